//! Keys of the one-line text fields, and the effect of their text.

use crossterm::event::KeyCode;
use quadfrog::recording::record::LogLevel;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::trial::{TrialRecord, six_digits};
use tui_input::{Input, InputRequest};

use crate::draw::clock_ms;
use crate::keymap::Key;
use crate::message::{Effect, ReplayCommand};
use crate::model::Model;
use crate::model::dialog::{Dialog, Problem, Purpose, Question, places};
use crate::text::range_example;
use crate::update::beside::chosen;
use crate::update::rejudged;
use crate::update::request::{cancelled, reply, request};

/// Share of the robot's measurement, and distance from it in m or rad, beyond which a value measured by hand is asked about: more
/// than the estimator drifts in a jump, less than a lost or a shifted decimal point.
const DOUBTED_SHARE: f64 = 0.5;
const DOUBTED_DISTANCE: f64 = 0.2;

pub(super) fn key(
    model: &mut Model,
    key: Key,
    purpose: Purpose,
    (mut input, replaces, before): (Input, bool, Option<Problem>),
) -> Vec<Effect> {
    let mut problem = before.filter(|problem| problem.refused_character);
    let refused = key.typed().filter(|c| purpose.characters().is_some_and(|allowed| !allowed.contains(*c)));
    // The selection ends with the first key that edits; one that types or deletes takes the text with it. A number that was refused is
    // selected again.
    let takes = key.typed().is_some() || matches!(key.code(), KeyCode::Backspace | KeyCode::Delete);
    if replaces && takes && refused.is_none() {
        input.reset();
        if key.typed().is_none() {
            model.dialog = Some(Dialog::Field { purpose, input, replaces: false, problem: None });
            return Vec::new();
        }
    }
    let mut selected = replaces && refused.is_some();
    match key.code() {
        KeyCode::Esc => {
            let typed = if replaces { "" } else { input.value().trim() };
            return match purpose {
                Purpose::Note(_) if !typed.is_empty() => {
                    cancelled(model, &format!("nothing was changed; dropped: {typed}"))
                }
                _ => cancelled(model, "nothing was changed"),
            };
        }
        KeyCode::Enter if problem.is_some() => {
            problem = Some(match (input.value(), purpose) {
                ("", Purpose::HandValue(trial)) if model.session.measured_objective_of(trial).is_some() => {
                    Problem::acknowledged("Enter again goes back to the measured value")
                }
                // The sentence names the character and what is taken.
                ("", _) => format!("{}; Esc cancels", problem.map_or(String::new(), |problem| problem.text)).into(),
                (trial, Purpose::TrialNumber | Purpose::Beside) => {
                    Problem::acknowledged(&format!("Enter again looks for trial {trial}"))
                }
                (number, _) => Problem::acknowledged(&format!("Enter again confirms {number}")),
            });
        }
        KeyCode::Enter => match submit(model, purpose, input.value().trim()) {
            Ok(effects) => return effects,
            Err(reason) => {
                problem = Some(reason.into());
                selected = purpose.characters().is_some() && !input.value().is_empty();
            }
        },
        // Where Space is always STOP, a note needs another key for it.
        KeyCode::Char('_') if key.typed().is_some() && model.space_bar_must_stop() && purpose.is_remark() => {
            input.handle(InputRequest::InsertChar(' '));
        }
        _ => match refused {
            Some(c) if purpose == Purpose::Seek => problem = Some(Problem::not_of_a_place(c)),
            Some(c) => problem = Some(Problem::not_of_a_number(c)),
            None => {
                let edits = edit(&mut input, key);
                selected = replaces && !edits;
                // An emptied field has no number that the missing character could have changed.
                problem = problem.filter(|_| !input.value().is_empty());
            }
        },
    }
    model.dialog = Some(Dialog::Field { purpose, input, replaces: selected, problem });
    Vec::new()
}

/// Carries out a field's text.
///
/// # Errors
/// The reason when the text is refused.
fn submit(model: &mut Model, purpose: Purpose, text: &str) -> Result<Vec<Effect>, String> {
    if let Some(needed) = purpose.needed().filter(|_| text.is_empty()) {
        return Err(format!("nothing was typed: {needed} is needed; Esc cancels"));
    }
    let wanted = match purpose {
        Purpose::Note(trial) => OperatorRequest::Note { trial, text: text.to_owned() },
        Purpose::HandValue(_) if text.is_empty() => OperatorRequest::HandValue(None),
        Purpose::HandValue(_) => match text.replace(',', ".").parse::<f64>() {
            Ok(value) if value.is_finite() && is_doubted(model, value) => {
                let trial = model.session.under_review().map(|row| row.trial).ok_or("no trial waits for a verdict")?;
                model.dialog = Some(Dialog::Confirm(Question::HandValue { trial, value }));
                return Ok(Vec::new());
            }
            Ok(value) if value.is_finite() => OperatorRequest::HandValue(Some(value)),
            _ => return Err(format!("`{text}` is not a number")),
        },
        Purpose::Continue => OperatorRequest::Continue(count(text, "trials")?),
        Purpose::Fix { parameter, value } => {
            let trials = count(text, "trials")?;
            let info = model.session.info.parameters.get(parameter).ok_or("there is no such parameter")?;
            OperatorRequest::Fix { parameter: info.name.clone(), value, trials }
        }
        Purpose::Bounds { parameter } => bounds(model, parameter, text)?,
        Purpose::ConfirmBest => {
            let repeats = count(text, "repeats")?;
            if (repeats as usize) < model.least_repeats() {
                model.dialog = Some(Dialog::Confirm(Question::FewRepeats { repeats }));
                return Ok(Vec::new());
            }
            OperatorRequest::ConfirmBest { repeats }
        }
        Purpose::VoidReason { .. } if text.is_empty() => {
            return Err("give the reason why the parameters did not cause it".to_owned());
        }
        Purpose::VoidReason { rerun, .. } => OperatorRequest::VoidBecause { reason: text.to_owned(), rerun },
        Purpose::ChangeVerdict { .. } if text.is_empty() => {
            return Err("give the reason of the change; the journal keeps it with the old verdict".to_owned());
        }
        Purpose::ChangeVerdict { trial, verdict } => {
            OperatorRequest::ChangeVerdict { trial, verdict, reason: text.to_owned() }
        }
        Purpose::TrialNumber => {
            let number = text.parse::<u32>().map_err(|_| format!("`{text}` is not the number of a trial"))?;
            if model.trial(number).is_none() {
                return Err(format!("there is no trial {number}"));
            }
            if !model.trial_rows().iter().any(|row| row.trial == number) {
                (model.trial_table.filter, model.trial_table.best_only) = (None, false);
                let text = format!("the table shows all trials: it had left trial {number} out");
                reply(model, LogLevel::Info, text);
            }
            model.trial_table.selected = Some(number);
            return Ok(Vec::new());
        }
        Purpose::Seek => {
            let command = seek(model, text)?;
            // Second 12, or trial 12?
            let trial =
                text.parse().ok().filter(|trial| model.timeline.as_ref().is_some_and(|t| t.has_ticks_of(*trial)));
            if let Some(trial) = trial {
                reply(model, LogLevel::Info, format!("{trial} s after the beginning; trial {trial} is #{trial}"));
            }
            return Ok(vec![Effect::Replay(command)]);
        }
        Purpose::Rejudge => return Ok(rejudged::chosen(model, text)),
        Purpose::Beside => {
            let number = text.strip_prefix('#').unwrap_or(text).trim();
            let trial = number.parse().map_err(|_| format!("`{text}` is not the number of a trial"))?;
            return chosen(model, trial);
        }
        Purpose::LogSearch => {
            model.log_view.search = text.to_owned();
            model.log_view.back = 0;
            return Ok(Vec::new());
        }
    };
    Ok(request(model, wanted))
}

/// Whether a value measured by hand for the trial under review is far from the robot's own, or cannot be compared.
fn is_doubted(model: &Model, value: f64) -> bool {
    let measured = model.session.under_review().and_then(|row| model.session.measured_objective(row));
    let doubted = |measured: f64| (value - measured).abs() > DOUBTED_DISTANCE.max(DOUBTED_SHARE * measured.abs());
    measured.is_none_or(doubted)
}

/// The place that a text names: a time or a trial.
fn seek(model: &Model, text: &str) -> Result<ReplayCommand, String> {
    let text = &*text.to_lowercase();
    if text == "fall" {
        return Ok(ReplayCommand::NextFall);
    }
    if text == "best" {
        let timeline = model.timeline.as_ref();
        let best = timeline.and_then(|timeline| timeline.best).ok_or("the recording has no accepted trial")?;
        return match timeline.is_some_and(|timeline| timeline.has_ticks_of(best)) {
            true => Ok(ReplayCommand::Trial(best)),
            false => Err(format!("the best is trial {best}, which is not in this recording")),
        };
    }
    let named = text.strip_prefix("trial").map(|rest| rest.trim_start().trim_start_matches('#'));
    if let Some(number) = named.or(text.strip_prefix('#')) {
        let trial =
            number.trim().parse().map_err(|_| format!("`{text}` is not the number of a trial; write it as #7"))?;
        let known = model.timeline.as_ref().is_some_and(|timeline| timeline.has_ticks_of(trial));
        return if known {
            Ok(ReplayCommand::Trial(trial))
        } else {
            let row = model.timeline.as_ref().and_then(|timeline| timeline.rows.get(&trial));
            Err(match row.is_some_and(TrialRecord::was_not_run) {
                true => format!("trial {trial} was not run: there is no jump to show"),
                false => format!("trial {trial} is not in this recording"),
            })
        };
    }
    let refused = || format!("`{text}` is no place; write {}", places(!model.can_stop()));
    let mut time_s = 0.0;
    let parts: Vec<&str> = text.strip_suffix('s').unwrap_or(text).split(':').collect();
    for (index, part) in parts.iter().enumerate() {
        let number =
            part.trim().replace(',', ".").parse::<f64>().ok().filter(|number| number.is_finite() && *number >= 0.0);
        let whole = index + 1 == parts.len() || number.is_some_and(|number| number.fract() == 0.0);
        let number = number.filter(|number| whole && (index == 0 || *number < 60.0)).ok_or_else(refused)?;
        time_s = 60.0 * time_s + number;
    }
    if parts.len() > 3 {
        return Err(refused());
    }
    let duration_ns = model.replay.as_ref().map_or(0, |replay| replay.duration_ns);
    let time_ns = (time_s * 1e9).round() as u64;
    if time_ns > duration_ns {
        return Err(format!("`{text}` is after the end, {}", clock_ms(duration_ns)));
    }
    Ok(ReplayCommand::Time(time_ns))
}

fn count(text: &str, things: &str) -> Result<u32, String> {
    let number = text.parse().ok().filter(|number| (1..=1000).contains(number));
    number.ok_or_else(|| format!("`{text}` is not a number of {things} from 1 to 1000"))
}

/// Bounds typed as `low..high` or `low,high`, checked as far as the screen can know; the session checks all of it again.
fn bounds(model: &Model, parameter: usize, text: &str) -> Result<OperatorRequest, String> {
    let info = model.session.present_parameter(parameter).ok_or("there is no such parameter")?;
    let (name, unit) = (&info.name, &info.unit);
    let number = |text: &str| text.trim().replace(',', ".").parse::<f64>().ok().filter(|value| value.is_finite());
    // A comma separates two numbers, or the decimals of each where `..` separates them.
    let parts = text.split_once("..").or_else(|| text.split_once(',').filter(|(_, high)| !high.contains(',')));
    let ends = parts.and_then(|(low, high)| Some((number(low)?, number(high)?)));
    let Some((low, high)) = ends else {
        return Err(format!("`{text}` is no range; write it as {}", range_example(&info)));
    };
    if low >= high {
        return Err(format!("{low} is not below {high}"));
    }
    match model.session.searched(name) {
        Some(p) if low < p.least || high > p.most => {
            let (least, most) = (six_digits(p.least), six_digits(p.most));
            Err(format!("{name} may be searched from {least} to {most} {unit} (safety.toml)"))
        }
        _ => Ok(OperatorRequest::NarrowBounds { parameter: name.clone(), low, high }),
    }
}

/// Edits the text with a key; false for a key that does not edit.
pub(super) fn edit(input: &mut Input, key: Key) -> bool {
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
        _ => return false,
    };
    input.handle(request);
    true
}
