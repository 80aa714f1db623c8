//! `quadfrog evaluate` on the running program.

use std::process::{Command, Output};

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
        (vec!["--point", "f0=1.3,Fq=3"], vec!["no parameter Fq", "Fz"]),
        (vec!["--point", "f0=1.3,Fx=1e9"], vec!["Fx = 1000000000", "outside"]),
        (vec!["--point", "Fx=40"], vec!["f0 is missing"]),
        (vec!["--point", "f0=abc"], vec!["abc", "not a number"]),
        (vec!["--point", "f0=1.3", "--duration", "5"], vec!["--duration", "f1"]),
        (vec!["--point", "best"], vec!["--point best", "--config"]),
        (vec!["--point", "f0=1.3", "--vmc", "maybe"], vec!["maybe", "on,off"]),
    ] {
        let output = evaluate(&arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{arguments:?}: {message}");
    }
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
