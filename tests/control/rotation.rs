//! The project's rotations beside those of nalgebra.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use proptest::prelude::*;
use quadfrog::robot::rotation::{
    about_z, angle_between, from_roll_pitch_yaw, from_scaled_axis, roll_pitch_yaw, scaled_axis,
};

fn vector(most: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-most..most).prop_map(Vector3::from)
}

proptest! {
    #[test]
    fn rotations_are_those_of_nalgebra(axis in vector(4.0), small in vector(1e-9), a in vector(1.0), b in vector(1.0)) {
        for axis in [axis, small, Vector3::zeros()] {
            let theirs = UnitQuaternion::from_scaled_axis(axis);
            prop_assert!((from_scaled_axis(axis).coords - theirs.coords).norm() < 1e-15);
            prop_assert!((scaled_axis(&theirs) - theirs.scaled_axis()).norm() < 1e-14);
            let ((r, p, y), (roll, pitch, yaw)) = (theirs.euler_angles(), roll_pitch_yaw(&theirs));
            let away = Vector3::new(r - roll, p - pitch, y - yaw).map(|turn| turn.sin().abs() + 1.0 - turn.cos());
            // Near the nose upright, roll and yaw are known by their sum alone.
            prop_assert!(away.norm() * pitch.cos() < 1e-7, "{away}");
            let back = from_roll_pitch_yaw(roll, pitch, yaw).to_rotation_matrix();
            prop_assert!((back.matrix() - theirs.to_rotation_matrix().matrix()).norm() < 1e-7);
            let z = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), axis.x).to_rotation_matrix();
            prop_assert!((about_z(axis.x).matrix() - z.matrix()).norm() < 1e-15);
        }
        prop_assert!((angle_between(&a, &b) - a.angle(&b)).abs() < 1e-7);
    }
}

#[test]
fn upright_on_the_nose_the_yaw_is_zero() {
    for sign in [1.0, -1.0] {
        let half = 0.5_f64.sqrt();
        let upright = UnitQuaternion::new_unchecked(Quaternion::new(half, 0.0, sign * half, 0.0));
        assert_eq!(roll_pitch_yaw(&upright), (0.0, sign * std::f64::consts::FRAC_PI_2, 0.0));
    }
}
