//! The last gate before the motors, after every controller: finite, clamp, rate.

use super::settings::ControlSettings;
use crate::robot::{JOINTS, JointCommand, Joints, MOTOR_DAMPING_STEP, MotorCommand, RobotState};
use crate::telemetry::Fault;

/// Largest torque that a controller may want on hardware, N m: a larger one comes from a wrong number, and its limit would still be sent.
const MOST_WANTED_N_M: f64 = 1e4;

/// Result of the gate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GateOutput {
    /// Command to send.
    pub command: JointCommand,
    /// Bit `i` set: the command of joint `i` was changed.
    pub limited: u16,
    /// A number was not finite, or a torque is out of all bounds; `command` is damping.
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

    /// As [`CommandGate::pass_within`], with the whole of each joint's limit.
    pub fn pass(&mut self, wanted: &JointCommand, state: &RobotState, settings: &ControlSettings) -> GateOutput {
        self.pass_within(1.0, wanted, state, settings)
    }

    /// Limits a command without regard to the measured state: positions and gains are clamped, the motors limit the torque. Wanted
    /// velocities and torques, which count together with measured numbers, become 0.
    pub fn pass_unmeasured(&mut self, wanted: &JointCommand, settings: &ControlSettings) -> GateOutput {
        self.reset();
        let mut passed = GateOutput { command: *wanted, limited: 0, fault: None };
        for (joint, motor) in passed.command.motor.iter_mut().enumerate() {
            let held = MotorCommand { velocity_rad_s: 0.0, torque_n_m: 0.0, ..*motor };
            let limited = match clamped(&held, joint, settings) {
                Ok(limited) => limited,
                Err(fault) => return refused(fault, settings),
            };
            passed.limited |= u16::from(limited != *motor) << joint;
            *motor = limited;
        }
        passed
    }

    /// Limits `wanted`.
    ///
    /// 1. Damping passes unchanged: it needs no measured number.
    /// 2. A number that is not finite gives damping and a fault, as does, on hardware, a torque beyond 1e4 N m.
    /// 3. Position and gains are clamped.
    /// 4. The torque of the motor's own law at the measured angle and velocity is clamped to `torque_share` of the joint's limit and to
    ///    its rate, by a change of the feed-forward torque.
    /// 5. If that feed-forward torque exceeds the joint's limit (a fast joint, an encoder that jumps), a law without stiffness keeps as
    ///    much damping as the limit allows; a law with stiffness is replaced by the limited torque alone. Both give the same torque if
    ///    the measured numbers are right, and no more than the limit if they are not.
    pub fn pass_within(
        &mut self,
        torque_share: f64,
        wanted: &JointCommand,
        state: &RobotState,
        settings: &ControlSettings,
    ) -> GateOutput {
        let damping = JointCommand::damping(settings.gate.damping_kd);
        let last = self.last_torque.take();
        if *wanted == damping {
            return GateOutput { command: damping, limited: 0, fault: None };
        }
        let mut passed = GateOutput { command: *wanted, limited: 0, fault: None };
        let mut torques = Joints::default();
        for (joint, motor) in passed.command.motor.iter_mut().enumerate() {
            let measured = (state.joint_position_rad[joint], state.joint_velocity_rad_s[joint]);
            let last = last.map(|torques| torques[joint]);
            let limited = match limit_torque(motor, joint, measured, (torque_share, last), settings) {
                Ok(limited) => limited,
                Err(fault) => return refused(fault, settings),
            };
            torques[joint] = limited.torque_n_m;
            passed.limited |= u16::from(limited.changed) << joint;
            *motor = limited.motor;
        }
        self.last_torque = Some(torques);
        passed
    }
}

/// Damping of all joints for a command that cannot be sent.
fn refused(fault: Fault, settings: &ControlSettings) -> GateOutput {
    let command = JointCommand::damping(settings.gate.damping_kd);
    GateOutput { command, limited: u16::MAX >> (16 - JOINTS), fault: Some(fault) }
}

/// The command with position and gains within their limits. A fault if a number is not finite.
fn clamped(motor: &MotorCommand, joint: usize, settings: &ControlSettings) -> Result<MotorCommand, Fault> {
    let finite = [motor.position_rad, motor.velocity_rad_s, motor.kp_joint, motor.kd_joint, motor.torque_n_m];
    all_finite(&finite, "a motor command")?;
    Ok(MotorCommand {
        position_rad: motor.position_rad.clamp(settings.min_position[joint], settings.max_position[joint]),
        kp_joint: motor.kp_joint.clamp(0.0, settings.gate.kp_max),
        kd_joint: motor.kd_joint.clamp(0.0, settings.gate.kd_max),
        ..*motor
    })
}

/// The command of a joint within its limits.
struct LimitedMotor {
    motor: MotorCommand,
    /// Torque of the motor's law at the measured angle and velocity, N m.
    torque_n_m: f64,
    /// Whether the motor does something else than was wanted.
    changed: bool,
}

/// Steps 2 to 5 of [`CommandGate::pass_within`] for one joint at its measured angle q, rad, and velocity dq, rad/s. The torque is within
/// `torque_share` of the joint's limit, then within a rate limit's step of the `last` one, N m, which therefore wins where the share
/// falls.
fn limit_torque(
    wanted: &MotorCommand,
    joint: usize,
    (q, dq): (f64, f64),
    (torque_share, last): (f64, Option<f64>),
    settings: &ControlSettings,
) -> Result<LimitedMotor, Fault> {
    let clamped = clamped(wanted, joint, settings)?;
    // tau_motor = tau + kp (q_d - q) + kd (dq_d - dq)
    let feedback = clamped.kp_joint * (clamped.position_rad - q) + clamped.kd_joint * (clamped.velocity_rad_s - dq);
    all_finite(&[feedback], "a joint's angle or velocity")?;
    let wanted_n_m = clamped.torque_n_m + feedback;
    if settings.hardware && wanted_n_m.abs() > MOST_WANTED_N_M {
        let (measured_n_m, allowed_n_m) = (wanted_n_m, MOST_WANTED_N_M);
        return Err(Fault::WantedTorque { joint: joint as u8, measured_n_m, allowed_n_m });
    }
    let most_n_m = torque_share * settings.max_torque[joint];
    let mut torque_n_m = wanted_n_m.clamp(-most_n_m, most_n_m);
    if let Some(last) = last {
        let step = settings.gate.torque_step_nm;
        torque_n_m = torque_n_m.clamp(last - step, last + step);
    }
    let mut motor = MotorCommand { torque_n_m: torque_n_m - feedback, ..clamped };
    let damped = clamped.kp_joint == 0.0 && clamped.velocity_rad_s == 0.0;
    if motor.torque_n_m.abs() > settings.max_torque[joint] {
        // tau_motor = tau - kd dq, |tau| at most the limit.
        let most_kd = (settings.max_torque[joint] - torque_n_m * dq.signum()) / dq.abs();
        let kd_joint = (most_kd / MOTOR_DAMPING_STEP).floor() * MOTOR_DAMPING_STEP;
        motor = if damped && kd_joint > 0.0 {
            MotorCommand { torque_n_m: torque_n_m + kd_joint * dq, kd_joint, ..MotorCommand::default() }
        } else {
            MotorCommand { torque_n_m, ..MotorCommand::default() }
        };
    }
    // Rounding of the subtraction does not count as a change, nor does damping that moved to the feed-forward torque.
    let moved = if damped {
        (torque_n_m - wanted_n_m).abs() > 1e-9 || clamped.kd_joint != wanted.kd_joint
    } else {
        (motor.torque_n_m - wanted.torque_n_m).abs() > 1e-9 || motor.kd_joint != wanted.kd_joint
    };
    let changed = moved
        || motor.kp_joint != wanted.kp_joint
        || (motor.kp_joint > 0.0 && motor.position_rad != wanted.position_rad);
    if !changed && motor.kd_joint == wanted.kd_joint {
        motor.torque_n_m = wanted.torque_n_m;
    }
    Ok(LimitedMotor { motor, torque_n_m, changed })
}

/// Checks that every measured number is finite.
///
/// # Errors
/// The first quantity that is not.
pub fn finite(state: &RobotState) -> Result<(), Fault> {
    joints_finite(state).and_then(|()| body_finite(state))
}

fn all_finite(values: &[f64], what: &'static str) -> Result<(), Fault> {
    if values.iter().all(|value| value.is_finite()) { Ok(()) } else { Err(Fault::NotFinite { what }) }
}

/// Checks that every measured angle and velocity of a joint is finite.
///
/// # Errors
/// The first quantity that is not.
pub fn joints_finite(state: &RobotState) -> Result<(), Fault> {
    all_finite(&state.joint_position_rad, "a joint angle")?;
    all_finite(&state.joint_velocity_rad_s, "a joint velocity")
}

/// Checks that every number of the inertial unit and the foot sensors is finite.
///
/// # Errors
/// The first quantity that is not.
pub fn body_finite(state: &RobotState) -> Result<(), Fault> {
    let all = all_finite;
    all(state.imu.world_from_body.coords.as_slice(), "the orientation")?;
    all(state.imu.gyro_body.as_slice(), "the angular velocity")?;
    all(state.imu.accel_body.as_slice(), "the acceleration")?;
    all(&state.foot_force_n, "a foot's force")
}
