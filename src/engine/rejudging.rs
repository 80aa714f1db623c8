//! The trials of a recording judged again by another configuration: estimate, fall detection and objective on the recorded ticks.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::verify::{VerifyError, attached_config, attached_robot};
use crate::config::{Config, ConfigError};
use crate::control::estimator::Estimator;
use crate::control::leg;
use crate::control::settings::ControlSettings;
use crate::recording::RecordingError;
use crate::recording::player::{Damage, MOST_TICKS_OF_A_ROLLOUT, Played};
use crate::recording::timeline::Timeline;
use crate::robot::description::{RobotDescription, RobotFiles};
use crate::session::rejudge::{Judgement, rejudge, row_of_repeat};
use crate::telemetry::{Mode, Tick};
use crate::trial::{Backend, JumpParameters, ObjectiveRule, TrialRecord, Verdict};

/// A trial with its old and its new judgement.
#[derive(Debug, Clone, PartialEq)]
pub struct RejudgedTrial {
    /// Its number.
    pub trial: u32,
    /// The verdict in force in the recording; none where the trial has none yet.
    pub judged: Option<Verdict>,
    /// The rules' result as recorded, which the operator's verdict may differ from.
    pub old: Judgement,
    /// The rules' result by the other configuration.
    pub new: Judgement,
    /// Change of the estimate; none where the configuration estimates as the recorded one does.
    pub estimate: Option<EstimateChange>,
}

impl RejudgedTrial {
    /// Returns the new value less the old one; 0 within the precision of recorded ticks.
    pub fn difference(&self) -> Option<f64> {
        self.new.difference(&self.old)
    }
}

/// Returns in words how many of the trials get another suggested verdict, how many others another value or reason, and of how many
/// the recording does not show the verdict.
pub fn changes_in_words<'a>(trials: impl Iterator<Item = &'a RejudgedTrial> + Clone) -> String {
    let known = trials.clone().filter(|trial| trial.new.verdict.is_some());
    let changed = known.clone().filter(|trial| trial.new.verdict != trial.old.verdict).count();
    let differ = known.clone().filter(|trial| trial.new.differs(&trial.old)).count();
    let others = match differ - changed {
        0 => String::new(),
        others => format!(", of {others} others J or the cause"),
    };
    let all = trials.count();
    let unknown = match all - known.count() {
        0 => String::new(),
        unknown => format!("; {unknown} not known"),
    };
    format!("{changed} of {all} suggestions change{others}{unknown}")
}

/// The recomputed estimate of a trial beside the recorded one; of several rollouts the largest numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EstimateChange {
    /// Largest distance between both positions, each from its start, m.
    pub distance_m: f64,
    /// Error of the recorded displacement at the last tick, m; none without the simulator's true state.
    pub old_error_m: Option<f64>,
    /// Error of the recomputed one, m.
    pub new_error_m: Option<f64>,
}

/// A recording that cannot be judged again.
#[expect(missing_docs, reason = "the messages name variants and fields")]
#[derive(Debug, thiserror::Error)]
pub enum RejudgeError {
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error("{}: not judged again: {reason}", path.display())]
    NotRejudgeable { path: PathBuf, reason: String },
}

/// Loads the configuration by which a recording is judged again: that of `folder`, else the built-in one, with the own configuration of
/// a built-in robot that was recorded below it.
///
/// # Errors
/// When the recording cannot be opened or the configuration cannot be used.
pub fn config_for_recorded(files: &[PathBuf], folder: Option<&Path>) -> Result<Config, RejudgeError> {
    let mut recording = Timeline::open(files)?;
    let name = recording.session().robot.clone();
    // An older recording has no robot of its own: that of its name.
    let recorded = attached_robot(recording.first_player()).ok();
    let built_in = RobotFiles::embedded(&name).ok().filter(|files| match (&recorded, files.description()) {
        (Some(recorded), Ok(built_in)) => built_in.is_same_robot(recorded),
        (recorded, _) => recorded.is_none(),
    });
    Ok(match built_in {
        Some(robot) => Config::load_for(&robot, folder)?,
        None => Config::load(folder)?,
    })
}

/// Iterator over the judged trials of a recording. A trial that ran more than once comes once for each run; the last one counts.
pub struct Rejudging {
    recording: Timeline,
    rows: BTreeMap<u32, TrialRecord>,
    rules: BTreeMap<u32, ObjectiveRule>,
    settings: ControlSettings,
    unit: &'static str,
    /// Recomputes the estimate; none where the configuration estimates as the recorded one does.
    estimator: Option<Estimator>,
    mode: Mode,
    present: PresentTrial,
}

/// The rollouts of the trial that is read.
#[derive(Default)]
struct PresentTrial {
    trial: Option<u32>,
    /// Ticks of the rollout, with the recorded positions.
    ticks: Vec<Tick>,
    recorded_world: Vec<Vector3<f64>>,
    /// Whether the rollout has more ticks than are kept.
    is_too_long: bool,
    judged: Vec<Judgement>,
    estimate: EstimateChange,
}

impl Rejudging {
    /// Opens files of one study to judge their trials by `config`. The robot is the recorded one.
    ///
    /// # Errors
    /// When a file cannot be played, `config` does not fit its robot, or the robot, the task or the backend is not known.
    pub fn open(files: &[PathBuf], config: &Config) -> Result<Rejudging, RejudgeError> {
        let mut recording = Timeline::open(files)?;
        let path = recording.paths().into_iter().next().unwrap_or_default();
        let refuse = |reason: String| RejudgeError::NotRejudgeable { path: path.clone(), reason };
        let info = recording.session().clone();
        let (Some(task), Some(backend)) = (info.task, info.backend) else {
            return Err(refuse("it names a task or a backend that this version does not know".into()));
        };
        let robot = match attached_robot(recording.first_player()) {
            Ok(robot) => robot,
            // An older recording has no robot of its own.
            Err(VerifyError::NotAttached { .. }) => RobotDescription::embedded(&info.robot)
                .map_err(|error| refuse(format!("its robot {} is not known: {error}", info.robot)))?,
            Err(error) => return Err(refuse(format!("its robot cannot be read: {error}"))),
        };
        let settings = config.settings(&robot, task, backend)?;
        let recorded = match attached_config(recording.first_player()) {
            Ok(config) => config.settings(&robot, task, backend).ok(),
            // It may be damaged; that of an older version may be missing, or not valid any more.
            Err(_) => None,
        };
        let estimation = |s: &ControlSettings| (s.estimator, s.objective, s.contact_force_n);
        let same = recorded.as_ref().is_some_and(|recorded| estimation(recorded) == estimation(&settings));
        let control = config.task(task);
        let rows = recording.rows();
        let rule = |row: &TrialRecord| {
            let jump = JumpParameters::from_values(&row.parameters, control.f1_hz);
            ObjectiveRule { jumps: control.jumps(&jump), ..control.trial(task, jump).objective() }
        };
        Ok(Rejudging {
            rules: rows.iter().map(|(trial, row)| (*trial, rule(row))).collect(),
            recording,
            rows,
            settings: ControlSettings { hardware: backend == Backend::Hardware, ..settings },
            unit: task.objective_unit(control.rate),
            estimator: (!same).then(Estimator::default),
            mode: Mode::Offline,
            present: PresentTrial::default(),
        })
    }

    /// Returns the unit of the new objective.
    pub fn unit(&self) -> &'static str {
        self.unit
    }

    /// Returns the number of trials that were measured.
    pub fn measured_trials(&self) -> usize {
        self.rows.values().filter(|row| row.suggested.is_some()).count()
    }

    /// Returns the damage of the files, as far as it is found.
    pub fn damage(&self) -> Vec<Damage> {
        self.recording.damage()
    }

    /// Returns the reasons for which ends of files are missing, with their names.
    pub fn cuts(&self) -> Vec<String> {
        self.recording.cuts()
    }

    /// Returns what was lost already when the files were recovered from damaged ones, with their names.
    pub fn lost_before_recovery(&mut self) -> Vec<String> {
        self.recording.lost_before_recovery()
    }

    /// Takes a tick; returns the trial that ended before it.
    fn take(&mut self, mut tick: Tick) -> Option<RejudgedTrial> {
        let present = &self.present;
        let last_s = present.ticks.last().map_or(f64::NEG_INFINITY, |last| last.trial_time_s);
        let other_trial = tick.trial.is_some() && tick.trial != present.trial;
        let begins = tick.trial.is_some() && (other_trial || present.ticks.is_empty() || tick.trial_time_s < last_s);
        if begins || tick.trial.is_none() {
            self.end_rollout();
        }
        let ended = if other_trial { self.end_trial() } else { None };
        // As the controller does: it starts again where it stands up, and where a simulated robot is placed for a trial.
        let stands_up = tick.mode == Mode::StandUp && self.mode != Mode::StandUp;
        self.mode = tick.mode;
        let recorded_world = tick.estimate.position_world;
        if let Some(estimator) = &mut self.estimator {
            if stands_up || begins && !self.settings.hardware {
                estimator.reset();
            }
            let feet = leg::feet(&self.settings.geometry, &tick.state.joint_position_rad);
            tick.estimate = *estimator.update(&tick.state, &feet, &self.settings);
        }
        if tick.trial.is_some() && self.present.ticks.len() == MOST_TICKS_OF_A_ROLLOUT {
            self.present.is_too_long = true;
        } else if tick.trial.is_some() {
            self.present.trial = tick.trial;
            self.present.ticks.push(tick);
            self.present.recorded_world.push(recorded_world);
        }
        ended
    }

    /// Judges the ticks of the rollout that has ended.
    fn end_rollout(&mut self) {
        let PresentTrial { trial, ticks, recorded_world, is_too_long, judged, estimate } = &mut self.present;
        let found = trial.and_then(|trial| Some((self.rows.get(&trial)?, self.rules.get(&trial)?)));
        if let (Some((row, rule)), false) = (found, ticks.is_empty()) {
            judged.push(match row.repeats.get(judged.len()) {
                _ if *is_too_long => Judgement::unknown(format!("it has more than {MOST_TICKS_OF_A_ROLLOUT} ticks")),
                Some(repeat) => rejudge(&row_of_repeat(row, repeat), ticks, rule, &self.settings),
                None => rejudge(row, ticks, rule, &self.settings),
            });
            let change = EstimateChange::of(ticks, recorded_world);
            let larger = |a: Option<f64>, b: Option<f64>| a.into_iter().chain(b).reduce(f64::max);
            *estimate = EstimateChange {
                distance_m: estimate.distance_m.max(change.distance_m),
                old_error_m: larger(estimate.old_error_m, change.old_error_m),
                new_error_m: larger(estimate.new_error_m, change.new_error_m),
            };
        }
        ticks.clear();
        recorded_world.clear();
        *is_too_long = false;
    }

    /// Returns the judgement of the trial that has ended; none of one that was never measured.
    fn end_trial(&mut self) -> Option<RejudgedTrial> {
        let PresentTrial { trial, mut judged, estimate, .. } = std::mem::take(&mut self.present);
        let row = self.rows.get(&trial?).filter(|row| row.suggested.is_some())?;
        let new = match row.repeats.len() {
            // A trial that was interrupted and ran again.
            0 => judged.pop()?,
            repeats if repeats == judged.len() => Judgement::of_repeats(&judged),
            repeats => Judgement::unknown(format!("{} of its {repeats} rollouts are recorded", judged.len())),
        };
        let estimate = self.estimator.is_some().then_some(estimate);
        Some(RejudgedTrial { trial: row.trial, judged: row.verdict, old: Judgement::of(row), new, estimate })
    }
}

impl Iterator for Rejudging {
    type Item = RejudgedTrial;

    /// Reads on to the end of the next trial; none at the end of the recording.
    fn next(&mut self) -> Option<RejudgedTrial> {
        while let Some(played) = self.recording.next() {
            if let Played::Tick(tick) = played
                && let Some(ended) = self.take(*tick)
            {
                return Some(ended);
            }
        }
        self.end_rollout();
        self.end_trial()
    }
}

impl EstimateChange {
    fn of(ticks: &[Tick], recorded_world: &[Vector3<f64>]) -> EstimateChange {
        let (Some(first), Some(last)) = (ticks.first(), ticks.last()) else { return EstimateChange::default() };
        let moved = |tick: &Tick| tick.estimate.position_world - first.estimate.position_world;
        let recorded = |world: &Vector3<f64>| world - recorded_world[0];
        let distances = ticks.iter().zip(recorded_world).map(|(tick, world)| (moved(tick) - recorded(world)).norm());
        let true_world = |tick: &Tick| tick.state.truth.map(|truth| truth.position_world);
        let true_moved = true_world(first).zip(true_world(last)).map(|(from, to)| to - from);
        EstimateChange {
            distance_m: distances.fold(0.0, f64::max),
            old_error_m: true_moved.zip(recorded_world.last()).map(|(moved, world)| (recorded(world) - moved).norm()),
            new_error_m: true_moved.map(|true_moved| (moved(last) - true_moved).norm()),
        }
    }
}
