//! The series of the live view's charts: names and units.

use strum::{EnumString, IntoStaticStr, VariantArray};

/// One signal over time, in the order of the charts. The names are those of the charts and of `console.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, VariantArray, EnumString, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
#[expect(missing_docs, reason = "the names say what each is")]
pub enum Series {
    Roll,
    Pitch,
    #[strum(to_string = "FR foot z", serialize = "FR foot")]
    FrFoot,
    #[strum(to_string = "FL foot z", serialize = "FL foot")]
    FlFoot,
    #[strum(to_string = "RR foot z", serialize = "RR foot")]
    RrFoot,
    #[strum(to_string = "RL foot z", serialize = "RL foot")]
    RlFoot,
    Height,
    Oscillator,
    #[strum(serialize = "FR force")]
    FrForce,
    #[strum(serialize = "FL force")]
    FlForce,
    #[strum(serialize = "RR force")]
    RrForce,
    #[strum(serialize = "RL force")]
    RlForce,
}

impl Series {
    /// Roll, pitch and the four foot heights, as the paper's figure over rough terrain.
    pub const ATTITUDE: [Series; 6] =
        [Series::Roll, Series::Pitch, Series::FrFoot, Series::FlFoot, Series::RrFoot, Series::RlFoot];
    /// Height of the trunk, phase of the oscillator and the four foot forces.
    pub const FORCES: [Series; 6] =
        [Series::Height, Series::Oscillator, Series::FrForce, Series::FlForce, Series::RrForce, Series::RlForce];

    /// Its name on charts and in `console.toml`.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Its unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Series::Roll | Series::Pitch | Series::Oscillator => "rad",
            Series::FrFoot | Series::FlFoot | Series::RrFoot | Series::RlFoot | Series::Height => "m",
            Series::FrForce | Series::FlForce | Series::RrForce | Series::RlForce => "N",
        }
    }

    /// Its content, for the dialog.
    pub const fn help(self) -> &'static str {
        match self {
            Series::FrFoot | Series::FlFoot | Series::RrFoot | Series::RlFoot => "m, in the leg's hip frame",
            Series::Height => "m, of the trunk over the world's zero",
            Series::Oscillator => "rad, phase",
            _ => self.unit(),
        }
    }
}
