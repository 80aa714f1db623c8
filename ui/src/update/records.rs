//! Applies the session's records to the model: rows, the log, the answer to the operator, the bell.

use std::time::Duration;

use quadfrog::engine::is_stop_of_observer;
use quadfrog::recording::record::{
    LogLevel, LogRecord, Record, RequestRecord, SessionInfo, StageRecord, Stamped, Transition,
};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::session::storage::{ANSWERED_AFTER, ANSWERS_LATER};
use quadfrog::telemetry::{Fault, Mode, TransitionCause};
use quadfrog::trial::{
    Approval, ExperimentStage, Proposal, ProposalInsight, ProposalSource, ProposedParameter, TrialRecord, Verdict,
    six_digits,
};

use super::request::{cancelled, quote, reply, say};
use crate::action::Action;
use crate::legal::legal;
use crate::message::Effect;
use crate::model::dialog::{APPROVAL_TIME, Dialog, Question};
use crate::model::log::LogLine;
use crate::model::trials::{BestValue, RunTime};
use crate::model::{Model, Notice};
use crate::settings::BellCause;

/// Time for which another message replaces the reason of a fault, or why the robot sat down.
const REASON_AGAIN: Duration = Duration::from_secs(5);

/// Closes a question that no longer applies: one about a proposal holds for the shown revision, an approval while the robot stands.
pub(super) fn close_stale_dialog(model: &mut Model) {
    let is_another = |proposal: Option<&Proposal>, trial: u32, revision: u32| {
        proposal.map(|p| (p.trial, p.revision)) != Some((trial, revision))
    };
    let stale = match &model.dialog {
        Some(Dialog::Approve { trial, revision, .. }) => {
            is_another(model.session.proposal.as_ref(), *trial, *revision) || legal(Action::Approve, model).is_err()
        }
        Some(Dialog::Confirm(Question::Skip { trial, revision })) => {
            is_another(model.session.open_proposal(), *trial, *revision) || legal(Action::Skip, model).is_err()
        }
        Some(Dialog::Confirm(Question::JudgeAnyway { trial, .. } | Question::HandValue { trial, .. })) => {
            model.session.under_review().is_none_or(|row| row.trial != *trial)
        }
        Some(Dialog::Confirm(Question::QueueProposed { trial, revision })) => {
            is_another(model.session.open_proposal(), *trial, *revision)
        }
        Some(Dialog::Confirm(Question::RemoveQueued { trial })) => !model.session.is_queued(*trial),
        Some(Dialog::Confirm(Question::EndRepeats)) => {
            model.session.confirming().is_none() || legal(Action::ConfirmBest, model).is_err()
        }
        Some(Dialog::Confirm(Question::Undo { trial })) => model.session.undoable() != Some(*trial),
        Some(Dialog::Confirm(Question::Rerun { .. })) => legal(Action::Rerun, model).is_err(),
        Some(Dialog::TakeControl) => legal(Action::TakeControl, model).is_err(),
        Some(Dialog::Arm { .. }) => legal(Action::Arm, model).is_err(),
        Some(Dialog::Override(form)) => {
            is_another(model.session.proposal.as_ref(), form.trial, form.revision)
                || legal(Action::Override, model).is_err()
        }
        _ => false,
    };
    let expired = |pressed_at: &Duration| model.clock.saturating_sub(*pressed_at) > APPROVAL_TIME;
    let forgotten = matches!(&model.dialog, Some(Dialog::Approve { pressed_at, .. }) if expired(pressed_at));
    if forgotten {
        model.dialog = None;
        cancelled(model, &format!("no jump, the question was {} s old", APPROVAL_TIME.as_secs()));
    } else if stale {
        model.dialog = None;
        reply(model, LogLevel::Warning, "the question was closed: the situation has changed");
    }
}

/// Gives what is shown of the open proposal its new number, where that is all that has changed: another program has added trials.
fn renumber(model: &mut Model, proposal: &Proposal) {
    let session = &mut model.session;
    let Some(before) = session.open_proposal().filter(|before| before.revision == proposal.revision) else { return };
    let (before, now) = (before.trial, proposal.trial);
    let insight = session.insight.as_mut().map(|insight| &mut insight.trial);
    let stage = session.stage.as_mut().map(|stage| &mut stage.trial);
    let asked = match &mut model.dialog {
        Some(
            Dialog::Approve { trial, .. }
            | Dialog::Confirm(Question::Skip { trial, .. } | Question::QueueProposed { trial, .. }),
        ) => Some(trial),
        Some(Dialog::Override(form)) => Some(&mut form.trial),
        _ => None,
    };
    for trial in [insight, stage, asked].into_iter().flatten().filter(|trial| **trial == before) {
        *trial = now;
    }
}

/// Applies a record. In a replay what the session has said waits until the answer to a key of this console is read.
pub(super) fn apply_beside_answer(model: &mut Model, stamped: Stamped) -> Vec<Effect> {
    let clock = model.clock;
    let of_recording = model.replay.is_some() && model.observer().is_none();
    let being_read = model.message.take_if(|message| of_recording && message.is_being_read(clock));
    if being_read.is_none() {
        return apply(model, stamped);
    }
    model.message = model.message_after_answer.take();
    let effects = apply(model, stamped);
    model.message_after_answer = std::mem::replace(&mut model.message, being_read);
    effects
}

/// Shows what the replayed session has said since the answer to a key of this console, once that is gone or read.
pub(super) fn end_answer(model: &mut Model) {
    let clock = model.clock;
    if !model.message.as_ref().is_some_and(|message| message.is_being_read(clock)) {
        model.message = model.message_after_answer.take().or(model.message.take());
    }
}

fn apply(model: &mut Model, stamped: Stamped) -> Vec<Effect> {
    let bell = apply_record(model, stamped);
    close_stale_dialog(model);
    let rings = bell.is_some_and(|cause| model.bell.contains(&cause)) && model.replay.is_none();
    if rings { vec![Effect::Bell] } else { Vec::new() }
}

/// Applies a record; returns the cause for which the bell may ring.
fn apply_record(model: &mut Model, Stamped { time_ns, record }: Stamped) -> Option<BellCause> {
    match record {
        Record::Session(info) => begin_session(model, time_ns, info),
        Record::Transition(change) => return change_mode(model, time_ns, &change),
        Record::Stage(info) => return change_stage(model, time_ns, info),
        Record::Proposal(proposal) => propose(model, time_ns, proposal),
        Record::Trial(trial) => return update_trial(model, time_ns, trial),
        Record::Request(command) => answer(model, time_ns, command),
        Record::Counters(counters) => model.snapshot.counters = counters,
        Record::Log(line) => log_line(model, time_ns, line),
        Record::ArmingChecks(list) => {
            model.session.arming_checks = list;
            model.session.arming_checked_ns = time_ns;
        }
        Record::Search(search) => model.session.search = Some(search),
        Record::Insight(insight) => explain(model, insight),
        Record::Points(points) => model.session.trials.points = points,
        Record::FaultTicks(ticks) => {
            let text = format!("the last {} ticks before the fault are in the recording", ticks.len());
            log(model, time_ns, LogLevel::Error, "control", text, false);
        }
    }
    None
}

/// Takes over the facts of a session. The next file of the same session begins with them, too.
fn begin_session(model: &mut Model, time_ns: u64, info: SessionInfo) {
    let (task, robot, backend) = (info.task_name(), &info.robot, info.backend_name());
    let (sampler, version, seed) = (info.sampler_name(), &info.version, info.seed);
    let text = format!("{task} on {robot} ({backend}), {sampler} {version}, seed {seed}");
    let known = &model.session.info;
    let continued = !known.recording.is_empty()
        && (&info.started, info.started.is_empty()) == (&known.started, false)
        && info.recording != known.recording;
    if !continued && !known.started.is_empty() {
        // An answer that an earlier session gave is none of this one.
        model.message = None;
    }
    model.session.info = info;
    if !continued {
        model.session.control_taken = false;
        log(model, time_ns, LogLevel::Info, "session", text, false);
    }
}

/// Reports a change of mode; rings for a fault.
fn change_mode(model: &mut Model, time_ns: u64, change: &Transition) -> Option<BellCause> {
    let level = match change.to {
        Mode::Fault => LogLevel::Error,
        Mode::Damped => LogLevel::Warning,
        Mode::SitDown if is_unasked(change) => LogLevel::Warning,
        _ => LogLevel::Info,
    };
    if change.to == Mode::SitDown && level == LogLevel::Warning {
        model.session.sat_down_because.clone_from(&change.cause);
        say(model, level, sat_down(&change.cause));
    } else if change.to != Mode::Disarmed {
        model.session.sat_down_because.clear();
    }
    // The observer who stopped may have been reported before the stop.
    let by_observer = |message: &&Notice| message.stop && is_stop_of_observer(message.level, &message.text);
    let by_observer = model.message.as_ref().filter(by_observer).filter(|_| change.is_stop());
    if matches!(change.to, Mode::Damped | Mode::Fault) {
        model.session.stopped_because = by_observer.map_or(&change.cause, |message| &message.text).clone();
        // The STOP key was answered already.
        if !(change.is_stop() && model.message.as_ref().is_some_and(|message| message.stop)) {
            say(model, level, format!("{}: {}", change.to.name(), change.cause));
        }
    }
    let text = format!("{} {} {}: {}", change.from.name(), model.theme.arrow(), change.to.name(), change.cause);
    log(model, time_ns, level, "mode", text, change.to == Mode::Fault);
    (change.to == Mode::Fault).then_some(BellCause::Fault)
}

/// Takes over the experiment's stage; rings for a proposal and for a trial that waits for its verdict.
fn change_stage(model: &mut Model, time_ns: u64, info: StageRecord) -> Option<BellCause> {
    let before = model.session.stage.replace(info);
    if let Some(before) = before
        && before.stage == ExperimentStage::Review
        && info.stage != ExperimentStage::Review
        && info.can_undo
    {
        model.session.last_judged = Some(before.trial);
    }
    if before.is_some_and(|before| (before.stage, before.trial) == (info.stage, info.trial)) {
        return None;
    }
    note_time(model, info, time_ns);
    match info.stage {
        ExperimentStage::Proposed => Some(BellCause::Proposal),
        ExperimentStage::Review => {
            show_landed(model);
            say_suggestion(model, info.trial);
            Some(BellCause::Verdict)
        }
        ExperimentStage::Running => {
            lay_ground(model, info.trial);
            None
        }
        ExperimentStage::Finished => {
            say_finished(model, time_ns);
            None
        }
    }
}

/// Reports the end of the study with its best trial.
fn say_finished(model: &mut Model, time_ns: u64) {
    let best = model.session.trials.best_value();
    let best = best.map_or("no trial was accepted".to_owned(), |BestValue { trial, value, by_hand, chosen }| {
        format!("the best{chosen} is trial {trial}, J = {value:.3} {}{by_hand}", model.session.info.unit)
    });
    let confirmed = model.session.confirmation().map_or(String::new(), |confirmed| format!("; {confirmed}"));
    let (counted, budget) = (model.session.counted(), model.session.budget());
    let finished = match counted > budget as usize {
        true => format!("{counted} trials already count; the study is finished"),
        false => "the study is finished".to_owned(),
    };
    let text = format!("{finished}: {best}{confirmed}");
    say(model, LogLevel::Info, text.clone());
    log(model, time_ns, LogLevel::Info, "study", text, true);
}

/// Takes over a proposal, new or changed.
fn propose(model: &mut Model, time_ns: u64, proposal: Proposal) {
    let unit = |name: &str| model.session.parameter(name).map_or(String::new(), |info| format!(" {}", info.unit));
    let value = |p: &ProposedParameter| format!("{} {}{}", p.name, six_digits(p.value), unit(&p.name));
    let values: Vec<String> = proposal.parameters.iter().map(value).collect();
    let text = format!("trial {} ({}): {}", proposal.trial, proposal.source.name(), values.join(", "));
    log(model, time_ns, LogLevel::Info, "proposal", text, proposal.revision == 0);
    renumber(model, &proposal);
    model.session.overrides.take(&proposal);
    model.session.proposal = Some(proposal);
}

/// Takes over a row of the trial table; rings for a suspected fall.
fn update_trial(model: &mut Model, time_ns: u64, trial: TrialRecord) -> Option<BellCause> {
    let suspects_fall = trial.verdict.is_none() && trial.suggested == Some(Verdict::Fall);
    log_trial(model, time_ns, &trial);
    let number = trial.trial;
    let waited = model.session.trials.records.get(&number).is_some_and(|before| before.verdict.is_none());
    if waited && trial.verdict.is_some() {
        say_verdict_by_rule(model, &trial);
    }
    model.session.trials.records.insert(number, trial);
    model.history.keep(model.session.trials.best().map(|best| best.trial));
    if model.session.stage.is_some_and(|now| (now.stage, now.trial) == (ExperimentStage::Running, number)) {
        lay_ground(model, number);
    }
    if model.session.under_review().is_some_and(|trial| trial.trial == number && trial.hand_value.is_none()) {
        say_suggestion(model, number);
    }
    suspects_fall.then_some(BellCause::Fall)
}

/// Logs a line of the session, and shows it where it needs attention or ends a wait.
fn log_line(model: &mut Model, time_ns: u64, line: LogRecord) {
    let waits = |shown: &Notice| shown.text.ends_with(ANSWERS_LATER);
    let wait_ended = line.message.starts_with(ANSWERED_AFTER) && model.message.as_ref().is_some_and(waits);
    if line.level > LogLevel::Info || wait_ended {
        say(model, line.level, line.message.clone());
    }
    if line.source == "session" && is_stop_of_observer(line.level, &line.message) {
        model.message.iter_mut().for_each(|message| message.stop = true);
        model.session.stopped_because.clone_from(&line.message);
    }
    log(model, time_ns, line.level, &line.source, line.message, false);
}

/// Takes over the reasons for a proposal. Without one, as at the end of a study, those for the last one stay, with the number of its
/// trial.
fn explain(model: &mut Model, mut insight: ProposalInsight) {
    model.session.trials.model_best = insight.predicted_best().copied();
    if let Some(before) = model.session.insight.take().filter(|_| insight.parameters.is_empty()) {
        (insight.trial, insight.parameters) = (before.trial, before.parameters);
    }
    model.session.insight = Some(insight);
}

/// Whether neither the operator nor the end of the session has sat the robot down: a failsafe, or the time without an approval.
fn is_unasked(change: &Transition) -> bool {
    let expected =
        [TransitionCause::Command, TransitionCause::StepFinished, TransitionCause::Fault(Fault::OperatorLeft)];
    expected.iter().all(|cause| cause.to_string() != change.cause)
}

/// Returns in words why the robot sat down.
fn sat_down(cause: &str) -> String {
    format!("the robot sat down: {cause}")
}

/// Lays the ground of a trial that runs.
fn lay_ground(model: &mut Model, trial: u32) {
    let row = model.session.trials.records.get(&trial);
    model.ground = model.trial_ground.zip(row).and_then(|(ground, row)| ground.of(Some(row)));
}

/// Puts the charts of a live session on the trial that waits for its verdict.
fn show_landed(model: &mut Model) {
    if model.replay.is_none() {
        let live = &mut model.live;
        (live.frozen, live.comparison) = (None, None);
        (live.present_in_review, live.landed_cursor_ns) = (false, None);
    }
}

fn note_time(model: &mut Model, info: StageRecord, time_ns: u64) {
    match info.stage {
        ExperimentStage::Running => {
            model.session.trials.ran.insert(info.trial, RunTime { begun_ns: time_ns, ended_ns: None });
        }
        ExperimentStage::Review => {
            if let Some(ran) = model.session.trials.ran.get_mut(&info.trial) {
                ran.ended_ns.get_or_insert(time_ns);
            }
        }
        ExperimentStage::Proposed | ExperimentStage::Finished => {}
    }
}

/// Reports the suggested verdict of the trial under review; its row and its stage come in either order.
fn say_suggestion(model: &mut Model, trial: u32) {
    let Some(row) = model.session.trials.records.get(&trial).filter(|row| row.verdict.is_none()) else { return };
    let Some(suggested) = row.suggested else { return };
    let level = if suggested == Verdict::Accept { LogLevel::Info } else { LogLevel::Warning };
    let text = format!("{}{} ({})", suggestion_of(trial), suggested.name(), row.cause);
    say(model, level, text);
}

fn suggestion_of(trial: u32) -> String {
    format!("trial #{trial}, suggested verdict: ")
}

/// Reports the verdict that the rule of `--approve` has given, in place of the suggestion on the screen. A verdict of the operator is
/// reported by the answer to it.
fn say_verdict_by_rule(model: &mut Model, row: &TrialRecord) {
    let approve = model.session.info.approve;
    let Some(verdict) = row.verdict.filter(|_| approve != Approval::Each && row.verdict == row.suggested) else {
        return;
    };
    let suggestion = suggestion_of(row.trial);
    if let Some(level) = model.message.as_ref().filter(|it| it.text.starts_with(&suggestion)).map(|it| it.level) {
        let (trial, rule, verdict) = (row.trial, approve.name(), verdict.name());
        say(model, level, format!("trial #{trial}, verdict by --approve {rule}: {verdict} ({})", row.cause));
    }
}

fn answer(model: &mut Model, time_ns: u64, command: RequestRecord) {
    let (level, outcome) = if command.accepted { (LogLevel::Info, "") } else { (LogLevel::Warning, "refused: ") };
    if command.accepted {
        model.session.sat_down_because.clear();
    }
    if command.request == OperatorRequest::TakeControl.to_string() {
        model.session.control_taken = command.accepted;
    }
    let text = match command.answer.as_str() {
        "" => command.request.clone(),
        answer => format!("{}: {outcome}{answer}", command.request),
    };
    match model.replay.is_some() {
        true => quote(model, level, &text),
        false => reply(model, level, text.clone()),
    }
    log(model, time_ns, level, "operator", text, false);
}

/// Logs a new verdict or suggestion; rows are also repeated for other reasons.
fn log_trial(model: &mut Model, time_ns: u64, trial: &TrialRecord) {
    let before = model.session.trials.records.get(&trial.trial);
    let known = |field: fn(&TrialRecord) -> Option<Verdict>| before.and_then(field) == field(trial);
    let text = match (trial.verdict, trial.suggested) {
        (Some(verdict), _) if !known(|t| t.verdict) => {
            let value = trial.value.map(|v| format!(", J = {v:.3} {}", model.session.info.unit)).unwrap_or_default();
            let source = match trial.source {
                ProposalSource::Sampler => String::new(),
                other => format!(" ({})", other.name()),
            };
            // A study that is continued begins with the rows of the sessions before; other workers add theirs.
            let ran_elsewhere = !trial.was_not_run() && !model.session.trials.ran.contains_key(&trial.trial);
            let of = match (ran_elsewhere, model.replay.is_some()) {
                (false, _) => "",
                (true, false) => " of another session",
                // Of `quadfrog optimize`, for example, that records the ticks of the best trial alone.
                (true, true) => " without ticks",
            };
            let by_hand = if trial.counts_by_hand() { " by hand" } else { "" };
            let verdict = trial.verdict_name().unwrap_or(verdict.name());
            format!("trial {}{of}{source}: {verdict}{value}{by_hand}", trial.trial)
        }
        (None, Some(verdict)) if !known(|t| t.suggested) => {
            let cause = if trial.cause.is_empty() { String::new() } else { format!(" ({})", trial.cause) };
            format!("trial {}, suggested verdict: {}{cause}", trial.trial, verdict.name())
        }
        _ => return,
    };
    log(model, time_ns, LogLevel::Info, "trial", text, trial.verdict.is_some());
}

/// Shows the reason of a latched fault, or why the robot sat down, again once a message that has replaced it was read: the line below
/// has no room for it in a narrow terminal.
pub(super) fn show_reason_again(model: &mut Model) {
    let session = &model.session;
    let (level, text) = match model.mode() {
        Mode::Fault if !session.stopped_because.is_empty() => {
            (LogLevel::Error, format!("{}: {}", Mode::Fault.name(), session.stopped_because))
        }
        Mode::SitDown | Mode::Disarmed if !session.sat_down_because.is_empty() => {
            (LogLevel::Warning, sat_down(&session.sat_down_because))
        }
        _ => return,
    };
    let read = |message: &Notice| message.text == text || model.clock.saturating_sub(message.at) < REASON_AGAIN;
    if !model.message.as_ref().is_some_and(read) {
        say(model, level, text);
    }
}

fn log(model: &mut Model, time_ns: u64, level: LogLevel, source: &str, text: String, marker: bool) {
    let line = LogLine { time_ns, level, source: source.to_owned(), text, marker };
    // A reader who has scrolled back stays on the same lines.
    if model.log_view.back > 0 && model.log_view.shows(&line) {
        model.log_view.back += 1;
    }
    model.session.log.push(line);
}
