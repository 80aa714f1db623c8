//! The trials as points of the prior's unit cube, with the prior's terms there.

use crate::optimize::ask::Direction;
use crate::optimize::gp::regression::Observations;
use crate::optimize::observations::{ObservedTrial, TrialPoints};
use crate::optimize::prior::PriorModel;
use crate::optimize::prior::terms::{Ensemble, Features};
use crate::optimize::trial::Trial;

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
#[derive(Debug, Clone)]
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
        let TrialPoints { observed, pending, void } = TrialPoints::of(trials, parameters, direction);
        let features = |point: &[f64]| ensemble.features(prior.prior(), point);
        let jump = |ObservedTrial { number, point, stood, value }: ObservedTrial| {
            let features = features(&point);
            Jump { number, point, features, stood, value }
        };
        let running = |point: Vec<f64>| {
            let features = features(&point);
            (point, features)
        };
        History {
            dimensions: parameters.len(),
            jumps: observed.into_iter().map(jump).collect(),
            pending: pending.into_iter().map(running).collect(),
            void,
        }
    }

    /// The jumps that stood as observations of a regression, in scaled values and with a row of terms each.
    pub fn observations(&self, ensemble: &Ensemble, terms: Vec<Vec<f64>>) -> Observations {
        Observations {
            points: self.stood().map(|jump| jump.point.clone()).collect(),
            terms,
            values: self.stood().map(|jump| (jump.value - ensemble.offset) / ensemble.scale).collect(),
        }
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
