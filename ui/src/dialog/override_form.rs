//! The form in which an operator changes a proposal.

use crossterm::event::KeyCode;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::trial::{ParameterInfo, Proposal, ProposedParameter};
use tui_input::Input;

use super::{Dialog, cancelled, edit};
use crate::action::Action;
use crate::keymap::Key;
use crate::model::Model;
use crate::update::{Effect, wish};

/// The proposal being changed. Nothing leaves it before Enter, and nothing moves before an approval.
#[derive(Debug, Clone)]
pub struct OverrideForm {
    /// Number of the proposal.
    pub trial: u32,
    /// The parameters.
    pub rows: Vec<OverrideRow>,
    /// The chosen one.
    pub selected: usize,
    /// A value being typed.
    pub typing: Option<Input>,
    /// What is wrong with it.
    pub problem: Option<String>,
}

/// One parameter of the form.
#[derive(Debug, Clone, PartialEq)]
pub struct OverrideRow {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// The value of the sampler or the queue; of a gain that of the configuration.
    pub proposed: f64,
    /// The value of the proposal when the form was opened.
    pub before: f64,
    /// The value now.
    pub value: f64,
    /// Whether it is a gain of the controller, not a parameter that is searched.
    pub gain: bool,
}

impl OverrideRow {
    /// What asks the session for the value.
    fn intent(&self) -> OperatorRequest {
        match self.gain {
            true => OperatorRequest::OverrideGain { gain: self.name.clone(), value: self.value },
            false => OperatorRequest::Override { parameter: self.name.clone(), value: self.value },
        }
    }
}

impl OverrideForm {
    /// The form for a proposal; parameters without known bounds are left out.
    pub fn new(proposal: &Proposal, model: &Model) -> OverrideForm {
        let row = |p: &ProposedParameter, info: ParameterInfo, gain| OverrideRow {
            name: p.name.clone(),
            unit: info.unit,
            low: info.low,
            high: info.high,
            proposed: p.proposed,
            before: p.value,
            value: p.value,
            gain,
        };
        let parameters = proposal.parameters.iter().filter_map(|p| Some(row(p, model.parameter(&p.name)?, false)));
        let gains = proposal.gains.iter().filter_map(|p| Some(row(p, model.gain(&p.name)?.clone(), true)));
        let rows: Vec<OverrideRow> = parameters.chain(gains).collect();
        let selected = model.override_row.min(rows.len().saturating_sub(1));
        OverrideForm { trial: proposal.trial, rows, selected, typing: None, problem: None }
    }

    /// Moves the chosen value by `share` of its range, stopping at the bounds.
    fn step(&mut self, share: f64) {
        self.typing = None;
        self.problem = None;
        if let Some(row) = self.rows.get_mut(self.selected) {
            row.value = (row.value + share * (row.high - row.low)).clamp(row.low, row.high);
        }
    }

    /// Takes the typed value over; false if it is not possible, and then `problem` says why.
    fn take_typed(&mut self) -> bool {
        let Some(input) = &self.typing else { return true };
        let Some(row) = self.rows.get_mut(self.selected) else { return true };
        match input.value().trim().replace(',', ".").parse::<f64>() {
            Ok(value) if (row.low..=row.high).contains(&value) => {
                row.value = value;
                self.typing = None;
                self.problem = None;
                true
            }
            Ok(value) => {
                self.problem = Some(format!(
                    "{} = {value} {u} is outside {} to {} {u}",
                    row.name,
                    row.low,
                    row.high,
                    u = row.unit
                ));
                false
            }
            Err(_) => {
                self.problem = Some(format!("`{}` is not a number", input.value()));
                false
            }
        }
    }

    fn select(&mut self, selected: usize) {
        if self.take_typed() {
            self.selected = selected.min(self.rows.len().saturating_sub(1));
        }
    }
}

/// One key while the form is open.
pub(super) fn key(model: &mut Model, key: Key, mut form: OverrideForm) -> Vec<Effect> {
    match key.code() {
        KeyCode::Esc if form.typing.is_some() => {
            form.typing = None;
            form.problem = None;
        }
        KeyCode::Esc => return cancelled(model, "nothing was changed"),
        KeyCode::Enter => {
            if form.take_typed() {
                let changed = form.rows.iter().filter(|row| row.value != row.before);
                let intents: Vec<OperatorRequest> = changed.map(OverrideRow::intent).collect();
                if intents.is_empty() {
                    return cancelled(model, "nothing was changed");
                }
                return intents.into_iter().flat_map(|intent| wish(model, intent)).collect();
            }
        }
        // The point as it stands in the form, with what is not as configured of the gains, comes next.
        _ if model.keymap.action(key) == Some(Action::QueuePoint) => {
            if form.take_typed() {
                let said = form.rows.iter().filter(|row| !row.gain || row.value != row.proposed);
                let point = said.map(|row| (row.name.clone(), row.value)).collect();
                return wish(model, OperatorRequest::Enqueue(point));
            }
        }
        KeyCode::Up => form.select(form.selected.saturating_sub(1)),
        KeyCode::Down | KeyCode::Tab => form.select(form.selected + 1),
        KeyCode::Left if form.typing.is_none() => form.step(-0.01),
        KeyCode::Right if form.typing.is_none() => form.step(0.01),
        KeyCode::PageDown => form.step(-0.1),
        KeyCode::PageUp => form.step(0.1),
        _ => {
            // A number and nothing else can be typed here.
            let digit = matches!(key.typed(), Some('0'..='9' | '.' | ',' | '-' | '+' | 'e'));
            if digit || form.typing.is_some() && key.typed().is_none() {
                form.problem = None;
                edit(form.typing.get_or_insert_default(), key);
            }
        }
    }
    model.override_row = form.selected;
    model.dialog = Some(Dialog::Override(form));
    Vec::new()
}
