//! Maximization of a smooth function of a few variables inside a box: the BFGS method with projection onto the bounds.
//!
//! Nocedal and Wright, "Numerical Optimization", 2nd ed.: update 6.17, backtracking 3.1; Bertsekas, "Projected Newton
//! methods", SIAM J. Control Optim. 20, 1982, for holding variables at an active bound.

use nalgebra::{DMatrix, DVector};

/// Sufficient increase of the backtracking search (Armijo's c_1).
const ARMIJO: f64 = 1e-4;

/// Maximizes `f` (value and gradient) from `start`. Returns the best point found and its value.
pub fn maximize(
    f: impl Fn(&[f64]) -> (f64, Vec<f64>),
    start: &[f64],
    bounds: &[(f64, f64)],
    iterations: usize,
) -> (Vec<f64>, f64) {
    let n = start.len();
    let mut x: Vec<f64> = start.iter().zip(bounds).map(|(x, (low, high))| x.clamp(*low, *high)).collect();
    let (mut value, mut gradient) = f(&x);
    // H, the estimate of the inverse of the negative Hessian
    let mut inverse = DMatrix::<f64>::identity(n, n);
    let mut fresh = true;
    for _ in 0..iterations {
        let held: Vec<bool> = (0..n)
            .map(|i| {
                let (low, high) = bounds[i];
                low == high || (x[i] <= low && gradient[i] < 0.0) || (x[i] >= high && gradient[i] > 0.0)
            })
            .collect();
        let free_gradient = DVector::from_fn(n, |i, _| if held[i] { 0.0 } else { gradient[i] });
        if free_gradient.amax() < 1e-9 {
            break;
        }
        let mut direction = &inverse * &free_gradient;
        (0..n).filter(|i| held[*i]).for_each(|i| direction[i] = 0.0);
        if direction.dot(&free_gradient) <= 0.0 {
            inverse.fill_with_identity();
            direction = free_gradient.clone();
            fresh = true;
        }
        // Without a curvature estimate a step is limited to a tenth of the box.
        let longest = (0..n).map(|i| direction[i].abs() / (bounds[i].1 - bounds[i].0).max(1e-300)).fold(0.0, f64::max);
        let mut step = if fresh { (0.1 / longest).min(1.0) } else { 1.0 };
        let mut moved = None;
        for _ in 0..30 {
            let candidate: Vec<f64> =
                (0..n).map(|i| (x[i] + step * direction[i]).clamp(bounds[i].0, bounds[i].1)).collect();
            let (v, g) = f(&candidate);
            let promised: f64 = (0..n).map(|i| gradient[i] * (candidate[i] - x[i])).sum();
            if v.is_finite() && v >= value + ARMIJO * promised && promised > 0.0 {
                moved = Some((candidate, v, g));
                break;
            }
            step *= 0.5;
        }
        let Some((next, next_value, next_gradient)) = moved else {
            if fresh {
                break;
            }
            inverse.fill_with_identity();
            fresh = true;
            continue;
        };
        let s = DVector::from_fn(n, |i, _| next[i] - x[i]);
        let y = DVector::from_fn(n, |i, _| if held[i] { 0.0 } else { gradient[i] - next_gradient[i] });
        let sy = s.dot(&y);
        if sy > 1e-12 * s.norm() * y.norm() {
            // H <- (I - rho s y') H (I - rho y s') + rho s s',  rho = 1/(y's)   (Nocedal and Wright 6.17)
            if fresh {
                inverse = DMatrix::identity(n, n) * (sy / y.dot(&y));
            }
            let rho = 1.0 / sy;
            let left = DMatrix::identity(n, n) - &s * y.transpose() * rho;
            inverse = product(&product(&left, &inverse), &left.transpose()) + &s * s.transpose() * rho;
            fresh = false;
        }
        let gain = next_value - value;
        (x, value, gradient) = (next, next_value, next_gradient);
        if gain < 1e-10 * (1.0 + value.abs()) {
            break;
        }
    }
    (x, value)
}

/// The product a b, column by column. From six rows on that of nalgebra has fused instructions where the machine has them, and so
/// other last bits on another machine.
fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_columns(&b.column_iter().map(|column| a * column).collect::<Vec<_>>())
}

/// Adds a gradient to `f` by central differences of width `h`, one-sided at the bounds.
pub fn with_gradient<'a>(
    f: impl Fn(&[f64]) -> f64 + 'a,
    bounds: &'a [(f64, f64)],
    h: f64,
) -> impl Fn(&[f64]) -> (f64, Vec<f64>) + 'a {
    move |x| {
        let mut point = x.to_vec();
        let gradient = (0..x.len())
            .map(|i| {
                let (low, high) = ((x[i] - h).max(bounds[i].0), (x[i] + h).min(bounds[i].1));
                if high <= low {
                    return 0.0;
                }
                point[i] = high;
                let above = f(&point);
                point[i] = low;
                let below = f(&point);
                point[i] = x[i];
                (above - below) / (high - low)
            })
            .collect();
        (f(x), gradient)
    }
}
