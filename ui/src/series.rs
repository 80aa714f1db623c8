//! What the live view's charts can show: one table of signals with their names in `console.toml`, units and ranges.

use quadfrog::robot::Leg;

use crate::history::Sample;
use crate::theme::Role;

/// One signal over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "each is named in words, with its unit, in `SIGNALS`")]
pub enum Series {
    Roll,
    Pitch,
    FlFoot,
    FrFoot,
    RlFoot,
    RrFoot,
    Height,
    Oscillator,
    FlForce,
    FrForce,
    RlForce,
    RrForce,
}

/// How a series is drawn.
#[derive(Clone, Copy)]
pub struct Signal {
    /// The series.
    pub series: Series,
    /// Its name on charts and in `console.toml`.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Its value in a sample.
    pub value: fn(&Sample) -> f32,
    /// Ranges to choose from, narrowest first: the first one that holds the window's values is drawn.
    pub ranges: &'static [(f32, f32)],
    /// Its colour.
    pub role: Role,
    /// The foot whose contact lamp stands beside the name.
    pub foot: Option<Leg>,
}

const TILT: &[(f32, f32)] = &[(-0.25, 0.25), (-0.5, 0.5), (-1.0, 1.0), (-3.2, 3.2)];
const FOOT: &[(f32, f32)] = &[(-0.35, -0.05), (-0.45, 0.05)];
const FORCE: &[(f32, f32)] = &[(0.0, 100.0), (0.0, 400.0), (0.0, 1000.0)];
const HEIGHT: &[(f32, f32)] = &[(0.0, 0.5), (0.0, 1.0), (0.0, 2.0)];
const TURN: &[(f32, f32)] = &[(0.0, 6.3)];

const fn base(
    series: Series,
    (name, unit): (&'static str, &'static str),
    value: fn(&Sample) -> f32,
    ranges: &'static [(f32, f32)],
    role: Role,
) -> Signal {
    Signal { series, name, unit, value, ranges, role, foot: None }
}

const fn foot(series: Series, name: &'static str, leg: Leg, value: fn(&Sample) -> f32, role: Role) -> Signal {
    Signal { series, name, unit: "m", value, ranges: FOOT, role, foot: Some(leg) }
}

const fn force(series: Series, name: &'static str, leg: Leg, value: fn(&Sample) -> f32, role: Role) -> Signal {
    Signal { series, name, unit: "N", value, ranges: FORCE, role, foot: Some(leg) }
}

/// Every series, in the order of the charts: two in a row, left feet at the left, front feet above.
#[rustfmt::skip]
pub const SIGNALS: [Signal; 12] = {
    use Role::{SeriesA, SeriesB};
    use Series as S;
    [
        base(S::Roll, ("roll", "rad"), |s| s.roll, TILT, SeriesA),
        base(S::Pitch, ("pitch", "rad"), |s| s.pitch, TILT, SeriesB),
        foot(S::FlFoot, "FL foot", Leg::FL, |s| s.foot_z[Leg::FL as usize], SeriesA),
        foot(S::FrFoot, "FR foot", Leg::FR, |s| s.foot_z[Leg::FR as usize], SeriesA),
        foot(S::RlFoot, "RL foot", Leg::RL, |s| s.foot_z[Leg::RL as usize], SeriesB),
        foot(S::RrFoot, "RR foot", Leg::RR, |s| s.foot_z[Leg::RR as usize], SeriesB),
        base(S::Height, ("height", "m"), |s| s.height, HEIGHT, SeriesA),
        base(S::Oscillator, ("oscillator", "rad"), |s| s.theta, TURN, SeriesB),
        force(S::FlForce, "FL force", Leg::FL, |s| s.foot_force[Leg::FL as usize], SeriesA),
        force(S::FrForce, "FR force", Leg::FR, |s| s.foot_force[Leg::FR as usize], SeriesA),
        force(S::RlForce, "RL force", Leg::RL, |s| s.foot_force[Leg::RL as usize], SeriesB),
        force(S::RrForce, "RR force", Leg::RR, |s| s.foot_force[Leg::RR as usize], SeriesB),
    ]
};

impl Series {
    /// Roll, pitch and the four foot heights, as the paper's figure over rough terrain.
    pub const ATTITUDE: [Series; 6] =
        [Series::Roll, Series::Pitch, Series::FlFoot, Series::FrFoot, Series::RlFoot, Series::RrFoot];
    /// Base height, oscillator phase and the four foot forces.
    pub const FORCES: [Series; 6] =
        [Series::Height, Series::Oscillator, Series::FlForce, Series::FrForce, Series::RlForce, Series::RrForce];

    /// How it is drawn.
    pub fn signal(self) -> Signal {
        SIGNALS[self as usize]
    }

    /// The series of that name in `console.toml`.
    pub fn from_name(name: &str) -> Option<Series> {
        SIGNALS.iter().find(|signal| signal.name == name).map(|signal| signal.series)
    }
}
