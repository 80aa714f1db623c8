//! The ticks of two trials to lay over each other, read apart from the playback.

use quadfrog::realtime::channel::SHOWN_EVERY;
use quadfrog::recording::RecordingError;
use quadfrog::recording::player::{Damage, Played};
use quadfrog::recording::timeline::{Timeline, TrialRun};
use quadfrog::telemetry::Tick;

use crate::message::{ComparedTrial, SecondRecording, SideBySide};

/// Most ticks of a trial that are read: ten seconds of every fifth.
const LONGEST: usize = 2_000;

/// The choice of the second trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Choice {
    Nothing,
    /// The trial of the same number in the second recording, or its first one.
    SameNumber,
    Trial(u32),
}

/// The trial at the playhead and a second one, of the same or of another recording.
pub struct TrialPair {
    /// The played recording once more; opened with the first choice.
    own: Option<Timeline>,
    second: Option<Timeline>,
    choice: Choice,
    /// Begin of the first trial and number of the second one, as sent last.
    sent: Option<(u64, u32)>,
}

impl TrialPair {
    /// With a second recording its trials are laid beside those at the playhead from the start.
    pub fn new(second: Option<Timeline>) -> TrialPair {
        let choice = if second.is_some() { Choice::SameNumber } else { Choice::Nothing };
        TrialPair { own: None, second, choice, sent: None }
    }

    /// The second recording and its trials.
    pub fn second(&self) -> Option<SecondRecording> {
        let second = self.second.as_ref()?;
        let trials = second.trials().iter().map(|run| run.trial).collect();
        Some(SecondRecording { name: name_of(second), trials })
    }

    /// Damage of the second recording, as far as it is found.
    pub fn damage(&self) -> Vec<Damage> {
        self.second.as_ref().map_or(Vec::new(), Timeline::damage)
    }

    pub fn choose(&mut self, trial: u32) {
        (self.choice, self.sent) = (Choice::Trial(trial), None);
    }

    pub fn end(&mut self) {
        (self.choice, self.sent) = (Choice::Nothing, None);
    }

    /// Returns both trials when they have changed. Where the trial at the playhead becomes the second one itself, the last pair
    /// stays.
    ///
    /// # Errors
    /// When a trial cannot be read; nothing is chosen any longer then.
    pub fn changed(&mut self, recording: &Timeline, present: Option<&TrialRun>) -> Result<Option<SideBySide>, String> {
        let Some((first, second)) = present.and_then(|run| Some((run, self.second_run(recording, run)?))) else {
            return Ok(None);
        };
        let own_pair = self.second.is_none() && first.trial == second.trial;
        if own_pair || self.sent == Some((first.begin_ns, second.trial)) {
            return Ok(None);
        }
        self.sent = Some((first.begin_ns, second.trial));
        let both = self.read(recording, first, &second);
        if both.is_err() {
            self.end();
        }
        both.map(Some)
    }

    fn second_run(&self, recording: &Timeline, first: &TrialRun) -> Option<TrialRun> {
        let runs = self.second.as_ref().unwrap_or(recording).trials();
        let last_of = |trial: u32| runs.iter().rev().find(|run| run.trial == trial).copied();
        match self.choice {
            Choice::Nothing => None,
            Choice::SameNumber => last_of(first.trial).or(runs.first().copied()),
            Choice::Trial(trial) => last_of(trial),
        }
    }

    fn read(&mut self, recording: &Timeline, first: &TrialRun, second: &TrialRun) -> Result<SideBySide, String> {
        let own = opened(&mut self.own, recording)?;
        let (ticks_a, a) = (ticks(own, first), compared(own, first.trial, false));
        let (ticks_b, b) = match &mut self.second {
            Some(other) => (ticks(other, second), compared(other, second.trial, true)),
            None => (ticks(own, second), compared(own, second.trial, false)),
        };
        for (ticks, trial) in [(&ticks_a, &a), (&ticks_b, &b)] {
            if ticks.is_empty() {
                let place = trial.recording.as_ref().map_or(String::new(), |name| format!(" of {name}"));
                return Err(unread(trial.trial, &place));
            }
        }
        Ok(SideBySide { a, b, ticks_a, ticks_b })
    }

    /// Returns the ticks that the charts show of a trial of the played recording, wherever the playhead is.
    ///
    /// # Errors
    /// When none can be read.
    pub fn jump_of(&mut self, recording: &Timeline, trial: u32) -> Result<Vec<Tick>, String> {
        let run = recording.trials().iter().rev().find(|run| run.trial == trial).ok_or_else(|| unread(trial, ""))?;
        let ticks = ticks(opened(&mut self.own, recording)?, run);
        if ticks.is_empty() { Err(unread(trial, "")) } else { Ok(ticks) }
    }
}

/// The played recording once more, as it is now.
fn opened<'a>(own: &'a mut Option<Timeline>, recording: &Timeline) -> Result<&'a mut Timeline, String> {
    let failed = |error: RecordingError| error.to_string();
    let own = match own {
        Some(own) => own,
        None => own.insert(Timeline::open(&recording.paths()).map_err(failed)?),
    };
    own.refresh().map_err(failed)?;
    Ok(own)
}

fn unread(trial: u32, place: &str) -> String {
    format!("no tick of trial {trial}{place} can be read: nothing to lay beside")
}

fn name_of(recording: &Timeline) -> String {
    recording.paths().first().map_or(String::new(), |path| path.display().to_string())
}

fn compared(recording: &Timeline, trial: u32, named: bool) -> ComparedTrial {
    ComparedTrial {
        trial,
        row: recording.rows().remove(&trial),
        unit: recording.session().unit.clone(),
        recording: named.then(|| name_of(recording)),
    }
}

/// Every fifth tick of a run, and those in which the mode changes.
pub(super) fn ticks(recording: &mut Timeline, run: &TrialRun) -> Vec<Tick> {
    recording.seek_sparse(run.begin_ns, u64::MAX, SHOWN_EVERY as u32);
    let mut ticks = Vec::new();
    for played in recording.by_ref() {
        match played {
            Played::Tick(tick) if tick.trial == Some(run.trial) => ticks.push(*tick),
            played if played.time_ns() > run.end_ns => break,
            _ => {}
        }
        if ticks.len() == LONGEST {
            break;
        }
    }
    ticks
}
