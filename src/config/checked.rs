//! The files as values, and every check that needs more than a key's kind.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Table;

use super::ConfigError;
use super::merge::merge;
use super::safety::SafetyFile;
use crate::control::estimator::GRAVITY;
use crate::control::leg::stance_of;
use crate::control::settings::{
    ControlSettings, EstimatorSettings, ObjectiveSource, RampSettings, SettleSettings, StandSettings, TaskControl,
};
use crate::optimize::sampler::{SamplerConfig, SamplerKind};
use crate::realtime::scheduling::Scheduling;
use crate::robot::Leg;
use crate::robot::description::RobotDescription;
use crate::sim::{SimConfig, SimError};
use crate::trial::{ParameterInfo, Task};

/// Largest damping of Virtual Model Control, N s/m: a corner that moves at 1 m/s then meets half of the stiffness' force at a
/// tilt of 1 rad.
const MAX_ATTITUDE_RATE_GAIN: f64 = 100.0;
/// Longest time of the foot placement, s: at 1 m/s the foot is then placed 0.3 m ahead, the end of the leg's reach.
const MAX_FOOT_PLACEMENT_S: f64 = 0.3;

/// The files of a configuration folder and their defaults.
const FILES: [(&str, &str); 5] = [
    ("control.toml", include_str!("../../config/control.toml")),
    ("safety.toml", include_str!("../../config/safety.toml")),
    ("optimize.toml", include_str!("../../config/optimize.toml")),
    ("simulator.toml", include_str!("../../config/simulator.toml")),
    ("console.toml", include_str!("../../config/console.toml")),
];

/// The gains of the controller, in table order, with their units.
const GAINS: [(&str, &str); 4] = [("kp", "N/m"), ("kd", "N s/m"), ("kd_joint", "N m s/rad"), ("k_att", "N/m")];

/// Keys that may be given though the defaults leave them out, each with an example of its kind.
const OPTIONAL: [(&str, &str); 1] = [(
    "optimize.toml",
    "objective = \"truth\"
[sampler]
startup_trials = 10
[first]
forward = { f0 = 1.0, f1 = 1.0, Fx = 1.0, Fy = 1.0, Fz = 1.0 }
lateral-left = { f0 = 1.0, f1 = 1.0, Fx = 1.0, Fy = 1.0, Fz = 1.0 }
lateral-right = { f0 = 1.0, f1 = 1.0, Fx = 1.0, Fy = 1.0, Fz = 1.0 }
twist-ccw = { f0 = 1.0, f1 = 1.0, Fx = 1.0, Fy = 1.0, Fz = 1.0 }
twist-cw = { f0 = 1.0, f1 = 1.0, Fx = 1.0, Fy = 1.0, Fz = 1.0 }
",
)];

/// Which machine stands behind the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Backend {
    /// The built-in simulator.
    Simulator,
    /// A robot over its network.
    Hardware,
}

/// `control.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct ControlFile {
    /// Standing up.
    pub stand_up: RampSettings,
    /// Sitting down.
    pub sit_down: RampSettings,
    /// From approval to the impulse.
    pub countdown: Countdown,
    /// When a trial is over.
    pub settle: SettleSettings,
    /// When a foot is on the ground.
    pub contact: Contact,
    /// How the base's state is estimated.
    pub estimator: EstimatorSettings,
    /// What the control thread asks of the system.
    pub realtime: RealtimeFile,
    /// What each task's trials run with.
    pub tasks: BTreeMap<String, TaskControl>,
}

/// What the control thread asks of the system.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct RealtimeFile {
    /// Priority under SCHED_FIFO on hardware; 0 asks for nothing.
    pub hardware_priority: u8,
    /// The same on the simulator.
    pub simulator_priority: u8,
    /// The core to stay on; -1 leaves the choice to the system.
    pub core: i64,
    /// Whether the program's memory is locked.
    pub lock_memory: bool,
}

/// From approval to the impulse, standing still.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Countdown {
    /// On the simulator, s.
    pub simulator_s: f64,
    /// On hardware, s.
    pub hardware_s: f64,
}

/// When a foot is on the ground, by the simulator's own knowledge.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Contact {
    /// Least force of the ground on it, N.
    pub force_n: f64,
}

/// `optimize.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct OptimizeFile {
    /// Trials that count.
    pub trials: u32,
    /// Name of what the objective is measured from; none takes what the backend has.
    pub objective: Option<String>,
    /// Bounds of each parameter.
    pub bounds: BTreeMap<String, [f64; 2]>,
    /// Which parameters each task optimizes.
    pub parameters: BTreeMap<String, Vec<String>>,
    /// The sampler.
    pub sampler: SamplerConfig,
    /// Repeats of the best points.
    pub confirm: ConfirmFile,
    /// Several programs on one study.
    pub workers: WorkersFile,
    /// The point that a new study of each task begins with, as `export to config` writes it.
    #[serde(default)]
    pub first: BTreeMap<String, BTreeMap<String, f64>>,
}

/// When the best point counts as confirmed.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct ConfirmFile {
    /// How many points are repeated.
    pub contenders: u32,
    /// Confidence at which one leads, 0.5 to 1.
    pub confidence: f64,
}

/// Several programs on one study.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct WorkersFile {
    /// After how long a running trial of another worker counts as dead, s.
    pub abandoned_s: f64,
}

/// All files, checked.
#[derive(Debug, Clone)]
pub struct Config {
    /// `control.toml`.
    pub control: ControlFile,
    /// `safety.toml`.
    pub safety: SafetyFile,
    /// `optimize.toml`.
    pub optimize: OptimizeFile,
    /// `simulator.toml`.
    pub simulator: SimConfig,
    /// `console.toml`, for the console to read.
    pub console: Table,
    /// Every file as it is in force, to be kept with what it produced: name and text.
    pub as_run: Vec<(String, String)>,
    places: HashMap<&'static str, Place>,
}

/// Where a file came from, for messages.
#[derive(Debug, Clone)]
struct Place {
    file: String,
    lines: HashMap<String, usize>,
}

impl Place {
    fn refuse(&self, key: &str, value: impl ToString, reason: impl ToString) -> ConfigError {
        let file = match self.lines.get(key) {
            Some(line) => format!("{}:{line}", self.file),
            None => self.file.clone(),
        };
        ConfigError::Value { file, key: key.to_owned(), value: value.to_string(), reason: reason.to_string() }
    }
}

impl Config {
    /// The defaults, or the files of `folder` laid over them.
    ///
    /// # Errors
    /// When a file cannot be read or holds a key or a value that cannot be; the message names it.
    pub fn load(folder: Option<&Path>) -> Result<Config, ConfigError> {
        if let Some(folder) = folder {
            refuse_strangers(folder)?;
        }
        let mut places = HashMap::new();
        let mut as_run = Vec::new();
        let mut tables = HashMap::new();
        for (name, default_text) in FILES {
            let embedded = format!("config/{name}");
            let optional = OPTIONAL.iter().find(|(file, _)| *file == name).map_or("", |(_, example)| example);
            let optional = template(optional);
            let default = merge(&embedded, default_text, &template(default_text), &optional)?;
            let (table, place) = match folder.map(|folder| folder.join(name)).filter(|path| path.exists()) {
                Some(path) => {
                    let text = std::fs::read_to_string(&path)
                        .map_err(|source| ConfigError::Read { path: path.clone(), source })?;
                    let file = path.display().to_string();
                    let merged = merge(&file, &text, &default.table, &optional)?;
                    (merged.table, Place { file, lines: merged.lines })
                }
                None => (default.table, Place { file: embedded, lines: default.lines }),
            };
            as_run.push((name.to_owned(), table.to_string()));
            places.insert(name, place);
            tables.insert(name, table);
        }
        let mut take = |name: &'static str| (name, tables.remove(name).unwrap_or_default());
        let config = Config {
            control: parse(&places, take("control.toml"))?,
            safety: parse(&places, take("safety.toml"))?,
            optimize: parse(&places, take("optimize.toml"))?,
            simulator: parse(&places, take("simulator.toml"))?,
            console: take("console.toml").1,
            as_run,
            places,
        };
        config.check()?;
        Ok(config)
    }

    /// Another sampler than the file says; the configuration that is kept says so too.
    pub fn choose_sampler(&mut self, kind: SamplerKind) {
        self.optimize.sampler.kind = kind;
        let name = toml::Value::try_from(kind);
        let kept = self.as_run.iter_mut().find(|(file, _)| file == "optimize.toml");
        if let (Ok(name), Some((_, text))) = (name, kept)
            && let Ok(mut table) = text.parse::<Table>()
            && let Some(toml::Value::Table(sampler)) = table.get_mut("sampler")
        {
            sampler.insert("kind".to_owned(), name);
            *text = table.to_string();
        }
    }

    /// What `task`'s trials run with.
    pub fn task(&self, task: Task) -> &TaskControl {
        // `check` has seen that every task is there.
        &self.control.tasks[task.name()]
    }

    /// The parameters of `task` with their bounds, in table order.
    pub fn parameters(&self, task: Task) -> Vec<ParameterInfo> {
        self.optimize.parameters[task.name()]
            .iter()
            .map(|name| {
                let [low, high] = self.optimize.bounds[name];
                let unit = if name.starts_with('f') { "Hz" } else { "N" };
                ParameterInfo { name: name.clone(), unit: unit.to_owned(), low, high }
            })
            .collect()
    }

    /// The point that a new study of `task` begins with; empty where none is given.
    pub fn first(&self, task: Task) -> Vec<(String, f64)> {
        let Some(point) = self.optimize.first.get(task.name()) else { return Vec::new() };
        let names = &self.optimize.parameters[task.name()];
        names.iter().filter_map(|name| Some((name.clone(), *point.get(name)?))).collect()
    }

    /// The same parameters with the widest bounds that they may be given.
    pub fn widest(&self, task: Task) -> Vec<ParameterInfo> {
        let widest = |parameter: ParameterInfo| {
            let [low, high] = self.safety.parameters[&parameter.name];
            ParameterInfo { low, high, ..parameter }
        };
        self.parameters(task).into_iter().map(widest).collect()
    }

    /// The controller's gains with the ranges in which they may be set, in table order.
    pub fn gains(&self) -> Vec<ParameterInfo> {
        GAINS
            .iter()
            .map(|(name, unit)| {
                let [low, high] = self.safety.gains[*name];
                ParameterInfo { name: (*name).to_owned(), unit: (*unit).to_owned(), low, high }
            })
            .collect()
    }

    /// What the objective is measured from: as chosen, or else the truth on the simulator and the estimate on hardware.
    ///
    /// # Errors
    /// When it is something else than those two, or the truth is asked of hardware, which does not know it.
    pub fn objective(&self, backend: Backend) -> Result<ObjectiveSource, ConfigError> {
        let refuse = |name: &str, reason| self.refuse("optimize.toml", "objective", format!("\"{name}\""), reason);
        let Some(name) = &self.optimize.objective else {
            return Ok(match backend {
                Backend::Simulator => ObjectiveSource::Truth,
                Backend::Hardware => ObjectiveSource::Estimate,
            });
        };
        match (ObjectiveSource::from_name(name), backend) {
            (None, _) => Err(refuse(name, "must be \"truth\" or \"estimate\", or be left out")),
            (Some(ObjectiveSource::Truth), Backend::Hardware) => Err(refuse(
                name,
                "a robot does not know the truth, only a simulator does; take \"estimate\" or leave it out",
            )),
            (Some(source), _) => Ok(source),
        }
    }

    /// What the control cycle is made with.
    ///
    /// # Errors
    /// When the stance of `task` is out of the robot's reach, or the objective cannot be measured on `backend`.
    pub fn settings(
        &self,
        robot: &RobotDescription,
        task: Task,
        backend: Backend,
    ) -> Result<ControlSettings, ConfigError> {
        let chosen = self.task(task);
        self.check_stance(robot, task)?;
        let hardware = backend == Backend::Hardware;
        let SafetyFile { watchdog, fall, .. } = &self.safety;
        let (min_position, max_position) = robot.allowed_positions();
        Ok(ControlSettings {
            geometry: robot.leg_geometry,
            hip_origin_body: Leg::ALL.map(|leg| robot.legs[leg as usize].joint_origin[0]),
            imu_origin_body: robot.imu_origin,
            foot_radius: robot.legs[0].foot_radius,
            min_position,
            max_position,
            max_torque: robot.limits.max_torque,
            max_velocity: robot.limits.max_velocity,
            // A folded leg rests on its mechanical stop; what is asked of the motors ends at the limit.
            lying_position: std::array::from_fn(|i| robot.lying_position[i].clamp(min_position[i], max_position[i])),
            weight_n: robot.total_mass() * GRAVITY,
            stand: StandSettings {
                gains: chosen.gains(),
                stance_leg: chosen.stance_leg(),
                vmc: chosen.vmc,
                attitude_rate_gain: chosen.attitude_rate_gain,
            },
            stand_up: self.control.stand_up,
            sit_down: self.control.sit_down,
            countdown_s: if hardware { self.control.countdown.hardware_s } else { self.control.countdown.simulator_s },
            settle: self.control.settle,
            fall: self.safety.fall,
            flight_tilt_rad: if hardware { fall.hardware_flight_rad } else { fall.simulator_flight_rad },
            contact_force_n: self.control.contact.force_n,
            objective: self.objective(backend)?,
            estimator: self.control.estimator,
            gate: self.safety.gate,
            hardware,
            pre_arm: self.safety.pre_arm,
            approval: self.safety.approval,
            watchdog: *watchdog,
            late_ms: if hardware { watchdog.hardware_late_ms } else { watchdog.simulator_late_ms },
            idle_s: if hardware { watchdog.hardware_idle_s } else { watchdog.simulator_idle_s },
        })
    }

    /// What the control thread asks of the system.
    pub fn scheduling(&self, backend: Backend) -> Scheduling {
        let realtime = &self.control.realtime;
        Scheduling {
            priority: match backend {
                Backend::Hardware => realtime.hardware_priority,
                Backend::Simulator => realtime.simulator_priority,
            },
            core: usize::try_from(realtime.core).ok(),
            lock_memory: realtime.lock_memory,
        }
    }

    /// Says where `key` of `file` stands, and what is wrong with it.
    pub fn refuse(&self, file: &'static str, key: &str, value: impl ToString, reason: impl ToString) -> ConfigError {
        self.places[file].refuse(key, value, reason)
    }

    fn check(&self) -> Result<(), ConfigError> {
        self.check_control()?;
        self.check_safety()?;
        self.check_optimize()?;
        self.simulator.check().map_err(|error| match error {
            SimError::Value { key, value, remedy } => self.refuse("simulator.toml", key, value, remedy),
            SimError::Syntax { reason } => {
                ConfigError::Syntax { file: "simulator.toml".to_owned(), line: 1, message: reason }
            }
        })
    }

    fn check_control(&self) -> Result<(), ConfigError> {
        const FILE: &str = "control.toml";
        let control = &self.control;
        let mut positive = vec![
            ("countdown.hardware_s".to_owned(), control.countdown.hardware_s),
            ("settle.quiet_s".to_owned(), control.settle.quiet_s),
            ("settle.cap_s".to_owned(), control.settle.cap_s),
            ("settle.speed_m_s".to_owned(), control.settle.speed_m_s),
            ("settle.rate_rad_s".to_owned(), control.settle.rate_rad_s),
            ("contact.force_n".to_owned(), control.contact.force_n),
        ];
        for (name, ramp) in [("stand_up", &control.stand_up), ("sit_down", &control.sit_down)] {
            for (key, value) in [
                ("duration_s", ramp.duration_s),
                ("kp", ramp.kp),
                ("kd", ramp.kd),
                ("tolerance_rad", ramp.tolerance_rad),
                ("timeout_s", ramp.timeout_s),
            ] {
                positive.push((format!("{name}.{key}"), value));
            }
        }
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
                    return Err(self.refuse(FILE, &format!("{tables}.{key}"), value, reason));
                }
            }
            for (key, value, most, unit) in [
                ("attitude_rate_gain", chosen.attitude_rate_gain, MAX_ATTITUDE_RATE_GAIN, "N s/m"),
                ("foot_placement_s", chosen.foot_placement_s, MAX_FOOT_PLACEMENT_S, "s"),
            ] {
                if !(0.0..=most).contains(&value) {
                    return Err(self.refuse(
                        FILE,
                        &format!("{tables}.{key}"),
                        value,
                        format!("must be 0 to {most} {unit}"),
                    ));
                }
            }
            if chosen.jumps == 0 || chosen.jumps > 100 {
                let reason = "must be 1 to 100 jumps";
                return Err(self.refuse(FILE, &format!("{tables}.jumps"), chosen.jumps, reason));
            }
            let f1_is_parameter = self.optimize.parameters[task.name()].iter().any(|name| name == "f1");
            if chosen.jumps > 1 && chosen.f1_hz <= 0.0 && !f1_is_parameter {
                let reason = "several jumps in a row need a frequency between them; give one above 0 Hz, or make f1 a parameter in optimize.toml";
                return Err(self.refuse(FILE, &format!("{tables}.f1_hz"), chosen.f1_hz, reason));
            }
            if !(chosen.f1_hz >= 0.0 && chosen.f1_hz.is_finite()) {
                return Err(self.refuse(FILE, &format!("{tables}.f1_hz"), chosen.f1_hz, "must be 0 or more"));
            }
        }
        if !(control.countdown.simulator_s >= 0.0 && control.countdown.simulator_s <= 60.0) {
            let reason = "must be 0 to 60 s";
            return Err(self.refuse(FILE, "countdown.simulator_s", control.countdown.simulator_s, reason));
        }
        let estimator = &control.estimator;
        positive.extend(estimator.numbers().map(|(key, value)| (format!("estimator.{key}"), value)));
        if estimator.contact_off_n >= estimator.contact_on_n {
            let reason = format!("must be below estimator.contact_on_n = {}", estimator.contact_on_n);
            return Err(self.refuse(FILE, "estimator.contact_off_n", estimator.contact_off_n, reason));
        }
        let realtime = &control.realtime;
        for (key, value) in [
            ("realtime.hardware_priority", realtime.hardware_priority),
            ("realtime.simulator_priority", realtime.simulator_priority),
        ] {
            if value > 99 {
                return Err(self.refuse(FILE, key, value, "must be 1 to 99, or 0 to ask for nothing"));
            }
        }
        if realtime.core < -1 {
            let reason = "must be the number of a core, from 0, or -1 for any";
            return Err(self.refuse(FILE, "realtime.core", realtime.core, reason));
        }
        self.all_positive(FILE, &positive)
    }

    fn check_optimize(&self) -> Result<(), ConfigError> {
        const FILE: &str = "optimize.toml";
        self.objective(Backend::Simulator)?;
        if self.optimize.trials == 0 {
            return Err(self.refuse(FILE, "trials", 0, "a study needs at least one trial"));
        }
        let ConfirmFile { contenders, confidence } = self.optimize.confirm;
        if !(2..=10).contains(&contenders) {
            return Err(self.refuse(FILE, "confirm.contenders", contenders, "must be 2 to 10 points"));
        }
        if !(confidence > 0.5 && confidence < 1.0) {
            return Err(self.refuse(FILE, "confirm.confidence", confidence, "must be above 0.5 and below 1"));
        }
        self.all_positive(FILE, &[("workers.abandoned_s".to_owned(), self.optimize.workers.abandoned_s)])?;
        for (name, [low, high]) in &self.optimize.bounds {
            let key = format!("bounds.{name}");
            let value = format!("[{low}, {high}]");
            let [least, most] = self.safety.parameters[name];
            if !(low.is_finite() && high.is_finite() && low <= high) {
                return Err(self.refuse(FILE, &key, value, "must be [lower, upper] with lower <= upper"));
            }
            if name.starts_with('f') && *low <= 0.0 {
                return Err(self.refuse(FILE, &key, value, "a frequency must be above 0 Hz"));
            }
            if *low < least || *high > most {
                let reason = format!(
                    "outside the robot's limits [{least}, {most}] of safety.toml, [parameters] {name}; narrow the bounds"
                );
                return Err(self.refuse(FILE, &key, value, reason));
            }
        }
        for (task, point) in &self.optimize.first {
            for (name, value) in point {
                let [low, high] = self.optimize.bounds[name];
                if !(*value >= low && *value <= high) {
                    let reason = format!("outside its bounds [{low}, {high}]: a study could not begin with it");
                    return Err(self.refuse(FILE, &format!("first.{task}.{name}"), value, reason));
                }
            }
        }
        for (task, names) in &self.optimize.parameters {
            let key = format!("parameters.{task}");
            if names.is_empty() {
                return Err(self.refuse(FILE, &key, "[]", "a task needs at least one parameter"));
            }
            if !names.iter().any(|name| name == "f0") {
                let reason = "a jump needs f0, the frequency of its impulse; add it (equal bounds fix it)";
                return Err(self.refuse(FILE, &key, format!("{names:?}"), reason));
            }
            for (i, name) in names.iter().enumerate() {
                if !self.optimize.bounds.contains_key(name) {
                    let known: Vec<_> = self.optimize.bounds.keys().map(String::as_str).collect();
                    let reason = format!("there is no parameter `{name}`; the parameters are {}", known.join(", "));
                    return Err(self.refuse(FILE, &key, format!("{names:?}"), reason));
                }
                if names[..i].contains(name) {
                    return Err(self.refuse(FILE, &key, format!("{names:?}"), format!("`{name}` stands there twice")));
                }
            }
        }
        Ok(())
    }

    fn check_stance(&self, robot: &RobotDescription, task: Task) -> Result<(), ConfigError> {
        let key = format!("tasks.{}.stance_m", task.name());
        let chosen = self.task(task);
        let value = format!("{:?}", chosen.stance_m);
        let (min_position, max_position) = robot.allowed_positions();
        for leg in Leg::ALL {
            let foot = stance_of(&chosen.stance_leg(), leg);
            let q = robot
                .leg_geometry
                .inverse(&foot, leg.side())
                .map_err(|error| self.refuse("control.toml", &key, &value, error))?;
            for (joint, angle) in q.iter().enumerate() {
                let i = 3 * leg as usize + joint;
                let (least, most) = (min_position[i], max_position[i]);
                if !(least..=most).contains(angle) {
                    let reason = format!(
                        "needs {} at {angle:.3} rad, which the robot's limits [{least}, {most}] forbid",
                        crate::robot::joint_name(i)
                    );
                    return Err(self.refuse("control.toml", &key, &value, reason));
                }
            }
        }
        Ok(())
    }

    pub(super) fn all_positive(&self, file: &'static str, values: &[(String, f64)]) -> Result<(), ConfigError> {
        match values.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            Some((key, value)) => Err(self.refuse(file, key, value, "must be a number above 0")),
            None => Ok(()),
        }
    }
}

/// The defaults are their own template: what they hold is what may be given.
fn template(text: &str) -> Table {
    text.parse().unwrap_or_default()
}

fn parse<T: DeserializeOwned>(
    places: &HashMap<&'static str, Place>,
    (name, table): (&'static str, Table),
) -> Result<T, ConfigError> {
    let place = &places[name];
    serde_path_to_error::deserialize(toml::Value::Table(table.clone())).map_err(|error| {
        let key = error.path().to_string();
        // An entry of a list stands where its list does.
        let key = key.split('[').next().unwrap_or(&key);
        let value = lookup(&table, key).map(toml::Value::to_string).unwrap_or_default();
        place.refuse(key, value, in_plain_words(error.inner().message()))
    })
}

/// What a decoder says, without the names of our types.
fn in_plain_words(message: &str) -> String {
    let whole = |most: u64| format!("a whole number from 0 to {most}");
    let Some((found, kind)) = message.rsplit_once("expected ") else { return message.to_owned() };
    let kind = match kind {
        "u8" => whole(u8::MAX.into()),
        "u16" => whole(u16::MAX.into()),
        "u32" => whole(u32::MAX.into()),
        "u64" | "usize" => whole(u64::MAX),
        kind => kind.to_owned(),
    };
    format!("{found}expected {kind}")
}

/// The value of a key with its tables.
fn lookup<'a>(table: &'a Table, key: &str) -> Option<&'a toml::Value> {
    let mut parts = key.split('.');
    let first = table.get(parts.next()?)?;
    parts.try_fold(first, |value, part| value.get(part))
}

/// A folder must exist, and a TOML file in it that no one reads is probably a misspelt name.
fn refuse_strangers(folder: &Path) -> Result<(), ConfigError> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(_) => return Err(ConfigError::NoFolder { path: folder.to_owned() }),
    };
    for entry in entries {
        let path = entry.map_err(|source| ConfigError::Read { path: folder.to_owned(), source })?.path();
        let known = path.file_name().is_some_and(|name| FILES.iter().any(|(file, _)| name == *file));
        if path.extension().is_some_and(|extension| extension == "toml") && !known {
            let known = FILES.map(|(file, _)| file).join(", ");
            return Err(ConfigError::UnknownFile { path, known });
        }
    }
    Ok(())
}
