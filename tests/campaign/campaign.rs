//! The campaign of faults: scenarios as data (`tests/campaign/scenarios.toml`), one table at the end.
//!
//! `cargo test --test campaign` runs the short form, `cargo test --test campaign -- --ignored --nocapture` the long one of about
//! half an hour; `QUADFROG_CAMPAIGN` chooses scenarios whose name or kind contains its text, `QUADFROG_TRIES` limits the tries
//! of each, `QUADFROG_SEED` (1) begins another series of random moments. Two tries run at a time. Time decides when a fault
//! occurs and never whether a try has passed: results are compared bit for bit. `docs/reliability.md` holds the last long run.

mod damage;
mod disk;
mod kill;
#[path = "../fuzz/mutate.rs"]
mod mutate;
#[path = "../console/support/program.rs"]
#[allow(dead_code, reason = "each test program uses a part")]
mod program;
#[path = "../console/support/pty.rs"]
mod pty;
mod several;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

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
    /// Test program of the normal suite.
    test: Option<String>,
    /// Module of that program: its tests run.
    module: Option<String>,
    #[serde(default)]
    environment: BTreeMap<String, String>,
    /// Variable that takes the seed of a try.
    seeds: Option<String>,
}

impl Scenario {
    /// Test program and module of a [`Kind::Suite`].
    fn suite(&self) -> (&str, &str) {
        (self.test.as_deref().expect("the test program of a suite"), self.module.as_deref().expect("its module"))
    }
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
    let (test, module) = this.scenario.suite();
    let mut command = Command::new(std::env::var("CARGO").unwrap_or("cargo".into()));
    command
        .args([
            "test",
            "--quiet",
            "--offline",
            "--workspace",
            "--test",
            test,
            &format!("{module}::"),
            "--",
            "--test-threads",
            "1",
        ])
        .envs(&this.scenario.environment);
    if let Some(variable) = &this.scenario.seeds {
        command.env(variable, (this.seed * 1000).to_string());
    }
    let output = command.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).stdin(Stdio::null()).output().unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{printed}{}", String::from_utf8_lossy(&output.stderr));
    assert!(!printed.contains("ok. 0 passed"), "no test of {test} is in {module}: {printed}");
    Passed::Tried(String::new())
}

fn scenarios() -> Vec<Scenario> {
    #[derive(Deserialize)]
    struct Table {
        scenario: Vec<Scenario>,
    }
    let Table { scenario } = toml::from_str(include_str!("scenarios.toml")).unwrap();
    scenario
}

/// A number of the environment, if it is set.
fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{variable}: {text} is no number")))
}

/// Tries that run at a time. A try waits for most of its time: for a disk, a clock or a lock.
const THREADS: usize = 2;

/// Results of the tries of one scenario.
#[derive(Default)]
struct Row {
    passed: u32,
    failures: Vec<String>,
    /// Outcomes with their numbers.
    notes: BTreeMap<String, u32>,
    /// Sum over the tries.
    duration: Duration,
}

fn campaign(long: bool) {
    let chosen = std::env::var("QUADFROG_CAMPAIGN").unwrap_or_default();
    let first = number("QUADFROG_SEED").unwrap_or(1) * 10_000;
    let most = number("QUADFROG_TRIES").unwrap_or(u64::MAX);
    let is_chosen =
        |scenario: &Scenario| scenario.name.contains(&chosen) || format!("{:?}", scenario.kind).contains(&chosen);
    let scenarios: Vec<Scenario> = scenarios().into_iter().filter(is_chosen).collect();
    let tries = |scenario: &Scenario| u64::from(if long { scenario.long } else { scenario.short }).min(most);
    let all: Vec<(usize, u64)> = (0..scenarios.len())
        .flat_map(|row| (first..first + tries(&scenarios[row])).map(move |seed| (row, seed)))
        .collect();
    assert!(!all.is_empty(), "no scenario has {chosen} in its name or kind");
    let rows = Mutex::new(BTreeMap::<usize, Row>::new());
    let next = AtomicUsize::new(0);
    let run = || {
        while let Some(&(row, seed)) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
            let mut this = Try { scenario: &scenarios[row], long, seed, random: Random(seed) };
            let begun = Instant::now();
            let result = catch_unwind(AssertUnwindSafe(|| this.run()));
            let mut rows = rows.lock().unwrap();
            let row = rows.entry(row).or_default();
            row.duration += begun.elapsed();
            row.add(&this, result);
        }
    };
    std::thread::scope(|scope| (0..THREADS).for_each(|_| drop(scope.spawn(run))));
    let rows = rows.into_inner().unwrap();
    println!("| scenario | tries | passed | failed | outcomes | s |\n|---|---|---|---|---|---|");
    for (number, row) in &rows {
        let scenario = &scenarios[*number];
        let notes: Vec<String> = row.notes.iter().map(|(note, count)| format!("{count} {note}")).collect();
        println!(
            "| {} | {} | {} | {} | {} | {} |",
            scenario.name,
            tries(scenario),
            row.passed,
            row.failures.len(),
            notes.join("; "),
            row.duration.as_secs()
        );
    }
    let failures: Vec<String> = rows.into_values().flat_map(|row| row.failures).collect();
    assert!(failures.is_empty(), "{} tries failed:\n{}", failures.len(), failures.join("\n"));
}

impl Row {
    fn add(&mut self, this: &Try<'_>, result: std::thread::Result<Passed>) {
        let note = match result {
            Ok(Passed::Tried(note)) => {
                self.passed += 1;
                note
            }
            Ok(Passed::Skipped(reason)) => format!("skipped: {reason}"),
            Err(cause) => {
                let text = cause.downcast_ref::<String>().map(String::as_str);
                let text = text.or_else(|| cause.downcast_ref::<&str>().copied()).unwrap_or("no text");
                self.failures.push(format!("{}, seed {}: {text}", this.scenario.name, this.seed));
                return;
            }
        };
        if !note.is_empty() {
            *self.notes.entry(note).or_default() += 1;
        }
    }
}

#[test]
fn the_short_campaign_fails_nowhere() {
    campaign(false);
}

#[test]
fn every_scenario_is_tried_and_every_named_test_exists() {
    for scenario in scenarios() {
        assert!(scenario.long > 0 && (scenario.short > 0 || scenario.kind == Kind::Suite), "{}", scenario.name);
        if scenario.kind == Kind::Suite {
            let (test, module) = scenario.suite();
            let file = format!("{}/../tests/{test}/{module}.rs", env!("CARGO_MANIFEST_DIR"));
            assert!(Path::new(&file).exists(), "{}: no {file}", scenario.name);
        }
    }
}

#[test]
#[ignore = "half an hour: see the head of this file"]
fn the_long_campaign_fails_nowhere() {
    campaign(true);
}
