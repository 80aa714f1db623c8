//! The machine's share of a tick, without quadfrog's code: the wake-up latency of cyclictest and the duration of the
//! system calls of a tick.

use std::io;
use std::net::{Ipv4Addr, UdpSocket};
use std::ops::ControlFlow;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, anyhow};
use hdrhistogram::Histogram;
use quadfrog::realtime::clock::{Clock, MonotonicClock};
use quadfrog::realtime::scheduling::Scheduling;
use quadfrog::realtime::thread::{CONTROL_TICK_OFFSET, PeriodicTask, TickStart, pace_with_warm_up};
use quadfrog::robot::go1::packet::{COMMAND_LENGTH, STATE_LENGTH};

use crate::put_line;
use crate::subcommand::failure::Failure;
use crate::subcommand::interrupt::output_of;

/// The control period.
pub const PERIOD: Duration = Duration::from_millis(1);

/// Durations in ns, 1 to 1e9 with three digits; longer ones count as 1 s.
pub type Durations = Histogram<u64>;

/// Returns an empty histogram. Its bounds are fixed, so recording does not allocate.
pub fn durations() -> Durations {
    Histogram::new_with_bounds(1, 1_000_000_000, 3).unwrap_or_else(|error| unreachable!("{error}"))
}

/// Prints processor, version and a warning about a debug build.
pub fn print_header(more: &str) {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let processor = model.map_or(std::env::consts::ARCH, |(_, name)| name.trim());
    put_line!("{processor}{more}, quadfrog {}", env!("CARGO_PKG_VERSION"));
    if cfg!(debug_assertions) {
        put_line!("This is a debug build; for valid figures use cargo run --release.");
    }
}

/// Runs `act` in a new thread, so that its priority ends with it.
pub fn in_a_thread<T: Send + 'static>(
    act: impl FnOnce() -> Result<T, anyhow::Error> + Send + 'static,
) -> Result<T, Failure> {
    let thread = std::thread::Builder::new().name("control".into()).spawn(act).context("control thread")?;
    Ok(thread.join().map_err(|_| anyhow!("the control thread panicked"))??)
}

/// Two non-blocking UDP sockets connected over the loopback.
struct LoopbackPair {
    controller: UdpSocket,
    robot: UdpSocket,
}

impl LoopbackPair {
    fn open() -> io::Result<LoopbackPair> {
        let bind = || UdpSocket::bind((Ipv4Addr::LOCALHOST, 0));
        let pair = LoopbackPair { controller: bind()?, robot: bind()? };
        pair.controller.connect(pair.robot.local_addr()?)?;
        pair.robot.connect(pair.controller.local_addr()?)?;
        pair.controller.set_nonblocking(true)?;
        pair.robot.set_nonblocking(true)?;
        Ok(pair)
    }

    /// Makes the system calls of a tick: receives the state until the queue is empty, sends a command. A failed call
    /// takes its time too.
    fn tick(&self) {
        let mut buffer = [0; 2048];
        while self.controller.recv(&mut buffer).is_ok() {}
        let _ = self.controller.send(&[0; COMMAND_LENGTH]);
    }

    /// Sends the state that the next tick receives.
    fn answer(&self) {
        let mut buffer = [0; 2048];
        while self.robot.recv(&mut buffer).is_ok() {}
        let _ = self.robot.send(&[0; STATE_LENGTH]);
    }
}

/// A loop of the system calls of a tick, with the warm-up of a tick.
struct SystemCallLoop {
    pair: LoopbackPair,
    warm_up: LoopbackPair,
    clock: MonotonicClock,
    durations: Durations,
    remaining: u64,
}

impl PeriodicTask for SystemCallLoop {
    fn warm_up(&mut self) {
        self.warm_up.answer();
        self.warm_up.tick();
    }

    fn tick(&mut self, _: TickStart) -> ControlFlow<()> {
        let start_ns = self.clock.now_ns();
        self.pair.tick();
        self.durations.saturating_record((self.clock.now_ns() - start_ns).max(1));
        self.pair.answer();
        self.remaining -= 1;
        if self.remaining == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Adds `ticks` measurements of the system calls of a tick, at the period and priority of the control thread.
pub fn system_calls(
    scheduling: Scheduling,
    lead: Duration,
    ticks: u64,
    durations: Durations,
) -> Result<Durations, Failure> {
    let open = || LoopbackPair::open().context("sockets on the loopback");
    let (pair, warm_up, clock) = (open()?, open()?, MonotonicClock::start());
    let mut calls = SystemCallLoop { pair, warm_up, clock, durations, remaining: ticks };
    in_a_thread(move || {
        let _granted = scheduling.apply();
        pace_with_warm_up(PERIOD, CONTROL_TICK_OFFSET, lead, &mut calls).context("waiting on the monotonic clock")?;
        Ok(calls.durations)
    })
}

/// Refuses a machine without cyclictest: before the first measurement, which may take hours.
pub fn require_cyclictest() -> Result<(), Failure> {
    output_of(Command::new("cyclictest").arg("--help")).map_err(no_cyclictest)?;
    Ok(())
}

fn no_cyclictest(error: io::Error) -> Failure {
    Failure::input(format!("cyclictest: {error}; install it: apt-get install rt-tests"))
}

/// Runs cyclictest once and adds its histogram, in whole microseconds, to `durations`.
pub fn cyclictest(scheduling: Scheduling, loops: u64, durations: &mut Durations) -> Result<(), Failure> {
    let mut program = Command::new("cyclictest");
    program.args(["--quiet", "--mlockall", "--threads=1", "--interval=1000", "--histogram=100000"]);
    program.arg(format!("--loops={loops}"));
    if scheduling.priority > 0 {
        program.arg(format!("--priority={}", scheduling.priority)).arg("--policy=fifo");
    }
    if let Some(core) = scheduling.core {
        program.arg(format!("--affinity={core}"));
    }
    let output = output_of(&mut program).map_err(no_cyclictest)?;
    let text = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        return Err(anyhow!("cyclictest ended with {}: {} {}", output.status, text.trim(), errors.trim()).into());
    }
    let before = durations.len();
    for line in text.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())) {
        let mut numbers = line.split_whitespace().filter_map(|number| number.parse::<u64>().ok());
        if let (Some(us), Some(count)) = (numbers.next(), numbers.next()) {
            durations.saturating_record_n((us * 1000).max(1), count);
        }
    }
    if durations.len() == before {
        return Err(anyhow!("cyclictest printed no histogram: {}", text.trim()).into());
    }
    Ok(())
}
