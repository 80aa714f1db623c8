//! `quadfrog emulate`: the simulator served as a Go1 on the network; faults come by option and as lines of standard input.

use std::io::BufRead;
use std::net::SocketAddr;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use color_eyre::eyre::WrapErr;
use nix::sys::signal::{SigSet, Signal};
use quadfrog::config::Config;
use quadfrog::engine::EngineError;
use quadfrog::realtime::thread::pace;
use quadfrog::robot::CONTROL_PERIOD_S;
use quadfrog::robot::description::RobotFiles;
use quadfrog::robot::go1::Network;
use quadfrog::sim::emulator::{self, Emulator, EmulatorFault, EmulatorHandle, EmulatorStatus};

use super::Failure;

/// How often it says what has changed.
const REPORT_PERIOD: Duration = Duration::from_millis(200);

#[derive(Debug, Args)]
pub struct EmulateArguments {
    /// Where it listens
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:8007")]
    bind: SocketAddr,
    /// Seed of everything random: sensors, terrain, what the network does
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Robot model: go1, or a folder with a URDF and a robot.toml that has a network
    #[arg(long, value_name = "MODEL", default_value = "go1")]
    model: String,
    /// Folder whose simulator.toml says terrain, motors, sensors and time-outs
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// A fault from the start, for example "loss 5"; may be given several times
    #[arg(long = "fault", value_name = "FAULT")]
    faults: Vec<EmulatorFault>,
}

pub fn run(arguments: &EmulateArguments) -> Result<(), Failure> {
    let config = Config::load(arguments.config.as_deref())?;
    let files = RobotFiles::open(&arguments.model).map_err(Failure::input)?;
    let description = files.description().map_err(Failure::input)?;
    let no_network = || EngineError::NoNetwork { robot: description.name.clone() };
    let network = Network::read(&files).map_err(Failure::input)?.ok_or_else(no_network)?;
    let mut emulator = Emulator::bind(arguments.bind, &description, &network, &config.simulator, arguments.seed)
        .map_err(Failure::input)?;
    for &fault in &arguments.faults {
        emulator.apply(fault);
    }
    // Before the threads begin, so that every one of them leaves the signals to the one that waits for them.
    let ends = SigSet::from_iter([Signal::SIGINT, Signal::SIGTERM]);
    ends.thread_block().wrap_err("signals cannot be blocked")?;
    let address = emulator.local_address().wrap_err("the address of the socket")?;
    println!("A {} listens on {address}. Drive it:  quadfrog --robot go1 --address {address}", description.name);
    println!("Type a fault, help, or Ctrl-C.");

    let handle = emulator.handle();
    let ending = Arc::new(AtomicBool::new(false));
    let flag = ending.clone();
    let robot = std::thread::spawn(move || {
        pace(Duration::from_secs_f64(CONTROL_PERIOD_S), Duration::ZERO, |_| {
            emulator.step();
            if flag.load(Ordering::Acquire) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
    });
    let (flag, watched) = (ending.clone(), handle.clone());
    let reporter = std::thread::spawn(move || report(&watched, &flag));
    // Neither can be woken from its reading; they end with the program.
    std::thread::spawn(move || read_faults(&handle));

    // Waits for Ctrl-C; if that cannot be waited for, the robot runs until it is killed.
    let waited = ends.wait();
    if waited.is_ok() {
        ending.store(true, Ordering::Release);
    }
    let paced = robot.join().map_err(|_| color_eyre::eyre::eyre!("the robot's thread panicked"))?;
    let _ = reporter.join();
    paced.wrap_err("the monotonic clock")?;
    println!("The robot is switched off.");
    Ok(())
}

/// Lines of standard input, until it ends; the robot lives on without them.
fn read_faults(handle: &EmulatorHandle) {
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        match line.trim() {
            "" => {}
            "help" => print!("{}", emulator::help()),
            line => match line.parse() {
                Ok(fault) => {
                    handle.apply(fault);
                    println!("done: {line}");
                }
                Err(error) => eprintln!("quadfrog emulate: {error}"),
            },
        }
    }
}

/// Says who commands the robot, and when its motors brake because nobody does.
fn report(handle: &EmulatorHandle, ending: &AtomicBool) {
    let mut last = EmulatorStatus::default();
    while !ending.load(Ordering::Acquire) {
        let now = handle.status();
        if now.client != last.client
            && let Some(client) = now.client
        {
            println!("commands come from {client}");
        }
        if now.timed_out && !last.timed_out && now.commands > 0 {
            println!("no commands any more: the motors brake");
        }
        if !now.timed_out && last.timed_out && last.commands > 0 {
            println!("commands come again");
        }
        if now.rejected > last.rejected && last.rejected == 0 {
            println!("a datagram was no command (checksum, length or head); more are counted, not shown");
        }
        last = now;
        std::thread::sleep(REPORT_PERIOD);
    }
}
