//! Compares datagrams with those of the official library, captured on loopback (`golden/wire`): commands that it sent,
//! and states that it accepted or rejected, with their decoded fields. `QUADFROG_GOLDEN` names another folder of golden
//! data.

mod support;

use quadfrog::robot::go1::packet::{
    CommandError, CrcForm, Header, LowCmd, LowState, MOTORS, MotorTarget, Rejection, STATE_LENGTH, crc,
};
use serde::Deserialize;
use serde_json::Value;
use support::bytes;

/// Reads `wire/<name>` in the golden folder, or `<name>` if the folder itself holds the datagrams.
fn cases<T: serde::de::DeserializeOwned>(name: &str) -> Vec<T> {
    support::golden_cases("wire", name)
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct CommandFields {
    head: [u8; 2],
    level_flag: u8,
    frame_reserve: u8,
    #[serde(rename = "SN")]
    serial: [u32; 2],
    version: [u32; 2],
    band_width: u16,
    motor_cmd: Vec<[u32; 9]>,
    bms: [u8; 4],
    wireless_remote: String,
    reserve: u32,
}

#[derive(Deserialize)]
struct CommandCase {
    name: String,
    in_range: bool,
    fields: CommandFields,
    wire: String,
    sealed_crc: String,
}

/// A command whose motor records have those reserved words, which no function of [`LowCmd`] sets.
fn with_reserve(motors: &[[u32; 9]], form: CrcForm) -> LowCmd {
    let mut datagram = LowCmd::braking(form).bytes().to_vec();
    for (motor, words) in motors.iter().enumerate() {
        for (word, value) in words[6..].iter().enumerate() {
            datagram[37 + 27 * motor + 4 * word..][..4].copy_from_slice(&value.to_le_bytes());
        }
    }
    let checksum = form.apply(crc(&datagram[..608]));
    datagram[610..].copy_from_slice(&checksum.to_le_bytes());
    *LowCmd::parse(&datagram, form).unwrap()
}

/// The command of those fields, without the byte that switches the battery off.
fn command(fields: &CommandFields, form: CrcForm) -> Result<LowCmd, CommandError> {
    let mut command = with_reserve(&fields.motor_cmd, form);
    command.header = Header {
        head: fields.head,
        level: fields.level_flag,
        frame_reserve: fields.frame_reserve,
        serial: fields.serial.map(Into::into),
        version: fields.version.map(Into::into),
        bandwidth: fields.band_width.into(),
    };
    for (motor, &[mode, q, dq, tau, kp, kd, ..]) in fields.motor_cmd.iter().enumerate() {
        let target = MotorTarget {
            mode: mode as u8,
            position: f32::from_bits(q),
            velocity: f32::from_bits(dq),
            torque: f32::from_bits(tau),
            kp: f32::from_bits(kp),
            kd: f32::from_bits(kd),
        };
        command.set(motor, &target)?;
    }
    command.battery_reserve = [fields.bms[1], fields.bms[2], fields.bms[3]];
    command.remote = bytes(&fields.wireless_remote).try_into().unwrap();
    command.reserve = fields.reserve.into();
    command.write_crc(form);
    Ok(command)
}

#[test]
fn every_command_in_range_is_the_librarys_byte_for_byte() {
    let mut same = 0;
    for case in cases::<CommandCase>("lowcmd.json").iter().filter(|case| case.in_range) {
        let plain = bytes(&case.wire);
        let mut sealed = plain.clone();
        sealed[610..].copy_from_slice(&bytes(&case.sealed_crc));
        for (form, wire) in [(CrcForm::Plain, plain), (CrcForm::Sealed, sealed)] {
            let ours = command(&case.fields, form).unwrap_or_else(|error| panic!("{}: {error}", case.name));
            if case.fields.bms[0] != 0 {
                // Our commands cannot switch the battery off: all other bytes are equal, and the library's command is
                // rejected.
                assert_eq!(ours.bytes()[562], 0, "{}", case.name);
                assert_eq!(ours.bytes()[..562], wire[..562], "{}", case.name);
                assert_eq!(ours.bytes()[563..610], wire[563..610], "{}", case.name);
                if case.fields.head == [0xFE, 0xEF] {
                    assert_eq!(LowCmd::parse(&wire, form), Err(Rejection::BatteryOff), "{}", case.name);
                }
                continue;
            }
            assert_eq!(ours.bytes(), wire, "{}, {form:?}", case.name);
            if case.fields.head == [0xFE, 0xEF] {
                let read = LowCmd::parse(&wire, form).unwrap_or_else(|error| panic!("{}: {error}", case.name));
                assert_eq!(read.bytes(), wire, "{}, {form:?}", case.name);
            }
            same += 1;
        }
    }
    println!("{same} datagrams are the library's byte for byte");
    assert!(same > 0);
}

/// The library lets numbers wrap around (200 N m becomes -56); our error names the quantity and the motor.
#[test]
fn every_command_out_of_range_is_refused_by_name() {
    let mut refused = 0;
    for case in cases::<CommandCase>("lowcmd.json").iter().filter(|case| !case.in_range) {
        let error = command(&case.fields, CrcForm::Plain).expect_err(&case.name);
        let (quantity, motor, value) = match error {
            CommandError::NotFinite { quantity, motor, value } => {
                assert!(!value.is_finite(), "{}: {error}", case.name);
                (quantity, motor, value)
            }
            CommandError::OutOfRange { quantity, motor, value, lowest, highest, .. } => {
                assert!(value < lowest || value >= highest, "{}: {error}", case.name);
                (quantity, motor, value)
            }
        };
        let column = match quantity {
            "torque" => 3,
            "kp" => 4,
            "kd" => 5,
            other => panic!("{}: a {other}", case.name),
        };
        assert_eq!(case.fields.motor_cmd[motor][column], value.to_bits(), "{}: {error}", case.name);
        refused += 1;
    }
    println!("{refused} commands are refused");
}

#[derive(Deserialize)]
struct StateCase {
    name: String,
    datagrams: Vec<String>,
    recv: i32,
    state: Option<Value>,
}

#[test]
fn every_state_is_accepted_or_rejected_as_by_the_library() {
    let (mut accepted, mut rejected) = (0, 0);
    for case in cases::<StateCase>("lowstate.json") {
        // The library's buffer: zeroed once, each datagram of the queue over the previous one, checked at the end.
        let mut buffer = vec![0; STATE_LENGTH];
        let mut last = Vec::new();
        for datagram in case.datagrams.iter().map(|hex| bytes(hex)) {
            let kept = datagram.len().min(STATE_LENGTH);
            buffer[..kept].copy_from_slice(&datagram[..kept]);
            last = datagram;
        }
        let verdict = LowState::parse(&buffer);
        let expected = match verdict {
            Ok(_) => 0,
            Err(Rejection::Head { .. }) => -1,
            Err(_) => -3,
        };
        assert_eq!(expected, case.recv, "{}: {verdict:?}", case.name);
        // Ours checks each datagram by itself. Only for a datagram that is too short can the results differ.
        match LowState::parse(&last) {
            Err(Rejection::Length { length, .. }) => assert!(length < STATE_LENGTH, "{}", case.name),
            alone => assert_eq!(alone, verdict, "{}", case.name),
        }
        match verdict {
            Ok(state) => {
                compare(state, case.state.as_ref().expect(&case.name), &case.name);
                accepted += 1;
            }
            Err(_) => rejected += 1,
        }
    }
    println!("{accepted} states accepted and equal in every field, {rejected} rejected");
    assert!(accepted > 0);
}

/// Compares every field of a decoded state; floats by their bits.
fn compare(ours: &LowState, theirs: &Value, case: &str) {
    let numbers = |value: &Value| -> Vec<i64> {
        value.as_array().unwrap_or_else(|| panic!("{case}: {value}")).iter().map(|v| v.as_i64().unwrap()).collect()
    };
    let bits = |values: &[f32]| -> Vec<i64> { values.iter().map(|v| i64::from(v.to_bits())).collect() };
    let same = |what: &str, ours: Vec<i64>, theirs: &Value| assert_eq!(ours, numbers(theirs), "{case}: {what}");
    let one = |what: &str, ours: i64, theirs: &Value| assert_eq!(Some(ours), theirs.as_i64(), "{case}: {what}");

    let header = &ours.header;
    same("head", header.head.map(i64::from).to_vec(), &theirs["head"]);
    one("level", header.level.into(), &theirs["levelFlag"]);
    one("frame reserve", header.frame_reserve.into(), &theirs["frameReserve"]);
    same("serial", header.serial.map(|v| v.get().into()).to_vec(), &theirs["SN"]);
    same("version", header.version.map(|v| v.get().into()).to_vec(), &theirs["version"]);
    one("bandwidth", header.bandwidth.get().into(), &theirs["bandWidth"]);

    let imu = &theirs["imu"];
    same("quaternion", bits(&ours.imu.quaternion.map(|v| v.get())), &imu["quaternion"]);
    same("gyroscope", bits(&ours.imu.gyroscope.map(|v| v.get())), &imu["gyroscope"]);
    same("accelerometer", bits(&ours.imu.accelerometer.map(|v| v.get())), &imu["accelerometer"]);
    same("rpy", bits(&ours.imu.roll_pitch_yaw.map(|v| v.get())), &imu["rpy"]);
    one("temperature", ours.imu.temperature.into(), &imu["temperature"]);

    let motors = theirs["motorState"].as_array().unwrap();
    assert_eq!(motors.len(), MOTORS, "{case}");
    for (motor, row) in ours.motor.iter().zip(motors) {
        let float = |value: f32| i64::from(value.to_bits());
        let ours = vec![
            motor.mode.into(),
            float(motor.position.get()),
            float(motor.velocity.get()),
            float(f32::from(motor.acceleration.get())),
            float(motor.torque()),
            float(motor.position_raw.get()),
            float(motor.velocity_raw.get()),
            float(f32::from(motor.acceleration_raw.get())),
            motor.temperature.into(),
            motor.reserve[0].get().into(),
            motor.reserve[1].get().into(),
        ];
        same("motor", ours, row);
    }

    let (battery, bms) = (&ours.battery, &theirs["bms"]);
    one("version_h", battery.version[0].into(), &bms["version_h"]);
    one("version_l", battery.version[1].into(), &bms["version_l"]);
    one("bms_status", battery.status.into(), &bms["bms_status"]);
    one("SOC", battery.charge.into(), &bms["SOC"]);
    one("current", battery.current.get().into(), &bms["current"]);
    one("cycle", battery.cycles.get().into(), &bms["cycle"]);
    same("BQ_NTC", battery.cell_temperature.map(i64::from).to_vec(), &bms["BQ_NTC"]);
    same("MCU_NTC", battery.controller_temperature.map(i64::from).to_vec(), &bms["MCU_NTC"]);
    same("cell_vol", battery.cell_v().map(|v| (v * 1000.0).round() as i64).to_vec(), &bms["cell_vol"]);

    same("footForce", ours.foot_force.map(|v| v.get().into()).to_vec(), &theirs["footForce"]);
    same("footForceEst", ours.foot_force_estimated.map(|v| v.get().into()).to_vec(), &theirs["footForceEst"]);
    one("tick", ours.robot_time_ms.get().into(), &theirs["tick"]);
    assert_eq!(
        bytes(theirs["wirelessRemote"].as_str().unwrap()),
        zerocopy::IntoBytes::as_bytes(&ours.remote),
        "{case}: wirelessRemote"
    );
    one("reserve", ours.reserve.get().into(), &theirs["reserve"]);
}
