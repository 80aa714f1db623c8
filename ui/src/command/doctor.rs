//! `quadfrog doctor`: what this machine can do for a control thread and for the console, line by line, and what to do about the
//! rest.

use std::fmt;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use color_eyre::eyre::eyre;
use quadfrog::config::Config;
use quadfrog::realtime::scheduling::{ALLOW_LOCKING, ALLOW_PRIORITY, Scheduling};
use quadfrog::realtime::{system, thread};
use quadfrog::recording::disk;
use quadfrog::trial::Backend;
use quadfrog_console::line::Place;

use super::Failure;

/// Wake-ups that are measured: one second of them.
const WAKE_UPS: usize = 1000;

#[derive(Debug, Args)]
pub struct DoctorArguments {
    /// Where the folders of new studies are made
    #[arg(long, value_name = "DIR", default_value = "recordings")]
    output: PathBuf,
    /// Folder whose TOML files replace those of the configuration, whole or key by key
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
}

/// How an item stands.
enum Verdict {
    Good,
    /// The simulator works all the same; a robot may not.
    Weak(String),
    /// Nothing works.
    Broken(String),
}

struct Line {
    item: &'static str,
    found: String,
    verdict: Verdict,
}

impl Line {
    fn new(item: &'static str, found: impl Into<String>, good: bool, remedy: &str) -> Line {
        let verdict = if good { Verdict::Good } else { Verdict::Weak(remedy.to_owned()) };
        Line { item, found: found.into(), verdict }
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (word, remedy) = match &self.verdict {
            Verdict::Good => ("ok", None),
            Verdict::Weak(remedy) => ("warn", Some(remedy)),
            Verdict::Broken(remedy) => ("FAIL", Some(remedy)),
        };
        write!(f, "{word:<5} {:<18} {}", self.item, self.found)?;
        remedy.map_or(Ok(()), |remedy| write!(f, "\n{:>24} {remedy}", "->"))
    }
}

pub fn run(arguments: &DoctorArguments) -> Result<(), Failure> {
    let config = Config::load(arguments.config.as_deref())?;
    let scheduling = config.scheduling(Backend::Hardware);
    let mut lines = vec![kernel(), priority(scheduling), memory(), cores(), governor(), timer()];
    lines.extend(wake_up(scheduling));
    lines.extend([characters(), colours(), size(), connection()]);
    lines.push(room(&arguments.output, config.safety.pre_arm.disk_free_mb));
    for line in &lines {
        println!("{line}");
    }
    let weak = lines.iter().filter(|line| matches!(line.verdict, Verdict::Weak(_))).count();
    let broken = lines.iter().filter(|line| matches!(line.verdict, Verdict::Broken(_))).count();
    println!();
    match (weak, broken) {
        (_, 1..) => return Err(eyre!("{broken} of {} items make quadfrog unusable here", lines.len()).into()),
        (0, _) => println!("Everything is as it should be, for the simulator and for a robot."),
        (weak, _) => println!(
            "Usable. The simulator needs nothing of the {weak} marked warn; look at them before a real robot jumps."
        ),
    }
    Ok(())
}

fn kernel() -> Line {
    let build = system::kernel_build();
    let kind = build.split_whitespace().find(|word| word.starts_with("PREEMPT")).unwrap_or("no preemption named");
    Line::new(
        "kernel",
        format!("{}, {kind}", system::kernel_release()),
        system::kernel_is_realtime(),
        "a PREEMPT_RT kernel bounds the wake-up (Debian: apt-get install linux-image-rt-amd64); others are late now and then",
    )
}

fn priority(scheduling: Scheduling) -> Line {
    let (limit, asked) = (system::priority_limit(), u64::from(scheduling.priority));
    let found = format!("may be {limit}, asked for {asked} (realtime.hardware_priority)");
    Line::new("real-time priority", found, limit >= asked, ALLOW_PRIORITY)
}

fn memory() -> Line {
    match system::memlock_limit() {
        None => Line::new("locked memory", "without limit", true, ""),
        Some(bytes) => Line::new("locked memory", format!("{} MB at most", bytes / 1_000_000), false, ALLOW_LOCKING),
    }
}

fn cores() -> Line {
    let count = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let isolated = system::isolated_cores();
    let found = match isolated.as_slice() {
        [] => format!("{count}, none isolated"),
        cores => format!("{count}, isolated: {cores:?}"),
    };
    let remedy = "keep one of two or more free for the control thread (boot parameter isolcpus=N, or realtime.core): it is late less often";
    Line::new("cores", found, count >= 2 && !isolated.is_empty(), remedy)
}

fn governor() -> Line {
    let governors = system::governors();
    let good = governors.iter().all(|governor| governor == "performance");
    let found = if governors.is_empty() { "no frequency control".to_owned() } else { governors.join(", ") };
    Line::new("cpu governor", found, good, "sudo cpupower frequency-set -g performance")
}

fn timer() -> Line {
    match system::timer_resolution_ns() {
        Ok(ns) => {
            let remedy = "the kernel has no high-resolution timers (CONFIG_HIGH_RES_TIMERS): 1 kHz cannot be kept";
            Line::new("timer", format!("{ns} ns"), ns <= 1000, remedy)
        }
        Err(error) => Line {
            item: "timer",
            found: error.to_string(),
            verdict: Verdict::Broken("the monotonic clock cannot be read".to_owned()),
        },
    }
}

/// What a thread is granted that is scheduled as the control thread on hardware would be, and a second of its wake-ups.
fn wake_up(scheduling: Scheduling) -> Vec<Line> {
    let measured = std::thread::spawn(move || {
        let granted = scheduling.apply();
        let mut lateness = Vec::with_capacity(WAKE_UPS);
        let paced = thread::pace(Duration::from_millis(1), thread::CONTROL_PHASE, |instant| {
            lateness.push(instant.lateness_ns);
            if lateness.len() == WAKE_UPS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        lateness.sort_unstable();
        paced.map(|()| (granted, lateness))
    });
    let broken = |found: String, remedy: &str| {
        vec![Line { item: "wake-up lateness", found, verdict: Verdict::Broken(remedy.to_owned()) }]
    };
    match measured.join() {
        Ok(Ok((granted, lateness))) => {
            let favours: Vec<_> = granted.favours.iter().map(ToString::to_string).collect();
            let mut lines = vec![Line::new("control thread", favours.join(", "), true, "")];
            lines.extend(granted.shortfalls.iter().map(|shortfall| {
                let found = format!("not {}: {}", shortfall.favour, shortfall.reason);
                Line::new("control thread", found, false, shortfall.remedy)
            }));
            let at = |rank: usize| lateness[rank.min(lateness.len() - 1)] as f64 * 1e-3;
            let (p50, p99, most) = (at(WAKE_UPS / 2), at(WAKE_UPS * 99 / 100), at(WAKE_UPS - 1));
            let found = format!("p50 {p50:.0} us, p99 {p99:.0} us, worst {most:.0} us of {WAKE_UPS}");
            let remedy = "a robot is not armed while p99 is above 500 us: see the lines above; end other programs";
            lines.push(Line::new("wake-up lateness", found, p99 < 500.0, remedy));
            lines
        }
        Ok(Err(error)) => broken(error.to_string(), "the monotonic clock cannot be waited on"),
        Err(_) => broken("the measuring thread broke down".to_owned(), "please report it"),
    }
}

/// Whether the console would notice that its operator is gone.
fn connection() -> Line {
    let (found, remedy) = match Place::of(|name| std::env::var(name).ok()) {
        Place::Multiplexer => (
            "tmux or screen",
            "it lives on when your connection ends, and the robot with it: for a robot start quadfrog outside",
        ),
        Place::Ssh(Some(_)) => (
            "SSH",
            "a dead line lands the robot after two seconds or more, but only the line from this machine to the next is seen: \
             ClientAliveInterval 1, ClientAliveCountMax 2 in sshd_config sees all of it",
        ),
        Place::Ssh(None) => (
            "SSH, but SSH_CONNECTION cannot be read",
            "a dead line is noticed only if sshd looks for it: ClientAliveInterval 1, ClientAliveCountMax 2 in sshd_config",
        ),
        Place::Here => ("a terminal of this machine", ""),
    };
    Line::new("connection", found, remedy.is_empty(), remedy)
}

/// The first that is set decides (POSIX, Base Definitions, 8.2).
fn characters() -> Line {
    let set = ["LC_ALL", "LC_CTYPE", "LANG"].iter().find_map(|name| std::env::var(name).ok().filter(|v| !v.is_empty()));
    let locale = set.unwrap_or_else(|| "no locale".to_owned());
    let upper = locale.to_uppercase();
    let good = upper.contains("UTF-8") || upper.contains("UTF8");
    Line::new(
        "characters",
        locale,
        good,
        "without UTF-8 charts are drawn in ASCII (--ascii); set LANG=C.UTF-8 for finer ones",
    )
}

fn colours() -> Line {
    let variable = |name| std::env::var(name).unwrap_or_default();
    let (term, depth) = (variable("TERM"), variable("COLORTERM"));
    let found = match (term.as_str(), depth.as_str()) {
        _ if !variable("NO_COLOR").is_empty() => "none asked for (NO_COLOR)",
        (_, "truecolor" | "24bit") => "24 bits",
        (term, _) if term.contains("256color") => "256",
        ("" | "dumb", _) => "unknown",
        _ => "16",
    };
    let remedy = "TERM says nothing of this terminal; --color 16, 256 or true chooses";
    Line::new("colours", format!("{found} (TERM={term})"), !["", "dumb"].contains(&term.as_str()), remedy)
}

fn size() -> Line {
    match crossterm::terminal::size() {
        Ok((columns, rows)) => {
            let remedy = "below 80x24 only the mode, STOP and the link are shown; make the window larger";
            Line::new("terminal size", format!("{columns}x{rows}"), columns >= 80 && rows >= 24, remedy)
        }
        Err(_) => Line::new("terminal size", "not a terminal", false, "run the console itself in a terminal"),
    }
}

/// Room in the folder, or in the nearest one above it that exists.
fn room(folder: &Path, needed_mb: u32) -> Line {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let existing = absolute.ancestors().find(|path| path.exists()).unwrap_or(Path::new("/"));
    match disk::free_mb(existing) {
        Ok(free) => {
            let found = format!("{free} MB free for {}", absolute.display());
            let remedy = format!("a robot is not armed with less than {needed_mb} MB; make room, or choose --output");
            Line::new("disk", found, free >= u64::from(needed_mb), &remedy)
        }
        Err(error) => Line {
            item: "disk",
            found: format!("{}: {error}", existing.display()),
            verdict: Verdict::Broken("nothing can be recorded there; choose another --output".to_owned()),
        },
    }
}
