//! The Gaussian-process sampler, for robots: a trial is expensive, computing time is not.
//!
//! A space-filling start; then regression with a Matern 5/2 kernel, a lengthscale per parameter and estimated noise
//! ([`process`]); the next point maximizes the logarithm of the expected improvement (Ament et al., "Unexpected
//! improvements to expected improvement for Bayesian optimization", NeurIPS 2023) times the probability of standing
//! ([`falls`]). Running trials of other workers count with their expected value.
//!
//! A fall's value of 0 beside a good jump is a cliff, which forces short lengthscales and a large noise on the whole
//! space. So a fall enters the regression with the lower quartile of the values without a fall (padding, as Wakabayashi
//! et al., "Bayesian optimization with experimental failure", npj Comput. Mater. 8, 180, 2022, who take the worst value);
//! the classifier learns the position of the cliff.
//!
//! A void trial gives no value, so the acquisition is reduced around its point (local penalization, Gonzalez et al., "Batch
//! Bayesian optimization via local penalization", AISTATS 2016).

pub mod ascent;
pub mod falls;
pub mod laplace;
pub mod process;
pub mod regression;

use super::ask::{Ask, Candidate, Direction, Expectation, Prediction, Streams};
use super::model_free;
use super::observations::{ObservedTrial, TrialPoints};
use super::sobol::Sobol;
use super::space::Parameter;
use super::truncnorm::{HALF_LN_TWO_PI, log_cdf};
use falls::StandProbability;
use libm::{exp, expm1, log, log1p};
use process::GaussianProcess;

/// Points over the whole space at which the acquisition is evaluated.
const SCATTERED: u32 = 512;
/// Points per cloud around a centre at which it is evaluated as well.
const CLOUD: u32 = 32;
/// Half widths of the clouds of a centre, in units of the cube.
const CLOUD_WIDTHS: [f64; 3] = [0.2, 0.05, 0.01];
/// Number of best trials that are centres.
const CENTRES: usize = 3;
/// Distance from a void trial, in units of the cube, at which the acquisition is reduced to 0.39 of its value.
const VOID_RADIUS: f64 = 0.1;
/// Finished trials from which on a probability of standing below [`LEAST_P_STAND`] reduces the acquisition. Before, the classifier
/// knows little, and the search would stay among the careful points.
const CAREFUL_FROM: usize = 10;
/// Probability of standing that a proposal should have: about 1.5 falls of 20 jumps fewer at no loss of value
/// (`src/optimize/README.md`).
const LEAST_P_STAND: f64 = 0.8;
/// Reduction of the acquisition per unit of missing probability. Among points that are all too risky a sure one is chosen; a larger
/// reduction would give several workers the same one, whatever the others run.
const TOO_RISKY: f64 = 100.0;
/// Number of best points from which the gradient ascent starts.
const CLIMBS: usize = 6;

/// Proposes the next point for the given parameters.
pub fn propose(ask: &Ask<'_>, streams: &mut Streams) -> Candidate {
    let parameters = ask.space.parameters();
    let given: Vec<Option<f64>> = parameters.iter().map(|p| ask.given(p)).collect();
    if given.iter().all(Option::is_some) {
        return given.into_iter().flatten().collect::<Vec<f64>>().into();
    }
    let model = Acquisition::of(ask, points_of(ask));
    let Some(model) = model else { return model_free::sobol(ask, streams) };
    let bound =
        |(p, given): (&Parameter, &Option<f64>)| given.map_or((0.0, 1.0), |v| (p.range.scale(v), p.range.scale(v)));
    let bounds: Vec<(f64, f64)> = parameters.iter().zip(&given).map(bound).collect();
    let unit = model.best_point(&bounds, streams);
    let expected = Some(model.expectation(&unit, ask.direction));
    let values =
        parameters.iter().zip(&given).zip(unit).map(|((p, given), u)| given.unwrap_or_else(|| p.range.unscale(u)));
    Candidate { expected, ..values.collect::<Vec<f64>>().into() }
}

/// Returns what the model expects of a trial at `values`; none before the model proposes.
pub fn expect(ask: &Ask<'_>, values: &[f64]) -> Option<Expectation> {
    let model = Acquisition::of(ask, points_of(ask))?;
    let point: Vec<f64> = ask.space.parameters().iter().zip(values).map(|(p, v)| p.range.scale(*v)).collect();
    Some(model.expectation(&point, ask.direction))
}

/// Returns what the model says of the finished trials; empty before the model proposes.
pub fn predict(ask: &Ask<'_>) -> Vec<Prediction> {
    let points = points_of(ask);
    let observed = points.observed.clone();
    let Some(model) = Acquisition::of(ask, points) else { return Vec::new() };
    let prediction = |trial: &ObservedTrial| {
        let Expectation { value, deviation, .. } = model.expectation(&trial.point, ask.direction);
        Prediction { trial: trial.number, stood: trial.stood, value, deviation, worth: value }
    };
    observed.iter().map(prediction).collect()
}

/// The trials of the question as points of the unit cube of its space.
fn points_of(ask: &Ask<'_>) -> TrialPoints {
    TrialPoints::of(ask.trials, ask.space.parameters(), ask.direction)
}

/// One value per trial; falls have the lower quartile of the other values.
fn values_with_falls(observed: &[ObservedTrial]) -> Vec<f64> {
    let mut sorted: Vec<f64> = observed.iter().filter(|trial| trial.stood).map(|trial| trial.value).collect();
    sorted.sort_by(f64::total_cmp);
    let low = sorted.get(sorted.len() / 4).copied().unwrap_or(0.0);
    observed.iter().map(|trial| if trial.stood { trial.value } else { low }).collect()
}

/// The acquisition function: the expected gain of a trial at a point.
struct Acquisition {
    process: GaussianProcess,
    stand_probability: Option<StandProbability>,
    /// The largest expected value at the observed points.
    incumbent: f64,
    /// The observed points of largest expected value.
    centres: Vec<Vec<f64>>,
    /// Points of void trials.
    void: Vec<Vec<f64>>,
    /// [`LEAST_P_STAND`], once it counts.
    least_p_stand: f64,
}

impl Acquisition {
    /// Learns from the trials of a study; none before there are enough.
    fn of(ask: &Ask<'_>, points: TrialPoints) -> Option<Self> {
        let stood = points.observed.iter().filter(|trial| trial.stood).count();
        let enough = points.observed.len() >= ask.config.startup_trials(ask.space) && stood >= 2;
        enough.then(|| Acquisition::new(points)).flatten()
    }

    fn new(TrialPoints { observed, pending, void }: TrialPoints) -> Option<Self> {
        let values = values_with_falls(&observed);
        let (points, stood): (Vec<_>, Vec<_>) = observed.into_iter().map(|trial| (trial.point, trial.stood)).unzip();
        let stand_probability = StandProbability::fit(&points, &stood);
        let process = GaussianProcess::fit(points, &values)?;
        let mut ranked: Vec<(f64, &Vec<f64>)> = process.points().iter().map(|p| (process.predict(p).0, p)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let incumbent = ranked.first()?.0;
        let centres = ranked.iter().take(CENTRES).map(|(_, p)| (*p).clone()).collect();
        let least_p_stand = if values.len() >= CAREFUL_FROM { LEAST_P_STAND } else { 0.0 };
        let process = process.believing(&pending)?;
        Some(Acquisition { process, stand_probability, incumbent, centres, void, least_p_stand })
    }

    /// ln EI(x) + ln P(stands at x) - c max(p - P(stands at x), 0) + sum over void points v of ln(1 - exp(-|x - v|^2 / 2 r^2))
    fn value(&self, x: &[f64]) -> f64 {
        let (mean, deviation) = self.process.predict(x);
        let probability = self.stand_probability.as_ref().map_or(1.0, |s| s.probability(x));
        let missing = (self.least_p_stand - probability).max(0.0);
        log(deviation) + log_improvement((mean - self.incumbent) / deviation) + log(probability) - TOO_RISKY * missing
            + self.log_distance(x)
    }

    fn log_distance(&self, x: &[f64]) -> f64 {
        self.void.iter().map(|v| log(share_beside(x, v).max(1e-300))).sum()
    }

    /// The prediction at `x` in the objective's own sign. Falls count with the padding of the regression; before the first fall the
    /// probability of standing is 1.
    fn expectation(&self, x: &[f64], direction: Direction) -> Expectation {
        let (mean, deviation) = self.process.predict(x);
        let value = direction.maximized(mean);
        let p_stand = self.stand_probability.as_ref().map_or(1.0, |s| s.probability(x));
        Expectation { value, deviation, p_stand, worlds: None, worth_the_risk: true }
    }

    /// Returns the point of the box with the largest acquisition. Takes one double per coordinate.
    fn best_point(&self, bounds: &[(f64, f64)], streams: &mut Streams) -> Vec<f64> {
        let scatter = Sobol::new(bounds.len(), &mut streams.model);
        let into_box =
            |x: Vec<f64>| -> Vec<f64> { x.iter().zip(bounds).map(|(x, (low, high))| x.clamp(*low, *high)).collect() };
        let mut candidates: Vec<Vec<f64>> = (0..SCATTERED).map(|i| into_box(scatter.point(i))).collect();
        for centre in &self.centres {
            for (cloud, width) in CLOUD_WIDTHS.iter().enumerate() {
                let around = |i| -> Vec<f64> {
                    let offsets = scatter.point(cloud as u32 * CLOUD + i);
                    centre.iter().zip(offsets).map(|(c, o)| c + width * (2.0 * o - 1.0)).collect()
                };
                candidates.extend((0..CLOUD).map(|i| into_box(around(i))));
            }
        }
        let mut ranked: Vec<(f64, Vec<f64>)> = candidates.into_iter().map(|x| (self.value(&x), x)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let climb = ascent::with_gradient(|x| self.value(x), bounds, 1e-5);
        let summits = ranked.into_iter().take(CLIMBS).map(|(_, x)| ascent::maximize(&climb, &x, bounds, 50));
        summits.reduce(|a, b| if b.1 > a.1 { b } else { a }).map_or_else(|| vec![0.5; bounds.len()], |(x, _)| x)
    }
}

/// 1 - exp(-|x - v|^2 / 2 r^2): what is left of a gain at x beside a void or running trial at v; r is 0.1.
pub fn share_beside(x: &[f64], v: &[f64]) -> f64 {
    let squared: f64 = x.iter().zip(v).map(|(x, v)| (x - v) * (x - v)).sum();
    -expm1(-0.5 * squared / (VOID_RADIUS * VOID_RADIUS))
}

/// ln h(z), h(z) = phi(z) + z Phi(z): the expected improvement of a standard normal over -z, accurate in the tail.
pub fn log_improvement(z: f64) -> f64 {
    let log_phi = -0.5 * z * z - HALF_LN_TWO_PI;
    if z > -1.0 {
        // phi + z Phi
        log(exp(log_phi) + z * exp(log_cdf(z)))
    } else if z > -50.0 {
        // ln phi + ln(1 - |z| Phi / phi)
        log_phi + log1p(-exp(log(-z) + log_cdf(z) - log_phi))
    } else {
        // 1 - |z| Phi / phi = 1/z^2 - 3/z^4 + 15/z^6 - ...  (Abramowitz and Stegun 26.2.12)
        let inverse_square = 1.0 / (z * z);
        log_phi + log(inverse_square) + log1p(inverse_square * (15.0 * inverse_square - 3.0))
    }
}
