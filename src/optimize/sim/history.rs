//! The trials as points of the prior's unit cube, with the prior's terms there.

use crate::optimize::ask::Direction;
use crate::optimize::prior::PriorModel;
use crate::optimize::prior::terms::{Ensemble, Features};
use crate::optimize::trial::{Trial, TrialState};

/// One finished jump.
#[derive(Debug, Clone)]
pub struct Jump {
    /// Number of the trial.
    pub number: u32,
    /// Coordinates.
    pub point: Vec<f64>,
    /// Terms of the prior there.
    pub features: Features,
    /// Whether it ended without a fall.
    pub stood: bool,
    /// Objective, larger is better; without meaning for a fall.
    pub value: f64,
}

/// The trials that the model reads.
#[derive(Debug, Clone, Default)]
pub struct History {
    /// Number of parameters.
    pub dimensions: usize,
    /// Finished trials in order.
    pub jumps: Vec<Jump>,
    /// Points of running trials.
    pub pending: Vec<(Vec<f64>, Features)>,
    /// Points of void trials.
    pub void: Vec<Vec<f64>>,
}

impl History {
    /// Reads the trials that have all parameters of the prior.
    pub fn gather(prior: &PriorModel, ensemble: &Ensemble, trials: &[Trial], direction: Direction) -> History {
        let parameters = &prior.prior().parameters;
        let mut history = History { dimensions: parameters.len(), ..History::default() };
        for trial in trials {
            let coordinates = parameters.iter().map(|p| trial.parameter(&p.name).map(|v| p.range.scale(v)));
            let Some(point) = coordinates.collect::<Option<Vec<f64>>>() else { continue };
            match (trial.state, trial.value) {
                (TrialState::Running, _) => {
                    let features = ensemble.features(prior.prior(), &point);
                    history.pending.push((point, features));
                }
                (TrialState::Fail, _) => history.void.push(point),
                (TrialState::Complete, Some(value)) if value.is_finite() && trial.violation() <= 0.0 => {
                    let features = ensemble.features(prior.prior(), &point);
                    let value = direction.maximized(value);
                    let stood = !trial.is_fall();
                    history.jumps.push(Jump { number: trial.number, point, features, stood, value });
                }
                _ => {}
            }
        }
        // A point that was run again has a result: the interrupted trial leaves no trace.
        let (jumps, pending) = (&history.jumps, &history.pending);
        let again = |point: &Vec<f64>| {
            jumps.iter().any(|jump| jump.point == *point) || pending.iter().any(|(other, _)| other == point)
        };
        history.void.retain(|point| !again(point));
        history
    }

    /// The jumps without a fall.
    pub fn stood(&self) -> impl Iterator<Item = &Jump> {
        self.jumps.iter().filter(|jump| jump.stood)
    }

    /// Falls since the last jump without one.
    pub fn falls_in_a_row(&self) -> usize {
        self.jumps.iter().rev().take_while(|jump| !jump.stood).count()
    }
}
