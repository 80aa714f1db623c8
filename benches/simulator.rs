//! Duration of the dynamics alone and of a step by number of contacts and of blocks: `cargo bench --bench simulator`. The counterpart in
//! MuJoCo is `mj_step` on the same model and machine.

use criterion::{Criterion, criterion_group, criterion_main};
use quadfrog::sim::bench::{BLOCK_COUNTS, BenchScene, SimulatorBench};

fn benches(criterion: &mut Criterion) {
    let speed = SimulatorBench::new();
    criterion.bench_function("dynamics: accelerations from torques", |b| {
        let mut dynamics = speed.dynamics();
        b.iter(|| dynamics.run());
    });
    for scene in BenchScene::ALL {
        criterion.bench_function(&format!("1 ms step, {}", scene.name()), |b| {
            let mut stand = speed.scene(scene);
            b.iter(|| stand.step());
        });
    }
    for count in BLOCK_COUNTS {
        criterion.bench_function(&format!("1 ms step, standing on {count} blocks"), |b| {
            let mut stand = speed.blocks(count);
            b.iter(|| stand.step());
        });
    }
}

criterion_group!(simulator, benches);
criterion_main!(simulator);
