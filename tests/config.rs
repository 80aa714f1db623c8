//! Configuration files: errors are reported with file, line, key, value and remedy.

use std::fs;
use std::path::PathBuf;

use quadfrog::config::Config;
use quadfrog::robot::description::RobotDescription;
use quadfrog::trial::{Backend, Task};

/// Loads a folder with one file and returns the error's message.
fn refused(name: &str, text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), text).unwrap();
    let error = Config::load(Some(folder.path())).expect_err("should be refused").to_string();
    assert!(error.contains(name), "the message does not name the file: {error}");
    error
}

#[test]
fn the_defaults_are_fit_for_use() {
    let config = Config::load(None).unwrap();
    for name in ["go1", "a1"] {
        let robot = RobotDescription::embedded(name).unwrap();
        for task in Task::ALL {
            let settings = config.settings(&robot, task, Backend::Simulator).unwrap();
            assert!(settings.weight_n > 50.0);
            assert!(config.parameters(task).len() >= 3);
        }
    }
}

/// The files of the repository are the embedded ones; giving them as a folder changes nothing.
#[test]
fn the_folder_of_the_repository_gives_the_defaults() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("config");
    let given = Config::load(Some(&folder)).unwrap();
    let embedded = Config::load(None).unwrap();
    assert_eq!(given.as_run, embedded.as_run);
}

#[test]
fn a_file_replaces_key_by_key() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("optimize.toml"), "trials = 7\n[bounds]\nFx = [10, 140]\n").unwrap();
    let config = Config::load(Some(folder.path())).unwrap();
    assert_eq!(config.optimize.trials, 7);
    assert_eq!(config.optimize.bounds["Fx"], [10.0, 140.0]);
    assert_eq!(config.optimize.bounds["Fz"], [150.0, 350.0]);
}

#[test]
fn a_key_that_the_defaults_leave_out_may_be_given() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("optimize.toml"), "[sampler]\nkind = \"gp\"\nstartup_trials = 5\n").unwrap();
    let config = Config::load(Some(folder.path())).unwrap();
    assert_eq!(config.optimize.sampler.startup_trials, Some(5));
    let error = refused("optimize.toml", "[sampler]\nstartup_trials = \"ten\"\n");
    assert!(error.contains("sampler.startup_trials") && error.contains("whole number"), "{error}");
}

#[test]
fn an_unknown_key_is_refused_with_line_and_nearest_key() {
    let error = refused("control.toml", "# mine\n\n[tasks.forward]\nkpp = 300.0\n");
    assert!(
        error.contains(":4:") && error.contains("tasks.forward.kpp") && error.contains("tasks.forward.kp`?"),
        "{error}"
    );
}

#[test]
fn an_unknown_table_is_refused() {
    let error = refused("safety.toml", "[gates]\nkp_max = 1.0\n");
    assert!(error.contains("`gates`") && error.contains("`gate`?"), "{error}");
}

#[test]
fn a_value_of_another_kind_is_refused() {
    let error = refused("control.toml", "[settle]\ncap_s = \"long\"\n");
    assert!(error.contains("settle.cap_s") && error.contains("a number") && error.contains("long"), "{error}");
}

#[test]
fn broken_toml_is_refused_with_its_line() {
    let error = refused("optimize.toml", "trials = 3\n[bounds\n");
    assert!(error.contains(":2:"), "{error}");
}

#[test]
fn bounds_outside_the_robots_limits_are_refused_with_both() {
    let error = refused("optimize.toml", "[bounds]\nFz = [150.0, 900.0]\n");
    assert!(error.contains("bounds.Fz") && error.contains("900") && error.contains("400"), "{error}");
}

#[test]
fn bounds_the_wrong_way_round_are_refused() {
    let error = refused("optimize.toml", "[bounds]\nFx = [100.0, 50.0]\n");
    assert!(error.contains("bounds.Fx") && error.contains("[100, 50]"), "{error}");
}

#[test]
fn a_parameter_that_does_not_exist_is_refused_with_those_that_do() {
    let error = refused("optimize.toml", "[parameters]\nforward = [\"f0\", \"Fw\"]\n");
    assert!(error.contains("Fw") && error.contains("Fx"), "{error}");
}

/// (A defect once: without f0 the impulse never ended.)
#[test]
fn a_task_without_f0_or_a_frequency_of_zero_is_refused() {
    let error = refused("optimize.toml", "[parameters]\nforward = [\"Fx\", \"Fz\"]\n");
    assert!(error.contains("parameters.forward") && error.contains("needs f0"), "{error}");
    let error = refused("optimize.toml", "[bounds]\nf1 = [0.0, 1.0]\n");
    assert!(error.contains("bounds.f1") && error.contains("above 0 Hz"), "{error}");
    let error = refused("safety.toml", "[watchdog]\nhardware_late_ms = -10.0\n");
    assert!(error.contains("hardware_late_ms"), "{error}");
}

#[test]
fn a_negative_duration_is_refused() {
    let error = refused("control.toml", "[stand_up]\nduration_s = -1.0\n");
    assert!(error.contains("stand_up.duration_s") && error.contains("-1"), "{error}");
}

#[test]
fn a_misspelt_file_name_is_refused() {
    let error = refused("saftey.toml", "");
    assert!(error.contains("safety.toml"), "{error}");
}

#[test]
fn a_folder_that_is_not_there_is_refused() {
    let error = Config::load(Some("/nowhere/at/all".as_ref())).unwrap_err().to_string();
    assert!(error.contains("/nowhere/at/all") && error.contains("no such"), "{error}");
}

#[test]
fn a_stance_out_of_reach_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("control.toml"), "[tasks.forward]\nstance_m = [0.0, 0.14, -0.5]\n").unwrap();
    let config = Config::load(Some(folder.path())).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let error = config.settings(&robot, Task::Forward, Backend::Simulator).unwrap_err().to_string();
    assert!(error.contains("control.toml:2") && error.contains("stance_m") && error.contains("stretched"), "{error}");
}

#[test]
fn a_stop_that_the_gate_would_cut_is_refused() {
    let error = refused("safety.toml", "[gate]\ndamping_kd = 20.0\n");
    assert!(error.contains("gate.damping_kd") && error.contains("kd_max"), "{error}");
}

/// (A defect once: such values were reported in line 1.)
#[test]
fn values_that_no_kind_can_hold_are_refused_with_their_line_key_and_value() {
    let error = refused("optimize.toml", "# mine\n\ntrials = -3\n");
    assert!(error.contains(":3") && error.contains("`trials` = -3"), "{error}");
    assert!(error.contains("a whole number from 0 to 4294967295"), "no user knows our types: {error}");
    let error = refused("control.toml", "\n[tasks.forward]\nstance_m = [0.0, 0.14]\n");
    assert!(error.contains(":3") && error.contains("tasks.forward.stance_m") && error.contains("0.14"), "{error}");
    let error = refused("optimize.toml", "[sampler]\nkind = \"cma\"\n");
    assert!(error.contains(":2") && error.contains("sampler.kind") && error.contains("cma"), "{error}");
}
