//! The likelihood of each simulated robot, and its share in what is expected of the robot's standing.
//!
//! Five labels hardly say where a robot falls. Five values say which friction, mass and torque it has, and with them which worlds fall
//! where it does.

use super::history::History;
use super::model::ValueModel;
use crate::optimize::gp::laplace::sigmoid;
use crate::optimize::prior::terms::Ensemble;
use libm::{exp, log};

/// Least probability of a label under a world: a single label does not rule a world out.
const LEAST_PROBABILITY: f64 = 0.02;
/// Sum of the shares that follow the likelihoods; the others are equal, because the robot is none of the worlds.
const LEARNED: f64 = 0.7;

/// Returns ln of the likelihood of the jumps under each world: of a value with the robot's bias and difference, of a label through the
/// logistic prior. A world without a value explains no jump that stood.
pub fn log_likelihoods(ensemble: &Ensemble, history: &History) -> Vec<f64> {
    let [b0, b1, b2] = ensemble.standing.mean.into();
    // Of each jump that stood, of each world that has a value.
    let values: Vec<Vec<f64>> = history.stood().map(|jump| ensemble.world_values(&jump.point)).collect();
    let log_likelihood = |k: usize| {
        let labels = history.jumps.iter().map(|jump| {
            let p = sigmoid(b0 + b1 * jump.features.labels[k] + b2 * jump.features.standing[2]);
            log(if jump.stood { p } else { 1.0 - p }.max(LEAST_PROBABILITY))
        });
        let of_values = match ensemble.known.iter().position(|known| *known == k) {
            Some(at) => {
                let scaled = |values: &Vec<f64>| (values[at] - ensemble.offset) / ensemble.scale;
                let simulated: Vec<f64> = values.iter().map(scaled).collect();
                ValueModel::log_likelihood_about(ensemble, history, &simulated)
            }
            None if values.is_empty() => 0.0,
            None => f64::NEG_INFINITY,
        };
        labels.sum::<f64>() + of_values
    };
    (0..ensemble.worlds()).map(log_likelihood).collect()
}

/// Returns the share of each of n worlds, 0.3 / n plus 0.7 times the square root of its likelihood as a share of the sum of the roots.
/// With the root the share of the likeliest world grows more slowly: the worlds' surfaces have errors of their own.
pub fn shares(log_likelihoods: &[f64]) -> Vec<f64> {
    let equal = (1.0 - LEARNED) / log_likelihoods.len() as f64;
    normalized(log_likelihoods, 0.5).into_iter().map(|share| equal + LEARNED * share).collect()
}

/// Returns likelihood^`power`, scaled to the sum 1; equal values where no likelihood is a positive number.
pub fn normalized(log_likelihoods: &[f64], power: f64) -> Vec<f64> {
    let largest = log_likelihoods.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        return vec![1.0 / log_likelihoods.len() as f64; log_likelihoods.len()];
    }
    // A likelihood that is not a number counts as 0.
    let relative: Vec<f64> = log_likelihoods.iter().map(|log| exp(power * (log - largest)).max(0.0)).collect();
    let sum: f64 = relative.iter().sum();
    relative.iter().map(|relative| relative / sum).collect()
}
