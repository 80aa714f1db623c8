//! Changes of the queue that are refused, and points that another program has queued.

use crate::support;
use std::path::Path;

use quadfrog::recording::record::Record;
use quadfrog::session::experiment::Experiment;
use quadfrog::telemetry::TrialEnd;
use quadfrog::trial::{ProposalSource, Verdict};
use support::{accept, approve, open, run, study_in, ticks};

/// Runs the proposal to a jump of `value` m that is accepted. Returns its number.
fn jump(experiment: &mut Experiment, value: f64) -> u32 {
    let spec = approve(experiment);
    experiment.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, value), 2);
    experiment.judge(Verdict::Accept, false).unwrap();
    spec.trial
}

/// Returns number and parent of the trials that repeat another one.
fn repeats(folder: &Path) -> Vec<(u32, Option<u64>)> {
    let trials = study_in(folder);
    let parent = |name: &str, trial: &quadfrog::optimize::trial::Trial| trial.user_attributes.get(name)?.as_u64();
    trials.trials().iter().map(|trial| (trial.number, parent("parent", trial))).filter(|(_, of)| of.is_some()).collect()
}

/// Regression: a refused change of the queue made the last verdict final and queued its re-run, and left the open proposal as if
/// it had not: the next approval was refused, and the operator's values were dropped.
#[test]
fn a_refused_change_of_the_queue_leaves_the_verdict_and_the_changed_re_run_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    accept(&mut experiment);
    let voided = run(&mut experiment, TrialEnd::Stopped).trial;
    experiment.judge(Verdict::Void, true).unwrap();
    experiment.set_parameter("Fx", 61.0).unwrap();
    let proposal = experiment.proposal().unwrap();
    let refused = [
        experiment.move_queued(proposal.trial, true).err(),
        experiment.move_queued(proposal.trial, false).err(),
        experiment.move_queued(9, true).err(),
        experiment.remove_queued(9).err(),
    ];
    for (refusal, reason) in refused.into_iter().zip(["first", "last", "not in the queue", "not in the queue"]) {
        let text = refusal.expect("a refusal").to_string();
        assert!(text.contains(reason), "{text}");
    }
    assert_eq!(experiment.undoable(), Some(voided));
    experiment.refresh().unwrap();
    let spec = approve(&mut experiment);
    assert_eq!((spec.trial, spec.jump.fx_n), (proposal.trial, 61.0));
    assert_eq!(repeats(folder.path()), [(proposal.trial, Some(u64::from(voided)))]);
}

/// Regression: after a refused change of the queue the re-run of a repeat of the best was queued twice, and the robot jumped it
/// twice.
#[test]
fn a_refused_change_of_the_queue_doubles_no_repeat_of_the_best() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    for value in [0.9, 0.5, 0.3] {
        jump(&mut experiment, value);
    }
    experiment.confirm_best(12).unwrap();
    let voided = run(&mut experiment, TrialEnd::Stopped).trial;
    experiment.judge(Verdict::Void, true).unwrap();
    let rerun = experiment.proposal().unwrap().trial;
    let refusal = experiment.move_queued(rerun, true).unwrap_err().to_string();
    assert!(refusal.contains("confirms the best"), "{refusal}");
    assert_eq!(experiment.undoable(), Some(voided));
    assert_eq!(jump(&mut experiment, 0.9), rerun);
    experiment.close().unwrap();
    let of_voided: Vec<u32> =
        repeats(folder.path()).into_iter().filter(|(_, of)| *of == Some(u64::from(voided))).map(|(n, _)| n).collect();
    assert_eq!(of_voided, [rerun]);
    assert_eq!(experiment.proposal().unwrap().source, ProposalSource::Confirm);
    assert_eq!(study_in(folder.path()).waiting().count(), 0, "the next repeat is queued with its approval");
}

/// Appends a point that another program has queued, with these parameters as JSON of Python.
fn queue_elsewhere(folder: &Path, parameters: &str) {
    let path = folder.join("study.log");
    let text = std::fs::read_to_string(&path).unwrap();
    let line = format!(
        r#"{{"op_code":4,"worker_id":"py","study_id":0,"datetime_start":null,"state":4,"value":null,"values":null,"distributions":{{}},"params":{{}},"user_attrs":{{}},"system_attrs":{{"fixed_params":{parameters}}},"intermediate_values":{{}}}}"#
    );
    std::fs::write(&path, text + &line + "\n").unwrap();
}

/// Regression: a queued NaN, which is not equal to itself, could be neither begun nor skipped nor removed: a study without a person
/// never ended.
#[test]
fn a_queued_value_that_is_no_number_is_proposed_by_the_sampler() {
    for approved in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let mut experiment = open(folder.path());
        accept(&mut experiment);
        experiment.close().unwrap();
        queue_elsewhere(folder.path(), r#"{"f0":NaN,"Fx":61.0,"Fz":Infinity}"#);
        experiment.refresh().unwrap();
        let proposal = experiment.proposal().unwrap();
        assert_eq!((proposal.trial, proposal.source), (1, ProposalSource::Queued));
        assert_eq!(experiment.refusal(), None);
        let revision = proposal.revision;
        experiment.refresh().unwrap();
        assert_eq!(experiment.proposal().unwrap().revision, revision, "the point has not changed");
        let told = experiment.take_records().into_iter().any(|record| match record {
            Record::Log(log) => log.message.contains("trial 1 was queued with f0 = NaN, Fz = Infinity"),
            _ => false,
        });
        assert!(told, "the operator sees that the values were not used");
        match approved {
            true => {
                let spec = accept(&mut experiment);
                assert_eq!((spec.trial, spec.jump.fx_n), (1, 61.0));
                assert!(spec.jump.f0_hz.is_finite() && spec.jump.fz_n.is_finite(), "{spec:?}");
            }
            false => experiment.skip(proposal.trial, revision).unwrap(),
        }
        assert_eq!(experiment.proposal().unwrap().trial, 2);
    }
}
