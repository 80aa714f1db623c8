//! The value and the label of each world as functions of the point: Gaussian processes through its jumps.
//!
//! The value has the jumps that stood, scaled to mean 0 and variance 1; the label is +1 for a jump that stood and -1 for a fall.
//! The worlds are changes of one robot, so they share lengthscales, signal and noise: the maximum of the sum of their likelihoods.

use super::data::{LEAST_STOOD, Prior, PriorModelError, SurfaceHyperparameters, World};
use crate::optimize::gp::regression::{
    HyperPrior, Hyperparameters, LinearPrior, LogNormal, Observations, Regression, log_likelihood, matern,
};
use libm::sqrt;
use nalgebra::{DMatrix, DVector};

/// Points of a world from which the hyperparameters are fitted: the cost grows with their cube, and all worlds count together.
const FITTED_POINTS: usize = 96;
/// Steps of the ascent.
const ITERATIONS: usize = 30;

/// A function of the point, for each world.
#[derive(Debug, Clone)]
pub struct Surfaces {
    /// 1 / l_d
    inverse_lengthscale: Vec<f64>,
    /// The points times 1 / l_d.
    points: Vec<Vec<f64>>,
    /// Per world its mean and the weight of each point.
    worlds: Vec<(f64, Vec<f64>)>,
}

impl Surfaces {
    /// The worlds' values at a point of the unit cube.
    pub fn at(&self, x: &[f64]) -> Vec<f64> {
        let x: Vec<f64> = x.iter().zip(&self.inverse_lengthscale).map(|(x, l)| x * l).collect();
        let kernel = |p: &Vec<f64>| {
            let r2: f64 = p.iter().zip(&x).map(|(p, x)| (p - x) * (p - x)).sum();
            matern(1.0, sqrt(5.0 * r2))
        };
        let kernels: Vec<f64> = self.points.iter().map(kernel).collect();
        let value = |(mean, weights): &(f64, Vec<f64>)| {
            mean + weights.iter().zip(&kernels).map(|(weight, kernel)| weight * kernel).sum::<f64>()
        };
        self.worlds.iter().map(value).collect()
    }

    /// The surface of each series, given as indices of points with values.
    fn through(prior: &Prior, theta: &[f64], series: &[Series]) -> Option<Surfaces> {
        let hyper = Hyperparameters::from_log(theta);
        let inverse_lengthscale: Vec<f64> = hyper.lengthscale.iter().map(|l| 1.0 / l).collect();
        let scaled = |x: &Vec<f64>| x.iter().zip(&inverse_lengthscale).map(|(x, l)| x * l).collect();
        let world = |series: &Series| {
            let points = series.at.iter().map(|i| prior.points[*i].clone()).collect();
            let terms = vec![vec![1.0]; series.at.len()];
            let observed = Observations { points, terms, values: series.values.clone() };
            let regression = Regression::condition(observed, constant(), hyper.clone())?;
            // mean(x) = sum alpha_i (s^2 k(x, x_i) + 1), from the kernel and the constant term
            let mean = series.mean + series.deviation * regression.alpha().sum();
            let mut weights = vec![0.0; prior.points.len()];
            for (i, alpha) in series.at.iter().zip(regression.alpha().iter()) {
                weights[*i] = series.deviation * hyper.signal * alpha;
            }
            Some((mean, weights))
        };
        let worlds = series.iter().map(world).collect::<Option<_>>()?;
        Some(Surfaces { points: prior.points.iter().map(scaled).collect(), inverse_lengthscale, worlds })
    }
}

/// The surfaces of the values of the worlds that stood often enough, with the worlds' indices, and of the labels of all worlds.
pub fn surfaces(prior: &Prior, hyper: &SurfaceHyperparameters) -> Option<(Vec<usize>, Surfaces, Surfaces)> {
    let known: Vec<usize> = (0..prior.worlds.len()).filter(|k| prior.worlds[*k].stood() >= LEAST_STOOD).collect();
    let values: Vec<Series> = known.iter().map(|k| Series::value(&prior.worlds[*k])).collect();
    let labels: Vec<Series> = prior.worlds.iter().map(Series::label).collect();
    let d = prior.parameters.len() + 2;
    if hyper.value.len() != d || hyper.label.len() != d {
        return None;
    }
    Some((known, Surfaces::through(prior, &hyper.value, &values)?, Surfaces::through(prior, &hyper.label, &labels)?))
}

/// Fits the hyperparameters of values and labels, at the same time where the system gives a thread.
pub fn fit(prior: &Prior) -> Result<SurfaceHyperparameters, PriorModelError> {
    let values = || {
        let known = prior.worlds.iter().filter(|world| world.stood() >= LEAST_STOOD);
        fit_series(prior, &known.map(Series::value).collect::<Vec<_>>())
    };
    let labels = || fit_series(prior, &prior.worlds.iter().map(Series::label).collect::<Vec<_>>());
    let (value, label) = std::thread::scope(|scope| {
        let started = std::thread::Builder::new().spawn_scoped(scope, values);
        let label = labels();
        let joined = started.map(|value| value.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        (joined.unwrap_or_else(|_| values()), label)
    });
    Ok(SurfaceHyperparameters { value: value.ok_or(PriorModelError::Fit)?, label: label.ok_or(PriorModelError::Fit)? })
}

/// One quantity of one world, scaled.
struct Series {
    /// Indices of the points.
    at: Vec<usize>,
    /// (value - mean) / deviation at each.
    values: Vec<f64>,
    mean: f64,
    deviation: f64,
}

impl Series {
    fn value(world: &World) -> Series {
        let (at, values): (Vec<usize>, Vec<f64>) =
            world.values.iter().enumerate().filter_map(|(i, value)| Some((i, (*value)?))).unzip();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n;
        let deviation = if variance > 0.0 { sqrt(variance) } else { 1.0 };
        Series { at, values: values.iter().map(|v| (v - mean) / deviation).collect(), mean, deviation }
    }

    fn label(world: &World) -> Series {
        let label = |value: &Option<f64>| if value.is_some() { 1.0 } else { -1.0 };
        let values = world.values.iter().map(label).collect();
        Series { at: (0..world.values.len()).collect(), values, mean: 0.0, deviation: 1.0 }
    }
}

/// A constant term of variance 1: the mean of a surface is unknown.
fn constant() -> LinearPrior {
    LinearPrior { mean: vec![0.0], variance: vec![1.0] }
}

/// theta of the largest sum of the likelihoods of all series, each at its first [`FITTED_POINTS`] points.
fn fit_series(prior: &Prior, series: &[Series]) -> Option<Vec<f64>> {
    let d = prior.parameters.len();
    let prepare = |series: &Series| {
        let n = series.at.len().min(FITTED_POINTS);
        let points: Vec<Vec<f64>> = series.at[..n].iter().map(|i| prior.points[*i].clone()).collect();
        (points, DVector::from_row_slice(&series.values[..n]), DMatrix::from_element(n, n, 1.0))
    };
    let prepared: Vec<_> = series.iter().map(prepare).collect();
    let likelihood = |theta: &[f64]| {
        let mut sum = (0.0, vec![0.0; theta.len()]);
        for (points, y, linear) in &prepared {
            let (value, gradient) = log_likelihood(theta, points, y, Some(linear));
            sum.0 += value;
            sum.1.iter_mut().zip(gradient).for_each(|(sum, g)| *sum += g);
        }
        sum
    };
    let (hyper, _) = hyper_prior().maximize(d, ITERATIONS, likelihood)?;
    Some(hyper.to_log())
}

fn hyper_prior() -> HyperPrior {
    HyperPrior {
        lengthscale: LogNormal::new(-1.0, 1.0, (0.05, 20.0)),
        signal: LogNormal::new(0.0, 1.0, (1e-4, 20.0)),
        noise: LogNormal::new(-5.0, 2.0, (1e-6, 0.5)),
        starts: vec![[-0.5, 0.0, -4.0]],
    }
}
