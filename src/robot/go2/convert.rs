//! Conversion between the engine's commands and states and the Go2's messages; conventions as in `docs/go2-wire.md`,
//! section 5.
//!
//! Motor order, joint signs and frames are the same in both: order FR, FL, RR, RL x hip, thigh, calf; quaternion w, x,
//! y, z from body to world. Assumed: the inertial unit's axes are the trunk's, the order of the feet is that of the
//! legs, the current is negative while discharging, and `tick` counts milliseconds. `robots/go2/README.md` lists them.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::message::{
    CommandMessage, CommandPayload, EncodeError, MODE_SERVO, MODE_STOP, MotorReport, POSITION_STOP, ServoTarget,
    StateMessage, VELOCITY_STOP,
};
use crate::robot::remote::RemoteRecord;
use crate::robot::rotation::roll_pitch_yaw;
use crate::robot::{Battery, Imu, JOINTS, JointCommand, MotorCommand, RobotState};

/// Largest deviation of the norm of a reported orientation from 1.
const QUATERNION_TOLERANCE: f32 = 0.1;

/// Encodes `command`; motors 12 to 19 are in servo mode without a target, as by the SDK.
///
/// Every motor is in servo mode, also while the robot is damped: damping is the gain `kd` towards the velocity zero. Without
/// stiffness the message holds no position target, without damping no velocity target, so a motor can never run to a stale
/// target.
///
/// # Errors
/// A number is not finite, or a gain is negative.
pub fn low_command(command: &JointCommand) -> Result<CommandPayload, EncodeError> {
    let mut message = CommandMessage::INITIAL;
    for (motor, command) in command.motor.iter().enumerate() {
        message.motor[motor] = encode_motor(motor, command)?;
    }
    message.encode()
}

fn encode_motor(motor: usize, command: &MotorCommand) -> Result<ServoTarget, EncodeError> {
    let finite = |quantity, value: f64| {
        let value = value as f32;
        if value.is_finite() { Ok(value) } else { Err(EncodeError::NotFinite { quantity, motor, value }) }
    };
    let (position, velocity) = (finite("position", command.position_rad)?, finite("velocity", command.velocity_rad_s)?);
    // The gains as they are sent: one that is too small for 32 bits is none.
    let (kp, kd) = (command.kp_joint as f32, command.kd_joint as f32);
    Ok(ServoTarget {
        position: if kp == 0.0 { POSITION_STOP } else { position },
        velocity: if kd == 0.0 { VELOCITY_STOP } else { velocity },
        torque: command.torque_n_m as f32,
        kp,
        kd,
        ..ServoTarget::NONE
    })
}

/// Decodes a motor's target, for an emulator; none outside of servo mode.
pub fn motor_command(target: &ServoTarget) -> Option<MotorCommand> {
    if target.mode != MODE_SERVO {
        return None;
    }
    let mut command = MotorCommand { torque_n_m: target.torque.into(), ..MotorCommand::default() };
    if target.kp != 0.0 {
        (command.position_rad, command.kp_joint) = (target.position.into(), target.kp.into());
    }
    if target.kd != 0.0 {
        (command.velocity_rad_s, command.kd_joint) = (target.velocity.into(), target.kd.into());
    }
    Some(command)
}

/// Decodes a state. `foot_step_n` is the force per count of a foot sensor, N.
///
/// `motor_enabled` is whether the motor reports servo mode. An orientation that is no rotation (all zero, for example)
/// becomes NaN, so that the failsafe reports it. Voltages of the battery's first ten cells are kept; the sum is of all.
pub fn robot_state(state: &StateMessage, foot_step_n: f64) -> RobotState {
    let joints = |value: fn(&MotorReport) -> f64| std::array::from_fn(|i| value(&state.motor[i]));
    let imu = &state.imu;
    let [w, x, y, z] = imu.quaternion;
    let norm = (w * w + x * x + y * y + z * z).sqrt();
    let world_from_body = if (norm - 1.0).abs() < QUATERNION_TOLERANCE {
        UnitQuaternion::new_normalize(Quaternion::new(w.into(), x.into(), y.into(), z.into()))
    } else {
        UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, f64::NAN, f64::NAN, f64::NAN))
    };
    let cell_v = state.battery.cell_mv.map(|mv| f64::from(mv) * 1e-3);
    RobotState {
        robot_time_ms: state.tick,
        joint_position_rad: joints(|motor| motor.position.into()),
        joint_velocity_rad_s: joints(|motor| motor.velocity.into()),
        joint_torque_n_m: joints(|motor| motor.torque.into()),
        imu: Imu { world_from_body, gyro_body: vector(&imu.gyroscope), accel_body: vector(&imu.accelerometer) },
        foot_force_n: state.foot_force.map(|force| f64::from(force) * foot_step_n),
        motor_temperature_c: joints(|motor| motor.temperature.into()),
        motor_enabled: std::array::from_fn(|i| state.motor[i].mode == MODE_SERVO),
        battery: Some(Battery {
            charge_percent: state.battery.charge.into(),
            voltage_v: cell_v.iter().sum(),
            current_a: f64::from(state.battery.current) * 1e-3,
            cell_v: std::array::from_fn(|cell| cell_v[cell]),
        }),
        truth: None,
        remote: state.remote.decode(),
    }
}

/// Encodes a state, for an emulator: the inverse of [`robot_state`].
pub fn low_state(state: &RobotState, foot_step_n: f64) -> StateMessage {
    let mut message = StateMessage::zero();
    message.tick = state.robot_time_ms;
    let orientation = &state.imu.world_from_body;
    let [x, y, z, w]: [f64; 4] = orientation.coords.into();
    let (roll, pitch, yaw) = roll_pitch_yaw(orientation);
    message.imu.quaternion = [w, x, y, z].map(|value| value as f32);
    message.imu.gyroscope = floats(&state.imu.gyro_body);
    message.imu.accelerometer = floats(&state.imu.accel_body);
    message.imu.roll_pitch_yaw = [roll, pitch, yaw].map(|angle| angle as f32);
    for i in 0..JOINTS {
        message.motor[i] = MotorReport {
            mode: if state.motor_enabled[i] { MODE_SERVO } else { MODE_STOP },
            position: state.joint_position_rad[i] as f32,
            velocity: state.joint_velocity_rad_s[i] as f32,
            torque: state.joint_torque_n_m[i] as f32,
            temperature: state.motor_temperature_c[i].round() as i8,
            ..MotorReport::default()
        };
    }
    if let Some(battery) = &state.battery {
        message.battery.charge = battery.charge_percent.round() as u8;
        message.battery.current = (battery.current_a * 1e3).round() as i32;
        for (cell, voltage) in message.battery.cell_mv.iter_mut().zip(battery.cell_v) {
            *cell = (voltage * 1e3).round() as u16;
        }
        message.power_v = battery.voltage_v as f32;
        message.power_a = battery.current_a as f32;
    }
    message.foot_force = state.foot_force_n.map(|force| (force / foot_step_n).round() as i16);
    if let Some(remote) = &state.remote {
        message.remote = RemoteRecord::encode(remote);
    }
    message
}

fn floats(vector: &Vector3<f64>) -> [f32; 3] {
    [vector.x, vector.y, vector.z].map(|value| value as f32)
}

fn vector(floats: &[f32; 3]) -> Vector3<f64> {
    Vector3::from(floats.map(f64::from))
}
