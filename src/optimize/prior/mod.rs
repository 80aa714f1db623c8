//! The prior of the sampler `sim`: jumps of an ensemble of simulated robots ("worlds") at the same points.
//!
//! [`Prior`] has plain numbers, without robot and simulator: `crate::session::prior` makes them. [`PriorModel`] predicts from
//! them: each world's value and label at any point ([`surface`]), and the terms in which a robot may differ from the ensemble's
//! mean ([`terms`]).

mod data;
pub mod standing;
pub mod surface;
pub mod terms;

pub use data::{Prior, PriorModelError, SlipParameters, SurfaceHyperparameters, World};

use super::space::{Parameter, Space};
use terms::{Ensemble, Features};

impl Prior {
    /// Fits the hyperparameters of the surfaces, the expensive part of a [`PriorModel`], so that a file keeps them. Without effect
    /// where they are known.
    ///
    /// # Errors
    /// The numbers are not those of a prior, or cannot be fitted.
    pub fn fit(&mut self) -> Result<(), PriorModelError> {
        self.check()?;
        if self.hyperparameters.is_none() {
            self.hyperparameters = Some(surface::fit(self)?);
        }
        Ok(())
    }
}

/// A prior that is ready to predict.
#[derive(Debug, Clone)]
pub struct PriorModel {
    prior: Prior,
    ensemble: Result<Ensemble, PriorModelError>,
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
    /// The reason for which the prior cannot be used (`docs/prior.md`, section 2).
    pub fn covers(&self, space: &Space) -> Result<(), PriorModelError> {
        self.ensemble.as_ref().map_err(Clone::clone)?;
        let names = |parameters: &[Parameter]| {
            let mut names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
            names.sort_unstable();
            names.join(", ")
        };
        let (study, prior) = (names(space.parameters()), names(&self.prior.parameters));
        if study != prior {
            return Err(PriorModelError::Parameters { study, prior });
        }
        let other_scale = |p: &&Parameter| space.range(&p.name).is_some_and(|range| range.log != p.range.log);
        match self.prior.parameters.iter().find(other_scale) {
            Some(parameter) => Err(PriorModelError::Scale(parameter.name.clone())),
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
