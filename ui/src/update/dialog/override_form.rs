//! Keys of the form that changes a proposal.

use crossterm::event::KeyCode;
use quadfrog::recording::record::LogLevel;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::trial::six_digits;
use tui_input::Input;

use super::text_field::edit;
use crate::action::Action;
use crate::keymap::Key;
use crate::message::Effect;
use crate::model::Model;
use crate::model::dialog::{Dialog, OverrideForm, OverrideRow, Problem};
use crate::update::request::{cancelled, does_nothing, reply, request};

fn override_request(row: &OverrideRow) -> OperatorRequest {
    match row.gain {
        true => OperatorRequest::OverrideGain { gain: row.name.clone(), value: row.value },
        false => OperatorRequest::Override { parameter: row.name.clone(), value: row.value },
    }
}

impl OverrideForm {
    /// Moves the selected value by `share` of its range, stopping at the bounds.
    fn step(&mut self, share: f64) {
        self.typing = None;
        self.problem = None;
        if let Some(row) = self.rows.get_mut(self.selected) {
            row.value = (row.value + share * (row.high - row.low)).clamp(row.low, row.high);
        }
    }

    /// Reports, before a key uses the number, that a character of it was not taken; the key uses it when pressed again, and a digit
    /// begins the number anew.
    fn asks_about_refused_character(&mut self, key: Key, does: &str) -> bool {
        if !self.has_refused_character() || self.is_outside() {
            return false;
        }
        let shown = self.rows.get(self.selected).map(|row| six_digits(row.value)).unwrap_or_default();
        let number = self.typing.as_ref().map_or(shown.as_str(), |input| input.value());
        self.problem = Some(Problem::acknowledged(&format!("{key} again {does} {number}")));
        self.replaces = true;
        true
    }

    /// Whether the typed number is outside its bounds: it is refused for that, in place of a question that promises to use it.
    fn is_outside(&self) -> bool {
        let typed = self.typing.as_ref().and_then(|input| input.value().trim().replace(',', ".").parse::<f64>().ok());
        typed.zip(self.rows.get(self.selected)).is_some_and(|(value, row)| !(row.low..=row.high).contains(&value))
    }

    /// Takes the typed value over; false if it is refused, with the reason in `problem`.
    fn take_typed(&mut self) -> bool {
        let (Some(input), Some(row)) = (&self.typing, self.rows.get_mut(self.selected)) else { return true };
        let (name, low, high, unit) = (&row.name, row.low, row.high, &row.unit);
        self.problem = match input.value().trim().replace(',', ".").parse::<f64>() {
            Ok(value) if (row.low..=row.high).contains(&value) => {
                row.value = value;
                self.typing = None;
                None
            }
            Ok(value) => Some(format!("{name} = {value} {unit} is outside {low} to {high} {unit}").into()),
            Err(_) => Some(format!("{name} needs a number from {low} to {high} {unit}").into()),
        };
        self.replaces = self.problem.is_some();
        !self.replaces
    }

    /// The keys that work, for the answer to another one.
    fn keys(&self, model: &Model) -> String {
        match self.typing {
            Some(_) => "a number, Left Right, Backspace, Enter and Esc do".to_owned(),
            None => {
                let queue = model.keymap.key(Action::QueuePoint);
                format!("a number, arrows, PgUp PgDn, Enter, {queue} and Esc do")
            }
        }
    }

    fn select(&mut self, selected: usize) {
        if self.take_typed() {
            // What is said of another row is no longer meant.
            self.problem = None;
            self.selected = selected.min(self.rows.len().saturating_sub(1));
        }
    }
}

pub(super) fn key(model: &mut Model, key: Key, mut form: OverrideForm) -> Vec<Effect> {
    form.dropped = None;
    match key.code() {
        KeyCode::Esc if form.typing.is_some() => {
            form.dropped = form.typing.take().map(|input| input.value().to_owned());
            form.problem = None;
            form.replaces = false;
        }
        KeyCode::Esc => return cancelled(model, "nothing was changed"),
        KeyCode::Enter if form.asks_about_refused_character(key, "confirms") => {}
        KeyCode::Enter if !form.take_typed() => {}
        KeyCode::Enter => {
            let changed = form.rows.iter().filter(|row| row.value != row.before);
            let requests: Vec<OperatorRequest> = changed.map(override_request).collect();
            if requests.is_empty() {
                reply(model, LogLevel::Info, "no value was changed: the proposal stays as it is");
                return Vec::new();
            }
            return requests.into_iter().flat_map(|each| request(model, each)).collect();
        }
        // Queues the form's point with the gains that differ from the configuration.
        _ if model.keymap.action(key) == Some(Action::QueuePoint) => {
            if !form.asks_about_refused_character(key, "queues") && form.take_typed() {
                let set = form.rows.iter().filter(|row| !row.gain || row.value != row.proposed);
                let point = set.map(|row| (row.name.clone(), row.value)).collect();
                return request(model, OperatorRequest::Enqueue(point));
            }
        }
        KeyCode::Up | KeyCode::Down | KeyCode::Tab
            if form.typing.is_some() && form.asks_about_refused_character(key, "takes") => {}
        KeyCode::Up => form.select(form.selected.saturating_sub(1)),
        KeyCode::Down | KeyCode::Tab => form.select(form.selected + 1),
        KeyCode::Left if form.typing.is_none() => form.step(-0.01),
        KeyCode::Right if form.typing.is_none() => form.step(0.01),
        KeyCode::PageDown => form.step(-0.1),
        KeyCode::PageUp => form.step(0.1),
        _ => {
            // Only the characters of a number can be typed here.
            let digit = matches!(key.typed(), Some('0'..='9' | '.' | ',' | '-' | '+' | 'e'));
            let edits = digit || form.typing.is_some() && key.typed().is_none();
            let deletes = matches!(key.code(), KeyCode::Backspace | KeyCode::Delete);
            if std::mem::take(&mut form.replaces) && (digit || deletes) {
                form.typing = Some(Input::default());
            }
            let refused = form.problem.take().filter(|problem| problem.refused_character);
            form.problem = match key.typed() {
                // An emptied number has none that the missing character could have changed.
                _ if edits && edit(form.typing.get_or_insert_default(), key) => {
                    refused.filter(|_| form.typing.as_ref().is_some_and(|input| !input.value().is_empty()))
                }
                Some(c) => Some(Problem::not_of_a_number(c)),
                None => refused.or_else(|| Some(does_nothing(key, &form.keys(model)).into())),
            };
        }
    }
    model.override_row = form.selected;
    model.dialog = Some(Dialog::Override(form));
    Vec::new()
}
