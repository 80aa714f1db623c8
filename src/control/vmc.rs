//! Virtual Model Control: springs and dampers between a plane through the trunk and the horizontal (paper, equations 5 to 7).

use nalgebra::{UnitQuaternion, Vector3};

use crate::robot::{Leg, PerLeg};

/// Gains of the virtual springs and dampers at the corners of the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VmcGains {
    /// Stiffness k_att, N/m.
    pub attitude: f64,
    /// Damping k_rate, N s/m; zero in the paper.
    pub attitude_rate: f64,
}

/// The vertical force of the virtual spring and damper at each leg, leg frame z, N, "force of the foot" convention:
/// F_VMC = [0, 0, k_att (R c_i).z + k_rate (omega x c_i).z] with the corners c_i = (+-1, +-1, 0) of the plane, columns FR, FL,
/// RR, RL; omega in body axes, rad/s. Zero for legs without contact.
pub fn forces_leg_z(
    gains: VmcGains,
    world_from_body: &UnitQuaternion<f64>,
    angular_velocity_body: &Vector3<f64>,
    contact: &PerLeg<bool>,
) -> PerLeg<f64> {
    Leg::ALL.map(|leg| {
        if !contact[leg as usize] {
            return 0.0;
        }
        let corner_body = Vector3::new(leg.front_sign(), leg.left_sign(), 0.0);
        let spring = gains.attitude * (world_from_body * corner_body).z;
        // Without the damper the sum is the spring's force to the last bit.
        if gains.attitude_rate == 0.0 {
            return spring;
        }
        spring + gains.attitude_rate * angular_velocity_body.cross(&corner_body).z
    })
}
