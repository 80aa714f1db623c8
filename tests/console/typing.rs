//! Text fields: what a key does to the text that is there.

use crate::support;
use crate::support::{Console, assert_shows, session, trial};
use quadfrog::engine::ObserverStatus;
use quadfrog::recording::record::{Record, SessionInfo};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{Approval, ExperimentStage, SearchStatus, SearchedParameter, Verdict};
use quadfrog_console::message::{Effect, Msg, ReplayCommand, ReplayStatus};
use quadfrog_console::model::dialog::Dialog;
use quadfrog_console::theme::Role;

/// A finished study.
fn finished() -> Console {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    console.stage(ExperimentStage::Finished, 0);
    console
}

/// Regression: a note opened during a jump, where Space, which is to stop the robot, typed a space.
#[test]
fn no_text_field_opens_while_the_robot_jumps() {
    let mut console = Console::ready();
    console.judged(1);
    console.stage(ExperimentStage::Running, 1);
    console.mode(Mode::Jump);
    for keys in [&["m"][..], &["6", "/"], &[":"]] {
        console.press(keys);
        assert!(console.model.dialog.is_none(), "{keys:?}");
        let refused = format!("{} is not possible: the robot is jumping, and Space would type", keys[keys.len() - 1]);
        assert_shows(console.said(), &[&refused]);
    }
    // Any key cancels a countdown.
    console.mode(Mode::Countdown);
    console.press(&["m"]);
    assert!(console.model.dialog.is_none());
    console.mode(Mode::Settle);
    console.press(&["m"]);
    assert!(console.model.dialog.is_some());
}

/// Regression: the rule began a countdown over a half-written note: its next letter cancelled and dropped the note, and the letters
/// behind it judged the trial.
#[test]
fn letters_of_a_note_that_a_countdown_overtakes_stay_letters() {
    let mut console = Console::ready();
    console.record(Record::Session(SessionInfo { approve: Approval::FallsOnly, ..session() }));
    console.judged(1);
    console.press(&["m"]);
    console.enter("slid");
    console.stage(ExperimentStage::Running, 1);
    console.record(Record::Trial(trial(1, None, None)));
    console.mode(Mode::Countdown);
    assert_eq!(console.requests(&["v"]), [OperatorRequest::Cancel]);
    console.record(Record::Trial(trial(1, None, Some(Verdict::Void))));
    console.stage(ExperimentStage::Review, 1);
    console.mode(Mode::Ready);
    assert_eq!(console.requests(&["r"]), []);
    assert_shows(&console.screen(80, 24), &["slidvr"]);
    let text = "slidvr".to_owned();
    assert_eq!(console.requests(&["Enter"]), [OperatorRequest::Note { trial: 0, text }]);
    // A key that is no letter confirms and drops nothing.
    for key in ["Enter", "Esc", "Backspace"] {
        console.stage(ExperimentStage::Proposed, 2);
        console.press(&["m"]);
        console.mode(Mode::Countdown);
        assert_eq!(console.requests(&[key]), [OperatorRequest::Cancel], "{key}");
        assert!(console.model.dialog.as_ref().is_some_and(Dialog::takes_text), "{key}");
        console.mode(Mode::Ready);
        console.press(&["Esc"]);
    }
    // A question closes: its keys command.
    console.press(&["q"]);
    console.mode(Mode::Countdown);
    assert_eq!(console.requests(&["y"]), [OperatorRequest::Cancel]);
    assert!(console.model.dialog.is_none());
}

#[test]
fn typing_replaces_the_default_of_a_number() {
    let mut console = finished();
    assert_eq!(console.requests(&["C", "3", "Enter"]), [OperatorRequest::Continue(3)]);
    assert_eq!(console.requests(&["C", "Enter"]), [OperatorRequest::Continue(20)], "the default itself");
    assert_eq!(console.requests(&["C", "End", "1", "Enter"]), [OperatorRequest::Continue(201)], "after the selection");
    assert_eq!(console.requests(&["C", "Backspace", "7", "Enter"]), [OperatorRequest::Continue(7)]);
    let mut console = Console::ready();
    let fixed = console.requests(&["4", "X", "3", "Enter"]);
    assert_eq!(fixed, [OperatorRequest::Fix { parameter: "f0".into(), value: 1.25, trials: 3 }]);
    console.press(&["B"]);
    console.enter("0,8..1.5");
    let bounds = console.requests(&["Enter"]);
    assert_eq!(bounds, [OperatorRequest::NarrowBounds { parameter: "f0".into(), low: 0.8, high: 1.5 }]);
}

/// The selected default has the colours of a selection; it loses them with the first key.
#[test]
fn the_default_of_a_number_is_drawn_as_selected() {
    let mut console = finished();
    let selected = |console: &Console| {
        let style = console.model.theme.style(Role::Selected);
        let buffer = console.draw(80, 24);
        let marked = buffer.content().iter().skip(80 * 3).filter(|cell| {
            (Some(cell.fg), Some(cell.bg)) == (style.fg.or(Some(cell.fg)), style.bg.or(Some(cell.bg)))
                && cell.modifier == style.add_modifier
        });
        marked.map(|cell| cell.symbol().to_owned()).collect::<String>()
    };
    console.press(&["C"]);
    assert!(selected(&console).contains("20"), "{}", selected(&console));
    console.press(&["3"]);
    assert!(!selected(&console).contains('3'), "{}", selected(&console));
}

#[test]
fn a_field_of_a_number_takes_no_other_characters_and_says_so() {
    let mut console = finished();
    console.press(&["C", "1", "0"]);
    for key in ["A", "x", ".", "-"] {
        console.press(&[key]);
        assert_shows(&console.screen(80, 24), &[&format!("`{key}` does not belong here")]);
    }
    // 1.5 does not become 15 unseen.
    assert_eq!(console.requests(&["5", "Enter"]), []);
    assert_shows(&console.screen(80, 24), &["a character was not taken; Enter again confirms 105"]);
    assert_eq!(console.requests(&["Backspace", "Enter"]), [OperatorRequest::Continue(10)]);
    // A refused character leaves the selected default as it is.
    assert_eq!(console.requests(&["C", "x", "Enter", "Enter"]), [OperatorRequest::Continue(20)]);
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    assert_eq!(console.requests(&["=", "0", ",", "3", "Enter"]), [OperatorRequest::HandValue(Some(0.3))]);
    // With nothing typed there is nothing to confirm.
    let mut without_value = finished();
    assert_eq!(without_value.requests(&["C", "Backspace", "x", "Enter"]), []);
    assert_shows(&without_value.screen(80, 24), &["`x` does not belong here: type a number; Esc cancels"]);
    assert_eq!(without_value.requests(&["Enter"]), []);
    assert_shows(&without_value.screen(80, 24), &["nothing was typed: a number of trials from 1 to 1000 is needed"]);
    // No trial is promised that may not exist.
    assert_eq!(console.requests(&["2", "/", "9", "9", "x", "Enter"]), []);
    assert_shows(&console.screen(80, 24), &["a character was not taken; Enter again looks for trial 99"]);
    assert_eq!(console.requests(&["Enter"]), []);
    assert_shows(&console.screen(80, 24), &["there is no trial 99"]);
    // The form of the overrides refuses a letter aloud, too.
    let mut console = Console::ready();
    assert_eq!(console.requests(&["o", "x"]), []);
    assert_shows(&console.screen(80, 24), &["`x` does not belong here: type a number"]);
}

/// Regression: the hint promises that an empty field goes back to the measured value, and Enter said that nothing was typed.
#[test]
fn an_empty_field_of_a_value_by_hand_goes_back_to_the_measured_one() {
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    let measured = [OperatorRequest::HandValue(None)];
    assert_eq!(console.requests(&["="]), []);
    assert_shows(&console.screen(80, 24), &["0.420 m; empty: back"]);
    assert_eq!(console.requests(&["Enter"]), measured);
    // A character that was not taken is reported once, with the effect of Enter.
    assert_eq!(console.requests(&["=", "x", "Enter"]), []);
    assert_shows(&console.screen(80, 24), &["a character was not taken; Enter again goes back to the measured value"]);
    assert_eq!(console.requests(&["Enter"]), measured);
    // A key that empties the field acknowledges it.
    console.press(&["=", "x", "3", "Backspace"]);
    assert_shows(&console.screen(80, 24), &["0.420 m; empty: back"]);
    assert_eq!(console.requests(&["Enter"]), measured);
}

#[test]
fn a_note_is_continued_and_takes_every_character() {
    let mut console = Console::ready();
    let mut row = trial(0, Some(Verdict::Accept), None);
    row.note = "slid".into();
    console.record(Record::Trial(row));
    console.press(&["m", "Space", "5", "Enter"]);
    let noted = console.requests(&["m", "Space", "5", "Enter"]);
    assert_eq!(noted, [OperatorRequest::Note { trial: 0, text: "slid 5".into() }]);
}

/// Bounds of a search on a logarithmic scale, or computed ones, have up to 17 digits.
#[test]
fn no_dialog_and_no_message_has_a_number_of_17_digits() {
    let mut console = Console::new();
    let mut info: SessionInfo = session();
    let (low, high) = (0.1 + 0.2, 1.549_158_564_216_723_6);
    (info.parameters[0].low, info.parameters[0].high) = (low, high);
    console.record(Record::Session(info));
    let searched = |name: &str| SearchedParameter { name: name.into(), low, high, least: low, most: high, fixed: None };
    let search = SearchStatus { parameters: vec![searched("f0")], ..SearchStatus::default() };
    console.record(Record::Search(search));
    console.record(Record::Proposal(support::proposal(0, 0)));
    console.stage(ExperimentStage::Proposed, 0);
    console.mode(Mode::Ready);
    console.stage(ExperimentStage::Running, 0);
    let mut row = trial(0, Some(Verdict::Accept), None);
    row.gains = vec![("kp".to_owned(), high)].into();
    row.hand_value = Some(high);
    console.record(Record::Trial(row));
    console.stage(ExperimentStage::Proposed, 0);
    for keys in [&["4", "B"][..], &["4", "X"], &["4", "o"], &["2", "Enter"], &["1"], &["3"]] {
        console.press(keys);
        let screen = console.screen(200, 60);
        let longest = screen.split(|c: char| !c.is_ascii_digit()).map(str::len).max();
        assert!(longest <= Some(6), "{keys:?}\n{screen}");
        console.press(&["Esc"]);
    }
    console.press(&["4", "B", "1"]);
    console.press(&["Enter"]);
    assert_shows(&console.screen(80, 24), &["write it as 0.3..1.54916"]);
}

/// Regression: the field for a time, a trial or the best said that a number is typed.
#[test]
fn the_field_of_a_place_in_a_recording_says_what_it_takes() {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus::default()));
    console.press(&["G", "?"]);
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["`?` does not belong here: type a time, #7 for a trial, best or fall"]);
    console.press(&["Enter"]);
    assert_shows(&console.screen(80, 24), &["type a time, #7 for a trial, best or fall; Esc"]);
    assert_eq!(console.press(&["Enter"]), []);
    assert_shows(&console.screen(80, 24), &["nothing was typed: a time, #7 for a trial, best or fall is needed"]);
}

#[test]
fn a_space_in_a_place_of_a_recording_stops_the_robot_of_an_observed_session() {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus { observer: Some(ObserverStatus::default()), ..ReplayStatus::default() }));
    console.press(&["G"]);
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["12:34, 1:02:03.5, 75.5, #7, best of the recording, fall", "Space is STOP."]);
    assert_eq!(console.press(&["Space"]), [Effect::Stop]);
}

/// Regression: of a word the field took the letters of `best` alone and then said that nothing was typed; `fall` was refused.
#[test]
fn a_word_that_is_no_place_in_a_recording_is_named() {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus::default()));
    console.press(&["G"]);
    assert_shows(&console.screen(80, 24), &["12:34, 1:02:03.5, 75.5 s, #7 or trial 7, best of the recording, fall"]);
    console.enter("worst");
    assert_eq!(console.press(&["Enter"]), []);
    assert_shows(&console.screen(80, 24), &["`worst` is no place; write 12:34, 75.5 s, #7 or trial 7, best or fall"]);
    // The refused word is selected: the next one replaces it.
    console.enter("fall");
    assert_eq!(console.press(&["Enter"]), [Effect::Replay(ReplayCommand::NextFall)]);
}

/// Regression: the first Esc of the form of the overrides dropped the typed number without a word, and the form seemed stuck.
#[test]
fn the_form_of_the_overrides_says_what_esc_drops() {
    let mut console = Console::ready();
    console.press(&["o", "9", "9"]);
    assert_shows(&console.next_step(), &["Enter applies the number. Esc drops it; Esc again closes."]);
    assert_eq!(console.press(&["Esc"]), []);
    assert_shows(&console.screen(80, 24), &["99 was dropped: f0 stays", "Esc again closes the form."]);
    console.press(&["Down"]);
    assert!(!console.screen(80, 24).contains("was dropped"));
    // A value that was taken over before is dropped with the form.
    console.press(&["1", "0", "0", "Down", "5", "Esc"]);
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["5 was dropped: Fz stays", "Esc again closes the form and drops its"]);
    assert_eq!(console.requests(&["Esc"]), []);
    assert_eq!(console.said(), "cancelled: nothing was changed");
    assert!(!console.screen(80, 24).contains("Override trial"));
}

/// Regression: messages stayed after what they offered, or what they described, had ended.
#[test]
fn a_message_ends_with_what_it_describes() {
    let mut console = Console::ready();
    console.press(&["Ctrl-C"]);
    assert_eq!(console.said(), "STOP: damping. Ctrl-C again within 2 s quits");
    console.wait(2_100);
    assert_eq!(console.said(), "STOP: damping.");
    assert_eq!(console.press(&["Ctrl-C"]), [Effect::Stop], "the offer is over");
}

/// Regression: of an emptied number the form said "`` is not a number".
#[test]
fn a_number_of_the_form_that_is_none_is_asked_for_with_its_range() {
    let mut console = Console::ready();
    console.press(&["o", "Down", "1", "Backspace", "Enter"]);
    assert_shows(&console.screen(80, 24), &["Fx needs a number from 0 to 150 N"]);
    console.press(&["-", "Down"]);
    assert_shows(&console.screen(80, 24), &["Fx needs a number from 0 to 150 N"]);
    console.press(&["Backspace", "7", "0"]);
    let wanted = OperatorRequest::Override { parameter: "Fx".into(), value: 70.0 };
    assert_eq!(console.requests(&["Enter"]), [wanted]);
}

/// Regression: after a refused 99 the form appended (991..5), and a field of a number did or did not, depending on the refusal.
#[test]
fn typing_replaces_a_number_that_was_refused() {
    let mut console = Console::ready();
    console.press(&["o", "Down", "9", "9", "9", "Enter"]);
    assert_shows(&console.screen(80, 24), &["Fx = 999 N is outside 0 to 150 N"]);
    console.press(&["8", "5"]);
    let wanted = OperatorRequest::Override { parameter: "Fx".into(), value: 85.0 };
    assert_eq!(console.requests(&["Enter"]), [wanted]);
    // A key without a meaning keeps what was typed.
    console.press(&["o", "Down", "7", "F5", "6"]);
    let wanted = OperatorRequest::Override { parameter: "Fx".into(), value: 76.0 };
    assert_eq!(console.requests(&["Enter"]), [wanted]);
    // So does one in a field with a default, and a refused range is replaced.
    console.press(&["4", "X", "F5"]);
    let fixed = console.requests(&["3", "Enter"]);
    assert_eq!(fixed, [OperatorRequest::Fix { parameter: "Fx".into(), value: 75.0, trials: 3 }]);
    console.press(&["B"]);
    console.enter("120..50");
    console.press(&["Enter"]);
    console.enter("50..120");
    let bounds = console.requests(&["Enter"]);
    assert_eq!(bounds, [OperatorRequest::NarrowBounds { parameter: "Fx".into(), low: 50.0, high: 120.0 }]);
}

/// Regression: `12O` in the form of the overrides became 12 with Enter or `Q`, and the message about the letter went with the next digit.
#[test]
fn the_form_of_the_overrides_asks_before_it_uses_a_number_without_a_refused_character() {
    let mut console = Console::ready();
    let overridden = |value| [OperatorRequest::Override { parameter: "Fx".into(), value }];
    assert_eq!(console.requests(&["o", "Down", "1", "2", "O", "Enter"]), []);
    assert_shows(&console.screen(80, 24), &["a character was not taken; Enter again confirms 12"]);
    assert_eq!(console.requests(&["Enter"]), overridden(12.0));
    // The letter within the number, and a key without a meaning after it.
    console.press(&["o", "Down", "1", "O", "2", "F5"]);
    assert_shows(
        &console.screen(80, 24),
        &["`O` does not belong here", "Enter, Up, Down and Q work when pressed twice, Esc drops the number."],
    );
    assert_eq!(console.requests(&["Q"]), []);
    assert_shows(&console.screen(80, 24), &["a character was not taken; Q again queues 12"]);
    let point = vec![("f0".into(), 1.25), ("Fx".into(), 12.0), ("Fz".into(), 250.0)];
    assert_eq!(console.requests(&["Q"]), [OperatorRequest::Enqueue(point)]);
    // Another row takes the number, too; so does Enter on a value that was not typed.
    console.press(&["o", "Down", "1", "2", "O", "Down"]);
    assert_shows(&console.screen(80, 24), &["a character was not taken; Down again takes 12"]);
    assert_eq!(console.requests(&["Down", "x", "Enter"]), []);
    assert_shows(&console.screen(80, 24), &["a character was not taken; Enter again confirms 250"]);
    assert_eq!(console.requests(&["Enter"]), overridden(12.0));
    // Regression: the question promised to use a number that is outside its bounds.
    assert_eq!(console.requests(&["o", "1", "O", "5", "Enter"]), []);
    assert_shows(&console.screen(80, 24), &["f0 = 15 Hz is outside 0.75 to 1.75 Hz"]);
    console.press(&["Esc", "Esc"]);
    // A number that is typed anew has no missing character.
    assert_eq!(console.requests(&["o", "Down", "7", "O", "Backspace", "8", "Enter"]), overridden(8.0));
}

/// Regression: after `Down` that asked, the number for the next row was appended to that of this one: `w`, 1.2, Down, 100 made 1.2100.
#[test]
fn a_number_after_a_key_that_asked_is_a_new_one() {
    let mut console = Console::ready();
    console.press(&["o", "w", "1", ".", "2", "Down"]);
    assert_shows(&console.screen(80, 24), &["a character was not taken; Down again takes 1.2"]);
    console.press(&["1", "0", "0", "Down"]);
    assert_shows(&console.screen(80, 24), &["f0 = 100 Hz is outside"]);
    // Without a number no key that moves asks.
    console.press(&["Esc", "x"]);
    assert_shows(&console.screen(80, 24), &["Enter and Q work when pressed twice, Esc cancels."]);
    console.press(&["Down"]);
    console.enter("105");
    let request = OperatorRequest::Override { parameter: "Fx".into(), value: 105.0 };
    assert_eq!(console.requests(&["Enter"]), [request]);
}

/// Regression: after a character that was not taken the last line promised that Enter confirms.
#[test]
fn enter_is_not_said_to_confirm_before_a_refused_character_is_acknowledged() {
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    console.press(&["=", "z"]);
    console.enter("0.44");
    let last = |console: &mut Console| console.screen(80, 24).lines().last().unwrap_or_default().to_owned();
    assert_shows(&last(&mut console), &["Enter twice confirms, Esc cancels. Space is STOP."]);
    assert_eq!(console.requests(&["Enter"]), []);
    assert_shows(&last(&mut console), &["Enter confirms, Esc cancels. Space is STOP."]);
}

/// Regression: in an empty field that needs a number the last line said that Enter confirms.
#[test]
fn an_empty_field_says_what_to_type() {
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    let last = |console: &Console| console.screen(80, 24).lines().last().unwrap_or_default().to_owned();
    console.press(&["2", "/"]);
    assert_shows(&last(&console), &["Type the number of a trial, Esc cancels."]);
    console.press(&["z"]);
    assert_shows(&last(&console), &["Type the number of a trial, Esc cancels."]);
    console.enter("0");
    assert_shows(&last(&console), &["Enter twice confirms, Esc cancels."]);
    console.press(&["Enter"]);
    assert_shows(&last(&console), &["Enter confirms, Esc cancels."]);
}

/// Regression: over a half-written note, which a STOP keeps open, the line advised the key that drops it.
#[test]
fn a_form_that_is_open_over_a_stop_says_first_how_it_is_kept() {
    let last = |console: &Console| console.screen(80, 24).lines().last().unwrap_or_default().to_owned();
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    console.press(&["m", "o", "k"]);
    assert_eq!(console.press(&["F12"]), [Effect::Stop]);
    console.mode(Mode::Damped);
    assert_eq!(last(&console), " STOPPED: Enter keeps the note, Esc drops it; then k acknowledges.");
    // Regression: a half-written note went without its text.
    let mut other = Console::review(Mode::Review, Verdict::Accept);
    other.press(&["m", "n", "o", "Esc"]);
    assert_eq!(other.said(), "cancelled: nothing was changed; dropped: no");
    let note = OperatorRequest::Note { trial: 0, text: "ok".into() };
    assert_eq!(console.requests(&["Enter", "k"]), [note, OperatorRequest::Acknowledge]);
    // Another person's STOP closes no form.
    for (keys, step) in [
        (&["=", "1"][..], "FAULT: Enter uses the value, Esc drops it; then k acknowledges."),
        (&["=", "1", "m"], "FAULT: Enter twice confirms, Esc cancels; then k acknowledges."),
        (&["2", "/"], "FAULT: Esc cancels; then k acknowledges."),
    ] {
        let mut console = Console::review(Mode::Review, Verdict::Accept);
        console.press(keys);
        console.mode(Mode::Fault);
        assert_eq!(last(&console).trim(), step, "{keys:?}");
    }
}
