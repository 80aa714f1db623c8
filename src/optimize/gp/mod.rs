//! The Gaussian-process sampler: where a trial costs a jump of a real robot, the model may take its time.
//!
//! A space-filling start; then regression with a Matern 5/2 kernel, a lengthscale per parameter and estimated noise
//! ([`process`]); the next point maximizes the logarithm of the expected improvement (Ament et al., "Unexpected
//! improvements to expected improvement for Bayesian optimization", NeurIPS 2023) times the chance of standing
//! ([`falls`]). Trials that other workers are running count as if they had given their expected value.
//!
//! Falls: their value 0 beside a best jump is a cliff, and a cliff forces short lengthscales and a large noise on the
//! whole space. So the regression sees a fall at the lower quartile of the jumps that were stood through: bad, but no
//! cliff (padding, as Wakabayashi et al., "Bayesian optimization with experimental failure", npj Comput. Mater. 8, 180,
//! 2022, who take the worst value instead); where the edge is, the classifier says.

pub mod ascent;
pub mod falls;
pub mod process;

use super::sampler::{Direction, Proposal, SamplerConfig, Streams, startup_point};
use super::sobol::Sobol;
use super::space::Space;
use super::trial::{Trial, TrialState};
use super::truncnorm::{HALF_LN_TWO_PI, log_cdf};
use falls::Standing;
use libm::{exp, log, log1p};
use process::GaussianProcess;

/// Points over the whole space at which the acquisition is tried before the best ones are climbed from.
const SCATTERED: u32 = 512;
/// Points around each of the best trials at which it is tried as well, and the widths of these clouds.
const CLOUD: u32 = 32;
const CLOUD_WIDTHS: [f64; 3] = [0.2, 0.05, 0.01];
/// Best trials that get clouds, and best candidates that are climbed from.
const CENTRES: usize = 3;
const CLIMBS: usize = 6;

/// The next point. `fixed` parameters are kept, the others are chosen for them.
pub fn propose(
    config: &SamplerConfig,
    streams: &mut Streams,
    trials: &[Trial],
    space: &Space,
    fixed: &[(String, f64)],
    direction: Direction,
) -> Proposal {
    let parameters = space.parameters();
    let given: Vec<Option<f64>> = parameters
        .iter()
        .map(|p| {
            let value = fixed.iter().find(|(n, _)| *n == p.name).map(|(_, v)| *v);
            value.or(p.range.is_point().then_some(p.range.low))
        })
        .collect();
    if given.iter().all(Option::is_some) {
        return Proposal { values: given.into_iter().flatten().collect(), joint: Vec::new() };
    }
    let history = History::gather(trials, space, direction);
    let model = if history.points.len() < config.startup_trials(space) || history.values.len() < 2 {
        None
    } else {
        Acquisition::new(&history)
    };
    let Some(model) = model else {
        return startup_point(config.seed, streams, space, fixed);
    };
    let bounds: Vec<(f64, f64)> = parameters
        .iter()
        .zip(&given)
        .map(|(p, given)| given.map_or((0.0, 1.0), |v| (p.range.scale(v), p.range.scale(v))))
        .collect();
    let unit = model.best_point(&bounds, streams);
    let values =
        parameters.iter().zip(&given).zip(unit).map(|((p, given), u)| given.unwrap_or_else(|| p.range.unscale(u)));
    Proposal { values: values.collect(), joint: Vec::new() }
}

/// The trials as points of the unit cube.
struct History {
    /// Points of all observed trials.
    points: Vec<Vec<f64>>,
    /// Whether each was stood through.
    stood: Vec<bool>,
    /// Values of those that were, larger is better.
    values: Vec<f64>,
    /// Points of trials that are running.
    pending: Vec<Vec<f64>>,
}

impl History {
    fn gather(trials: &[Trial], space: &Space, direction: Direction) -> Self {
        let mut history = History { points: Vec::new(), stood: Vec::new(), values: Vec::new(), pending: Vec::new() };
        for trial in trials {
            let coordinate = |p: &super::space::Parameter| trial.parameter(&p.name).map(|v| p.range.scale(v));
            let Some(point) = space.parameters().iter().map(coordinate).collect::<Option<Vec<f64>>>() else { continue };
            match (trial.state, trial.value) {
                (TrialState::Running, _) => history.pending.push(point),
                (TrialState::Complete, Some(value)) if value.is_finite() && trial.violation() <= 0.0 => {
                    history.points.push(point);
                    history.stood.push(!trial.is_fall());
                    if !trial.is_fall() {
                        history.values.push(if direction == Direction::Maximize { value } else { -value });
                    }
                }
                _ => {}
            }
        }
        history
    }

    /// One value per point; falls have the lower quartile of the others.
    fn values_with_falls(&self) -> Vec<f64> {
        let mut sorted = self.values.clone();
        sorted.sort_by(f64::total_cmp);
        let low = sorted.get(sorted.len() / 4).copied().unwrap_or(0.0);
        let mut stood = self.values.iter();
        let value = |s: &bool| if *s { stood.next().copied().unwrap_or(low) } else { low };
        self.stood.iter().map(value).collect()
    }
}

/// What a trial is worth, as a function of its point.
struct Acquisition {
    process: GaussianProcess,
    standing: Option<Standing>,
    /// The best expected value of a point that was tried.
    incumbent: f64,
    /// The best points that were tried.
    centres: Vec<Vec<f64>>,
}

impl Acquisition {
    fn new(history: &History) -> Option<Self> {
        let process = GaussianProcess::fit(history.points.clone(), &history.values_with_falls())?;
        let mut ranked: Vec<(f64, &Vec<f64>)> = process.points().iter().map(|p| (process.predict(p).0, p)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let incumbent = ranked.first()?.0;
        let centres = ranked.iter().take(CENTRES).map(|(_, p)| (*p).clone()).collect();
        let standing = Standing::fit(&history.points, &history.stood);
        let process = process.believing(&history.pending)?;
        Some(Acquisition { process, standing, incumbent, centres })
    }

    /// ln EI(x) + ln P(stands at x)
    fn value(&self, x: &[f64]) -> f64 {
        let (mean, deviation) = self.process.predict(x);
        let chance = self.standing.as_ref().map_or(1.0, |s| s.chance(x));
        log(deviation) + log_improvement((mean - self.incumbent) / deviation) + log(chance)
    }

    /// The point of the box where the acquisition is largest. Takes one double per coordinate.
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

/// ln h(z), h(z) = phi(z) + z Phi(z): the expected improvement of a standard normal over -z, kept exact where it vanishes.
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
