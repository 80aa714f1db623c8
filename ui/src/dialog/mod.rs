//! What can lie over a view: questions, text fields, help. Each is data; keys reach it through [`key`].

mod choice;
mod override_form;

use std::time::Duration;

use crossterm::event::KeyCode;
use quadfrog::recording::record::LogLevel;
use quadfrog::session::operator_request::{OperatorCheck, OperatorRequest};
use tui_input::{Input, InputRequest};

use crate::action::{ACTIONS, Action, ActionInfo};
use crate::keymap::Key;
use crate::model::{Message, Model};
use crate::update::{Effect, perform, wish};

pub use choice::Choice;
pub use override_form::{OverrideForm, OverrideRow};

/// Two presses nearer than this are one: the second moment of an approval comes later. Longer than a held key waits before
/// it repeats itself (660 ms on X11, at most 500 ms elsewhere as delivered), for a repetition cannot be told from a press.
pub const APPROVAL_PAUSE: Duration = Duration::from_millis(800);

/// Lines that a page of a trial's details moves by; there are never more than two pages of them.
const DETAILS_PAGE: usize = 10;

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
    /// Stand the robot up? Asked on hardware, and where arming was chosen with Enter.
    Arm {
        /// Letters of the confirming word that were typed.
        typed: usize,
    },
    /// The pre-arm list.
    PreArm {
        /// The operator's own item that the key is about.
        selected: usize,
    },
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
        /// Lines scrolled off.
        scroll: usize,
    },
}

/// What a text field is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Purpose {
    /// A note on this trial.
    Note(u32),
    /// A value for the trial under review, measured by hand.
    HandValue(u32),
    /// More trials for a finished study.
    Continue,
    /// For how many trials a parameter is fixed.
    Fix {
        /// Its place in the session's list.
        parameter: usize,
        /// The value that it keeps, in its unit.
        value: f64,
    },
    /// Between which bounds a parameter is searched.
    Bounds {
        /// Its place in the session's list.
        parameter: usize,
    },
    /// How often the best points are repeated.
    ConfirmBest,
    /// Jump to a trial.
    TrialNumber,
    /// Search the log.
    LogSearch,
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
        Dialog::Arm { typed } => arm_key(model, key, typed),
        Dialog::PreArm { selected } => pre_arm_key(model, key, selected),
        Dialog::Quit => match key.typed() {
            Some('y' | 'Y') => vec![Effect::Quit],
            _ => cancelled(model, "not quit"),
        },
        Dialog::Override(form) => override_form::key(model, key, form),
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
        Dialog::Choose { what, selected } => choice::key(model, key, what, selected),
        Dialog::Details { trial, scroll } => {
            let neighbour = match key.code() {
                KeyCode::PageUp | KeyCode::PageDown => {
                    // The drawing stops at the last line.
                    let page = DETAILS_PAGE;
                    let scroll =
                        if key.code() == KeyCode::PageUp { scroll.saturating_sub(page) } else { scroll + page };
                    model.dialog = Some(Dialog::Details { trial, scroll: scroll.min(DETAILS_PAGE * 2) });
                    return Vec::new();
                }
                KeyCode::Up => model.trials.range(..trial).next_back(),
                KeyCode::Down => model.trials.range(trial + 1..).next(),
                KeyCode::Esc | KeyCode::Enter => return Vec::new(),
                // Verdicts and the like work while the details are read.
                _ => return model.keymap.action(key).map_or_else(Vec::new, |action| perform(model, action)),
            };
            let trial = neighbour.map_or(trial, |(number, _)| *number);
            model.trials_view.selected = Some(trial);
            model.dialog = Some(Dialog::Details { trial, scroll: 0 });
            Vec::new()
        }
    }
}

fn cancelled(model: &mut Model, text: &str) -> Vec<Effect> {
    model.message = Some(Message { level: LogLevel::Info, text: format!("cancelled: {text}") });
    Vec::new()
}

/// The word whose letters, in order, arm the robot: on hardware one that nobody types by accident.
pub fn arming_word(model: &Model) -> &'static str {
    if model.is_hardware() { "stand" } else { "y" }
}

fn arm_key(model: &mut Model, key: Key, typed: usize) -> Vec<Effect> {
    let word = arming_word(model);
    if key.typed() != word.chars().nth(typed) {
        return cancelled(model, "not armed");
    }
    if typed + 1 < word.len() {
        model.dialog = Some(Dialog::Arm { typed: typed + 1 });
        return Vec::new();
    }
    match Action::Arm.legal(model) {
        Ok(()) => wish(model, OperatorRequest::Arm),
        Err(reason) => {
            model.message = Some(Message { level: LogLevel::Warning, text: format!("not armed: {reason}") });
            Vec::new()
        }
    }
}

fn pre_arm_key(model: &mut Model, key: Key, mut selected: usize) -> Vec<Effect> {
    let last = OperatorCheck::ALL.len() - 1;
    let effects = match key.code() {
        KeyCode::Esc | KeyCode::Enter => return Vec::new(),
        KeyCode::Up => {
            selected = selected.saturating_sub(1);
            Vec::new()
        }
        KeyCode::Down => {
            selected = (selected + 1).min(last);
            Vec::new()
        }
        KeyCode::Char('x') => wish(model, OperatorRequest::Confirm(OperatorCheck::ALL[selected.min(last)])),
        // Arming from the list that says whether it is possible.
        _ if model.keymap.action(key) == Some(Action::Arm) && Action::Arm.legal(model).is_ok() => {
            return perform(model, Action::Arm);
        }
        _ => Vec::new(),
    };
    model.dialog = Some(Dialog::PreArm { selected });
    effects
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
        Ok(()) => wish(model, OperatorRequest::Approve { trial, revision }),
        Err(reason) => {
            model.message = Some(Message { level: LogLevel::Warning, text: format!("not approved: {reason}") });
            Vec::new()
        }
    }
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
        Purpose::Note(trial) => Ok(wish(model, OperatorRequest::Note { trial, text: text.to_owned() })),
        Purpose::HandValue(_) if text.is_empty() => Ok(wish(model, OperatorRequest::HandValue(None))),
        Purpose::HandValue(_) => match text.replace(',', ".").parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(wish(model, OperatorRequest::HandValue(Some(value)))),
            _ => Err(format!("`{text}` is not a number")),
        },
        Purpose::Continue => match text.parse::<u32>() {
            Ok(more @ 1..=1000) => Ok(wish(model, OperatorRequest::Continue(more))),
            _ => Err(format!("`{text}` is not a number of trials from 1 to 1000")),
        },
        Purpose::Fix { parameter, value } => match (text.parse::<u32>(), model.session.parameters.get(parameter)) {
            (Ok(trials @ 1..=1000), Some(info)) => {
                let intent = OperatorRequest::Fix { parameter: info.name.clone(), value, trials };
                Ok(wish(model, intent))
            }
            _ => Err(format!("`{text}` is not a number of trials from 1 to 1000")),
        },
        Purpose::Bounds { parameter } => {
            let intent = bounds_of(model, parameter, text)?;
            Ok(wish(model, intent))
        }
        Purpose::ConfirmBest => match text.parse::<u32>() {
            Ok(repeats @ 1..=1000) => Ok(wish(model, OperatorRequest::ConfirmBest { repeats })),
            _ => Err(format!("`{text}` is not a number of repeats from 1 to 1000")),
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

/// Bounds typed as `low..high`, checked as far as the screen can know; the session checks all of it again.
fn bounds_of(model: &Model, parameter: usize, text: &str) -> Result<OperatorRequest, String> {
    let Some(info) = model.session.parameters.get(parameter) else { return Err("there is no such parameter".into()) };
    let (name, unit) = (&info.name, &info.unit);
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    let ends = text.split_once("..").and_then(|(low, high)| Some((number(low)?, number(high)?)));
    let Some((low, high)) = ends else { return Err(format!("`{text}` is no range; write it as 50..120")) };
    if low >= high {
        return Err(format!("{low} is not below {high}"));
    }
    match model.searched(name) {
        Some(p) if low < p.least || high > p.most => {
            Err(format!("{name} may be searched from {} to {} {unit} (safety.toml)", p.least, p.most))
        }
        _ => Ok(OperatorRequest::NarrowBounds { parameter: name.clone(), low, high }),
    }
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
                    model.dialog = Some(Dialog::Arm { typed: 0 });
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
