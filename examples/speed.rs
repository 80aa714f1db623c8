use quadfrog::sim::bench::*;
fn main() {
    let s = Speed::new();
    for sc in Scene::ALL {
        let mut r = s.scene(sc);
        let mut m = vec![];
        for _ in 0..500 {
            r.step();
            m.push(r.contacts());
        }
        println!("{} {:?}", sc.name(), &m[490..]);
    }
    for _ in 0..3 {
        let f = s.measure(2.0);
        println!("dyn {:.3} us; steps {:?} us", f.dynamics_s * 1e6, f.step_s.map(|x| (x * 1e9).round() / 1e3));
    }
}
