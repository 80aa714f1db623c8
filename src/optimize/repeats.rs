//! Several trials of one point: what they amount to together, and which point to repeat to be sure of the best.
//!
//! The rule: complete trials whose parameters (and gains, where they are kept) are equal to the bit are repeats of one
//! point. Its value is the mean of
//! all their values, falls included with the value that they were told with; it is shown as k/n, k of n repeats stood,
//! with the standard deviation of a single repeat. TPE sees every repeat as a trial of its own, as Optuna does; the
//! Gaussian process weighs them by the noise that it estimates.

use super::sampler::Direction;
use super::trial::{GAINS, Trial, TrialState};
use std::f64::consts::PI;

/// Repeats that a contender must have before anything is concluded from its spread.
pub const LEAST_REPEATS: usize = 3;

/// A point and all that its repeats say.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// The parameters.
    pub parameters: Vec<(String, f64)>,
    /// Numbers of its trials, ascending.
    pub trials: Vec<u32>,
    /// Values of these trials.
    pub values: Vec<f64>,
    /// k: how many of them did not fall.
    pub stood: usize,
}

impl Point {
    /// n: how often it was run.
    pub fn repeats(&self) -> usize {
        self.values.len()
    }

    /// Mean value of a repeat.
    pub fn mean(&self) -> f64 {
        self.values.iter().sum::<f64>() / self.repeats() as f64
    }

    /// Standard deviation of a single repeat, from two repeats on.
    pub fn deviation(&self) -> Option<f64> {
        (self.repeats() > 1).then(|| (self.squares() / (self.repeats() - 1) as f64).sqrt())
    }

    /// Sum of squared differences from the mean.
    fn squares(&self) -> f64 {
        let mean = self.mean();
        self.values.iter().map(|v| (v - mean) * (v - mean)).sum()
    }
}

/// All points that have a complete trial, in the order of their first trials.
pub fn points(trials: &[Trial]) -> Vec<Point> {
    let mut points: Vec<Point> = Vec::new();
    let complete = trials.iter().filter(|t| t.state == TrialState::Complete);
    for (trial, value) in complete.filter_map(|t| Some((t, t.value?))) {
        let first = |p: &Point| trials.iter().find(|t| t.number == p.trials[0]);
        let conditions = |t: &Trial| t.user_attributes.get(GAINS).cloned();
        let known = points
            .iter_mut()
            .find(|p| same(&p.parameters, &trial.parameters) && first(p).map(conditions) == Some(conditions(trial)));
        let stood = usize::from(!trial.is_fall());
        match known {
            Some(point) => {
                point.trials.push(trial.number);
                point.values.push(value);
                point.stood += stood;
            }
            None => points.push(Point {
                parameters: trial.parameters.clone(),
                trials: vec![trial.number],
                values: vec![value],
                stood,
            }),
        }
    }
    points
}

fn same(a: &[(String, f64)], b: &[(String, f64)]) -> bool {
    let has = |(name, value): &(String, f64)| b.iter().any(|(n, v)| n == name && v.to_bits() == value.to_bits());
    a.len() == b.len() && a.iter().all(has)
}

/// The best `count` points by mean value, best first; earlier ones first among equals.
pub fn contenders(trials: &[Trial], direction: Direction, count: usize) -> Vec<Point> {
    let mut points = points(trials);
    points.sort_by(|a, b| direction.best_first(a.mean(), b.mean()));
    points.truncate(count);
    points
}

/// What to do to confirm the best of some points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Confirmation {
    /// Run the contender of this index once more.
    Repeat(usize),
    /// The contender of this index leads, with at least this confidence over all others together.
    Leads(usize, f64),
}

/// Decides from the repeats so far of contenders that were chosen once ([`contenders`]) and stay the same (the values
/// that chose them flatter them, so each is repeated before it is believed).
///
/// First every contender gets [`LEAST_REPEATS`]. Then the leader is compared with each of the others by Student's t-test
/// with the variance pooled over all of them; the confidence in the leader is 1 minus the sum of the chances that another
/// is better (Bonferroni). Below `confidence` the leader or its closest rival is repeated, whichever has fewer repeats.
/// Without any spread at all (a simulator without noise) the leader leads for certain.
///
/// Looking after each repeat finds a leader too early more often than looking once: over many confirmations of equally
/// good contenders that matters, for contenders that differ it does not.
pub fn confirm(contenders: &[Point], direction: Direction, confidence: f64) -> Confirmation {
    let fewest = (0..contenders.len()).min_by_key(|i| contenders[*i].repeats());
    let Some(fewest) = fewest.filter(|_| contenders.len() > 1) else { return Confirmation::Leads(0, 1.0) };
    if contenders[fewest].repeats() < LEAST_REPEATS {
        return Confirmation::Repeat(fewest);
    }
    let Standing { leader, confidence: reached, rival } = standing(contenders, direction);
    if reached >= confidence {
        return Confirmation::Leads(leader, reached);
    }
    let leader_has_fewer = contenders[leader].repeats() <= contenders[rival].repeats();
    Confirmation::Repeat(if leader_has_fewer { leader } else { rival })
}

/// Who is ahead, and how surely.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Index of the contender with the best mean.
    pub leader: usize,
    /// Confidence in it over all others together; 0 while there is no spread to tell it from.
    pub confidence: f64,
    /// Index of the contender that may best be better; the leader itself where there is no other.
    pub rival: usize,
}

/// Who is ahead of some contenders (at least one), by the test of [`confirm`].
pub fn standing(contenders: &[Point], direction: Direction) -> Standing {
    let mut order: Vec<usize> = (0..contenders.len()).collect();
    order.sort_by(|a, b| direction.best_first(contenders[*a].mean(), contenders[*b].mean()));
    let leader = order[0];
    let freedom = contenders.iter().map(|p| p.repeats() - 1).sum::<usize>();
    if freedom == 0 {
        return Standing { leader, confidence: 0.0, rival: order.get(1).copied().unwrap_or(leader) };
    }
    // s^2 = sum_i sum_j (y_ij - mean_i)^2 / sum_i (n_i - 1)
    let variance = contenders.iter().map(Point::squares).sum::<f64>() / freedom as f64;
    let doubt = |rival: usize| {
        let (a, b) = (&contenders[leader], &contenders[rival]);
        // t = (mean_a - mean_b) / (s sqrt(1/n_a + 1/n_b))
        let difference = (a.mean() - b.mean()).abs();
        let error = (variance * (1.0 / a.repeats() as f64 + 1.0 / b.repeats() as f64)).sqrt();
        if error > 0.0 { 1.0 - student_cdf(difference / error, freedom) } else { 0.0 }
    };
    let doubts: Vec<(usize, f64)> = order[1..].iter().map(|&rival| (rival, doubt(rival))).collect();
    let confidence = (1.0 - doubts.iter().map(|(_, d)| d).sum::<f64>()).max(0.0);
    let rival = doubts.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(leader, |(rival, _)| rival);
    Standing { leader, confidence, rival }
}

/// Distribution function of Student's t for t >= 0 and a whole number of degrees of freedom
/// (Abramowitz and Stegun, 26.7.3 and 26.7.4).
pub fn student_cdf(t: f64, freedom: usize) -> f64 {
    let n = freedom as f64;
    let theta = (t / n.sqrt()).atan();
    let (sin, cos) = theta.sin_cos();
    // A(t|n), the mass of (-t, t), as a sum of powers of cos theta
    let powers = |first: f64, start: usize| {
        let mut term = first;
        let mut sum = if freedom > start { first } else { 0.0 };
        let mut k = start + 1;
        while k + 1 < freedom {
            term *= cos * cos * k as f64 / (k + 1) as f64;
            sum += term;
            k += 2;
        }
        sum
    };
    let within = if freedom % 2 == 1 {
        // 2/pi (theta + sin (cos + 2/3 cos^3 + ... ))
        2.0 / PI * (theta + sin * powers(cos, 1))
    } else {
        // sin (1 + 1/2 cos^2 + 1*3/(2*4) cos^4 + ...)
        sin * powers(1.0, 0)
    };
    0.5 + 0.5 * within
}
