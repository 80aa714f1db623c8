//! `quadfrog bench loop`: how late the control thread wakes and what a tick costs, and beside it `cyclictest` at the same
//! priority and pace.

use std::net::{Ipv4Addr, SocketAddr};
use std::ops::ControlFlow;
use std::process::Command as Program;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use color_eyre::eyre::{WrapErr, eyre};
use hdrhistogram::Histogram;
use quadfrog::config::{Backend, Config};
use quadfrog::control::body::Body;
use quadfrog::control::settings::Settings;
use quadfrog::realtime::channel::{ScreenEnd, SessionEnd, channels};
use quadfrog::realtime::clock::{Clock, MonotonicClock};
use quadfrog::realtime::command::{Command, Permit, Task};
use quadfrog::realtime::scheduling::{Granted, Scheduling};
use quadfrog::realtime::telemetry::{Event, Mode, Tick};
use quadfrog::realtime::thread::{Instant, pace};
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::go1::Go1;
use quadfrog::robot::{Placement, Robot};
use quadfrog::sim::Simulator;
use quadfrog::sim::emulator::Emulator;

use super::Failure;

/// The control period.
const PERIOD: Duration = Duration::from_millis(1);
/// What is asked of the wake-up: its 99.9th percentile is at most this many times cyclictest's.
const RATIO_ASKED: f64 = 1.2;
/// What is asked of a tick over the link: its 99.9th percentile, us.
const TICK_ASKED_US: f64 = 25.0;
/// How long a robot may take until it stands, s.
const LONGEST_RISE_S: u64 = 30;

#[derive(Debug, Args)]
pub struct LoopArguments {
    /// How long is measured, s
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    seconds: f64,
    /// Priority under SCHED_FIFO, for both; 0 is an ordinary thread
    #[arg(long, value_name = "P", default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    priority: u8,
    /// Over the Go1's link to an emulated robot in this program, instead of with the simulator
    #[arg(long)]
    with_link: bool,
    /// Also run cyclictest (package rt-tests) in turns with it, and compare
    #[arg(long)]
    cyclictest: bool,
    /// In how many turns
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100))]
    turns: u32,
}

/// Times in ns, from 1 to a second, to three digits; what is longer counts as a second.
type Times = Histogram<u64>;

fn times() -> Times {
    // These bounds are legal, and a histogram with bounds never grows: recording does not allocate.
    Histogram::new_with_bounds(1, 1_000_000_000, 3).unwrap_or_else(|error| unreachable!("{error}"))
}

/// What one turn measured.
struct Measured {
    /// Of all ticks.
    lateness: Times,
    /// Of the ticks before which the thread slept. A tick that makes up for a stall follows the one before at once: it is
    /// late, but nothing woke late; cyclictest leaves such periods out.
    wake_up: Times,
    /// The same in whole microseconds, as cyclictest counts.
    wake_up_floor: Times,
    /// When the last tick ended, ns after the pace began.
    ended_ns: u64,
    tick: Times,
    read: Times,
    decide: Times,
    write: Times,
    /// Ticks that were not in READY: the robot did not stand all the time.
    elsewhere: u64,
    granted: Option<Granted>,
}

impl Measured {
    fn new() -> Measured {
        let lateness = times();
        let [wake_up, wake_up_floor, tick, read, decide, write] = std::array::from_fn(|_| lateness.clone());
        Measured {
            lateness,
            wake_up,
            wake_up_floor,
            ended_ns: 0,
            tick,
            read,
            decide,
            write,
            elsewhere: 0,
            granted: None,
        }
    }

    fn add(&mut self, other: Measured) -> Result<(), Failure> {
        for (mine, theirs) in [
            (&mut self.lateness, &other.lateness),
            (&mut self.wake_up, &other.wake_up),
            (&mut self.wake_up_floor, &other.wake_up_floor),
            (&mut self.tick, &other.tick),
            (&mut self.read, &other.read),
            (&mut self.decide, &other.decide),
            (&mut self.write, &other.write),
        ] {
            mine.add(theirs).wrap_err("two histograms could not be added")?;
        }
        self.elsewhere += other.elsewhere;
        self.granted = other.granted.or(self.granted.take());
        Ok(())
    }

    fn take(&mut self, instant: Instant, cost_ns: u64, tick: &Tick) {
        self.lateness.saturating_record(instant.lateness_ns.max(1));
        if instant.planned_ns >= self.ended_ns {
            self.wake_up.saturating_record(instant.lateness_ns.max(1));
            self.wake_up_floor.saturating_record((instant.lateness_ns / 1000 * 1000).max(1));
        }
        self.ended_ns = instant.planned_ns + instant.lateness_ns + cost_ns;
        self.tick.saturating_record(cost_ns.max(1));
        let stages = &tick.stages;
        for (times, ns) in
            [(&mut self.read, stages.read_ns), (&mut self.decide, stages.decide_ns), (&mut self.write, stages.write_ns)]
        {
            times.saturating_record(u64::from(ns).max(1));
        }
        self.elsewhere += u64::from(tick.mode != Mode::Ready);
    }
}

pub fn run(arguments: &LoopArguments) -> Result<(), Failure> {
    if !(arguments.seconds >= 0.1 && arguments.seconds <= 86_400.0) {
        return Err(Failure::input(format!("--seconds {}: give 0.1 to 86400", arguments.seconds)));
    }
    println!("{}, quadfrog {}", super::bench::machine(), env!("CARGO_PKG_VERSION"));
    if cfg!(debug_assertions) {
        println!("This is a debug build: for figures that count, run it with cargo run --release.");
    }
    let scheduling = Scheduling { priority: arguments.priority, core: None, lock_memory: true };
    let turns = if arguments.cyclictest { arguments.turns } else { 1 };
    let ticks = (arguments.seconds * 1000.0 / f64::from(turns)).ceil() as u64;
    let (mut ours, mut theirs) = (Measured::new(), times());
    for turn in 0..turns {
        // Who begins changes from turn to turn: what else the machine does meets both alike.
        if arguments.cyclictest && turn % 2 == 1 {
            cyclictest(arguments.priority, ticks, &mut theirs)?;
        }
        ours.add(measure(scheduling, arguments.with_link, ticks)?)?;
        if arguments.cyclictest && turn % 2 == 0 {
            cyclictest(arguments.priority, ticks, &mut theirs)?;
        }
    }
    report(arguments, &ours, &theirs);
    Ok(())
}

fn report(arguments: &LoopArguments, ours: &Measured, theirs: &Times) {
    if let Some(granted) = &ours.granted {
        let favours: Vec<_> = granted.favours.iter().map(ToString::to_string).collect();
        println!("granted: {}", if favours.is_empty() { "nothing".to_owned() } else { favours.join(", ") });
        for shortfall in &granted.shortfalls {
            println!("{shortfall}");
        }
    }
    println!();
    println!("{:<26}{:>10}{:>10}{:>10}{:>10}   us", "", "p50", "p99", "p99.9", "max");
    let line = |name: &str, times: &Times| {
        let at = |quantile| us(times.value_at_quantile(quantile));
        println!("{name:<26}{:>10.1}{:>10.1}{:>10.1}{:>10.1}", at(0.5), at(0.99), at(0.999), us(times.max()));
    };
    line("wake-up lateness", &ours.wake_up);
    if arguments.cyclictest {
        line("cyclictest", theirs);
    }
    line("start of all ticks", &ours.lateness);
    line("tick", &ours.tick);
    line("  read", &ours.read);
    line("  estimate, watch, decide", &ours.decide);
    line(if arguments.with_link { "  send" } else { "  write (its physics)" }, &ours.write);
    println!();
    let (ticks, slept) = (ours.lateness.len(), ours.wake_up.len());
    println!("{ticks} ticks, {} of them made up for a stall, {} not in READY", ticks - slept, ours.elsewhere);
    if arguments.cyclictest {
        let (own, other) = (ours.wake_up_floor.value_at_quantile(0.999), theirs.value_at_quantile(0.999));
        let ratio = own.max(1000) as f64 / other.max(1000) as f64;
        println!("p99.9 of the wake-up: {ratio:.2} times cyclictest's, in whole us (asked: at most {RATIO_ASKED})");
    }
    if arguments.with_link {
        let cost = us(ours.tick.value_at_quantile(0.999));
        println!("p99.9 of a tick with the Go1's link: {cost:.1} us (asked: at most {TICK_ASKED_US})");
    }
}

fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

/// A control thread as the engine's, whose robot stands; `ticks` of them measured.
fn measure(scheduling: Scheduling, with_link: bool, ticks: u64) -> Result<Measured, Failure> {
    let config = Config::load(None)?;
    let mut description = RobotDescription::embedded("go1").map_err(Failure::input)?;
    let backend = if with_link { Backend::Hardware } else { Backend::Simulator };
    let mut settings = config.settings(&description, Task::Forward, backend)?;
    // A late tick is what is measured here, and standing is all that the robot does.
    (settings.late_ms, settings.idle_s) = (0.0, 0.0);
    if !with_link {
        let mut robot = Simulator::new(&description, &config.simulator).map_err(Failure::input)?;
        robot.place(&Placement { joint_position: settings.lying_position, lying: true, seed: 0 });
        return in_a_thread(move || stand_and_measure(scheduling, &settings, ticks, &mut robot));
    }
    let anywhere = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let mut emulator = Emulator::bind(anywhere, &description, &config.simulator, 0).map_err(Failure::input)?;
    if let Some(network) = &mut description.network {
        network.address = emulator.local_address().wrap_err("the emulator has no address")?;
        network.local_port = 0;
    }
    let mut robot = Go1::open(&description, false).map_err(Failure::input)?;
    let ended = Arc::new(AtomicBool::new(false));
    let flag = ended.clone();
    let emulated = std::thread::spawn(move || {
        // A robot is on time by itself; an emulated one must not wait for the thread that is measured.
        let _granted = Scheduling { priority: scheduling.priority.saturating_sub(1), ..scheduling }.apply();
        pace(PERIOD, |_| {
            emulator.step();
            if flag.load(Ordering::Acquire) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
    });
    let measured = in_a_thread(move || stand_and_measure(scheduling, &settings, ticks, &mut robot));
    ended.store(true, Ordering::Release);
    let _ = emulated.join();
    measured
}

/// A thread of its own: its priority ends with it.
fn in_a_thread(
    act: impl FnOnce() -> Result<Measured, color_eyre::Report> + Send + 'static,
) -> Result<Measured, Failure> {
    let joined = std::thread::Builder::new().name("control".into()).spawn(act).wrap_err("no thread to be had")?.join();
    Ok(joined.map_err(|_| eyre!("the control thread broke down"))??)
}

/// The other ends of the channels, kept so that nothing counts as broken down.
struct Others {
    session: SessionEnd,
    screen: ScreenEnd,
    ticks: rtrb::Consumer<Tick>,
    mode_changes: u64,
}

impl Others {
    /// Takes what came, as the other threads would.
    fn attend(&mut self) {
        self.screen.heartbeat.beat();
        while self.ticks.pop().is_ok() {}
        while self.screen.shown.pop().is_ok() {}
        while let Ok(event) = self.session.events.pop() {
            self.mode_changes += u64::from(matches!(event, Event::Mode { .. }));
        }
    }

    fn ask(&mut self, command: Command) {
        // A full ring is emptied by the next ticks; it is asked again.
        let _ = self.session.commands.push(command);
    }
}

fn stand_and_measure<R: Robot>(
    scheduling: Scheduling,
    settings: &Settings,
    ticks: u64,
    robot: &mut R,
) -> Result<Measured, color_eyre::Report> {
    let mut measured = Measured::new();
    measured.granted = Some(scheduling.apply());
    let clock = MonotonicClock::start();
    let (end, session, screen, ring) = channels();
    let mut others = Others { session, screen, ticks: ring, mode_changes: 0 };
    others.attend();
    let mut body = Body::new(settings, end, clock.now_ns());
    let (mut rising, mut left, mut failed) = (0_u64, ticks, None);
    pace(PERIOD, |instant| {
        let began_ns = clock.now_ns();
        let tick = body.tick(instant, &clock, robot);
        let cost_ns = clock.now_ns() - began_ns;
        if rising < u64::MAX {
            rising += 1;
            match tick.mode {
                Mode::Ready => rising = u64::MAX,
                Mode::Observe => others.ask(Command::TakeControl),
                // What is refused, because the robot has not been still for long enough, is asked again.
                Mode::Disarmed if rising.is_multiple_of(100) => {
                    let given_ns = clock.now_ns();
                    others.ask(Command::Arm(Permit { mode_changes: others.mode_changes, given_ns }));
                }
                _ => {}
            }
            if rising > LONGEST_RISE_S * 1000 && rising < u64::MAX {
                failed = Some(tick.mode);
                return ControlFlow::Break(());
            }
        } else {
            measured.take(instant, cost_ns, tick);
            left -= 1;
        }
        others.attend();
        if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .wrap_err("the monotonic clock cannot be waited on")?;
    match failed {
        Some(mode) => Err(eyre!("the robot did not stand within {LONGEST_RISE_S} s: it is {}", mode.name())),
        None => Ok(measured),
    }
}

/// One run of the real cyclictest, into `times`; it counts in whole microseconds.
fn cyclictest(priority: u8, loops: u64, times: &mut Times) -> Result<(), Failure> {
    let mut program = Program::new("cyclictest");
    program.args(["--quiet", "--mlockall", "--threads=1", "--interval=1000", "--histogram=100000"]);
    program.arg(format!("--loops={loops}"));
    if priority > 0 {
        program.arg(format!("--priority={priority}")).arg("--policy=fifo");
    }
    let output = program
        .output()
        .map_err(|error| Failure::input(format!("cyclictest: {error}; install it: apt-get install rt-tests")))?;
    let said = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        let why = String::from_utf8_lossy(&output.stderr);
        return Err(eyre!("cyclictest ended with {}: {} {}", output.status, said.trim(), why.trim()).into());
    }
    let mut counted = 0;
    for line in said.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())) {
        let mut words = line.split_whitespace().filter_map(|word| word.parse::<u64>().ok());
        if let (Some(us), Some(count)) = (words.next(), words.next()) {
            times.saturating_record_n((us * 1000).max(1), count);
            counted += count;
        }
    }
    if counted == 0 {
        return Err(eyre!("cyclictest gave no histogram: {}", said.trim()).into());
    }
    Ok(())
}
