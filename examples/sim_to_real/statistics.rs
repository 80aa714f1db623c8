//! Means and their differences.

use quadfrog::optimize::repeats::student_cdf;

/// Mean and standard error.
pub(super) fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, (variance / n).sqrt())
}

/// Two-sided p of the paired t-test.
pub(super) fn p_value(differences: &[f64]) -> f64 {
    let (mean, error) = mean(differences);
    if error > 0.0 { 2.0 * (1.0 - student_cdf((mean / error).abs(), differences.len() - 1)) } else { 1.0 }
}
