//! Trials judged again by another configuration in `quadfrog replay`, on files that the program itself wrote.

use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;

use crate::program::{Program, assert_shows};
use crate::pty::Session;
use portable_pty::CommandBuilder;
use serde_json::Value;

/// A study of six trials, every tick recorded, and two configurations: a strict limit of a fall, and a rate as objective.
fn recorded() -> &'static (Program, PathBuf) {
    static STUDY: OnceLock<(Program, PathBuf)> = OnceLock::new();
    STUDY.get_or_init(|| {
        let program = Program::new();
        program.text(&["optimize", "--trials", "6", "--seed", "0", "--record", "all"]);
        program.write("strict/safety.toml", "[fall]\nroll_rad = 0.2\npitch_rad = 0.2\n");
        program.write("rate/control.toml", "[tasks.forward]\nrate = true\n");
        let file = program.study("recordings").join("session.mcap");
        (program, file)
    })
}

/// The replay of the study in its folder, paused at its end, in view Trials.
fn trials(size: (u16, u16), arguments: &[&str]) -> Session {
    let (program, file) = recorded();
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["replay", file.to_str().unwrap()]);
    command.args(arguments);
    let mut session = Session::run(&program.path(""), size, command);
    session.wait_for(&["REPLAY"]);
    session.send("p)2");
    session.wait_for(&["paused", "verdict"]);
    session
}

/// Output of `quadfrog rejudge`.
fn expected(config: &str) -> Vec<Value> {
    let (program, file) = recorded();
    program.trials(&["rejudge", file.to_str().unwrap(), "--config", config, "--json"])
}

/// The row of a trial in the table.
fn row(session: &Session, trial: u64) -> String {
    let of_trial =
        |line: &&str| line.trim_start_matches(['>', ' ']).split([' ', '+', '~']).next() == Some(&trial.to_string());
    let screen = session.screen();
    screen.lines().skip(4).find(of_trial).unwrap_or_else(|| panic!("no row {trial}:\n{screen}")).to_owned()
}

/// Every row of the screen shows the old and the new judgement of `quadfrog rejudge`.
#[track_caller]
fn assert_rows(session: &Session, rows: &[Value]) {
    for expected in rows {
        let row = row(session, expected["trial"].as_u64().unwrap());
        let (old, new) = (&expected["old"], &expected["new"]);
        let verdict = new["verdict"].as_str();
        let value = match verdict {
            Some("fall") => "0.000".to_owned(),
            Some(_) => format!("{:.3}", new["value"].as_f64().unwrap()),
            None => "-".to_owned(),
        };
        let sign = match verdict {
            Some("accept") => "o accept",
            Some("fall") => "x fall",
            _ => "? open",
        };
        let change = if old["verdict"] == new["verdict"] { "" } else { " !" };
        // Old verdict, new value, new verdict, from left to right.
        let at = row.find(old["verdict"].as_str().unwrap()).unwrap_or_else(|| panic!("{row}"));
        let new_at = row[at..].find(&format!(" {value} {sign}{change}"));
        assert!(new_at.is_some(), "no {value} {sign}{change} after the old verdict: {row}");
    }
}

#[test]
fn the_new_judgements_stand_beside_the_recorded_ones_and_the_file_stays() {
    let (_, file) = recorded();
    let before = fs::read(file).unwrap();
    let rows = expected("strict");
    // Regression: trials of the same suggestion, of which the cause or J alone changes, were counted among the changed ones.
    let changes = |row: &&Value| row["old"]["verdict"] != row["new"]["verdict"];
    let differs = |row: &&Value| row["old"]["cause"] != row["new"]["cause"] || row["difference"] != 0.0;
    let changed = rows.iter().filter(changes).count();
    let others = rows.iter().filter(differs).count() - changed;
    assert!(changed >= 1 && others >= 1, "{changed}, {others} change");
    for size in [(80, 24), (120, 40)] {
        let mut session = trials(size, &["--rejudge", "strict"]);
        let others = if size.0 >= 120 { format!(", of {others} others J or the cause") } else { String::new() };
        session.wait_for(&[&format!("{changed} of 6 suggestions change{others}")]);
        session.wait_for(&["new m"]);
        assert_rows(&session, &rows);
        // Without them: the table as before.
        session.send("J");
        session.wait_until("they are removed", || !session.screen().contains("new m"));
        session.send("q");
        assert!(session.wait().success());
    }
    assert_eq!(fs::read(file).unwrap(), before, "the file is not changed");
}

#[test]
fn a_key_takes_the_folder_of_a_configuration() {
    let mut session = trials((120, 40), &[]);
    session.send("J");
    session.wait_for(&["Judge all trials again", "empty: the defaults"]);
    session.send("rate\r");
    session.wait_for(&["new m/s", " of 6 suggestions change"]);
    assert_rows(&session, &expected("rate"));
    // The details name cause and measured values of both.
    session.send("\x1b[H\r");
    session.wait_for(&["00:0"]);
    session.send("\r");
    session.wait_for(&["judged again", "; measured 0."]);
    session.send("\x1b");
    session.wait_until("closed", || !session.screen().contains("; measured 0."));
    session.send("J");
    session.wait_until("removed", || !session.screen().contains("new m/s"));
    // The defaults are those of the recording: nothing changes.
    session.send("J\r");
    session.wait_for(&["the defaults: 0 of 6 suggestions change"]);
    session.send("JJmissing\r");
    // The field opens again with the folder that was refused.
    session.wait_for(&["Judge all trials again", "not judged again: missing: no such configuration folder"]);
    session.send(&format!("{}rate\r", "\x7f".repeat("missing".len())));
    session.wait_for(&["new m/s", " of 6 suggestions change"]);
    session.send("q");
    assert!(session.wait().success());
}

#[test]
fn a_configuration_that_cannot_be_used_is_refused_before_the_screen_opens() {
    let (program, file) = recorded();
    let file = file.to_str().unwrap();
    program.write("wrong/safety.toml", "[fall]\nroll = 0.2\n");
    for (folder, part) in [("missing", "missing"), ("wrong", "roll")] {
        assert_shows(&program.refused(&["replay", file, "--rejudge", folder]), &[part]);
    }
}
