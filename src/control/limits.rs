//! The last gate: finite, clamp, rate. One function, after every controller, always.

use super::settings::{ControlSettings, PERIOD_S};
use crate::robot::{JOINTS, JointCommand, Joints, MotorCommand, RobotState};
use crate::telemetry::Fault;

/// What left the gate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passed {
    /// The command that may be sent.
    pub command: JointCommand,
    /// Bit `i` set: the command of joint `i` was changed.
    pub limited: u16,
    /// Something was not a finite number: `command` is damping.
    pub fault: Option<Fault>,
}

/// The gate; remembers the last torques for the rate limit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CommandGate {
    last_torque: Option<Joints>,
}

impl CommandGate {
    /// The next command is not compared with the last one: the robot was put somewhere else or was damped.
    pub fn reset(&mut self) {
        self.last_torque = None;
    }

    /// Lets `wanted` through as far as the limits allow.
    ///
    /// The torque that counts is the one that the motor's own law will produce at the measured angle and velocity; the
    /// feed-forward part is changed so that this stays inside the joint's limit and its rate. Where that would take a
    /// feed-forward torque beyond the joint's limit itself, against a law that asks for more than twice of it (an encoder that
    /// jumps), the law is left out: the torque alone is sent, which is the same if the measured numbers are right and harmless
    /// if they are not.
    pub fn pass(&mut self, wanted: &JointCommand, state: &RobotState, settings: &ControlSettings) -> Passed {
        let damping = JointCommand::damping(settings.gate.damping_kd);
        if *wanted == damping {
            // The safe command needs no measured number, and passes even when there is none.
            self.reset();
            return Passed { command: damping, limited: 0, fault: None };
        }
        let mut passed = Passed { command: *wanted, limited: 0, fault: None };
        let mut torques = Joints::default();
        for joint in 0..JOINTS {
            let motor = &mut passed.command.motor[joint];
            let finite = [motor.position, motor.velocity, motor.kp, motor.kd, motor.torque];
            if !finite.iter().all(|value| value.is_finite()) {
                self.reset();
                let fault = Some(Fault::NotFinite { what: "a motor command" });
                return Passed { command: damping, limited: u16::MAX >> (16 - JOINTS), fault };
            }
            let before = *motor;
            motor.position = motor.position.clamp(settings.min_position[joint], settings.max_position[joint]);
            motor.kp = motor.kp.clamp(0.0, settings.gate.kp_max);
            motor.kd = motor.kd.clamp(0.0, settings.gate.kd_max);
            // tau_motor = tau + kp (q_d - q) + kd (dq_d - dq)
            let feedback = motor.torque_at(state.joint_position[joint], state.joint_velocity[joint]) - motor.torque;
            if !feedback.is_finite() {
                self.reset();
                let fault = Some(Fault::NotFinite { what: "a joint's angle or velocity" });
                return Passed { command: damping, limited: u16::MAX >> (16 - JOINTS), fault };
            }
            let mut torque = (motor.torque + feedback).clamp(-settings.max_torque[joint], settings.max_torque[joint]);
            if let Some(last) = self.last_torque {
                let step = settings.gate.torque_step_nm;
                torque = torque.clamp(last[joint] - step, last[joint] + step);
            }
            motor.torque = torque - feedback;
            if motor.torque.abs() > settings.max_torque[joint] {
                *motor = MotorCommand { torque, ..MotorCommand::default() };
            }
            torques[joint] = torque;
            // Rounding of the subtraction is not a limit.
            let moved = (motor.torque - before.torque).abs() > 1e-9;
            if moved
                || motor.kp != before.kp
                || motor.kd != before.kd
                || (motor.kp > 0.0 && motor.position != before.position)
            {
                passed.limited |= 1 << joint;
            } else {
                motor.torque = before.torque;
            }
        }
        self.last_torque = Some(torques);
        passed
    }
}

/// Whether every measured number is finite.
pub fn finite(state: &RobotState) -> Result<(), Fault> {
    let all = |values: &[f64], what| {
        if values.iter().all(|value| value.is_finite()) { Ok(()) } else { Err(Fault::NotFinite { what }) }
    };
    all(&state.joint_position, "a joint angle")?;
    all(&state.joint_velocity, "a joint velocity")?;
    all(state.imu.orientation_world.coords.as_slice(), "the orientation")?;
    all(state.imu.gyro_body.as_slice(), "the angular velocity")?;
    all(state.imu.accel_body.as_slice(), "the acceleration")?;
    all(&state.foot_force, "a foot's force")
}

/// Number of ticks in `seconds`.
pub fn ticks(seconds: f64) -> u32 {
    (seconds / PERIOD_S).round() as u32
}
