//! The questions of open dialogs, and the keys that answer.

use crate::action::Action;
use crate::legal::{legal, may_request};
use crate::model::Model;
use crate::model::dialog::{Dialog, Purpose, Question};
use quadfrog::trial::Verdict;

/// The two ends of a form with values of the operator, the one that keeps them first; none of another dialog.
pub(super) fn ends_of_form(dialog: &Dialog) -> Option<&'static str> {
    Some(match dialog {
        Dialog::Field { .. } if dialog.lacks_content() => "Esc cancels",
        _ if dialog.has_refused_character() => "Enter twice confirms, Esc cancels",
        Dialog::Override(_) => "Enter applies, Esc drops the values",
        Dialog::Field { purpose: Purpose::Note(_), .. } => "Enter keeps the note, Esc drops it",
        Dialog::Field { purpose: Purpose::HandValue(_), .. } => "Enter uses the value, Esc drops it",
        Dialog::Field { purpose: Purpose::VoidReason { .. } | Purpose::ChangeVerdict { .. }, .. } => {
            "Enter gives the verdict, Esc cancels"
        }
        Dialog::Field { .. } => "Enter confirms, Esc cancels",
        _ => return None,
    })
}

/// The question of a dialog. Of its keys those that move stand before the last one: in a narrow terminal they go first.
pub(super) fn question(model: &Model, dialog: &Dialog) -> String {
    let key = |action| model.keymap.key(action);
    let close = format!("{} close.", model.keymap.closing_keys());
    match dialog {
        Dialog::Approve { trial, area_clear: false, .. } if model.session.info.is_hardware() => {
            format!("Type y if the area is clear (trial #{trial}). Any key but {} cancels.", key(Action::Approve))
        }
        Dialog::Approve { trial, .. } => {
            format!("Press {} again to jump (trial #{trial}). Any other key cancels.", key(Action::Approve))
        }
        Dialog::Arm { typed, .. } => {
            let left = model.session.arming_confirmation().get(*typed..).unwrap_or_default();
            format!("Type {left} to stand the robot up. Any other key cancels.")
        }
        Dialog::ArmingChecks { .. } => {
            // First, since keys that scroll give way in a narrow terminal.
            let arms = legal(Action::Arm, model).map_or(String::new(), |()| format!("{} arms. ", key(Action::Arm)));
            match model.session.info.is_hardware() {
                true => format!("{arms}x confirms, Up Down choose, PgUp PgDn Home End scroll, {close}"),
                false => format!("{arms}Up Down PgUp PgDn Home End scroll, {close}"),
            }
        }
        Dialog::Override(form) if dialog.has_refused_character() => {
            let (keys, esc) =
                if form.typing.is_some() { ("Enter, Up, Down", "drops the number") } else { ("Enter", "cancels") };
            format!("{keys} and {} work when pressed twice, Esc {esc}.", key(Action::QueuePoint))
        }
        Dialog::Override(form) if form.typing.is_none() => {
            let queue = key(Action::QueuePoint);
            format!("Type, or Left Right 1 %, PgUp PgDn 10 %. Enter applies, {queue} queues, Esc cancels.")
        }
        Dialog::Override(_) => "Enter applies the number. Esc drops it; Esc again closes.".to_owned(),
        Dialog::TakeControl => "Press y to take control. Any other key cancels.".to_owned(),
        Dialog::Confirm(Question::Skip { trial, .. }) => {
            format!("Press y to skip trial #{trial}. Any other key cancels.")
        }
        Dialog::Confirm(Question::JudgeAnyway { trial, verdict: Verdict::Fall }) => {
            format!("Press y to judge trial #{trial} a fall. Any other key cancels.")
        }
        Dialog::Confirm(Question::JudgeAnyway { trial, .. }) => {
            format!("Press y to accept trial #{trial}. Any other key cancels.")
        }
        Dialog::Confirm(Question::Rerun { trial }) => {
            format!("Press y to queue trial #{trial} again. Any other key cancels.")
        }
        Dialog::Confirm(Question::QueueProposed { .. }) => {
            "Press y to queue the values. Any other key cancels.".to_owned()
        }
        Dialog::Confirm(Question::RemoveQueued { trial }) => {
            format!("Press y to remove trial #{trial} from the queue. Any other key cancels.")
        }
        Dialog::Confirm(Question::FewRepeats { .. }) => {
            "Press y to repeat all the same. Any other key goes back to the field.".to_owned()
        }
        Dialog::Confirm(Question::EndRepeats) => "Press y to end the repeats. Any other key cancels.".to_owned(),
        Dialog::Confirm(Question::Undo { trial }) => {
            format!("Press y to take the verdict of trial #{trial} back. Any other key cancels.")
        }
        Dialog::Confirm(Question::HandValue { .. }) => {
            "Press y to use the value. Any other key goes back to the field.".to_owned()
        }
        Dialog::Quit => "Press y to quit. Any other key cancels.".to_owned(),
        Dialog::Field { purpose, .. } if purpose.is_remark() && model.space_bar_must_stop() => {
            "Enter saves the text, Esc cancels. Energised: Space is STOP, _ writes a space.".to_owned()
        }
        Dialog::Export { .. } => "Press a for all trials, s for those shown. Any other key cancels.".to_owned(),
        Dialog::Field { purpose, .. } => {
            let enter = match purpose.needed().filter(|_| dialog.lacks_content()) {
                Some(needed) => format!("Type {needed}"),
                None if dialog.has_refused_character() => "Enter twice confirms".to_owned(),
                None => "Enter confirms".to_owned(),
            };
            let space = if model.can_stop() && !model.space_bar_is_text() { " Space is STOP." } else { "" };
            format!("{enter}, Esc cancels.{space}")
        }
        Dialog::Palette { .. } => "Type to filter, Enter does it, Up Down Home End choose, Esc closes.".to_owned(),
        Dialog::Choose { .. } => format!("x switches it on or off, Up Down Home End choose, {close}"),
        Dialog::Queue { .. } if model.session.queue().is_empty() => close,
        Dialog::Queue { .. } if may_request(model).is_err() => format!("Up Down Home End choose, {close}"),
        Dialog::Queue { .. } => format!("Left Right move it, x removes, Up Down Home End choose, {close}"),
        Dialog::Report { .. } | Dialog::Help { .. } => format!("Up Down PgUp PgDn Home End scroll, {close}"),
        Dialog::Details { .. } => format!("Up Down Home End other trials, PgUp PgDn scroll, {close}"),
        Dialog::LogLine { .. } => format!("Up Down Home End other lines, PgUp PgDn scroll, {close}"),
    }
}
