//! The campaign of faults: scenarios as data (`tests/campaign/scenarios.toml`), one table at the end.
//!
//! `cargo test --test campaign` runs the short form, `cargo test --test campaign -- --ignored --nocapture` the long one of about
//! half an hour; `QUADFROG_CAMPAIGN` chooses scenarios whose name or kind contains its text, `QUADFROG_SEED` (1) begins
//! another series of random moments. Time decides when a fault occurs and never whether a try has passed: results are
//! compared bit for bit. `docs/reliability.md` holds the last long run.

mod damage;
mod disk;
mod kill;
#[path = "../fuzz/mutate.rs"]
mod mutate;
#[path = "../console/support/program.rs"]
mod program;
#[path = "../console/support/pty.rs"]
mod pty;
mod several;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::{Command, Stdio};
use std::time::Instant;

use mutate::Random;
use serde::Deserialize;

/// One row of the table of scenarios.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    name: String,
    kind: Kind,
    short: u32,
    long: u32,
    /// Arguments of the program.
    #[serde(default)]
    arguments: Vec<String>,
    /// Folder of `examples` with the configuration.
    config: Option<String>,
    #[serde(default)]
    trials_short: u32,
    #[serde(default)]
    trials_long: u32,
    /// Test of the normal suite.
    test: Option<String>,
    #[serde(default)]
    environment: BTreeMap<String, String>,
    /// Variable that takes the seed of a try.
    seeds: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    KillOptimize,
    KillConsole,
    FileLimit,
    DiskFull,
    DamagedJournal,
    DamagedRecording,
    ClockJump,
    SecondProgram,
    BegunAtOnce,
    Soak,
    Suite,
}

/// End of a try that did not fail.
pub enum Passed {
    /// With what is worth a word in the table.
    Tried(String),
    /// Reason: something is missing on this machine.
    Skipped(String),
}

/// One try of a scenario.
pub struct Try<'a> {
    scenario: &'a Scenario,
    long: bool,
    seed: u64,
    random: Random,
}

impl Try<'_> {
    /// The scenario's arguments of the program, with those of `more`.
    fn arguments<'s>(&'s self, more: &[&'s str]) -> Vec<&'s str> {
        self.scenario.arguments.iter().map(String::as_str).chain(more.iter().copied()).collect()
    }

    /// The arguments that name the scenario's configuration, if it has one.
    fn config(&self) -> Vec<String> {
        let folder = |name: &String| format!("{}/../examples/{name}", env!("CARGO_MANIFEST_DIR"));
        self.scenario.config.iter().flat_map(|name| ["--config".to_owned(), folder(name)]).collect()
    }

    fn run(&mut self) -> Passed {
        match self.scenario.kind {
            Kind::KillOptimize => kill::optimize(self),
            Kind::KillConsole => kill::console(self),
            Kind::FileLimit => disk::file_limit(self),
            Kind::DiskFull => disk::full(self),
            Kind::DamagedJournal => damage::journal(self),
            Kind::DamagedRecording => damage::recording(self),
            Kind::ClockJump => several::clock_jump(self),
            Kind::SecondProgram => several::second_program(self),
            Kind::BegunAtOnce => several::begun_at_once(self),
            Kind::Soak => several::soak(self),
            Kind::Suite => suite(self),
        }
    }
}

/// Runs a test of the normal suite as a process of its own.
fn suite(this: &mut Try<'_>) -> Passed {
    let test = this.scenario.test.as_ref().expect("the test of a suite");
    let mut command = Command::new(std::env::var("CARGO").unwrap_or("cargo".into()));
    command
        .args(["test", "--quiet", "--offline", "--test", test, "--", "--test-threads", "1"])
        .envs(&this.scenario.environment);
    if let Some(variable) = &this.scenario.seeds {
        command.env(variable, (this.seed * 1000).to_string());
    }
    let output = command.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).stdin(Stdio::null()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    Passed::Tried(String::new())
}

fn campaign(long: bool) {
    #[derive(Deserialize)]
    struct Table {
        scenario: Vec<Scenario>,
    }
    let Table { scenario } = toml::from_str(include_str!("scenarios.toml")).unwrap();
    let chosen = std::env::var("QUADFROG_CAMPAIGN").unwrap_or_default();
    let first: u64 = std::env::var("QUADFROG_SEED").map_or(1, |text| text.parse().expect("QUADFROG_SEED"));
    let has_kind = |scenario: &Scenario| format!("{:?}", scenario.kind).contains(&chosen);
    let mut rows = Vec::new();
    let mut failures = Vec::new();
    for scenario in scenario.iter().filter(|scenario| scenario.name.contains(&chosen) || has_kind(scenario)) {
        let tries = if long { scenario.long } else { scenario.short };
        let (mut passed, mut failed, mut notes) = (0, 0, BTreeMap::<String, u32>::new());
        let begun = Instant::now();
        for number in 0..u64::from(tries) {
            let seed = first * 10_000 + number;
            let mut this = Try { scenario, long, seed, random: Random(seed) };
            match catch_unwind(AssertUnwindSafe(|| this.run())) {
                Ok(Passed::Tried(note)) => {
                    passed += 1;
                    *notes.entry(note).or_default() += 1;
                }
                Ok(Passed::Skipped(reason)) => *notes.entry(format!("skipped: {reason}")).or_default() += 1,
                Err(cause) => {
                    failed += 1;
                    let text = cause.downcast_ref::<String>().map(String::as_str);
                    let text = text.or_else(|| cause.downcast_ref::<&str>().copied()).unwrap_or("no text");
                    failures.push(format!("{}, seed {seed}: {text}", scenario.name));
                }
            }
        }
        if tries > 0 {
            notes.remove("");
            let notes: Vec<String> = notes.into_iter().map(|(note, count)| format!("{count} {note}")).collect();
            let seconds = begun.elapsed().as_secs();
            rows.push(format!(
                "| {} | {tries} | {passed} | {failed} | {} | {seconds} |",
                scenario.name,
                notes.join("; ")
            ));
        }
    }
    println!("| scenario | tries | passed | failed | outcomes | s |\n|---|---|---|---|---|---|\n{}", rows.join("\n"));
    assert!(!rows.is_empty(), "no scenario has {chosen} in its name or kind");
    assert!(failures.is_empty(), "{} tries failed:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn the_short_campaign_fails_nowhere() {
    campaign(false);
}

#[test]
#[ignore = "half an hour: see the head of this file"]
fn the_long_campaign_fails_nowhere() {
    campaign(true);
}
