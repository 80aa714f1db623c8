//! Impossible values of the accelerometer: single ones change no result, many are a fault.

use crate::emulated::{EmulatedBench, emulated_on, hardware_like};
use nalgebra::Vector3;
use quadfrog::control::foot_placement::SwingLegs;
use quadfrog::robot::{LEGS, RobotState};
use quadfrog::session::objective;
use quadfrog::telemetry::{Event, Mode, Tick, TrialEnd};
use quadfrog::trial::Backend;

type Tamper = fn(&mut RobotState);

const SAMPLES: [Tamper; 4] = [
    |state| state.imu.accel_body = Vector3::new(500.0, 0.0, 500.0),
    |state| state.imu.accel_body.x = -1e4,
    |state| state.imu.accel_body = Vector3::new(1e10, 0.0, 1e10),
    |state| state.imu.accel_body = Vector3::new(1e30, 0.0, 1e30),
];

fn standing() -> EmulatedBench {
    emulated_on(Backend::Hardware, 1, hardware_like).with_short_countdown().reach(Mode::Ready)
}

/// Runs a jump with one sample changed in flight; returns the displacement and the end.
fn jump(sample: Option<Tamper>) -> (f64, TrialEnd) {
    let mut bench = standing();
    bench.settle();
    let mut ticks: Vec<Tick> = vec![bench.command(bench.approved())];
    let mut sample = sample;
    while matches!(bench.cycle.mode(), Mode::Countdown | Mode::Jump | Mode::Settle) {
        let last = ticks.last().unwrap();
        if last.mode == Mode::Jump && last.estimate.contact == [false; LEGS] && last.trial_time_s > 0.42 {
            bench.robot.tamper = sample.take().unwrap_or(|_| {});
        }
        ticks.push(bench.tick(None));
    }
    let measured = objective::measure(&bench.spec().objective(), &ticks).expect("a jump that landed");
    (measured.dx_m, bench.ends()[0])
}

/// Regression: one sample of 500 m/s^2 in flight made J 0.53 m in place of 0.37 m, one of 1e10 m/s^2 3e6 m, both settled.
#[test]
fn one_impossible_acceleration_changes_no_result() {
    let (sound_m, end) = jump(None);
    assert_eq!(end, TrialEnd::Settled);
    for sample in SAMPLES {
        let (dx_m, end) = jump(Some(sample));
        assert_eq!(end, TrialEnd::Settled);
        assert!((dx_m - sound_m).abs() < 0.02, "{dx_m} m in place of {sound_m} m");
    }
}

/// Regression: after one such sample a robot at rest was not quiet for seconds.
#[test]
fn a_standing_robot_stays_quiet_after_one_impossible_acceleration() {
    for sample in SAMPLES {
        let mut bench = standing();
        bench.settle();
        let before = bench.cycle.last().estimate.position_world;
        bench.robot.tamper = sample;
        bench.ticks(1);
        bench.robot.tamper = |_| {};
        bench.ticks(5);
        assert_eq!((bench.cycle.mode(), bench.cycle.readiness().unready), (Mode::Ready, None));
        let moved_m = (bench.cycle.last().estimate.position_world - before).norm();
        assert!(moved_m < 1e-3, "{moved_m} m");
    }
}

/// Five in a row, or ten in a second, are no fault; one more is, as a number that is not finite.
#[test]
fn an_accelerometer_of_impossible_values_is_a_fault() {
    for sample in SAMPLES {
        for (tampered, sound) in [(1, 20), (5, 400)] {
            let mut bench = standing();
            for _ in 0..if tampered == 1 { 10 } else { 2 } {
                bench.robot.tamper = sample;
                bench.ticks(tampered);
                bench.robot.tamper = |_| {};
                bench.ticks(sound);
            }
            assert_eq!(bench.cycle.mode(), Mode::Ready, "{:?}", bench.events.last());
        }
        for (tampered, sound, most_ticks) in [(6, 0, 6), (1, 9, 120)] {
            let mut bench = standing();
            let mut ticks = 0;
            while bench.cycle.mode() == Mode::Ready && ticks < 1000 {
                bench.robot.tamper = sample;
                bench.ticks(tampered);
                bench.robot.tamper = |_| {};
                bench.ticks(sound);
                ticks += tampered + sound;
            }
            assert!(bench.cycle.mode() == Mode::Fault && ticks <= most_ticks, "{ticks}: {:?}", bench.events.last());
            let fault = bench.faults()[0].to_string();
            assert!(fault.contains("limit 320 m/s^2"), "{fault}");
        }
    }
}

/// In the air the motors hold the stance, as after a number that is not finite.
#[test]
fn impossible_accelerations_in_flight_are_landed() {
    let mut bench = emulated_on(Backend::Hardware, 1, hardware_like).with_short_countdown().airborne();
    bench.robot.tamper = SAMPLES[0];
    bench.ticks(50);
    assert_eq!(bench.cycle.mode(), Mode::Jump, "the motors hold the stance: {:?}", bench.events.last());
    let held = bench.robot.sent.motor.iter().all(|motor| motor.kp_joint == bench.settings.failsafe.hold_kp);
    assert!(held, "{:?}", bench.robot.sent.motor[0]);
    bench.until(Mode::Fault);
    assert!(bench.events.iter().any(|event| matches!(event, Event::TrialEnded { end: TrialEnd::Fault(_), .. })));
}

/// Regression: a wrong velocity moved the feet without a bound.
#[test]
fn the_placement_of_a_foot_is_bounded() {
    let mut swing = SwingLegs::default();
    (0..30).for_each(|_| swing.update(&[false; LEGS]));
    for velocity in [Vector3::new(1e30, -1e30, 0.0), Vector3::new(f64::INFINITY, 4.0, 0.0)] {
        for offset in swing.offsets_leg(0.3, &velocity) {
            assert!(offset.norm() <= 0.3 * 3.0 * 2.0_f64.sqrt(), "{offset}");
        }
    }
    let slow = Vector3::new(2.9, -1.5, 0.7);
    assert_eq!(swing.offsets_leg(0.1, &slow)[0], Vector3::new(0.1 * 2.9, 0.1 * -1.5, 0.0));
}
