//! A simulated session run again from its recording alone, and compared tick by tick.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::config::{Config, ConfigLayer};
use crate::recording::RecordingError;
use crate::recording::difference::difference;
use crate::recording::player::{Damage, Played, Player};
use crate::recording::record::Record;
use crate::robot::description::{RobotDescription, RobotFiles};
use crate::session::experiment::next_seed;
use crate::session::rollout::Rollout;
use crate::sim::Simulator;
use crate::telemetry::{Tick, TrialSpec};
use crate::trial::{Backend, JumpParameters, Task, TrialRecord, Verdict};

/// Result of a verification.
#[derive(Debug, Clone, PartialEq)]
pub enum Verification {
    /// Every tick of these trials is the same.
    Equal {
        /// Compared trials.
        trials: usize,
        /// Compared ticks.
        ticks: u64,
        /// Trials that a person, a fault or a crash ended: nothing in the file repeats that.
        left_out: Vec<u32>,
        /// Parts that were lost already when the file was recovered from a damaged one.
        lost_before: Vec<String>,
    },
    /// A tick differs.
    Different(TickDifference),
}

/// The first tick that differs.
#[derive(Debug, Clone, PartialEq)]
pub struct TickDifference {
    /// Number of the trial.
    pub trial: u32,
    /// Place of the tick among those of the trial, from 0.
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

/// The ticks of one trial as the simulation gives them, one rollout at a time.
struct ExpectedTicks {
    trial: u32,
    specs: VecDeque<TrialSpec>,
    ticks: VecDeque<Tick>,
    compared: u64,
}

impl ExpectedTicks {
    fn next(&mut self, rollout: &mut Rollout<Simulator>) -> Option<Tick> {
        while self.ticks.is_empty() {
            let (_, ticks) = rollout.run(&self.specs.pop_front()?);
            self.ticks.extend(ticks.iter().filter(|tick| tick.trial == Some(self.trial)));
        }
        self.ticks.pop_front()
    }

    /// Compares the next tick of the file; none for a file that has no more ticks of the trial.
    fn compare(&mut self, rollout: &mut Rollout<Simulator>, recorded: Option<&Tick>) -> Option<TickDifference> {
        let simulated = self.next(rollout);
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
                ("number of ticks".to_owned(), word(recorded.copied().as_ref()), word(simulated.as_ref()))
            }
        };
        Some(TickDifference {
            trial: self.trial,
            tick: self.compared,
            number: recorded.map(|tick| tick.number),
            field,
            recorded: recorded_value,
            simulated: simulated_value,
        })
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
    let compared = compare_trials(&mut player, &mut rollout, &config, task);
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

/// Compares the ticks of every trial with those of the simulation up to the first difference.
fn compare_trials(
    player: &mut Player,
    rollout: &mut Rollout<Simulator>,
    config: &Config,
    task: Task,
) -> Result<Verification, VerifyError> {
    let path = player.path().to_owned();
    let refuse = |reason: String| VerifyError::NotVerifiable { path: path.clone(), reason };
    let rows = rows(player);
    let (mut trials, mut ticks, mut left_out) = (0, 0, Vec::new());
    let mut present: Option<ExpectedTicks> = None;
    // The trial of the last tick that had one, compared or left out.
    let mut last = None;
    for played in player.by_ref() {
        let Played::Tick(tick) = played else { continue };
        let Some(trial) = tick.trial else { continue };
        if last != Some(trial) {
            last = Some(trial);
            if let Some(mut ended) = present.take() {
                if let Some(found) = ended.compare(rollout, None) {
                    return Ok(Verification::Different(found));
                }
                ticks += ended.compared;
            }
            let Some(row) = rows.get(&trial) else {
                return Err(refuse(format!("trial {trial} has ticks but no row in the trial table")));
            };
            if matches!(row.suggested, Some(Verdict::Accept | Verdict::Fall)) {
                let specs = specs(config, task, row).ok_or_else(|| {
                    refuse(format!("trial {trial} has no seed: it was recorded by an older version, or the study was begun by another program"))
                })?;
                trials += 1;
                present = Some(ExpectedTicks { trial, specs, ticks: VecDeque::new(), compared: 0 });
            } else {
                left_out.push(trial);
            }
        }
        if let Some(expected) = &mut present
            && let Some(found) = expected.compare(rollout, Some(&tick))
        {
            return Ok(Verification::Different(found));
        }
    }
    if let Some(mut ended) = present {
        if let Some(found) = ended.compare(rollout, None) {
            return Ok(Verification::Different(found));
        }
        ticks += ended.compared;
    }
    if trials == 0 {
        return Err(VerifyError::NoTrial { path });
    }
    Ok(Verification::Equal { trials, ticks, left_out, lost_before: player.lost_before_recovery() })
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

/// Returns the newest row of each trial.
fn rows(player: &Player) -> BTreeMap<u32, TrialRecord> {
    let row = |record: &Record| match record {
        Record::Trial(row) => Some((row.trial, row.clone())),
        _ => None,
    };
    player.events().iter().filter_map(|event| row(&event.record)).collect()
}

/// Returns the settings of each rollout of a trial; none without its seed.
fn specs(config: &Config, task: Task, row: &TrialRecord) -> Option<VecDeque<TrialSpec>> {
    let control = config.task(task);
    let spec = |seed| TrialSpec {
        trial: row.trial,
        gains: control.gains().with(&row.gains).with(&row.parameters),
        seed,
        ..control.trial(task, JumpParameters::from_values(&row.parameters, control.f1_hz))
    };
    if row.repeats.is_empty() {
        return Some(VecDeque::from([spec(next_seed(row)?)]));
    }
    Some(row.repeats.iter().map(|repeat| spec(repeat.seed)).collect())
}
