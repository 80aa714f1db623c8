//! Properties of the Go1's datagrams: numbers in range survive encoding within the resolution, others are refused, and
//! the battery is never switched off.

use proptest::prelude::*;
use quadfrog::robot::go1::convert::{decode_motor, low_cmd, low_state, robot_state};
use quadfrog::robot::go1::packet::{
    COMMAND_LENGTH, CommandError, CrcForm, LowCmd, LowState, MODE_BRAKE, MODE_SERVO, POSITION_STOP, Rejection,
    VELOCITY_STOP, crc,
};
use quadfrog::robot::remote::{Remote, RemoteButtons};
use quadfrog::robot::{Battery, JOINTS, JointCommand, MotorCommand, RobotState};

fn motor() -> impl Strategy<Value = MotorCommand> {
    let gain = |most: f64| prop_oneof![Just(0.0), 0.0..most];
    (-10.0..10.0, -50.0..50.0, gain(1023.9), gain(2047.9), -127.9..127.9).prop_map(
        |(position, velocity, kp, kd, torque)| MotorCommand {
            position_rad: position,
            velocity_rad_s: velocity,
            kp_joint: kp,
            kd_joint: kd,
            torque_n_m: torque,
        },
    )
}

fn command() -> impl Strategy<Value = JointCommand> {
    proptest::array::uniform12(motor()).prop_map(|motor| JointCommand { motor })
}

fn form() -> impl Strategy<Value = CrcForm> {
    prop_oneof![Just(CrcForm::Plain), Just(CrcForm::Sealed)]
}

proptest! {
    #[test]
    fn a_command_comes_back_within_the_fixed_points_step(command in command(), form in form()) {
        let datagram = low_cmd(&command, form).unwrap();
        let read = LowCmd::parse(datagram.bytes(), form).unwrap();
        for (joint, wanted) in command.motor.iter().enumerate() {
            let got = decode_motor(&read.motor(joint)).expect("servo mode");
            // Truncated towards zero: not more than the command, and less than one step less, except for the rounding
            // to 32 bits.
            for (got, wanted, step) in
                [(got.torque_n_m, wanted.torque_n_m, 1.0 / 256.0), (got.kp_joint, wanted.kp_joint, 1.0 / 32.0), (got.kd_joint, wanted.kd_joint, 1.0 / 16.0)]
            {
                prop_assert!(got.abs() <= wanted.abs() + 1e-4 && (got - wanted).abs() < step + 1e-4);
            }
            if wanted.kp_joint > 0.0 {
                prop_assert!((got.position_rad - wanted.position_rad).abs() < 1e-5);
            }
            if wanted.kd_joint > 0.0 {
                prop_assert!((got.velocity_rad_s - wanted.velocity_rad_s).abs() < 1e-5);
            }
        }
        for motor in JOINTS..20 {
            prop_assert_eq!(read.motor(motor).mode, MODE_BRAKE);
        }
    }

    /// Without a gain there is no target: a motor never runs to a stale position.
    #[test]
    fn without_a_gain_there_is_no_target(command in command()) {
        let datagram = low_cmd(&command, CrcForm::Plain).unwrap();
        for (joint, wanted) in command.motor.iter().enumerate() {
            let target = datagram.motor(joint);
            prop_assert_eq!(target.mode, MODE_SERVO);
            prop_assert_eq!(target.position == POSITION_STOP, wanted.kp_joint == 0.0);
            prop_assert_eq!(target.velocity == VELOCITY_STOP, wanted.kd_joint == 0.0);
        }
    }

    /// Byte 562 with 0xA5 would drop the robot. Arbitrary bits in every number of a command, encoded or refused, leave
    /// it zero.
    #[test]
    fn no_command_switches_the_battery_off(numbers in proptest::array::uniform12(proptest::array::uniform5(any::<u64>())), form in form()) {
        let motor = numbers.map(|bits| {
            let [position, velocity, kp, kd, torque] = bits.map(f64::from_bits);
            MotorCommand { position_rad: position, velocity_rad_s: velocity, kp_joint: kp, kd_joint: kd, torque_n_m: torque }
        });
        if let Ok(datagram) = low_cmd(&JointCommand { motor }, form) {
            prop_assert_eq!(datagram.bytes()[562], 0);
        }
        prop_assert_eq!(LowCmd::braking(form).bytes()[562], 0);
    }

    #[test]
    fn what_is_not_finite_is_refused_by_name(
        command in command(), joint in 0..JOINTS, which in 0..5usize,
        bad in prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(1e300)],
    ) {
        let mut command = command;
        let motor = &mut command.motor[joint];
        *[&mut motor.position_rad, &mut motor.velocity_rad_s, &mut motor.torque_n_m, &mut motor.kp_joint, &mut motor.kd_joint][which] = bad;
        let name = ["position", "velocity", "torque", "kp", "kd"][which];
        match low_cmd(&command, CrcForm::Plain) {
            Err(CommandError::NotFinite { quantity, motor, .. }) => prop_assert_eq!((quantity, motor), (name, joint)),
            other => prop_assert!(false, "{:?}", other.map(|_| "encoded")),
        }
    }

    #[test]
    fn one_wrong_bit_anywhere_under_the_checksum_is_seen(bit in 16..608 * 8usize, form in form()) {
        let mut bytes = LowCmd::braking(form).bytes().to_vec();
        bytes[bit / 8] ^= 1 << (bit % 8);
        prop_assert!(matches!(LowCmd::parse(&bytes, form), Err(Rejection::Crc { .. })), "bit {}", bit);
    }

    #[test]
    fn nothing_that_comes_makes_a_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..1500)) {
        let _ = LowState::parse(&bytes).map(|state| robot_state(state, 1.0));
        let _ = LowCmd::parse(&bytes, CrcForm::Plain);
    }

    /// The controller decodes the state that the emulator encodes.
    #[test]
    fn a_state_comes_back(
        q in proptest::array::uniform12(-4.0..4.0f64), dq in proptest::array::uniform12(-30.0..30.0f64),
        torque in proptest::array::uniform12(-40.0..40.0f64), tick in any::<u32>(),
        force in proptest::array::uniform4(0..500i16), charge in 0..=100u8,
        axis in proptest::array::uniform3(-1.5..1.5f64), enabled in proptest::array::uniform12(any::<bool>()),
    ) {
        let mut told = RobotState {
            robot_time_ms: tick,
            joint_position_rad: q,
            joint_velocity_rad_s: dq,
            joint_torque_n_m: torque,
            foot_force_n: force.map(f64::from),
            motor_temperature_c: [41.0; JOINTS],
            motor_enabled: enabled,
            battery: Some(Battery { charge_percent: charge.into(), voltage_v: 6.0 * 3.84, current_a: -2.5, cell_v: [0.0; 10] }),
            ..RobotState::default()
        };
        told.battery.as_mut().unwrap().cell_v[..6].fill(3.84);
        told.imu.world_from_body = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::from(axis));
        told.imu.gyro_body = axis.into();
        let mut datagram = low_state(&told, 1.0);
        datagram.write_crc();
        let heard = robot_state(LowState::parse(datagram.bytes()).unwrap(), 1.0);
        let near = |a: &[f64], b: &[f64], step: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= step);
        prop_assert!(near(&heard.joint_position_rad, &told.joint_position_rad, 1e-6));
        prop_assert!(near(&heard.joint_velocity_rad_s, &told.joint_velocity_rad_s, 1e-5));
        prop_assert!(near(&heard.joint_torque_n_m, &told.joint_torque_n_m, 0.5 / 256.0 + 1e-5));
        prop_assert!(heard.imu.world_from_body.angle_to(&told.imu.world_from_body) < 1e-6);
        prop_assert!((heard.imu.gyro_body - told.imu.gyro_body).norm() < 1e-6);
        prop_assert_eq!((heard.robot_time_ms, heard.motor_enabled), (told.robot_time_ms, told.motor_enabled));
        prop_assert_eq!((heard.foot_force_n, heard.motor_temperature_c), (told.foot_force_n, told.motor_temperature_c));
        let (heard, told) = (heard.battery.unwrap(), told.battery.unwrap());
        prop_assert_eq!(heard.charge_percent, told.charge_percent);
        prop_assert!((heard.current_a - told.current_a).abs() < 1e-3 && (heard.voltage_v - told.voltage_v).abs() < 1e-3);
    }
}

/// The remote control's bytes at their offsets (`docs/go1-wire.md`, section 4), and back.
#[test]
fn the_remote_control_is_decoded() {
    let mut bytes = LowState::zero().bytes().to_vec();
    assert_eq!(robot_state(LowState::parse(&bytes).unwrap(), 1.0).remote, None, "zeros are no answer");
    // Bit 5 of the first byte is L2, bit 1 of the second is B.
    bytes[759..763].copy_from_slice(&[0x55, 0x51, 0x20, 0x02]);
    for (place, axis) in [0.25_f32, -0.5, 1.0, 0.75, -1.0].iter().enumerate() {
        bytes[763 + 4 * place..767 + 4 * place].copy_from_slice(&axis.to_le_bytes());
    }
    let sum = crc(&bytes[..800]);
    bytes[803..807].copy_from_slice(&sum.to_le_bytes());
    let state = robot_state(LowState::parse(&bytes).unwrap(), 1.0);
    let pressed: RemoteButtons = "L2+B".parse().unwrap();
    let expected = Remote { buttons: pressed, left_stick: [0.25, -1.0], right_stick: [-0.5, 1.0], l2_travel: 0.75 };
    assert_eq!(state.remote, Some(expected));
    let mut datagram = low_state(&state, 1.0);
    datagram.write_crc();
    assert_eq!(datagram.bytes()[759..799], bytes[759..799]);
}

/// The default command of `docs/go1-wire.md`, section 3, in both forms.
#[test]
fn a_command_that_asks_for_the_battery_to_be_switched_off_is_none() {
    let mut bytes = LowCmd::braking(CrcForm::Plain).bytes().to_vec();
    assert_eq!(bytes.len(), COMMAND_LENGTH);
    bytes[562] = 0xA5;
    let sum = crc(&bytes[..608]);
    bytes[610..].copy_from_slice(&sum.to_le_bytes());
    assert_eq!(LowCmd::parse(&bytes, CrcForm::Plain), Err(Rejection::BatteryOff));
}

/// The sources contain the only value of the battery's byte and no way around the type: the driver writes no byte by
/// its offset.
#[test]
fn the_driver_writes_no_byte_by_its_place() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/robot/go1");
    let mut read = 0;
    for folder in [root.clone(), root.join("packet")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                for way_around in ["as_mut_bytes", "mut_from", "transmute", "0xA5,", "165", "Zeroize"] {
                    assert!(!text.contains(way_around), "{}: {way_around}", path.display());
                }
                read += 1;
            }
        }
    }
    assert!(read >= 7, "only {read} files");
}

/// The worked example of `docs/go1-wire.md`, section 3: the checksum of 608 zero bytes.
#[test]
fn the_documented_example() {
    assert_eq!(CrcForm::Sealed.apply(0xE7CD_1C3B), 0xE50A_07A5);
}

/// The worked examples of `docs/go1-wire.md`, section 3, and `docs/go2-wire.md`, section 4.
#[test]
fn the_documented_examples() {
    assert_eq!(crc(&[0; 4]), 0xC704_DD7B);
    assert_eq!(crc(&[0xFE, 0xEF, 0xFF, 0]), 0x9BF0_26DF);
    assert_eq!(crc(&[0; 608]), 0xE7CD_1C3B);
    assert_eq!(crc(&[0; 808]), 0x4B5A_4880);
    assert_eq!(crc(&[0; 1176]), 0x85F1_1EA6);
}

#[test]
fn an_incomplete_word_is_not_covered() {
    assert_eq!(crc(&[1, 2, 3, 4, 5, 6, 7]), crc(&[1, 2, 3, 4]));
}
