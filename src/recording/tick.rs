//! A tick as messages, and back, with numbers of single precision.

use std::mem::take;

use foxglove::messages::{JointState, JointStates, Timestamp};
use nalgebra::{UnitQuaternion, Vector3};

use super::frog;
use super::wire::{DecodeError, Way, encoded, to_single_precision};
use crate::robot::description::RobotDescription;
use crate::robot::{Battery, JOINTS, Joints, LEGS, MotorCommand, PerLeg, RobotState, Truth, joint_name};
use crate::telemetry::Tick;

const JOINT_VALUES: &str = "joint values";

/// Converts log time (UTC, ns) to protobuf's seconds and nanoseconds; saturates in the year 2106.
pub fn timestamp(log_time: u64) -> Timestamp {
    let (seconds, nanoseconds) = (log_time / 1_000_000_000, log_time % 1_000_000_000);
    Timestamp::new(u32::try_from(seconds).unwrap_or(u32::MAX), nanoseconds as u32)
}

/// Returns a message for [`joint_states`] to fill, with the URDF's joint names; of an unknown robot `FR_hip_joint` and so on.
pub fn named_joints(robot: Option<&RobotDescription>) -> JointStates {
    let name =
        |index| robot.map_or_else(|| format!("{}_joint", joint_name(index)), |robot| robot.joint_names[index].clone());
    let joint = |index| JointState { name: name(index), ..JointState::default() };
    JointStates { timestamp: None, joints: (0..JOINTS).map(joint).collect() }
}

/// Fills a message of [`named_joints`] with the measured joint states.
pub fn joint_states(state: &RobotState, log_time: u64, message: &mut JointStates) {
    message.timestamp = Some(timestamp(log_time));
    for (index, joint) in message.joints.iter_mut().enumerate() {
        joint.position = Some(to_single_precision(state.joint_position_rad[index]));
        joint.velocity = Some(to_single_precision(state.joint_velocity_rad_s[index]));
        joint.effort = Some(to_single_precision(state.joint_torque_n_m[index]));
    }
}

/// Returns a tick as two messages: what is commanded beside the torques, which rarely changes, and everything else.
pub fn split(tick: &Tick) -> (frog::JointCommand, frog::ControlTick) {
    let frog::fault_ticks::Whole { tick, command, position, velocity, torque } = whole(tick);
    let (mut command, control) = (command.unwrap_or_default(), tick.unwrap_or_default());
    let torque_command = take(&mut command.torque);
    let torque_demanded =
        Some(take(&mut command.torque_demanded)).filter(|demanded| !same_bits(demanded, &torque_command));
    let control = frog::ControlTick {
        joint_position: position,
        joint_velocity: velocity,
        joint_torque: torque,
        torque_command,
        torque_demanded: torque_demanded.unwrap_or_default(),
        limited: take(&mut command.limited),
        ..control
    };
    (command, control)
}

/// The inverse of [`split`]. Of `command` the parts that rarely change are read and the torques are overwritten; `control` is as
/// before.
pub fn join(command: &mut frog::JointCommand, control: &mut frog::ControlTick) -> Result<Tick, DecodeError> {
    let torque = &control.torque_command;
    let demanded = if control.torque_demanded.is_empty() { torque } else { &control.torque_demanded };
    command.torque.clone_from(torque);
    command.torque_demanded.clone_from(demanded);
    command.limited = control.limited;
    let mut measured = [&mut control.joint_position, &mut control.joint_velocity, &mut control.joint_torque].map(take);
    let tick = joined(control, command, &mut measured);
    // Their memory serves the next tick.
    [control.joint_position, control.joint_velocity, control.joint_torque] = measured;
    tick
}

/// Whether the joints of a tick are in its message, as [`split`] writes it.
pub fn has_joints(control: &frog::ControlTick) -> bool {
    !control.joint_position.is_empty()
}

/// Whether two lists are the same bit for bit: 0.0 is not -0.0 here, and a NaN is like itself.
fn same_bits(one: &[f64], other: &[f64]) -> bool {
    one.iter().map(|number| number.to_bits()).eq(other.iter().map(|number| number.to_bits()))
}

fn joint_command_fields(way: Way, tick: &mut Tick, m: &mut frog::JointCommand) -> Result<(), DecodeError> {
    type Field = fn(&mut MotorCommand) -> &mut f64;
    let fields: [(Field, &mut Vec<f64>); 5] = [
        (|motor| &mut motor.position_rad, &mut m.position),
        (|motor| &mut motor.velocity_rad_s, &mut m.velocity),
        (|motor| &mut motor.kp_joint, &mut m.kp),
        (|motor| &mut motor.kd_joint, &mut m.kd),
        (|motor| &mut motor.torque_n_m, &mut m.torque),
    ];
    for (field, theirs) in fields {
        let mut ours: Joints = tick.command.motor.map(|mut motor| *field(&mut motor));
        way.array(&mut ours, theirs, JOINT_VALUES)?;
        for (motor, value) in tick.command.motor.iter_mut().zip(ours) {
            *field(motor) = value;
        }
    }
    way.array(&mut tick.torque_demanded, &mut m.torque_demanded, JOINT_VALUES)?;
    match way {
        Way::Encode => m.limited = tick.limited.into(),
        Way::Decode => {
            let unknown = |_| DecodeError::Unknown("limited", m.limited as i32);
            tick.limited = u16::try_from(m.limited).map_err(unknown)?;
        }
    }
    Ok(())
}

fn control_tick_fields(way: Way, tick: &mut Tick, m: &mut frog::ControlTick) -> Result<(), DecodeError> {
    way.copy(&mut tick.number, &mut m.number);
    way.copy(&mut tick.time_ns, &mut m.time_ns);
    way.variant(&mut tick.mode, &mut m.mode, "mode")?;
    way.variant(&mut tick.phase, &mut m.phase, "phase")?;
    way.copy(&mut tick.trial, &mut m.trial);
    // A multiple of the period: exact.
    way.number(&mut tick.trial_time_s, &mut m.trial_time);
    way.single(&mut tick.theta_rad, &mut m.theta);

    let estimate = &mut tick.estimate;
    vector(way, &mut estimate.roll_pitch_yaw, [&mut m.roll, &mut m.pitch, &mut m.yaw]);
    vector(way, &mut estimate.position_world, [&mut m.position_x, &mut m.position_y, &mut m.position_z]);
    vector(way, &mut estimate.velocity_world, [&mut m.velocity_x, &mut m.velocity_y, &mut m.velocity_z]);
    let orientation = [&mut m.orientation_x, &mut m.orientation_y, &mut m.orientation_z, &mut m.orientation_w];
    rotation(way, &mut estimate.world_from_body, orientation);
    let angular_velocity = [&mut m.angular_velocity_x, &mut m.angular_velocity_y, &mut m.angular_velocity_z];
    vector(way, &mut estimate.angular_velocity_body, angular_velocity);
    let contact = [&mut m.contact_fr, &mut m.contact_fl, &mut m.contact_rr, &mut m.contact_rl];
    contacts(way, &mut estimate.contact, contact);
    let [fr, fl, rr, rl] = &mut estimate.foot_position_leg;
    vector(way, fr, [&mut m.foot_x_fr, &mut m.foot_y_fr, &mut m.foot_z_fr]);
    vector(way, fl, [&mut m.foot_x_fl, &mut m.foot_y_fl, &mut m.foot_z_fl]);
    vector(way, rr, [&mut m.foot_x_rr, &mut m.foot_y_rr, &mut m.foot_z_rr]);
    vector(way, rl, [&mut m.foot_x_rl, &mut m.foot_y_rl, &mut m.foot_z_rl]);

    let state = &mut tick.state;
    way.copy(&mut state.robot_time_ms, &mut m.robot_time_ms);
    rotation(way, &mut state.imu.world_from_body, [&mut m.imu_x, &mut m.imu_y, &mut m.imu_z, &mut m.imu_w]);
    vector(way, &mut state.imu.gyro_body, [&mut m.gyro_x, &mut m.gyro_y, &mut m.gyro_z]);
    vector(way, &mut state.imu.accel_body, [&mut m.acc_x, &mut m.acc_y, &mut m.acc_z]);
    let force = [&mut m.force_fr, &mut m.force_fl, &mut m.force_rr, &mut m.force_rl];
    way.singles(state.foot_force_n.each_mut(), force);
    way.array(&mut state.motor_temperature_c, &mut m.motor_temperature, JOINT_VALUES)?;
    let mut enabled = (0..JOINTS).map(|motor| u32::from(state.motor_enabled[motor]) << motor).sum();
    way.copy(&mut enabled, &mut m.motor_enabled);
    state.motor_enabled = std::array::from_fn(|motor| enabled & (1 << motor) != 0);
    way.option(&mut state.battery, &mut m.battery, battery)?;
    way.option(&mut state.truth, &mut m.truth, truth)?;

    way.copy(&mut tick.stages.lateness_ns, &mut m.lateness_ns);
    way.copy(&mut tick.stages.read_ns, &mut m.read_ns);
    way.copy(&mut tick.stages.decide_ns, &mut m.decide_ns);
    way.copy(&mut tick.stages.write_ns, &mut m.write_ns);
    Ok(())
}

fn battery(way: Way, ours: &mut Battery, m: &mut frog::Battery) -> Result<(), DecodeError> {
    way.single(&mut ours.charge_percent, &mut m.charge);
    way.single(&mut ours.voltage_v, &mut m.voltage);
    way.single(&mut ours.current_a, &mut m.current);
    way.array(&mut ours.cell_v, &mut m.cell, "cells")
}

fn truth(way: Way, ours: &mut Truth, m: &mut frog::Truth) -> Result<(), DecodeError> {
    vector(way, &mut ours.position_world, [&mut m.position_x, &mut m.position_y, &mut m.position_z]);
    vector(way, &mut ours.velocity_world, [&mut m.velocity_x, &mut m.velocity_y, &mut m.velocity_z]);
    let orientation = [&mut m.orientation_x, &mut m.orientation_y, &mut m.orientation_z, &mut m.orientation_w];
    rotation(way, &mut ours.world_from_body, orientation);
    let angular_velocity = [&mut m.angular_velocity_x, &mut m.angular_velocity_y, &mut m.angular_velocity_z];
    vector(way, &mut ours.angular_velocity_body, angular_velocity);
    let contact = [&mut m.contact_fr, &mut m.contact_fl, &mut m.contact_rr, &mut m.contact_rl];
    contacts(way, &mut ours.foot_contact, contact);
    let [fr, fl, rr, rl] = &mut ours.foot_force_world;
    vector(way, fr, [&mut m.force_x_fr, &mut m.force_y_fr, &mut m.force_z_fr]);
    vector(way, fl, [&mut m.force_x_fl, &mut m.force_y_fl, &mut m.force_z_fl]);
    vector(way, rr, [&mut m.force_x_rr, &mut m.force_y_rr, &mut m.force_z_rr]);
    vector(way, rl, [&mut m.force_x_rl, &mut m.force_y_rl, &mut m.force_z_rl]);
    way.copy(&mut ours.body_contact, &mut m.body_contact);
    Ok(())
}

/// Returns a tick from the three messages of an older recording.
pub fn join_three(
    control: &mut frog::ControlTick,
    joints: &JointStates,
    mut command: frog::JointCommand,
) -> Result<Tick, DecodeError> {
    let each = |value: fn(&JointState) -> Option<f64>| {
        joints.joints.iter().map(|joint| value(joint).unwrap_or_default()).collect::<Vec<_>>()
    };
    let mut measured = [each(|joint| joint.position), each(|joint| joint.velocity), each(|joint| joint.effort)];
    joined(control, &mut command, &mut measured)
}

/// A whole tick of a fault, in one message.
pub fn whole(tick: &Tick) -> frog::fault_ticks::Whole {
    frog::fault_ticks::Whole {
        tick: Some(encoded(control_tick_fields, tick)),
        command: Some(encoded(joint_command_fields, tick)),
        position: tick.state.joint_position_rad.map(to_single_precision).to_vec(),
        velocity: tick.state.joint_velocity_rad_s.map(to_single_precision).to_vec(),
        torque: tick.state.joint_torque_n_m.map(to_single_precision).to_vec(),
    }
}

/// The inverse of [`whole`].
pub fn from_whole(message: frog::fault_ticks::Whole) -> Result<Tick, DecodeError> {
    let mut control = message.tick.ok_or(DecodeError::Missing("a fault's tick"))?;
    let mut command = message.command.ok_or(DecodeError::Missing("a fault's joint command"))?;
    joined(&mut control, &mut command, &mut [message.position, message.velocity, message.torque])
}

fn joined(
    control: &mut frog::ControlTick,
    command: &mut frog::JointCommand,
    [position, velocity, torque]: &mut [Vec<f64>; 3],
) -> Result<Tick, DecodeError> {
    let mut tick = Tick::default();
    control_tick_fields(Way::Decode, &mut tick, control)?;
    joint_command_fields(Way::Decode, &mut tick, command)?;
    Way::Decode.array(&mut tick.state.joint_position_rad, position, JOINT_VALUES)?;
    Way::Decode.array(&mut tick.state.joint_velocity_rad_s, velocity, JOINT_VALUES)?;
    Way::Decode.array(&mut tick.state.joint_torque_n_m, torque, JOINT_VALUES)?;
    Ok(tick)
}

fn contacts(way: Way, ours: &mut PerLeg<bool>, theirs: [&mut bool; LEGS]) {
    for (ours, theirs) in ours.iter_mut().zip(theirs) {
        way.copy(ours, theirs);
    }
}

fn vector(way: Way, ours: &mut Vector3<f64>, theirs: [&mut Option<f64>; 3]) {
    way.singles(ours.data.0[0].each_mut(), theirs);
}

/// x, y, z, w. Not normalized: that would change the last bits.
fn rotation(way: Way, ours: &mut UnitQuaternion<f64>, theirs: [&mut Option<f64>; 4]) {
    way.singles(ours.as_mut_unchecked().coords.data.0[0].each_mut(), theirs);
}
