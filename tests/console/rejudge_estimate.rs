//! `quadfrog rejudge` on recordings of an own robot, of trials with several rollouts, and with another estimator.

use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;

use crate::precision::{PRECISION, assert_same};
use crate::program::{Program, assert_shows};
use quadfrog::recording::player::Played;
use quadfrog::recording::timeline::Timeline;
use quadfrog::robot::description::RobotDescription;
use quadfrog::telemetry::Tick;
use quadfrog::trial::Verdict;
use serde_json::Value;

/// A study of a robot of its own, `pony`: three trials of two rollouts each, estimated from the sensors.
fn recorded() -> &'static (Program, PathBuf) {
    static STUDY: OnceLock<(Program, PathBuf)> = OnceLock::new();
    STUDY.get_or_init(|| {
        let program = Program::new();
        for (name, text) in &RobotDescription::embedded("go1").unwrap().files {
            let text = text.replace("\"go1\"", "\"pony\"").replace("5.561079999999999", "5.4");
            program.write(&format!("robot/{name}"), &text);
        }
        program.write("config/control.toml", "[tasks.forward]\nrepeats = 2\n");
        program.write("config/optimize.toml", "objective = \"estimate\"\n");
        let arguments = ["optimize", "--trials", "3", "--record", "all", "--config", "config", "--model", "robot"];
        program.text(&arguments);
        // The recording alone is judged.
        fs::remove_dir_all(program.path("robot")).unwrap();
        let study = program.study("recordings");
        (program, study)
    })
}

fn rejudged(config: &str) -> Vec<Value> {
    let (program, study) = recorded();
    program.trials(&["rejudge", study.to_str().unwrap(), "--config", config, "--json"])
}

/// Writes a configuration.
fn config(name: &str, control: &str, optimize: &str) {
    let (program, _) = recorded();
    program.write(&format!("{name}/control.toml"), control);
    program.write(&format!("{name}/optimize.toml"), optimize);
}

fn timeline() -> Timeline {
    Timeline::open(&[recorded().1.join("session.mcap")]).unwrap()
}

/// The ticks of each rollout of a trial.
fn rollouts(trial: u32) -> Vec<Vec<Tick>> {
    let mut rollouts: Vec<Vec<Tick>> = Vec::new();
    for played in timeline() {
        let Played::Tick(tick) = played else { continue };
        if tick.trial != Some(trial) {
            continue;
        }
        match rollouts.last_mut().filter(|ticks| ticks.last().unwrap().trial_time_s < tick.trial_time_s) {
            Some(ticks) => ticks.push(*tick),
            None => rollouts.push(vec![*tick]),
        }
    }
    rollouts
}

#[test]
fn the_same_configuration_gives_the_same_judgement_of_every_trial() {
    let (program, study) = recorded();
    let before = fs::read(study.join("session.mcap")).unwrap();
    let rows = rejudged(study.join("config").to_str().unwrap());
    assert_eq!(rows.len(), 3);
    for row in &rows {
        assert_same(&row["new"], &row["old"], "");
        assert_shows(row["old"]["cause"].as_str().unwrap(), &["mean of 2 repeats"]);
        assert!(row["old"]["value"].is_f64());
        assert_eq!(row["estimate"], Value::Null, "nothing is recomputed");
    }
    let text = program.text(&["rejudge", study.to_str().unwrap(), "--config", "config"]);
    assert_shows(&text, &["0 of 3 suggestions change"]);
    assert_eq!(fs::read(study.join("session.mcap")).unwrap(), before, "the file is not changed");
}

#[test]
fn another_objective_is_the_mean_of_the_rollouts_by_an_independent_computation() {
    config("rate", "[tasks.forward]\nrepeats = 2\nrate = true\n", "objective = \"estimate\"\n");
    let rows = timeline().rows();
    for row in rejudged("rate") {
        let repeats = &rows[&(row["trial"].as_u64().unwrap() as u32)].repeats;
        assert_eq!(repeats.len(), 2);
        let values = repeats.iter().map(|repeat| {
            let measured = repeat.measured.as_ref().unwrap();
            let time_s = measured.touchdown.map_or(measured.end_s, |touchdown| touchdown.time_s);
            if repeat.verdict == Some(Verdict::Fall) { 0.0 } else { measured.dx_m / time_s }
        });
        let mean = values.sum::<f64>() / 2.0;
        assert!((row["new"]["value"].as_f64().unwrap() - mean).abs() <= PRECISION, "{row}");
        assert_eq!(row["new"]["verdict"], row["old"]["verdict"]);
    }
}

#[test]
fn a_recomputed_estimate_repeats_that_of_the_controller() {
    // With sensors this force is not used: the estimate is recomputed and must come out the same.
    config("force", "[contact]\nforce_n = 2.0\n[tasks.forward]\nrepeats = 2\n", "objective = \"estimate\"\n");
    for row in rejudged("force") {
        assert!(row["estimate"]["distance_m"].as_f64().unwrap() <= PRECISION, "{row}");
        assert_same(&row["estimate"]["new_error_m"], &row["estimate"]["old_error_m"], "error");
        assert_same(&row["new"], &row["old"], "");
    }
}

#[test]
fn the_true_state_as_estimate_gives_the_true_displacement() {
    config("truth", "[tasks.forward]\nrepeats = 2\n", "objective = \"truth\"\n");
    let rows = rejudged("truth");
    for row in &rows {
        let trial = row["trial"].as_u64().unwrap() as u32;
        let rollouts = rollouts(trial);
        let verdicts: Vec<_> = timeline().rows()[&trial].repeats.iter().map(|repeat| repeat.verdict).collect();
        let errors = rollouts.iter().map(|ticks| {
            let (first, last) = (&ticks[0], ticks.last().unwrap());
            let moved = |position: fn(&Tick) -> nalgebra::Vector3<f64>| position(last) - position(first);
            (moved(|tick| tick.estimate.position_world) - moved(|tick| tick.state.truth.unwrap().position_world)).norm()
        });
        let largest_m = errors.fold(0.0, f64::max);
        assert!((row["estimate"]["old_error_m"].as_f64().unwrap() - largest_m).abs() < 1e-12, "{row}");
        assert_eq!(row["estimate"]["new_error_m"], 0.0, "{row}");
        if verdicts != [Some(Verdict::Accept); 2] {
            continue;
        }
        let dx_m = rollouts.iter().map(|ticks| {
            let truth = |tick: &Tick| tick.state.truth.unwrap();
            let start = truth(ticks.iter().find(|tick| tick.trial_time_s >= 0.0).unwrap());
            let moved = truth(ticks.last().unwrap()).position_world - start.position_world;
            let yaw = start.world_from_body.euler_angles().2;
            moved.x * yaw.cos() + moved.y * yaw.sin()
        });
        let mean = dx_m.sum::<f64>() / 2.0;
        assert!((row["new"]["value"].as_f64().unwrap() - mean).abs() < 1e-9, "{row}");
        assert_ne!(row["new"]["value"], row["old"]["value"]);
    }
}

#[test]
fn another_estimator_changes_estimate_and_value_and_is_shown_in_the_table() {
    let (program, study) = recorded();
    let control = "[estimator]\nfoot_velocity_m_s = 0.3\nfoot_creep = 0.01\n[tasks.forward]\nrepeats = 2\n";
    config("loose", control, "objective = \"estimate\"\n");
    let rows = rejudged("loose");
    for row in &rows {
        let distance_m = row["estimate"]["distance_m"].as_f64().unwrap();
        assert!(distance_m > 1e-5 && distance_m < 0.5, "{row}");
        assert_ne!(row["estimate"]["old_error_m"], row["estimate"]["new_error_m"], "{row}");
    }
    assert!(rows.iter().any(|row| row["old"]["value"] != row["new"]["value"]));
    let text = program.text(&["rejudge", study.to_str().unwrap(), "--config", "loose"]);
    assert_shows(&text, &["trial 0: the estimate is recomputed, at most 0.", "error at the end 0.", ", now 0."]);
}
