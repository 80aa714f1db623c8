//! What the screen shows. Plain data; [`crate::update::update`] alone changes it.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use quadfrog::realtime::telemetry::{Mode, Snapshot};
use quadfrog::recording::record::{
    Level, ParameterInfo, PreArmCheck, Proposal, SessionInfo, Source, Stage, StageInfo, TrialRecord, Verdict,
};
use quadfrog::robot::description::RobotDescription;

use crate::dialog::Dialog;
use crate::history::History;
use crate::keymap::Keymap;
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
    pub level: Level,
    /// What is said.
    pub text: String,
}

/// What a line of the log is about, for colours and for the filter.
#[derive(Debug, Clone, PartialEq)]
pub struct LogLine {
    /// Time since the engine started, ns.
    pub time_ns: u64,
    /// How grave.
    pub level: Level,
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
    /// Which set of series is drawn.
    pub series: SeriesSet,
    /// The history as it was when the charts were frozen, and when (console's clock).
    pub frozen: Option<(History, Duration)>,
    /// Time under the cursor while frozen, ns.
    pub cursor_ns: u64,
    /// The trial laid under the charts.
    pub ghost: Option<u32>,
}

/// What the charts of the live view show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeriesSet {
    /// Roll, pitch and the four foot heights.
    Attitude,
    /// Base height, oscillator phase and the four foot forces.
    Forces,
}

/// State of the trial table.
#[derive(Debug, Clone, Default)]
pub struct TrialsView {
    /// The chosen trial; none follows the newest.
    pub selected: Option<u32>,
    /// Column that the rows are sorted by.
    pub sort: SortBy,
    /// Only this verdict.
    pub filter: Option<Verdict>,
    /// Only trials that were the best when they ran.
    pub best_only: bool,
    /// Whether the measured terms stand in place of the parameters.
    pub columns: Columns,
}

/// What the trial table is sorted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SortBy {
    /// Number, oldest first.
    #[default]
    Number,
    /// Value, best first; trials without a value last.
    Value,
    /// Verdict.
    Verdict,
}

/// Which columns the trial table has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Columns {
    /// The parameters.
    #[default]
    Parameters,
    /// The measured terms.
    Measured,
}

/// State of the log view.
#[derive(Debug, Clone, Default)]
pub struct LogView {
    /// Lines above the newest; 0 follows.
    pub back: usize,
    /// The lowest level shown.
    pub level: Option<Level>,
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
    pub stage: Option<StageInfo>,
    /// The proposal on the table.
    pub proposal: Option<Proposal>,
    /// The pre-arm list as it was shown last; empty before the robot was disarmed for the first time.
    pub pre_arm: Vec<PreArmCheck>,
    /// The study.
    pub trials: BTreeMap<u32, TrialRecord>,
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
    /// Rows that page up and page down move by, from the terminal's height.
    pub page: usize,
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
            trials: BTreeMap::new(),
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
                series: SeriesSet::Attitude,
                frozen: None,
                cursor_ns: 0,
                ghost: None,
            },
            trials_view: TrialsView::default(),
            override_row: 0,
            log_view: LogView::default(),
            replay: None,
            interrupted_at: None,
            page: 10,
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
    pub fn stage_is(&self, stage: Stage) -> bool {
        self.stage.is_some_and(|info| info.stage == stage)
    }

    /// The trial that waits for its verdict.
    pub fn under_review(&self) -> Option<&TrialRecord> {
        let info = self.stage.filter(|info| info.stage == Stage::Review)?;
        self.trials.get(&info.trial)
    }

    /// The proposal that waits for approval; an older one, still drawn while its trial runs, does not count.
    pub fn proposal_on_table(&self) -> Option<&Proposal> {
        let info = self.stage.filter(|info| info.stage == Stage::Proposed)?;
        self.proposal.as_ref().filter(|proposal| proposal.trial == info.trial)
    }

    /// The parameter of that name with its bounds.
    pub fn parameter(&self, name: &str) -> Option<&ParameterInfo> {
        self.session.parameters.iter().find(|parameter| parameter.name == name)
    }

    /// The accepted trial with the highest value; the earlier one of equals.
    pub fn best(&self) -> Option<&TrialRecord> {
        self.best_so_far().last()
    }

    /// The accepted trials that were better than all before them, in order.
    pub fn best_so_far(&self) -> impl Iterator<Item = &TrialRecord> + '_ {
        let mut best = f64::NEG_INFINITY;
        self.trials.values().filter(move |trial| match accepted_value(trial) {
            Some(value) if value > best => {
                best = value;
                true
            }
            _ => false,
        })
    }

    /// How many trials count for the budget: those with a verdict other than void.
    pub fn counted(&self) -> usize {
        self.trials.values().filter(|trial| matches!(trial.verdict, Some(Verdict::Accept | Verdict::Fall))).count()
    }

    /// The rows of the trial table as sorted and filtered.
    pub fn table(&self) -> Vec<&TrialRecord> {
        let view = &self.trials_view;
        let mut rows: Vec<&TrialRecord> = if view.best_only {
            self.best_so_far().collect()
        } else {
            self.trials.values().filter(|trial| view.filter.is_none() || trial.verdict == view.filter).collect()
        };
        match view.sort {
            SortBy::Number => {}
            // Without a value last: -inf is below every value.
            SortBy::Value => rows.sort_by(|a, b| {
                let value = |trial: &TrialRecord| trial.value.unwrap_or(f64::NEG_INFINITY);
                value(b).total_cmp(&value(a))
            }),
            SortBy::Verdict => rows.sort_by_key(|trial| {
                trial.verdict.map_or(usize::MAX, |verdict| Verdict::ALL.iter().position(|v| *v == verdict).unwrap_or(0))
            }),
        }
        rows
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
        trial.source != Source::Sampler
    }
}

/// The value of an accepted trial.
pub fn accepted_value(trial: &TrialRecord) -> Option<f64> {
    trial.value.filter(|_| trial.verdict == Some(Verdict::Accept))
}
