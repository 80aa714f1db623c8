//! The prior as plain numbers, as its file keeps them.

use crate::optimize::space::{Parameter, Space, SpaceError};
use serde::{Deserialize, Serialize};

/// Least number of points of a prior.
pub const LEAST_POINTS: usize = 16;
/// Jumps that a world must have stood for a surface of its value.
pub const LEAST_STOOD: usize = 8;

/// Jumps of simulated robots at shared points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// The parameters, with the bounds that the points cover.
    pub parameters: Vec<Parameter>,
    /// Points of the unit cube, one coordinate per parameter.
    pub points: Vec<Vec<f64>>,
    /// The simulated robots.
    pub worlds: Vec<World>,
    /// Names of the parameters that push sideways and up; none unless the parameters have both.
    pub slip: Option<SlipParameters>,
    /// Hyperparameters of the surfaces; none before [`Prior::fit`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hyperparameters: Option<SurfaceHyperparameters>,
}

/// Hyperparameters of the surfaces, shared by the worlds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfaceHyperparameters {
    /// ln (l_1 .. l_d, s^2, noise) of the values, in units of each world's standard deviation.
    pub value: Vec<f64>,
    /// ln (l_1 .. l_d, s^2, noise) of the labels.
    pub label: Vec<f64>,
}

/// One simulated robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct World {
    /// Name, as on screens: `world 3`.
    pub name: String,
    /// Objective at each point, in the task's unit, larger is better; none for a fall.
    pub values: Vec<Option<f64>>,
}

/// The demanded friction F_horizontal / F_vertical as a function of the parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SlipParameters {
    /// Names of the horizontal force amplitudes; their norm counts.
    pub horizontal: Vec<String>,
    /// Name of the vertical force amplitude.
    pub vertical: String,
}

/// Reason for which a prior cannot be used (`docs/prior.md`, section 2).
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message of each variant has its meaning")]
pub enum PriorModelError {
    #[error(
        "the prior has {points} points and {worlds} worlds: at least {least_points} points and one world are needed"
    )]
    Size { points: usize, worlds: usize, least_points: usize },
    #[error("the parameters of the prior are damaged, make it again: {0}")]
    Space(#[from] SpaceError),
    #[error(
        "point {point} of the prior has {found} coordinates in 0..1, {expected} are needed: the file is damaged, make it again"
    )]
    Point { point: usize, found: usize, expected: usize },
    #[error(
        "world \"{world}\" of the prior has {found} values, {expected} are needed, all finite: the file is damaged, make it again"
    )]
    Values { world: String, found: usize, expected: usize },
    #[error("no simulated robot stood {least} times: the prior knows no value")]
    Falls { least: usize },
    #[error("the surfaces of the prior cannot be fitted: a covariance is not positive definite")]
    Fit,
    #[error("the study searches {study}, the prior has {prior}: make the prior for the parameters of the study")]
    Parameters { study: String, prior: String },
    #[error("parameter `{0}` is logarithmic in only one of study and prior: make the prior again")]
    Scale(String),
}

impl Prior {
    /// Results without fitted hyperparameters.
    pub fn new(
        parameters: Vec<Parameter>,
        points: Vec<Vec<f64>>,
        worlds: Vec<World>,
        slip: Option<SlipParameters>,
    ) -> Prior {
        Prior { parameters, points, worlds, slip, hyperparameters: None }
    }

    /// Checks sizes and numbers.
    pub fn check(&self) -> Result<(), PriorModelError> {
        let (d, n) = (self.parameters.len(), self.points.len());
        if n < LEAST_POINTS || self.worlds.is_empty() || d == 0 {
            let worlds = self.worlds.len();
            return Err(PriorModelError::Size { points: n, worlds, least_points: LEAST_POINTS });
        }
        Space::new(self.parameters.iter().map(|p| (p.name.clone(), p.range)))?;
        for (point, x) in self.points.iter().enumerate() {
            let inside = x.iter().filter(|x| (0.0..=1.0).contains(*x)).count();
            if x.len() != d || inside != d {
                return Err(PriorModelError::Point { point, found: inside, expected: d });
            }
        }
        let finite = |world: &World| world.values.iter().filter(|v| v.is_none_or(f64::is_finite)).count();
        match self.worlds.iter().find(|world| world.values.len() != n || finite(world) != n) {
            Some(world) => {
                Err(PriorModelError::Values { world: world.name.clone(), found: finite(world), expected: n })
            }
            None if self.worlds.iter().all(|world| world.stood() < LEAST_STOOD) => {
                Err(PriorModelError::Falls { least: LEAST_STOOD })
            }
            None => Ok(()),
        }
    }

    /// (0.5 - F_horizontal / F_vertical) / 0.15 at a point of the unit cube: the reserve of friction, in units in which falls become
    /// likelier by about one. 0 for a task without [`SlipParameters`].
    pub fn slip_reserve(&self, x: &[f64]) -> f64 {
        let value = |name: &String| {
            let i = self.parameters.iter().position(|p| p.name == *name)?;
            Some(self.parameters[i].range.extrapolate(x[i]))
        };
        let Some(slip) = &self.slip else { return 0.0 };
        let Some(vertical) = value(&slip.vertical) else { return 0.0 };
        let horizontal: f64 = slip.horizontal.iter().filter_map(value).map(|f| f * f).sum();
        // Beyond a ratio of 2 no ground holds a foot.
        let ratio = (libm::sqrt(horizontal) / vertical.max(1e-9)).min(2.0);
        (0.5 - ratio) / 0.15
    }
}

impl World {
    /// Number of jumps without a fall.
    pub fn stood(&self) -> usize {
        self.values.iter().flatten().count()
    }
}
