//! The prior of the sampler `sim`: jumps of an ensemble of simulated robots ("worlds") at the same points.
//!
//! Plain numbers, without robot and simulator: `crate::session::prior` makes them.

use serde::{Deserialize, Serialize};

use super::space::Parameter;

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

/// A prior that is ready to predict.
#[derive(Debug, Clone)]
pub struct PriorModel {
    prior: Prior,
}

impl PriorModel {
    /// Prepares a prior.
    pub fn new(prior: Prior) -> PriorModel {
        PriorModel { prior }
    }

    /// Returns the simulated jumps.
    pub fn prior(&self) -> &Prior {
        &self.prior
    }
}
