//! The conditions of each action, with the reason where it is not possible. The session checks every request again.

use quadfrog::control::mode::{self, Trigger};
use quadfrog::telemetry::Mode;
use quadfrog::trial::{ExperimentStage, Proposal, TrialRecord, Verdict};
use ratatui::layout::Size;

use crate::action::{ACTIONS, Action, ActionGroup, ActionInfo};
use crate::layout::{COMPACT_COLUMNS, COMPACT_ROWS, MIN_COLUMNS, MIN_ROWS, areas, compact_areas, shows_trial};
use crate::model::{Model, View};

/// Whether an action is possible now; the reason if it is not.
pub type Legality = Result<(), String>;

/// Reason for which a replay, also that of a watched session that has ended, stops nothing.
pub const NO_ROBOT_TO_STOP: &str = "this is a replay: there is no robot to stop";

/// Reason for which the session approves no jump while its recording, or a file of it, is not complete.
pub const RECORDING_FAILED: &str = "the recording is not complete";

pub fn legal(action: Action, model: &Model) -> Legality {
    use Action as A;
    match action {
        A::Stop => require(model.can_stop(), NO_ROBOT_TO_STOP),
        A::TakeControl => may_take_control(model),
        A::Arm => may_arm(model),
        A::SitDown => may_sit_down(model),
        A::Acknowledge => may_acknowledge(model),
        A::Approve => may_approve(model),
        A::Override | A::QueuePoint | A::Skip => may_change_proposal(model),
        A::ClearOverrides => may_clear_overrides(model),
        A::Fix => may_fix(model),
        A::Bounds => may_bound(model),
        A::Continue => {
            may_request(model)?;
            require(model.session.stage_is(ExperimentStage::Finished), "the study is not finished")
        }
        A::ConfirmBest => {
            may_search(model)?;
            let accepted = model.session.trials.count(Verdict::Accept);
            require(accepted >= 2, "two accepted trials are needed to compare")
        }
        A::ExportBest => {
            may_request(model)?;
            require(model.session.trials.best().is_some(), "no trial was accepted yet")?;
            require(!model.session.info.study.is_empty(), "this session keeps no study")
        }
        A::Accept => may_judge(model, Verdict::Accept),
        A::Fall => may_judge(model, Verdict::Fall),
        A::Void => may_judge(model, Verdict::Void),
        A::HandValue => {
            may_request(model)?;
            require(model.session.stage_is(ExperimentStage::Review), "no trial waits for a verdict")?;
            waiting_trial_is_meant(model)?;
            require(!model.session.under_review().is_some_and(TrialRecord::did_not_jump), &did_not_jump(model))
        }
        A::Rerun => may_rerun(model),
        A::Undo => {
            may_request(model)?;
            require(
                model.session.stage.is_some_and(|info| info.can_undo),
                "no verdict can be taken back; to change one, select its row in Trials",
            )
        }
        A::Note => {
            may_request(model)?;
            must_not_jump(model)?;
            require(model.trial_in_view().is_some(), &model.session.no_trial_yet())
        }
        A::Ghost => {
            // Of a trial of another session it says where that is; a replay reads it.
            let recorded = model.timeline.as_ref().is_some_and(|timeline| !timeline.trials.is_empty());
            let known = recorded
                || model.history.traces().next().is_some()
                || model.session.trials.best().is_some()
                || model.view == View::Trials && model.selected_trial().is_some();
            require(known, "no jump has been recorded yet")
        }
        A::Series => require(matches!(model.view, View::Live | View::Health), "the charts are in the view Live"),
        A::ChartMode | A::ZoomIn | A::ZoomOut => require(model.view == View::Live, "the charts are in the view Live"),
        A::Sort | A::Reverse | A::Columns | A::BestOnly | A::Copy | A::Export => {
            let reason =
                if action == A::Copy { "it copies a row in the view Trials" } else { "only in the view Trials" };
            require(model.view == View::Trials, reason)
        }
        A::Filter | A::Search => {
            require(matches!(model.view, View::Trials | View::Log), "only in the views Trials and Log")?;
            let types_text = action == A::Search && model.view == View::Log;
            if types_text { must_not_jump(model) } else { Ok(()) }
        }
        A::Palette => must_not_jump(model),
        A::EndComparison => {
            let live = &model.live;
            require(live.comparison.is_some() || live.ghost.is_some(), "no trial is beside or under another")
        }
        A::Beside => {
            require(model.replay.is_some(), "only in a replay")?;
            let present = model.replay.as_ref().and_then(|replay| replay.present);
            require(present.is_some(), "the recording has no trial")
        }
        _ if action.info().group == ActionGroup::Replay => require(model.replay.is_some(), "only in a replay"),
        A::Suspend => may_suspend(model),
        _ => Ok(()),
    }
}

/// The actions whose name or help contains the filter's words, possible ones first.
pub fn palette(filter: &str, model: &Model) -> Vec<(&'static ActionInfo, Legality)> {
    let words: Vec<String> = filter.split_whitespace().map(str::to_lowercase).collect();
    let matches = |info: &&ActionInfo| {
        let text = format!("{} {}", info.name, info.help.to_lowercase());
        words.iter().all(|word| text.contains(word))
    };
    let mut rows: Vec<_> = ACTIONS.iter().filter(matches).map(|info| (info, legal(info.action, model))).collect();
    rows.sort_by_key(|(_, legal)| legal.is_err());
    rows
}

/// Whether an action can have a meaning in this session: in a replay not those that command a robot.
pub fn has_meaning(action: Action, model: &Model) -> bool {
    let commands = match action {
        Action::Stop => !model.can_stop(),
        _ => model.replay.is_some() && may_request(model).err() == legal(action, model).err(),
    };
    !commands
}

/// Whether this session accepts requests.
pub fn may_request(model: &Model) -> Legality {
    require(model.observer().is_none(), "this console only watches; of its keys STOP alone reaches the session")?;
    require(model.replay.is_none(), "this is a replay: there is nothing to command")?;
    require(!model.session.info.observe, "this session only observes")
}

/// Whether the keys of the views do not cancel a countdown: where simulated jumps follow each other without a question, and every
/// view shows the countdown. On a robot, and before a jump that a person has approved one by one, any key cancels.
pub fn view_keys_keep_countdown(model: &Model) -> bool {
    let shown = areas(Size::from(model.size), model).is_some() && model.dialog.is_none();
    shown && model.session.jumps_without_question()
}

/// Whether a stop can be acknowledged. An observer may acknowledge too, since an observer's STOP stops the robot.
pub fn may_acknowledge(model: &Model) -> Legality {
    if !model.session.info.observe {
        may_request(model)?;
    }
    require(mode::next(model.mode(), Trigger::Acknowledge).is_some(), "nothing waits to be acknowledged")
}

fn require(condition: bool, reason: &str) -> Legality {
    if condition { Ok(()) } else { Err(reason.to_owned()) }
}

/// A text field would take the Space that is to stop a jump. In a countdown any key cancels.
fn must_not_jump(model: &Model) -> Legality {
    let jumps = model.mode() == Mode::Jump && model.replay.is_none();
    require(!jumps, "the robot is jumping, and Space would type; write after the jump")
}

fn refuse(reason: impl Into<String>) -> Legality {
    Err(reason.into())
}

/// The reason why the robot accepts no command at present; none while it lies or stands waiting.
fn busy_reason(mode: Mode) -> Option<&'static str> {
    match mode {
        Mode::Offline => Some("the robot does not answer yet"),
        Mode::Observe => Some("the robot is not under control yet"),
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

/// Time for which the console listens before it may send the first command, s: another commander is then visible.
const LISTENING_S: f64 = 1.0;

/// A real robot receives nothing before the operator's key: another console may drive it.
fn may_take_control(model: &Model) -> Legality {
    may_request(model)?;
    require(model.session.info.is_hardware(), "the simulator is under control from the start")?;
    require(matches!(model.mode(), Mode::Offline | Mode::Observe), "this console commands the robot already")?;
    let drawn = compact_areas(Size::from(model.size)).is_some();
    let enlarge = format!("enlarge the terminal to {COMPACT_COLUMNS}x{COMPACT_ROWS}: the question must be visible");
    require(drawn, &enlarge)?;
    let left_s = LISTENING_S - model.clock.as_secs_f64();
    require(left_s <= 0.0, &format!("listening to the robot for another {left_s:.1} s"))
}

fn may_arm(model: &Model) -> Legality {
    may_request(model)?;
    must_be_visible(model)?;
    if mode::next(model.mode(), Trigger::Arm).is_none() {
        return refuse(busy_reason(model.mode()).unwrap_or("the robot is armed already"));
    }
    require(!model.session.stage_is(ExperimentStage::Review), "the last trial waits for its verdict")?;
    require(!model.session.arming_checks.is_empty(), "the arming checks are not finished")?;
    match model.session.failing_checks() {
        0 => Ok(()),
        1 => refuse(format!("1 arming check has not passed: {} shows it", model.keymap.key(Action::ArmingChecks))),
        count => refuse(format!(
            "{count} arming checks have not passed: {} shows them",
            model.keymap.key(Action::ArmingChecks)
        )),
    }
}

fn may_sit_down(model: &Model) -> Legality {
    may_request(model)?;
    match (mode::next(model.mode(), Trigger::SitDown), model.mode()) {
        (Some(_), _) => Ok(()),
        // Jumps in a row: the further ones are dropped.
        (None, Mode::Jump | Mode::Settle) if model.session.jumps_in_a_row() > 1 => Ok(()),
        (None, Mode::Disarmed) => refuse("the robot is disarmed already"),
        (None, mode) => refuse(busy_reason(mode).unwrap_or("not now")),
    }
}

/// Energising the robot requires a screen that shows it.
fn must_be_visible(model: &Model) -> Legality {
    let shows = |columns: u16, rows: u16| {
        // A line that is wider than the terminal takes two rows: at most what is expected and the distance to falls.
        let needed = model.session.trial_rows() + if columns < MIN_COLUMNS { 2 } else { 0 };
        shows_trial(Size::new(columns, rows), needed)
    };
    let (columns, rows) = model.size;
    if shows(columns, rows) {
        return Ok(());
    }
    let (columns, rows) = match shows(COMPACT_COLUMNS, COMPACT_ROWS) {
        true => (COMPACT_COLUMNS, COMPACT_ROWS),
        false => (MIN_COLUMNS, MIN_ROWS),
    };
    refuse(format!("enlarge the terminal to {columns}x{rows}: the proposal must be visible"))
}

fn may_approve(model: &Model) -> Legality {
    may_change_proposal(model)?;
    must_be_visible(model)?;
    if let Some(error) = model.recording_failure() {
        return refuse(format!("{RECORDING_FAILED} ({error})"));
    }
    match (mode::next(model.mode(), Trigger::Approve), model.mode()) {
        (Some(_), _) => Ok(()),
        (None, Mode::Disarmed) => {
            refuse(format!("the robot is not standing: press {} first", model.keymap.key(Action::Arm)))
        }
        (None, mode) => refuse(busy_reason(mode).unwrap_or("the robot is not ready")),
    }
}

fn may_change_proposal(model: &Model) -> Legality {
    may_request(model)?;
    not_under_way(model)?;
    if model.session.stage_is(ExperimentStage::Finished) {
        let key = model.keymap.key(Action::Continue);
        return refuse(format!("the study is finished: {key} gives it more trials"));
    }
    require(model.session.open_proposal().is_some(), "there is no proposal yet")
}

/// No trial runs or waits for its verdict.
fn not_under_way(model: &Model) -> Legality {
    require(!model.session.stage_is(ExperimentStage::Review), "the last trial waits for its verdict")?;
    require(!model.session.stage_is(ExperimentStage::Running), "a trial is running")
}

/// Whether the search may be changed: not during a trial.
fn may_search(model: &Model) -> Legality {
    may_request(model)?;
    not_under_way(model)?;
    require(model.session.stage.is_some(), "the session has not begun")
}

fn may_bound(model: &Model) -> Legality {
    may_search(model)?;
    require(model.view == View::Override, "only in the view Override")?;
    require(model.override_parameter().is_some(), "gains are not searched")
}

fn may_fix(model: &Model) -> Legality {
    may_bound(model)?;
    let fixed = model.override_parameter().and_then(|info| model.session.searched(&info.name)?.fixed);
    require(fixed.is_some() || model.override_value().is_some(), "there is no proposal whose value could be kept")
}

fn may_clear_overrides(model: &Model) -> Legality {
    may_change_proposal(model)?;
    let changed = |proposal: &Proposal| proposal.changed().next().is_some();
    require(model.session.open_proposal().is_some_and(changed), "nothing was overridden")
}

/// While a trial waits for its verdict, no other row of Trials may be the selected one: a verdict could be meant for that.
pub fn waiting_trial_is_meant(model: &Model) -> Legality {
    let waiting = model.session.under_review().map(|row| row.trial);
    let selected = model.selected_trial().map(|row| row.trial).filter(|_| model.view == View::Trials);
    match (waiting, selected) {
        (Some(waiting), Some(selected)) if waiting != selected => {
            let live = model.keymap.key(Action::LiveView);
            refuse(format!(
                "trial {waiting} waits for its verdict, but {selected} is selected; judge {waiting} first, in its row or in Live ({live})"
            ))
        }
        _ => Ok(()),
    }
}

/// The reason for which a trial that ended before its impulse is neither accepted nor a fall, and what there is.
fn did_not_jump(model: &Model) -> String {
    let [void, rerun] = [Action::Void, Action::Rerun].map(|action| model.keymap.key(action));
    format!("the robot did not jump: {void} void gives the point up, {rerun} runs it again")
}

/// Under review, or in Trials a judged row that has another verdict.
fn may_judge(model: &Model, verdict: Verdict) -> Legality {
    may_request(model)?;
    if model.session.stage_is(ExperimentStage::Review) {
        waiting_trial_is_meant(model)?;
        let jumped = !model.session.under_review().is_some_and(TrialRecord::did_not_jump);
        require(jumped || verdict == Verdict::Void, &did_not_jump(model))?;
        let value = model.session.under_review().and_then(|row| model.session.value_if_accepted(row));
        let key = model.keymap.key(Action::HandValue);
        let reason = format!("nothing was measured: {key} gives a value measured by hand, or judge it otherwise");
        return require(verdict != Verdict::Accept || value.is_some(), &reason);
    }
    require(!model.session.stage_is(ExperimentStage::Running), "a trial is running")?;
    let row = model.selected_trial().filter(|row| model.view == View::Trials && row.verdict.is_some());
    let Some(row) = row else {
        return refuse("no trial waits for a verdict; in Trials, select a judged one to change it");
    };
    let trial = row.trial;
    require(!row.was_not_run(), &format!("trial {trial} was not run: it has no verdict"))?;
    if model.session.undoable() == Some(trial) {
        let undo = model.keymap.key(Action::Undo);
        return refuse(format!("the verdict of trial {trial} is the last one: {undo} takes it back"));
    }
    require(row.verdict != Some(verdict), &format!("trial {trial} is {} already", verdict.name()))?;
    require(!row.did_not_jump(), &format!("the robot did not jump in trial {trial}: it stays void"))?;
    let has_value = verdict != Verdict::Accept || model.session.value_if_accepted(row).is_some();
    require(has_value, &format!("nothing was measured in trial {trial}: it cannot be accepted"))
}

fn may_rerun(model: &Model) -> Legality {
    may_request(model)?;
    if model.session.stage_is(ExperimentStage::Review) {
        return waiting_trial_is_meant(model);
    }
    match model.selected_trial() {
        Some(trial) if model.view == View::Trials && trial.verdict.is_some() => Ok(()),
        _ if model.session.stage_is(ExperimentStage::Running) => refuse("a trial is running"),
        _ => refuse("no trial waits for a verdict; in Trials, select a judged one to run it again"),
    }
}

/// A stopped process sends nothing, not even the damping commands that a real robot needs.
fn may_suspend(model: &Model) -> Legality {
    let commanded = model.mode().commanded() || model.session.control_taken;
    if model.replay.is_none() && model.session.info.is_hardware() && commanded {
        refuse("a suspended program sends the robot nothing, not even damping; quit it instead")
    } else if model.robot_is_energised() {
        let sit_down = model.keymap.key(Action::SitDown);
        refuse(format!("the robot is armed; {sit_down} sits it down, then the program can be suspended"))
    } else {
        Ok(())
    }
}
