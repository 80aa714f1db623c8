//! LowState, the state datagram.

use zerocopy::little_endian::{F32, I16, I32, U16, U32};
use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, KnownLayout, Unaligned};

use super::{CrcForm, HEAD, HIGH_LEVEL, Header, MOTORS, Rejection, crc};

/// Bytes of a state that are read; a real robot is reported to send 13 more, of unknown meaning.
pub const STATE_LENGTH: usize = 807;
/// Bytes that its checksum covers.
const COVERED: usize = 800;
/// Steps of the reported torque, per N m.
const TORQUE_STEPS: f32 = 256.0;
/// What one step of a cell's voltage is, V.
const CELL_STEP_V: f32 = 0.032;

/// The inertial unit's 53 bytes. That its axes are the trunk's is assumed.
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct ImuRecord {
    /// Rotation that takes body axes to world axes: w, x, y, z.
    pub quaternion: [F32; 4],
    /// Angular velocity, rad/s.
    pub gyroscope: [F32; 3],
    /// Specific force, m/s^2.
    pub accelerometer: [F32; 3],
    /// Roll, pitch, yaw, rad.
    pub roll_pitch_yaw: [F32; 3],
    /// Temperature, degrees Celsius.
    pub temperature: i8,
}

/// One motor's 32 bytes.
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct MotorRecord {
    /// Mode: 0x0A servo, 0x00 damping, 0x08 overheated.
    pub mode: u8,
    /// Angle, rad.
    pub position: F32,
    /// Velocity, rad/s.
    pub velocity: F32,
    /// Acceleration, rad/s^2.
    pub acceleration: I16,
    /// Torque as the motor estimates it, words of 1/256 N m: see [`MotorRecord::torque`].
    pub torque_word: I16,
    /// Angle before the motor's own filter, rad.
    pub position_raw: F32,
    /// Velocity before the motor's own filter, rad/s.
    pub velocity_raw: F32,
    /// Acceleration before the motor's own filter, rad/s^2.
    pub acceleration_raw: I16,
    /// Temperature, degrees Celsius.
    pub temperature: i8,
    /// Reserved.
    pub reserve: [U32; 2],
}

impl MotorRecord {
    /// Torque as the motor estimates it, N m.
    pub fn torque(&self) -> f32 {
        f32::from(self.torque_word.get()) / TORQUE_STEPS
    }

    /// Sets the torque, N m, as near as the word can say it.
    pub fn set_torque(&mut self, torque: f32) {
        self.torque_word = ((torque * TORQUE_STEPS).round() as i16).into();
    }
}

/// The battery's 24 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct BatteryRecord {
    /// Version, high and low.
    pub version: [u8; 2],
    /// Status: 1 discharging, 2 charging, others in `specs/go1-wire.md`, section 4.
    pub status: u8,
    /// State of charge, percent.
    pub charge: u8,
    /// Current, mA.
    pub current: I32,
    /// Charging cycles.
    pub cycles: U16,
    /// Temperatures at the cells, degrees Celsius.
    pub cell_temperature: [i8; 2],
    /// Temperatures of its controller, degrees Celsius.
    pub controller_temperature: [i8; 2],
    /// Cell voltages in steps of 32 mV: see [`BatteryRecord::cell_v`].
    pub cell_steps: [u8; 10],
}

impl BatteryRecord {
    /// Voltage of each cell, V; zero where there is no such cell.
    pub fn cell_v(&self) -> [f32; 10] {
        self.cell_steps.map(|steps| f32::from(steps) * CELL_STEP_V)
    }

    /// Sets the voltages of the cells, V, as near as the steps can say them.
    pub fn set_cell_v(&mut self, cell_v: &[f32; 10]) {
        self.cell_steps = cell_v.map(|v| (v / CELL_STEP_V).round() as u8);
    }
}

/// The state datagram, 807 bytes.
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct LowState {
    /// How it begins.
    pub header: Header,
    /// Inertial unit.
    pub imu: ImuRecord,
    /// Motors: record `3 * leg + joint`; the last eight are unused on the Go1.
    pub motor: [MotorRecord; MOTORS],
    /// Battery.
    pub battery: BatteryRecord,
    /// Foot sensors; their order is assumed to be that of the legs, their unit is not established.
    pub foot_force: [I16; 4],
    /// Foot forces as the robot estimates them.
    pub foot_force_estimated: [I16; 4],
    /// The robot's clock, ms.
    pub tick: U32,
    /// Bytes of the remote control.
    pub remote: [u8; 40],
    /// Reserved; the checksum covers its first byte alone.
    pub reserve: U32,
    crc: U32,
}

impl LowState {
    /// A low-level state in which all is zero.
    pub fn zero() -> LowState {
        let mut state = LowState::new_zeroed();
        state.header = Header::low_level();
        state.seal();
        state
    }

    /// Computes the checksum, in the form that the level demands; to be called once all is set.
    pub fn seal(&mut self) {
        self.crc = form_of(self.header.level).apply(crc(&self.as_bytes()[..COVERED])).into();
    }

    /// The bytes that travel.
    pub fn bytes(&self) -> &[u8] {
        self.as_bytes()
    }

    /// Judges one datagram by itself, as the official endpoint judges the last of a queue: head, then checksum in the form that
    /// the level demands. What is longer is judged on its first 807 bytes.
    ///
    /// # Errors
    /// When it is no state. A datagram that is too short is refused as such; the official endpoint finds its checksum wrong.
    pub fn judge(datagram: &[u8]) -> Result<&LowState, Rejection> {
        let Ok((state, _)) = LowState::ref_from_prefix(datagram) else {
            return Err(Rejection::Length { length: datagram.len(), expected: STATE_LENGTH });
        };
        if state.header.head != HEAD {
            return Err(Rejection::Head { head: state.header.head });
        }
        let (found, computed) = (state.crc.get(), form_of(state.header.level).apply(crc(&datagram[..COVERED])));
        if found == computed { Ok(state) } else { Err(Rejection::Crc { found, computed }) }
    }
}

/// The form that a state of `level` must have.
fn form_of(level: u8) -> CrcForm {
    if level == HIGH_LEVEL { CrcForm::Sealed } else { CrcForm::Plain }
}

const _: () = assert!(size_of::<LowState>() == STATE_LENGTH);
const _: () = assert!(std::mem::offset_of!(LowState, motor) == 75 && std::mem::offset_of!(LowState, tick) == 755);
