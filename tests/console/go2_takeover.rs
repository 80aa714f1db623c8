//! Messages of a console about the own controller of a Go2, which it releases at the start; an emulated robot takes its place.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::pty::{STRICT, Session, Setup};
use portable_pty::CommandBuilder;

const SIZE: (u16, u16) = (120, 36);

/// A domain beside those of the other tests, whose ports lie below those of outgoing connections.
fn domain() -> String {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    (2 + std::process::id() % 4 * 2 + NEXT.fetch_add(1, Ordering::Relaxed) % 2).to_string()
}

fn quadfrog(folder: &Path, arguments: &[&str]) -> Session {
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(arguments);
    command.env("QUADFROG_SESSIONS", folder.join("sessions"));
    Session::run_in(folder, &Setup { size: SIZE, cell: (0, 0), variables: &[STRICT] }, command)
}

/// The only study in the folder `studies`.
fn study(folder: &Path) -> PathBuf {
    std::fs::read_dir(folder.join("studies")).unwrap().next().unwrap().unwrap().path()
}

/// Regression: the robot's own controller was released, the engine did not start, and the way back was not printed.
#[test]
fn a_session_that_does_not_start_says_how_to_give_the_robot_back() {
    let (folder, domain) = (tempfile::tempdir().unwrap(), domain());
    let emulator = quadfrog(folder.path(), &["emulate", "--robot", "go2", "--domain", &domain]);
    emulator.wait_for(&["Type a fault"]);
    // A session of the simulator holds the study.
    let mut holder = quadfrog(folder.path(), &["--model", "go2", "--output", "studies"]);
    holder.wait_for(&["Press A to arm"]);
    let study = study(folder.path());
    let drive = ["--robot", "go2", "--interface", "lo", "--domain", &domain];
    let resume = ["--resume", study.to_str().unwrap(), "--accept-backend-change"];
    let mut session = quadfrog(folder.path(), &[&drive[..], &resume[..]].concat());
    session.wait_for(&["Type yes to go on"]);
    session.send("yes\n");
    assert!(!session.wait().success());
    let screen = session.screen();
    for text in [
        "The robot's own controller normal is released, the legs are not supported.",
        &format!("quadfrog give-back --controller normal --interface lo --domain {domain}"),
        "another session is running in this folder",
    ] {
        assert!(screen.contains(text), "{text}: {screen}");
    }
    holder.quit();
}

/// Regression: Ctrl-C between the release and the screen ended the program, and the way back was not printed. The lock of the study is
/// held, so the screen does not open before the key.
#[test]
fn an_interrupt_after_the_release_says_how_to_give_the_robot_back() {
    let (folder, domain) = (tempfile::tempdir().unwrap(), domain());
    let emulator = quadfrog(folder.path(), &["emulate", "--robot", "go2", "--domain", &domain]);
    emulator.wait_for(&["Type a fault"]);
    let simulate = ["optimize", "--model", "go2", "--trials", "2", "--record", "none", "--output", "studies"];
    let mut optimize = quadfrog(folder.path(), &simulate);
    assert!(optimize.wait().success(), "{}", optimize.screen());
    let study = study(folder.path());
    std::os::unix::fs::symlink(study.join("study.log"), study.join("study.log.lock")).unwrap();
    let drive = ["--robot", "go2", "--interface", "lo", "--domain", &domain];
    let resume = ["--resume", study.to_str().unwrap(), "--accept-backend-change", "--trials", "9"];
    let mut session = quadfrog(folder.path(), &[&drive[..], &resume[..]].concat());
    session.wait_for(&["Type yes to go on"]);
    session.send("yes\n");
    session.wait_for(&["waiting for", "study.log.lock"]);
    session.send("\x03");
    assert!(!session.wait().success());
    let screen = session.screen();
    for text in [
        "The robot's own controller normal is released, the legs are not supported.",
        &format!("quadfrog give-back --controller normal --interface lo --domain {domain}"),
    ] {
        assert!(screen.contains(text), "{text}: {screen}");
    }
}

/// Regression: the number of trials was checked after the robot had lost its own controller.
#[test]
fn a_number_of_trials_below_those_that_count_is_refused_before_the_takeover() {
    let folder = tempfile::tempdir().unwrap();
    let simulate = ["optimize", "--model", "go2", "--trials", "2", "--record", "none", "--output", "studies"];
    let mut optimize = quadfrog(folder.path(), &simulate);
    assert!(optimize.wait().success(), "{}", optimize.screen());
    let study = study(folder.path());
    let resume = ["--resume", study.to_str().unwrap(), "--accept-backend-change", "--trials", "1"];
    let mut session = quadfrog(folder.path(), &[&["--robot", "go2", "--interface", "lo"][..], &resume[..]].concat());
    session.wait_until("it ends or asks", || {
        let screen = session.screen();
        screen.contains("count already") || screen.contains("Type yes")
    });
    let screen = session.screen();
    assert!(screen.contains("--trials 1: 2 trials of this study count already"), "{screen}");
    assert_eq!(session.wait().exit_code(), 2);
}
