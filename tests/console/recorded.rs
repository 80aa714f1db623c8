//! All views of a recorded session of the simulator, as text, at five sizes, and in colours for a dark and a light background.
//! `cargo test --test console recorded -- --ignored` renews the recording, then
//! `INSTA_UPDATE=always cargo test --test console recorded` the expected screens.

use std::path::{Path, PathBuf};

use crate::pty::Session;
use crate::support::Console;
use portable_pty::CommandBuilder;
use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::Record;
use quadfrog::recording::writer::Writer;
use quadfrog_console::feed::Feed;
use quadfrog_console::settings::ConsoleSettings;
use quadfrog_console::theme::{Background, Colours, Glyphs, Theme};

const VIEWS: [(&str, &str); 6] =
    [("1", "live"), ("2", "trials"), ("3", "optimizer"), ("4", "override"), ("5", "health"), ("6", "log")];

fn recording() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/console/session.mcap")
}

/// A console at the end of the recorded session: two trials judged, the third under review.
fn console(theme: Theme) -> Console {
    let mut console = Console::with(ConsoleSettings::built_in(), theme);
    let player = Player::open(recording()).expect("the recorded session");
    let robot = quadfrog::robot::description::RobotDescription::embedded(&player.session().robot).expect("its robot");
    console.model.robot = Some(robot);
    let mut feed = Feed::replay(player);
    // One hour, longer than the recording.
    for msg in feed.poll(3_600_000_000_000) {
        console.update(msg);
    }
    console
}

/// The screen with `hh:mm:ss` for the time of day at the start of a line: it depends on the machine's time zone.
fn without_time_of_day(screen: &str) -> String {
    let line = |line: &str| {
        let (digits, colons): (Vec<usize>, Vec<usize>) = (0..8).partition(|at| at % 3 != 2);
        let is = |at: &usize, test: fn(&u8) -> bool| line.as_bytes().get(*at).is_some_and(test);
        let shows =
            digits.iter().all(|at| is(at, u8::is_ascii_digit)) && colons.iter().all(|at| is(at, |c| *c == b':'));
        if shows { format!("hh:mm:ss{}", &line[8..]) } else { line.to_owned() }
    };
    screen.lines().map(line).collect::<Vec<_>>().join("\n")
}

const SIZES: [(u16, u16); 5] = [(60, 20), (80, 24), (100, 30), (120, 40), (200, 60)];

fn compare(theme: Theme, kind: &str, draw: impl Fn(&Console, u16, u16) -> String) {
    for (columns, rows) in SIZES {
        let mut console = console(theme);
        // Below 80x24 one screen takes the place of all views.
        let views = if columns < 80 { &VIEWS[..1] } else { &VIEWS };
        for (key, name) in views {
            console.press(&[key]);
            let screen = without_time_of_day(&draw(&console, columns, rows));
            insta::assert_snapshot!(format!("{name}-{columns}x{rows}{kind}"), screen);
        }
    }
}

#[test]
fn views_of_a_recorded_session() {
    compare(Theme::new(Colours::Named, Glyphs::Braille), "", Console::screen);
}

#[test]
fn the_tables_of_a_recorded_study_open_scroll_and_close() {
    let mut console = console(Theme::new(Colours::Named, Glyphs::Braille));
    console.press(&["R"]);
    let first = console.screen(80, 24);
    assert!(first.contains("Study (1-") && first.contains("J_forward = x_final - x_init"), "{first}");
    console.press(&["End"]);
    let last = console.screen(80, 24);
    assert!(!last.contains("J_forward") && last.contains("accept"), "{last}");
    console.press(&["Home"]);
    assert_eq!(console.screen(80, 24), first);
    console.press(&["Esc"]);
    assert!(!console.screen(80, 24).contains("Study (1-"));
}

#[test]
fn views_of_a_recorded_session_in_ascii() {
    compare(Theme::new(Colours::None, Glyphs::Ascii), "-ascii", |console, columns, rows| {
        let screen = console.screen(columns, rows);
        assert!(screen.is_ascii(), "{columns}x{rows}:\n{screen}");
        screen
    });
}

#[test]
fn views_of_a_recorded_session_in_colour() {
    let dark = Theme::new(Colours::True, Glyphs::Braille);
    compare(dark, "-colour", Console::colours);
    compare(Theme { background: Background::Light, ..dark }, "-light", Console::colours);
}

#[test]
#[ignore = "renews the recording that the other tests read"]
fn record_the_session() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["--output", "recordings", "--seed", "3"]);
    let mut session = Session::run(folder.path(), (100, 30), command);
    session.wait_for(&["Press A to arm"]);
    for (trial, verdict) in [(0, "a"), (1, "v"), (2, "q")] {
        if session.screen().contains("DAMPED") {
            session.send("k");
        }
        session.wait_until("the next", || ["DISARMED", "READY"].iter().any(|mode| session.screen().contains(mode)));
        if session.screen().contains("DISARMED") {
            session.send("A");
        }
        session.wait_for(&["Press g twice"]);
        if trial == 1 {
            session.send("o");
            session.wait_for(&["Override trial #1"]);
            session.send("\x1b[B120\r");
            session.wait_for(&["120.0"]);
        }
        session.approve();
        session.wait_for(&[&format!("Trial #{trial}: judge it")]);
        session.send(verdict);
    }
    session.wait_for(&["Quit?"]);
    session.send("y");
    assert!(session.wait().success());

    let recordings = std::fs::read_dir(folder.path().join("recordings")).expect("recordings");
    let study = recordings.map(|entry| entry.expect("an entry").path()).next().expect("a study");
    let mut player = Player::open(study.join("session.mcap")).expect("a recording");
    let info = player.session().clone();
    // Keeps every fifth tick of the last 5 s, for the charts, and every record.
    let charts_from_ns = player.duration_ns().saturating_sub(5_000_000_000);
    let _ = std::fs::remove_file(recording());
    let mut writer = Writer::create(recording(), &info, player.start_utc_ns(), &[]).expect("the shorter recording");
    for played in player.by_ref() {
        match played {
            Played::Tick(tick) if tick.time_ns >= charts_from_ns && tick.number % 5 == 0 => {
                writer.tick(&tick).expect("written")
            }
            Played::Record(stamped)
                if !matches!(stamped.record, Record::Counters(_)) || stamped.time_ns >= charts_from_ns =>
            {
                writer.record(&stamped).expect("written");
            }
            _ => {}
        }
    }
    writer.finish().expect("closed");
}
