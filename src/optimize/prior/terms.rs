//! The linear terms of a robot's value and of its standing: the ensemble's mean and its principal components.
//!
//! Value, in units of the worlds' mean standard deviation over the cube: h = (1, m, phi_1 ..), m the mean over the worlds and phi_j
//! the principal components of their differences from it. Standing: h = (1, g, z, psi_1 ..), g the mean of the clipped labels, z the
//! reserve of friction and psi_j the components of the labels.

use super::data::{Prior, PriorModelError};
use super::standing::{LogisticPrior, leave_one_world_out};
use super::surface::{Surfaces, surfaces};
use crate::optimize::mt19937::Mt19937;
use crate::optimize::sobol::Sobol;
use libm::sqrt;
use nalgebra::DMatrix;

/// Points of the unit cube at which components are found and candidates are scored; the same for every study.
pub const CANDIDATES: u32 = 1024;
/// Seed of their digital shift.
pub const CANDIDATE_SEED: u32 = 3;
/// Largest number of principal components.
const COMPONENTS: usize = 3;
/// Bound of a label: beyond it the surface overshoots its data.
const LABEL_BOUND: f64 = 1.3;
/// Share of the largest singular value below which a component is rounding.
const RANK_TOLERANCE: f64 = 1e-9;

/// The linear terms at a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    /// 1, scaled ensemble mean, components: of the value.
    pub value: Vec<f64>,
    /// 1, mean label, reserve of friction, components: of standing.
    pub standing: Vec<f64>,
    /// Clipped label of each world.
    pub labels: Vec<f64>,
}

/// The worlds' surfaces and what they have in common.
#[derive(Debug, Clone)]
pub struct Ensemble {
    /// Indices of the worlds that have a value.
    pub known: Vec<usize>,
    values: Surfaces,
    labels: Surfaces,
    /// Mean of the ensemble's mean over the cube, in the task's unit.
    pub offset: f64,
    /// Mean over the worlds of the standard deviation over the cube, in the task's unit.
    pub scale: f64,
    /// Smallest value of a world at a candidate, in the task's unit.
    pub lowest: f64,
    /// Weight of each world in each component of the value, in columns.
    value_components: DMatrix<f64>,
    /// Weight of each world in each component of the label, in columns.
    label_components: DMatrix<f64>,
    /// Prior of the coefficients of 1, g and z.
    pub standing: LogisticPrior,
    /// Candidates over the whole cube with their terms.
    pub candidates: Vec<(Vec<f64>, Features)>,
}

impl Ensemble {
    /// Computes surfaces, components and candidates. The hyperparameters of `prior` are known.
    pub fn new(prior: &Prior) -> Result<Ensemble, PriorModelError> {
        let hyper = prior.hyperparameters.as_ref().ok_or(PriorModelError::Fit)?;
        let (known, values, labels) = surfaces(prior, hyper).ok_or(PriorModelError::Fit)?;
        let sobol = Sobol::new(prior.parameters.len(), &mut Mt19937::new(CANDIDATE_SEED));
        let points: Vec<Vec<f64>> = (0..CANDIDATES).map(|i| sobol.point(i)).collect();
        let at = |surfaces: &Surfaces| -> Vec<Vec<f64>> { points.iter().map(|x| surfaces.at(x)).collect() };
        let (v, mut l) = (at(&values), at(&labels));
        l.iter_mut().flatten().for_each(|l| *l = clipped(*l));
        let n = points.len() as f64;
        let offset = v.iter().map(|v| mean(v)).sum::<f64>() / n;
        let deviation = |k: usize| {
            let mean = v.iter().map(|v| v[k]).sum::<f64>() / n;
            sqrt(v.iter().map(|v| (v[k] - mean) * (v[k] - mean)).sum::<f64>() / n)
        };
        let scale = (0..known.len()).map(deviation).sum::<f64>() / known.len() as f64;
        let scale = if scale > 0.0 { scale } else { 1.0 };
        let lowest = v.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let value_components = components(&v, scale).ok_or(PriorModelError::Fit)?;
        let label_components = components(&l, 1.0).ok_or(PriorModelError::Fit)?;
        let reserve: Vec<f64> = points.iter().map(|x| prior.slip_reserve(x)).collect();
        let standing = leave_one_world_out(&l, &reserve);
        let mut ensemble = Ensemble {
            known,
            values,
            labels,
            offset,
            scale,
            lowest,
            value_components,
            label_components,
            standing,
            candidates: Vec::new(),
        };
        let features = |((v, l), z): ((&Vec<f64>, &Vec<f64>), &f64)| ensemble.combine(v, l, *z);
        let features: Vec<Features> = v.iter().zip(&l).zip(&reserve).map(features).collect();
        ensemble.candidates = points.into_iter().zip(features).collect();
        Ok(ensemble)
    }

    /// The linear terms at a point of the unit cube.
    pub fn features(&self, prior: &Prior, x: &[f64]) -> Features {
        self.combine(&self.world_values(x), &self.world_labels(x), prior.slip_reserve(x))
    }

    /// The value of each world that has one at a point of the unit cube, in the task's unit.
    pub fn world_values(&self, x: &[f64]) -> Vec<f64> {
        self.values.at(x)
    }

    /// The clipped label of each world at a point of the unit cube.
    pub fn world_labels(&self, x: &[f64]) -> Vec<f64> {
        self.labels.at(x).into_iter().map(clipped).collect()
    }

    /// Number of worlds.
    pub fn worlds(&self) -> usize {
        self.label_components.nrows()
    }

    /// Number of components of value and label.
    pub fn components(&self) -> (usize, usize) {
        (self.value_components.ncols(), self.label_components.ncols())
    }

    fn combine(&self, values: &[f64], labels: &[f64], reserve: f64) -> Features {
        let (m, g) = (mean(values), mean(labels));
        let project = |weights: &DMatrix<f64>, at: &[f64], mean: f64, scale: f64| -> Vec<f64> {
            let component = |column: nalgebra::DVectorView<'_, f64>| {
                at.iter().zip(column.iter()).map(|(value, weight)| weight * (value - mean) / scale).sum()
            };
            weights.column_iter().map(component).collect()
        };
        let mut value = vec![1.0, (m - self.offset) / self.scale];
        value.extend(project(&self.value_components, values, m, self.scale));
        let mut standing = vec![1.0, g, reserve];
        standing.extend(project(&self.label_components, labels, g, 1.0));
        Features { value, standing, labels: labels.to_vec() }
    }
}

/// The left singular vectors of (value of world k - mean) / scale over the points, at most [`COMPONENTS`], one fewer than worlds.
/// The entry of largest magnitude of each is positive. `None` if a difference is not finite or the iteration does not converge.
fn components(at: &[Vec<f64>], scale: f64) -> Option<DMatrix<f64>> {
    let worlds = at.first().map_or(0, Vec::len);
    let differences = DMatrix::from_fn(worlds, at.len(), |k, i| (at[i][k] - mean(&at[i])) / scale);
    if !differences.iter().all(|difference| difference.is_finite()) {
        return None;
    }
    let svd = differences.try_svd(true, false, f64::EPSILON, 10_000)?;
    let (u, singular) = (svd.u?, svd.singular_values);
    let largest = singular.iter().copied().fold(0.0, f64::max);
    let mut order: Vec<usize> = (0..singular.len()).filter(|j| singular[*j] > RANK_TOLERANCE * largest).collect();
    order.sort_by(|a, b| singular[*b].total_cmp(&singular[*a]));
    order.truncate(COMPONENTS.min(worlds.saturating_sub(1)));
    let column = |j: &usize| {
        let column = u.column(*j).into_owned();
        let largest = column.iter().copied().fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
        if largest < 0.0 { -column } else { column }
    };
    let columns: Vec<_> = order.iter().map(column).collect();
    Some(if columns.is_empty() { DMatrix::zeros(worlds, 0) } else { DMatrix::from_columns(&columns) })
}

fn clipped(label: f64) -> f64 {
    label.clamp(-LABEL_BOUND, LABEL_BOUND)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
