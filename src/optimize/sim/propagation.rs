//! Expectation propagation for a latent Gaussian process whose sign is observed: Minka, "Expectation propagation for approximate
//! Bayesian inference", UAI 2001; Rasmussen and Williams (R&W), algorithms 3.5 and 3.6.
//!
//! Laplace's approximation is centred at the mode. With a wide prior and few signs the mode lies nearer to zero than the mean, and
//! probabilities come out too near 1/2 (Kuss and Rasmussen, J. Mach. Learn. Res. 6, 2005). Here the likelihood of each sign is replaced
//! by the normal factor that gives the right mean and variance beside all the others.
//!
//! The likelihood is Phi(f / 1.702) for a positive sign, which differs from the logistic one by less than 0.0095 (Haley 1952): log odds
//! keep their meaning, and all integrals have a closed form.

use crate::optimize::truncnorm::{HALF_LN_TWO_PI, log_cdf};
use libm::{exp, sqrt};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Width of the normal distribution function nearest to the logistic one.
const WIDTH: f64 = 1.702;
/// Change of the factors, relative to the posterior, at which they have converged.
const TOLERANCE: f64 = 1e-6;
/// Most rounds over all signs. Five to some twenty are needed, the most where a hundred signs agree at one point of a wide prior.
const ROUNDS: usize = 200;

/// The approximate posterior of the latent function.
#[derive(Debug, Clone)]
pub struct Propagation {
    /// (K + T^-1)^-1 times the factors' means, counted from the prior's; T is the diagonal of the factors' precisions.
    weights: DVector<f64>,
    /// T^(1/2)
    root: DVector<f64>,
    /// The factor of I + T^(1/2) K T^(1/2).
    factor: Cholesky<f64, Dyn>,
}

impl Propagation {
    /// Fits the prior N(`mean`, `k`) to the observed signs. `None` if a matrix cannot be factored or the factors do not converge.
    pub fn fit(k: &DMatrix<f64>, mean: &DVector<f64>, positive: &[bool]) -> Option<Self> {
        let n = positive.len();
        // Precision, and precision times mean, of each factor and of the posterior; means are counted from the prior's.
        let (mut tau, mut nu) = (DVector::zeros(n), DVector::zeros(n));
        let (mut covariance, mut centre) = (k.clone(), DVector::zeros(n));
        for _ in 0..ROUNDS {
            let mut change = 0.0_f64;
            for i in 0..n {
                let variance: f64 = covariance[(i, i)];
                // The posterior without factor i   (R&W 3.56)
                let (tau_without, nu_without) = (1.0 / variance - tau[i], centre[i] / variance - nu[i]);
                let Some((tau_new, nu_new)) = matched(tau_without, nu_without, mean[i], positive[i]) else { continue };
                let (tau_step, nu_step) = (tau_new - tau[i], nu_new - nu[i]);
                (tau[i], nu[i]) = (tau_new, nu_new);
                // One element of the posterior's precision changes: Sherman and Morrison.
                let column = covariance.column(i).clone_owned();
                let shrink = tau_step / (1.0 + tau_step * variance);
                centre += &column * (nu_step - shrink * (centre[i] + nu_step * variance));
                covariance.ger(-shrink, &column, &column, 1.0);
                // Of the mean in standard deviations, of the precision as a share of the posterior's.
                change = change.max((nu_step * sqrt(variance)).abs()).max((tau_step * variance).abs());
            }
            let root = tau.map(|t: f64| sqrt(t));
            let b_matrix = DMatrix::from_fn(n, n, |i, j| root[i] * k[(i, j)] * root[j] + f64::from(u8::from(i == j)));
            let factor = Cholesky::new(b_matrix)?;
            // K - K T^(1/2) B^-1 T^(1/2) K, anew, so that rounding does not add up.
            let v = factor.l_dirty().solve_lower_triangular(&DMatrix::from_fn(n, n, |i, j| root[i] * k[(i, j)]))?;
            covariance = k - v.tr_mul(&v);
            centre = &covariance * &nu;
            if change < TOLERANCE {
                // nu - T^(1/2) B^-1 T^(1/2) K nu
                let weights = &nu - root.component_mul(&factor.solve(&root.component_mul(&(k * &nu))));
                return Some(Propagation { weights, root, factor });
            }
        }
        None
    }

    /// The probability of a positive sign, averaged over the uncertainty of the latent function. `mean`: its prior mean; `k`: its
    /// covariances with the observed points; `variance`: its prior variance.
    pub fn probability(&self, mean: f64, k: &DVector<f64>, variance: f64) -> f64 {
        let weighted = self.root.component_mul(k);
        let v = self.factor.l_dirty().solve_lower_triangular(&weighted).unwrap_or(weighted);
        averaged(mean + k.dot(&self.weights), (variance - v.dot(&v)).max(0.0))
    }
}

/// The likelihood of a positive sign averaged over a normal distribution of the latent value   (R&W 3.82).
pub fn averaged(mean: f64, variance: f64) -> f64 {
    exp(log_cdf(mean / sqrt(WIDTH * WIDTH + variance)))
}

/// Precision, and precision times mean, of the normal factor that stands for the likelihood of a sign beside a normal distribution of
/// precision `tau` and mean `nu` / `tau`, counted from `origin`: both have the same mean and variance. `None` without a positive
/// precision.
fn matched(tau: f64, nu: f64, origin: f64, positive: bool) -> Option<(f64, f64)> {
    if tau <= 0.0 {
        return None;
    }
    let (variance, mean) = (1.0 / tau, nu / tau);
    let sign = if positive { 1.0 } else { -1.0 };
    let width = sqrt(WIDTH * WIDTH + variance);
    let z = sign * (origin + mean) / width;
    // phi(z) / Phi(z)
    let ratio = exp(-0.5 * z * z - HALF_LN_TWO_PI - log_cdf(z));
    // Mean and variance of the product   (R&W 3.58)
    let product_mean = mean + sign * variance * ratio / width;
    let product_variance = variance - variance * variance * ratio * (z + ratio) / (width * width);
    let product_tau = 1.0 / product_variance;
    Some(((product_tau - tau).max(0.0), product_mean * product_tau - nu))
}
