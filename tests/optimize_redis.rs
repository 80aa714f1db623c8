//! A study on a Redis server, shared by workers: processes of this test program, and Python. Skipped with a message if
//! `redis-server` is not installed.

#[path = "support/redis.rs"]
mod redis;

use quadfrog::optimize::ask::{Direction, SamplerConfig};
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Outcome, Storage, Study, StudyOptions};
use quadfrog::optimize::trial::TrialState;
use redis::{Ended, server};
use serde_json::{Value, json};
use std::net::TcpListener;
use std::process::{Command, Stdio};

/// Set for the processes that this test starts as workers: `URL SEED TRIALS`.
const WORKER: &str = "QUADFROG_TEST_REDIS_WORKER";

fn options(seed: u32) -> StudyOptions {
    let ranges = [("f0", 0.75, 1.75), ("Fx", 0.0, 150.0), ("Fz", 150.0, 350.0)];
    StudyOptions {
        name: "forward".into(),
        direction: Direction::Maximize,
        metric: "distance [m]".into(),
        space: Space::new(ranges.map(|(n, low, high)| (n.to_owned(), Range::linear(low, high)))).unwrap(),
        sampler: SamplerConfig { seed, ..SamplerConfig::default() },
        attributes: vec![("robot".into(), json!("go1"))],
        durability: Durability::Synced,
    }
}

fn open(url: &str, seed: u32) -> Study {
    Study::open(Storage::Redis(url.to_owned()), options(seed)).unwrap()
}

fn run(study: &mut Study) -> u32 {
    study.refresh().unwrap();
    let number = study.begin(&study.draft(), &[], &[]).unwrap();
    let value = study.trial(number).unwrap().parameters.iter().map(|(_, v)| v).sum();
    study.tell(number, Outcome::Complete(value)).unwrap();
    number
}

/// The body of a worker process, not a test by itself.
#[test]
fn worker() {
    let Ok(task) = std::env::var(WORKER) else { return };
    let mut task = task.split(' ');
    let (url, seed, trials) = (task.next().unwrap(), task.next().unwrap(), task.next().unwrap());
    let mut study = open(url, seed.parse().unwrap());
    (0..trials.parse().unwrap()).for_each(|_| {
        run(&mut study);
    });
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
    let mut watcher = open(&url, 0);
    let victims = |study: &Study| {
        let of = |t: &&quadfrog::optimize::trial::Trial| t.system_attributes["quadfrog:draws"]["seed"] == 4;
        study.trials().iter().filter(of).count()
    };
    // Killed at an arbitrary point of its work.
    while victims(&watcher) < 40 {
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
    let of = |seed: u32| trials.iter().filter(move |t| t.system_attributes["quadfrog:draws"]["seed"] == seed);
    for seed in 1..4 {
        assert_eq!(of(seed).filter(|t| t.state == TrialState::Complete).count(), 120, "worker {seed}");
    }
    let left = watcher.running().count();
    assert!(left <= 1, "a killed worker leaves one trial running at most, not {left}");
    assert!(trials.len() >= 400 && trials.iter().enumerate().all(|(i, t)| t.number as usize == i));
    let mut points: Vec<String> = trials.iter().map(|t| format!("{:?}", t.parameters)).collect();
    points.sort_unstable();
    points.dedup();
    assert_eq!(points.len(), trials.len(), "no trial is there twice");
    println!(
        "redis: {} trials of 4 workers, {} of them by the killed one, {left} left running",
        trials.len(),
        of(4).count()
    );
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
    let mut study = open(&url, 1);
    (0..12).for_each(|_| {
        run(&mut study);
    });
    let python =
        Command::new("python3").args([script, "continue", &url, "30", "8"]).stdout(Stdio::piped()).spawn().unwrap();
    let ours: Vec<u32> = (0..30).map(|_| run(&mut study)).collect();
    let output = python.wait_with_output().unwrap();
    assert!(output.status.success());
    let theirs: Value = serde_json::from_slice(&output.stdout).unwrap();
    study.refresh().unwrap();
    assert_eq!(study.trials().iter().filter(|t| t.state == TrialState::Complete).count(), 72);
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
    let error = Study::open(Storage::Redis(url), options(0)).unwrap_err().to_string();
    assert!(error.contains(&format!("127.0.0.1:{port}")) && !error.contains("secret"), "{error}");
    let error = Study::open(Storage::Redis("nowhere".into()), options(0)).unwrap_err().to_string();
    assert!(error.contains("nowhere"), "{error}");
}
