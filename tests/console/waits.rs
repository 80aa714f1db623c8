//! Waits of the program and what ends them: the lock of another program, another worker's trial; and threads that the system
//! does not grant.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};

use crate::program::{Program, assert_shows, without_threads};
use crate::pty::Session;

/// A study of two trials.
fn study(program: &Program) -> PathBuf {
    program.text(&["optimize", "--trials", "2", "--record", "none"]);
    program.study("recordings")
}

/// Locks the study as a writer does that then ends without releasing it.
fn lock(study: &Path) -> PathBuf {
    let lock = study.join("study.log.lock");
    symlink(study.join("study.log"), &lock).unwrap();
    lock
}

/// Starts a command and waits until it prints a wait for `what`.
fn waiting(program: &Program, arguments: &[&str], what: &str) -> (Child, String) {
    let mut child = program.command(arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut printed = String::new();
    for line in BufReader::new(child.stderr.take().unwrap()).lines() {
        printed += &(line.unwrap() + "\n");
        if printed.contains("waiting for") {
            assert_shows(&printed, &[what]);
            return (child, printed);
        }
    }
    let status = child.wait().unwrap();
    panic!("{arguments:?} ended without a wait, {status}: {printed}");
}

/// Before its screen the console says what it waits for; Ctrl-C ends the wait, and the screen follows the lock's end.
#[test]
fn a_console_that_waits_for_a_lock_says_so_before_its_screen() {
    let program = Program::new();
    let study = study(&program);
    let journal = fs::read(study.join("study.log")).unwrap();
    // A larger budget is stored before the screen appears.
    let arguments = ["--trials", "9", "--resume", study.to_str().unwrap()];
    let start = || Session::start(&program.path("recordings"), (200, 50), &arguments);
    lock(&study);
    let mut ended = start();
    ended.wait_for(&["waiting for", "study.log.lock", "broken after 30 s", "Ctrl-C ends"]);
    ended.send("\x03");
    assert!(!ended.wait().success());
    assert!(ended.restored() && fs::read(study.join("study.log")).unwrap() == journal, "the study changed");
    let mut session = start();
    session.wait_for(&["waiting for"]);
    fs::remove_file(study.join("study.log.lock")).unwrap();
    session.wait_for(&["Press A to arm"]);
    session.send("\x03\x03");
    assert!(session.wait().success() && session.restored());
}

/// Regression: from the quit key to the end of the session, here that of the lock, the screen stood still: READY, with the key of the
/// next jump.
#[test]
fn a_session_that_ends_shows_the_mode_and_what_it_waits_for() {
    let program = Program::new();
    let mut session = Session::start(&program.path("recordings"), (120, 36), &[]);
    session.wait_for(&["Press A to arm"]);
    session.send("A");
    session.wait_for(&["READY"]);
    session.approve();
    session.wait_for(&["Trial #0: judge it"]);
    // Stored at the end: until then it can be undone.
    session.send("a");
    session.wait_for(&["u takes it back"]);
    let lock = lock(&program.study("recordings"));
    session.send("q");
    session.wait_for(&["Press y to quit"]);
    session.send("y");
    session.wait_for(&["DISARMED", "Quitting: waiting for the study's lock"]);
    fs::remove_file(lock).unwrap();
    assert!(session.wait().success() && session.restored());
}

#[test]
fn a_command_that_waits_for_a_lock_says_so_and_goes_on_at_its_end() {
    let program = Program::new();
    let study = study(&program);
    let lock = lock(&study);
    let folder = study.to_str().unwrap();
    let (mut child, printed) =
        waiting(&program, &["study", "enqueue", folder, "f0=1.2", "Fx=50", "Fz=250"], "study.log.lock");
    assert_shows(&printed, &["Ctrl-C ends the wait"]);
    fs::remove_file(lock).unwrap();
    assert!(child.wait().unwrap().success());
}

/// The trial of a worker that does not answer counts for the budget until `workers.abandoned_s`.
#[test]
fn a_worker_that_waits_for_another_ones_trial_says_so() {
    let program = Program::new();
    let study = study(&program);
    let running = "{\"op_code\":4,\"worker_id\":\"another\",\"study_id\":0,\"datetime_start\":\"2026-01-01T00:00:00.000000+00:00\"}\n";
    fs::OpenOptions::new().append(true).open(study.join("study.log")).unwrap().write_all(running.as_bytes()).unwrap();
    let (mut child, _) =
        waiting(&program, &["optimize", "--join", study.to_str().unwrap(), "--trials", "3"], "of other workers");
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Regression: the program panicked where the system granted no thread.
#[test]
fn threads_that_the_system_does_not_grant_are_an_error() {
    let program = Program::new();
    let optimize = ["optimize", "--trials", "2", "--jobs", "2", "--seed", "0-1"];
    let emulate = ["emulate", "--bind", "127.0.0.1:0"];
    let with_link = ["bench", "loop", "--seconds", "0.1", "--with-link"];
    for arguments in [&optimize[..], &emulate, &["doctor"], &with_link, &with_link[..4]] {
        let output = without_threads(&program, arguments);
        let printed = [output.stdout, output.stderr].concat();
        let message = String::from_utf8_lossy(&printed);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert!(!message.contains("panicked") && !message.contains("defect"), "{arguments:?}: {message}");
        assert_shows(&message, &["thread"]);
    }
}
