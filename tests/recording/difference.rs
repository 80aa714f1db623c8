//! The first difference of two ticks.

use quadfrog::recording::difference::{FieldDifference, difference};
use quadfrog::telemetry::Tick;

#[test]
fn the_first_differing_bit_is_named() {
    let tick = Tick::default();
    assert_eq!(difference(&tick, &Tick { number: 7, time_ns: 9, ..tick }), None);
    let mut other = tick;
    other.command.motor[3].kp_joint = 1.0 + f64::from(f32::EPSILON);
    let found = difference(&tick, &other).unwrap();
    assert_eq!((found.field.as_str(), found.values[1].as_str()), ("command.kp[3]", "1.0000001192092896"));
    let mut other = tick;
    other.estimate.roll_pitch_yaw.x = -0.0;
    let found = difference(&tick, &other).unwrap();
    assert_eq!(found, FieldDifference { field: "tick.roll".into(), values: ["0.0".into(), "-0.0".into()] });
    let [mut one, mut other] = [tick; 2];
    one.theta_rad = f64::NAN;
    other.theta_rad = -f64::NAN;
    assert!(difference(&one, &other).is_some());
}
