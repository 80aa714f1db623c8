//! The arming checks of the control thread: each fails by itself and refuses arming, whatever the session says.

use crate::bench;
use crate::robots;
use bench::{Bench, shipped};
use nalgebra::{UnitQuaternion, Vector3};
use quadfrog::robot::remote::Remote;
use quadfrog::robot::{Battery, GRAVITY, Imu, LinkStatus, RobotError, RobotState};
use quadfrog::telemetry::{ArmingCheck, Command, CommandRefusal, Mode};
use quadfrog::trial::Backend;
use robots::ScriptedRobot;

type ArmingBench = Bench<ScriptedRobot>;

/// A disarmed robot that lies still and passes every check.
fn lying_still() -> ArmingBench {
    let (config, _, settings) = shipped(Backend::Hardware);
    let state = RobotState {
        joint_position_rad: settings.lying_position,
        motor_enabled: [true; 12],
        motor_temperature_c: [30.0; 12],
        battery: Some(Battery { charge_percent: 80.0, voltage_v: 24.0, current_a: 0.0, cell_v: [0.0; 10] }),
        imu: Imu { accel_body: Vector3::new(0.0, 0.0, GRAVITY), ..Imu::default() },
        remote: Some(Remote::default()),
        ..RobotState::default()
    };
    let link = LinkStatus { recent_received: 5000, ..LinkStatus::default() };
    let mut bench =
        Bench::new(config, settings, ScriptedRobot { state: Ok(state), link, noisy: true }).reach(Mode::Disarmed);
    bench.ticks(4500);
    bench
}

impl ArmingBench {
    fn state(&mut self) -> &mut RobotState {
        self.robot.state.as_mut().unwrap()
    }

    /// Arms; returns the failing checks of a refusal.
    fn failing(&mut self) -> Vec<ArmingCheck> {
        self.command(self.arm());
        let checks: Vec<ArmingCheck> = match self.refusal() {
            Some(CommandRefusal::Checks(checks)) => checks.iter().collect(),
            other => other.map(|other| panic!("{other}")).unwrap_or_default(),
        };
        assert_eq!(checks.is_empty(), self.cycle.mode() == Mode::StandUp);
        checks
    }
}

#[test]
fn a_sound_robot_is_armed() {
    assert_eq!(lying_still().failing(), []);
}

/// Each check fails and is named alone; a jump of an angle is also a contradiction to the velocities.
#[test]
fn each_check_refuses_arming_by_itself() {
    type Breaks = fn(&mut ArmingBench);
    let table: [(ArmingCheck, Breaks); 22] = [
        (ArmingCheck::StateFresh, |b| b.robot.state = Err(RobotError::NoNewState { age_ms: 12 })),
        (ArmingCheck::Loss, |b| b.robot.link.recent_lost = 60),
        (ArmingCheck::Checksums, |b| b.robot.link.recent_corrupt = 1),
        (ArmingCheck::Upright, |b| {
            b.state().imu.world_from_body = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.25);
        }),
        (ArmingCheck::JointsInside, |b| b.state().joint_position_rad[2] = -2.83),
        (ArmingCheck::LyingDown, |b| b.state().joint_position_rad[4] = 0.6),
        (ArmingCheck::Battery, |b| b.state().battery.as_mut().unwrap().charge_percent = 29.0),
        (ArmingCheck::Battery, |b| b.state().battery = None),
        (ArmingCheck::MotorsCool, |b| b.state().motor_temperature_c[11] = 61.0),
        (ArmingCheck::MotorsFollow, |b| b.state().motor_enabled[7] = false),
        (ArmingCheck::GyroStill, |b| b.state().imu.gyro_body.y = 0.2),
        (ArmingCheck::OnTime, |b| {
            b.inputs.lateness_ns = 600_000;
            b.ticks(60);
            b.inputs.lateness_ns = 0;
        }),
        (ArmingCheck::InertialLive, |b| {
            b.robot.noisy = false;
            b.ticks(60);
        }),
        (ArmingCheck::Gravity, |b| {
            b.state().imu.accel_body.z = 8.9;
            b.ticks(1500);
        }),
        (ArmingCheck::Remote, |b| b.state().remote = None),
        (ArmingCheck::MotorsCool, |b| b.state().motor_temperature_c[3] = f64::NAN),
        // Motors that do not measure: an empty field, all of them, and a byte that reads as negative.
        (ArmingCheck::MotorsCool, |b| b.state().motor_temperature_c[3] = 0.0),
        (ArmingCheck::MotorsCool, |b| b.state().motor_temperature_c = [0.0; 12]),
        (ArmingCheck::MotorsCool, |b| b.state().motor_temperature_c[5] = -1.0),
        (ArmingCheck::Battery, |b| b.state().battery.as_mut().unwrap().charge_percent = f64::NAN),
        // Regression: a byte that means "not available" passed as a full battery.
        (ArmingCheck::Battery, |b| b.state().battery.as_mut().unwrap().charge_percent = 255.0),
        (ArmingCheck::Battery, |b| b.state().battery.as_mut().unwrap().charge_percent = 101.0),
    ];
    for (check, breaks) in table {
        let mut bench = lying_still();
        breaks(&mut bench);
        let mut failing = bench.failing();
        match check {
            ArmingCheck::Upright => failing.retain(|check| *check != ArmingCheck::Orientation),
            ArmingCheck::LyingDown => failing.retain(|check| *check != ArmingCheck::JointVelocity),
            _ => {}
        }
        assert_eq!(failing, [check]);
        assert_eq!(bench.cycle.mode(), Mode::Disarmed);
    }
}

#[test]
fn all_that_fails_is_named_at_once() {
    let mut bench = lying_still();
    bench.robot.link.recent_corrupt = 3;
    bench.state().battery = None;
    bench.state().imu.gyro_body.z = 1.0;
    assert_eq!(bench.failing(), [ArmingCheck::Checksums, ArmingCheck::Battery, ArmingCheck::GyroStill]);
}

/// Stillness must last; late ticks leave the window after five seconds.
#[test]
fn stillness_must_last_and_lateness_is_forgotten() {
    let mut bench = lying_still();
    bench.state().imu.gyro_body.z = 1.0;
    bench.inputs.lateness_ns = 2_000_000;
    bench.ticks(100);
    bench.state().imu.gyro_body.z = 0.0;
    bench.inputs.lateness_ns = 0;
    bench.ticks(900);
    assert_eq!(bench.failing(), [ArmingCheck::GyroStill, ArmingCheck::OnTime]);
    bench.ticks(200);
    assert_eq!(bench.failing(), [ArmingCheck::OnTime]);
    bench.ticks(5000);
    assert_eq!(bench.failing(), []);
}

/// A motor that left servo mode is named, and nothing is energised. Regression: the other eleven were energised for one tick.
#[test]
fn a_motor_out_of_servo_mode_is_named_before_anything_is_energised() {
    let mut bench = lying_still();
    bench.state().motor_enabled[7] = false;
    bench.state().motor_enabled[9] = false;
    bench.ticks(1);
    let findings = bench.cycle.readiness().findings;
    let finding = findings.get(ArmingCheck::MotorsFollow).unwrap();
    assert_eq!((finding.measured, finding.joint), (2.0, Some(7)));
    assert_eq!(bench.failing(), [ArmingCheck::MotorsFollow]);
}

/// An old state does not count as stillness. Regression: one state that was read a thousand times counted as a second.
#[test]
fn silence_is_not_stillness() {
    let silent = |bench: &mut ArmingBench, ticks: u32| {
        let state = bench.robot.state;
        for age_ms in 1..=ticks {
            bench.robot.state = Err(RobotError::NoNewState { age_ms });
            bench.tick(None);
        }
        bench.robot.state = state.map(|state| RobotState { robot_time_ms: state.robot_time_ms + ticks, ..state });
    };
    let moved = || {
        let mut bench = lying_still();
        bench.state().imu.gyro_body.z = 1.0;
        bench.ticks(2);
        bench.state().imu.gyro_body.z = 0.0;
        bench
    };
    // Every tenth state is new: after a second, 0.1 s of states has arrived.
    let mut bench = moved();
    for _ in 0..110 {
        bench.ticks(1);
        silent(&mut bench, 9);
    }
    bench.ticks(1);
    assert_eq!(bench.failing(), [ArmingCheck::GyroStill]);
    bench.ticks(1000);
    assert_eq!(bench.failing(), []);
    // A longer silence and a restart reset the count.
    let mut bench = moved();
    bench.ticks(1500);
    silent(&mut bench, 25);
    bench.ticks(10);
    bench.command(Command::Acknowledge { stops: 0 });
    assert_eq!(bench.failing(), [ArmingCheck::GyroStill]);
    let mut bench = lying_still();
    bench.state().robot_time_ms = 0;
    bench.ticks(2);
    bench.command(Command::Acknowledge { stops: 0 });
    assert_eq!(bench.failing(), [ArmingCheck::GyroStill]);
    bench.ticks(1000);
    assert_eq!(bench.failing(), []);
}

/// Joint limits: intersection of URDF and official SDK.
#[test]
fn joint_limits_are_the_intersection_of_the_urdf_and_the_official_sdk() {
    let Bench { settings, .. } = lying_still();
    for leg in 0..4 {
        let limits = |joint: usize| (settings.min_position[3 * leg + joint], settings.max_position[3 * leg + joint]);
        assert_eq!(limits(0), (-0.863, 0.863), "hip: the URDF's");
        assert_eq!(limits(1), (-0.663, 2.966), "thigh: the SDK's");
        assert_eq!(limits(2), (-2.721, -0.888), "calf: the lower of the SDK's, the upper of the URDF's");
    }
    let (lying, min) = (settings.lying_position, settings.min_position);
    assert!((0..12).all(|i| lying[i] >= min[i]), "sitting down asks for nothing beyond a limit: {lying:?}");
}

#[test]
fn the_table_has_the_order_of_the_findings() {
    let findings = lying_still().cycle.readiness().findings;
    assert_eq!(findings.failing().iter().next(), None, "these are findings of a tick");
    assert_eq!(findings.0.map(|finding| finding.check), ArmingCheck::CONTROL);
}
