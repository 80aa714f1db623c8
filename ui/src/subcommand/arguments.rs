//! Arguments that several commands share, and parsers for the engine's named values.

use std::fmt::Display;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, ToSocketAddrs};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Once;

use crate::notice;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap_complete::ArgValueCandidates;
use nix::unistd::{User, getuid};
use quadfrog::config::Config;
use quadfrog::engine::{Provenance, STUDY_FILE, check_kept_config, kept_robot, newest_config};
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::printable::is_unprintable;
use quadfrog::robot::description::{RobotDescription, RobotFiles};
use quadfrog::robot::hardware::Network;
use quadfrog::trial::Task;

use super::completion;
use super::failure::Failure;

/// Version of the program and commit of its sources.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("QUADFROG_COMMIT"), ")");

/// Parses one of several named values; each row is a value, its name and its line of help.
pub fn one_of<T: Copy + Send + Sync + 'static>(
    rows: impl IntoIterator<Item = (T, &'static str, &'static str)>,
) -> impl TypedValueParser<Value = T> {
    let rows: Vec<_> = rows.into_iter().collect();
    let values: Vec<_> = rows.iter().map(|(_, name, help)| PossibleValue::new(*name).help(*help)).collect();
    PossibleValuesParser::new(values).try_map(move |text| {
        rows.iter().find(|(_, name, _)| *name == text).map(|(value, ..)| *value).ok_or("not one of the values")
    })
}

/// Parses a whole number within a range; unlike clap's own parser it says what is asked for.
pub fn whole_number<T>(range: RangeInclusive<T>) -> impl TypedValueParser<Value = T>
where
    T: FromStr + PartialOrd + Display + Clone + Send + Sync + 'static,
{
    move |text: &str| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("give a whole number from {} to {}", range.start(), range.end()))
    }
}

/// Parses a number within a range; unlike clap's own parser it says what is asked for.
pub fn number_within(range: RangeInclusive<f64>) -> impl TypedValueParser<Value = f64> {
    move |text: &str| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("give {} to {}", range.start(), range.end()))
    }
}

/// Parses a task.
pub fn task() -> impl TypedValueParser<Value = Task> {
    one_of(Task::ALL.map(|task| {
        let help = match task {
            Task::Forward => "Jump forward",
            Task::LateralLeft => "Jump to the left",
            Task::LateralRight => "Jump to the right",
            Task::TwistCcw => "Turn counterclockwise",
            Task::TwistCw => "Turn clockwise",
        };
        (task, task.name(), help)
    }))
}

/// Parses a sampler.
pub fn sampler() -> impl TypedValueParser<Value = SamplerKind> {
    one_of(SamplerKind::ALL.iter().map(|&kind| {
        let help = match kind {
            SamplerKind::Tpe => "Tree-structured Parzen estimator, as Optuna",
            SamplerKind::Gp => "Gaussian process, better with some tens of trials",
            SamplerKind::Sim => "Gaussian process about simulated robots, for some five trials on a robot",
            SamplerKind::Random => "Uniform random",
            SamplerKind::Sobol => "Sobol sequence (quasi-random)",
        };
        (kind, kind.name(), help)
    }))
}

/// Returns the robot model of a name, or of a folder with a URDF and a robot.toml.
pub fn load_model(model: &str) -> Result<(RobotFiles, RobotDescription), Failure> {
    let files = RobotFiles::open(model).map_err(Failure::input)?;
    let description = files.description().map_err(Failure::input)?;
    Ok((files, description))
}

/// Loads the configuration of a command: that of `--config`, else the user's own, else the built-in one.
pub fn load_config(given: Option<&Path>) -> Result<Config, Failure> {
    Ok(Config::load(given_or_user(given)?.as_deref())?)
}

/// Loads the configuration of a command with a robot: as [`load_config`], laid over the robot's own. Reports the values of the
/// robot's own that do not apply, as when the user's own holds whole files for another robot.
pub fn load_config_for(robot: &RobotFiles, given: Option<&Path>) -> Result<Config, Failure> {
    let given = given_or_user(given)?;
    let config = Config::load_for(robot, given.as_deref())?;
    for (folder, file) in given.iter().flat_map(|folder| Config::FILE_NAMES.map(|file| (folder, file))) {
        if let replaced @ [_, ..] = config.replaced(file) {
            let (file, keys) = (folder.join(file), replaced.join(", "));
            notice!("{} replaces values of the robot's own configuration: {keys}", file.display());
        }
    }
    Ok(config)
}

/// Returns the given configuration, else the user's own, if there is one; reports that the user's own is used.
pub fn given_or_user(given: Option<&Path>) -> Result<Option<PathBuf>, Failure> {
    if let Some(given) = given {
        return Ok(Some(given.to_owned()));
    }
    let Some(own) = user_folder() else { return Ok(None) };
    let has_toml = has_toml(&own).map_err(|error| {
        let remedy = "correct it, or name another configuration with --config DIR where the command has this option";
        Failure::input(format!("the configuration {} cannot be read: {error}; {remedy}", own.display()))
    })?;
    // One without a TOML file is as good as none.
    if !has_toml {
        return Ok(None);
    }
    notice!("configuration: {}", own.display());
    Ok(Some(own))
}

/// Whether a folder has a TOML file; not if there is no such folder.
fn has_toml(folder: &Path) -> io::Result<bool> {
    let entries = match folder.read_dir() {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(false),
        // The home of a service is none, as /dev/null.
        Err(error) if error.kind() == ErrorKind::NotADirectory && folder.symlink_metadata().is_err() => {
            return Ok(false);
        }
        entries => entries?,
    };
    for entry in entries {
        if entry?.path().extension().is_some_and(|extension| extension == "toml") {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Returns the place of the user's own configuration, by the XDG Base Directory Specification: `$XDG_CONFIG_HOME/quadfrog`, where the
/// variable is an absolute path, else `~/.config/quadfrog`.
pub fn user_folder() -> Option<PathBuf> {
    let absolute = |path: &PathBuf| path.is_absolute();
    let of_variable = |name| std::env::var_os(name).map(PathBuf::from).filter(absolute);
    let base = of_variable("XDG_CONFIG_HOME").or_else(|| Some(of_variable("HOME")?.join(".config")))?;
    Some(base.join("quadfrog"))
}

/// Arguments of the console and of `optimize`.
#[derive(Debug, Clone, Args)]
pub struct StudyArguments {
    /// Budget: number of trials that count [default: from optimize.toml]
    #[arg(long, value_name = "N", value_parser = whole_number(1_u32..=u32::MAX))]
    pub trials: Option<u32>,
    /// Folder whose TOML files replace those of the configuration, whole or key by key [default: ~/.config/quadfrog if it
    /// exists]
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// Robot model: go1, a1, go2, or a folder with a URDF and a robot.toml [default: that of a continued study, else the robot
    /// that is driven, else go1]
    #[arg(long, value_name = "MODEL", add = ArgValueCandidates::new(completion::robots))]
    pub model: Option<String>,
    /// Sampler that proposes the parameters [default: from optimize.toml]
    #[arg(long, value_name = "SAMPLER", value_parser = sampler())]
    sampler: Option<SamplerKind>,
    /// Parent folder of new studies
    #[arg(long, value_name = "DIR", default_value = "recordings")]
    pub output: PathBuf,
    /// Name of the operator, for the recording [default: the user's name]
    #[arg(long, value_name = "NAME", value_parser = printable_name)]
    operator: Option<String>,
}

/// Model of a robot that no argument names.
pub const DEFAULT_MODEL: &str = "go1";

/// A robot with a network that can be driven or emulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RealRobot {
    /// Unitree Go1 over UDP.
    Go1,
    /// Unitree Go2 over DDS.
    Go2,
}

impl RealRobot {
    /// Returns its name, which is also that of its model.
    pub const fn name(self) -> &'static str {
        match self {
            RealRobot::Go1 => "go1",
            RealRobot::Go2 => "go2",
        }
    }

    /// Reads the settings of its network from the files of a model.
    pub fn network(self, files: &RobotFiles, model: &str) -> Result<Network, Failure> {
        let network = Network::read(files).map_err(Failure::input)?;
        let section = match (self, network) {
            (RealRobot::Go1, Some(network @ Network::Go1(_))) | (RealRobot::Go2, Some(network @ Network::Go2(_))) => {
                return Ok(network);
            }
            (RealRobot::Go1, _) => "[network]",
            (RealRobot::Go2, _) => "[dds]",
        };
        let name = self.name();
        Err(Failure::input(format!(
            "--model {model}: its robot.toml has no section {section}, so it is no robot for --robot {name}; give the model of the robot that is driven"
        )))
    }
}

/// Way to a Go2.
#[derive(Debug, Clone, Args)]
pub struct DdsArguments {
    /// Network interface to a Go2, or its IPv4 address [default: the only one in the network of its robot.toml; lo for an
    /// emulated robot]
    #[arg(long, value_name = "NAME")]
    pub interface: Option<String>,
    /// DDS domain of a Go2 [default: from its robot.toml; 1 for an emulated robot]
    #[arg(long, value_name = "N", value_parser = whole_number(0_u16..=232))]
    pub domain: Option<u16>,
}

impl DdsArguments {
    /// Puts the arguments into the settings of a network; refused for one that is not DDS.
    pub fn apply(&self, network: &mut Network) -> Result<(), Failure> {
        match network {
            Network::Go2(settings) => {
                settings.domain = self.domain.unwrap_or(settings.domain);
                if let Some(name) = &self.interface {
                    settings.interface.clone_from(name);
                }
                Ok(())
            }
            Network::Go1(_) => self.refuse("only a Go2 has one"),
        }
    }

    /// Refuses the arguments, if there are any, for `reason`.
    pub fn refuse(&self, reason: &str) -> Result<(), Failure> {
        let given = match (&self.interface, self.domain) {
            (None, None) => return Ok(()),
            (Some(name), _) => format!("--interface {name}"),
            (None, Some(domain)) => format!("--domain {domain}"),
        };
        Err(Failure::input(format!("{given}: {reason}; add --robot go2")))
    }
}

/// Resolves `HOST:PORT`, the value of `option`. `example` is one of its values.
pub fn address(option: &str, text: &str, example: &str) -> Result<SocketAddr, Failure> {
    let refuse =
        |reason: String| Failure::input(format!("{option} {text}: {reason}; give HOST:PORT, for example {example}"));
    let mut found = text.to_socket_addrs().map_err(|error| refuse(error.to_string()))?;
    found.next().ok_or_else(|| refuse("no such host".to_owned()))
}

/// Longest name of an operator, a machine or a robot, characters.
const LONGEST_NAME: usize = 100;

/// Parses the name of an operator, a machine or a robot.
pub fn printable_name(text: &str) -> Result<String, String> {
    let length = text.chars().count();
    if text.trim().is_empty() || length > LONGEST_NAME || text.chars().any(is_unprintable) {
        return Err(format!("a name has 1 to {LONGEST_NAME} characters, none of them a control character"));
    }
    Ok(text.to_owned())
}

/// Returns the name of the operator: the given one, or else the user's. Reports once that there is none.
pub fn operator_or_user(given: Option<&String>) -> String {
    static REPORTED: Once = Once::new();
    let of_user = || ["USER", "LOGNAME"].iter().find_map(|name| printable_name(&std::env::var(name).ok()?).ok());
    // Neither variable is set in a container.
    let of_login = || printable_name(&User::from_uid(getuid()).ok()??.name).ok();
    given.cloned().or_else(of_user).or_else(of_login).unwrap_or_else(|| {
        REPORTED
            .call_once(|| notice!("the operator is unknown, as this user has no name; give one with --operator NAME"));
        unknown()
    })
}

fn unknown() -> String {
    "unknown".to_owned()
}

impl StudyArguments {
    /// Returns the origin of a session of this program, on this machine.
    pub fn provenance(&self) -> Provenance {
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
        Provenance {
            commit: env!("QUADFROG_COMMIT").to_owned(),
            host: host.and_then(|host| printable_name(host.trim()).ok()).unwrap_or_else(unknown),
            operator: operator_or_user(self.operator.as_ref()),
        }
    }

    /// Loads the robot: that of `--model`, else the one that the study in `resume` ran with last, else `default`. A study of an
    /// earlier version keeps none. For a kept robot that is not built in `--config` replaces values of the configuration that it ran
    /// with, because the robot's own is in that. Returns also the robot's `--model`.
    pub fn load_robot(
        &self,
        default: &str,
        resume: Option<&Path>,
    ) -> Result<(String, RobotFiles, RobotDescription), Failure> {
        let with_description = |files: RobotFiles| Ok((files.description()?, files));
        let load = |model: &str| load_model(model).map(|(files, robot)| (model.to_owned(), files, robot));
        let config = resume.and_then(last_config);
        let Some((folder, config)) = config.and_then(|config| Some((kept_robot(&config)?, config))) else {
            return load(self.model.as_deref().unwrap_or(default));
        };
        let place = folder.display().to_string();
        let kept = RobotFiles::from_folder(&folder).and_then(with_description);
        let Some(model) = &self.model else {
            let (robot, files) = kept.map_err(Failure::input)?;
            return match RobotFiles::embedded(&robot.name).and_then(with_description) {
                Ok((built_in, files)) if built_in.is_same_robot(&robot) => Ok((robot.name, files, built_in)),
                _ if self.config.is_some() => Ok((place, files.with_config(&config).map_err(Failure::input)?, robot)),
                _ => Ok((place, files, robot)),
            };
        };
        let given = load(model)?;
        match kept {
            Ok((kept, _)) if !kept.is_same_robot(&given.2) => Err(Failure::Input(format!(
                "--model {model}: the study ran with another robot, the {} in {place}; omit --model to continue with it, or begin a new study",
                kept.name
            ))),
            // One that cannot be read is known by its name, which is compared with the study.
            _ => Ok(given),
        }
    }

    /// Loads the configuration: that of `--config`, else the last one that the study in `resume` ran with, else as
    /// [`load_config_for`]. Returns also the notice that it is that of the study: for when the study was not refused.
    pub fn load_config(&self, robot: &RobotFiles, resume: Option<&Path>) -> Result<(Config, Option<String>), Failure> {
        let own = resume.and_then(last_config).filter(|_| self.config.is_none());
        if let Some(own) = &own {
            check_kept_config(own)?;
        }
        let mut config = load_config_for(robot, self.config.as_deref().or(own.as_deref()))?;
        if let Some(sampler) = self.sampler {
            config.choose_sampler(sampler);
        }
        let continued =
            own.map(|own| format!("continuing with the last configuration of the study, {}", own.display()));
        Ok((config, continued))
    }

    /// Returns the folder of a new study, before a number is appended: `<output>/<date>T<time>-<task>-seed<seed>`.
    pub fn new_folder(&self, task: Task, seed: u32) -> PathBuf {
        let now = jiff::Zoned::now().strftime("%Y-%m-%dT%H-%M-%S");
        self.output.join(format!("{now}-{}-seed{seed}", task.name()))
    }
}

/// Returns the configuration that the study in `folder` ran with last; none without a study there.
pub fn last_config(folder: &Path) -> Option<PathBuf> {
    newest_config(folder).filter(|_| folder.join(STUDY_FILE).is_file()).map(|(_, config)| config)
}

/// Seeds of the command line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seeds(pub Vec<u32>);

/// Returns the values without repetitions: a repeated one is no other run.
pub fn each_once<T: Copy + PartialEq>(values: &[T]) -> Vec<T> {
    let is_first = |&at: &usize| !values[..at].contains(&values[at]);
    (0..values.len()).filter(is_first).map(|at| values[at]).collect()
}

/// Parses seeds: 7, 0-4 or 0,3,7; each once.
pub fn parse_seeds(text: &str) -> Result<Seeds, String> {
    let number = |text: &str| {
        text.trim().parse::<u32>().map_err(|_| format!("`{text}` is not a whole number from 0 to 4294967295"))
    };
    let mut seeds = Vec::new();
    for part in text.split(',') {
        match part.split_once('-') {
            Some((first, last)) => {
                let (first, last) = (number(first)?, number(last)?);
                if last < first || last - first >= 10_000 {
                    return Err(format!("`{part}` is not a range of at most 10000 seeds; write it as 0-4"));
                }
                seeds.extend(first..=last);
            }
            None => seeds.push(number(part)?),
        }
    }
    let mut known = std::collections::BTreeSet::new();
    seeds.retain(|seed| known.insert(*seed));
    Ok(Seeds(seeds))
}
