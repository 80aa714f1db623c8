//! Compares messages of the Go2 with payloads of Unitree's Python types and checksums of Unitree's library
//! (`golden/wire_go2`): commands, states that are accepted and rejected, requests and responses. `QUADFROG_GOLDEN` names
//! another folder of golden data.

mod support;

use proptest::prelude::*;
use quadfrog::robot::go2::convert::{low_command, low_state, motor_command, robot_state};
use quadfrog::robot::go2::message::{
    COMMAND_LENGTH, CommandMessage, ENCAPSULATION, EncodeError, MODE_SERVO, MOTORS, MessageHead, MessageRejection,
    MotorReport, POSITION_STOP, RequestMessage, ResponseMessage, STATE_LENGTH, ServoTarget, StateMessage,
    VELOCITY_STOP, motion_switcher, payload, sport,
};
use quadfrog::robot::remote::RemoteButtons;
use quadfrog::robot::{Battery, JointCommand, RobotState};
use serde::Deserialize;
use serde_json::Value;
use support::bytes;

/// Reads `wire_go2/<name>` in the golden folder, or `<name>` if the folder itself holds the payloads.
fn cases<T: serde::de::DeserializeOwned>(name: &str) -> Vec<T> {
    support::golden_cases("wire_go2", name)
}

#[derive(Deserialize)]
struct CommandFields {
    head: [u8; 2],
    level_flag: u8,
    frame_reserve: u8,
    sn: [u32; 2],
    version: [u32; 2],
    bandwidth: u16,
    motor_cmd: Vec<[u32; 9]>,
    bms_cmd: [u8; 4],
    wireless_remote: String,
    led: String,
    fan: [u8; 2],
    gpio: u8,
    reserve: u32,
}

impl CommandFields {
    fn message(&self) -> CommandMessage {
        let target = |&[mode, q, dq, tau, kp, kd, reserve @ ..]: &[u32; 9]| ServoTarget {
            mode: mode as u8,
            position: f32::from_bits(q),
            velocity: f32::from_bits(dq),
            torque: f32::from_bits(tau),
            kp: f32::from_bits(kp),
            kd: f32::from_bits(kd),
            reserve,
        };
        let motor: Vec<ServoTarget> = self.motor_cmd.iter().map(target).collect();
        CommandMessage {
            head: MessageHead {
                head: self.head,
                level: self.level_flag,
                frame_reserve: self.frame_reserve,
                serial: self.sn,
                version: self.version,
                bandwidth: self.bandwidth,
            },
            motor: motor.try_into().unwrap(),
            battery: self.bms_cmd,
            remote: bytes(&self.wireless_remote).try_into().unwrap(),
            led: bytes(&self.led).try_into().unwrap(),
            fan: self.fan,
            gpio: self.gpio,
            reserve: self.reserve,
        }
    }
}

#[derive(Deserialize)]
struct CommandCase {
    name: String,
    finite: bool,
    fields: CommandFields,
    crc: u32,
    cdr: String,
}

/// The numbers of a target as bits: NaN differs from itself.
fn bits(target: &ServoTarget) -> [u32; 9] {
    let [a, b, c] = target.reserve;
    let floats = [target.position, target.velocity, target.torque, target.kp, target.kd].map(f32::to_bits);
    [target.mode.into(), floats[0], floats[1], floats[2], floats[3], floats[4], a, b, c]
}

/// Removes what the encoder refuses, and returns the refusals.
fn made_safe(message: &mut CommandMessage, case: &str) -> Vec<EncodeError> {
    let mut refusals = Vec::new();
    while let Err(refusal) = message.encode() {
        assert!(refusals.len() < 200, "{case}: {refusal} again");
        match refusal {
            EncodeError::NotFinite { quantity, motor, value } => {
                assert!(!value.is_finite(), "{case}: {refusal}");
                let target = &mut message.motor[motor];
                *match quantity {
                    "position" => &mut target.position,
                    "velocity" => &mut target.velocity,
                    "torque" => &mut target.torque,
                    "kp" => &mut target.kp,
                    "kd" => &mut target.kd,
                    other => panic!("{case}: a {other}"),
                } = 0.0;
            }
            EncodeError::NegativeGain { quantity, motor, value, .. } => {
                assert!(value < 0.0, "{case}: {refusal}");
                let target = &mut message.motor[motor];
                *if quantity == "kp" { &mut target.kp } else { &mut target.kd } = 0.0;
            }
            EncodeError::StiffnessWithoutPosition { motor, kp } => {
                assert!(kp > 0.0 && message.motor[motor].position.abs() >= POSITION_STOP, "{case}: {refusal}");
                message.motor[motor].kp = 0.0;
            }
            EncodeError::DampingWithoutVelocity { motor, kd } => {
                assert!(kd > 0.0 && message.motor[motor].velocity.abs() >= VELOCITY_STOP, "{case}: {refusal}");
                message.motor[motor].kd = 0.0;
            }
            EncodeError::Battery { bytes } => {
                assert_ne!(bytes, [0; 4], "{case}: {refusal}");
                message.battery = [0; 4];
            }
        }
        refusals.push(refusal);
    }
    refusals
}

/// Bytes of a payload in which the words differ that [`made_safe`] has changed.
fn changed(before: &CommandMessage, after: &CommandMessage) -> Vec<usize> {
    let mut places = Vec::new();
    for (motor, (before, after)) in before.motor.iter().zip(&after.motor).enumerate() {
        let words = bits(before).into_iter().zip(bits(after)).skip(1).enumerate();
        for (word, _) in words.filter(|(_, (before, after))| before != after) {
            places.extend(24 + 36 * motor + 4 * word..28 + 36 * motor + 4 * word);
        }
    }
    if before.battery != after.battery {
        places.extend(740..744);
    }
    if !places.is_empty() {
        places.extend(804..808);
    }
    places
}

#[test]
fn every_command_is_unitrees_byte_for_byte_or_refused() {
    let (mut same, mut refused) = (0, 0);
    for case in cases::<CommandCase>("lowcmd.json") {
        let name = &case.name;
        let serialized = bytes(&case.cdr);
        assert_eq!(serialized[..4], ENCAPSULATION, "{name}");
        let theirs = payload(&serialized).unwrap();
        let message = case.fields.message();

        let decoded = CommandMessage::decode(theirs).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(decoded.motor.map(|target| bits(&target)), message.motor.map(|target| bits(&target)), "{name}");
        // The motors are compared; the rest without their NaN.
        let rest = |message: &CommandMessage| CommandMessage { motor: [ServoTarget::NONE; MOTORS], ..*message };
        assert_eq!(rest(&decoded), rest(&message), "{name}");

        let mut safe = message;
        let refusals = made_safe(&mut safe, name);
        let not_finite = refusals.iter().any(|refusal| matches!(refusal, EncodeError::NotFinite { .. }));
        assert_eq!(not_finite, !case.finite, "{name}");
        let ours = safe.encode().unwrap();
        let places = changed(&message, &safe);
        for (place, (ours, theirs)) in ours.bytes().iter().zip(theirs).enumerate() {
            assert!(ours == theirs || places.contains(&place), "{name}: byte {place} is {ours}, theirs {theirs}");
        }
        if refusals.is_empty() {
            assert_eq!(ours.bytes()[804..], case.crc.to_le_bytes(), "{name}");
            assert_eq!(ours.bytes(), theirs, "{name}");
            same += 1;
        } else {
            refused += 1;
        }
    }
    println!("{same} commands are Unitree's byte for byte, {refused} are refused and equal without what is refused");
    assert!(same > 0 && refused > 0);
}

#[derive(Deserialize)]
struct StateCase {
    name: String,
    kind: String,
    finite: Option<bool>,
    fields: Option<Value>,
    crc_expected: Option<u32>,
    cdr: String,
}

#[test]
fn every_state_is_accepted_or_rejected_as_it_must_be() {
    let (mut accepted, mut wrong_checksum, mut short) = (0, 0, 0);
    for case in cases::<StateCase>("lowstate.json") {
        let name = &case.name;
        let serialized = bytes(&case.cdr);
        let verdict = payload(&serialized).and_then(StateMessage::decode);
        match (case.kind.as_str(), verdict) {
            ("ok", Ok(state)) => {
                compare(&state, case.fields.as_ref().unwrap(), name);
                assert_eq!(state.encode()[..], serialized[4..], "{name}");
                let reported = robot_state(&state, 1.0);
                let finite = reported.joint_position_rad.iter().chain(&reported.joint_velocity_rad_s);
                assert!(case.finite == Some(false) || finite.clone().all(|value| value.is_finite()), "{name}");
                accepted += 1;
            }
            ("crc_bad", Err(MessageRejection::Checksum { found, computed })) => {
                assert_eq!(Some(computed), case.crc_expected, "{name}");
                assert_eq!(found.to_le_bytes(), serialized[serialized.len() - 4..], "{name}");
                // Every field is as it was sent, once the checksum is right.
                let mut repaired = serialized[4..].to_vec();
                repaired[1172..].copy_from_slice(&computed.to_le_bytes());
                compare(&StateMessage::decode(&repaired).unwrap(), case.fields.as_ref().unwrap(), name);
                wrong_checksum += 1;
            }
            ("malformed", Err(MessageRejection::Length { .. })) => short += 1,
            (kind, verdict) => panic!("{name}: {kind}, {verdict:?}"),
        }
    }
    println!(
        "{accepted} states accepted and equal in every field, rejected {wrong_checksum} checksums, {short} lengths"
    );
    assert!(accepted > 0 && wrong_checksum > 0 && short > 0);
}

/// Compares every field of a decoded state; floats by their bits, temperatures by their bytes.
fn compare(ours: &StateMessage, theirs: &Value, case: &str) {
    fn floats(values: &[f32]) -> Vec<i64> {
        values.iter().map(|value| i64::from(value.to_bits())).collect()
    }
    let temperature = |value: i8| i64::from(value as u8);
    let same = |place: &Value, what: &str, ours: Vec<i64>| {
        let number = |value: &Value| value.as_i64().unwrap_or_else(|| panic!("{case}: {what}: {value}"));
        let value = &place[what];
        let theirs = value.as_array().map_or_else(|| vec![number(value)], |all| all.iter().map(number).collect());
        assert_eq!(ours, theirs, "{case}: {what}");
    };

    let head = &ours.head;
    same(theirs, "head", head.head.map(i64::from).to_vec());
    same(theirs, "level_flag", vec![head.level.into()]);
    same(theirs, "frame_reserve", vec![head.frame_reserve.into()]);
    same(theirs, "sn", head.serial.map(i64::from).to_vec());
    same(theirs, "version", head.version.map(i64::from).to_vec());
    same(theirs, "bandwidth", vec![head.bandwidth.into()]);

    let imu = &theirs["imu_state"];
    same(imu, "quaternion", floats(&ours.imu.quaternion));
    same(imu, "gyroscope", floats(&ours.imu.gyroscope));
    same(imu, "accelerometer", floats(&ours.imu.accelerometer));
    same(imu, "rpy", floats(&ours.imu.roll_pitch_yaw));
    same(imu, "temperature", vec![temperature(ours.imu.temperature)]);

    let row = |motor: &MotorReport| -> Vec<i64> {
        let numbers = [motor.position, motor.velocity, motor.acceleration, motor.torque];
        let mut row = vec![motor.mode.into()];
        row.extend(floats(&numbers));
        row.extend(floats(&motor.raw));
        row.extend([temperature(motor.temperature), motor.lost.into()]);
        row.extend(motor.reserve.map(i64::from));
        row
    };
    let motors: Vec<Vec<i64>> = serde_json::from_value(theirs["motor_state"].clone()).unwrap();
    assert_eq!(ours.motor.iter().map(row).collect::<Vec<_>>(), motors, "{case}");

    let (battery, bms) = (&ours.battery, &theirs["bms_state"]);
    same(bms, "version_high", vec![battery.version[0].into()]);
    same(bms, "version_low", vec![battery.version[1].into()]);
    same(bms, "status", vec![battery.status.into()]);
    same(bms, "soc", vec![battery.charge.into()]);
    same(bms, "current", vec![battery.current.into()]);
    same(bms, "cycle", vec![battery.cycles.into()]);
    same(bms, "bq_ntc", battery.cell_temperature.map(temperature).to_vec());
    same(bms, "mcu_ntc", battery.controller_temperature.map(temperature).to_vec());
    same(bms, "cell_vol", battery.cell_mv.map(i64::from).to_vec());

    same(theirs, "foot_force", ours.foot_force.map(i64::from).to_vec());
    same(theirs, "foot_force_est", ours.foot_force_estimated.map(i64::from).to_vec());
    same(theirs, "tick", vec![ours.tick.into()]);
    let remote = bytes(theirs["wireless_remote"].as_str().unwrap());
    assert_eq!(remote, zerocopy::IntoBytes::as_bytes(&ours.remote), "{case}");
    same(theirs, "bit_flag", vec![ours.bit_flag.into()]);
    same(theirs, "adc_reel", floats(&[ours.adc_reel]));
    same(theirs, "temperature_ntc1", vec![temperature(ours.board_temperature[0])]);
    same(theirs, "temperature_ntc2", vec![temperature(ours.board_temperature[1])]);
    same(theirs, "power_v", floats(&[ours.power_v]));
    same(theirs, "power_a", floats(&[ours.power_a]));
    same(theirs, "fan_frequency", ours.fan_frequency.map(i64::from).to_vec());
    same(theirs, "reserve", vec![ours.reserve.into()]);
}

#[derive(Deserialize)]
struct ApiFields {
    id: i64,
    api_id: i64,
    #[serde(default)]
    lease_id: i64,
    #[serde(default)]
    priority: i32,
    #[serde(default)]
    noreply: bool,
    #[serde(default)]
    code: i32,
    #[serde(default)]
    parameter: String,
    #[serde(default)]
    data: String,
    binary: Vec<u8>,
}

#[derive(Deserialize)]
struct ApiCase {
    name: String,
    #[serde(rename = "type")]
    kind: String,
    fields: ApiFields,
    cdr: String,
}

#[test]
fn every_request_and_response_is_unitrees_byte_for_byte() {
    let (mut requests, mut responses) = (0, 0);
    for ApiCase { name, kind, fields, cdr } in cases("api.json") {
        let serialized = bytes(&cdr);
        let theirs = payload(&serialized).unwrap();
        if kind == "Request_" {
            let request = RequestMessage {
                id: fields.id,
                api: fields.api_id,
                lease: fields.lease_id,
                priority: fields.priority,
                no_reply: fields.noreply,
                parameter: fields.parameter,
                binary: fields.binary,
            };
            assert_eq!(request.encode(), theirs, "{name}");
            assert_eq!(RequestMessage::decode(theirs).as_ref(), Ok(&request), "{name}");
            requests += 1;
        } else {
            let ApiFields { id, api_id: api, code, data, binary, .. } = fields;
            let response = ResponseMessage { id, api, code, data, binary };
            assert_eq!(response.encode(), theirs, "{name}");
            assert_eq!(ResponseMessage::decode(theirs).as_ref(), Ok(&response), "{name}");
            responses += 1;
        }
        for length in 0..theirs.len() {
            let cut = &theirs[..length];
            assert!(RequestMessage::decode(cut).is_err() || kind != "Request_", "{name}: {length} bytes");
            assert!(ResponseMessage::decode(cut).is_err() || kind == "Request_", "{name}: {length} bytes");
        }
    }
    println!("{requests} requests and {responses} responses are Unitree's byte for byte");
    assert!(requests > 0 && responses > 0);
}

#[test]
fn requests_are_those_of_the_sdk() {
    let check = motion_switcher::check_mode(5);
    assert_eq!((check.api, check.parameter.as_str()), (1001, "{}"));
    assert_eq!(motion_switcher::select_mode(1, "normal").parameter, "{\"name\": \"normal\"}");
    assert_eq!(motion_switcher::select_mode(1, "a\"b").parameter, "{\"name\": \"a\\\"b\"}");
    assert_eq!(motion_switcher::release_mode(1).api, 1003);
    assert_eq!(sport::request(3, sport::STAND_DOWN).api, 1005);

    let answer = |code, data: &str| {
        let response = ResponseMessage { id: 5, api: 1001, code, data: data.to_owned(), binary: Vec::new() };
        response.active_mode()
    };
    assert_eq!(answer(0, "{\"form\":\"0\",\"name\":\"normal\"}"), Some("normal".to_owned()));
    assert_eq!(answer(0, "{\"form\":\"0\",\"name\":\"\"}"), Some(String::new()));
    for (code, data) in [(7002, "{\"name\":\"\"}"), (0, ""), (0, "{\"name\":5}"), (0, "[]")] {
        assert_eq!(answer(code, data), None, "{code} {data}: no answer may count as released");
    }
}

#[test]
fn what_may_harm_the_robot_is_refused_by_name() {
    let refusal = |change: fn(&mut CommandMessage)| {
        let mut message = CommandMessage::INITIAL;
        change(&mut message);
        message.encode().unwrap_err().to_string()
    };
    assert!(CommandMessage::INITIAL.encode().is_ok());
    let text = refusal(|message| message.motor[7].torque = f32::NAN);
    assert!(text.contains("torque of motor 7 is NaN"), "{text}");
    let text = refusal(|message| message.motor[19].position = f32::INFINITY);
    assert!(text.contains("position of motor 19 is inf"), "{text}");
    let text = refusal(|message| message.motor[2].kd = 2.0);
    assert!(text.contains("kd of motor 2 is 2 N m s/rad without a velocity target"), "{text}");
    let text = refusal(|message| message.motor[3].kp = 60.0);
    assert!(text.contains("kp of motor 3 is 60 N m/rad without a position target"), "{text}");
    let text = refusal(|message| (message.motor[0].velocity, message.motor[0].kd) = (0.0, -1.0));
    assert!(text.contains("kd of motor 0 is -1 N m s/rad"), "{text}");
    for byte in 0..4 {
        let mut message = CommandMessage::INITIAL;
        message.battery[byte] = 0xA5;
        assert!(matches!(message.encode(), Err(EncodeError::Battery { .. })), "byte {byte}");
    }
}

#[test]
fn commands_hold_no_target_without_a_gain() {
    let decoded = |command: &JointCommand| CommandMessage::decode(low_command(command).unwrap().bytes()).unwrap();
    let damping = decoded(&JointCommand::damping(3.0));
    for (motor, target) in damping.motor.iter().enumerate() {
        assert_eq!(target.mode, MODE_SERVO);
        let (velocity, kd) = if motor < 12 { (0.0, 3.0) } else { (VELOCITY_STOP, 0.0) };
        assert_eq!((target.position, target.kp, target.torque), (POSITION_STOP, 0.0, 0.0), "motor {motor}");
        assert_eq!((target.velocity, target.kd), (velocity, kd), "motor {motor}");
    }
    let torques = decoded(&JointCommand::torques(&[1.5; 12]));
    assert_eq!((torques.motor[4].torque, torques.motor[4].velocity, torques.motor[4].kd), (1.5, VELOCITY_STOP, 0.0));
    let command = JointCommand::hold(&[0.25; 12], 60.0, 5.0);
    let hold = decoded(&command);
    assert_eq!(motor_command(&hold.motor[11]), Some(command.motor[11]));
    // A gain that vanishes in 32 bits is none.
    let tiny = decoded(&JointCommand::hold(&[0.0; 12], 1e-60, 1e-60));
    assert_eq!((tiny.motor[0].position, tiny.motor[0].velocity), (POSITION_STOP, VELOCITY_STOP));
    for (position, kd) in [(f64::NAN, 0.0), (1e300, 0.0), (0.0, f64::INFINITY), (0.0, -1.0)] {
        assert!(low_command(&JointCommand::hold(&[position; 12], 60.0, kd)).is_err(), "{position} {kd}");
    }
}

#[test]
fn the_remote_control_is_decoded() {
    let mut message = StateMessage::zero();
    assert_eq!(robot_state(&message, 1.0).remote, None, "zeros are no answer");
    let mut payload = message.encode();
    // Bit 5 of the first byte is L2, bit 1 of the second is B.
    payload[1100..1104].copy_from_slice(&[0x55, 0x51, 0x20, 0x02]);
    for (place, axis) in [0.25_f32, -0.5, 1.0, 0.75, -1.0].iter().enumerate() {
        payload[1104 + 4 * place..1108 + 4 * place].copy_from_slice(&axis.to_le_bytes());
    }
    let Err(MessageRejection::Checksum { computed, .. }) = StateMessage::decode(&payload) else { panic!() };
    payload[1172..].copy_from_slice(&computed.to_le_bytes());
    message = StateMessage::decode(&payload).unwrap();
    let state = robot_state(&message, 1.0);
    let remote = state.remote.unwrap();
    let stop: RemoteButtons = "L2+B".parse().unwrap();
    assert!(remote.buttons == stop && remote.buttons.contains(stop));
    assert_eq!((remote.left_stick, remote.right_stick, remote.l2_travel), ([0.25, -1.0], [-0.5, 1.0], 0.75));
    assert_eq!(low_state(&state, 1.0).remote, message.remote);
}

#[test]
fn a_state_survives_the_way_over_the_wire() {
    let mut state = RobotState {
        robot_time_ms: 7,
        motor_enabled: [true; 12],
        foot_force_n: [10.0, 20.0, 30.0, -5.0],
        battery: Some(Battery { charge_percent: 80.0, voltage_v: 30.0, current_a: -2.5, cell_v: [3.0; 10] }),
        ..RobotState::default()
    };
    for i in 0..12 {
        state.joint_position_rad[i] = i as f64 / 8.0;
        state.joint_velocity_rad_s[i] = -(i as f64);
        state.joint_torque_n_m[i] = i as f64 / 4.0;
        state.motor_temperature_c[i] = i as f64 - 6.0;
    }
    let decoded = StateMessage::decode(&low_state(&state, 1.0).encode()).unwrap();
    assert_eq!(robot_state(&decoded, 1.0), state);
    let mut tilted = decoded;
    tilted.imu.quaternion = [0.0; 4];
    assert!(robot_state(&tilted, 1.0).imu.world_from_body.coords.x.is_nan(), "no rotation is no orientation");
}

/// Bytes between members of a command, which the checksum does not cover.
fn command_padding(byte: usize) -> bool {
    byte == 23 || byte == 799 || (56..740).contains(&byte) && matches!((byte - 20) % 36, 1..=3)
}

/// Bytes between members of a state, which the checksum does not cover.
fn state_padding(byte: usize) -> bool {
    let motors = (78..80).contains(&byte)
        || (124..1036).contains(&byte) && matches!((byte - 76) % 48, 1..=3)
        || (109..1036).contains(&byte) && matches!((byte - 108) % 48, 1..=3);
    byte == 22 || byte == 23 || motors || (1141..1144).contains(&byte) || (1150..1152).contains(&byte)
}

#[test]
fn every_covered_byte_is_protected() {
    let command = *low_command(&JointCommand::hold(&[0.5; 12], 60.0, 5.0)).unwrap().bytes();
    let state = cases::<StateCase>("lowstate.json").into_iter().find(|case| case.name.contains("battery, feet"));
    let state = state.map_or_else(|| StateMessage::zero().encode().to_vec(), |case| bytes(&case.cdr)[4..].to_vec());
    for flip in [0x01, 0x80, 0xFF] {
        for byte in 0..COMMAND_LENGTH {
            let mut changed = command;
            changed[byte] ^= flip;
            assert_eq!(CommandMessage::decode(&changed).is_ok(), command_padding(byte), "command, byte {byte}");
        }
        for byte in 0..STATE_LENGTH {
            let mut changed = state.clone();
            changed[byte] ^= flip;
            assert_eq!(StateMessage::decode(&changed).is_ok(), state_padding(byte), "state, byte {byte}");
        }
    }
}

proptest! {
    #[test]
    fn arbitrary_bytes_are_decoded_or_rejected(noise in prop::collection::vec(any::<u8>(), 0..1400)) {
        for part in [Some(&noise[..]), payload(&noise).ok()].into_iter().flatten() {
            let _ = CommandMessage::decode(part);
            let _ = StateMessage::decode(part);
            let _ = RequestMessage::decode(part);
            let _ = ResponseMessage::decode(part);
        }
    }

    /// Also behind a right checksum: the fields are any, and come back as they were sent.
    #[test]
    fn arbitrary_fields_survive(noise in prop::collection::vec(any::<u8>(), STATE_LENGTH)) {
        let mut noise: [u8; STATE_LENGTH] = noise.try_into().unwrap();
        (0..STATE_LENGTH).filter(|byte| state_padding(*byte)).for_each(|byte| noise[byte] = 0);
        let Err(MessageRejection::Checksum { computed, .. }) = StateMessage::decode(&noise) else { return Ok(()) };
        noise[1172..].copy_from_slice(&computed.to_le_bytes());
        let state = StateMessage::decode(&noise).unwrap();
        prop_assert_eq!(state.encode(), noise);
        let _ = robot_state(&state, 1.0);
    }

    /// A command that is encoded holds finite numbers and no gain without its target; all else is refused.
    #[test]
    fn encoded_commands_are_harmless(
        motor in 0..MOTORS,
        position in prop_oneof![Just(POSITION_STOP), Just(f32::NAN), any::<f32>()],
        velocity in prop_oneof![Just(VELOCITY_STOP), Just(f32::INFINITY), any::<f32>()],
        torque in any::<f32>(),
        kp in prop_oneof![Just(0.0), any::<f32>()],
        kd in prop_oneof![Just(0.0), any::<f32>()],
        battery in any::<u8>(),
    ) {
        let mut message = CommandMessage::INITIAL;
        message.motor[motor] = ServoTarget { position, velocity, torque, kp, kd, ..ServoTarget::NONE };
        message.battery[0] = battery & 1;
        let harmless = [position, velocity, torque, kp, kd].iter().all(|value| value.is_finite())
            && kp >= 0.0
            && kd >= 0.0
            && (kp == 0.0 || position.abs() < POSITION_STOP)
            && (kd == 0.0 || velocity.abs() < VELOCITY_STOP)
            && battery & 1 == 0;
        prop_assert_eq!(message.encode().is_ok(), harmless);
    }
}
