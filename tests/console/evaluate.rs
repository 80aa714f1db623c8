//! `quadfrog evaluate` on the running program.

use std::process::{Command, Output};

use crate::program::{Program, assert_shows, without_threads};
use serde_json::Value;

fn evaluate(arguments: &[&str]) -> Output {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    Command::new(env!("CARGO_BIN_EXE_quadfrog")).current_dir(root).arg("evaluate").args(arguments).output().unwrap()
}

fn runs(arguments: &[&str]) -> Vec<Value> {
    let output = evaluate(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn every_variant_and_seed_is_one_object_with_the_same_bits_each_time() {
    let arguments =
        ["--task", "forward", "--config", "examples/continuous", "--seeds", "0-2", "--vmc", "on,off", "--json"];
    let first = runs(&arguments);
    let keys: Vec<_> =
        first.iter().map(|run| (run["variant"]["vmc"].as_str().unwrap(), run["seed"].as_u64().unwrap())).collect();
    assert_eq!(keys, [("on", 0), ("on", 1), ("on", 2), ("off", 0), ("off", 1), ("off", 2)]);
    for run in first.iter().filter(|run| run["fell"] == false) {
        assert_eq!(run["jumps"], 5);
        assert!(run["cause"].is_null() && run["fall_time_s"].is_null());
        let per_jump = run["measured"]["dx_m"].as_f64().unwrap() / 5.0;
        assert!((run["value"].as_f64().unwrap() - per_jump).abs() < 1e-12, "{run}");
        let jumps = run["measured"]["jumps"].as_array().unwrap();
        let shares = jumps.iter().map(|jump| jump["value"].as_f64().unwrap()).sum::<f64>();
        assert!(jumps.len() == 5 && (shares - 5.0 * per_jump).abs() < 1e-9, "{run}");
        for name in ["time_s", "x_m", "y_m", "yaw_rad", "tilt_rad", "rise_m", "air_s"] {
            assert!(jumps[1][name].is_f64(), "{run}");
        }
        assert!(run["measured"]["touchdown"]["dx_m"].as_f64().unwrap() > jumps[4]["x_m"].as_f64().unwrap(), "{run}");
    }
    for run in first.iter().filter(|run| run["fell"] == true) {
        assert!(run["cause"].is_string() && run["value"] == 0.0, "{run}");
    }
    assert_eq!(first, runs(&arguments));
}

/// More jobs than cores, and more than runs.
#[test]
fn the_results_do_not_depend_on_the_number_of_jobs() {
    let output = |jobs: &str| {
        let arguments = ["--config", "examples/rough_terrain", "--seeds", "0-3", "--vmc", "on,off", "--duration", "3"];
        let output = evaluate(&[&arguments[..], &["--json", "--jobs", jobs]].concat());
        assert!(output.status.success());
        (output.stdout, output.stderr)
    };
    let one = output("1");
    assert_eq!(one.0.iter().filter(|&&byte| byte == b'\n').count(), 8);
    assert_eq!(one, output("3"));
    assert_eq!(one, output("16"));
}

/// Regression: sines of the C library take fused instructions where the processor has them, and the noise its logarithms: the ninth digit
/// of a jump was that of the machine, and `verify` failed on another one. Its switch for such instructions is that of glibc; another C
/// library ignores it.
#[test]
fn a_jump_has_the_same_bits_whatever_the_c_library_finds_in_the_processor() {
    let output = |switches: &str| {
        let robot =
            ["evaluate", "--task", "twist-ccw", "--config", "examples/hardware_like", "--seeds", "0-3", "--json"];
        let arguments = [&robot[..], &["--point", "f0=1.2,Fy=110,Fz=250"]].concat();
        let mut program = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
        program.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).env("GLIBC_TUNABLES", switches);
        let output = program.args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let plain = output("");
    assert_eq!(plain.lines().count(), 4);
    assert_eq!(plain, output("glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX2_Usable,-FMA_Usable"));
}

/// The task, the configuration and the robot are those of the study.
#[test]
fn the_best_point_of_a_study_gives_the_value_of_its_trial() {
    let folder = tempfile::tempdir().unwrap();
    let parent = folder.path().to_str().unwrap();
    let mut optimize = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
    let arguments = ["optimize", "--task", "twist-ccw", "--trials", "4", "--model", "a1", "--json", "--output", parent];
    let output = optimize.args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let trials: Vec<Value> =
        String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let best = trials.iter().filter_map(|trial| trial["value"].as_f64()).fold(0.0, f64::max);
    assert!(best > 0.1, "{trials:?}");
    let study = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
    for place in [study.clone(), study.join("config")] {
        let run = &runs(&["--point", "best", "--config", place.to_str().unwrap(), "--json"])[0];
        assert_eq!((run["value"].as_f64(), run["fell"].as_bool()), (Some(best), Some(false)), "{run}");
    }
    let place = study.to_str().unwrap();
    let refused = evaluate(&["--task", "forward", "--point", "best", "--config", place]);
    let message = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(2) && message.contains("twist-ccw"), "{message}");
}

#[test]
fn friction_is_a_variant_and_is_reported_for_each_seed_where_it_is_drawn() {
    let point = ["--point", "f0=1.3,Fx=40,Fz=210", "--json"];
    let variants = runs(&[&point[..], &["--friction", "0.5,1", "--seeds", "0,1", "--vmc", "on,off"]].concat());
    let named: Vec<_> =
        variants.iter().map(|run| (run["variant"].clone(), run["friction"].as_f64().unwrap())).collect();
    assert_eq!(named.len(), 8);
    for (variant, friction) in named {
        assert_eq!(variant["friction"], friction);
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("simulator.toml");
    let configured = |text: &str| {
        std::fs::write(&file, text).unwrap();
        evaluate(&[&point[..], &["--config", folder.path().to_str().unwrap(), "--seeds", "0-9"]].concat())
    };
    let drawn = String::from_utf8(configured("[terrain]\nfriction_range = [0.4, 0.9]\n").stdout).unwrap();
    let drawn: Vec<Value> = drawn.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let drawn: Vec<f64> = drawn.iter().map(|run| run["friction"].as_f64().unwrap()).collect();
    assert!(drawn.len() == 10 && drawn.iter().all(|friction| (0.4..=0.9).contains(friction)), "{drawn:?}");
    assert!(drawn.windows(2).all(|pair| pair[0] != pair[1]), "{drawn:?}");
    for (text, key) in [
        ("[terrain]\nfriction_range = [0.9, 0.4]", "`terrain.friction_range` = 0.4"),
        ("[terrain]\nfriction_range = [0.4, 11]", "`terrain.friction_range` = 11"),
        ("[terrain.blocks]\narea_m = [2, 1, 0, 1]", "`terrain.blocks.area_m` = 1"),
        ("[terrain.blocks]\narea_m = [0, 1]", "`terrain.blocks.area_m`"),
        ("[terrain.blocks]\ncount = 20000", "1 to 10000"),
        ("[contact]\nfall_bodies = [\"knee\"]", "`contact.fall_bodies`"),
    ] {
        let refused = configured(text);
        let message = String::from_utf8_lossy(&refused.stderr);
        assert!(refused.status.code() == Some(2) && message.contains("simulator.toml:2"), "{text}: {message}");
        assert!(message.contains(key), "{key} is not in: {message}");
    }
}

#[test]
fn the_table_shows_means_with_spread_and_each_fall_with_cause_time_and_jumps() {
    let point = "f0=1.3,Fx=40,Fz=210,f1=0.8";
    let arguments = ["--config", "examples/rough_terrain", "--point", point, "--seeds", "300-305", "--vmc", "off"];
    let output = evaluate(&[&arguments[..], &["--duration", "8"]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    for part in ["value per jump, m", "tilt, rad", "roll range, rad", "pitch range, rad", "standard deviations"] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    let row = text.lines().find(|line| line.starts_with("off")).unwrap();
    assert!(row.matches('(').count() >= 2, "{row}");
    let falls = text.lines().filter(|line| line.trim_start().starts_with("seed ")).collect::<Vec<_>>();
    assert!(!falls.is_empty(), "{text}");
    assert!(falls.iter().all(|fall| fall.contains(" s, after ") && fall.ends_with(" jumps")), "{falls:?}");
}

/// Regression: a single run had standard deviations, 0.000, and the values of the point had no units.
#[test]
fn the_table_of_a_single_run_has_units_and_no_deviations() {
    let text = String::from_utf8(evaluate(&["--point", "f0=1.5,Fx=40,Fz=200"]).stdout).unwrap();
    for part in ["f0 1.5000 Hz, ", "Fx 40.0000 N, ", "Fz 200.0000 N"] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    let row = text.lines().find(|line| line.starts_with("on")).unwrap();
    assert!(!row.contains('('), "{row}");
}

#[test]
fn a_duration_counts_the_jumps_that_begin_within_it() {
    // One period lasts 0.5 / 1.25 + 0.5 / 0.8333 = 1.0 s: impulses begin at 0, 1 and 2 s.
    let point = "f0=1.25,f1=0.8333333333333334,Fx=10,Fz=170";
    let runs = runs(&["--point", point, "--duration", "2.5", "--json"]);
    assert_eq!(runs[0]["jumps"], 3, "{}", runs[0]);
}

#[test]
fn wrong_input_is_refused_with_name_value_and_remedy() {
    for (arguments, parts) in [
        (vec![], vec!["there is no point", "[first.forward]"]),
        (vec!["--point", "f0=1.3,Fq=3"], vec!["no parameter Fq", "there are Fx, Fy, Fz, f0"]),
        (vec!["--point", "f0=1.3,Fx=1e9"], vec!["Fx = 1000000000", "outside"]),
        (vec!["--point", "Fx=40"], vec!["f0 is missing"]),
        (vec!["--point", "f0=abc"], vec!["abc", "not a number"]),
        (vec!["--point", "f0=1.3,Fx=40,Fz=210", "--duration", "5"], vec!["--duration", "f1"]),
        (vec!["--point", "f0=1.3,f0=1.5"], vec!["f0 is given twice"]),
        (vec!["--point", "best"], vec!["--point best", "--config"]),
        (vec!["--point", "f0=1.3", "--vmc", "maybe"], vec!["maybe", "on,off"]),
        (vec!["--point", "f0=1.3", "--friction", "a"], vec!["--friction", "give numbers, for example 0.4,0.6,1.0"]),
        (vec!["--point", "f0=1.3,Fx=40,Fz=210", "--friction", "99"], vec!["--friction 99", "0 to 10"]),
    ] {
        let output = evaluate(&arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{arguments:?}: {message}");
    }
}

/// Regression: without f0 an impulse had no end and the command neither, with ticks in memory; a force that was left out was 0 N
/// without a word.
#[test]
fn a_point_without_a_frequency_or_a_force_is_refused() {
    let program = Program::new();
    program.write("f0/optimize.toml", "[first.forward]\nFx = 100.0\nFz = 250.0\n");
    program.write("Fz/optimize.toml", "[first.forward]\nf0 = 1.3\nFx = 100.0\n");
    for (arguments, parts) in [
        (["--config", "f0"], ["[first.forward] in optimize.toml: f0 is missing", "--point"]),
        (["--config", "Fz"], ["[first.forward] in optimize.toml: Fz is missing", "a force of forward"]),
        (["--point", "f0=1.3"], ["--point f0=1.3: Fx is missing", "0 for none"]),
        (["--point", "f0=1.3,Fx=40"], ["--point f0=1.3,Fx=40: Fz is missing", "a force of forward"]),
    ] {
        assert_shows(&program.refused(&[&["evaluate"], &arguments[..]].concat()), &parts);
    }
    // A force of another task is 0 unless it is given.
    assert_eq!(program.trials(&["evaluate", "--point", "f0=1.3,Fx=0,Fz=210", "--json"]).len(), 1);
}

/// Regression: a repeated seed or variant counted as a run of its own.
#[test]
fn a_repeated_seed_or_variant_is_one_run() {
    let point = ["--point", "f0=1.5,Fx=40,Fz=200", "--json"];
    let repeated = ["--seeds", "0,0-1", "--vmc", "on,on", "--friction", "0.6,0.6"];
    assert_eq!(runs(&[&point[..], &repeated[..]].concat()).len(), 2);
}

/// Of the seeds that no value of the example was chosen on.
#[test]
fn the_fast_example_stands_at_more_than_1_3_m_per_second() {
    let runs = runs(&["--task", "forward", "--config", "examples/continuous_fast", "--seeds", "200-203", "--json"]);
    for run in &runs {
        let touchdown_s = run["measured"]["touchdown"]["time_s"].as_f64().unwrap();
        let speed = run["measured"]["dx_m"].as_f64().unwrap() / touchdown_s;
        assert!(run["fell"] == false && run["measured"]["flights"] == 1, "{run}");
        assert!(speed > 1.3 && (run["value"].as_f64().unwrap() - speed).abs() < 1e-12, "{run}");
    }
}

/// Regression: without a free thread, as in a container with a limit of processes, `evaluate` and `prior` ended with a panic.
#[test]
fn without_a_free_thread_the_results_are_the_same() {
    let program = Program::new();
    program.write("small/prior.toml", "worlds = 2\npoints = 16\n");
    let point = "f0=1.25,Fx=75,Fz=250";
    let evaluate = ["evaluate", "--task", "forward", "--point", point, "--seeds", "0-2", "--json", "--jobs", "2"];
    let prior = ["prior", "--config", "small", "--json", "--jobs", "2", "--output"];
    for (with, without) in [
        (evaluate.to_vec(), evaluate.to_vec()),
        ([&prior[..], &["one.json"]].concat(), [&prior[..], &["two.json"]].concat()),
    ] {
        let expected = program.text(&with);
        let output = without_threads(&program, &without);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(String::from_utf8(output.stdout).unwrap().replace("two.json", "one.json"), expected);
    }
}

/// A configuration whose joint velocities are so noisy that the failsafe trips before a trial can begin.
fn with_noisy_joints() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = "[sensors]\nenabled = true\njoint_velocity_noise_rad_s = 100.0\n";
    std::fs::write(folder.path().join("simulator.toml"), text).unwrap();
    folder
}

/// Regression: a run without an impulse counted with a tilt of 0, and had -0.0 in JSON.
#[test]
fn a_run_without_an_impulse_has_no_tilt_at_one() {
    let folder = with_noisy_joints();
    let arguments = ["--point", "f0=1.3,Fx=40,Fz=210", "--config", folder.path().to_str().unwrap(), "--seeds", "0-1"];
    for run in runs(&[&arguments[..], &["--json"]].concat()) {
        assert_eq!(run.get("tilt_at_impulse_rad"), Some(&Value::Null), "{run}");
    }
    let table = String::from_utf8(evaluate(&arguments).stdout).unwrap();
    // vmc, runs, falls; jumps and their deviation; value, tilt, roll and pitch.
    let row: Vec<&str> = table.lines().find(|line| line.starts_with("on ")).unwrap().split_whitespace().collect();
    assert_eq!(row[3..], ["0.0", "(0.0)", "-", "-", "-", "-"], "{table}");
}

/// Regression: it was a fall, "not begun: not in this mode, after 0 jumps".
#[test]
fn a_run_that_did_not_begin_names_the_failsafe_and_is_no_fall() {
    let folder = with_noisy_joints();
    let arguments = ["--point", "f0=1.3,Fx=40,Fz=210", "--config", folder.path().to_str().unwrap(), "--seeds", "0-1"];
    for run in runs(&[&arguments[..], &["--json"]].concat()) {
        assert_eq!((&run["begun"], &run["fell"], &run["value"]), (&false.into(), &false.into(), &0.0.into()), "{run}");
        let cause = run["cause"].as_str().unwrap();
        assert!(cause.starts_with("not begun: ") && cause.contains("rad/s exceeds"), "{cause}");
    }
    let table = String::from_utf8(evaluate(&arguments).stdout).unwrap();
    let row: Vec<&str> = table.lines().find(|line| line.starts_with("on ")).unwrap().split_whitespace().collect();
    assert_eq!(row[..3], ["on", "2", "0"], "{table}");
    assert!(table.contains("not begun, no falls: 2 runs") && !table.contains("after 0 jumps"), "{table}");
}
