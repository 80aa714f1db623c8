//! `quadfrog bench loop`: wake-up latency of the control thread and duration of a tick, compared with the machine's own
//! share ([`machine`]): cyclictest at the same priority and period, and the system calls of a tick alone.

use std::net::{Ipv4Addr, SocketAddr};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::{put, put_line};
use anyhow::{Context, anyhow};
use clap::Args;
use quadfrog::config::Config;
use quadfrog::control::control_loop::ControlLoop;
use quadfrog::control::settings::ControlSettings;
use quadfrog::realtime::channel::{ConsolePorts, SessionPorts, channels};
use quadfrog::realtime::clock::{Clock, MonotonicClock};
use quadfrog::realtime::scheduling::{GrantedSettings, Scheduling};
use quadfrog::realtime::system::isolated_cores;
use quadfrog::realtime::thread::{CONTROL_TICK_OFFSET, PeriodicTask, TickStart, WARM_UP_LEAD, pace, pace_with_warm_up};
use quadfrog::robot::description::RobotFiles;
use quadfrog::robot::go1::{Go1, Go1Network};
use quadfrog::robot::{Placement, Robot};
use quadfrog::sim::Simulator;
use quadfrog::sim::emulator::Emulator;
use quadfrog::telemetry::{Command, Event, Mode, Permit, Tick};
use quadfrog::trial::{Backend, Task};

use super::super::arguments::{number_within, whole_number};
use super::machine::{self, Durations, PERIOD, durations};
use crate::subcommand::failure::Failure;

/// Limit of the ratio of the 99.9th percentiles of the wake-up latency, ours to cyclictest's.
const RATIO_LIMIT: f64 = 1.2;
/// Limit of the 99.9th percentile of a tick over the link, us.
const TICK_LIMIT_US: f64 = 25.0;
/// Time limit of standing up, ticks.
const STAND_UP_LIMIT_TICKS: u64 = 30_000;

#[derive(Debug, Args)]
pub struct LoopArguments {
    /// Duration of the measurement, s
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = number_within(0.1..=86_400.0))]
    seconds: f64,
    /// SCHED_FIFO priority, of cyclictest too; 0 is an ordinary thread
    #[arg(long, value_name = "P", default_value_t = 80, value_parser = whole_number(0_u8..=99))]
    priority: u8,
    /// Use the Go1's link to an emulated robot in this program instead of the simulator
    #[arg(long)]
    with_link: bool,
    /// Omit the warm-up before each tick over the link (--cyclictest omits it too)
    #[arg(long, requires = "with_link")]
    without_warm_up: bool,
    /// Also run cyclictest (package rt-tests) in alternation, and compare
    #[arg(long)]
    cyclictest: bool,
    /// Number of alternations
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = whole_number(1_u32..=100))]
    turns: u32,
}

impl LoopArguments {
    /// Returns the time from the start of a warm-up to its tick; zero for no warm-up. cyclictest wakes once per period,
    /// so the thread compared with it does too.
    fn lead(&self) -> Duration {
        if self.with_link && !self.without_warm_up && !self.cyclictest { WARM_UP_LEAD } else { Duration::ZERO }
    }
}

/// The measurements of all turns.
struct LoopMeasurement {
    /// Start of every tick after its planned time.
    lateness: Durations,
    /// Lateness of the ticks before which the thread slept. A tick that follows the previous one at once, to make up for
    /// a stall, is left out, as in cyclictest.
    wake_up: Durations,
    /// `wake_up` in whole microseconds, the resolution of cyclictest.
    wake_up_floor: Durations,
    /// End of the last tick, ns since the start of the turn.
    end_ns: u64,
    tick: Durations,
    /// Read, decide, write, publish; the last is the remainder of the tick: the rings and two clock readings.
    stages: [Durations; 4],
    /// After the tick: prefetch of the ring slots of the next one.
    prepare: Durations,
    /// Before the tick: a discarded tick on a copy.
    warm_up: Durations,
    /// Number of ticks in a mode other than READY.
    not_ready: u64,
    granted: Option<GrantedSettings>,
}

impl LoopMeasurement {
    fn new() -> LoopMeasurement {
        let [lateness, wake_up, wake_up_floor, tick, prepare, warm_up] = std::array::from_fn(|_| durations());
        let (stages, end_ns, not_ready, granted) = (std::array::from_fn(|_| durations()), 0, 0, None);
        LoopMeasurement { lateness, wake_up, wake_up_floor, end_ns, tick, stages, prepare, warm_up, not_ready, granted }
    }

    fn record(&mut self, instant: TickStart, duration_ns: u64, tick: &Tick) {
        self.lateness.saturating_record(instant.lateness_ns.max(1));
        if instant.planned_ns >= self.end_ns {
            self.wake_up.saturating_record(instant.lateness_ns.max(1));
            self.wake_up_floor.saturating_record((instant.lateness_ns / 1000 * 1000).max(1));
        }
        self.end_ns = instant.planned_ns + instant.lateness_ns + duration_ns;
        self.tick.saturating_record(duration_ns.max(1));
        let stages = &tick.stages;
        let [read, decide, write] = [stages.read_ns, stages.decide_ns, stages.write_ns].map(u64::from);
        let publish = duration_ns.saturating_sub(read + decide + write);
        for (durations, ns) in self.stages.iter_mut().zip([read, decide, write, publish]) {
            durations.saturating_record(ns.max(1));
        }
        self.not_ready += u64::from(tick.mode != Mode::Ready);
    }
}

pub fn run(arguments: &LoopArguments) -> Result<(), Failure> {
    if arguments.cyclictest {
        machine::require_cyclictest()?;
    }
    machine::print_header("");
    // All measurements run on the same core: the first isolated one, if any.
    let core = isolated_cores().first().copied();
    let scheduling = Scheduling { priority: arguments.priority, core, lock_memory: true };
    let turns = if arguments.cyclictest { arguments.turns } else { 1 };
    let ticks = (arguments.seconds * 1000.0 / f64::from(turns)).ceil() as u64;
    let (mut ours, mut cyclictest, mut system_calls) = (LoopMeasurement::new(), durations(), durations());
    for turn in 0..turns {
        // The order alternates, so that other load on the machine meets both alike.
        if arguments.cyclictest && turn % 2 == 1 {
            machine::cyclictest(scheduling, ticks, &mut cyclictest)?;
        }
        ours = measure(scheduling, arguments, ticks, ours)?;
        if arguments.with_link {
            system_calls = machine::system_calls(scheduling, arguments.lead(), ticks, system_calls)?;
        }
        if arguments.cyclictest && turn % 2 == 0 {
            machine::cyclictest(scheduling, ticks, &mut cyclictest)?;
        }
    }
    report(arguments, &ours, &cyclictest, &system_calls);
    Ok(())
}

fn report(arguments: &LoopArguments, ours: &LoopMeasurement, cyclictest: &Durations, system_calls: &Durations) {
    if let Some(granted) = &ours.granted {
        let settings: Vec<_> = granted.granted.iter().map(ToString::to_string).collect();
        put_line!("granted: {}", if settings.is_empty() { "nothing".to_owned() } else { settings.join(", ") });
        for denied in &granted.denied {
            put_line!("{denied}");
        }
    }
    put_line!();
    put_line!("{:<26}{:>10}{:>10}{:>10}{:>10}   us", "", "p50", "p99", "p99.9", "max");
    let line = |name: &str, durations: &Durations| {
        let at = |quantile| us(durations.value_at_quantile(quantile));
        put_line!("{name:<26}{:>10.1}{:>10.1}{:>10.1}{:>10.1}", at(0.5), at(0.99), at(0.999), us(durations.max()));
    };
    line("wake-up latency", &ours.wake_up);
    if arguments.cyclictest {
        line("cyclictest", cyclictest);
    }
    line("start of all ticks", &ours.lateness);
    line("tick", &ours.tick);
    let write = if arguments.with_link { "  send" } else { "  write (with physics)" };
    for (name, durations) in ["  read", "  estimate, check, decide", write, "  publish"].iter().zip(&ours.stages) {
        line(name, durations);
    }
    line("after the tick: prefetch", &ours.prepare);
    if !arguments.lead().is_zero() {
        line("before the tick: warm-up", &ours.warm_up);
    }
    if arguments.with_link {
        line("system calls of a tick", system_calls);
    }
    put_line!();
    let (ticks, slept) = (ours.lateness.len(), ours.wake_up.len());
    put!("{ticks} ticks, {} without sleep after a stall, {} not in READY", ticks - slept, ours.not_ready);
    if !arguments.lead().is_zero() {
        put!(", {} with a warm-up", ours.warm_up.len());
    }
    put_line!();
    if arguments.cyclictest {
        let (own, other) = (ours.wake_up_floor.value_at_quantile(0.999), cyclictest.value_at_quantile(0.999));
        let ratio = own.max(1000) as f64 / other.max(1000) as f64;
        put_line!("p99.9 of the wake-up latency: {ratio:.2} times cyclictest's, in whole us (limit {RATIO_LIMIT})");
    }
    if arguments.with_link {
        let [tick, calls] = [&ours.tick, system_calls].map(|durations| us(durations.value_at_quantile(0.999)));
        put_line!(
            "p99.9 of a tick over the Go1's link: {tick:.1} us (limit {TICK_LIMIT_US}); its system calls: {calls:.1} us"
        );
    }
}

fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

/// Runs a control thread as the engine does, until its robot stands, and then adds `ticks` ticks to the measurement.
fn measure(
    scheduling: Scheduling,
    arguments: &LoopArguments,
    ticks: u64,
    measurement: LoopMeasurement,
) -> Result<LoopMeasurement, Failure> {
    let config = Config::load(None)?;
    let files = RobotFiles::embedded("go1").map_err(Failure::input)?;
    let description = files.description().map_err(Failure::input)?;
    let backend = if arguments.with_link { Backend::Hardware } else { Backend::Simulator };
    let mut settings = config.settings(&description, Task::Forward, backend)?;
    // Neither a late tick nor a long stand may end the measurement.
    (settings.late_ms, settings.idle_s) = (0.0, 0.0);
    let lead = arguments.lead();
    if !arguments.with_link {
        let mut robot = Simulator::new(&description, &config.simulator).map_err(Failure::input)?;
        robot.place(&Placement { joint_position: settings.lying_position, lying: true, seed: 0 });
        return machine::in_a_thread(move || {
            stand_and_measure(scheduling, &settings, ticks, lead, measurement, &mut robot)
        });
    }
    let any_port = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let network = Go1Network::read(&files).map_err(Failure::input)?.expect("the embedded go1 has a network");
    let mut emulator =
        Emulator::bind(any_port, &description, &network, &config.simulator, 0).map_err(Failure::input)?;
    let address = emulator.local_address().context("the address of the emulator")?;
    let mut robot = Go1::open(&Go1Network { address, local_port: 0, ..network }, false).map_err(Failure::input)?;
    let ending = Arc::new(AtomicBool::new(false));
    let flag = ending.clone();
    let emulated = std::thread::Builder::new().name("robot".into()).spawn(move || {
        // Another core: the emulated robot must keep its period without the core of the measured thread.
        let core = scheduling.core.map(|core| usize::from(core == 0));
        let _granted = Scheduling { priority: scheduling.priority.saturating_sub(1), core, ..scheduling }.apply();
        pace(PERIOD, Duration::ZERO, |start| {
            emulator.step_at(start.planned_ns);
            if flag.load(Ordering::Acquire) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
    });
    let emulated = emulated.context("the thread of the emulated robot")?;
    let measured =
        machine::in_a_thread(move || stand_and_measure(scheduling, &settings, ticks, lead, measurement, &mut robot));
    ending.store(true, Ordering::Release);
    let _ = emulated.join();
    measured
}

/// The other ends of the control thread's channels, kept open and empty as the engine's threads do.
struct ChannelEnds {
    session: SessionPorts,
    screen: ConsolePorts,
    ticks: rtrb::Consumer<Tick>,
    mode_changes: u64,
}

impl ChannelEnds {
    fn drain(&mut self) {
        self.screen.heartbeat.beat();
        while self.ticks.pop().is_ok() {}
        while self.screen.shown.pop().is_ok() {}
        while let Ok(event) = self.session.events.pop() {
            self.mode_changes += u64::from(matches!(event, Event::Mode { .. }));
        }
    }

    /// Sends a command. If the ring is full the command is dropped; the caller sends it again.
    fn send(&mut self, command: Command) {
        let _ = self.session.commands.push(command);
    }
}

/// A control loop whose robot stands up and is then measured while it stands.
struct StandingLoop<'a> {
    control: ControlLoop,
    robot: &'a mut dyn Robot,
    clock: MonotonicClock,
    channels: ChannelEnds,
    /// Ticks since the start; none once the robot stands.
    standing_up: Option<u64>,
    remaining: u64,
    measurement: LoopMeasurement,
}

impl StandingLoop<'_> {
    /// Sends the command with which a session brings the robot from `mode` towards READY.
    fn stand_up(&mut self, ticks: u64, mode: Mode) {
        match mode {
            Mode::Observe => self.channels.send(Command::TakeControl),
            // Arming is refused until the robot has been still for long enough, therefore repeated.
            Mode::Disarmed if ticks.is_multiple_of(100) => {
                let (mode_changes, given_ns) = (self.channels.mode_changes, self.clock.now_ns());
                self.channels.send(Command::Arm(Permit { mode_changes, given_ns }));
            }
            _ => {}
        }
    }
}

impl PeriodicTask for StandingLoop<'_> {
    fn warm_up(&mut self) {
        let start_ns = self.clock.now_ns();
        self.control.warm_up(&self.clock, self.robot);
        if self.standing_up.is_none() {
            self.measurement.warm_up.saturating_record((self.clock.now_ns() - start_ns).max(1));
        }
    }

    fn tick(&mut self, instant: TickStart) -> ControlFlow<()> {
        let start_ns = self.clock.now_ns();
        let tick = self.control.tick(instant, &self.clock, self.robot);
        let duration_ns = self.clock.now_ns() - start_ns;
        let mode = tick.mode;
        if self.standing_up.is_none() {
            self.measurement.record(instant, duration_ns, tick);
            self.remaining -= 1;
        }
        let start_ns = self.clock.now_ns();
        self.control.prepare();
        if self.standing_up.is_none() {
            self.measurement.prepare.saturating_record((self.clock.now_ns() - start_ns).max(1));
        }
        if let Some(ticks) = self.standing_up {
            self.stand_up(ticks, mode);
            self.standing_up = (mode != Mode::Ready).then_some(ticks + 1);
        }
        self.channels.drain();
        let timed_out = self.standing_up.is_some_and(|ticks| ticks > STAND_UP_LIMIT_TICKS);
        if self.remaining == 0 || timed_out { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

fn stand_and_measure(
    scheduling: Scheduling,
    settings: &ControlSettings,
    ticks: u64,
    lead: Duration,
    mut measurement: LoopMeasurement,
    robot: &mut dyn Robot,
) -> Result<LoopMeasurement, anyhow::Error> {
    (measurement.end_ns, measurement.granted) = (0, Some(scheduling.apply()));
    let clock = MonotonicClock::start();
    let (end, session, screen, ring) = channels();
    let mut channels = ChannelEnds { session, screen, ticks: ring, mode_changes: 0 };
    channels.drain();
    let control = ControlLoop::new(settings, end);
    let mut standing =
        StandingLoop { control, robot, clock, channels, standing_up: Some(0), remaining: ticks, measurement };
    pace_with_warm_up(PERIOD, CONTROL_TICK_OFFSET, lead, &mut standing).context("waiting on the monotonic clock")?;
    if standing.standing_up.is_some() {
        let mode = standing.control.mode().name();
        let limit_s = STAND_UP_LIMIT_TICKS / 1000;
        return Err(anyhow!("the robot did not reach READY within {limit_s} s; its mode is {mode}"));
    }
    Ok(standing.measurement)
}
