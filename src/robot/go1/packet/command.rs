//! LowCmd, the command datagram.

use zerocopy::little_endian::{F32, I16, U16, U32};
use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, KnownLayout, TryFromBytes, Unaligned};

use super::{CommandError, CrcForm, HEAD, Header, MOTORS, Rejection, crc};

/// Length of a command, bytes.
pub const COMMAND_LENGTH: usize = 614;
/// Bytes covered by the checksum.
const COVERED: usize = 608;

/// Motor mode: the motor follows its target.
pub const MODE_SERVO: u8 = 0x0A;
/// Motor mode: the motor brakes by itself, with unknown strength.
pub const MODE_BRAKE: u8 = 0x00;
/// The position that means "no position target".
pub const POSITION_STOP: f32 = 2.146e9;
/// The velocity that means "no velocity target".
pub const VELOCITY_STOP: f32 = 16000.0;

/// Resolution of the fixed point: steps per N m, per N m/rad, per N m s/rad.
const TORQUE_STEPS: f32 = 256.0;
const KP_STEPS: f32 = 32.0;
const KD_STEPS: f32 = 16.0;

/// The byte that switches the robot's battery off (0xA5), which drops the robot. The type has one value: a command with
/// the request cannot be built, and a datagram with it is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromZeros, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(u8)]
enum BatteryOff {
    #[expect(dead_code, reason = "every command is made from zeroed bytes")]
    Never = 0,
}

/// Target of one motor in the datagram's resolution: `tau + kp (q_des - q) + kd (dq_des - dq)` inside the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorTarget {
    /// [`MODE_SERVO`] or [`MODE_BRAKE`].
    pub mode: u8,
    /// Desired angle, rad, or [`POSITION_STOP`].
    pub position: f32,
    /// Desired velocity, rad/s, or [`VELOCITY_STOP`].
    pub velocity: f32,
    /// Feed-forward torque, N m, in steps of 1/256: -128 up to less than 128.
    pub torque: f32,
    /// Stiffness, N m/rad, in steps of 1/32: 0 up to less than 1024. Whether the robot reads the word as unsigned,
    /// which allows more, is unknown.
    pub kp: f32,
    /// Damping, N m s/rad, in steps of 1/16: 0 up to less than 2048.
    pub kd: f32,
}

impl MotorTarget {
    /// Braking without target and gain.
    pub const BRAKING: MotorTarget = MotorTarget {
        mode: MODE_BRAKE,
        position: POSITION_STOP,
        velocity: VELOCITY_STOP,
        torque: 0.0,
        kp: 0.0,
        kd: 0.0,
    };
}

/// Record of one motor, 27 bytes.
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
struct TargetRecord {
    mode: u8,
    position: F32,
    velocity: F32,
    torque: I16,
    kp: U16,
    kd: U16,
    reserve: [U32; 3],
}

/// The command datagram, 614 bytes. Byte 562, which switches the battery off, is zero in every value of this type.
#[derive(Debug, Clone, Copy, PartialEq, FromZeros, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct LowCmd {
    /// Header.
    pub header: Header,
    motor: [TargetRecord; MOTORS],
    battery_off: BatteryOff,
    /// Reserved bytes of the battery.
    pub battery_reserve: [u8; 3],
    /// Bytes of the remote control.
    pub remote: [u8; 40],
    /// Reserved; the checksum covers the lower half alone.
    pub reserve: U32,
    crc: U32,
}

impl LowCmd {
    /// Returns a command in which every motor brakes.
    pub fn braking(form: CrcForm) -> LowCmd {
        let mut command = LowCmd::without_crc();
        command.write_crc(form);
        command
    }

    /// Returns the command of [`LowCmd::braking`] without a checksum.
    pub fn without_crc() -> LowCmd {
        let mut command = LowCmd::new_zeroed();
        command.header = Header::low_level();
        for motor in 0..MOTORS {
            command.put(motor, &MotorTarget::BRAKING, [U32::ZERO; 3]);
        }
        command
    }

    /// Sets one motor's target, rounded towards zero to the resolution as by the official library. The checksum does
    /// not change until [`LowCmd::write_crc`].
    ///
    /// # Errors
    /// Torque or a gain is not finite or out of range; the command is unchanged. (The official library lets the number
    /// wrap around: it sends 200 N m as -56.)
    ///
    /// # Panics
    /// There is no such motor.
    pub fn set(&mut self, motor: usize, target: &MotorTarget) -> Result<(), CommandError> {
        let check = |quantity, unit, value: f32, lowest, highest| {
            if !value.is_finite() {
                Err(CommandError::NotFinite { quantity, motor, value })
            } else if value >= lowest && value < highest {
                Ok(())
            } else {
                Err(CommandError::OutOfRange { quantity, motor, value, unit, lowest, highest })
            }
        };
        // Positive range of signed 16-bit numbers: the same if the robot reads the words as unsigned.
        let words = 32768.0;
        check("torque", "N m", target.torque, -words / TORQUE_STEPS, words / TORQUE_STEPS)?;
        check("kp", "N m/rad", target.kp, 0.0, words / KP_STEPS)?;
        check("kd", "N m s/rad", target.kd, 0.0, words / KD_STEPS)?;
        self.put(motor, target, self.motor[motor].reserve);
        Ok(())
    }

    fn put(&mut self, motor: usize, target: &MotorTarget, reserve: [U32; 3]) {
        self.motor[motor] = TargetRecord {
            mode: target.mode,
            position: target.position.into(),
            velocity: target.velocity.into(),
            torque: ((target.torque * TORQUE_STEPS) as i16).into(),
            kp: ((target.kp * KP_STEPS) as u16).into(),
            kd: ((target.kd * KD_STEPS) as u16).into(),
            reserve,
        };
    }

    /// Returns the target of `motor`.
    ///
    /// # Panics
    /// There is no such motor.
    pub fn motor(&self, motor: usize) -> MotorTarget {
        let record = &self.motor[motor];
        MotorTarget {
            mode: record.mode,
            position: record.position.get(),
            velocity: record.velocity.get(),
            torque: f32::from(record.torque.get()) / TORQUE_STEPS,
            kp: f32::from(record.kp.get()) / KP_STEPS,
            kd: f32::from(record.kd.get()) / KD_STEPS,
        }
    }

    /// Computes the checksum; call after all fields are set.
    pub fn write_crc(&mut self, form: CrcForm) {
        self.crc = form.apply(crc(&self.as_bytes()[..COVERED])).into();
    }

    /// The bytes of the datagram.
    pub fn bytes(&self) -> &[u8] {
        self.as_bytes()
    }

    /// Parses a datagram, for the emulator.
    ///
    /// # Errors
    /// The datagram is no command with that form of the checksum, or requests to switch the battery off.
    pub fn parse(datagram: &[u8], form: CrcForm) -> Result<&LowCmd, Rejection> {
        let length = datagram.len();
        if length != COMMAND_LENGTH {
            return Err(Rejection::Length { length, expected: COMMAND_LENGTH });
        }
        if datagram[..2] != HEAD {
            return Err(Rejection::Head { head: [datagram[0], datagram[1]] });
        }
        let (found, computed) = (
            u32::from_le_bytes([datagram[610], datagram[611], datagram[612], datagram[613]]),
            form.apply(crc(&datagram[..COVERED])),
        );
        if found != computed {
            return Err(Rejection::Crc { found, computed });
        }
        LowCmd::try_ref_from_bytes(datagram).map_err(|_| Rejection::BatteryOff)
    }
}

const _: () = assert!(size_of::<LowCmd>() == COMMAND_LENGTH);
const _: () = assert!(std::mem::offset_of!(LowCmd, battery_off) == 562);
