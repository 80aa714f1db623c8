//! The command line: output and exit status of complete runs of the program.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;

fn quadfrog(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.current_dir(folder).stdin(Stdio::null()).env("NO_COLOR", "1");
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    quadfrog(folder).args(arguments).output().unwrap()
}

/// The message of a run that must end with status 2.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    message
}

/// The study folders below `recordings/`.
fn studies(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder.join("recordings"))
        .map(|entries| entries.map(|entry| entry.unwrap().path()).collect())
        .unwrap_or_default()
}

fn lines(output: &[u8]) -> Vec<Value> {
    String::from_utf8_lossy(output).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn optimize_prints_one_json_object_per_trial_in_the_promised_form() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(folder.path(), &["optimize", "--task", "twist-cw", "--trials", "3", "--seed", "1", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let trials = lines(&output.stdout);
    assert_eq!(trials.len(), 3);
    for (number, trial) in trials.iter().enumerate() {
        assert_eq!(trial["trial"], number);
        for name in ["f0", "Fy", "Fz"] {
            assert!(trial["params"][name].is_f64(), "{trial}");
        }
        for name in ["dx_m", "dy_m", "dyaw_rad", "apex_m", "air_s"] {
            assert!(trial["measured"][name].is_f64(), "{trial}");
        }
        let verdict = trial["verdict"].as_str().unwrap();
        let measured = -trial["measured"]["dyaw_rad"].as_f64().unwrap();
        let expected = if verdict == "fall" { 0.0 } else { measured };
        assert_eq!(trial["value"].as_f64().unwrap(), expected, "{trial}");
    }
    let [study] = studies(folder.path()).try_into().expect("one study");
    assert!(study.join("study.log").is_file() && study.join("session.mcap").is_file());
    assert!(study.join("config/control.toml").is_file());
}

#[test]
fn without_a_terminal_optimize_prints_plain_lines_a_table_and_the_best() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(folder.path(), &["optimize", "--trials", "3", "--record", "none"]);
    assert_eq!(output.status.code(), Some(0));
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.lines().next().unwrap().starts_with("trial   0"), "{text}");
    assert!(text.contains("f0 (Hz)") && text.contains("Best: trial"), "{text}");
    assert!(!text.contains('\u{1b}'), "escape sequences without a terminal: {text:?}");
    let [study] = studies(folder.path()).try_into().expect("one study");
    assert!(!study.join("session.mcap").exists());
}

#[test]
fn the_same_seed_prints_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let sorted = |jobs: &str| {
        let arguments =
            ["optimize", "--task", "forward,lateral-left", "--seed", "0-1", "--trials", "3", "--json", "--jobs", jobs];
        let output = run(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(0));
        let mut lines: Vec<String> = String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect();
        lines.sort();
        lines
    };
    let one = sorted("1");
    assert_eq!(one.len(), 12);
    assert_eq!(one, sorted("2"));
}

/// Killed with SIGKILL, then continued: no judged trial is lost, and the trials are those of an uninterrupted run.
#[test]
fn a_killed_study_continues_as_if_it_had_not_been_interrupted() {
    let folder = tempfile::tempdir().unwrap();
    const TRIALS: &str = "16";
    let whole = run(folder.path(), &["optimize", "--trials", TRIALS, "--seed", "5", "--json", "--output", "whole"]);
    assert_eq!(whole.status.code(), Some(0));
    let whole = lines(&whole.stdout);

    let mut printed = Vec::new();
    let mut resumed = None;
    // Killed after trials 3 and 12: while the sampler draws at random, and while it uses its model.
    for after in [3, 12] {
        let mut command = quadfrog(folder.path());
        command.args(["optimize", "--trials", TRIALS, "--json"]);
        match &resumed {
            None => command.args(["--seed", "5", "--output", "broken"]),
            Some(study) => command.arg("--resume").arg(study),
        };
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        for line in BufReader::new(child.stdout.take().unwrap()).lines() {
            printed.push(serde_json::from_str::<Value>(&line.unwrap()).unwrap());
            if printed.len() >= after {
                break;
            }
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let [study] = fs::read_dir(folder.path().join("broken"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect::<Vec<_>>()
            .try_into()
            .expect("one study");
        resumed = Some(study);
    }
    let study = resumed.unwrap();
    let rest = run(folder.path(), &["optimize", "--trials", TRIALS, "--json", "--resume", study.to_str().unwrap()]);
    assert_eq!(rest.status.code(), Some(0), "{}", String::from_utf8_lossy(&rest.stderr));

    // Counted trials in order: a trial killed before its verdict was repeated under another number.
    let counted = |trials: &[Value]| -> Vec<(Value, Value, Value)> {
        trials.iter().map(|t| (t["params"].clone(), t["value"].clone(), t["verdict"].clone())).collect()
    };
    let table: BTreeMap<u64, Value> = journal_trials(&study.join("study.log"));
    let ours: Vec<(Value, Value)> = table.values().map(|t| (t["params"].clone(), t["value"].clone())).collect();
    let theirs: Vec<(Value, Value)> = counted(&whole).into_iter().map(|(p, v, _)| (p, v)).collect();
    assert_eq!(ours, theirs);
    for trial in &printed {
        let kept = &table[&trial["trial"].as_u64().unwrap()];
        assert_eq!((&kept["params"], &kept["value"]), (&trial["params"], &trial["value"]), "a judged trial changed");
    }
}

/// The complete trials of a journal by number, parsed without the project's reader.
fn journal_trials(path: &Path) -> BTreeMap<u64, Value> {
    let mut trials: BTreeMap<u64, Value> = BTreeMap::new();
    let mut created = 0;
    for line in fs::read_to_string(path).unwrap().lines() {
        let operation: Value = serde_json::from_str(line).unwrap();
        let id = operation["trial_id"].as_u64();
        match operation["op_code"].as_u64().unwrap() {
            4 => {
                trials.insert(created, serde_json::json!({"params": {}, "value": null}));
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

#[test]
fn bad_input_is_refused_with_file_key_and_value_and_no_study_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("mine");
    fs::create_dir(&config).unwrap();
    let write = |name: &str, text: &str| fs::write(config.join(name), text).unwrap();

    write("control.toml", "[tasks.forward]\nkpp = 3.0\n");
    let message = refused(folder.path(), &["optimize", "--config", "mine"]);
    assert!(
        message.contains("mine/control.toml:2") && message.contains("kpp") && message.contains("kp`?"),
        "{message}"
    );
    fs::remove_file(config.join("control.toml")).unwrap();

    write("optimize.toml", "[bounds]\nFz = [150.0, 900.0]\n");
    let message = refused(folder.path(), &["optimize", "--config", "mine"]);
    assert!(
        message.contains("mine/optimize.toml:2") && message.contains("900") && message.contains("400"),
        "{message}"
    );
    fs::remove_file(config.join("optimize.toml")).unwrap();

    write("simulator.toml", "[terrain]\nfriction = -1.0\n");
    let message = refused(folder.path(), &["optimize", "--config", "mine"]);
    assert!(message.contains("simulator.toml") && message.contains("friction") && message.contains("-1"), "{message}");

    let message = refused(folder.path(), &["optimize", "--config", "elsewhere"]);
    assert!(message.contains("elsewhere"), "{message}");
    // Regression: options before the subcommand were silently ignored.
    let message = refused(folder.path(), &["--config", "mine", "optimize"]);
    assert!(message.contains("--config") && message.contains("optimize"), "{message}");
    let message = refused(folder.path(), &["optimize", "--model", "spot"]);
    assert!(message.contains("spot") && message.contains("go1"), "{message}");
    let message = refused(folder.path(), &["optimize", "--task", "backward"]);
    assert!(message.contains("backward") && message.contains("forward"), "{message}");
    let message = refused(folder.path(), &["optimize", "--seed", "minus"]);
    assert!(message.contains("minus"), "{message}");
    let message = refused(folder.path(), &["optimize", "--resume", "mine"]);
    assert!(message.contains("mine") && message.contains("study.log"), "{message}");
    assert!(studies(folder.path()).is_empty(), "something was made: {:?}", studies(folder.path()));
}

#[test]
fn a_urdf_without_a_foot_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("cripple");
    fs::create_dir(&model).unwrap();
    let ours = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/go1");
    fs::copy(ours.join("robot.toml"), model.join("robot.toml")).unwrap();
    let urdf = fs::read_to_string(ours.join("go1.urdf")).unwrap();
    // Removes link and joint of one foot.
    let cut = |text: &str, start: &str, end: &str| match text.find(start) {
        Some(from) => {
            let to = text[from..].find(end).unwrap() + from + end.len();
            format!("{}{}", &text[..from], &text[to..])
        }
        None => panic!("{start} is not in the URDF"),
    };
    let link = urdf.lines().find(|line| line.contains("<link") && line.contains("FL_foot")).unwrap().trim().to_owned();
    let joint =
        urdf.lines().find(|line| line.contains("<joint") && line.contains("FL_foot")).unwrap().trim().to_owned();
    let text = cut(&cut(&urdf, &link, "</link>"), &joint, "</joint>");
    fs::write(model.join("go1.urdf"), text).unwrap();
    let message = refused(folder.path(), &["optimize", "--model", "cripple"]);
    assert!(message.contains("cripple/go1.urdf") && message.contains("foot"), "{message}");
}

#[test]
fn a_file_that_is_no_recording_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("noise.mcap"), b"this is no recording").unwrap();
    let message = refused(folder.path(), &["replay", "noise.mcap"]);
    assert!(message.contains("noise.mcap"), "{message}");
    let message = refused(folder.path(), &["replay", "nothing.mcap"]);
    assert!(message.contains("nothing.mcap"), "{message}");
    fs::write(folder.path().join("empty.mcap"), b"").unwrap();
    let message = refused(folder.path(), &["replay", "empty.mcap"]);
    assert!(message.contains("empty.mcap"), "{message}");
}

#[test]
fn an_incomplete_recording_is_reported_and_can_be_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(folder.path(), &["optimize", "--trials", "1", "--record", "all"]);
    assert_eq!(output.status.code(), Some(0));
    let [study] = studies(folder.path()).try_into().expect("one study");
    let bytes = fs::read(study.join("session.mcap")).unwrap();
    let cut = folder.path().join("cut.mcap");
    fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let message = refused(folder.path(), &["replay", "cut.mcap"]);
    assert!(message.contains("cut.mcap") && message.contains("quadfrog recover cut.mcap"), "{message}");
    let output = run(folder.path(), &["recover", "cut.mcap"]);
    let printed = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{printed}");
    assert!(printed.contains("cut.recovered.mcap") && printed.contains("ticks"), "{printed}");
    assert!(cut.is_file(), "the damaged file is kept");
}

/// Regression: of several failed studies only the first was reported.
#[test]
fn every_failed_study_is_reported_and_a_disk_error_is_not_unusable_input() {
    let folder = tempfile::tempdir().unwrap();
    // A file in place of the parent folder.
    fs::write(folder.path().join("taken"), "").unwrap();
    let output = run(folder.path(), &["optimize", "--seed", "0-1", "--trials", "1", "--output", "taken"]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("seed0") && message.contains("seed1"), "{message}");
}

#[test]
fn several_studies_are_summarized_and_the_sampler_can_be_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let arguments =
        ["optimize", "--seed", "0-1", "--trials", "2", "--record", "none", "--sampler", "sobol", "--output", "mine"];
    let output = run(folder.path(), &arguments);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.trim_end().lines().last().unwrap().starts_with("forward: 2 studies, mean best"), "{text}");
    let study = fs::read_dir(folder.path().join("mine")).unwrap().next().unwrap().unwrap().path();
    let kept = fs::read_to_string(study.join("config/optimize.toml")).unwrap();
    assert!(kept.contains("kind = \"sobol\""), "{kept}");
}

/// It also belongs to one session at a time.
#[test]
fn a_continued_study_keeps_its_configuration_and_robot() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("mine");
    fs::create_dir(&config).unwrap();
    fs::write(config.join("optimize.toml"), "trials = 3\n[bounds]\nFz = [200.0, 300.0]\n").unwrap();
    let output = run(folder.path(), &["optimize", "--config", "mine", "--json", "--record", "none"]);
    assert_eq!(lines(&output.stdout).len(), 3);
    let [study] = studies(folder.path()).try_into().expect("one study");
    let study = study.to_str().unwrap();
    let message = refused(folder.path(), &["optimize", "--resume", study, "--model", "a1"]);
    assert!(message.contains("--model a1") && message.contains("go1"), "{message}");
    let output = run(folder.path(), &["optimize", "--resume", study, "--trials", "5", "--json", "--record", "none"]);
    let rest = lines(&output.stdout);
    assert_eq!(rest.len(), 2);
    assert!(rest.iter().all(|trial| (200.0..=300.0).contains(&trial["params"]["Fz"].as_f64().unwrap())));
    let held = fs::File::open(Path::new(study).join("session.lock")).unwrap();
    held.lock().unwrap();
    let message = refused(folder.path(), &["optimize", "--resume", study, "--trials", "6"]);
    assert!(message.contains("another session"), "{message}");
}

#[test]
fn the_doctor_reports_each_item_and_a_remedy_for_each_warning() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(folder.path(), &["doctor"]);
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{printed}");
    for item in [
        "kernel",
        "real-time priority",
        "locked memory",
        "cores",
        "timer",
        "control thread",
        "wake-up latency",
        "connection",
        "disk",
    ] {
        let line = printed.lines().find(|line| line.get(6..).is_some_and(|rest| rest.starts_with(item)));
        let line = line.unwrap_or_else(|| panic!("no line on {item}: {printed}"));
        assert!(line.starts_with("ok ") || line.starts_with("warn "), "{line}");
    }
    let warnings = printed.lines().filter(|line| line.starts_with("warn ")).count();
    assert_eq!(printed.lines().filter(|line| line.trim_start().starts_with("-> ")).count(), warnings, "{printed}");
}

#[test]
fn without_a_terminal_the_console_names_the_alternatives() {
    let folder = tempfile::tempdir().unwrap();
    let message = refused(folder.path(), &[]);
    assert!(message.contains("terminal") && message.contains("optimize"), "{message}");
    assert!(studies(folder.path()).is_empty());
}
