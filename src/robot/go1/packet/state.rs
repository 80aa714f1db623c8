//! LowState, the state datagram.

use zerocopy::little_endian::{F32, I16, I32, U16, U32};
use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, KnownLayout, Unaligned};

use super::{CrcForm, HEAD, HIGH_LEVEL, Header, MOTORS, Rejection, RemoteRecord, crc};

/// Bytes of a state that are read; a real robot is reported to send 13 more of unknown meaning.
pub const STATE_LENGTH: usize = 807;
/// Bytes covered by the checksum.
const COVERED: usize = 800;
/// Resolution of the reported torque, steps per N m.
const TORQUE_STEPS: f32 = 256.0;
/// Resolution of a cell's voltage, V.
const CELL_STEP_V: f32 = 0.032;

/// Record of the inertial unit, 53 bytes. Assumed: its axes are the trunk's.
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct ImuRecord {
    /// Rotation from body axes to world axes: w, x, y, z.
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

/// Record of one motor, 32 bytes.
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct MotorRecord {
    /// Mode: 0x0A servo, 0x00 braking, 0x08 overheated.
    pub mode: u8,
    /// Angle, rad.
    pub position: F32,
    /// Velocity, rad/s.
    pub velocity: F32,
    /// Acceleration, rad/s^2.
    pub acceleration: I16,
    /// Torque as the motor estimates it, 1/256 N m; see [`MotorRecord::torque`].
    pub torque_word: I16,
    /// Angle before the motor's filter, rad.
    pub position_raw: F32,
    /// Velocity before the motor's filter, rad/s.
    pub velocity_raw: F32,
    /// Acceleration before the motor's filter, rad/s^2.
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

    /// Sets the torque, N m, rounded to the resolution.
    pub fn set_torque(&mut self, torque: f32) {
        self.torque_word = ((torque * TORQUE_STEPS).round() as i16).into();
    }
}

/// Record of the battery, 24 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct BatteryRecord {
    /// Version, high and low.
    pub version: [u8; 2],
    /// Status: 1 discharging, 2 charging, others in `docs/go1-wire.md`, section 4.
    pub status: u8,
    /// State of charge, percent.
    pub charge: u8,
    /// Current, mA.
    pub current: I32,
    /// Charging cycles.
    pub cycles: U16,
    /// Temperatures at the cells, degrees Celsius.
    pub cell_temperature: [i8; 2],
    /// Temperatures of the controller, degrees Celsius.
    pub controller_temperature: [i8; 2],
    /// Cell voltages, 32 mV; see [`BatteryRecord::cell_v`].
    pub cell_steps: [u8; 10],
}

impl BatteryRecord {
    /// Voltage of each cell, V; zero for absent cells.
    pub fn cell_v(&self) -> [f32; 10] {
        self.cell_steps.map(|steps| f32::from(steps) * CELL_STEP_V)
    }

    /// Sets the voltages of the cells, V, rounded to the resolution.
    pub fn set_cell_v(&mut self, cell_v: &[f32; 10]) {
        self.cell_steps = cell_v.map(|v| (v / CELL_STEP_V).round() as u8);
    }
}

/// The state datagram, 807 bytes.
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct LowState {
    /// Header.
    pub header: Header,
    /// Inertial unit.
    pub imu: ImuRecord,
    /// Motors: record `3 * leg + joint`; the last eight are unused on the Go1.
    pub motor: [MotorRecord; MOTORS],
    /// Battery.
    pub battery: BatteryRecord,
    /// Foot sensors. Assumed: the order of the legs. The unit is unknown.
    pub foot_force: [I16; 4],
    /// Foot forces as the robot estimates them.
    pub foot_force_estimated: [I16; 4],
    /// The robot's clock, ms.
    pub robot_time_ms: U32,
    /// Remote control (`wirelessRemote`).
    pub remote: RemoteRecord,
    /// Reserved; the checksum covers the first byte alone.
    pub reserve: U32,
    crc: U32,
}

impl LowState {
    /// Returns a low-level state with all fields zero.
    pub fn zero() -> LowState {
        let mut state = LowState::new_zeroed();
        state.header = Header::low_level();
        state.write_crc();
        state
    }

    /// Computes the checksum in the form of the level; call after all fields are set.
    pub fn write_crc(&mut self) {
        self.crc = form_of(self.header.level).apply(crc(&self.as_bytes()[..COVERED])).into();
    }

    /// The bytes of the datagram.
    pub fn bytes(&self) -> &[u8] {
        self.as_bytes()
    }

    /// Parses a datagram and checks head and checksum, as the official endpoint does with the last datagram of a queue.
    /// Bytes after the first 807 are ignored.
    ///
    /// # Errors
    /// The datagram is no state. A datagram that is too short is an error of its own; the official endpoint reports a
    /// wrong checksum.
    pub fn parse(datagram: &[u8]) -> Result<&LowState, Rejection> {
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

/// Returns the checksum's form in a state of `level`.
fn form_of(level: u8) -> CrcForm {
    if level == HIGH_LEVEL { CrcForm::Sealed } else { CrcForm::Plain }
}

const _: () = assert!(size_of::<LowState>() == STATE_LENGTH);
const _: () = assert!(std::mem::offset_of!(LowState, remote) == 759);
const _: () =
    assert!(std::mem::offset_of!(LowState, motor) == 75 && std::mem::offset_of!(LowState, robot_time_ms) == 755);
