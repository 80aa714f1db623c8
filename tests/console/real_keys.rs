//! The visible effect of every key of the default keymap, on the program in a pseudo-terminal. A key without a row fails.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use crate::pty::Session;
use portable_pty::CommandBuilder;
use quadfrog_console::action::{ACTIONS, Action};
use quadfrog_console::settings::ConsoleSettings;

/// The effect of a key on the terminal.
enum Seen {
    /// This text appears.
    Shows(&'static str),
    /// This text disappears.
    Hides(&'static str),
    /// A still screen changes.
    Changes,
    /// These bytes are sent.
    Sends(&'static [u8]),
}

use Seen::{Changes, Hides, Sends, Shows};

/// An action, its key, the expected effect and the continuation.
struct Row {
    action: Action,
    key: &'static str,
    seen: Seen,
    /// Keys typed next, and the text to wait for.
    after: (&'static str, &'static str),
}

const fn row(action: Action, key: &'static str, seen: Seen, after: (&'static str, &'static str)) -> Row {
    Row { action, key, seen, after }
}

/// A session of one trial on the simulator, in this order.
const LIVE: &[Row] = &[
    row(Action::TakeControl, "L", Shows("the simulator is under control"), ("", "")),
    row(Action::Override, "o", Shows("Override trial #0"), ("\x1b[B120\r", "was 106.2")),
    row(Action::ClearOverrides, "O", Hides("was 106.2"), ("", "")),
    row(Action::ArmingChecks, "P", Shows("Arming checks: 3 passed"), ("\x1b", "Press A to arm")),
    row(Action::Skip, "n", Shows("Skip the proposal?"), ("y", "skipped; a new proposal follows")),
    // The program is the first of its session.
    row(Action::Suspend, "Ctrl-Z", Shows("no shell to continue it"), ("", "Press A to arm")),
    row(Action::Arm, "A", Shows("STAND UP"), ("", "READY")),
    row(Action::SitDown, "D", Shows("SIT DOWN"), ("", "DISARMED")),
    row(Action::Stop, "F12", Shows("DAMPED"), ("", "k acknowledges")),
    row(Action::Acknowledge, "k", Hides("DAMPED"), ("A", "READY")),
    row(Action::Stop, "Space", Shows("DAMPED"), ("kA", "READY")),
    row(Action::Approve, "g", Shows("Jump?"), ("", "")),
    row(Action::Approve, "g", Hides("Jump?"), ("", "TRIAL #1")),
    row(Action::Freeze, "z", Shows("8 s sweep"), ("z", "TRIAL #1")),
    row(Action::HandValue, "=", Shows("measured by hand"), ("0.5\r", "by hand")),
    row(Action::Note, "m", Shows("Note on trial #1"), ("slid\r", "note on trial 1")),
    row(Action::Void, "v", Hides("judge it"), ("", "undo")),
    row(Action::Undo, "u", Shows("judge it"), ("", "")),
    row(Action::Rerun, "r", Shows("re-run of #1"), ("u", "judge it")),
    row(Action::Fall, "f", Shows("Did the robot fall?"), ("y", "Study finished")),
    row(Action::Undo, "u", Shows("judge it"), ("", "")),
    row(Action::Accept, "a", Shows("Study finished"), ("", "")),
    row(Action::ExportBest, "E", Shows("exported; start with quadfrog --config "), ("", "")),
    row(Action::Continue, "C", Shows("How many more trials?"), ("\r", "Trial #2")),
    row(Action::ConfirmBest, "K", Shows("two accepted trials are needed"), ("4", "Actions ─")),
    row(Action::Fix, "X", Shows("Fix Fx at"), ("3\r", "fixed at")),
    row(Action::Fix, "X", Hides("fixed at"), ("", "")),
    row(Action::Bounds, "B", Shows("Search Fx from .. to"), ("\x1520..120\r", "initial 0.000..150.0")),
    row(Action::QueuePoint, "Q", Shows("Queue the sampler's values?"), ("y1", "8 s sweep")),
    row(Action::Queue, "N", Shows("Left Right move it"), ("\r", "8 s sweep")),
    row(Action::Interrupt, "Ctrl-C", Shows("Ctrl-C again within 2 s quits"), ("", "DAMPED")),
    row(Action::Quit, "q", Shows("The study and its recording are in"), ("", "")),
];

/// The recorded session, paused at its end.
const REPLAY: &[Row] = &[
    row(Action::PlayPause, "p", Shows("paused"), ("", "")),
    row(Action::NextMarker, "]", Changes, ("", "")),
    row(Action::PreviousMarker, "[", Changes, (")", "Trial #2: no verdict yet")),
    row(Action::Seek, "G", Shows("Go to a time or a trial"), ("0\r", "00:00.000")),
    row(Action::ReplayEnd, ")", Hides("00:00.000"), ("", "Trial #2: no verdict yet")),
    row(Action::ReplayStart, "(", Shows("00:00.000"), ("", "")),
    row(Action::NextFall, "}", Shows("no further fall or fault"), ("", "")),
    row(Action::PreviousFall, "{", Shows("no earlier fall or fault"), (")", "Trial #2: no verdict yet")),
    row(Action::TickBack, ";", Changes, ("", "")),
    row(Action::TickForward, "'", Changes, ("", "")),
    row(Action::SecondBack, "j", Changes, ("", "")),
    row(Action::SecondForward, "l", Changes, ("", "")),
    row(Action::SlowMotion, "H", Shows("SLOW JUMPS"), ("H", "")),
    row(Action::LoopJump, "i", Shows("LOOP #2"), ("i)", "Trial #2: no verdict yet")),
    row(Action::Beside, "|", Shows("Which trial beside #2?"), ("1\r", "A #2 line, B #1 dotted")),
    row(Action::EndComparison, "Esc", Hides("dotted"), ("", "8 s sweep")),
    row(Action::StepBack, ",", Changes, ("", "")),
    row(Action::StepForward, ".", Changes, ("", "")),
    row(Action::Slower, "<", Shows("x0.5"), ("", "")),
    row(Action::Faster, ">", Hides("x0.5"), ("", "")),
    row(Action::Freeze, "z", Shows("VIEW FROZEN"), ("", "")),
    row(Action::Left, "Left", Shows("cursor -0.08 s"), ("", "")),
    row(Action::Right, "Right", Shows("cursor 0.00 s"), ("z", "8 s sweep")),
    row(Action::ZoomIn, "+", Shows("4 s sweep"), ("", "")),
    row(Action::ZoomOut, "-", Shows("8 s sweep"), ("", "")),
    row(Action::ChartMode, "w", Shows("8 s scroll"), ("w", "8 s sweep")),
    row(Action::Series, "t", Shows("FL force"), ("ttttt", "FL foot")),
    row(Action::ChooseSeries, "T", Shows("Series of the charts"), ("\x1b", "8 s sweep")),
    row(Action::TrialsView, "2", Shows("by number"), ("", "")),
    row(Action::Rejudge, "J", Shows("Judge all trials again"), ("\r", " change")),
    row(Action::Rejudge, "J", Hides(" change"), ("", "by number")),
    row(Action::First, "Home", Changes, ("", "")),
    row(Action::Down, "Down", Changes, ("", "")),
    row(Action::Up, "Up", Changes, ("", "")),
    row(Action::Last, "End", Changes, ("", "")),
    row(Action::PageUp, "PgUp", Changes, ("", "")),
    row(Action::PageDown, "PgDn", Changes, ("", "")),
    row(Action::Ghost, "c", Shows("is laid under the charts"), ("", "")),
    row(Action::Open, "Enter", Changes, (")", "by number")),
    row(Action::Sort, "s", Shows("by value"), ("", "")),
    row(Action::Reverse, "S", Shows("by value reversed"), ("", "")),
    row(Action::Filter, "F", Shows("only accept"), ("FFFF", "all (F)")),
    row(Action::BestOnly, "b", Shows("best only"), ("b", "all (F)")),
    row(Action::Columns, "x", Shows("Columns of the trial table"), ("\x1b", "by value")),
    row(Action::Search, "/", Shows("Go to trial"), ("1\r", "by value")),
    row(Action::Copy, "y", Sends(b"\x1b]52;c;"), ("", "")),
    row(Action::Export, "e", Shows("written: "), ("", "")),
    row(Action::OptimizerView, "3", Shows("Landings"), ("", "")),
    row(Action::OverrideView, "4", Shows("Nothing can be changed: this is a replay"), ("", "")),
    row(Action::HealthView, "5", Shows("Recorder"), ("", "")),
    row(Action::LogView, "6", Shows("all levels"), ("", "")),
    row(Action::NextView, "Tab", Shows("8 s sweep"), ("", "")),
    row(Action::PreviousView, "Shift-Tab", Shows("all levels"), ("", "")),
    row(Action::LiveView, "1", Shows("8 s sweep"), ("", "")),
    row(Action::Palette, ":", Shows("Actions"), ("\x1b", "8 s sweep")),
    row(Action::Report, "R", Shows("J_forward = x_final"), ("\x1b", "8 s sweep")),
    row(Action::Help, "?", Shows("Keys (1"), ("\x1b", "8 s sweep")),
    row(Action::Theme, "W", Shows("colours for a light background"), ("W", "colours for a dark background")),
    row(Action::Mouse, "M", Shows("mouse on"), ("M", "mouse off")),
    row(Action::Redraw, "Ctrl-L", Shows("the screen was drawn again"), ("", "")),
];

/// The bytes that a terminal sends for a key.
fn typed(key: &str) -> String {
    let named = match key {
        "Space" => " ",
        "Enter" => "\r",
        "Esc" => "\x1b",
        "Tab" => "\t",
        "Shift-Tab" => "\x1b[Z",
        "Up" => "\x1b[A",
        "Down" => "\x1b[B",
        "Right" => "\x1b[C",
        "Left" => "\x1b[D",
        "Home" => "\x1b[H",
        "End" => "\x1b[F",
        "PgUp" => "\x1b[5~",
        "PgDn" => "\x1b[6~",
        "F12" => "\x1b[24~",
        _ => "",
    };
    match (named, key.strip_prefix("Ctrl-").and_then(|letter| letter.bytes().next())) {
        ("", Some(letter)) => char::from(letter & 0x1f).to_string(),
        ("", None) => key.to_owned(),
        (named, _) => named.to_owned(),
    }
}

fn play(session: &mut Session, rows: &[Row]) {
    for row in rows {
        let name = row.action.info().name;
        let (before, bytes) = (session.screen(), session.bytes());
        session.send(&typed(row.key));
        match row.seen {
            Shows(text) => {
                assert!(!before.contains(text), "{name}: `{text}` was there before {}:\n{before}", row.key);
                session.wait_for(&[text]);
            }
            Hides(text) => {
                assert!(before.contains(text), "{name}: `{text}` was not there before {}:\n{before}", row.key);
                session.wait_until(&format!("{name} hides `{text}`"), || !session.screen().contains(text));
            }
            Changes => session.wait_until(&format!("{name} changes the screen"), || session.screen() != before),
            Sends(wanted) => {
                session.wait_until(&format!("{name} sends its bytes"), || session.sent_after(bytes, wanted));
            }
        }
        if row.action == Action::Approve {
            // The second press counts after 1 s at the earliest.
            std::thread::sleep(Duration::from_millis(1000));
        }
        let (keys, text) = row.after;
        for key in keys.split_inclusive(|_: char| !keys.contains('\x1b')) {
            session.send(key);
            std::thread::sleep(Duration::from_millis(50));
        }
        if !text.is_empty() {
            session.wait_for(&[text]);
        }
    }
}

#[test]
fn every_key_of_the_keymap_has_a_row() {
    let keymap = ConsoleSettings::built_in().keymap;
    let wanted: BTreeSet<(&str, String)> =
        ACTIONS.iter().flat_map(|info| keymap.keys(info.action).map(|key| (info.name, key.to_string()))).collect();
    let rows: BTreeSet<(&str, String)> =
        LIVE.iter().chain(REPLAY).map(|row| (row.action.info().name, row.key.to_owned())).collect();
    assert_eq!(wanted.difference(&rows).collect::<Vec<_>>(), Vec::<&(&str, String)>::new(), "keys without a row");
    assert_eq!(rows.difference(&wanted).collect::<Vec<_>>(), Vec::<&(&str, String)>::new(), "rows without a key");
}

#[test]
fn every_key_of_a_live_session_is_seen() {
    let (_folder, mut session) = Session::opened((120, 40), &["--trials", "1", "--seed", "3"]);
    play(&mut session, LIVE);
    assert!(session.wait().success());
    assert!(session.restored() && session.cooked());
}

#[test]
fn every_key_of_a_replay_is_seen() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.arg("replay");
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/console/session.mcap"));
    let mut session = Session::run(folder.path(), (120, 40), command);
    session.wait_for(&["p pauses"]);
    play(&mut session, REPLAY);
    let exported = std::fs::read_to_string(folder.path().join("trials-replay.csv")).expect("the exported table");
    assert_eq!(exported.lines().count(), 4, "{exported}");
    session.send("q");
    assert!(session.wait().success());
}

/// Regression: the table that a replay wrote replaced that of the session, with the verdicts up to the playhead.
#[test]
fn a_replay_exports_the_table_of_its_end_and_leaves_that_of_the_session() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("trials.csv"), "of the session").expect("written");
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.arg("replay");
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/console/session.mcap"));
    let mut session = Session::run(folder.path(), (120, 40), command);
    session.wait_for(&["p pauses"]);
    let file = folder.path().join("trials-replay.csv");
    session.send("p2");
    session.wait_for(&["paused"]);
    let tables = [("G#1\r", "1 after the playhead"), (")", "1 void")].map(|(place, shown)| {
        session.send(place);
        session.wait_for(&[shown]);
        session.send("e");
        session.wait_for(&["written: all 3 trials"]);
        let table = std::fs::read_to_string(&file).expect("the exported table");
        std::fs::remove_file(&file).expect("removed");
        table
    });
    assert_eq!(tables[0], tables[1]);
    assert!(
        tables[0].lines().skip(1).all(|line| line.contains(",accept,") || line.contains(",fall,")),
        "{}",
        tables[0]
    );
    assert_eq!(std::fs::read_to_string(folder.path().join("trials.csv")).expect("read"), "of the session");
    session.send("q");
    assert!(session.wait().success());
}
