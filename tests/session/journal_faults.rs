//! Journals that a program left in the middle of an append, or that another program changed under the session.

use std::fs;
use std::path::Path;
use std::time::Duration;

use crate::support::{accept, approve, joined, open, run, study_in};
use quadfrog::optimize::trial::TrialState;
use quadfrog::session::experiment::Experiment;
use quadfrog::telemetry::TrialEnd;
use quadfrog::trial::{ExperimentStage, Verdict};

/// Trials of the study below that count.
const COUNTED: u32 = 4;

/// Appends a line of another program.
fn append(folder: &Path, line: &str) {
    let journal = folder.join("study.log");
    let text = fs::read_to_string(&journal).unwrap();
    fs::write(&journal, format!("{text}{line}\n")).unwrap();
}

/// Continues the study in `folder` to its end. Returns point, value and seed of each complete trial.
fn completed(folder: &Path, mut experiment: Experiment) -> Vec<String> {
    if experiment.stage() == ExperimentStage::Review {
        experiment.judge(Verdict::Accept, false).unwrap();
    }
    while experiment.counted() < COUNTED {
        accept(&mut experiment);
    }
    experiment.close().unwrap();
    let study = study_in(folder);
    let complete = study.trials().iter().filter(|trial| trial.state == TrialState::Complete);
    let result = complete.map(|trial| {
        let point = ["f0", "Fx", "Fz"].map(|name| trial.parameter(name).unwrap());
        format!("{point:?} {:?} {}", trial.value, trial.user_attributes["seed"])
    });
    result.collect()
}

/// Regression: a trial whose lines were cut off after the first one belonged to no session. `--resume` waited a minute for it and then
/// ran other trials than an unbroken study, and a judgement without its measured values ended every `optimize --resume`.
#[test]
fn a_study_that_was_cut_off_at_any_line_continues_as_an_unbroken_one() {
    let begin = || {
        let folder = tempfile::tempdir().unwrap();
        let mut experiment = open(folder.path());
        accept(&mut experiment);
        study_in(folder.path()).enqueue(&[("Fx".to_owned(), 77.0)], &[]).unwrap();
        experiment.refresh().unwrap();
        (folder, experiment)
    };
    let (folder, experiment) = begin();
    let unbroken = completed(folder.path(), experiment);
    let (folder, mut experiment) = begin();
    let journal = folder.path().join("study.log");
    let queued = fs::read_to_string(&journal).unwrap().lines().count();
    accept(&mut experiment);
    approve(&mut experiment);
    drop(experiment);
    // The interrupted trial is closed and queued again.
    assert_eq!(completed(folder.path(), open(folder.path())), unbroken);
    let whole = fs::read_to_string(&journal).unwrap();
    let lines: Vec<&str> = whole.split_inclusive('\n').collect();
    for kept in queued..lines.len() {
        let half = &lines[kept][..lines[kept].len() / 2];
        fs::write(&journal, lines[..kept].concat() + half).unwrap();
        let continued = completed(folder.path(), open(folder.path()));
        assert_eq!(continued, unbroken, "cut off after line {kept}, {}", lines[kept - 1]);
    }
}

/// Regression: a verdict on a study that another program had deleted was confirmed and lost, and a queued point began and ran without a
/// line in the journal.
#[test]
fn a_deleted_study_begins_no_trial_and_takes_no_verdict() {
    for queued in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let mut experiment = open(folder.path());
        let delete = || append(folder.path(), r#"{"op_code":1,"worker_id":"py","study_id":0}"#);
        if queued {
            study_in(folder.path()).enqueue(&[("Fx".to_owned(), 77.0)], &[]).unwrap();
            experiment.refresh().unwrap();
            delete();
            let seen = experiment.proposal().unwrap();
            let error = experiment.approve(seen.trial, seen.revision).unwrap_err().to_string();
            assert!(error.contains("`test` is no longer in the journal"), "{error}");
            assert_eq!(experiment.stage(), ExperimentStage::Proposed);
        } else {
            run(&mut experiment, TrialEnd::Settled);
            delete();
            let error = experiment.judge(Verdict::Accept, false).unwrap_err().to_string();
            assert!(error.contains("`test` is no longer in the journal"), "{error}");
            assert_eq!(experiment.stage(), ExperimentStage::Review);
        }
    }
}

/// Regression: of a trial of another program attributes alone were news. One that ran for longer than `abandoned_s` and reported
/// intermediate values counted as abandoned, and the budget was exceeded.
#[test]
fn a_trial_that_reports_intermediate_values_is_not_abandoned() {
    let folder = tempfile::tempdir().unwrap();
    drop(open(folder.path()));
    append(
        folder.path(),
        r#"{"op_code":4,"worker_id":"py","study_id":0,"datetime_start":"2026-01-01T00:00:00.000000+00:00"}"#,
    );
    let mut experiment = joined(folder.path(), 5, Duration::from_secs(1));
    for step in 0..6 {
        let report =
            format!(r#"{{"op_code":7,"worker_id":"py","trial_id":0,"step":{step},"intermediate_value":0.{step}}}"#);
        append(folder.path(), &report);
        experiment.refresh().unwrap();
        assert!(experiment.others_run(), "after report {step}");
        std::thread::sleep(Duration::from_millis(300));
    }
    std::thread::sleep(Duration::from_millis(900));
    experiment.refresh().unwrap();
    assert!(!experiment.others_run(), "without news it is abandoned");
}
