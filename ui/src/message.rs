//! Messages into the model and effects out of it.

use std::time::Duration;

use quadfrog::recording::record::Stamped;
use quadfrog::recording::recorder::RecorderStatus;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::session::storage::StorageWait;
use quadfrog::telemetry::{Snapshot, Tick};

use crate::keymap::Key;

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
    /// Mouse input, while the mouse is on.
    Mouse(Mouse),
    /// The newest tick and counters, for numbers and the mode.
    Snapshot(Box<Snapshot>),
    Recorder(RecorderStatus),
    /// The wait of the session for the storage of its study; none while there is none.
    Storage(Option<StorageWait>),
    /// One of the ticks for the charts.
    Tick(Box<Tick>),
    Record(Stamped),
    Replay(ReplayStatus),
    /// The replay jumped to another time; the records up to that time follow from the start.
    Rewound,
    /// SIGTSTP or its key.
    Suspend,
    /// The process continues after a stop: the arming checks are out of date.
    Resumed,
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
    /// Write the trial table to files beside the study.
    Export,
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

/// A command to the replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum ReplayCommand {
    PlayPause,
    /// One chart tick forward; pauses.
    StepForward,
    /// One chart tick back; pauses.
    StepBack,
    Slower,
    Faster,
    PreviousMarker,
    NextMarker,
}

/// State of the replay.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct ReplayStatus {
    pub playing: bool,
    /// Recorded seconds per second.
    pub speed: f64,
    /// Present position, ns since the recording began.
    pub time_ns: u64,
    /// Length of the recording, ns.
    pub duration_ns: u64,
}
