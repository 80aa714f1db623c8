//! The examples of the library, as programs: each ends without error and prints the figure that its first lines promise.

use std::path::PathBuf;
use std::process::Command;

/// Runs an example that `cargo test` has built; returns its output.
fn output_of(name: &str) -> String {
    let test = std::env::current_exe().expect("the test has a path");
    let profile = test.ancestors().nth(2).expect("the test is in PROFILE/deps");
    let program: PathBuf = profile.join("examples").join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    let output = Command::new(&program)
        .output()
        .unwrap_or_else(|error| panic!("{}: {error}; build it with 'cargo build --example {name}'", program.display()));
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{name}: {}\n{text}\n{errors}", output.status);
    text.into_owned()
}

/// The first number after `before` in the last line that contains it.
fn number_after(text: &str, before: &str) -> f64 {
    let rest = text.lines().rev().find_map(|line| line.split_once(before)).map(|(_, rest)| rest);
    let number = rest.and_then(|rest| rest.split_whitespace().next()?.trim_end_matches(',').parse().ok());
    number.unwrap_or_else(|| panic!("no number after '{before}' in:\n{text}"))
}

#[test]
fn a_study_in_thirty_lines_reaches_half_a_metre() {
    let text = output_of("study");
    assert_eq!(text.lines().filter(|line| line.starts_with("trial ")).count(), 20, "{text}");
    assert!(number_after(&text, " with ") >= 0.5, "{text}");
    let source = include_str!("../examples/study.rs");
    let code = source.lines().filter(|line| !line.is_empty() && !line.trim_start().starts_with("//"));
    assert!(code.count() <= 30, "a study in 30 lines");
}

#[test]
fn a_driven_robot_stands_up_and_nods() {
    let text = output_of("drive_robot");
    assert!(number_after(&text, "0.00 s: height ") < 0.1, "{text}");
    assert!(number_after(&text, "1.50 s: height ") > 0.2, "{text}");
    let pitch = text.lines().filter_map(|line| line.split_once("pitch ")?.1.split_whitespace().next()?.parse().ok());
    let pitch: Vec<f64> = pitch.collect();
    assert!(pitch.iter().any(|&rad| rad > 0.05) && pitch.iter().any(|&rad| rad < -0.05), "{text}");
    assert!(pitch.iter().all(|rad| rad.abs() < 0.5), "{text}");
}

#[test]
fn an_own_task_finds_higher_jumps() {
    let text = output_of("own_task");
    assert!(number_after(&text, " with ") > 0.55, "{text}");
}

#[test]
fn an_own_sampler_finds_longer_jumps() {
    let text = output_of("own_sampler");
    assert!(number_after(&text, "best: own ") > 0.6, "{text}");
    assert!(number_after(&text, "gp ") > 0.6, "{text}");
}

#[test]
fn an_own_robot_runs_under_the_controller() {
    let text = output_of("own_robot");
    assert_eq!(text.lines().count(), 5, "{text}");
    assert!(number_after(&text, "100 % of the torque: ") > number_after(&text, " 50 % of the torque: "), "{text}");
}

#[test]
fn a_recording_is_read() {
    let text = output_of("read_recording");
    assert!(text.starts_with("forward on go1"), "{text}");
    assert!(text.contains("accept; ") && number_after(&text, "torque up to ") > 10.0, "{text}");
}
