//! Rules between the keys of a configuration, and between a configuration and a robot.

use super::ConfigError;
use super::checked::Config;
use super::files::SafetyFile;
use super::kneeling;
use crate::control::force_profile::second_direction;
use crate::robot::Leg;
use crate::robot::description::RobotDescription;
use crate::sim::SimError;
use crate::trial::{Backend, ParameterInfo, Task, is_gain, parameter_unit};

const CONTROL: &str = "control.toml";
const SAFETY: &str = "safety.toml";
const OPTIMIZE: &str = "optimize.toml";
const PRIOR: &str = "prior.toml";

/// Least frequency between jumps in a row, Hz: a pause of 10 s.
pub const LEAST_F1_HZ: f64 = 0.05;

impl Config {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        self.check_control()?;
        self.check_safety()?;
        self.check_optimize()?;
        self.check_prior()?;
        self.simulator.check().map_err(|error| match error {
            SimError::Value { key, value, remedy } => self.refuse("simulator.toml", &key, value, remedy),
            SimError::Syntax { reason } => {
                ConfigError::Syntax { file: "simulator.toml".to_owned(), line: 1, message: reason }
            }
        })
    }

    fn check_control(&self) -> Result<(), ConfigError> {
        for task in Task::ALL {
            let chosen = self.task(task);
            let tables = format!("tasks.{}", task.name());
            for (key, value) in
                [("kp", chosen.kp), ("kd", chosen.kd), ("kd_joint", chosen.kd_joint), ("k_att", chosen.k_att)]
            {
                let [least, most] = self.safety.gains[key];
                if !(value >= least && value <= most) {
                    let reason =
                        format!("must be within the safe range [{least}, {most}] of safety.toml, [gains] {key}");
                    return Err(self.refuse(CONTROL, &format!("{tables}.{key}"), value, reason));
                }
            }
            let (jumps, duration) = (format!("{tables}.jumps"), format!("{tables}.duration_s"));
            if let Some(duration_s) = chosen.duration_s.filter(|_| self.gives(CONTROL, &jumps)) {
                let reason = format!("{jumps} = {} is given, too; give one of them", chosen.jumps);
                return Err(self.refuse(CONTROL, &duration, duration_s, reason));
            }
            let in_a_row = chosen.jumps > 1 || chosen.duration_s.is_some();
            if in_a_row && chosen.f1_hz < LEAST_F1_HZ && !self.optimizes(task, "f1") {
                let reason = "several jumps in a row need a frequency between them; give at least 0.05 Hz, or make f1 a parameter in optimize.toml";
                return Err(self.refuse(CONTROL, &format!("{tables}.f1_hz"), chosen.f1_hz, reason));
            }
        }
        let estimator = &self.control.estimator;
        if estimator.contact_off_n >= estimator.contact_on_n {
            let reason = format!("must be below estimator.contact_on_n = {}", estimator.contact_on_n);
            return Err(self.refuse(CONTROL, "estimator.contact_off_n", estimator.contact_off_n, reason));
        }
        Ok(())
    }

    fn check_safety(&self) -> Result<(), ConfigError> {
        let SafetyFile { fall, gate, failsafe, parameters, gains, ready, .. } = &self.safety;
        if gate.damping_kd > gate.kd_max {
            let reason =
                format!("must not be above gate.kd_max = {}, which would reduce the stop's damping", gate.kd_max);
            return Err(self.refuse(SAFETY, "gate.damping_kd", gate.damping_kd, reason));
        }
        // A warning comes before the stop that it announces, a lower limit below its upper one.
        let [warn, gap, lost] =
            [failsafe.state_age_warn_ms, failsafe.state_age_ms, failsafe.link_lost_ms].map(f64::from);
        let [quiet, silent] = [failsafe.operator_warn_ms, failsafe.operator_silent_ms].map(f64::from);
        for (key, value, stop, limit) in [
            ("watchdog.motor_warm_c", failsafe.motor_warm_c, "watchdog.motor_c", failsafe.motor_c),
            ("watchdog.delay_warn_ms", failsafe.delay_warn_ms, "watchdog.delay_hold_ms", failsafe.delay_hold_ms),
            ("watchdog.delay_hold_ms", failsafe.delay_hold_ms, "watchdog.delay_land_ms", failsafe.delay_land_ms),
            ("watchdog.state_age_ms", gap, "watchdog.link_lost_ms", lost),
            ("watchdog.state_age_warn_ms", warn, "watchdog.state_age_ms", gap),
            ("watchdog.operator_warn_ms", quiet, "watchdog.operator_silent_ms", silent),
            ("ready.force_share_min", ready.force_share_min, "ready.force_share_max", ready.force_share_max),
            ("watchdog.stance_tilt_rad", failsafe.stance_tilt_rad, "watchdog.tilt_rad", failsafe.tilt_rad),
            ("fall.roll_rad", fall.roll_rad, "watchdog.tilt_rad", failsafe.tilt_rad),
            ("fall.pitch_rad", fall.pitch_rad, "watchdog.tilt_rad", failsafe.tilt_rad),
        ] {
            if value > limit {
                return Err(self.refuse(SAFETY, key, value, format!("must not be above {stop} = {limit}")));
            }
        }
        if self.safety.remote.stop.is_empty() {
            return Err(self.refuse(
                SAFETY,
                "remote.stop",
                "\"none\"",
                "give at least one button, for example \"L2+B\"",
            ));
        }
        for (name, [low, high]) in gains {
            if !(low.is_finite() && high.is_finite() && low <= high && *low >= 0.0) {
                let reason = "must be [lowest, highest] with 0 <= lowest <= highest";
                return Err(self.refuse(SAFETY, &format!("gains.{name}"), format!("[{low}, {high}]"), reason));
            }
        }
        for (name, [low, high]) in parameters {
            if !(low.is_finite() && high.is_finite() && low < high && *low >= 0.0) {
                let reason = "must be [lowest, highest] with 0 <= lowest < highest";
                return Err(self.refuse(SAFETY, &format!("parameters.{name}"), format!("[{low}, {high}]"), reason));
            }
        }
        Ok(())
    }

    fn check_optimize(&self) -> Result<(), ConfigError> {
        self.objective(Backend::Simulator)?;
        for (name, [low, high]) in &self.optimize.bounds {
            let key = format!("bounds.{name}");
            let value = format!("[{low}, {high}]");
            if !(low.is_finite() && high.is_finite() && low <= high) {
                return Err(self.refuse(OPTIMIZE, &key, value, "must be [lower, upper] with lower <= upper"));
            }
            if parameter_unit(name) == "Hz" && *low <= 0.0 {
                return Err(self.refuse(OPTIMIZE, &key, value, "a frequency must be above 0 Hz"));
            }
            self.check_bound_limits(name, [*low, *high])?;
        }
        for (task, names) in &self.optimize.parameters {
            let key = format!("parameters.{task}");
            if names.is_empty() {
                return Err(self.refuse(OPTIMIZE, &key, "[]", "a task needs at least one parameter"));
            }
            if !names.iter().any(|name| name == "f0") {
                let reason = "a jump needs f0, the frequency of its impulse; add it (equal bounds fix it)";
                return Err(self.refuse(OPTIMIZE, &key, format!("{names:?}"), reason));
            }
            for (i, name) in names.iter().enumerate() {
                if !self.optimize.bounds.contains_key(name) {
                    let known: Vec<_> = self.optimize.bounds.keys().map(String::as_str).collect();
                    let reason = format!("there is no parameter `{name}`; the parameters are {}", known.join(", "));
                    return Err(self.refuse(OPTIMIZE, &key, format!("{names:?}"), reason));
                }
                if names[..i].contains(name) {
                    return Err(self.refuse(OPTIMIZE, &key, format!("{names:?}"), format!("`{name}` is listed twice")));
                }
            }
        }
        Task::ALL.into_iter().try_for_each(|task| self.check_first(task))
    }

    fn check_prior(&self) -> Result<(), ConfigError> {
        let inverted = |(_, [low, high]): &(&str, [f64; 2])| low > high;
        let Some((name, [low, high])) = self.prior.ranges.named().into_iter().find(inverted) else { return Ok(()) };
        let reason = "must be [lowest, highest] with lowest <= highest; equal values give every robot the same";
        Err(self.refuse(PRIOR, &format!("ranges.{name}"), format!("[{low}, {high}]"), reason))
    }

    /// Checks that the first point of `task` is within the bounds.
    fn check_first(&self, task: Task) -> Result<(), ConfigError> {
        let searched = self.parameters(task);
        for (name, value) in self.optimize.first.get(task.name()).into_iter().flatten() {
            let of_task = searched.iter().find(|p| p.name == *name).map(|p| [p.low, p.high]);
            let [low, high] = of_task.unwrap_or(self.optimize.bounds[name]);
            if !(*value >= low && *value <= high) {
                let reason = format!("outside its bounds [{low}, {high}]: widen the bounds or remove the first point");
                return Err(self.refuse(OPTIMIZE, &format!("first.{}.{name}", task.name()), value, reason));
            }
        }
        Ok(())
    }

    /// Checks the bounds of a parameter against its limits in `safety.toml`, those of a gain only where a task optimizes it.
    /// Negative bounds need a task whose second direction it is; the other tasks search the part above zero.
    fn check_bound_limits(&self, name: &str, [low, high]: [f64; 2]) -> Result<(), ConfigError> {
        let refuse =
            |reason: String| self.refuse(OPTIMIZE, &format!("bounds.{name}"), format!("[{low}, {high}]"), reason);
        let tasks: Vec<Task> = Task::ALL.into_iter().filter(|task| self.optimizes(*task, name)).collect();
        let is_second = |task: &Task| second_direction(*task) == name;
        let outside = |[least, most]: [f64; 2], low: f64| {
            let table = if is_gain(name) { "gains" } else { "parameters" };
            (low < least || high > most).then(|| {
                format!(
                    "outside the robot's limits [{least}, {most}] of safety.toml, [{table}] {name}; narrow the bounds"
                )
            })
        };
        let both_signs = tasks.iter().any(is_second);
        let of_task = |task: &Task| {
            let low = if both_signs && !is_second(task) { low.max(0.0) } else { low };
            outside(self.limits(*task, name)?, low)
        };
        let unused =
            || self.safety.parameters.get(name).filter(|_| tasks.is_empty()).and_then(|limits| outside(*limits, low));
        let reason = tasks.iter().find_map(of_task).or_else(unused);
        reason.map_or(Ok(()), |reason| Err(refuse(reason)))
    }

    /// Checks that bounds below zero leave something to search for `task`: they are those of another task's second direction.
    pub(super) fn check_directions(&self, task: Task) -> Result<(), ConfigError> {
        let searched = self.parameters(task);
        let Some(ParameterInfo { name, .. }) = searched.iter().find(|parameter| parameter.low > parameter.high) else {
            return Ok(());
        };
        let reason = format!("{} pushes with positive {name} only; give an upper bound above 0", task.name());
        Err(self.refuse(OPTIMIZE, &format!("bounds.{name}"), format!("{:?}", self.optimize.bounds[name]), reason))
    }

    /// Checks that the stance of `task` is within the robot's reach and joint limits.
    pub(super) fn check_stance(&self, robot: &RobotDescription, task: Task) -> Result<(), ConfigError> {
        let key = format!("tasks.{}.stance_m", task.name());
        let chosen = self.task(task);
        let value = format!("{:?}", chosen.stance_m);
        let (min_position, max_position) = robot.allowed_positions();
        for leg in Leg::ALL {
            let foot = leg.mirrored(&chosen.stance_leg());
            let q = robot
                .leg_geometry
                .inverse(&foot, leg.left_sign())
                .map_err(|error| self.refuse(CONTROL, &key, &value, error))?;
            for (joint, angle) in q.iter().enumerate() {
                let i = 3 * leg as usize + joint;
                let (least, most) = (min_position[i], max_position[i]);
                if !(least..=most).contains(angle) {
                    let reason = format!(
                        "needs {} at {angle:.3} rad, which the robot's limits [{least}, {most}] forbid",
                        crate::robot::joint_name(i)
                    );
                    return Err(self.refuse(CONTROL, &key, &value, reason));
                }
            }
        }
        let softest = self.parameters(task).into_iter().find(|parameter| parameter.name == "kp");
        let kp = softest.map_or(chosen.kp, |parameter| parameter.low.min(chosen.kp));
        let clearance_m = kneeling::clearance_m(robot, &chosen.stance_leg(), kp);
        if clearance_m < 0.0 {
            let reason = format!(
                "the robot kneels before the jump: sagged under its weight with kp = {kp} N/m, thigh or calf is {:.3} m in the ground; lower the feet or raise kp",
                -clearance_m
            );
            return Err(self.refuse(CONTROL, &key, &value, reason));
        }
        Ok(())
    }
}
