//! Placement of the swing feet by the trunk's velocity (Raibert, Legged Robots That Balance, 1986, chapter 2).

use nalgebra::Vector3;

use crate::robot::ticks_in;
use crate::robot::{LEGS, PerLeg};

/// Shortest absence of all feet that counts as a flight, s; a foot may lift for a moment in stance.
pub const SHORTEST_FLIGHT_S: f64 = 0.02;

/// Largest component of the velocity that shifts a foot, m/s: faster than a jump, so that a wrong estimate moves no foot further.
const MOST_M_S: f64 = 3.0;

/// The legs in swing: all of them in flight, and those in landing whose feet have not touched down yet.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SwingLegs {
    /// Ticks without any foot on the ground.
    airborne: u32,
    /// In swing, leg by leg.
    swing: PerLeg<bool>,
}

impl SwingLegs {
    /// Records the contacts of one tick. Called once per tick.
    pub fn update(&mut self, contact: &PerLeg<bool>) {
        let airborne = contact.iter().all(|&down| !down);
        self.airborne = if airborne { self.airborne + 1 } else { 0 };
        if self.airborne >= ticks_in(SHORTEST_FLIGHT_S) {
            self.swing = [true; LEGS];
        }
        for (swing, &down) in self.swing.iter_mut().zip(contact) {
            *swing &= !down;
        }
    }

    /// Returns whether each leg is in swing.
    pub fn legs(&self) -> &PerLeg<bool> {
        &self.swing
    }

    /// Ticks without any foot on the ground, the newest one included.
    pub fn airborne_ticks(&self) -> u32 {
        self.airborne
    }

    /// Shift of each leg's nominal foot position, leg frame, m: T v.xy for legs in swing, with T = `foot_placement_s` and the
    /// trunk's velocity v in body axes, each component at most 3 m/s. Zero for the others.
    pub fn offsets_leg(&self, foot_placement_s: f64, velocity_body: &Vector3<f64>) -> PerLeg<Vector3<f64>> {
        let velocity = velocity_body.map(|component| component.clamp(-MOST_M_S, MOST_M_S));
        let offset = Vector3::new(foot_placement_s * velocity.x, foot_placement_s * velocity.y, 0.0);
        self.swing.map(|swing| if swing && foot_placement_s != 0.0 { offset } else { Vector3::zeros() })
    }
}
