//! From commands to joint torques: ideal motors, or ones with a torque-speed curve, lag and friction.

use super::config::{ActuatorConfig, ActuatorKind, HardwareLikeConfig};
use crate::robot::description::JointLimits;
use crate::robot::{JOINTS, JointCommand, Joints};

/// What the motors do in one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Drive {
    /// Torques at the velocities of the step's start, N m, viscous friction included.
    pub torque: Joints,
    /// How much less they become per rad/s of more velocity in the step, N m s/rad. The step takes it implicitly: stiff
    /// damping stays stable.
    pub damping: Joints,
    /// Bounds of dry friction, N m.
    pub dry_friction: Joints,
}

/// The twelve motors.
#[derive(Debug, Clone)]
pub(super) struct Actuator {
    config: ActuatorConfig,
    limits: JointLimits,
    /// Torques at the motors now, N m: what the lag has reached.
    torque: Joints,
}

impl Actuator {
    pub fn new(config: &ActuatorConfig, limits: &JointLimits) -> Actuator {
        Actuator { config: *config, limits: *limits, torque: [0.0; JOINTS] }
    }

    pub fn reset(&mut self) {
        self.torque = [0.0; JOINTS];
    }

    /// Torques of the motors, N m, without the joints' friction: what they report.
    pub fn torque(&self) -> &Joints {
        &self.torque
    }

    /// What `command` makes of the motors at joint angles `q` and velocities `dq` for a step of `h` seconds.
    pub fn drive(&mut self, command: &JointCommand, q: &Joints, dq: &Joints, h: f64) -> Drive {
        match self.config.kind {
            ActuatorKind::Ideal => self.drive_ideal(command, q, dq, h),
            ActuatorKind::HardwareLike => self.drive_hardware_like(command, q, dq, h),
        }
    }

    fn drive_ideal(&mut self, command: &JointCommand, q: &Joints, dq: &Joints, h: f64) -> Drive {
        let mut drive = Drive { torque: [0.0; JOINTS], damping: [0.0; JOINTS], dry_friction: [0.0; JOINTS] };
        for i in 0..JOINTS {
            let (motor, most) = (&command.motor[i], self.limits.max_torque[i]);
            let wanted = motor.torque_at(q[i], dq[i]);
            drive.torque[i] = wanted.clamp(-most, most);
            // At the limit the motor no longer answers to velocity. Below it kp (q_d - q) + kd (dq_d - dq) is taken at the end of
            // the step, where q has moved by h dq: its slope in dq is -(kd + h kp).
            if wanted.abs() < most {
                drive.damping[i] = motor.kd + h * motor.kp;
                drive.torque[i] -= h * motor.kp * dq[i];
            }
        }
        self.torque = drive.torque;
        drive
    }

    fn drive_hardware_like(&mut self, command: &JointCommand, q: &Joints, dq: &Joints, h: f64) -> Drive {
        let HardwareLikeConfig { torque_lag_s, dry_friction_nm, viscous_friction_nm_s, .. } = self.config.hardware_like;
        // First-order lag: d torque / dt = (wanted - torque) / T, exactly over the step.
        let reached = if torque_lag_s > 0.0 { -(-h / torque_lag_s).exp_m1() } else { 1.0 };
        let mut drive = Drive {
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

    /// `torque` within what the motor gives at the joint velocity `dq`: full up to a share of the no-load speed, then linearly
    /// less, none at and above that speed. Braking is not limited by speed.
    fn within_curve(&self, joint: usize, torque: f64, dq: f64) -> f64 {
        if torque * dq <= 0.0 {
            return torque;
        }
        let full = self.config.hardware_like.full_torque_speed_share;
        let share = ((1.0 - dq.abs() / self.limits.max_velocity[joint]) / (1.0 - full)).clamp(0.0, 1.0);
        let most = share * self.limits.max_torque[joint];
        torque.clamp(-most, most)
    }
}
