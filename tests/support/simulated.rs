//! A robot of a formula, and priors of an ensemble of such robots.
#![allow(dead_code, reason = "each user takes its own part")]

use quadfrog::optimize::mt19937::Mt19937;
use quadfrog::optimize::prior::{Prior, SlipParameters, World};
use quadfrog::optimize::sobol::Sobol;
use quadfrog::optimize::space::{Parameter, Range, Space};
use quadfrog::optimize::study::{Outcome, Study};
use quadfrog::optimize::trial::{FALL, VERDICT};

/// A robot whose jump grows with the push along x until its feet slip, or the push is too hard for its motors.
#[derive(Debug, Clone, Copy)]
pub struct Formula {
    /// Factor of the value.
    pub gain: f64,
    /// Best position of the first parameter.
    pub best: f64,
    /// Ratio of the horizontal to the vertical force at which the feet slip.
    pub grip: f64,
}

impl Formula {
    /// Value at a point of the unit cube of f0, Fx, Fz, none for a fall.
    pub fn jump(&self, u: &[f64]) -> Option<f64> {
        let ratio = 150.0 * u[1] / (150.0 + 200.0 * u[2]);
        (ratio <= self.grip).then(|| self.value(u))
    }

    /// Value if the robot stands.
    pub fn value(&self, u: &[f64]) -> f64 {
        let (a, b) = (u[0] - self.best, u[2] - 0.6);
        self.gain * (0.1 + 0.5 * u[1] - 0.5 * a * a - 0.3 * b * b)
    }
}

/// Four robots about the formula of gain 1.
pub const WORLDS: [Formula; 4] = [
    Formula { gain: 0.9, best: 0.55, grip: 0.45 },
    Formula { gain: 1.1, best: 0.65, grip: 0.55 },
    Formula { gain: 1.0, best: 0.45, grip: 0.5 },
    Formula { gain: 1.2, best: 0.6, grip: 0.4 },
];

/// The parameters of the formula.
pub fn parameters() -> Vec<Parameter> {
    let parameter =
        |(name, low, high): (&str, f64, f64)| Parameter { name: name.into(), range: Range::linear(low, high) };
    [("f0", 0.75, 1.75), ("Fx", 0.0, 150.0), ("Fz", 150.0, 350.0)].map(parameter).to_vec()
}

pub fn space() -> Space {
    Space::new(parameters().into_iter().map(|p| (p.name, p.range))).unwrap()
}

/// Jumps of `worlds` at `points` points of the unit cube.
pub fn prior_of(worlds: &[Formula], points: u32) -> Prior {
    let sobol = Sobol::new(3, &mut Mt19937::new(5));
    let points: Vec<Vec<f64>> = (0..points).map(|i| sobol.point(i)).collect();
    let world = |(k, formula): (usize, &Formula)| World {
        name: format!("world {}", k + 1),
        values: points.iter().map(|u| formula.jump(u)).collect(),
    };
    let worlds = worlds.iter().enumerate().map(world).collect();
    let slip = SlipParameters { horizontal: vec!["Fx".into()], vertical: "Fz".into() };
    Prior::new(parameters(), points, worlds, Some(slip))
}

/// The prior of a simulator whose axes all point the other way.
pub fn mirrored(mut prior: Prior) -> Prior {
    prior.points.iter_mut().flatten().for_each(|u| *u = 1.0 - *u);
    prior
}

/// The point of trial `number` in the unit cube.
pub fn unit(study: &Study, number: u32) -> Vec<f64> {
    let trial = study.trial(number).unwrap();
    parameters().iter().map(|p| p.range.scale(trial.parameter(&p.name).unwrap())).collect()
}

/// Ends a running trial with a value, or with a fall.
pub fn finish(study: &mut Study, number: u32, value: Option<f64>) {
    let verdict = if value.is_some() { "accept" } else { FALL };
    study.annotate(number, &[(VERDICT.into(), verdict.into())]).unwrap();
    study.tell(number, Outcome::Complete(value.unwrap_or(0.0))).unwrap();
}

/// Runs the next trial on the robot of the formula; returns its value, none for a fall.
pub fn jump(study: &mut Study, robot: &Formula) -> Option<f64> {
    let number = study.begin(&study.draft(), &[], &[]).unwrap();
    let value = robot.jump(&unit(study, number));
    finish(study, number, value);
    value
}

/// Runs the next `count` trials.
pub fn jumps(study: &mut Study, count: usize, robot: &Formula) {
    for _ in 0..count {
        jump(study, robot);
    }
}
