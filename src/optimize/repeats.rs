//! Repeats: several trials of one point, the best trial, and the rule that confirms it.
//!
//! Complete trials whose parameters (and gains, if recorded) are equal to the bit are repeats of one point. The value of
//! a point is the mean over its repeats, falls included with their value; displays show it as k/n (k of n repeats without
//! a fall) with the standard deviation of a single repeat. TPE treats every repeat as a trial of its own, as Optuna does;
//! the Gaussian process accounts for them by its estimated noise.

use super::ask::Direction;
use super::trial::{GAINS, Trial, TrialState, value_of};
use std::f64::consts::PI;

/// Least repeats of a contender before its spread is used.
pub const LEAST_REPEATS: usize = 3;

/// A point and the results of its repeats.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RepeatedPoint {
    /// The parameters.
    pub parameters: Vec<(String, f64)>,
    /// Numbers of its trials, ascending.
    pub trials: Vec<u32>,
    /// Values of these trials.
    pub values: Vec<f64>,
    /// k: number of trials without a fall.
    pub without_fall: usize,
}

impl RepeatedPoint {
    /// n: number of trials.
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

/// The result of one trial of a point; `G` holds the gains with which it ran.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RepeatResult<'a, G> {
    /// Number of the trial.
    pub trial: u32,
    /// Parameters of the trial.
    pub parameters: &'a [(String, f64)],
    /// Gains of the trial.
    pub gains: G,
    /// Value of the trial.
    pub value: f64,
    /// Whether the trial was a fall.
    pub is_fall: bool,
}

/// All points with a complete trial, in the order of their first trials.
pub fn points(trials: &[Trial]) -> Vec<RepeatedPoint> {
    let complete = trials.iter().filter(|t| t.state == TrialState::Complete);
    points_of(complete.filter_map(|t| {
        let gains = t.user_attributes.get(GAINS);
        Some(RepeatResult { trial: t.number, parameters: &t.parameters, gains, value: t.value?, is_fall: t.is_fall() })
    }))
}

/// The points of results with equal parameters and gains, in the order of their first results. A result that is infinite or no
/// number has no mean with others and is left out.
pub fn points_of<'a, G: PartialEq>(results: impl IntoIterator<Item = RepeatResult<'a, G>>) -> Vec<RepeatedPoint> {
    let mut points: Vec<(G, RepeatedPoint)> = Vec::new();
    for RepeatResult { trial, parameters, gains, value, is_fall } in results {
        if !value.is_finite() {
            continue;
        }
        let known = points.iter().position(|(g, point)| *g == gains && same(&point.parameters, parameters));
        let index = known.unwrap_or(points.len());
        if index == points.len() {
            points.push((gains, RepeatedPoint { parameters: parameters.to_vec(), ..RepeatedPoint::default() }));
        }
        let point = &mut points[index].1;
        point.trials.push(trial);
        point.values.push(value);
        point.without_fall += usize::from(!is_fall);
    }
    points.into_iter().map(|(_, point)| point).collect()
}

/// Whether two trials are repeats of one point, whatever their states: equal parameters and gains.
pub fn is_repeat(one: &Trial, other: &Trial) -> bool {
    let (gains, others) = (one.user_attributes.get(GAINS), other.user_attributes.get(GAINS));
    same(&one.parameters, &other.parameters) && gains == others
}

fn same(a: &[(String, f64)], b: &[(String, f64)]) -> bool {
    let has = |(name, value): &(String, f64)| value_of(b, name).map(f64::to_bits) == Some(value.to_bits());
    a.len() == b.len() && a.iter().all(has)
}

/// The trials that were better than all before them, in order; the last is the best, the earliest among equals. `trials`:
/// candidates in the order of their numbers, each with its number and its own value; `mean`: value of the repeated point
/// of a trial, which replaces the trial's own.
pub fn improvements<T>(
    trials: impl IntoIterator<Item = (T, u32, f64)>,
    mean: impl Fn(u32) -> Option<f64>,
    direction: Direction,
) -> impl Iterator<Item = T> {
    let mut best = None;
    trials.into_iter().filter_map(move |(trial, number, value)| {
        let value = mean(number).unwrap_or(value);
        let better = !value.is_nan() && best.is_none_or(|best| direction.best_first(value, best).is_lt());
        better.then(|| best = Some(value)).map(|()| trial)
    })
}

/// The best feasible complete trial that did not fall, with repeats averaged; the earliest among equals.
pub fn best(trials: &[Trial], direction: Direction) -> Option<&Trial> {
    let points = points(trials);
    let mean = |number| points.iter().find(|point| point.trials.contains(&number)).map(RepeatedPoint::mean);
    let candidates = trials.iter().filter(|t| t.state == TrialState::Complete && t.violation() <= 0.0 && !t.is_fall());
    improvements(candidates.filter_map(|t| Some((t, t.number, t.value?))), mean, direction).last()
}

/// The point of the trial `best`, which a sampler's model may have chosen, then the others by mean value, best first, `count` in all;
/// earlier ones first among equals.
pub fn contenders(trials: &[Trial], direction: Direction, count: usize, best: Option<u32>) -> Vec<RepeatedPoint> {
    contenders_of(points(trials), direction, count, best)
}

/// Some of the points, as [`contenders`].
pub fn contenders_of(
    mut points: Vec<RepeatedPoint>,
    direction: Direction,
    count: usize,
    best: Option<u32>,
) -> Vec<RepeatedPoint> {
    let is_best = |point: &RepeatedPoint| best.is_some_and(|best| point.trials.contains(&best));
    points.sort_by(|a, b| is_best(b).cmp(&is_best(a)).then(direction.best_first(a.mean(), b.mean())));
    points.truncate(count);
    points
}

/// The number of repeats that the points need at least to be compared: each of them [`LEAST_REPEATS`] jumps.
pub fn least_repeats<'a>(compared: impl IntoIterator<Item = &'a RepeatedPoint>) -> usize {
    compared.into_iter().map(|point| LEAST_REPEATS.saturating_sub(point.repeats())).sum()
}

/// Next step in the confirmation of the best of some points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Confirmation {
    /// Repeat the contender of this index.
    Repeat(usize),
    /// The contender of this index leads, with this confidence over all others together.
    Leads(usize, f64),
}

/// Decides the next step from the repeats so far of contenders that were chosen once ([`contenders`]) and stay the same:
/// the values by which they were chosen are biased upwards, so each is repeated.
///
/// First every contender gets [`LEAST_REPEATS`]. Then the leader is compared with each of the others by Student's t-test
/// with the variance pooled over all of them; the confidence in the leader is 1 minus the sum of the probabilities that
/// another is better (Bonferroni). Below `confidence` the leader or its closest rival is repeated, whichever has fewer
/// repeats. Without any spread (a simulator without noise) the confidence is 1.
///
/// Testing after each repeat finds a leader too early more often than testing once; this matters over many confirmations
/// of equally good contenders, not for contenders that differ.
pub fn confirm(contenders: &[RepeatedPoint], direction: Direction, confidence: f64) -> Confirmation {
    let fewest = (0..contenders.len()).min_by_key(|i| contenders[*i].repeats());
    let Some(fewest) = fewest.filter(|_| contenders.len() > 1) else { return Confirmation::Leads(0, 1.0) };
    if contenders[fewest].repeats() < LEAST_REPEATS {
        return Confirmation::Repeat(fewest);
    }
    let Ranking { leader, confidence: reached, rival } = rank(contenders, direction);
    if reached >= confidence {
        return Confirmation::Leads(leader, reached);
    }
    let leader_has_fewer = contenders[leader].repeats() <= contenders[rival].repeats();
    Confirmation::Repeat(if leader_has_fewer { leader } else { rival })
}

/// Leader and rival of some contenders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ranking {
    /// Index of the contender with the best mean.
    pub leader: usize,
    /// Confidence in the leader over all others together; 0 while no contender has two repeats.
    pub confidence: f64,
    /// Index of the contender most likely to be better; the leader itself without another.
    pub rival: usize,
}

/// Ranks some contenders (at least one) by the test of [`confirm`].
pub fn rank(contenders: &[RepeatedPoint], direction: Direction) -> Ranking {
    let mut order: Vec<usize> = (0..contenders.len()).collect();
    order.sort_by(|a, b| direction.best_first(contenders[*a].mean(), contenders[*b].mean()));
    let leader = order[0];
    let freedom = contenders.iter().map(|p| p.repeats() - 1).sum::<usize>();
    if freedom == 0 {
        return Ranking { leader, confidence: 0.0, rival: order.get(1).copied().unwrap_or(leader) };
    }
    // s^2 = sum_i sum_j (y_ij - mean_i)^2 / sum_i (n_i - 1)
    let variance = contenders.iter().map(RepeatedPoint::squares).sum::<f64>() / freedom as f64;
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
    Ranking { leader, confidence, rival }
}

/// Distribution function of Student's t for t >= 0 and a whole number of degrees of freedom
/// (Abramowitz and Stegun, 26.7.3 and 26.7.4).
pub fn student_cdf(t: f64, freedom: usize) -> f64 {
    let n = freedom as f64;
    let theta = libm::atan(t / n.sqrt());
    let (sin, cos) = libm::sincos(theta);
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
