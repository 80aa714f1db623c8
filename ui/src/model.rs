//! What the screen shows. Plain data; [`crate::update::update`] alone changes it.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use quadfrog::recording::record::{ArmingCheckRecord, LogLevel, SessionInfo, StageRecord};
use quadfrog::recording::recorder::RecorderStatus;
use quadfrog::robot::description::RobotDescription;
use quadfrog::telemetry::{Mode, Snapshot};
use quadfrog::trial::{
    ExperimentStage, ParameterInfo, PointRecord, Proposal, ProposalInsight, ProposalSource, SearchStatus,
    SearchedParameter, TrialRecord, Verdict,
};

use crate::column::{Column, SortBy};
use crate::comparison::Comparison;
use crate::dialog::Dialog;
use crate::history::History;
use crate::keymap::Keymap;
use crate::series::Series;
use crate::settings::{BellCause, ChartMode, Settings};
use crate::theme::Theme;

/// Lines that the log keeps.
pub const LOG_LINES: usize = 10_000;

/// One of the tabs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the words of the tabs")]
pub enum View {
    Live,
    Trials,
    Optimizer,
    Override,
    Health,
    Log,
}

impl View {
    /// All views in the order of their tabs.
    pub const ALL: [View; 6] = [View::Live, View::Trials, View::Optimizer, View::Override, View::Health, View::Log];

    /// The word on its tab.
    pub const fn name(self) -> &'static str {
        match self {
            View::Live => "Live",
            View::Trials => "Trials",
            View::Optimizer => "Optimizer",
            View::Override => "Override",
            View::Health => "Health",
            View::Log => "Log",
        }
    }
}

/// The line that answers the operator.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// How grave.
    pub level: LogLevel,
    /// What is said.
    pub text: String,
}

/// What a line of the log is about, for colours and for the filter.
#[derive(Debug, Clone, PartialEq)]
pub struct LogLine {
    /// Time since the engine started, ns.
    pub time_ns: u64,
    /// How grave.
    pub level: LogLevel,
    /// Which part speaks.
    pub source: String,
    /// The line.
    pub text: String,
    /// Whether a trial was proposed, judged, or a fault latched here.
    pub marker: bool,
}

/// How a replay stands.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplayStatus {
    /// Name of the file.
    pub file: String,
    /// Whether it plays.
    pub playing: bool,
    /// Recorded seconds per second.
    pub speed: f64,
    /// Where it stands, ns since the recording began.
    pub time_ns: u64,
    /// How long the recording is, ns.
    pub duration_ns: u64,
}

/// State of the live view's charts.
#[derive(Debug, Clone)]
pub struct LiveView {
    /// Sweep or scroll.
    pub mode: ChartMode,
    /// Time that a chart shows, s.
    pub window_s: f64,
    /// Whether the sweep's cursor is drawn as a line; the gap before it says the same with less to send.
    pub cursor_line: bool,
    /// Charts, or the joints in their place.
    pub panel: Panel,
    /// The series that are drawn, in the order of the charts.
    pub series: Vec<Series>,
    /// The history as it was when the charts were frozen, and when (console's clock).
    pub frozen: Option<(History, Duration)>,
    /// Time under the cursor while frozen, ns.
    pub cursor_ns: u64,
    /// The trial laid under the charts of a jump.
    pub ghost: Option<u32>,
    /// Two trials in place of the present; none shows the present.
    pub comparison: Option<Comparison>,
}

/// What the large area of the live view shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Panel {
    /// Signals over time.
    Charts,
    /// Torque and speed of the joints, and the robot as a wireframe.
    Joints,
}

/// State of the trial table.
#[derive(Debug, Clone, Default)]
pub struct TrialsView {
    /// The chosen trial; none follows the newest.
    pub selected: Option<u32>,
    /// What the rows are sorted by.
    pub sort: SortBy,
    /// Whether the order is turned round; rows without a value stay last.
    pub reversed: bool,
    /// Only this verdict.
    pub filter: Option<Verdict>,
    /// Only trials that were the best when they ran.
    pub best_only: bool,
    /// The columns beside the number.
    pub columns: Vec<Column>,
}

/// When a trial of this session ran, ns since the engine started.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunTime {
    /// Its approval.
    pub begun_ns: u64,
    /// The end of its measurement; none while it runs.
    pub ended_ns: Option<u64>,
}

/// State of the log view.
#[derive(Debug, Clone, Default)]
pub struct LogView {
    /// Lines above the newest; 0 follows.
    pub back: usize,
    /// The lowest level shown.
    pub level: Option<LogLevel>,
    /// Only lines that hold this text.
    pub search: String,
}

/// Everything that the screen shows.
#[derive(Debug, Clone)]
pub struct Model {
    /// Colours and characters.
    pub theme: Theme,
    /// The active keys.
    pub keymap: Keymap,
    /// What rings the bell.
    pub bell: Vec<BellCause>,
    /// The machine, for limits and the wireframe; none where it is not known.
    pub robot: Option<RobotDescription>,
    /// Time since the console started.
    pub clock: Duration,
    /// What this session is.
    pub session: SessionInfo,
    /// The newest tick and counters.
    pub snapshot: Snapshot,
    /// When the newest tick arrived, on the console's clock.
    pub snapshot_at: Duration,
    /// Where the session is in a trial's life.
    pub stage: Option<StageRecord>,
    /// The proposal on the table.
    pub proposal: Option<Proposal>,
    /// The pre-arm list as it was shown last; empty before the robot was disarmed for the first time.
    pub pre_arm: Vec<ArmingCheckRecord>,
    /// What is searched at present; none before the session has said so.
    pub search: Option<SearchStatus>,
    /// Why the newest proposal of the sampler was made.
    pub insight: Option<ProposalInsight>,
    /// Points that were run more than once.
    pub points: Vec<PointRecord>,
    /// How the recorder is doing; none in a replay.
    pub recorder: Option<RecorderStatus>,
    /// The study.
    pub trials: BTreeMap<u32, TrialRecord>,
    /// When the trials of this session ran.
    pub ran: BTreeMap<u32, RunTime>,
    /// What the charts draw.
    pub history: History,
    /// What happened, oldest first.
    pub log: VecDeque<LogLine>,
    /// The newest answer to the operator.
    pub message: Option<Message>,
    /// Why the robot was stopped, while DAMPED or FAULT.
    pub stopped_because: String,
    /// The open tab.
    pub view: View,
    /// What lies over it.
    pub dialog: Option<Dialog>,
    /// Charts.
    pub live: LiveView,
    /// Trial table.
    pub trials_view: TrialsView,
    /// Row of view Override.
    pub override_row: usize,
    /// Log.
    pub log_view: LogView,
    /// How the replay stands; none in a live session.
    pub replay: Option<ReplayStatus>,
    /// When Ctrl-C was pressed last.
    pub interrupted_at: Option<Duration>,
    /// The terminal's columns and rows.
    pub size: (u16, u16),
    /// Rows that page up and page down move by, from the terminal's height.
    pub page: usize,
    /// Whether clicks and the wheel reach the console; otherwise the terminal keeps them for selecting and copying.
    pub mouse: bool,
}

impl Model {
    /// An empty screen.
    pub fn new(settings: Settings, theme: Theme, robot: Option<RobotDescription>) -> Model {
        Model {
            theme,
            keymap: settings.keymap,
            bell: settings.bell,
            robot,
            clock: Duration::ZERO,
            session: SessionInfo::default(),
            snapshot: Snapshot::default(),
            snapshot_at: Duration::ZERO,
            stage: None,
            proposal: None,
            pre_arm: Vec::new(),
            search: None,
            insight: None,
            points: Vec::new(),
            recorder: None,
            trials: BTreeMap::new(),
            ran: BTreeMap::new(),
            history: History::default(),
            log: VecDeque::new(),
            message: None,
            stopped_because: String::new(),
            view: View::Live,
            dialog: None,
            live: LiveView {
                mode: settings.chart_mode,
                window_s: settings.chart_window_s,
                cursor_line: !settings.low_bandwidth,
                panel: Panel::Charts,
                series: settings.chart_series,
                frozen: None,
                cursor_ns: 0,
                ghost: None,
                comparison: None,
            },
            trials_view: TrialsView { columns: settings.trial_columns, ..TrialsView::default() },
            override_row: 0,
            log_view: LogView::default(),
            replay: None,
            interrupted_at: None,
            size: (0, 0),
            page: 10,
            mouse: settings.mouse,
        }
    }

    /// The robot's mode, from the newest tick.
    pub fn mode(&self) -> Mode {
        self.snapshot.tick.mode
    }

    /// Whether leaving now would leave an energised robot to itself.
    pub fn robot_needs_us(&self) -> bool {
        self.replay.is_none() && self.mode().energised()
    }

    /// The stage, where it is known.
    pub fn stage_is(&self, stage: ExperimentStage) -> bool {
        self.stage.is_some_and(|info| info.stage == stage)
    }

    /// The trial that waits for its verdict.
    pub fn under_review(&self) -> Option<&TrialRecord> {
        let info = self.stage.filter(|info| info.stage == ExperimentStage::Review)?;
        self.trials.get(&info.trial)
    }

    /// The proposal that waits for approval; an older one, still drawn while its trial runs, does not count.
    pub fn proposal_on_table(&self) -> Option<&Proposal> {
        let info = self.stage.filter(|info| info.stage == ExperimentStage::Proposed)?;
        self.proposal.as_ref().filter(|proposal| proposal.trial == info.trial)
    }

    /// The items of the pre-arm list that forbid arming.
    pub fn pre_arm_failing(&self) -> impl Iterator<Item = &ArmingCheckRecord> + '_ {
        self.pre_arm.iter().filter(|item| !item.state.allows())
    }

    /// Whether a machine is driven that can hurt somebody.
    pub fn is_hardware(&self) -> bool {
        self.session.is_hardware()
    }

    /// The parameter of that name with its present bounds.
    pub fn parameter(&self, name: &str) -> Option<ParameterInfo> {
        let info = self.session.parameters.iter().find(|parameter| parameter.name == name)?;
        Some(match self.searched(name) {
            Some(searched) => ParameterInfo { low: searched.low, high: searched.high, ..info.clone() },
            None => info.clone(),
        })
    }

    /// The gain of that name with the range in which it may be set.
    pub fn gain(&self, name: &str) -> Option<&ParameterInfo> {
        self.session.gains.iter().find(|gain| gain.name == name)
    }

    /// The value on the card of the parameter that the chosen row of view Override is about.
    pub fn override_value(&self) -> Option<f64> {
        let name = &self.override_parameter()?.name;
        self.proposal_on_table()?.parameters.iter().find(|p| p.name == *name).map(|p| p.value)
    }

    /// The accepted trial whose point is worth most, the earlier one of equals: a repeated point is worth the mean of its
    /// repeats.
    pub fn best(&self) -> Option<&TrialRecord> {
        self.best_so_far().last()
    }

    /// The accepted trials that were better than all before them, in order.
    pub fn best_so_far(&self) -> impl Iterator<Item = &TrialRecord> + '_ {
        let mut best = f64::NEG_INFINITY;
        self.trials.values().filter(move |trial| match self.worth(trial) {
            Some(value) if value > best => {
                best = value;
                true
            }
            _ => false,
        })
    }

    /// What the point of an accepted trial is worth.
    fn worth(&self, trial: &TrialRecord) -> Option<f64> {
        let value = accepted_value(trial)?;
        let point = self.points.iter().find(|point| point.trials.contains(&trial.trial));
        Some(point.map_or(value, |point| point.mean))
    }

    /// How many trials count for the budget: as the session says, or else those with a verdict other than void.
    pub fn counted(&self) -> usize {
        let judged = |trial: &&TrialRecord| matches!(trial.verdict, Some(Verdict::Accept | Verdict::Fall));
        match &self.search {
            Some(search) => search.counted as usize,
            None => self.trials.values().filter(judged).count(),
        }
    }

    /// How many trials the study is to have.
    pub fn budget(&self) -> u32 {
        self.search.as_ref().map_or(self.session.budget, |search| search.budget)
    }

    /// The parameter as it is searched at present.
    pub fn searched(&self, name: &str) -> Option<&SearchedParameter> {
        self.search.as_ref()?.parameters.iter().find(|parameter| parameter.name == name)
    }

    /// The parameter that the chosen row of view Override is about; none for a gain.
    pub fn override_parameter(&self) -> Option<&ParameterInfo> {
        self.session.parameters.get(self.override_row)
    }

    /// The row of the trial table that actions are about: the chosen one, or the newest.
    pub fn selected_trial(&self) -> Option<&TrialRecord> {
        match self.trials_view.selected {
            Some(number) => self.trials.get(&number),
            None => self.trials.values().next_back(),
        }
    }

    /// The trial that a note would be about.
    pub fn trial_for_note(&self) -> Option<&TrialRecord> {
        if self.view == View::Trials {
            self.selected_trial()
        } else {
            self.under_review().or(self.trials.values().next_back())
        }
    }

    /// The lines of the log that its filter lets through, oldest first.
    pub fn log_lines(&self) -> impl DoubleEndedIterator<Item = &LogLine> + '_ {
        let search = self.log_view.search.to_lowercase();
        let level = self.log_view.level;
        self.log.iter().filter(move |line| {
            level.is_none_or(|level| line.level >= level)
                && (search.is_empty() || line.text.to_lowercase().contains(&search) || line.source.contains(&search))
        })
    }

    /// What the charts draw: the running history, or the frozen one.
    pub fn charted(&self) -> &History {
        self.live.frozen.as_ref().map_or(&self.history, |(history, _)| history)
    }

    /// Whether a source was chosen by a person; shown as a mark in tables.
    pub fn by_hand(trial: &TrialRecord) -> bool {
        trial.source != ProposalSource::Sampler
    }
}

/// The value of an accepted trial.
pub fn accepted_value(trial: &TrialRecord) -> Option<f64> {
    trial.value.filter(|_| trial.verdict == Some(Verdict::Accept))
}
