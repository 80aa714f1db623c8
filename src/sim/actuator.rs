//! Motor models: joint torques from commands, for ideal motors or motors with torque-speed curve, lag and friction.

use super::config::{ActuatorConfig, ActuatorKind, HardwareLikeConfig};
use crate::robot::description::JointLimits;
use crate::robot::{JOINTS, JointCommand, Joints};

/// Output of the motors in one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MotorTorques {
    /// Torques at the velocities of the start of the step, with viscous friction, N m.
    pub torque: Joints,
    /// Decrease of the torques per velocity, N m s/rad. The step treats it implicitly, so that stiff damping is stable.
    pub damping: Joints,
    /// Bounds of dry friction, N m.
    pub dry_friction: Joints,
}

/// The twelve motors.
#[derive(Debug, Clone)]
pub(super) struct Actuator {
    config: ActuatorConfig,
    limits: JointLimits,
    /// Current torques of the motors after the lag, N m.
    torque: Joints,
}

impl Actuator {
    pub fn new(config: &ActuatorConfig, limits: &JointLimits) -> Actuator {
        Actuator { config: *config, limits: *limits, torque: [0.0; JOINTS] }
    }

    pub fn reset(&mut self) {
        self.torque = [0.0; JOINTS];
    }

    /// Reported torques of the motors, without joint friction, N m.
    pub fn torque(&self) -> &Joints {
        &self.torque
    }

    /// Computes the output for `command` at joint angles `q` and velocities `dq` in a step of `h` seconds.
    pub fn drive(&mut self, command: &JointCommand, q: &Joints, dq: &Joints, h: f64) -> MotorTorques {
        match self.config.kind {
            ActuatorKind::Ideal => self.drive_ideal(command, q, dq, h),
            ActuatorKind::HardwareLike => self.drive_hardware_like(command, q, dq, h),
        }
    }

    fn drive_ideal(&mut self, command: &JointCommand, q: &Joints, dq: &Joints, h: f64) -> MotorTorques {
        let mut drive = MotorTorques { torque: [0.0; JOINTS], damping: [0.0; JOINTS], dry_friction: [0.0; JOINTS] };
        for i in 0..JOINTS {
            let (motor, most) = (&command.motor[i], self.limits.max_torque[i]);
            let wanted = motor.torque_at(q[i], dq[i]);
            drive.torque[i] = wanted.clamp(-most, most);
            // A saturated torque does not depend on velocity. Otherwise kp (q_d - q) + kd (dq_d - dq) is evaluated at
            // the end of the step, where q has moved by h dq: its slope in dq is -(kd + h kp).
            if wanted.abs() < most {
                drive.damping[i] = motor.kd_joint + h * motor.kp_joint;
                drive.torque[i] -= h * motor.kp_joint * dq[i];
            }
        }
        self.torque = drive.torque;
        drive
    }

    fn drive_hardware_like(&mut self, command: &JointCommand, q: &Joints, dq: &Joints, h: f64) -> MotorTorques {
        let HardwareLikeConfig { torque_lag_s, dry_friction_nm, viscous_friction_nm_s, .. } = self.config.hardware_like;
        // First-order lag: d torque / dt = (wanted - torque) / T, exactly over the step.
        let reached = if torque_lag_s > 0.0 { -libm::expm1(-h / torque_lag_s) } else { 1.0 };
        let mut drive = MotorTorques {
            torque: [0.0; JOINTS],
            damping: [viscous_friction_nm_s; JOINTS],
            dry_friction: [dry_friction_nm; JOINTS],
        };
        for i in 0..JOINTS {
            let most = self.limits.max_torque[i];
            let wanted = command.motor[i].torque_at(q[i], dq[i]).clamp(-most, most);
            let torque = self.torque[i] + (wanted - self.torque[i]) * reached;
            self.torque[i] = self.within_curve(i, torque, dq[i]);
            drive.torque[i] = self.torque[i] - viscous_friction_nm_s * dq[i];
        }
        drive
    }

    /// Clamps `torque` to the torque-speed curve at the joint velocity `dq`: full torque up to a share of the no-load
    /// speed, then linearly less, zero at and above it. Braking torque is not limited by speed.
    fn within_curve(&self, joint: usize, torque: f64, dq: f64) -> f64 {
        if torque * dq <= 0.0 {
            return torque;
        }
        let full = self.config.hardware_like.full_torque_speed_share;
        let share = ((1.0 - dq.abs() / self.limits.max_velocity[joint]) / (1.0 - full)).clamp(0.0, 1.0);
        let most = share * self.limits.max_torque[joint];
        // `clamp` would panic where the velocity is not finite, which the control has yet to find in the state.
        torque.min(most).max(-most)
    }
}
