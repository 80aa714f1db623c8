//! Interoperability of the journal with Python's Optuna 5 and optuna-dashboard. Tests are skipped with a message if Python
//! lacks them; `pip install optuna==5.0.0 optuna-dashboard` installs them.

use crate::redis;
use crate::skip;
use crate::support;
use quadfrog::optimize::ask::{Ask, Direction, SamplerConfig, Streams};
use quadfrog::optimize::importance::divergences;
use quadfrog::optimize::journal::{Durability, Journal, JournalError, JournalFile, Operation};
use quadfrog::optimize::sampler::propose;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Outcome, Storage, Study};
use quadfrog::optimize::trial::{Distribution, Trial, TrialState, value_of};
use redis::Ended;
use serde_json::{Value, json};
use skip::skip;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use support::{begin, forward, linear, options};
use tempfile::{TempDir, tempdir};

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/support/optuna_study.py");

/// Whether Python can import `module`; prints a message if it cannot.
fn python_has(module: &str, version: &str) -> bool {
    let check = format!("import {module}; assert {module}.__version__.startswith('{version}')");
    let found = Command::new("python3").args(["-c", &check]).stderr(Stdio::null()).status().is_ok_and(|s| s.success());
    if !found {
        skip(&format!("python3 has no {module} {version}"));
    }
    found
}

fn python(arguments: &[&str]) -> Command {
    let mut command = Command::new("python3");
    command.arg(SCRIPT).args(arguments);
    command
}

/// Runs the script and parses its output.
fn optuna(arguments: &[&str]) -> Value {
    let output = python(arguments).output().expect("python3 runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("the script answers in JSON")
}

/// A journal in a temporary folder: its path, also as an argument of the script.
fn journal() -> (TempDir, PathBuf, String) {
    let folder = tempdir().unwrap();
    let path = folder.path().join("study.log");
    let text = path.to_str().unwrap().to_owned();
    (folder, path, text)
}

/// [`journal`] if Python has Optuna.
fn shared_journal() -> Option<(TempDir, PathBuf, String)> {
    python_has("optuna", "5.").then(journal)
}

fn ask<'a>(config: &'a SamplerConfig, trials: &'a [Trial], space: &'a Space, fixed: &'a [(String, f64)]) -> Ask<'a> {
    Ask { config, trials, space, fixed, direction: Direction::Maximize, prior: None }
}

fn open(path: &Path, seed: u32) -> Study {
    let options = options(forward(), SamplerConfig { seed, ..SamplerConfig::default() });
    Study::open(Storage::File(path.to_owned()), options).unwrap()
}

/// The script's objective.
fn objective(parameters: &[(String, f64)]) -> f64 {
    let u = |name: &str| forward().range(name).unwrap().scale(value_of(parameters, name).unwrap_or(1.0));
    1.0 - (u("f0") - 0.35).powi(2) - (u("Fx") - 0.6).powi(2) - (u("Fz") - 0.55).powi(2)
}

fn run(study: &mut Study, overrides: &[(String, f64)]) -> u32 {
    study.refresh().unwrap();
    let draft = study.draft();
    let number = study.begin(&draft, overrides, &[]).unwrap();
    let value = objective(&study.trial(number).unwrap().parameters);
    study.annotate(number, &[("verdict".into(), json!("accept")), ("apex_m".into(), json!(0.31))]).unwrap();
    study.tell(number, Outcome::Complete(value)).unwrap();
    number
}

fn run_several(study: &mut Study, count: usize) -> Vec<u32> {
    (0..count).map(|_| run(study, &[])).collect()
}

#[test]
fn python_reads_what_we_wrote() {
    let Some((_folder, path, journal)) = shared_journal() else { return };
    let mut study = open(&path, 3);
    for number in 0..14 {
        let overrides = [("Fx".to_owned(), 80.0)];
        run(&mut study, if number == 12 { &overrides } else { &[] });
    }
    let failing = begin(&mut study);
    study.tell(failing, Outcome::Fail).unwrap();
    study.enqueue(&[("Fz".into(), 200.0)], &[("by".into(), json!("Zoë"))]).unwrap();

    let theirs = optuna(&["summary", &journal]);
    let best = study.best().unwrap();
    assert_eq!(theirs["best"]["number"], best.number);
    assert_eq!(theirs["best"]["value"], json!(best.value));
    assert_eq!(theirs["user_attrs"], json!({"robot": "go1"}));
    assert_eq!(theirs["metric_names"], json!(["distance [m]"]));
    let trials = theirs["trials"].as_array().unwrap();
    assert_eq!(trials.len(), study.trials().len());
    for (ours, theirs) in study.trials().iter().zip(trials) {
        assert_eq!(theirs["value"], json!(ours.value), "trial {}", ours.number);
        assert_eq!(theirs["user_attrs"], json!(ours.user_attributes));
        for (name, value) in &ours.parameters {
            assert_eq!(theirs["params"][name], json!(value));
        }
    }
    assert_eq!(trials[12]["fixed"], json!({"Fx": 80.0}));
    assert_eq!(trials[14]["state"], "FAIL");
    assert_eq!((&trials[15]["state"], &trials[15]["user_attrs"]["by"]), (&json!("WAITING"), &json!("Zoë")));
}

#[test]
fn we_run_what_python_enqueued_and_both_continue_each_other() {
    let Some((_folder, path, journal)) = shared_journal() else { return };
    let mut study = open(&path, 3);
    run_several(&mut study, 6);

    optuna(&["enqueue", &journal, r#"{"f0": 1.25, "Fx": 60.5, "Fz": 240.0}"#]);
    study.refresh().unwrap();
    let draft = study.draft();
    assert!(draft.enqueued);
    assert_eq!(draft.attributes["by"], "python");
    assert_eq!(draft.parameters.iter().map(|s| s.value).collect::<Vec<_>>(), [1.25, 60.5, 240.0]);
    assert_eq!(run(&mut study, &[]), 6);

    let done = optuna(&["continue", &journal, "8", "77"]);
    study.refresh().unwrap();
    assert_eq!(study.trials().len(), 15);
    for theirs in done.as_array().unwrap() {
        let ours = study.trial(theirs["number"].as_u64().unwrap() as u32).unwrap();
        assert_eq!(ours.state, TrialState::Complete);
        ours.parameters.iter().for_each(|(n, v)| assert_eq!(theirs["params"][n], json!(v)));
    }
    run_several(&mut study, 5);

    // The next suggestion of Python equals ours for the same seed and history.
    let before = study.trials().to_vec();
    let next = optuna(&["continue", &journal, "1", "5"]);
    let config = SamplerConfig { seed: 5, ..SamplerConfig::default() };
    let ours = propose(&ask(&config, &before, &forward(), &[]), &mut Streams::new(5));
    for (p, value) in forward().parameters().iter().zip(ours.values) {
        let theirs = next[0]["params"][&p.name].as_f64().unwrap();
        assert!((value - theirs).abs() <= 1e-10 * (p.range.high - p.range.low), "{}: {value}, not {theirs}", p.name);
    }
}

#[test]
fn bounds_changed_in_mid_study_are_treated_as_optuna_does() {
    if !python_has("optuna", "5.") {
        return;
    }
    let mut compared = 0;
    for (seed, multivariate) in [(0, true), (1, true), (2, true), (0, false), (1, false)] {
        let theirs = optuna(&["bounds", "-", &seed.to_string(), &multivariate.to_string()]);
        let config = SamplerConfig { seed, multivariate, ..SamplerConfig::default() };
        let mut streams = Streams::new(seed);
        let mut trials: Vec<Trial> = Vec::new();
        for (i, theirs) in theirs.as_array().unwrap().iter().enumerate() {
            let ranges = forward().parameters().to_vec().into_iter().filter(|p| i < 32 || p.name != "f0");
            let ranges = ranges.map(|p| match p.name.as_str() {
                "Fx" if (15..25).contains(&i) => (p.name, Range::linear(40.0, 110.0)),
                _ => (p.name, p.range),
            });
            let space = Space::new(ranges).unwrap();
            let fixed: &[(String, f64)] = if i == 20 { &[("Fz".to_owned(), 225.0)] } else { &[] };
            let candidate = propose(&ask(&config, &trials, &space, fixed), &mut streams);
            let mut trial = Trial::new(i as u32, TrialState::Complete);
            for (p, value) in space.parameters().iter().zip(candidate.values) {
                let theirs = theirs[&p.name].as_f64().unwrap();
                let difference = (value - theirs).abs() / (p.range.high - p.range.low);
                assert!(difference <= 1e-10, "seed {seed} trial {i} {}: {value}, not {theirs}", p.name);
                trial.set(&p.name, value, Distribution::Float(p.range));
                compared += 1;
            }
            trial.value = Some(objective(&trial.parameters));
            trials.push(trial);
        }
    }
    println!("changed bounds: {compared} suggestions equal to Optuna's");
}

#[test]
fn three_writers_at_once_lose_nothing() {
    let Some((_folder, path, journal)) = shared_journal() else { return };
    drop(open(&path, 0));
    let theirs = python(&["continue", &journal, "100", "9"]).stdout(Stdio::piped()).spawn().unwrap();
    let ours: Vec<_> = (1..3)
        .map(|seed| {
            let path = path.clone();
            std::thread::spawn(move || run_several(&mut open(&path, seed), 100))
        })
        .collect();
    let mut numbers: Vec<u64> = ours.into_iter().flat_map(|t| t.join().unwrap()).map(u64::from).collect();
    let theirs: Value = serde_json::from_slice(&theirs.wait_with_output().unwrap().stdout).unwrap();
    numbers.extend(theirs.as_array().unwrap().iter().map(|t| t["number"].as_u64().unwrap()));
    numbers.sort_unstable();
    assert_eq!(numbers, (0..300).collect::<Vec<_>>(), "each trial has one writer");
    let study = open(&path, 0);
    assert_eq!(study.trials().iter().filter(|t| t.state == TrialState::Complete).count(), 300);
    assert_eq!(optuna(&["summary", &journal])["trials"].as_array().unwrap().len(), 300);
    assert!(!path.with_extension("log.lock").exists());
}

/// PED-ANOVA's divergences equal those of Optuna's evaluator, also after a change of the bounds.
#[test]
fn importances_are_optunas() {
    let Some((_folder, path, journal)) = shared_journal() else { return };
    let mut study = open(&path, 3);
    for trials in [12, 30, 80, 110] {
        while study.trials().len() < trials {
            run(&mut study, &[]);
        }
        if trials == 80 {
            study.search(linear([("f0", 0.75, 1.75), ("Fx", 40.0, 110.0), ("Fz", 150.0, 350.0)])).unwrap();
        }
        let theirs = optuna(&["importances", &journal]);
        for (name, ours) in divergences(study.trials(), &study.options().space, Direction::Maximize) {
            let theirs = theirs[&name].as_f64().unwrap();
            let same = (ours - theirs).abs() <= 1e-9 * theirs.abs().max(1e-6);
            assert!(same, "{trials} trials, {name}: {ours} is not {theirs}");
        }
    }
}

/// Creates the lock that a killed writer leaves.
fn dead_writers_lock(path: &Path) {
    std::os::unix::fs::symlink(path, path.with_extension("log.lock")).unwrap();
}

#[test]
fn the_lock_of_a_dead_writer_is_broken() {
    let (_folder, path, _) = journal();
    dead_writers_lock(&path);
    let file = JournalFile::new(&path, Durability::Buffered, Duration::from_millis(200)).unwrap();
    let mut journal = Journal::open(file).unwrap();
    let create = Operation::CreateStudy { name: "after".into(), directions: vec![2] };
    journal.commit(|_| Ok::<_, JournalError>(vec![create.clone()])).unwrap();
    assert_eq!(journal.state().find("after"), Some(0));
    assert!(std::fs::symlink_metadata(path.with_extension("log.lock")).is_err(), "the lock is gone");
}

#[test]
#[ignore = "takes 30 s, the grace time that Optuna gives a lock"]
fn the_lock_of_a_dead_writer_is_broken_after_thirty_seconds() {
    let (_folder, path, _) = journal();
    drop(open(&path, 0));
    dead_writers_lock(&path);
    let began = std::time::Instant::now();
    run(&mut open(&path, 0), &[]);
    println!("the lock of a dead writer was broken after {:.1} s", began.elapsed().as_secs_f64());
    assert!(began.elapsed() >= Duration::from_secs(30), "a lock may be held for 30 s");
}

/// GETs a path of the dashboard; `None` until it answers.
fn get(port: u16, path: &str) -> Option<Value> {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
    write!(stream, "GET {path} HTTP/1.0\r\nHost: localhost\r\n\r\n").ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).ok()?;
    serde_json::from_str(answer.split_once("\r\n\r\n")?.1).ok()
}

/// Polls until `ask` returns a value; fails after a minute.
fn until<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    for _ in 0..600 {
        if let Some(answer) = ask() {
            return answer;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("{what} did not happen within a minute");
}

#[test]
fn the_dashboard_shows_our_study_while_we_write() {
    let Some((_folder, path, journal)) = shared_journal().filter(|_| python_has("optuna_dashboard", "0.")) else {
        return;
    };
    let mut study = open(&path, 1);
    run_several(&mut study, 4);
    study.note(2, "slipped a little").unwrap();
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let server = "import sys, optuna_dashboard\n\
                  from optuna.storages import JournalStorage\n\
                  from optuna.storages.journal import JournalFileBackend\n\
                  optuna_dashboard.run_server(JournalStorage(JournalFileBackend(sys.argv[1])), port=int(sys.argv[2]))";
    let mut dashboard = Command::new("python3");
    dashboard.args(["-c", server, &journal, &port.to_string()]).stdout(Stdio::null()).stderr(Stdio::null());
    let _dashboard = Ended(dashboard.spawn().unwrap());
    let studies = until("the dashboard's answer", || get(port, "/api/studies"));
    let shown = &studies["study_summaries"][0];
    assert_eq!(shown["study_name"], "forward", "{studies}");
    let shows = |count: usize| {
        get(port, "/api/studies/0?after=0").filter(|d| d["trials"].as_array().is_some_and(|t| t.len() == count))
    };
    let detail = until("four trials on the dashboard", || shows(4));
    assert_eq!(detail["trials"][2]["note"]["body"], "slipped a little", "{}", detail["trials"][2]);
    assert_eq!(detail["best_trials"][0]["number"].as_u64(), study.best().map(|t| u64::from(t.number)));
    run(&mut study, &[]);
    until("the fifth trial on the dashboard", || shows(5));
}
