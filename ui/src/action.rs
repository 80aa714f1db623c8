//! What the operator can do: one table of actions with their default keys, when they are legal and what they do in
//! words. Dispatch, the help overlay, the palette and the next-step line are all made of it.

use quadfrog::realtime::telemetry::Mode;
use quadfrog::recording::record::{Stage, Verdict};

use crate::model::{Model, View};

/// One thing that a key can do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "each action is explained in words in `ACTIONS`, where the operator's help comes from")]
pub enum Action {
    Stop,
    Interrupt,
    Arm,
    PreArm,
    Approve,
    SitDown,
    Acknowledge,
    Accept,
    Fall,
    Void,
    Rerun,
    Undo,
    HandValue,
    Note,
    Override,
    ClearOverrides,
    Fix,
    Bounds,
    QueuePoint,
    Skip,
    Continue,
    ConfirmBest,
    ExportBest,
    Open,
    LiveView,
    TrialsView,
    OptimizerView,
    OverrideView,
    HealthView,
    LogView,
    NextView,
    PreviousView,
    Up,
    Down,
    Left,
    Right,
    PageUp,
    PageDown,
    First,
    Last,
    Freeze,
    ZoomIn,
    ZoomOut,
    ChartMode,
    Series,
    ChooseSeries,
    Ghost,
    Sort,
    Reverse,
    Filter,
    Columns,
    BestOnly,
    Search,
    Copy,
    Export,
    PlayPause,
    StepForward,
    StepBack,
    Slower,
    Faster,
    PreviousMarker,
    NextMarker,
    Palette,
    Help,
    Mouse,
    Redraw,
    Suspend,
    Quit,
}

/// Why an action cannot be done now, in words for the operator.
pub type Legality = Result<(), String>;

/// One row of the table of actions.
pub struct ActionInfo {
    /// The action.
    pub action: Action,
    /// Its name in `console.toml` and in the palette.
    pub name: &'static str,
    /// Its default keys.
    pub keys: &'static [&'static str],
    /// Whether the keys may not be changed.
    pub fixed: bool,
    /// Where the help shows it.
    pub group: Group,
    /// What it does.
    pub help: &'static str,
    /// Whether it can be done now, and if not, why.
    pub legal: fn(&Model) -> Legality,
}

/// A heading of the help.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Group {
    /// Stopping, arming, sitting down.
    Robot,
    /// The proposal on the table.
    Proposal,
    /// Judging a trial.
    Verdict,
    /// Tabs and moving about.
    Views,
    /// Charts of the live view.
    Charts,
    /// Tables and the log.
    Tables,
    /// Playing a recording.
    Replay,
    /// The program itself.
    Program,
}

impl Group {
    /// All groups, as the help shows them.
    pub const ALL: [Group; 8] = [
        Group::Robot,
        Group::Proposal,
        Group::Verdict,
        Group::Views,
        Group::Charts,
        Group::Tables,
        Group::Replay,
        Group::Program,
    ];

    /// Its heading.
    pub const fn title(self) -> &'static str {
        match self {
            Group::Robot => "Robot",
            Group::Proposal => "Proposal",
            Group::Verdict => "Verdict",
            Group::Views => "Views",
            Group::Charts => "Charts",
            Group::Tables => "Tables and log",
            Group::Replay => "Replay",
            Group::Program => "Program",
        }
    }
}

impl Action {
    /// The action's row of the table.
    pub fn info(self) -> &'static ActionInfo {
        ACTIONS.iter().find(|info| info.action == self).expect("every action has a row")
    }

    /// Whether it can be done now, and if not, why.
    pub fn legal(self, model: &Model) -> Legality {
        (self.info().legal)(model)
    }
}

const fn row(
    action: Action,
    name: &'static str,
    keys: &'static [&'static str],
    group: Group,
    help: &'static str,
    legal: fn(&Model) -> Legality,
) -> ActionInfo {
    ActionInfo { action, name, keys, fixed: false, group, help, legal }
}

const fn fixed(info: ActionInfo) -> ActionInfo {
    ActionInfo { fixed: true, ..info }
}

/// Every action, once.
#[rustfmt::skip]
pub const ACTIONS: [ActionInfo; 68] = {
    use Action as A;
    use Group as G;
    [
        fixed(row(A::Stop, "stop", &["Space", "F12"], G::Robot, "STOP: damp all motors at once, from any screen", always)),
        fixed(row(A::Interrupt, "interrupt", &["Ctrl-C"], G::Robot, "STOP; again within 2 s: quit", always)),
        row(A::Arm, "arm", &["A"], G::Robot, "arm: the robot stands up", may_arm),
        row(A::PreArm, "pre-arm", &["P"], G::Robot, "the pre-arm list, and your word on what only you can see", always),
        row(A::SitDown, "sit-down", &["D"], G::Robot, "sit down and disarm", may_sit_down),
        row(A::Acknowledge, "acknowledge", &["k"], G::Robot, "acknowledge a stop or a fault: back to DISARMED", may_acknowledge),

        row(A::Approve, "approve", &["g"], G::Proposal, "approve the jump; again after 0.3 s: countdown and jump", may_approve),
        row(A::Override, "override", &["o"], G::Proposal, "change parameters and gains of the proposal", may_change_proposal),
        row(A::ClearOverrides, "clear-overrides", &["O"], G::Proposal, "back to what was proposed", may_clear_overrides),
        row(A::Fix, "fix", &["X"], G::Proposal, "Override: fix the parameter for the next trials, or search it again", may_fix),
        row(A::Bounds, "bounds", &["B"], G::Proposal, "Override: search the parameter within other bounds", may_bound),
        row(A::QueuePoint, "queue-point", &["Q"], G::Proposal, "queue this point; it comes before the sampler's", may_queue),
        row(A::Skip, "skip", &["n"], G::Proposal, "refuse the proposal and ask for another", may_change_proposal),
        row(A::Continue, "continue", &["C"], G::Proposal, "give a finished study more trials", may_continue),
        row(A::ConfirmBest, "confirm-best", &["K"], G::Proposal, "repeat the best points until one leads; again: end that", may_confirm),
        row(A::ExportBest, "export-best", &["E"], G::Proposal, "write the best parameters as a configuration beside the study", may_export_best),

        row(A::Accept, "accept", &["a"], G::Verdict, "accept: it counts with its value", may_judge),
        row(A::Fall, "fall", &["f"], G::Verdict, "fall: it counts as J = 0", may_judge),
        row(A::Void, "void", &["v"], G::Verdict, "void: the cause was not the parameters; hidden from the sampler", may_judge),
        row(A::Rerun, "re-run", &["r"], G::Verdict, "re-run: void, and the same parameters again (Trials: queue the row)", may_rerun),
        row(A::Undo, "undo", &["u"], G::Verdict, "take the last verdict back, until the next approval", may_undo),
        row(A::HandValue, "hand-value", &["="], G::Verdict, "use a value measured by hand", may_judge),
        row(A::Note, "note", &["m"], G::Verdict, "write a note on a trial", may_note),

        row(A::LiveView, "view-live", &["1"], G::Views, "Live: charts, proposal, trials", always),
        row(A::TrialsView, "view-trials", &["2"], G::Views, "Trials: the whole table and details", always),
        row(A::OptimizerView, "view-optimizer", &["3"], G::Views, "Optimizer: history, scatter, landings", always),
        row(A::OverrideView, "view-override", &["4"], G::Views, "Override: the proposal and its bounds", always),
        row(A::HealthView, "view-health", &["5"], G::Views, "Health: loop, link, motors, battery", always),
        row(A::LogView, "view-log", &["6"], G::Views, "Log: what happened", always),
        row(A::NextView, "next-view", &["Tab"], G::Views, "next view", always),
        row(A::PreviousView, "previous-view", &["Shift-Tab"], G::Views, "previous view", always),
        row(A::Up, "up", &["Up"], G::Views, "move up", always),
        row(A::Down, "down", &["Down"], G::Views, "move down", always),
        row(A::Left, "left", &["Left"], G::Views, "move left; Live: cursor back", always),
        row(A::Right, "right", &["Right"], G::Views, "move right; Live: cursor on", always),
        row(A::PageUp, "page-up", &["PgUp"], G::Views, "a page up", always),
        row(A::PageDown, "page-down", &["PgDn"], G::Views, "a page down", always),
        row(A::First, "first", &["Home"], G::Views, "to the first", always),
        row(A::Last, "last", &["End"], G::Views, "to the last", always),
        row(A::Open, "open", &["Enter"], G::Views, "details; acknowledges while DAMPED or FAULT; never starts motion", always),

        row(A::Freeze, "freeze", &["z"], G::Charts, "freeze the charts; recording goes on", always),
        row(A::ZoomIn, "zoom-in", &["+"], G::Charts, "shorter time window", always),
        row(A::ZoomOut, "zoom-out", &["-"], G::Charts, "longer time window", always),
        row(A::ChartMode, "chart-mode", &["w"], G::Charts, "sweep or scroll", always),
        row(A::Series, "series", &["t"], G::Charts, "next set: attitude and feet, forces, joints", always),
        row(A::ChooseSeries, "choose-series", &["T"], G::Charts, "choose the series of the charts", always),
        row(A::Ghost, "ghost", &["c"], G::Charts, "lay the best (Trials: the selected) trial under the charts; a second one: compare the two", may_ghost),

        row(A::Sort, "sort", &["s"], G::Tables, "sort by the next column", in_trials),
        row(A::Reverse, "reverse", &["S"], G::Tables, "turn the order round", in_trials),
        row(A::Filter, "filter", &["F"], G::Tables, "Trials: only a verdict; Log: only a level", in_table),
        row(A::Columns, "columns", &["x"], G::Tables, "choose the columns", in_trials),
        row(A::BestOnly, "best-only", &["b"], G::Tables, "only trials that were the best so far", in_trials),
        row(A::Search, "search", &["/"], G::Tables, "Trials: jump to a number; Log: search", in_table),
        row(A::Copy, "copy", &["y"], G::Tables, "copy the row to the clipboard of your terminal", in_trials),
        row(A::Export, "export", &["e"], G::Tables, "write the table as CSV and Markdown beside the study", in_trials),

        row(A::PlayPause, "play-pause", &["p"], G::Replay, "play or pause", in_replay),
        row(A::StepForward, "step-forward", &["."], G::Replay, "a step forward", in_replay),
        row(A::StepBack, "step-back", &[","], G::Replay, "a step back", in_replay),
        row(A::Slower, "slower", &["<"], G::Replay, "half the speed", in_replay),
        row(A::Faster, "faster", &[">"], G::Replay, "twice the speed", in_replay),
        row(A::PreviousMarker, "previous-marker", &["["], G::Replay, "to the previous trial or fault", in_replay),
        row(A::NextMarker, "next-marker", &["]"], G::Replay, "to the next trial or fault", in_replay),

        row(A::Palette, "palette", &[":"], G::Program, "all actions, and why some are not possible now", always),
        row(A::Help, "help", &["?"], G::Program, "this help", always),
        row(A::Mouse, "mouse", &["M"], G::Program, "mouse on or off: tabs, rows, wheel", always),
        row(A::Redraw, "redraw", &["Ctrl-L"], G::Program, "draw the whole screen again", always),
        row(A::Suspend, "suspend", &["Ctrl-Z"], G::Program, "suspend the program (only while the robot is not armed)", may_suspend),
        row(A::Quit, "quit", &["q"], G::Program, "quit; asks if the robot is armed", always),
    ]
};

fn always(_: &Model) -> Legality {
    Ok(())
}

fn refuse(reason: impl Into<String>) -> Legality {
    Err(reason.into())
}

/// Whether this session may ask the engine for anything. Checked here and again where wishes leave the model.
pub fn may_wish(model: &Model) -> Legality {
    if model.replay.is_some() {
        return refuse("this is a replay: there is nothing to command");
    }
    if model.session.observe {
        return refuse("this session only observes");
    }
    Ok(())
}

fn stage_is(model: &Model, stage: Stage) -> bool {
    model.stage.is_some_and(|info| info.stage == stage)
}

/// What stands in the way while the robot is busy by itself; none when it lies or stands waiting.
fn busy(mode: Mode) -> Option<&'static str> {
    match mode {
        Mode::Offline | Mode::Observe => Some("the robot does not answer yet"),
        Mode::StandUp => Some("the robot is standing up"),
        Mode::Countdown => Some("the countdown runs"),
        Mode::Jump => Some("the robot is jumping"),
        Mode::Settle => Some("the robot is settling"),
        Mode::SitDown => Some("the robot is sitting down"),
        Mode::Damped => Some("the robot was stopped: acknowledge first"),
        Mode::Fault => Some("a fault is latched: acknowledge first"),
        Mode::Disarmed | Mode::Ready | Mode::Review => None,
    }
}

fn may_arm(model: &Model) -> Legality {
    may_wish(model)?;
    match model.mode() {
        mode if busy(mode).is_some() => refuse(busy(mode).unwrap_or_default()),
        Mode::Disarmed if stage_is(model, Stage::Review) => refuse("the last trial waits for its verdict"),
        Mode::Disarmed if model.pre_arm.is_empty() => refuse("the pre-arm list is still being made"),
        Mode::Disarmed => match model.pre_arm_failing().count() {
            0 => Ok(()),
            count => refuse(format!(
                "{count} checks of the pre-arm list do not hold: {} shows them",
                model.keymap.key(Action::PreArm)
            )),
        },
        _ => refuse("the robot is armed already"),
    }
}

fn may_sit_down(model: &Model) -> Legality {
    may_wish(model)?;
    match model.mode() {
        Mode::StandUp | Mode::Ready | Mode::Review => Ok(()),
        Mode::Disarmed => refuse("the robot is disarmed already"),
        mode => refuse(busy(mode).unwrap_or("not now")),
    }
}

/// Whether there is something to acknowledge. An observer may, too: STOP is everybody's, and so is letting go afterwards.
pub fn may_acknowledge(model: &Model) -> Legality {
    if !model.session.observe {
        may_wish(model)?;
    }
    match model.mode() {
        Mode::Damped | Mode::Fault => Ok(()),
        _ => refuse("nothing waits to be acknowledged"),
    }
}

fn may_approve(model: &Model) -> Legality {
    may_change_proposal(model)?;
    match model.mode() {
        Mode::Ready => Ok(()),
        Mode::Disarmed => refuse(format!("the robot is not standing: press {} first", model.keymap.key(Action::Arm))),
        mode => refuse(busy(mode).unwrap_or("the robot is not ready")),
    }
}

fn may_change_proposal(model: &Model) -> Legality {
    may_wish(model)?;
    match model.stage.map(|info| info.stage) {
        Some(Stage::Proposed) if model.proposal_on_table().is_some() => Ok(()),
        Some(Stage::Review) => refuse("the last trial waits for its verdict"),
        Some(Stage::Running) => refuse("a trial is running"),
        Some(Stage::Finished) => {
            refuse(format!("the study is finished: {} gives it more trials", model.keymap.key(Action::Continue)))
        }
        _ => refuse("there is no proposal yet"),
    }
}

/// Whether the search may be changed: not while a trial is under way.
fn may_search(model: &Model) -> Legality {
    may_wish(model)?;
    match model.stage.map(|info| info.stage) {
        Some(Stage::Proposed | Stage::Finished) => Ok(()),
        Some(Stage::Review) => refuse("the last trial waits for its verdict"),
        Some(Stage::Running) => refuse("a trial is running"),
        None => refuse("the session has not begun"),
    }
}

fn may_bound(model: &Model) -> Legality {
    may_search(model)?;
    if model.view != View::Override {
        return refuse("only in the view Override");
    }
    match model.override_parameter() {
        Some(_) => Ok(()),
        None => refuse("gains are not searched"),
    }
}

fn may_fix(model: &Model) -> Legality {
    may_bound(model)?;
    let fixed = model.override_parameter().and_then(|info| model.searched(&info.name)?.fixed);
    match (fixed, model.override_value()) {
        (None, None) => refuse("there is no proposal whose value could be kept"),
        _ => Ok(()),
    }
}

fn may_queue(model: &Model) -> Legality {
    may_change_proposal(model)
}

fn may_confirm(model: &Model) -> Legality {
    may_search(model)?;
    let stood = model.trials.values().filter(|trial| trial.verdict == Some(Verdict::Accept));
    if stood.count() < 2 { refuse("two accepted trials are needed to compare") } else { Ok(()) }
}

fn may_export_best(model: &Model) -> Legality {
    may_wish(model)?;
    match (model.best(), model.session.study.is_empty()) {
        (None, _) => refuse("no trial was accepted yet"),
        (_, true) => refuse("this session keeps no study"),
        _ => Ok(()),
    }
}

fn may_clear_overrides(model: &Model) -> Legality {
    may_change_proposal(model)?;
    match model.proposal_on_table() {
        Some(proposal) if proposal.parameters.iter().chain(&proposal.gains).any(|p| p.value != p.proposed) => Ok(()),
        _ => refuse("nothing was overridden"),
    }
}

fn may_continue(model: &Model) -> Legality {
    may_wish(model)?;
    if stage_is(model, Stage::Finished) { Ok(()) } else { refuse("the study is not finished") }
}

fn may_judge(model: &Model) -> Legality {
    may_wish(model)?;
    if stage_is(model, Stage::Review) { Ok(()) } else { refuse("no trial waits for a verdict") }
}

fn may_rerun(model: &Model) -> Legality {
    may_wish(model)?;
    if stage_is(model, Stage::Review) {
        return Ok(());
    }
    match model.selected_trial() {
        Some(trial) if model.view == View::Trials && trial.verdict.is_some() => Ok(()),
        _ => refuse("no trial waits for a verdict; in Trials, select a judged one"),
    }
}

fn may_undo(model: &Model) -> Legality {
    may_wish(model)?;
    if model.stage.is_some_and(|info| info.can_undo) { Ok(()) } else { refuse("no verdict can be taken back") }
}

fn may_note(model: &Model) -> Legality {
    may_wish(model)?;
    if model.trial_for_note().is_some() { Ok(()) } else { refuse("there is no trial yet") }
}

fn may_ghost(model: &Model) -> Legality {
    if model.history.traces().next().is_some() { Ok(()) } else { refuse("no jump has been seen yet") }
}

fn in_trials(model: &Model) -> Legality {
    if model.view == View::Trials { Ok(()) } else { refuse("only in the view Trials") }
}

fn in_table(model: &Model) -> Legality {
    if matches!(model.view, View::Trials | View::Log) { Ok(()) } else { refuse("only in the views Trials and Log") }
}

fn in_replay(model: &Model) -> Legality {
    if model.replay.is_some() { Ok(()) } else { refuse("only in a replay") }
}

fn may_suspend(model: &Model) -> Legality {
    if model.robot_needs_us() {
        refuse(format!(
            "the robot is armed; {} sits it down, then the program can be suspended",
            model.keymap.key(Action::SitDown)
        ))
    } else {
        Ok(())
    }
}
