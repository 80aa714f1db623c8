//! `quadfrog emulate`: serves the simulator as a Go1 or Go2 on the network; faults come from arguments and standard input.

use std::io::{BufRead, Read as _};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use crate::{notice, put, put_line};
use anyhow::{Context, anyhow};
use clap::Args;
use clap::builder::TypedValueParser;
use clap_complete::ArgValueCandidates;
use nix::sys::signal::{SigSet, Signal};
use quadfrog::realtime::thread::pace;
use quadfrog::robot::CONTROL_PERIOD_S;
use quadfrog::robot::go2::network::Go2Network;
use quadfrog::robot::hardware::Network;
use quadfrog::sim::emulator::{self, Emulator, EmulatorFault, EmulatorHandle, EmulatorStatus};

use super::arguments::{self, DdsArguments, RealRobot, load_model, one_of, whole_number};
use super::completion;
use super::failure::Failure;

/// Longest line of standard input that can be a fault, bytes.
const LONGEST_LINE: u64 = 1024;

/// Period of the status report.
const REPORT_PERIOD: Duration = Duration::from_millis(200);

/// Address of an emulated Go1 that no argument names.
const DEFAULT_ADDRESS: &str = "127.0.0.1:8007";
/// DDS domain and interface of an emulated Go2 that no argument names. A real one is in domain 0.
const EMULATED_DOMAIN: u16 = 1;
const LOOPBACK: &str = "lo";

fn robot() -> impl TypedValueParser<Value = RealRobot> {
    one_of([
        (RealRobot::Go1, RealRobot::Go1.name(), "Unitree Go1 over UDP"),
        (RealRobot::Go2, RealRobot::Go2.name(), "Unitree Go2 over DDS"),
    ])
}

#[derive(Debug, Args)]
pub struct EmulateArguments {
    /// Address on which a Go1 listens
    #[arg(long, value_name = "HOST:PORT", default_value = DEFAULT_ADDRESS)]
    bind: String,
    /// Seed of all random numbers: sensors, terrain, network
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole_number(0_u64..=u64::MAX))]
    seed: u64,
    /// Robot to emulate
    #[arg(long, value_name = "WHICH", default_value = "go1", value_parser = robot())]
    robot: RealRobot,
    /// Robot model: a folder with a URDF and a robot.toml that has a network [default: that of the robot]
    #[arg(long, value_name = "MODEL", add = ArgValueCandidates::new(completion::robots))]
    model: Option<String>,
    #[command(flatten)]
    dds: DdsArguments,
    /// Folder whose simulator.toml sets terrain, motors, sensors and time-outs
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// Fault from the start, for example "loss 5"; may be repeated
    #[arg(long = "fault", value_name = "FAULT")]
    faults: Vec<EmulatorFault>,
}

pub fn run(arguments: &EmulateArguments) -> Result<(), Failure> {
    let model = arguments.model.as_deref().unwrap_or(arguments.robot.name());
    let (files, description) = load_model(model)?;
    let config = arguments::load_config_for(&files, arguments.config.as_deref())?;
    let mut network = arguments.robot.network(&files, model)?;
    if let Network::Go2(settings) = &mut network {
        // So that an emulated robot never reaches a real one's domain.
        (settings.domain, settings.interface) = (EMULATED_DOMAIN, LOOPBACK.to_owned());
    }
    arguments.dds.apply(&mut network)?;
    let bind = arguments::address("--bind", &arguments.bind, DEFAULT_ADDRESS)?;
    let emulator = Emulator::serve(&network, bind, &description, &config.simulator, arguments.seed);
    let mut emulator = emulator.map_err(Failure::input)?;
    arguments.faults.iter().for_each(|&fault| emulator.apply(fault));
    // Before the threads start, so that all of them inherit the blocked signals and only `wait` receives them.
    let ends = SigSet::from_iter([Signal::SIGINT, Signal::SIGTERM]);
    ends.thread_block().context("blocking signals")?;
    match (&network, emulator.local_address()) {
        (Network::Go2(Go2Network { domain, interface, .. }), _) => {
            put_line!(
                "A {} is in DDS domain {domain} at {interface}. Drive it:  quadfrog --robot go2 --interface {interface} --domain {domain}",
                description.name
            );
        }
        (Network::Go1(_), address) => {
            let address = address.context("the address of the socket")?;
            put_line!(
                "A {} listens on {address}. Drive it:  quadfrog --robot go1 --address {}",
                description.name,
                on_this_machine(address)
            );
        }
    }
    put_line!("Type a fault, help, or Ctrl-C.");

    let handle = emulator.handle();
    let ending = Arc::new(AtomicBool::new(false));
    let flag = ending.clone();
    let robot = start_thread("robot", move || {
        let period = Duration::from_secs_f64(CONTROL_PERIOD_S);
        pace(period, Duration::ZERO, |start| {
            // After a stop of this process the first state is of the present, too.
            emulator.step_at(start.planned_ns + start.skipped_ns(period.as_nanos() as u64));
            if flag.load(Ordering::Acquire) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
    })?;
    let (flag, watched) = (ending.clone(), handle.clone());
    let reporter = start_thread("report", move || report(&watched, &flag))?;
    // Neither is joined: a blocked read cannot be interrupted, and the robot's thread may end without a signal.
    start_thread("faults", move || read_faults(&handle))?;
    let flag = ending.clone();
    start_thread("signals", move || {
        // If the wait fails, the robot runs until the process is killed.
        if ends.wait().is_ok() {
            flag.store(true, Ordering::Release);
        }
    })?;

    let paced = robot.join().map_err(|_| anyhow!("the robot's thread panicked"))?;
    ending.store(true, Ordering::Release);
    let _ = reporter.join();
    paced.context("the monotonic clock")?;
    put_line!("The robot is switched off.");
    Ok(())
}

/// Starts a thread with the name `name`.
fn start_thread<T: Send + 'static>(
    name: &str,
    act: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, Failure> {
    Ok(Builder::new().name(name.to_owned()).spawn(act).with_context(|| format!("the thread `{name}`"))?)
}

/// Returns the address at which a program of this machine reaches a socket that listens on `address`.
fn on_this_machine(address: SocketAddr) -> SocketAddr {
    let ip = match address.ip() {
        ip if !ip.is_unspecified() => ip,
        IpAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
    };
    SocketAddr::new(ip, address.port())
}

/// Applies faults from standard input until its end.
fn read_faults(handle: &EmulatorHandle) {
    let (mut input, mut line) = (std::io::stdin().lock(), Vec::new());
    while input.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line).is_ok_and(|length| length > 0) {
        if line.len() as u64 == LONGEST_LINE && !line.ends_with(b"\n") {
            notice!("a line of more than {LONGEST_LINE} bytes is no fault");
            if input.skip_until(b'\n').is_err() {
                return;
            }
            line.clear();
        }
        // A line that is not UTF-8 is no fault, and not the last line.
        match String::from_utf8_lossy(&line).trim() {
            "" => {}
            "help" => put!("{}", emulator::help()),
            line => match line.parse() {
                Ok(fault) => {
                    handle.apply(fault);
                    put_line!("done: {line}");
                }
                Err(error) => notice!("{error}"),
            },
        }
        line.clear();
    }
}

/// Prints changes of the client, the command time-out and the first rejected datagram.
fn report(handle: &EmulatorHandle, ending: &AtomicBool) {
    let mut last = EmulatorStatus::default();
    while !ending.load(Ordering::Acquire) {
        let now = handle.status();
        if let Some(client) = now.client.filter(|client| last.client != Some(*client)) {
            put_line!("commands come from {client}");
        }
        if now.timed_out && !last.timed_out && now.commands > 0 {
            put_line!("commands timed out: the motors brake");
        }
        if !now.timed_out && last.timed_out && last.commands > 0 {
            put_line!("commands resumed");
        }
        if now.rejected > last.rejected && last.rejected == 0 {
            put_line!("rejected a datagram (checksum, length or head); further ones are counted, not printed");
        }
        last = now;
        std::thread::sleep(REPORT_PERIOD);
    }
}
