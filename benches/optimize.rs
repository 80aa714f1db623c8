//! Time of one ask and of a whole study on disk.

#[path = "../tests/support/optimize.rs"]
mod support;

#[path = "../tests/support/simulated.rs"]
mod simulated;

use criterion::{Criterion, criterion_group, criterion_main};
use quadfrog::optimize::ask::{SamplerConfig, SamplerKind};
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::prior::PriorModel;
use quadfrog::optimize::study::{Storage, Study, StudyOptions};
use simulated::{Formula, prior_of, space};
use std::hint::black_box;
use std::sync::Arc;
use support::{in_memory, sideways};

fn options(sampler: SamplerConfig) -> StudyOptions {
    support::options(sideways(), sampler)
}

/// A study with `trials` finished trials of a smooth objective, at points of the random sampler, which is fast.
fn history(sampler: SamplerConfig, trials: u32) -> Study {
    let random = SamplerConfig { kind: SamplerKind::Random, ..SamplerConfig::default() };
    let (mut points, mut study) = (in_memory(options(random)), in_memory(options(sampler)));
    for _ in 0..trials {
        let number = support::run(&mut points, |_| 0.0);
        study.enqueue(&points.trial(number).expect("begun").parameters, &[]).expect("queued");
        run(&mut study);
    }
    study
}

fn run(study: &mut Study) {
    let space = sideways();
    let u = |(name, value): &(String, f64)| space.range(name).expect("a parameter").scale(*value) - 0.4;
    support::run(study, |parameters| -parameters.iter().map(|p| u(p) * u(p)).sum::<f64>());
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

/// One ask about a prior of eight worlds and 320 points, and the preparation of such a prior.
fn ask_sim(c: &mut Criterion) {
    let worlds: Vec<Formula> = (0..8)
        .map(|k| Formula {
            gain: 0.9 + 0.04 * f64::from(k),
            best: 0.4 + 0.03 * f64::from(k),
            grip: 0.58 - 0.02 * f64::from(k),
        })
        .collect();
    let mut group = c.benchmark_group("sim, 8 worlds of 320 points");
    group.sample_size(10);
    group.bench_function("hyperparameters", |b| {
        b.iter(|| prior_of(&worlds, 320).fit().expect("a prior"));
    });
    let mut prior = prior_of(&worlds, 320);
    prior.fit().expect("a prior");
    group.bench_function("model of a fitted prior", |b| b.iter(|| black_box(PriorModel::new(prior.clone()))));
    let prior = Arc::new(PriorModel::new(prior));
    for trials in [0, 5, 20, 100] {
        let sampler = SamplerConfig { kind: SamplerKind::Sobol, ..SamplerConfig::default() };
        let mut points = in_memory(support::options(space(), sampler));
        let sampler = SamplerConfig { kind: SamplerKind::Sim, ..SamplerConfig::default() };
        let mut study = in_memory(support::options(space(), sampler));
        for _ in 0..trials {
            let number = support::run(&mut points, |_| 0.0);
            study.enqueue(&points.trial(number).expect("begun").parameters, &[]).expect("queued");
            simulated::jump(&mut study, &worlds[3]);
        }
        study.use_prior(prior.clone());
        group.bench_function(format!("ask, {trials} trials"), |b| b.iter(|| black_box(study.draft())));
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
                let options = StudyOptions { durability, ..options(SamplerConfig::default()) };
                let mut study = Study::open(storage, options).expect("opens");
                for _ in 0..20 {
                    run(&mut study);
                }
            });
        });
    }
    let _ = std::fs::remove_dir_all(&folder);
}

criterion_group!(benches, ask, ask_sim, study_on_disk);
criterion_main!(benches);
