//! Recorded trials of a study, read from its recordings.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::jump::{JumpCurves, JumpQuantities};
use crate::recording::player::{MOST_TICKS_OF_A_ROLLOUT, Played, Player};
use crate::recording::record::{Record, Stamped};
use crate::recording::timeline::{ended_trial, rows_of};
use crate::robot::description::RobotDescription;
use crate::telemetry::Tick;
use crate::trial::{Overrides, ParameterValues, TrialRecord};

/// Time before the impulse from which curves are shown, s.
const BEFORE_S: f64 = 0.1;

/// One trial whose ticks were recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedTrial {
    /// Take-off, torque and power; none if the ticks hold no flight.
    pub quantities: Option<JumpQuantities>,
    /// Curves over time.
    pub curves: JumpCurves,
}

impl RecordedTrial {
    /// Measures a trial's ticks; none if they end before the impulse.
    pub fn of(ticks: &[Tick], robot: &RobotDescription) -> Option<RecordedTrial> {
        let curves = JumpCurves::of(ticks, robot, BEFORE_S);
        (!curves.roll_rad.is_empty()).then(|| RecordedTrial { quantities: JumpQuantities::of(ticks), curves })
    }
}

/// Recorded trials by number, with everything about the recordings that a reader needs to know.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recordings {
    /// Trials whose ticks reach the impulse.
    pub trials: BTreeMap<u32, RecordedTrial>,
    /// Trials of which ticks are recorded, also those that ended before the impulse.
    pub with_ticks: BTreeSet<u32>,
    /// Those of them whose last rollout is not whole: the program was killed in the trial, or a part of the file is lost.
    pub in_part: BTreeSet<u32>,
    /// Recordings that were read.
    pub files: Vec<PathBuf>,
    /// Values that operators have set in place of proposed ones.
    pub overrides: Overrides,
    /// Operators of the sessions with their rules of approval, in words.
    pub operators: BTreeSet<String>,
    /// Versions of quadfrog that wrote them, each with its commit.
    pub programs: BTreeSet<String>,
    /// Damaged, unreadable and incompletely recovered recordings, as sentences.
    pub damages: Vec<String>,
}

impl Recordings {
    /// Reads the recordings in the folder of a study, finished or not; `study` has the parameters of its trials. A file that cannot
    /// be read or is of another study is noted in `damages`. Of a trial that is in several recordings the last counts.
    pub fn read(files: &[PathBuf], study: &BTreeMap<u32, ParameterValues>, robot: &RobotDescription) -> Recordings {
        let mut read = Recordings::default();
        for file in files {
            let player = match Player::open(file) {
                Ok(player) => player,
                Err(error) => {
                    read.files.push(file.clone());
                    read.damages.push(error.to_string());
                    continue;
                }
            };
            let rows = rows_of(player.events().iter());
            let differs = |row: &&TrialRecord| study.get(&row.trial).is_some_and(|known| !has_parameters(row, known));
            if let Some(row) = rows.values().find(differs) {
                let (file, trial) = (file.display(), row.trial);
                read.damages.push(format!(
                    "{file}: left out, because it is of another study: trial {trial} has other parameters there"
                ));
                continue;
            }
            read.files.push(file.clone());
            read.play(player, robot, &|_| true);
        }
        read
    }

    /// Adds a recording in another folder, which `named` trials of the study name: those of them whose recorded rows have the same
    /// parameters. Under the same numbers it may have trials of another study; one that has no other trials is left out.
    pub fn add(&mut self, file: &Path, named: &BTreeMap<u32, ParameterValues>, robot: &RobotDescription) {
        let player = match Player::open(file) {
            Ok(player) => player,
            Err(error) => return self.damages.push(error.to_string()),
        };
        let rows = rows_of(player.events().iter());
        let is_of_study = |trial| {
            rows.get(&trial).zip(named.get(&trial)).is_some_and(|(row, parameters)| has_parameters(row, parameters))
        };
        if named.keys().any(|trial| is_of_study(*trial)) {
            self.files.push(file.to_owned());
            self.play(player, robot, &is_of_study);
        }
    }

    /// Reads a recording, of its trials only those that are `of_study`.
    fn play(&mut self, mut player: Player, robot: &RobotDescription, of_study: &dyn Fn(u32) -> bool) {
        self.programs.insert(player.session().program_version());
        self.operators.extend(player.session().operator_in_words());
        self.with_ticks.extend(player.trials_with_ticks().filter(|trial| of_study(*trial)));
        let mut ticks: Vec<Tick> = Vec::new();
        let (mut ended, mut too_long) = (BTreeSet::new(), BTreeSet::new());
        for played in player.by_ref() {
            let mut tick = match played {
                Played::Tick(tick) => tick,
                Played::Record(Stamped { record, .. }) => {
                    if let Record::Proposal(proposal) = &record
                        && of_study(proposal.trial)
                    {
                        self.overrides.take(proposal);
                    }
                    ended.extend(ended_trial(&record));
                    continue;
                }
            };
            tick.trial = tick.trial.filter(|trial| of_study(*trial));
            // In simulated time the rollouts of a trial with repeats abut.
            let another = |last: &Tick| last.trial != tick.trial || tick.trial_time_s < last.trial_time_s;
            if ticks.last().is_some_and(another) {
                self.end(&mut ticks, robot, true);
            }
            if let Some(trial) = tick.trial {
                if ticks.is_empty() {
                    // Another rollout of it begins.
                    ended.remove(&trial);
                }
                if ticks.len() < MOST_TICKS_OF_A_ROLLOUT {
                    ticks.push(*tick);
                } else {
                    too_long.insert(trial);
                }
            }
        }
        let is_ended = ticks.last().and_then(|last| last.trial).is_some_and(|trial| ended.contains(&trial));
        self.end(&mut ticks, robot, is_ended);
        for trial in too_long {
            self.in_part.insert(trial);
            let file = player.path().display();
            let text =
                format!("{file}: trial {trial} has more than {MOST_TICKS_OF_A_ROLLOUT} ticks; the others are left out");
            self.damages.push(text);
        }
        self.damages.extend(player.named_losses_before_recovery());
        self.damages.extend(player.damage().map(|damage| damage.to_string()));
    }

    /// Takes over the ticks of a rollout; `is_ended`: the recording goes on after them or reports the trial's end.
    fn end(&mut self, ticks: &mut Vec<Tick>, robot: &RobotDescription, is_ended: bool) {
        if let Some(trial) = ticks.last().and_then(|tick| tick.trial) {
            let is_whole = is_ended && ticks.windows(2).all(|pair| pair[1].number == pair[0].number + 1);
            match is_whole {
                true => self.in_part.remove(&trial),
                false => self.in_part.insert(trial),
            };
            self.trials.extend(RecordedTrial::of(ticks, robot).map(|recorded| (trial, recorded)));
        }
        ticks.clear();
    }
}

/// Whether a recorded row has these parameters, in any order.
fn has_parameters(row: &TrialRecord, parameters: &ParameterValues) -> bool {
    let equal = |(name, value): &(String, f64)| row.parameters.get(name) == Some(*value);
    row.parameters.len() == parameters.len() && parameters.iter().all(equal)
}
