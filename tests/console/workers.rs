//! Several worker processes on one study, one of them killed, and a worker of Optuna, on a journal file and on a Redis
//! server (skipped with a message if `redis-server` or Optuna is missing).

#[path = "../support/redis.rs"]
mod redis;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::study::Storage;
use quadfrog::optimize::trial::{Trial, TrialState};
use redis::{Ended, server};
use serde_json::Value;

/// Number of trials of all workers together.
const BUDGET: usize = 400;

/// Number of trials of the study that Optuna joins.
const SHARED: usize = 120;

/// Starts a worker on `journal` that prints JSON lines.
fn worker(folder: &Path, journal: &str, budget: usize) -> Ended {
    let trials = budget.to_string();
    let mut command = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["optimize", "--join", journal, "--task", "forward", "--seed", "3", "--trials", &trials]);
    command.args(["--json", "--record", "none", "--config", "mine"]).current_dir(folder);
    Ended(command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap())
}

/// A folder with a configuration in which a dead worker's trial is abandoned after 10 s.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("mine")).unwrap();
    fs::write(folder.path().join("mine/optimize.toml"), "[workers]\nabandoned_s = 10.0\n").unwrap();
    folder
}

/// The numbers of the trials that a worker printed until its end.
fn printed(worker: Ended) -> Vec<u32> {
    let mut worker = worker;
    let mut output = String::new();
    std::io::Read::read_to_string(&mut worker.0.stdout.take().unwrap(), &mut output).unwrap();
    let mut errors = String::new();
    std::io::Read::read_to_string(&mut worker.0.stderr.take().unwrap(), &mut errors).unwrap();
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
    let folder = folder();
    let mut victim = worker(folder.path(), journal, BUDGET);
    let mut lines = BufReader::new(victim.0.stdout.take().unwrap()).lines();
    // The first worker makes the study.
    let mut seen: Vec<u32> = Vec::new();
    let number = |line: String| serde_json::from_str::<Value>(&line).unwrap()["trial"].as_u64().unwrap() as u32;
    seen.push(number(lines.next().expect("a first trial").unwrap()));
    let others: Vec<Ended> = (0..3).map(|_| worker(folder.path(), journal, BUDGET)).collect();
    seen.extend(lines.by_ref().take(30).map(|line| number(line.unwrap())));
    // The trials it printed before the kill are judged.
    victim.0.kill().unwrap();
    victim.0.wait().unwrap();
    seen.extend(lines.map_while(Result::ok).filter(|line| line.ends_with('}')).map(number));
    let mut all = seen;
    for other in others {
        all.extend(printed(other));
    }
    let trials = trials(storage);
    let workers = by_worker(&trials);
    assert_eq!(workers.len(), 4, "{:?}", workers.keys());
    check(&trials, &workers, &all);
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
        println!("skipped: python3 has no optuna");
        return;
    }
    let folder = folder();
    let file = folder.path().join("shared.log");
    let journal = file.to_str().unwrap();
    let mut ours = worker(folder.path(), journal, SHARED);
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
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
        command.args(arguments).current_dir(folder.path()).stdin(Stdio::null()).output().unwrap()
    };
    let config = folder.path().join("mine");
    fs::create_dir(&config).unwrap();
    fs::write(config.join("optimize.toml"), "[bounds]\nFz = [200.0, 300.0]\n").unwrap();
    let made =
        run(&["optimize", "--trials", "4", "--seed", "2", "--record", "none", "--output", "first", "--config", "mine"]);
    assert!(made.status.success());
    let study = fs::read_dir(folder.path().join("first")).unwrap().next().unwrap().unwrap().path();
    let study = study.to_str().unwrap();
    // The lock of a running session does not prevent joining.
    let held = fs::File::open(Path::new(study).join("session.lock")).unwrap();
    held.lock().unwrap();
    let joined = run(&["optimize", "--join", study, "--json", "--record", "none"]);
    assert!(joined.status.success() && joined.stdout.is_empty(), "the budget of 4 is met already");
    let joined = run(&["optimize", "--join", study, "--trials", "9", "--json", "--record", "all"]);
    let text = String::from_utf8_lossy(&joined.stdout);
    assert_eq!(text.lines().count(), 5, "{text}");
    for line in text.lines() {
        let trial: Value = serde_json::from_str(line).unwrap();
        assert!((200.0..=300.0).contains(&trial["params"]["Fz"].as_f64().unwrap()), "{line}");
    }
    let own = fs::read_dir(folder.path().join("recordings")).unwrap().map(|e| e.unwrap().path());
    assert!(own.into_iter().any(|own| own.join("session.mcap").is_file() && !own.join("study.log").exists()));
    let refused = run(&["optimize", "--join", study, "--model", "a1"]);
    assert_eq!(refused.status.code(), Some(2));
    let refused = run(&["optimize", "--join", study, "--task", "twist-cw"]);
    let message = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(2) && message.contains("forward seed 2"), "{message}");
    let refused = run(&["optimize", "--join", "redis://127.0.0.1:1/0"]);
    assert_eq!(refused.status.code(), Some(1), "a server that does not answer is not unusable input");
}
