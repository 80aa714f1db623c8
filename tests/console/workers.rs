//! Several worker processes on one study, one of them killed, and a worker of Optuna, on a journal file and on a Redis
//! server (skipped with a message if `redis-server` or Optuna is missing).

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::program::{Program, assert_shows, hold};
use crate::redis::{Ended, server};
use crate::skip::skip;
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::study::Storage;
use quadfrog::optimize::trial::{Trial, TrialState};
use serde_json::Value;

/// Number of trials of all workers together.
const BUDGET: usize = 400;

/// Number of trials of the study that Optuna joins.
const SHARED: usize = 120;

/// Starts a worker on `journal` that prints JSON lines.
fn worker(program: &Program, journal: &str, budget: usize) -> Ended {
    let trials = budget.to_string();
    let join = ["optimize", "--join", journal, "--task", "forward", "--seed", "3", "--trials", &trials];
    let mut command = program.command(&[&join[..], &["--json", "--record", "none", "--config", "mine"]].concat());
    Ended(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap())
}

/// A folder with a configuration in which a dead worker's trial is abandoned after 10 s.
fn abandoning() -> Program {
    let program = Program::new();
    program.write("mine/optimize.toml", "[workers]\nabandoned_s = 10.0\n");
    program
}

/// The numbers of the trials that a worker printed until its end.
fn printed(mut worker: Ended) -> Vec<u32> {
    let output = io::read_to_string(worker.0.stdout.take().unwrap()).unwrap();
    let errors = io::read_to_string(worker.0.stderr.take().unwrap()).unwrap();
    assert!(worker.0.wait().unwrap().success(), "{errors}");
    let number = |line: &str| serde_json::from_str::<Value>(line).unwrap()["trial"].as_u64().unwrap() as u32;
    output.lines().map(number).collect()
}

fn trials(storage: &Storage) -> Vec<Trial> {
    storage.journal(Durability::Buffered).unwrap().state().studies()[0].trials.clone()
}

/// Checks that no trial is lost or duplicated and the budget is met exactly.
fn check(trials: &[Trial], by_worker: &BTreeMap<u32, Vec<u32>>, printed: &[u32]) {
    let counted: Vec<&Trial> = trials.iter().filter(|t| t.state == TrialState::Complete).collect();
    assert_eq!(counted.len(), BUDGET, "the budget is met to the trial");
    assert_eq!(trials.iter().filter(|t| t.state == TrialState::Running).count(), 0, "nothing is left running");
    assert!(trials.iter().enumerate().all(|(i, t)| t.number as usize == i));
    let unique: BTreeSet<u32> = printed.iter().copied().collect();
    assert_eq!(unique.len(), printed.len(), "no trial was run by two workers");
    for number in printed {
        assert!(trials[*number as usize].state.is_finished(), "trial {number} was judged and is lost");
    }
    let points: BTreeSet<String> = counted.iter().map(|t| format!("{:?}", t.parameters)).collect();
    assert_eq!(points.len(), BUDGET, "no point was proposed twice");
    println!("trials per worker: {:?}", by_worker.iter().map(|(w, t)| (*w, t.len())).collect::<Vec<_>>());
}

fn by_worker(trials: &[Trial]) -> BTreeMap<u32, Vec<u32>> {
    let mut workers: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for trial in trials {
        let worker = trial.user_attributes.get("worker").and_then(Value::as_u64).unwrap_or(0) as u32;
        workers.entry(worker).or_default().push(trial.number);
    }
    workers
}

fn four_workers(journal: &str, storage: &Storage) {
    let program = abandoning();
    let mut victim = worker(&program, journal, BUDGET);
    let mut lines = BufReader::new(victim.0.stdout.take().unwrap()).lines();
    let number = |line: String| serde_json::from_str::<Value>(&line).unwrap()["trial"].as_u64().unwrap() as u32;
    // The first worker makes the study.
    let mut seen = vec![number(lines.next().expect("a first trial").unwrap())];
    let others: Vec<Ended> = (0..3).map(|_| worker(&program, journal, BUDGET)).collect();
    seen.extend(lines.by_ref().take(30).map(|line| number(line.unwrap())));
    // The trials it printed before the kill are judged.
    victim.0.kill().unwrap();
    victim.0.wait().unwrap();
    seen.extend(lines.map_while(Result::ok).filter(|line| line.ends_with('}')).map(number));
    seen.extend(others.into_iter().flat_map(printed));
    let trials = trials(storage);
    let workers = by_worker(&trials);
    assert_eq!(workers.len(), 4, "{:?}", workers.keys());
    check(&trials, &workers, &seen);
    let seeds: BTreeSet<u64> =
        trials.iter().map(|t| t.system_attributes["quadfrog:draws"]["seed"].as_u64().unwrap()).collect();
    assert_eq!(seeds.len(), 4, "each worker has its own random streams");
}

#[test]
fn four_workers_on_a_file_one_of_them_killed_meet_the_budget_to_the_trial() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("shared.log");
    four_workers(file.to_str().unwrap(), &Storage::File(file.clone()));
}

#[test]
fn four_workers_on_a_redis_server_one_of_them_killed_meet_the_budget_to_the_trial() {
    let Some((_server, url)) = server() else { return };
    four_workers(&url, &Storage::Redis(url.clone()));
}

#[test]
fn a_python_worker_joins_the_study() {
    let has = Command::new("python3").args(["-c", "import optuna"]).stderr(Stdio::null()).status();
    if !has.is_ok_and(|status| status.success()) {
        skip("python3 has no optuna");
        return;
    }
    let program = abandoning();
    let file = program.path("shared.log");
    let journal = file.to_str().unwrap();
    let mut ours = worker(&program, journal, SHARED);
    let mut lines = BufReader::new(ours.0.stdout.take().unwrap()).lines();
    for _ in 0..20 {
        lines.next().expect("a trial").unwrap();
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/support/optuna_study.py");
    let python = Command::new("python3")
        .args([script, "continue", journal, "25", "8", "forward-seed3"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut count = 20;
    for line in lines {
        line.unwrap();
        count += 1;
    }
    assert!(ours.0.wait().unwrap().success());
    let output = python.wait_with_output().unwrap();
    assert!(output.status.success());
    let theirs: Value = serde_json::from_slice(&output.stdout).unwrap();
    let trials = trials(&Storage::File(file));
    for theirs in theirs.as_array().unwrap() {
        let trial = &trials[theirs["number"].as_u64().unwrap() as usize];
        trial.parameters.iter().for_each(|(name, value)| assert_eq!(theirs["params"][name], serde_json::json!(value)));
    }
    let counted = trials.iter().filter(|t| t.state == TrialState::Complete).count();
    let python = trials.iter().filter(|t| !t.system_attributes.contains_key("quadfrog:draws")).count();
    println!("{count} trials of ours, {python} of Python's");
    assert_eq!(python, 25);
    assert_eq!(counted, count + python);
    // Optuna does not know the budget and may exceed it after our workers have ended.
    assert!((SHARED..=SHARED + 25).contains(&counted), "{counted}");
}

/// It takes budget, robot, task and configuration from the folder; contradicting arguments are refused.
#[test]
fn a_worker_joins_the_study_of_a_folder() {
    let program = Program::new();
    program.write("mine/optimize.toml", "[bounds]\nFz = [200.0, 300.0]\n");
    let first = ["optimize", "--trials", "4", "--seed", "2", "--record", "none", "--output", "first"];
    program.text(&[&first[..], &["--config", "mine"]].concat());
    let study = program.study("first");
    // The lock of a running session does not prevent joining.
    let _held = hold(&study);
    let study = study.to_str().unwrap();
    let joined = program.text(&["optimize", "--join", study, "--json", "--record", "none"]);
    assert_eq!(joined, "", "the budget of 4 is met already");
    let trials = program.trials(&["optimize", "--join", study, "--trials", "9", "--json", "--record", "all"]);
    assert_eq!(trials.len(), 5, "{trials:?}");
    for trial in trials {
        assert!((200.0..=300.0).contains(&trial["params"]["Fz"].as_f64().unwrap()), "{trial}");
    }
    let mut own = program.studies("recordings").into_iter();
    assert!(own.any(|own| own.join("session.mcap").is_file() && !own.join("study.log").exists()));
    program.refused(&["optimize", "--join", study, "--model", "a1"]);
    assert_shows(&program.refused(&["optimize", "--join", study, "--task", "twist-cw"]), &["forward seed 2"]);
    let refused = program.run(&["optimize", "--join", "redis://127.0.0.1:1/0"]);
    assert_eq!(refused.status.code(), Some(1), "a server that does not answer is not unusable input");
}

/// Regression: `C` of the console was named, which has no study on a server.
#[test]
fn a_point_queued_on_a_server_is_run_by_a_worker_with_more_trials() {
    let Some((_server, url)) = server() else { return };
    let program = Program::new();
    let join = ["optimize", "--join", &url, "--record", "none", "--trials"];
    program.text(&[&join[..], &["1", "--task", "forward", "--seed", "3"]].concat());
    let queued = program.text(&["study", "enqueue", &url, "Fx=77"]);
    assert_shows(&queued, &["Queued as trial 1", "what is queued runs once a worker joins with more --trials"]);
    program.text(&[&join[..], &["2"]].concat());
    assert_eq!(trials(&Storage::Redis(url))[1].parameter("Fx"), Some(77.0));
}
