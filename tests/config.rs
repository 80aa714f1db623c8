//! Configuration files: errors are reported with file, line, key, value and remedy.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::PathBuf;

use quadfrog::config::{Config, ConfigLayer};
use quadfrog::robot::description::{RobotDescription, RobotFiles};
use quadfrog::trial::{Backend, JumpParameters, Task};

/// Asserts that a folder with one file is refused, and that the message names the file and has all `words`.
fn refuses(name: &str, text: &str, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), text).unwrap();
    let error = Config::load(Some(folder.path())).expect_err("should be refused").to_string();
    for word in [name].iter().chain(words) {
        assert!(error.contains(word), "{word} is not in: {error}");
    }
}

/// Regression: bounds with a text in them "must be a list, not a list".
#[test]
fn a_list_with_wrong_entries_names_the_entries_that_it_needs() {
    let bounds = "[bounds]\nf0 = [\"a\", 1.0]\n";
    refuses("optimize.toml", bounds, &["optimize.toml:2", "`bounds.f0` must be a list of two numbers, not"]);
}

/// Regression: a warning that comes after its stop, and foot forces of which none is allowed, were valid.
#[test]
fn a_lower_limit_above_its_upper_one_is_refused() {
    let late = "[watchdog]\noperator_warn_ms = 1000\noperator_silent_ms = 200\n";
    refuses("safety.toml", late, &["operator_warn_ms", "must not be above watchdog.operator_silent_ms = 200"]);
    let forces = "[ready]\nforce_share_min = 2.5\nforce_share_max = 2.0\n";
    refuses("safety.toml", forces, &["force_share_min", "must not be above ready.force_share_max = 2"]);
}

/// Regression: pauses of more than 10 s between jumps were valid, and their trials ended with "no state from the robot".
#[test]
fn a_frequency_between_jumps_that_is_none_is_refused() {
    refuses("safety.toml", "[parameters]\nf1 = [0.001, 3.0]\n", &["parameters.f1", "0.05 to 100 Hz"]);
}

/// Regression: a folder without a configuration file was taken for one, and the defaults were in force without a word.
#[test]
fn a_folder_without_a_configuration_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("notes.txt"), "none").unwrap();
    fs::create_dir(folder.path().join("hardware_like")).unwrap();
    let error = Config::load(Some(folder.path())).expect_err("should be refused").to_string();
    for part in ["holds no configuration file", "control.toml", "safety.toml", "or none, for the defaults"] {
        assert!(error.contains(part), "{part} is not in: {error}");
    }
}

#[test]
fn the_defaults_are_fit_for_use() {
    for name in RobotDescription::embedded_names() {
        let files = RobotFiles::embedded(name).unwrap();
        let (robot, config) = (files.description().unwrap(), Config::load_for(&files, None).unwrap());
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

/// The built-in values, the robot's own over them, those of `--config` over both; messages name the file that gives the value.
#[test]
fn a_robots_own_configuration_lies_under_the_given_one() {
    let go2 = RobotFiles::embedded("go2").unwrap();
    let own = Config::load_for(&go2, None).unwrap();
    assert_eq!(own.task(Task::Forward).stance_m, [0.0, 0.1555, -0.25]);
    assert_eq!(own.optimize.bounds["Fz"], [180.0, 400.0]);
    assert_eq!(own.optimize.bounds["f0"], Config::load(None).unwrap().optimize.bounds["f0"]);
    let place = own.origin("optimize.toml", "bounds.Fz").unwrap();
    assert!(place.starts_with("robots/go2/config/optimize.toml:"), "{place}");

    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("optimize.toml"), "[bounds]\nFx = [10, 140]\n").unwrap();
    let given = Config::load_for(&go2, Some(folder.path())).unwrap();
    assert_eq!((given.optimize.bounds["Fx"], given.optimize.bounds["Fz"]), ([10.0, 140.0], [180.0, 400.0]));
    assert!(given.origin("optimize.toml", "bounds.Fx").unwrap().ends_with("optimize.toml:2"));
    assert_eq!(given.origin("optimize.toml", "bounds.Fz").unwrap(), place);
    assert_eq!(given.origin("optimize.toml", "bounds.f0"), None);

    // A file that no configuration has, and a wrong value, are refused with the robot's file.
    let robot = folder.path().join("robot");
    fs::create_dir_all(robot.join("config")).unwrap();
    fs::write(robot.join("robot.toml"), include_str!("../robots/go2/robot.toml")).unwrap();
    fs::write(robot.join("config/saftey.toml"), "").unwrap();
    let refusal = || Config::load_for(&RobotFiles::from_folder(&robot).unwrap(), None).unwrap_err().to_string();
    let error = refusal();
    assert!(error.contains("saftey.toml") && error.contains("safety.toml"), "{error}");
    fs::rename(robot.join("config/saftey.toml"), robot.join("config/optimize.toml")).unwrap();
    fs::write(robot.join("config/optimize.toml"), "\n[bounds]\nFz = [300.0, 200.0]\n").unwrap();
    let error = refusal();
    assert!(error.contains("robot/config/optimize.toml:3") && error.contains("bounds.Fz"), "{error}");

    // A configuration that cannot be read is refused, not left out.
    fs::remove_dir_all(robot.join("config")).unwrap();
    assert!(Config::load_for(&RobotFiles::from_folder(&robot).unwrap(), None).is_ok(), "there is none");
    fs::write(robot.join("config"), "").unwrap();
    let error = RobotFiles::from_folder(&robot).unwrap_err().to_string();
    assert!(error.contains("robot/config"), "{error}");
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
    fs::write(
        folder.path().join("optimize.toml"),
        "[sampler]\nkind = \"gp\"\nstartup_trials = 5\nleast_p_stand = 0.9\n",
    )
    .unwrap();
    let config = Config::load(Some(folder.path())).unwrap();
    assert_eq!((config.optimize.sampler.startup_trials, config.optimize.sampler.least_p_stand), (Some(5), 0.9));
    refuses("optimize.toml", "[sampler]\nleast_p_stand = 1.0\n", &["sampler.least_p_stand", "0.99"]);
    refuses("optimize.toml", "[fall_price]\nforward = -0.1\n", &["fall_price.forward", "0 to 10"]);
    refuses("optimize.toml", "[fall_price]\nlateral_left = 0.1\n", &["unknown key `fall_price.lateral_left`"]);
    // Regression: a key without a similar one was refused without a remedy.
    let remedy = "unknown key `zzzzzz`; remove it; `quadfrog config show` lists the keys of each file";
    refuses("safety.toml", "zzzzzz = 1.0\n", &[remedy]);
    refuses("optimize.toml", "[sampler]\nstartup_trials = \"ten\"\n", &["sampler.startup_trials", "whole number"]);
}

#[test]
fn an_unknown_key_is_refused_with_line_and_nearest_key() {
    refuses(
        "control.toml",
        "# mine\n\n[tasks.forward]\nkpp = 300.0\n",
        &[":4:", "tasks.forward.kpp", "tasks.forward.kp`?"],
    );
}

#[test]
fn an_unknown_table_is_refused() {
    refuses("safety.toml", "[gates]\nkp_max = 1.0\n", &["`gates`", "`gate`?"]);
}

#[test]
fn a_value_of_another_kind_is_refused() {
    refuses("control.toml", "[settle]\ncap_s = \"long\"\n", &["settle.cap_s", "a number", "long"]);
}

#[test]
fn broken_toml_is_refused_with_its_line() {
    refuses("optimize.toml", "trials = 3\n[bounds\n", &[":2:"]);
}

#[test]
fn bounds_outside_the_robots_limits_are_refused_with_both() {
    refuses("optimize.toml", "[bounds]\nFz = [150.0, 900.0]\n", &["bounds.Fz", "900", "400"]);
}

#[test]
fn bounds_the_wrong_way_round_are_refused() {
    refuses("optimize.toml", "[bounds]\nFx = [100.0, 50.0]\n", &["bounds.Fx", "[100, 50]"]);
}

#[test]
fn a_parameter_that_does_not_exist_is_refused_with_those_that_do() {
    refuses("optimize.toml", "[parameters]\nforward = [\"f0\", \"Fw\"]\n", &["Fw", "Fx"]);
}

fn loads(text: &str) -> Config {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("optimize.toml"), text).unwrap();
    Config::load(Some(folder.path())).unwrap()
}

fn bounds(config: &Config, task: Task, name: &str) -> Option<[f64; 2]> {
    let found = config.parameters(task).into_iter().find(|parameter| parameter.name == name);
    found.map(|parameter| [parameter.low, parameter.high])
}

/// `docs/method.md`, "Amplitude signs".
#[test]
fn only_the_second_direction_of_a_task_has_negative_bounds() {
    let lateral = "lateral-left = [\"f0\", \"Fx\", \"Fy\", \"Fz\"]\n";
    let config = loads(&format!("[bounds]\nFx = [-50, 120]\nFy = [0, 90]\n[parameters]\n{lateral}"));
    assert_eq!(bounds(&config, Task::LateralLeft, "Fx"), Some([-50.0, 120.0]));
    assert_eq!(bounds(&config, Task::Forward, "Fx"), Some([0.0, 120.0]), "its own direction is positive");
    assert_eq!(bounds(&config, Task::LateralLeft, "Fy"), Some([0.0, 90.0]));
    assert_eq!(config.limits(Task::LateralLeft, "Fx"), Some([-200.0, 200.0]), "the limit is of the magnitude");
    assert_eq!(config.limits(Task::Forward, "Fx"), Some([0.0, 200.0]));
    let widest = config.widest(Task::LateralLeft);
    let fx = widest.iter().find(|parameter| parameter.name == "Fx").unwrap();
    assert_eq!([fx.low, fx.high], [-200.0, 200.0]);
    refuses(
        "optimize.toml",
        "[bounds]\nFx = [-50, 120]\n",
        &[":2", "bounds.Fx", "[-50, 120]", "[0, 200]", "[parameters] Fx"],
    );
    refuses("optimize.toml", "[bounds]\nFz = [-50, 300]\n", &["bounds.Fz", "[0, 400]"]);
    let beyond = format!("[bounds]\nFx = [-201, 120]\n[parameters]\n{lateral}");
    refuses("optimize.toml", &beyond, &[":2", "bounds.Fx", "[-201, 120]", "[-200, 200]"]);
    let backward = format!("[bounds]\nFx = [-50, -20]\n[parameters]\n{lateral}");
    let config = loads(&backward);
    assert_eq!(bounds(&config, Task::LateralLeft, "Fx"), Some([-50.0, -20.0]));
    let robot = RobotDescription::embedded("go1").unwrap();
    config.settings(&robot, Task::LateralLeft, Backend::Simulator).unwrap();
    let error = config.settings(&robot, Task::Forward, Backend::Simulator).unwrap_err().to_string();
    assert!(
        error.contains("bounds.Fx") && error.contains("[-50.0, -20.0]: forward pushes with positive Fx"),
        "{error}"
    );
    let first = |task: &str| {
        format!("[bounds]\nFx = [-50, 120]\n[parameters]\n{lateral}[first.{task}]\nf0 = 1.0\nFx = -10.0\n")
    };
    assert_eq!(loads(&first("lateral-left")).first(Task::LateralLeft).get("Fx"), Some(-10.0));
    refuses("optimize.toml", &first("forward"), &["first.forward.Fx", "-10", "[0, 120]"]);
}

#[test]
fn gains_may_be_parameters_within_the_limits_of_gains() {
    let config =
        loads("[bounds]\nkp = [350, 700]\n[parameters]\nforward = [\"f0\", \"Fx\", \"Fz\", \"kp\", \"kd_joint\"]\n");
    let parameters = config.parameters(Task::Forward);
    let named: Vec<_> = parameters.iter().map(|p| (p.name.as_str(), p.unit.as_str(), p.low, p.high)).collect();
    assert_eq!(named[3..], [("kp", "N/m", 350.0, 700.0), ("kd_joint", "N m s/rad", 0.2, 2.0)]);
    let names =
        |gains: Vec<quadfrog::trial::ParameterInfo>| gains.into_iter().map(|gain| gain.name).collect::<Vec<_>>();
    assert_eq!(names(config.fixed_gains(Task::Forward)), ["kd", "k_att"]);
    assert_eq!(names(config.fixed_gains(Task::TwistCw)), ["kp", "kd", "kd_joint", "k_att"]);
    let searched = "[parameters]\nforward = [\"f0\", \"Fx\", \"Fz\", \"kp\"]\n";
    let beyond = format!("[bounds]\nkp = [200, 700]\n{searched}");
    refuses("optimize.toml", &beyond, &[":2", "bounds.kp", "[200, 700]", "[300, 800]", "safety.toml, [gains] kp"]);
    // The shipped bounds bind nothing where no task searches the gain.
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("safety.toml"), "[gains]\nkp = [350.0, 450.0]\n").unwrap();
    Config::load(Some(folder.path())).unwrap();
    fs::write(folder.path().join("optimize.toml"), searched).unwrap();
    let error = Config::load(Some(folder.path())).unwrap_err().to_string();
    assert!(error.contains("bounds.kp") && error.contains("[350, 450]"), "{error}");
}

/// Regression: without f0 the impulse never ended.
#[test]
fn a_task_without_f0_or_a_frequency_of_zero_is_refused() {
    refuses("optimize.toml", "[parameters]\nforward = [\"Fx\", \"Fz\"]\n", &["parameters.forward", "needs f0"]);
    refuses("optimize.toml", "[bounds]\nf1 = [0.0, 1.0]\n", &["bounds.f1", "above 0 Hz"]);
    refuses("safety.toml", "[watchdog]\nhardware_late_ms = -10.0\n", &["hardware_late_ms"]);
}

#[test]
fn a_negative_duration_is_refused() {
    refuses("control.toml", "[stand_up]\nduration_s = -1.0\n", &["stand_up.duration_s", "-1"]);
}

/// A limit that would never trip, and buttons that no remote has.
#[test]
fn consistency_limits_have_ranges_and_the_remote_its_buttons() {
    refuses("safety.toml", "[consistency]\nclock_step_ms = 5000\n", &["consistency.clock_step_ms", "20 to 1000 ms"]);
    refuses("safety.toml", "[consistency]\norientation_rad = 3.0\n", &["consistency.orientation_rad", "0.3 rad"]);
    refuses("safety.toml", "[consistency]\nrepeated_states = 1000000\n", &["consistency.repeated_states", "200"]);
    refuses("safety.toml", "[remote]\nstop = \"L9\"\n", &["remote.stop", "L9", "known buttons"]);
    refuses("safety.toml", "[remote]\nstop = \"none\"\n", &["remote.stop", "at least one button"]);
}

#[test]
fn a_misspelt_file_name_is_refused() {
    refuses("saftey.toml", "", &["safety.toml"]);
    // Regression: the file was ignored without a word.
    refuses("safety.TOML", "", &["safety.toml"]);
}

/// Regression: the defaults were in force without a word in place of limits whose link led to no file.
#[test]
fn a_file_that_is_a_link_to_no_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("optimize.toml"), "trials = 5\n").unwrap();
    symlink("../shared/safety.toml", folder.path().join("safety.toml")).unwrap();
    let error = Config::load(Some(folder.path())).expect_err("should be refused").to_string();
    for part in ["safety.toml", "../shared/safety.toml, which does not exist", "correct or remove the link"] {
        assert!(error.contains(part), "{part} is not in: {error}");
    }
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

/// Regression: the sagged robot knelt, and every trial ended in the countdown (`docs/method.md`, "High twist").
#[test]
fn a_stance_that_kneels_is_refused_and_the_shipped_ones_do_not() {
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = |config: &Config| config.settings(&robot, Task::TwistCcw, Backend::Simulator);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("control.toml"), "[tasks.twist-ccw]\nstance_m = [0.03, 0.045, -0.172]\n").unwrap();
    let error = settings(&Config::load(Some(folder.path())).unwrap()).unwrap_err().to_string();
    assert!(error.contains("control.toml:2") && error.contains("kneels before the jump"), "{error}");
    // The softest gain of a study counts: at 400 N/m this stance stands.
    fs::write(folder.path().join("control.toml"), "[tasks.twist-ccw]\nstance_m = [0.03, 0.045, -0.22]\n").unwrap();
    settings(&Config::load(Some(folder.path())).unwrap()).unwrap();
    let search = "[parameters]\ntwist-ccw = [\"f0\", \"Fy\", \"Fz\", \"kp\"]\n";
    fs::write(folder.path().join("optimize.toml"), search).unwrap();
    let error = settings(&Config::load(Some(folder.path())).unwrap()).unwrap_err().to_string();
    assert!(error.contains("kneels before the jump") && error.contains("kp = 300"), "{error}");
    for example in ["high_twist", "stable_landing", "continuous", "rough_terrain", "hardware_like", "far"] {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(example);
        settings(&Config::load(Some(&path)).unwrap()).unwrap();
    }
}

#[test]
fn a_later_text_replaces_keys_of_an_earlier_one_and_an_unknown_key_names_its_origin() {
    let layer = |origin, text| ConfigLayer { file: "control.toml", origin, text };
    let first = layer("first", "[tasks.forward]\njumps = 5\nf1_hz = 1.0\n");
    let second = layer("second", "[tasks.forward]\nf1_hz = 1.5\n");
    let config = Config::layered(&[first, second]).unwrap();
    assert_eq!((config.task(Task::Forward).jumps, config.task(Task::Forward).f1_hz), (5, 1.5));
    let error = Config::layered(&[first, layer("second", "\njumpz = 1\n")]).unwrap_err().to_string();
    assert!(error.contains("second:2") && error.contains("jumpz"), "{error}");
    let stray = ConfigLayer { file: "controls.toml", origin: "a/controls.toml", text: "" };
    let error = Config::layered(&[stray]).unwrap_err().to_string();
    assert!(error.contains("a/controls.toml") && error.contains("control.toml"), "{error}");
}

#[test]
fn a_stop_that_the_gate_would_cut_is_refused() {
    refuses("safety.toml", "[gate]\ndamping_kd = 20.0\n", &["gate.damping_kd", "kd_max"]);
}

/// Regression: such values were reported in line 1.
#[test]
fn values_that_no_kind_can_hold_are_refused_with_their_line_key_and_value() {
    refuses("optimize.toml", "# mine\n\ntrials = -3\n", &[":3", "`trials` = -3", "a whole number from 1 to 1000000"]);
    // Regression: the range was that of the kind, which starts at 0, and not that of the key.
    for (keys, expected) in [
        (
            "[terrain.blocks]\ncount = -3\n",
            "`terrain.blocks.count` = -3: invalid value: integer `-3`, expected a whole number from 1 to 10000",
        ),
        (
            "[sensors]\ndelay_ms = -1\n",
            "`sensors.delay_ms` = -1: invalid value: integer `-1`, expected a whole number from 0 to 20",
        ),
    ] {
        refuses("simulator.toml", keys, &[":2", expected]);
    }
    let three = "`tasks.forward.stance_m` must be a list of 3 numbers, not a list [0.0, 0.14]";
    refuses("control.toml", "\n[tasks.forward]\nstance_m = [0.0, 0.14]\n", &[":3", three]);
    refuses("optimize.toml", "[sampler]\nkind = \"cma\"\n", &[":2", "sampler.kind", "cma"]);
}

/// Regression: such a number was called a text in quotes, and a list that is too long was refused in a library's words.
#[test]
fn a_number_beyond_64_bits_and_a_list_of_another_length_are_refused_as_such() {
    let (number, digits) = ("must be a whole number, not a number 1", "1".repeat(20));
    refuses("optimize.toml", &format!("trials = {digits}\n"), &["optimize.toml:1", "`trials`", number]);
    refuses("optimize.toml", &format!("[fall_price]\nforward = {digits}\n"), &[":2", "must be 0 to 10"]);
    for bounds in ["[]", "[1.0]", "[1.0, 1.2, 1.3]"] {
        let expected = format!("`bounds.f0` must be a list of two numbers, not a list {bounds}");
        refuses("optimize.toml", &format!("[bounds]\nf0 = {bounds}\n"), &[":2", &expected]);
    }
}

#[test]
fn jumps_and_a_duration_exclude_each_other() {
    let both = "[tasks.forward]\njumps = 5\nduration_s = 4.0\nf1_hz = 1.0\n";
    refuses(
        "control.toml",
        both,
        &["control.toml:3", "tasks.forward.duration_s", "tasks.forward.jumps = 5", "one of them"],
    );
    refuses("control.toml", "[tasks.forward]\nduration_s = 4.0\n", &["tasks.forward.f1_hz", "0.05 Hz"]);
    refuses("control.toml", "[tasks.forward]\nduration_s = 0.0\nf1_hz = 1.0\n", &["tasks.forward.duration_s", "0.1"]);
    refuses("control.toml", "[tasks.forward]\nbounce = \"jump\"\n", &["tasks.forward.bounce", "jump", "first-landing"]);
}

/// The files as run, loaded again, are the same configuration.
#[test]
fn a_duration_alone_counts_and_its_copy_loads_again() {
    let folder = tempfile::tempdir().unwrap();
    let text = "[tasks.forward]\nduration_s = 2.5\nf1_hz = 0.8333333333333334\nrate = true\n";
    fs::write(folder.path().join("control.toml"), text).unwrap();
    let config = Config::load(Some(folder.path())).unwrap();
    let control = config.task(Task::Forward);
    // One period lasts 1 s: impulses begin at 0, 1 and 2 s.
    let jump = JumpParameters { f0_hz: 1.25, f1_hz: control.f1_hz, fx_n: 0.0, fy_n: 0.0, fz_n: 200.0 };
    assert_eq!((control.jumps(&jump), control.unit(Task::Forward), control.unit(Task::TwistCw)), (3, "m/s", "rad/s"));
    let copy = tempfile::tempdir().unwrap();
    for (name, text) in &config.as_run {
        fs::write(copy.path().join(name), text).unwrap();
    }
    let again = Config::load(Some(copy.path())).unwrap();
    assert_eq!((again.task(Task::Forward), &again.as_run), (control, &config.as_run));
}
