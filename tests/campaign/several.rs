//! Clocks that jump, programs that meet, and long runs.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Stdio};

use serde_json::Value;

use crate::kill::{WithOptimize, assert_equal, unbroken};
use crate::program::{Program, assert_shows};
use crate::pty::Session;
use crate::{Passed, Try};

/// The library of the Debian package libfaketime, which shows a process another wall clock.
fn faketime() -> Option<PathBuf> {
    let mut folders =
        fs::read_dir("/usr/lib").ok()?.flatten().map(|entry| entry.path().join("faketime/libfaketimeMT.so.1"));
    folders.find(|file| file.exists())
}

/// A study whose wall clock jumps by years between its trials, forward and back.
pub fn clock_jump(this: &mut Try<'_>) -> Passed {
    let Some(library) = faketime() else { return Passed::Skipped("libfaketime is not installed".into()) };
    let program = Program::new();
    let seed = (this.seed % 50).to_string();
    let whole = unbroken(&program, this, &seed);
    let clock = program.path("clock");
    let mut jump = || {
        let year = [1971, 1999, 2026, 2037, 2040, 2100][this.random.below(6)];
        let next = program.path("next");
        fs::write(&next, format!("@{year}-03-01 12:00:00\n")).unwrap();
        fs::rename(next, &clock).unwrap();
    };
    jump();
    let arguments = this.scenario.arguments.iter().map(String::as_str).collect::<Vec<_>>().with_optimize();
    let mut command = program.command(&[&arguments[..], &["--seed", &seed, "--output", "jumping", "--json"]].concat());
    command.env("LD_PRELOAD", library).env("FAKETIME_TIMESTAMP_FILE", &clock).env("FAKETIME_NO_CACHE", "1");
    command.env("FAKETIME_DONT_FAKE_MONOTONIC", "1");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut printed: Vec<Value> = Vec::new();
    for line in BufReader::new(child.stdout.take().unwrap()).lines() {
        printed.push(serde_json::from_str(&line.unwrap()).unwrap());
        jump();
    }
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_equal(&program.study("jumping"), &whole, &printed);
    Passed::Tried(String::new())
}

/// A console has a study; a second console and `optimize` are refused, `study show` reads, and the first one goes on.
pub fn second_program(this: &mut Try<'_>) -> Passed {
    let program = Program::new();
    let folder = program.path("recordings");
    fs::create_dir(&folder).unwrap();
    let mut first = Session::start(&folder, (120, 36), &["--trials", "9", "--seed", &this.seed.to_string()]);
    first.wait_for(&["Press A to arm"]);
    let study = program.study("recordings");
    let study = study.to_str().unwrap();
    let mut second = Session::start(&folder, (120, 36), &["--resume", study]);
    assert_eq!(second.wait().exit_code(), 2, "{}", second.screen());
    assert_shows(&program.refused(&["optimize", "--resume", study]), &["another"]);
    program.text(&["study", "show", study]);
    first.send("A");
    first.wait_for(&["READY"]);
    first.send("\x03\x03");
    first.wait();
    assert!(first.restored());
    Passed::Tried(String::new())
}

/// Identical studies that begin at the same moment get a folder each.
pub fn begun_at_once(this: &mut Try<'_>) -> Passed {
    let program = Program::new();
    let seed = this.seed.to_string();
    let arguments = ["optimize", "--trials", "2", "--record", "none", "--seed", &seed];
    let children: Vec<Child> =
        (0..8).map(|_| program.command(&arguments).stdout(Stdio::null()).spawn().unwrap()).collect();
    for mut child in children {
        assert!(child.wait().unwrap().success());
    }
    let studies = program.studies("recordings");
    let counted: Vec<_> =
        studies.iter().map(|study| crate::program::counted_trials(&study.join("study.log"))).collect();
    assert_eq!(counted.len(), 8);
    assert!(counted.iter().all(|trials| trials.len() == 2 && trials == &counted[0]), "the studies are mixed");
    Passed::Tried(String::new())
}

/// Most growth of resident memory for each trial, kB: the study keeps its trials (some kB each), and the allocator rounds.
const GROWTH_KB: f64 = 64.0;

/// Descriptors or threads that may be open for a moment, as the journal during an append; a leak grows with the trials.
const TEMPORARY: usize = 3;

/// A long study: descriptors and threads as after the first third but for [`TEMPORARY`], memory within [`GROWTH_KB`] for each trial.
pub fn soak(this: &mut Try<'_>) -> Passed {
    let program = Program::new();
    let trials = if this.long { this.scenario.trials_long } else { this.scenario.trials_short };
    let (count, seed) = (trials.to_string(), this.seed.to_string());
    let arguments = this.arguments(&["--trials", &count, "--seed", &seed, "--json"]).with_optimize();
    let mut child = program.command(&arguments).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut measured = Vec::new();
    for (number, line) in BufReader::new(child.stdout.take().unwrap()).lines().enumerate() {
        line.unwrap();
        // The process may end behind its last line.
        if number as u32 == trials / 3 || number as u32 == trials - 2 {
            measured.push(usage(child.id()));
        }
    }
    assert!(child.wait().unwrap().success());
    let [before, after] = measured.try_into().expect("two measurements");
    let grown = |before: usize, after: usize| after > before + TEMPORARY;
    let (descriptors, threads) = ([before.descriptors, after.descriptors], [before.threads, after.threads]);
    assert!(!grown(before.descriptors, after.descriptors), "descriptors {descriptors:?}");
    assert!(!grown(before.threads, after.threads), "threads {threads:?}");
    let growth = (after.resident_kb - before.resident_kb) / f64::from(trials - 2 - trials / 3);
    assert!(growth < GROWTH_KB, "{growth:.1} kB for each trial");
    Passed::Tried(format!(
        "{} descriptors, {} threads, {growth:.1} kB for each trial",
        after.descriptors, after.threads
    ))
}

#[derive(Debug)]
struct Usage {
    descriptors: usize,
    threads: usize,
    resident_kb: f64,
}

fn usage(process: u32) -> Usage {
    let count = |what: &str| fs::read_dir(format!("/proc/{process}/{what}")).unwrap().count();
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("resident memory");
    let resident_kb = resident.trim().trim_end_matches(" kB").parse().unwrap();
    Usage { descriptors: count("fd"), threads: count("task"), resident_kb }
}
