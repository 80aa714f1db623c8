//! Laplace approximation of a latent Gaussian process whose sign is observed, with a logistic likelihood: Rasmussen and Williams
//! (R&W), algorithms 3.1 and 3.2.

use libm::{exp, log, log1p, sqrt};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::f64::consts::PI;

/// Smallest part of a Newton step that is tried.
const LEAST_STEP: f64 = 1e-3;

/// The approximation at the mode of the latent function.
#[derive(Debug, Clone)]
pub struct Laplace {
    /// Gradient of ln p(y|f) at the mode.
    gradient: DVector<f64>,
    /// W^(1/2), W the negative Hessian of ln p(y|f) at the mode.
    root_w: DVector<f64>,
    /// The factor of I + W^(1/2) K W^(1/2).
    factor: Cholesky<f64, Dyn>,
    /// ln q(y), the logarithm of the evidence.
    pub log_evidence: f64,
}

impl Laplace {
    /// Finds the mode for the prior N(`mean`, `k`) and the observed signs. `None` if a matrix cannot be factored or the mode is not
    /// found.
    pub fn fit(k: &DMatrix<f64>, mean: &DVector<f64>, stood: &[bool]) -> Option<Self> {
        let n = stood.len();
        let target = DVector::from_iterator(n, stood.iter().map(|s| f64::from(u8::from(*s))));
        let mut latent = mean.clone();
        let mut weights = DVector::zeros(n);
        let mut objective = f64::NEG_INFINITY;
        for _ in 0..50 {
            let probability = latent.map(sigmoid);
            let gradient = &target - &probability;
            let w = probability.map(|p| (p * (1.0 - p)).max(1e-12));
            let root_w = w.map(sqrt);
            // B = I + W^(1/2) K W^(1/2)
            let b_matrix =
                DMatrix::from_fn(n, n, |i, j| root_w[i] * k[(i, j)] * root_w[j] + f64::from(u8::from(i == j)));
            let factor = Cholesky::new(b_matrix)?;
            // b = W (f - m) + grad,  a = b - W^(1/2) B^-1 W^(1/2) K b,  f = m + K a
            let b = w.component_mul(&(&latent - mean)) + &gradient;
            let newton = &b - root_w.component_mul(&factor.solve(&root_w.component_mul(&(k * &b))));
            let mut step = 1.0;
            let (a, next) = loop {
                let a = if step == 1.0 { newton.clone() } else { &weights + (&newton - &weights) * step };
                latent = k * &a + mean;
                // psi = -a'(f - m)/2 + ln p(y|f)
                let log_likelihood: f64 =
                    latent.iter().zip(stood).map(|(f, s)| -log1p(exp(if *s { -f } else { *f }))).sum();
                let next = -0.5 * a.dot(&(&latent - mean)) + log_likelihood;
                // psi is concave: a step that loses has gone too far.
                if next >= objective - 1e-12 || step < LEAST_STEP {
                    break (a, next);
                }
                step *= 0.5;
            };
            if (next - objective).abs() < 1e-9 {
                // ln q(y) = psi - sum ln L_ii   (R&W 3.32)
                let log_evidence = next - (0..n).map(|i| log(factor.l_dirty()[(i, i)])).sum::<f64>();
                return Some(Laplace { gradient, root_w, factor, log_evidence });
            }
            (weights, objective) = (a, next);
        }
        None
    }

    /// The probability of a positive sign, averaged over the uncertainty of the latent function. `mean`: its prior mean; `k`: its
    /// covariances with the observed points; `variance`: its prior variance.
    pub fn probability(&self, mean: f64, k: &DVector<f64>, variance: f64) -> f64 {
        let mean = mean + k.dot(&self.gradient);
        // v = L^-1 W^(1/2) k,  variance = k(x,x) - v'v   (R&W algorithm 3.2)
        let weighted = self.root_w.component_mul(k);
        let v = self.factor.l_dirty().solve_lower_triangular(&weighted).unwrap_or(weighted);
        averaged_sigmoid(mean, (variance - v.dot(&v)).max(0.0))
    }
}

/// The sigmoid averaged over a normal distribution: MacKay's approximation (Neural Computation 4, 1992).
fn averaged_sigmoid(mean: f64, variance: f64) -> f64 {
    sigmoid(mean / sqrt(1.0 + PI * variance / 8.0))
}

/// 1 / (1 + exp(-f))
pub fn sigmoid(f: f64) -> f64 {
    1.0 / (1.0 + exp(-f))
}
