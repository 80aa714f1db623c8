//! View Log: the time of day, and whole lines.

mod support;

#[path = "support/pty.rs"]
mod pty;

use pty::Session;
use quadfrog::recording::record::{LogLevel, LogRecord, Record, SessionInfo};
use quadfrog::telemetry::Mode;
use support::{Console, assert_shows, line_with, session};

/// A console whose log has these lines.
fn logged(texts: &[&str]) -> Console {
    let mut console = Console::new();
    console.record(Record::Session(SessionInfo { started: "2026-03-04T10:20:30Z".into(), ..session() }));
    for text in texts {
        console.record(Record::Log(LogRecord {
            level: LogLevel::Warning,
            source: "test".into(),
            message: (*text).into(),
        }));
    }
    console.press(&["6"]);
    console
}

#[test]
fn a_line_opens_whole_and_shows_its_neighbours() {
    // Longer than the three rows of the message at each width.
    for (columns, rows, repeats) in [(80, 24, 6), (120, 40, 7), (200, 60, 11)] {
        let long = "the first words of a line that no terminal shows in one row, ".repeat(repeats)
            + "and its last word: amphibian";
        let words: Vec<&str> = long.split_whitespace().collect();
        let mut console = logged(&["the line before", &long]);
        assert!(!console.screen(columns, rows).contains("amphibian"), "{columns}");
        console.press(&["Enter"]);
        let screen = console.screen(columns, rows);
        assert_shows(&screen, &["Line of the log", "amphibian", "warning", "test", "STOP", "any other key closes"]);
        // Words stay whole: each row of the text is a part of it.
        for row in screen.lines().filter_map(|row| row.split_once("│ ").map(|(_, rest)| rest)) {
            let text = row.split("│").next().unwrap_or_default().trim();
            let of_the_text = text.contains("words") || text.contains("terminal");
            assert!(!of_the_text || text.split_whitespace().all(|word| words.contains(&word)), "{row}");
        }
        console.press(&["Up"]);
        assert_shows(&console.screen(columns, rows), &["the line before"]);
        assert!(!console.screen(columns, rows).contains("amphibian"));
        console.press(&["Down", "Esc"]);
        assert!(console.model.dialog.is_none());
    }
}

#[test]
fn a_line_longer_than_the_screen_scrolls_to_its_end() {
    let long = "word ".repeat(900) + "amphibian";
    let mut console = logged(&[&long]);
    console.press(&["Enter"]);
    assert!(!console.screen(80, 24).contains("amphibian"));
    console.press(&["PgDn"; 12]);
    assert_shows(&console.screen(80, 24), &["amphibian", "STOP"]);
}

#[test]
fn enter_in_the_log_still_acknowledges_a_stop_first() {
    let mut console = logged(&["a line"]);
    console.mode(Mode::Damped);
    assert_eq!(console.requests(&["Enter"]).len(), 1);
    assert!(console.model.dialog.is_none());
}

#[test]
fn an_empty_log_says_that_it_is_empty() {
    let mut console = Console::new();
    console.press(&["6", "Enter"]);
    assert_eq!(console.said(), "the log has no line");
}

#[test]
fn the_log_of_the_program_has_the_time_of_day() {
    let seconds = |time: &str| {
        let parts: Vec<i64> = time.split(':').map(|part| part.parse().unwrap_or(-1)).collect();
        assert_eq!(parts.len(), 3, "{time}");
        parts[0] * 3600 + parts[1] * 60 + parts[2]
    };
    let time_of_day = || seconds(&jiff::Zoned::now().strftime("%H:%M:%S").to_string());
    let before = time_of_day();
    let (_folder, mut session) = Session::opened((100, 30), &[]);
    session.send("6");
    session.wait_for(&["whole line (Enter)"]);
    let after = time_of_day();
    let line = line_with(&session.screen(), "proposal");
    let shown = seconds(line.split_whitespace().next().expect("a time"));
    // The clock may pass midnight.
    let day = 24 * 3600;
    assert!((shown - before).rem_euclid(day) <= (after - before).rem_euclid(day), "{line}: {before} to {after}");
    assert!(session.quit().success());
}
