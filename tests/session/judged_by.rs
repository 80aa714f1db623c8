//! The origin of a verdict: the operator, or a rule of the program.

use crate::support;
use std::path::Path;

use quadfrog::optimize::study::Outcome;
use quadfrog::session::experiment::Experiment;
use quadfrog::telemetry::TrialEnd;
use quadfrog::trial::{JudgedBy, Verdict};
use serde_json::Value;
use support::{accept, approve, open, run, skip, study_in};

const OPERATOR: Option<JudgedBy> = Some(JudgedBy::Operator);
const RULE: Option<JudgedBy> = Some(JudgedBy::Rule);

fn origin(experiment: &Experiment, trial: u32) -> Option<JudgedBy> {
    experiment.row(trial).expect("the trial").judged_by
}

/// The attribute of the trial in the journal; none where the journal has no such attribute.
fn written(folder: &Path, trial: u32) -> Option<Value> {
    study_in(folder).trial(trial).unwrap().user_attributes.get("judged_by").cloned()
}

#[test]
fn the_origin_of_a_verdict_is_in_the_journal_and_in_later_sessions() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let by_operator = accept(&mut session).trial;
    assert_eq!(origin(&session, by_operator), OPERATOR);
    let by_rule = run(&mut session, TrialEnd::Settled).trial;
    assert_eq!(written(folder.path(), by_rule), None);
    session.judge_by_rule(Verdict::Accept).unwrap();
    assert_eq!(origin(&session, by_rule), RULE);
    assert_eq!(written(folder.path(), by_rule), Some("rule".into()), "on disk when it is shown");
    let given = run(&mut session, TrialEnd::Settled).trial;
    session.void_because("the mat slid", false).unwrap();
    let refused = session.proposal().unwrap().trial;
    skip(&mut session);
    session.close().unwrap();
    drop(session);

    let session = open(folder.path());
    let trials = [by_operator, by_rule, given, refused];
    assert_eq!(trials.map(|trial| origin(&session, trial)), [OPERATOR, RULE, OPERATOR, None]);
    assert_eq!(written(folder.path(), refused), Some(Value::Null), "a refused proposal has no verdict");
}

#[test]
fn undo_takes_the_origin_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let trial = run(&mut session, TrialEnd::Settled).trial;
    session.judge_by_rule(Verdict::Accept).unwrap();
    session.undo().unwrap();
    assert_eq!((origin(&session, trial), written(folder.path(), trial)), (None, Some(Value::Null)));
    session.judge(Verdict::Fall, false).unwrap();
    assert_eq!((origin(&session, trial), written(folder.path(), trial)), (OPERATOR, Some("operator".into())));
}

#[test]
fn a_changed_verdict_is_the_operators() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let trial = run(&mut session, TrialEnd::Settled).trial;
    session.judge_by_rule(Verdict::Accept).unwrap();
    accept(&mut session);
    session.change_verdict(trial, Verdict::Fall, "it lay on its back").unwrap();
    assert_eq!(origin(&session, trial), OPERATOR);
    drop(session);
    assert_eq!(origin(&open(folder.path()), trial), OPERATOR);
}

#[test]
fn the_end_of_a_session_and_a_crash_judge_by_rule() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let stopped = run(&mut session, TrialEnd::Stopped).trial;
    session.close_unreviewed().unwrap();
    assert_eq!(origin(&session, stopped), RULE);
    drop(session);
    let mut session = open(folder.path());
    assert_eq!(origin(&session, stopped), RULE);
    let running = approve(&mut session).trial;
    drop(session);
    let mut session = open(folder.path());
    let row = session.row(running).unwrap();
    assert_eq!((row.verdict, row.judged_by), (Some(Verdict::Void), RULE));
    // Approved, and refused by the robot.
    let withdrawn = approve(&mut session).trial;
    session.withdraw(withdrawn, "not run: STOP was pressed after it").unwrap();
    assert_eq!((origin(&session, withdrawn), written(folder.path(), withdrawn)), (None, Some(Value::Null)));
}

/// A journal of an earlier version, and a trial of another program, have no origin.
#[test]
fn a_verdict_without_the_attribute_has_no_origin() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let trial = accept(&mut session).trial;
    session.close().unwrap();
    drop(session);
    let journal = folder.path().join("study.log");
    let text = std::fs::read_to_string(&journal).unwrap();
    let earlier: String =
        text.lines().filter(|line| !line.contains("judged_by")).map(|l| l.to_owned() + "\n").collect();
    assert!(earlier.len() < text.len());
    std::fs::write(&journal, earlier).unwrap();
    let mut study = study_in(folder.path());
    let draft = study.draft();
    let other = study.begin(&draft, &[], &[]).unwrap();
    study.annotate(other, &[("verdict".to_owned(), "accept".into())]).unwrap();
    study.tell(other, Outcome::Complete(0.5)).unwrap();
    drop(study);
    let session = open(folder.path());
    for number in [trial, other] {
        let row = session.row(number).unwrap();
        assert_eq!((row.verdict, row.judged_by), (Some(Verdict::Accept), None), "trial {number}");
    }
}
