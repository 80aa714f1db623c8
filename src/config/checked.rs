//! The configuration in force: its files loaded and checked, and the settings of each part drawn from them.

use std::collections::HashMap;
use std::io::{self, ErrorKind};
use std::path::Path;

use serde::de::DeserializeOwned;
use toml::Table;

use super::ConfigError;
use super::defaults::{FILES, OPTIONAL, template};
use super::files::{ControlFile, OptimizeFile, SafetyFile};
use super::merge::{FileOrigin, lookup, merge};
use super::ranges;
use crate::control::force_profile::second_direction;
use crate::control::settings::{ControlSettings, ObjectiveSource, StandSettings, TaskControl};
use crate::optimize::ask::{SamplerConfig, SamplerKind};
use crate::realtime::scheduling::Scheduling;
use crate::recording::record::HealthLimits;
use crate::robot::GRAVITY;
use crate::robot::Leg;
use crate::robot::description::{RobotDescription, RobotFiles, read_text};
use crate::sim::SimConfig;
use crate::sim::ensemble::EnsembleSettings;
use crate::sim::ranges::NumberRange;
use crate::trial::{Backend, GAIN_UNITS, HopEnvelope, ParameterInfo, ParameterValues, Task, parameter_unit};

/// A text laid over the file of a name.
#[derive(Debug, Clone, Copy)]
pub struct ConfigLayer<'a> {
    /// Name of the file, for example `control.toml`.
    pub file: &'a str,
    /// Place of the text, for messages: the path of its file.
    pub origin: &'a str,
    /// TOML with the keys that differ.
    pub text: &'a str,
}

/// All files, checked.
#[expect(missing_docs, reason = "a field has the name of its file")]
#[derive(Debug, Clone)]
pub struct Config {
    pub control: ControlFile,
    pub safety: SafetyFile,
    pub optimize: OptimizeFile,
    pub simulator: SimConfig,
    pub prior: EnsembleSettings,
    /// `console.toml`, read by the console.
    pub console: Table,
    /// Name and text of every file as in force, kept with the study that it produced.
    pub as_run: Vec<(String, String)>,
    origins: HashMap<&'static str, FileOrigin>,
}

impl Config {
    /// Names of all files.
    pub const FILE_NAMES: [&str; FILES.len()] = {
        let mut names = [""; FILES.len()];
        let mut next = 0;
        while next < FILES.len() {
            names[next] = FILES[next].0;
            next += 1;
        }
        names
    };

    /// Loads the defaults, with the files of `folder` laid over them.
    pub fn load(folder: Option<&Path>) -> Result<Config, ConfigError> {
        Config::load_over(Vec::new(), folder)
    }

    /// Loads the defaults, with the robot's own configuration laid over them, and the files of `folder` over both.
    pub fn load_for(robot: &RobotFiles, folder: Option<&Path>) -> Result<Config, ConfigError> {
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let own = robot.config().map(|(path, text)| (name(path), path.display().to_string(), text.to_owned()));
        Config::load_over(own.collect(), folder)
    }

    /// Loads the defaults, with texts (name, origin, text) laid over them, and the files of `folder` over both.
    fn load_over(mut texts: Vec<(String, String, String)>, folder: Option<&Path>) -> Result<Config, ConfigError> {
        let below = texts.len();
        if let Some(folder) = folder {
            refuse_unknown_files(folder)?;
            for (name, _) in FILES {
                let path = folder.join(name);
                let text = read_given(&path).map_err(|source| ConfigError::Read { path: path.clone(), source })?;
                texts.extend(text.map(|text| (name.to_owned(), path.display().to_string(), text)));
            }
            if texts.len() == below {
                return Err(ConfigError::NoFile {
                    path: folder.to_owned(),
                    known: FILES.map(|(file, _)| file).join(", "),
                });
            }
        }
        let layers = texts.iter().map(|(file, origin, text)| ConfigLayer { file, origin, text });
        Config::layered(&layers.collect::<Vec<_>>())
    }

    /// Returns the defaults with texts laid over them; a later text of a file replaces keys of an earlier one.
    ///
    /// # Errors
    /// When a text is no TOML, has an unknown key or a value outside its range, or is of an unknown file.
    pub fn layered(layers: &[ConfigLayer<'_>]) -> Result<Config, ConfigError> {
        if let Some(layer) = layers.iter().find(|layer| FILES.iter().all(|(name, _)| *name != layer.file)) {
            let known = FILES.map(|(file, _)| file).join(", ");
            return Err(ConfigError::UnknownFile { path: layer.origin.into(), known });
        }
        let mut origins = HashMap::new();
        let mut as_run = Vec::new();
        let mut tables = HashMap::new();
        for (name, default_text) in FILES {
            let optional = OPTIONAL.iter().find(|(file, _)| *file == name).map_or("", |(_, example)| example);
            let optional = template(optional);
            let mut default = merge(&format!("config/{name}"), default_text, &template(default_text), &optional)?;
            default.1.built_in = true;
            let mut of_file = layers.iter().filter(|layer| layer.file == name);
            let (table, origin) = of_file.try_fold(default, |(under, below), layer| {
                let (table, origin) = merge(layer.origin, layer.text, &under, &optional)?;
                let origin = origin.over(below, &table, &under);
                Ok((table, origin))
            })?;
            as_run.push((name.to_owned(), without_unused_jumps(&table).to_string()));
            origins.insert(name, origin);
            tables.insert(name, table);
        }
        let config = Config {
            control: parse("control.toml", &tables, &origins)?,
            safety: parse("safety.toml", &tables, &origins)?,
            optimize: parse("optimize.toml", &tables, &origins)?,
            simulator: parse("simulator.toml", &tables, &origins)?,
            prior: parse("prior.toml", &tables, &origins)?,
            console: tables["console.toml"].clone(),
            as_run,
            origins,
        };
        // After the types, whose error names the kind of number that a key holds.
        for (name, default) in FILES {
            ranges::check(name, &tables[name], &template(default), &config.origins[name])?;
        }
        config.check()?;
        Ok(config)
    }

    /// Replaces the sampler, also in the text that is kept.
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

    /// Returns the settings of the sampler for `task`.
    pub fn sampler(&self, task: Task) -> SamplerConfig {
        SamplerConfig { fall_price: self.optimize.fall_price[task.name()], ..self.optimize.sampler.clone() }
    }

    /// Returns the controller's settings of `task`'s trials.
    pub fn task(&self, task: Task) -> &TaskControl {
        // Present: the default file has every task, and `merge` removes none.
        &self.control.tasks[task.name()]
    }

    /// Returns the parameters of `task`, gains among them, with their bounds, in table order. Only the second direction of a task has
    /// negative bounds; for other parameters the part above zero holds.
    pub fn parameters(&self, task: Task) -> Vec<ParameterInfo> {
        self.optimize.parameters[task.name()]
            .iter()
            .map(|name| {
                let [low, high] = self.optimize.bounds[name];
                let low = if name == second_direction(task) { low } else { low.max(0.0) };
                ParameterInfo { name: name.clone(), unit: parameter_unit(name).to_owned(), low, high }
            })
            .collect()
    }

    /// Whether `task` optimizes the parameter or gain `name`.
    pub fn optimizes(&self, task: Task, name: &str) -> bool {
        self.optimize.parameters[task.name()].iter().any(|parameter| parameter == name)
    }

    /// Returns the first point of a new study of `task`; empty if none is given.
    pub fn first(&self, task: Task) -> ParameterValues {
        let Some(point) = self.optimize.first.get(task.name()) else { return ParameterValues::default() };
        let names = &self.optimize.parameters[task.name()];
        names.iter().filter_map(|name| Some((name.clone(), *point.get(name)?))).collect()
    }

    /// Returns the same parameters with the widest bounds that `safety.toml` allows.
    pub fn widest(&self, task: Task) -> Vec<ParameterInfo> {
        let widest = |parameter: ParameterInfo| match self.limits(task, &parameter.name) {
            Some([low, high]) => ParameterInfo { low, high, ..parameter },
            None => parameter,
        };
        self.parameters(task).into_iter().map(widest).collect()
    }

    /// Returns the limits of `safety.toml` for a parameter or gain of `task`, in its unit; none for an unknown name. The limit of
    /// a second direction is of the magnitude.
    pub fn limits(&self, task: Task, name: &str) -> Option<[f64; 2]> {
        let &[least, most] = self.safety.parameters.get(name).or_else(|| self.safety.gains.get(name))?;
        Some([if name == second_direction(task) { -most } else { least }, most])
    }

    /// Returns the growth of the largest forces; none on the simulator.
    pub fn hop_envelope(&self, backend: Backend) -> Option<HopEnvelope> {
        (backend == Backend::Hardware).then_some(self.safety.hop_envelope)
    }

    /// Returns the gains that are no parameters of `task`, with their allowed ranges, in table order.
    pub fn fixed_gains(&self, task: Task) -> Vec<ParameterInfo> {
        self.gains().into_iter().filter(|gain| !self.optimizes(task, &gain.name)).collect()
    }

    /// Returns the controller's gains with their allowed ranges, in table order.
    pub fn gains(&self) -> Vec<ParameterInfo> {
        GAIN_UNITS
            .iter()
            .map(|(name, unit)| {
                let [low, high] = self.safety.gains[*name];
                ParameterInfo { name: (*name).to_owned(), unit: (*unit).to_owned(), low, high }
            })
            .collect()
    }

    /// Returns the limits by which a console colours its values.
    pub fn health_limits(&self) -> HealthLimits {
        let (safety, default) = (&self.safety, HealthLimits::default());
        HealthLimits {
            state_age_ms: safety.failsafe.state_age_warn_ms,
            loss_share: safety.arming.loss_share,
            motor_c: safety.arming.motor_c,
            battery_percent: safety.arming.battery_percent,
            // 0: late ticks trip nothing.
            late_ms: Some(safety.failsafe.hardware_late_ms).filter(|ms| *ms > 0.0).unwrap_or(default.late_ms),
            late_share: default.late_share,
        }
    }

    /// Returns the source of the objective: as chosen, else the truth on the simulator and the estimate on hardware.
    ///
    /// # Errors
    /// When the name is unknown, or is `truth` on hardware, where the true state is unknown.
    pub fn objective(&self, backend: Backend) -> Result<ObjectiveSource, ConfigError> {
        let refuse = |name: &str, reason| self.refuse("optimize.toml", "objective", format!("\"{name}\""), reason);
        let Some(name) = &self.optimize.objective else {
            return Ok(match backend {
                Backend::Simulator => ObjectiveSource::Truth,
                Backend::Hardware => ObjectiveSource::Estimate,
            });
        };
        match (ObjectiveSource::from_name(name), backend) {
            (None, _) => {
                Err(refuse(name, "must be \"truth\" or \"estimate\"; leave it out for the default of the backend"))
            }
            (Some(ObjectiveSource::Truth), Backend::Hardware) => {
                Err(refuse(name, "the true state is known on the simulator only; give \"estimate\" or leave it out"))
            }
            (Some(source), _) => Ok(source),
        }
    }

    /// Returns the settings of the control cycle.
    ///
    /// # Errors
    /// When the stance of `task` is out of the robot's reach, the objective cannot be measured on `backend`, or a limit is
    /// outside its range for hardware.
    pub fn settings(
        &self,
        robot: &RobotDescription,
        task: Task,
        backend: Backend,
    ) -> Result<ControlSettings, ConfigError> {
        let chosen = self.task(task);
        self.check_stance(robot, task)?;
        self.check_directions(task)?;
        let hardware = backend == Backend::Hardware;
        if hardware {
            self.check_hardware(robot)?;
        }
        let SafetyFile { failsafe, fall, .. } = &self.safety;
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
            // A folded leg rests on its mechanical stop, beyond the limit of the commanded positions.
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
            blend_s: self.control.countdown.blend_s,
            settle: self.control.settle,
            fall: self.safety.fall,
            flight_tilt_rad: if hardware { fall.hardware_flight_rad } else { fall.simulator_flight_rad },
            contact_force_n: self.control.contact.force_n,
            objective: self.objective(backend)?,
            estimator: self.control.estimator,
            gate: self.safety.gate,
            hardware,
            arming: self.safety.arming,
            ready: self.safety.ready,
            consistency: self.safety.consistency,
            remote: self.safety.remote,
            approval: self.safety.approval,
            failsafe: *failsafe,
            late_ms: if hardware { failsafe.hardware_late_ms } else { failsafe.simulator_late_ms },
            idle_s: if hardware { failsafe.hardware_idle_s } else { failsafe.simulator_idle_s },
        })
    }

    /// Checks the limits of the files, as loaded, and of the robot's motors against their ranges for hardware.
    fn check_hardware(&self, robot: &RobotDescription) -> Result<(), ConfigError> {
        for (name, default) in FILES {
            let text = self.as_run.iter().find(|(file, _)| file == name).map_or("", |(_, text)| text.as_str());
            ranges::check_hardware(name, &template(text), &template(default), &self.origins[name])?;
        }
        ranges::check_motors(robot)
    }

    /// Returns the scheduling that the control thread requests.
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

    /// Returns where the value of a key is from: path and line of the file that gives it; none for a default.
    pub fn origin(&self, file: &str, key: &str) -> Option<String> {
        let origin = self.origins.get(file).filter(|origin| !origin.built_in)?;
        origin.place(key)
    }

    /// Returns the keys of a file of the robot's own configuration for which the given configuration has another value.
    pub fn replaced(&self, file: &str) -> &[String] {
        self.origins.get(file).map_or(&[], |origin| &origin.replaced)
    }

    /// Whether the loaded file itself gives a key, by its name with its tables.
    pub(super) fn gives(&self, file: &'static str, key: &str) -> bool {
        self.origins[file].lines.contains_key(key)
    }

    /// Returns the error of a value: file, line, key, value and reason.
    pub fn refuse(&self, file: &'static str, key: &str, value: impl ToString, reason: impl ToString) -> ConfigError {
        self.origins[file].refuse(key, value, reason)
    }
}

/// Returns the files' values without the number of jumps of tasks that have a duration: both may not be given.
fn without_unused_jumps(table: &Table) -> Table {
    let mut table = table.clone();
    let tasks = table.get_mut("tasks").and_then(toml::Value::as_table_mut);
    for task in tasks.into_iter().flat_map(|tasks| tasks.iter_mut().filter_map(|(_, task)| task.as_table_mut())) {
        if task.contains_key("duration_s") {
            task.remove("jumps");
        }
    }
    table
}

fn parse<T: DeserializeOwned>(
    name: &'static str,
    tables: &HashMap<&'static str, Table>,
    origins: &HashMap<&'static str, FileOrigin>,
) -> Result<T, ConfigError> {
    let (table, origin) = (&tables[name], &origins[name]);
    table.clone().try_into().map_err(|error: toml::de::Error| {
        let key = key_of(&error);
        let value = lookup(table, &key).map(toml::Value::to_string).unwrap_or_default();
        origin.refuse(&key, value, without_type_names(error.message(), ranges::of_key(name, &key).0))
    })
}

/// Returns the key, with its tables, at which a decoder of values failed; empty at the top. An entry of a list has the key of its list.
fn key_of(error: &toml::de::Error) -> String {
    // The error's text alone names it, in its last line.
    let text = error.to_string();
    let key = text.lines().last().and_then(|line| line.strip_prefix("in `")?.strip_suffix('`'));
    key.unwrap_or_default().to_owned()
}

/// Returns a decoder's message with the names of Rust types replaced: by the whole numbers of the key's range, if it has one.
fn without_type_names(message: &str, range: Option<&NumberRange>) -> String {
    let whole = |most: u64| match range {
        Some(range) => {
            format!("a whole number from {} to {}", range.least.max(0.0).ceil(), range.most.min(most as f64))
        }
        None => format!("a whole number from 0 to {most}"),
    };
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

/// Reads a file of a configuration folder; none where the folder has no entry of this name.
///
/// # Errors
/// As of [`read_text`]; a symbolic link to no file is one: its keys, limits among them, were meant to be in force.
fn read_given(path: &Path) -> io::Result<Option<String>> {
    match (path.symlink_metadata(), path.metadata()) {
        (Err(error), _) if error.kind() == ErrorKind::NotFound => Ok(None),
        (Ok(_), Err(error)) if error.kind() == ErrorKind::NotFound => {
            let target = path.read_link()?;
            let reason =
                format!("it is a link to {}, which does not exist; correct or remove the link", target.display());
            Err(io::Error::new(error.kind(), reason))
        }
        _ => read_text(path).map(Some),
    }
}

/// Rejects a folder that does not exist, and TOML files that are not read: probably a misspelt name.
fn refuse_unknown_files(folder: &Path) -> Result<(), ConfigError> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            return Err(ConfigError::NoFolder { path: folder.to_owned() });
        }
        Err(source) => return Err(ConfigError::Read { path: folder.to_owned(), source }),
    };
    for entry in entries {
        let path = entry.map_err(|source| ConfigError::Read { path: folder.to_owned(), source })?.path();
        let known = path.file_name().is_some_and(|name| FILES.iter().any(|(file, _)| name == *file));
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml")) && !known {
            let known = FILES.map(|(file, _)| file).join(", ");
            return Err(ConfigError::UnknownFile { path, known });
        }
    }
    Ok(())
}
