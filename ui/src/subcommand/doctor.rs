//! `quadfrog doctor`: checks of this machine for the control thread and the console, one line each, with remedies.

use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::connection::TerminalLocation;
use crate::put_line;
use anyhow::anyhow;
use clap::Args;
use quadfrog::control::settings::ArmingLimits;
use quadfrog::realtime::scheduling::{ALLOW_LOCKING, ALLOW_PRIORITY, Scheduling};
use quadfrog::realtime::{system, thread};
use quadfrog::recording::disk;
use quadfrog::session::parallel;
use quadfrog::trial::Backend;

use super::arguments;
use super::console::settings;
use super::failure::Failure;

/// Number of wake-ups measured, at 1 kHz.
const WAKE_UPS: usize = 1000;

#[derive(Debug, Args)]
pub struct DoctorArguments {
    /// Parent folder of new studies
    #[arg(long, value_name = "DIR", default_value = "recordings")]
    output: PathBuf,
    /// Folder whose TOML files replace those of the configuration, whole or key by key
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
}

/// The status of an item, with the remedy.
enum ItemStatus {
    Good,
    /// The simulator works; a robot may not.
    Weak(String),
    /// Nothing works.
    Broken(String),
}

/// A checked property of the machine.
struct DoctorItem {
    name: &'static str,
    found: String,
    status: ItemStatus,
}

impl DoctorItem {
    fn new(name: &'static str, found: impl Into<String>, good: bool, remedy: &str) -> DoctorItem {
        let status = if good { ItemStatus::Good } else { ItemStatus::Weak(remedy.to_owned()) };
        DoctorItem { name, found: found.into(), status }
    }

    fn broken(name: &'static str, found: String, remedy: &str) -> DoctorItem {
        DoctorItem { name, found, status: ItemStatus::Broken(remedy.to_owned()) }
    }
}

impl fmt::Display for DoctorItem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (label, remedy) = match &self.status {
            ItemStatus::Good => ("ok", None),
            ItemStatus::Weak(remedy) => ("warn", Some(remedy)),
            ItemStatus::Broken(remedy) => ("FAIL", Some(remedy)),
        };
        write!(f, "{label:<5} {:<18} {}", self.name, self.found)?;
        remedy.map_or(Ok(()), |remedy| write!(f, "\n{:>24} {remedy}", "->"))
    }
}

pub fn run(arguments: &DoctorArguments) -> Result<(), Failure> {
    let config = arguments::load_config(arguments.config.as_deref())?;
    settings(&config)?;
    let scheduling = config.scheduling(Backend::Hardware);
    let mut items = vec![kernel(), priority(scheduling), memory(), cores(), governor(), timer()];
    items.extend(wake_up(scheduling, &config.safety.arming));
    items.extend([characters(), colours(), size(), connection()]);
    items.push(disk_space(&arguments.output, config.safety.arming.disk_free_mb));
    items.push(folder(&arguments.output));
    for item in &items {
        put_line!("{item}");
    }
    let weak = items.iter().filter(|item| matches!(item.status, ItemStatus::Weak(_))).count();
    let broken = items.iter().filter(|item| matches!(item.status, ItemStatus::Broken(_))).count();
    put_line!();
    match (weak, broken) {
        (_, 1..) => return Err(anyhow!("{broken} of {} items make quadfrog unusable here", items.len()).into()),
        (0, _) => put_line!("All items are ok, for the simulator and for a robot."),
        (weak, _) => put_line!("Usable with the simulator. Resolve the {weak} warnings before a real robot jumps."),
    }
    Ok(())
}

fn kernel() -> DoctorItem {
    let build = system::kernel_build();
    let kind = build.split_whitespace().find(|word| word.starts_with("PREEMPT")).unwrap_or("unknown preemption model");
    DoctorItem::new(
        "kernel",
        format!("{}, {kind}", system::kernel_release()),
        system::kernel_is_realtime(),
        "a PREEMPT_RT kernel bounds the wake-up latency (Debian: apt-get install linux-image-rt-amd64)",
    )
}

fn priority(scheduling: Scheduling) -> DoctorItem {
    let (limit, asked) = (system::priority_limit(), u64::from(scheduling.priority));
    let found = format!("allowed {limit}, requested {asked} (realtime.hardware_priority)");
    DoctorItem::new("real-time priority", found, limit >= asked, ALLOW_PRIORITY)
}

fn memory() -> DoctorItem {
    let limit = system::memlock_limit();
    let found = limit.map_or("unlimited".to_owned(), |bytes| format!("{} MB at most", bytes / 1_000_000));
    DoctorItem::new("locked memory", found, limit.is_none(), ALLOW_LOCKING)
}

fn cores() -> DoctorItem {
    let count = parallel::cores();
    let isolated = system::isolated_cores();
    let found = match isolated.as_slice() {
        [] => format!("{count}, none isolated"),
        cores => format!("{count}, isolated: {cores:?}"),
    };
    let remedy = "reserve one of two or more cores for the control thread (boot parameter isolcpus=N, or realtime.core): fewer late ticks";
    DoctorItem::new("cores", found, count >= 2 && !isolated.is_empty(), remedy)
}

fn governor() -> DoctorItem {
    let governors = system::governors();
    let good = governors.iter().all(|governor| governor == "performance");
    let found = if governors.is_empty() { "no frequency control".to_owned() } else { governors.join(", ") };
    DoctorItem::new("cpu governor", found, good, "sudo cpupower frequency-set -g performance")
}

fn timer() -> DoctorItem {
    let remedy = "the kernel has no high-resolution timers (CONFIG_HIGH_RES_TIMERS): 1 kHz cannot be kept";
    match system::timer_resolution_ns() {
        Ok(ns) => DoctorItem::new("timer", format!("{ns} ns"), ns <= 1000, remedy),
        Err(error) => DoctorItem::broken("timer", error.to_string(), "the monotonic clock cannot be read"),
    }
}

/// Requests the scheduling of the control thread on hardware, measures wake-ups with what was granted, and compares them with the
/// limits of the arming check.
fn wake_up(scheduling: Scheduling, limits: &ArmingLimits) -> Vec<DoctorItem> {
    const LATENCY: &str = "wake-up latency";
    let measured = std::thread::Builder::new().name("control".into()).spawn(move || {
        let granted = scheduling.apply();
        let mut lateness = Vec::with_capacity(WAKE_UPS);
        let paced = thread::pace(Duration::from_millis(1), thread::CONTROL_TICK_OFFSET, |instant| {
            lateness.push(instant.lateness_ns);
            if lateness.len() == WAKE_UPS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        lateness.sort_unstable();
        paced.map(|()| (granted, lateness))
    });
    let measured = match measured {
        Ok(measured) => measured,
        Err(error) => {
            let remedy = "allow this user more processes: `ulimit -u` shows the limit";
            return vec![DoctorItem::broken(LATENCY, format!("the system grants no thread: {error}"), remedy)];
        }
    };
    match measured.join() {
        Ok(Ok((granted, lateness))) => {
            let settings: Vec<_> = granted.granted.iter().map(ToString::to_string).collect();
            let mut items = Vec::new();
            if !settings.is_empty() {
                items.push(DoctorItem::new("control thread", settings.join(", "), true, ""));
            }
            items.extend(granted.denied.iter().map(|denied| {
                let found = format!("not {}: {}", denied.setting, denied.reason);
                DoctorItem::new("control thread", found, false, denied.remedy)
            }));
            let at = |rank: usize| lateness[rank.min(lateness.len() - 1)] as f64 * 1e-3;
            let (p50, p99, max) = (at(WAKE_UPS / 2), at(WAKE_UPS * 99 / 100), at(WAKE_UPS - 1));
            let late = lateness.iter().filter(|ns| **ns as f64 * 1e-6 > limits.late_ms).count();
            let (late_share, late_ms) = (late as f64 / WAKE_UPS as f64, limits.late_ms);
            let [late_percent, allowed_percent] = [late_share, limits.late_share].map(|share| 100.0 * share);
            let found = format!(
                "p50 {p50:.0} us, p99 {p99:.0} us, max {max:.0} us in {WAKE_UPS} wake-ups; \
                 {late_percent:.1} % later than {late_ms} ms, limit {allowed_percent:.1} %"
            );
            let remedy = "a robot is not armed while more are late: see the items above; end other programs";
            items.push(DoctorItem::new(LATENCY, found, late_share <= limits.late_share, remedy));
            items
        }
        Ok(Err(error)) => {
            vec![DoctorItem::broken(LATENCY, error.to_string(), "the monotonic clock cannot be waited on")]
        }
        Err(_) => vec![DoctorItem::broken(LATENCY, "the measuring thread panicked".to_owned(), "please report it")],
    }
}

/// Checks whether the console can detect the loss of its operator.
fn connection() -> DoctorItem {
    let location = TerminalLocation::of(|name| std::env::var(name).ok());
    let (found, remedy) = match (location, location.unseen()) {
        (TerminalLocation::Multiplexer, _) => (
            "tmux or screen",
            "the session keeps running when your connection ends, and so does the robot: for a robot start quadfrog outside",
        ),
        (_, Some(reason)) => (
            reason,
            "a dead connection is detected only by sshd (ClientAliveInterval 1, ClientAliveCountMax 2 in sshd_config); \
             arming a robot asks for your confirmation",
        ),
        (TerminalLocation::Ssh(_), None) => (
            "SSH",
            "a dead connection lands the robot after two seconds or more, but only the last hop to this machine is monitored: \
             ClientAliveInterval 1, ClientAliveCountMax 2 in sshd_config monitors the whole path",
        ),
        (_, None) => ("a terminal of this machine", ""),
    };
    DoctorItem::new("connection", found, remedy.is_empty(), remedy)
}

/// Checks the character set; the first variable that is set takes precedence (POSIX, Base Definitions, 8.2).
fn characters() -> DoctorItem {
    let set = ["LC_ALL", "LC_CTYPE", "LANG"].iter().find_map(|name| std::env::var(name).ok().filter(|v| !v.is_empty()));
    let locale = set.unwrap_or_else(|| "no locale".to_owned());
    let upper = locale.to_uppercase();
    let good = upper.contains("UTF-8") || upper.contains("UTF8");
    DoctorItem::new("characters", locale, good, "without UTF-8 charts are drawn in ASCII (--ascii); set LANG=C.UTF-8")
}

fn colours() -> DoctorItem {
    let variable = |name| std::env::var(name).unwrap_or_default();
    let (term, depth) = (variable("TERM"), variable("COLORTERM"));
    let found = match (term.as_str(), depth.as_str()) {
        _ if !variable("NO_COLOR").is_empty() => "none (NO_COLOR)",
        (_, "truecolor" | "24bit") => "24 bits",
        (term, _) if term.contains("256color") => "256",
        ("" | "dumb", _) => "unknown",
        _ => "16",
    };
    let remedy = "TERM does not describe this terminal; choose with --color 16, 256 or true";
    DoctorItem::new("colours", format!("{found} (TERM={term})"), !["", "dumb"].contains(&term.as_str()), remedy)
}

fn size() -> DoctorItem {
    let size = crossterm::terminal::size().ok().filter(|_| io::stdin().is_terminal());
    let Some((columns, rows)) = size else {
        return DoctorItem::new("terminal size", "not a terminal", false, "run the console itself in a terminal");
    };
    let remedy =
        "below 80x24 the screen is reduced, below 60x20 to the mode, STOP and the link; make the window larger";
    DoctorItem::new("terminal size", format!("{columns}x{rows}"), columns >= 80 && rows >= 24, remedy)
}

/// Checks whether studies can be written into the folder, or into its nearest ancestor that exists, by writing a file.
fn folder(folder: &Path) -> DoctorItem {
    const NAME: &str = "folder";
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let existing = absolute.ancestors().find(|path| path.exists()).unwrap_or(Path::new("/"));
    let probe = existing.join(format!(".quadfrog-doctor-{}", std::process::id()));
    let written = std::fs::File::create_new(&probe).and_then(|mut file| {
        let written = file.write_all(b"quadfrog doctor").and_then(|()| file.sync_all());
        std::fs::remove_file(&probe).and(written)
    });
    match written {
        Ok(()) => DoctorItem::new(NAME, format!("{} can be written", existing.display()), true, ""),
        Err(error) => {
            let remedy = "no study can be kept there; choose another --output, or change the folder's permissions";
            DoctorItem::broken(NAME, format!("{}: {error}", existing.display()), remedy)
        }
    }
}

/// Checks the free space in the folder, or in its nearest ancestor that exists.
fn disk_space(folder: &Path, needed_mb: u32) -> DoctorItem {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let existing = absolute.ancestors().find(|path| path.exists()).unwrap_or(Path::new("/"));
    match disk::free_mb(existing) {
        Ok(free) => {
            let found = format!("{free} MB free for {}", absolute.display());
            let remedy = format!("a robot is not armed with less than {needed_mb} MB; free space, or choose --output");
            DoctorItem::new("disk", found, free >= u64::from(needed_mb), &remedy)
        }
        Err(error) => {
            let found = format!("{}: {error}", existing.display());
            DoctorItem::broken("disk", found, "nothing can be recorded there; choose another --output")
        }
    }
}
