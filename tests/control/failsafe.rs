//! The failsafe table, row by row: modes, time to damping, text of the fault. A sound robot that jumps trips none.

use crate::bench;
use crate::robots;
use std::collections::BTreeSet;

use bench::{Bench, shipped};
use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use quadfrog::config::Config;
use quadfrog::control::cycle::Cycle;
use quadfrog::control::settings::ControlSettings;
use quadfrog::engine::{Options, open_experiment};
use quadfrog::optimize::journal::Durability;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JOINTS, JointCommand, Placement, Robot, RobotState};
use quadfrog::session::automatic;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::{
    Command, CommandRefusal, Event, FallCause, Fault, Mode, Permit, TransitionCause, TrialEnd, TrialInhibit,
};
use quadfrog::trial::{Backend, Task};
use robots::LinkedRobot;

type LinkedBench = Bench<LinkedRobot>;
type Tamper = fn(&mut RobotState);

/// A robot with hardware settings that lies and passes every arming check.
fn linked() -> LinkedBench {
    let (config, description, mut settings) = shipped(Backend::Hardware);
    // An injected tilt is one that no gyroscope has measured (tests/control/consistency.rs).
    (settings.consistency.orientation_rad, settings.consistency.turn_rad) = (f64::INFINITY, f64::INFINITY);
    let lying = LinkedRobot::lying(&description, &config.simulator);
    Bench::new(config, settings, LinkedRobot { with_truth: true, keeps_commands: true, ..lying })
}

fn in_mode(mode: Mode) -> LinkedBench {
    linked().reach(mode)
}

impl LinkedBench {
    /// Runs `count` ticks; returns the first of them, from 1, that sent damping.
    fn ticks_until_damping(&mut self, count: u32) -> Option<u32> {
        self.robot.sent.clear();
        self.events.clear();
        let damping = JointCommand::damping(self.settings.gate.damping_kd);
        let mut first = None;
        for n in 1..=count {
            let tick = self.tick(None);
            let damped = self.robot.sent.last() == Some(&damping);
            if damped {
                first.get_or_insert(n);
            }
            assert!(first.is_none() || (damped && !tick.mode.energised()), "damping goes on being sent");
        }
        first
    }

    fn acknowledge(&mut self) -> Mode {
        self.command(Command::Acknowledge { stops: 0 }).mode
    }
}

/// Every DAMP row, injected in READY: damping within two ticks of the first bad one; the fault names measured value and limit.
#[test]
fn every_cut_row_damps_within_two_ticks_and_names_its_fault() {
    type Inject = fn(&mut LinkedBench);
    let rows: [(Inject, &str); 16] = [
        (|b| b.robot.tamper = |s| s.joint_velocity_rad_s[4] = f64::NAN, "a joint velocity is not a finite number"),
        (|b| b.robot.tamper = |s| s.joint_position_rad[2] = -0.7, "FR_calf at -0.700 rad exceeds -0.788 rad"),
        (|b| b.robot.tamper = |s| s.joint_position_rad[7] = -0.8, "RR_thigh at -0.800 rad exceeds -0.763 rad"),
        (|b| b.robot.tamper = |s| s.joint_velocity_rad_s[11] = -41.0, "RL_calf at -41.0 rad/s exceeds 40.1 rad/s"),
        (|b| b.robot.tamper = |s| s.joint_torque_n_m[0] = 29.0, "FR_hip at 29.0 N m exceeds 28.4 N m"),
        (|b| b.robot.tamper = |s| s.joint_torque_n_m[3] = f64::NAN, "FL_hip at NaN N m"),
        (|b| b.robot.tamper = |s| s.motor_enabled[5] = false, "motor FL_calf left servo mode"),
        (|b| b.robot.tamper = |s| s.motor_temperature_c[9] = 80.0, "RL_hip at 80 degrees Celsius, limit 80"),
        (|b| b.robot.link.recent_corrupt = 11, "11 states with a wrong checksum within 5 s, limit 10"),
        (|b| b.robot.tamper = |s| s.robot_time_ms = 5, "its clock went backwards"),
        (|b| b.robot.send_errno = Some(111), "could not be sent: Connection refused (error 111); check the cable"),
        (|b| b.inputs.lateness_ns = 10_100_000, "control thread late: 10.1 ms exceeds 10.0 ms"),
        (|b| b.inputs.events_lost = true, "the session does not take events"),
        (|b| b.robot.tamper = |s| tilt(s, Vector3::x_axis(), 0.36), "tilt 0.360 rad exceeds 0.350 rad"),
        (|b| b.robot.tamper = |s| tilt(s, Vector3::y_axis(), -0.36), "tilt 0.360 rad exceeds 0.350 rad"),
        (|b| b.robot.tamper = |s| s.imu.accel_body.x = f64::INFINITY, "the acceleration is not a finite"),
    ];
    for (inject, words) in rows {
        let mut bench = in_mode(Mode::Ready);
        inject(&mut bench);
        let damped = bench.ticks_until_damping(50);
        assert!(damped.is_some_and(|ticks| ticks <= 2), "{words}: damping after {damped:?} ticks");
        let fault = bench.faults()[0].to_string();
        assert!(fault.contains(words), "{fault}");
        assert_eq!(bench.cycle.mode(), Mode::Fault, "{words}: latched");
    }
}

fn tilt(state: &mut RobotState, axis: nalgebra::Unit<Vector3<f64>>, angle: f64) {
    let tilted = UnitQuaternion::from_axis_angle(&axis, angle);
    state.imu.world_from_body = tilted;
    if let Some(truth) = &mut state.truth {
        truth.world_from_body = tilted;
    }
}

/// Missing states: nothing at 20 ms, damping at 21 ms, a lost link by name beyond 200 ms.
#[test]
fn a_gap_is_cut_at_its_limit_and_becomes_a_lost_link() {
    let mut bench = in_mode(Mode::Ready);
    bench.robot.silent_ms = 1;
    let damped = bench.ticks_until_damping(300);
    // The first silent tick reports 2 ms.
    assert_eq!(damped, Some(bench.settings.failsafe.state_age_ms));
    let faults = bench.faults();
    let [Fault::StateAge { age_ms: 21, allowed_ms: 20 }, Fault::LinkLost { age_ms: 201, .. }] = faults[..] else {
        panic!("{faults:?}")
    };
}

/// A later fault that voids confirmations is reported once behind a latched fault; others are not.
#[test]
fn a_fault_that_voids_confirmations_is_reported_behind_another_fault() {
    let mut bench = in_mode(Mode::Ready);
    bench.events.clear();
    let faults: [fn(&mut LinkedBench); 5] = [
        |b| b.robot.tamper = |s| s.joint_position_rad[2] = -0.7,
        |b| b.robot.tamper = |s| s.motor_temperature_c[0] = 85.0,
        |b| b.robot.tamper = |s| s.motor_enabled[5] = false,
        |b| b.robot.silent_ms = 1,
        |b| b.robot.tamper = |s| (s.robot_time_ms, s.joint_velocity_rad_s[1]) = (3, f64::NAN),
    ];
    for inject in faults {
        inject(&mut bench);
        bench.ticks(300);
        bench.robot.tamper = |_| {};
        bench.robot.silent_ms = 0;
    }
    let reported = bench.faults();
    // The clock of the last injection stands still.
    let [
        Fault::JointPosition { .. },
        Fault::MotorMode { joint: 5 },
        Fault::LinkLost { .. },
        Fault::Reboot,
        Fault::RobotClock { .. },
    ] = reported[..]
    else {
        panic!("{reported:?}")
    };
}

/// The robot's clock of 32 bits overflows after 49 days: no restart.
#[test]
fn a_clock_that_runs_over_is_no_restart() {
    let mut bench = linked().reach(Mode::Disarmed);
    let clocks: [Tamper; 3] =
        [|s| s.robot_time_ms = u32::MAX - 1, |s| s.robot_time_ms = u32::MAX, |s| s.robot_time_ms = 0];
    // From 1.5 s to just before the end of the clock counts as backwards: acknowledged, and on from there.
    for (n, clock) in clocks.into_iter().enumerate() {
        bench.robot.tamper = clock;
        bench.ticks(1);
        if n == 0 {
            bench.acknowledge();
        }
        assert_eq!(bench.cycle.mode(), Mode::Disarmed, "{:?}", bench.events.last());
    }
    bench.events.clear();
    bench.robot.tamper = |s| s.robot_time_ms = u32::MAX - 1;
    bench.ticks(1);
    assert_eq!(bench.faults(), [Fault::Reboot]);
}

/// A robot that tips over in REVIEW is damped at the limit of READY; it counts as fallen, without a fault. Regression: only
/// 1.0 rad damps.
#[test]
fn a_robot_that_tips_over_in_review_is_damped_at_the_limit_of_standing() {
    let tips: [Tamper; 2] =
        [|state| tilt(state, Vector3::x_axis(), 0.36), |state| tilt(state, Vector3::y_axis(), -0.36)];
    for tips_over in tips {
        let mut bench = in_mode(Mode::Review);
        bench.robot.tamper = |state| tilt(state, Vector3::x_axis(), 0.34);
        bench.ticks(50);
        assert_eq!(bench.cycle.mode(), Mode::Review);
        bench.robot.tamper = tips_over;
        assert_eq!(bench.ticks_until_damping(20), Some(1));
        let [Event::Mode { from: Mode::Review, to: Mode::Damped, cause: TransitionCause::Fell(cause), .. }] =
            bench.events[..]
        else {
            panic!("{:?}", bench.events)
        };
        let (FallCause::Roll { allowed_rad, .. } | FallCause::Pitch { allowed_rad, .. }) = cause else {
            panic!("{cause}")
        };
        assert_eq!(allowed_rad, 0.35);
        bench.robot.tamper = |_| {};
        bench.command(Command::EndReview);
        assert_eq!(bench.cycle.mode(), Mode::Damped, "a verdict is no acknowledgement");
        assert_eq!(bench.acknowledge(), Mode::Disarmed);
    }
}

/// Five periods in a row of more than twice the nominal one trip, four do not.
#[test]
fn slow_periods_are_counted_and_cut() {
    let slow = |ticks: u64| {
        let mut bench = in_mode(Mode::Ready);
        for n in 1..=ticks {
            // 1.5 ms later each time: periods of 2.5 ms.
            bench.inputs.lateness_ns = n * 1_500_000;
            bench.tick(None);
        }
        bench.inputs.lateness_ns = 0;
        bench.tick(None);
        bench
    };
    assert_eq!(slow(4).cycle.mode(), Mode::Ready);
    let bench = slow(5);
    assert_eq!(bench.cycle.mode(), Mode::Fault);
    let fault = bench.faults()[0].to_string();
    assert!(fault.contains("5 control periods in a row too long: 2.5 ms exceeds 2.0 ms"), "{fault}");
}

/// In simulation a late tick is only counted, unless configured.
#[test]
fn lateness_trips_nothing_in_simulation_unless_asked() {
    for (late_ms, expected) in [(0.0, Mode::Ready), (10.0, Mode::Fault)] {
        let mut bench = in_mode(Mode::Ready);
        let settings = ControlSettings { late_ms, hardware: false, ..bench.settings };
        bench.cycle = Cycle::ready(&settings);
        bench.tick(None);
        bench.inputs.lateness_ns = 500_000_000;
        bench.tick(None);
        assert_eq!(bench.cycle.mode(), expected, "late_ms = {late_ms}");
    }
}

/// A flight that tilts too far is damped before it lands, and counts as a fall of its parameters.
#[test]
fn a_flight_that_tilts_is_cut_as_a_fall() {
    let mut bench = linked().airborne();
    bench.robot.tamper = |state| tilt(state, Vector3::y_axis(), 0.79);
    bench.ticks(2);
    assert_eq!(bench.cycle.mode(), Mode::Jump);
    bench.robot.tamper = |state| tilt(state, Vector3::y_axis(), 0.81);
    assert_eq!(bench.ticks_until_damping(20), Some(1));
    let ends = bench.ends();
    assert!(matches!(ends[..], [TrialEnd::Fell(FallCause::Pitch { allowed_rad: 0.8, .. })]), "{ends:?}");
}

/// A robot that sits down may lean, but not fall over.
#[test]
fn sitting_down_is_cut_at_the_outer_tilt() {
    let mut bench = in_mode(Mode::SitDown);
    bench.robot.tamper = |state| tilt(state, Vector3::x_axis(), 0.9);
    bench.ticks(10);
    assert_eq!(bench.cycle.mode(), Mode::SitDown);
    bench.robot.tamper = |state| tilt(state, Vector3::x_axis(), 1.01);
    assert_eq!(bench.ticks_until_damping(10), Some(1));
    assert!(matches!(bench.faults()[..], [Fault::Tilt { allowed_rad: 1.0, .. }]));
}

/// Bending the legs of a disarmed robot by hand is no fault; faults of the link are, in every commanded mode.
#[test]
fn a_disarmed_robot_may_be_handled() {
    let mut bench = in_mode(Mode::Disarmed);
    bench.robot.tamper = |state| {
        state.joint_position_rad[2] = -0.5;
        state.joint_velocity_rad_s[2] = 40.0;
        state.motor_enabled[2] = false;
        tilt(state, Vector3::x_axis(), 1.5);
    };
    bench.ticks(100);
    assert_eq!(bench.cycle.mode(), Mode::Disarmed);
    bench.robot.link.recent_corrupt = 11;
    bench.ticks(1);
    assert_eq!(bench.cycle.mode(), Mode::Fault);
}

/// A fault whose cause persists cannot be acknowledged; one whose cause is gone can. The robot is damped throughout.
#[test]
fn a_standing_fault_cannot_be_acknowledged() {
    let mut bench = in_mode(Mode::Ready);
    bench.robot.tamper = |state| state.motor_temperature_c[0] = 85.0;
    bench.ticks(5);
    assert_eq!(bench.acknowledge(), Mode::Fault);
    assert!(matches!(bench.refusal(), Some(CommandRefusal::FaultPersists(Fault::MotorTemperature { joint: 0, .. }))));
    bench.robot.tamper = |_| {};
    bench.ticks(1);
    assert_eq!(bench.acknowledge(), Mode::Disarmed);
}

/// Battery and warm motors: the running trial finishes, the next is refused with the reason.
#[test]
fn what_holds_lets_the_trial_finish_and_refuses_the_next() {
    let holds: [(Tamper, &str); 2] = [
        (|state| state.battery.as_mut().unwrap().charge_percent = 14.0, "battery at 14 %"),
        (|state| state.motor_temperature_c[6] = 72.0, "motor RR_hip at 72 degrees"),
    ];
    for (tamper, words) in holds {
        let mut bench = in_mode(Mode::Jump);
        bench.robot.tamper = tamper;
        bench.until(Mode::Review);
        assert_eq!(bench.ends(), [TrialEnd::Settled]);
        bench.command(Command::EndReview);
        assert_eq!(bench.cycle.mode(), Mode::Ready);
        bench.command(bench.approved());
        let inhibit: TrialInhibit = bench.cycle.readiness().inhibit.unwrap();
        assert!(inhibit.to_string().contains(words), "{inhibit}");
        assert_eq!((bench.cycle.mode(), bench.refusal()), (Mode::Ready, Some(CommandRefusal::Inhibited(inhibit))));
    }
}

/// Measurements that fall silent after arming refuse the next trial. Regression: a charge above 100 % passed as a full battery, one that
/// was no longer reported and motors that report no temperature as sound ones.
#[test]
fn a_battery_or_a_motor_that_falls_silent_refuses_the_next_trial() {
    let silent: [(Tamper, &str); 6] = [
        (|state| state.battery = None, "battery does not report a charge"),
        (|state| state.battery.as_mut().unwrap().charge_percent = 255.0, "battery does not report a charge"),
        (|state| state.battery.as_mut().unwrap().charge_percent = 101.0, "battery does not report a charge"),
        (|state| state.battery.as_mut().unwrap().charge_percent = f64::NAN, "battery does not report a charge"),
        (|state| state.motor_temperature_c[2] = 0.0, "motor FR_calf reports 0 degrees"),
        (|state| state.motor_temperature_c = [-128.0; JOINTS], "motor FR_hip reports -128 degrees"),
    ];
    for (tamper, words) in silent {
        let mut bench = in_mode(Mode::Ready);
        bench.settle();
        bench.robot.tamper = tamper;
        bench.ticks(2);
        bench.command(bench.approved());
        let inhibit = bench.cycle.readiness().inhibit.unwrap_or_else(|| panic!("nothing holds: {words}"));
        assert!(inhibit.to_string().contains(words), "{inhibit}");
        assert_eq!((bench.cycle.mode(), bench.refusal()), (Mode::Ready, Some(CommandRefusal::Inhibited(inhibit))));
        bench.robot.tamper = |_| {};
        bench.ticks(2);
        bench.command(bench.approved());
        assert_eq!(bench.cycle.mode(), Mode::Countdown, "{words}");
    }
}

/// Regression: before a robot had answered, its battery was said to report no charge.
#[test]
fn before_the_first_state_nothing_refuses_a_trial() {
    let mut bench = linked();
    bench.robot.silent_ms = 1;
    bench.ticks(3);
    assert_eq!((bench.cycle.mode(), bench.cycle.readiness().inhibit), (Mode::Offline, None));
}

/// Operator lost in flight: the nominal controller lands, and the robot sits down soon after touchdown, quiet or not.
#[test]
fn an_operator_lost_in_flight_is_landed_and_sat_down() {
    let mut bench = linked().airborne();
    bench.inputs.operator_silent_ms = 1001;
    assert_eq!(bench.modes_until(Mode::Settle), [Mode::Jump, Mode::Settle]);
    let touchdown = bench.cycle.last().number;
    assert_eq!(bench.modes_until(Mode::SitDown), [Mode::Settle, Mode::Review, Mode::SitDown]);
    let settled = bench.cycle.last().number - touchdown;
    assert!(settled <= 610, "sat down {settled} ms after touchdown");
    bench.until(Mode::Disarmed);
    assert!(matches!(bench.ends()[..], [TrialEnd::Fault(Fault::OperatorLost { .. })]), "{:?}", bench.ends());
}

/// An operator who returns before REVIEW: the robot sits down all the same, from flight and from SETTLE.
#[test]
fn a_robot_that_was_landed_sits_down_though_the_operator_has_returned() {
    for mode in [Mode::Jump, Mode::Settle] {
        let mut bench = if mode == Mode::Jump { linked().airborne() } else { in_mode(mode) };
        bench.inputs.operator_silent_ms = 1001;
        bench.ticks(1);
        bench.inputs.operator_silent_ms = 0;
        bench.until(Mode::Review);
        bench.ticks(1);
        assert_eq!(bench.cycle.mode(), Mode::SitDown, "from {mode:?}");
        let cause = bench.events.last();
        assert!(
            matches!(cause, Some(Event::Mode { cause: TransitionCause::Fault(Fault::OperatorLost { .. }), .. })),
            "from {mode:?}: {cause:?}"
        );
        bench.until(Mode::Disarmed);
    }
}

/// A trial that had landed already when the operator was lost is measured to its end and counts.
#[test]
fn a_trial_that_had_landed_counts_though_the_operator_is_lost() {
    let mut bench = in_mode(Mode::Settle);
    bench.inputs.operator_silent_ms = 1001;
    bench.until(Mode::Disarmed);
    assert_eq!(bench.ends(), [TrialEnd::Settled]);
}

/// Several jumps in a row end with the running one.
#[test]
fn an_operator_lost_between_jumps_ends_the_series() {
    let mut bench = in_mode(Mode::Ready);
    bench.settle();
    let mut spec = bench.spec();
    (spec.jumps, spec.jump.f1_hz, spec.jump.fx_n) = (5, 0.5, 20.0);
    bench.command(Command::RunTrial(spec, bench.permit()));
    bench.until(Mode::Jump);
    bench.ticks(100);
    bench.inputs.operator_silent_ms = 1001;
    let mut impulses = BTreeSet::new();
    while bench.cycle.mode() != Mode::SitDown {
        let tick = bench.tick(None);
        assert!(tick.number < 60_000, "never sat down: {:?}", tick.mode);
        if tick.theta_rad >= std::f64::consts::PI {
            impulses.insert((tick.trial_time_s / 1.385).floor() as u32);
        }
    }
    assert_eq!(impulses.into_iter().collect::<Vec<_>>(), [0], "one impulse, and no other began");
}

/// A robot that stands and waits sits down after its time, on hardware.
#[test]
fn an_idle_robot_sits_down() {
    for mode in [Mode::Ready, Mode::Review] {
        let mut bench = in_mode(mode);
        bench.ticks((bench.settings.idle_s * 1000.0) as u32 - 10);
        assert_eq!(bench.cycle.mode(), mode);
        bench.ticks(20);
        assert_eq!(bench.cycle.mode(), Mode::SitDown);
        assert!(matches!(bench.events.last(), Some(Event::Mode { cause: TransitionCause::Idle { .. }, .. })));
    }
}

/// An approval holds once, for a limited time and in one mode.
#[test]
fn an_approval_is_single_use_expires_and_dies_with_a_change_of_mode() {
    let mut bench = in_mode(Mode::Ready);
    bench.settle();
    let approval = bench.approved();
    bench.command(approval);
    bench.command(Command::Cancel);
    assert_eq!(bench.cycle.mode(), Mode::Ready, "any key cancels the countdown");
    bench.command(approval);
    assert_eq!((bench.cycle.mode(), bench.refusal()), (Mode::Ready, Some(CommandRefusal::Stale)), "used up");

    let approval = bench.approved();
    bench.ticks(2001);
    bench.command(approval);
    assert!(matches!(bench.refusal(), Some(CommandRefusal::Expired { .. })), "{:?}", bench.refusal());
    assert_eq!(bench.cycle.mode(), Mode::Ready);

    let mut bench = in_mode(Mode::Ready);
    let approval = bench.approved();
    bench.command(Command::SitDown);
    bench.until(Mode::Disarmed);
    bench.ticks(1500);
    bench.command(bench.arm());
    bench.until(Mode::Ready);
    bench.command(approval);
    assert_eq!((bench.cycle.mode(), bench.refusal()), (Mode::Ready, Some(CommandRefusal::Stale)), "another standing");
    bench.settle();
    bench.command(bench.approved());
    assert_eq!(bench.cycle.mode(), Mode::Countdown);
}

/// Regression: an approval that was refused because the robot had moved began a jump when it arrived again half a second later.
#[test]
fn a_permit_that_was_refused_is_used_up() {
    let mut bench = linked().reach(Mode::Ready);
    bench.robot.tamper = |state| state.imu.gyro_body.z = 0.5;
    bench.ticks(10);
    bench.robot.tamper = |_| {};
    let approval = bench.approved();
    bench.command(approval);
    assert!(matches!(bench.refusal(), Some(CommandRefusal::Inhibited(_))), "{:?}", bench.refusal());
    bench.settle();
    bench.command(approval);
    assert_eq!((bench.cycle.mode(), bench.refusal()), (Mode::Ready, Some(CommandRefusal::Answered)));
    bench.command(bench.approved());
    assert_eq!(bench.cycle.mode(), Mode::Countdown);

    let mut bench = linked().reach(Mode::Disarmed);
    bench.robot.tamper = |state| state.battery = None;
    bench.ticks(10);
    let arm = bench.arm();
    bench.command(arm);
    assert!(matches!(bench.refusal(), Some(CommandRefusal::Checks(_))), "{:?}", bench.refusal());
    bench.robot.tamper = |_| {};
    bench.ticks(1500);
    bench.command(arm);
    assert_eq!((bench.cycle.mode(), bench.refusal()), (Mode::Disarmed, Some(CommandRefusal::Answered)));
    bench.command(bench.arm());
    assert_eq!(bench.cycle.mode(), Mode::StandUp);
}

/// Regression: arming did not expire, and needed no heartbeat of the operator's console.
#[test]
fn arming_expires_dies_with_a_change_of_mode_and_needs_somebody_who_watches() {
    let mut bench = in_mode(Mode::Disarmed);
    let arm = bench.arm();
    bench.ticks(2001);
    bench.command(arm);
    assert!(matches!(bench.refusal(), Some(CommandRefusal::Expired { .. })), "{:?}", bench.refusal());

    let arm = bench.arm();
    bench.command(bench.arm());
    bench.until(Mode::Ready);
    bench.command(Command::SitDown);
    bench.until(Mode::Disarmed);
    bench.ticks(1500);
    bench.command(arm);
    assert_eq!(bench.refusal(), Some(CommandRefusal::Stale), "of another time");

    for silent_ms in [1001, u32::MAX] {
        bench.inputs.operator_silent_ms = silent_ms;
        bench.command(bench.arm());
        assert_eq!(bench.refusal(), Some(CommandRefusal::OperatorSilent { silent_ms, allowed_ms: 1000 }));
        assert_eq!(bench.cycle.mode(), Mode::Disarmed);
    }
    bench.inputs.operator_silent_ms = 0;
    bench.command(bench.arm());
    assert_eq!(bench.cycle.mode(), Mode::StandUp);
}

/// Without a first heartbeat of the screen, control cannot be taken.
#[test]
fn control_is_not_taken_while_nobody_watches() {
    let mut bench = linked().reach(Mode::Disarmed);
    bench.command(Command::Release);
    assert_eq!(bench.cycle.mode(), Mode::Observe);
    bench.inputs.operator_silent_ms = u32::MAX;
    bench.robot.sent.clear();
    bench.command(Command::TakeControl);
    assert!(matches!(bench.refusal(), Some(CommandRefusal::OperatorSilent { .. })), "{:?}", bench.refusal());
    assert_eq!((bench.cycle.mode(), bench.robot.sent.len()), (Mode::Observe, 0));
}

/// After the end of the session, from every mode, the robot ends lying and disarmed, and nothing arms it again. Regression: a
/// session that ended during a jump did not land the robot.
#[test]
fn a_session_that_ends_lands_sits_down_and_energises_nothing_any_more() {
    for mode in [Mode::StandUp, Mode::Ready, Mode::Countdown, Mode::Jump, Mode::Settle, Mode::Review, Mode::SitDown] {
        let mut bench = in_mode(mode);
        bench.command(Command::Leave);
        bench.until(Mode::Disarmed);
        bench.ticks(1500);
        let (arm, approved) = (bench.arm(), bench.approved());
        bench.command(arm);
        assert_eq!((bench.cycle.mode(), bench.refusal()), (Mode::Disarmed, Some(CommandRefusal::Leaving)), "{mode:?}");
        bench.command(approved);
        assert_eq!(bench.cycle.mode(), Mode::Disarmed, "{mode:?}");
        let expected: &[TrialEnd] = match mode {
            Mode::Countdown | Mode::Jump => &[TrialEnd::Fault(Fault::OperatorLeft)],
            // After the landing the trial is measured to its end.
            Mode::Settle | Mode::Review | Mode::SitDown => &[TrialEnd::Settled],
            _ => &[],
        };
        assert_eq!(bench.ends(), expected, "{mode:?}");
    }
}

/// After a fall: damping, verdict or acknowledgement, the arming checks, and standing up from the measured joint angles.
#[test]
fn after_a_fall_the_robot_stands_up_from_its_measured_pose_once_it_is_upright_again() {
    let mut bench = linked().airborne();
    bench.robot.tamper = |state| tilt(state, Vector3::y_axis(), 1.2);
    bench.ticks(2);
    assert_eq!(bench.cycle.mode(), Mode::Damped);
    bench.robot.tamper = |_| {};
    bench.ticks(4000);
    bench.command(bench.arm());
    assert_eq!(bench.cycle.mode(), Mode::Damped, "not without a look at it");
    assert_eq!(bench.acknowledge(), Mode::Disarmed);
    bench.robot.tamper = |state| tilt(state, Vector3::x_axis(), 0.6);
    bench.ticks(1500);
    bench.command(bench.arm());
    assert!(matches!(bench.refusal(), Some(CommandRefusal::Checks(_))), "it lies on its side");
    // The operator turns it over, folded again.
    bench.robot.tamper = |_| {};
    let lying_position = bench.settings.lying_position;
    bench.robot.simulator.place(&Placement { joint_position: lying_position, lying: true, seed: 1 });
    bench.tick(None);
    if bench.cycle.mode() == Mode::Fault {
        // Placing resets the robot's clock, as a restart does.
        bench.acknowledge();
    }
    bench.ticks(1500);
    let before = bench.cycle.last().state.joint_position_rad;
    let tick = bench.command(bench.arm());
    assert_eq!(tick.mode, Mode::StandUp);
    for (joint, motor) in tick.command.motor.iter().enumerate() {
        // Targets end at the limit, also for a folded leg that rests beyond it.
        let measured = before[joint].clamp(bench.settings.min_position[joint], bench.settings.max_position[joint]);
        assert!((motor.position_rad - measured).abs() < 0.01, "joint {joint} begins at its measured angle");
    }
    bench.until(Mode::Ready);
}

/// Studies on sound robots trip no limit; prints the margins.
#[test]
fn whole_studies_on_the_simulator_trip_no_limit() {
    let robot = RobotDescription::embedded("go1").unwrap();
    let (mut beyond, mut speed, mut torque) = ([0.0_f64; 3], 0.0_f64, 0.0_f64);
    for task in [Task::Forward, Task::LateralLeft, Task::TwistCcw] {
        let options = Options {
            seed: 1,
            trials: Some(20),
            ..Options::new(Config::load(None).unwrap(), robot.clone(), Backend::Simulator, task)
        };
        let settings = options.config.settings(&robot, task, Backend::Simulator).unwrap();
        let simulator = Simulator::new(&robot, &options.config.simulator).unwrap();
        let mut life = open_experiment(&options, Durability::Buffered, "").unwrap();
        automatic::run(&mut life, &mut Rollout::new(simulator, &settings), |row, ticks| {
            let faulty = ticks.iter().find(|tick| tick.mode == Mode::Fault);
            assert!(faulty.is_none(), "{}, trial {}: {}", task.name(), row.trial, row.cause);
            for tick in ticks.iter().filter(|tick| tick.mode.energised()) {
                for i in 0..JOINTS {
                    let q = tick.state.joint_position_rad[i];
                    beyond[i % 3] = beyond[i % 3].max(settings.min_position[i] - q).max(q - settings.max_position[i]);
                    speed = speed.max(tick.state.joint_velocity_rad_s[i].abs() / settings.max_velocity[i]);
                    torque = torque.max(tick.state.joint_torque_n_m[i].abs() / settings.max_torque[i]);
                }
            }
        })
        .unwrap();
    }
    println!(
        "60 trials: beyond the limits by at most {beyond:.3?} rad (hip, thigh, calf), {speed:.2} times the no-load speed, \
         {torque:.2} times the largest torque"
    );
}

#[derive(Debug, Clone, Copy)]
enum Step {
    Nothing,
    Plain(Command),
    FreshApproval,
    /// The first approval that was given before, again.
    OldApproval,
    Stop,
    Silence,
    Tamper(Tamper),
    Mend,
}

fn any_step() -> impl Strategy<Value = Step> {
    let tampers: [Tamper; 6] = [
        |state| state.joint_velocity_rad_s[1] = f64::NAN,
        |state| state.motor_enabled[3] = false,
        |state| state.motor_temperature_c[3] = 75.0,
        |state| state.battery = None,
        |state| state.imu.gyro_body.z = 0.5,
        |state| tilt(state, Vector3::x_axis(), 0.3),
    ];
    prop_oneof![
        3 => Just(Step::Nothing),
        2 => Just(Step::Plain(Command::TakeControl)),
        4 => Just(Step::Plain(Command::Arm(Permit::default()))),
        1 => Just(Step::Plain(Command::SitDown)),
        1 => Just(Step::Plain(Command::Cancel)),
        1 => Just(Step::Plain(Command::EndReview)),
        1 => Just(Step::Plain(Command::Release)),
        3 => Just(Step::Plain(Command::Acknowledge { stops: 0 })),
        4 => Just(Step::FreshApproval),
        2 => Just(Step::OldApproval),
        1 => Just(Step::Stop),
        1 => Just(Step::Silence),
        2 => (0..tampers.len()).prop_map(move |i| Step::Tamper(tampers[i])),
        3 => Just(Step::Mend),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..ProptestConfig::default() })]

    /// For any sequence of commands with hardware settings: a motor does more than damp only after an arm command in a tick in which
    /// every check passed, a jump begins only after an unused approval given since the last change of mode, and every command is
    /// finite.
    #[test]
    fn no_sequence_energises_without_arm_fresh_checks_and_approval(
        steps in proptest::collection::vec((any_step(), 1..2500_u32), 1..20)
    ) {
        let mut bench = linked().reach(Mode::Disarmed);
        let (mut armed, mut jumping, mut old) = (false, false, None);
        for (step, ticks) in steps {
            bench.inputs.stop = false;
            let command = match step {
                Step::Plain(Command::Arm(_)) => Some(bench.arm()),
                Step::Plain(command) => Some(command),
                Step::FreshApproval => {
                    let approval = bench.approved();
                    old.get_or_insert(approval);
                    Some(approval)
                }
                Step::OldApproval => old,
                _ => None,
            };
            match step {
                Step::Stop => bench.inputs.stop = true,
                Step::Silence => bench.robot.silent_ms = 1,
                Step::Tamper(tamper) => bench.robot.tamper = tamper,
                Step::Mend => {
                    bench.robot.tamper = |_| {};
                    bench.robot.silent_ms = 0;
                }
                _ => {}
            }
            for n in 0..ticks {
                let before = bench.cycle.mode();
                let fresh = command == Some(bench.approved()) && matches!(command, Some(Command::RunTrial(..)));
                let sent_before = bench.robot.sent.len();
                let tick = bench.tick(command.filter(|_| n == 0));
                if tick.mode == Mode::StandUp && before != Mode::StandUp {
                    prop_assert!(n == 0 && matches!(command, Some(Command::Arm(_))), "it stands up by itself");
                    prop_assert_eq!(before, Mode::Disarmed);
                    prop_assert!(bench.cycle.readiness().findings.failing().is_empty());
                    let state = &tick.state;
                    prop_assert!(state.imu.gyro_body.norm() < 0.1 && state.battery.is_some());
                    prop_assert!(tick.estimate.roll_pitch_yaw.xy().norm() < 0.2);
                    armed = true;
                }
                let trial = matches!(tick.mode, Mode::Countdown | Mode::Jump | Mode::Settle);
                if trial && !jumping {
                    prop_assert!(n == 0 && fresh && before == Mode::Ready, "{:?} without a fresh approval", tick.mode);
                }
                jumping = trial;
                let damping = JointCommand::damping(bench.settings.gate.damping_kd);
                let sent = &bench.robot.sent[sent_before..];
                if tick.mode.energised() {
                    prop_assert!(armed, "{:?} without arm", tick.mode);
                } else {
                    armed = false;
                    prop_assert!(sent.iter().all(|command| *command == damping), "{:?}", tick.mode);
                }
                for motor in sent.iter().flat_map(|command| &command.motor) {
                    let numbers = [motor.position_rad, motor.velocity_rad_s, motor.kp_joint, motor.kd_joint, motor.torque_n_m];
                    prop_assert!(numbers.iter().all(|number| number.is_finite()));
                }
                if bench.inputs.stop {
                    prop_assert!(matches!(tick.mode, Mode::Damped | Mode::Fault));
                }
            }
            bench.robot.sent.clear();
        }
    }
}

#[test]
fn measured_value_and_limit_never_print_alike() {
    let fall = |measured_rad| FallCause::Pitch { measured_rad, allowed_rad: 1.0 }.to_string();
    assert_eq!(fall(1.004), "pitch 1.004 rad exceeds 1.000 rad");
    assert_eq!(fall(-1.000_04), "pitch -1.00004 rad exceeds 1.00000 rad");
    let quiet = |measured_s| TrialInhibit::NotQuiet { measured_s, needed_s: 0.3 }.to_string();
    assert_eq!(quiet(0.1), "all feet down and the trunk at rest for 0.1 s, a jump needs 0.3 s; wait");
    assert_eq!(quiet(0.299), "all feet down and the trunk at rest for 0.299 s, a jump needs 0.300 s; wait");
}
