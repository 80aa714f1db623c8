//! One rule for the keys that close a dialog, and for the time of an answer in the message line.

use crate::support::{Console, assert_shows, trial};
use quadfrog::recording::record::{LogLevel, LogRecord, Record};
use quadfrog::telemetry::Mode;
use quadfrog::trial::Verdict;
use quadfrog_console::keymap::Keymap;
use quadfrog_console::message::{Msg, ReplayStatus};
use quadfrog_console::settings::ConsoleSettings;
use quadfrog_console::theme::{Colours, Glyphs, Theme};

/// The keys that open each dialog that only shows something.
const SHOWING: [&[&str]; 8] = [&["?"], &["R"], &["N"], &["P"], &["T"], &["2", "x"], &["2", "Enter"], &["6", "Enter"]];

/// Regression: the help closed with any key, the queue and the checks with Enter, the details with Esc.
#[test]
fn the_same_keys_close_every_dialog_that_only_shows_something() {
    for replay in [false, true] {
        for opening in SHOWING {
            for closing in ["Esc", "Enter", "q"] {
                let mut console = Console::ready();
                console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
                if replay {
                    console.update(Msg::Replay(ReplayStatus::default()));
                }
                console.press(opening);
                assert!(console.model.dialog.is_some(), "{opening:?} opens");
                let last = console.screen(80, 24).lines().last().unwrap_or_default().to_owned();
                assert_shows(&last, &["Esc Enter q close."]);
                assert_eq!(console.press(&[closing]), [], "{opening:?} {closing}");
                assert!(console.model.dialog.is_none(), "{opening:?} {closing} closes");
                assert_eq!(console.said(), "", "{opening:?} {closing}");
            }
        }
    }
}

/// Regression: the answer to a key without a meaning named one of the closing keys, or the key closed what was read.
#[test]
fn a_key_without_a_meaning_leaves_the_dialog_open_and_names_the_keys_that_close() {
    for opening in SHOWING {
        let mut console = Console::ready();
        console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
        console.press(opening);
        assert_eq!(console.press(&["F5"]), []);
        assert!(console.model.dialog.is_some(), "{opening:?} stays open");
        assert_shows(console.said(), &["F5 does nothing here; ", "Esc Enter q do"]);
    }
}

/// Regression: the tables went on above their last page, and so many keys back showed nothing.
#[test]
fn the_last_page_of_the_tables_is_left_with_one_key() {
    let mut console = Console::ready();
    console.update(Msg::Resize(80, 24));
    console.judged(30);
    console.press(&["R", "End"]);
    let last = console.screen(80, 24);
    console.press(&["Up"]);
    assert_ne!(console.screen(80, 24), last);
    console.press(&["Down", "Down"]);
    assert_eq!(console.screen(80, 24), last);
}

#[test]
fn the_key_chosen_for_quitting_closes_too_and_is_named() {
    let keys = [("quit", ["Ctrl-T".to_owned()])];
    let keymap = Keymap::new(keys.iter().map(|(action, keys)| (*action, &keys[..]))).expect("a free key");
    let settings = ConsoleSettings { keymap, ..ConsoleSettings::built_in() };
    let mut console = Console::with(settings, Theme::new(Colours::Named, Glyphs::Braille));
    console.press(&["?"]);
    assert_shows(&console.next_step(), &["Esc Enter Ctrl-T close."]);
    assert_eq!(console.press(&["Ctrl-T"]), []);
    assert!(console.model.dialog.is_none());
}

/// Regression: an answer stayed for minutes, and came back when a dialog or another view had been closed.
#[test]
fn an_answer_goes_with_the_next_key_that_has_an_effect_and_does_not_come_back() {
    for effect in [&["2"][..], &["R"], &["?", "Esc"], &["Ctrl-L"], &["Down"], &["t"], &["2", "1"]] {
        let mut console = Console::ready();
        console.press(&["W"]);
        let text = "colours for a light background";
        assert_eq!(console.said(), text);
        console.press(effect);
        assert_ne!(console.said(), text, "{effect:?}");
        assert!(!console.screen(80, 24).contains(&format!(" {text}\n")), "{effect:?}");
        console.press(&["2", "1"]);
        assert!(!console.screen(80, 24).contains(&format!(" {text}\n")), "{effect:?}");
    }
    // The answer of the session to a request, too.
    let mut console = Console::ready();
    console.answer("override Fx = 120", true, "done");
    assert_eq!(console.said(), "override Fx = 120: done");
    console.press(&["2"]);
    assert_eq!(console.said(), "");
}

#[test]
fn an_answer_goes_after_its_time_and_a_report_of_the_session_stays() {
    let mut console = Console::ready();
    console.press(&["W"]);
    console.wait(14_000);
    assert_eq!(console.said(), "colours for a light background");
    console.wait(1_000);
    assert_eq!(console.said(), "");
    let slow = LogRecord { level: LogLevel::Warning, source: "recorder".into(), message: "the disk is slow".into() };
    console.record(Record::Log(slow));
    console.press(&["2", "1"]);
    console.wait(120_000);
    assert_shows(&console.screen(80, 24), &["2 min ago: the disk is slow"]);
}

/// The first answer to a key that was pressed twice stays: the second press has no effect.
#[test]
fn a_key_without_an_effect_leaves_the_answer() {
    let mut console = Console::review(Mode::Ready, Verdict::Accept);
    console.press(&["a"]);
    console.answer("accept trial 0", true, "");
    console.press(&["a"]);
    assert_eq!(console.said(), "accept trial 0");
    // Nothing is beside another.
    console.press(&["Esc"]);
    assert_eq!(console.said(), "accept trial 0");
}

/// Regression: the key that opens the help was said to do nothing in it.
#[test]
fn the_key_of_the_help_closes_it_again() {
    let mut console = Console::ready();
    console.press(&["?", "?"]);
    assert!(console.model.dialog.is_none());
    assert_eq!(console.said(), "");
}
