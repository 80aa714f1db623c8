//! Values that an operator has set in place of proposed ones: they outlive the session, in the journal.

use std::fs;

use crate::program::{Program, assert_shows};
use crate::pty::Session;
use crate::support::{Console, trial};
use quadfrog::recording::record::Record;
use quadfrog::trial::{TrialRecord, Verdict};

/// Regressions: a session that continued a study did not show the changed values of the sessions before, and `study show` had
/// neither the proposed values nor the number of such trials.
#[test]
fn a_later_session_and_the_table_of_a_study_show_the_proposed_values() {
    let program = Program::new();
    let folder = program.path("recordings");
    fs::create_dir(&folder).unwrap();
    let mut session = Session::start(&folder, (100, 30), &[]);
    session.wait_for(&["Press A to arm"]);
    session.send("o");
    session.wait_for(&["Override trial"]);
    session.send("\x1b[B88\r");
    session.wait_for(&["Trial #0 (operator)"]);
    session.send("A");
    session.wait_for(&["Press g twice to jump"]);
    session.approve();
    session.wait_for_long("a verdict is asked for", || session.screen().contains("Judge it"));
    session.send("a");
    session.wait_for(&["Press g twice to jump"]);
    session.quit();
    let study = program.study("recordings");
    let place = study.to_str().unwrap();
    // The journal alone has them.
    fs::remove_file(study.join("session.mcap")).unwrap();
    let shown = program.text(&["study", "show", place]);
    assert_shows(
        &shown,
        &[
            "1 trial with parameters or gains that an operator has set, 0 re-runs",
            "Trial 0 ran with Fx 88.00 N, proposed ",
        ],
    );
    let report = program.text(&["report", place]);
    assert_shows(
        &report,
        &["1 trial with parameters or gains that an operator has set", "Values that an operator has set in place"],
    );
    let mut session = Session::start(&folder, (100, 30), &["--resume", place]);
    session.wait_for(&["Press A to arm"]);
    session.send("2");
    session.wait_for(&["Enter open"]);
    session.send("\r");
    session.wait_for(&["88.00000 N, overridden; proposed "]);
    // Enter closes the details.
    session.send("\r");
    session.quit();
}

/// Regression: an observer and a replay that began after the proposal did not show it either.
#[test]
fn the_details_of_a_trial_show_the_proposed_values_of_its_row() {
    let mut console = Console::ready();
    let row = trial(0, Some(Verdict::Accept), None);
    console.record(Record::Trial(TrialRecord { proposed: vec![("Fx".to_owned(), 61.5)].into(), ..row }));
    console.press(&["2", "Home", "Enter"]);
    assert_shows(&console.screen(80, 24), &["75.00000 N, overridden; proposed 61.50"]);
}
