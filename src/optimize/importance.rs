//! Importance of each parameter: PED-ANOVA.
//!
//! Watanabe, Bansal and Hutter, "PED-ANOVA: Efficiently Quantifying Hyperparameter Importance in Arbitrary Subspaces",
//! IJCAI 2023 (arXiv:2304.10255). The importance of a parameter is the Pearson divergence between two densities along it:
//! that of the best trials and that of all trials; it is 0 if the best are distributed like all. The settings are those
//! of Optuna's `PedAnovaImportanceEvaluator`: the best tenth against all, values rounded to a grid of 50, Scott's
//! bandwidth. Parameters whose bounds have changed are weighted per bounds (Conditional PED-ANOVA, arXiv:2601.20800,
//! theorem 4.2).

use super::ask::Direction;
use super::space::{Range, Space};
use super::trial::{Trial, TrialState};
use super::truncnorm::log_mass;
use libm::exp;

/// Share of the trials that counts as best: gamma'.
const BEST: f64 = 0.1;
/// Grid cells per parameter.
const GRID: usize = 50;
/// Least number of trials with the same bounds; bounds of fewer trials are ignored.
const FEWEST: usize = 2;
/// Least bandwidth, in cells: 90 % of the narrowest kernel lies within half a cell of its centre.
const NARROWEST: f64 = 0.5 / 1.64;
/// Keeps the quotient of two densities finite.
const FLOOR: f64 = 1e-12;

/// The importance of every parameter of the space, in its order: the divergences times the square of the share of best
/// trials, as Optuna reports them before normalization. Empty with fewer than two finished trials.
pub fn divergences(trials: &[Trial], space: &Space, direction: Direction) -> Vec<(String, f64)> {
    let finite = |t: &&Trial| t.state == TrialState::Complete && t.value.is_some_and(f64::is_finite);
    let all: Vec<&Trial> = trials.iter().filter(finite).collect();
    if all.len() < 2 {
        return Vec::new();
    }
    let value = |t: &Trial| t.value.unwrap_or(f64::NAN);
    let mut ranked = all.clone();
    ranked.sort_by(|a, b| direction.best_first(value(a), value(b)));
    let worst = value(ranked[(BEST * all.len() as f64).ceil() as usize - 1]);
    // Trials equal to the worst of the best count as best too.
    let is_best = |t: &&Trial| direction.best_first(value(t), worst).is_le();
    let best_count = all.iter().copied().filter(|t| is_best(t)).count() as f64;
    let gamma = best_count / all.len() as f64;
    let importance = |name: &str| {
        let mut sum = 0.0;
        let mut seen: Vec<Range> = Vec::new();
        for range in all.iter().filter_map(|t| t.distribution(name)?.range()) {
            if range.is_point() || seen.contains(&range) {
                continue;
            }
            seen.push(range);
            let with: Vec<&Trial> =
                all.iter().copied().filter(|t| t.distribution(name).and_then(|d| d.range()) == Some(range)).collect();
            let best: Vec<&Trial> = with.iter().copied().filter(|t| is_best(t)).collect();
            if with.len() < FEWEST || best.is_empty() {
                continue;
            }
            // alpha^2 / beta, the shares of these bounds among the best and among all
            let (alpha, beta) = (best.len() as f64 / best_count, with.len() as f64 / all.len() as f64);
            let [best, with] = [best, with].map(|trials| cells(&trials, name, range));
            sum += alpha * alpha / beta * pearson(&density(&best), &density(&with));
        }
        gamma * gamma * sum
    };
    space.parameters().iter().map(|p| (p.name.clone(), importance(&p.name))).collect()
}

/// Number of trials in each cell of the parameter's grid.
fn cells(trials: &[&Trial], name: &str, range: Range) -> [f64; GRID] {
    let mut counts = [0.0; GRID];
    let (low, high) = range.inner_bounds();
    let step = (high - low) / (GRID - 1) as f64;
    for x in trials.iter().filter_map(|t| t.parameter(name)).map(|v| range.inner(v)) {
        // The nearest cell, the lower of two; values outside the bounds belong to the outermost cell.
        let cell = ((x - low) / step - 0.5).ceil().clamp(0.0, (GRID - 1) as f64);
        counts[cell as usize] += 1.0;
    }
    counts
}

/// The density of counted cells: a normal kernel per occupied cell, weighted by its count, and a broad prior of weight 1,
/// each truncated to the grid and integrated over its cells.
fn density(counts: &[f64; GRID]) -> [f64; GRID] {
    let used: Vec<(f64, f64)> = (0..GRID).map(|i| (i as f64, counts[i])).filter(|(_, n)| *n > 0.0).collect();
    let total: f64 = used.iter().map(|(_, n)| n).sum();
    let mean = used.iter().map(|(x, n)| x * n).sum::<f64>() / total;
    let squares: f64 = used.iter().map(|(x, n)| (x - mean) * (x - mean) * n).sum();
    let deviation = (squares / (total - 1.0).max(1.0)).sqrt();
    // Scott's rule with the interquartile range: 1.059 min(IQR / 1.34, s) n^(-1/5)
    let width = 1.059 * (quartile_range(&used, total) / 1.34).min(deviation) * libm::pow(total, -0.2);
    let width = width.max(NARROWEST);
    let kernels = used.iter().map(|&(x, n)| (x, width, n));
    let prior = ((GRID - 1) as f64 / 2.0, GRID as f64, 1.0);
    let mut density = [0.0; GRID];
    for (centre, width, weight) in kernels.chain([prior]) {
        let at = |x: f64| (x - centre) / width;
        let whole = log_mass(at(-0.5), at(GRID as f64 - 0.5));
        for (i, p) in density.iter_mut().enumerate() {
            let cell = log_mass(at(i as f64 - 0.5), at(i as f64 + 0.5));
            *p += weight / (total + 1.0) * exp(cell - whole);
        }
    }
    density
}

/// Interquartile range: from the first cell that reaches a quarter of the count to the first above three quarters.
fn quartile_range(used: &[(f64, f64)], total: f64) -> f64 {
    let reaches = |reached: &dyn Fn(f64) -> bool| {
        let mut sum = 0.0;
        let place = used.iter().position(|(_, n)| {
            sum += n;
            reached(sum)
        });
        used[place.unwrap_or(used.len() - 1)].0
    };
    let (quarter, three_quarters) = ((total / 4.0).floor(), (total * 3.0 / 4.0).floor());
    reaches(&|sum| sum > three_quarters) - reaches(&|sum| sum >= quarter)
}

/// Pearson's divergence: sum q (p/q - 1)^2.
fn pearson(p: &[f64; GRID], q: &[f64; GRID]) -> f64 {
    let term = |(p, q): (&f64, &f64)| {
        let (p, q) = (p + FLOOR, q + FLOOR);
        q * (p / q - 1.0) * (p / q - 1.0)
    };
    p.iter().zip(q).map(term).sum()
}
