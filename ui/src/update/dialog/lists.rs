//! Keys of the lists: palette, help, switches, details of a trial.

use crossterm::event::KeyCode;
use quadfrog::session::operator_request::OperatorRequest;
use strum::VariantArray;
use tui_input::Input;

use super::text_field::edit;
use crate::action::Action;
use crate::keymap::Key;
use crate::layout::{dialog_columns, dialog_rows};
use crate::legal::{legal, may_request, palette};
use crate::message::Effect;
use crate::model::dialog::{Choice, Dialog, Question};
use crate::model::live::Panel;
use crate::model::{Model, View};
use crate::update::navigate::move_by;
use crate::update::perform::open_palette;
use crate::update::request::{cancelled, refused, request, unknown_key};
use crate::wrap::wrap_all;
use crate::{details, help};

/// Lines that a page of a trial's details moves by.
const DETAILS_PAGE: usize = 10;
/// Lines that a page of a line of the log moves by.
const LOG_PAGE: usize = 10;

/// The action that Enter chooses in the palette. Arming is not among them: it is confirmed first.
pub(super) fn chosen_action(model: &Model, key: Key, selected: Option<Action>) -> Option<Action> {
    selected
        .filter(|_| key.code() == KeyCode::Enter)
        .filter(|action| *action != Action::Arm || legal(Action::Arm, model).is_err())
}

/// Actions that a key of the palette pages over: fewer than fit where some have two lines.
const PALETTE_PAGE: usize = 10;

pub(super) fn palette_key(model: &mut Model, key: Key, mut input: Input, selected: Option<Action>) -> Vec<Effect> {
    let rows: Vec<Action> = palette(input.value(), model).iter().map(|(info, _)| info.action).collect();
    let last = rows.len().saturating_sub(1);
    let at = rows.iter().position(|action| Some(*action) == selected).unwrap_or(0);
    let at = match key.code() {
        KeyCode::Esc => return Vec::new(),
        KeyCode::Up => at.saturating_sub(1),
        KeyCode::Down => (at + 1).min(last),
        KeyCode::PageUp => at.saturating_sub(PALETTE_PAGE),
        KeyCode::PageDown => (at + PALETTE_PAGE).min(last),
        KeyCode::Home => 0,
        KeyCode::End => last,
        // Enter never starts motion: `chosen_action` leaves arming, which is confirmed here.
        KeyCode::Enter if selected.is_some() => {
            model.dialog = Some(Dialog::Arm { typed: 0, opened_at: model.clock });
            return Vec::new();
        }
        KeyCode::Enter => return cancelled(model, "no such action"),
        _ => {
            edit(&mut input, key);
            open_palette(model, input);
            return Vec::new();
        }
    };
    model.dialog = Some(Dialog::Palette { input, selected: rows.get(at).copied() });
    Vec::new()
}

pub(super) fn help_key(model: &mut Model, key: Key, scroll: usize) -> Vec<Effect> {
    // The key that has opened it.
    if model.keymap.action(key) == Some(Action::Help) {
        return Vec::new();
    }
    let rows = wrap_all(&help::lines(model), dialog_columns(model), help::INDENT).len();
    let scroll = scrolled(model, key, scroll, rows);
    model.dialog = Some(Dialog::Help { scroll });
    Vec::new()
}

pub(super) fn report_key(model: &mut Model, key: Key, lines: Vec<String>, scroll: usize) -> Vec<Effect> {
    let scroll = scrolled(model, key, scroll, lines.len());
    model.dialog = Some(Dialog::Report { lines, scroll });
    Vec::new()
}

/// Returns the number of the `rows` above the shown ones after a key; one that does not scroll is answered with those that do.
fn scrolled(model: &mut Model, key: Key, scroll: usize, rows: usize) -> usize {
    let page = model.page.max(2) - 1;
    let last = rows.saturating_sub(dialog_rows(model));
    let scroll = match key.code() {
        KeyCode::Up => scroll.saturating_sub(1),
        KeyCode::Down => scroll + 1,
        KeyCode::PageUp => scroll.saturating_sub(page),
        KeyCode::PageDown => scroll + page,
        KeyCode::Home => 0,
        KeyCode::End => last,
        _ => {
            unknown_key(model, key, "Up Down PgUp PgDn Home End");
            scroll
        }
    };
    scroll.min(last)
}

/// Switches in a list, which stays open; the change shows at once.
pub(super) fn choice_key(model: &mut Model, key: Key, subject: Choice, mut selected: usize) -> Vec<Effect> {
    let last = model.choices(subject).len().saturating_sub(1);
    match key.code() {
        KeyCode::Up => selected = selected.saturating_sub(1),
        KeyCode::Down => selected = (selected + 1).min(last),
        KeyCode::PageUp => selected = selected.saturating_sub(model.page),
        KeyCode::PageDown => selected = (selected + model.page).min(last),
        KeyCode::Home => selected = 0,
        KeyCode::End => selected = last,
        KeyCode::Left | KeyCode::Right | KeyCode::Char('x') => match subject {
            Choice::Series => {
                model.live.panel = Panel::Charts;
                let mut series = model.live.series.clone();
                toggle(&mut series, selected);
                model.live.choose(series);
            }
            Choice::Columns => toggle(&mut model.trial_table.columns, selected),
        },
        _ => unknown_key(model, key, "Up Down PgUp PgDn Home End x"),
    }
    model.dialog = Some(Dialog::Choose { subject, selected });
    Vec::new()
}

/// Switches one item on or off; the last one stays on. The items keep the order of their enum.
fn toggle<T: Copy + PartialEq + VariantArray>(on: &mut Vec<T>, index: usize) {
    let Some(chosen) = T::VARIANTS.get(index) else { return };
    let switched: Vec<T> = T::VARIANTS.iter().copied().filter(|item| on.contains(item) != (item == chosen)).collect();
    if !switched.is_empty() {
        *on = switched;
    }
}

/// Moves and removes queued points; the list stays open and shows what the session answers.
pub(super) fn queue_key(model: &mut Model, key: Key, selected: Option<u32>) -> Vec<Effect> {
    let trials: Vec<u32> = model.session.queue().iter().map(|point| point.trial).collect();
    let last = trials.len().saturating_sub(1);
    let at = model.session.queue_row(selected);
    let trial = trials.get(at).copied();
    // A moved point changes places with its neighbour, whose number it has then.
    let (at, change) = match (key.code(), trial) {
        (KeyCode::Up, Some(_)) => (at.saturating_sub(1), None),
        (KeyCode::Down, Some(_)) => ((at + 1).min(last), None),
        (KeyCode::Home, Some(_)) => (0, None),
        (KeyCode::End, Some(_)) => (last, None),
        (KeyCode::Left, Some(trial)) => {
            (at.saturating_sub(1), Some(OperatorRequest::MoveQueued { trial, earlier: true }))
        }
        (KeyCode::Right, Some(trial)) => {
            ((at + 1).min(last), Some(OperatorRequest::MoveQueued { trial, earlier: false }))
        }
        (KeyCode::Char('x') | KeyCode::Delete, Some(trial)) => {
            if let Err(reason) = may_request(model) {
                model.dialog = Some(Dialog::Queue { selected: Some(trial) });
                return refused(model, "not removed", &reason);
            }
            model.dialog = Some(Dialog::Confirm(Question::RemoveQueued { trial }));
            return Vec::new();
        }
        _ => {
            let keys = match may_request(model) {
                _ if trial.is_none() => "",
                Ok(()) => "Up Down Left Right Home End x",
                Err(_) => "Up Down Home End",
            };
            unknown_key(model, key, keys);
            (at, None)
        }
    };
    model.dialog = Some(Dialog::Queue { selected: trials.get(at).copied() });
    change.map_or_else(Vec::new, |change| request(model, change))
}

/// Opens the neighbours of a line of the log, and scrolls a long one.
pub(super) fn log_line_key(model: &mut Model, key: Key, scroll: usize) -> Vec<Effect> {
    let scroll = match key.code() {
        KeyCode::Up => {
            move_by(model, -1);
            0
        }
        KeyCode::Down => {
            move_by(model, 1);
            0
        }
        KeyCode::Home => {
            move_by(model, isize::MIN);
            0
        }
        KeyCode::End => {
            move_by(model, isize::MAX);
            0
        }
        KeyCode::PageUp => scroll.saturating_sub(LOG_PAGE),
        // The longest text of a line fills fewer pages.
        KeyCode::PageDown => (scroll + LOG_PAGE).min(20 * LOG_PAGE),
        _ => {
            unknown_key(model, key, "Up Down PgUp PgDn Home End");
            scroll
        }
    };
    model.dialog = Some(Dialog::LogLine { scroll });
    Vec::new()
}

/// The action of a key over the details: verdicts and others work while the details are read.
pub(super) fn action_over_details(model: &Model, key: Key) -> Option<Action> {
    match key.code() {
        KeyCode::PageUp | KeyCode::PageDown | KeyCode::Up | KeyCode::Down | KeyCode::Home | KeyCode::End => None,
        _ => model.keymap.action(key),
    }
}

/// Prepares an action over the details of a trial: it acts on that trial, as on its row of Trials, also where the view would act on a
/// newer one that has come since.
pub(super) fn act_on_shown(model: &mut Model, action: Action, trial: u32) {
    let acts_on_trial = matches!(
        action,
        Action::Accept
            | Action::Fall
            | Action::Void
            | Action::Rerun
            | Action::Undo
            | Action::HandValue
            | Action::Note
            | Action::Ghost
            | Action::Copy
    );
    let meant = |model: &Model| model.trial_in_view().is_some_and(|row| row.trial == trial);
    if acts_on_trial && !meant(model) {
        (model.trial_table.selected, model.view) = (Some(trial), View::Trials);
        if !meant(model) {
            // The filter leaves it out.
            (model.trial_table.filter, model.trial_table.best_only) = (None, false);
        }
    }
}

pub(super) fn details_key(model: &mut Model, key: Key, trial: u32, scroll: usize) -> Vec<Effect> {
    let numbers = || model.session.trials.records.values().chain(model.later_trials()).map(|row| row.trial);
    let (neighbour, scroll) = match key.code() {
        KeyCode::PageUp => (None, scroll.saturating_sub(DETAILS_PAGE)),
        KeyCode::PageDown => {
            let lines = details::lines(model, trial, dialog_columns(model)).map_or(0, |lines| lines.len());
            (None, (scroll + DETAILS_PAGE).min(lines.saturating_sub(dialog_rows(model))))
        }
        KeyCode::Up => (numbers().filter(|number| *number < trial).max(), 0),
        KeyCode::Down => (numbers().filter(|number| *number > trial).min(), 0),
        KeyCode::Home => (numbers().min(), 0),
        KeyCode::End => (numbers().max(), 0),
        _ => {
            unknown_key(model, key, "Up Down PgUp PgDn Home End");
            model.dialog = Some(Dialog::Details { trial, scroll });
            return Vec::new();
        }
    };
    let trial = neighbour.unwrap_or(trial);
    if !matches!(key.code(), KeyCode::PageUp | KeyCode::PageDown) {
        // Keys act on the shown trial: as on a row of Trials.
        model.trial_table.selected = Some(trial);
        model.view = View::Trials;
    }
    model.dialog = Some(Dialog::Details { trial, scroll });
    Vec::new()
}
