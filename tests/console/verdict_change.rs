//! The running program: a verdict that has become final is changed, and the files that the session leaves hold both.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::pty::Session;

/// Output of `quadfrog` with these arguments.
fn quadfrog(folder: &Path, arguments: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_quadfrog")).args(arguments).current_dir(folder).output().expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The folder of the only study there.
fn study_in(folder: &Path) -> PathBuf {
    let mut below = std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path());
    below.find(|path| path.join("study.log").exists()).expect("a study")
}

/// A session in `folder` whose trial 0 waits for its verdict.
fn jumped(folder: &Path) -> Session {
    let mut session = Session::start(folder, (120, 40), &["--seed", "3"]);
    session.wait_for(&["Press A to arm"]);
    session.send("A");
    session.wait_for(&["Press g twice"]);
    session.approve();
    session.wait_for(&["Trial #0: judge it", "TRIAL #0"]);
    session
}

#[test]
fn a_changed_verdict_is_in_the_table_the_journal_and_the_exports() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = jumped(folder.path());
    session.send("a");
    session.wait_for(&["Trial #1"]);
    session.send("2");
    session.send("f");
    session.wait_for(&["the verdict of trial 0 is the last one: u takes it back"]);
    // The verdict becomes final with the next decision.
    session.send("n");
    session.wait_for(&["Skip the proposal?"]);
    session.send("y");
    session.wait_for(&["skipped; a new proposal follows"]);
    session.send("\x1b[H");
    session.send("f");
    session.wait_for(&["Trial #0: accept becomes fall. Why?"]);
    session.send("it lay on its back\r");
    session.wait_for(&["change the verdict of trial 0 to fall", "it was accept; the journal keeps both"]);
    session.wait_for(&["changed by the operator, was accept"]);
    // The table shows one of two trials: the export asks.
    session.send("F");
    session.send("F");
    session.wait_for(&["only fall"]);
    session.send("e");
    session.wait_for(&["The table shows 1 of 2 trials"]);
    session.send("s");
    session.wait_for(&["written: 1 of 2 trials, 1 left out"]);
    session.send("e");
    session.wait_for(&["The table shows 1 of 2 trials"]);
    session.send("a");
    session.wait_for(&["written: all 2 trials"]);
    assert!(session.quit().success());

    let study = study_in(folder.path());
    let table = std::fs::read_to_string(study.join("trials.csv")).expect("trials.csv");
    let row = table.lines().nth(1).expect("trial 0");
    assert!(
        row.contains(",fall,") && row.contains("it lay on its back; changed by the operator, was accept"),
        "{table}"
    );
    let journal = std::fs::read_to_string(study.join("study.log")).expect("the journal");
    let change = journal.lines().find(|line| line.contains("verdict:0")).expect("the change");
    for part in ["\"old_verdict\"", "\"accept\"", "it lay on its back", "\"old_value\""] {
        assert!(change.contains(part), "no {part} in {change}");
    }
    let exported = quadfrog(folder.path(), &["study", "export", study.to_str().expect("a path")]);
    let row = exported.lines().find(|line| line.contains("it lay on its back"));
    assert!(row.is_some_and(|row| row.contains("fall")), "{exported}");
    // Regression: the recorded suggestion was called the old verdict.
    let judged_again = quadfrog(folder.path(), &["rejudge", study.to_str().expect("a path")]);
    let columns: Vec<&str> = judged_again.lines().nth(1).expect("trial 0").split_whitespace().collect();
    assert_eq!((columns[1], columns[3], columns[5]), ("fall", "accept", "accept"), "{judged_again}");
    assert!(judged_again.contains("0 of 1 suggestions change"), "{judged_again}");
}

/// Regression: a session that ended in the review made the measured jump void, and the value by hand was lost with it.
#[test]
fn a_trial_that_waits_for_its_verdict_waits_until_the_study_is_continued() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = jumped(folder.path());
    session.send("=");
    session.wait_for(&["displacement forward, start to rest; the robot measured"]);
    session.send("0.4\r");
    session.wait_for(&["0.4 m counts instead of the measured value"]);
    session.send("q");
    session.wait_for(&["It keeps its measurement and waits"]);
    session.send("y");
    assert!(session.wait().success());

    let study = study_in(folder.path());
    let arguments = ["--resume", study.to_str().expect("a name")];
    let mut session = Session::start(folder.path(), (120, 40), &arguments);
    session.wait_for(&["Trial #0: judge it", "0.400 m by hand", "Judge it: a accept (suggested)"]);
    session.wait_for(&["trial 0 had no verdict at the end of the last session"]);
    // Killed, it still waits.
    session.signal(nix::sys::signal::Signal::SIGKILL);
    session.wait();
    let mut session = Session::start(folder.path(), (120, 40), &arguments);
    session.wait_for(&["Trial #0: judge it", "0.400 m by hand"]);
    session.send("a");
    session.wait_for(&["1 of 20 count", "best 0.400 m by hand (#0)", "accept: trial 0; u takes it back"]);
    assert!(session.quit().success());

    let study = study.to_str().expect("a name");
    let shown = quadfrog(folder.path(), &["study", "show", study]);
    assert!(shown.contains("accept, J by hand"), "{shown}");
    let report = quadfrog(folder.path(), &["report", study]);
    assert!(report.contains("accept, J by hand, best"), "{report}");
    // Regression: the tables of the studies and of their best trials showed a value by hand as a measured one.
    assert_eq!(report.matches("0.400 h").count(), 3, "{report}");
    assert_eq!(
        report.split_whitespace().collect::<Vec<_>>().join(" ").matches("h: measured by hand.").count(),
        3,
        "{report}"
    );
}

/// Regression: an accepted re-run was the best of its session alone as long as `u` could take the verdict back, and a trial in which
/// the program was killed ran for ever.
#[test]
fn readers_of_a_study_see_its_best_trial_at_once_and_that_its_session_was_killed() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = jumped(folder.path());
    session.send("r");
    session.wait_for(&["Trial #1 (", "Press g twice"]);
    session.approve();
    session.wait_for(&["Trial #1: judge it", "TRIAL #1"]);
    session.send("=");
    session.wait_for(&["displacement forward, start to rest; the robot measured"]);
    session.send("0.7\r");
    session.wait_for(&["0.7 m counts instead of the measured value"]);
    session.send("a");
    session.wait_for(&["best 0.700 m by hand (#1)", "Press g twice"]);
    let study = study_in(folder.path());
    let study = study.to_str().expect("a name");
    let best = |words: &[&str]| quadfrog(folder.path(), &[words, &[study]].concat());
    for (words, expected) in [(["study", "best"], "Best: trial 1 "), (["study", "show"], "*1 ")] {
        let shown = best(&words);
        assert!(shown.contains(expected), "{words:?}: {shown}");
    }
    assert!(best(&["report"]).contains("0.700 h"), "{}", best(&["report"]));

    session.approve();
    session.wait_until("the jump", || session.screen().starts_with(" JUMP"));
    assert!(best(&["study", "show"]).contains("1 running, 0 queued"), "{}", best(&["study", "show"]));
    session.signal(nix::sys::signal::Signal::SIGKILL);
    session.wait();
    let shown = best(&["study", "show"]);
    assert!(shown.contains("Trial 2 was interrupted: its session ended within it"), "{shown}");
    assert!(!shown.contains("running"), "{shown}");
}

/// Regression: under automatic approval an edit in the table of a finished study made the robot arm itself and jump.
#[test]
fn a_changed_verdict_of_a_finished_study_moves_no_robot() {
    let folder = tempfile::tempdir().expect("a folder");
    quadfrog(folder.path(), &["optimize", "--trials", "3", "--seed", "0", "--output", "studies"]);
    let study = study_in(&folder.path().join("studies"));
    let arguments = ["--resume", study.to_str().expect("a path"), "--approve", "auto"];
    let mut session = Session::start(folder.path(), (120, 40), &arguments);
    session.wait_for(&["The study is finished.", "3 of 3 counted"]);
    session.send("2\x1b[Hv");
    session.wait_for(&["becomes void. Why?", "has room for a further trial, which waits for A"]);
    session.send("slipped\r");
    let words = |session: &Session| session.screen().split_whitespace().collect::<Vec<_>>().join(" ");
    session.wait_until("the answer", || words(&session).contains("the study has room again: trial 3 waits for you"));
    session.wait_for(&["DISARMED", "2 of 3 counted", "Press A to arm"]);
    // The rule goes on with the operator's key.
    session.send("1A");
    session.wait_for(&["The study is finished.", "3 of 3 counted"]);
    assert!(session.quit().success());
}

/// Regression: a fix that was used up came back with a changed verdict, and no answer said so.
#[test]
fn the_answer_to_a_changed_verdict_says_that_a_fixed_parameter_holds_for_one_more() {
    let folder = tempfile::tempdir().expect("a folder");
    quadfrog(folder.path(), &["optimize", "--trials", "2", "--seed", "0", "--output", "studies"]);
    let study = study_in(&folder.path().join("studies"));
    let study = study.to_str().expect("a path");
    let mut session = Session::start(folder.path(), (120, 40), &["--resume", study, "--trials", "5"]);
    session.wait_for(&["Press A to arm"]);
    session.send("4X");
    session.wait_for(&["Fix f0 at", "for how many trials?"]);
    session.send("\x151\r");
    session.wait_for(&["fixed at", "1 more"]);
    assert!(session.quit().success());
    quadfrog(folder.path(), &["optimize", "--resume", study, "--trials", "5"]);
    let mut session = Session::start(folder.path(), (120, 40), &["--resume", study]);
    session.wait_for(&["The study is finished."]);
    // Trial 2 had the fixed value.
    session.send("2\x1b[H\x1b[B\x1b[Bv");
    session.wait_for(&["Trial #2: ", "becomes void. Why?"]);
    session.send("slipped\r");
    session.wait_for(&["both; f0 ", " Hz fixed, 1 more"]);
    assert!(session.quit().success());
}
