//! Damaged journals and recordings: each command reads, repairs or refuses; none panics, hangs or is killed.

use std::fs;
use std::path::Path;

use crate::mutate;
use crate::program::Program;
use crate::{Passed, Try};

/// Mutations of the file at `path` by the seed of the try.
fn damage(this: &Try<'_>, path: &Path) {
    let words: [&[u8]; 8] = [b"1e308", b"NaN", b"-1", b"null", b"\n", b"{}", b"\xff\xff\xff\xff", b"\\u001b"];
    let corpus = [fs::read(path).unwrap()];
    fs::write(path, mutate::input(&corpus, &words, this.seed, 0)).unwrap();
}

/// Runs a command; returns whether it succeeded.
fn accepted(program: &Program, arguments: &[&str]) -> bool {
    let output = program.run(arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(matches!(output.status.code(), Some(0..=2)), "{arguments:?} ended with {:?}: {message}", output.status);
    assert!(!message.contains("panicked"), "{arguments:?}: {message}");
    assert!(output.status.success() || !message.trim().is_empty(), "{arguments:?} failed without a message");
    output.status.success()
}

fn outcome(accepted: usize, of: usize) -> Passed {
    Passed::Tried(if accepted == of { "read".to_owned() } else { "refused by a command or by all".to_owned() })
}

pub fn journal(this: &mut Try<'_>) -> Passed {
    let program = Program::new();
    program.text(&["optimize", "--trials", "5", "--record", "none", "--seed", "1"]);
    let study = program.study("recordings");
    damage(this, &study.join("study.log"));
    let study = study.to_str().unwrap();
    let commands: [&[&str]; 4] = [
        &["study", "show", study],
        &["study", "export", study],
        &["study", "best", study],
        &["optimize", "--resume", study, "--trials", "6", "--record", "none"],
    ];
    outcome(commands.iter().filter(|command| accepted(&program, command)).count(), commands.len())
}

pub fn recording(this: &mut Try<'_>) -> Passed {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "all", "--seed", "1"]);
    let study = program.study("recordings");
    let file = study.join("session.mcap");
    damage(this, &file);
    let (study, file) = (study.to_str().unwrap(), file.to_str().unwrap());
    let commands: [&[&str]; 2] = [&["recover", file], &["report", study]];
    outcome(commands.iter().filter(|command| accepted(&program, command)).count(), commands.len())
}
