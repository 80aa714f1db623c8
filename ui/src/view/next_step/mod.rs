//! The operator's next possible step.

mod dialog;

use quadfrog::engine::WHO_WATCHES;
use quadfrog::robot::{CONTACT_S, joint_name};
use quadfrog::session::prior::PriorProgress;
use quadfrog::telemetry::{Mode, TransitionCause};
use quadfrog::trial::{ExperimentStage, Verdict};

use super::{countdown, row_keys};
use crate::action::Action;
use crate::layout::MIN_COLUMNS;
use crate::legal::{RECORDING_FAILED, legal, waiting_trial_is_meant};
use crate::message::ReplayStatus;
use crate::model::Model;
use crate::model::dialog::Dialog;

const OVERRIDE: (Action, &str) = (Action::Override, "override");
const QUIT: (Action, &str) = (Action::Quit, "quit");
const SIT_DOWN: (Action, &str) = (Action::SitDown, "sit down");
const UNDO: (Action, &str) = (Action::Undo, "undo");

/// The most likely next step, and the others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NextStep {
    /// The step itself, a sentence.
    pub lead: String,
    /// The step in few words, for a line that lacks room for the keys; empty where the step itself stays.
    pub short: String,
    /// Keys and their effects.
    pub others: Vec<(String, String)>,
}

/// The next possible step.
pub fn next_step(model: &Model) -> NextStep {
    with_row(model, true)
}

/// The next possible step; `view_is_shown`: with the keys of the selected row, or of the comparison, of the open view.
pub(super) fn with_row(model: &Model, view_is_shown: bool) -> NextStep {
    let mut next = without_row(model);
    if model.dialog.is_some() {
        return next;
    }
    if !view_is_shown {
        // No row can be seen, so that none is named either.
        if !next.short.is_empty() && waiting_trial_is_meant(model).is_err() {
            next.lead = std::mem::take(&mut next.short);
        }
        return next;
    }
    // Before the keys of the next step, but a verdict comes first.
    let keys = row_keys::keys(model);
    next.others.retain(|other| !keys.contains(other));
    let at = if is_asked(model) { next.others.len() } else { 0 };
    next.others.splice(at..at, keys);
    next
}

/// Whether the robot, or a trial, waits for the operator's judgement.
fn is_asked(model: &Model) -> bool {
    if model.replay.is_some() {
        return false;
    }
    matches!(model.mode(), Mode::Damped | Mode::Fault)
        || model.session.under_review().is_some() && waiting_trial_is_meant(model).is_ok()
}

fn without_row(model: &Model) -> NextStep {
    match &model.dialog {
        Some(dialog) => in_dialog(model, dialog),
        None if model.replay.is_some() => replay(model),
        None if model.session.info.observe && model.stop_requested() => observers_stop(model),
        None if model.session.info.observe && legal(Action::Acknowledge, model).is_err() => {
            step("Observing: of the keys STOP alone reaches the robot.", model, &[QUIT])
        }
        None if model.leaving => leaving(model),
        None => live(model),
    }
}

fn step(lead: impl Into<String>, model: &Model, others: &[(Action, &'static str)]) -> NextStep {
    let others = others
        .iter()
        .filter(|(action, _)| legal(*action, model).is_ok())
        .map(|(action, text)| {
            // In Trials another row may be selected.
            let undone = model.session.undoable().filter(|_| *action == Action::Undo);
            let of = undone.map_or(String::new(), |trial| format!(" #{trial}"));
            (model.keymap.key(*action), format!("{text}{of}"))
        })
        .collect();
    NextStep { lead: lead.into(), short: String::new(), others }
}

/// The rest of a session that ends, in which no key but STOP has an effect.
fn leaving(model: &Model) -> NextStep {
    let lead = match (model.mode(), model.storage) {
        (Mode::Jump | Mode::Settle, _) => "Quitting: the robot lands.".to_owned(),
        (mode, _) if mode.energised() => "Quitting: the robot sits down.".to_owned(),
        (_, Some(wait)) => format!("Quitting: waiting for {}, {:.0} s.", wait.place(), wait.waited.as_secs_f64()),
        (mode, None) if mode.commanded() => "Quitting: the motors are damped.".to_owned(),
        (_, None) => "Quitting.".to_owned(),
    };
    step(lead, model, &[])
}

fn live(model: &Model) -> NextStep {
    let key = |action| model.keymap.key(action);
    let session = &model.session;
    let (stage, finished) = (session.stage.map(|info| info.stage), session.stage_is(ExperimentStage::Finished));
    match model.mode() {
        Mode::Countdown => {
            let left = model.countdown_s.map_or(String::new(), |seconds| format!(" in {seconds} s"));
            step(format!("Jump{left}: {}.", countdown::cancels(model)), model, &[])
        }
        Mode::StandUp if session.jumps_without_question() && !finished => {
            step("Standing up; the robot then jumps without a question.", model, &[SIT_DOWN])
        }
        Mode::StandUp => step("Standing up.", model, &[SIT_DOWN]),
        Mode::Jump if session.jumps_in_a_row() > 1 => step(model.jump_series.line(session), model, &[SIT_DOWN]),
        Mode::Jump => step("Jumping.", model, &[]),
        Mode::Settle => step("Landed; waiting until the robot is quiet.", model, &[]),
        Mode::SitDown => step("Sitting down.", model, &[]),
        // What a stopped robot needs comes before a wait and before the verdict.
        Mode::Damped | Mode::Fault => of_stopped_robot(model),
        _ if model.storage.is_some() => {
            let wait = model.storage.map(|wait| {
                let waited_s = wait.waited.as_secs_f64();
                match wait.prior {
                    Some(PriorProgress { done, total }) => {
                        format!("Simulating the prior, {done} of {total} jumps, {waited_s:.0} s")
                    }
                    None => format!("Waiting for {}, {waited_s:.0} s", wait.place()),
                }
            });
            let lead = format!("{}: the study answers later.", wait.unwrap_or_default());
            step(lead, model, &[SIT_DOWN, QUIT])
        }
        _ if stage == Some(ExperimentStage::Review) => review(model),
        mode @ (Mode::Offline | Mode::Observe) if session.info.is_hardware() => {
            let take = key(Action::TakeControl);
            let lead = match (mode, session.control_taken) {
                (Mode::Offline, false) => format!("The robot is silent, nothing is sent to it. {take} takes control."),
                (_, false) => format!("The robot sends states, nothing is sent to it. {take} takes control."),
                (Mode::Offline, true) => {
                    // A Go2 is sent nothing before its first state.
                    let sent = if session.info.robot == "go1" { "are" } else { "may be" };
                    format!("Braking commands {sent} sent for at most {CONTACT_S} s; a robot that answers is damped.")
                }
                (_, true) => "The robot sends states; it is damped from now on.".to_owned(),
            };
            step(lead, model, &[QUIT])
        }
        Mode::Offline | Mode::Observe => step("Waiting for the robot to answer.", model, &[QUIT]),
        mode @ (Mode::Disarmed | Mode::Ready) if finished => {
            let more = [(Action::Continue, "more trials"), (Action::ConfirmBest, "confirm best")];
            let (first, last) = if mode == Mode::Disarmed { (QUIT, None) } else { (SIT_DOWN, Some(QUIT)) };
            let rest = [(Action::ExportBest, "export"), UNDO];
            step("The study is finished.", model, &[&[first], &more[..], &rest, last.as_slice()].concat())
        }
        Mode::Disarmed => before_arming(model),
        Mode::Ready if session.open_proposal().is_some() && model.recording_failure().is_some() => {
            let lead = format!("No jump now: {RECORDING_FAILED}; {} shows why.", key(Action::HealthView));
            step(lead, model, &[SIT_DOWN, QUIT])
        }
        Mode::Ready if session.open_proposal().is_some() && model.snapshot.unready.is_some() => {
            let reason = model.snapshot.unready.map(|reason| reason.to_string()).unwrap_or_default();
            step(format!("No jump now: {reason}."), model, &[SIT_DOWN, OVERRIDE, (Action::Skip, "skip"), UNDO])
        }
        Mode::Ready if session.open_proposal().is_some() => before_jump(model),
        // The mode is shown a moment before the measured values arrive.
        Mode::Review if stage == Some(ExperimentStage::Running) => step("Measuring the jump.", model, &[]),
        _ => step("The sampler is choosing the next trial.", model, &[SIT_DOWN]),
    }
}

/// The step of a robot that waits for an acknowledgement: it may come before or after the verdict.
fn of_stopped_robot(model: &Model) -> NextStep {
    let session = &model.session;
    let cause = &session.stopped_because;
    // A verdict is possible unless another row of Trials is selected.
    let waiting = session.under_review().map(|trial| trial.trial);
    let review = waiting.is_some() && waiting_trial_is_meant(model).is_ok();
    // The cause of a fall stands beside its suggested verdict; STOP says itself why.
    let is_stop = *cause == TransitionCause::Stop.to_string();
    let stopped = stopped(model);
    let because = match cause.is_empty() || is_stop || stopped == FELL && waiting.is_some() {
        true => String::new(),
        // Of an observer the name is enough: the keys of the verdict need the room. That it fell is said already.
        false => {
            let cause = cause.strip_suffix(WHO_WATCHES).unwrap_or(cause);
            format!(": {}", cause.strip_prefix("fell: ").filter(|_| stopped == FELL).unwrap_or(cause))
        }
    };
    // The key first: a long reason may be cut.
    let acknowledge = model.keymap.key(Action::Acknowledge);
    let mut lead = format!("{stopped}; check the robot, then {acknowledge} acknowledges{because}");
    if lead.chars().count() + 2 > usize::from(MIN_COLUMNS) {
        lead = format!("{stopped}; check it, {acknowledge} acknowledges{because}");
    }
    if let Some(trial) = waiting.filter(|_| !review) {
        lead += &format!(". Trial {trial} waits for its verdict");
    }
    // A verdict can be given before the acknowledgement; the suggested one comes first.
    let suggested = session.under_review().and_then(|trial| trial.suggested);
    let mut verdicts = [
        (Action::Fall, Verdict::Fall, "fall", "fall (suggested)"),
        (Action::Accept, Verdict::Accept, "accept", "accept (suggested)"),
        (Action::Void, Verdict::Void, "void", "void (suggested)"),
    ];
    verdicts.sort_by_key(|(_, verdict, ..)| Some(*verdict) != suggested);
    let shown = |(action, verdict, name, first)| (action, if Some(verdict) == suggested { first } else { name });
    let verdicts: Vec<_> = verdicts.into_iter().filter(|_| review).map(shown).collect();
    let rerun = if review { &[(Action::Rerun, "re-run")][..] } else { &[] };
    // Of a fall a value by hand is not reported: the note comes first.
    let about = [(Action::Note, "note"), (Action::HandValue, "value by hand")];
    let about = if review { &about[..] } else { &[] };
    step(lead, model, &[&verdicts[..], rerun, about, &[UNDO, QUIT]].concat())
}

fn before_arming(model: &Model) -> NextStep {
    let key = |action| model.keymap.key(action);
    let session = &model.session;
    let lead = match session.failing_checks() {
        _ if session.arming_checks.is_empty() => "Checking the robot.".to_owned(),
        0 => {
            let stands = match (model.simulated_robot_lies(), session.jumps_without_question()) {
                (true, true) => "it is turned upright, then jumps without a question",
                (true, false) => "the robot is turned upright and stands",
                (false, true) => "it stands up, then jumps without a question",
                (false, false) => "the robot stands up",
            };
            format!("Press {} to arm: {stands}.", key(Action::Arm))
        }
        1 => format!("Not ready to arm: 1 check has not passed. {} shows it.", key(Action::ArmingChecks)),
        failing => {
            let shows = key(Action::ArmingChecks);
            format!("Not ready to arm: {failing} checks have not passed. {shows} shows them.")
        }
    };
    let short = match session.failing_checks() {
        _ if session.arming_checks.is_empty() => String::new(),
        0 if session.jumps_without_question() => format!("Press {} to arm: it then jumps.", key(Action::Arm)),
        0 => format!("Press {} to arm.", key(Action::Arm)),
        _ => format!("{} shows failed checks.", key(Action::ArmingChecks)),
    };
    NextStep { short, ..step(lead, model, &[OVERRIDE, UNDO, (Action::Help, "help"), QUIT]) }
}

fn before_jump(model: &Model) -> NextStep {
    let key = |action| model.keymap.key(action);
    let session = &model.session;
    let approve = key(Action::Approve);
    let times = if session.info.is_hardware() { "" } else { " twice" };
    let press = format!("Press {approve}{times} to jump");
    let lead = match (session.info.is_hardware(), session.jumps_without_question()) {
        (true, _) => format!("{press}: y confirms the area, {approve} again jumps."),
        // An interruption has paused the rule.
        (false, true) => format!("{press}. The next jumps follow without a question."),
        (false, false) => format!("{press}."),
    };
    let short = format!("{press}.");
    NextStep { short, ..step(lead, model, &[OVERRIDE, (Action::Skip, "skip"), UNDO, SIT_DOWN]) }
}

/// The effect of an observer's STOP, which another commander may counteract, as far as the robot's states show it.
fn observers_stop(model: &Model) -> NextStep {
    let key = model.keymap.key(Action::Acknowledge);
    let lead = match model.torque_against_stop() {
        _ if model.robot_is_silent() => {
            "STOP requested; no state shows whether the robot follows. Use the remote.".to_owned()
        }
        Some((joint, torque)) => {
            let name = joint_name(joint);
            format!("NOT STOPPED: {name} holds {torque:.1} N m, another console commands. Use the remote.")
        }
        None => format!("STOP requested and followed: the joints are damped. {key} releases the robot."),
    };
    step(lead, model, &[QUIT])
}

fn review(model: &Model) -> NextStep {
    let suggested = model.session.under_review().and_then(|trial| trial.suggested);
    if let (Err(_), Some(waiting)) = (waiting_trial_is_meant(model), model.session.under_review()) {
        let live = model.keymap.key(Action::LiveView);
        let lead = format!("Trial {} waits for its verdict: select its row or press {live}.", waiting.trial);
        let short = format!("Trial {} waits for its verdict: press {live}.", waiting.trial);
        return NextStep { short, ..step(lead, model, &[SIT_DOWN, QUIT]) };
    }
    let verdicts = [(Action::Accept, Verdict::Accept), (Action::Fall, Verdict::Fall), (Action::Void, Verdict::Void)];
    let (first, others): (Vec<_>, Vec<_>) = verdicts.into_iter().partition(|(_, verdict)| Some(*verdict) == suggested);
    let lead = match first.first() {
        Some((action, verdict)) => {
            format!("Judge it: {} {} (suggested)", model.keymap.key(*action), verdict.name())
        }
        None => "Judge it".to_owned(),
    };
    let mut others: Vec<_> = others.into_iter().map(|(action, verdict)| (action, verdict.name())).collect();
    if suggested == Some(Verdict::Void) {
        // As after a cancelled countdown: void alone gives the point up.
        others.insert(0, (Action::Rerun, "re-run of this point"));
    } else {
        others.push((Action::Rerun, "re-run"));
    }
    others.extend([(Action::HandValue, "value by hand"), (Action::Note, "note")]);
    step(lead, model, &others)
}

/// The age of what a followed recording shows, if it is old, and the key to the present.
fn behind(model: &Model) -> Option<String> {
    let replay = model.replay.as_ref()?;
    let old_s = replay.old_ns()? as f64 / 1e9;
    let end = model.keymap.key(Action::ReplayEnd);
    Some(match replay.later_is_known() {
        true => format!("Behind by {old_s:.0} s: {end} shows the present."),
        false => format!("Nothing new for {old_s:.0} s."),
    })
}

fn replay(model: &Model) -> NextStep {
    let old = behind(model);
    if let Some(observer) = model.observer() {
        let unconfirmed = observer.demanded > observer.stopped;
        let lead = match (observer.ended, old) {
            (true, _) => "The session has ended. STOP does not reach its robot any longer.".to_owned(),
            (false, _) if unconfirmed && model.session.info.is_hardware() => {
                "STOP is not confirmed: the session does not answer. Damp the robot by its remote control.".to_owned()
            }
            (false, _) if unconfirmed => "STOP is not confirmed: the session does not answer.".to_owned(),
            // Later ticks are there: the session runs, and this console shows earlier ones.
            (false, Some(old)) if model.replay.as_ref().is_some_and(ReplayStatus::later_is_known) => {
                format!("{old} STOP reaches its robot at once.")
            }
            (false, Some(old)) => format!("{old} The session may hang: STOP reaches its robot once it is confirmed."),
            (false, None) => "Watching, about 1 s behind. STOP reaches the robot of this session at once.".to_owned(),
        };
        return step(lead, model, &[QUIT, (Action::PlayPause, "pause or play"), (Action::ReplayEnd, "newest")]);
    }
    let playing = model.replay.as_ref().is_some_and(|replay| replay.playing);
    let key = model.keymap.key(Action::PlayPause);
    if let Some(old) = old.filter(|_| model.replay.as_ref().is_some_and(ReplayStatus::later_is_known)) {
        return step(old, model, &[QUIT, (Action::PlayPause, "pause or play")]);
    }
    let mut others = vec![
        (Action::EndComparison, "end comparison"),
        (Action::Seek, "go to"),
        (Action::PreviousMarker, "previous trial"),
        (Action::NextMarker, "next trial"),
        (Action::NextFall, "next fall"),
        (Action::StepForward, "step"),
        (Action::Slower, "slower"),
        (Action::Faster, "faster"),
        QUIT,
    ];
    others.retain(|(action, _)| *action != Action::NextFall || fall_follows(model));
    step(format!("{key} {}", if playing { "pauses" } else { "plays" }), model, &others)
}

/// Whether a fall or a fault follows the playhead.
fn fall_follows(model: &Model) -> bool {
    let (Some(replay), Some(timeline)) = (&model.replay, &model.timeline) else { return false };
    timeline.last_fall_ns > Some(replay.time_ns)
}

const FELL: &str = "FELL";

/// The state of a robot that waits for an acknowledgement, in one word; the same before and after the verdict.
fn stopped(model: &Model) -> &'static str {
    let session = &model.session;
    let fell = session.under_review().is_some_and(|trial| trial.suggested == Some(Verdict::Fall));
    match model.mode() {
        Mode::Fault => "FAULT",
        _ if session.stopped_because == TransitionCause::Stop.to_string() => "STOPPED",
        _ if fell || session.stopped_because.starts_with("fell: ") => FELL,
        _ => "STOPPED",
    }
}

/// The step of an open dialog. A stopped robot comes before what the dialog asks.
fn in_dialog(model: &Model, dialog: &Dialog) -> NextStep {
    let question = dialog::question(model, dialog);
    if !model.stop_requested() || legal(Action::Acknowledge, model).is_err() {
        return step(question, model, &[]);
    }
    let stopped = stopped(model);
    let acknowledge = model.keymap.key(Action::Acknowledge);
    let lead = match dialog::ends_of_form(dialog) {
        Some(ends) => format!("{stopped}: {ends}; then {acknowledge} acknowledges."),
        None => {
            let way = if matches!(dialog, Dialog::Details { .. }) { "" } else { "Esc, then " };
            format!("{stopped}: {way}{acknowledge} acknowledges. {question}")
        }
    };
    step(lead, model, &[])
}
