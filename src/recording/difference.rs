//! First difference of two ticks, bit by bit, with the name of the field.

use prost::Message;
use serde_json::Value;

use super::tick;
use crate::telemetry::{Tick, TickDurations};

/// A field in which two ticks differ.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldDifference {
    /// Name in `proto/frog.proto`, for example `tick.roll` or `command.kp[3]`.
    pub field: String,
    /// Values of the first and of the second tick as text.
    pub values: [String; 2],
}

/// Returns the first field in which the ticks differ in a bit. Number, time and the durations of the stages are left out: they
/// depend on the clock, not on the robot.
pub fn difference(first: &Tick, second: &Tick) -> Option<FieldDifference> {
    let [first, second] = [first, second]
        .map(|tick| tick::whole(&Tick { number: 0, time_ns: 0, stages: TickDurations::default(), ..*tick }));
    if first.encode_to_vec() == second.encode_to_vec() {
        return None;
    }
    let [mut one, mut other] = [Vec::new(), Vec::new()];
    flatten("", &serde_json::to_value(&first).unwrap_or_default(), &mut one);
    flatten("", &serde_json::to_value(&second).unwrap_or_default(), &mut other);
    let unequal = one.into_iter().zip(other).find(|(one, other)| one != other);
    Some(unequal.map_or_else(
        // JSON has one word for all that are no numbers.
        || FieldDifference { field: "a field that is not a number".to_owned(), values: Default::default() },
        |((field, one), (_, other))| FieldDifference { field, values: [one, other] },
    ))
}

fn flatten(path: &str, value: &Value, found: &mut Vec<(String, String)>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let dot = if path.is_empty() { "" } else { "." };
                flatten(&format!("{path}{dot}{name}"), value, found);
            }
        }
        Value::Array(values) => {
            for (index, value) in values.iter().enumerate() {
                flatten(&format!("{path}[{index}]"), value, found);
            }
        }
        value => found.push((path.to_owned(), value.to_string())),
    }
}
