//! Virtual Model Control: springs between a plane through the trunk and the horizontal (paper, section II-C).

use nalgebra::{UnitQuaternion, Vector3};

use crate::robot::{Leg, PerLeg};

/// The vertical force of the virtual spring at each leg, leg frame z, N, "force of the foot" convention:
/// F_VMC = [0, 0, k_att (R c_i).z] with the corners c_i = (+-1, +-1, 0) of the plane, columns FR, FL, RR, RL.
/// It applies to legs in contact only.
pub fn forces_leg_z(k_att: f64, world_from_body: &UnitQuaternion<f64>, contact: &PerLeg<bool>) -> PerLeg<f64> {
    Leg::ALL.map(|leg| {
        if !contact[leg as usize] {
            return 0.0;
        }
        let corner_body = Vector3::new(leg.end(), leg.side(), 0.0);
        k_att * (world_from_body * corner_body).z
    })
}
