//! `quadfrog bench loop`: how late the control thread wakes and what a tick costs. Beside the first stands `cyclictest` at the
//! same priority and pace, beside the second the system calls of a tick without anything of ours: the machine's own share.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::ops::ControlFlow;
use std::process::Command as Program;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use color_eyre::eyre::{WrapErr, eyre};
use hdrhistogram::Histogram;
use quadfrog::config::Config;
use quadfrog::control::control_loop::ControlLoop;
use quadfrog::control::settings::ControlSettings;
use quadfrog::realtime::channel::{ScreenEnd, SessionEnd, channels};
use quadfrog::realtime::clock::{Clock, MonotonicClock};
use quadfrog::realtime::scheduling::{GrantedSettings, Scheduling};
use quadfrog::realtime::system::isolated_cores;
use quadfrog::realtime::thread::{CONTROL_PHASE, Instant, Paced, REHEARSAL_LEAD, pace, pace_rehearsed};
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::go1::Go1;
use quadfrog::robot::go1::packet::{COMMAND_LENGTH, STATE_LENGTH};
use quadfrog::robot::{Placement, Robot};
use quadfrog::sim::Simulator;
use quadfrog::sim::emulator::Emulator;
use quadfrog::telemetry::{Command, Event, Mode, Permit, Tick};
use quadfrog::trial::{Backend, Task};

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
    /// Without the rehearsal before each tick over the link (and so it is with --cyclictest)
    #[arg(long, requires = "with_link")]
    unrehearsed: bool,
    /// Also run cyclictest (package rt-tests) in turns with it, and compare
    #[arg(long)]
    cyclictest: bool,
    /// In how many turns
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100))]
    turns: u32,
}

impl LoopArguments {
    /// How long before a tick its rehearsal begins. cyclictest wakes once per period, and is compared with a thread that does.
    fn lead(&self) -> Duration {
        if self.with_link && !self.unrehearsed && !self.cyclictest { REHEARSAL_LEAD } else { Duration::ZERO }
    }
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
    /// What is left of the tick: the rings, and two readings of the clock.
    publish: Times,
    /// After the tick: fetching the places of the next one.
    prepare: Times,
    /// Before the tick: doing it on a copy.
    rehearsal: Times,
    /// Ticks that were not in READY: the robot did not stand all the time.
    elsewhere: u64,
    granted: Option<GrantedSettings>,
}

impl Measured {
    fn new() -> Measured {
        let lateness = times();
        let [wake_up, wake_up_floor, tick, read, decide, write, publish, prepare, rehearsal] =
            std::array::from_fn(|_| lateness.clone());
        Measured {
            lateness,
            wake_up,
            wake_up_floor,
            ended_ns: 0,
            tick,
            read,
            decide,
            write,
            publish,
            prepare,
            rehearsal,
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
            (&mut self.publish, &other.publish),
            (&mut self.prepare, &other.prepare),
            (&mut self.rehearsal, &other.rehearsal),
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
        let [read, decide, write] = [stages.read_ns, stages.decide_ns, stages.write_ns].map(u64::from);
        let publish = cost_ns.saturating_sub(read + decide + write);
        for (times, ns) in
            [(&mut self.read, read), (&mut self.decide, decide), (&mut self.write, write), (&mut self.publish, publish)]
        {
            times.saturating_record(ns.max(1));
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
    // All that is compared runs on the same core, where one is isolated.
    let core = isolated_cores().first().copied();
    let scheduling = Scheduling { priority: arguments.priority, core, lock_memory: true };
    let turns = if arguments.cyclictest { arguments.turns } else { 1 };
    let ticks = (arguments.seconds * 1000.0 / f64::from(turns)).ceil() as u64;
    let (mut ours, mut theirs, mut alone) = (Measured::new(), times(), times());
    for turn in 0..turns {
        // Who begins changes from turn to turn: what else the machine does meets both alike.
        if arguments.cyclictest && turn % 2 == 1 {
            cyclictest(scheduling, ticks, &mut theirs)?;
        }
        ours.add(measure(scheduling, arguments, ticks)?)?;
        if arguments.with_link {
            alone.add(exchange(scheduling, arguments.lead(), ticks)?).wrap_err("two histograms could not be added")?;
        }
        if arguments.cyclictest && turn % 2 == 0 {
            cyclictest(scheduling, ticks, &mut theirs)?;
        }
    }
    report(arguments, &ours, &theirs, &alone);
    Ok(())
}

fn report(arguments: &LoopArguments, ours: &Measured, theirs: &Times, alone: &Times) {
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
    line("  publish", &ours.publish);
    line("after it: fetch places", &ours.prepare);
    if !arguments.lead().is_zero() {
        line("before it: rehearsal", &ours.rehearsal);
    }
    if arguments.with_link {
        line("its system calls alone", alone);
    }
    println!();
    let (ticks, slept) = (ours.lateness.len(), ours.wake_up.len());
    print!("{ticks} ticks, {} of them made up for a stall, {} not in READY", ticks - slept, ours.elsewhere);
    if !arguments.lead().is_zero() {
        print!(", {} rehearsed", ours.rehearsal.len());
    }
    println!();
    if arguments.cyclictest {
        let (own, other) = (ours.wake_up_floor.value_at_quantile(0.999), theirs.value_at_quantile(0.999));
        let ratio = own.max(1000) as f64 / other.max(1000) as f64;
        println!("p99.9 of the wake-up: {ratio:.2} times cyclictest's, in whole us (asked: at most {RATIO_ASKED})");
    }
    if arguments.with_link {
        let cost = us(ours.tick.value_at_quantile(0.999));
        let machine = us(alone.value_at_quantile(0.999));
        println!(
            "p99.9 of a tick with the Go1's link: {cost:.1} us (asked: at most {TICK_ASKED_US}); of its system calls alone: {machine:.1}"
        );
    }
}

fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

/// A control thread as the engine's, whose robot stands; `ticks` of them measured.
fn measure(scheduling: Scheduling, arguments: &LoopArguments, ticks: u64) -> Result<Measured, Failure> {
    let config = Config::load(None)?;
    let mut description = RobotDescription::embedded("go1").map_err(Failure::input)?;
    let backend = if arguments.with_link { Backend::Hardware } else { Backend::Simulator };
    let mut settings = config.settings(&description, Task::Forward, backend)?;
    // A late tick is what is measured here, and standing is all that the robot does.
    (settings.late_ms, settings.idle_s) = (0.0, 0.0);
    if !arguments.with_link {
        let mut robot = Simulator::new(&description, &config.simulator).map_err(Failure::input)?;
        robot.place(&Placement { joint_position: settings.lying_position, lying: true, seed: 0 });
        let lead = arguments.lead();
        return in_a_thread(move || stand_and_measure(scheduling, &settings, ticks, lead, &mut robot));
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
        let core = scheduling.core.map(|core| usize::from(core == 0));
        let _granted = Scheduling { priority: scheduling.priority.saturating_sub(1), core, ..scheduling }.apply();
        pace(PERIOD, Duration::ZERO, |_| {
            emulator.step();
            if flag.load(Ordering::Acquire) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
    });
    let lead = arguments.lead();
    let measured = in_a_thread(move || stand_and_measure(scheduling, &settings, ticks, lead, &mut robot));
    ended.store(true, Ordering::Release);
    let _ = emulated.join();
    measured
}

/// A thread of its own: its priority ends with it.
fn in_a_thread<T: Send + 'static>(
    act: impl FnOnce() -> Result<T, color_eyre::Report> + Send + 'static,
) -> Result<T, Failure> {
    let joined = std::thread::Builder::new().name("control".into()).spawn(act).wrap_err("no thread to be had")?.join();
    Ok(joined.map_err(|_| eyre!("the control thread broke down"))??)
}

/// The two ends of a connection on the loopback.
struct Ends {
    ours: UdpSocket,
    robots: UdpSocket,
}

impl Ends {
    fn open() -> std::io::Result<Ends> {
        let ends = Ends {
            ours: UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?,
            robots: UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?,
        };
        ends.ours.connect(ends.robots.local_addr()?)?;
        ends.robots.connect(ends.ours.local_addr()?)?;
        ends.ours.set_nonblocking(true)?;
        ends.robots.set_nonblocking(true)?;
        Ok(ends)
    }

    /// What a tick asks of the system: a state is taken, the queue is found empty, a command is sent. What fails takes its time
    /// all the same.
    fn tick(&self) {
        let mut buffer = [0; 2048];
        while self.ours.recv(&mut buffer).is_ok() {}
        let _ = self.ours.send(&[0; COMMAND_LENGTH]);
    }

    /// The robot's part: the state that the next tick takes.
    fn answer(&self) {
        let mut buffer = [0; 2048];
        while self.robots.recv(&mut buffer).is_ok() {}
        let _ = self.robots.send(&[0; STATE_LENGTH]);
    }
}

/// The system calls of a tick without anything of ours, rehearsed as a tick is.
struct Exchange {
    ends: Ends,
    rehearsed: Ends,
    clock: MonotonicClock,
    taken: Times,
    left: u64,
}

impl Paced for Exchange {
    fn rehearse(&mut self) {
        self.rehearsed.answer();
        self.rehearsed.tick();
    }

    fn tick(&mut self, _: Instant) -> ControlFlow<()> {
        let began_ns = self.clock.now_ns();
        self.ends.tick();
        self.taken.saturating_record((self.clock.now_ns() - began_ns).max(1));
        self.ends.answer();
        self.left -= 1;
        if self.left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// What the system calls of a tick take by themselves, at the same pace and priority.
fn exchange(scheduling: Scheduling, lead: Duration, ticks: u64) -> Result<Times, Failure> {
    let open = || Ends::open().wrap_err("no sockets on the loopback");
    let (ends, rehearsed, clock) = (open()?, open()?, MonotonicClock::start());
    let mut exchange = Exchange { ends, rehearsed, clock, taken: times(), left: ticks };
    in_a_thread(move || {
        let _granted = scheduling.apply();
        pace_rehearsed(PERIOD, CONTROL_PHASE, lead, &mut exchange)
            .wrap_err("the monotonic clock cannot be waited on")?;
        Ok(exchange.taken)
    })
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

/// A robot that stands up, then the ticks in which it stands, measured.
struct Standing<'a> {
    body: ControlLoop,
    robot: &'a mut dyn Robot,
    clock: MonotonicClock,
    others: Others,
    /// Ticks since it began to rise; none once it stands.
    rising: Option<u64>,
    left: u64,
    measured: Measured,
}

impl Standing<'_> {
    /// What a session would ask of a robot that is still in `mode` after `ticks`.
    fn rise(&mut self, ticks: u64, mode: Mode) {
        match mode {
            Mode::Observe => self.others.ask(Command::TakeControl),
            // What is refused, because the robot has not been still for long enough, is asked again.
            Mode::Disarmed if ticks.is_multiple_of(100) => {
                let (mode_changes, given_ns) = (self.others.mode_changes, self.clock.now_ns());
                self.others.ask(Command::Arm(Permit { mode_changes, given_ns }));
            }
            _ => {}
        }
    }
}

impl Paced for Standing<'_> {
    fn rehearse(&mut self) {
        let began_ns = self.clock.now_ns();
        self.body.rehearse(&self.clock, self.robot);
        if self.rising.is_none() {
            self.measured.rehearsal.saturating_record((self.clock.now_ns() - began_ns).max(1));
        }
    }

    fn tick(&mut self, instant: Instant) -> ControlFlow<()> {
        let began_ns = self.clock.now_ns();
        let tick = self.body.tick(instant, &self.clock, self.robot);
        let cost_ns = self.clock.now_ns() - began_ns;
        let mode = tick.mode;
        if self.rising.is_none() {
            self.measured.take(instant, cost_ns, tick);
            self.left -= 1;
        }
        let began_ns = self.clock.now_ns();
        self.body.prepare();
        if self.rising.is_none() {
            self.measured.prepare.saturating_record((self.clock.now_ns() - began_ns).max(1));
        }
        if let Some(ticks) = self.rising {
            self.rise(ticks, mode);
            self.rising = (mode != Mode::Ready).then_some(ticks + 1);
        }
        self.others.attend();
        let late = self.rising.is_some_and(|ticks| ticks > LONGEST_RISE_S * 1000);
        if self.left == 0 || late { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// As the engine's control thread goes, with a rehearsal `lead` before each tick.
fn stand_and_measure(
    scheduling: Scheduling,
    settings: &ControlSettings,
    ticks: u64,
    lead: Duration,
    robot: &mut dyn Robot,
) -> Result<Measured, color_eyre::Report> {
    let mut measured = Measured::new();
    measured.granted = Some(scheduling.apply());
    let clock = MonotonicClock::start();
    let (end, session, screen, ring) = channels();
    let mut others = Others { session, screen, ticks: ring, mode_changes: 0 };
    others.attend();
    let body = ControlLoop::new(settings, end);
    let mut standing = Standing { body, robot, clock, others, rising: Some(0), left: ticks, measured };
    pace_rehearsed(PERIOD, CONTROL_PHASE, lead, &mut standing).wrap_err("the monotonic clock cannot be waited on")?;
    match standing.rising {
        Some(_) => {
            let mode = standing.body.mode().name();
            Err(eyre!("the robot did not stand within {LONGEST_RISE_S} s: it is {mode}"))
        }
        None => Ok(standing.measured),
    }
}

/// One run of the real cyclictest, into `times`; it counts in whole microseconds.
fn cyclictest(scheduling: Scheduling, loops: u64, times: &mut Times) -> Result<(), Failure> {
    let mut program = Program::new("cyclictest");
    program.args(["--quiet", "--mlockall", "--threads=1", "--interval=1000", "--histogram=100000"]);
    program.arg(format!("--loops={loops}"));
    if scheduling.priority > 0 {
        program.arg(format!("--priority={}", scheduling.priority)).arg("--policy=fifo");
    }
    if let Some(core) = scheduling.core {
        program.arg(format!("--affinity={core}"));
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
