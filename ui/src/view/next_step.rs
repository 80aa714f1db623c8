//! The last line: the operator's next possible step.
//!
//! ```text
//!  Press g twice to jump  ·  o override  ·  n skip  ·  D sit down
//! ```

use quadfrog::telemetry::Mode;
use quadfrog::trial::{ExperimentStage, Verdict};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

use super::draw::span;
use crate::action::Action;
use crate::legal::legal;
use crate::model::Model;
use crate::model::dialog::{Dialog, Purpose};
use crate::theme::Role;

/// The most likely next step, and the others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NextStep {
    /// The step itself, a sentence.
    pub lead: String,
    /// Keys and their effects.
    pub others: Vec<(String, &'static str)>,
}

/// The next possible step.
pub fn next_step(model: &Model) -> NextStep {
    match &model.dialog {
        Some(dialog) => in_dialog(model, dialog),
        None if model.replay.is_some() => replay(model),
        None if model.session.info.observe && legal(Action::Acknowledge, model).is_err() => {
            step("Observing: this session can change nothing.", model, &[(Action::Quit, "quit")])
        }
        None => live(model),
    }
}

fn step(lead: impl Into<String>, model: &Model, others: &[(Action, &'static str)]) -> NextStep {
    let others = others
        .iter()
        .filter(|(action, _)| legal(*action, model).is_ok())
        .map(|(action, text)| (model.keymap.key(*action), *text))
        .collect();
    NextStep { lead: lead.into(), others }
}

fn live(model: &Model) -> NextStep {
    let key = |action| model.keymap.key(action);
    let quit = (Action::Quit, "quit");
    match model.mode() {
        Mode::Countdown => return step("Countdown to the jump: any key cancels it.", model, &[]),
        Mode::StandUp => return step("Standing up.", model, &[(Action::SitDown, "sit down")]),
        Mode::Jump => return step("Jumping.", model, &[]),
        Mode::Settle => return step("Landed; waiting until the robot is quiet.", model, &[]),
        Mode::SitDown => return step("Sitting down.", model, &[]),
        _ => {}
    }
    let stage = model.session.stage.map(|info| info.stage);
    if stage == Some(ExperimentStage::Review) {
        return review(model);
    }
    match model.mode() {
        Mode::Damped | Mode::Fault => {
            let stopped = if model.mode() == Mode::Fault { "FAULT" } else { "STOPPED" };
            let because = match model.session.stopped_because.as_str() {
                "" => String::new(),
                because => format!(": {because}"),
            };
            // The key first: a long reason may be cut.
            let lead = format!("{stopped}; check the robot, then {} acknowledges{because}", key(Action::Acknowledge));
            step(lead, model, &[(Action::Undo, "undo"), quit])
        }
        Mode::Offline | Mode::Observe => step("Waiting for the robot to answer.", model, &[quit]),
        Mode::Disarmed if stage == Some(ExperimentStage::Finished) => step(
            "The study is finished.",
            model,
            &[
                (Action::Continue, "more trials"),
                (Action::ConfirmBest, "confirm best"),
                (Action::ExportBest, "export"),
                (Action::Undo, "undo"),
                quit,
            ],
        ),
        Mode::Disarmed if model.session.arming_checks.is_empty() => step(
            "Checking the robot.",
            model,
            &[(Action::Override, "override"), (Action::Undo, "undo"), (Action::Help, "help"), quit],
        ),
        Mode::Disarmed if model.session.failing_checks() > 0 => step(
            format!(
                "Not ready to arm: {} checks have not passed. {} shows them.",
                model.session.failing_checks(),
                key(Action::ArmingChecks)
            ),
            model,
            &[(Action::Override, "override"), (Action::Undo, "undo"), (Action::Help, "help"), quit],
        ),
        Mode::Disarmed => step(
            format!("Press {} to arm: the robot stands up.", key(Action::Arm)),
            model,
            &[(Action::Override, "override"), (Action::Undo, "undo"), (Action::Help, "help"), quit],
        ),
        Mode::Ready if stage == Some(ExperimentStage::Finished) => step(
            "The study is finished.",
            model,
            &[
                (Action::Continue, "more trials"),
                (Action::ConfirmBest, "confirm best"),
                (Action::ExportBest, "export"),
                (Action::SitDown, "sit down"),
                (Action::Undo, "undo"),
            ],
        ),
        Mode::Ready if model.session.open_proposal().is_some() => step(
            format!("Press {} twice to jump.", key(Action::Approve)),
            model,
            &[
                (Action::Override, "override"),
                (Action::Skip, "skip"),
                (Action::Undo, "undo"),
                (Action::SitDown, "sit down"),
            ],
        ),
        _ => step("The sampler is choosing the next trial.", model, &[(Action::SitDown, "sit down")]),
    }
}

fn review(model: &Model) -> NextStep {
    let key = |action| model.keymap.key(action);
    let lead = match model.session.under_review().and_then(|trial| trial.suggested) {
        Some(Verdict::Accept) => format!("Judge it: {} accept (suggested)", key(Action::Accept)),
        Some(Verdict::Fall) => format!("Judge it: {} fall (suggested)", key(Action::Fall)),
        Some(Verdict::Void) => format!("Judge it: {} void (suggested)", key(Action::Void)),
        None => "Judge it".to_owned(),
    };
    let suggested = model.session.under_review().and_then(|trial| trial.suggested);
    let mut verdicts = vec![(Action::Accept, "accept"), (Action::Fall, "fall"), (Action::Void, "void")];
    verdicts.retain(|(action, _)| {
        !matches!(
            (action, suggested),
            (Action::Accept, Some(Verdict::Accept))
                | (Action::Fall, Some(Verdict::Fall))
                | (Action::Void, Some(Verdict::Void))
        )
    });
    verdicts.extend([(Action::Rerun, "re-run"), (Action::HandValue, "value by hand"), (Action::Note, "note")]);
    step(lead, model, &verdicts)
}

fn replay(model: &Model) -> NextStep {
    let playing = model.replay.as_ref().is_some_and(|replay| replay.playing);
    let key = model.keymap.key(Action::PlayPause);
    step(
        format!("{key} {}", if playing { "pauses" } else { "plays" }),
        model,
        &[
            (Action::StepBack, "step back"),
            (Action::StepForward, "step"),
            (Action::PreviousMarker, "previous trial"),
            (Action::NextMarker, "next trial"),
            (Action::Slower, "slower"),
            (Action::Faster, "faster"),
            (Action::Quit, "quit"),
        ],
    )
}

fn in_dialog(model: &Model, dialog: &Dialog) -> NextStep {
    let plain = |lead: String| NextStep { lead, others: Vec::new() };
    match dialog {
        Dialog::Approve { trial, .. } => plain(format!(
            "Press {} again to jump (trial #{trial}). Any other key cancels.",
            model.keymap.key(Action::Approve)
        )),
        Dialog::Arm { typed } => {
            let word = model.session.arming_word();
            let left = word.get(*typed..).unwrap_or_default();
            plain(format!("Type {left} to stand the robot up. Any other key cancels."))
        }
        Dialog::ArmingChecks { .. } => {
            let arm = if legal(Action::Arm, model).is_ok() {
                format!(" {} arms.", model.keymap.key(Action::Arm))
            } else {
                String::new()
            };
            plain(format!("Up Down choose an item, x confirms it, Enter closes.{arm}"))
        }
        Dialog::Quit => plain("Press y to quit. Any other key cancels.".to_owned()),
        Dialog::Override(form) if form.typing.is_some() => {
            plain("Enter takes the value and applies. Esc drops it.".to_owned())
        }
        Dialog::Override(_) => {
            let queue = model.keymap.key(Action::QueuePoint);
            plain(format!("Type, or Left Right 1 %, PgUp PgDn 10 %. Enter applies, {queue} queues, Esc cancels."))
        }
        Dialog::Field { purpose: Purpose::Note(_), .. } if model.robot_needs_us() => {
            plain("Enter saves the note, Esc cancels. Armed: Space is STOP, _ writes a space.".to_owned())
        }
        Dialog::Field { .. } => plain("Enter confirms, Esc cancels.".to_owned()),
        Dialog::Palette { .. } => plain("Type to filter, Up Down choose, Enter does it, Esc closes.".to_owned()),
        Dialog::Choose { .. } => plain("Up Down choose, x switches it on or off, Enter closes.".to_owned()),
        Dialog::Help { .. } => plain("Up Down scroll, any other key closes.".to_owned()),
        Dialog::Details { .. } => plain("Up Down other trials, Esc closes.".to_owned()),
    }
}

/// Draws the line.
pub fn render(frame: &mut Frame, area: Rect, model: &Model) {
    let theme = &model.theme;
    let next = next_step(model);
    let mut left = usize::from(area.width).saturating_sub(next.lead.chars().count() + 1);
    let mut spans = vec![Span::raw(" "), span(theme, Role::Key, next.lead)];
    for (key, text) in next.others {
        let width = key.chars().count() + text.chars().count() + 4;
        let Some(rest) = left.checked_sub(width) else { break };
        left = rest;
        spans.extend([
            span(theme, Role::Quiet, format!(" {} ", theme.dot())),
            span(theme, Role::Key, key),
            span(theme, Role::Quiet, format!(" {text}")),
        ]);
    }
    frame.render_widget(Line::from(spans), area);
}
