//! The effect of each action.

use quadfrog::recording::record::LogLevel;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{ExperimentStage, Verdict};

use strum::VariantArray;

use super::answer::{interrupt, request, say, stop};
use super::navigate::{filter, freeze, ghost, move_by, move_cursor, next_mode, next_series, next_sort, zoom};
use crate::action::Action;
use crate::legal::{legal, may_acknowledge, may_request};
use crate::message::{Effect, ReplayCommand};
use crate::model::dialog::{Choice, Dialog, OverrideForm, Purpose};
use crate::model::{Model, View};

/// Performs an action, or reports why it is not possible.
pub(super) fn perform(model: &mut Model, action: Action) -> Vec<Effect> {
    if let Err(reason) = legal(action, model) {
        say(model, LogLevel::Warning, format!("{}: {reason}", action.info().name));
        // All failed arming checks are shown at once.
        let shown = action == Action::Arm && model.mode() == Mode::Disarmed && model.session.failing_checks() > 0;
        if shown && may_request(model).is_ok() {
            return open(model, Dialog::ArmingChecks { selected: 0 });
        }
        return Vec::new();
    }
    match action {
        Action::Stop => stop(model),
        Action::Interrupt => interrupt(model),
        // Arming hardware needs a typed confirmation, not a single key.
        Action::Arm if model.session.is_hardware() => open(model, Dialog::Arm { typed: 0 }),
        Action::Arm => request(model, OperatorRequest::Arm),
        Action::ArmingChecks => open(model, Dialog::ArmingChecks { selected: 0 }),
        Action::SitDown => request(model, OperatorRequest::SitDown),
        Action::Acknowledge => request(model, OperatorRequest::Acknowledge),
        Action::Approve => open_approval(model),
        Action::Override => open_override(model),
        Action::ClearOverrides => request(model, OperatorRequest::ClearOverrides),
        Action::Fix => fix(model),
        Action::Bounds => bounds(model),
        Action::QueuePoint => queue_point(model),
        Action::Skip => request(model, OperatorRequest::Skip),
        Action::Continue => open(model, Dialog::field(Purpose::Continue, "20")),
        Action::ConfirmBest => match model.session.confirming() {
            Some(_) => request(model, OperatorRequest::ConfirmBest { repeats: 0 }),
            None => open(model, Dialog::field(Purpose::ConfirmBest, "10")),
        },
        Action::ExportBest => vec![Effect::ExportBest],
        Action::Accept => request(model, OperatorRequest::Judge(Verdict::Accept)),
        Action::Fall => request(model, OperatorRequest::Judge(Verdict::Fall)),
        Action::Void => request(model, OperatorRequest::Judge(Verdict::Void)),
        Action::Rerun => rerun(model),
        Action::Undo => request(model, OperatorRequest::Undo),
        Action::HandValue => match model.session.under_review().map(|trial| (trial.trial, trial.hand_value)) {
            Some((trial, value)) => {
                let text = value.map(|value| value.to_string()).unwrap_or_default();
                open(model, Dialog::field(Purpose::HandValue(trial), &text))
            }
            None => Vec::new(),
        },
        Action::Note => match model.trial_in_view().map(|trial| (trial.trial, trial.note.clone())) {
            Some((trial, note)) => open(model, Dialog::field(Purpose::Note(trial), &note)),
            None => Vec::new(),
        },
        Action::Open => open_details(model),
        Action::LiveView => show(model, View::Live),
        Action::TrialsView => show(model, View::Trials),
        Action::OptimizerView => show(model, View::Optimizer),
        Action::OverrideView => show(model, View::Override),
        Action::HealthView => show(model, View::Health),
        Action::LogView => show(model, View::Log),
        Action::NextView => show(model, neighbour_view(model.view, 1)),
        Action::PreviousView => show(model, neighbour_view(model.view, View::VARIANTS.len() - 1)),
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
        Action::Series => next_series(model),
        Action::ChooseSeries => open(model, Dialog::Choose { what: Choice::Series, selected: 0 }),
        Action::Ghost => ghost(model),
        Action::Sort => next_sort(model),
        Action::Reverse => {
            model.trial_table.reversed = !model.trial_table.reversed;
            Vec::new()
        }
        Action::Filter => filter(model),
        Action::Columns => open(model, Dialog::Choose { what: Choice::Columns, selected: 0 }),
        Action::BestOnly => {
            model.trial_table.best_only = !model.trial_table.best_only;
            Vec::new()
        }
        Action::Search => {
            let (purpose, text) = match model.view {
                View::Log => (Purpose::LogSearch, model.log_view.search.clone()),
                _ => (Purpose::TrialNumber, String::new()),
            };
            open(model, Dialog::field(purpose, &text))
        }
        Action::Copy => match model.selected_trial().map(|trial| trial.trial) {
            Some(trial) => {
                say(model, LogLevel::Info, "the row is on your terminal's clipboard (OSC 52)");
                vec![Effect::CopyTrial(trial)]
            }
            None => Vec::new(),
        },
        Action::Export => vec![Effect::Export],
        Action::PlayPause => vec![Effect::Replay(ReplayCommand::PlayPause)],
        Action::StepForward => vec![Effect::Replay(ReplayCommand::StepForward)],
        Action::StepBack => vec![Effect::Replay(ReplayCommand::StepBack)],
        Action::Slower => vec![Effect::Replay(ReplayCommand::Slower)],
        Action::Faster => vec![Effect::Replay(ReplayCommand::Faster)],
        Action::PreviousMarker => vec![Effect::Replay(ReplayCommand::PreviousMarker)],
        Action::NextMarker => vec![Effect::Replay(ReplayCommand::NextMarker)],
        Action::Palette => open(model, Dialog::Palette { input: Default::default(), selected: 0 }),
        Action::Help => open(model, Dialog::Help { scroll: 0 }),
        Action::Mouse => {
            model.mouse = !model.mouse;
            let text = if model.mouse {
                "mouse on: tabs, rows, wheel; Shift while dragging selects text in most terminals"
            } else {
                "mouse off: your terminal selects and copies text"
            };
            say(model, LogLevel::Info, text);
            vec![Effect::Mouse(model.mouse)]
        }
        Action::Redraw => {
            say(model, LogLevel::Info, "the screen was drawn again");
            vec![Effect::Redraw]
        }
        Action::Suspend => vec![Effect::Suspend],
        Action::Quit
            if model.robot_needs_us() || model.session.stage_is(ExperimentStage::Review) && model.replay.is_none() =>
        {
            open(model, Dialog::Quit)
        }
        Action::Quit => vec![Effect::Quit],
    }
}

fn open(model: &mut Model, dialog: Dialog) -> Vec<Effect> {
    model.dialog = Some(dialog);
    Vec::new()
}

fn open_approval(model: &mut Model) -> Vec<Effect> {
    let Some(proposal) = model.session.open_proposal() else { return Vec::new() };
    let (trial, revision) = (proposal.trial, proposal.revision);
    open(model, Dialog::Approve { trial, revision, pressed_at: model.clock })
}

fn open_override(model: &mut Model) -> Vec<Effect> {
    let Some(proposal) = model.session.open_proposal() else { return Vec::new() };
    let form = OverrideForm::new(proposal, &model.session, model.override_row);
    open(model, Dialog::Override(form))
}

/// Asks for how many trials the selected parameter keeps its proposed value; a fixed one is searched again.
fn fix(model: &mut Model) -> Vec<Effect> {
    let Some(name) = model.override_parameter().map(|info| info.name.clone()) else { return Vec::new() };
    if model.session.searched(&name).is_some_and(|searched| searched.fixed.is_some()) {
        return request(model, OperatorRequest::Unfix { parameter: name });
    }
    let Some(value) = model.override_value() else { return Vec::new() };
    open(model, Dialog::field(Purpose::Fix { parameter: model.override_row, value }, "5"))
}

fn bounds(model: &mut Model) -> Vec<Effect> {
    let Some(info) = model.override_parameter().and_then(|info| model.session.parameter(&info.name)) else {
        return Vec::new();
    };
    let text = format!("{}..{}", info.low, info.high);
    open(model, Dialog::field(Purpose::Bounds { parameter: model.override_row }, &text))
}

fn queue_point(model: &mut Model) -> Vec<Effect> {
    let Some(proposal) = model.session.open_proposal() else { return Vec::new() };
    let gains = proposal.gains.iter().filter(|gain| gain.value != gain.proposed);
    let point = proposal.parameters.iter().chain(gains).map(|p| (p.name.clone(), p.value)).collect();
    request(model, OperatorRequest::Enqueue(point))
}

/// Enter: acknowledges, overrides or opens the details; it never starts motion.
fn open_details(model: &mut Model) -> Vec<Effect> {
    if may_acknowledge(model).is_ok() {
        return request(model, OperatorRequest::Acknowledge);
    }
    if model.view == View::Override && legal(Action::Override, model).is_ok() {
        return open_override(model);
    }
    match model.trial_in_view().map(|trial| trial.trial) {
        Some(trial) => open(model, Dialog::Details { trial, scroll: 0 }),
        None => {
            say(model, LogLevel::Info, "there is no trial yet");
            Vec::new()
        }
    }
}

/// Under review: voids the trial and queues it again. In the table: queues the selected trial.
fn rerun(model: &mut Model) -> Vec<Effect> {
    let trial = match model.session.stage_is(ExperimentStage::Review) {
        true => None,
        false => model.selected_trial().map(|trial| trial.trial),
    };
    request(model, OperatorRequest::Rerun { trial })
}

fn show(model: &mut Model, view: View) -> Vec<Effect> {
    model.view = view;
    Vec::new()
}

fn neighbour_view(view: View, step: usize) -> View {
    View::VARIANTS[(view as usize + step) % View::VARIANTS.len()]
}
