//! What can lie over a view: questions, text fields, help. Each is data; keys reach it through [`key`].

use std::time::Duration;

use crossterm::event::KeyCode;
use quadfrog::recording::record::{Level, Proposal};
use quadfrog::session::intent::Intent;
use tui_input::{Input, InputRequest};

use crate::action::{ACTIONS, Action, ActionInfo};
use crate::column::Column;
use crate::keymap::Key;
use crate::model::{Message, Model, Panel};
use crate::series::SIGNALS;
use crate::update::{Effect, perform, wish};

/// Two presses nearer than this are one: the second moment of an approval comes later.
pub const APPROVAL_PAUSE: Duration = Duration::from_millis(300);

/// What lies over the view.
#[derive(Debug, Clone)]
pub enum Dialog {
    /// The first of the two presses that approve a jump was made.
    Approve {
        /// Number of the proposal on the card.
        trial: u32,
        /// Its revision.
        revision: u32,
        /// When the approving key was pressed last.
        pressed_at: Duration,
    },
    /// Stand the robot up? Asked where arming was chosen with Enter.
    Arm,
    /// End the program although the robot is armed or a trial waits?
    Quit,
    /// Change parameters of the proposal.
    Override(OverrideForm),
    /// One line of text.
    Field {
        /// What it is for.
        purpose: Purpose,
        /// The text so far.
        input: Input,
        /// What is wrong with it.
        problem: Option<String>,
    },
    /// All actions with a filter.
    Palette {
        /// The filter.
        input: Input,
        /// The chosen line among the filtered ones.
        selected: usize,
    },
    /// The active keys; the first line shown.
    Help {
        /// Lines scrolled off.
        scroll: usize,
    },
    /// Things to switch on and off.
    Choose {
        /// What.
        what: Choice,
        /// The line that the key is about.
        selected: usize,
    },
    /// All about one trial.
    Details {
        /// Its number.
        trial: u32,
    },
}

/// What a text field is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// A note on this trial.
    Note(u32),
    /// A value for the trial under review, measured by hand.
    HandValue(u32),
    /// More trials for a finished study.
    Continue,
    /// Jump to a trial.
    TrialNumber,
    /// Search the log.
    LogSearch,
}

/// What a list of switches is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// The series of the charts.
    Series,
    /// The columns of the trial table.
    Columns,
}

impl Choice {
    /// Each thing's name, what it is, and whether it is on.
    pub fn rows(self, model: &Model) -> Vec<(&'static str, &'static str, bool)> {
        match self {
            Choice::Series => {
                let on = |series| model.live.series.contains(&series);
                SIGNALS.iter().map(|signal| (signal.name, signal.unit, on(signal.series))).collect()
            }
            Choice::Columns => {
                let on = |column| model.trials_view.columns.contains(&column);
                Column::ALL.into_iter().map(|column| (column.name(), column.help(), on(column))).collect()
            }
        }
    }

    /// Switches one; the last one stays on. They keep the order of their table.
    fn toggle(self, model: &mut Model, index: usize) {
        match self {
            Choice::Series => {
                model.live.panel = Panel::Charts;
                toggle(&mut model.live.series, SIGNALS.map(|signal| signal.series), index);
            }
            Choice::Columns => toggle(&mut model.trials_view.columns, Column::ALL, index),
        }
    }
}

fn toggle<T: Copy + PartialEq, const N: usize>(on: &mut Vec<T>, all: [T; N], index: usize) {
    let Some(chosen) = all.get(index) else { return };
    let wanted = |item: &T| on.contains(item) != (item == chosen);
    let switched: Vec<T> = all.into_iter().filter(wanted).collect();
    if !switched.is_empty() {
        *on = switched;
    }
}

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
    /// The value of the proposal when the form was opened.
    pub before: f64,
    /// The value now.
    pub value: f64,
}

impl OverrideForm {
    /// The form for a proposal; parameters without known bounds are left out.
    pub fn new(proposal: &Proposal, model: &Model) -> OverrideForm {
        let row = |p: &quadfrog::recording::record::ProposedParameter| {
            let info = model.parameter(&p.name)?;
            Some(OverrideRow {
                name: p.name.clone(),
                unit: info.unit.clone(),
                low: info.low,
                high: info.high,
                before: p.value,
                value: p.value,
            })
        };
        let rows: Vec<OverrideRow> = proposal.parameters.iter().filter_map(row).collect();
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

impl Dialog {
    /// An empty field.
    pub fn field(purpose: Purpose, text: &str) -> Dialog {
        Dialog::Field { purpose, input: Input::new(text.to_owned()), problem: None }
    }

    /// Whether keys are text here.
    pub fn takes_text(&self) -> bool {
        matches!(self, Dialog::Field { .. } | Dialog::Palette { .. })
            || matches!(self, Dialog::Override(form) if form.typing.is_some())
    }
}

/// The actions whose name or help holds the filter's words, legal ones first.
pub fn palette_rows(filter: &str, model: &Model) -> Vec<(&'static ActionInfo, Result<(), String>)> {
    let words: Vec<String> = filter.split_whitespace().map(str::to_lowercase).collect();
    let matches = |info: &ActionInfo| {
        let text = format!("{} {}", info.name, info.help.to_lowercase());
        words.iter().all(|word| text.contains(word))
    };
    let mut rows: Vec<_> =
        ACTIONS.iter().filter(|info| matches(info)).map(|info| (info, (info.legal)(model))).collect();
    rows.sort_by_key(|(_, legal)| legal.is_err());
    rows
}

/// One key while a dialog is open. STOP and Ctrl-C have been dealt with before.
pub fn key(model: &mut Model, key: Key) -> Vec<Effect> {
    let Some(dialog) = model.dialog.take() else { return Vec::new() };
    match dialog {
        Dialog::Approve { trial, revision, pressed_at } => approve_key(model, key, (trial, revision, pressed_at)),
        Dialog::Arm => match key.typed() {
            Some('y' | 'Y') => wish(model, Intent::Arm),
            _ => cancelled(model, "not armed"),
        },
        Dialog::Quit => match key.typed() {
            Some('y' | 'Y') => vec![Effect::Quit],
            _ => cancelled(model, "not quit"),
        },
        Dialog::Override(form) => override_key(model, key, form),
        Dialog::Field { purpose, input, .. } => field_key(model, key, purpose, input),
        Dialog::Palette { input, selected } => palette_key(model, key, input, selected),
        Dialog::Help { scroll } => {
            let page = model.page.max(2) - 1;
            let scroll = match key.code() {
                KeyCode::Up => scroll.saturating_sub(1),
                KeyCode::Down => scroll + 1,
                KeyCode::PageUp => scroll.saturating_sub(page),
                KeyCode::PageDown => scroll + page,
                KeyCode::Home => 0,
                _ => return Vec::new(),
            };
            model.dialog = Some(Dialog::Help { scroll });
            Vec::new()
        }
        Dialog::Choose { what, selected } => choose_key(model, key, what, selected),
        Dialog::Details { trial } => {
            let neighbour = match key.code() {
                KeyCode::Up => model.trials.range(..trial).next_back(),
                KeyCode::Down => model.trials.range(trial + 1..).next(),
                KeyCode::Esc | KeyCode::Enter => return Vec::new(),
                // Verdicts and the like work while the details are read.
                _ => return model.keymap.action(key).map_or_else(Vec::new, |action| perform(model, action)),
            };
            let trial = neighbour.map_or(trial, |(number, _)| *number);
            model.trials_view.selected = Some(trial);
            model.dialog = Some(Dialog::Details { trial });
            Vec::new()
        }
    }
}

fn cancelled(model: &mut Model, text: &str) -> Vec<Effect> {
    model.message = Some(Message { level: Level::Info, text: format!("cancelled: {text}") });
    Vec::new()
}

/// The second moment of an approval. Only the approving key approves, and only after a pause: a bounced key or one
/// that lies on the keyboard starts the pause again. Everything else, Enter first of all, is Cancel.
fn approve_key(model: &mut Model, key: Key, (trial, revision, pressed_at): (u32, u32, Duration)) -> Vec<Effect> {
    if model.keymap.action(key) != Some(Action::Approve) {
        return cancelled(model, "no jump");
    }
    if model.clock.saturating_sub(pressed_at) < APPROVAL_PAUSE {
        model.dialog = Some(Dialog::Approve { trial, revision, pressed_at: model.clock });
        return Vec::new();
    }
    match Action::Approve.legal(model) {
        Ok(()) => wish(model, Intent::Approve { trial, revision }),
        Err(reason) => {
            model.message = Some(Message { level: Level::Warning, text: format!("not approved: {reason}") });
            Vec::new()
        }
    }
}

fn override_key(model: &mut Model, key: Key, mut form: OverrideForm) -> Vec<Effect> {
    match key.code() {
        KeyCode::Esc if form.typing.is_some() => {
            form.typing = None;
            form.problem = None;
        }
        KeyCode::Esc => return cancelled(model, "nothing was changed"),
        KeyCode::Enter => {
            if form.take_typed() {
                let changed = form.rows.iter().filter(|row| row.value != row.before);
                let intents: Vec<Intent> =
                    changed.map(|row| Intent::Override { parameter: row.name.clone(), value: row.value }).collect();
                if intents.is_empty() {
                    return cancelled(model, "nothing was changed");
                }
                return intents.into_iter().flat_map(|intent| wish(model, intent)).collect();
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

fn field_key(model: &mut Model, key: Key, purpose: Purpose, mut input: Input) -> Vec<Effect> {
    match key.code() {
        KeyCode::Esc => return cancelled(model, "nothing was changed"),
        KeyCode::Enter => match submit(model, purpose, input.value().trim()) {
            Ok(effects) => return effects,
            Err(problem) => {
                model.dialog = Some(Dialog::Field { purpose, input, problem: Some(problem) });
                return Vec::new();
            }
        },
        // Space is STOP while the robot is armed, so a note needs another key for it.
        KeyCode::Char('_')
            if key.typed().is_some() && model.robot_needs_us() && matches!(purpose, Purpose::Note(_)) =>
        {
            input.handle(InputRequest::InsertChar(' '));
        }
        _ => edit(&mut input, key),
    }
    model.dialog = Some(Dialog::Field { purpose, input, problem: None });
    Vec::new()
}

/// What a field's text does; the reason when it can do nothing.
fn submit(model: &mut Model, purpose: Purpose, text: &str) -> Result<Vec<Effect>, String> {
    match purpose {
        Purpose::Note(trial) => Ok(wish(model, Intent::Note { trial, text: text.to_owned() })),
        Purpose::HandValue(_) if text.is_empty() => Ok(wish(model, Intent::HandValue(None))),
        Purpose::HandValue(_) => match text.replace(',', ".").parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(wish(model, Intent::HandValue(Some(value)))),
            _ => Err(format!("`{text}` is not a number")),
        },
        Purpose::Continue => match text.parse::<u32>() {
            Ok(more @ 1..=1000) => Ok(wish(model, Intent::Continue(more))),
            _ => Err(format!("`{text}` is not a number of trials from 1 to 1000")),
        },
        Purpose::TrialNumber => {
            let number = text.parse::<u32>().map_err(|_| format!("`{text}` is not a trial's number"))?;
            if !model.trials.contains_key(&number) {
                return Err(format!("there is no trial {number}"));
            }
            model.trials_view.selected = Some(number);
            Ok(Vec::new())
        }
        Purpose::LogSearch => {
            model.log_view.search = text.to_owned();
            model.log_view.back = 0;
            Ok(Vec::new())
        }
    }
}

/// The list stays open while things are switched; what is switched shows at once.
fn choose_key(model: &mut Model, key: Key, what: Choice, mut selected: usize) -> Vec<Effect> {
    let last = what.rows(model).len().saturating_sub(1);
    match key.code() {
        KeyCode::Esc | KeyCode::Enter => return Vec::new(),
        KeyCode::Up => selected = selected.saturating_sub(1),
        KeyCode::Down => selected = (selected + 1).min(last),
        KeyCode::Home => selected = 0,
        KeyCode::End => selected = last,
        KeyCode::Left | KeyCode::Right | KeyCode::Char('x') => what.toggle(model, selected),
        _ => {}
    }
    model.dialog = Some(Dialog::Choose { what, selected });
    Vec::new()
}

fn palette_key(model: &mut Model, key: Key, mut input: Input, mut selected: usize) -> Vec<Effect> {
    let rows = palette_rows(input.value(), model);
    match key.code() {
        KeyCode::Esc => return Vec::new(),
        KeyCode::Up => selected = selected.saturating_sub(1),
        KeyCode::Down => selected = (selected + 1).min(rows.len().saturating_sub(1)),
        KeyCode::Enter => {
            return match rows.get(selected) {
                // Enter never starts motion: arming is asked again, approving opens its dialog by itself.
                Some((info, Ok(()))) if info.action == Action::Arm => {
                    model.dialog = Some(Dialog::Arm);
                    Vec::new()
                }
                Some((info, _)) => perform(model, info.action),
                None => cancelled(model, "no such action"),
            };
        }
        _ => {
            edit(&mut input, key);
            selected = 0;
        }
    }
    model.dialog = Some(Dialog::Palette { input, selected });
    Vec::new()
}

/// Edits a line of text.
fn edit(input: &mut Input, key: Key) {
    let request = match (key.typed(), key.code()) {
        (Some(c), _) => InputRequest::InsertChar(c),
        (None, KeyCode::Backspace) => InputRequest::DeletePrevChar,
        (None, KeyCode::Delete) => InputRequest::DeleteNextChar,
        (None, KeyCode::Left) => InputRequest::GoToPrevChar,
        (None, KeyCode::Right) => InputRequest::GoToNextChar,
        (None, KeyCode::Home) => InputRequest::GoToStart,
        (None, KeyCode::End) => InputRequest::GoToEnd,
        (None, KeyCode::Char('u')) => InputRequest::DeleteLine,
        (None, KeyCode::Char('w')) => InputRequest::DeletePrevWord,
        _ => return,
    };
    input.handle(request);
}
