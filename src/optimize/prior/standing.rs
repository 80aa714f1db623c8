//! The prior of a robot's standing: how well the labels of the other worlds and the reserve of friction predict those of a world.
//!
//! Each world is predicted from the others, as the robot will be from all, by logistic regression on (1, mean label of the others, z)
//! with a normal prior N(0, 3^2) of the coefficients. Their mean and covariance over the worlds are the robot's prior (empirical Bayes).
//! The covariance matters: where all worlds stand nearly everywhere only the sum of the coefficients of 1 and of the label is known.

use crate::optimize::gp::laplace::sigmoid;
use nalgebra::{Matrix3, Vector3};

/// Mean and covariance of the coefficients of 1, g and z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogisticPrior {
    /// Means.
    pub mean: Vector3<f64>,
    /// Covariance.
    pub covariance: Matrix3<f64>,
}

/// Standard deviations beside the spread over the worlds, of which a handful does not span all robots.
const OWN_DEVIATION: [f64; 3] = [1.5, 0.7, 0.5];
/// Factor of the spread over the worlds.
const SPREAD: f64 = 1.5;
/// Means and standard deviations for a single world, from which nothing can be left out.
const SINGLE: ([f64; 3], [f64; 3]) = ([0.5, 2.0, 0.0], [2.5, 0.7, 0.7]);
/// Probabilities of standing that stand for a label, so that the odds stay finite.
const TARGET: (f64, f64) = (0.02, 0.98);
/// Variance of the coefficients' own prior.
const RIDGE: f64 = 9.0;

/// Computes the prior from the clipped labels of the worlds at some points, and the reserve of friction there.
pub fn leave_one_world_out(labels: &[Vec<f64>], reserve: &[f64]) -> LogisticPrior {
    let worlds = labels.first().map_or(0, Vec::len);
    if worlds < 2 {
        let (mean, deviation) = SINGLE;
        return LogisticPrior { mean: mean.into(), covariance: squared(deviation) };
    }
    let coefficients: Vec<Vector3<f64>> = (0..worlds)
        .map(|k| {
            let row = |(labels, z): (&Vec<f64>, &f64)| {
                let others = (labels.iter().sum::<f64>() - labels[k]) / (worlds - 1) as f64;
                let target = if labels[k] > 0.0 { TARGET.1 } else { TARGET.0 };
                (Vector3::new(1.0, others, *z), target)
            };
            logistic(&labels.iter().zip(reserve).map(row).collect::<Vec<_>>())
        })
        .collect();
    let n = worlds as f64;
    let mean = coefficients.iter().sum::<Vector3<f64>>() / n;
    let product = |c: &Vector3<f64>| (c - mean) * (c - mean).transpose();
    let sum = coefficients.iter().map(product).sum::<Matrix3<f64>>();
    LogisticPrior { mean, covariance: sum * (SPREAD * SPREAD / (n - 1.0)) + squared(OWN_DEVIATION) }
}

/// Covariance of independent coefficients with these standard deviations.
fn squared(deviation: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::from(deviation).map(|s| s * s))
}

/// Coefficients of largest posterior, by Newton's method with halved steps.
fn logistic(rows: &[(Vector3<f64>, f64)]) -> Vector3<f64> {
    // ln p = sum t ln p + (1 - t) ln(1 - p) - |w|^2 / 2 s^2
    let objective = |w: &Vector3<f64>| {
        let fit = |(h, t): &(Vector3<f64>, f64)| {
            let f = h.dot(w);
            t * f - f.max(0.0) - libm::log1p(libm::exp(-f.abs()))
        };
        rows.iter().map(fit).sum::<f64>() - 0.5 * w.norm_squared() / RIDGE
    };
    let mut w = Vector3::zeros();
    let mut value = objective(&w);
    for _ in 0..50 {
        let (mut hessian, mut gradient) = (Matrix3::identity() / RIDGE, -w / RIDGE);
        for (h, t) in rows {
            let p = sigmoid(h.dot(&w));
            hessian += h * h.transpose() * (p * (1.0 - p));
            gradient += h * (t - p);
        }
        let Some(step) = hessian.cholesky().map(|factor| factor.solve(&gradient)) else { break };
        let halved = (0..30).map(|halvings| w + step * libm::pow(0.5, f64::from(halvings)));
        let Some((next, better)) = halved.map(|w| (w, objective(&w))).find(|(_, better)| *better >= value) else {
            break;
        };
        let gain = better - value;
        (w, value) = (next, better);
        if gain < 1e-12 * value.abs() {
            break;
        }
    }
    w
}
