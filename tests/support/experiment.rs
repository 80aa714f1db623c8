//! A study without a robot: the length of a jump is a function of its parameters.
#![allow(dead_code, reason = "each test uses its own part")]

use std::path::Path;
use std::time::Duration;

use quadfrog::control::settings::TaskControl;
use quadfrog::optimize::ask::{Direction, SamplerConfig};
use quadfrog::optimize::exchange::TableTrial;
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Storage, Study, StudyOptions};
use quadfrog::optimize::trial::TrialState;
use quadfrog::session::experiment::{Experiment, ExperimentPlan};
use quadfrog::telemetry::{Cutoff, Tick, TrialEnd, TrialSpec};
use quadfrog::trial::{Backend, BounceRule, ExperimentStage, ParameterInfo, Task, Verdict};

pub const BOUNDS: [(&str, f64, f64); 3] = [("f0", 0.75, 1.75), ("Fx", 0.0, 150.0), ("Fz", 150.0, 350.0)];

pub fn study(storage: Storage) -> Study {
    let ranges = BOUNDS.map(|(name, low, high)| (name.to_owned(), Range::linear(low, high)));
    Study::open(
        storage,
        StudyOptions {
            name: "test".into(),
            direction: Direction::Maximize,
            metric: "J (m)".into(),
            space: Space::new(ranges).unwrap(),
            sampler: SamplerConfig { startup_trials: Some(3), ..SamplerConfig::default() },
            attributes: Vec::new(),
            durability: Durability::Buffered,
        },
    )
    .unwrap()
}

pub fn plan(budget: u32) -> ExperimentPlan {
    ExperimentPlan {
        needs_prior: false,
        task: Task::Forward,
        control: TaskControl {
            kp: 400.0,
            kd: 8.0,
            kd_joint: 0.8,
            k_att: 200.0,
            stance_m: [0.0, 0.14, -0.25],
            vmc: true,
            attitude_rate_gain: 0.0,
            foot_placement_s: 0.0,
            cutoff: Cutoff::None,
            cutoff_lost_s: 0.02,
            landing_spread_m: 0.0,
            landing_spread_s: 0.3,
            jumps: 1,
            f1_hz: 0.0,
            duration_s: None,
            landing_wait_s: 0.0,
            bounce: BounceRule::Ignore,
            rate: false,
            repeats: 1,
        },
        parameters: bounds(|low, high| (low, high)),
        seed: 0,
        budget,
        recording: String::new(),
        widest: bounds(|low, high| (0.5 * low, 2.0 * high)),
        gains: [("kp", 100.0, 1000.0), ("kd", 2.0, 30.0), ("kd_joint", 0.1, 3.0), ("k_att", 0.0, 500.0)]
            .map(|(name, low, high)| ParameterInfo { name: name.into(), unit: "N/m".into(), low, high })
            .to_vec(),
        contenders: 3,
        confidence: 0.95,
        worker: 0,
        abandoned: Duration::from_secs(60),
        backend: Backend::Simulator,
        terrain: None,
        envelope: None,
    }
}

pub fn bounds(of: impl Fn(f64, f64) -> (f64, f64)) -> Vec<ParameterInfo> {
    let info = |(name, low, high): (&str, f64, f64)| {
        let (low, high) = of(low, high);
        ParameterInfo { name: name.into(), unit: "N".into(), low, high }
    };
    BOUNDS.map(info).to_vec()
}

pub fn experiment(budget: u32) -> Experiment {
    Experiment::open(plan(budget), study(Storage::Memory)).unwrap()
}

/// Length of a jump, m: a smooth function of the parameters.
pub fn far(spec: &TrialSpec) -> f64 {
    let (f, x, z) = (spec.jump.f0_hz - 1.2, spec.jump.fx_n / 150.0 - 0.7, spec.jump.fz_n / 350.0 - 0.6);
    0.7 - f * f - x * x - z * z
}

/// The ticks of a trial that ends `dx_m` in front of its start.
pub fn ticks(trial: u32, dx_m: f64) -> Vec<Tick> {
    [0.0, dx_m]
        .map(|x| {
            let mut tick = Tick { trial: Some(trial), ..Tick::default() };
            tick.estimate.position_world.x = x;
            tick
        })
        .to_vec()
}

pub fn approve(experiment: &mut Experiment) -> TrialSpec {
    let proposal = experiment.proposal().expect("a proposal");
    experiment.approve(proposal.trial, proposal.revision).unwrap()
}

pub fn skip(experiment: &mut Experiment) {
    let proposal = experiment.proposal().expect("a proposal");
    experiment.skip(proposal.trial, proposal.revision).unwrap();
}

/// Approves the proposal and ends its trial with `end`, up to the review.
pub fn run(experiment: &mut Experiment, end: TrialEnd) -> TrialSpec {
    let spec = approve(experiment);
    experiment.ended(spec.trial, &end, &ticks(spec.trial, far(&spec)), 2);
    assert_eq!(experiment.stage(), ExperimentStage::Review);
    spec
}

pub fn accept(experiment: &mut Experiment) -> TrialSpec {
    let spec = run(experiment, TrialEnd::Settled);
    experiment.judge(Verdict::Accept, false).unwrap();
    spec
}

pub fn parameters(experiment: &Experiment) -> Vec<f64> {
    experiment.proposal().unwrap().parameters.iter().map(|p| p.value).collect()
}

/// Returns a row of a table to import: a trial that stood, with values of [`BOUNDS`] and its objective.
pub fn imported(values: [f64; 3], value: f64) -> TableTrial {
    TableTrial {
        state: TrialState::Complete,
        value: Some(value),
        parameters: BOUNDS.map(|(name, ..)| name.to_owned()).into_iter().zip(values).collect(),
        attributes: serde_json::Map::new(),
        started: None,
        completed: None,
        note: String::new(),
    }
}

/// Returns the study in `folder`, as another program reads it.
pub fn study_in(folder: &Path) -> Study {
    study(Storage::File(folder.join("study.log")))
}

/// Calls `act` while the journal in `folder` can be neither read nor written.
pub fn without_journal<T>(folder: &Path, act: impl FnOnce() -> T) -> T {
    let (journal, aside) = (folder.join("study.log"), folder.join("aside.log"));
    std::fs::rename(&journal, &aside).unwrap();
    std::fs::create_dir(&journal).unwrap();
    let result = act();
    std::fs::remove_dir(&journal).unwrap();
    std::fs::rename(&aside, &journal).unwrap();
    result
}

/// Opens the study in `folder` as a session does.
pub fn open(folder: &Path) -> Experiment {
    Experiment::open(plan(1000), study_in(folder)).unwrap()
}

/// Joins the study in `folder` as one more worker; see [`ExperimentPlan::abandoned`].
pub fn joined(folder: &Path, budget: u32, abandoned: Duration) -> Experiment {
    let mut study = study_in(folder);
    let worker = study.join().unwrap();
    Experiment::open(ExperimentPlan { worker, abandoned, ..plan(budget) }, study).unwrap()
}
