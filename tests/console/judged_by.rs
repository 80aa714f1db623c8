//! The running program: the origin of a verdict on the screen and in all files of a study.

use std::collections::BTreeMap;
use std::path::Path;

use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::Record;
use quadfrog::recording::session_files::recordings_in;
use quadfrog::trial::{JudgedBy, TrialRecord, Verdict};
use quadfrog_console::settings::{ConsoleSettings, DEFAULT};
use quadfrog_console::theme::{Colours, Glyphs, Theme};
use serde_json::Value;

use crate::program::Program;
use crate::pty::Session;
use crate::support::{Console, assert_shows, line_with, trial};

/// The origins of verdicts in the newest recorded row of each trial.
fn recorded(study: &Path) -> BTreeMap<u32, Option<JudgedBy>> {
    let players = recordings_in(study).into_iter().flat_map(|file| Player::open(file).unwrap());
    let row = |played| match played {
        Played::Record(played) => match played.record {
            Record::Trial(row) => Some((row.trial, row.judged_by)),
            _ => None,
        },
        Played::Tick(_) => None,
    };
    players.filter_map(row).collect()
}

/// The column `judged_by` of `trials.csv`, by the numbers of the trials: no column before it holds a comma.
fn column(table: &str) -> BTreeMap<u32, String> {
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let at = header.iter().position(|column| *column == "judged_by").unwrap();
    lines.map(|row| (row[0].parse().unwrap(), row[at].to_owned())).collect()
}

#[test]
fn rule_and_operator_are_on_the_screen_and_in_all_files() {
    let program = Program::new();
    let automatic = ["--seed", "3", "--approve", "auto", "--trials", "2"];
    let mut session = Session::start(&program.path(""), (160, 40), &automatic);
    session.wait_for_long("the end of the study", || session.screen().contains("The study is finished"));
    session.send("2");
    session.wait_for(&["judged by", "rule"]);
    session.send("\x1b[H\r");
    session.wait_for(&["Trial #0", "by a rule of the program"]);
    session.send("\x1b");
    session.wait_until("the details are closed", || !session.screen().contains("by a rule of the program"));
    // The verdict of the first trial is final.
    session.send("v");
    session.wait_for(&["becomes void. Why?"]);
    session.send("the mat slid\r");
    session.wait_for(&["changed by the operator", "operator"]);
    assert!(session.quit().success());
    let below = std::fs::read_dir(program.path("")).unwrap().map(|entry| entry.unwrap().path());
    let study = below.into_iter().find(|path| path.join("study.log").exists()).expect("a study");
    let (operator, rule) = (JudgedBy::Operator, JudgedBy::Rule);
    assert_eq!(recorded(&study), [(0, Some(operator)), (1, Some(rule))].into());

    let place = study.to_str().unwrap();
    let mut session = Session::start(&program.path(""), (160, 40), &["--resume", place, "--trials", "3"]);
    session.wait_for(&["Press A to arm"]);
    session.send("2");
    session.wait_for(&["judged by", "operator", "rule"]);
    session.send("1A");
    session.wait_for(&["Press g twice"]);
    session.approve();
    session.wait_for(&["Trial #2: judge it"]);
    session.send("a");
    session.wait_for(&["accept: trial 2; u takes it back until the next trial"]);
    session.send("u");
    session.wait_for(&["the verdict of trial 2 is taken back"]);
    session.send("a");
    session.wait_for(&["accept: trial 2; u takes it back until the next trial"]);
    session.send("2e");
    session.wait_for(&["written: all"]);
    assert!(session.quit().success());

    let expected = [(0, "operator"), (1, "rule"), (2, "operator")];
    let expected: BTreeMap<u32, String> = expected.map(|(trial, by)| (trial, by.to_owned())).into();
    assert_eq!(column(&std::fs::read_to_string(study.join("trials.csv")).unwrap()), expected);
    let of_row = |row: &Value| {
        let by = row["user_attrs"]["judged_by"].as_str().unwrap_or_default();
        (row["number"].as_u64().unwrap() as u32, by.to_owned())
    };
    let exported: BTreeMap<u32, String> = program.exported(place).iter().map(of_row).collect();
    assert_eq!(exported, expected, "the table of the journal");
    assert_eq!(recorded(&study)[&2], Some(operator));
    let shown = program.text(&["study", "show", place]);
    assert_shows(&shown, &["\nJudged by the operator: trials 0, 2; by a rule of the program: trial 1\n"]);
    let report = program.text(&["report", place]);
    for (trial, verdict, by) in [(0, "void", "operator"), (1, "accept, best", "rule"), (2, "accept", "operator")] {
        let row = format!("{trial:>5}  {verdict:<12}  {by:<8}  sampler");
        assert!(report.contains(&row), "no `{row}`:\n{report}");
    }
}

fn judged(number: u32, judged_by: Option<JudgedBy>) -> TrialRecord {
    TrialRecord { judged_by, ..trial(number, Some(Verdict::Accept), Some(Verdict::Accept)) }
}

#[test]
fn the_column_of_the_origin_gives_way_to_the_cause() {
    let mut console = Console::ready();
    for (number, by) in [(0, Some(JudgedBy::Rule)), (1, Some(JudgedBy::Operator)), (2, None)] {
        console.record(Record::Trial(judged(number, by)));
    }
    console.press(&["2"]);
    let wide = console.screen(140, 30);
    assert_shows(&wide, &["judged by source", "note | cause"]);
    let line = |number: u32| line_with(&wide, &format!(" {number}  "));
    assert!(line(0).contains("rule") && line(1).contains("operator"), "{wide}");
    assert!(!line(2).contains("rule") && !line(2).contains("operator"), "an earlier version");
    let mut earlier = Console::ready();
    earlier.press(&["2"]);
    assert_shows(&earlier.screen(140, 30), &["judged by"]);
    earlier.record(Record::Trial(judged(0, None)));
    assert!(!earlier.screen(140, 30).contains("judged by"), "a study of an earlier version");
    let narrow = console.screen(80, 24);
    assert!(!narrow.contains("judged by") && narrow.contains("note | cause"), "{narrow}");
    // Without the column of the cause it has room.
    let mut table: toml::Table = DEFAULT.parse().expect("the defaults");
    table.insert("trial_columns".into(), vec!["parameters", "value", "verdict", "judged_by", "source"].into());
    let settings = ConsoleSettings::from_table(&table).expect("columns that exist");
    let mut console = Console::with(settings, Theme::new(Colours::None, Glyphs::Ascii));
    console.record(Record::Trial(judged(0, Some(JudgedBy::Rule))));
    console.press(&["2"]);
    assert_shows(&console.screen(80, 24), &["judged by", "rule"]);
}

#[test]
fn the_details_name_the_origin_unless_the_cause_does() {
    let details = |row: TrialRecord| {
        let mut console = Console::ready();
        console.record(Record::Trial(row));
        console.press(&["2", "Home", "Enter"]);
        line_with(&console.screen(120, 40), " verdict   ")
    };
    assert!(details(judged(0, Some(JudgedBy::Rule))).contains("accept, by a rule of the program"));
    assert!(details(judged(0, Some(JudgedBy::Operator))).contains("accept, by the operator"));
    assert!(!details(judged(0, None)).contains(", by"));
    let cause = "it slid; changed by the operator, was fall; landed and settled".to_owned();
    let changed = details(TrialRecord { cause, ..judged(0, Some(JudgedBy::Operator)) });
    assert!(!changed.contains(", by"), "{changed}");
}
