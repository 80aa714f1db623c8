//! The content of the screen: plain data and questions to it. [`crate::update`] alone changes it.

pub(crate) mod comparison;
pub mod dialog;
pub(crate) mod health_history;
pub(crate) mod history;
pub mod jump_series;
pub(crate) mod landed;
pub(crate) mod live;
pub(crate) mod log;
pub(crate) mod rejudged;
pub mod session;
pub mod table_columns;
pub(crate) mod trials;

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::time::Duration;

use quadfrog::config::Config;
use quadfrog::engine::{ObserverStatus, TrialGround};
use quadfrog::recording::live::LiveStatus;
use quadfrog::recording::record::LogLevel;
use quadfrog::recording::recorder::RecorderStatus;
use quadfrog::recording::scene::Ground;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::storage::StorageWait;
use quadfrog::telemetry::{Mode, Snapshot};
use quadfrog::trial::{Backend, ParameterInfo, TrialRecord};
use strum::{IntoStaticStr, VariantArray};

use crate::action::Action;
use crate::column::Column;
use crate::keymap::Keymap;
use crate::message::{ReplayStatus, ReplayTimeline};
use crate::series::Series;
use crate::settings::{BellCause, ConsoleSettings};
use crate::theme::{Background, Theme, ThemeChoice};
use dialog::{Choice, Dialog};
use health_history::HealthHistory;
use history::SignalHistory;
use jump_series::JumpSeries;
use landed::LandedTrial;
use live::{LiveView, Panel};
use log::LogView;
use rejudged::RejudgedTable;
use session::SessionModel;
use trials::TrialTable;

/// Torque of a joint at rest that damping leaves: friction and the error of the motor's estimate, N m.
const DAMPED_TORQUE_N_M: f64 = 2.0;

/// Time after which an answer goes, and a report of the session is no news any more.
const NEWS_TIME: Duration = Duration::from_secs(15);
/// Time for which the answer to a key in a replay stays before what the recording says.
const READING_TIME: Duration = Duration::from_secs(4);

/// Tilt of a robot that no longer lies on its belly, rad: half a right angle.
const LYING_TILT_RAD: f64 = 0.25 * PI;

/// One of the tabs, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, VariantArray, IntoStaticStr)]
#[expect(missing_docs, reason = "the labels of the tabs")]
pub enum View {
    Live,
    Trials,
    Optimizer,
    Override,
    Health,
    Log,
}

impl View {
    /// The label of its tab.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// The message line: the newest answer to the operator.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct Notice {
    pub level: LogLevel,
    pub text: String,
    /// Whether it answers the STOP key.
    pub stop: bool,
    /// Whether it answers a request or a key: it goes with the next key that has an effect, or after its time.
    pub answer: bool,
    /// Whether it answers a key of this console, not of the operator of a session that is replayed.
    pub own: bool,
    /// When it was shown, on the console's clock.
    pub at: Duration,
}

impl Notice {
    /// Its age in whole minutes at `clock`.
    pub fn age_min(&self, clock: Duration) -> u64 {
        clock.saturating_sub(self.at).as_secs() / 60
    }

    /// Whether it is no news any more at `clock`.
    pub fn is_old(&self, clock: Duration) -> bool {
        clock.saturating_sub(self.at) >= NEWS_TIME
    }

    /// Whether it is an answer that who pressed the key may not have read yet at `clock`.
    pub fn is_being_read(&self, clock: Duration) -> bool {
        self.answer && self.own && clock.saturating_sub(self.at) < READING_TIME
    }
}

/// The robot, its limits, its ground and the rule that confirms the best, as far as they are known: by default nothing is.
#[derive(Debug, Clone, Default)]
pub struct RobotFacts {
    /// The robot's limits and geometry.
    pub description: Option<RobotDescription>,
    /// Largest roll and pitch before a trial is a fall, rad.
    pub fall_tilt_rad: Option<[f64; 2]>,
    /// The ground of the trials.
    pub ground: Option<TrialGround>,
    /// Number of points that a confirmation of the best compares.
    pub contenders: Option<usize>,
}

impl RobotFacts {
    /// The facts of a session with a configuration and the seed of its study.
    pub fn new(description: RobotDescription, config: &Config, backend: Backend, seed: u64) -> RobotFacts {
        let fall = &config.safety.fall;
        RobotFacts {
            description: Some(description),
            fall_tilt_rad: Some([fall.roll_rad, fall.pitch_rad]),
            ground: Some(TrialGround::new(config, backend, seed)),
            contenders: Some(config.optimize.confirm.contenders as usize),
        }
    }
}

/// The content of the screen.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct Model {
    pub theme: Theme,
    /// Whether the theme follows the background that the terminal reports.
    pub follow_background: bool,
    pub keymap: Keymap,
    pub bell: Vec<BellCause>,
    /// Whether Space stops an energised robot in a text field, too.
    pub space_always_stops: bool,
    /// The robot's limits and geometry; none where they are not known.
    pub robot: Option<RobotDescription>,
    /// Largest roll and pitch before a trial is a fall, rad; none where they are not known.
    pub fall_tilt_rad: Option<[f64; 2]>,
    /// Number of points that a confirmation of the best compares; none where it is not known.
    pub contenders: Option<usize>,
    /// The ground of every trial; none where it is not known.
    pub trial_ground: Option<TrialGround>,
    /// The ground of the running trial, or of the last one.
    pub ground: Option<Ground>,
    /// Time since the console started.
    pub clock: Duration,
    pub session: SessionModel,
    /// The newest tick and counters.
    pub snapshot: Snapshot,
    /// Arrival of the newest tick, on the console's clock.
    pub snapshot_at: Duration,
    /// State of the recorder; none in a replay.
    pub recorder: Option<RecorderStatus>,
    /// State of the live view; none without one.
    pub viewers: Option<LiveStatus>,
    /// Number of observers of this session; none where it cannot be watched.
    pub observers: Option<usize>,
    /// Wait of the session for the storage of its study.
    pub storage: Option<StorageWait>,
    /// Whether the console ends the session.
    pub leaving: bool,
    pub history: SignalHistory,
    pub health_history: HealthHistory,
    /// Whether view Health shows its history in place of the numbers.
    pub health_history_shown: bool,
    /// The jumps of the running trial.
    pub jump_series: JumpSeries,
    pub message: Option<Notice>,
    /// Message of a replayed session that waits until the answer to a key of this console is read.
    pub message_after_answer: Option<Notice>,
    pub view: View,
    pub dialog: Option<Dialog>,
    pub live: LiveView,
    pub trial_table: TrialTable,
    /// Selected row of view Override.
    pub override_row: usize,
    pub log_view: LogView,
    /// State of the replay; none in a live session.
    pub replay: Option<ReplayStatus>,
    /// The whole recording of the replay.
    pub timeline: Option<Box<ReplayTimeline>>,
    /// The trials of the replay as another configuration judges them; none without one.
    pub rejudged: Option<RejudgedTable>,
    /// Whole seconds left of a countdown, as the bell last rang them.
    pub countdown_s: Option<u32>,
    /// The newest verdict that was sent to the session, and when.
    pub judged: Option<(Action, Duration)>,
    /// When the open dialog was opened.
    pub dialog_opened_at: Duration,
    /// Time of the last Ctrl-C.
    pub interrupted_at: Option<Duration>,
    /// The terminal's columns and rows.
    pub size: (u16, u16),
    /// Whether the screen is drawn for the first time: joints and picture follow in the second frame, because over a slow link
    /// each takes a second and nothing is decided by them.
    pub first_frame: bool,
    /// Rows that page up and page down move by, from the terminal's height.
    pub page: usize,
    /// Whether the console receives clicks and the wheel; otherwise the terminal keeps them for selecting and copying.
    pub mouse: bool,
}

impl Model {
    /// An empty screen.
    pub fn new(settings: ConsoleSettings, mut theme: Theme, facts: RobotFacts) -> Model {
        match settings.theme {
            ThemeChoice::Auto => {}
            ThemeChoice::Dark => theme.background = Background::Dark,
            ThemeChoice::Light => theme.background = Background::Light,
        }
        Model {
            theme,
            follow_background: settings.theme == ThemeChoice::Auto,
            keymap: settings.keymap,
            bell: settings.bell,
            space_always_stops: settings.space_always_stops,
            robot: facts.description,
            fall_tilt_rad: facts.fall_tilt_rad,
            contenders: facts.contenders,
            trial_ground: facts.ground,
            ground: facts.ground.and_then(|ground| ground.of(None)),
            clock: Duration::ZERO,
            session: SessionModel::default(),
            snapshot: Snapshot::default(),
            snapshot_at: Duration::ZERO,
            recorder: None,
            viewers: None,
            observers: None,
            storage: None,
            leaving: false,
            history: SignalHistory::default(),
            health_history: HealthHistory::default(),
            health_history_shown: false,
            jump_series: JumpSeries::default(),
            message: None,
            message_after_answer: None,
            view: View::Live,
            dialog: None,
            live: LiveView {
                mode: settings.chart_mode,
                window_s: settings.chart_window_s,
                cursor_line: !settings.low_bandwidth,
                panel: Panel::Charts,
                chosen_series: live::own_choice(&settings.chart_series),
                series: settings.chart_series,
                frozen: None,
                cursor_ns: 0,
                ghost: None,
                comparison: None,
                present_in_review: false,
                landed_cursor_ns: None,
            },
            trial_table: TrialTable { columns: settings.trial_columns, ..TrialTable::default() },
            override_row: 0,
            log_view: LogView::default(),
            replay: None,
            timeline: None,
            rejudged: None,
            countdown_s: None,
            judged: None,
            dialog_opened_at: Duration::ZERO,
            interrupted_at: None,
            size: (0, 0),
            first_frame: false,
            page: 10,
            mouse: settings.mouse,
        }
    }

    /// The answer or warning to show: an answer from before the open dialog is none to what that asks.
    pub fn shown_message(&self) -> Option<&Notice> {
        let before = |message: &Notice| self.dialog.is_some() && message.at < self.dialog_opened_at;
        let stale = |message: &Notice| (message.level == LogLevel::Info || message.answer) && before(message);
        self.message.as_ref().filter(|message| !stale(message))
    }

    /// The error for which the recording is not complete; none while everything is recorded, and in a replay.
    pub fn recording_failure(&self) -> Option<&str> {
        self.recorder.as_ref()?.incomplete()
    }

    /// Whether the robot sends no states: what is known of it is of an earlier time, or nothing.
    pub fn robot_is_silent(&self) -> bool {
        self.history.is_silent().unwrap_or(self.runs_real_robot())
    }

    /// Whether this console runs the session of a real robot.
    pub fn runs_real_robot(&self) -> bool {
        self.replay.is_none() && self.session.info.is_hardware()
    }

    /// The robot's mode, from the newest tick.
    pub fn mode(&self) -> Mode {
        self.snapshot.tick.mode
    }

    /// The session that another process runs and this console watches; none otherwise.
    pub fn observer(&self) -> Option<ObserverStatus> {
        self.replay.as_ref()?.observer
    }

    /// Whether STOP reaches a robot: not in the replay of a recording, nor after the end of a watched session.
    pub fn can_stop(&self) -> bool {
        self.replay.is_none() || self.observer().is_some_and(|observer| !observer.ended)
    }

    /// Whether the robot is energised and this console commands it.
    pub fn robot_is_energised(&self) -> bool {
        self.replay.is_none() && self.mode().energised()
    }

    /// Whether a late tick matters: a simulated robot waits for it.
    pub fn lateness_matters(&self) -> bool {
        self.session.info.backend != Some(Backend::Simulator)
    }

    /// Whether a simulated robot is tilted so far that arming turns it upright first.
    pub fn simulated_robot_lies(&self) -> bool {
        let tilt_rad = self.snapshot.tick.estimate.tilt_rad();
        self.session.info.backend == Some(Backend::Simulator) && tilt_rad > LYING_TILT_RAD
    }

    /// Whether the arming checks are those of an earlier time: they run while the robot is disarmed.
    pub fn arming_checks_are_past(&self) -> bool {
        self.mode() != Mode::Disarmed && !self.session.arming_checks.is_empty()
    }

    /// Whether an observer's STOP is in force.
    pub fn stop_requested(&self) -> bool {
        self.replay.is_none() && matches!(self.mode(), Mode::Damped | Mode::Fault)
    }

    /// The joint and the torque, N m, that contradict damping most; none while the robot follows it.
    pub fn torque_against_stop(&self) -> Option<(usize, f64)> {
        let tick = &self.snapshot.tick;
        let (torque, velocity) = (&tick.state.joint_torque_n_m, &tick.state.joint_velocity_rad_s);
        let beyond = |joint: usize| {
            let damping = tick.command.motor[joint].kd_joint * velocity[joint].abs();
            torque[joint].abs() - 2.0 * damping - DAMPED_TORQUE_N_M
        };
        let worst = (0..tick.command.motor.len()).max_by(|a, b| beyond(*a).total_cmp(&beyond(*b)))?;
        (beyond(worst) > 0.0).then(|| (worst, torque[worst]))
    }

    /// Whether Space is text: a text field is open in which a space has a meaning.
    pub fn space_bar_is_text(&self) -> bool {
        self.dialog.as_ref().is_some_and(|dialog| dialog.takes_spaces(self.can_stop())) && !self.space_bar_must_stop()
    }

    /// Repeats that a confirmation of the best needs at least; 0 if that is not known.
    pub fn least_repeats(&self) -> usize {
        self.contenders.map_or(0, |contenders| self.session.trials.least_repeats(contenders))
    }

    /// Whether Space is STOP in a text field, too.
    pub fn space_bar_must_stop(&self) -> bool {
        self.space_always_stops && self.robot_is_energised()
    }

    /// Whether Space types although the robot is energised: the screen shows it in the colour of STOP.
    pub fn space_bar_is_text_while_energised(&self) -> bool {
        self.robot_is_energised() && self.space_bar_is_text()
    }

    /// Whether keys choose a row of the view: an open dialog takes them, and has a cursor of its own.
    pub fn chooses_row(&self) -> bool {
        self.dialog.is_none()
    }

    /// The parameter of the selected row of view Override; none for a gain.
    pub fn override_parameter(&self) -> Option<&ParameterInfo> {
        self.session.info.parameters.get(self.override_row)
    }

    pub(crate) fn override_value(&self) -> Option<f64> {
        let name = &self.override_parameter()?.name;
        self.session.open_proposal()?.parameters.iter().find(|p| p.name == *name).map(|p| p.value)
    }

    /// The rows of the trial table, sorted and filtered.
    pub fn trial_rows(&self) -> Vec<&TrialRecord> {
        let waiting = self.session.under_review().map(|row| row.trial);
        self.trial_table.rows(&self.session.trials, self.later_trials(), &self.session.info.parameters, waiting)
    }

    /// Every trial, by number: also those that the table does not show, in a replay as at its end.
    pub fn every_trial(&self) -> Vec<&TrialRecord> {
        let recorded = self.timeline.iter().flat_map(|timeline| timeline.rows.iter());
        let rows: BTreeMap<&u32, &TrialRecord> = self.session.trials.records.iter().chain(recorded).collect();
        rows.into_values().collect()
    }

    /// The trials of a replay that are not proposed yet at the playhead, as they will be at the end.
    pub fn later_trials(&self) -> impl Iterator<Item = &TrialRecord> + '_ {
        let rows = self.timeline.iter().flat_map(|timeline| timeline.rows.values());
        rows.filter(|row| !self.session.trials.records.contains_key(&row.trial))
    }

    /// Whether a trial lies after the playhead of a replay.
    pub fn is_later(&self, trial: u32) -> bool {
        !self.session.trials.records.contains_key(&trial)
    }

    /// The row of a trial: as of the playhead in a replay, of a later trial as it will be.
    pub fn trial(&self, trial: u32) -> Option<&TrialRecord> {
        let later = || self.timeline.as_ref().and_then(|timeline| timeline.rows.get(&trial));
        self.session.trials.records.get(&trial).or_else(later)
    }

    /// The row of a trial as it is at the end of the recording; in a live session the present one.
    pub fn final_row(&self, trial: u32) -> Option<&TrialRecord> {
        let last = self.timeline.as_ref().and_then(|timeline| timeline.rows.get(&trial));
        last.or_else(|| self.session.trials.records.get(&trial))
    }

    /// The trial that actions of the trial table apply to: the selected one, or the newest; where the table's filter hides that,
    /// the shown one whose number is nearest.
    pub fn selected_trial(&self) -> Option<&TrialRecord> {
        let wanted = match self.trial_table.selected {
            Some(number) => self.trial(number),
            None => self.session.trials.newest().or_else(|| self.later_trials().next()),
        }?;
        if !self.trial_table.is_filtered() {
            return Some(wanted);
        }
        self.trial_rows().into_iter().min_by_key(|row| row.trial.abs_diff(wanted.trial))
    }

    /// The trial that a note and the details apply to.
    pub fn trial_in_view(&self) -> Option<&TrialRecord> {
        if self.view == View::Trials {
            self.selected_trial()
        } else {
            self.session.under_review().or(self.session.trials.newest())
        }
    }

    /// The trial that waits for its verdict, as the charts of Live draw it; none where they draw something else.
    pub fn landed(&self) -> Option<LandedTrial<'_>> {
        let live = &self.live;
        let elsewhere = live.present_in_review || live.frozen.is_some() || live.comparison.is_some();
        let trial = self.session.under_review().filter(|_| !elsewhere && self.replay.is_none())?.trial;
        let best = self.session.trials.best().map(|best| best.trial);
        let under = live.ghost.or(best).filter(|under| *under != trial);
        LandedTrial::of(&self.history, trial, under)
    }

    /// The samples that the charts draw: the running history, or the frozen one.
    pub fn charted(&self) -> &SignalHistory {
        self.live.frozen.as_ref().map_or(&self.history, |(history, _)| history)
    }

    /// The rows of a list of switches: name, help, and whether it is on.
    pub fn choices(&self, choice: Choice) -> Vec<(&'static str, &'static str, bool)> {
        match choice {
            Choice::Series => {
                let on = |series| self.live.series.contains(series);
                Series::VARIANTS.iter().map(|series| (series.name(), series.help(), on(series))).collect()
            }
            Choice::Columns => {
                let on = |column| self.trial_table.columns.contains(column);
                Column::VARIANTS.iter().map(|column| (column.name(), column.help(), on(column))).collect()
            }
        }
    }
}
