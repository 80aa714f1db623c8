//! The only place that changes the [`Model`]: keys, the feed and the clock go in, effects on the world come out.
//!
//! What a key does is in `perform` and `navigate`, what a record of the session changes in `records`, the mouse in `mouse`.

mod mouse;
mod navigate;
mod perform;
mod records;

use std::time::Duration;

use quadfrog::recording::record::{LogLevel, Stamped};
use quadfrog::recording::recorder::RecorderStatus;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{Mode, Snapshot, Tick};

use crate::action::{Action, may_acknowledge, may_wish};
use crate::dialog::{self, Dialog};
use crate::keymap::Key;
use crate::model::{Message, Model, ReplayStatus};

pub use mouse::Mouse;
pub use perform::perform;

/// A second Ctrl-C within this time quits.
pub const INTERRUPT_WINDOW: Duration = Duration::from_secs(2);

/// Something that happened.
#[expect(clippy::large_enum_variant, reason = "records are few; the many ticks are boxed")]
#[derive(Debug, Clone)]
pub enum Msg {
    /// Time since the console started.
    Clock(Duration),
    /// The terminal has this many columns and rows.
    Resize(u16, u16),
    /// A key was pressed.
    Key(Key),
    /// Text was pasted; it is never read as keys.
    Paste(String),
    /// The mouse was used, while it is on.
    Mouse(Mouse),
    /// The newest tick and counters, for numbers and the mode.
    Snapshot(Box<Snapshot>),
    /// How the recorder is doing.
    Recorder(RecorderStatus),
    /// One of the ticks for the charts.
    Tick(Box<Tick>),
    /// A record of the session.
    Record(Stamped),
    /// How the replay stands.
    Replay(ReplayStatus),
    /// The replay jumped: what was known is not the past of what follows, which is told from the start.
    Rewound,
    /// SIGTERM: sit down and end.
    Terminate,
    /// SIGTSTP or its key.
    Suspend,
    /// The process was stopped and goes on: what was checked before is old.
    Resumed,
}

/// Something to be done to the world.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Stop the robot now.
    Stop,
    /// Ask the session.
    Wish(OperatorRequest),
    /// Move the replay.
    Replay(ReplayCommand),
    /// Ring the terminal's bell.
    Bell,
    /// Put text on the clipboard of the operator's terminal.
    Copy(String),
    /// Write the trial table to files beside the study.
    Export,
    /// Write the best parameters as a configuration beside the study.
    ExportBest,
    /// Draw everything again.
    Redraw,
    /// Ask the terminal for the mouse's clicks, or leave them to it.
    Mouse(bool),
    /// Give the terminal back and stop this process until it is continued.
    Suspend,
    /// Sit the robot down and end.
    Quit,
}

/// What can be done to a replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReplayCommand {
    /// Play or pause.
    PlayPause,
    /// A tick of the charts forward; pauses.
    StepForward,
    /// A tick back; pauses.
    StepBack,
    /// Half the speed.
    Slower,
    /// Twice the speed.
    Faster,
    /// To the marker before.
    PreviousMarker,
    /// To the marker after.
    NextMarker,
}

/// Folds one happening into the model.
pub fn update(model: &mut Model, msg: Msg) -> Vec<Effect> {
    match msg {
        Msg::Clock(now) => {
            model.clock = now;
            Vec::new()
        }
        Msg::Resize(columns, rows) => {
            model.size = (columns, rows);
            // The frame, the tabs, a heading and the two lines below are not part of a page.
            model.page = usize::from(rows.saturating_sub(7)).max(1);
            Vec::new()
        }
        Msg::Key(key) => press(model, key),
        Msg::Paste(text) => {
            // One key per character, but only where text is taken, and without what a key could command.
            if model.dialog.as_ref().is_some_and(Dialog::takes_text) {
                for c in text.chars().filter(|c| !c.is_control()) {
                    if let Ok(key) = c.to_string().parse::<Key>() {
                        dialog::key(model, key);
                    }
                }
            }
            Vec::new()
        }
        Msg::Mouse(event) => mouse::take(model, event),
        Msg::Snapshot(snapshot) => {
            model.snapshot = *snapshot;
            model.snapshot_at = model.clock;
            records::close_stale_dialog(model);
            Vec::new()
        }
        Msg::Recorder(status) => {
            model.recorder = Some(status);
            Vec::new()
        }
        Msg::Tick(tick) => {
            model.history.push(&tick);
            Vec::new()
        }
        Msg::Record(stamped) => records::take(model, stamped),
        Msg::Replay(status) => {
            model.replay = Some(status);
            Vec::new()
        }
        Msg::Rewound => {
            model.history.clear();
            model.trials.clear();
            model.ran.clear();
            model.pre_arm.clear();
            model.search = None;
            model.insight = None;
            model.points.clear();
            model.log.clear();
            model.log_view.back = 0;
            model.stage = None;
            model.proposal = None;
            Vec::new()
        }
        Msg::Terminate => vec![Effect::Quit],
        Msg::Suspend => perform(model, Action::Suspend),
        Msg::Resumed => {
            model.pre_arm.clear();
            Vec::new()
        }
    }
}

/// One key. STOP comes before everything else, on every screen.
fn press(model: &mut Model, key: Key) -> Vec<Effect> {
    let action = model.keymap.action(key);
    let typing = model.dialog.as_ref().is_some_and(Dialog::takes_text);
    match action {
        // A text field may have the space bar only while the robot is not armed.
        Some(Action::Stop) if key.typed().is_some() && typing && !model.robot_needs_us() => {}
        Some(Action::Stop) => return stop(model, "STOP"),
        Some(Action::Interrupt) => return interrupt(model),
        _ => {}
    }
    if model.mode() == Mode::Countdown && may_wish(model).is_ok() {
        model.dialog = None;
        return wish(model, OperatorRequest::Cancel);
    }
    if model.dialog.is_some() {
        return dialog::key(model, key);
    }
    match action {
        Some(action) => perform(model, action),
        None => {
            let help = model.keymap.key(Action::Help);
            say(model, LogLevel::Info, format!("{key} does nothing here; {help} shows the keys"));
            Vec::new()
        }
    }
}

/// Stops the robot. What lies over the view closes, so that the robot is seen; a half-written note stays.
fn stop(model: &mut Model, word: &str) -> Vec<Effect> {
    if model.replay.is_some() {
        say(model, LogLevel::Info, "this is a replay: there is no robot to stop".to_owned());
        return Vec::new();
    }
    if !matches!(model.dialog, Some(Dialog::Field { .. })) {
        model.dialog = None;
    }
    say(model, LogLevel::Warning, format!("{word}: damping"));
    vec![Effect::Stop]
}

fn interrupt(model: &mut Model) -> Vec<Effect> {
    let again = model.interrupted_at.is_some_and(|at| model.clock.saturating_sub(at) < INTERRUPT_WINDOW);
    model.interrupted_at = Some(model.clock);
    if again {
        return vec![Effect::Quit];
    }
    let effects = stop(model, "STOP");
    let text = if effects.is_empty() {
        "Ctrl-C again within 2 s quits"
    } else {
        "STOP: damping. Ctrl-C again within 2 s quits"
    };
    say(model, LogLevel::Warning, text.to_owned());
    effects
}

/// Asks the session, if this console may ask at all: the one gate for replays and observers.
pub fn wish(model: &mut Model, intent: OperatorRequest) -> Vec<Effect> {
    let allowed = if intent == OperatorRequest::Acknowledge { may_acknowledge(model) } else { may_wish(model) };
    match allowed {
        Ok(()) => vec![Effect::Wish(intent)],
        Err(reason) => {
            say(model, LogLevel::Warning, format!("refused: {reason}"));
            Vec::new()
        }
    }
}

/// Shows a line to the operator.
pub fn say(model: &mut Model, level: LogLevel, text: String) {
    model.message = Some(Message { level, text });
}
