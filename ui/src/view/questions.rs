//! The texts of the questions: each says what follows, and Cancel is the default and comes first.

use quadfrog::robot::CONTACT_S;
use quadfrog::session::objective;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{ExperimentStage, ProposalSource, ProposedParameter, TrialRecord, Verdict, counted, six_digits};
use ratatui::text::Line;

use super::draw::{number, span};
use crate::action::Action;
use crate::model::Model;
use crate::model::dialog::Question;
use crate::theme::{Role, Theme};

/// The two answers; Cancel is the default and comes first.
fn answers(theme: &Theme, key: &str, text: &str) -> Line<'static> {
    answers_or(("Cancel", "any other key"), theme, key, text)
}

/// The two answers with another word for the default, and the keys that give it beside Enter.
fn answers_or((default, keys): (&str, &str), theme: &Theme, key: &str, text: &str) -> Line<'static> {
    Line::from(vec![
        span(theme, Role::Selected, format!(" {default} ")),
        span(theme, Role::Quiet, format!(" Enter, or {keys}     ")),
        span(theme, Role::Key, key.to_owned()),
        span(theme, Role::Text, format!(" {text}")),
    ])
}

/// The sentence that the last verdict becomes final; none where it is final already.
pub fn last_verdict_stays(model: &Model) -> Option<String> {
    let undo = model.keymap.key(Action::Undo);
    let text = |trial| format!("The verdict of trial #{trial} then stays: {undo} does not take it back any longer.");
    model.session.undoable().map(text)
}

pub fn take_control(model: &Model) -> Vec<Line<'static>> {
    let foreign_commands = model.snapshot.counters.link.map_or(0, |link| link.foreign_commands);
    let heard = match model.mode() {
        Mode::Offline => {
            format!(
                "The robot has sent nothing since the start. A Go1 answers only after a command: it is sent braking commands \
                 without a target, for at most {CONTACT_S} s. A Go2 is sent nothing. Damping is sent once states arrive."
            )
        }
        _ if foreign_commands > 0 => format!(
            "Another program commands the robot: {} of it until now. End it first: both would command the robot, and \
             arming ends in a fault. Damping is sent from now on.",
            counted(foreign_commands as usize, "command")
        ),
        _ => "States arrive although this console sends nothing: another program may command the robot. Damping is \
             sent from now on."
            .to_owned(),
    };
    vec![
        Line::from(heard),
        Line::from("A robot that another program drives at present falls."),
        Line::default(),
        answers(&model.theme, "y", "take control"),
    ]
}

pub fn arm(model: &Model, typed: usize) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let letters = model.session.arming_confirmation();
    let effect = match model.session.jumps_without_question() {
        true => "The robot will stand up and jump without a question.",
        false => "The robot will stand up. Is the area clear?",
    };
    let mut lines = vec![Line::from(effect), Line::default()];
    if letters.len() == 1 {
        lines.push(answers(&model.theme, letters, "stand up"));
    } else {
        let (done, left) = letters.split_at(typed.min(letters.len()));
        lines.push(Line::from(vec![
            span(theme, Role::Selected, " Cancel "),
            span(theme, Role::Quiet, " Enter, or any other key     type "),
            span(theme, Role::Good, done),
            span(theme, Role::Key, left),
            span(theme, Role::Text, " to arm"),
        ]));
    }
    lines
}

pub fn approve(model: &Model, trial: u32, waited: bool, area_clear: bool) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let key = model.keymap.key(Action::Approve);
    let mut lines = Vec::new();
    if let Some(proposal) = &model.session.proposal {
        let value = |p: &ProposedParameter| {
            let info = model.session.parameter(&p.name).or_else(|| model.session.gain(&p.name).cloned());
            let unit = info.map_or(String::new(), |info| info.unit);
            let before = if p.value == p.proposed { String::new() } else { format!(" (was {})", number(p.proposed)) };
            format!("{} {} {unit}{before}", p.name, number(p.value))
        };
        let values: Vec<String> = proposal.parameters.iter().chain(proposal.changed_gains()).map(value).collect();
        lines.push(Line::from(format!("Trial #{trial}: {}", values.join(", "))));
    }
    lines.push(Line::from(match area_clear {
        true => "The area is clear, confirmed for this jump. A countdown follows.",
        false => "Is the area clear of people and objects? A countdown follows.",
    }));
    lines.push(Line::default());
    let area_asked = model.session.info.is_hardware() && !area_clear;
    let mut answer = match area_asked {
        // Once more, the approving key is only too early.
        true => answers_or(("Cancel", &format!("any key but {key}")), &model.theme, "y", "the area is clear"),
        false => answers(&model.theme, &key, "jump"),
    };
    if !area_asked && !waited {
        answer.push_span(span(theme, Role::Quiet, ", 0.8 s after the first press"));
    }
    lines.push(answer);
    lines
}

pub fn quit(model: &Model) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    if model.robot_is_energised() {
        lines.push(Line::from(match model.session.info.is_hardware() {
            true => "The robot is armed: it will sit down before the program ends.",
            false => "The simulation ends as the robot stands; a real robot would sit down first.",
        }));
    }
    let one_of_several = model.session.proposal.as_ref().is_some_and(|proposal| proposal.repeats > 1);
    if let Some(trial) = model.session.trial_in(ExperimentStage::Running) {
        let follows = match model.mode() {
            Mode::Settle if one_of_several => "this jump is done again when the study is continued",
            Mode::Settle => "it has landed, is measured, and waits until the study is continued (--resume)",
            Mode::Jump => "the robot lands first; it is void, and its parameters run again",
            _ => "it does not jump; it is void, and its parameters run again",
        };
        lines.push(Line::from(format!("Trial #{trial} is under way: {follows}.")));
    } else if let Some(row) = model.session.under_review() {
        let by_hand = row.hand_value.is_some();
        let follows = match row.suggested {
            Some(Verdict::Fall) if objective::tripped_limit(row) => "It counts as a fall, as suggested.",
            Some(Verdict::Void) if !by_hand => "It is void, as suggested, and its parameters run again.",
            _ if one_of_several => "This jump is done again when the study is continued.",
            _ => "It keeps its measurement and waits until the study is continued (--resume).",
        };
        lines.push(Line::from(format!("Trial #{} has no verdict yet. {follows}", row.trial)));
    } else if !model.session.stage_is(ExperimentStage::Finished) && model.session.stage.is_some() {
        let (judged, budget) = (model.session.counted(), model.session.budget());
        lines.push(Line::from(format!("{judged} of {budget} trials count so far; --resume continues the study.")));
        if let Some(proposal) = model.session.open_proposal() {
            let values =
                if proposal.changed().next().is_some() { "with the values set here" } else { "with these values" };
            let trial = proposal.trial;
            lines.push(Line::from(format!("Trial #{trial} is not run: it is proposed again then, {values}.")));
        }
    }
    if let Some(trial) = model.session.undoable() {
        lines.push(Line::from(format!("The verdict of trial #{trial} then stays; Trials changes it later.")));
    }
    lines.push(Line::default());
    lines.push(answers(&model.theme, "y", "quit"));
    lines
}

pub fn confirm(model: &Model, question: &Question) -> (&'static str, Vec<Line<'static>>) {
    match question {
        Question::Skip { trial, .. } => {
            let text =
                format!("Trial #{trial} will not be run; the sampler does not see it. Another proposal follows.");
            let mut lines = vec![Line::from(text)];
            lines.extend(last_verdict_stays(model).map(Line::from));
            lines.extend([Line::default(), answers(&model.theme, "y", "skip")]);
            ("Skip the proposal?", lines)
        }
        Question::Rerun { trial } => {
            let confirms = |source: ProposalSource| source == ProposalSource::Confirm;
            // A repeat that confirms the best runs after what the operator queues.
            let before = model.session.queue().iter().filter(|point| !confirms(point.source)).count();
            let follows = match model.session.open_proposal() {
                None => "will wait in the queue until the study has more trials".to_owned(),
                Some(_) if before > 0 => format!("will wait in the queue behind {}", counted(before, "point")),
                Some(proposal) if confirms(proposal.source) => {
                    "will be the proposal; the repeat follows them".to_owned()
                }
                Some(_) => "will be the proposal; the sampler's comes after".to_owned(),
            };
            let mut lines = vec![Line::from(format!("The parameters of trial #{trial} {follows}."))];
            let replaced = model.session.open_proposal().filter(|_| before == 0);
            if let Some(changed) = replaced.filter(|proposal| proposal.changed().next().is_some()) {
                let (number, key) = (changed.trial, model.keymap.key(Action::QueuePoint));
                lines.push(Line::from(format!(
                    "The changed values of proposal #{number} are dropped; {key} queues them before."
                )));
            }
            lines.extend([Line::default(), answers(&model.theme, "y", "queue")]);
            ("Queue it again?", lines)
        }
        Question::JudgeAnyway { trial, verdict: Verdict::Fall } => {
            let Some(row) = model.session.not_to_fall() else { return ("Judge it a fall?", Vec::new()) };
            let suggested = row.suggested.unwrap_or(Verdict::Void).name();
            let (title, otherwise) = match row.suggested {
                Some(Verdict::Accept) => ("Did the robot fall?", format!("Accept reports {}.", value(model, row))),
                _ => ("Judge a void trial a fall?", "Void hides the trial from it.".to_owned()),
            };
            let lines = vec![
                Line::from(format!("The suggested verdict of trial #{trial} is {suggested}: {}.", row.cause)),
                Line::from("Fall reports J = 0 to the optimizer, which then avoids these parameters."),
                Line::from(otherwise),
                Line::default(),
                answers(&model.theme, "y", "fall"),
            ];
            (title, lines)
        }
        Question::QueueProposed { trial, .. } => {
            let (title, text) = match model.session.is_queued(*trial) {
                true => (
                    "Queue it once more?",
                    format!(
                        "Trial #{trial} is queued itself and remains the proposal: its values will run once more after it."
                    ),
                ),
                false => (
                    "Queue the sampler's values?",
                    "They are proposed already, by the sampler. Queued, they run first, and it may propose them again after that; \
                     as long as it draws at random, it does."
                        .to_owned(),
                ),
            };
            (title, vec![Line::from(text), Line::default(), answers(&model.theme, "y", "queue")])
        }
        Question::RemoveQueued { trial } => {
            let proposed = model.session.open_proposal().is_some_and(|proposal| proposal.trial == *trial);
            let which = if proposed { ", the present proposal," } else { "" };
            let text =
                format!("Trial #{trial}{which} will leave the queue: it is not run, and the sampler does not see it.");
            ("Remove it from the queue?", vec![Line::from(text), Line::default(), answers(&model.theme, "y", "remove")])
        }
        Question::Undo { trial } => {
            let verdict = model.session.trials.records.get(trial).and_then(|row| row.verdict_name()).unwrap_or("-");
            let text = format!(
                "The verdict {verdict} of trial #{trial} will be taken back: it waits for another. The selected row stays as it is."
            );
            ("Take the last verdict back?", vec![Line::from(text), Line::default(), answers(&model.theme, "y", "undo")])
        }
        Question::FewRepeats { repeats } => {
            let least = counted(model.least_repeats(), "repeat");
            let few = counted(*repeats as usize, "repeat");
            let lines = vec![
                Line::from(format!("To compare the best points takes {least}: {few} cannot confirm any of them.")),
                Line::default(),
                answers_or(("Back to the field", "any other key"), &model.theme, "y", "repeat all the same"),
            ];
            ("So few repeats?", lines)
        }
        Question::EndRepeats => {
            let left = counted(model.session.confirming().unwrap_or(0) as usize, "repeat");
            let mut lines = vec![Line::from(format!("{left} will not be run: the best is not confirmed."))];
            lines.extend(last_verdict_stays(model).map(Line::from));
            lines.extend([Line::default(), answers(&model.theme, "y", "end them")]);
            ("End the repeats?", lines)
        }
        Question::JudgeAnyway { trial, .. } => {
            let Some(row) = model.session.not_to_accept() else { return ("Accept?", Vec::new()) };
            let value = value(model, row);
            let (suggested, title, otherwise) = match row.suggested {
                Some(Verdict::Void) => ("void", "Accept a void trial?", "void hides the trial from it"),
                _ => ("fall", "Accept a fall?", "fall reports 0"),
            };
            let mut lines = vec![
                Line::from(format!("The suggested verdict of trial #{trial} is {suggested}: {}.", row.cause)),
                Line::from(format!("Accept reports {value} to the optimizer, {otherwise}.")),
            ];
            if row.suggested == Some(Verdict::Void) && row.hand_value.is_none() {
                lines.push(Line::from("It was measured where the trial ended, which may be in the air."));
            }
            lines.extend([Line::default(), answers(&model.theme, "y", "accept")]);
            (title, lines)
        }
        Question::HandValue { trial, value } => {
            let unit = &model.session.info.unit;
            let measured = model.session.under_review().and_then(|row| model.session.measured_objective(row));
            let measured = measured.map_or("the robot measured nothing".to_owned(), |measured| {
                format!("the robot measured {} {unit}", number(measured))
            });
            let lines = vec![
                Line::from(format!("Trial #{trial}: {} {unit} by hand, but {measured}.", six_digits(*value))),
                Line::from("An accepted trial reports the value by hand to the optimizer."),
                Line::default(),
                answers_or(("Back to the field", "any other key"), &model.theme, "y", "use it"),
            ];
            ("Is this value right?", lines)
        }
    }
}

/// The value that the trial under review reports if it is accepted.
fn value(model: &Model, row: &TrialRecord) -> String {
    let unit = &model.session.info.unit;
    let value = model.session.value_if_accepted(row);
    value.map_or("no value".to_owned(), |value| format!("J = {} {unit}", number(value)))
}

pub fn export(model: &Model, shown: usize, all: usize) -> Vec<Line<'static>> {
    let theme = &model.theme;
    let key = |key: &'static str, text: String| {
        Line::from(vec![span(theme, Role::Key, format!(" {key} ")), span(theme, Role::Text, text)])
    };
    vec![
        Line::from(format!("The table shows {shown} of {all} trials; the others do not pass its filter.")),
        Line::default(),
        key("a", format!("write all {all} trials, by number")),
        key("s", format!("write the {shown} as shown and leave {} out", all - shown.min(all))),
        Line::from(vec![span(theme, Role::Selected, " Cancel "), span(theme, Role::Quiet, " Enter, or any other key")]),
    ]
}
