//! The Go2 over DDS against other people's code: types, checksum and RPC messages of Unitree's Python SDK over Cyclone DDS
//! (`tests/support/go2_peer.py`) in place of the robot, and in place of the program that commands ours. With the feature `go2`.
#![cfg(feature = "go2")]
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with unsafe; this one hands everything to the system's"
)]

#[path = "support/no_alloc.rs"]
mod no_alloc;
#[path = "support/skip.rs"]
mod skip;

use std::net::Ipv4Addr;
use std::ops::ControlFlow;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU16, Ordering};
use std::time::{Duration, Instant};

use no_alloc::without_allocation;
use quadfrog::config::Config;
use quadfrog::realtime::thread::pace;
use quadfrog::robot::description::{RobotDescription, RobotFiles};
use quadfrog::robot::go2::dds::{DdsTransport, Participant, TopicType};
use quadfrog::robot::go2::link::{Transport, damping};
use quadfrog::robot::hardware::{DampingRoute, HardwareError, Network};
use quadfrog::robot::{JointCommand, LinkStatus, Robot, RobotState};
use quadfrog::sim::emulator::{Emulator, EmulatorFault, EmulatorHandle};
use serde_json::Value;
use skip::skip;

/// Time within which a peer must have been found.
const PATIENCE: Duration = Duration::from_secs(30);

/// A domain of its own for each test, so that they do not hear each other. Their ports lie below those of outgoing connections.
fn domain() -> u16 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    10 + (std::process::id() % 6) as u16 * 15 + NEXT.fetch_add(1, Ordering::Relaxed)
}

fn files() -> RobotFiles {
    RobotFiles::embedded("go2").unwrap()
}

/// The way to a robot in `domain`. The robot of the Python SDK sends a state every 2 ms of its clock, ours every one.
fn network(domain: u16, state_period_ms: u32) -> Network {
    let Some(Network::Go2(mut network)) = Network::read(&files()).unwrap() else { panic!("the Go2's network is DDS") };
    (network.domain, network.interface) = (domain, "127.0.0.1".to_owned());
    network.state_period_ms = state_period_ms;
    Network::Go2(network)
}

fn lying() -> RobotDescription {
    files().description().unwrap()
}

/// Takes the robot over from its own controller, without an interruption.
fn take_over(network: &Network, report: &mut dyn FnMut(&str)) -> Result<Option<String>, HardwareError> {
    network.take_over(&lying().lying_position, &AtomicBool::new(false), report)
}

/// The peer in Python.
struct Peer(Child);

impl Peer {
    /// Starts the peer; none where Python or its packages are absent.
    fn start(mode: &str, domain: u16, seconds: u32) -> Option<Peer> {
        let packages = "import cyclonedds, importlib.util; assert importlib.util.find_spec('unitree_sdk2py')";
        let has = Command::new("python3").args(["-c", packages]).stderr(Stdio::null()).status();
        if !has.is_ok_and(|status| status.success()) {
            skip("python3 has no cyclonedds with unitree_sdk2");
            return None;
        }
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/support/go2_peer.py");
        let mut python = Command::new("python3");
        python.args([script, mode, &domain.to_string(), &seconds.to_string()]).stdout(Stdio::piped());
        Some(Peer(python.spawn().unwrap()))
    }

    /// Counts of the peer at its end.
    fn counts(self) -> Value {
        let output = self.0.wait_with_output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{text}");
        serde_json::from_str(text.lines().last().unwrap()).unwrap()
    }
}

/// An emulated Go2 in real time.
struct Emulated {
    handle: EmulatorHandle,
    ending: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Emulated {
    fn start(domain: u16) -> Emulated {
        let config = Config::load_for(&files(), None).unwrap();
        let address = "127.0.0.1:0".parse().unwrap();
        let mut emulator = Emulator::serve(&network(domain, 1), address, &lying(), &config.simulator, 0).unwrap();
        let (handle, ending) = (emulator.handle(), Arc::<AtomicBool>::default());
        let flag = ending.clone();
        let step = move || {
            pace(Duration::from_millis(1), Duration::ZERO, |start| {
                emulator.step_at(start.planned_ns);
                if flag.load(Ordering::Acquire) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })
            .unwrap();
        };
        Emulated { handle, ending, thread: Some(std::thread::spawn(step)) }
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        self.thread.take().unwrap().join().unwrap();
    }
}

/// Ticks of 1 ms: reads, and writes `command` if there is one; returns the newest state and the link.
fn tick(robot: &mut dyn Robot, ms: u32, command: Option<JointCommand>) -> (Option<RobotState>, LinkStatus) {
    let mut newest = None;
    for _ in 0..ms {
        newest = without_allocation(|| {
            let state = robot.read().ok();
            if let Some(command) = &command {
                // On a loaded computer a command takes more than 20 ms to the network, which is an error.
                let _ = robot.write(command);
            }
            state
        })
        .or(newest);
        std::thread::sleep(Duration::from_millis(1));
    }
    (newest, robot.link().unwrap())
}

/// Ticks until `done`, which sees the link.
fn tick_until(robot: &mut dyn Robot, command: Option<JointCommand>, done: impl Fn(&LinkStatus) -> bool) -> LinkStatus {
    let begun = Instant::now();
    loop {
        let (_, link) = tick(robot, 50, command);
        if done(&link) {
            return link;
        }
        assert!(begun.elapsed() < PATIENCE, "{link:?}");
    }
}

/// The order of the specification: states, CheckMode, StandDown, ReleaseMode, CheckMode; then our commands, with the checksum of
/// Unitree's code; and back. No tick allocates.
#[test]
fn a_robot_of_the_python_sdk_is_taken_over_commanded_and_given_back() {
    let domain = domain();
    let Some(peer) = Peer::start("robot", domain, 25) else { return };
    let network = network(domain, 2);
    let mut steps = Vec::new();
    let released = take_over(&network, &mut |step| steps.push(step.to_owned())).unwrap();
    assert_eq!(released.as_deref(), Some("normal"), "{steps:?}");
    let (mut robot, _) = network.open(3.0).unwrap();
    tick_until(&mut *robot, None, |link| link.received > 50);
    let (state, link) = tick(&mut *robot, 1500, Some(JointCommand::damping(3.0)));
    let state = state.unwrap();
    assert!((state.joint_position_rad[1] - 1.36).abs() < 1e-6 && (state.joint_position_rad[5] + 2.65).abs() < 1e-6);
    assert_eq!(state.motor_temperature_c[11], 41.0);
    assert_eq!(state.battery.unwrap().charge_percent, 87.0);
    assert_eq!(state.foot_force_n, [10.0, 20.0, 30.0, 40.0]);
    assert_eq!((link.corrupt, link.wrong_length, link.foreign, link.foreign_commands), (0, 0, 0, 0), "{link:?}");
    assert!(link.sent > 500, "{link:?}");
    drop(robot);
    network.give_back(&lying().lying_position, "normal").unwrap();
    let counts = peer.counts();
    let asked: Vec<(&str, i64)> = counts["asked"]
        .as_array()
        .unwrap()
        .iter()
        .map(|asked| (asked[0].as_str().unwrap(), asked[1].as_i64().unwrap()))
        .collect();
    let mut order = asked.clone();
    order.dedup();
    let switcher = "motion_switcher";
    assert_eq!(order, [(switcher, 1001), ("sport", 1005), (switcher, 1003), (switcher, 1001), (switcher, 1002)]);
    assert_eq!(counts["active"], "normal");
    assert!(counts["commands"].as_u64().unwrap() > 100, "{counts}");
    assert_eq!(counts["bad_checksums"], 0, "{counts}");
    assert_eq!(counts["last"]["mode"], 1);
    assert_eq!((counts["last"]["kp"].as_f64(), counts["last"]["kd"].as_f64()), (Some(0.0), Some(3.0)), "{counts}");
    assert_eq!((counts["last"]["dq"].as_f64(), counts["battery_off"].as_u64()), (Some(0.0), Some(0)), "{counts}");
}

/// The emulator answers as the robot: services, states with the right checksum, motors that enter servo mode.
#[test]
fn a_program_of_the_python_sdk_commands_the_emulated_robot() {
    let domain = domain();
    let emulated = Emulated::start(domain);
    let Some(peer) = Peer::start("host", domain, 3) else { return };
    let counts = peer.counts();
    assert_eq!(counts["bad_checksums"], 0, "{counts}");
    assert!(counts["states"].as_u64().unwrap() > 100, "{counts}");
    assert_eq!(counts["modes"], serde_json::json!(vec![1; 12]), "{counts}");
    let answers: Vec<(i64, i64)> = counts["answers"]
        .as_array()
        .unwrap()
        .iter()
        .map(|answer| (answer[0].as_i64().unwrap(), answer[1].as_i64().unwrap()))
        .collect();
    assert_eq!(answers, [(1001, 0), (1003, 0), (1001, 0), (1002, 7004), (1002, 0), (1001, 0)], "{counts}");
    let name = |index: usize| counts["answers"][index][2].as_str().unwrap().to_owned();
    assert!(name(0).contains("\"normal\"") && name(2).contains("\"\"") && name(5).contains("\"ai\""), "{counts}");
    let status = emulated.handle.status();
    assert!(status.commands > 100 && status.rejected == 0, "{status:?}");
}

/// The robot's own controller, or a program beside ours, is seen by its commands; ours and the guard's are not.
#[test]
fn commands_of_other_programs_are_counted() {
    let domain = domain();
    let emulated = Emulated::start(domain);
    let (mut robot, (route, _)) = network(domain, 1).open(3.0).unwrap();
    let DampingRoute::Go2 { command, .. } = route else { panic!("{route:?}") };
    // Not released: the robot's own controller commands.
    let link = tick_until(&mut *robot, Some(JointCommand::damping(3.0)), |link| link.foreign_commands > 100);
    assert!(link.sent > 0, "{link:?}");
    take_over(&network(domain, 1), &mut |_| {}).unwrap();
    tick(&mut *robot, 500, None);
    let before = tick(&mut *robot, 10, None).1.foreign_commands;
    let guard = Participant::join(domain, Ipv4Addr::LOCALHOST).unwrap();
    let writer = guard.writer(&TopicType::low_command()).unwrap();
    let commands = emulated.handle.status().commands;
    let begun = Instant::now();
    while emulated.handle.status().commands < commands + 100 {
        writer.write(&command).unwrap();
        tick(&mut *robot, 5, None);
        assert!(begun.elapsed() < PATIENCE, "the robot hears the guard");
    }
    let after = tick(&mut *robot, 100, None).1.foreign_commands;
    assert_eq!(after, before, "neither ours nor the guard's, and the controller is released");
    let Some(peer) = Peer::start("commander", domain, 8) else { return };
    tick_until(&mut *robot, None, |link| link.foreign_commands > before + 20);
    assert!(peer.counts()["sent"].as_u64().unwrap() > 100);
}

/// Regression: a second console was invisible to the first, and both to one that only observes, because their damping has the bytes of
/// the guard's.
#[test]
fn two_consoles_that_damp_one_robot_count_each_other() {
    let domain = domain();
    let (mut first, _) = network(domain, 1).open(3.0).unwrap();
    let (mut second, _) = network(domain, 1).open(3.0).unwrap();
    let (mut observer, _) = network(domain, 1).open(3.0).unwrap();
    let damping = Some(JointCommand::damping(3.0));
    let begun = Instant::now();
    loop {
        let links = [(&mut first, damping), (&mut second, damping), (&mut observer, None)];
        let links = links.map(|(robot, command)| tick(&mut **robot, 1, command).1);
        if links.iter().all(|link| link.foreign_commands > 100) {
            return;
        }
        assert!(begun.elapsed() < PATIENCE, "{links:?}");
    }
}

/// A console that hangs for a moment is damped by its guard, which is no other program.
#[test]
fn the_guards_commands_in_a_silence_are_not_counted() {
    let domain = domain();
    let (mut robot, (route, _)) = network(domain, 1).open(3.0).unwrap();
    let DampingRoute::Go2 { command, .. } = route else { panic!("{route:?}") };
    let damping = Some(JointCommand::damping(3.0));
    let guard = Participant::join(domain, Ipv4Addr::LOCALHOST).unwrap();
    let writer = guard.writer(&TopicType::low_command()).unwrap();
    // While the console writes, the same bytes are another program's: the two have found each other.
    let begun = Instant::now();
    while tick(&mut *robot, 10, damping).1.foreign_commands < 10 {
        writer.write(&command).unwrap();
        assert!(begun.elapsed() < PATIENCE);
    }
    let before = tick(&mut *robot, 300, damping).1.foreign_commands;
    std::thread::sleep(Duration::from_millis(50));
    for _ in 0..100 {
        writer.write(&command).unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
    let after = tick(&mut *robot, 500, damping).1.foreign_commands;
    assert_eq!(after, before);
}

/// Regression: the emulator kept its controller released over a restart, so that arming worked on; a robot starts its own again.
#[test]
fn a_robot_that_restarts_is_commanded_by_its_own_controller_again() {
    let domain = domain();
    let emulated = Emulated::start(domain);
    take_over(&network(domain, 1), &mut |_| {}).unwrap();
    let (mut robot, _) = network(domain, 1).open(3.0).unwrap();
    let damping = Some(JointCommand::damping(3.0));
    tick_until(&mut *robot, damping, |link| link.received > 100 && link.sent > 1000);
    assert_eq!(robot.link().unwrap().foreign_commands, 0);
    emulated.handle.apply(EmulatorFault::Reboot);
    let link = tick_until(&mut *robot, damping, |link| link.foreign_commands > 100);
    assert_eq!(link.reboots, 1, "{link:?}");
}

/// Regression: the position of the first state was used without an end. If states alone fail, the services release a robot that a
/// person may have raised.
#[test]
fn a_robot_whose_states_end_keeps_its_controller() {
    for fault in [EmulatorFault::Loss(100.0), EmulatorFault::Repeat] {
        let domain = domain();
        let emulated = Emulated::start(domain);
        let mut inject = |step: &str| {
            if step == "the robot is to lie down" {
                emulated.handle.apply(fault);
            }
        };
        let error = take_over(&network(domain, 1), &mut inject).unwrap_err().to_string();
        assert!(error.contains("no state of the robot for"), "{error}");
        emulated.handle.apply(EmulatorFault::Clear);
        let commands = emulated.handle.status().commands;
        std::thread::sleep(Duration::from_millis(500));
        assert!(emulated.handle.status().commands > commands + 50, "its own controller commands");
    }
}

/// Regression: the name of a released controller was lost with every later failure, and the robot had none to be given back to.
#[test]
fn a_takeover_that_fails_after_the_release_was_sent_names_the_controller() {
    let domain = domain();
    let emulated = Emulated::start(domain);
    let mut inject = |step: &str| {
        if step.starts_with("releasing") {
            emulated.handle.apply(EmulatorFault::Freeze);
        }
    };
    let error = take_over(&network(domain, 1), &mut inject).unwrap_err();
    assert_eq!(error.released_controller(), Some("normal"), "{error}");
}

/// Regression: Ctrl-C in a takeover ended the program, and the robot had no controller to be given back to.
#[test]
fn a_takeover_that_is_interrupted_after_the_release_names_the_controller() {
    let domain = domain();
    let _emulated = Emulated::start(domain);
    let (interrupted, mut releasing) = (AtomicBool::new(false), false);
    // The step after the release.
    let mut interrupt = |step: &str| {
        interrupted.fetch_or(releasing, Ordering::AcqRel);
        releasing |= step.starts_with("releasing");
    };
    let error = network(domain, 1).take_over(&lying().lying_position, &interrupted, &mut interrupt).unwrap_err();
    assert_eq!(error.released_controller(), Some("normal"), "{error}");
    assert!(error.to_string().contains("interrupted"), "{error}");
}

/// Regression: the controller was started at once, while a console made the robot stand.
#[test]
fn a_robot_that_is_commanded_unseen_or_raised_is_not_given_back() {
    let domain = domain();
    let emulated = Emulated::start(domain);
    let network = network(domain, 1);
    take_over(&network, &mut |_| {}).unwrap();
    let (mut robot, _) = network.open(3.0).unwrap();
    let damping = Some(JointCommand::damping(3.0));
    tick_until(&mut *robot, damping, |link| link.received > 100);
    let refusal = || network.give_back(&lying().lying_position, "normal").unwrap_err().to_string();
    let ending = AtomicBool::new(false);
    let commanded = std::thread::scope(|scope| {
        let commanding = scope.spawn(|| {
            while !ending.load(Ordering::Acquire) {
                tick(&mut *robot, 5, damping);
            }
        });
        let commanded = refusal();
        ending.store(true, Ordering::Release);
        commanding.join().unwrap();
        commanded
    });
    assert!(commanded.contains("a program commands the robot"), "{commanded}");
    drop(robot);
    emulated.handle.apply(EmulatorFault::Angle { joint: 1, radians: 0.0 });
    let raised = refusal();
    assert!(raised.contains("FR_thigh is 1.36 rad from the lying pose"), "{raised}");
    emulated.handle.apply(EmulatorFault::Clear);
    emulated.handle.apply(EmulatorFault::Repeat);
    let unseen = refusal();
    assert!(unseen.contains("no state of the robot arrives"), "{unseen}");
    emulated.handle.apply(EmulatorFault::Clear);
    // Nothing was started by the refused requests: no commands arrive.
    let commands = emulated.handle.status().commands;
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(emulated.handle.status().commands, commands);
    network.give_back(&lying().lying_position, "ai").unwrap();
    std::thread::sleep(Duration::from_millis(300));
    assert!(emulated.handle.status().commands > commands + 50, "its own controller commands");
}

/// Losses and damage of the network are counted as the Go1's; a robot that restarts is seen.
#[test]
fn losses_damage_and_a_restart_are_counted() {
    let domain = domain();
    let emulated = Emulated::start(domain);
    let (mut robot, _) = network(domain, 1).open(3.0).unwrap();
    tick_until(&mut *robot, None, |link| link.received > 100);
    emulated.handle.apply(EmulatorFault::Corrupt(20.0));
    tick_until(&mut *robot, None, |link| link.corrupt > 10);
    emulated.handle.apply(EmulatorFault::Clear);
    emulated.handle.apply(EmulatorFault::Reboot);
    let link = tick_until(&mut *robot, None, |link| link.reboots == 1);
    assert!(link.lost > 0, "{link:?}");
}

#[test]
fn a_silent_domain_and_a_wrong_type_are_said() {
    let empty = domain();
    let begun = Instant::now();
    let mut steps = Vec::new();
    let mut report = |step: &str| steps.push((begun.elapsed(), step.to_owned()));
    let error = take_over(&network(empty, 1), &mut report).unwrap_err().to_string();
    assert!(error.contains("no state") && error.contains("--domain"), "{error}");
    let (said, words) = steps.iter().find(|(_, step)| step.contains("no state yet")).unwrap();
    assert!(words.contains("no other program"), "{words}");
    println!("an empty domain was said after {said:?}");

    let other = domain();
    let Some(peer) = Peer::start("wrong-type", other, 16) else { return };
    let error = take_over(&network(other, 1), &mut |_| {}).unwrap_err().to_string();
    assert!(error.contains("LowCmd_, expected unitree_go::msg::dds_::LowState_"), "{error}");
    peer.counts();
}

/// The library hands a participant none of its own commands, so a second one receives them.
#[test]
fn commands_on_the_network_are_received_by_a_second_participant() {
    let domain = domain();
    let [participant, witness] = [(); 2].map(|()| Participant::join(domain, Ipv4Addr::LOCALHOST).unwrap());
    let guards = damping(3.0).unwrap();
    let mut transport = DdsTransport::open(&participant, &witness, &TopicType::low_command(), guards.bytes()).unwrap();
    let begun = Instant::now();
    while transport.counts().returned < 100 {
        transport.send(guards.bytes());
        std::thread::sleep(Duration::from_millis(1));
        assert!(begun.elapsed() < PATIENCE, "{:?}", transport.counts());
    }
    let counts = transport.counts();
    assert!(counts.sent >= counts.returned && counts.foreign_commands == 0, "{counts:?}");
}
