//! A study on a Redis server, shared by workers: processes of this test program, and Python. Skipped with a message if
//! `redis-server` is not installed.

#[path = "support/redis.rs"]
mod redis;
#[path = "support/optimize.rs"]
mod support;

use quadfrog::optimize::ask::SamplerConfig;
use quadfrog::optimize::study::{Storage, Study, StudyError};
use quadfrog::optimize::trial::{Trial, TrialState};
use redis::{Ended, server};
use serde_json::{Value, json};
use std::net::TcpListener;
use std::process::{Command, Stdio};
use support::{forward, options};

/// Set for the processes that this test starts as workers: `URL SEED TRIALS`.
const WORKER: &str = "QUADFROG_TEST_REDIS_WORKER";

fn open(url: &str, seed: u32) -> Result<Study, StudyError> {
    let options = options(forward(), SamplerConfig { seed, ..SamplerConfig::default() });
    Study::open(Storage::Redis(url.to_owned()), options)
}

fn run(study: &mut Study) -> u32 {
    study.refresh().unwrap();
    support::run(study, |parameters| parameters.iter().map(|(_, v)| v).sum())
}

/// Number of complete trials.
fn complete<'a>(trials: impl IntoIterator<Item = &'a Trial>) -> usize {
    trials.into_iter().filter(|t| t.state == TrialState::Complete).count()
}

/// The body of a worker process, not a test by itself.
#[test]
fn worker() {
    let Ok(task) = std::env::var(WORKER) else { return };
    let mut task = task.split(' ');
    let (url, seed, trials) = (task.next().unwrap(), task.next().unwrap(), task.next().unwrap());
    let mut study = open(url, seed.parse().unwrap()).unwrap();
    for _ in 0..trials.parse().unwrap() {
        run(&mut study);
    }
}

fn spawn(url: &str, seed: u32, trials: u32) -> Ended {
    let child = Command::new(std::env::current_exe().unwrap())
        .args(["worker", "--exact"])
        .env(WORKER, format!("{url} {seed} {trials}"))
        .stdout(Stdio::null())
        .spawn();
    Ended(child.unwrap())
}

#[test]
fn four_workers_one_of_them_killed_lose_nothing_and_double_nothing() {
    let Some((_server, url)) = server() else { return };
    let mut workers: Vec<Ended> = (1..4).map(|seed| spawn(&url, seed, 120)).collect();
    let mut victim = spawn(&url, 4, 1_000_000);
    let mut watcher = open(&url, 0).unwrap();
    let has_seed = |t: &Trial, seed: u32| t.system_attributes["quadfrog:draws"]["seed"] == seed;
    // Killed at an arbitrary point of its work.
    while watcher.trials().iter().filter(|t| has_seed(t, 4)).count() < 40 {
        watcher.refresh().unwrap();
        assert!(victim.0.try_wait().unwrap().is_none(), "the worker ended by itself");
    }
    victim.0.kill().unwrap();
    victim.0.wait().unwrap();
    for worker in &mut workers {
        assert!(worker.0.wait().unwrap().success());
    }
    watcher.refresh().unwrap();
    let trials = watcher.trials();
    let of = |seed: u32| trials.iter().filter(move |t| has_seed(t, seed));
    for seed in 1..4 {
        assert_eq!(complete(of(seed)), 120, "worker {seed}");
    }
    let left = watcher.running().count();
    assert!(left <= 1, "a killed worker leaves one trial running at most, not {left}");
    assert!(trials.len() >= 400 && trials.iter().enumerate().all(|(i, t)| t.number as usize == i));
    let mut points: Vec<String> = trials.iter().map(|t| format!("{:?}", t.parameters)).collect();
    points.sort_unstable();
    points.dedup();
    assert_eq!(points.len(), trials.len(), "no trial is there twice");
    let (all, killed) = (trials.len(), of(4).count());
    println!("redis: {all} trials of 4 workers, {killed} of them by the killed one, {left} left running");
}

#[test]
fn a_python_worker_joins_the_study() {
    let has = Command::new("python3").args(["-c", "import optuna, redis"]).stderr(Stdio::null()).status();
    if !has.is_ok_and(|s| s.success()) {
        println!("skipped: python3 has no optuna with redis");
        return;
    }
    let Some((_server, url)) = server() else { return };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/support/optuna_study.py");
    let mut study = open(&url, 1).unwrap();
    for _ in 0..12 {
        run(&mut study);
    }
    let python =
        Command::new("python3").args([script, "continue", &url, "30", "8"]).stdout(Stdio::piped()).spawn().unwrap();
    let ours: Vec<u32> = (0..30).map(|_| run(&mut study)).collect();
    let output = python.wait_with_output().unwrap();
    assert!(output.status.success());
    let theirs: Value = serde_json::from_slice(&output.stdout).unwrap();
    study.refresh().unwrap();
    assert_eq!(complete(study.trials()), 72);
    for theirs in theirs.as_array().unwrap() {
        let number = theirs["number"].as_u64().unwrap() as u32;
        assert!(!ours.contains(&number));
        let trial = study.trial(number).unwrap();
        trial.parameters.iter().for_each(|(n, v)| assert_eq!(theirs["params"][n], json!(v)));
    }
}

#[test]
fn a_server_that_is_not_there_is_named_without_its_password() {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let url = format!("redis://:secret@127.0.0.1:{port}/0");
    let error = open(&url, 0).unwrap_err().to_string();
    assert!(error.contains(&format!("127.0.0.1:{port}")) && !error.contains("secret"), "{error}");
    let error = open("nowhere", 0).unwrap_err().to_string();
    assert!(error.contains("nowhere"), "{error}");
}
