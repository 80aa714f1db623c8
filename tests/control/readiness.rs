//! Readiness for a jump: each condition is broken in READY, where the approval is refused, and in the countdown, which is cancelled
//! before the impulse. Faults of robot and network are injected at an emulated Go1, stepped by the millisecond.

use crate::bench;
use crate::emulated;
use crate::go1;
use emulated::{EmulatedBench, emulated, emulated_on, hardware_like};
use quadfrog::control::control_loop::ControlLoop;
use quadfrog::realtime::channel::channels;
use quadfrog::realtime::clock::SimulatedClock;
use quadfrog::realtime::thread::TickStart;
use quadfrog::robot::RobotState;
use quadfrog::sim::SimConfig;
use quadfrog::telemetry::{
    Command, CommandRefusal, Event, Mode, Permit, TransitionCause, TrialEnd, TrialInhibit, TrialSpec,
};
use quadfrog::trial::{Backend, Gains};

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
    fn break_for(&mut self, defect: Defect, ticks: u32) {
        match defect {
            Defect::Emulator(line) => self.robot.emulator.apply(line.parse().unwrap()),
            Defect::State(tamper) => self.robot.tamper = tamper,
            Defect::Silence(ms) => {
                self.robot.deaf_ms = 1;
                self.ticks(ms);
                self.robot.deaf_ms = 0;
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

/// Each condition with the defect that breaks it, its time in ms, too short for another failsafe, and a part of the reason that the
/// operator sees.
const CONDITIONS: [(Defect, u32, &str); 9] = [
    // A link that loses states (with 40 % lost an earlier version jumped).
    (Defect::Emulator("loss 3"), 700, "%, a jump needs at most 1.0 %; check the cable"),
    // Foot sensors of another scale (jumped by an earlier version, without Virtual Model Control).
    (
        Defect::State(|state| state.foot_force_n.iter_mut().for_each(|force| *force *= 0.05)),
        20,
        "0 of 4 feet on the ground",
    ),
    (Defect::State(|state| state.foot_force_n[2] = 0.0), 20, "3 of 4 feet on the ground"),
    (Defect::State(|state| state.foot_force_n[1] += 80.0), 20, "N, a jump needs 64 to 193 N"),
    (Defect::State(|state| state.imu.gyro_body.z = 0.5), 20, "at rest for 0.0 s, a jump needs 0.3 s"),
    (Defect::Silence(14), 100, "ms old within the last second, a jump needs at most 10 ms"),
    // Every other tick late (5465 of 9000 were late in an earlier version, which jumped).
    (Defect::LateTicks(2), 300, "%, a jump needs at most 1.0 %; end other programs"),
    (Defect::Emulator("battery 12"), 20, "battery at 12 %"),
    // The usual byte for "not available".
    (Defect::Emulator("battery 255"), 20, "battery does not report a charge"),
];

#[test]
fn an_approval_is_refused_with_measured_value_and_limit() {
    for (defect, ms, words) in CONDITIONS {
        let mut bench = emulated(|_| {}).reach(Mode::Ready);
        bench.settle();
        assert_eq!(bench.cycle.readiness().unready, None);
        bench.break_for(defect, ms);
        bench.command(bench.approved());
        assert_eq!(bench.cycle.mode(), Mode::Ready, "{defect:?}: {:?}", bench.events.last());
        let refused = bench.refusal();
        let Some(CommandRefusal::Inhibited(inhibit)) = refused else { panic!("{defect:?}: {refused:?}") };
        assert!(inhibit.to_string().contains(words), "{defect:?}: {inhibit}");
        let shown = bench.cycle.readiness();
        assert_eq!(shown.inhibit.or(shown.unready), Some(inhibit), "the console is told beforehand");
    }
}

#[test]
fn a_countdown_is_cancelled_before_the_impulse() {
    for (defect, ms, words) in CONDITIONS {
        let mut bench = emulated(|_| {}).reach(Mode::Countdown);
        bench.end_of_countdown(ms + 40);
        bench.break_for(defect, ms);
        assert_eq!(bench.cycle.mode(), Mode::Countdown, "{defect:?}: {:?}", bench.events.last());
        bench.events.clear();
        bench.ticks(60);
        assert_eq!(bench.cycle.mode(), Mode::Ready, "{defect:?}: {:?}", bench.events);
        let [TrialEnd::NotReady(inhibit)] = bench.ends()[..] else { panic!("{defect:?}: {:?}", bench.ends()) };
        let cause = TransitionCause::NotReady(inhibit);
        let cancelled = |event: &Event| match *event {
            Event::Mode { from: Mode::Countdown, to: Mode::Ready, cause: found, .. } => found == cause,
            _ => false,
        };
        assert!(bench.events.iter().any(cancelled), "{:?}", bench.events);
        assert!(inhibit.to_string().contains(words), "{defect:?}: {inhibit}");
    }
}

/// A defect that has ended is forgotten after a second: the next approval jumps.
#[test]
fn a_robot_that_is_ready_again_jumps() {
    let mut bench = emulated(|_| {}).reach(Mode::Countdown);
    bench.end_of_countdown(50);
    bench.break_for(Defect::Silence(14), 100);
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
            let (cycle, mode_changes) = (bench.cycle, bench.mode_changes);
            bench.ticks(1);
            assert_eq!(bench.tick(None).mode, Mode::Jump, "{gains:?}: {:?}", bench.events.last());
            // The impulse has moved nothing in its first tick: from before it the same robot is ready for the next corner.
            (bench.cycle, bench.mode_changes) = (cycle, mode_changes);
            bench.command(Command::Cancel);
            bench.until(Mode::Ready);
        }
    }
}

/// In simulation the conditions belong to the trial: rough ground and soft gains are what it measures.
#[test]
fn a_simulated_robot_needs_no_readiness() {
    let mut bench = emulated_on(Backend::Simulator, 0, |_| {}).reach(Mode::Ready);
    bench.robot.tamper = |state| state.foot_force_n = [0.0; 4];
    bench.ticks(300);
    assert_eq!(bench.cycle.readiness().unready, None);
    bench.command(bench.approved());
    assert_eq!(bench.cycle.mode(), Mode::Countdown);
}

/// The screen reads from the control thread whether an approval would be refused, before one is given.
#[test]
fn the_console_reads_why_no_trial_would_be_approved() {
    let (config, _, settings) = bench::shipped(Backend::Hardware);
    let (mut emulator, mut robot) = go1::pair(&config.simulator, 1);
    let (control, mut session, mut screen, mut recorder) = channels();
    let mut body = ControlLoop::new(&settings, control);
    let (mut changes, mut reasons) = (0, Vec::new());
    for ms in 0..9000 {
        screen.heartbeat.beat();
        let command = match body.mode() {
            Mode::Observe if ms == 100 => Some(Command::TakeControl),
            Mode::Disarmed if ms == 2000 => {
                Some(Command::Arm(Permit { mode_changes: changes, given_ns: ms * 1_000_000 }))
            }
            _ => None,
        };
        if let Some(command) = command {
            session.commands.push(command).unwrap();
        }
        if ms == 7000 {
            emulator.apply("hot RL_hip 72".parse().unwrap());
        }
        body.tick(TickStart { planned_ns: ms * 1_000_000, lateness_ns: 0 }, &SimulatedClock, &mut robot);
        let _ = recorder.pop();
        let events = std::iter::from_fn(|| session.events.pop().ok());
        changes += events.filter(|event| matches!(event, Event::Mode { .. })).count() as u64;
        emulator.step();
        if [6900, 8900].contains(&ms) {
            assert_eq!(body.mode(), Mode::Ready, "at {ms} ms");
            reasons.push(screen.snapshot.read().unready);
        }
    }
    assert_eq!(reasons[0], None, "a robot at rest in READY");
    assert!(matches!(reasons[1], Some(TrialInhibit::MotorWarm { .. })), "{:?}", reasons[1]);
}
