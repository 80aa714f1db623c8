//! The prior of the sampler `sim` for a configuration.

use super::options::EngineError;
use crate::config::Config;
use crate::robot::description::RobotDescription;
use crate::session::prior::PriorPlan;
use crate::trial::{Backend, Task};

/// Returns the inputs of the prior of `task` for a configured robot.
///
/// # Errors
/// When the task's settings do not fit the robot.
pub fn prior_plan(config: &Config, robot: &RobotDescription, task: Task) -> Result<PriorPlan, EngineError> {
    Ok(PriorPlan {
        robot: robot.clone(),
        simulator: config.simulator.clone(),
        settings: config.settings(robot, task, Backend::Simulator)?,
        control: *config.task(task),
        task,
        parameters: config.parameters(task),
        ensemble: config.prior.clone(),
    })
}
