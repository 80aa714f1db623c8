//! Scratch.
use quadfrog::sim::bench::*;
fn main() {
    let s = Speed::new();
    let a: Vec<String> = std::env::args().collect();
    let n: u32 = a[2].parse().unwrap();
    match a[1].as_str() {
        "dyn" => {
            let mut d = s.dynamics();
            for _ in 0..n {
                d.run();
            }
        }
        "all" => {
            for sc in Scene::ALL {
                let mut r = s.scene(sc);
                let mut m = vec![];
                for _ in 0..500 {
                    r.step();
                    m.push(r.contacts());
                }
                println!("{} {:?}", sc.name(), &m[490..]);
            }
            for _ in 0..n {
                let f = s.measure(2.0);
                println!("dyn {:.3} us; steps {:?} us", f.dynamics_s * 1e6, f.step_s.map(|x| (x * 1e9).round() / 1e3));
            }
        }
        k => {
            let mut r = s.scene(Scene::ALL[k.parse::<usize>().unwrap()]);
            for _ in 0..n {
                r.step();
            }
        }
    }
}
