//! LowState, the state message: topic `rt/lowstate`, type `unitree_go::msg::dds_::LowState_`.

use zerocopy::{FromBytes, FromZeros, IntoBytes};

use super::cdr::{CLayout, CdrReader, CdrWriter};
use super::head::{MOTORS, MessageHead};
use super::rejection::{MessageRejection, check_sum, whole};
use crate::robot::remote::RemoteRecord;

/// Length of a state's payload, bytes.
pub const STATE_LENGTH: usize = 1176;
/// Bytes of the C struct that the checksum covers.
const COVERED: usize = 1176;

/// Report of the inertial unit. Assumed: its axes are the trunk's.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImuReport {
    /// Rotation from body axes to world axes: w, x, y, z.
    pub quaternion: [f32; 4],
    /// Angular velocity, rad/s.
    pub gyroscope: [f32; 3],
    /// Specific force, m/s^2.
    pub accelerometer: [f32; 3],
    /// Roll, pitch, yaw, rad.
    pub roll_pitch_yaw: [f32; 3],
    /// Temperature, degrees Celsius.
    pub temperature: i8,
}

/// Report of one motor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotorReport {
    /// Mode: 0x01 servo, 0x00 stopped.
    pub mode: u8,
    /// Angle, rad.
    pub position: f32,
    /// Velocity, rad/s.
    pub velocity: f32,
    /// Acceleration, rad/s^2.
    pub acceleration: f32,
    /// Torque as the motor estimates it, N m.
    pub torque: f32,
    /// Angle, velocity and acceleration before the motor's filter; reported to be unused.
    pub raw: [f32; 3],
    /// Temperature, degrees Celsius.
    pub temperature: i8,
    /// Count of lost messages of the motor.
    pub lost: u32,
    /// Reserved.
    pub reserve: [u32; 2],
}

/// Report of the battery.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BatteryReport {
    /// Version, high and low.
    pub version: [u8; 2],
    /// Status.
    pub status: u8,
    /// State of charge, percent.
    pub charge: u8,
    /// Current, mA.
    pub current: i32,
    /// Charging cycles.
    pub cycles: u16,
    /// Temperatures at the cells, degrees Celsius.
    pub cell_temperature: [i8; 2],
    /// Temperatures of the controller, degrees Celsius.
    pub controller_temperature: [i8; 2],
    /// Cell voltages, mV; zero for absent cells.
    pub cell_mv: [u16; 15],
}

/// The fields of a state. Numbers are as they came, also if they are not finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateMessage {
    /// Head.
    pub head: MessageHead,
    /// Inertial unit.
    pub imu: ImuReport,
    /// Motors: record `3 * leg + joint`; the last eight do not exist.
    pub motor: [MotorReport; MOTORS],
    /// Battery.
    pub battery: BatteryReport,
    /// Foot sensors, raw counts. Assumed: the order of the legs.
    pub foot_force: [i16; 4],
    /// Foot forces as the robot estimates them; reported to be unused.
    pub foot_force_estimated: [i16; 4],
    /// Counter of the robot's time; its unit is not established.
    pub tick: u32,
    /// Remote control.
    pub remote: RemoteRecord,
    /// Flags of unknown meaning.
    pub bit_flag: u8,
    /// Quantity of unknown meaning.
    pub adc_reel: f32,
    /// Temperatures of the board, degrees Celsius.
    pub board_temperature: [i8; 2],
    /// Voltage, V.
    pub power_v: f32,
    /// Current, A.
    pub power_a: f32,
    /// Frequencies of the fans.
    pub fan_frequency: [u16; 4],
    /// Reserved.
    pub reserve: u32,
}

impl StateMessage {
    /// Returns a state with the SDK's head and all other fields zero.
    pub fn zero() -> StateMessage {
        StateMessage {
            head: MessageHead::LOW_LEVEL,
            imu: ImuReport::default(),
            motor: [MotorReport::default(); MOTORS],
            battery: BatteryReport::default(),
            foot_force: [0; 4],
            foot_force_estimated: [0; 4],
            tick: 0,
            remote: RemoteRecord::new_zeroed(),
            bit_flag: 0,
            adc_reel: 0.0,
            board_temperature: [0; 2],
            power_v: 0.0,
            power_a: 0.0,
            fan_frequency: [0; 4],
            reserve: 0,
        }
    }

    /// Decodes a payload. Does not allocate.
    ///
    /// # Errors
    /// The payload is too short, or its checksum is wrong.
    pub fn decode(payload: &[u8]) -> Result<StateMessage, MessageRejection> {
        let payload = whole::<STATE_LENGTH>(payload)?;
        check_sum(payload, checksum(payload))?;
        let mut reader = CdrReader::new(payload);
        let head = MessageHead::read(&mut reader)?;
        let imu = ImuReport {
            quaternion: reader.array(CdrReader::f32)?,
            gyroscope: reader.array(CdrReader::f32)?,
            accelerometer: reader.array(CdrReader::f32)?,
            roll_pitch_yaw: reader.array(CdrReader::f32)?,
            temperature: reader.i8()?,
        };
        let mut motor = [MotorReport::default(); MOTORS];
        for report in &mut motor {
            *report = MotorReport {
                mode: reader.u8()?,
                position: reader.f32()?,
                velocity: reader.f32()?,
                acceleration: reader.f32()?,
                torque: reader.f32()?,
                raw: reader.array(CdrReader::f32)?,
                temperature: reader.i8()?,
                lost: reader.u32()?,
                reserve: reader.array(CdrReader::u32)?,
            };
        }
        let battery = BatteryReport {
            version: reader.bytes()?,
            status: reader.u8()?,
            charge: reader.u8()?,
            current: reader.i32()?,
            cycles: reader.u16()?,
            cell_temperature: reader.array(CdrReader::i8)?,
            controller_temperature: reader.array(CdrReader::i8)?,
            cell_mv: reader.array(CdrReader::u16)?,
        };
        Ok(StateMessage {
            head,
            imu,
            motor,
            battery,
            foot_force: reader.array(CdrReader::i16)?,
            foot_force_estimated: reader.array(CdrReader::i16)?,
            tick: reader.u32()?,
            remote: {
                let at = reader.bytes::<40>()?;
                RemoteRecord::read_from_bytes(&at).expect("40 bytes, of which any value is valid")
            },
            bit_flag: reader.u8()?,
            adc_reel: reader.f32()?,
            board_temperature: reader.array(CdrReader::i8)?,
            power_v: reader.f32()?,
            power_a: reader.f32()?,
            fan_frequency: reader.array(CdrReader::u16)?,
            reserve: reader.u32()?,
        })
    }

    /// Encodes the state with its checksum, for an emulator.
    pub fn encode(&self) -> [u8; STATE_LENGTH] {
        let mut payload = [0; STATE_LENGTH];
        let mut writer = CdrWriter::new(&mut payload);
        self.head.write(&mut writer);
        writer.floats(&self.imu.quaternion);
        writer.floats(&self.imu.gyroscope);
        writer.floats(&self.imu.accelerometer);
        writer.floats(&self.imu.roll_pitch_yaw);
        writer.number(self.imu.temperature.to_le_bytes());
        for motor in &self.motor {
            writer.bytes(&[motor.mode]);
            writer.floats(&[motor.position, motor.velocity, motor.acceleration, motor.torque]);
            writer.floats(&motor.raw);
            writer.number(motor.temperature.to_le_bytes());
            for word in [motor.lost, motor.reserve[0], motor.reserve[1]] {
                writer.number(word.to_le_bytes());
            }
        }
        let battery = &self.battery;
        writer.bytes(&battery.version);
        writer.bytes(&[battery.status, battery.charge]);
        writer.number(battery.current.to_le_bytes());
        writer.number(battery.cycles.to_le_bytes());
        for temperature in battery.cell_temperature.into_iter().chain(battery.controller_temperature) {
            writer.number(temperature.to_le_bytes());
        }
        for voltage in battery.cell_mv {
            writer.number(voltage.to_le_bytes());
        }
        for force in self.foot_force.into_iter().chain(self.foot_force_estimated) {
            writer.number(force.to_le_bytes());
        }
        writer.number(self.tick.to_le_bytes());
        writer.bytes(self.remote.as_bytes());
        writer.bytes(&[self.bit_flag]);
        writer.floats(&[self.adc_reel]);
        for temperature in self.board_temperature {
            writer.number(temperature.to_le_bytes());
        }
        writer.floats(&[self.power_v, self.power_a]);
        for frequency in self.fan_frequency {
            writer.number(frequency.to_le_bytes());
        }
        writer.number(self.reserve.to_le_bytes());
        let length = writer.length();
        let sum = checksum(&payload);
        payload[length..].copy_from_slice(&sum.to_le_bytes());
        payload
    }
}

/// Computes the checksum of a payload.
fn checksum(payload: &[u8; STATE_LENGTH]) -> u32 {
    let mut layout = CLayout::<COVERED>::new();
    layout.put(&payload[..22], 2);
    layout.put(&payload[24..77], 3);
    for motor in 0..MOTORS {
        // The mode byte follows the previous member at once: CDR aligns members, not structures.
        let mode = if motor == 0 { 77 } else { 76 + 48 * motor };
        layout.put(&payload[mode..=mode], 3);
        layout.put(&payload[80 + 48 * motor..109 + 48 * motor], 3);
        layout.put(&payload[112 + 48 * motor..124 + 48 * motor], 0);
    }
    layout.put(&payload[1036..1141], 3);
    layout.put(&payload[1144..1150], 2);
    layout.put(&payload[1152..1172], 0);
    layout.crc()
}
