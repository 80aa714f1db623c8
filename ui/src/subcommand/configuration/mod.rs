//! `quadfrog config`: the configuration in force, its differences, a check, a beginning, and its schema for editors.

mod page;
mod schema;

use std::path::{Path, PathBuf};

use crate::{output, put_line};
use anyhow::Context as _;
use clap::{Args, Subcommand};
use clap_complete::ArgValueCandidates;
use quadfrog::config::{Config, reference, write_new_files};
use quadfrog::trial::{Backend, Task};
use toml::{Table, Value};

use super::arguments::{load_config_for, load_model, user_folder};
use super::completion;
use super::console::settings;
use super::failure::{Failure, not_written};
use super::output_file::write_text;

#[derive(Debug, Args)]
pub struct ConfigCommand {
    #[command(subcommand)]
    command: ConfigSubcommand,
}

#[derive(Debug, Subcommand)]
enum ConfigSubcommand {
    /// Show every value in force and where it is from
    Show {
        /// Names of files or beginnings of keys, for example safety.toml or watchdog. [default: all]
        #[arg(value_name = "WHAT")]
        what: Vec<String>,
        /// Folder whose TOML files replace those of the configuration, whole or key by key [default: ~/.config/quadfrog if it
        /// exists]
        #[arg(long, value_name = "DIR")]
        config: Option<PathBuf>,
        /// Robot model whose own configuration lies under that of DIR: go1, a1, go2, or a folder with a URDF and a robot.toml
        #[arg(long, value_name = "MODEL", default_value = "go1", add = ArgValueCandidates::new(completion::robots))]
        model: String,
    },
    /// Show the values that differ: from the built-in configuration to that in force, or from one folder to another
    Diff {
        /// Folder of a configuration [default: the configuration in force]
        #[arg(value_name = "DIR")]
        folder: Option<PathBuf>,
        /// Folder with the new values, those of DIR being the old ones [default: DIR beside the built-in configuration]
        #[arg(value_name = "OTHER")]
        other: Option<PathBuf>,
        /// DIR, as for other commands
        #[arg(long, value_name = "DIR", conflicts_with = "folder")]
        config: Option<PathBuf>,
        /// Robot model whose own configuration lies under that of DIR: go1, a1, go2, or a folder with a URDF and a robot.toml
        #[arg(long, value_name = "MODEL", default_value = "go1", add = ArgValueCandidates::new(completion::robots))]
        model: String,
    },
    /// Check a configuration for all tasks: exit status 2 after the file, the key and the remedy of the first error
    Check {
        /// Folder of the configuration [default: the configuration in force]
        #[arg(value_name = "DIR")]
        folder: Option<PathBuf>,
        /// DIR, as for other commands
        #[arg(long, value_name = "DIR", conflicts_with = "folder")]
        config: Option<PathBuf>,
        /// Robot model: go1, a1, go2, or a folder with a URDF and a robot.toml
        #[arg(long, value_name = "MODEL", default_value = "go1", add = ArgValueCandidates::new(completion::robots))]
        model: String,
        /// Refuse a configuration that is for the simulator only
        #[arg(long)]
        hardware: bool,
    },
    /// Write the built-in files, with their comments, into a folder to be edited; no file is replaced
    Init {
        /// The folder [default: ~/.config/quadfrog]
        #[arg(value_name = "DIR")]
        folder: Option<PathBuf>,
    },
    /// Print the JSON schema of a file, for editors, or write those of all files into a folder
    Schema {
        /// File of the configuration, for example safety.toml
        #[arg(value_name = "FILE", required_unless_present = "output", value_parser = Config::FILE_NAMES)]
        file: Option<String>,
        /// Folder for safety.schema.json and so on
        #[arg(long, short, value_name = "DIR", conflicts_with = "file")]
        output: Option<PathBuf>,
    },
    /// Print the reference of all keys as Markdown: default, range, range on hardware, meaning
    Reference,
}

pub fn run(command: &ConfigCommand) -> Result<(), Failure> {
    match &command.command {
        ConfigSubcommand::Show { what, config, model } => show(what, config.as_deref(), model),
        ConfigSubcommand::Diff { folder, other, config, model } => {
            differences(folder.as_deref().or(config.as_deref()), other.as_deref(), model)
        }
        ConfigSubcommand::Check { folder, config, model, hardware } => {
            check(folder.as_deref().or(config.as_deref()), model, *hardware)
        }
        ConfigSubcommand::Init { folder } => init(folder.as_deref()),
        ConfigSubcommand::Schema { file, output } => write_schemas(file.as_deref(), output.as_deref()),
        ConfigSubcommand::Reference => {
            output::data(&page::reference_page());
            Ok(())
        }
    }
}

/// A value in force: file, key with its tables, value.
struct Setting {
    file: String,
    key: String,
    value: Value,
}

/// Returns all values of a configuration in the order of its files.
fn values(config: &Config) -> Result<Vec<Setting>, Failure> {
    let mut found = Vec::new();
    for (file, text) in &config.as_run {
        let table = text.parse::<Table>().with_context(|| format!("{file}: cannot be read again"))?;
        collect(file, "", &table, &mut found);
    }
    Ok(found)
}

fn collect(file: &str, tables: &str, table: &Table, found: &mut Vec<Setting>) {
    for (name, value) in table {
        let key = format!("{tables}{name}");
        match value {
            Value::Table(inner) => collect(file, &format!("{key}."), inner, found),
            value => found.push(Setting { file: file.to_owned(), key, value: value.clone() }),
        }
    }
}

fn show(what: &[String], folder: Option<&Path>, model: &str) -> Result<(), Failure> {
    let config = load_config_for(&load_model(model)?.0, folder)?;
    let all = values(&config)?;
    let names = |what: &str, setting: &Setting| what == setting.file || setting.key.starts_with(what);
    if let Some(what) = what.iter().find(|what| !all.iter().any(|setting| names(what, setting))) {
        let files = Config::FILE_NAMES.join(", ");
        return Err(Failure::input(format!(
            "{what}: no key of the configuration begins so; the files are {files}, and `quadfrog config show` shows all keys"
        )));
    }
    let is_shown = |setting: &&Setting| what.is_empty() || what.iter().any(|what| names(what, setting));
    for Setting { file, key, value } in all.iter().filter(is_shown) {
        let origin = config.origin(file, key).unwrap_or_else(|| "built-in".to_owned());
        put_line!("{file}  {key} = {value}  # {origin}");
    }
    Ok(())
}

fn differences(folder: Option<&Path>, other: Option<&Path>, model: &str) -> Result<(), Failure> {
    let given = load_config_for(&load_model(model)?.0, folder)?;
    let compared = Config::load(other)?;
    let (old, new) = if other.is_some() { (given, compared) } else { (compared, given) };
    let (new_values, old_values) = (values(&new)?, values(&old)?);
    let mut equal = true;
    for Setting { file, key, value } in &new_values {
        let before = old_values.iter().find(|setting| setting.file == *file && setting.key == *key);
        if before.is_none_or(|before| before.value != *value) {
            let before = before.map_or("not given".to_owned(), |before| before.value.to_string());
            put_line!("{file}  {key}: {before} -> {value}");
            equal = false;
        }
    }
    for Setting { file, key, value } in &old_values {
        if !new_values.iter().any(|setting| setting.file == *file && setting.key == *key) {
            put_line!("{file}  {key}: {value} -> not given");
            equal = false;
        }
    }
    if equal {
        put_line!("no value differs");
    }
    Ok(())
}

/// Checks a configuration as the commands do that use it: for every task on the simulator, and for hardware.
fn check(folder: Option<&Path>, model: &str, hardware: bool) -> Result<(), Failure> {
    let (files, robot) = load_model(model)?;
    let config = load_config_for(&files, folder)?;
    settings(&config)?;
    for task in Task::ALL {
        config.settings(&robot, task, Backend::Simulator)?;
    }
    put_line!("simulator: all values are valid for {}", robot.name);
    match Task::ALL.into_iter().find_map(|task| config.settings(&robot, task, Backend::Hardware).err()) {
        None => put_line!("hardware: all limits are inside their ranges"),
        Some(refusal) if hardware => return Err(refusal.into()),
        Some(refusal) => put_line!("hardware: refused: {refusal}"),
    }
    Ok(())
}

fn init(folder: Option<&Path>) -> Result<(), Failure> {
    let remedy = || Failure::input("HOME and XDG_CONFIG_HOME are not set to absolute paths; give a folder");
    let folder = folder.map(Path::to_owned).or_else(user_folder).ok_or_else(remedy)?;
    let files = reference();
    let files: Vec<_> = files.iter().map(|file| (file.name, file.text)).collect();
    for path in write_new_files(&folder, &files)? {
        put_line!("{}", path.display());
    }
    put_line!("Keys that are left out have their built-in values: a file may be cut to the keys that differ.");
    Ok(())
}

fn write_schemas(file: Option<&str>, folder: Option<&Path>) -> Result<(), Failure> {
    for reference in reference() {
        if file.is_some_and(|file| file != reference.name) {
            continue;
        }
        let text = format!("{:#}\n", schema::schema(&reference));
        let Some(folder) = folder else {
            output::data(&text);
            continue;
        };
        let path = folder.join(reference.name).with_extension("schema.json");
        std::fs::create_dir_all(folder).map_err(|error| not_written(folder, &error))?;
        write_text(&path, &text)?;
        put_line!("{}", path.display());
    }
    Ok(())
}
