//! The texts of the questions: each says what follows, and Cancel is the default and comes first.

use quadfrog::telemetry::Mode;
use quadfrog::trial::{ProposedParameter, Verdict, six_digits};
use ratatui::text::Line;

use super::draw::{number, span};
use crate::action::Action;
use crate::model::Model;
use crate::model::dialog::Question;
use crate::theme::{Role, Theme};

/// The two answers; Cancel is the default and comes first.
fn answers(theme: &Theme, key: &str, text: &str) -> Line<'static> {
    Line::from(vec![
        span(theme, Role::Selected, " Cancel "),
        span(theme, Role::Quiet, " Enter, or any other key     "),
        span(theme, Role::Key, key.to_owned()),
        span(theme, Role::Text, format!(" {text}")),
    ])
}

pub fn take_control(model: &Model) -> Vec<Line<'static>> {
    let heard = match model.mode() {
        Mode::Offline => {
            "The robot has sent nothing since the start: it answers only after a command. This console then sends braking \
             commands without a target, and damping once the robot answers."
        }
        _ => {
            "States arrive although this console has sent nothing: another program may command the robot. Damping is \
             sent from now on."
        }
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
    let mut lines = vec![Line::from("The robot will stand up. Is the area clear?"), Line::default()];
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
            let unit = model.session.parameter(&p.name).map_or(String::new(), |info| info.unit);
            format!("{} {} {unit}", p.name, number(p.value))
        };
        let values: Vec<String> = proposal.parameters.iter().map(value).collect();
        lines.push(Line::from(format!("Trial #{trial}: {}", values.join(", "))));
    }
    lines.push(Line::from(match area_clear {
        true => "The area is clear, confirmed for this jump.",
        false => "Is the area clear of people and objects?",
    }));
    lines.push(Line::default());
    let area_asked = model.session.info.is_hardware() && !area_clear;
    let mut answer = match area_asked {
        true => answers(&model.theme, "y", "the area is clear"),
        false => answers(&model.theme, &key, "jump"),
    };
    if !area_asked && !waited {
        answer.push_span(span(theme, Role::Quiet, " (after 0.8 s)"));
    }
    lines.push(answer);
    lines
}

pub fn quit(model: &Model) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    if model.robot_is_energised() {
        lines.push(Line::from("The robot is armed: it will sit down before the program ends."));
    }
    if let Some(trial) = model.session.under_review() {
        lines.push(Line::from(format!("Trial #{} has no verdict yet.", trial.trial)));
    }
    lines.push(Line::default());
    lines.push(answers(&model.theme, "y", "quit"));
    lines
}

pub fn confirm(model: &Model, question: &Question) -> (&'static str, Vec<Line<'static>>) {
    match question {
        Question::Skip { trial, .. } => {
            let text = format!("Trial #{trial} is not run; the sampler does not see it. Another proposal follows.");
            let answer = answers(&model.theme, "y", "skip");
            ("Skip the proposal?", vec![Line::from(text), Line::default(), answer])
        }
        Question::AcceptAnyway { trial } => {
            let Some(row) = model.session.not_to_accept() else { return ("Accept?", Vec::new()) };
            let value = model.session.value_if_accepted(row);
            let unit = &model.session.info.unit;
            let value = value.map_or("no value".to_owned(), |value| format!("J = {} {unit}", number(value)));
            let (suggested, title, otherwise) = match row.suggested {
                Some(Verdict::Void) => ("void", "Accept a void trial?", "void hides the trial from it"),
                _ => ("fall", "Accept a fall?", "fall reports 0"),
            };
            let lines = vec![
                Line::from(format!("The suggested verdict of trial #{trial} is {suggested}: {}.", row.cause)),
                Line::from(format!("Accept reports {value} to the optimizer, {otherwise}.")),
                Line::default(),
                answers(&model.theme, "y", "accept"),
            ];
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
                answers(&model.theme, "y", "use it"),
            ];
            ("Is this value right?", lines)
        }
    }
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
