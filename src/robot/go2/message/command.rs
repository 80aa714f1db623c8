//! LowCmd, the command message: topic `rt/lowcmd`, type `unitree_go::msg::dds_::LowCmd_`.

use super::cdr::{CLayout, CdrReader, CdrWriter};
use super::head::{MOTORS, MessageHead};
use super::rejection::{MessageRejection, check_sum, whole};

/// Length of a command's payload, bytes.
pub const COMMAND_LENGTH: usize = 808;
/// Bytes of the C struct that the checksum covers.
const COVERED: usize = 808;

/// Motor mode: the motor follows its target. (The Go1's 0x0A belongs to other robots.)
pub const MODE_SERVO: u8 = 0x01;
/// Motor mode: the motor is stopped.
pub const MODE_STOP: u8 = 0x00;
/// The position that means "no position target".
pub const POSITION_STOP: f32 = 2.146e9;
/// The velocity that means "no velocity target".
pub const VELOCITY_STOP: f32 = 16000.0;

/// Target of one motor: `tau + kp (q_des - q) + kd (dq_des - dq)` inside the motor. The largest gains that a robot accepts
/// are not established.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServoTarget {
    /// [`MODE_SERVO`] or [`MODE_STOP`].
    pub mode: u8,
    /// Desired angle, rad, or [`POSITION_STOP`].
    pub position: f32,
    /// Desired velocity, rad/s, or [`VELOCITY_STOP`].
    pub velocity: f32,
    /// Feed-forward torque, N m.
    pub torque: f32,
    /// Stiffness, N m/rad, not negative; zero with [`POSITION_STOP`].
    pub kp: f32,
    /// Damping, N m s/rad, not negative; zero with [`VELOCITY_STOP`].
    pub kd: f32,
    /// Reserved words.
    pub reserve: [u32; 3],
}

impl ServoTarget {
    /// Servo mode without target, torque and gain: the SDK's initial command.
    pub const NONE: ServoTarget = ServoTarget {
        mode: MODE_SERVO,
        position: POSITION_STOP,
        velocity: VELOCITY_STOP,
        torque: 0.0,
        kp: 0.0,
        kd: 0.0,
        reserve: [0; 3],
    };

    /// Checks the target of `motor`.
    fn check(&self, motor: usize) -> Result<(), EncodeError> {
        let quantities = [
            ("position", self.position),
            ("velocity", self.velocity),
            ("torque", self.torque),
            ("kp", self.kp),
            ("kd", self.kd),
        ];
        for (quantity, value) in quantities {
            if !value.is_finite() {
                return Err(EncodeError::NotFinite { quantity, motor, value });
            }
        }
        for (quantity, unit, value) in [("kp", "N m/rad", self.kp), ("kd", "N m s/rad", self.kd)] {
            if value < 0.0 {
                return Err(EncodeError::NegativeGain { quantity, motor, value, unit });
            }
        }
        if self.kp > 0.0 && self.position.abs() >= POSITION_STOP {
            return Err(EncodeError::StiffnessWithoutPosition { motor, kp: self.kp });
        }
        if self.kd > 0.0 && self.velocity.abs() >= VELOCITY_STOP {
            return Err(EncodeError::DampingWithoutVelocity { motor, kd: self.kd });
        }
        Ok(())
    }
}

/// Reason for which a command is not encoded, in motor record `motor`, 0..20.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum EncodeError {
    /// Not a finite number: it would travel to the motor as it is.
    #[error("{quantity} of motor {motor} is {value}, not a finite number")]
    NotFinite { quantity: &'static str, motor: usize, value: f32 },
    /// A negative gain drives the joint away from its target.
    #[error("{quantity} of motor {motor} is {value} {unit}; give 0 or more")]
    NegativeGain { quantity: &'static str, motor: usize, value: f32, unit: &'static str },
    /// Stiffness towards the marker "no position target": a huge torque.
    #[error("kp of motor {motor} is {kp} N m/rad without a position target; give kp 0 or a target below 2.146e9 rad")]
    StiffnessWithoutPosition { motor: usize, kp: f32 },
    /// Damping towards the marker "no velocity target": a huge torque.
    #[error("kd of motor {motor} is {kd} N m s/rad without a velocity target; give kd 0 or a target below 16000 rad/s")]
    DampingWithoutVelocity { motor: usize, kd: f32 },
    /// A byte of the battery's command, of which A5 in the first switches the battery off and drops the robot.
    #[error("the battery's command is {bytes:02X?}; give zeros")]
    Battery { bytes: [u8; 4] },
}

/// A checked command, ready to be sent: the payload without the encapsulation header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CommandPayload([u8; COMMAND_LENGTH]);

impl CommandPayload {
    /// The bytes of the payload.
    pub fn bytes(&self) -> &[u8; COMMAND_LENGTH] {
        &self.0
    }
}

/// The fields of a command. Decoded, they may hold anything; encoded, they are checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandMessage {
    /// Head.
    pub head: MessageHead,
    /// Targets: record `3 * leg + joint`; the last eight motors do not exist and are commanded like the rest.
    pub motor: [ServoTarget; MOTORS],
    /// The battery's command; anything but zeros is refused.
    pub battery: [u8; 4],
    /// Bytes of the remote control.
    pub remote: [u8; 40],
    /// Lights.
    pub led: [u8; 12],
    /// Fans.
    pub fan: [u8; 2],
    /// Digital output.
    pub gpio: u8,
    /// Reserved.
    pub reserve: u32,
}

impl CommandMessage {
    /// The SDK's initial command: every motor in servo mode, without target, torque and gain.
    pub const INITIAL: CommandMessage = CommandMessage {
        head: MessageHead::LOW_LEVEL,
        motor: [ServoTarget::NONE; MOTORS],
        battery: [0; 4],
        remote: [0; 40],
        led: [0; 12],
        fan: [0; 2],
        gpio: 0,
        reserve: 0,
    };

    /// Checks and encodes the command with its checksum. Does not allocate.
    ///
    /// # Errors
    /// A number is not finite, a gain is negative or has no target, or a byte of the battery's command is not zero.
    pub fn encode(&self) -> Result<CommandPayload, EncodeError> {
        for (motor, target) in self.motor.iter().enumerate() {
            target.check(motor)?;
        }
        if self.battery != [0; 4] {
            return Err(EncodeError::Battery { bytes: self.battery });
        }
        let mut payload = [0; COMMAND_LENGTH];
        let mut writer = CdrWriter::new(&mut payload);
        self.head.write(&mut writer);
        for target in &self.motor {
            writer.bytes(&[target.mode]);
            writer.floats(&[target.position, target.velocity, target.torque, target.kp, target.kd]);
            for word in target.reserve {
                writer.number(word.to_le_bytes());
            }
        }
        writer.bytes(&self.battery);
        writer.bytes(&self.remote);
        writer.bytes(&self.led);
        writer.bytes(&self.fan);
        writer.bytes(&[self.gpio]);
        writer.number(self.reserve.to_le_bytes());
        let length = writer.length();
        let sum = checksum(&payload);
        payload[length..].copy_from_slice(&sum.to_le_bytes());
        Ok(CommandPayload(payload))
    }

    /// Decodes a payload, for an emulator or an observer of `rt/lowcmd`. The fields are not checked.
    ///
    /// # Errors
    /// The payload is too short, or its checksum is wrong.
    pub fn decode(payload: &[u8]) -> Result<CommandMessage, MessageRejection> {
        let payload = whole::<COMMAND_LENGTH>(payload)?;
        check_sum(payload, checksum(payload))?;
        let mut reader = CdrReader::new(payload);
        let head = MessageHead::read(&mut reader)?;
        let mut motor = [ServoTarget::NONE; MOTORS];
        for target in &mut motor {
            *target = ServoTarget {
                mode: reader.u8()?,
                position: reader.f32()?,
                velocity: reader.f32()?,
                torque: reader.f32()?,
                kp: reader.f32()?,
                kd: reader.f32()?,
                reserve: reader.array(CdrReader::u32)?,
            };
        }
        Ok(CommandMessage {
            head,
            motor,
            battery: reader.bytes()?,
            remote: reader.bytes()?,
            led: reader.bytes()?,
            fan: reader.bytes()?,
            gpio: reader.u8()?,
            reserve: reader.u32()?,
        })
    }
}

/// Computes the checksum of a payload.
fn checksum(payload: &[u8; COMMAND_LENGTH]) -> u32 {
    let mut layout = CLayout::<COVERED>::new();
    layout.put(&payload[..22], 2);
    for motor in 0..MOTORS {
        // The mode byte follows the previous member at once: CDR aligns members, not structures.
        let mode = if motor == 0 { 22 } else { 20 + 36 * motor };
        layout.put(&payload[mode..=mode], 3);
        layout.put(&payload[24 + 36 * motor..56 + 36 * motor], 0);
    }
    layout.put(&payload[740..799], 1);
    layout.put(&payload[800..804], 0);
    layout.crc()
}
