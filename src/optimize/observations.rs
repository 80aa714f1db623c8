//! The trials of a study as points of a unit cube, as the Gaussian processes read them.

use super::ask::Direction;
use super::space::Parameter;
use super::trial::{Trial, TrialState};

/// A finished trial with a value.
#[derive(Debug, Clone)]
pub struct ObservedTrial {
    /// Its number.
    pub number: u32,
    /// Its point.
    pub point: Vec<f64>,
    /// Whether it ended without a fall.
    pub stood: bool,
    /// Objective, larger is better; without meaning for a fall.
    pub value: f64,
}

/// The trials that have all parameters, by what is known of them.
#[derive(Debug, Clone, Default)]
pub struct TrialPoints {
    /// Trials with a finite value whose constraints hold, in order.
    pub observed: Vec<ObservedTrial>,
    /// Points of running trials.
    pub pending: Vec<Vec<f64>>,
    /// Points of void trials.
    pub void: Vec<Vec<f64>>,
}

impl TrialPoints {
    /// Reads the trials. The unit cube is that of `parameters`; a point may lie outside. A trial of another program with a parameter
    /// that is infinite or no number is left out.
    pub fn of(trials: &[Trial], parameters: &[Parameter], direction: Direction) -> TrialPoints {
        let mut points = TrialPoints::default();
        for trial in trials {
            let scaled = |p: &Parameter| trial.parameter(&p.name).map(|v| p.range.scale(v)).filter(|x| x.is_finite());
            let Some(point) = parameters.iter().map(scaled).collect::<Option<Vec<f64>>>() else { continue };
            match (trial.state, trial.value) {
                (TrialState::Running, _) => points.pending.push(point),
                (TrialState::Fail, _) => points.void.push(point),
                (TrialState::Complete, Some(value)) if value.is_finite() && trial.violation() <= 0.0 => {
                    let (stood, value) = (!trial.is_fall(), direction.maximized(value));
                    points.observed.push(ObservedTrial { number: trial.number, point, stood, value });
                }
                _ => {}
            }
        }
        // A point that was run again has a result: the interrupted trial leaves no trace.
        let (observed, pending) = (&points.observed, &points.pending);
        points.void.retain(|void| !observed.iter().any(|trial| trial.point == *void) && !pending.contains(void));
        points
    }
}
