//! A study on a Redis server, shared by workers: processes of this test program, and Python. Skipped with a message if
//! `redis-server` is not installed.

use crate::redis;
use crate::skip;
use crate::support;
use quadfrog::optimize::ask::SamplerConfig;
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::study::{Storage, Study, StudyError};
use quadfrog::optimize::trial::{Trial, TrialState};
use redis::{Ended, address, free_port, server, start};
use serde_json::{Value, json};
use skip::skip;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
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
        .args(["redis_storage::worker", "--exact"])
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
        skip("python3 has no optuna with redis");
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
    let port = free_port();
    let url = format!("redis://:secret@127.0.0.1:{port}/0");
    let error = open(&url, 0).unwrap_err().to_string();
    assert!(error.contains(&format!("127.0.0.1:{port}")) && !error.contains("secret"), "{error}");
    assert!(!Storage::Redis(url).to_string().contains("secret"));
    let error = open("nowhere", 0).unwrap_err().to_string();
    assert!(error.contains("redis://HOST:PORT/DB"), "{error}");
}

#[test]
fn an_address_that_cannot_be_parsed_is_refused_without_its_password() {
    for url in ["redis://:secret@:port/0", "redis://user:secret@127.0.0.1:99999/0", "redis://:secret@127.0.0.1/x"] {
        let error = open(url, 0).unwrap_err().to_string();
        assert!(!error.contains("secret") && error.contains("redis://HOST:PORT/DB"), "{error}");
        assert!(!Storage::Redis(url.to_owned()).to_string().contains("secret"));
    }
}

#[test]
fn workers_continue_after_a_restart_of_the_server() {
    let folder = tempfile::tempdir().unwrap();
    let port = free_port();
    let kept = ["--appendonly", "yes", "--appendfsync", "always", "--dir", folder.path().to_str().unwrap()];
    let Some(server) = start(port, &kept) else { return };
    let url = address(port);
    let mut study = open(&url, 0).unwrap();
    let mut worker = spawn(&url, 1, 60);
    while complete(study.trials()) < 20 {
        run(&mut study);
    }
    // SIGKILL in the middle of the worker's requests.
    drop(server);
    let restarted = std::thread::spawn(move || {
        std::thread::sleep(std::time::Duration::from_millis(500));
        start(port, &["--appendonly", "yes", "--dir", folder.path().to_str().unwrap()]).map(|server| (server, folder))
    });
    while complete(study.trials()) < 80 {
        run(&mut study);
    }
    assert!(worker.0.wait().unwrap().success(), "the worker ended with the server");
    let _server = restarted.join().unwrap().expect("the server started before");
    study.refresh().unwrap();
    let of_worker = study.trials().iter().filter(|t| t.system_attributes["quadfrog:draws"]["seed"] == 1);
    assert_eq!(complete(of_worker), 60);
    assert!(study.trials().iter().enumerate().all(|(i, t)| t.number as usize == i));
    assert_eq!(study.running().count(), 0);
}

#[test]
fn a_server_that_lost_its_data_ends_the_study_with_its_name() {
    let Some((_server, url)) = server() else { return };
    let mut study = open(&url, 0).unwrap();
    run(&mut study);
    ::redis::cmd("FLUSHALL").exec(&mut by_hand(&url)).unwrap();
    let error = study.refresh().unwrap_err().to_string();
    assert!(error.contains("lost its data") && error.contains("127.0.0.1"), "{error}");
    // Also without a read in between: a worker that only writes.
    let draft = study.draft();
    let error = study.begin(&draft, &[], &[]).unwrap_err().to_string();
    assert!(error.contains("lost its data"), "{error}");
}

/// A connection to the server for a change of its keys by hand.
fn by_hand(url: &str) -> ::redis::Connection {
    ::redis::Client::open(url).unwrap().get_connection().unwrap()
}

/// Regression: readers showed the lines before it as the whole study, and writers asked again without a pause or an end.
#[test]
fn a_missing_line_is_an_error_of_readers_and_writers() {
    let Some((_server, url)) = server() else { return };
    let mut behind = open(&url, 0).unwrap();
    run(&mut open(&url, 1).unwrap());
    let mut connection = by_hand(&url);
    let last: u32 = ::redis::cmd("GET").arg(":log_number").query(&mut connection).unwrap();
    ::redis::cmd("DEL").arg(format!(":log:{last}")).exec(&mut connection).unwrap();
    let draft = behind.draft();
    let of_writer = behind.begin(&draft, &[], &[]).unwrap_err().to_string();
    let of_reader = open(&url, 2).unwrap_err().to_string();
    for error in [of_reader, of_writer] {
        let named = format!(":log:{last}, line {}: the line is missing on the server", last + 1);
        assert!(error.contains(&named), "{error}");
    }
}

/// Regression: the lines of a new study were written over the old ones, and readers saw an empty server.
#[test]
fn lines_whose_number_was_lost_are_not_overwritten() {
    let Some((_server, url)) = server() else { return };
    run(&mut open(&url, 0).unwrap());
    let mut connection = by_hand(&url);
    let first = ::redis::cmd("GET").arg(":log:0").to_owned();
    let before: String = first.query(&mut connection).unwrap();
    ::redis::cmd("DEL").arg(":log_number").exec(&mut connection).unwrap();
    let of_reader = Storage::Redis(url.clone()).journal(Durability::Buffered).unwrap_err().to_string();
    let of_writer = open(&url, 1).unwrap_err().to_string();
    for error in [of_reader, of_writer] {
        assert!(error.contains("127.0.0.1") && error.contains("Set :log_number"), "{error}");
    }
    assert_eq!(first.query::<String>(&mut connection).unwrap(), before);
}

/// Accepts connections and never answers.
#[test]
fn a_server_that_does_not_answer_is_given_up() {
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = address(silent.local_addr().unwrap().port());
    let _accepting = std::thread::spawn(move || silent.incoming().filter_map(Result::ok).collect::<Vec<_>>());
    let error = open(&url, 0).unwrap_err().to_string();
    assert!(error.contains("127.0.0.1"), "{error}");
}

/// Forwards to a server; the answers to the first `lost` appends are dropped together with their connections.
fn proxy(server: String, lost: usize) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = address(listener.local_addr().unwrap().port());
    let lost = Arc::new(AtomicUsize::new(lost));
    std::thread::spawn(move || {
        for mut client in listener.incoming().filter_map(Result::ok) {
            let (mut upstream, lost) = (TcpStream::connect(&server).unwrap(), lost.clone());
            let (mut to_client, mut answers) = (client.try_clone().unwrap(), upstream.try_clone().unwrap());
            let drops = Arc::new(AtomicBool::new(false));
            let drop_answer = drops.clone();
            std::thread::spawn(move || {
                let mut bytes = vec![0; 1 << 16];
                while let Ok(length @ 1..) = answers.read(&mut bytes) {
                    if drop_answer.load(Ordering::Acquire) || to_client.write_all(&bytes[..length]).is_err() {
                        break;
                    }
                }
                let _ = to_client.shutdown(Shutdown::Both);
            });
            std::thread::spawn(move || {
                let mut bytes = vec![0; 1 << 16];
                while let Ok(length @ 1..) = client.read(&mut bytes) {
                    let appends = bytes[..length].windows(4).any(|word| word == b"EVAL");
                    let one_less = |left: usize| left.checked_sub(1);
                    if appends && lost.fetch_update(Ordering::AcqRel, Ordering::Acquire, one_less).is_ok() {
                        drops.store(true, Ordering::Release);
                    }
                    if upstream.write_all(&bytes[..length]).is_err() {
                        break;
                    }
                }
            });
        }
    });
    url
}

#[test]
fn a_lost_answer_doubles_no_line() {
    let Some((_server, url)) = server() else { return };
    let server = url.trim_start_matches("redis://").trim_end_matches("/0").to_owned();
    let mut study = open(&proxy(server, 5), 0).unwrap();
    for _ in 0..4 {
        run(&mut study);
    }
    let seen = open(&url, 0).unwrap();
    assert_eq!(complete(seen.trials()), 4);
    assert_eq!(seen.trials().len(), 4, "a trial was begun twice");
    assert_eq!(seen.trials(), study.trials());
}
