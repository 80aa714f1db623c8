//! Complete runs of the program in a temporary folder.

use std::collections::BTreeMap;
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use nix::sys::signal::Signal;
use serde_json::Value;

/// The folder in which the program runs.
pub struct Program(tempfile::TempDir);

impl Program {
    pub fn new() -> Program {
        Program(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file below the folder.
    pub fn write(&self, name: &str, text: &str) {
        fs::create_dir_all(self.path(name).parent().unwrap()).unwrap();
        fs::write(self.path(name), text).unwrap();
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
        command.args(arguments).current_dir(&self.0).stdin(Stdio::null()).env("NO_COLOR", "1");
        // Not the configuration of the user who runs the tests.
        command.env("XDG_CONFIG_HOME", self.path("no-configuration"));
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// The output of a run that must succeed.
    #[track_caller]
    pub fn text(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// The JSON lines of a run that must succeed.
    #[track_caller]
    pub fn trials(&self, arguments: &[&str]) -> Vec<Value> {
        self.text(arguments).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// The exported trials of a study: `number`, `state`, `value`, `params`, `user_attrs`.
    #[track_caller]
    pub fn exported(&self, study: &str) -> Vec<Value> {
        let rows: Vec<serde_json::Map<String, Value>> =
            serde_json::from_str(&self.text(&["study", "export", study, "--format", "json"])).unwrap();
        let nested = |row: &serde_json::Map<String, Value>, prefix: &str| -> Value {
            let cells =
                row.iter().filter_map(|(name, cell)| Some((name.strip_prefix(prefix)?.to_owned(), cell.clone())));
            cells.collect::<serde_json::Map<_, _>>().into()
        };
        let trial = |row: &serde_json::Map<String, Value>| {
            let value = row.iter().find(|(name, _)| name.starts_with("value")).map(|(_, value)| value);
            serde_json::json!({
                "number": row["number"], "state": row["state"], "value": value,
                "params": nested(row, "params_"), "user_attrs": nested(row, "user_attrs_"),
            })
        };
        rows.iter().map(trial).collect()
    }

    /// The message of a run that must end with status 2.
    #[track_caller]
    pub fn refused(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        message
    }

    /// The study folders below a folder, by name.
    pub fn studies(&self, below: &str) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.path(below)).into_iter().flatten();
        let mut studies: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        studies.sort();
        studies
    }

    /// The only study below a folder.
    #[track_caller]
    pub fn study(&self, below: &str) -> PathBuf {
        let [study] = self.studies(below).try_into().expect("one study");
        study
    }
}

/// The signals that end a command, but those that this process, and so every program of its own, ignores: a shell lets the programs
/// in its background ignore SIGINT.
pub fn ending_signals() -> Vec<Signal> {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    let ignored = u64::from_str_radix(ignored.trim(), 16).unwrap();
    let ending = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP].into_iter();
    ending.filter(|signal| ignored & (1 << (*signal as i32 - 1)) == 0).collect()
}

/// Holds the lock of a study, as a running session does.
pub fn hold(study: &Path) -> fs::File {
    let held = fs::File::open(study.join("session.lock")).unwrap();
    held.lock().unwrap();
    held
}

#[track_caller]
pub fn assert_shows(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no {part}:\n{text}");
    }
}

/// The complete trials of a journal by number, parsed without the project's reader.
pub fn journal_trials(path: &Path) -> BTreeMap<u64, Value> {
    let mut trials: BTreeMap<u64, Value> = BTreeMap::new();
    let mut created = 0;
    let text = fs::read_to_string(path).unwrap();
    // A line without its end is still being written, or was torn by a kill.
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    for line in whole.lines() {
        let operation: Value = serde_json::from_str(line).unwrap();
        let id = operation["trial_id"].as_u64();
        match operation["op_code"].as_u64().unwrap() {
            4 => {
                // A trial of this program begins with its parameters; one of the queue has none yet.
                let params = operation.get("params").cloned().unwrap_or_else(|| serde_json::json!({}));
                trials.insert(created, serde_json::json!({"params": params, "value": null}));
                created += 1;
            }
            5 => {
                let name = operation["param_name"].as_str().unwrap();
                trials.get_mut(&id.unwrap()).unwrap()["params"][name] = operation["param_value_internal"].clone();
            }
            6 if operation["state"] == 1 => {
                trials.get_mut(&id.unwrap()).unwrap()["value"] = operation["values"][0].clone();
            }
            _ => {}
        }
    }
    trials.retain(|_, trial| !trial["value"].is_null());
    trials
}

/// Parameters and values of the complete trials of a journal in their order.
pub fn counted_trials(path: &Path) -> Vec<(Value, Value)> {
    journal_trials(path).into_values().map(|trial| (trial["params"].clone(), trial["value"].clone())).collect()
}

/// Runs the command with files of at most `blocks` of 512 bytes, as on a disk that is full beyond.
pub fn with_small_files(program: &Program, blocks: u32, arguments: &[&str]) -> (Option<i32>, String) {
    // With SIGXFSZ ignored a write beyond the limit fails.
    let shell = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &shell, env!("CARGO_BIN_EXE_quadfrog")]).args(arguments).current_dir(program.path(""));
    let output = command.output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Runs the command so that the system gives it no further thread.
pub fn without_threads(program: &Program, arguments: &[&str]) -> Output {
    let mut command = Command::new("bash");
    command.args(["-c", "ulimit -u 1; exec \"$0\" \"$@\""]).arg(copy_for_all(program)).args(arguments);
    as_bound_user(program, &mut command).output().unwrap()
}

/// Runs the command as a user for whom the permissions of files hold.
pub fn with_permissions(program: &Program, arguments: &[&str]) -> Output {
    as_bound_user(program, Command::new(copy_for_all(program)).args(arguments)).output().unwrap()
}

/// A copy of the program that every user may run.
fn copy_for_all(program: &Program) -> PathBuf {
    let copy = program.path("quadfrog");
    if !copy.exists() {
        fs::copy(env!("CARGO_BIN_EXE_quadfrog"), &copy).unwrap();
    }
    copy
}

/// A command in the program's folder of a user whom limits and permissions bind: they do not bind the user root.
fn as_bound_user<'a>(program: &Program, command: &'a mut Command) -> &'a mut Command {
    command.current_dir(program.path("")).env("XDG_CONFIG_HOME", program.path("no-configuration"));
    if nix::unistd::Uid::effective().is_root() {
        command.uid(54_322);
        fs::set_permissions(program.path(""), Permissions::from_mode(0o777)).unwrap();
    }
    command.stdin(Stdio::null())
}
