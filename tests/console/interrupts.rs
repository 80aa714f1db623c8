//! Signals that end a command without a screen: nothing half-written stays, and `optimize` keeps the ticks of its best trial.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::program::{Program, assert_shows, ending_signals};
use crate::redis::Ended;

fn send(child: &Child, signal: Signal) {
    kill(Pid::from_raw(child.id() as i32), signal).unwrap();
}

/// A study without an end that has printed `trials` lines.
fn optimizing(program: &Program, trials: usize, more: &[&str]) -> Ended {
    let endless = ["optimize", "--seed", "0", "--trials", "100000", "--json"];
    let mut command = program.command(&[&endless[..], more].concat());
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let stdout = child.stdout.take().unwrap();
    let mut lines = BufReader::new(stdout).lines();
    assert_eq!(lines.by_ref().take(trials).map_while(Result::ok).count(), trials);
    // Read on: a program does not end while its output is full.
    std::thread::spawn(move || lines.map_while(Result::ok).for_each(drop));
    Ended(child)
}

fn names_in(folder: &Path) -> Vec<String> {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

/// Waits until a file or folder below `folder` has a name that begins and ends so, or the program has ended.
fn wait_for_name(child: &mut Child, folder: &Path, begin: &str, end: &str) {
    let is_there = || names_in(folder).iter().any(|name| name.starts_with(begin) && name.ends_with(end));
    while !is_there() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Regression: the next command waited for the lock of a program that was gone.
#[test]
fn a_signal_leaves_no_lock_of_a_journal() {
    for signal in ending_signals() {
        for trials in 1..=6 {
            let program = Program::new();
            let mut ended = optimizing(&program, trials, &["--record", "none"]);
            // The second one ends the program at once, wherever it is.
            send(&ended.0, signal);
            send(&ended.0, signal);
            assert_eq!(ended.0.wait().unwrap().code(), Some(128 + signal as i32));
            let files = names_in(&program.study("recordings"));
            assert!(!files.iter().any(|name| name.starts_with("study.log.lock")), "{signal}: {files:?}");
        }
    }
}

/// Regression: `optimize | head -1` ran all trials after the end of `head`.
#[test]
fn a_study_ends_with_the_reader_of_its_trials() {
    for format in [&["--json"][..], &[]] {
        let program = Program::new();
        let long = ["optimize", "--seed", "0", "--trials", "3000"];
        let mut command = program.command(&[&long[..], format].concat());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (mut first, mut messages) = (String::new(), child.stderr.take().unwrap());
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut first).unwrap();
        let mut ended = Ended(child);
        assert_eq!(ended.0.wait().unwrap().code(), Some(128 + Signal::SIGPIPE as i32), "{format:?}");
        let mut message = String::new();
        messages.read_to_string(&mut message).unwrap();
        assert_shows(&message, &["the reader of standard output has ended", "--resume recordings/"]);
        assert_eq!(message.matches("the reader").count(), 1, "{message}");
        let study = program.study("recordings");
        program.text(&["verify", study.to_str().unwrap()]);
    }
}

#[test]
fn a_signal_ends_a_wait_for_a_lock() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "none"]);
    let study = program.study("recordings");
    let (folder, lock) = (study.to_str().unwrap(), study.join("study.log.lock"));
    symlink(study.join("study.log"), &lock).unwrap();
    for arguments in [
        &["study", "enqueue", folder, "f0=1.2", "Fx=50", "Fz=250"][..],
        &["optimize", "--resume", folder, "--trials", "3"],
        &["optimize", "--join", folder, "--trials", "3"],
    ] {
        let mut ended = Ended(program.command(arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap());
        let mut lines = BufReader::new(ended.0.stderr.take().unwrap()).lines().map_while(Result::ok);
        assert!(lines.any(|line| line.contains("waiting for")), "{arguments:?} did not wait");
        send(&ended.0, Signal::SIGTERM);
        assert_eq!(ended.0.wait().unwrap().code(), Some(143), "{arguments:?}");
        assert!(lock.symlink_metadata().is_ok(), "the lock of another program was removed");
    }
}

/// Regression: with `--record best` the ticks of the best trial are in memory until the end, and a signal lost them.
#[test]
fn the_best_trial_of_an_interrupted_study_is_recorded() {
    let program = Program::new();
    let mut ended = optimizing(&program, 5, &[]);
    send(&ended.0, Signal::SIGTERM);
    assert_eq!(ended.0.wait().unwrap().code(), Some(143));
    let study = program.study("recordings");
    let folder = study.to_str().unwrap();
    assert!(study.join("session.mcap").is_file(), "{:?}", names_in(&study));
    let best = program.text(&["study", "best", folder]);
    let number = best.split_whitespace().nth(2).unwrap();
    let ticks = program.text(&["export", folder, "--trial", number]);
    assert!(ticks.lines().count() > 1_000, "{best}{} lines of ticks", ticks.lines().count());
    let trials = program.exported(folder).len();
    let more = (trials + 2).to_string();
    program.text(&["optimize", "--resume", folder, "--trials", &more]);
    assert_eq!(program.exported(folder).len(), trials + 2, "no trial was left running");
}

/// `nohup` and the background of a script let programs ignore signals.
#[test]
fn an_ignored_signal_stays_ignored() {
    let program = Program::new();
    let mut command = Command::new("sh");
    command.args([
        "-c",
        "trap '' HUP; exec \"$0\" \"$@\"",
        env!("CARGO_BIN_EXE_quadfrog"),
        "optimize",
        "--trials",
        "8",
    ]);
    command.current_dir(program.path("")).args(["--json", "--record", "none"]).stdout(Stdio::piped());
    let mut ended = Ended(command.spawn().unwrap());
    let mut lines = BufReader::new(ended.0.stdout.take().unwrap()).lines().map_while(Result::ok);
    lines.next().unwrap();
    send(&ended.0, Signal::SIGHUP);
    assert_eq!(lines.count(), 7);
    assert!(ended.0.wait().unwrap().success());
}

/// Regression: the beginning of a file stayed, and nothing removed it.
#[test]
fn a_signal_removes_an_unfinished_file() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "12", "--record", "all"]);
    let study = program.study("recordings");
    let recording = fs::read(study.join("session.mcap")).unwrap();
    fs::write(program.path("cut.mcap.part"), &recording[..recording.len() - 100]).unwrap();
    let folder = study.to_str().unwrap();
    for (arguments, (begin, end)) in [
        (["export", folder, "--output", "ticks.csv"], (".ticks.csv.", ".part")),
        (["recover", "cut.mcap.part", "--output", "whole.mcap"], ("whole.mcap.", ".recovering")),
    ] {
        let mut ended = Ended(program.command(&arguments).stdout(Stdio::null()).spawn().unwrap());
        wait_for_name(&mut ended.0, &program.path(""), begin, end);
        send(&ended.0, Signal::SIGTERM);
        ended.0.wait().unwrap();
        let files = names_in(&program.path(""));
        assert!(!files.iter().any(|name| name.starts_with(begin) && name.ends_with(end)), "{arguments:?}: {files:?}");
    }
}

/// Regression: the study went on, and its folder stayed.
#[test]
fn a_signal_ends_the_study_of_a_bench_and_removes_its_folder() {
    let program = Program::new();
    fs::create_dir(program.path("temporary")).unwrap();
    let mut command = program.command(&["bench", "--seconds", "0.1"]);
    let place = program.path("temporary");
    let mut ended = Ended(command.env("TMPDIR", &place).stdout(Stdio::null()).spawn().unwrap());
    wait_for_name(&mut ended.0, &place, "quadfrog-bench-", "");
    let folder = place.join(format!("quadfrog-bench-{}", ended.0.id()));
    send(&ended.0, Signal::SIGTERM);
    assert_eq!(ended.0.wait().unwrap().code(), Some(143));
    assert_eq!(names_in(&place), [""; 0]);
    let of_study = |process: &str| {
        let command = fs::read(format!("/proc/{process}/cmdline")).unwrap_or_default();
        String::from_utf8_lossy(&command).contains(folder.to_str().unwrap())
    };
    let left: Vec<String> = names_in(Path::new("/proc")).into_iter().filter(|name| of_study(name)).collect();
    assert_shows(&format!("left: {left:?}"), &["left: []"]);
}

/// Regression: systemd called a worker that it had stopped failed, and started one whose study does not exist again every minute.
#[test]
fn the_service_of_a_worker_knows_its_exit_statuses() {
    let unit =
        fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../packaging/quadfrog-worker.service")).unwrap();
    let value = |key: &str| unit.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('=')).unwrap_or_default();
    assert_eq!(value("ExecStart"), "/usr/bin/quadfrog optimize --join ${QUADFROG_STUDY}");
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "none", "--output", "met"]);
    program.text(&["optimize", "--join", program.study("met").to_str().unwrap()]);

    let refused = program.run(&["optimize", "--join", "study"]).status.code().unwrap();
    assert_eq!(value("RestartPreventExitStatus"), refused.to_string());

    let mut ended = optimizing(&program, 1, &["--record", "none"]);
    send(&ended.0, Signal::SIGTERM);
    assert_eq!(value("SuccessExitStatus"), ended.0.wait().unwrap().code().unwrap().to_string());
}

/// Regression: the command was printed without the budget. That of the study was used up, and the command ended at once.
#[test]
fn the_command_that_continues_an_interrupted_worker_names_its_budget() {
    let program = Program::new();
    program.text(&["optimize", "--seed", "2", "--trials", "1", "--record", "none", "--output", "first"]);
    let study = program.study("first").join("study.log");
    let join = ["optimize", "--join", study.to_str().unwrap(), "--json", "--record", "none", "--trials"];
    let mut command = program.command(&[&join[..], &["100000"]].concat());
    let mut worker = Ended(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap());
    let mut lines = BufReader::new(worker.0.stdout.take().unwrap()).lines();
    lines.next().expect("a trial").unwrap();
    send(&worker.0, Signal::SIGTERM);
    lines.map_while(Result::ok).for_each(drop);
    let printed = std::io::read_to_string(worker.0.stderr.take().unwrap()).unwrap();
    let command = format!("`quadfrog optimize --join {} --task forward --seed 2 --trials 100000`", study.display());
    assert_shows(&printed, &["of 100000 trials counted", &command, "continues the study"]);
}
