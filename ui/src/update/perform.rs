//! The effect of each action.

use std::time::Duration;

use quadfrog::recording::record::LogLevel;
use quadfrog::session::objective;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{ExperimentStage, Proposal, ProposalSource, Verdict, six_digits};
use strum::VariantArray;
use tui_input::Input;

use super::beside;
use super::navigate::{filter, freeze, move_by, move_cursor, next_mode, next_series, next_sort, zoom};
use super::rejudged;
use super::request::{drop_answer, interrupt, reply, request, stop};
use crate::action::Action;
use crate::legal::{legal, may_request, palette};
use crate::message::{Effect, ExportedRows, ReplayCommand, ReplayStep};
use crate::model::dialog::{Choice, Dialog, MAX_WIDTH, OverrideForm, Purpose, Question};
use crate::model::{Model, View};
use crate::text::{range, report};
use crate::theme::Background;

/// Time within which the same verdict is a key that was pressed twice: another trial cannot wait so soon.
const DOUBLE_PRESS: Duration = Duration::from_secs(1);

/// Performs an action, or reports why it is not possible.
pub(super) fn perform(model: &mut Model, action: Action) -> Vec<Effect> {
    // A key that was pressed twice judges once, and the first answer stays.
    if let Some((judged, at)) = model.judged.take()
        && judged == action
        && model.clock.saturating_sub(at) < DOUBLE_PRESS
    {
        model.judged = Some((judged, at));
        return Vec::new();
    }
    if let Err(reason) = legal(action, model) {
        // Esc also closes dialogs: once more, it has nothing to close.
        if action == Action::EndComparison {
            return Vec::new();
        }
        let key = model.keymap.key(action);
        reply(model, LogLevel::Warning, format!("{key} is not possible: {reason}"));
        // All failed arming checks are shown at once.
        let shown = action == Action::Arm && model.mode() == Mode::Disarmed && model.session.failing_checks() > 0;
        if shown && may_request(model).is_ok() {
            open(model, Dialog::ArmingChecks { selected: 0, scroll: 0 });
        }
        return Vec::new();
    }
    drop_answer(model);
    match action {
        Action::Stop => return stop(model),
        Action::Interrupt => return interrupt(model),
        Action::TakeControl => open(model, Dialog::TakeControl),
        // Arming hardware needs a typed confirmation, not a single key.
        Action::Arm if model.session.info.is_hardware() => {
            open(model, Dialog::Arm { typed: 0, opened_at: model.clock })
        }
        Action::Arm => return request(model, OperatorRequest::Arm),
        Action::ArmingChecks => open(model, Dialog::ArmingChecks { selected: 0, scroll: 0 }),
        Action::SitDown => return request(model, OperatorRequest::SitDown),
        Action::Acknowledge => return request(model, OperatorRequest::Acknowledge),
        Action::Approve => {
            if let Some(&Proposal { trial, revision, .. }) = model.session.open_proposal() {
                open(model, Dialog::Approve { trial, revision, pressed_at: model.clock, area_clear: false });
            }
        }
        Action::Override => open_override(model),
        Action::ClearOverrides => return request(model, OperatorRequest::ClearOverrides),
        Action::Fix => return fix(model),
        Action::Bounds => bounds(model),
        Action::QueuePoint => {
            let Some(proposal) = model.session.open_proposal() else { return Vec::new() };
            let (trial, revision, point) = (proposal.trial, proposal.revision, queued_values(proposal));
            // A queued point would run twice, and the sampler's while it draws at random: the queued trial uses up no draw.
            match model.session.is_queued(trial) || proposal.source == ProposalSource::Sampler {
                true => open(model, Dialog::Confirm(Question::QueueProposed { trial, revision })),
                false => return request(model, OperatorRequest::Enqueue(point)),
            }
        }
        Action::Queue => open(model, Dialog::Queue { selected: None }),
        Action::Skip => {
            if let Some(&Proposal { trial, revision, .. }) = model.session.open_proposal() {
                open(model, Dialog::Confirm(Question::Skip { trial, revision }));
            }
        }
        Action::Continue => open(model, Dialog::field(Purpose::Continue, "20")),
        Action::ConfirmBest if model.session.confirming().is_some() => {
            open(model, Dialog::Confirm(Question::EndRepeats));
        }
        Action::ConfirmBest => open(model, Dialog::field(Purpose::ConfirmBest, "10")),
        Action::ExportBest => return vec![Effect::ExportBest],
        Action::Accept if model.session.not_to_accept().is_some() => {
            if let Some(trial) = model.session.not_to_accept().map(|row| row.trial) {
                open(model, Dialog::Confirm(Question::JudgeAnyway { trial, verdict: Verdict::Accept }));
            }
        }
        // The sampler would avoid its parameters.
        Action::Fall if model.session.not_to_fall().is_some() => {
            if let Some(trial) = model.session.not_to_fall().map(|row| row.trial) {
                open(model, Dialog::Confirm(Question::JudgeAnyway { trial, verdict: Verdict::Fall }));
            }
        }
        Action::Accept => return judge(model, Verdict::Accept),
        Action::Fall => return judge(model, Verdict::Fall),
        Action::Void => return judge(model, Verdict::Void),
        Action::Rerun => return rerun(model),
        Action::Undo => {
            let selected = model.selected_trial().map(|row| row.trial).filter(|_| model.view == View::Trials);
            match model.session.undoable() {
                Some(trial) if selected.is_some_and(|selected| selected != trial) => {
                    open(model, Dialog::Confirm(Question::Undo { trial }));
                }
                _ => return request(model, OperatorRequest::Undo),
            }
        }
        Action::HandValue => {
            if let Some(trial) = model.session.under_review() {
                let text = trial.hand_value.map(six_digits).unwrap_or_default();
                open(model, Dialog::field(Purpose::HandValue(trial.trial), &text));
            }
        }
        Action::Note => {
            if let Some(trial) = model.trial_in_view() {
                open(model, Dialog::field(Purpose::Note(trial.trial), &trial.note));
            }
        }
        Action::Open => return open_details(model),
        Action::LiveView => model.view = View::Live,
        Action::TrialsView => model.view = View::Trials,
        Action::OptimizerView => model.view = View::Optimizer,
        Action::OverrideView => model.view = View::Override,
        Action::HealthView => model.view = View::Health,
        Action::LogView => model.view = View::Log,
        Action::NextView => model.view = neighbour_view(model.view, 1),
        Action::PreviousView => model.view = neighbour_view(model.view, View::VARIANTS.len() - 1),
        Action::Up => move_by(model, -1),
        Action::Down => move_by(model, 1),
        Action::PageUp => move_by(model, -(model.page.max(2) as isize - 1)),
        Action::PageDown => move_by(model, model.page.max(2) as isize - 1),
        Action::First => move_by(model, isize::MIN),
        Action::Last => move_by(model, isize::MAX),
        Action::Left => move_cursor(model, -1),
        Action::Right => move_cursor(model, 1),
        Action::Freeze => freeze(model),
        Action::ZoomIn => zoom(model, 0.5),
        Action::ZoomOut => zoom(model, 2.0),
        Action::ChartMode => next_mode(model),
        Action::Series if model.view == View::Health => model.health_history_shown = !model.health_history_shown,
        Action::Series => next_series(model),
        Action::ChooseSeries => open(model, Dialog::Choose { subject: Choice::Series, selected: 0 }),
        Action::Ghost => return beside::ghost(model),
        Action::Sort => next_sort(model),
        Action::Reverse => model.trial_table.reversed = !model.trial_table.reversed,
        Action::Filter => filter(model),
        Action::Columns => open(model, Dialog::Choose { subject: Choice::Columns, selected: 0 }),
        Action::BestOnly => model.trial_table.best_only = !model.trial_table.best_only,
        Action::Search if model.view == View::Log => {
            open(model, Dialog::field(Purpose::LogSearch, &model.log_view.search));
        }
        Action::Search => open(model, Dialog::field(Purpose::TrialNumber, "")),
        Action::Copy => {
            if let Some(trial) = model.selected_trial().map(|trial| trial.trial) {
                reply(
                    model,
                    LogLevel::Info,
                    "the row was sent to the clipboard of your terminal (OSC 52), if it has one",
                );
                return vec![Effect::CopyTrial(trial)];
            }
        }
        Action::Export => {
            let (shown, all) = (model.trial_rows().len(), model.every_trial().len());
            if shown == all {
                return vec![Effect::Export(ExportedRows::All)];
            }
            open(model, Dialog::Export { shown, all });
        }
        Action::Seek => open(model, Dialog::field(Purpose::Seek, "")),
        Action::PlayPause => return vec![Effect::Replay(ReplayCommand::PlayPause)],
        Action::StepForward => return vec![Effect::Replay(ReplayCommand::Forward(ReplayStep::Frame))],
        Action::StepBack => return vec![Effect::Replay(ReplayCommand::Back(ReplayStep::Frame))],
        Action::TickForward => return vec![Effect::Replay(ReplayCommand::Forward(ReplayStep::Tick))],
        Action::TickBack => return vec![Effect::Replay(ReplayCommand::Back(ReplayStep::Tick))],
        Action::SecondForward => return vec![Effect::Replay(ReplayCommand::Forward(ReplayStep::Second))],
        Action::SecondBack => return vec![Effect::Replay(ReplayCommand::Back(ReplayStep::Second))],
        Action::Slower => return vec![Effect::Replay(ReplayCommand::Slower)],
        Action::Faster => return vec![Effect::Replay(ReplayCommand::Faster)],
        Action::PreviousMarker => return vec![Effect::Replay(ReplayCommand::PreviousMarker)],
        Action::NextMarker => return vec![Effect::Replay(ReplayCommand::NextMarker)],
        Action::PreviousFall => return vec![Effect::Replay(ReplayCommand::PreviousFall)],
        Action::NextFall => return vec![Effect::Replay(ReplayCommand::NextFall)],
        Action::ReplayStart => return vec![Effect::Replay(ReplayCommand::Start)],
        Action::ReplayEnd => return vec![Effect::Replay(ReplayCommand::End)],
        Action::LoopJump => return vec![Effect::Replay(ReplayCommand::Loop)],
        Action::SlowMotion => return vec![Effect::Replay(ReplayCommand::SlowMotion)],
        Action::Rejudge => return rejudged::toggle(model),
        Action::Beside => return beside::begin(model),
        Action::EndComparison => {
            beside::no_ghost(model);
            reply(model, LogLevel::Info, "no trial is compared any longer");
            return beside::ended(model);
        }
        Action::Palette => open_palette(model, Default::default()),
        Action::Help => open(model, Dialog::Help { scroll: 0 }),
        Action::Report => {
            let lines = report(&model.session, usize::from(model.size.0.min(MAX_WIDTH)).saturating_sub(4));
            open(model, Dialog::Report { lines, scroll: 0 });
        }
        Action::Theme => {
            model.follow_background = false;
            let (background, text) = match model.theme.background {
                Background::Dark => (Background::Light, "colours for a light background"),
                Background::Light => (Background::Dark, "colours for a dark background"),
            };
            model.theme.background = background;
            reply(model, LogLevel::Info, text);
            return vec![Effect::Redraw];
        }
        Action::Mouse => {
            model.mouse = !model.mouse;
            let text = match model.mouse {
                true => "mouse on: tabs, rows, wheel; Shift while dragging selects text in most terminals",
                false => "mouse off: your terminal selects and copies text",
            };
            reply(model, LogLevel::Info, text);
            return vec![Effect::Mouse(model.mouse)];
        }
        Action::Redraw => {
            reply(model, LogLevel::Info, "the screen was drawn again");
            return vec![Effect::Redraw];
        }
        Action::Suspend => return vec![Effect::Suspend],
        Action::Quit
            if model.robot_is_energised()
                || model.session.stage_is(ExperimentStage::Review) && model.replay.is_none() =>
        {
            open(model, Dialog::Quit);
        }
        Action::Quit => return vec![Effect::Quit],
    }
    Vec::new()
}

fn open(model: &mut Model, dialog: Dialog) {
    model.dialog = Some(dialog);
}

/// Opens the list of actions with the first one selected that passes the filter.
pub(super) fn open_palette(model: &mut Model, input: Input) {
    let selected = palette(input.value(), model).first().map(|(info, _)| info.action);
    open(model, Dialog::Palette { input, selected });
}

fn open_override(model: &mut Model) {
    // The row that the view Override shows as chosen; elsewhere nothing is.
    let row = if model.view == View::Override { model.override_row } else { 0 };
    if let Some(proposal) = model.session.open_proposal() {
        model.dialog = Some(Dialog::Override(OverrideForm::new(proposal, &model.session, row)));
    }
}

/// Asks for how many trials the selected parameter keeps its proposed value; a fixed one is searched again.
fn fix(model: &mut Model) -> Vec<Effect> {
    let Some(name) = model.override_parameter().map(|info| info.name.clone()) else { return Vec::new() };
    if model.session.searched(&name).is_some_and(|searched| searched.fixed.is_some()) {
        return request(model, OperatorRequest::Unfix { parameter: name });
    }
    let Some(value) = model.override_value() else { return Vec::new() };
    open(model, Dialog::field(Purpose::Fix { parameter: model.override_row, value }, "5"));
    Vec::new()
}

fn bounds(model: &mut Model) {
    if let Some(info) = model.session.present_parameter(model.override_row) {
        open(model, Dialog::field(Purpose::Bounds { parameter: model.override_row }, &range(&info)));
    }
}

/// The values of a proposal as a point for the queue: its parameters, and the gains that were changed.
pub(super) fn queued_values(proposal: &Proposal) -> Vec<(String, f64)> {
    proposal.parameters.iter().chain(proposal.changed_gains()).map(|p| (p.name.clone(), p.value)).collect()
}

/// Enter: overrides, goes to the trial of a replay or opens the details. It never starts motion and acknowledges no stop: it may
/// have been meant for a dialog that the stop has closed.
fn open_details(model: &mut Model) -> Vec<Effect> {
    if model.view == View::Trials
        && let Some(trial) = model.selected_trial().map(|trial| trial.trial)
        && model.timeline.as_ref().is_some_and(|timeline| timeline.has_ticks_of(trial))
        && model.snapshot.tick.trial != Some(trial)
    {
        return vec![Effect::Replay(ReplayCommand::Trial(trial))];
    }
    if model.view == View::Log {
        match model.log_view.selected(&model.session.log) {
            Some(_) => open(model, Dialog::LogLine { scroll: 0 }),
            None => reply(model, LogLevel::Info, "the log has no line"),
        }
        return Vec::new();
    }
    if model.view == View::Override && legal(Action::Override, model).is_ok() {
        open_override(model);
    } else if let Some(trial) = model.trial_in_view().map(|trial| trial.trial) {
        open(model, Dialog::Details { trial, scroll: 0 });
    } else {
        let text = model.session.no_trial_yet();
        reply(model, LogLevel::Info, text);
    }
    Vec::new()
}

/// Judges the trial under review. Without one the selected row of Trials: asks for the reason of the change.
fn judge(model: &mut Model, verdict: Verdict) -> Vec<Effect> {
    if model.session.stage_is(ExperimentStage::Review) {
        if verdict == Verdict::Void {
            return void(model, false);
        }
        let action = if verdict == Verdict::Fall { Action::Fall } else { Action::Accept };
        model.judged = Some((action, model.clock));
        return request(model, OperatorRequest::Judge(verdict));
    }
    if let Some(trial) = model.selected_trial().map(|row| row.trial) {
        open(model, Dialog::field(Purpose::ChangeVerdict { trial, verdict }, ""));
    }
    Vec::new()
}

/// Voids the trial under review; asks for the reason if it tripped a limit.
fn void(model: &mut Model, rerun: bool) -> Vec<Effect> {
    match model.session.under_review().filter(|row| objective::tripped_limit(row)).map(|row| row.trial) {
        Some(trial) => open(model, Dialog::field(Purpose::VoidReason { trial, rerun }, "")),
        None if rerun => return request(model, OperatorRequest::Rerun { trial: None }),
        None => {
            model.judged = Some((Action::Void, model.clock));
            return request(model, OperatorRequest::Judge(Verdict::Void));
        }
    }
    Vec::new()
}

/// Under review: voids the trial and queues it again. In the table: queues the selected trial.
fn rerun(model: &mut Model) -> Vec<Effect> {
    match model.session.stage_is(ExperimentStage::Review) {
        true => void(model, true),
        // Asked: letters of a reason whose field did not open must not queue a jump.
        false => {
            if let Some(trial) = model.selected_trial().map(|trial| trial.trial) {
                open(model, Dialog::Confirm(Question::Rerun { trial }));
            }
            Vec::new()
        }
    }
}

fn neighbour_view(view: View, step: usize) -> View {
    View::VARIANTS[(view as usize + step) % View::VARIANTS.len()]
}
