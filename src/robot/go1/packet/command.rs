//! LowCmd, the command datagram.

use zerocopy::little_endian::{F32, I16, U16, U32};
use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, KnownLayout, TryFromBytes, Unaligned};

use super::{CommandError, CrcForm, HEAD, Header, MOTORS, Rejection, crc};

/// Length of a command, bytes.
pub const COMMAND_LENGTH: usize = 614;
/// Bytes that its checksum covers.
const COVERED: usize = 608;

/// Motor mode: the motor follows its target.
pub const MODE_SERVO: u8 = 0x0A;
/// Motor mode: the motor brakes by itself; how strongly is not established.
pub const MODE_DAMPING: u8 = 0x00;
/// The position that means "no position target".
pub const POSITION_STOP: f32 = 2.146e9;
/// The velocity that means "no velocity target".
pub const VELOCITY_STOP: f32 = 16000.0;

/// Steps of the fixed point: words per N m, per N m/rad, per N m s/rad.
const TORQUE_STEPS: f32 = 256.0;
const KP_STEPS: f32 = 32.0;
const KD_STEPS: f32 = 16.0;

/// The byte with which a program can switch the robot's battery off (0xA5), which drops the robot. The type has one value:
/// a command with the request cannot be built, and one that comes over the network is no command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromZeros, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(u8)]
enum BatteryOff {
    #[expect(dead_code, reason = "every command is made from zeroed bytes")]
    Never = 0,
}

/// What one motor is told, in the datagram's own resolution: `tau + kp (q_des - q) + kd (dq_des - dq)` inside the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorTarget {
    /// [`MODE_SERVO`] or [`MODE_DAMPING`].
    pub mode: u8,
    /// Desired angle, rad, or [`POSITION_STOP`]. Any bit pattern travels.
    pub position: f32,
    /// Desired velocity, rad/s, or [`VELOCITY_STOP`]. Any bit pattern travels.
    pub velocity: f32,
    /// Feed-forward torque, N m, in steps of 1/256: -128 up to less than 128.
    pub torque: f32,
    /// Stiffness, N m/rad, in steps of 1/32: 0 up to less than 1024. More would fit if the robot reads the word as unsigned,
    /// which is not established.
    pub kp: f32,
    /// Damping, N m s/rad, in steps of 1/16: 0 up to less than 2048.
    pub kd: f32,
}

impl MotorTarget {
    /// Braking, no target, no gain.
    pub const DAMPING: MotorTarget = MotorTarget {
        mode: MODE_DAMPING,
        position: POSITION_STOP,
        velocity: VELOCITY_STOP,
        torque: 0.0,
        kp: 0.0,
        kd: 0.0,
    };
}

/// One motor's 27 bytes.
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

/// The command datagram, 614 bytes. There is no field for the battery's switch: byte 562 is zero in every value of this type.
#[derive(Debug, Clone, Copy, PartialEq, FromZeros, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct LowCmd {
    /// How it begins.
    pub header: Header,
    motor: [TargetRecord; MOTORS],
    battery_off: BatteryOff,
    /// Reserved bytes behind the battery's.
    pub battery_reserve: [u8; 3],
    /// Bytes of the remote control.
    pub remote: [u8; 40],
    /// Reserved; the checksum covers its lower half alone.
    pub reserve: U32,
    crc: U32,
}

impl LowCmd {
    /// A command that moves nothing: every motor brakes.
    pub fn damping(form: CrcForm) -> LowCmd {
        let mut command = LowCmd::unsealed();
        command.seal(form);
        command
    }

    /// The same before its checksum is computed: to be changed first.
    pub fn unsealed() -> LowCmd {
        let mut command = LowCmd::new_zeroed();
        command.header = Header::low_level();
        for motor in 0..MOTORS {
            command.put(motor, &MotorTarget::DAMPING, [0; 3]);
        }
        command
    }

    /// Sets one motor's target, rounded towards zero to the datagram's steps as the official library does. The checksum is
    /// that of before until [`LowCmd::seal`].
    ///
    /// # Errors
    /// When torque or a gain is not finite or does not fit; nothing is changed then. (The official library lets the words
    /// wrap: 200 N m would be sent as -56.)
    ///
    /// # Panics
    /// When there is no such motor.
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
        // The words' range as signed 16-bit numbers: what every way of reading them agrees on.
        let words = 32768.0;
        check("torque", "N m", target.torque, -words / TORQUE_STEPS, words / TORQUE_STEPS)?;
        check("kp", "N m/rad", target.kp, 0.0, words / KP_STEPS)?;
        check("kd", "N m s/rad", target.kd, 0.0, words / KD_STEPS)?;
        self.put(motor, target, self.reserve_of(motor));
        Ok(())
    }

    fn put(&mut self, motor: usize, target: &MotorTarget, reserve: [u32; 3]) {
        self.motor[motor] = TargetRecord {
            mode: target.mode,
            position: target.position.into(),
            velocity: target.velocity.into(),
            torque: ((target.torque * TORQUE_STEPS) as i16).into(),
            kp: ((target.kp * KP_STEPS) as u16).into(),
            kd: ((target.kd * KD_STEPS) as u16).into(),
            reserve: reserve.map(U32::new),
        };
    }

    /// What `motor` is told.
    ///
    /// # Panics
    /// When there is no such motor.
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

    /// The reserved words of `motor`'s record.
    ///
    /// # Panics
    /// When there is no such motor.
    pub fn reserve_of(&self, motor: usize) -> [u32; 3] {
        self.motor[motor].reserve.map(U32::get)
    }

    /// Sets the reserved words of `motor`'s record.
    ///
    /// # Panics
    /// When there is no such motor.
    pub fn set_reserve(&mut self, motor: usize, reserve: [u32; 3]) {
        self.motor[motor].reserve = reserve.map(U32::new);
    }

    /// Computes the checksum; to be called once all is set.
    pub fn seal(&mut self, form: CrcForm) {
        self.crc = form.apply(crc(&self.as_bytes()[..COVERED])).into();
    }

    /// The bytes that travel.
    pub fn bytes(&self) -> &[u8] {
        self.as_bytes()
    }

    /// Reads a datagram as the robot would have to: the view from the other side, for the emulator.
    ///
    /// # Errors
    /// When it is not a command in that form, or asks for the battery to be switched off.
    pub fn judge(datagram: &[u8], form: CrcForm) -> Result<&LowCmd, Rejection> {
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
