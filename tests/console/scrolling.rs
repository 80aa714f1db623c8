//! Home and End in the lists and pages that scroll.

use crate::dialogs::long_checks;
use crate::support::{Console, assert_shows, line_with, session};
use quadfrog::recording::record::{Record, SessionInfo};
use quadfrog::trial::{Backend, ProposalSource, QueuedPoint, SearchStatus};
use quadfrog_console::message::{Mouse, Msg};

/// Regressions: End was refused in the help and, as Home, in the arming checks, and neither was named; after keys beyond the end as many
/// of the other direction seemed to do nothing.
#[test]
fn home_and_end_go_to_both_ends_of_every_list_that_scrolls() {
    let mut help = Console::ready();
    help.press(&["?"]);
    let mut checks = long_checks();
    checks.press(&["P"]);
    let mut confirmed = long_checks();
    confirmed.model.session.info = SessionInfo { backend: Some(Backend::Hardware), ..session() };
    confirmed.press(&["P"]);
    for console in [&mut help, &mut checks, &mut confirmed] {
        assert_shows(&console.next_step(), &["Home End"]);
        console.press(&["Home"]);
        let top = console.screen(80, 24);
        console.press(&["End"]);
        assert_eq!(console.said(), "");
        let end = console.screen(80, 24);
        assert_ne!(end, top);
        // On hardware Down chooses.
        if !console.model.session.info.is_hardware() {
            console.press(&["Down", "PgDn", "PgDn"]);
            assert_eq!(console.screen(80, 24), end, "the last line is in sight already");
            console.press(&["Up"]);
            assert_ne!(console.screen(80, 24), end, "one line back");
        }
        console.press(&["z"]);
        assert_shows(console.said(), &["z does nothing here; Up Down ", "PgUp PgDn Home End Esc Enter q do"]);
        console.press(&["Home"]);
        assert_eq!(console.screen(80, 24), top);
    }
}

/// Regression: Home and End left the details of a trial, and were refused over a line of the log and in the queue.
#[test]
fn home_and_end_go_to_the_first_and_the_last_of_the_others() {
    let mut console = Console::ready();
    console.judged(4);
    console.press(&["2", "Enter"]);
    for (key, title) in [("Home", "Trial #0"), ("End", "Trial #3")] {
        console.press(&[key]);
        assert_shows(&line_with(&console.screen(80, 24), " Trial #"), &[title]);
    }
    console.press(&["Esc", "6", "Enter", "Home"]);
    let first = console.screen(80, 24);
    console.press(&["End"]);
    assert_ne!(console.screen(80, 24), first);
    assert_eq!(console.said(), "");
    let point = |trial| QueuedPoint { trial, source: ProposalSource::Operator, ..QueuedPoint::default() };
    console.record(Record::Search(SearchStatus { queue: (5..9).map(point).collect(), ..SearchStatus::default() }));
    for (key, trial) in [("End", 8), ("Home", 5)] {
        console.press(&["Esc", "N", key, "x"]);
        assert_shows(&console.next_step(), &[&format!("remove trial #{trial} from the queue")]);
    }
    console.press(&["Esc", "Esc", ":", "End"]);
    let last = console.screen(80, 24);
    console.press(&["Home", "Up"]);
    assert_shows(&console.screen(80, 24), &["Actions (1 of "]);
    assert!(!last.contains("Actions (1 of "), "{last}");
}

/// Regression: with the mouse on, the wheel did nothing over the help, details and lists.
#[test]
fn the_wheel_scrolls_help_details_and_lists_and_answers_no_question() {
    let wheel = |console: &mut Console, event| assert_eq!(console.update(Msg::Mouse(event)), []);
    // The selected row of a list has other colours.
    let shown = |console: &Console| console.screen(80, 24) + &console.colours(80, 24);
    let mut console = long_checks();
    console.judged(4);
    let point = |trial| QueuedPoint { trial, source: ProposalSource::Operator, ..QueuedPoint::default() };
    console.record(Record::Search(SearchStatus { queue: (5..9).map(point).collect(), ..SearchStatus::default() }));
    console.update(Msg::Resize(80, 24));
    console.press(&["M"]);
    for keys in [&["?"][..], &["P"], &["N"], &["x"], &["2", "Enter"], &["R"]] {
        console.press(&["2"]);
        console.press(keys);
        let before = shown(&console);
        assert!(console.model.dialog.is_some(), "{keys:?}: {}", console.said());
        wheel(&mut console, Mouse::WheelDown);
        let moved = shown(&console);
        wheel(&mut console, Mouse::WheelUp);
        assert_eq!(shown(&console), before, "{keys:?}");
        // A short page has nothing to scroll.
        if !keys.contains(&"Enter") && !keys.contains(&"R") {
            assert_ne!(moved, before, "{keys:?}");
        }
        console.press(&["Esc"]);
    }
    console.press(&["1", "n"]);
    let before = shown(&console);
    assert_shows(&before, &["Skip the proposal?"]);
    wheel(&mut console, Mouse::WheelDown);
    assert_eq!(shown(&console), before);
}
