//! Faults of an emulated robot or its network, each written as one line: `loss 5`, `hot FR_calf 82`, `clear`.

use std::str::FromStr;

use crate::robot::{JOINTS, joint_name};

/// A fault from now on, or an action of a person on the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
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
    Hot {
        /// Joint, 0..12.
        joint: usize,
        /// Temperature, degrees Celsius.
        celsius: f64,
    },
    /// The battery reports this charge, percent.
    Battery(f64),
    /// A motor leaves servo mode: it brakes and reports the mode.
    ServoOff {
        /// Joint, 0..12.
        joint: usize,
    },
    /// A joint is stuck at its current angle, up to its motor's torque.
    Stuck {
        /// Joint, 0..12.
        joint: usize,
    },
    /// An encoder reports this angle, rad.
    Angle {
        /// Joint, 0..12.
        joint: usize,
        /// Angle, rad.
        radians: f64,
    },
    /// An encoder reports this velocity, rad/s.
    Speed {
        /// Joint, 0..12.
        joint: usize,
        /// Velocity, rad/s.
        radians_per_s: f64,
    },
    /// A motor reports this torque, N m.
    Torque {
        /// Joint, 0..12.
        joint: usize,
        /// Torque, N m.
        newton_metres: f64,
    },
    /// An encoder reports NaN as its angle.
    NotANumber {
        /// Joint, 0..12.
        joint: usize,
    },
    /// Error of the reported roll, rad.
    Tilt(f64),
    /// A person lays the robot down at its start position, on its belly.
    Place,
    /// All faults end; the robot stays where it is.
    Clear,
}

/// Operands of a fault.
#[derive(Clone, Copy)]
enum FaultOperands {
    None(EmulatorFault),
    /// A number with its unit, lowest and highest value.
    Number(fn(f64) -> EmulatorFault, &'static str, f64, f64),
    Joint(fn(usize) -> EmulatorFault),
    JointNumber(fn(usize, f64) -> EmulatorFault, &'static str, f64, f64),
}

use FaultOperands::{Joint, JointNumber, Number};

/// Name, operands and description of every fault, for the parser and `help`.
const FAULTS: [(&str, FaultOperands, &str); 19] = [
    (
        "loss",
        Number(EmulatorFault::Loss, "PERCENT", 0.0, 100.0),
        "the network loses this share of the datagrams, each way",
    ),
    ("delay", Number(EmulatorFault::Delay, "MS", 0.0, 1000.0), "every datagram is delayed by this time, each way"),
    ("jitter", Number(EmulatorFault::Jitter, "MS", 0.0, 1000.0), "largest random addition to the delay"),
    ("duplicate", Number(EmulatorFault::Duplicate, "PERCENT", 0.0, 100.0), "this share of the datagrams is duplicated"),
    (
        "corrupt",
        Number(EmulatorFault::Corrupt, "PERCENT", 0.0, 100.0),
        "one bit is flipped in this share of the datagrams",
    ),
    (
        "freeze",
        FaultOperands::None(EmulatorFault::Freeze),
        "the robot's computer stops: no states, no commands executed",
    ),
    ("repeat", FaultOperands::None(EmulatorFault::Repeat), "the same state is sent repeatedly"),
    ("reboot", FaultOperands::None(EmulatorFault::Reboot), "the robot reboots; its clock restarts"),
    (
        "hot",
        JointNumber(|joint, celsius| EmulatorFault::Hot { joint, celsius }, "CELSIUS", -40.0, 127.0),
        "a motor reports this temperature",
    ),
    ("battery", Number(EmulatorFault::Battery, "PERCENT", 0.0, 100.0), "the battery reports this charge"),
    ("servo-off", Joint(|joint| EmulatorFault::ServoOff { joint }), "a motor leaves servo mode"),
    ("stuck", Joint(|joint| EmulatorFault::Stuck { joint }), "a joint is stuck at its current angle"),
    (
        "angle",
        JointNumber(|joint, radians| EmulatorFault::Angle { joint, radians }, "RAD", -10.0, 10.0),
        "an encoder reports this angle",
    ),
    (
        "speed",
        JointNumber(|joint, radians_per_s| EmulatorFault::Speed { joint, radians_per_s }, "RAD/S", -1000.0, 1000.0),
        "an encoder reports this velocity",
    ),
    (
        "torque",
        JointNumber(|joint, newton_metres| EmulatorFault::Torque { joint, newton_metres }, "NM", -120.0, 120.0),
        "a motor reports this torque",
    ),
    ("nan", Joint(|joint| EmulatorFault::NotANumber { joint }), "an encoder reports NaN as its angle"),
    ("tilt", Number(EmulatorFault::Tilt, "RAD", -3.2, 3.2), "error of the reported roll"),
    (
        "place",
        FaultOperands::None(EmulatorFault::Place),
        "a person lays the robot down at its start position, on its belly",
    ),
    ("clear", FaultOperands::None(EmulatorFault::Clear), "all faults end"),
];

/// Error of parsing a fault.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EmulatorFaultError {
    /// Unknown name.
    #[error("\"{word}\" is not a known fault; known faults: {known}")]
    Unknown {
        /// The given name.
        word: String,
        /// All names.
        known: String,
    },
    /// Wrong number of operands.
    #[error("write it as: {usage}")]
    Usage {
        /// The name with its operands.
        usage: String,
    },
    /// Unknown joint.
    #[error("\"{name}\" is not a joint; write it as FR_hip, FL_thigh, RL_calf and so on")]
    Joint {
        /// The name.
        name: String,
    },
    /// Not a number within the bounds.
    #[error("\"{value}\" is out of range: give {lowest} to {highest} ({unit})")]
    Number {
        /// The given text.
        value: String,
        /// The unit.
        unit: &'static str,
        /// Lowest value.
        lowest: f64,
        /// Highest value.
        highest: f64,
    },
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
            (FaultOperands::None(fault), []) => Ok(fault),
            (Number(fault, unit, lowest, highest), [value]) => Ok(fault(number(value, unit, lowest, highest)?)),
            (Joint(fault), [name]) => Ok(fault(joint(name)?)),
            (JointNumber(fault, unit, lowest, highest), [name, value]) => {
                Ok(fault(joint(name)?, number(value, unit, lowest, highest)?))
            }
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
        FaultOperands::None(_) => word.to_owned(),
        Number(_, unit, ..) => format!("{word} {unit}"),
        Joint(_) => format!("{word} JOINT"),
        JointNumber(_, unit, ..) => format!("{word} JOINT {unit}"),
    }
}

/// Describes all faults, one line each.
pub fn help() -> String {
    let line =
        |(word, operands, what): &(&str, FaultOperands, &str)| format!("  {:<20} {what}\n", usage(word, *operands));
    FAULTS.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_parsed_as_help_writes_it() {
        for (word, operands, _) in &FAULTS {
            let line = usage(word, *operands).replace("JOINT", "RL_thigh");
            let value = |unit: &str| line.replace(unit, "3");
            let parsed = match operands {
                Number(_, unit, ..) | JointNumber(_, unit, ..) => value(unit).parse::<EmulatorFault>(),
                FaultOperands::None(_) | Joint(_) => line.parse(),
            };
            assert!(parsed.is_ok(), "{line}: {parsed:?}");
            assert!(help().contains(&usage(word, *operands)));
        }
        assert_eq!("hot fr_CALF 82".parse(), Ok(EmulatorFault::Hot { joint: 2, celsius: 82.0 }));
    }

    #[test]
    fn an_invalid_fault_is_refused_with_the_valid_form() {
        let message = |line: &str| line.parse::<EmulatorFault>().unwrap_err().to_string();
        assert!(message("los 5").contains("\"los\"") && message("los 5").contains("loss"));
        assert_eq!(message("loss"), "write it as: loss PERCENT");
        assert_eq!(message("hot FR_calf"), "write it as: hot JOINT CELSIUS");
        assert!(message("loss 101").contains("give 0 to 100 (PERCENT)"));
        assert!(message("loss nan").contains("nan"));
        assert!(message("stuck FR_knee").contains("FR_hip"));
        assert!(message("clear now").contains("write it as: clear"));
        assert!(message("").contains("known faults"));
    }
}
