//! The experiments of the paper as data: the studies and runs that each needs.

use clap::ValueEnum;
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::trial::{ParameterValues, Task};
use serde::{Deserialize, Serialize};

use super::configuration::ExperimentConfiguration::{self, *};

/// An experiment of the paper, or beyond it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum PaperExperiment {
    /// Convergence of three tasks in the ideal simulation, beside random search
    Convergence,
    /// Studies of 20 trials in the hardware-like simulation
    HardwareLike,
    /// A jump that turns by more than a full turn
    HighTwist,
    /// Jumps in a row
    Continuous,
    /// Jumps over blocks, with and without Virtual Model Control
    RoughTerrain,
    /// Five directions: take-off angle, torque, power
    Directions,
    /// From the ideal to the hardware-like simulation
    Transfer,
    /// Beyond the paper: added terms for the landing
    Landing,
}

/// The tasks of the paper's Fig. 5.
pub const THREE_TASKS: [Task; 3] = [Task::Forward, Task::LateralLeft, Task::TwistCcw];
/// Trials of a study on the robot in the paper.
pub const PAPER_TRIALS: u32 = 20;
/// Frequencies between the impulses at which continuous jumping is run, Hz.
pub const F1_HZ: [f64; 6] = [0.6, 0.8, 1.0, 1.3, 1.6, 2.0];
/// Frequencies of the impulse at which the paper's best point runs, Hz: the text does not give that of the robot.
pub const PAPER_POINT_F0_HZ: [f64; 3] = [1.0, 1.25, 1.5];
/// Length of a run over the blocks, s: that of the paper's Fig. 9.
pub const ROUGH_S: f64 = 12.0;

/// Numbers of trials and seeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExperimentSize {
    /// First seed: studies have this one and the next ones, runs those from 100 above on.
    pub seed: u32,
    /// Seeds of each study.
    pub studies: u32,
    /// Trials of the studies of convergence.
    pub convergence_trials: u32,
    /// Trials of the studies of the high twist.
    pub twist_trials: u32,
    /// Trials of the studies in the hardware-like simulation.
    pub trials: u32,
    /// Trials of the studies of directions, of the transfer, of jumps in a row and of the landing.
    pub side_trials: u32,
    /// Seeds of continuous jumping.
    pub runs: u32,
    /// Seeds of the rough terrain.
    pub rough_runs: u32,
    /// Seeds of sensor noise of a transferred point.
    pub noise_runs: u32,
}

impl ExperimentSize {
    /// Returns the whole size, or the quick one.
    pub fn new(seed: u32, quick: bool) -> ExperimentSize {
        let whole = ExperimentSize {
            seed,
            studies: 5,
            convergence_trials: 100,
            twist_trials: 100,
            trials: PAPER_TRIALS,
            side_trials: PAPER_TRIALS,
            runs: 20,
            rough_runs: 50,
            noise_runs: 8,
        };
        let quick_size = ExperimentSize {
            studies: 2,
            convergence_trials: 30,
            twist_trials: 30,
            side_trials: 10,
            runs: 4,
            rough_runs: 8,
            noise_runs: 2,
            ..whole
        };
        if quick { quick_size } else { whole }
    }

    /// Returns this size with at most `trials` trials a study.
    pub fn at_most(self, trials: u32) -> ExperimentSize {
        ExperimentSize {
            convergence_trials: self.convergence_trials.min(trials),
            twist_trials: self.twist_trials.min(trials),
            trials: self.trials.min(trials),
            side_trials: self.side_trials.min(trials),
            ..self
        }
    }

    fn study_seeds(&self) -> impl Iterator<Item = u32> + use<> {
        let seed = self.seed;
        (0..self.studies).map(move |i| seed.saturating_add(i))
    }

    fn run_seeds(&self, count: u32) -> impl Iterator<Item = u32> + use<> {
        let seed = self.seed.saturating_add(100);
        (0..count).map(move |i| seed.saturating_add(i))
    }
}

/// A study to run: one task, one seed, no operator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudyJob {
    pub configuration: ExperimentConfiguration,
    pub task: Task,
    pub sampler: SamplerKind,
    pub seed: u32,
    pub trials: u32,
    /// Configuration of the study whose best of the first `side_trials` trials is this study's first point.
    pub warm: Option<ExperimentConfiguration>,
}

impl StudyJob {
    /// Whether the first trials of this study are those of `job`: a study does not depend on its budget.
    pub fn includes(&self, job: &StudyJob) -> bool {
        self.trials >= job.trials && *self == StudyJob { trials: self.trials, ..job.clone() }
    }
}

/// The point of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RunPoint {
    /// `[first.TASK]` of the configuration.
    First,
    /// The same with another frequency between impulses, Hz.
    FirstWithF1(f64),
    /// These values.
    Given(ParameterValues),
    /// The best of the first `side_trials` trials of the study with this configuration and seed.
    BestOf(ExperimentConfiguration, u32),
}

/// A run of one point, as of `quadfrog evaluate`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunJob {
    pub configuration: ExperimentConfiguration,
    pub task: Task,
    pub point: RunPoint,
    pub seed: u32,
    /// Virtual Model Control; none for that of the configuration.
    pub vmc: Option<bool>,
    /// Length, s; none for the number of jumps of the configuration.
    pub duration_s: Option<f64>,
}

/// One piece of work.
#[derive(Debug, Clone, PartialEq)]
pub enum ReproduceJob {
    Study(StudyJob),
    Run(RunJob),
}

impl ReproduceJob {
    /// Whether the job needs the result of another.
    pub fn depends(&self) -> bool {
        match self {
            ReproduceJob::Study(job) => job.warm.is_some(),
            ReproduceJob::Run(job) => matches!(job.point, RunPoint::BestOf(..)),
        }
    }

    /// Work in units of 25 ms of a desktop's core, for the order of the jobs and the time left.
    pub fn cost(&self) -> u64 {
        match self {
            ReproduceJob::Study(job) => u64::from(job.trials) * trial_cost(job.configuration),
            ReproduceJob::Run(job) => trial_cost(job.configuration),
        }
    }
}

/// Work of one trial of a configuration, measured: sensors, jumps in a row and terrain take longer.
pub fn trial_cost(configuration: ExperimentConfiguration) -> u64 {
    match configuration {
        Ideal | HighTwist | StableLanding => 2,
        HardwareLike | HardwareLikeEstimate | StableLandingEstimate => 5,
        ContinuousLateral => 6,
        Continuous | ContinuousLow | ContinuousFast | ContinuousTwist | RoughTerrain | RoughTerrainPaper
        | RoughTerrainFlat => 12,
    }
}

impl PaperExperiment {
    /// Returns the title in the report.
    pub fn title(self) -> &'static str {
        match self {
            PaperExperiment::Convergence => "Convergence in the ideal simulation",
            PaperExperiment::HardwareLike => "Twenty trials in the hardware-like simulation",
            PaperExperiment::HighTwist => "High twist",
            PaperExperiment::Continuous => "Continuous jumping",
            PaperExperiment::RoughTerrain => "Rough terrain with and without Virtual Model Control",
            PaperExperiment::Directions => "All directions: take-off, torque, power",
            PaperExperiment::Transfer => "From the ideal to the hardware-like simulation",
            PaperExperiment::Landing => "Beyond the paper: added terms for the landing",
        }
    }

    /// Returns the studies and runs of the experiment. Experiments share those that they have in common.
    pub fn jobs(self, size: &ExperimentSize) -> Vec<ReproduceJob> {
        let mut jobs = Vec::new();
        let studies = |jobs: &mut Vec<ReproduceJob>, configuration, tasks: &[Task], sampler, trials| {
            for (task, seed) in tasks.iter().flat_map(|&task| size.study_seeds().map(move |seed| (task, seed))) {
                jobs.push(ReproduceJob::Study(StudyJob { configuration, task, sampler, seed, trials, warm: None }));
            }
        };
        let run =
            |configuration, task, point, seed| RunJob { configuration, task, point, seed, vmc: None, duration_s: None };
        match self {
            PaperExperiment::Convergence => {
                for sampler in [SamplerKind::Tpe, SamplerKind::Random] {
                    studies(&mut jobs, Ideal, &THREE_TASKS, sampler, size.convergence_trials);
                }
            }
            PaperExperiment::HardwareLike => {
                for configuration in [HardwareLike, HardwareLikeEstimate] {
                    studies(&mut jobs, configuration, &THREE_TASKS, SamplerKind::Tpe, size.trials);
                }
                studies(&mut jobs, Ideal, &THREE_TASKS, SamplerKind::Tpe, size.trials);
                for f0_hz in PAPER_POINT_F0_HZ {
                    let values = [("f0", f0_hz), ("Fx", 140.0), ("Fz", 239.0)];
                    let point: ParameterValues =
                        values.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
                    jobs.extend(size.run_seeds(size.noise_runs).map(|seed| {
                        ReproduceJob::Run(run(HardwareLike, Task::Forward, RunPoint::Given(point.clone()), seed))
                    }));
                }
            }
            PaperExperiment::HighTwist => {
                studies(&mut jobs, HighTwist, &[Task::TwistCcw], SamplerKind::Tpe, size.twist_trials);
            }
            PaperExperiment::Continuous => {
                let low = F1_HZ.map(|f1_hz| (ContinuousLow, RunPoint::FirstWithF1(f1_hz)));
                let points = std::iter::once((Continuous, RunPoint::First)).chain(low);
                jobs.extend(points.flat_map(|(configuration, point)| {
                    size.run_seeds(size.runs)
                        .map(move |seed| ReproduceJob::Run(run(configuration, Task::Forward, point.clone(), seed)))
                }));
                for (configuration, task) in [(ContinuousFast, Task::Forward), (ContinuousTwist, Task::TwistCcw)] {
                    let seeds = size.run_seeds(size.runs);
                    jobs.extend(seeds.map(|seed| ReproduceJob::Run(run(configuration, task, RunPoint::First, seed))));
                }
                studies(&mut jobs, ContinuousLateral, &[Task::LateralLeft], SamplerKind::Tpe, size.side_trials);
            }
            PaperExperiment::RoughTerrain => {
                for (configuration, vmc) in
                    [(RoughTerrain, true), (RoughTerrain, false), (RoughTerrainPaper, true), (RoughTerrainPaper, false)]
                {
                    jobs.extend(size.run_seeds(size.rough_runs).map(|seed| {
                        let run = run(configuration, Task::Forward, RunPoint::First, seed);
                        ReproduceJob::Run(RunJob { vmc: Some(vmc), duration_s: Some(ROUGH_S), ..run })
                    }));
                }
                let flat = run(RoughTerrainFlat, Task::Forward, RunPoint::First, size.seed.saturating_add(100));
                jobs.push(ReproduceJob::Run(RunJob { vmc: Some(true), duration_s: Some(ROUGH_S), ..flat }));
            }
            PaperExperiment::Directions => {
                for configuration in [Ideal, HardwareLike] {
                    studies(&mut jobs, configuration, &Task::ALL, SamplerKind::Tpe, size.side_trials);
                }
            }
            PaperExperiment::Transfer => {
                for configuration in [Ideal, HardwareLike] {
                    studies(&mut jobs, configuration, &THREE_TASKS, SamplerKind::Tpe, size.side_trials);
                }
                for (task, seed) in
                    THREE_TASKS.iter().flat_map(|&task| size.study_seeds().map(move |seed| (task, seed)))
                {
                    jobs.push(ReproduceJob::Study(StudyJob {
                        configuration: HardwareLike,
                        task,
                        sampler: SamplerKind::Tpe,
                        seed,
                        trials: size.side_trials,
                        warm: Some(Ideal),
                    }));
                    jobs.extend(
                        size.run_seeds(size.noise_runs).map(|noise| {
                            ReproduceJob::Run(run(HardwareLike, task, RunPoint::BestOf(Ideal, seed), noise))
                        }),
                    );
                }
            }
            PaperExperiment::Landing => {
                for configuration in [Ideal, StableLanding, HardwareLikeEstimate, StableLandingEstimate] {
                    studies(&mut jobs, configuration, &THREE_TASKS, SamplerKind::Tpe, size.side_trials);
                }
            }
        }
        jobs
    }
}

/// Returns the jobs of several experiments, each once: a study that two need has the greater number of trials.
pub fn all_jobs(experiments: &[PaperExperiment], size: &ExperimentSize) -> Vec<ReproduceJob> {
    let mut jobs: Vec<ReproduceJob> = Vec::new();
    for job in experiments.iter().flat_map(|experiment| experiment.jobs(size)) {
        let known = jobs.iter_mut().find(|known| match (&**known, &job) {
            (ReproduceJob::Study(known), ReproduceJob::Study(job)) => {
                *known == StudyJob { trials: known.trials, ..job.clone() }
            }
            (known, job) => known == job,
        });
        match (known, job) {
            (Some(ReproduceJob::Study(known)), ReproduceJob::Study(job)) => known.trials = known.trials.max(job.trials),
            (Some(_), _) => {}
            (None, job) => jobs.push(job),
        }
    }
    jobs
}
