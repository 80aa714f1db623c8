//! A simulated session run again from its recording alone, and compared tick by tick.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::config::{Config, ConfigLayer};
use crate::recording::RecordingError;
use crate::recording::difference::difference;
use crate::recording::player::{Damage, Played, Player};
use crate::recording::record::{Record, StageRecord};
use crate::robot::description::{RobotDescription, RobotFiles};
use crate::session::experiment::next_seed;
use crate::session::rollout::Rollout;
use crate::sim::Simulator;
use crate::telemetry::{Tick, TrialSpec};
use crate::trial::{Backend, ExperimentStage, JumpParameters, Task, TrialRecord, Verdict};

/// Result of a verification.
#[derive(Debug, Clone, PartialEq)]
pub enum Verification {
    /// Every tick of these trials is the same.
    Equal {
        /// Compared trials.
        trials: usize,
        /// Compared ticks.
        ticks: u64,
        /// Rollouts that a person, a fault or a crash ended: nothing in the file repeats that.
        left_out: Vec<RecordedRun>,
        /// Parts that were lost already when the file was recovered from a damaged one.
        lost_before: Vec<String>,
    },
    /// A tick differs.
    Different(TickDifference),
}

/// A rollout in a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecordedRun {
    /// Number of the trial.
    pub trial: u32,
    /// Number of the rollout within the trial, from 1, void ones included; none for a trial that is one rollout.
    pub rollout: Option<usize>,
}

impl fmt::Display for RecordedRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.rollout {
            None => write!(f, "trial {}", self.trial),
            Some(rollout) => write!(f, "rollout {rollout} of trial {}", self.trial),
        }
    }
}

/// The first tick that differs.
#[derive(Debug, Clone, PartialEq)]
pub struct TickDifference {
    /// The rollout.
    pub run: RecordedRun,
    /// Place of the tick among those of the rollout, from 0.
    pub tick: u64,
    /// Number of the tick in the file; none if the file has too few.
    pub number: Option<u64>,
    /// Name of the field in `proto/frog.proto`.
    pub field: String,
    /// Value in the file.
    pub recorded: String,
    /// Value of the simulation.
    pub simulated: String,
}

/// A recording that cannot be verified.
#[expect(missing_docs, reason = "the messages name variants and fields")]
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error("{}: not verifiable: it has no tick of a trial that came to its own end", path.display())]
    NoTrial { path: PathBuf },
    #[error(
        "{}: not verifiable: {name} is not attached; it was recorded by an older version, or copied without it",
        path.display()
    )]
    NotAttached { path: PathBuf, name: String },
    #[error("{}: not verifiable: it is damaged: {}", .0.path.display(), .0.parts)]
    Damaged(Damage),
    #[error("{}: not verifiable: {reason}", path.display())]
    NotVerifiable { path: PathBuf, reason: String },
}

/// The ticks of one rollout as the simulation gives them.
struct ExpectedTicks {
    run: RecordedRun,
    ticks: VecDeque<Tick>,
    compared: u64,
}

impl ExpectedTicks {
    /// Compares the next tick of the file; none for a file that has no more ticks of the rollout.
    fn compare(&mut self, recorded: Option<&Tick>) -> Option<TickDifference> {
        let simulated = self.ticks.pop_front();
        let (field, recorded_value, simulated_value) = match (recorded, &simulated) {
            (None, None) => return None,
            (Some(recorded), Some(simulated)) => match difference(recorded, simulated) {
                None => {
                    self.compared += 1;
                    return None;
                }
                Some(found) => {
                    let [recorded, simulated] = found.values;
                    (found.field, recorded, simulated)
                }
            },
            (recorded, simulated) => {
                let word = |tick: Option<&Tick>| if tick.is_some() { "a tick" } else { "no tick" }.to_owned();
                ("number of ticks".to_owned(), word(recorded), word(simulated.as_ref()))
            }
        };
        Some(TickDifference {
            run: self.run,
            tick: self.compared,
            number: recorded.map(|tick| tick.number),
            field,
            recorded: recorded_value,
            simulated: simulated_value,
        })
    }
}

/// The rollouts of a recording by the records of their begin and their end.
#[derive(Default)]
struct RecordedRollouts {
    /// Time of each rollout that began in the file, and the number of judged ones before it, by trial and in the order of time. Those
    /// of an interrupted trial that this one continues are in another file.
    begun: BTreeMap<u32, VecDeque<(u64, usize)>>,
    /// The row with the suggested verdict of each rollout that ended, by trial and judged rollouts before it.
    ended: BTreeMap<(u32, usize), TrialRecord>,
}

impl RecordedRollouts {
    fn of(player: &Player) -> RecordedRollouts {
        let mut rollouts = RecordedRollouts::default();
        let mut judged = BTreeMap::new();
        for event in player.events() {
            match &event.record {
                Record::Trial(row) => {
                    judged.insert(row.trial, row.repeats.len());
                    if row.suggested.is_some() {
                        rollouts.ended.insert((row.trial, row.repeats.len()), row.clone());
                    }
                }
                Record::Stage(StageRecord { stage: ExperimentStage::Running, trial, .. }) => {
                    if let Some(before) = judged.get(trial) {
                        rollouts.begun.entry(*trial).or_default().push_back((event.time_ns, *before));
                    }
                }
                _ => {}
            }
        }
        rollouts
    }

    /// Takes the rollout with the first tick at `time_ns`: returns the number of judged ones before it.
    fn begin(&mut self, trial: u32, time_ns: u64) -> Option<usize> {
        let begun = self.begun.get_mut(&trial)?;
        // One that was refused has no ticks.
        while begun.get(1).is_some_and(|(next_ns, _)| *next_ns <= time_ns) {
            begun.pop_front();
        }
        begun.pop_front().map(|(_, before)| before)
    }
}

/// Runs the trials of a recording again with the configuration, the robot, the parameters and the seeds in it, and compares
/// every recorded tick of every trial bit for bit, without number, time and duration of its stages.
///
/// # Errors
/// When the file cannot be read or lacks what the simulation needs.
pub fn verify(path: &Path) -> Result<Verification, VerifyError> {
    let refuse = |reason: String| VerifyError::NotVerifiable { path: path.into(), reason };
    let mut player = Player::open(path)?;
    let session = player.session().clone();
    match session.backend {
        Some(Backend::Simulator) => {}
        Some(Backend::Hardware) => {
            return Err(refuse("it was recorded on a robot; only the simulator repeats a jump".into()));
        }
        None => return Err(refuse("its backend is not known to this version".into())),
    }
    let Some(task) = session.task else { return Err(refuse("its task is not known to this version".into())) };
    let (config, robot) = (attached_config(&mut player)?, attached_robot(&mut player)?);
    let damaged = |player: &Player| player.damage().map_or(Ok(()), |damage| Err(VerifyError::Damaged(damage)));
    damaged(&player)?;

    let settings = config.settings(&robot, task, Backend::Simulator).map_err(|error| refuse(error.to_string()))?;
    let simulator = Simulator::new(&robot, &config.simulator).map_err(|error| refuse(error.to_string()))?;
    let mut rollout = Rollout::new(simulator, &settings);
    let compared = compare_rollouts(&mut player, &mut rollout, &config, task);
    // A damaged chunk is found while it is played; its missing ticks are no difference of the simulation.
    damaged(&player)?;
    let lost_before = player.lost_before_recovery();
    match compared {
        // Nor are ticks that were lost before the file was recovered.
        Ok(Verification::Different(_)) if !lost_before.is_empty() => {
            Err(refuse(format!("it was {}", lost_before.join("; it was "))))
        }
        compared => compared,
    }
}

/// Compares the ticks of every rollout with those of the simulation up to the first difference.
fn compare_rollouts(
    player: &mut Player,
    rollout: &mut Rollout<Simulator>,
    config: &Config,
    task: Task,
) -> Result<Verification, VerifyError> {
    let path = player.path().to_owned();
    let refuse = |reason: String| VerifyError::NotVerifiable { path: path.clone(), reason };
    let mut rollouts = RecordedRollouts::of(player);
    let (mut trials, mut ticks, mut left_out) = (BTreeSet::new(), 0, Vec::new());
    let mut present: Option<ExpectedTicks> = None;
    // Trial and time of the last tick, if it had a trial.
    let mut last: Option<(u32, f64)> = None;
    for played in player.by_ref() {
        let Played::Tick(tick) = played else { continue };
        let begins = tick
            .trial
            .filter(|trial| last.is_none_or(|(of_last, last_s)| of_last != *trial || tick.trial_time_s < last_s));
        last = tick.trial.map(|trial| (trial, tick.trial_time_s));
        if (begins.is_some() || last.is_none())
            && let Some(mut ended) = present.take()
        {
            if let Some(found) = ended.compare(None) {
                return Ok(Verification::Different(found));
            }
            ticks += ended.compared;
        }
        if let Some(trial) = begins {
            let Some(before) = rollouts.begin(trial, tick.time_ns) else {
                return Err(refuse(format!("trial {trial} has ticks but no record of their begin")));
            };
            let row = rollouts.ended.get(&(trial, before));
            let run = RecordedRun { trial, rollout: (config.task(task).repeats > 1).then_some(before + 1) };
            match row.filter(|row| matches!(row.suggested, Some(Verdict::Accept | Verdict::Fall))) {
                Some(row) => {
                    let spec = spec(config, task, row).ok_or_else(|| {
                        refuse(format!("trial {trial} has no seed: it was recorded by an older version, or the study was begun by another program"))
                    })?;
                    let (_, simulated) = rollout.run(&spec);
                    let of_trial = simulated.iter().filter(|tick| tick.trial == Some(trial)).copied();
                    present = Some(ExpectedTicks { run, ticks: of_trial.collect(), compared: 0 });
                    trials.insert(trial);
                }
                None => left_out.push(run),
            }
        }
        if let Some(expected) = &mut present
            && let Some(found) = expected.compare(Some(&tick))
        {
            return Ok(Verification::Different(found));
        }
    }
    if let Some(mut ended) = present {
        if let Some(found) = ended.compare(None) {
            return Ok(Verification::Different(found));
        }
        ticks += ended.compared;
    }
    if trials.is_empty() {
        return Err(VerifyError::NoTrial { path });
    }
    let lost_before = player.lost_before_recovery();
    Ok(Verification::Equal { trials: trials.len(), ticks, left_out, lost_before })
}

/// Returns the text of an attached file.
fn attached_text(player: &mut Player, name: &str) -> Result<String, VerifyError> {
    let path = player.path().to_owned();
    let bytes = player.attachment(name)?;
    let bytes = bytes.ok_or_else(|| VerifyError::NotAttached { path: path.clone(), name: name.to_owned() })?;
    let reason = format!("the attached {name} is not UTF-8");
    String::from_utf8(bytes).map_err(|_| VerifyError::NotVerifiable { path, reason })
}

/// Returns the configuration that is attached to a recording.
///
/// # Errors
/// When one of its files is not attached, damaged or not valid any more.
pub fn attached_config(player: &mut Player) -> Result<Config, VerifyError> {
    let path = player.path().to_owned();
    let files = Config::FILE_NAMES;
    let texts = files.iter().map(|name| Ok((*name, attached_text(player, name)?)));
    let texts = texts.collect::<Result<Vec<_>, VerifyError>>()?;
    let origins: Vec<String> = files.iter().map(|name| format!("{}: attached {name}", path.display())).collect();
    let layers = texts.iter().zip(&origins).map(|((file, text), origin)| ConfigLayer { file, origin, text });
    let config = Config::layered(&layers.collect::<Vec<_>>());
    config.map_err(|error| VerifyError::NotVerifiable { path, reason: error.to_string() })
}

/// Returns the robot that is attached to a recording.
///
/// # Errors
/// When one of its files is not attached, damaged or not valid any more.
pub fn attached_robot(player: &mut Player) -> Result<RobotDescription, VerifyError> {
    #[derive(Deserialize)]
    struct UrdfName {
        urdf: String,
    }
    let path = &player.path().to_owned();
    let refuse = |reason: String| VerifyError::NotVerifiable { path: path.into(), reason };
    let toml = attached_text(player, "robot.toml")?;
    let name: UrdfName = toml::from_str(&toml).map_err(|error| refuse(format!("the attached robot.toml: {error}")))?;
    let base = Path::new(&name.urdf).file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let urdf = attached_text(player, &base)?;
    RobotFiles::from_texts(path, toml, urdf).description().map_err(|error| refuse(error.to_string()))
}

/// Returns the settings of a rollout from the row at its end; none without its seed.
fn spec(config: &Config, task: Task, row: &TrialRecord) -> Option<TrialSpec> {
    let control = config.task(task);
    Some(TrialSpec {
        trial: row.trial,
        gains: control.gains().with(&row.gains).with(&row.parameters),
        seed: next_seed(row)?,
        ..control.trial(task, JumpParameters::from_values(&row.parameters, control.f1_hz))
    })
}
