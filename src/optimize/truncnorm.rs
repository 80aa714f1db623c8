//! The normal distribution truncated to an interval: logarithm of its mass and quantiles, accurate in the far tails, where
//! the plain formulas underflow or cancel.
//!
//! Symbols: Phi and phi are the distribution function and density of the standard normal. All functions are
//! those of the `libm` crate, so that the bits do not depend on the C library of the machine.

use libm::{erf, erfc, exp, expm1, log, log1p, sqrt};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// (1/2) ln(2 pi), the logarithm of the normal density's constant.
pub const HALF_LN_TWO_PI: f64 = 0.918_938_533_204_672_7;

/// ln Phi(x).
pub fn log_cdf(x: f64) -> f64 {
    if x > 6.0 {
        // ln(1 - e) = -e to the last bit
        -cdf_by_erfc(-x)
    } else if x > -20.0 {
        log(cdf_by_erfc(x))
    } else {
        log_cdf_far_left(x)
    }
}

/// Phi(x), by erf or erfc, whichever does not cancel.
fn cdf_by_erfc(x: f64) -> f64 {
    let t = x * FRAC_1_SQRT_2;
    if t < -FRAC_1_SQRT_2 {
        0.5 * erfc(-t)
    } else if t < FRAC_1_SQRT_2 {
        0.5 + 0.5 * erf(t)
    } else {
        1.0 - 0.5 * erfc(t)
    }
}

/// ln Phi(x) = -x^2/2 - ln(-x) - ln(2 pi)/2 + ln(1 - 1/x^2 + 3/x^4 - 15/x^6 + ...)
/// (Abramowitz and Stegun, 26.2.12).
fn log_cdf_far_left(x: f64) -> f64 {
    let inverse_square = 1.0 / (x * x);
    let (mut sum, mut term, mut odd) = (1.0, 1.0_f64, 1.0);
    // Ends for a NaN, too.
    while term.abs() > f64::EPSILON {
        term *= -odd * inverse_square;
        sum += term;
        odd += 2.0;
    }
    -0.5 * x * x - log(-x) - HALF_LN_TWO_PI + log(sum)
}

/// ln(Phi(b) - Phi(a)), a < b; either may be infinite.
pub fn log_mass(a: f64, b: f64) -> f64 {
    if b <= 0.0 {
        log_mass_left(a, b)
    } else if a > 0.0 {
        // The mass of (a, b) is that of its mirror image (-b, -a), which does not cancel.
        log_mass_left(-b, -a)
    } else {
        // ln(1 - Phi(a) - Phi(-b))
        let cdf = |x: f64| 0.5 + 0.5 * erf(x * FRAC_1_SQRT_2);
        log1p(-cdf(a) - cdf(-b))
    }
}

fn log_mass_left(a: f64, b: f64) -> f64 {
    // ln(Phi(b) - Phi(a)) = ln Phi(b) + ln(1 - exp(ln Phi(a) - ln Phi(b)))
    let (log_a, log_b) = (log_cdf(a), log_cdf(b));
    log_b + log1p(-exp(log_a - log_b))
}

/// Quantile `u` (0..1) of the standard normal truncated to [a, b].
pub fn quantile(u: f64, a: f64, b: f64) -> f64 {
    if u == 0.0 {
        return a;
    }
    let mass = log_mass(a, b);
    if a < 0.0 {
        // Phi(x) = Phi(a) + u (Phi(b) - Phi(a))
        inverse_log_cdf(log_add_exp(log_cdf(a), log(u) + mass))
    } else {
        // the same from the right: Phi(-x) = Phi(-b) + (1 - u) (Phi(b) - Phi(a))
        -inverse_log_cdf(log_add_exp(log_cdf(-b), log1p(-u) + mass))
    }
}

/// ln(e^x + e^y) without overflow.
fn log_add_exp(x: f64, y: f64) -> f64 {
    let (low, high) = if x < y { (x, y) } else { (y, x) };
    if low == f64::NEG_INFINITY { high } else { high + log1p(exp(low - high)) }
}

/// The x with ln Phi(x) = y, by Newton's method on the concave function ln Phi.
fn inverse_log_cdf(y: f64) -> f64 {
    // Near y = 0 the other tail is solved: Phi(-x) = 1 - e^y.
    let flipped = y > -0.01;
    let z = if flipped { log(-expm1(y)) } else { y };
    let mut x = if z < -5.0 {
        -sqrt(-2.0 * (z + HALF_LN_TWO_PI))
    } else {
        // The logistic approximation of Phi has standard deviation pi / sqrt(3).
        -(sqrt(3.0) / PI) * log(expm1(-z))
    };
    for _ in 0..100 {
        // x <- x - (ln Phi(x) - z) Phi(x) / phi(x)
        let log_phi = log_cdf(x);
        let step = (log_phi - z) * exp(log_phi + 0.5 * x * x + HALF_LN_TWO_PI);
        // Beyond some 1e9 a step is rounding alone; the start is exact to the last digits there.
        if !step.is_finite() {
            break;
        }
        x -= step;
        // Convergence is quadratic: after such a step the error is of the order of rounding.
        if step.abs() < 1e-8 * x.abs() || x == 0.0 {
            break;
        }
    }
    if flipped { -x } else { x }
}
