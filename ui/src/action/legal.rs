//! When each action can be done, and in words why not.

use quadfrog::telemetry::Mode;
use quadfrog::trial::{ExperimentStage, Verdict};

use super::{Action, Legality};
use crate::model::{Model, View};
use crate::view::{MIN_COLUMNS, MIN_ROWS};

pub(super) fn always(_: &Model) -> Legality {
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

fn stage_is(model: &Model, stage: ExperimentStage) -> bool {
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

pub(super) fn may_arm(model: &Model) -> Legality {
    may_wish(model)?;
    must_be_seen(model)?;
    match model.mode() {
        mode if busy(mode).is_some() => refuse(busy(mode).unwrap_or_default()),
        Mode::Disarmed if stage_is(model, ExperimentStage::Review) => refuse("the last trial waits for its verdict"),
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

pub(super) fn may_sit_down(model: &Model) -> Legality {
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

/// What energises needs a screen that shows what it does.
fn must_be_seen(model: &Model) -> Legality {
    let (columns, rows) = model.size;
    if columns >= MIN_COLUMNS && rows >= MIN_ROWS {
        return Ok(());
    }
    refuse(format!("enlarge the terminal to {MIN_COLUMNS}x{MIN_ROWS}: what will run must be seen"))
}

pub(super) fn may_approve(model: &Model) -> Legality {
    may_change_proposal(model)?;
    must_be_seen(model)?;
    match model.mode() {
        Mode::Ready => Ok(()),
        Mode::Disarmed => refuse(format!("the robot is not standing: press {} first", model.keymap.key(Action::Arm))),
        mode => refuse(busy(mode).unwrap_or("the robot is not ready")),
    }
}

pub(super) fn may_change_proposal(model: &Model) -> Legality {
    may_wish(model)?;
    match model.stage.map(|info| info.stage) {
        Some(ExperimentStage::Proposed) if model.proposal_on_table().is_some() => Ok(()),
        Some(ExperimentStage::Review) => refuse("the last trial waits for its verdict"),
        Some(ExperimentStage::Running) => refuse("a trial is running"),
        Some(ExperimentStage::Finished) => {
            refuse(format!("the study is finished: {} gives it more trials", model.keymap.key(Action::Continue)))
        }
        _ => refuse("there is no proposal yet"),
    }
}

/// Whether the search may be changed: not while a trial is under way.
pub(super) fn may_search(model: &Model) -> Legality {
    may_wish(model)?;
    match model.stage.map(|info| info.stage) {
        Some(ExperimentStage::Proposed | ExperimentStage::Finished) => Ok(()),
        Some(ExperimentStage::Review) => refuse("the last trial waits for its verdict"),
        Some(ExperimentStage::Running) => refuse("a trial is running"),
        None => refuse("the session has not begun"),
    }
}

pub(super) fn may_bound(model: &Model) -> Legality {
    may_search(model)?;
    if model.view != View::Override {
        return refuse("only in the view Override");
    }
    match model.override_parameter() {
        Some(_) => Ok(()),
        None => refuse("gains are not searched"),
    }
}

pub(super) fn may_fix(model: &Model) -> Legality {
    may_bound(model)?;
    let fixed = model.override_parameter().and_then(|info| model.searched(&info.name)?.fixed);
    match (fixed, model.override_value()) {
        (None, None) => refuse("there is no proposal whose value could be kept"),
        _ => Ok(()),
    }
}

pub(super) fn may_queue(model: &Model) -> Legality {
    may_change_proposal(model)
}

pub(super) fn may_confirm(model: &Model) -> Legality {
    may_search(model)?;
    let stood = model.trials.values().filter(|trial| trial.verdict == Some(Verdict::Accept));
    if stood.count() < 2 { refuse("two accepted trials are needed to compare") } else { Ok(()) }
}

pub(super) fn may_export_best(model: &Model) -> Legality {
    may_wish(model)?;
    match (model.best(), model.session.study.is_empty()) {
        (None, _) => refuse("no trial was accepted yet"),
        (_, true) => refuse("this session keeps no study"),
        _ => Ok(()),
    }
}

pub(super) fn may_clear_overrides(model: &Model) -> Legality {
    may_change_proposal(model)?;
    match model.proposal_on_table() {
        Some(proposal) if proposal.parameters.iter().chain(&proposal.gains).any(|p| p.value != p.proposed) => Ok(()),
        _ => refuse("nothing was overridden"),
    }
}

pub(super) fn may_continue(model: &Model) -> Legality {
    may_wish(model)?;
    if stage_is(model, ExperimentStage::Finished) { Ok(()) } else { refuse("the study is not finished") }
}

pub(super) fn may_judge(model: &Model) -> Legality {
    may_wish(model)?;
    if stage_is(model, ExperimentStage::Review) { Ok(()) } else { refuse("no trial waits for a verdict") }
}

pub(super) fn may_rerun(model: &Model) -> Legality {
    may_wish(model)?;
    if stage_is(model, ExperimentStage::Review) {
        return Ok(());
    }
    match model.selected_trial() {
        Some(trial) if model.view == View::Trials && trial.verdict.is_some() => Ok(()),
        _ => refuse("no trial waits for a verdict; in Trials, select a judged one"),
    }
}

pub(super) fn may_undo(model: &Model) -> Legality {
    may_wish(model)?;
    if model.stage.is_some_and(|info| info.can_undo) { Ok(()) } else { refuse("no verdict can be taken back") }
}

pub(super) fn may_note(model: &Model) -> Legality {
    may_wish(model)?;
    if model.trial_for_note().is_some() { Ok(()) } else { refuse("there is no trial yet") }
}

pub(super) fn may_ghost(model: &Model) -> Legality {
    if model.history.traces().next().is_some() { Ok(()) } else { refuse("no jump has been seen yet") }
}

pub(super) fn in_trials(model: &Model) -> Legality {
    if model.view == View::Trials { Ok(()) } else { refuse("only in the view Trials") }
}

pub(super) fn in_table(model: &Model) -> Legality {
    if matches!(model.view, View::Trials | View::Log) { Ok(()) } else { refuse("only in the views Trials and Log") }
}

pub(super) fn in_replay(model: &Model) -> Legality {
    if model.replay.is_some() { Ok(()) } else { refuse("only in a replay") }
}

/// A stopped process sends nothing: not even the damping that a real robot lies in.
pub(super) fn may_suspend(model: &Model) -> Legality {
    let spoken_to = model.mode().commanded();
    if model.replay.is_none() && model.is_hardware() && spoken_to {
        refuse("a suspended program sends the robot nothing, not even damping; quit it instead")
    } else if model.robot_needs_us() {
        refuse(format!(
            "the robot is armed; {} sits it down, then the program can be suspended",
            model.keymap.key(Action::SitDown)
        ))
    } else {
        Ok(())
    }
}
