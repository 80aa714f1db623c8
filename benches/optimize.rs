//! Time of one ask and of a whole study on disk.

use criterion::{Criterion, criterion_group, criterion_main};
use quadfrog::optimize::ask::{Direction, SamplerConfig, SamplerKind};
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Outcome, Storage, Study, StudyOptions, SuggestedParameter};
use std::hint::black_box;

fn options(sampler: SamplerConfig, durability: Durability) -> StudyOptions {
    let ranges = [("f0", 0.75, 1.75), ("Fx", 0.0, 150.0), ("Fy", 0.0, 150.0), ("Fz", 150.0, 350.0)];
    StudyOptions {
        name: "bench".into(),
        direction: Direction::Maximize,
        metric: "value".into(),
        space: Space::new(ranges.map(|(n, low, high)| (n.to_owned(), Range::linear(low, high)))).expect("a space"),
        sampler,
        attributes: Vec::new(),
        durability,
    }
}

/// A study with `trials` finished trials of a smooth objective, at points of the random sampler, which is fast.
fn history(sampler: SamplerConfig, trials: u32) -> Study {
    let random = SamplerConfig { kind: SamplerKind::Random, ..SamplerConfig::default() };
    let mut points = Study::open(Storage::Memory, options(random, Durability::Buffered)).expect("memory");
    let mut study = Study::open(Storage::Memory, options(sampler, Durability::Buffered)).expect("memory");
    for _ in 0..trials {
        let draft = points.draft();
        let number = points.begin(&draft, &[], &[]).expect("begins");
        let point: Vec<_> = points.trial(number).expect("begun").parameters.clone();
        points.tell(number, Outcome::Complete(0.0)).expect("running");
        study.enqueue(&point, &[]).expect("queued");
        run(&mut study);
    }
    study
}

fn run(study: &mut Study) {
    let draft = study.draft();
    let number = study.begin(&draft, &[], &[]).expect("begins");
    let u = |s: &SuggestedParameter| (s.value - s.low) / (s.high - s.low) - 0.4;
    let value = -draft.parameters.iter().map(|s| u(s) * u(s)).sum::<f64>();
    study.tell(number, Outcome::Complete(value)).expect("running");
}

fn ask(c: &mut Criterion) {
    let mut group = c.benchmark_group("ask, 4 parameters");
    for multivariate in [true, false] {
        for trials in [20, 200, 1000] {
            let study = history(SamplerConfig { multivariate, ..SamplerConfig::default() }, trials);
            let mode = if multivariate { "multivariate" } else { "univariate" };
            group.bench_function(format!("tpe {mode}, {trials} trials"), |b| b.iter(|| black_box(study.draft())));
        }
    }
    // The cost of the fit grows with the cube of the number of trials; the sampler is intended for some tens.
    group.sample_size(10);
    for trials in [20, 50, 200] {
        let study = history(SamplerConfig { kind: SamplerKind::Gp, ..SamplerConfig::default() }, trials);
        group.bench_function(format!("gp, {trials} trials"), |b| b.iter(|| black_box(study.draft())));
    }
}

fn study_on_disk(c: &mut Criterion) {
    let mut group = c.benchmark_group("study of 20 trials on disk");
    group.sample_size(10);
    let folder = std::env::temp_dir().join(format!("quadfrog-bench-{}", std::process::id()));
    for durability in [Durability::Synced, Durability::Buffered] {
        let path = folder.join("study.log");
        group.bench_function(format!("{durability:?}"), |b| {
            b.iter(|| {
                let _ = std::fs::remove_file(&path);
                let storage = Storage::File(path.clone());
                let mut study = Study::open(storage, options(SamplerConfig::default(), durability)).expect("opens");
                for _ in 0..20 {
                    run(&mut study);
                }
            });
        });
    }
    let _ = std::fs::remove_dir_all(&folder);
}

criterion_group!(benches, ask, study_on_disk);
criterion_main!(benches);
