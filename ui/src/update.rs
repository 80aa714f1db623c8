//! The only place that changes the [`Model`]: keys, the feed and the clock go in, effects on the world come out.

use std::time::Duration;

use quadfrog::realtime::telemetry::{Mode, Snapshot, Tick};
use quadfrog::recording::record::{CommandRecord, Level, Record, Source, Stage, Stamped, TrialRecord, Verdict};
use quadfrog::session::intent::Intent;

use crate::action::{Action, may_acknowledge, may_wish};
use crate::dialog::{self, Dialog, OverrideForm, Purpose};
use crate::keymap::Key;
use crate::model::{Columns, LOG_LINES, LogLine, Message, Model, ReplayStatus, SeriesSet, SortBy, View};
use crate::settings::{BellCause, ChartMode};

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
    /// The newest tick and counters, for numbers and the mode.
    Snapshot(Box<Snapshot>),
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
}

/// Something to be done to the world.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Stop the robot now.
    Stop,
    /// Ask the session.
    Wish(Intent),
    /// Move the replay.
    Replay(ReplayCommand),
    /// Ring the terminal's bell.
    Bell,
    /// Put text on the clipboard of the operator's terminal.
    Copy(String),
    /// Write the trial table to files beside the study.
    Export,
    /// Draw everything again.
    Redraw,
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
        Msg::Resize(_, rows) => {
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
        Msg::Snapshot(snapshot) => {
            model.snapshot = *snapshot;
            model.snapshot_at = model.clock;
            close_stale_dialog(model);
            Vec::new()
        }
        Msg::Tick(tick) => {
            model.history.push(&tick);
            Vec::new()
        }
        Msg::Record(stamped) => take_record(model, stamped),
        Msg::Replay(status) => {
            model.replay = Some(status);
            Vec::new()
        }
        Msg::Rewound => {
            model.history.clear();
            model.trials.clear();
            model.log.clear();
            model.log_view.back = 0;
            model.stage = None;
            model.proposal = None;
            Vec::new()
        }
        Msg::Terminate => vec![Effect::Quit],
        Msg::Suspend => perform(model, Action::Suspend),
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
        return wish(model, Intent::Cancel);
    }
    if model.dialog.is_some() {
        return dialog::key(model, key);
    }
    match action {
        Some(action) => perform(model, action),
        None => {
            let help = model.keymap.key(Action::Help);
            say(model, Level::Info, format!("{key} does nothing here; {help} shows the keys"));
            Vec::new()
        }
    }
}

/// Stops the robot. What lies over the view closes, so that the robot is seen; a half-written note stays.
fn stop(model: &mut Model, word: &str) -> Vec<Effect> {
    if model.replay.is_some() {
        say(model, Level::Info, "this is a replay: there is no robot to stop".to_owned());
        return Vec::new();
    }
    if !matches!(model.dialog, Some(Dialog::Field { .. })) {
        model.dialog = None;
    }
    say(model, Level::Warning, format!("{word}: damping"));
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
    say(model, Level::Warning, text.to_owned());
    effects
}

/// Asks the session, if this console may ask at all: the one gate for replays and observers.
pub fn wish(model: &mut Model, intent: Intent) -> Vec<Effect> {
    let allowed = if intent == Intent::Acknowledge { may_acknowledge(model) } else { may_wish(model) };
    match allowed {
        Ok(()) => vec![Effect::Wish(intent)],
        Err(reason) => {
            say(model, Level::Warning, format!("refused: {reason}"));
            Vec::new()
        }
    }
}

/// Does an action, or says why not.
pub fn perform(model: &mut Model, action: Action) -> Vec<Effect> {
    if let Err(reason) = action.legal(model) {
        say(model, Level::Warning, format!("{}: {reason}", action.info().name));
        return Vec::new();
    }
    match action {
        Action::Stop => stop(model, "STOP"),
        Action::Interrupt => interrupt(model),
        Action::Arm => wish(model, Intent::Arm),
        Action::SitDown => wish(model, Intent::SitDown),
        Action::Acknowledge => wish(model, Intent::Acknowledge),
        Action::Approve => open_approval(model),
        Action::Override => open_override(model),
        Action::ClearOverrides => wish(model, Intent::ClearOverrides),
        Action::Skip => wish(model, Intent::Skip),
        Action::Continue => open(model, Dialog::field(Purpose::Continue, "20")),
        Action::Accept => wish(model, Intent::Judge(Verdict::Accept)),
        Action::Fall => wish(model, Intent::Judge(Verdict::Fall)),
        Action::Void => wish(model, Intent::Judge(Verdict::Void)),
        Action::Rerun => rerun(model),
        Action::Undo => wish(model, Intent::Undo),
        Action::HandValue => match model.under_review().map(|trial| (trial.trial, trial.hand_value)) {
            Some((trial, value)) => {
                let text = value.map(|value| value.to_string()).unwrap_or_default();
                open(model, Dialog::field(Purpose::HandValue(trial), &text))
            }
            None => Vec::new(),
        },
        Action::Note => match model.trial_for_note().map(|trial| (trial.trial, trial.note.clone())) {
            Some((trial, note)) => open(model, Dialog::field(Purpose::Note(trial), &note)),
            None => Vec::new(),
        },
        Action::Open => open_details(model),
        Action::LiveView => show(model, View::Live),
        Action::TrialsView => show(model, View::Trials),
        Action::OptimizerView => show(model, View::Optimizer),
        Action::OverrideView => show(model, View::Override),
        Action::HealthView => show(model, View::Health),
        Action::LogView => show(model, View::Log),
        Action::NextView => show(model, neighbour_view(model.view, 1)),
        Action::PreviousView => show(model, neighbour_view(model.view, View::ALL.len() - 1)),
        Action::Up => move_by(model, -1),
        Action::Down => move_by(model, 1),
        Action::PageUp => move_by(model, -(model.page.max(2) as isize - 1)),
        Action::PageDown => move_by(model, model.page.max(2) as isize - 1),
        Action::First => move_by(model, isize::MIN),
        Action::Last => move_by(model, isize::MAX),
        Action::Left => move_cursor(model, -1),
        Action::Right => move_cursor(model, 1),
        Action::Freeze => freeze(model),
        Action::ZoomIn => zoom(model, 0.5),
        Action::ZoomOut => zoom(model, 2.0),
        Action::ChartMode => {
            model.live.mode = match model.live.mode {
                ChartMode::Sweep => ChartMode::Scroll,
                ChartMode::Scroll => ChartMode::Sweep,
            };
            Vec::new()
        }
        Action::Series => {
            model.live.series = match model.live.series {
                SeriesSet::Attitude => SeriesSet::Forces,
                SeriesSet::Forces => SeriesSet::Attitude,
            };
            Vec::new()
        }
        Action::Ghost => ghost(model),
        Action::Sort => {
            model.trials_view.sort = match model.trials_view.sort {
                SortBy::Number => SortBy::Value,
                SortBy::Value => SortBy::Verdict,
                SortBy::Verdict => SortBy::Number,
            };
            Vec::new()
        }
        Action::Filter => filter(model),
        Action::Columns => {
            model.trials_view.columns = match model.trials_view.columns {
                Columns::Parameters => Columns::Measured,
                Columns::Measured => Columns::Parameters,
            };
            Vec::new()
        }
        Action::BestOnly => {
            model.trials_view.best_only = !model.trials_view.best_only;
            Vec::new()
        }
        Action::Search => {
            let (purpose, text) = match model.view {
                View::Log => (Purpose::LogSearch, model.log_view.search.clone()),
                _ => (Purpose::TrialNumber, String::new()),
            };
            open(model, Dialog::field(purpose, &text))
        }
        Action::Copy => match model.selected_trial().map(|trial| crate::view::trials::as_text(trial, model)) {
            Some(text) => {
                say(model, Level::Info, "the row is on your terminal's clipboard (OSC 52)".to_owned());
                vec![Effect::Copy(text)]
            }
            None => Vec::new(),
        },
        Action::Export => vec![Effect::Export],
        Action::PlayPause => vec![Effect::Replay(ReplayCommand::PlayPause)],
        Action::StepForward => vec![Effect::Replay(ReplayCommand::StepForward)],
        Action::StepBack => vec![Effect::Replay(ReplayCommand::StepBack)],
        Action::Slower => vec![Effect::Replay(ReplayCommand::Slower)],
        Action::Faster => vec![Effect::Replay(ReplayCommand::Faster)],
        Action::PreviousMarker => vec![Effect::Replay(ReplayCommand::PreviousMarker)],
        Action::NextMarker => vec![Effect::Replay(ReplayCommand::NextMarker)],
        Action::Palette => open(model, Dialog::Palette { input: Default::default(), selected: 0 }),
        Action::Help => open(model, Dialog::Help { scroll: 0 }),
        Action::Redraw => vec![Effect::Redraw],
        Action::Suspend => vec![Effect::Suspend],
        Action::Quit if model.robot_needs_us() || model.stage_is(Stage::Review) && model.replay.is_none() => {
            open(model, Dialog::Quit)
        }
        Action::Quit => vec![Effect::Quit],
    }
}

/// Shows a line to the operator.
pub fn say(model: &mut Model, level: Level, text: String) {
    model.message = Some(Message { level, text });
}

fn open(model: &mut Model, dialog: Dialog) -> Vec<Effect> {
    model.dialog = Some(dialog);
    Vec::new()
}

fn open_approval(model: &mut Model) -> Vec<Effect> {
    let Some(proposal) = &model.proposal else { return Vec::new() };
    let (trial, revision) = (proposal.trial, proposal.revision);
    open(model, Dialog::Approve { trial, revision, pressed_at: model.clock })
}

fn open_override(model: &mut Model) -> Vec<Effect> {
    let Some(proposal) = model.proposal.clone() else { return Vec::new() };
    let form = OverrideForm::new(&proposal, model);
    open(model, Dialog::Override(form))
}

/// Enter: what lies nearest, as long as nothing moves by it.
fn open_details(model: &mut Model) -> Vec<Effect> {
    if may_acknowledge(model).is_ok() {
        return wish(model, Intent::Acknowledge);
    }
    if model.view == View::Override && Action::Override.legal(model).is_ok() {
        return open_override(model);
    }
    let trial = match model.view {
        View::Trials => model.selected_trial(),
        _ => model.under_review().or(model.trials.values().next_back()),
    };
    match trial.map(|trial| trial.trial) {
        Some(trial) => open(model, Dialog::Details { trial }),
        None => {
            say(model, Level::Info, "there is no trial yet".to_owned());
            Vec::new()
        }
    }
}

/// Under review: void and queue again. In the table: queue the chosen trial.
fn rerun(model: &mut Model) -> Vec<Effect> {
    let trial = match model.stage_is(Stage::Review) {
        true => None,
        false => model.selected_trial().map(|trial| trial.trial),
    };
    wish(model, Intent::Rerun { trial })
}

fn show(model: &mut Model, view: View) -> Vec<Effect> {
    model.view = view;
    Vec::new()
}

fn neighbour_view(view: View, step: usize) -> View {
    let index = View::ALL.iter().position(|v| *v == view).unwrap_or(0);
    View::ALL[(index + step) % View::ALL.len()]
}

/// Moves through the rows of the open view; `isize::MIN` and `MAX` go to the ends.
fn move_by(model: &mut Model, step: isize) -> Vec<Effect> {
    match model.view {
        View::Trials | View::Live => {
            let rows: Vec<u32> = model.table().iter().map(|trial| trial.trial).collect();
            let Some(last) = rows.len().checked_sub(1) else { return Vec::new() };
            let at = model.trials_view.selected.and_then(|n| rows.iter().position(|row| *row == n)).unwrap_or(last);
            let to = at.saturating_add_signed(step).min(last);
            // Standing on the newest row follows it.
            let follow = to == last && model.trials_view.sort == SortBy::Number;
            model.trials_view.selected = if follow { None } else { Some(rows[to]) };
        }
        View::Log => {
            let last = model.log_lines().count().saturating_sub(1);
            model.log_view.back = match step {
                isize::MIN => last,
                isize::MAX => 0,
                step => model.log_view.back.saturating_add_signed(-step).min(last),
            };
        }
        View::Override => {
            let last = model.session.parameters.len().saturating_sub(1);
            model.override_row = model.override_row.saturating_add_signed(step).min(last);
        }
        View::Optimizer | View::Health => {}
    }
    Vec::new()
}

/// Moves the charts' cursor; the first move freezes them.
fn move_cursor(model: &mut Model, step: i64) -> Vec<Effect> {
    if model.view != View::Live {
        return Vec::new();
    }
    if model.live.frozen.is_none() {
        freeze(model);
    }
    // A hundredth of the window: about one character of a chart.
    let step_ns = (model.live.window_s * 1e7) as i64 * step;
    let newest = model.charted().newest_ns();
    let oldest = newest.saturating_sub((model.live.window_s * 1e9) as u64);
    model.live.cursor_ns = model.live.cursor_ns.saturating_add_signed(step_ns).clamp(oldest, newest);
    Vec::new()
}

fn freeze(model: &mut Model) -> Vec<Effect> {
    model.live.frozen = match model.live.frozen.take() {
        Some(_) => None,
        None => {
            model.live.cursor_ns = model.history.newest_ns();
            Some((model.history.clone(), model.clock))
        }
    };
    Vec::new()
}

fn zoom(model: &mut Model, factor: f64) -> Vec<Effect> {
    model.live.window_s = (model.live.window_s * factor).clamp(1.0, 60.0);
    Vec::new()
}

/// Lays a trial under the charts: the selected one in Trials, else the best; the same again takes it away.
fn ghost(model: &mut Model) -> Vec<Effect> {
    let wanted = match model.view {
        View::Trials => model.selected_trial().map(|trial| trial.trial),
        _ => model.best().map(|trial| trial.trial),
    };
    let wanted = wanted.filter(|trial| model.history.trace(*trial).is_some());
    let (ghost, text) = match wanted {
        None => (None, "no trace of that trial: its jump was not seen".to_owned()),
        Some(trial) if model.live.ghost == Some(trial) => (None, "no trial is laid under the charts".to_owned()),
        Some(trial) => (Some(trial), format!("trial {trial} is laid under the charts of a jump")),
    };
    model.live.ghost = ghost;
    say(model, Level::Info, text);
    Vec::new()
}

fn filter(model: &mut Model) -> Vec<Effect> {
    match model.view {
        View::Log => {
            model.log_view.back = 0;
            model.log_view.level = match model.log_view.level {
                None => Some(Level::Warning),
                Some(Level::Warning) => Some(Level::Error),
                Some(_) => None,
            };
        }
        _ => {
            model.trials_view.filter = match model.trials_view.filter {
                None => Some(Verdict::Accept),
                Some(Verdict::Accept) => Some(Verdict::Fall),
                Some(Verdict::Fall) => Some(Verdict::Void),
                Some(Verdict::Void) => None,
            };
        }
    }
    Vec::new()
}

/// An approval holds for the card that was on the screen and while the robot stands; anything else closes the question.
fn close_stale_dialog(model: &mut Model) {
    let stale = match &model.dialog {
        Some(Dialog::Approve { trial, revision, .. }) => {
            let on_table = model.proposal.as_ref().map(|p| (p.trial, p.revision));
            on_table != Some((*trial, *revision)) || Action::Approve.legal(model).is_err()
        }
        Some(Dialog::Arm) => Action::Arm.legal(model).is_err(),
        Some(Dialog::Override(form)) => {
            model.proposal.as_ref().is_none_or(|p| p.trial != form.trial) || Action::Override.legal(model).is_err()
        }
        _ => false,
    };
    if stale {
        model.dialog = None;
        say(model, Level::Warning, "the question was closed: the situation has changed".to_owned());
    }
}

fn take_record(model: &mut Model, stamped: Stamped) -> Vec<Effect> {
    let time_ns = stamped.time_ns;
    let mut bells = Vec::new();
    match stamped.record {
        Record::Session(info) => {
            let text = format!(
                "{} on {} ({}), {} {}, seed {}",
                info.task, info.robot, info.backend, info.sampler, info.version, info.seed
            );
            model.session = info;
            log(model, time_ns, Level::Info, "session", text, false);
        }
        Record::Transition(change) => {
            let stopped = matches!(change.to, Mode::Damped | Mode::Fault);
            let level = match change.to {
                Mode::Fault => Level::Error,
                Mode::Damped => Level::Warning,
                _ => Level::Info,
            };
            if stopped {
                model.stopped_because = change.cause.clone();
                // The key that stopped has been answered already.
                if change.cause != "STOP"
                    || !model.message.as_ref().is_some_and(|message| message.text.starts_with("STOP"))
                {
                    say(model, level, format!("{}: {}", change.to.name(), change.cause));
                }
            }
            if change.to == Mode::Fault {
                bells.push(BellCause::Fault);
            }
            let text = format!("{} {} {}: {}", change.from.name(), model.theme.arrow(), change.to.name(), change.cause);
            log(model, time_ns, level, "mode", text, change.to == Mode::Fault);
        }
        Record::Stage(info) => {
            let entered = model.stage.is_none_or(|before| (before.stage, before.trial) != (info.stage, info.trial));
            model.stage = Some(info);
            if entered {
                match info.stage {
                    Stage::Proposed => bells.push(BellCause::Proposal),
                    Stage::Review => {
                        bells.push(BellCause::Verdict);
                        say_suggestion(model, info.trial);
                    }
                    Stage::Running => {}
                    Stage::Finished => {
                        say(model, Level::Info, "the study is finished".to_owned());
                        log(model, time_ns, Level::Info, "study", "finished".to_owned(), true);
                    }
                }
            }
        }
        Record::Proposal(proposal) => {
            let values: Vec<String> =
                proposal.parameters.iter().map(|p| format!("{} {:.4}", p.name, p.value)).collect();
            let text = format!("trial {} ({}): {}", proposal.trial, proposal.source.name(), values.join(", "));
            log(model, time_ns, Level::Info, "proposal", text, proposal.revision == 0);
            model.proposal = Some(proposal);
        }
        Record::Trial(trial) => {
            if trial.verdict.is_none() && trial.suggested == Some(Verdict::Fall) {
                bells.push(BellCause::Fall);
            }
            log_trial(model, time_ns, &trial);
            let number = trial.trial;
            model.trials.insert(number, trial);
            if model.under_review().is_some_and(|trial| trial.trial == number && trial.hand_value.is_none()) {
                say_suggestion(model, number);
            }
        }
        Record::Command(command) => answer(model, time_ns, command),
        Record::Counters(counters) => model.snapshot.counters = counters,
        Record::Log(line) => {
            if line.level > Level::Info {
                say(model, line.level, line.message.clone());
            }
            log(model, time_ns, line.level, &line.source, line.message, false);
        }
        Record::PreArm(list) => model.pre_arm = list,
        Record::FaultTicks(ticks) => {
            let text = format!("the last {} ticks before the fault are in the recording", ticks.len());
            log(model, time_ns, Level::Error, "control", text, false);
        }
    }
    close_stale_dialog(model);
    let rings = bells.iter().any(|cause| model.bell.contains(cause)) && model.replay.is_none();
    if rings { vec![Effect::Bell] } else { Vec::new() }
}

/// What the rules think of the trial under review; its row and its stage come in either order.
fn say_suggestion(model: &mut Model, trial: u32) {
    let Some(row) = model.trials.get(&trial).filter(|row| row.verdict.is_none()) else { return };
    let Some(suggested) = row.suggested else { return };
    let level = if suggested == Verdict::Accept { Level::Info } else { Level::Warning };
    let text = format!("trial #{trial} looks like {}: {}", suggested.name(), row.cause);
    say(model, level, text);
}

fn answer(model: &mut Model, time_ns: u64, command: CommandRecord) {
    let (level, outcome) = if command.accepted { (Level::Info, "") } else { (Level::Warning, "refused: ") };
    let text = match command.answer.as_str() {
        "" => command.wish.clone(),
        answer => format!("{}: {outcome}{answer}", command.wish),
    };
    say(model, level, text.clone());
    log(model, time_ns, level, "operator", text, false);
}

/// A line where a trial's verdict or suggestion is new; rows repeat for other reasons too.
fn log_trial(model: &mut Model, time_ns: u64, trial: &TrialRecord) {
    let before = model.trials.get(&trial.trial);
    let known = |field: fn(&TrialRecord) -> Option<Verdict>| before.and_then(field) == field(trial);
    let text = match (trial.verdict, trial.suggested) {
        (Some(verdict), _) if !known(|t| t.verdict) => {
            let value = trial.value.map(|v| format!(", J = {v:.3} {}", model.session.unit)).unwrap_or_default();
            let source =
                if trial.source == Source::Sampler { String::new() } else { format!(" ({})", trial.source.name()) };
            format!("trial {}{source}: {}{value}", trial.trial, verdict.name())
        }
        (None, Some(verdict)) if !known(|t| t.suggested) => {
            let cause = if trial.cause.is_empty() { String::new() } else { format!(": {}", trial.cause) };
            format!("trial {} looks like {}{cause}", trial.trial, verdict.name())
        }
        _ => return,
    };
    log(model, time_ns, Level::Info, "trial", text, trial.verdict.is_some());
}

fn log(model: &mut Model, time_ns: u64, level: Level, source: &str, text: String, marker: bool) {
    if model.log.len() == LOG_LINES {
        model.log.pop_front();
    }
    model.log.push_back(LogLine { time_ns, level, source: source.to_owned(), text, marker });
    // A reader who has scrolled back stays on the same lines.
    if model.log_view.back > 0 {
        model.log_view.back += 1;
    }
}
