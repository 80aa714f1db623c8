//! `quadfrog rejudge` on a file that the program itself wrote.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;

use crate::precision::{PRECISION, assert_same};
use crate::program::{Program, assert_shows};
use crate::verify::{PARTS, copied};
use quadfrog::recording::player::{Played, Player};
use quadfrog::telemetry::Tick;
use serde_json::Value;

/// A study of six trials, every tick recorded; the fifth falls.
fn recorded() -> &'static (Program, PathBuf) {
    static STUDY: OnceLock<(Program, PathBuf)> = OnceLock::new();
    STUDY.get_or_init(|| {
        let program = Program::new();
        program.text(&["optimize", "--trials", "6", "--seed", "0", "--record", "all"]);
        let study = program.study("recordings");
        (program, study)
    })
}

fn rejudged(config: &str) -> Vec<Value> {
    let (program, study) = recorded();
    program.trials(&["rejudge", study.to_str().unwrap(), "--config", config, "--json"])
}

/// The ticks of each trial.
fn ticks() -> BTreeMap<u32, Vec<Tick>> {
    let mut trials: BTreeMap<u32, Vec<Tick>> = BTreeMap::new();
    for played in Player::open(recorded().1.join("session.mcap")).unwrap() {
        if let Played::Tick(tick) = played
            && let Some(trial) = tick.trial
        {
            trials.entry(trial).or_default().push(*tick);
        }
    }
    trials
}

/// Regression: a Go2 was judged with the Go1's threshold of a contact and limits, without a word, and its estimate was recomputed.
#[test]
fn a_built_in_robot_is_judged_again_with_its_own_configuration() {
    let program = Program::new();
    program.text(&["optimize", "--model", "go2", "--trials", "1", "--seed", "0", "--record", "all"]);
    program.write("mine/safety.toml", "[fall]\nroll_rad = 0.9\n");
    let study = program.study("recordings");
    let rejudge = ["rejudge", study.to_str().unwrap()];
    for more in [&[][..], &["--config", "mine"]] {
        let text = program.text(&[&rejudge[..], more].concat());
        assert_shows(&text, &["+0.0000", "0 of 1 suggestions change"]);
        assert!(!text.contains("recomputed"), "{more:?}: {text}");
    }
}

#[test]
fn the_same_configuration_gives_the_same_judgement_and_leaves_the_file() {
    let (program, study) = recorded();
    let before = fs::read(study.join("session.mcap")).unwrap();
    let rows = rejudged(study.join("config").to_str().unwrap());
    assert_eq!(rows.len(), 6);
    assert!(
        rows.iter().any(|row| row["old"]["verdict"] == "fall")
            && rows.iter().any(|row| row["old"]["verdict"] == "accept")
    );
    for row in &rows {
        assert_same(&row["new"], &row["old"], "");
        assert!(row["old"]["value"].is_f64());
        assert_eq!(row["difference"], 0.0);
        assert_eq!(row["verdict"], row["old"]["verdict"], "a study without an operator takes the suggestions");
    }
    let table = program.text(&["rejudge", study.to_str().unwrap(), "--config", study.join("config").to_str().unwrap()]);
    assert_shows(&table, &["old J", "new J", "difference", "0 of 6 suggestions change"]);
    assert_eq!(fs::read(study.join("session.mcap")).unwrap(), before, "the file is not changed");
}

#[test]
fn another_objective_gives_the_values_of_an_independent_computation() {
    let (program, _) = recorded();
    program.write("rate/control.toml", "[tasks.forward]\nrate = true\n");
    let rows = rejudged("rate");
    for row in &rows {
        // Displacement by the time from the first impulse to the first touchdown after the last one, from the file's own row.
        let measured = &row["old"]["measured"];
        let time_s = measured["touchdown"]["time_s"].as_f64().or(measured["end_s"].as_f64()).unwrap();
        let expected = measured["dx_m"].as_f64().unwrap() / time_s;
        assert!((row["new"]["value"].as_f64().unwrap() - expected).abs() <= PRECISION, "{row}");
        assert!(row["difference"].as_f64().unwrap().abs() > 0.01, "{row}");
        assert_eq!(row["new"]["verdict"], row["old"]["verdict"]);
    }
}

#[test]
fn another_limit_of_a_fall_ends_the_trial_where_an_independent_computation_does() {
    let (program, _) = recorded();
    let limit = 0.2;
    program.write("strict/safety.toml", &format!("[fall]\nroll_rad = {limit}\npitch_rad = {limit}\n"));
    let (rows, ticks) = (rejudged("strict"), ticks());
    let mut falls = 0;
    for row in &rows {
        let ticks = &ticks[&(row["trial"].as_u64().unwrap() as u32)];
        let tilted = |tick: &Tick| {
            let [roll, pitch, _] = tick.estimate.roll_pitch_yaw.into();
            roll.abs() > limit || pitch.abs() > limit
        };
        let Some(end) = ticks.iter().position(tilted) else {
            assert_same(&row["new"], &row["old"], "");
            continue;
        };
        falls += 1;
        assert_eq!(row["new"]["verdict"], "fall", "{row}");
        assert_shows(row["new"]["cause"].as_str().unwrap(), &["exceeds 0.2"]);
        // x in the frame of the start.
        let (start, last) = (ticks.iter().find(|tick| tick.trial_time_s >= 0.0).unwrap(), &ticks[end]);
        let moved = last.estimate.position_world - start.estimate.position_world;
        let yaw = start.estimate.roll_pitch_yaw.z;
        let dx_m = moved.x * yaw.cos() + moved.y * yaw.sin();
        assert!((row["new"]["value"].as_f64().unwrap() - dx_m).abs() <= PRECISION, "{row}");
    }
    assert!(falls >= 2, "{falls} of {} tilt by more than {limit} rad", rows.len());
}

#[test]
fn a_trial_that_fell_and_would_not_fall_has_no_verdict() {
    let (program, _) = recorded();
    let wide = "[fall]\nroll_rad = 1.4\npitch_rad = 1.4\nbody_contact_s = 5.0\nsimulator_flight_rad = 1.4\n";
    program.write("wide/safety.toml", &format!("{wide}[watchdog]\ntilt_rad = 1.5\n"));
    let rows = rejudged("wide");
    let fell: Vec<_> = rows.iter().filter(|row| row["old"]["verdict"] == "fall").collect();
    assert!(!fell.is_empty());
    for row in fell {
        assert_eq!(row["new"]["verdict"], Value::Null, "{row}");
        assert_shows(row["new"]["cause"].as_str().unwrap(), &["the recording ends where it fell before"]);
    }
}

/// Regression: a judgement that the recording does not show was counted as a changed one.
#[test]
fn a_suggestion_that_is_not_known_is_no_change() {
    let (program, study) = recorded();
    let no_end = |tick: Tick| (tick.trial != Some(2) || tick.trial_time_s <= 0.3).then_some(tick);
    copied(&study.join("session.mcap"), program.path("one-without-end.mcap"), &PARTS, no_end);
    let table = program.text(&["rejudge", "one-without-end.mcap"]);
    assert_shows(&table, &["0 of 6 suggestions change; 1 not known; verdicts are those in force"]);
}

/// Regression: damaged files of the robot were replaced by the built-in robot of its name, without a word.
#[test]
fn a_recording_whose_robot_is_damaged_is_not_judged_by_another_one() {
    let (program, study) = recorded();
    let mut bytes = fs::read(study.join("session.mcap")).unwrap();
    let urdf = b"<robot name=";
    let at = bytes.windows(urdf.len()).position(|bytes| bytes == urdf).expect("the attached description");
    bytes[at + 200] ^= 1;
    fs::write(program.path("damaged.mcap"), bytes).unwrap();
    let refused = program.refused(&["rejudge", "damaged.mcap"]);
    assert_shows(&refused, &["damaged.mcap: not judged again: its robot cannot be read", "Attachment CRC failed"]);
}

/// Regression: from the ticks of a part of a trial a value and a verdict were computed, without a word.
#[test]
fn a_trial_without_its_end_or_its_begin_has_no_new_judgement() {
    let (program, study) = recorded();
    for (name, kept_s, cause) in [
        ("no-end.mcap", 0.0..=0.3, "its end is not recorded"),
        ("no-begin.mcap", 0.3..=f64::MAX, "its begin is not recorded"),
    ] {
        let change = |tick: Tick| (tick.trial != Some(2) || kept_s.contains(&tick.trial_time_s)).then_some(tick);
        copied(&study.join("session.mcap"), program.path(name), &PARTS, change);
        let rows = program.trials(&["rejudge", name, "--json"]);
        for (row, whole) in rows.iter().zip(rejudged(study.join("config").to_str().unwrap())) {
            if row["trial"] == 2 {
                assert_eq!(row["new"]["verdict"], Value::Null, "{row}");
                assert_eq!((&row["new"]["value"], &row["difference"]), (&Value::Null, &Value::Null));
                assert_eq!(row["new"]["cause"], cause);
            } else {
                assert_same(&row["new"], &whole["new"], "");
            }
        }
        assert_eq!(rows.len(), 6);
    }
}

/// Regression: a damaged configuration, which is compared alone, ended the judgement.
#[test]
fn a_recording_whose_configuration_is_damaged_is_judged_with_a_new_estimate() {
    let (program, study) = recorded();
    let mut bytes = fs::read(study.join("session.mcap")).unwrap();
    let at = bytes.windows(12).position(|bytes| bytes == b"control.toml").expect("an attachment");
    bytes[at + 100] ^= 1;
    fs::write(program.path("configuration.mcap"), bytes).unwrap();
    assert_shows(&program.text(&["rejudge", "configuration.mcap"]), &["trial 5: the estimate is recomputed"]);
}
