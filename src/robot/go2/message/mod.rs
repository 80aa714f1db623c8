//! The Go2's messages as bytes; no DDS here.
//!
//! A message travels as a CDR payload, behind an encapsulation header of four bytes ([`payload`]). Its checksum covers
//! another layout, that of the C struct (`docs/go2-wire.md`, sections 2 to 4). `tests/golden_wire_go2.rs` compares with
//! payloads of the official Python types.
//!
//! [`CommandMessage::encode`] is the only source of a [`CommandPayload`], and refuses a command that may harm the robot.

mod api;
mod cdr;
mod command;
mod head;
mod rejection;
mod state;

pub use api::{RequestMessage, ResponseMessage, motion_switcher, sport};
pub use command::{
    COMMAND_LENGTH, CommandMessage, CommandPayload, EncodeError, MODE_SERVO, MODE_STOP, POSITION_STOP, ServoTarget,
    VELOCITY_STOP,
};
pub use head::{MOTORS, MessageHead};
pub use rejection::{ENCAPSULATION, MessageRejection, payload};
pub use state::{BatteryReport, ImuReport, MotorReport, STATE_LENGTH, StateMessage};
