//! Ranges of every number of the shipped files: what is accepted runs, what no robot may be limited by is refused on
//! hardware with file, key, value, range and remedy.

#[path = "support/cores.rs"]
mod cores;

use std::fs;
use std::path::Path;

use cores::on_all_cores;
use quadfrog::config::{Config, ConfigError, NumberRange, range_of, reference};
use quadfrog::engine::{self, EngineError, Options, open_experiment};
use quadfrog::optimize::journal::Durability;
use quadfrog::robot::description::{RobotDescription, RobotFiles};
use quadfrog::robot::hardware::Network;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::{Tick, TrialEnd};
use quadfrog::trial::{Backend, JumpParameters, Task, Verdict};
use toml::{Table, Value};

/// Replacement of a number.
fn mutations() -> [Value; 9] {
    [
        Value::Integer(0),
        Value::Integer(-1),
        Value::Float(1e-300),
        Value::Float(1e300),
        Value::Float(f64::NAN),
        Value::Float(f64::INFINITY),
        Value::Integer(i64::MAX),
        Value::String("text".to_owned()),
        Value::Array(vec![Value::Float(1.0)]),
    ]
}

/// Places of the numbers of a value: names of tables and keys, indices in lists.
fn places(value: &Value, place: &str) -> Vec<String> {
    match value {
        Value::Integer(_) | Value::Float(_) => vec![place.to_owned()],
        Value::Table(table) => {
            table.iter().flat_map(|(name, inner)| places(inner, &format!("{place}/{name}"))).collect()
        }
        Value::Array(list) => {
            list.iter().enumerate().flat_map(|(i, inner)| places(inner, &format!("{place}/{i}"))).collect()
        }
        _ => Vec::new(),
    }
}

/// Every text in which one number of `text` is replaced, with its description.
fn mutants(text: &str) -> Vec<(String, String)> {
    let table: Table = text.parse().unwrap();
    let mut mutants = Vec::new();
    for place in places(&Value::Table(table.clone()), "") {
        for mutation in mutations() {
            let mut whole = Value::Table(table.clone());
            let steps = place.split('/').skip(1);
            let number = steps.fold(&mut whole, |value, step| match value {
                Value::Array(list) => &mut list[step.parse::<usize>().unwrap()],
                other => &mut other[step],
            });
            *number = mutation.clone();
            // A whole value would be printed as an inline table.
            mutants.push((format!("{place} = {mutation}"), whole.as_table().unwrap().to_string()));
        }
    }
    assert!(mutants.len() >= 9);
    mutants
}

fn load(file: &str, text: &str) -> Result<Config, ConfigError> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(file), text).unwrap();
    Config::load(Some(folder.path()))
}

fn go1() -> RobotDescription {
    RobotDescription::embedded("go1").unwrap()
}

const JUMP: JumpParameters = JumpParameters { f0_hz: 1.3, f1_hz: 1.0, fx_n: 60.0, fy_n: 0.0, fz_n: 270.0 };

/// Runs a trial of a robot; nothing where the configuration refuses it.
fn trial(config: &Config, robot: &RobotDescription) -> Option<(TrialEnd, Vec<Tick>)> {
    for task in Task::ALL {
        let _ = config.settings(robot, task, Backend::Hardware);
    }
    let settings = config.settings(robot, Task::Forward, Backend::Simulator).ok()?;
    let simulator = Simulator::new(robot, &config.simulator).ok()?;
    let spec = config.task(Task::Forward).trial(Task::Forward, JUMP);
    let mut rollout = Rollout::new(simulator, &settings);
    let (end, ticks) = rollout.run(&spec);
    Some((end, ticks.to_vec()))
}

/// Loads every mutant of a file and tries those that are accepted; at least the text and the list are not.
fn every_mutant(file: &str, text: &str, accepted: impl Fn(&Config) + Sync) {
    accepted(&load(file, text).unwrap());
    let is_accepted = on_all_cores(&mutants(text), |(mutation, text)| match load(file, text) {
        Err(error) => {
            assert!(error.to_string().contains(file), "{mutation}: {error}");
            false
        }
        Ok(config) => {
            println!("{file}: {mutation} is accepted");
            accepted(&config);
            true
        }
    });
    let tried = is_accepted.iter().filter(|is_accepted| **is_accepted).count();
    let refused = is_accepted.len() - tried;
    println!("{file}: {tried} tried, {refused} refused");
    assert!(tried > 0 && refused > tried, "{tried} tried, {refused} refused");
}

#[test]
fn every_accepted_number_of_control_toml_runs_a_trial() {
    let text = include_str!("../config/control.toml");
    every_mutant("control.toml", text, |config| drop(trial(config, &go1())));
}

#[test]
fn every_accepted_number_of_safety_toml_runs_a_trial() {
    every_mutant("safety.toml", include_str!("../config/safety.toml"), |config| drop(trial(config, &go1())));
}

/// Each terrain, with noise, delays and the model of the motors.
#[test]
fn every_accepted_number_of_simulator_toml_runs_a_trial() {
    for terrain in ["slope", "steps", "blocks"] {
        let text = include_str!("../config/simulator.toml")
            .replace("kind = \"flat\"", &format!("kind = \"{terrain}\""))
            .replace("loose = false", "loose = true")
            .replace("kind = \"ideal\"", "kind = \"hardware-like\"")
            .replace("enabled = false", "enabled = true");
        let section = format!("[terrain.{terrain}]");
        assert!(text.contains(&section));
        every_mutant("simulator.toml", &text, |config| drop(trial(config, &go1())));
    }
}

/// (Defects once: `candidates = 0` and `abandoned_s = 1e20` panicked, `candidates = 1e12` aborted, at the first modelled
/// trial.) Twelve trials: after ten the model proposes.
#[test]
fn every_accepted_number_of_optimize_toml_runs_a_study() {
    let (end, ticks) = trial(&Config::load(None).unwrap(), &go1()).unwrap();
    let text = include_str!("../config/optimize.toml")
        .replace("# startup_trials", "startup_trials")
        .replace("# [first.forward]", "[first.forward]\nFz = 270.0")
        .replace("# f0 = 1.3", "f0 = 1.3")
        .replace("# Fx = 120.0", "Fx = 120.0");
    every_mutant("optimize.toml", &text, |config| {
        let options =
            Options { trials: Some(13), ..Options::new(config.clone(), go1(), Backend::Simulator, Task::Forward) };
        let mut experiment = open_experiment(&options, Durability::Buffered, "").unwrap();
        for _ in 0..12 {
            let proposal = experiment.proposal().unwrap();
            experiment.approve(proposal.trial, proposal.revision).unwrap();
            experiment.ended(proposal.trial, &end, &ticks, ticks.len() as u64);
            experiment.judge(Verdict::Accept, false).unwrap();
        }
        assert!(experiment.proposal().is_some());
    });
}

#[test]
fn every_accepted_number_of_robot_toml_runs_a_trial() {
    let config = Config::load(None).unwrap();
    for (name, urdf, toml) in [
        ("go1", include_str!("../robots/go1/go1.urdf"), include_str!("../robots/go1/robot.toml")),
        ("go2", include_str!("../robots/go2/go2.urdf"), include_str!("../robots/go2/robot.toml")),
    ] {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(format!("{name}.urdf")), urdf).unwrap();
        let (mut tried, mut refused) = (0, 0);
        for (mutation, text) in mutants(toml) {
            fs::write(folder.path().join("robot.toml"), &text).unwrap();
            let files = RobotFiles::from_folder(folder.path()).unwrap();
            match files.description().and_then(|robot| Ok((robot, Network::read(&files)?))) {
                Err(error) => {
                    refused += 1;
                    assert!(error.to_string().contains("robot.toml"), "{name}, {mutation}: {error}");
                }
                Ok((robot, _)) => {
                    println!("{name}: {mutation} is accepted");
                    tried += 1;
                    drop(trial(&config, &robot));
                }
            }
        }
        assert!(tried > 0 && refused > tried, "{name}: {tried} tried, {refused} refused");
    }
}

/// (Defects once: all of these were accepted with a robot, and the arming checks passed.)
#[test]
fn limits_that_protect_nothing_are_refused_on_hardware_with_range_and_remedy() {
    let mutants: [(&str, &str, &[&str]); 22] = [
        (
            "safety.toml",
            "[watchdog]\nstate_age_ms = 400\nlink_lost_ms = 900",
            &["`watchdog.state_age_ms` = 400", "5 to 100 ms", "20"],
        ),
        ("safety.toml", "[watchdog]\ntorque_factor = 99", &["watchdog.torque_factor", "1 to 1.5"]),
        ("safety.toml", "[watchdog]\nvelocity_factor = 99", &["watchdog.velocity_factor", "1 to 3"]),
        ("safety.toml", "[watchdog]\nmotor_c = 120", &["watchdog.motor_c", "30 to 90 degrees"]),
        ("safety.toml", "[watchdog]\nhardware_late_ms = 0", &["watchdog.hardware_late_ms", "1 to 100 ms"]),
        ("safety.toml", "[watchdog]\noperator_silent_ms = 60000", &["watchdog.operator_silent_ms", "200 to 2000"]),
        ("safety.toml", "[watchdog]\nhardware_idle_s = 0", &["watchdog.hardware_idle_s", "5 to 600"]),
        ("safety.toml", "[watchdog]\nstance_tilt_rad = 0.9", &["watchdog.stance_tilt_rad", "0.1 to 0.6"]),
        ("safety.toml", "[fall]\nroll_rad = 1.3\n[watchdog]\ntilt_rad = 3.1", &["fall.roll_rad", "0.3 to 1.2"]),
        ("safety.toml", "[gate]\nkp_max = 1000", &["gate.kp_max", "20 to 200"]),
        ("safety.toml", "[gate]\ntorque_step_nm = 1000", &["gate.torque_step_nm", "5 to 40"]),
        ("safety.toml", "[pre_arm]\nbattery_percent = 0", &["pre_arm.battery_percent", "10 to 100"]),
        ("safety.toml", "[pre_arm]\nlate_share = 1", &["pre_arm.late_share", "0 to 0.1"]),
        ("safety.toml", "[pre_arm]\nmotor_measured_c = -20", &["pre_arm.motor_measured_c", "0 to 10"]),
        ("safety.toml", "[consistency]\nloss_share = 0.5", &["consistency.loss_share", "0.005 to 0.2"]),
        ("safety.toml", "[hop_envelope]\nstart = 1.0", &["hop_envelope.start", "0.1 to 0.6"]),
        ("safety.toml", "[hop_envelope]\nstep = 1.0", &["hop_envelope.step", "0.01 to 0.2"]),
        ("safety.toml", "[parameters]\nFz = [0, 5000]", &["`parameters.Fz` = 5000", "0 to 500 N", "400"]),
        ("safety.toml", "[gains]\nkp = [300, 5000]", &["`gains.kp` = 5000", "100 to 1200"]),
        ("control.toml", "[countdown]\nhardware_s = 0.001", &["`countdown.hardware_s` = 0.001", "1 to 60 s", "3"]),
        ("control.toml", "[stand_up]\nduration_s = 0.1", &["stand_up.duration_s", "0.5 to 10 s"]),
        ("control.toml", "[sit_down]\nkp = 900", &["sit_down.kp", "20 to 150"]),
    ];
    for (file, text, words) in mutants {
        let config = load(file, text).unwrap_or_else(|error| panic!("the simulator may: {error}"));
        assert!(config.settings(&go1(), Task::Forward, Backend::Simulator).is_ok(), "{text}");
        let error = engine::start(Options::new(config, go1(), Backend::Hardware, Task::Forward)).err();
        let Some(EngineError::Config(error)) = error else { panic!("{text}: {error:?}") };
        let error = error.to_string();
        for word in [file, "on hardware", "default"].iter().chain(words) {
            assert!(error.contains(word), "{word} is not in: {error}");
        }
    }
}

/// Regression: 0.03 for 3.0 was the word 0 on the wire, and STOP and guard left the robot limp.
#[test]
fn damping_that_is_nothing_on_the_wire_is_refused_on_every_backend() {
    for kd in ["0.03", "0.9", "0", "nan"] {
        let error = load("safety.toml", &format!("[gate]\ndamping_kd = {kd}")).unwrap_err().to_string();
        assert!(error.contains("safety.toml:2") && error.contains("1 to 50"), "{error}");
    }
}

/// A robot whose motors are stronger than the Go1's is no Go1.
#[test]
fn motors_without_a_limit_are_refused_on_hardware() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = include_str!("../robots/go1/go1.urdf").replacen("effort=\"23.7\"", "effort=\"237\"", 1);
    write_robot(folder.path(), &urdf);
    let robot = RobotDescription::from_folder(folder.path()).unwrap();
    let config = Config::load(None).unwrap();
    assert!(config.settings(&robot, Task::Forward, Backend::Simulator).is_ok());
    let error = config.settings(&robot, Task::Forward, Backend::Hardware).unwrap_err().to_string();
    assert!(error.contains("FR_hip limit effort") && error.contains("237") && error.contains("1 to 40 N m"), "{error}");
}

fn write_robot(folder: &Path, urdf: &str) {
    fs::write(folder.join("go1.urdf"), urdf).unwrap();
    fs::write(folder.join("robot.toml"), include_str!("../robots/go1/robot.toml")).unwrap();
}

/// The numbers of a value by their key with its tables; those of a list have the key of the list.
fn numbers(value: &Value, key: &str) -> Vec<(String, f64)> {
    match value {
        Value::Integer(number) => vec![(key.to_owned(), *number as f64)],
        Value::Float(number) => vec![(key.to_owned(), *number)],
        Value::Table(table) => {
            let dot = if key.is_empty() { "" } else { "." };
            table.iter().flat_map(|(name, inner)| numbers(inner, &format!("{key}{dot}{name}"))).collect()
        }
        Value::Array(list) => list.iter().flat_map(|inner| numbers(inner, key)).collect(),
        _ => Vec::new(),
    }
}

/// Calls `check` with each number of the files: its name, its value, its range on every backend and on hardware.
fn each(files: &[&str], check: impl Fn(&str, f64, &NumberRange, Option<&NumberRange>)) {
    let reference = reference();
    for name in files {
        let file = reference.iter().find(|file| file.name == *name).unwrap();
        let found = numbers(&Value::Table(file.text.parse().unwrap()), "");
        assert!(!found.is_empty(), "{name}");
        for (key, value) in found {
            let name = format!("{name}: `{key}`");
            let wide = range_of(file.name, &key).unwrap_or_else(|| panic!("{name} has no range"));
            let (table, last) = key.rsplit_once('.').unwrap_or(("", &key));
            let section = file.sections.iter().find(|section| section.table == table);
            let known = section.and_then(|section| section.keys.iter().find(|known| known.name == last));
            let known = known.unwrap_or_else(|| panic!("{name} is not in the reference"));
            assert_eq!(known.range, Some(wide), "{name}");
            check(&name, value, wide, known.hardware_range);
        }
    }
}

/// (Defect once: the row of `friction` had the comment of `area_m`, which the defaults leave out, and `area_m` had none.)
#[test]
fn a_key_that_the_defaults_leave_out_has_an_entry_of_its_own() {
    let files = reference();
    let entry = |file: &str, table: &str, key: &str| {
        let file = files.iter().find(|known| known.name == file).unwrap();
        let section = file.sections.iter().find(|section| section.table == table).unwrap();
        section.keys.iter().find(|known| known.name == key).unwrap_or_else(|| panic!("{key} is not there"))
    };
    let (area, friction) =
        (entry("simulator.toml", "terrain.blocks", "area_m"), entry("simulator.toml", "terrain.blocks", "friction"));
    assert!(area.default.is_none() && area.range.is_some() && area.comment.contains("Rectangle"), "{area:?}");
    assert!(friction.default.is_some() && !friction.comment.contains("area_m"), "{friction:?}");
    for (table, key) in [("", "objective"), ("sampler", "startup_trials"), ("first.forward", "Fx")] {
        assert_eq!(entry("optimize.toml", table, key).default, None, "{key}");
    }
}

const FILES: [&str; 4] = ["control.toml", "safety.toml", "optimize.toml", "prior.toml"];

#[test]
fn every_number_of_the_defaults_has_a_range_and_is_inside() {
    each(&FILES, |name, value, wide, narrow| {
        assert!(wide.allows(value) && narrow.is_none_or(|narrow| narrow.allows(value)), "{name}");
    });
}

/// No limit of a robot can be so large that it limits nothing.
#[test]
fn every_number_has_a_ceiling_on_hardware() {
    each(&FILES, |name, _, wide, narrow| assert!(!narrow.unwrap_or(wide).allows(1e12), "{name}"));
}

#[test]
fn a_range_for_hardware_is_part_of_the_range_for_every_backend() {
    let grid: Vec<f64> = (-60..=60).flat_map(|i| [1.0, 2.5, 5.0].map(|d| d * 10_f64.powi(i / 5))).collect();
    each(&FILES, |name, _, wide, narrow| {
        let Some(narrow) = narrow else { return };
        let outside = grid.iter().find(|value| narrow.allows(**value) && !wide.allows(**value));
        assert_eq!(outside, None, "{name}");
    });
}

#[test]
fn every_number_of_the_simulator_has_a_range() {
    each(&["simulator.toml"], |name, value, wide, _| assert!(wide.allows(value), "{name}"));
}

#[test]
fn a_range_includes_its_ends_and_no_other_number() {
    let range = range_of("control.toml", "tasks.forward.cutoff_lost_s").unwrap();
    assert!([0.001, 0.1, 0.5].into_iter().all(|value| range.allows(value)));
    assert!(![0.0009, 0.501, f64::NAN, f64::INFINITY, f64::NEG_INFINITY].into_iter().any(|value| range.allows(value)));
    assert_eq!(range.text, "must be 0.001 to 0.5 s");
}
