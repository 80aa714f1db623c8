//! What can be wrong with an emulated robot or its network, said in one line: `loss 5`, `hot FR_calf 82`, `clear`.

use std::str::FromStr;

use crate::robot::{JOINTS, joint_name};

/// One thing that is wrong from now on, or that a person does to the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// Share of datagrams that the network loses, each way, percent.
    Loss(f64),
    /// Time that every datagram is under way, each way, ms.
    Delay(f64),
    /// More of it at random, up to this, ms: datagrams overtake each other.
    Jitter(f64),
    /// Share of datagrams that come twice, percent.
    Duplicate(f64),
    /// Share of datagrams in which a bit is turned over, percent.
    Corrupt(f64),
    /// The robot's computer stands still: nothing is sent, no command is heard; the motors brake after their own time-out.
    Freeze,
    /// The same state is sent again and again.
    Repeat,
    /// The robot restarts; its clock begins anew.
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
    /// A motor leaves servo mode: it brakes and says so.
    ServoOff {
        /// Joint, 0..12.
        joint: usize,
    },
    /// A joint holds the angle that it has, as far as its motor can.
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
    /// An encoder reports an angle that is no number.
    NotANumber {
        /// Joint, 0..12.
        joint: usize,
    },
    /// The inertial unit reports a roll larger by this, rad.
    Tilt(f64),
    /// A person lifts the robot back on its mark, lying on its belly.
    Place,
    /// Everything is well again; the robot lies where it is.
    Clear,
}

/// What an operand is.
#[derive(Clone, Copy)]
enum Operands {
    None(Fault),
    /// A number within these bounds.
    Number(fn(f64) -> Fault, &'static str, f64, f64),
    Joint(fn(usize) -> Fault),
    JointNumber(fn(usize, f64) -> Fault, &'static str, f64, f64),
}

use Operands::{Joint, JointNumber, Number};

/// Every word, its operands, and what it does: read by the parser and by `help`.
const WORDS: [(&str, Operands, &str); 19] = [
    ("loss", Number(Fault::Loss, "PERCENT", 0.0, 100.0), "the network loses this share of the datagrams, each way"),
    ("delay", Number(Fault::Delay, "MS", 0.0, 1000.0), "every datagram is under way for so long, each way"),
    ("jitter", Number(Fault::Jitter, "MS", 0.0, 1000.0), "and up to so much longer, at random"),
    ("duplicate", Number(Fault::Duplicate, "PERCENT", 0.0, 100.0), "this share of the datagrams comes twice"),
    ("corrupt", Number(Fault::Corrupt, "PERCENT", 0.0, 100.0), "in this share of the datagrams one bit is turned over"),
    ("freeze", Operands::None(Fault::Freeze), "the robot's computer stands still: no states, no ear for commands"),
    ("repeat", Operands::None(Fault::Repeat), "the same state is sent again and again"),
    ("reboot", Operands::None(Fault::Reboot), "the robot restarts; its clock begins anew"),
    (
        "hot",
        JointNumber(|joint, celsius| Fault::Hot { joint, celsius }, "CELSIUS", -40.0, 127.0),
        "a motor reports this temperature",
    ),
    ("battery", Number(Fault::Battery, "PERCENT", 0.0, 100.0), "the battery reports this charge"),
    ("servo-off", Joint(|joint| Fault::ServoOff { joint }), "a motor leaves servo mode"),
    ("stuck", Joint(|joint| Fault::Stuck { joint }), "a joint holds the angle that it has"),
    (
        "angle",
        JointNumber(|joint, radians| Fault::Angle { joint, radians }, "RAD", -10.0, 10.0),
        "an encoder reports this angle",
    ),
    (
        "speed",
        JointNumber(|joint, radians_per_s| Fault::Speed { joint, radians_per_s }, "RAD/S", -1000.0, 1000.0),
        "an encoder reports this velocity",
    ),
    (
        "torque",
        JointNumber(|joint, newton_metres| Fault::Torque { joint, newton_metres }, "NM", -120.0, 120.0),
        "a motor reports this torque",
    ),
    ("nan", Joint(|joint| Fault::NotANumber { joint }), "an encoder reports an angle that is no number"),
    ("tilt", Number(Fault::Tilt, "RAD", -3.2, 3.2), "the inertial unit reports so much more roll"),
    ("place", Operands::None(Fault::Place), "a person lifts the robot back on its mark, lying on its belly"),
    ("clear", Operands::None(Fault::Clear), "everything is well again"),
];

/// A line that is no fault: what is wrong with it and what to write.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FaultError {
    /// The first word is none of ours.
    #[error("\"{word}\" is nothing that can be done to the robot; the words are {known}")]
    Unknown {
        /// The word.
        word: String,
        /// The words there are.
        known: String,
    },
    /// Too few or too many operands.
    #[error("write it as: {usage}")]
    Usage {
        /// The word with its operands.
        usage: String,
    },
    /// No such joint.
    #[error("\"{name}\" is no joint; write it as FR_hip, FL_thigh, RL_calf and so on")]
    Joint {
        /// The name.
        name: String,
    },
    /// A number that cannot be.
    #[error("\"{value}\" cannot be: give {lowest} to {highest} ({unit})")]
    Number {
        /// What stands there.
        value: String,
        /// The unit.
        unit: &'static str,
        /// The least that can be given.
        lowest: f64,
        /// The most that can be given.
        highest: f64,
    },
}

impl FromStr for Fault {
    type Err = FaultError;

    fn from_str(line: &str) -> Result<Fault, FaultError> {
        let mut words = line.split_whitespace();
        let word = words.next().unwrap_or_default();
        let Some((word, operands, _)) = WORDS.iter().find(|(known, ..)| *known == word) else {
            let known = WORDS.map(|(known, ..)| known).join(", ");
            return Err(FaultError::Unknown { word: word.to_owned(), known });
        };
        let given: Vec<&str> = words.collect();
        match (*operands, given.as_slice()) {
            (Operands::None(fault), []) => Ok(fault),
            (Number(fault, unit, lowest, highest), [value]) => Ok(fault(number(value, unit, lowest, highest)?)),
            (Joint(fault), [name]) => Ok(fault(joint(name)?)),
            (JointNumber(fault, unit, lowest, highest), [name, value]) => {
                Ok(fault(joint(name)?, number(value, unit, lowest, highest)?))
            }
            _ => Err(FaultError::Usage { usage: usage(word, *operands) }),
        }
    }
}

fn number(value: &str, unit: &'static str, lowest: f64, highest: f64) -> Result<f64, FaultError> {
    match value.parse::<f64>() {
        Ok(number) if (lowest..=highest).contains(&number) => Ok(number),
        _ => Err(FaultError::Number { value: value.to_owned(), unit, lowest, highest }),
    }
}

fn joint(name: &str) -> Result<usize, FaultError> {
    let found = (0..JOINTS).find(|&joint| joint_name(joint).eq_ignore_ascii_case(name));
    found.ok_or_else(|| FaultError::Joint { name: name.to_owned() })
}

fn usage(word: &str, operands: Operands) -> String {
    match operands {
        Operands::None(_) => word.to_owned(),
        Number(_, unit, ..) => format!("{word} {unit}"),
        Joint(_) => format!("{word} JOINT"),
        JointNumber(_, unit, ..) => format!("{word} JOINT {unit}"),
    }
}

/// What can be written, one line each.
pub fn help() -> String {
    let line = |(word, operands, what): &(&str, Operands, &str)| format!("  {:<20} {what}\n", usage(word, *operands));
    WORDS.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_is_read_as_help_writes_it() {
        for (word, operands, _) in &WORDS {
            let line = usage(word, *operands).replace("JOINT", "RL_thigh");
            let value = |unit: &str| line.replace(unit, "3");
            let parsed = match operands {
                Number(_, unit, ..) | JointNumber(_, unit, ..) => value(unit).parse::<Fault>(),
                Operands::None(_) | Joint(_) => line.parse(),
            };
            assert!(parsed.is_ok(), "{line}: {parsed:?}");
            assert!(help().contains(&usage(word, *operands)));
        }
        assert_eq!("hot fr_CALF 82".parse(), Ok(Fault::Hot { joint: 2, celsius: 82.0 }));
    }

    #[test]
    fn what_cannot_be_is_refused_with_what_can() {
        let said = |line: &str| line.parse::<Fault>().unwrap_err().to_string();
        assert!(said("los 5").contains("\"los\"") && said("los 5").contains("loss"));
        assert_eq!(said("loss"), "write it as: loss PERCENT");
        assert_eq!(said("hot FR_calf"), "write it as: hot JOINT CELSIUS");
        assert!(said("loss 101").contains("give 0 to 100 (PERCENT)"));
        assert!(said("loss nan").contains("nan"));
        assert!(said("stuck FR_knee").contains("FR_hip"));
        assert!(said("clear now").contains("write it as: clear"));
        assert!(said("").contains("the words are"));
    }
}
