//! Recordings that are still written, cannot be finished or do not fit on the disk: `quadfrog recover`, the console and
//! `quadfrog optimize`.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use crate::program::{Program, assert_shows, with_small_files};
use crate::pty::Session;
use nix::fcntl::{FcntlArg, fcntl};
use portable_pty::CommandBuilder;
use quadfrog::recording::player::Player;

const SIZE: (u16, u16) = (100, 30);

/// A console that runs in the folder `recordings` of the program, and the folder of its study.
fn console(program: &Program) -> (Session, PathBuf) {
    let folder = program.path("recordings");
    fs::create_dir(&folder).unwrap();
    let session = Session::start(&folder, SIZE, &[]);
    session.wait_for(&["Press A to arm"]);
    (session, program.study("recordings"))
}

/// Ends a console; returns its exit status and its last output.
fn quit(session: &mut Session) -> (u32, String) {
    let status = session.quit().exit_code();
    // Lines are wrapped at the width of the terminal.
    (status, session.screen().replace('\n', ""))
}

#[test]
fn a_recording_of_a_running_session_is_not_recovered() {
    let program = Program::new();
    let (mut session, study) = console(&program);
    let part = study.join("session.mcap.part");
    let owner = format!("process {}", session.pid());
    let refused = program.refused(&["recover", part.to_str().unwrap()]);
    assert_shows(&refused, &["session.mcap.part", "a session runs", &owner, "end the session"]);
    // Also into another file, and by the name alone.
    assert!(program.refused(&["recover", part.to_str().unwrap(), "--output", "copy.mcap"]).contains(&owner));
    let output = program.command(&["recover", "session.mcap.part"]).current_dir(&study).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(!study.join("session.mcap").exists() && !program.path("copy.mcap").exists());
    // A second session in the folder names the first one, too.
    let second = program.refused(&["optimize", "--resume", study.to_str().unwrap()]);
    assert_shows(&second, &["another session is running", &owner]);
    let (status, screen) = quit(&mut session);
    assert_eq!(status, 0, "{screen}");
    assert!(study.join("session.mcap").exists() && !part.exists());
}

/// Regression: a recording that its session still wrote was called damaged, with the advice to recover it.
#[test]
fn a_recording_of_a_running_session_is_not_called_damaged() {
    let program = Program::new();
    let (mut session, study) = console(&program);
    let part = study.join("session.mcap.part");
    assert_shows(&program.text(&["replay", "--check", part.to_str().unwrap()]), &["a session still writes it"]);
    // Regression: a report said that the program had not finished the file.
    let report = program.text(&["report", part.parent().unwrap().to_str().unwrap()]);
    let words = report.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("a session still writes it") && !words.contains("did not finish"), "{report}");
    // Regression: its export failed, with the advice to recover the folder.
    let export = program.run(&["export", study.to_str().unwrap(), "-o", "signals.csv"]);
    let message = String::from_utf8_lossy(&export.stderr);
    assert_eq!(export.status.code(), Some(0), "{message}");
    assert_shows(&message, &["session.mcap.part: a session still writes it; it is exported up to"]);
    assert!(!message.contains("recover"), "{message}");
    // Regression: `rejudge` failed, with the advice to recover the file.
    let rejudge = program.run(&["rejudge", study.to_str().unwrap()]);
    let message = String::from_utf8_lossy(&rejudge.stderr);
    assert_eq!(rejudge.status.code(), Some(0), "{message}");
    assert_shows(&message, &["session.mcap.part: a session still writes it; the trials that have ended are judged"]);
    assert!(!message.contains("recover"), "{message}");
    // Regression: `verify` called it damaged and named the file twice.
    let refused = program.refused(&["verify", study.to_str().unwrap()]);
    assert_shows(&refused, &["session.mcap.part: not verifiable: a session still writes it"]);
    assert_eq!(refused.matches("mcap.part").count(), 1, "{refused}");
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["replay", part.to_str().unwrap()]);
    let mut replay = Session::run(&program.path("."), SIZE, command);
    replay.wait_for(&["REPLAY"]);
    let (status, screen) = quit(&mut replay);
    assert!(status == 0 && !screen.contains("recover"), "{screen}");
    // The same file without its session is what a killed program left.
    let copy = program.path("left.mcap.part");
    fs::copy(&part, &copy).unwrap();
    assert_eq!(
        program.command(&["replay", "--check", copy.to_str().unwrap()]).output().unwrap().status.code(),
        Some(1)
    );
    quit(&mut session);
}

/// Regression: what a killed session had left was taken for the file of the session that continues its study.
#[test]
fn a_leftover_of_a_killed_session_is_damaged_also_beside_the_session_that_continues() {
    let program = Program::new();
    let (mut session, study) = console(&program);
    let left = study.join("session.mcap.part");
    let of_killed = fs::read(&left).unwrap();
    quit(&mut session);
    fs::remove_file(study.join("session.mcap")).unwrap();
    fs::write(&left, of_killed).unwrap();
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["--resume", study.to_str().unwrap()]);
    let mut session = Session::run(&program.path("."), SIZE, command);
    session.wait_for(&["Press A to arm"]);
    // Regression: after the resume nothing on the screen named the unfinished recording or the command that repairs it.
    let joined = |session: &Session| session.screen().split_whitespace().collect::<String>();
    let hint = format!("quadfrogrecover{}", left.display());
    session.wait_until("the hint", || joined(&session).contains(&hint));
    session.send("6");
    session.wait_for(&["an earlier session did not finish its recording"]);
    session.send("1");
    let written = study.join("session-2.mcap.part");
    assert_shows(&program.text(&["replay", "--check", written.to_str().unwrap()]), &["a session still writes it"]);
    let refused = program.refused(&["verify", left.to_str().unwrap()]);
    assert_shows(&refused, &["not verifiable: it is damaged: its end was not written", "`quadfrog recover"]);
    // By the name alone, too.
    let output = program.command(&["replay", "--check", "session-2.mcap.part"]).current_dir(&study).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let output = program.run(&["replay", "--check", left.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stdout));
    let (_, screen) = quit(&mut session);
    assert_shows(&screen, &["repair an incomplete recording"]);

    // Regression: the advice to recover it came again after it was recovered, and the report used it in place of the whole file.
    program.text(&["recover", left.to_str().unwrap()]);
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["--resume", study.to_str().unwrap()]);
    let mut session = Session::run(&program.path("."), SIZE, command);
    session.wait_for(&["Press A to arm"]);
    assert!(!session.screen().contains("did not finish its recording"), "{}", session.screen());
    let (_, screen) = quit(&mut session);
    assert!(screen.contains("play the recording") && !screen.contains("repair"), "{screen}");
    let report = program.text(&["report", study.to_str().unwrap()]);
    assert!(left.exists() && !report.contains("mcap.part"), "{report}");
}

/// Regression: the console ended with status 0 and named the other file as its recording.
#[test]
fn a_console_that_cannot_finish_its_recording_ends_with_status_1() {
    let program = Program::new();
    let (mut session, study) = console(&program);
    fs::write(study.join("session.mcap"), "another file").unwrap();
    let (status, screen) = quit(&mut session);
    assert_eq!(status, 1, "{screen}");
    assert_shows(&screen, &["the recording is not complete", "exists already", "quadfrog replay", "session.mcap.part"]);
    assert_eq!(fs::read_to_string(study.join("session.mcap")).unwrap(), "another file");
    let player = Player::open(study.join("session.mcap.part")).unwrap();
    assert!(player.duration_ns() > 0);
}

#[test]
fn a_console_whose_disk_is_full_ends_with_status_1_and_the_cause() {
    let program = Program::new();
    program.write("mine/control.toml", "[recording]\nfull_rate = true\n");
    // With SIGXFSZ ignored a write beyond the limit, 512 kB, fails as on a full disk.
    let shell = "trap '' XFSZ; ulimit -f 1000; exec \"$0\" \"$@\"";
    let mut command = CommandBuilder::new("sh");
    command.args(["-c", shell, env!("CARGO_BIN_EXE_quadfrog"), "--output", "recordings", "--config", "mine"]);
    // Wide: the line with the cause is long.
    let mut session = Session::run(&program.path(""), (240, 40), command);
    session.wait_for(&["DISARMED"]);
    session.send("5");
    session.wait_for(&["File too large", "NOT RECORDED"]);
    assert!(!session.screen().contains(" REC "), "{}", session.screen());
    let (status, screen) = quit(&mut session);
    assert_eq!(status, 1, "{screen}");
    assert_shows(&screen, &["the recording is not complete", "File too large"]);
}

#[test]
fn a_study_that_cannot_finish_its_recording_ends_with_status_1() {
    let program = Program::new();
    let mut child = program
        .command(&["optimize", "--trials", "12", "--record", "all", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The program waits in the middle of its study until its lines are read.
    let mut lines = child.stdout.take().unwrap();
    fcntl(&lines, FcntlArg::F_SETPIPE_SZ(4096)).unwrap();
    lines.read_exact(&mut [0]).unwrap();
    let recording = program.study("recordings").join("session.mcap");
    assert!(recording.with_extension("mcap.part").exists());
    fs::write(&recording, "another file").unwrap();
    let mut rest = Vec::new();
    lines.read_to_end(&mut rest).unwrap();
    assert!(rest.len() > 4096 + 1000, "the program did not wait: {} bytes", rest.len());
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_shows(&message, &["the recording is not complete", "session.mcap", "exists already"]);
    assert_eq!(fs::read_to_string(&recording).unwrap(), "another file");
}

/// An unfinished recording: the beginning of a whole one.
fn cut(program: &Program) -> (PathBuf, u64) {
    program.text(&["optimize", "--trials", "2", "--record", "all"]);
    let whole = fs::read(program.study("recordings").join("session.mcap")).unwrap();
    let part = program.path("cut.mcap.part");
    fs::write(&part, &whole[..whole.len() * 2 / 3]).unwrap();
    (part, whole.len() as u64)
}

#[test]
fn a_recording_is_recovered_into_the_file_that_is_given() {
    let program = Program::new();
    let (part, _) = cut(&program);
    let printed = program.text(&["recover", "cut.mcap.part", "--output", "found.mcap"]);
    assert_shows(&printed, &["found.mcap", "ticks", "The recording is not complete: ", "cut.mcap.part is unchanged"]);
    assert!(!program.path("cut.mcap").exists());
    let other = program.refused(&["recover", "cut.mcap"]);
    assert_shows(&other, &["cut.mcap: there is no such file", "give cut.mcap.part"]);
    assert_eq!(Player::open(program.path("found.mcap")).unwrap().damage(), None);
    // Regression: of a recovered file nothing said any more that it lacks something.
    let checked = program.text(&["replay", "--check", "found.mcap"]);
    assert_shows(
        &checked,
        &["recovered from a file that was not whole: it was cut off", "that was recovered is there"],
    );
    // Nothing is overwritten, the name says what the file is, and a lock without a session does not count.
    assert!(program.refused(&["recover", "cut.mcap.part", "--output", "found.mcap"]).contains("exists already"));
    assert!(program.refused(&["recover", "cut.mcap.part", "--output", "found"]).contains("must end in .mcap"));
    assert!(program.refused(&["recover", "cut.mcap.part", "--output", "nowhere/found.mcap"]).contains("nowhere"));
    program.write("session.lock", "process 1\n");
    program.text(&["recover", part.to_str().unwrap()]);
    assert!(program.path("cut.mcap").exists());
}

/// Regression: a whole recording was copied, with the words that nothing needs it any more; its study does not read the copy.
#[test]
fn a_whole_recording_is_not_recovered_and_a_damaged_one_names_how_its_study_reads_the_new_file() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "2", "--record", "all"]);
    let study = program.study("recordings");
    let [file, recovered] = ["session.mcap", "session.recovered.mcap"].map(|name| study.join(name));
    let given = file.to_str().unwrap();
    assert_shows(&program.refused(&["recover", given]), &["session.mcap: it is whole; there is nothing to recover"]);
    assert!(!recovered.exists());
    let mut bytes = fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0xff;
    fs::write(&file, bytes).unwrap();
    let printed = program.text(&["recover", given]);
    assert_shows(&printed, &["session.mcap is unchanged.", "once you have moved", "renamed the new file to"]);
    fs::rename(&file, program.path("damaged.mcap")).unwrap();
    fs::rename(&recovered, &file).unwrap();
    assert_shows(&program.text(&["replay", "--check", study.to_str().unwrap()]), &["not whole: 1 of "]);
    // Regression: a report of the recovered file said nothing.
    let report = program.text(&["report", study.to_str().unwrap()]).split_whitespace().collect::<Vec<_>>().join(" ");
    assert_shows(&report, &["session.mcap: recovered from a file that was not whole: 1 of "]);
    // Regression: of a name without a file the ending was refused.
    let missing = study.join("nothing.part");
    let refused = program.refused(&["recover", missing.to_str().unwrap()]);
    assert_shows(&refused, &["nothing.part: there is no such file"]);
}

/// Regression: two that began at once wrote into one unfinished file.
#[test]
fn of_two_recoveries_into_one_file_the_second_is_refused() {
    let program = Program::new();
    cut(&program);
    program.write("cut.mcap.recovering", "what the first has written");
    let first = fs::File::options().write(true).open(program.path("cut.mcap.recovering")).unwrap();
    first.lock().unwrap();
    let refused = program.refused(&["recover", "cut.mcap.part"]);
    assert_shows(&refused, &["cut.mcap.recovering: another program recovers into this file"]);
    assert_eq!(fs::read_to_string(program.path("cut.mcap.recovering")).unwrap(), "what the first has written");
    // What a killed one has left is written over.
    drop(first);
    program.text(&["recover", "cut.mcap.part"]);
    assert!(program.path("cut.mcap").exists() && !program.path("cut.mcap.recovering").exists());
}

/// Regression: of a file that was cut off "0.000 s lost" was said.
#[test]
fn the_check_of_a_file_that_was_cut_off_says_from_when_on_it_is_lost() {
    let program = Program::new();
    cut(&program);
    let output = program.run(&["replay", "--check", "cut.mcap.part"]);
    assert_eq!(output.status.code(), Some(1));
    let printed = String::from_utf8_lossy(&output.stdout);
    assert_shows(&printed, &["it was cut off", "lost: what followed ", " s, and nothing tells how much that was"]);
    assert!(!printed.contains("0.000 s lost"), "{printed}");
}

/// Regression: the check ended at the first file that could not be opened.
#[test]
fn a_check_goes_on_after_a_file_that_cannot_be_opened() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "2", "--record", "all"]);
    let study = program.study("recordings");
    fs::rename(study.join("session.mcap"), study.join("session-2.mcap")).unwrap();
    fs::write(study.join("session.mcap"), "no recording").unwrap();
    let output = program.run(&["replay", "--check", study.to_str().unwrap()]);
    let [printed, message] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_shows(&printed, &["session-2.mcap", "whole"]);
    assert_shows(&message, &["session.mcap: not an MCAP file", "not whole: 1 of 2 files"]);
    assert!(!message.contains("quadfrog recover"), "{message}");
    // Of files none of which can be opened nothing was checked.
    fs::write(study.join("session-2.mcap"), "no recording").unwrap();
    let message = program.refused(&["replay", "--check", study.to_str().unwrap()]);
    assert_shows(&message, &["session-2.mcap: not an MCAP file", "not whole: 2 of 2 files"]);
}

#[test]
fn a_recovery_that_does_not_fit_names_its_cause_and_leaves_nothing() {
    let program = Program::new();
    let (_, bytes) = cut(&program);
    let blocks = (bytes / 3 / 512) as u32;
    let (status, message) = with_small_files(&program, blocks, &["recover", "cut.mcap.part"]);
    assert_eq!(status, Some(1), "{message}");
    assert_shows(&message, &["cut.mcap.recovering", "could not write", "File too large"]);
    let left = |name: &str| Path::new(&program.path(name)).exists();
    assert!(!left("cut.mcap") && !left("cut.mcap.recovering") && left("cut.mcap.part"));
}

/// The promise of the question before quitting: a changed proposal comes again with its values.
#[test]
fn a_session_that_was_quit_proposes_the_same_values_again() {
    let program = Program::new();
    let (mut session, study) = console(&program);
    session.send("o");
    session.wait_for(&["Override trial"]);
    session.send("1.3\x1b[B88\r");
    session.wait_for(&["Trial #0 (operator)"]);
    session.send("A");
    session.wait_for(&["Press g twice to jump"]);
    session.send("q");
    session.wait_for(&["Trial #0 is not run: it is proposed again then, with the values set here."]);
    session.send("y");
    session.wait();
    let mut session = Session::start(&program.path("."), SIZE, &["--resume", study.to_str().unwrap()]);
    session.wait_for(&["Trial #0 (operator)", "1.300 Hz", "88.00 N"]);
    quit(&mut session);
}

/// Regression: a recovered recording that lacks something was whole for every command but `replay --check` and `report`.
#[test]
fn what_was_lost_before_a_recovery_is_an_error_of_the_commands_that_use_the_rest() {
    let program = Program::new();
    cut(&program);
    program.text(&["recover", "cut.mcap.part"]);
    for arguments in
        [&["export", "cut.mcap", "-o", "cut.csv"][..], &["rejudge", "cut.mcap"], &["screenshot", "cut.mcap"]]
    {
        let output = program.run(arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert_shows(&message, &["cut.mcap: recovered from a file that was not whole: it was cut off"]);
    }
    assert!(fs::read_to_string(program.path("cut.csv")).unwrap().lines().count() > 1000);
}
