//! Consistency of sensors, clocks and commands on an emulated Go1: sound robots raise no fault, inconsistent ones are
//! not armed, or damped while they are energised. Stepped by hand, so that times are numbers of ticks.

use crate::bench;
use crate::cores::on_all_cores;
use crate::go1;
use bench::{Bench, shipped};
use go1::pair;
use quadfrog::config::Config;
use quadfrog::robot::go1::Go1;
use quadfrog::robot::{JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use quadfrog::sim::emulator::Emulator;
use quadfrog::sim::{ActuatorKind, BodyKind, TerrainKind};
use quadfrog::telemetry::{
    ArmingCheck, Command, CommandRefusal, Event, Fault, Mode, SensorCheck, TransitionCause, TrialInhibit, TrialSpec,
};
use quadfrog::trial::{Backend, JumpParameters, Task};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// An emulated Go1 behind its link; every command is followed by one millisecond of the robot.
struct Emulated {
    emulator: Emulator,
    go1: Go1,
}

impl Robot for Emulated {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        self.go1.read()
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.go1.write(command)
    }
    fn place(&mut self, _: &Placement) -> bool {
        false
    }
    fn link(&self) -> Option<LinkStatus> {
        self.go1.link()
    }
}

type EmulatedBench = Bench<Emulated>;

/// The robot's motors, sensors and ground.
#[derive(Debug, Clone, Copy, PartialEq)]
enum World {
    Ideal,
    HardwareLike,
    Rough,
    /// Hardware-like, on a network that delays, overtakes and loses.
    Delayed,
}

fn emulated(world: World, seed: u64) -> EmulatedBench {
    let (mut config, _, mut settings) = shipped(Backend::Hardware);
    let simulator = &mut config.simulator;
    if world != World::Ideal {
        simulator.sensors.enabled = true;
        simulator.actuator.kind = ActuatorKind::HardwareLike;
        simulator.terrain.friction = 0.6;
    }
    if world == World::Rough {
        simulator.contact.bodies = vec![BodyKind::Trunk, BodyKind::Hip];
        simulator.terrain.kind = TerrainKind::Blocks;
        simulator.terrain.blocks.count = 250;
        simulator.terrain.blocks.layers = 1;
        simulator.terrain.blocks.reach_m = 3.0;
    }
    settings.countdown_s = 0.6;
    let (emulator, go1) = pair(&config.simulator, seed);
    Bench { after_tick: |robot| robot.emulator.step(), ..Bench::new(config, settings, Emulated { emulator, go1 }) }
}

fn in_mode(mode: Mode) -> EmulatedBench {
    emulated(World::HardwareLike, 1).reach(mode)
}

impl EmulatedBench {
    fn inject(&mut self, fault: &str) {
        self.robot.emulator.apply(fault.parse().unwrap());
    }

    /// The cause of the first stop among the events.
    fn stop_cause(&self) -> Option<TransitionCause> {
        self.events.iter().find_map(|event| match event {
            Event::Mode { to: Mode::Damped | Mode::Fault, cause, .. } => Some(*cause),
            _ => None,
        })
    }

    /// Injects `fault`; returns the ticks until the robot is damped, and the cause.
    fn reaction(&mut self, fault: &str, most_ticks: u32) -> (u32, TransitionCause) {
        self.events.clear();
        self.inject(fault);
        for ticks in 1..=most_ticks {
            let tick = self.tick(None);
            if let Some(cause) = self.stop_cause() {
                assert!(self.damps(&tick));
                return (ticks, cause);
            }
        }
        panic!("{fault}: not damped within {most_ticks} ms, {:?}", self.cycle.mode());
    }

    /// Lays the robot down, acknowledges, and waits until it may be armed.
    fn lay_down(&mut self) {
        self.stop(None);
        self.inject("place");
        self.ticks(100);
        self.command(Command::Acknowledge { stops: 1 });
        self.ticks(1500);
        assert_eq!(self.cycle.mode(), Mode::Disarmed, "{:?}", self.events);
    }

    /// The checks for which arming is refused.
    fn failing(&mut self) -> Vec<ArmingCheck> {
        self.command(self.arm());
        match self.refusal() {
            Some(CommandRefusal::Checks(checks)) => checks.iter().collect(),
            other => other.map(|other| panic!("{other}")).unwrap_or_default(),
        }
    }
}

/// A jump of one of three tasks with uniform parameters within the shipped bounds.
fn random_jump(config: &Config, random: &mut ChaCha8Rng, trial: u32) -> TrialSpec {
    let task = [Task::Forward, Task::LateralLeft, Task::TwistCcw][trial as usize % 3];
    let mut draw = |name: &str| {
        let [low, high] = config.optimize.bounds[name];
        let share = f64::from(random.next_u32()) / f64::from(u32::MAX);
        let chosen = config.optimize.parameters[task.name()].iter().any(|parameter| parameter == name);
        if chosen { low + share * (high - low) } else { 0.0 }
    };
    let jump = JumpParameters { f0_hz: draw("f0"), f1_hz: 0.0, fx_n: draw("Fx"), fy_n: draw("Fy"), fz_n: draw("Fz") };
    TrialSpec { trial, ..config.task(task).trial(task, jump) }
}

/// Whether a fault is one of this file.
fn is_inconsistency(fault: &Fault) -> bool {
    matches!(fault, Fault::Sensors { .. } | Fault::RobotClock { .. } | Fault::OtherCommander { .. })
}

/// Makes random jumps, falls among them. Prints the largest measured value of every check, and requires that none trips.
fn jumps_without_alarm(world: World, count: u32) {
    let mut bench = emulated(world, 7).reach(Mode::Ready);
    if world == World::Delayed {
        for fault in ["delay 1", "jitter 2", "loss 0.3"] {
            bench.inject(fault);
        }
    }
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let mut largest = vec![0.0_f64; SensorCheck::ALL.len()];
    let (mut clock_ms, mut ended, mut alarms) = (0.0_f64, [0; 2], Vec::new());
    for trial in 0..count {
        let spec = random_jump(&bench.config, &mut random, trial);
        bench.settle();
        bench.events.clear();
        bench.command(Command::RunTrial(spec, bench.permit()));
        // A robot that landed with its feet apart is off its stance, one on blocks leans: it stands up again.
        let refused = bench.refusal();
        let stands_anew = matches!(refused, Some(CommandRefusal::Inhibited(_)));
        assert!(stands_anew || bench.cycle.mode() == Mode::Countdown, "{world:?} {trial}: {:?}", bench.events);
        for _ in 0..9000 {
            if !matches!(bench.cycle.mode(), Mode::Countdown | Mode::Jump | Mode::Settle) {
                break;
            }
            let mode = bench.cycle.mode();
            bench.tick(None);
            let consistency = bench.cycle.consistency();
            for (largest, check) in largest.iter_mut().zip(SensorCheck::ALL) {
                let standing = mode == Mode::Countdown;
                if standing || !matches!(check, SensorCheck::GravityMagnitude | SensorCheck::FeetLoaded) {
                    *largest = largest.max(consistency.measured(*check));
                }
            }
            clock_ms = clock_ms.max(consistency.clock_error_ms().abs());
        }
        if bench.cycle.mode() == Mode::Review {
            ended[0] += 1;
            bench.ticks(500);
            bench.command(Command::EndReview);
            bench.ticks(300);
        }
        alarms.extend(bench.faults().into_iter().map(|fault| (trial, fault)));
        if stands_anew || bench.cycle.mode() != Mode::Ready {
            ended[1] += u32::from(!stands_anew);
            bench.lay_down();
            // Blocks under the belly may tilt or rock it: a person then lays it elsewhere.
            let rocks = |check: &ArmingCheck| {
                matches!(check, ArmingCheck::Upright | ArmingCheck::GyroStill | ArmingCheck::LyingDown)
            };
            loop {
                let failing = bench.failing();
                if failing.is_empty() {
                    break;
                }
                assert!(world == World::Rough && failing.iter().all(rocks), "{world:?} {trial}: {failing:?}");
                bench.lay_down();
            }
            bench.until(Mode::Ready);
        }
    }
    println!("{world:?}: {} landed, {} stopped, clock {clock_ms:.1} ms, faults {alarms:?}", ended[0], ended[1]);
    for (largest, check) in largest.iter().zip(SensorCheck::ALL) {
        let allowed = bench.settings.consistency.allowed(*check);
        println!("  {:<42} {largest:.4} {}, limit {allowed}", check.name(), check.unit());
    }
    let false_alarms: Vec<_> = alarms.iter().filter(|(_, fault)| is_inconsistency(fault)).collect();
    assert!(false_alarms.is_empty(), "{world:?}: {false_alarms:?}");
}

#[test]
fn sound_robots_jump_without_alarm() {
    let count = std::env::var("JUMPS").ok().and_then(|count| count.parse().ok()).unwrap_or(20);
    on_all_cores(&[World::Ideal, World::HardwareLike, World::Rough, World::Delayed], |world| {
        jumps_without_alarm(*world, count);
    });
}

/// Faults of a robot that lies disarmed, and the check that refuses arming.
#[test]
fn an_inconsistent_robot_is_not_armed() {
    for (fault, check) in [
        ("imu-freeze", ArmingCheck::InertialLive),
        ("tilt 0.15", ArmingCheck::Orientation),
        ("feet 60", ArmingCheck::FootSensors),
        ("speed FR_calf 3", ArmingCheck::JointVelocity),
        ("remote-off", ArmingCheck::Remote),
    ] {
        let mut bench = in_mode(Mode::Disarmed);
        bench.inject(fault);
        bench.ticks(1500);
        assert_eq!(bench.failing(), [check], "{fault}");
        assert_eq!(bench.cycle.mode(), Mode::Disarmed);
        bench.inject("clear");
        bench.ticks(1500);
        assert_eq!(bench.failing(), [], "{fault}, cleared");
    }
}

/// An ideal robot whose sensors have no noise lies still for half a minute. Without noise a simulated robot at rest could
/// repeat its measurements.
#[test]
fn an_ideal_robot_at_rest_is_armed() {
    let mut bench = emulated(World::Ideal, 3).reach(Mode::Disarmed);
    bench.ticks(30_000);
    println!("{} equal states", bench.cycle.consistency().measured(SensorCheck::InertialUnitLive));
    assert_eq!(bench.failing(), []);
    bench.until(Mode::Ready);
    bench.ticks(30_000);
    println!("{} equal states", bench.cycle.consistency().measured(SensorCheck::InertialUnitLive));
    assert_eq!(bench.cycle.mode(), Mode::Ready, "{:?}", bench.events);
}

/// A step of the clock while disarmed is a fault; after the acknowledgement arming waits for a second without a step.
#[test]
fn a_robot_whose_clock_steps_is_not_armed() {
    let mut bench = in_mode(Mode::Disarmed);
    let (ticks, cause) = bench.reaction("clock-step 60000", 10);
    assert!(ticks <= 2 && cause.to_string().contains("the robot's clock is off by 60000 ms"), "{ticks}: {cause}");
    bench.ticks(100);
    bench.command(Command::Acknowledge { stops: 0 });
    assert_eq!(bench.cycle.mode(), Mode::Disarmed);
    assert!(bench.failing().contains(&ArmingCheck::RobotClock));
    // The states that the step counted as lost leave the window after 5 s.
    bench.ticks(5500);
    assert_eq!(bench.failing(), []);
}

/// A robot whose computer stood still while disarmed: its clock lags behind for good, so the failsafe for the link's delay would
/// sit it down at once, after each arming.
#[test]
fn a_robot_whose_clock_lags_behind_is_not_armed() {
    let mut bench = in_mode(Mode::Disarmed);
    let _ = bench.reaction("freeze", 300);
    bench.ticks(1500);
    bench.inject("clear");
    bench.ticks(100);
    bench.command(Command::Acknowledge { stops: 0 });
    bench.ticks(12_000);
    assert_eq!(bench.cycle.mode(), Mode::Disarmed, "{:?}", bench.events);
    assert_eq!(bench.failing(), [ArmingCheck::LinkDelay]);
}

/// A link that has become slower, and one that recovers.
#[test]
fn a_robot_behind_a_slower_link_is_not_armed() {
    let mut bench = in_mode(Mode::Disarmed);
    bench.inject("delay-states 15");
    bench.ticks(6000);
    assert_eq!(bench.failing(), [ArmingCheck::LinkDelay]);
    bench.inject("clear");
    bench.ticks(6000);
    assert_eq!(bench.failing(), []);
}

/// Faults of an energised robot: injected fault, mode, longest time to damping in ms, and words of the cause, of which one is
/// enough.
type Row = (&'static str, Mode, u32, &'static [&'static str]);

const TURNS: &[&str] = &["orientation against gyroscope", "turn against gyroscope"];
const CLOCK: &[&str] = &["the robot's clock is off"];
const DAMPED: [Row; 23] = [
    ("imu-freeze", Mode::StandUp, 60, &["inertial unit live"]),
    ("imu-freeze", Mode::Ready, 60, &["inertial unit live"]),
    ("imu-freeze", Mode::Jump, 60, &["inertial unit live"]),
    ("flip-roll", Mode::Ready, 6000, TURNS),
    ("flip-pitch", Mode::Ready, 6000, TURNS),
    ("flip-roll", Mode::Jump, 1500, TURNS),
    ("flip-pitch", Mode::Jump, 1500, TURNS),
    ("tilt 0.2", Mode::Ready, 2, TURNS),
    ("feet 0", Mode::Ready, 600, &["feet carry the weight"]),
    ("feet 72", Mode::Ready, 600, &["feet carry the weight"]),
    ("feet 33", Mode::Jump, 1000, &["no foot down in free fall"]),
    ("speed FR_calf 5", Mode::Ready, 60, &["joint velocity"]),
    ("clock-step 60000", Mode::Ready, 2, CLOCK),
    ("clock-step 60000", Mode::Jump, 2, CLOCK),
    ("clock-step 55", Mode::Ready, 2, CLOCK),
    ("clock-step -100", Mode::Ready, 12, CLOCK),
    ("clock-step -60000", Mode::Ready, 2, &["the robot restarted"]),
    ("clock-drift 10", Mode::Ready, 6000, CLOCK),
    ("commander 50", Mode::Ready, 300, &["another program commands the robot"]),
    ("commander 50", Mode::Jump, 300, &["another program commands the robot"]),
    ("hidden-commander 100", Mode::Ready, 300, &["another program commands the robot: a torque"]),
    ("motor-freeze FR_calf", Mode::Jump, 25, &["motors live"]),
    ("remote L2+B", Mode::Jump, 2, &["stop buttons of the remote control"]),
];

#[test]
fn an_inconsistent_robot_is_damped_while_it_is_energised() {
    for (fault, mode, most_ticks, words) in DAMPED {
        let mut bench = in_mode(mode);
        let (ticks, cause) = bench.reaction(fault, most_ticks);
        let cause = cause.to_string();
        println!("{fault:<20} {:<9} {ticks:>5} ms  {cause}", mode.name());
        assert!(words.iter().any(|words| cause.contains(words)), "{fault} in {}: {cause}", mode.name());
    }
}

/// Sensors that are stuck up after take-off: the landing is noticed by the inertial unit.
#[test]
fn a_landing_that_the_feet_do_not_report_is_damped() {
    let mut bench = emulated(World::HardwareLike, 1).airborne();
    let (ticks, cause) = bench.reaction("feet 0", 3000);
    println!("feet 0 in flight: {ticks} ms, {cause}");
    assert!(cause.to_string().contains("feet down after landing"), "{cause}");
}

/// The stop buttons damp from every mode in which the robot is commanded, and need an acknowledgement after their release.
#[test]
fn the_remote_stops_the_robot() {
    for mode in [Mode::Disarmed, Mode::StandUp, Mode::Ready, Mode::Countdown, Mode::Jump, Mode::Review, Mode::SitDown] {
        let mut bench = in_mode(mode);
        let (ticks, cause) = bench.reaction("remote L2+B+up", 10);
        println!("remote L2+B in {}: {ticks} ms", mode.name());
        assert!(ticks <= 2 && cause == TransitionCause::Fault(Fault::RemoteStop), "{ticks}: {cause}");
        bench.command(Command::Acknowledge { stops: 0 });
        assert_eq!(bench.cycle.mode(), Mode::Fault, "the buttons are still pressed");
        bench.inject("remote none");
        bench.ticks(3);
        bench.command(Command::Acknowledge { stops: 0 });
        assert_eq!(bench.cycle.mode(), Mode::Disarmed);
    }
}

/// A leg whose measurements stand still since before the jump: they agree with the standing robot.
#[test]
fn a_motor_that_repeats_its_measurements_ends_the_jump_at_its_beginning() {
    let mut bench = in_mode(Mode::Ready);
    bench.inject("motor-freeze RL_thigh");
    bench.ticks(1000);
    assert_eq!(bench.cycle.mode(), Mode::Ready, "{:?}", bench.events);
    bench.command(bench.approved());
    let began = bench.ticks_in_mode(Mode::Ready, 10) + bench.ticks_in_mode(Mode::Countdown, 5000);
    let ms = bench.ticks_in_mode(Mode::Jump, 1000);
    println!("countdown after {began} ms, damped {ms} ms after its end");
    assert!(ms <= 22 && bench.cycle.mode() == Mode::Fault, "{ms} ms: {:?}", bench.events);
}

/// A remote that falls silent after arming: no jump, and the robot sits down.
#[test]
fn without_a_remote_no_jump_begins_and_the_robot_sits_down() {
    let mut bench = in_mode(Mode::Ready);
    bench.settle();
    bench.inject("remote-off");
    bench.ticks(3);
    bench.command(bench.approved());
    assert_eq!(bench.refusal(), Some(CommandRefusal::Inhibited(TrialInhibit::RemoteSilent)));
    let ms = 3 + bench.ticks_in_mode(Mode::Ready, 5000);
    assert!((3000..3010).contains(&ms) && bench.cycle.mode() == Mode::SitDown, "{ms} ms: {:?}", bench.events);
    bench.until(Mode::Disarmed);
    // Until the gyroscope has been still for a second.
    bench.ticks(1500);
    assert_eq!((bench.faults(), bench.failing()), (Vec::new(), vec![ArmingCheck::Remote]));

    let mut bench = in_mode(Mode::Countdown);
    bench.inject("remote-off");
    let ms = bench.ticks_in_mode(Mode::Countdown, 5000);
    let cancelled = TransitionCause::NotReady(TrialInhibit::RemoteSilent);
    assert!(
        bench.events.iter().any(|event| matches!(event, Event::Mode { cause, .. } if *cause == cancelled)),
        "{ms} ms"
    );

    // A jump lands, and the robot sits down once the silence has lasted.
    let mut bench = in_mode(Mode::Jump);
    bench.inject("remote-off");
    bench.until(Mode::Disarmed);
    assert_eq!(bench.faults(), []);
}

/// One of the two buttons, or others, do nothing.
#[test]
fn other_buttons_of_the_remote_do_nothing() {
    let mut bench = in_mode(Mode::Ready);
    for buttons in ["remote L2", "remote B", "remote L1+A", "remote none"] {
        bench.inject(buttons);
        bench.ticks(20);
    }
    assert_eq!(bench.cycle.mode(), Mode::Ready);
}
