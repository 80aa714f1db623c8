//! The actions of the operator: names, default keys, help. `legal` says when each is possible.

use strum::{IntoStaticStr, VariantArray};

/// An action that a key can trigger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, VariantArray)]
#[expect(missing_docs, reason = "the help text of each action is in `ACTIONS`")]
pub enum Action {
    Stop,
    Interrupt,
    TakeControl,
    Arm,
    ArmingChecks,
    SitDown,
    Acknowledge,
    Approve,
    Override,
    ClearOverrides,
    Fix,
    Bounds,
    QueuePoint,
    Queue,
    Skip,
    Continue,
    ConfirmBest,
    ExportBest,
    Accept,
    Fall,
    Void,
    Rerun,
    Undo,
    HandValue,
    Note,
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
    Open,
    Report,
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
    Seek,
    PreviousFall,
    NextFall,
    ReplayStart,
    ReplayEnd,
    TickBack,
    TickForward,
    SecondBack,
    SecondForward,
    LoopJump,
    SlowMotion,
    Beside,
    EndComparison,
    Rejudge,
    Palette,
    Help,
    Theme,
    Mouse,
    Redraw,
    Suspend,
    Quit,
}

/// One row of the table of actions.
#[expect(missing_docs, reason = "the names say the rest")]
pub struct ActionInfo {
    pub action: Action,
    /// Its name in `console.toml` and in the palette.
    pub name: &'static str,
    /// Its default keys.
    pub keys: &'static [&'static str],
    /// Whether the keys cannot be changed.
    pub fixed: bool,
    pub group: ActionGroup,
    pub help: &'static str,
}

/// A section of the help, in the help's order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, VariantArray, IntoStaticStr)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum ActionGroup {
    Robot,
    Proposal,
    Verdict,
    Views,
    Charts,
    #[strum(serialize = "Tables and log")]
    Tables,
    Replay,
    Program,
}

impl Action {
    /// The action's row of the table.
    pub fn info(self) -> &'static ActionInfo {
        &ACTIONS[self as usize]
    }

    /// Whether it opens a view and does nothing else.
    pub fn opens_view(self) -> bool {
        self as usize >= Action::LiveView as usize && self as usize <= Action::PreviousView as usize
    }
}

const fn row(
    action: Action,
    name: &'static str,
    keys: &'static [&'static str],
    group: ActionGroup,
    help: &'static str,
) -> ActionInfo {
    ActionInfo { action, name, keys, fixed: false, group, help }
}

const fn fixed(info: ActionInfo) -> ActionInfo {
    ActionInfo { fixed: true, ..info }
}

/// Every action, in the order of [`Action`].
#[rustfmt::skip]
pub static ACTIONS: [ActionInfo; 86] = {
    use Action as A;
    use ActionGroup as G;
    [
        fixed(row(A::Stop, "stop", &["Space", "F12"], G::Robot, "STOP: damp all motors at once")),
        fixed(row(A::Interrupt, "interrupt", &["Ctrl-C"], G::Robot, "STOP; again within 2 s: quit")),
        row(A::TakeControl, "take-control", &["L"], G::Robot, "take control of a real robot: its first command"),
        row(A::Arm, "arm", &["A"], G::Robot, "arm: the robot stands up"),
        row(A::ArmingChecks, "pre-arm", &["P"], G::Robot, "arming checks, and your confirmation where one is needed"),
        row(A::SitDown, "sit-down", &["D"], G::Robot, "sit down and disarm"),
        row(A::Acknowledge, "acknowledge", &["k"], G::Robot, "acknowledge a stop or a fault: back to DISARMED"),

        row(A::Approve, "approve", &["g"], G::Proposal, "approve the jump; again after 0.8 s: countdown and jump"),
        row(A::Override, "override", &["o"], G::Proposal, "change parameters and gains of the proposal"),
        row(A::ClearOverrides, "clear-overrides", &["O"], G::Proposal, "restore the proposed values"),
        row(A::Fix, "fix", &["X"], G::Proposal, "Override: fix the parameter for the next trials, or search it again"),
        row(A::Bounds, "bounds", &["B"], G::Proposal, "Override: search the parameter within other bounds"),
        row(A::QueuePoint, "queue-point", &["Q"], G::Proposal, "queue this point ahead of the sampler's"),
        row(A::Queue, "queue", &["N"], G::Proposal, "the queue of the points that run next"),
        row(A::Skip, "skip", &["n"], G::Proposal, "skip the proposal, after a question; another follows"),
        row(A::Continue, "continue", &["C"], G::Proposal, "give a finished study more trials"),
        row(A::ConfirmBest, "confirm-best", &["K"], G::Proposal, "repeat the best points until one leads; again: end the repeats, after a question"),
        row(A::ExportBest, "export-best", &["E"], G::Proposal, "write the best parameters as a configuration beside the study"),

        row(A::Accept, "accept", &["a"], G::Verdict, "accept: it counts with its value (Trials, while none waits: change the selected row, with a reason)"),
        row(A::Fall, "fall", &["f"], G::Verdict, "fall: it counts as J = 0 (Trials: as accept)"),
        row(A::Void, "void", &["v"], G::Verdict, "void: cause outside the parameters; hidden from the sampler (Trials: as accept)"),
        row(A::Rerun, "re-run", &["r"], G::Verdict, "re-run: void, and the same parameters again (Trials: queue the row)"),
        row(A::Undo, "undo", &["u"], G::Verdict, "take the last verdict back, until the next trial runs or is skipped, or repeats begin or are called off"),
        row(A::HandValue, "hand-value", &["="], G::Verdict, "use a value measured by hand"),
        row(A::Note, "note", &["m"], G::Verdict, "write a note on a trial"),

        row(A::LiveView, "view-live", &["1"], G::Views, "Live: charts, proposal, trials"),
        row(A::TrialsView, "view-trials", &["2"], G::Views, "Trials: the whole table and details"),
        row(A::OptimizerView, "view-optimizer", &["3"], G::Views, "Optimizer: history, scatter, landings"),
        row(A::OverrideView, "view-override", &["4"], G::Views, "Override: the proposal and its bounds"),
        row(A::HealthView, "view-health", &["5"], G::Views, "Health: loop, link, motors, battery"),
        row(A::LogView, "view-log", &["6"], G::Views, "Log: events"),
        row(A::NextView, "next-view", &["Tab"], G::Views, "next view"),
        row(A::PreviousView, "previous-view", &["Shift-Tab"], G::Views, "previous view"),
        row(A::Up, "up", &["Up"], G::Views, "move up"),
        row(A::Down, "down", &["Down"], G::Views, "move down"),
        row(A::Left, "left", &["Left"], G::Views, "move left; Live: freeze the charts, cursor back"),
        row(A::Right, "right", &["Right"], G::Views, "move right; Live: freeze the charts, cursor on"),
        row(A::PageUp, "page-up", &["PgUp"], G::Views, "a page up"),
        row(A::PageDown, "page-down", &["PgDn"], G::Views, "a page down"),
        row(A::First, "first", &["Home"], G::Views, "to the first"),
        row(A::Last, "last", &["End"], G::Views, "to the last"),
        row(A::Open, "open", &["Enter"], G::Views, "details; never starts motion, acknowledges no stop; Trials of a replay: to the trial"),
        row(A::Report, "report", &["R"], G::Views, "tables of the study; quadfrog report adds other sessions"),

        row(A::Freeze, "freeze", &["z"], G::Charts, "freeze the charts; while a trial waits for its verdict: that trial or the present"),
        row(A::ZoomIn, "zoom-in", &["+"], G::Charts, "shorter time window"),
        row(A::ZoomOut, "zoom-out", &["-"], G::Charts, "longer time window"),
        row(A::ChartMode, "chart-mode", &["w"], G::Charts, "sweep or scroll"),
        row(A::Series, "series", &["t"], G::Charts, "next set: attitude, forces, motion, torques, your choice, joints, robot; Health: history"),
        row(A::ChooseSeries, "choose-series", &["T"], G::Charts, "choose the series of the charts: a set of its own"),
        row(A::Ghost, "ghost", &["c"], G::Charts, "best (Trials: selected) trial under the charts, ~ in Trials; a second one: compare both"),

        row(A::Sort, "sort", &["s"], G::Tables, "sort by the next: value, verdict, others from the left"),
        row(A::Reverse, "reverse", &["S"], G::Tables, "reverse the order"),
        row(A::Filter, "filter", &["F"], G::Tables, "Trials: only a verdict, or not run; Log: only a level"),
        row(A::Columns, "columns", &["x"], G::Tables, "choose the columns"),
        row(A::BestOnly, "best-only", &["b"], G::Tables, "only trials that were the best so far"),
        row(A::Search, "search", &["/"], G::Tables, "Trials: go to a trial by its number; Log: search the text"),
        row(A::Copy, "copy", &["y"], G::Tables, "copy the row to the terminal's clipboard"),
        row(A::Export, "export", &["e"], G::Tables, "write the table as CSV and Markdown beside the study"),

        row(A::PlayPause, "play-pause", &["p"], G::Replay, "play or pause"),
        row(A::StepForward, "step-forward", &["."], G::Replay, "a sample of the charts forward, 5 ms"),
        row(A::StepBack, "step-back", &[","], G::Replay, "a sample of the charts back"),
        row(A::Slower, "slower", &["<"], G::Replay, "half the speed"),
        row(A::Faster, "faster", &[">"], G::Replay, "twice the speed"),
        row(A::PreviousMarker, "previous-marker", &["["], G::Replay, "to the previous trial or fault"),
        row(A::NextMarker, "next-marker", &["]"], G::Replay, "to the next trial or fault"),
        row(A::Seek, "go-to", &["G"], G::Replay, "to a time, 12:34 or 75.5 s, a trial, #7 or trial 7, best or fall"),
        row(A::PreviousFall, "previous-fall", &["{"], G::Replay, "to the previous fall or fault"),
        row(A::NextFall, "next-fall", &["}"], G::Replay, "to the next fall or fault"),
        row(A::ReplayStart, "replay-start", &["("], G::Replay, "to the start"),
        row(A::ReplayEnd, "replay-end", &[")"], G::Replay, "to the end"),
        row(A::TickBack, "tick-back", &[";"], G::Replay, "a tick back, 1 ms"),
        row(A::TickForward, "tick-forward", &["'"], G::Replay, "a tick forward"),
        row(A::SecondBack, "second-back", &["j"], G::Replay, "a second back"),
        row(A::SecondForward, "second-forward", &["l"], G::Replay, "a second forward"),
        row(A::LoopJump, "loop-jump", &["i"], G::Replay, "repeat the jump at the playhead; again: play on"),
        row(A::SlowMotion, "slow-motion", &["H"], G::Replay, "impulse and flight at an eighth of the speed, on or off"),
        row(A::Beside, "beside", &["|"], G::Replay, "another trial (Trials: the selected one) beside the one at the playhead"),
        row(A::EndComparison, "end-comparison", &["Esc"], G::Replay, "no trial beside or under another any longer"),
        row(A::Rejudge, "rejudge", &["J"], G::Replay, "Trials judged again by another configuration, beside the old; again: without"),

        row(A::Palette, "palette", &[":"], G::Program, "all actions, and why some are not possible now"),
        row(A::Help, "help", &["?"], G::Program, "this help"),
        row(A::Theme, "theme", &["W"], G::Program, "colours for a dark or for a light background"),
        row(A::Mouse, "mouse", &["M"], G::Program, "mouse on or off: tabs, rows, wheel"),
        row(A::Redraw, "redraw", &["Ctrl-L"], G::Program, "draw the whole screen again"),
        row(A::Suspend, "suspend", &["Ctrl-Z"], G::Program, "suspend the program (only while the robot is not armed)"),
        row(A::Quit, "quit", &["q"], G::Program, "quit; asks while the robot is armed or a trial waits for its verdict"),
    ]
};
