//! Conversion between the engine's commands and states and the Go1's datagrams; conventions as in `docs/go1-wire.md`,
//! section 7.
//!
//! Motor order, joint signs and frames are the same in both: order FR, FL, RR, RL x hip, thigh, calf; quaternion w, x,
//! y, z from body to world. Assumed: the inertial unit's axes are the trunk's, the order of the feet is that of the
//! legs, and the current is negative while discharging. `robots/go1/README.md` lists the checks.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use zerocopy::little_endian::F32;

use super::packet::{
    CommandError, CrcForm, LowCmd, LowState, MODE_BRAKE, MODE_SERVO, MotorRecord, MotorTarget, POSITION_STOP,
    RemoteRecord, VELOCITY_STOP,
};
use crate::robot::rotation::roll_pitch_yaw;
use crate::robot::{Battery, Imu, JOINTS, JointCommand, MotorCommand, RobotState};

/// Largest deviation of the norm of a reported orientation from 1.
const QUATERNION_TOLERANCE: f32 = 0.1;

/// Encodes `command`; motors 12 to 19 brake without a target.
///
/// Every motor is in servo mode, also while the robot is damped: damping is the gain `kd` alone. The strength of the
/// motor's own braking (mode 0x00) is unknown and may differ between joints; the controller was tested with `kd`. A
/// motor that reports another mode has therefore always left servo mode by itself. Without stiffness the datagram holds
/// no position target, without damping no velocity target, so a motor can never run to a stale target.
///
/// # Errors
/// A number is not finite or does not fit the datagram.
pub fn low_cmd(command: &JointCommand, form: CrcForm) -> Result<LowCmd, CommandError> {
    let mut datagram = LowCmd::without_crc();
    for (motor, command) in command.motor.iter().enumerate() {
        datagram.set(motor, &encode_motor(motor, command)?)?;
    }
    datagram.write_crc(form);
    Ok(datagram)
}

fn encode_motor(motor: usize, command: &MotorCommand) -> Result<MotorTarget, CommandError> {
    let finite = |quantity, value: f64| {
        let value = value as f32;
        if value.is_finite() { Ok(value) } else { Err(CommandError::NotFinite { quantity, motor, value }) }
    };
    let (position, velocity) = (finite("position", command.position_rad)?, finite("velocity", command.velocity_rad_s)?);
    Ok(MotorTarget {
        mode: MODE_SERVO,
        position: if command.kp_joint == 0.0 { POSITION_STOP } else { position },
        velocity: if command.kd_joint == 0.0 { VELOCITY_STOP } else { velocity },
        torque: command.torque_n_m as f32,
        kp: command.kp_joint as f32,
        kd: command.kd_joint as f32,
    })
}

/// Decodes a motor's target, for the emulator; none outside of servo mode.
pub fn decode_motor(target: &MotorTarget) -> Option<MotorCommand> {
    if target.mode != MODE_SERVO {
        return None;
    }
    let mut command = MotorCommand { torque_n_m: target.torque.into(), ..MotorCommand::default() };
    if target.position != POSITION_STOP {
        (command.position_rad, command.kp_joint) = (target.position.into(), target.kp.into());
    }
    if target.velocity != VELOCITY_STOP {
        (command.velocity_rad_s, command.kd_joint) = (target.velocity.into(), target.kd.into());
    }
    Some(command)
}

/// Decodes a state. `foot_step_n` is the force per step of a foot sensor, N.
///
/// `motor_enabled` is whether the motor reports servo mode. An orientation that is no rotation (all zero, for example)
/// becomes NaN, so that the failsafe reports it.
pub fn robot_state(state: &LowState, foot_step_n: f64) -> RobotState {
    let joints = |value: fn(&MotorRecord) -> f64| std::array::from_fn(|i| value(&state.motor[i]));
    let imu = &state.imu;
    let [w, x, y, z] = imu.quaternion.map(F32::get);
    let norm = (w * w + x * x + y * y + z * z).sqrt();
    let world_from_body = if (norm - 1.0).abs() < QUATERNION_TOLERANCE {
        UnitQuaternion::new_normalize(Quaternion::new(w.into(), x.into(), y.into(), z.into()))
    } else {
        UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, f64::NAN, f64::NAN, f64::NAN))
    };
    let cell_v = state.battery.cell_v().map(f64::from);
    RobotState {
        robot_time_ms: state.robot_time_ms.get(),
        joint_position_rad: joints(|motor| motor.position.get().into()),
        joint_velocity_rad_s: joints(|motor| motor.velocity.get().into()),
        joint_torque_n_m: joints(|motor| motor.torque().into()),
        imu: Imu { world_from_body, gyro_body: vector(&imu.gyroscope), accel_body: vector(&imu.accelerometer) },
        foot_force_n: state.foot_force.map(|force| f64::from(force.get()) * foot_step_n),
        motor_temperature_c: joints(|motor| motor.temperature.into()),
        motor_enabled: std::array::from_fn(|i| state.motor[i].mode == MODE_SERVO),
        battery: Some(Battery {
            charge_percent: state.battery.charge.into(),
            voltage_v: cell_v.iter().sum(),
            current_a: f64::from(state.battery.current.get()) * 1e-3,
            cell_v,
        }),
        truth: None,
        remote: state.remote.decode(),
    }
}

/// Encodes a state, for the emulator: the inverse of [`robot_state`]. The caller computes the checksum.
pub fn low_state(state: &RobotState, foot_step_n: f64) -> LowState {
    let mut datagram = LowState::zero();
    datagram.robot_time_ms = state.robot_time_ms.into();
    let orientation = &state.imu.world_from_body;
    let [x, y, z, w]: [f64; 4] = orientation.coords.into();
    datagram.imu.quaternion = [w, x, y, z].map(float);
    datagram.imu.gyroscope = floats(&state.imu.gyro_body);
    datagram.imu.accelerometer = floats(&state.imu.accel_body);
    let (roll, pitch, yaw) = roll_pitch_yaw(orientation);
    datagram.imu.roll_pitch_yaw = [roll, pitch, yaw].map(float);
    for i in 0..JOINTS {
        let motor = &mut datagram.motor[i];
        motor.mode = if state.motor_enabled[i] { MODE_SERVO } else { MODE_BRAKE };
        motor.position = float(state.joint_position_rad[i]);
        motor.velocity = float(state.joint_velocity_rad_s[i]);
        motor.position_raw = motor.position;
        motor.velocity_raw = motor.velocity;
        motor.set_torque(state.joint_torque_n_m[i] as f32);
        motor.temperature = state.motor_temperature_c[i].round() as i8;
    }
    if let Some(battery) = &state.battery {
        datagram.battery.charge = battery.charge_percent.round() as u8;
        datagram.battery.current = ((battery.current_a * 1e3).round() as i32).into();
        datagram.battery.set_cell_v(&battery.cell_v.map(|v| v as f32));
    }
    datagram.foot_force = state.foot_force_n.map(|force| ((force / foot_step_n).round() as i16).into());
    datagram.foot_force_estimated = datagram.foot_force;
    if let Some(remote) = &state.remote {
        datagram.remote = RemoteRecord::encode(remote);
    }
    datagram
}

fn float(value: f64) -> F32 {
    (value as f32).into()
}

fn floats(vector: &Vector3<f64>) -> [F32; 3] {
    [vector.x, vector.y, vector.z].map(float)
}

fn vector(floats: &[F32; 3]) -> Vector3<f64> {
    Vector3::from(floats.map(|value| f64::from(value.get())))
}
