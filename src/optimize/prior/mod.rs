//! The prior of the sampler `sim`: jumps of an ensemble of simulated robots ("worlds") at the same points.
//!
//! [`Prior`] has plain numbers, without robot and simulator: `crate::session::prior` makes them. [`PriorModel`] predicts from
//! them: each world's value and label at any point ([`surface`]), and the terms in which a robot may differ from the ensemble's
//! mean ([`terms`]).

pub mod standing;
pub mod surface;
pub mod terms;

use super::space::{Parameter, Space};
use serde::{Deserialize, Serialize};
use surface::SurfaceHyperparameters;
use terms::{Ensemble, Features};

/// Jumps of simulated robots at shared points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// The parameters, with the bounds that the points cover.
    pub parameters: Vec<Parameter>,
    /// Points of the unit cube, one coordinate per parameter.
    pub points: Vec<Vec<f64>>,
    /// The simulated robots.
    pub worlds: Vec<World>,
    /// Names of the parameters that push sideways and up; none for a task whose falls they do not explain.
    pub slip: Option<SlipParameters>,
    /// Hyperparameters of the surfaces; none before [`Prior::fit`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hyperparameters: Option<SurfaceHyperparameters>,
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

/// Reason for which a prior is not used; the sampler proposes as `gp` then.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message of each variant has its meaning")]
pub enum PriorError {
    #[error(
        "the prior has {points} points and {worlds} worlds: at least {least_points} points and one world are needed"
    )]
    Size { points: usize, worlds: usize, least_points: usize },
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

    /// Fits the hyperparameters of the surfaces, the expensive part of a [`PriorModel`], so that a file keeps them. Without effect
    /// where they are known.
    ///
    /// # Errors
    /// The numbers are not those of a prior, or cannot be fitted.
    pub fn fit(&mut self) -> Result<(), PriorError> {
        self.check()?;
        if self.hyperparameters.is_none() {
            self.hyperparameters = Some(surface::fit(self)?);
        }
        Ok(())
    }

    /// Checks sizes and numbers.
    fn check(&self) -> Result<(), PriorError> {
        let (d, n) = (self.parameters.len(), self.points.len());
        if n < surface::LEAST_POINTS || self.worlds.is_empty() || d == 0 {
            let worlds = self.worlds.len();
            return Err(PriorError::Size { points: n, worlds, least_points: surface::LEAST_POINTS });
        }
        for (point, x) in self.points.iter().enumerate() {
            let inside = x.iter().filter(|x| (0.0..=1.0).contains(*x)).count();
            if x.len() != d || inside != d {
                return Err(PriorError::Point { point, found: inside, expected: d });
            }
        }
        let finite = |world: &World| world.values.iter().filter(|v| v.is_none_or(f64::is_finite)).count();
        match self.worlds.iter().find(|world| world.values.len() != n || finite(world) != n) {
            Some(world) => Err(PriorError::Values { world: world.name.clone(), found: finite(world), expected: n }),
            None if self.worlds.iter().all(|world| world.stood() < surface::LEAST_STOOD) => {
                Err(PriorError::Falls { least: surface::LEAST_STOOD })
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

/// A prior that is ready to predict.
#[derive(Debug, Clone)]
pub struct PriorModel {
    prior: Prior,
    ensemble: Result<Ensemble, PriorError>,
}

impl PriorModel {
    /// Prepares a prior; fits its hyperparameters if [`Prior::fit`] has not. With numbers that are not those of a prior the model
    /// is not used, and [`PriorModel::covers`] returns the reason.
    pub fn new(mut prior: Prior) -> PriorModel {
        let ensemble = prior.fit().and_then(|()| Ensemble::new(&prior));
        PriorModel { prior, ensemble }
    }

    /// Returns the simulated jumps.
    pub fn prior(&self) -> &Prior {
        &self.prior
    }

    /// Whether the prior describes a study of `space`: the same parameters in any order. Bounds may differ: beyond those of the
    /// prior its surfaces return to the worlds' means.
    ///
    /// # Errors
    /// The reason for which the sampler proposes as `gp`.
    pub fn covers(&self, space: &Space) -> Result<(), PriorError> {
        self.ensemble.as_ref().map_err(Clone::clone)?;
        let names = |parameters: &[Parameter]| {
            let mut names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
            names.sort_unstable();
            names.join(", ")
        };
        let (study, prior) = (names(space.parameters()), names(&self.prior.parameters));
        if study != prior {
            return Err(PriorError::Parameters { study, prior });
        }
        let other_scale = |p: &&Parameter| space.range(&p.name).is_some_and(|range| range.log != p.range.log);
        match self.prior.parameters.iter().find(other_scale) {
            Some(parameter) => Err(PriorError::Scale(parameter.name.clone())),
            None => Ok(()),
        }
    }

    /// Returns the surfaces of a prior that can be used.
    pub(super) fn ensemble(&self) -> Option<&Ensemble> {
        self.ensemble.as_ref().ok()
    }

    /// Returns the linear terms at a point of the prior's unit cube. `None` for a prior that cannot be used.
    pub fn features(&self, x: &[f64]) -> Option<Features> {
        Some(self.ensemble()?.features(&self.prior, x))
    }
}
