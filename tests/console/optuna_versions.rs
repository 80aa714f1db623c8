//! Journals and tables of Optuna 4 and Optuna 5, on the running program. Optuna 4 is expected in `target/optuna-4`
//! (`pip install --no-deps --target target/optuna-4 optuna==4.9.0`), Optuna 5 in Python itself; `.ci/run` installs both. A
//! test is skipped with a message where one of them, pandas, pyarrow or plotly is missing.

use std::path::Path;
use std::process::Command;

use crate::program::{Program, assert_shows};
use crate::skip::skip;
use serde_json::{Value, json};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
/// A zone without UTC: a local time that is taken for UTC is seen.
const ZONE: &str = "Asia/Kolkata";

/// Python with an Optuna.
#[derive(Clone, Copy, PartialEq)]
enum Optuna {
    Four,
    Five,
}

impl Optuna {
    fn python(self) -> Command {
        let mut command = Command::new("python3");
        command.env("TZ", ZONE);
        if self == Optuna::Four {
            command.env("PYTHONPATH", Path::new(ROOT).join("target/optuna-4"));
        }
        command
    }

    fn is_there(self) -> bool {
        let version = if self == Optuna::Four { "4." } else { "5." };
        let check = format!(
            "import optuna, pandas, pyarrow, plotly, sqlalchemy; assert optuna.__version__.startswith('{version}')"
        );
        let found = self.python().args(["-c", &check]).output().is_ok_and(|output| output.status.success());
        if !found {
            skip(&format!("python3 has no Optuna {version}x with pandas, pyarrow, plotly and sqlalchemy"));
        }
        found
    }

    /// Runs a command of the script in the program's folder; returns its output.
    #[track_caller]
    fn run(self, program: &Program, arguments: &[&str]) -> Value {
        let script = Path::new(ROOT).join("tests/support/optuna_versions.py");
        let output = self.python().arg(script).args(arguments).current_dir(program.path("")).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap_or_default()
    }
}

fn both() -> bool {
    Optuna::Four.is_there() && Optuna::Five.is_there()
}

/// The program's output in the zone of the journals.
#[track_caller]
fn text(program: &Program, arguments: &[&str]) -> String {
    let output = program.command(arguments).env("TZ", ZONE).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Start and end of each trial in an exported table, us since 1970.
fn exported_times(program: &Program, study: &str) -> Vec<[Option<i64>; 2]> {
    let rows: Vec<Value> =
        serde_json::from_str(&text(program, &["study", "export", study, "--format", "json"])).unwrap();
    let us = |cell: &Value| Some(cell.as_str()?.parse::<jiff::Timestamp>().unwrap().as_microsecond());
    rows.iter().map(|row| [us(&row["datetime_start"]), us(&row["datetime_complete"])]).collect()
}

fn times(theirs: &Value) -> Vec<[Option<i64>; 2]> {
    let trials = theirs["trials"].as_array().unwrap().iter();
    trials.map(|trial| [trial[0].as_i64(), trial[1].as_i64()]).collect()
}

/// Regression: every command refused the journal: "failed to find offset component".
#[test]
fn a_journal_of_optuna_4_is_read_and_its_times_are_local() {
    if !both() {
        return;
    }
    let program = Program::new();
    Optuna::Four.run(&program, &["create", "four.log", "maximize"]);
    let journal = std::fs::read_to_string(program.path("four.log")).unwrap();
    assert!(!journal.contains("+00:00"), "Optuna 4 writes no offset: {journal}");
    let theirs = Optuna::Four.run(&program, &["times", "four.log"]);
    assert_eq!(exported_times(&program, "four.log"), times(&theirs));
    assert_eq!(times(&Optuna::Five.run(&program, &["times", "four.log"])), times(&theirs));
    // Optuna 5 continues it: a journal of both forms.
    Optuna::Five.run(&program, &["more", "four.log", "2"]);
    assert!(std::fs::read_to_string(program.path("four.log")).unwrap().contains("+00:00"));
    let theirs = Optuna::Five.run(&program, &["times", "four.log"]);
    assert_eq!(exported_times(&program, "four.log"), times(&theirs));
    assert_shows(&text(&program, &["study", "show", "four.log"]), &["theirs", "kind", "complete"]);
}

#[test]
fn what_we_write_into_a_journal_of_optuna_4_does_not_break_optuna_4() {
    if !both() {
        return;
    }
    let program = Program::new();
    Optuna::Four.run(&program, &["floats", "four.log"]);
    program.write(
        "points.csv",
        "params_x,params_y,value,datetime_start,datetime_complete,state\n\
        1.5,0.5,3.25,2026-07-01T10:00:00Z,2026-07-01T10:00:03.5Z,COMPLETE\n",
    );
    assert_shows(&text(&program, &["study", "import", "four.log", "points.csv"]), &["1 trial"]);
    text(&program, &["study", "enqueue", "four.log", "x=2", "y=0.25"]);
    for optuna in [Optuna::Four, Optuna::Five] {
        let theirs = optuna.run(&program, &["times", "four.log"]);
        assert_eq!(theirs["timeline"], true, "{theirs}");
        let [start, end] = times(&theirs)[5];
        assert_eq!((start, end), (Some(1_782_900_000_000_000), Some(1_782_900_003_500_000)));
        assert_eq!((&theirs["trials"][5][2], &theirs["trials"][6][3]), (&json!(3.25), &json!("WAITING")));
    }
    assert!(!std::fs::read_to_string(program.path("four.log")).unwrap().contains("+00:00"));
}

/// A study of ours, continued by Optuna 4, is readable for all; Optuna 4 draws no timeline of the two forms of times.
#[test]
fn a_study_of_ours_that_optuna_4_continues_goes_on() {
    if !both() {
        return;
    }
    let program = Program::new();
    text(&program, &["optimize", "--trials", "3", "--record", "none"]);
    let study = program.study("recordings");
    let (folder, journal) = (study.to_str().unwrap(), study.join("study.log"));
    let journal = journal.to_str().unwrap();
    assert_eq!(Optuna::Four.run(&program, &["times", journal])["timeline"], true);
    Optuna::Four.run(&program, &["more", journal, "1"]);
    let mixed = Optuna::Four.run(&program, &["times", journal]);
    assert_eq!(mixed["timeline"], false, "Optuna 4 compares times of both forms: change docs/journal.md");
    text(&program, &["optimize", "--resume", folder, "--trials", "6", "--record", "none"]);
    let theirs = Optuna::Five.run(&program, &["times", journal]);
    assert_eq!(theirs["timeline"], true);
    assert_eq!(theirs["trials"].as_array().unwrap().len(), 6);
    assert_eq!(exported_times(&program, folder), times(&theirs));
    let show = text(&program, &["study", "show", folder]);
    let line = show.lines().find(|line| line.trim_start().trim_start_matches('*').starts_with("3 ")).unwrap();
    assert!(line.ends_with("other program  complete"), "{show}");
    assert!(!show.contains("queued"), "{show}");
}

#[test]
fn an_exported_table_equals_trials_dataframe() {
    if !both() {
        return;
    }
    for optuna in [Optuna::Four, Optuna::Five] {
        let program = Program::new();
        optuna.run(&program, &["create", "theirs.log", "maximize"]);
        text(&program, &["optimize", "--trials", "4", "--record", "none"]);
        let ours = program.study("recordings").join("study.log");
        for journal in ["theirs.log", ours.to_str().unwrap()] {
            for file in ["table.csv", "table.json", "table.parquet"] {
                text(&program, &["study", "export", journal, "--output", file]);
            }
            let found = optuna.run(&program, &["compare", journal, "table.csv", "table.json", "table.parquet"]);
            let columns = found["columns"].as_array().unwrap();
            let value = if journal == "theirs.log" { "value_height (m)" } else { "value_J_forward (m)" };
            assert!(columns.contains(&json!(value)) && columns.contains(&json!("duration")), "{found}");
        }
    }
}

#[test]
fn a_foreign_study_has_its_own_table_and_the_best_of_a_minimized_one_is_the_smallest() {
    if !Optuna::Five.is_there() {
        return;
    }
    let program = Program::new();
    Optuna::Five.run(&program, &["floats", "floats.log"]);
    let values: Vec<f64> =
        program.exported("floats.log").iter().map(|trial| trial["value"].as_f64().unwrap()).collect();
    let best = (0..values.len()).min_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap();
    assert_ne!(best, 0);
    let report = text(&program, &["report", "floats.log"]);
    assert_shows(&report, &["complete, best", "other program"]);
    assert!(!report.contains("queued"), "{report}");
    let show = text(&program, &["study", "show", "floats.log"]);
    assert!(!show.contains("queued") && !show.contains("accept"), "{show}");
    assert_eq!(show.matches('*').count(), 1, "{show}");
    assert_shows(&show, &[&format!("*{best} "), &format!("Best: trial {best} ")]);

    // Choices and whole numbers are shown as what they are.
    Optuna::Five.run(&program, &["create", "mixed.log", "minimize"]);
    let show = text(&program, &["study", "show", "mixed.log"]);
    assert_shows(&show, &["trial", "kind", "steps", "soft", "hard", "pruned", "waiting"]);
    Optuna::Five.run(&program, &["choices", "choices.log"]);
    assert_shows(
        &program.refused(&["study", "show", "choices.log"]),
        &["none of its parameters is a real number", "kind"],
    );
}

#[test]
fn an_sqlite_storage_is_named_with_the_command_that_converts_it() {
    if !Optuna::Five.is_there() {
        return;
    }
    let program = Program::new();
    Optuna::Five.run(&program, &["sqlite", "studies.db"]);
    for place in ["studies.db", "sqlite:///studies.db"] {
        let message = program.refused(&["study", "show", place]);
        assert_shows(&message, &["studies.db is an SQLite database", "optuna.copy_study"]);
        assert!(!message.contains("UTF-8") && !message.contains("repair"), "{message}");
    }
    // The command works as printed.
    let message = program.refused(&["study", "show", "studies.db"]);
    let command = &message[message.find("python3").unwrap()..];
    let done = Command::new("sh").args(["-c", command]).current_dir(program.path("")).output().unwrap();
    assert!(done.status.success(), "{command}: {}", String::from_utf8_lossy(&done.stderr));
    assert_shows(&program.text(&["study", "show", "study.log"]), &["in-sqlite", "complete"]);
}

#[test]
fn a_table_is_never_of_another_format_than_its_name_says() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "none"]);
    let study = program.study("recordings").to_str().unwrap().to_owned();
    let export = |more: &[&'static str]| [&["study", "export", study.as_str()], more].concat();
    let refused = program.refused(&export(&["--output", "t.parquet", "--format", "csv"]));
    assert_shows(&refused, &["--format csv", "t.parquet", "another name"]);
    assert_shows(&program.refused(&export(&["--output", "t.txt"])), &["t.txt", ".parquet", "--format"]);
    assert_shows(&program.refused(&export(&["--format", "parquet"])), &["--output"]);
    program.text(&export(&["--output", "t.txt", "--format", "json"]));
    program.text(&export(&["--output", "t.PARQUET"]));
    assert!(std::fs::read(program.path("t.PARQUET")).unwrap().starts_with(b"PAR1"));
    assert!(std::fs::read_to_string(program.path("t.txt")).unwrap().starts_with('['));
    let refused = program.refused(&["study", "import", &study, "t.PARQUET"]);
    assert_shows(&refused, &["Parquet", "to_csv"]);
    // An error leaves no beginning of a table.
    let output = program.run(&export(&["--output", "/dev/full", "--format", "csv"]));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && message.contains("No space left on device"), "{message}");
}
