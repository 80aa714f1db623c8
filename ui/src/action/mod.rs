//! What the operator can do: one table of actions with their default keys, when they are legal and what they do in
//! words. Dispatch, the help overlay, the palette and the next-step line are all made of it.

mod legal;

use crate::model::Model;
use legal::*;
pub use legal::{may_acknowledge, may_wish};

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

        row(A::Approve, "approve", &["g"], G::Proposal, "approve the jump; again after 0.8 s: countdown and jump", may_approve),
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
