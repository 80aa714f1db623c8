//! More parameters than the paper's on the running program: the second direction of a task, and gains.

use std::fs;

use crate::program::{Program, assert_shows};
use serde_json::Value;

const SEARCH: &str = "[bounds]
Fx = [-40, 60]
kp = [350, 700]
[parameters]
lateral-left = [\"f0\", \"Fx\", \"Fy\", \"Fz\", \"kp\", \"kd\"]
";

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The gains of a trial are those of its point: in the journal, in a continued study, and in an exported configuration.
#[test]
fn gains_and_a_second_direction_are_searched_continued_and_exported() {
    let program = Program::new();
    program.write("mine/optimize.toml", SEARCH);
    let common = ["--json", "--record", "none"];
    let run = |arguments: &[&str]| program.trials(&[&["optimize"], arguments, &common].concat());
    let arguments = ["--task", "lateral-left", "--config", "mine", "--seed", "3"];
    let first = run(&[&arguments[..], &["--trials", "8", "--output", "whole"]].concat());
    assert!(first.iter().any(|trial| number(&trial["params"]["Fx"]) < 0.0));
    assert!(first.iter().any(|trial| number(&trial["params"]["kp"]) != number(&first[0]["params"]["kp"])));
    for trial in &first {
        let inside = |name: &str, low: f64, high: f64| (low..=high).contains(&number(&trial["params"][name]));
        assert!(inside("Fx", -40.0, 60.0) && inside("kp", 350.0, 700.0) && inside("kd", 2.0, 20.0), "{trial}");
    }
    // Continued after five trials, the study is the same.
    let begun = run(&[&arguments[..], &["--trials", "5", "--output", "parts"]].concat());
    assert_eq!(begun, first[..5]);
    let study = program.study("parts");
    let study = study.to_str().unwrap();
    assert_eq!(run(&["--resume", study, "--trials", "8"]), first[5..]);

    let trials = program.exported(study);
    assert_eq!(trials.len(), 8);
    for trial in &trials {
        let (point, gains) = (&trial["params"], &trial["user_attrs"]["gains"]);
        assert_eq!((&gains["kp"], &gains["kd"]), (&point["kp"], &point["kd"]), "{trial}");
        assert_eq!((number(&gains["kd_joint"]), number(&gains["k_att"])), (0.8, 200.0), "{trial}");
    }
    assert_shows(&program.text(&["study", "show", study]), &["kp (N/m)", "kd (N s/m)", "Fx from -40 to 60 N"]);
    assert!(!program.text(&["study", "show", study]).contains("other gains"));

    // A queued point takes the sign and the gain; outside the bounds it is refused.
    program.text(&["study", "enqueue", study, "Fx=-12.5", "kp=555"]);
    assert_shows(&program.refused(&["study", "enqueue", study, "Fx=-41"]), &["Fx = -41", "-40 to 60"]);
    assert_shows(&program.refused(&["study", "enqueue", study, "kp=701"]), &["kp = 701", "350 to 700"]);
    let queued = run(&["--resume", study, "--trials", "9"]);
    assert_eq!((number(&queued[0]["params"]["Fx"]), number(&queued[0]["params"]["kp"])), (-12.5, 555.0));

    // The exported configuration begins with the best point and gives the same value.
    program.text(&["study", "best", study, "--config", "best"]);
    let best = first.iter().chain(&queued).filter(|trial| trial["verdict"] == "accept");
    let best = best.max_by(|a, b| number(&a["value"]).total_cmp(&number(&b["value"]))).unwrap();
    let again = run(&["--task", "lateral-left", "--config", "best", "--trials", "1", "--output", "again"]);
    assert_eq!((&again[0]["params"], &again[0]["value"]), (&best["params"], &best["value"]));
    let control = fs::read_to_string(program.path("best/control.toml")).unwrap();
    let control: Value = serde_json::to_value(control.parse::<toml::Table>().unwrap()).unwrap();
    let kp = number(&control["tasks"]["lateral-left"]["kp"]);
    assert_eq!(kp, 400.0, "the stance between trials keeps its stiffness");

    // The same point without a study.
    let seed: Vec<String> = best["params"].as_object().unwrap().iter().map(|(name, v)| format!("{name}={v}")).collect();
    for point in
        [&["--point", &seed.join(",")][..], &["--config", "best"], &["--config", "best", "--point", &seed.join(",")]]
    {
        let runs = program.trials(&[&["evaluate", "--task", "lateral-left", "--json"], point].concat());
        assert_eq!(runs[0]["value"], best["value"], "{point:?}");
    }
}

#[test]
fn evaluated_gains_act_and_keep_their_limits() {
    let program = Program::new();
    let value = |point: &str| {
        let runs = program.trials(&["evaluate", "--json", "--point", point]);
        number(&runs[0]["measured"]["dx_m"])
    };
    assert_eq!(value("f0=1.4,Fx=40,Fz=220,kp=400"), value("f0=1.4,Fx=40,Fz=220"));
    assert_ne!(value("f0=1.4,Fx=40,Fz=220,kp=500"), value("f0=1.4,Fx=40,Fz=220"));
    for (task, point, parts) in [
        ("forward", "f0=1.4,kp=900", ["kp = 900", "300 to 800"]),
        ("forward", "f0=1.4,Fx=-10", ["Fx = -10", "0 to 200"]),
        ("forward", "f0=1.4,Fy=-201", ["Fy = -201", "-200 to 200"]),
        ("lateral-left", "f0=1.4,Fy=-10", ["Fy = -10", "0 to 200"]),
    ] {
        assert_shows(&program.refused(&["evaluate", "--task", task, "--point", point]), &parts);
    }
}

#[test]
fn a_configuration_outside_the_limits_is_refused_before_any_trial() {
    let program = Program::new();
    for (text, parts) in [
        (SEARCH.replace("700", "900"), ["optimize.toml:3", "bounds.kp", "[350, 900]", "[300, 800]"]),
        (SEARCH.replace("-40", "-300"), ["optimize.toml:2", "bounds.Fx", "[-300, 60]", "[-200, 200]"]),
        (SEARCH.replace("\"Fx\", ", ""), ["optimize.toml:2", "bounds.Fx", "[-40, 60]", "[0, 200]"]),
    ] {
        program.write("mine/optimize.toml", &text);
        let message = program.refused(&["optimize", "--task", "lateral-left", "--config", "mine", "--trials", "1"]);
        assert_shows(&message, &parts);
    }
    assert!(program.studies("recordings").is_empty());
}
