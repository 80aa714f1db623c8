//! Smooth change of the controller's gains on a standing robot: another stiffness changes the sag at once otherwise (5 cm from 400
//! to 800 N/m).

use super::ramp::smoothstep;
use crate::robot::ticks_in;
use crate::trial::Gains;

/// Gains in force.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GainBlend {
    /// Gains at the start of the blend, in the last tick, and at its end; none before the first call.
    gains: Option<[Gains; 3]>,
    elapsed: u32,
}

impl GainBlend {
    /// Makes the next gains apply at once.
    pub fn reset(&mut self) {
        self.gains = None;
    }

    /// Returns the gains of this tick on the way to `to`, which is reached `duration_s` after `to` changed. To be called once per
    /// tick.
    pub fn next(&mut self, to: &Gains, duration_s: f64) -> Gains {
        let ticks = ticks_in(duration_s);
        let Some([from, now, last_to]) = &mut self.gains else {
            self.gains = Some([*to; 3]);
            return *to;
        };
        if last_to != to {
            (*from, *last_to, self.elapsed) = (*now, *to, 0);
        }
        self.elapsed = self.elapsed.saturating_add(1);
        *now = if self.elapsed >= ticks {
            *to
        } else {
            let smooth = smoothstep(f64::from(self.elapsed) / f64::from(ticks));
            let between = |from: f64, to: f64| from + smooth * (to - from);
            Gains {
                kp: between(from.kp, to.kp),
                kd: between(from.kd, to.kd),
                kd_joint: between(from.kd_joint, to.kd_joint),
                k_att: between(from.k_att, to.k_att),
            }
        };
        *now
    }
}
