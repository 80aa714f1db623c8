//! The leg controller: sum of force profile, impedance and Virtual Model Control (paper, equation 8).

use nalgebra::Vector3;

use super::vmc::VmcGains;
use super::{force_profile, impedance, vmc};
use crate::robot::kinematics::{FootPosition, LegGeometry};
use crate::robot::{Joints, Leg, PerLeg, leg_of};
use crate::telemetry::Estimate;
use crate::trial::Gains;

/// Target of the legs in one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegTarget {
    /// Gains.
    pub gains: Gains,
    /// Nominal foot position of a left leg, leg frame, m; y is mirrored for right legs.
    pub stance_leg: Vector3<f64>,
    /// Whether Virtual Model Control acts.
    pub vmc: bool,
    /// Damping of Virtual Model Control, N s/m; acts only where `vmc` does.
    pub attitude_rate_gain: f64,
    /// Shift of each leg's nominal foot position, leg frame, m.
    pub foot_offset_leg: PerLeg<Vector3<f64>>,
    /// Signed force amplitudes per leg, leg frame, N; zero outside an impulse and for a foot that is cut off.
    pub amplitudes_leg: PerLeg<Vector3<f64>>,
    /// Phase of the oscillator, rad.
    pub theta_rad: f64,
}

/// Foot positions and Jacobians of all legs at the joint angles, rad.
pub fn feet(geometry: &LegGeometry, joint_position: &Joints) -> PerLeg<FootPosition> {
    Leg::ALL.map(|leg| geometry.foot(&leg_of(joint_position, leg as usize), leg.left_sign()))
}

/// Joint torques before the actuators' limits, N m: tau_i = tau_f,i + tau_imp,i + tau_VMC,i.
pub fn torques(
    target: &LegTarget,
    feet: &PerLeg<FootPosition>,
    joint_velocity: &Joints,
    estimate: &Estimate,
) -> Joints {
    let vmc_gains = if target.vmc {
        VmcGains { attitude: target.gains.k_att, attitude_rate: target.attitude_rate_gain }
    } else {
        VmcGains { attitude: 0.0, attitude_rate: 0.0 }
    };
    let vmc_z =
        vmc::forces_leg_z(vmc_gains, &estimate.world_from_body, &estimate.angular_velocity_body, &estimate.contact);
    let mut torques = Joints::default();
    for leg in Leg::ALL {
        let i = leg as usize;
        let dq = leg_of(joint_velocity, i);
        let desired = leg.mirrored(&target.stance_leg) + target.foot_offset_leg[i];
        let mut force = impedance::force_leg(&target.gains, &desired, &feet[i], &dq);
        force += force_profile::force_leg(&target.amplitudes_leg[i], target.theta_rad);
        force.z += vmc_z[i];
        let torque = impedance::torque(&target.gains, &feet[i], &force, &dq);
        torques[3 * i..3 * i + 3].copy_from_slice(torque.as_slice());
    }
    torques
}
