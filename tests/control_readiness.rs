//! Readiness for a jump: each condition is broken in READY, where the approval is refused, and in the countdown, which is cancelled
//! before the impulse. Faults of robot and network are injected at an emulated Go1, stepped by the millisecond.

#[path = "support/bench.rs"]
mod bench;
#[path = "support/go1.rs"]
mod go1;

use bench::{Bench, shipped};
use go1::{emulator, network};
use nalgebra::UnitQuaternion;
use quadfrog::robot::go1::{Go1, Network};
use quadfrog::robot::{JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use quadfrog::sim::emulator::Emulator;
use quadfrog::sim::{ActuatorKind, SimConfig};
use quadfrog::telemetry::{Command, CommandRefusal, Event, Mode, TransitionCause, TrialEnd, TrialSpec};
use quadfrog::trial::{Backend, Gains};

/// An emulated robot behind its link; states may be changed.
struct EmulatedGo1 {
    go1: Go1,
    emulator: Emulator,
    tamper: fn(&mut RobotState),
}

impl Robot for EmulatedGo1 {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        let mut state = self.go1.read()?;
        (self.tamper)(&mut state);
        Ok(state)
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.go1.write(command)
    }
    fn place(&mut self, placement: &Placement) -> bool {
        self.go1.place(placement)
    }
    fn link(&self) -> Option<LinkStatus> {
        self.go1.link()
    }
}

type EmulatedBench = Bench<EmulatedGo1>;

fn emulated(simulator: impl Fn(&mut SimConfig)) -> EmulatedBench {
    let (mut config, _, settings) = shipped(Backend::Hardware);
    simulator(&mut config.simulator);
    let emulator = emulator(&config.simulator, 0);
    let network: Network = network(emulator.local_address().unwrap());
    let robot = EmulatedGo1 { go1: Go1::open(&network, false).unwrap(), emulator, tamper: |_| {} };
    Bench { after_tick: |robot| robot.emulator.step(), ..Bench::new(config, settings, robot) }
}

/// A defect: injected at the emulator as its prompt parses it, or by the test.
#[derive(Debug, Clone, Copy)]
enum Defect {
    Emulator(&'static str),
    State(fn(&mut RobotState)),
    /// No states for so many ms.
    Silence(u32),
    /// Every n-th tick begins 0.6 ms late.
    LateTicks(u32),
}

impl EmulatedBench {
    fn inject(&mut self, defect: Defect, ticks: u32) {
        match defect {
            Defect::Emulator(line) => self.robot.emulator.apply(line.parse().unwrap()),
            Defect::State(tamper) => self.robot.tamper = tamper,
            Defect::Silence(ms) => {
                self.robot.emulator.apply("freeze".parse().unwrap());
                self.ticks(ms);
                self.robot.emulator.apply("clear".parse().unwrap());
            }
            Defect::LateTicks(_) => {}
        }
        for n in 0..ticks {
            if let Defect::LateTicks(every) = defect {
                self.inputs.lateness_ns = if n.is_multiple_of(every) { 600_000 } else { 0 };
            }
            self.tick(None);
        }
        self.inputs.lateness_ns = 0;
    }

    /// Ticks to just before the impulse.
    fn end_of_countdown(&mut self, before_ms: u32) {
        while self.cycle.last().trial_time_s < -1e-3 * f64::from(before_ms) {
            self.tick(None);
        }
    }
}

/// Each condition with the defect that breaks it, and a part of the reason that the operator sees.
const CONDITIONS: [(Defect, &str); 10] = [
    // A link that loses states (with 40 % lost an earlier version jumped).
    (Defect::Emulator("loss 10"), "% of the states of the last second lost, a jump needs at most 1 %"),
    // Foot sensors of another scale (jumped by an earlier version, without Virtual Model Control).
    (
        Defect::State(|state| state.foot_force_n.iter_mut().for_each(|force| *force *= 0.05)),
        "0 of 4 feet on the ground",
    ),
    (Defect::State(|state| state.foot_force_n[2] = 0.0), "3 of 4 feet on the ground"),
    (Defect::State(|state| state.foot_force_n[1] += 80.0), "N, a jump needs 64 to 193 N"),
    // An attitude that is wrong by 0.3 rad (rolled 0.8 rad in flight in an earlier version): the robot leans until it looks level.
    (Defect::Emulator("tilt 0.3"), "a jump needs"),
    (Defect::Emulator("angle FL_thigh 0.6"), "a jump needs"),
    (Defect::State(|state| state.imu.gyro_body.z = 0.5), "at rest for 0.0 s, a jump needs 0.3 s"),
    (Defect::Silence(14), "ms old within the last second, a jump needs at most 10 ms"),
    // Five ticks in ten late (5465 of 9000 were late in an earlier version, which jumped).
    (Defect::LateTicks(2), "% of the control ticks of the last second late, a jump needs at most 1 %"),
    (Defect::Emulator("battery 12"), "battery at 12 %"),
];

#[test]
fn an_approval_is_refused_with_measured_value_and_limit() {
    for (defect, words) in CONDITIONS {
        let mut bench = emulated(|_| {}).reach(Mode::Ready);
        bench.settle();
        assert_eq!(bench.cycle.readiness().unready, None);
        bench.inject(defect, 300);
        bench.command(bench.approved());
        assert_eq!(bench.cycle.mode(), Mode::Ready, "{defect:?}");
        let refused = bench.refusal();
        let Some(CommandRefusal::Inhibited(inhibit)) = refused else { panic!("{defect:?}: {refused:?}") };
        assert!(inhibit.to_string().contains(words), "{defect:?}: {inhibit}");
        let shown = bench.cycle.readiness();
        assert_eq!(shown.inhibit.or(shown.unready), Some(inhibit), "the console is told beforehand");
    }
}

#[test]
fn a_countdown_is_cancelled_before_the_impulse() {
    for (defect, words) in CONDITIONS {
        let mut bench = emulated(|_| {}).reach(Mode::Countdown);
        bench.end_of_countdown(320);
        bench.inject(defect, 280);
        assert_eq!(bench.cycle.mode(), Mode::Countdown, "{defect:?}");
        bench.events.clear();
        bench.ticks(100);
        assert_eq!(bench.cycle.mode(), Mode::Ready, "{defect:?}: {:?}", bench.events);
        let [TrialEnd::NotReady(inhibit)] = bench.ends()[..] else { panic!("{defect:?}: {:?}", bench.ends()) };
        let cancelled = Event::Mode {
            from: Mode::Countdown,
            to: Mode::Ready,
            cause: TransitionCause::NotReady(inhibit),
            time_ns: 0,
        };
        let without_time = |event: &Event| match *event {
            Event::Mode { from, to, cause, .. } => Event::Mode { from, to, cause, time_ns: 0 },
            other => other,
        };
        assert!(bench.events.iter().map(without_time).any(|event| event == cancelled), "{:?}", bench.events);
        assert!(inhibit.to_string().contains(words), "{defect:?}: {inhibit}");
    }
}

/// Attitude and pose that are wrong in the very tick of the approval: the robot cannot have answered them yet.
#[test]
fn a_robot_that_leans_or_is_off_its_stance_is_refused() {
    let leans = |state: &mut RobotState| state.imu.world_from_body = UnitQuaternion::from_euler_angles(0.0, -0.15, 0.0);
    let conditions: [(fn(&mut RobotState), &str); 2] = [
        (leans, "tilt 0.150 rad, a jump needs at most 0.100 rad; put the robot on level ground"),
        (|state| state.joint_position_rad[4] += 0.35, "FL_thigh off its stance by 0."),
    ];
    for (tamper, words) in conditions {
        let mut bench = emulated(|_| {}).reach(Mode::Ready);
        bench.settle();
        bench.robot.tamper = tamper;
        bench.command(bench.approved());
        let refused = bench.refusal().unwrap().to_string();
        assert!(refused.contains(words), "{refused}");
    }
}

/// A defect that has ended is forgotten after a second: the next approval jumps.
#[test]
fn a_robot_that_is_ready_again_jumps() {
    let mut bench = emulated(|_| {}).reach(Mode::Countdown);
    bench.end_of_countdown(50);
    bench.inject(Defect::Silence(14), 100);
    assert_eq!(bench.cycle.mode(), Mode::Ready);
    bench.settle();
    bench.command(bench.approved());
    bench.until(Mode::Review);
    assert!(matches!(bench.ends()[..], [TrialEnd::NotReady(_), TrialEnd::Settled]), "{:?}", bench.ends());
}

/// Half a second after standing up, and in the corners of the gains at the end of the countdown, a sound robot is ready, also with
/// the actuators and sensors of the hardware-like model.
#[test]
fn a_sound_robot_is_ready() {
    let hardware_like = |config: &mut SimConfig| {
        config.actuator.kind = ActuatorKind::HardwareLike;
        config.terrain.friction = 0.6;
        config.sensors.enabled = true;
    };
    let models: [fn(&mut SimConfig); 2] = [|_| {}, hardware_like];
    for model in models {
        let mut bench = emulated(model).reach(Mode::Ready);
        bench.ticks(900);
        assert_eq!(bench.cycle.readiness().unready, None);
        let ranges = bench.config.gains();
        for corner in 0..1 << ranges.len() {
            let pick = |i: usize| if corner >> i & 1 == 0 { ranges[i].low } else { ranges[i].high };
            let gains = Gains { kp: pick(0), kd: pick(1), kd_joint: pick(2), k_att: pick(3) };
            let spec = TrialSpec { trial: corner, gains, ..bench.spec() };
            bench.settle();
            bench.command(Command::RunTrial(spec, bench.permit()));
            bench.end_of_countdown(1);
            assert_eq!(bench.cycle.mode(), Mode::Countdown, "{gains:?}: {:?}", bench.refusal());
            bench.ticks(1);
            assert_eq!(bench.tick(None).mode, Mode::Jump, "{gains:?}: {:?}", bench.events.last());
            bench.stop(None);
            bench.robot.emulator.apply("place".parse().unwrap());
            bench.ticks(1500);
            bench.command(Command::Acknowledge { stops: 0 });
            bench.ticks(1500);
            bench.command(bench.arm());
            bench.until(Mode::Ready);
        }
    }
}

/// In simulation the conditions belong to the trial: rough ground and soft gains are what it measures.
#[test]
fn a_simulated_robot_needs_no_readiness() {
    let (config, _, settings) = shipped(Backend::Simulator);
    let emulator = emulator(&config.simulator, 0);
    let network = network(emulator.local_address().unwrap());
    let robot = EmulatedGo1 { go1: Go1::open(&network, false).unwrap(), emulator, tamper: |_| {} };
    let bench =
        Bench { after_tick: |robot: &mut EmulatedGo1| robot.emulator.step(), ..Bench::new(config, settings, robot) };
    let mut bench = bench.reach(Mode::Ready);
    bench.robot.tamper = |state| state.foot_force_n = [0.0; 4];
    bench.ticks(300);
    assert_eq!(bench.cycle.readiness().unready, None);
    bench.command(bench.approved());
    assert_eq!(bench.cycle.mode(), Mode::Countdown);
}
