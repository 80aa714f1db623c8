//! Rotations with the same bits on every machine: functions of the C library, which nalgebra calls, take fused instructions where the
//! processor has them.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

/// Returns the rotation by the length of `vector` (rad) about its direction.
pub fn from_scaled_axis(vector: Vector3<f64>) -> UnitQuaternion<f64> {
    let half = vector * 0.5;
    let length = half.norm();
    if length <= f64::EPSILON {
        return UnitQuaternion::identity();
    }
    let (sin, cos) = libm::sincos(length);
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, half * (sin / length)))
}

/// Returns the rotation by `roll` about x, then `pitch` about y, then `yaw` about z of the fixed frame, rad.
pub fn from_roll_pitch_yaw(roll: f64, pitch: f64, yaw: f64) -> UnitQuaternion<f64> {
    let about = |axis: Vector3<f64>, angle: f64| from_scaled_axis(axis * angle);
    about(Vector3::z(), yaw) * about(Vector3::y(), pitch) * about(Vector3::x(), roll)
}

/// Returns the axis of a rotation times its angle of at most pi, rad.
pub fn scaled_axis(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let vector = rotation.imag();
    let length = vector.norm();
    if length <= f64::EPSILON {
        return Vector3::zeros();
    }
    let half_angle = libm::atan2(length, rotation.w.abs());
    vector * (2.0 * half_angle / length).copysign(rotation.w)
}

/// Returns the rotation about z by `angle`, rad.
pub fn about_z(angle: f64) -> Rotation3<f64> {
    let (sin, cos) = libm::sincos(angle);
    Rotation3::from_matrix_unchecked(Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0))
}

/// Returns roll, pitch and yaw, rad: turns about x, y and z of the fixed frame, in this order. Upright or upside down on the nose the
/// yaw is 0.
pub fn roll_pitch_yaw(rotation: &UnitQuaternion<f64>) -> (f64, f64, f64) {
    let m = rotation.to_rotation_matrix();
    let down = m[(2, 0)];
    if down.abs() < 1.0 {
        (libm::atan2(m[(2, 1)], m[(2, 2)]), -libm::asin(down), libm::atan2(m[(1, 0)], m[(0, 0)]))
    } else {
        let up = -down.signum();
        (libm::atan2(up * m[(0, 1)], up * m[(0, 2)]), up * std::f64::consts::FRAC_PI_2, 0.0)
    }
}

/// Returns the angle between two vectors, rad; 0 if one of them is zero.
pub fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b))
}
