//! Messages into the model and effects out of it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use quadfrog::engine::{ObserverStatus, RejudgedTrial};
use quadfrog::recording::live::LiveStatus;
use quadfrog::recording::record::Stamped;
use quadfrog::recording::recorder::RecorderStatus;
use quadfrog::recording::timeline::TrialRun;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::session::storage::StorageWait;
use quadfrog::telemetry::{Snapshot, Tick};
use quadfrog::trial::{Overrides, TrialRecord, Verdict};

use crate::keymap::Key;
use crate::theme::Background;

/// An input of the console: keys, mouse, signals, the feed, the clock.
#[expect(clippy::large_enum_variant, reason = "records are few; the many ticks are boxed")]
#[expect(missing_docs, reason = "the names say the rest")]
#[derive(Debug, Clone)]
pub enum Msg {
    /// Time since the console started.
    Clock(Duration),
    /// Columns and rows of the terminal.
    Resize(u16, u16),
    Key(Key),
    /// Pasted text of the terminal of a replay. In a live session a paste arrives as keys.
    Paste(String),
    /// The background that the terminal reports.
    Background(Background),
    /// Mouse input, while the mouse is on.
    Mouse(Mouse),
    /// The newest tick and counters, for numbers and the mode.
    Snapshot(Box<Snapshot>),
    Recorder(RecorderStatus),
    /// State of the live view.
    Viewers(LiveStatus),
    /// Observers that watch this session.
    Observers(usize),
    /// The wait of the session for the storage of its study; none while there is none.
    Storage(Option<StorageWait>),
    /// One of the ticks for the charts.
    Tick(Box<Tick>),
    Record(Stamped),
    /// The jump of a trial of an earlier session, or one that a replay was asked for; every fifth tick.
    EarlierJump {
        trial: u32,
        ticks: Vec<Tick>,
    },
    Replay(ReplayStatus),
    /// An answer of the replay to a key.
    Answer(String),
    /// The trials, faults and lost parts of the whole recording; again when they change.
    Timeline(Box<ReplayTimeline>),
    /// A result of judging the trials of a replay again.
    Rejudged(RejudgeNews),
    /// Two trials of a replay, or of two recordings, to lay over each other.
    SideBySide(Box<SideBySide>),
    /// The replay jumped to another time; the records up to that time follow from the start.
    Rewound,
    /// SIGTSTP or its key.
    Suspend,
    /// The process continues after a stop: the arming checks are out of date.
    Resumed,
    /// The console ends the session: keys other than STOP have no effect any more.
    Leaving,
}

/// Mouse input; columns and rows count from 0 at the upper left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum Mouse {
    Click {
        column: u16,
        row: u16,
    },
    /// The wheel was turned away from the operator.
    WheelUp,
    /// The wheel was turned towards the operator.
    WheelDown,
}

/// An effect outside of the model, carried out by the program's loop.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum Effect {
    Stop,
    Request(OperatorRequest),
    Replay(ReplayCommand),
    Bell,
    /// Put the row of this trial on the clipboard of the operator's terminal.
    CopyTrial(u32),
    /// Judge the trials of the replay again by the configuration in a folder; empty: by the defaults.
    Rejudge(String),
    /// No longer.
    EndRejudge,
    /// Write the trial table to files beside the study.
    Export(ExportedRows),
    /// Write the best parameters as a configuration beside the study.
    ExportBest,
    Redraw,
    /// Switch mouse reports of the terminal on or off.
    Mouse(bool),
    /// Release the terminal and stop this process until it is continued.
    Suspend,
    /// Sit the robot down and end.
    Quit,
}

/// Rows of an exported table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExportedRows {
    /// Every trial, by number.
    All,
    /// The table as shown: filtered and sorted.
    Shown,
}

/// Results of judging the trials of a replay again.
#[derive(Debug, Clone)]
pub enum RejudgeNews {
    /// It begins.
    Begun {
        /// The folder of the configuration.
        configuration: String,
        /// Unit of the new objective.
        unit: String,
        /// Trials that will be judged.
        trials: usize,
    },
    /// A judged trial; the last one of a number counts.
    Trial(Box<RejudgedTrial>),
    /// All trials are judged.
    Done,
    /// They cannot be judged.
    Failed {
        /// The folder of the configuration, as it was typed; empty for the defaults.
        folder: String,
        /// Reason.
        reason: String,
    },
}

/// A command to the replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum ReplayCommand {
    PlayPause,
    /// Forward; pauses.
    Forward(ReplayStep),
    /// Back; pauses.
    Back(ReplayStep),
    Slower,
    Faster,
    PreviousMarker,
    NextMarker,
    /// The previous fall, or trial that tripped a limit, or fault.
    PreviousFall,
    NextFall,
    Start,
    End,
    /// To a time, ns since the recording began.
    Time(u64),
    /// To the begin of a trial.
    Trial(u32),
    /// Repeat the jump at the playhead, or the last one before it; again: play on.
    Loop,
    /// Slow motion in impulse and flight on or off.
    SlowMotion,
    /// Lay a trial beside the one at the playhead: of the second recording where there is one.
    Beside(u32),
    /// No trial beside another any longer.
    EndBeside,
    /// Read the whole jump of a trial, to lay it under the charts.
    Lay(u32),
}

impl ReplayCommand {
    /// Whether the playhead goes to another place, or on from where it is `playing` already or not.
    pub fn leaves_the_place(self, playing: bool) -> bool {
        match self {
            ReplayCommand::PlayPause => !playing,
            ReplayCommand::Slower
            | ReplayCommand::Faster
            | ReplayCommand::SlowMotion
            | ReplayCommand::Beside(_)
            | ReplayCommand::EndBeside
            | ReplayCommand::Lay(_) => false,
            _ => true,
        }
    }
}

/// Length of a single step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReplayStep {
    /// A tick of the controller, 1 ms.
    Tick,
    /// A sample of the charts, 5 ms.
    Frame,
    /// A second.
    Second,
}

/// State of the replay.
#[derive(Debug, Clone, PartialEq, Default)]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct ReplayStatus {
    pub playing: bool,
    /// Recorded seconds per second.
    pub speed: f64,
    /// Present position, ns since the recording began.
    pub time_ns: u64,
    /// Length of the recording, ns.
    pub duration_ns: u64,
    /// Whether impulse and flight are played in slow motion.
    pub slow_motion: bool,
    /// The trial whose jump is repeated.
    pub looping: Option<u32>,
    /// The trial at the playhead, or else the last one before it, or the first one.
    pub present: Option<u32>,
    /// Time since the recording grew, ns, if it is being written and is followed.
    pub silent_ns: Option<u64>,
    /// Time from the playhead to the end of the recording at its last growth, ns.
    pub behind_ns: u64,
    /// The session that writes it, if its STOP can be reached.
    pub observer: Option<ObserverStatus>,
    /// Time that the parts found so far take that cannot be read, ns.
    pub lost_ns: u64,
}

/// Age from which what a followed recording shows counts as old, ns: the recording grows every second.
const OLD_NS: u64 = 2_500_000_000;

impl ReplayStatus {
    /// Age of what is shown, ns: the playhead's distance to the end, and the time since there was a later one. None for a
    /// recording that is not followed, and after the end of the session that wrote it.
    pub fn age_ns(&self) -> Option<u64> {
        let silent_ns = self.silent_ns.filter(|_| self.observer.is_none_or(|observer| !observer.ended))?;
        Some(silent_ns.saturating_add(self.behind_ns))
    }

    /// Whether a followed recording is shown as it is at present.
    pub fn shows_present(&self) -> bool {
        self.age_ns().is_some_and(|age_ns| age_ns <= OLD_NS)
    }

    /// The age of what a followed recording shows if that is old, ns.
    pub fn old_ns(&self) -> Option<u64> {
        self.age_ns().filter(|age_ns| *age_ns > OLD_NS)
    }

    /// Whether a later part of the recording is known than the one that is shown as old.
    pub fn later_is_known(&self) -> bool {
        self.old_ns().is_some() && self.behind_ns > OLD_NS
    }
}

/// The whole recording, wherever the playhead is.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReplayTimeline {
    /// Runs of trials, in the order of time.
    pub trials: Vec<TrialRun>,
    /// Begins of faults, ns.
    pub faults_ns: Vec<u64>,
    /// Begin and end of the parts found so far that cannot be read, ns.
    pub lost_ns: Vec<(u64, u64)>,
    /// The newest row of each trial.
    pub rows: BTreeMap<u32, TrialRecord>,
    /// Trials that fell, tripped a limit or were judged a fall at any time, whatever their verdict is now.
    pub falls: BTreeSet<u32>,
    /// The last place of a fall or a fault, ns; none without one.
    pub last_fall_ns: Option<u64>,
    /// Values that the operator has set in place of proposed ones.
    pub overrides: Overrides,
    /// The best trial at the end of the recording, by the rule of the table; none without an accepted one.
    pub best: Option<u32>,
    /// Begin of each file, ns, with its UTC time, ns since 1970: a session that continues a study begins another.
    pub begins_utc_ns: Vec<(u64, u64)>,
    /// The second recording; none without one.
    pub second: Option<SecondRecording>,
}

/// The recording whose trials are laid beside those of the first one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SecondRecording {
    /// Its first file.
    pub name: String,
    /// Numbers of the trials that have ticks.
    pub trials: BTreeSet<u32>,
}

/// Two trials with their ticks: A at the playhead, B beside it.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct SideBySide {
    pub a: ComparedTrial,
    pub b: ComparedTrial,
    /// Every fifth tick of A, on the clock of the replay.
    pub ticks_a: Vec<Tick>,
    /// Every fifth tick of B, on its own recording's clock.
    pub ticks_b: Vec<Tick>,
}

/// One of two compared trials.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedTrial {
    /// Its number.
    pub trial: u32,
    /// Its newest row in the whole recording; none where it is not recorded.
    pub row: Option<TrialRecord>,
    /// Unit of its objective.
    pub unit: String,
    /// The other recording that holds it; none for the one that is replayed.
    pub recording: Option<String>,
}

impl ReplayTimeline {
    /// The UTC time of a time of the replay, ns since 1970; none where the recording does not say when it began.
    pub fn utc_ns(&self, time_ns: u64) -> Option<u64> {
        let file = self.begins_utc_ns.partition_point(|(begin_ns, _)| *begin_ns <= time_ns).checked_sub(1)?;
        let (begin_ns, utc_ns) = self.begins_utc_ns[file];
        (utc_ns > begin_ns).then(|| utc_ns.saturating_add(time_ns - begin_ns))
    }

    /// Whether the recording has ticks of a trial: a continued study shows rows of earlier ones, too.
    pub fn has_ticks_of(&self, trial: u32) -> bool {
        self.trials.iter().any(|span| span.trial == trial)
    }

    /// Whether a trial can be laid beside another: it is in the second recording, or without one in this.
    pub fn has_beside(&self, trial: u32) -> bool {
        match &self.second {
            Some(second) => second.trials.contains(&trial),
            None => self.has_ticks_of(trial),
        }
    }

    /// The verdict of a trial; none before it is judged.
    pub fn verdict(&self, trial: u32) -> Option<Verdict> {
        self.rows.get(&trial)?.verdict
    }
}
