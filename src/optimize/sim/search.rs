//! The gain of a jump less the price of its falls, and the search for the point where it is largest.

use super::history::History;
use super::model::{StandingModel, ValueModel};
use crate::optimize::ask::{SamplerConfig, Streams};
use crate::optimize::gp::{log_improvement, share_beside};
use crate::optimize::prior::Prior;
use crate::optimize::prior::terms::{Ensemble, Features};
use crate::optimize::sobol::Sobol;
use libm::{exp, log, pow, sqrt};
use std::cmp::Ordering;

/// Factor of the price for each fall in a row.
const ESCALATION: f64 = 10.0;
/// Probability of standing from which a jump that stood can be the incumbent: one that stood by luck is none.
const INCUMBENT: f64 = 0.5;
/// Probability of a fall of a point that is sure enough to be proposed where no gain is worth its risk, as a share of the largest that
/// is accepted.
const SURE: f64 = 0.6;
/// Factor of the accepted probability of a fall where standing is learned without the simulated robots: it is uncertain everywhere but
/// about the jumps that stood, and with the accepted one the search would stay there.
const WITHOUT_WORLDS: f64 = 3.0;
/// Risk of a fall up to which the first jump is chosen by its gain where no point has the accepted one, as a factor of the smallest
/// risk: the surest point alone may be next to no jump.
const NEARLY_SUREST: f64 = 1.25;
/// Smallest J*, in scaled units.
const LEAST_STAR: f64 = 1e-3;
/// Half widths of the local rounds, as shares of the box.
const WIDTHS: [f64; 3] = [0.08, 0.03, 0.01];
/// Points of a local round.
const LOCAL: u32 = 100;
/// Best candidates around which the first local round searches.
const CENTRES: usize = 4;

/// Prediction at a point.
#[derive(Debug, Clone, Copy)]
pub struct PointPrediction {
    /// Mean of the value, scaled.
    pub mean: f64,
    /// Its variance, without noise.
    pub variance: f64,
    /// Probability of standing.
    pub p_stand: f64,
}

/// The model that scores points.
pub struct Acquisition<'a> {
    /// The prior.
    pub prior: &'a Prior,
    /// Its surfaces.
    pub ensemble: &'a Ensemble,
    /// The robot's value.
    pub value: ValueModel,
    /// The robot's standing.
    pub standing: StandingModel,
    /// Largest predicted mean of the jumps that stood, scaled; none before one has.
    incumbent: Option<f64>,
    /// J*, scaled and counted from [`Acquisition::origin`].
    star: f64,
    /// The value of a fall, scaled: 0, or the lowest value of the worlds where that is negative, so that no jump that stands counts less.
    origin: f64,
    /// lambda 10^c for c falls in a row: price of a fall, as a share of J*.
    price: f64,
    /// Probability of standing below which no gain is worth a jump.
    least: f64,
    /// Points of void and of running trials.
    avoided: Vec<Vec<f64>>,
}

/// Reason to choose a point, the weakest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Reason {
    /// Not even that it stands: the surest is the best.
    Unsure,
    /// It stands, and its gain is not worth its risk: the one that may be the highest is the best.
    Sure,
    /// Its gain is worth its risk: U > 0, and P is large enough.
    Gain,
}

/// Rank of a point: reason, then merit.
#[derive(Debug, Clone, Copy)]
struct Score {
    reason: Reason,
    merit: f64,
}

impl Score {
    fn cmp(&self, other: &Score) -> Ordering {
        self.reason.cmp(&other.reason).then(self.merit.total_cmp(&other.merit))
    }
}

/// A candidate that was scored.
#[derive(Debug, Clone)]
pub struct Scored {
    /// The point, in the prior's unit cube.
    pub point: Vec<f64>,
    score: Score,
    /// Prediction there.
    pub prediction: PointPrediction,
}

impl Scored {
    /// Whether the gain is worth the risk of a fall.
    pub fn is_worth_the_risk(&self) -> bool {
        self.score.reason == Reason::Gain
    }
}

impl<'a> Acquisition<'a> {
    /// Computes incumbent and price from the fitted models. `candidates` count for J* before the first jump that stood.
    pub fn new(
        (prior, ensemble): (&'a Prior, &'a Ensemble),
        (value, standing): (ValueModel, StandingModel),
        history: &History,
        candidates: &[(Vec<f64>, Features)],
        config: &SamplerConfig,
    ) -> Option<Self> {
        let origin = (ensemble.lowest.min(0.0) - ensemble.offset) / ensemble.scale;
        let at = |x: &[f64], f: &Features| (value.predict(x, &f.value).0, standing.probability(x, f));
        let stood: Vec<(f64, f64)> = history.stood().map(|jump| at(&jump.point, &jump.features)).collect();
        let safe = stood.iter().filter(|(_, p)| *p >= INCUMBENT).map(|(mean, _)| *mean).reduce(f64::max);
        // All stood by luck: the surest of them, less a unit.
        let lucky = || stood.iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a }).map(|(mean, _)| mean - 1.0);
        let incumbent = safe.or_else(lucky);
        let accepted = 1.0 - config.least_p_stand;
        let accepted = if standing.has_worlds() { accepted } else { WITHOUT_WORLDS * accepted };
        let (star, accepted) = match incumbent {
            Some(incumbent) => (incumbent - origin, accepted),
            None => {
                let expected: Vec<(f64, f64)> = candidates.iter().map(|(x, f)| at(x, f)).collect();
                let star = expected.iter().map(|(mean, p)| p * (mean - origin)).fold(0.0, f64::max);
                let smallest = expected.iter().map(|(_, p)| 1.0 - p).fold(1.0, f64::min);
                (star, accepted.max(NEARLY_SUREST * smallest))
            }
        };
        let value = value.believing(&history.pending)?;
        let price = config.fall_price * pow(ESCALATION, history.falls_in_a_row() as f64);
        let avoided = history.void.iter().chain(history.pending.iter().map(|(x, _)| x)).cloned().collect();
        let least = 1.0 - accepted;
        let star = star.max(LEAST_STAR);
        Some(Acquisition { prior, ensemble, value, standing, incumbent, star, origin, price, least, avoided })
    }

    /// Predicts at a point with its terms.
    pub fn predict(&self, x: &[f64], features: &Features) -> PointPrediction {
        let (mean, variance) = self.value.predict(x, &features.value);
        PointPrediction { mean, variance, p_stand: self.standing.probability(x, features) }
    }

    /// Scaled value by which a jump that stood is compared for the best: what a repetition is expected to be worth, P times the mean
    /// counted from the value of a fall.
    pub fn worth(&self, prediction: &PointPrediction) -> f64 {
        let gain = prediction.mean - self.origin;
        // Below the value of a fall the risk of one is no loss.
        self.origin + gain.min(gain * prediction.p_stand)
    }

    /// U = P EI - lambda 10^c J* (1 - P); before the first jump that stood the gain is J itself. Of the sure points whose gain is not
    /// worth their risk the one of the largest mean + deviation is the best, because EI is next to nothing at all of them; each that
    /// stands makes points beyond it sure. It is counted from the incumbent: near void points the merit is reduced, and of a merit
    /// counted from 0 a hundredth would be more than there is to gain. Of the others the surest is the best.
    fn score(&self, x: &[f64], features: &Features) -> Scored {
        let prediction = self.predict(x, features);
        let PointPrediction { mean, variance, p_stand } = prediction;
        let deviation = sqrt(variance);
        let gain = match self.incumbent {
            None => (mean - self.origin).max(0.0),
            Some(incumbent) => exp(log(deviation) + log_improvement((mean - incumbent) / deviation)),
        };
        let utility = p_stand * gain - self.price * self.star * (1.0 - p_stand);
        let (reason, merit) = if utility > 0.0 && p_stand >= self.least {
            (Reason::Gain, utility)
        } else if 1.0 - p_stand <= SURE * (1.0 - self.least) {
            (Reason::Sure, mean + deviation - self.incumbent.unwrap_or(self.origin))
        } else {
            (Reason::Unsure, p_stand)
        };
        let away = self.away(x);
        let score =
            Score { reason, merit: if merit > 0.0 { merit * away } else { merit / away.max(f64::MIN_POSITIVE) } };
        Scored { point: x.to_vec(), score, prediction }
    }

    /// Returns the share of a gain that void and running trials together leave.
    fn away(&self, x: &[f64]) -> f64 {
        self.avoided.iter().map(|v| share_beside(x, v)).product()
    }

    /// Searches the box, given as bounds in the prior's unit cube, from the candidates over it, in local rounds. Takes one double per
    /// coordinate.
    pub fn best_point(
        &self,
        candidates: &[(Vec<f64>, Features)],
        bounds: &[(f64, f64)],
        streams: &mut Streams,
    ) -> Option<Scored> {
        let scatter = Sobol::new(bounds.len(), &mut streams.model);
        let mut ranked: Vec<Scored> = candidates.iter().map(|(x, features)| self.score(x, features)).collect();
        ranked.sort_by(|a, b| b.score.cmp(&a.score));
        ranked.truncate(CENTRES);
        let mut best = ranked.first()?.clone();
        let mut centres = ranked;
        for (round, width) in WIDTHS.iter().enumerate() {
            let around = |i: u32| {
                let centre = &centres[i as usize % centres.len()].point;
                let offsets = scatter.point(round as u32 * LOCAL + i);
                let place = |((c, o), (low, high)): ((&f64, f64), &(f64, f64))| {
                    (c + width * (high - low) * (2.0 * o - 1.0)).clamp(*low, *high)
                };
                let x: Vec<f64> = centre.iter().zip(offsets).zip(bounds).map(place).collect();
                let features = self.ensemble.features(self.prior, &x);
                self.score(&x, &features)
            };
            let mut scored: Vec<Scored> = (0..LOCAL).map(around).collect();
            scored.sort_by(|a, b| b.score.cmp(&a.score));
            if scored[0].score.cmp(&best.score).is_gt() {
                best = scored[0].clone();
            }
            centres = std::iter::once(best.clone()).chain(scored.into_iter().take(2)).collect();
        }
        Some(best)
    }
}
