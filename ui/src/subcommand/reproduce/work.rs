//! Execution of the jobs: studies as of `quadfrog optimize`, runs as of `quadfrog evaluate`, with the same bits.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use quadfrog::config::Config;
use quadfrog::engine::{self, EngineError, Options};
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::optimize::journal::Durability;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::evaluation::evaluate;
use quadfrog::session::rollout::Rollout;
use quadfrog::session::{automatic, effort::effort};
use quadfrog::sim::Simulator;
use quadfrog::telemetry::{Tick, TrialSpec};
use quadfrog::trial::{Approval, Backend, JumpParameters, ParameterValues, Task};

use super::configuration::ExperimentConfiguration;
use super::plan::{ReproduceJob, RunJob, RunPoint, StudyJob};
use super::results::{RunResult, StudyResult, TrialResult, TrialTrace};
use crate::subcommand::failure::Failure;

/// Ticks from one sample of a trace to the next.
const TRACE_STEP: usize = 20;

/// Result of a job.
pub enum JobResult {
    Study(StudyResult),
    Run(Box<RunResult>),
}

/// The robot, the configurations, and the studies that are complete already.
pub struct Workplace {
    pub robot: RobotDescription,
    configurations: BTreeMap<ExperimentConfiguration, Config>,
    /// Trials of a study whose best is used elsewhere: the study may be longer for another experiment.
    side_trials: u32,
}

impl Workplace {
    /// Loads what `jobs` need.
    ///
    /// # Errors
    /// When a configuration does not fit the defaults or the robot.
    pub fn new(robot: RobotDescription, jobs: &[ReproduceJob], side_trials: u32) -> Result<Workplace, Failure> {
        let mut configurations = BTreeMap::new();
        for job in jobs {
            let configuration = match job {
                ReproduceJob::Study(job) => job.configuration,
                ReproduceJob::Run(job) => job.configuration,
            };
            if let Entry::Vacant(unknown) = configurations.entry(configuration) {
                unknown.insert(configuration.load()?);
            }
        }
        Ok(Workplace { robot, configurations, side_trials })
    }

    /// Runs one job; `studies` has the complete studies, `progress` receives each trial's share of the work.
    pub fn run(
        &self,
        job: &ReproduceJob,
        studies: &[StudyResult],
        progress: impl Fn(u64),
    ) -> Result<JobResult, Failure> {
        match job {
            ReproduceJob::Study(job) => self.study(job, studies, progress).map(JobResult::Study),
            ReproduceJob::Run(run) => {
                let result = self.evaluate(run, studies).map(|(result, _)| JobResult::Run(Box::new(result)));
                progress(job.cost());
                result
            }
        }
    }

    fn study(&self, job: &StudyJob, studies: &[StudyResult], progress: impl Fn(u64)) -> Result<StudyResult, Failure> {
        let mut config = self.configurations[&job.configuration].clone();
        config.choose_sampler(job.sampler);
        if let Some(point) = job.warm.and_then(|warm| self.best_of(studies, warm, job.task, job.seed)) {
            config.optimize.first.insert(job.task.name().to_owned(), point.iter().cloned().collect());
        }
        let mut rollout = self.rollout(&config, job.task)?;
        let options = Options {
            seed: job.seed,
            trials: Some(job.trials),
            approve: Approval::Auto,
            ..Options::new(config, self.robot.clone(), Backend::Simulator, job.task)
        };
        let mut experiment = engine::open_experiment(&options, Durability::Buffered, "")?;
        let mut trials = Vec::new();
        let share = super::plan::trial_cost(job.configuration);
        let ran = automatic::run(&mut experiment, &mut rollout, |row, ticks| {
            trials.push(TrialResult {
                trial: row.trial,
                params: row.parameters.clone(),
                value: row.value,
                verdict: row.verdict,
                cause: row.cause.clone(),
                measured: row.measured.clone(),
                effort: effort(ticks),
            });
            progress(share);
        });
        ran.map_err(|refusal| {
            let (name, task) = (job.configuration.name(), job.task.name());
            Failure::Other(anyhow::anyhow!("{name}, {task}, seed {}: {refusal}", job.seed))
        })?;
        Ok(StudyResult { job: job.clone(), trials })
    }

    fn rollout(&self, config: &Config, task: Task) -> Result<Rollout<Simulator>, Failure> {
        let settings = config.settings(&self.robot, task, Backend::Simulator)?;
        Ok(Rollout::new(Simulator::new(&self.robot, &config.simulator).map_err(EngineError::from)?, &settings))
    }

    /// Runs a point and returns its result and its ticks.
    fn evaluate(&self, job: &RunJob, studies: &[StudyResult]) -> Result<(RunResult, Vec<Tick>), Failure> {
        let config = &self.configurations[&job.configuration];
        let control = config.task(job.task);
        let point = match &job.point {
            RunPoint::First => config.first(job.task),
            RunPoint::FirstWithF1(f1_hz) => {
                let with_f1 =
                    |(name, value): &(String, f64)| (name.clone(), if name == "f1" { *f1_hz } else { *value });
                config.first(job.task).iter().map(with_f1).collect()
            }
            RunPoint::Given(values) => values.clone(),
            RunPoint::BestOf(from, seed) => self.best_of(studies, *from, job.task, *seed).unwrap_or_default(),
        };
        let jump = JumpParameters::from_values(&point, control.f1_hz);
        let mut spec = TrialSpec { seed: u64::from(job.seed), ..control.trial(job.task, jump) };
        spec.vmc = job.vmc.unwrap_or(spec.vmc);
        if let Some(duration_s) = job.duration_s {
            (spec.jumps, spec.duration_s) = (jump.within(duration_s), duration_s);
        }
        let mut result = RunResult {
            job: job.clone(),
            params: point,
            fell: false,
            cause: None,
            fall_time_s: None,
            jumps: 0,
            period_s: (spec.jumps > 1).then(|| jump.period_s()),
            value: 0.0,
            measured: None,
            tilt_at_impulse_rad: None,
            roll_range_rad: 0.0,
            pitch_range_rad: 0.0,
            effort: None,
        };
        if result.params.is_empty() {
            return Ok((result, Vec::new()));
        }
        let mut rollout = self.rollout(config, job.task)?;
        let run = evaluate(&mut rollout, &spec);
        result.fell = !run.stood();
        result.cause = result.fell.then_some(run.cause);
        result.fall_time_s = run.fall_time_s;
        result.jumps = run.jumps;
        result.value = run.value;
        result.measured = run.measured;
        result.tilt_at_impulse_rad = run.tilt_at_impulse_rad;
        result.roll_range_rad = run.roll_range_rad;
        result.pitch_range_rad = run.pitch_range_rad;
        result.effort = effort(rollout.ticks());
        Ok((result, rollout.ticks().to_vec()))
    }

    /// Runs a point again and returns its attitude and feet over time.
    pub fn trace(&self, job: &RunJob) -> Result<TrialTrace, Failure> {
        let (_, ticks) = self.evaluate(job, &[])?;
        let begun = ticks.iter().filter(|tick| tick.trial_time_s >= 0.0 && tick.trial.is_some());
        let samples: Vec<&Tick> = begun.step_by(TRACE_STEP).collect();
        let of = |value: &dyn Fn(&Tick) -> f64| samples.iter().map(|tick| round(value(tick))).collect::<Vec<_>>();
        Ok(TrialTrace {
            job: job.clone(),
            time_s: of(&|tick| tick.trial_time_s),
            roll_rad: of(&|tick| tick.estimate.roll_pitch_yaw.x),
            pitch_rad: of(&|tick| tick.estimate.roll_pitch_yaw.y),
            foot_z_m: std::array::from_fn(|leg| of(&|tick| tick.estimate.foot_position_leg[leg].z)),
        })
    }

    /// Returns the best point of the first `side_trials` trials of a study with a cold start.
    fn best_of(
        &self,
        studies: &[StudyResult],
        configuration: ExperimentConfiguration,
        task: Task,
        seed: u32,
    ) -> Option<ParameterValues> {
        let fits = |job: &StudyJob| {
            job.configuration == configuration
                && job.task == task
                && job.seed == seed
                && job.sampler == SamplerKind::Tpe
                && job.warm.is_none()
        };
        studies.iter().find(|study| fits(&study.job))?.best(self.side_trials).map(|best| best.params.clone())
    }
}

/// Returns the value with four decimal places, below the width of a line in a figure.
fn round(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
