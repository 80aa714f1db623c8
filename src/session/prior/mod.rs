//! The prior of the sampler `sim`: an ensemble of simulated robots jumps at shared points, on all cores.
//!
//! Robots, points and noise follow from the seed of `config/prior.toml` alone: the same bits on any number of threads.

mod work;

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

pub use work::PriorWork;

use super::objective;
use super::parallel::in_parallel;
use super::rollout::Rollout;
use crate::control::settings::{ControlSettings, TaskControl};
use crate::optimize::mt19937::Mt19937;
use crate::optimize::prior::{Prior, SlipParameters, World};
use crate::optimize::sobol::Sobol;
use crate::optimize::space::{Parameter, Range};
use crate::robot::description::RobotDescription;
use crate::sim::ensemble::{EnsembleSettings, PROPERTIES, PropertyRanges, RobotProperties};
use crate::sim::{SimConfig, SimError, Simulator};
use crate::telemetry::TrialSpec;
use crate::trial::{JumpParameters, ParameterInfo, ParameterValues, Task, Verdict};

/// Number that every change of the simulation, the controller or the surfaces raises by which the prior of the same configuration
/// becomes another: files of another number are made again.
pub const SIMULATION_VERSION: u32 = 1;

/// Inputs of a prior.
#[derive(Debug, Clone)]
pub struct PriorPlan {
    /// The configured robot.
    pub robot: RobotDescription,
    /// Its simulator, as configured.
    pub simulator: SimConfig,
    /// Settings of the control cycle for the configured robot: the controller does not know the differences.
    pub settings: ControlSettings,
    /// Controller's settings of the task's trials.
    pub control: TaskControl,
    /// The task.
    pub task: Task,
    /// Parameters of the task, gains among them, with the bounds that the points cover.
    pub parameters: Vec<ParameterInfo>,
    /// Robots, points and seed.
    pub ensemble: EnsembleSettings,
}

/// Work done on a prior.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PriorProgress {
    /// Simulated jumps.
    pub done: usize,
    /// Jumps of the whole prior.
    pub total: usize,
}

/// Error of the simulation of an ensemble.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message has the meaning of each variant")]
pub enum EnsembleError {
    #[error("a robot of the ensemble cannot be simulated: {0}; narrow the ranges in prior.toml")]
    Simulator(#[from] SimError),
    #[error("the prior was interrupted before it was complete")]
    Interrupted,
}

/// Simulates the prior of `plan` on at most `jobs` threads. `progress` is called after each jump, on the thread of the jump;
/// `interrupt` ends the work within one jump of each thread.
///
/// A value is the task's objective of one rollout; none for a fall, a tripped limit, a robot that did not come to rest and a
/// rollout that did not begin. Robots meet the same sensor noise and terrain at the same point.
///
/// # Errors
/// When a robot of the ensemble cannot be simulated, or `interrupt` was set.
pub fn simulate(
    plan: &PriorPlan,
    jobs: usize,
    progress: &(dyn Fn(PriorProgress) + Sync),
    interrupt: &AtomicBool,
) -> Result<Prior, EnsembleError> {
    let EnsembleSettings { points, seed, .. } = plan.ensemble;
    let robots = ensemble(&plan.ensemble);
    let range = |parameter: &ParameterInfo| Range::linear(parameter.low, parameter.high);
    let parameters: Vec<Parameter> =
        plan.parameters.iter().map(|p| Parameter { name: p.name.clone(), range: range(p) }).collect();
    // Another stream than that of the robots, so that their number does not change the points.
    let sobol = Sobol::new(parameters.len(), &mut Mt19937::new(seed));
    let points: Vec<Vec<f64>> = (0..points).map(|index| sobol.point(index)).collect();
    let jumps: Vec<(usize, usize)> =
        (0..robots.len()).flat_map(|robot| (0..points.len()).map(move |point| (robot, point))).collect();
    let done = AtomicUsize::new(0);
    let jump = |rollout: &mut Option<(usize, Rollout<Simulator>)>, &(robot, point): &(usize, usize)| {
        if interrupt.load(Ordering::Relaxed) {
            return Err(EnsembleError::Interrupted);
        }
        let ready = match rollout.take() {
            Some((of, ready)) if of == robot => ready,
            _ => {
                let (description, mut simulator) = robots[robot].apply(&plan.robot, &plan.simulator);
                let tolerance_m_s = &mut simulator.solver.tolerance_m_s;
                *tolerance_m_s = tolerance_m_s.max(plan.ensemble.solver_tolerance_m_s);
                Rollout::new(Simulator::new(&description, &simulator)?, &plan.settings)
            }
        };
        let (_, ready) = rollout.insert((robot, ready));
        let value = value(plan, ready, &trial(plan, &parameters, &points[point], point as u32));
        progress(PriorProgress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total: jumps.len() });
        Ok(value)
    };
    let values = in_parallel(jobs, &jumps, || Ok(None), jump)?;
    let worlds = values.chunks(points.len()).enumerate();
    let worlds = worlds.map(|(i, values)| World { name: format!("world {}", i + 1), values: values.to_vec() });
    let worlds = worlds.collect();
    let slip = slip(&parameters);
    Ok(Prior::new(parameters, points, worlds, slip))
}

/// Returns the robots of an ensemble: points of a Sobol sequence over the ranges.
pub fn ensemble(settings: &EnsembleSettings) -> Vec<RobotProperties> {
    // The points of `simulate` read the stream of the seed itself.
    let mut stream = Mt19937::new(settings.seed.wrapping_add(0x9E37_79B9));
    let sobol = Sobol::new(PROPERTIES, &mut stream);
    let unit = |index| -> [f64; PROPERTIES] {
        let point = sobol.point(index);
        std::array::from_fn(|i| point[i])
    };
    (0..settings.worlds).map(|index| settings.ranges.at(&unit(index))).collect()
}

/// Draws one robot: each property uniformly and independently from its range, by `seed`. For robots that are no members of an
/// ensemble, such as targets of a comparison.
pub fn draw_robot(ranges: &PropertyRanges, seed: u32) -> RobotProperties {
    let mut stream = Mt19937::new(seed);
    ranges.at(&std::array::from_fn(|_| stream.double()))
}

/// Returns the trial at a point of the unit cube; `seed` is the point's part of the trial's seed.
fn trial(plan: &PriorPlan, parameters: &[Parameter], unit: &[f64], seed: u32) -> TrialSpec {
    let values: ParameterValues =
        parameters.iter().zip(unit).map(|(p, unit)| (p.name.clone(), p.range.unscale(*unit))).collect();
    let control = &plan.control;
    let jump = JumpParameters::from_values(&values, control.f1_hz);
    let seed = u64::from(plan.ensemble.seed) << 32 | u64::from(seed);
    TrialSpec { gains: control.gains().with(&values), seed, ..control.trial(plan.task, jump) }
}

/// Runs a trial; returns its objective if the robot stands at its end.
fn value(plan: &PriorPlan, rollout: &mut Rollout<Simulator>, spec: &TrialSpec) -> Option<f64> {
    let (end, ticks) = rollout.run(spec);
    let measured = objective::measure(&spec.objective(), ticks);
    let (verdict, _) = objective::suggest_measured(&end, measured.as_ref(), plan.control.bounce);
    let value = measured?.measured_value.filter(|value| value.is_finite());
    value.filter(|_| verdict == Verdict::Accept)
}

/// Returns the force amplitudes among the parameters; none unless they are at least one horizontal and the vertical one.
fn slip(parameters: &[Parameter]) -> Option<SlipParameters> {
    let has = |name: &&str| parameters.iter().any(|parameter| parameter.name == *name);
    let horizontal: Vec<String> = ["Fx", "Fy"].into_iter().filter(has).map(str::to_owned).collect();
    (!horizontal.is_empty() && has(&"Fz")).then(|| SlipParameters { horizontal, vertical: "Fz".to_owned() })
}
