//! Landing terms of a trial, beside the paper's controller (`docs/method.md`, "Added terms").

use serde::{Deserialize, Serialize};

/// End of the profile force of a foot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Cutoff {
    /// The end of the impulse (paper).
    #[default]
    None,
    /// The loss of the foot's contact, if it lasts and the phase is above 1.25 pi.
    Foot,
}

/// Landing terms: keys of `[tasks.<task>]` in `config/control.toml`. The default is the paper's controller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LandingTerms {
    /// End of the profile force of a foot.
    pub cutoff: Cutoff,
    /// Time without contact after which `cutoff` ends the profile force of a foot, s.
    pub cutoff_lost_s: f64,
    /// Shift of the nominal position of a swing foot away from the trunk along y of the leg frame, m.
    pub spread_m: f64,
    /// Time after the touchdown of a foot in which its shift returns to zero, s.
    pub spread_s: f64,
}

impl Default for LandingTerms {
    fn default() -> LandingTerms {
        LandingTerms { cutoff: Cutoff::None, cutoff_lost_s: 0.02, spread_m: 0.0, spread_s: 0.3 }
    }
}
