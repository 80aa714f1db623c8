//! SIGKILL at a random moment, then the rest of the study: equal to an unbroken one bit for bit.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use nix::sys::signal::Signal;
use serde_json::Value;

use crate::program::{Program, counted_trials};
use crate::pty::Session;
use crate::{Passed, Try};

/// The complete trials of an unbroken study with the same arguments.
pub fn unbroken(program: &Program, this: &Try<'_>, seed: &str) -> Vec<(Value, Value)> {
    let config = this.config();
    let config: Vec<&str> = config.iter().map(String::as_str).collect();
    let fixed = ["optimize", "--seed", seed, "--output", "whole", "--record", "none", "--json"];
    program.trials(&[&fixed[..], &this.arguments(&config)].concat());
    counted_trials(&program.study("whole").join("study.log"))
}

/// Checks that the study in `folder` has the trials of the unbroken one, in their order, and those that were `printed`.
#[track_caller]
pub fn assert_equal(folder: &Path, whole: &[(Value, Value)], printed: &[Value]) {
    let counted = counted_trials(&folder.join("study.log"));
    assert_eq!(counted.len(), whole.len(), "another number of trials");
    for (number, (trial, expected)) in counted.iter().zip(whole).enumerate() {
        assert_eq!(trial, expected, "counted trial {number} differs from the unbroken study's");
    }
    for trial in printed {
        let judged = (trial["params"].clone(), trial["value"].clone());
        assert!(counted.contains(&judged), "a judged trial is lost: {trial}");
    }
}

/// `optimize`, killed up to three times after a random number of trials and a random pause.
pub fn optimize(this: &mut Try<'_>) -> Passed {
    let program = Program::new();
    let seed = (this.seed % 50).to_string();
    let whole = unbroken(&program, this, &seed);
    let config = this.config();
    let kills = 1 + this.random.below(3);
    let (mut printed, mut killed) = (Vec::new(), 0);
    for _ in 0..kills {
        let study = program.studies("broken").into_iter().find(|study| begun(study));
        let mut command = program.command(&this.arguments(&["--json", "--record", "all"]).with_optimize());
        match &study {
            None => command.args(["--seed", &seed, "--output", "broken"]).args(&config),
            Some(study) => command.arg("--resume").arg(study),
        };
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let wanted = this.random.below(whole.len());
        let pause = Duration::from_micros(this.random.below(80_000) as u64);
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut take = |count: usize, printed: &mut Vec<Value>| {
            printed.extend(
                lines.by_ref().take(count).map_while(Result::ok).filter_map(|line| serde_json::from_str(&line).ok()),
            );
        };
        take(wanted, &mut printed);
        std::thread::sleep(pause);
        killed += u32::from(child.try_wait().unwrap().is_none());
        let _ = child.kill();
        take(usize::MAX, &mut printed);
        child.wait().unwrap();
        release(&program, this);
    }
    finish(&program, this, &seed, "broken");
    assert_equal(&program.study("broken"), &whole, &printed);
    Passed::Tried(format!("with {killed} kills"))
}

/// Removes the lock of a journal that a killed program left within an append. The long form waits until `--resume` breaks it,
/// after 30 s; the wait has a test of its own in `tests/optimize/python.rs`.
fn release(program: &Program, this: &Try<'_>) {
    for study in program.studies("broken").iter().filter(|_| !this.long) {
        let _ = fs::remove_file(study.join("study.log.lock"));
    }
}

/// Whether a folder holds a study: one whole line at least. A disk may be full, or the program killed, before the first one;
/// such a folder is refused by `--resume` and nothing is lost.
fn begun(study: &Path) -> bool {
    fs::read(study.join("study.log")).is_ok_and(|bytes| bytes.contains(&b'\n'))
}

/// Resumes the study below `folder` to its end, or begins it where none was made before the end of the program.
pub fn finish(program: &Program, this: &Try<'_>, seed: &str, folder: &str) {
    let config = this.config();
    let config: Vec<&str> = config.iter().map(String::as_str).collect();
    let studies = program.studies(folder);
    let made = studies.iter().find(|study| begun(study));
    for empty in studies.iter().filter(|study| Some(*study) != made) {
        fs::remove_dir_all(empty).unwrap();
    }
    match made {
        Some(study) => program.text(&this.arguments(&["--resume", study.to_str().unwrap(), "--json"]).with_optimize()),
        None => program
            .text(&[&this.arguments(&["--seed", seed, "--output", folder]).with_optimize()[..], &config].concat()),
    };
}

/// Arguments behind the subcommand.
pub trait WithOptimize<'a> {
    fn with_optimize(self) -> Vec<&'a str>;
}

impl<'a> WithOptimize<'a> for Vec<&'a str> {
    fn with_optimize(self) -> Vec<&'a str> {
        [&["optimize"], &self[..]].concat()
    }
}

/// The console with `--approve auto` in a terminal, killed at a random moment of its trials.
pub fn console(this: &mut Try<'_>) -> Passed {
    let program = Program::new();
    let seed = (this.seed % 50).to_string();
    let whole = unbroken(&program, this, &seed);
    let output = program.path("broken");
    let arguments = this.arguments(&["--seed", &seed, "--approve", "auto"]);
    let session = Session::start(&output_made(&output), (120, 36), &arguments);
    let wanted = this.random.below(whole.len().min(3));
    let pause = Duration::from_micros(this.random.below(3_000_000) as u64);
    let judged = || {
        let study = program.studies("broken").into_iter().find(|study| begun(study));
        study.map_or(0, |study| counted_trials(&study.join("study.log")).len())
    };
    session.wait_for_long("enough trials", || judged() >= wanted);
    std::thread::sleep(pause);
    session.signal(Signal::SIGKILL);
    drop(session);
    release(&program, this);
    finish(&program, this, &seed, "broken");
    assert_equal(&program.study("broken"), &whole, &[]);
    Passed::Tried(String::new())
}

fn output_made(folder: &Path) -> std::path::PathBuf {
    fs::create_dir_all(folder).unwrap();
    folder.to_owned()
}
