//! Results of the experiments, as in `results.json`: everything from which report, figures and tables are made.

use std::io::Write as _;
use std::path::Path;

use quadfrog::optimize::ask::SamplerKind;
use quadfrog::robot::description::read_text_within;
use quadfrog::session::effort::JumpEffort;
use quadfrog::trial::{MeasuredJump, ParameterValues, Task, Verdict};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::configuration::ExperimentConfiguration;
use super::plan::{ExperimentSize, PaperExperiment, ReproduceJob, RunJob, RunPoint, StudyJob};
use crate::whole_file::write_whole;

/// Largest file of results, bytes: more than ten times one of the whole size.
const LARGEST_RESULTS: u64 = 1 << 27;

/// All results, in the order of the jobs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReproduceResults {
    /// Version of the program.
    pub version: String,
    /// Whether the quick size was asked for.
    pub quick: bool,
    /// Numbers of trials and seeds.
    pub size: ExperimentSize,
    /// The complete experiments.
    pub experiments: Vec<PaperExperiment>,
    pub studies: Vec<StudyResult>,
    pub runs: Vec<RunResult>,
    pub traces: Vec<TrialTrace>,
}

/// A study and its trials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudyResult {
    pub job: StudyJob,
    pub trials: Vec<TrialResult>,
}

/// A judged trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrialResult {
    pub trial: u32,
    #[serde(default, skip_serializing_if = "is_empty")]
    pub params: ParameterValues,
    /// Objective in the task's unit; 0 for a fall, none for a void trial.
    pub value: Option<f64>,
    pub verdict: Option<Verdict>,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub cause: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<MeasuredJump>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort: Option<JumpEffort>,
}

fn is_empty(params: &ParameterValues) -> bool {
    params.is_empty()
}

/// A run of one point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    pub job: RunJob,
    /// The values of the point; empty if the study that it comes from has no accepted trial: then nothing ran.
    pub params: ParameterValues,
    pub fell: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<String>,
    pub fall_time_s: Option<f64>,
    /// Impulses that ended before the run did.
    pub jumps: u32,
    /// Time from one impulse to the next, s; none for a single jump.
    pub period_s: Option<f64>,
    /// Objective per jump, in the task's unit; 0 for a fall.
    pub value: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<MeasuredJump>,
    /// None without an impulse; results of earlier versions have 0 there.
    pub tilt_at_impulse_rad: Option<f64>,
    pub roll_range_rad: f64,
    pub pitch_range_rad: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort: Option<JumpEffort>,
}

/// Attitude and feet of one run over time, 50 samples a second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrialTrace {
    pub job: RunJob,
    /// Time since the first impulse began, s.
    pub time_s: Vec<f64>,
    pub roll_rad: Vec<f64>,
    pub pitch_rad: Vec<f64>,
    /// Height of each foot in its leg frame, m, legs FR FL RR RL.
    pub foot_z_m: [Vec<f64>; 4],
}

impl StudyResult {
    /// Returns the trials that count among the first `trials`: accepted or fallen.
    pub fn counted(&self, trials: u32) -> impl Iterator<Item = &TrialResult> {
        self.trials.iter().filter(|trial| trial.value.is_some()).take(trials as usize)
    }

    /// Returns the accepted trial with the greatest value among the first `trials`, the earliest of equals.
    pub fn best(&self, trials: u32) -> Option<&TrialResult> {
        let accepted = self.counted(trials).filter(|trial| trial.verdict == Some(Verdict::Accept));
        accepted.reduce(|best, trial| if trial.value > best.value { trial } else { best })
    }

    /// Returns the best value after each of the first `trials` trials; 0 before the first accepted one.
    pub fn best_so_far(&self, trials: u32) -> Vec<f64> {
        let values = self.counted(trials).map(|trial| trial.value.unwrap_or(0.0));
        values
            .scan(0.0, |best: &mut f64, value| {
                *best = best.max(value);
                Some(*best)
            })
            .collect()
    }

    /// Returns the falls among the first `trials`.
    pub fn falls(&self, trials: u32) -> usize {
        self.counted(trials).filter(|trial| trial.verdict == Some(Verdict::Fall)).count()
    }
}

impl ReproduceResults {
    /// Results of this size without a study or run.
    pub fn new(size: ExperimentSize, quick: bool) -> ReproduceResults {
        ReproduceResults {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            quick,
            size,
            experiments: Vec::new(),
            studies: Vec::new(),
            runs: Vec::new(),
            traces: Vec::new(),
        }
    }

    /// Reads results from a file.
    ///
    /// # Errors
    /// When it cannot be read, or is not of this program, with the remedy.
    pub fn read(file: &Path) -> Result<ReproduceResults, String> {
        let refuse = |error: &dyn std::fmt::Display| {
            format!("--from {}: {error}; give the results.json of `quadfrog reproduce --output DIR`", file.display())
        };
        let text = read_text_within(file, LARGEST_RESULTS, "results").map_err(|error| refuse(&error))?;
        serde_json::from_str(&text).map_err(|error| refuse(&error))
    }

    /// Writes the results to a file.
    ///
    /// # Errors
    /// When it cannot be written; a file of that name then has its old contents.
    pub fn write(&self, file: &Path) -> std::io::Result<()> {
        let text = serde_json::to_string(self)? + "\n";
        write_whole(file, |to| to.write_all(text.as_bytes()))
    }

    /// Marks `experiments` as complete, orders studies and runs as `jobs`, and drops all others.
    pub fn complete(&mut self, experiments: &[PaperExperiment], jobs: &[ReproduceJob]) {
        self.experiments = experiments.to_vec();
        let mut unsorted = std::mem::take(&mut self.studies);
        let mut runs = std::mem::take(&mut self.runs);
        for job in jobs {
            match job {
                ReproduceJob::Study(job) => self.studies.extend(
                    unsorted.iter().position(|study| study.job.includes(job)).map(|index| unsorted.swap_remove(index)),
                ),
                ReproduceJob::Run(job) => {
                    self.runs.extend(runs.iter().position(|run| run.job == *job).map(|index| runs.swap_remove(index)));
                }
            }
        }
    }

    /// Returns results from which the same claims follow, with a tenth of the text: parameters, measurements and efforts only of
    /// trials that were the best so far, and numbers with six significant digits.
    pub fn reduced(&self) -> ReproduceResults {
        let mut reduced = self.clone();
        for study in &mut reduced.studies {
            let mut best = 0.0;
            for trial in &mut study.trials {
                let improves = trial.verdict == Some(Verdict::Accept) && trial.value.is_some_and(|value| value > best);
                trial.value = trial.value.map(six_digits);
                trial.cause.clear();
                if improves {
                    best = trial.value.unwrap_or(best);
                    trial.measured.iter_mut().for_each(|measured| measured.jumps.clear());
                    trial.params =
                        trial.params.iter().map(|(name, value)| (name.clone(), six_digits(*value))).collect();
                } else {
                    (trial.params, trial.measured, trial.effort) = (ParameterValues::default(), None, None);
                }
            }
        }
        for run in &mut reduced.runs {
            (run.measured, run.effort, run.cause) = (None, None, None);
            for value in [&mut run.value, &mut run.roll_range_rad, &mut run.pitch_range_rad] {
                *value = six_digits(*value);
            }
            run.tilt_at_impulse_rad = run.tilt_at_impulse_rad.map(six_digits);
        }
        reduced
    }

    /// Whether every study and run of an experiment is here.
    pub fn covers(&self, experiment: PaperExperiment) -> bool {
        experiment.jobs(&self.size).iter().all(|job| match job {
            ReproduceJob::Study(job) => self.studies.iter().any(|study| study.job.includes(job)),
            ReproduceJob::Run(job) => self.runs.iter().any(|run| run.job == *job),
        })
    }

    /// Returns the runs over blocks whose attitude is drawn: the first seed on which the robot stands with Virtual Model Control
    /// and falls without, with and without.
    pub fn runs_to_trace(&self) -> Vec<RunJob> {
        let on_blocks = |vmc| {
            self.runs_of(move |job| job.configuration == ExperimentConfiguration::RoughTerrain && job.vmc == Some(vmc))
        };
        let without = on_blocks(false);
        let differs =
            |with: &&RunResult| !with.fell && without.iter().any(|other| other.job.seed == with.job.seed && other.fell);
        let Some(with) = on_blocks(true).into_iter().find(differs) else { return Vec::new() };
        [true, false].map(|vmc| RunJob { vmc: Some(vmc), ..with.job.clone() }).to_vec()
    }

    /// Whether an experiment is complete.
    pub fn has(&self, experiment: PaperExperiment) -> bool {
        self.experiments.contains(&experiment)
    }

    /// Returns the studies with a cold start, by seed.
    pub fn studies(
        &self,
        configuration: ExperimentConfiguration,
        task: Task,
        sampler: SamplerKind,
    ) -> Vec<&StudyResult> {
        self.studies_from(configuration, task, sampler, None)
    }

    /// Returns the studies that began with the best of a study of `warm`, or with a cold start, by seed.
    pub fn studies_from(
        &self,
        configuration: ExperimentConfiguration,
        task: Task,
        sampler: SamplerKind,
        warm: Option<ExperimentConfiguration>,
    ) -> Vec<&StudyResult> {
        let fits = |job: &StudyJob| {
            (job.configuration, job.task, job.sampler, job.warm) == (configuration, task, sampler, warm)
        };
        let mut studies: Vec<&StudyResult> = self.studies.iter().filter(|study| fits(&study.job)).collect();
        studies.sort_by_key(|study| study.job.seed);
        studies
    }

    /// Returns the best trial of each of those studies, found by the TPE in the first `trials` trials.
    pub fn bests(&self, configuration: ExperimentConfiguration, task: Task, trials: u32) -> Vec<&TrialResult> {
        let studies = self.studies(configuration, task, SamplerKind::Tpe);
        studies.into_iter().filter_map(|study| study.best(trials)).collect()
    }

    /// Returns the runs that fit.
    pub fn runs_of(&self, fits: impl Fn(&RunJob) -> bool) -> Vec<&RunResult> {
        self.runs.iter().filter(|run| fits(&run.job)).collect()
    }

    /// Returns the runs of the best point of each ideal study on another configuration.
    pub fn transferred(&self, task: Task) -> Vec<&RunResult> {
        self.runs_of(|job| job.task == task && matches!(job.point, RunPoint::BestOf(..)))
    }
}

impl TrialResult {
    /// Returns the value of a parameter; NaN if the trial has none of that name.
    pub fn param(&self, name: &str) -> f64 {
        self.params.get(name).unwrap_or(f64::NAN)
    }

    /// Returns the angle of the profile's force above the horizontal, rad (paper: the take-off angle from the force direction).
    pub fn force_angle_rad(&self) -> f64 {
        let value = |name| self.params.get(name).unwrap_or(0.0);
        value("Fz").atan2(value("Fx").hypot(value("Fy")))
    }

    /// Returns the rise, m; 0 if it was not measured.
    pub fn rise_m(&self) -> f64 {
        self.measured.as_ref().map_or(0.0, |measured| measured.apex_m)
    }
}

/// Whether a text is one of results, of this version or another.
pub fn is_results(text: &str) -> bool {
    let value: Value = serde_json::from_str(text).unwrap_or_default();
    value["experiments"].is_array() && value["studies"].is_array() && value["runs"].is_array()
}

fn six_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// Mean, deviation and range of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    pub count: usize,
    pub mean: f64,
    /// Standard deviation of the sample; 0 for one value.
    pub deviation: f64,
    pub least: f64,
    pub most: f64,
}

impl Sample {
    /// Returns the statistics of values; none without a value.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Sample> {
        let values: Vec<f64> = values.into_iter().collect();
        let count = values.len();
        if count == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        Some(Sample {
            count,
            mean,
            deviation: (squares / count.saturating_sub(1).max(1) as f64).sqrt(),
            least: values.iter().copied().fold(f64::INFINITY, f64::min),
            most: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }
}
