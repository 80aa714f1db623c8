//! What each action does.

use quadfrog::recording::record::LogLevel;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{ExperimentStage, Verdict};

use super::navigate::{filter, freeze, ghost, move_by, move_cursor, next_mode, next_series, next_sort, zoom};
use super::{Effect, ReplayCommand, interrupt, say, stop, wish};
use crate::action::{Action, may_acknowledge, may_wish};
use crate::dialog::{Choice, Dialog, OverrideForm, Purpose};
use crate::model::{Model, View};

/// Does an action, or says why not.
pub fn perform(model: &mut Model, action: Action) -> Vec<Effect> {
    if let Err(reason) = action.legal(model) {
        say(model, LogLevel::Warning, format!("{}: {reason}", action.info().name));
        // What stands in the way of arming is shown at once, all of it.
        let shown = action == Action::Arm && model.mode() == Mode::Disarmed && model.pre_arm_failing().count() > 0;
        if shown && may_wish(model).is_ok() {
            return open(model, Dialog::PreArm { selected: 0 });
        }
        return Vec::new();
    }
    match action {
        Action::Stop => stop(model, "STOP"),
        Action::Interrupt => interrupt(model),
        // A machine that can hurt somebody is asked about with a word, not with a key that lies under a finger.
        Action::Arm if model.is_hardware() => open(model, Dialog::Arm { typed: 0 }),
        Action::Arm => wish(model, OperatorRequest::Arm),
        Action::PreArm => open(model, Dialog::PreArm { selected: 0 }),
        Action::SitDown => wish(model, OperatorRequest::SitDown),
        Action::Acknowledge => wish(model, OperatorRequest::Acknowledge),
        Action::Approve => open_approval(model),
        Action::Override => open_override(model),
        Action::ClearOverrides => wish(model, OperatorRequest::ClearOverrides),
        Action::Fix => fix(model),
        Action::Bounds => bounds(model),
        Action::QueuePoint => queue_point(model),
        Action::Skip => wish(model, OperatorRequest::Skip),
        Action::Continue => open(model, Dialog::field(Purpose::Continue, "20")),
        Action::ConfirmBest => match model.search.as_ref().and_then(|search| search.confirming) {
            Some(_) => wish(model, OperatorRequest::ConfirmBest { repeats: 0 }),
            None => open(model, Dialog::field(Purpose::ConfirmBest, "10")),
        },
        Action::ExportBest => vec![Effect::ExportBest],
        Action::Accept => wish(model, OperatorRequest::Judge(Verdict::Accept)),
        Action::Fall => wish(model, OperatorRequest::Judge(Verdict::Fall)),
        Action::Void => wish(model, OperatorRequest::Judge(Verdict::Void)),
        Action::Rerun => rerun(model),
        Action::Undo => wish(model, OperatorRequest::Undo),
        Action::HandValue => match model.under_review().map(|trial| (trial.trial, trial.hand_value)) {
            Some((trial, value)) => {
                let text = value.map(|value| value.to_string()).unwrap_or_default();
                open(model, Dialog::field(Purpose::HandValue(trial), &text))
            }
            None => Vec::new(),
        },
        Action::Note => match model.trial_for_note().map(|trial| (trial.trial, trial.note.clone())) {
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
        Action::PreviousView => show(model, neighbour_view(model.view, View::ALL.len() - 1)),
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
            model.trials_view.reversed = !model.trials_view.reversed;
            Vec::new()
        }
        Action::Filter => filter(model),
        Action::Columns => open(model, Dialog::Choose { what: Choice::Columns, selected: 0 }),
        Action::BestOnly => {
            model.trials_view.best_only = !model.trials_view.best_only;
            Vec::new()
        }
        Action::Search => {
            let (purpose, text) = match model.view {
                View::Log => (Purpose::LogSearch, model.log_view.search.clone()),
                _ => (Purpose::TrialNumber, String::new()),
            };
            open(model, Dialog::field(purpose, &text))
        }
        Action::Copy => match model.selected_trial().map(|trial| crate::view::trial_text::as_text(trial, model)) {
            Some(text) => {
                say(model, LogLevel::Info, "the row is on your terminal's clipboard (OSC 52)".to_owned());
                vec![Effect::Copy(text)]
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
            say(model, LogLevel::Info, text.to_owned());
            vec![Effect::Mouse(model.mouse)]
        }
        Action::Redraw => {
            say(model, LogLevel::Info, "the screen was drawn again".to_owned());
            vec![Effect::Redraw]
        }
        Action::Suspend => vec![Effect::Suspend],
        Action::Quit if model.robot_needs_us() || model.stage_is(ExperimentStage::Review) && model.replay.is_none() => {
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
    let Some(proposal) = &model.proposal else { return Vec::new() };
    let (trial, revision) = (proposal.trial, proposal.revision);
    open(model, Dialog::Approve { trial, revision, pressed_at: model.clock })
}

fn open_override(model: &mut Model) -> Vec<Effect> {
    let Some(proposal) = model.proposal.clone() else { return Vec::new() };
    let form = OverrideForm::new(&proposal, model);
    open(model, Dialog::Override(form))
}

/// Asks for how many trials the chosen parameter keeps the card's value; a fixed one is searched again.
fn fix(model: &mut Model) -> Vec<Effect> {
    let Some(name) = model.override_parameter().map(|info| info.name.clone()) else { return Vec::new() };
    if model.searched(&name).is_some_and(|searched| searched.fixed.is_some()) {
        return wish(model, OperatorRequest::Unfix { parameter: name });
    }
    let Some(value) = model.override_value() else { return Vec::new() };
    open(model, Dialog::field(Purpose::Fix { parameter: model.override_row, value }, "5"))
}

fn bounds(model: &mut Model) -> Vec<Effect> {
    let Some(info) = model.override_parameter().and_then(|info| model.parameter(&info.name)) else { return Vec::new() };
    let text = format!("{}..{}", info.low, info.high);
    open(model, Dialog::field(Purpose::Bounds { parameter: model.override_row }, &text))
}

fn queue_point(model: &mut Model) -> Vec<Effect> {
    let Some(proposal) = model.proposal_on_table() else { return Vec::new() };
    let gains = proposal.gains.iter().filter(|gain| gain.value != gain.proposed);
    let point = proposal.parameters.iter().chain(gains).map(|p| (p.name.clone(), p.value)).collect();
    wish(model, OperatorRequest::Enqueue(point))
}

/// Enter: what lies nearest, as long as nothing moves by it.
fn open_details(model: &mut Model) -> Vec<Effect> {
    if may_acknowledge(model).is_ok() {
        return wish(model, OperatorRequest::Acknowledge);
    }
    if model.view == View::Override && Action::Override.legal(model).is_ok() {
        return open_override(model);
    }
    let trial = match model.view {
        View::Trials => model.selected_trial(),
        _ => model.under_review().or(model.trials.values().next_back()),
    };
    match trial.map(|trial| trial.trial) {
        Some(trial) => open(model, Dialog::Details { trial, scroll: 0 }),
        None => {
            say(model, LogLevel::Info, "there is no trial yet".to_owned());
            Vec::new()
        }
    }
}

/// Under review: void and queue again. In the table: queue the chosen trial.
fn rerun(model: &mut Model) -> Vec<Effect> {
    let trial = match model.stage_is(ExperimentStage::Review) {
        true => None,
        false => model.selected_trial().map(|trial| trial.trial),
    };
    wish(model, OperatorRequest::Rerun { trial })
}

fn show(model: &mut Model, view: View) -> Vec<Effect> {
    model.view = view;
    Vec::new()
}

fn neighbour_view(view: View, step: usize) -> View {
    let index = View::ALL.iter().position(|v| *v == view).unwrap_or(0);
    View::ALL[(index + step) % View::ALL.len()]
}
