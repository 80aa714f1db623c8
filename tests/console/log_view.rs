//! View Log: the time of day, and whole lines.

use crate::pty::Session;
use crate::support::{Console, assert_shows, line_with, session};
use quadfrog::recording::record::{LogLevel, LogRecord, Record, SessionInfo, Stamped};
use quadfrog::telemetry::Mode;
use quadfrog_console::message::{Msg, ReplayStatus, ReplayTimeline};

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

/// Regression: a line that another thread wrote five milliseconds later stood above the earlier one.
#[test]
fn lines_stand_in_the_order_of_time() {
    let mut console = Console::new();
    console.record(Record::Session(session()));
    for (time_ns, text) in [(1_000_000_000, "first"), (1_005_000_000, "third"), (1_000_000_001, "second")] {
        let log = LogRecord { level: LogLevel::Warning, source: "test".into(), message: text.into() };
        console.update(Msg::Record(Stamped { time_ns, record: Record::Log(log) }));
    }
    console.press(&["6"]);
    let screen = console.screen(120, 40);
    let [first, second, third] = ["first", "second", "third"].map(|text| screen.find(text).unwrap());
    assert!(first < second && second < third, "{screen}");
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
        assert_shows(&screen, &["Line of the log", "amphibian", "warning", "test", "STOP", "Esc Enter q close"]);
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

/// Regression: in the replay of a study that was continued hours later, all lines had the times of the first session.
#[test]
fn lines_of_a_replay_have_the_time_of_the_session_that_recorded_them() {
    let mut console = logged(&[]);
    let utc_ns = |text: &str| text.parse::<jiff::Timestamp>().unwrap().as_nanosecond() as u64;
    let second = 1_000_000_000;
    // The second session began five hours later; of the pause 1 s is played.
    let begins_utc_ns = vec![(0, utc_ns("2026-03-04T10:20:30Z")), (61 * second, utc_ns("2026-03-04T15:47:01Z"))];
    console.update(Msg::Replay(ReplayStatus { duration_ns: 90 * second, ..ReplayStatus::default() }));
    console.update(Msg::Timeline(Box::new(ReplayTimeline { begins_utc_ns, ..ReplayTimeline::default() })));
    for (at_s, message) in [(12, "the first"), (61, "the second"), (71, "the third")] {
        let record = Record::Log(LogRecord { level: LogLevel::Info, source: "test".into(), message: message.into() });
        console.update(Msg::Record(Stamped { time_ns: at_s * second, record }));
    }
    let screen = console.screen(120, 40);
    // Minutes and seconds are the same in all time zones but those of half an hour.
    for (message, minutes, at) in [
        ("the first", ["20:42", "50:42"], "0:12.000"),
        ("the second", ["47:01", "17:01"], "1:01.000"),
        ("the third", ["47:11", "17:11"], "1:11.000"),
    ] {
        let line = line_with(&screen, message);
        assert!(minutes.iter().any(|time| line.contains(time)) && line.contains(at), "{message}:\n{screen}");
    }
    console.press(&["Enter"]);
    assert_shows(&console.screen(120, 40), &["1:11.000 of the replay"]);
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
fn enter_in_the_log_opens_its_line_and_acknowledges_no_stop() {
    let mut console = logged(&["a line"]);
    console.mode(Mode::Damped);
    assert_eq!(console.requests(&["Enter"]), []);
    assert_shows(&console.next_step(), &["STOPPED: Esc, then k acknowledges."]);
    assert_eq!(console.requests(&["Esc", "k"]).len(), 1);
}

#[test]
fn an_empty_log_says_that_it_is_empty() {
    let mut console = Console::new();
    console.press(&["6", "Enter"]);
    assert_eq!(console.said(), "the log has no line");
}

/// Regression: in a resumed session a search without a result left the page empty, although earlier sessions had such lines.
#[test]
fn a_search_without_a_result_says_where_the_lines_of_earlier_sessions_are() {
    let mut console = logged(&["a line"]);
    console.press(&["/"]);
    console.enter("fell");
    console.press(&["Enter"]);
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["0 lines", "No line of this session passes.", "quadfrog replay"]);
    console.update(Msg::Replay(ReplayStatus::default()));
    assert_shows(&console.screen(80, 24), &["No line up to this time passes."]);
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

/// Regression: each new line that the search left out moved a log that was scrolled back.
#[test]
fn a_scrolled_log_stays_on_its_line_when_a_line_that_it_leaves_out_comes() {
    let mut console = logged(&["frog one", "frog two", "frog three"]);
    console.press(&["/"]);
    console.enter("frog");
    console.press(&["Enter", "Up"]);
    let log = |console: &mut Console, text: &str| {
        let (level, source) = (LogLevel::Warning, "test".into());
        console.record(Record::Log(LogRecord { level, source, message: text.into() }));
    };
    let opened = |console: &mut Console| {
        console.press(&["Enter"]);
        let screen = console.screen(120, 40);
        console.press(&["Esc"]);
        screen
    };
    log(&mut console, "toad");
    assert_shows(&line_with(&opened(&mut console), "│ frog"), &["frog two"]);
    log(&mut console, "frog four");
    assert_shows(&line_with(&opened(&mut console), "│ frog"), &["frog two"]);
}
