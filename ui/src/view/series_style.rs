//! The drawing of each series: its value in a sample, its ranges, its colour.

use quadfrog::robot::Leg;

use crate::model::history::ChartSample;
use crate::series::Series;
use crate::theme::Role;

/// Drawing of a series.
#[derive(Clone, Copy)]
pub struct SeriesStyle {
    pub series: Series,
    /// Its value in a sample.
    pub value: fn(&ChartSample) -> f32,
    /// Ranges, narrowest first; the first one that holds the window's values is drawn.
    pub ranges: &'static [(f32, f32)],
    pub role: Role,
    /// The foot whose contact indicator stands beside the name.
    pub foot: Option<Leg>,
}

const TILT: &[(f32, f32)] = &[(-0.25, 0.25), (-0.5, 0.5), (-1.0, 1.0), (-3.2, 3.2)];
const FOOT: &[(f32, f32)] = &[(-0.35, -0.05), (-0.45, 0.05)];
const FORCE: &[(f32, f32)] = &[(0.0, 100.0), (0.0, 400.0), (0.0, 1000.0)];
const HEIGHT: &[(f32, f32)] = &[(0.0, 0.5), (0.0, 1.0), (0.0, 2.0)];
const TURN: &[(f32, f32)] = &[(0.0, 6.3)];

pub fn style(series: Series) -> SeriesStyle {
    let base = |value, ranges, role| SeriesStyle { series, value, ranges, role, foot: None };
    let foot = |leg: Leg, value| SeriesStyle { foot: Some(leg), ..base(value, FOOT, role_of(leg)) };
    let force = |leg: Leg, value| SeriesStyle { foot: Some(leg), ..base(value, FORCE, role_of(leg)) };
    match series {
        Series::Roll => base(|s| s.roll, TILT, Role::SeriesA),
        Series::Pitch => base(|s| s.pitch, TILT, Role::SeriesB),
        Series::FrFoot => foot(Leg::FR, |s| s.foot_z[Leg::FR as usize]),
        Series::FlFoot => foot(Leg::FL, |s| s.foot_z[Leg::FL as usize]),
        Series::RrFoot => foot(Leg::RR, |s| s.foot_z[Leg::RR as usize]),
        Series::RlFoot => foot(Leg::RL, |s| s.foot_z[Leg::RL as usize]),
        Series::Height => base(|s| s.height, HEIGHT, Role::SeriesA),
        Series::Oscillator => base(|s| s.theta, TURN, Role::SeriesB),
        Series::FrForce => force(Leg::FR, |s| s.foot_force[Leg::FR as usize]),
        Series::FlForce => force(Leg::FL, |s| s.foot_force[Leg::FL as usize]),
        Series::RrForce => force(Leg::RR, |s| s.foot_force[Leg::RR as usize]),
        Series::RlForce => force(Leg::RL, |s| s.foot_force[Leg::RL as usize]),
    }
}

const fn role_of(leg: Leg) -> Role {
    match leg {
        Leg::FR | Leg::FL => Role::SeriesA,
        Leg::RR | Leg::RL => Role::SeriesB,
    }
}
