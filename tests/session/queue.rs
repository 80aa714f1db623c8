//! Changes of the queue that are refused, and points that another program has queued.

use crate::support;
use std::path::Path;

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
