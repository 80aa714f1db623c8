//! Many workers on one study on a Redis server: time of ask and tell as trials grow, and of a late joiner's replay.
//!
//! `cargo run --release --example scaling -- WORKERS TRIALS OBJECTIVE_MS SAMPLER`, for example `64 20000 1000 tpe`; it starts
//! `redis-server` by itself. `docs/scaling.md` holds its results. The objective is a smooth function of three parameters that
//! takes OBJECTIVE_MS.

use std::error::Error;
use std::io::{self, BufRead, BufReader};
use std::net::TcpListener;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use quadfrog::optimize::ask::{SamplerConfig, SamplerKind};
use quadfrog::optimize::journal::{Durability, Journal, JournalFile, LOCK_GRACE};
use quadfrog::optimize::study::{Outcome, Storage, Study, StudyError};
use quadfrog::optimize::trial::TrialState;

#[path = "../tests/support/optimize.rs"]
mod support;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Ends its process when dropped.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Number of the trial, UTC time of its end, and milliseconds of reading, drafting, beginning and telling.
struct Row {
    trial: usize,
    end_s: f64,
    ms: [f64; 4],
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["worker", url, seed, trials, objective_ms, sampler] => {
            // Its error is a standard one only with a feature of strum that this package does not need.
            let kind: SamplerKind = sampler.parse().map_err(|error| format!("{sampler}: {error}"))?;
            worker(url, seed.parse()?, trials.parse()?, objective_ms.parse()?, kind)
        }
        [workers, trials, objective_ms, sampler] => measure(workers.parse()?, trials.parse()?, objective_ms, sampler),
        _ => Err("usage: scaling WORKERS TRIALS OBJECTIVE_MS SAMPLER".into()),
    }
}

fn open(storage: Storage, seed: u32, kind: SamplerKind) -> std::result::Result<Study, StudyError> {
    Study::open(storage, support::options(support::forward(), SamplerConfig { seed, kind, ..SamplerConfig::default() }))
}

fn worker(url: &str, seed: u32, trials: usize, objective_ms: u64, sampler: SamplerKind) -> Result<()> {
    let mut study = open(Storage::Redis(url.to_owned()), seed, sampler)?;
    loop {
        let begun = Instant::now();
        study.refresh()?;
        let read = begun.elapsed();
        let draft = study.draft();
        let drafted = begun.elapsed();
        let number = match study.begin_if(&draft, &[], &[], TrialState::Running, &|all| all.len() < trials) {
            Ok(number) => number,
            Err(StudyError::Full) => return Ok(()),
            Err(error) => return Err(error.into()),
        };
        let asked = begun.elapsed();
        sleep(Duration::from_millis(objective_ms));
        let value = |p: &[(String, f64)]| {
            p.iter().map(|(name, v)| if name == "f0" { -(v - 1.2).powi(2) } else { v / 350.0 }).sum()
        };
        let value = value(&study.trial(number)?.parameters);
        let told = Instant::now();
        study.tell(number, Outcome::Complete(value))?;
        let ms = [read, drafted - read, asked - drafted, told.elapsed()].map(|time| time.as_secs_f64() * 1e3);
        println!("{number} {} {} {} {} {}", seconds(), ms[0], ms[1], ms[2], ms[3]);
    }
}

fn seconds() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}

fn measure(workers: u32, trials: usize, objective_ms: &str, sampler: &str) -> Result<()> {
    let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
    let server = ["--port", &port.to_string(), "--bind", "127.0.0.1", "--save", "", "--appendonly", "no"];
    let _server = Ended(Command::new("redis-server").args(server).stdout(Stdio::null()).spawn()?);
    let url = format!("redis://127.0.0.1:{port}/0");
    let end = Instant::now() + Duration::from_secs(30);
    while let Err(error) = Storage::Redis(url.clone()).journal(Durability::Buffered) {
        if Instant::now() > end {
            return Err(error.into());
        }
        sleep(Duration::from_millis(50));
    }
    let (begun, begun_s) = (Instant::now(), seconds());
    let run = |seed: u32| {
        let task = ["worker", &url, &seed.to_string(), &trials.to_string(), objective_ms, sampler].map(str::to_owned);
        let child = Command::new(std::env::current_exe()?).args(task).stdout(Stdio::piped()).spawn()?;
        Ok(Ended(child))
    };
    let mut running = (1..=workers).map(run).collect::<io::Result<Vec<Ended>>>()?;
    let read = |worker: &mut Ended| {
        let output = worker.0.stdout.take().expect("piped");
        std::thread::spawn(move || {
            BufReader::new(output).lines().map_while(io::Result::ok).filter_map(|line| row(&line)).collect::<Vec<_>>()
        })
    };
    let readers: Vec<_> = running.iter_mut().map(read).collect();
    let mut rows: Vec<Row> = readers.into_iter().flat_map(|reader| reader.join().expect("read")).collect();
    for worker in &mut running {
        if !worker.0.wait()?.success() {
            return Err("a worker failed".into());
        }
    }
    rows.sort_by(|a, b| a.end_s.total_cmp(&b.end_s));
    println!(
        "{workers} workers, {} trials of {objective_ms} ms, {sampler}: {:.0} s",
        rows.len(),
        begun.elapsed().as_secs_f64()
    );
    table(&rows, begun_s);
    let mut numbers: Vec<usize> = rows.iter().map(|row| row.trial).collect();
    numbers.sort_unstable();
    if numbers != (0..trials).collect::<Vec<_>>() {
        return Err("a trial is lost or was run twice".into());
    }
    replay(&url)
}

fn row(line: &str) -> Option<Row> {
    let mut words = line.split(' ');
    let trial = words.next()?.parse().ok()?;
    let mut number = || words.next()?.parse::<f64>().ok();
    Some(Row { trial, end_s: number()?, ms: [number()?, number()?, number()?, number()?] })
}

/// Prints the rate of trials in the order of their ends, and of each step the 50th and 99th percentile.
fn table(rows: &[Row], begun_s: f64) {
    println!(
        "| trials | trials/s | read p50, p99 (ms) | draft p50, p99 (ms) | begin p50, p99 (ms) | tell p50, p99 (ms) |"
    );
    println!("|---|---|---|---|---|---|");
    let (mut rest, mut before_s, mut first) = (rows, begun_s, 0);
    for until in [1000, 2000, 5000, 10_000, 15_000, 20_000, usize::MAX] {
        let (now, later) = rest.split_at(rest.len().min(until - first));
        rest = later;
        let Some(last) = now.last() else { continue };
        let of = |step: usize| {
            let mut ms: Vec<f64> = now.iter().map(|row| row.ms[step]).collect();
            ms.sort_by(f64::total_cmp);
            let at = |share: f64| ms[((ms.len() - 1) as f64 * share) as usize];
            format!("{:.2}, {:.2}", at(0.5), at(0.99))
        };
        let rate = now.len() as f64 / (last.end_s - before_s);
        println!("| {first}-{} | {rate:.0} | {} | {} | {} | {} |", first + now.len() - 1, of(0), of(1), of(2), of(3));
        (before_s, first) = (last.end_s, first + now.len());
    }
}

/// Prints the time in which a late joiner reads the journal from the server, and from a file of the same lines, and that of
/// its first proposals.
fn replay(url: &str) -> Result<()> {
    let mut connection = redis::Client::open(url)?.get_connection()?;
    let lines = redis::cmd("GET").arg(":log_number").query::<i64>(&mut connection)? + 1;
    let info: String = redis::cmd("INFO").arg("memory").query(&mut connection)?;
    let used = info.lines().find_map(|line| line.strip_prefix("used_memory:")?.parse::<f64>().ok());
    let keys: Vec<String> = (0..lines).map(|i| format!(":log:{i}")).collect();
    let mut text = String::new();
    for keys in keys.chunks(1000) {
        let batch: Vec<String> = redis::cmd("MGET").arg(keys).query(&mut connection)?;
        batch.iter().for_each(|line| text.extend([line.trim_end(), "\n"]));
    }
    let folder = std::env::temp_dir().join(format!("quadfrog-scaling-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let file = folder.join("study.log");
    std::fs::write(&file, &text)?;
    println!(
        "journal: {lines} lines, {:.1} MB; server: {:.1} MB",
        text.len() as f64 / 1e6,
        used.unwrap_or(f64::NAN) / 1e6
    );
    for _ in 0..3 {
        let begun = Instant::now();
        let journal = Storage::Redis(url.to_owned()).journal(Durability::Buffered)?;
        let server_s = begun.elapsed().as_secs_f64();
        drop(journal);
        let begun = Instant::now();
        let journal = Journal::open(JournalFile::new(&file, Durability::Buffered, LOCK_GRACE)?)?;
        let file_s = begun.elapsed().as_secs_f64();
        let begun = Instant::now();
        drop(journal.fork());
        println!(
            "replay: server {server_s:.2} s, file {file_s:.2} s; copy of the state {:.3} s",
            begun.elapsed().as_secs_f64()
        );
    }
    std::fs::remove_dir_all(&folder)?;
    let study = open(Storage::Redis(url.to_owned()), 0, SamplerKind::Tpe)?;
    let drafts = (0..5).map(|_| {
        let begun = Instant::now();
        (study.draft(), begun.elapsed().as_secs_f64() * 1e3).1
    });
    let quickest = drafts.fold(f64::INFINITY, f64::min);
    println!("proposal of TPE over {} trials: {quickest:.1} ms, the quickest of five", study.trials().len());
    Ok(())
}
