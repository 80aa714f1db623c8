//! Comparison within the precision of recorded ticks.

use serde_json::Value;

/// Largest error of a measured value that follows from the single precision of recorded ticks.
pub const PRECISION: f64 = 1e-6;

/// Asserts that two values of JSON are the same but for the precision of recorded ticks.
pub fn assert_same(found: &Value, expected: &Value, at: &str) {
    match (found, expected) {
        (Value::Object(found), Value::Object(expected)) => {
            assert!(found.keys().eq(expected.keys()), "{at}");
            found.iter().for_each(|(key, value)| assert_same(value, &expected[key], &format!("{at}.{key}")));
        }
        (Value::Array(found), Value::Array(expected)) => {
            assert_eq!(found.len(), expected.len(), "{at}");
            found.iter().zip(expected).for_each(|(found, expected)| assert_same(found, expected, at));
        }
        (Value::Number(number), Value::Number(other)) => {
            let difference = number.as_f64().unwrap() - other.as_f64().unwrap();
            assert!(difference.abs() <= PRECISION, "{at}: {found}, not {expected}");
        }
        _ => assert_eq!(found, expected, "{at}"),
    }
}
