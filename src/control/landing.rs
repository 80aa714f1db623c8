//! Landing controller: the profile force of a foot ends with its contact, and the feet land apart (`docs/method.md`, "Added
//! terms").

use std::f64::consts::PI;

use nalgebra::Vector3;

use crate::robot::{CONTROL_PERIOD_S, Leg, PerLeg, ticks_in};
use crate::telemetry::{Cutoff, LandingTerms};

/// Phase above which the loss of a foot's contact ends its profile force, rad: the force is then beyond 0.71 of its amplitude,
/// and a foot that is still to press down at the begin of the impulse is not cut off.
const CUTOFF_PHASE_RAD: f64 = 1.25 * PI;

/// Times of contact of the legs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LandingLegs {
    /// Ticks in a row without contact.
    lost: PerLeg<u32>,
    /// Ticks since the leg was last in swing; 0 in swing, none before the first flight.
    landed: PerLeg<Option<u32>>,
}

impl LandingLegs {
    /// Records the contacts of one tick and the legs in swing. Called once per tick.
    pub fn update(&mut self, contact: &PerLeg<bool>, swing: &PerLeg<bool>) {
        for i in 0..contact.len() {
            self.lost[i] = if contact[i] { 0 } else { self.lost[i].saturating_add(1) };
            self.landed[i] = if swing[i] { Some(0) } else { self.landed[i].map(|ticks| ticks.saturating_add(1)) };
        }
    }

    /// Whether the profile force of each foot has ended at the phase `theta_rad`, rad.
    pub fn cut_off(&self, terms: &LandingTerms, theta_rad: f64) -> PerLeg<bool> {
        let late = terms.cutoff == Cutoff::Foot && theta_rad > CUTOFF_PHASE_RAD;
        self.lost.map(|ticks| late && ticks >= ticks_in(terms.cutoff_lost_s).max(1))
    }

    /// Shift of each leg's nominal foot position, leg frame, m: `spread_m` away from the trunk for legs in swing, and on the ground
    /// `spread_m` (1 - t / `spread_s`) with the time t since the touchdown, at least zero.
    pub fn spread_leg(&self, terms: &LandingTerms) -> PerLeg<Vector3<f64>> {
        Leg::ALL.map(|leg| {
            let share = match self.landed[leg as usize] {
                Some(0) => 1.0,
                Some(ticks) if terms.spread_s > 0.0 => {
                    (1.0 - f64::from(ticks) * CONTROL_PERIOD_S / terms.spread_s).max(0.0)
                }
                _ => 0.0,
            };
            Vector3::new(0.0, share * terms.spread_m * leg.left_sign(), 0.0)
        })
    }
}
