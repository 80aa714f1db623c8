//! A tick as the messages of its three topics, and back, bit for bit.

use foxglove::messages::{JointState, JointStates, Timestamp};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::decode::{DecodeError, number, one_of};
use super::frog;
use crate::robot::{
    Battery, Imu, JOINTS, JointCommand, Joints, LEGS, MotorCommand, PerLeg, RobotState, Truth, joint_name,
};
use crate::telemetry::{Estimate, Mode, Phase, StageTimes, Tick};

/// Converts log time (UTC, ns) to protobuf's seconds and nanoseconds; saturates in the year 2106.
pub fn timestamp(log_time: u64) -> Timestamp {
    let (seconds, nanoseconds) = (log_time / 1_000_000_000, log_time % 1_000_000_000);
    Timestamp::new(u32::try_from(seconds).unwrap_or(u32::MAX), nanoseconds as u32)
}

/// Returns a message for [`joint_states`] to fill, with the URDF's joint names.
pub fn named_joints() -> JointStates {
    let joint = |index| JointState { name: joint_name(index), ..JointState::default() };
    JointStates { timestamp: None, joints: (0..JOINTS).map(joint).collect() }
}

/// Fills a message of [`named_joints`] with the measured joint states.
pub fn joint_states(state: &RobotState, log_time: u64, message: &mut JointStates) {
    message.timestamp = Some(timestamp(log_time));
    for (index, joint) in message.joints.iter_mut().enumerate() {
        joint.position = Some(state.joint_position[index]);
        joint.velocity = Some(state.joint_velocity[index]);
        joint.effort = Some(state.joint_torque[index]);
    }
}

/// Returns the joint command as sent, with the torque before the limits.
pub fn joint_command(tick: &Tick) -> frog::JointCommand {
    let each = |value: fn(&MotorCommand) -> f64| tick.command.motor.iter().map(value).collect();
    frog::JointCommand {
        position: each(|motor| motor.position),
        velocity: each(|motor| motor.velocity),
        kp: each(|motor| motor.kp),
        kd: each(|motor| motor.kd),
        torque: each(|motor| motor.torque),
        torque_demanded: tick.torque_demanded.to_vec(),
        limited: tick.limited.into(),
    }
}

/// Returns everything else of a tick.
pub fn control_tick(tick: &Tick) -> frog::ControlTick {
    let Tick { state, estimate, stages, .. } = tick;
    let orientation = estimate.orientation_world.coords;
    let imu = state.imu.orientation_world.coords;
    let [fr, fl, rr, rl] = estimate.foot_position_leg;
    frog::ControlTick {
        number: tick.number,
        time_ns: tick.time_ns,
        mode: tick.mode as i32,
        phase: tick.phase as i32,
        trial: tick.trial,
        trial_time: Some(tick.trial_time_s),
        theta: Some(tick.theta_rad),
        roll: Some(estimate.roll_pitch_yaw.x),
        pitch: Some(estimate.roll_pitch_yaw.y),
        yaw: Some(estimate.roll_pitch_yaw.z),
        position_x: Some(estimate.position_world.x),
        position_y: Some(estimate.position_world.y),
        position_z: Some(estimate.position_world.z),
        velocity_x: Some(estimate.velocity_world.x),
        velocity_y: Some(estimate.velocity_world.y),
        velocity_z: Some(estimate.velocity_world.z),
        orientation_x: Some(orientation.x),
        orientation_y: Some(orientation.y),
        orientation_z: Some(orientation.z),
        orientation_w: Some(orientation.w),
        angular_velocity_x: Some(estimate.angular_velocity_body.x),
        angular_velocity_y: Some(estimate.angular_velocity_body.y),
        angular_velocity_z: Some(estimate.angular_velocity_body.z),
        contact_fr: estimate.contact[0],
        contact_fl: estimate.contact[1],
        contact_rr: estimate.contact[2],
        contact_rl: estimate.contact[3],
        foot_x_fr: Some(fr.x),
        foot_y_fr: Some(fr.y),
        foot_z_fr: Some(fr.z),
        foot_x_fl: Some(fl.x),
        foot_y_fl: Some(fl.y),
        foot_z_fl: Some(fl.z),
        foot_x_rr: Some(rr.x),
        foot_y_rr: Some(rr.y),
        foot_z_rr: Some(rr.z),
        foot_x_rl: Some(rl.x),
        foot_y_rl: Some(rl.y),
        foot_z_rl: Some(rl.z),
        robot_time_ms: state.robot_time_ms,
        imu_x: Some(imu.x),
        imu_y: Some(imu.y),
        imu_z: Some(imu.z),
        imu_w: Some(imu.w),
        gyro_x: Some(state.imu.gyro_body.x),
        gyro_y: Some(state.imu.gyro_body.y),
        gyro_z: Some(state.imu.gyro_body.z),
        acc_x: Some(state.imu.accel_body.x),
        acc_y: Some(state.imu.accel_body.y),
        acc_z: Some(state.imu.accel_body.z),
        force_fr: Some(state.foot_force[0]),
        force_fl: Some(state.foot_force[1]),
        force_rr: Some(state.foot_force[2]),
        force_rl: Some(state.foot_force[3]),
        motor_temperature: state.motor_temperature_c.to_vec(),
        motor_enabled: (0..JOINTS).map(|motor| u32::from(state.motor_enabled[motor]) << motor).sum(),
        battery: state.battery.as_ref().map(battery),
        truth: state.truth.as_ref().map(truth),
        lateness_ns: stages.lateness_ns,
        read_ns: stages.read_ns,
        decide_ns: stages.decide_ns,
        write_ns: stages.write_ns,
    }
}

fn battery(battery: &Battery) -> frog::Battery {
    frog::Battery {
        charge: Some(battery.charge_percent),
        voltage: Some(battery.voltage_v),
        current: Some(battery.current_a),
        cell: battery.cell_v.to_vec(),
    }
}

fn truth(truth: &Truth) -> frog::Truth {
    let orientation = truth.orientation_world.coords;
    let [fr, fl, rr, rl] = truth.foot_force_world;
    frog::Truth {
        position_x: Some(truth.position_world.x),
        position_y: Some(truth.position_world.y),
        position_z: Some(truth.position_world.z),
        velocity_x: Some(truth.velocity_world.x),
        velocity_y: Some(truth.velocity_world.y),
        velocity_z: Some(truth.velocity_world.z),
        orientation_x: Some(orientation.x),
        orientation_y: Some(orientation.y),
        orientation_z: Some(orientation.z),
        orientation_w: Some(orientation.w),
        angular_velocity_x: Some(truth.angular_velocity_body.x),
        angular_velocity_y: Some(truth.angular_velocity_body.y),
        angular_velocity_z: Some(truth.angular_velocity_body.z),
        contact_fr: truth.foot_contact[0],
        contact_fl: truth.foot_contact[1],
        contact_rr: truth.foot_contact[2],
        contact_rl: truth.foot_contact[3],
        force_x_fr: Some(fr.x),
        force_y_fr: Some(fr.y),
        force_z_fr: Some(fr.z),
        force_x_fl: Some(fl.x),
        force_y_fl: Some(fl.y),
        force_z_fl: Some(fl.z),
        force_x_rr: Some(rr.x),
        force_y_rr: Some(rr.y),
        force_z_rr: Some(rr.z),
        force_x_rl: Some(rl.x),
        force_y_rl: Some(rl.y),
        force_z_rl: Some(rl.z),
        body_contact: truth.body_contact,
    }
}

/// A tick from its three messages.
pub fn join(
    control: &frog::ControlTick,
    joints: &JointStates,
    command: &frog::JointCommand,
) -> Result<Tick, DecodeError> {
    let each = |value: fn(&JointState) -> Option<f64>| {
        joints.joints.iter().map(|joint| value(joint).unwrap_or_default()).collect::<Vec<_>>()
    };
    let position = each(|joint| joint.position);
    let velocity = each(|joint| joint.velocity);
    let torque = each(|joint| joint.effort);
    tick(control, command, [&position, &velocity, &torque])
}

/// A whole tick of a fault, in one message.
pub fn whole(tick: &Tick) -> frog::fault_ticks::Whole {
    frog::fault_ticks::Whole {
        tick: Some(control_tick(tick)),
        command: Some(joint_command(tick)),
        position: tick.state.joint_position.to_vec(),
        velocity: tick.state.joint_velocity.to_vec(),
        torque: tick.state.joint_torque.to_vec(),
    }
}

/// The inverse of [`whole`].
pub fn from_whole(message: &frog::fault_ticks::Whole) -> Result<Tick, DecodeError> {
    let control = message.tick.as_ref().ok_or(DecodeError::Missing("a fault's tick"))?;
    let command = message.command.as_ref().ok_or(DecodeError::Missing("a fault's joint command"))?;
    tick(control, command, [&message.position, &message.velocity, &message.torque])
}

fn tick(
    control: &frog::ControlTick,
    command: &frog::JointCommand,
    [position, velocity, torque]: [&[f64]; 3],
) -> Result<Tick, DecodeError> {
    let c = control;
    Ok(Tick {
        number: c.number,
        time_ns: c.time_ns,
        mode: one_of(&Mode::ALL, "mode", c.mode)?,
        phase: one_of(&Phase::ALL, "phase", c.phase)?,
        trial: c.trial,
        trial_time_s: number(c.trial_time),
        theta_rad: number(c.theta),
        state: RobotState {
            robot_time_ms: c.robot_time_ms,
            joint_position: twelve(position)?,
            joint_velocity: twelve(velocity)?,
            joint_torque: twelve(torque)?,
            imu: Imu {
                orientation_world: rotation(c.imu_x, c.imu_y, c.imu_z, c.imu_w),
                gyro_body: vector(c.gyro_x, c.gyro_y, c.gyro_z),
                accel_body: vector(c.acc_x, c.acc_y, c.acc_z),
            },
            foot_force: [c.force_fr, c.force_fl, c.force_rr, c.force_rl].map(number),
            motor_temperature_c: twelve(&c.motor_temperature)?,
            motor_enabled: std::array::from_fn(|motor| c.motor_enabled & (1 << motor) != 0),
            battery: c.battery.as_ref().map(from_battery).transpose()?,
            truth: c.truth.as_ref().map(from_truth),
        },
        estimate: Estimate {
            position_world: vector(c.position_x, c.position_y, c.position_z),
            velocity_world: vector(c.velocity_x, c.velocity_y, c.velocity_z),
            orientation_world: rotation(c.orientation_x, c.orientation_y, c.orientation_z, c.orientation_w),
            angular_velocity_body: vector(c.angular_velocity_x, c.angular_velocity_y, c.angular_velocity_z),
            roll_pitch_yaw: vector(c.roll, c.pitch, c.yaw),
            contact: [c.contact_fr, c.contact_fl, c.contact_rr, c.contact_rl],
            foot_position_leg: [
                vector(c.foot_x_fr, c.foot_y_fr, c.foot_z_fr),
                vector(c.foot_x_fl, c.foot_y_fl, c.foot_z_fl),
                vector(c.foot_x_rr, c.foot_y_rr, c.foot_z_rr),
                vector(c.foot_x_rl, c.foot_y_rl, c.foot_z_rl),
            ],
        },
        torque_demanded: twelve(&command.torque_demanded)?,
        command: from_joint_command(command)?,
        limited: u16::try_from(command.limited).map_err(|_| DecodeError::Unknown("limited", command.limited as i32))?,
        stages: StageTimes {
            lateness_ns: c.lateness_ns,
            read_ns: c.read_ns,
            decide_ns: c.decide_ns,
            write_ns: c.write_ns,
        },
    })
}

fn from_joint_command(message: &frog::JointCommand) -> Result<JointCommand, DecodeError> {
    let [position, velocity] = [twelve(&message.position)?, twelve(&message.velocity)?];
    let [kp, kd, torque] = [twelve(&message.kp)?, twelve(&message.kd)?, twelve(&message.torque)?];
    let motor = |i: usize| MotorCommand {
        position: position[i],
        velocity: velocity[i],
        kp: kp[i],
        kd: kd[i],
        torque: torque[i],
    };
    Ok(JointCommand { motor: std::array::from_fn(motor) })
}

fn from_battery(battery: &frog::Battery) -> Result<Battery, DecodeError> {
    Ok(Battery {
        charge_percent: number(battery.charge),
        voltage_v: number(battery.voltage),
        current_a: number(battery.current),
        cell_v: battery.cell.as_slice().try_into().map_err(|_| DecodeError::Length("cells", battery.cell.len()))?,
    })
}

fn from_truth(t: &frog::Truth) -> Truth {
    let foot_force_world: PerLeg<Vector3<f64>> = [
        vector(t.force_x_fr, t.force_y_fr, t.force_z_fr),
        vector(t.force_x_fl, t.force_y_fl, t.force_z_fl),
        vector(t.force_x_rr, t.force_y_rr, t.force_z_rr),
        vector(t.force_x_rl, t.force_y_rl, t.force_z_rl),
    ];
    let foot_contact: [bool; LEGS] = [t.contact_fr, t.contact_fl, t.contact_rr, t.contact_rl];
    Truth {
        position_world: vector(t.position_x, t.position_y, t.position_z),
        velocity_world: vector(t.velocity_x, t.velocity_y, t.velocity_z),
        orientation_world: rotation(t.orientation_x, t.orientation_y, t.orientation_z, t.orientation_w),
        angular_velocity_body: vector(t.angular_velocity_x, t.angular_velocity_y, t.angular_velocity_z),
        foot_contact,
        foot_force_world,
        body_contact: t.body_contact,
    }
}

fn vector(x: Option<f64>, y: Option<f64>, z: Option<f64>) -> Vector3<f64> {
    Vector3::new(number(x), number(y), number(z))
}

/// Not normalized: that would change the last bits.
fn rotation(x: Option<f64>, y: Option<f64>, z: Option<f64>, w: Option<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(number(w), number(x), number(y), number(z)))
}

fn twelve(values: &[f64]) -> Result<Joints, DecodeError> {
    values.try_into().map_err(|_| DecodeError::Length("joint values", values.len()))
}
