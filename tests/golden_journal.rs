//! A journal written by Optuna 5.0.0, compared with the contents that Optuna itself reports. `QUADFROG_GOLDEN` selects
//! another folder of golden data.

mod support;

use quadfrog::optimize::ask::{Ask, Direction, SamplerConfig, Streams};
use quadfrog::optimize::journal::{Durability, Journal, JournalFile, JournalLine, LOCK_GRACE, Operation};
use quadfrog::optimize::sampler::propose;
use quadfrog::optimize::space::Space;
use quadfrog::optimize::trial::{Distribution, Trial, TrialState};
use serde_json::{Map, Value, json};
use std::path::PathBuf;
use support::{golden_folder, golden_tpe_file};

fn golden(name: &str) -> PathBuf {
    golden_tpe_file(name).unwrap_or_else(|| panic!("no {name} in {}", golden_folder().display()))
}

/// A trial in the shape of the expected file.
fn as_expected(trial: &Trial) -> Value {
    let map = |members: Vec<(String, Value)>| Value::Object(Map::from_iter(members));
    json!({
        "number": trial.number,
        "state": <&str>::from(trial.state),
        "value": trial.value,
        "params": map(trial.parameters.iter().map(|(n, v)| (n.clone(), Value::from(*v))).collect()),
        "user_attrs": trial.user_attributes,
        "system_attrs": trial.system_attributes,
        "intermediate_values": map(trial.intermediate.iter().map(|(s, v)| (s.to_string(), Value::from(*v))).collect()),
    })
}

#[test]
fn golden_journal() {
    let expected: Value =
        serde_json::from_str(&std::fs::read_to_string(golden("journal_expected.json")).unwrap()).unwrap();
    let log = golden("journal.log");
    let journal = Journal::open(JournalFile::new(&log, Durability::Synced, LOCK_GRACE).unwrap()).unwrap();
    let name = expected["study_name"].as_str().unwrap();
    let study = &journal.state().studies()[journal.state().find(name).expect("the study is in the journal")];
    let mut compared = 0;
    let mut same = |what: String, ours: Value, theirs: &Value| {
        assert_eq!(&ours, theirs, "{what}");
        compared += 1;
    };
    let direction = if expected["direction"] == "maximize" { Direction::Maximize } else { Direction::Minimize };
    same("directions".into(), json!(study.directions), &json!([direction as u64]));
    same("study attributes".into(), json!(study.user_attributes), &expected["user_attrs"]);
    same("study system attributes".into(), json!(study.system_attributes), &expected["system_attrs"]);
    let theirs = expected["trials"].as_array().unwrap();
    same("number of trials".into(), json!(study.trials.len()), &json!(theirs.len()));
    for (trial, theirs) in study.trials.iter().zip(theirs) {
        let ours = as_expected(trial);
        for (field, theirs) in theirs.as_object().unwrap() {
            same(format!("{field} of trial {}", trial.number), ours[field].clone(), theirs);
        }
    }
    let largest = suggested_again(&study.trials, &expected, direction, &mut compared);
    println!("golden_journal: {compared} cases compared, largest difference {largest:.1e} of the range");
}

/// Recomputes the suggestions of the journal from its seed.
fn suggested_again(trials: &[Trial], expected: &Value, direction: Direction, compared: &mut usize) -> f64 {
    let (Some(seed), Some(multivariate)) = (expected["seed"].as_u64(), expected["multivariate"].as_bool()) else {
        return 0.0;
    };
    let config = SamplerConfig { seed: seed as u32, multivariate, ..SamplerConfig::default() };
    let mut streams = Streams::new(config.seed);
    let mut largest = 0.0_f64;
    for (i, trial) in trials.iter().enumerate().filter(|(_, t)| t.state != TrialState::Waiting) {
        let range = |d: &Distribution| d.range().expect("the golden journal has floats only");
        let names = trial.parameters.iter().map(|(n, _)| n.clone());
        let space = Space::new(names.zip(trial.distributions.iter().map(range))).unwrap();
        let fixed = trial.fixed();
        let ask = Ask { config: &config, trials: &trials[..i], space: &space, fixed: &fixed, direction, prior: None };
        let candidate = propose(&ask, &mut streams);
        for (p, value) in space.parameters().iter().zip(candidate.values) {
            let theirs = trial.parameter(&p.name).unwrap();
            let difference = (value - theirs).abs() / (p.range.high - p.range.low);
            assert!(difference <= 1e-10, "trial {i} {}: ours {value}, Optuna's {theirs}", p.name);
            largest = largest.max(difference);
            *compared += 1;
        }
    }
    largest
}

#[test]
fn lines_are_written_as_they_were_read() {
    let text = std::fs::read_to_string(golden("journal.log")).unwrap();
    for line in text.lines() {
        let JournalLine { worker, operation, times } = Operation::parse(line).unwrap();
        let ours = operation.to_line(&worker, times);
        let JournalLine { worker: again, operation: reread, .. } = Operation::parse(ours.trim_end()).unwrap();
        assert_eq!((again, reread), (worker, operation), "{line}");
        // And equal member by member to the line of Python.
        let value = |text: &str| serde_json::from_str::<Value>(text).unwrap();
        assert_eq!(value(&ours), value(line));
    }
}
