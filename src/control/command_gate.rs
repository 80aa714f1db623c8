//! The last gate before the motors, after every controller: finite, clamp, rate.

use super::settings::ControlSettings;
use crate::robot::{JOINTS, JointCommand, Joints, MotorCommand, RobotState};
use crate::telemetry::Fault;

/// Result of the gate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GateOutput {
    /// Command to send.
    pub command: JointCommand,
    /// Bit `i` set: the command of joint `i` was changed.
    pub limited: u16,
    /// A number was not finite; `command` is damping.
    pub fault: Option<Fault>,
}

/// The gate, with the last torques for the rate limit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CommandGate {
    last_torque: Option<Joints>,
}

impl CommandGate {
    /// Clears the last torques: the rate limit does not apply to the next command, after a placement or damping.
    pub fn reset(&mut self) {
        self.last_torque = None;
    }

    /// Limits `wanted`.
    ///
    /// 1. Damping passes unchanged: it needs no measured number.
    /// 2. A number that is not finite gives damping and a fault.
    /// 3. Position and gains are clamped.
    /// 4. The torque of the motor's own law at the measured angle and velocity is clamped to the joint's limit and rate, by a change
    ///    of the feed-forward torque.
    /// 5. If that feed-forward torque exceeds the joint's limit (an encoder that jumps), the limited torque is sent alone, without
    ///    the law: equal if the measured numbers are right, harmless if they are not.
    pub fn pass(&mut self, wanted: &JointCommand, state: &RobotState, settings: &ControlSettings) -> GateOutput {
        let damping = JointCommand::damping(settings.gate.damping_kd);
        if *wanted == damping {
            self.reset();
            return GateOutput { command: damping, limited: 0, fault: None };
        }
        let mut passed = GateOutput { command: *wanted, limited: 0, fault: None };
        let mut torques = Joints::default();
        let refused = |what| GateOutput {
            command: damping,
            limited: u16::MAX >> (16 - JOINTS),
            fault: Some(Fault::NotFinite { what }),
        };
        for joint in 0..JOINTS {
            let motor = &mut passed.command.motor[joint];
            let finite = [motor.position_rad, motor.velocity_rad_s, motor.kp_joint, motor.kd_joint, motor.torque_n_m];
            if !finite.iter().all(|value| value.is_finite()) {
                self.reset();
                return refused("a motor command");
            }
            let before = *motor;
            motor.position_rad = motor.position_rad.clamp(settings.min_position[joint], settings.max_position[joint]);
            motor.kp_joint = motor.kp_joint.clamp(0.0, settings.gate.kp_max);
            motor.kd_joint = motor.kd_joint.clamp(0.0, settings.gate.kd_max);
            // tau_motor = tau + kp (q_d - q) + kd (dq_d - dq)
            let feedback =
                motor.torque_at(state.joint_position_rad[joint], state.joint_velocity_rad_s[joint]) - motor.torque_n_m;
            if !feedback.is_finite() {
                self.reset();
                return refused("a joint's angle or velocity");
            }
            let mut torque =
                (motor.torque_n_m + feedback).clamp(-settings.max_torque[joint], settings.max_torque[joint]);
            if let Some(last) = self.last_torque {
                let step = settings.gate.torque_step_nm;
                torque = torque.clamp(last[joint] - step, last[joint] + step);
            }
            motor.torque_n_m = torque - feedback;
            if motor.torque_n_m.abs() > settings.max_torque[joint] {
                *motor = MotorCommand { torque_n_m: torque, ..MotorCommand::default() };
            }
            torques[joint] = torque;
            // Rounding of the subtraction does not count as limited.
            let moved = (motor.torque_n_m - before.torque_n_m).abs() > 1e-9;
            if moved
                || motor.kp_joint != before.kp_joint
                || motor.kd_joint != before.kd_joint
                || (motor.kp_joint > 0.0 && motor.position_rad != before.position_rad)
            {
                passed.limited |= 1 << joint;
            } else {
                motor.torque_n_m = before.torque_n_m;
            }
        }
        self.last_torque = Some(torques);
        passed
    }
}

/// Checks that every measured number is finite.
///
/// # Errors
/// The first quantity that is not.
pub fn finite(state: &RobotState) -> Result<(), Fault> {
    let all = |values: &[f64], what| {
        if values.iter().all(|value| value.is_finite()) { Ok(()) } else { Err(Fault::NotFinite { what }) }
    };
    all(&state.joint_position_rad, "a joint angle")?;
    all(&state.joint_velocity_rad_s, "a joint velocity")?;
    all(state.imu.world_from_body.coords.as_slice(), "the orientation")?;
    all(state.imu.gyro_body.as_slice(), "the angular velocity")?;
    all(state.imu.accel_body.as_slice(), "the acceleration")?;
    all(&state.foot_force_n, "a foot's force")
}
