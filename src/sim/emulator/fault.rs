//! Faults of an emulated robot or its network, each written as one line: `loss 5`, `hot FR_calf 82`, `clear`.

use std::str::FromStr;

use crate::robot::remote::RemoteButtons;
use crate::robot::{JOINTS, joint_name};

/// A fault from now on, or an action of a person on the robot. A joint is an index, 0..12.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the doc of the variant describes its fields")]
pub enum EmulatorFault {
    /// Share of datagrams lost, each way, percent.
    Loss(f64),
    /// Delay of every datagram, each way, ms.
    Delay(f64),
    /// Largest random addition to the delay, ms: datagrams overtake each other.
    Jitter(f64),
    /// Share of datagrams duplicated, percent.
    Duplicate(f64),
    /// Share of datagrams with one flipped bit, percent.
    Corrupt(f64),
    /// The robot's computer stops: no states are sent, no commands executed; the motors brake after their time-out.
    Freeze,
    /// The same state is sent repeatedly.
    Repeat,
    /// The robot reboots; its clock restarts.
    Reboot,
    /// A motor reports this temperature, degrees Celsius.
    Hot { joint: usize, celsius: f64 },
    /// The battery reports this charge, percent; above 100 it reports none.
    Battery(f64),
    /// A motor leaves servo mode: it brakes and reports the mode.
    ServoOff { joint: usize },
    /// A joint is stuck at its current angle, up to its motor's torque.
    Stuck { joint: usize },
    /// An encoder reports this angle, rad.
    Angle { joint: usize, radians: f64 },
    /// An encoder reports this velocity, rad/s.
    Speed { joint: usize, radians_per_s: f64 },
    /// A motor reports this torque, N m.
    Torque { joint: usize, newton_metres: f64 },
    /// An encoder reports NaN as its angle.
    NotANumber { joint: usize },
    /// Error of the reported roll, rad.
    Tilt(f64),
    /// A person lays the robot down at its start position, on its belly.
    Place,
    /// All faults end; the robot stays where it is.
    Clear,
    /// Delay of the commands alone, ms.
    CommandDelay(f64),
    /// Delay of the states alone, ms.
    StateDelay(f64),
    /// The inertial unit repeats its last measurement.
    ImuFreeze,
    /// A motor repeats its last angle, velocity and torque.
    MotorFreeze { joint: usize },
    /// The reported orientation has the wrong sign of roll.
    FlipRoll,
    /// The reported orientation has the wrong sign of pitch.
    FlipPitch,
    /// Every foot sensor reports this force, N.
    Feet(f64),
    /// Step of the robot's clock, ms.
    ClockStep(f64),
    /// Error of the rate of the robot's clock, ms per second.
    ClockDrift(f64),
    /// A second program damps the robot in this share of the milliseconds, percent, and receives the states of these
    /// milliseconds.
    Commander(f64),
    /// The same, on a robot that sends all states to the first program.
    HiddenCommander(f64),
    /// Buttons that a person holds on the remote control.
    Remote(RemoteButtons),
    /// The remote control is switched off: its bytes are zero.
    RemoteOff,
}

/// Operands of a fault.
#[derive(Clone, Copy)]
enum FaultOperands {
    Plain(EmulatorFault),
    /// A number with its unit, lowest and highest value.
    Number(fn(f64) -> EmulatorFault, &'static str, f64, f64),
    Joint(fn(usize) -> EmulatorFault),
    JointNumber(fn(usize, f64) -> EmulatorFault, &'static str, f64, f64),
    Buttons(fn(RemoteButtons) -> EmulatorFault),
}

use FaultOperands::{Buttons, Joint, JointNumber, Number, Plain};

/// Name, operands and description of every fault, for the parser and `help`.
const FAULTS: [(&str, FaultOperands, &str); 32] = {
    use EmulatorFault::*;
    [
        ("loss", Number(Loss, "PERCENT", 0.0, 100.0), "the network loses this share of the datagrams, each way"),
        ("delay", Number(Delay, "MS", 0.0, 1000.0), "every datagram is delayed by this time, each way"),
        ("jitter", Number(Jitter, "MS", 0.0, 1000.0), "largest random addition to the delay"),
        ("duplicate", Number(Duplicate, "PERCENT", 0.0, 100.0), "this share of the datagrams is duplicated"),
        ("corrupt", Number(Corrupt, "PERCENT", 0.0, 100.0), "one bit is flipped in this share of the datagrams"),
        ("freeze", Plain(Freeze), "the robot's computer stops: no states, no commands executed"),
        ("repeat", Plain(Repeat), "the same state is sent repeatedly"),
        ("reboot", Plain(Reboot), "the robot reboots; its clock restarts"),
        (
            "hot",
            JointNumber(|joint, celsius| Hot { joint, celsius }, "CELSIUS", -40.0, 127.0),
            "a motor reports this temperature",
        ),
        ("battery", Number(Battery, "PERCENT", 0.0, 255.0), "the battery reports this charge; 255: not available"),
        ("servo-off", Joint(|joint| ServoOff { joint }), "a motor leaves servo mode"),
        ("stuck", Joint(|joint| Stuck { joint }), "a joint is stuck at its current angle"),
        (
            "angle",
            JointNumber(|joint, radians| Angle { joint, radians }, "RAD", -10.0, 10.0),
            "an encoder reports this angle",
        ),
        (
            "speed",
            JointNumber(|joint, radians_per_s| Speed { joint, radians_per_s }, "RAD/S", -1000.0, 1000.0),
            "an encoder reports this velocity",
        ),
        (
            "torque",
            JointNumber(|joint, newton_metres| Torque { joint, newton_metres }, "NM", -120.0, 120.0),
            "a motor reports this torque",
        ),
        ("nan", Joint(|joint| NotANumber { joint }), "an encoder reports NaN as its angle"),
        ("tilt", Number(Tilt, "RAD", -3.2, 3.2), "error of the reported roll"),
        ("delay-commands", Number(CommandDelay, "MS", 0.0, 1000.0), "only commands are delayed by this time"),
        ("delay-states", Number(StateDelay, "MS", 0.0, 1000.0), "only states are delayed by this time"),
        ("imu-freeze", Plain(ImuFreeze), "the inertial unit repeats its last measurement"),
        ("motor-freeze", Joint(|joint| MotorFreeze { joint }), "a motor repeats its last angle, velocity and torque"),
        ("flip-roll", Plain(FlipRoll), "the reported orientation has the wrong sign of roll"),
        ("flip-pitch", Plain(FlipPitch), "the reported orientation has the wrong sign of pitch"),
        ("feet", Number(Feet, "N", 0.0, 500.0), "every foot sensor reports this force; 0: stuck up, 33: stuck down"),
        ("clock-step", Number(ClockStep, "MS", -1e6, 1e6), "the robot's clock steps by this time"),
        ("clock-drift", Number(ClockDrift, "MS/S", -500.0, 500.0), "the robot's clock gains this time"),
        (
            "commander",
            Number(Commander, "PERCENT", 0.0, 100.0),
            "a second program damps the robot in this share of the milliseconds and receives their states",
        ),
        (
            "hidden-commander",
            Number(HiddenCommander, "PERCENT", 0.0, 100.0),
            "the same; the robot sends all states to the first program",
        ),
        ("remote", Buttons(Remote), "a person holds these buttons of the remote, for example L2+B; none: released"),
        ("remote-off", Plain(RemoteOff), "the remote control is switched off"),
        ("place", Plain(Place), "a person lays the robot down at its start position, on its belly"),
        ("clear", Plain(Clear), "all faults end"),
    ]
};

/// Error of parsing a fault.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum EmulatorFaultError {
    #[error("\"{word}\" is not a known fault; known faults: {known}")]
    Unknown { word: String, known: String },
    #[error("write it as: {usage}")]
    Usage { usage: String },
    #[error("\"{name}\" is not a joint; write it as FR_hip, FL_thigh, RL_calf and so on")]
    Joint { name: String },
    #[error("\"{value}\" is out of range: give {lowest} to {highest} ({unit})")]
    Number { value: String, unit: &'static str, lowest: f64, highest: f64 },
    #[error("{0}")]
    Buttons(String),
}

impl FromStr for EmulatorFault {
    type Err = EmulatorFaultError;

    fn from_str(line: &str) -> Result<EmulatorFault, EmulatorFaultError> {
        let mut words = line.split_whitespace();
        let word = words.next().unwrap_or_default();
        let Some((word, operands, _)) = FAULTS.iter().find(|(known, ..)| *known == word) else {
            let known = FAULTS.map(|(known, ..)| known).join(", ");
            return Err(EmulatorFaultError::Unknown { word: word.to_owned(), known });
        };
        let given: Vec<&str> = words.collect();
        match (*operands, given.as_slice()) {
            (Plain(fault), []) => Ok(fault),
            (Number(fault, unit, lowest, highest), [value]) => Ok(fault(number(value, unit, lowest, highest)?)),
            (Joint(fault), [name]) => Ok(fault(joint(name)?)),
            (JointNumber(fault, unit, lowest, highest), [name, value]) => {
                Ok(fault(joint(name)?, number(value, unit, lowest, highest)?))
            }
            (Buttons(fault), [names]) => names.parse().map(fault).map_err(EmulatorFaultError::Buttons),
            _ => Err(EmulatorFaultError::Usage { usage: usage(word, *operands) }),
        }
    }
}

fn number(value: &str, unit: &'static str, lowest: f64, highest: f64) -> Result<f64, EmulatorFaultError> {
    match value.parse::<f64>() {
        Ok(number) if (lowest..=highest).contains(&number) => Ok(number),
        _ => Err(EmulatorFaultError::Number { value: value.to_owned(), unit, lowest, highest }),
    }
}

fn joint(name: &str) -> Result<usize, EmulatorFaultError> {
    let found = (0..JOINTS).find(|&joint| joint_name(joint).eq_ignore_ascii_case(name));
    found.ok_or_else(|| EmulatorFaultError::Joint { name: name.to_owned() })
}

fn usage(word: &str, operands: FaultOperands) -> String {
    match operands {
        Plain(_) => word.to_owned(),
        Number(_, unit, ..) => format!("{word} {unit}"),
        Joint(_) => format!("{word} JOINT"),
        JointNumber(_, unit, ..) => format!("{word} JOINT {unit}"),
        Buttons(_) => format!("{word} BUTTONS"),
    }
}

/// Describes all faults, one line each.
pub fn help() -> String {
    let line =
        |(word, operands, what): &(&str, FaultOperands, &str)| format!("  {:<26} {what}\n", usage(word, *operands));
    FAULTS.iter().map(line).collect()
}
