//! Studies of a sampler on a robot, and the ability of a robot.

use std::collections::BTreeMap;
use std::sync::Arc;

use quadfrog::optimize::ask::{Direction, SamplerConfig, SamplerKind};
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::prior::PriorModel;
use quadfrog::optimize::space::Space;
use quadfrog::optimize::study::{Outcome, Storage, Study, StudyOptions};
use quadfrog::optimize::trial::{FALL, VERDICT};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::evaluation::evaluate;
use quadfrog::session::prior::PriorPlan;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::ensemble::RobotProperties;
use quadfrog::sim::{SimConfig, Simulator};
use quadfrog::telemetry::TrialSpec;
use quadfrog::trial::{JumpParameters, ParameterValues};

use super::statistics::mean;

/// Repetitions of the best trial.
pub(super) const REPEATS: u64 = 4;
/// Numbers of jumps after which a study is judged.
pub(super) const AFTER: [usize; 5] = [1, 3, 5, 10, 20];
/// Jumps within which a good point is to be jumped.
pub(super) const EARLY: usize = 5;
/// Trials of the long studies of each robot.
pub(super) const LONG: usize = 100;
/// Their samplers.
pub(super) const LONG_PROPOSERS: [Proposer; 2] = [Proposer::Gp, Proposer::Sim];
/// The first of their seeds, which no other study has.
pub(super) const LONG_SEED: u32 = 900;
/// Points of which the optimum is chosen.
const SHORTLIST: usize = 10;
/// Repetitions by which it is chosen, and as many others by which it is valued.
pub(super) const OPTIMUM_REPEATS: u64 = 16;
/// Share of the optimum that counts as reached.
pub(super) const REACHED: f64 = 0.95;
/// Share of it below which the jump of a study, and then a few repetitions, tell that its point is not worth more of them.
pub(super) const NEAR: f64 = 0.8;

/// Source of the jumps of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Proposer {
    /// The sampler about the ensemble.
    Sim,
    /// The same with the ensemble's results at the mirrored points: a wrong simulator.
    SimMirrored,
    Gp,
    Tpe,
    /// First the best point of the configured simulator, then `gp`.
    IdealFirst,
}

impl Proposer {
    pub(super) const ALL: [(&'static str, Proposer); 5] = [
        ("sim", Proposer::Sim),
        ("sim-mirrored", Proposer::SimMirrored),
        ("gp", Proposer::Gp),
        ("tpe", Proposer::Tpe),
        ("ideal-first", Proposer::IdealFirst),
    ];

    pub(super) fn named(name: &str) -> Proposer {
        let known = Proposer::ALL.iter().find(|(known, _)| *known == name);
        let names = Proposer::ALL.map(|(name, _)| name).join(", ");
        known.unwrap_or_else(|| panic!("`{name}` is no sampler; give {names}, with commas between them")).1
    }

    pub(super) fn name(self) -> &'static str {
        Proposer::ALL.iter().find(|(_, proposer)| *proposer == self).map_or("", |(name, _)| name)
    }

    pub(super) fn kind(self) -> SamplerKind {
        match self {
            Proposer::Sim | Proposer::SimMirrored => SamplerKind::Sim,
            Proposer::Gp | Proposer::IdealFirst => SamplerKind::Gp,
            Proposer::Tpe => SamplerKind::Tpe,
        }
    }
}

/// A task with what is known of it before the first jump.
pub(super) struct KnownTask {
    pub(super) name: String,
    pub(super) plan: PriorPlan,
    pub(super) sampler: SamplerConfig,
    pub(super) space: Space,
    pub(super) prior: Arc<PriorModel>,
    pub(super) mirrored: Arc<PriorModel>,
    pub(super) ideal_best: Vec<(String, f64)>,
}

/// A robot that jumps.
pub(super) struct Target {
    pub(super) name: String,
    pub(super) properties: RobotProperties,
}

/// A study of one proposer on one robot.
#[derive(Clone, Copy)]
pub(super) struct Job {
    pub(super) target: usize,
    pub(super) proposer: Proposer,
    pub(super) study: u32,
    pub(super) trials: usize,
    /// Whether it tells of the robot, not of the proposer: one of [`LONG`] trials.
    pub(super) is_long: bool,
}

/// Repeated best values and falls so far after [`AFTER`] jumps, the points of the first [`EARLY`] jumps that stood with the values of
/// these jumps, and the best point in the end.
#[derive(Debug, Clone)]
pub(super) struct StudyResult {
    pub(super) best: [f64; AFTER.len()],
    pub(super) falls: [f64; AFTER.len()],
    pub(super) early: Vec<(Vec<(String, f64)>, f64)>,
    pub(super) point: Vec<(String, f64)>,
}

/// Ability of a robot, as far as it is known.
pub(super) struct Attainable {
    /// Value of its best known point.
    pub(super) optimum: f64,
    /// Value that 100 jumps find: that of the better one of the points that the long studies of a seed call their best, mean over
    /// the seeds, because what one study happens to find differs by a third of its value.
    pub(super) long: f64,
}

/// Jumps of one robot, with noise of its own for each.
pub(super) struct Jumper<'a> {
    pub(super) task: &'a KnownTask,
    pub(super) rollout: Rollout<Simulator>,
}

impl<'a> Jumper<'a> {
    pub(super) fn new(task: &'a KnownTask, (robot, simulator): (RobotDescription, SimConfig)) -> Jumper<'a> {
        let simulator = Simulator::new(&robot, &simulator).expect("the robot can be simulated");
        Jumper { task, rollout: Rollout::new(simulator, &task.plan.settings) }
    }

    /// The objective of a jump that stands; none for a fall.
    pub(super) fn jump(&mut self, point: &[(String, f64)], seed: u64) -> Option<f64> {
        let control = &self.task.plan.control;
        let values: ParameterValues = point.iter().cloned().collect();
        let spec = control.trial(self.task.plan.task, JumpParameters::from_values(&values, control.f1_hz));
        let run = evaluate(&mut self.rollout, &TrialSpec { gains: control.gains().with(&values), seed, ..spec });
        run.stood().then_some(run.value)
    }

    /// Mean of `count` jumps at a point, falls as 0.
    pub(super) fn repeated(&mut self, point: &[(String, f64)], seed: u64, count: u64) -> f64 {
        (0..count).map(|i| self.jump(point, seed + i).unwrap_or(0.0)).sum::<f64>() / count as f64
    }

    /// Whether the mean of [`OPTIMUM_REPEATS`] jumps at a point is `wanted` or more. A quarter of them with less than [`NEAR`] of it
    /// decide already, which a single fall among four does.
    pub(super) fn reaches(&mut self, point: &[(String, f64)], seed: u64, wanted: f64) -> bool {
        let (few, all) = (OPTIMUM_REPEATS / 4, OPTIMUM_REPEATS);
        let first = self.repeated(point, seed, few);
        let mut rest = || self.repeated(point, seed + few, all - few);
        first >= NEAR * wanted && (few as f64 * first + (all - few) as f64 * rest()) / all as f64 >= wanted
    }
}

pub(super) fn new_study(task: &KnownTask, proposer: Proposer, seed: u32) -> Study {
    let sampler = SamplerConfig { kind: proposer.kind(), seed, ..task.sampler.clone() };
    let options = StudyOptions {
        name: proposer.name().to_owned(),
        direction: Direction::Maximize,
        metric: "J".to_owned(),
        space: task.space.clone(),
        sampler,
        attributes: Vec::new(),
        durability: Durability::Buffered,
    };
    let mut study = Study::open(Storage::Memory, options).expect("opens in memory");
    match proposer {
        Proposer::Sim => study.use_prior(task.prior.clone()),
        Proposer::SimMirrored => study.use_prior(task.mirrored.clone()),
        Proposer::IdealFirst => drop(study.enqueue(&task.ideal_best, &[]).expect("within the bounds")),
        Proposer::Gp | Proposer::Tpe => {}
    }
    study
}

/// Runs one more jump; returns its value if the robot stood.
pub(super) fn one_jump(study: &mut Study, jumper: &mut Jumper<'_>, seed: u64) -> Option<f64> {
    let draft = study.draft();
    let point = draft.point();
    let number = study.begin(&draft, &[], &[]).expect("begins");
    let value = jumper.jump(&point, seed);
    if value.is_none() {
        study.annotate(number, &[(VERDICT.into(), FALL.into())]).expect("running");
    }
    study.tell(number, Outcome::Complete(value.unwrap_or(0.0))).expect("reported");
    value
}

/// Number of the trial that the study calls its best.
pub(super) fn best_of(study: &Study) -> Option<u32> {
    study.predict().best.map(|best| best.trial).or_else(|| study.best().map(|best| best.number))
}

pub(super) fn run(task: &KnownTask, targets: &[Target], seed: u64, job: &Job) -> StudyResult {
    let target = &targets[job.target];
    let mut jumper = Jumper::new(task, target.properties.apply(&task.plan.robot, &task.plan.simulator));
    let mut study = new_study(task, job.proposer, job.study);
    let (best, falls) = ([0.0; AFTER.len()], [0.0; AFTER.len()]);
    let mut result = StudyResult { best, falls, early: Vec::new(), point: Vec::new() };
    // The same noise for all proposers.
    let noise = seed * 1_000_000 + u64::from(job.study) * 10_000 + job.target as u64 * 100_000_000;
    let (mut falls, mut known): (f64, BTreeMap<u32, f64>) = (0.0, BTreeMap::new());
    for trial in 1..=job.trials {
        match one_jump(&mut study, &mut jumper, noise + trial as u64) {
            Some(value) if trial <= EARLY => result.early.push((study.trials()[trial - 1].parameters.clone(), value)),
            Some(_) => {}
            None => falls += 1.0,
        }
        let after = AFTER.iter().position(|after| *after == trial);
        let Some(index) = after.or((trial == job.trials).then_some(AFTER.len() - 1)) else { continue };
        if let Some(number) = best_of(&study) {
            result.point.clone_from(&study.trials()[number as usize].parameters);
            let repeated = || jumper.repeated(&result.point, noise + 1_000, REPEATS);
            result.best[index..].fill(*known.entry(number).or_insert_with(repeated));
        }
        result.falls[index..].fill(falls);
    }
    result
}

/// Values a robot by all its results and those of its long studies, which are in the order of their seeds. For the optimum the best
/// points of the [`SHORTLIST`] studies of the largest values are repeated with new noise; the largest mean chooses one, and repeats
/// with again other noise are its value.
pub(super) fn attainable(
    jumper: &mut Jumper<'_>,
    noise: u64,
    results: &[&StudyResult],
    long: &[&StudyResult],
) -> Attainable {
    let mut ranked: Vec<&StudyResult> = results.iter().copied().filter(|result| !result.point.is_empty()).collect();
    let value = |result: &StudyResult| result.best[AFTER.len() - 1];
    ranked.sort_by(|a, b| value(b).total_cmp(&value(a)));
    ranked.truncate(SHORTLIST);
    let valued = ranked.iter().map(|result| (jumper.repeated(&result.point, noise, OPTIMUM_REPEATS), &result.point));
    let chosen = valued.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, point)| point);
    let mut again = |point: &Vec<_>| jumper.repeated(point, noise + OPTIMUM_REPEATS, OPTIMUM_REPEATS);
    let optimum = chosen.map_or(0.0, &mut again);
    let mut found = |result: &&StudyResult| if result.point.is_empty() { 0.0 } else { again(&result.point) };
    let of_seeds = long.chunks(LONG_PROPOSERS.len());
    let bests: Vec<f64> = of_seeds.map(|of_seed| of_seed.iter().map(&mut found).fold(0.0, f64::max)).collect();
    Attainable { optimum, long: mean(&bests).0 }
}
