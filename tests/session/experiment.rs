//! The experiment through its public interface: requests of the operator, reports to the study, recovery after a crash.

use crate::support;
use std::time::Duration;

use quadfrog::config::Config;
use quadfrog::engine::{STUDY_FILE, open_stored};
use quadfrog::optimize::exchange::TableTrial;
use quadfrog::optimize::study::Storage;
use quadfrog::optimize::trial::{Trial, TrialState};
use quadfrog::recording::record::Record;
use quadfrog::session::experiment::{Experiment, import};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{FallCause, Fault, TrialEnd};
use quadfrog::trial::{ExperimentStage, Proposal, ProposalSource, TrialRecord, Verdict};
use support::{
    accept, approve, experiment, far, joined, open, parameters, plan, run, skip, study, study_in, ticks,
    without_journal,
};

const PATIENT: Duration = Duration::from_secs(3600);

#[test]
fn an_accepted_trial_counts_with_its_measured_value() {
    let mut experiment = experiment(5);
    let spec = accept(&mut experiment);
    let row = experiment.row(spec.trial).unwrap();
    assert_eq!(row.verdict, Some(Verdict::Accept));
    assert_eq!(row.value, Some(far(&spec)));
    assert_eq!(experiment.best().unwrap().trial, spec.trial);
}

#[test]
fn a_fall_counts_with_zero_and_is_never_the_best() {
    let mut experiment = experiment(5);
    let cause = FallCause::Roll { measured_rad: 1.2, allowed_rad: 1.0 };
    let spec = run(&mut experiment, TrialEnd::Fell(cause));
    assert_eq!(experiment.row(spec.trial).unwrap().suggested, Some(Verdict::Fall));
    assert!(experiment.row(spec.trial).unwrap().cause.contains("roll 1.20"));
    experiment.judge(Verdict::Fall, false).unwrap();
    assert_eq!(experiment.row(spec.trial).unwrap().value, Some(0.0));
    assert!(experiment.best().is_none());
    assert_eq!(experiment.counted(), 1);
}

#[test]
fn a_void_trial_does_not_count_and_a_rerun_repeats_its_parameters() {
    let mut experiment = experiment(5);
    let before = parameters(&experiment);
    let first = run(&mut experiment, TrialEnd::Stopped);
    experiment.judge(Verdict::Void, true).unwrap();
    assert_eq!(experiment.counted(), 0);
    let proposal = experiment.proposal().unwrap();
    assert_eq!((proposal.source, proposal.parent), (ProposalSource::Rerun, Some(first.trial)));
    assert_eq!(parameters(&experiment), before);
    let second = accept(&mut experiment);
    assert_eq!(second.jump, first.jump);
    assert_ne!(second.seed, first.seed, "a repetition has noise of its own");
}

#[test]
fn an_override_outside_the_bounds_is_refused_with_the_bounds() {
    let mut experiment = experiment(5);
    let error = experiment.set_parameter("Fx", 151.0).unwrap_err().to_string();
    assert!(error.contains("Fx = 151") && error.contains("0 to 150"), "{error}");
    let error = experiment.set_parameter("Fx", f64::NAN).unwrap_err().to_string();
    assert!(error.contains("outside its bounds"), "{error}");
    let error = experiment.set_parameter("Fw", 1.0).unwrap_err().to_string();
    assert!(error.contains("f0, Fx, Fz"), "{error}");
    assert!(parameters(&experiment)[1] != 151.0);
}

#[test]
fn an_override_runs_as_the_operators_and_keeps_what_was_proposed() {
    let mut experiment = experiment(5);
    let proposed = experiment.proposal().unwrap();
    experiment.set_parameter("Fx", 120.0).unwrap();
    let proposal = experiment.proposal().unwrap();
    assert_eq!(proposal.source, ProposalSource::Operator);
    assert_eq!(proposal.parameters[1].value, 120.0);
    assert_eq!(proposal.parameters[1].proposed, proposed.parameters[1].proposed);
    let spec = accept(&mut experiment);
    assert_eq!(spec.jump.fx_n, 120.0);
    assert_eq!(experiment.row(spec.trial).unwrap().source, ProposalSource::Operator);
}

#[test]
fn an_approval_of_an_earlier_card_is_refused() {
    let mut experiment = experiment(5);
    let seen = experiment.proposal().unwrap();
    experiment.set_parameter("Fx", 120.0).unwrap();
    let error = experiment.approve(seen.trial, seen.revision).unwrap_err().to_string();
    assert!(error.contains("has changed since it was shown"), "{error}");
    assert_eq!(experiment.stage(), ExperimentStage::Proposed);
}

/// Another program's point, proposed after the operator's question was shown, is not void by its answer.
#[test]
fn a_proposal_that_was_not_seen_is_not_skipped() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let seen = experiment.proposal().unwrap();
    study_in(folder.path()).enqueue(&[("Fx".to_owned(), 77.0)], &[]).unwrap();
    experiment.refresh().unwrap();
    let error = experiment.skip(seen.trial, seen.revision).unwrap_err().to_string();
    assert!(error.contains("has changed since it was shown"), "{error}");
    assert_eq!((experiment.stage(), experiment.rows().count()), (ExperimentStage::Proposed, 0));
    assert_eq!(parameters(&experiment)[1], 77.0);
    skip(&mut experiment);
    assert_eq!(experiment.row(0).unwrap().verdict, Some(Verdict::Void));
}

/// A skipped proposal is stored in one commit: at no time does it run.
#[test]
fn a_skipped_proposal_has_ended_when_it_begins() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    skip(&mut experiment);
    let text = std::fs::read_to_string(folder.path().join("study.log")).unwrap();
    let at = |part: &str| text.lines().position(|line| line.contains(part)).unwrap();
    let (verdict, end) = (at("\"verdict\""), at("\"op_code\":6,"));
    assert!(verdict < end, "the verdict stands before the end of the trial, which is final");
    let study = study_in(folder.path());
    assert_eq!(study.trial(0).unwrap().state, TrialState::Fail);
    let ended = |experiment: &Experiment| {
        let row = experiment.row(0).unwrap();
        (row.verdict, row.cause.clone())
    };
    assert_eq!(ended(&experiment), (Some(Verdict::Void), "skipped before the jump".to_owned()));
    assert_eq!(ended(&open(folder.path())), ended(&experiment));
}

#[test]
fn a_note_that_cannot_be_stored_is_not_shown() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    accept(&mut experiment);
    without_journal(folder.path(), || experiment.note(0, "left paw slipped")).unwrap_err();
    assert_eq!(experiment.row(0).unwrap().note, "");
    experiment.note(0, "left paw slipped").unwrap();
    assert_eq!(experiment.row(0).unwrap().note, "left paw slipped");
}

#[test]
fn a_verdict_can_be_undone_until_the_next_trial_begins() {
    let mut experiment = experiment(5);
    let spec = accept(&mut experiment);
    let after_accept = parameters(&experiment);
    experiment.undo().unwrap();
    assert_eq!(experiment.stage(), ExperimentStage::Review);
    assert_eq!(experiment.row(spec.trial).unwrap().verdict, None);
    experiment.judge(Verdict::Accept, false).unwrap();
    assert_eq!(parameters(&experiment), after_accept);
    accept(&mut experiment);
    experiment.undo().unwrap();
    experiment.judge(Verdict::Fall, false).unwrap();
    let proposal = experiment.proposal().unwrap();
    experiment.approve(proposal.trial, proposal.revision).unwrap();
    assert!(experiment.undo().is_err(), "the verdict was told when the next trial began");
}

/// Regression: the cause of the row that a cancelled countdown leaves did not say that the robot had not jumped.
#[test]
fn the_row_of_a_cancelled_countdown_says_that_the_robot_did_not_jump() {
    let mut experiment = experiment(5);
    let trial = approve(&mut experiment).trial;
    experiment.ended(trial, &TrialEnd::Cancelled, &[], 0);
    let row = experiment.row(trial).unwrap();
    assert_eq!(row.cause, "countdown cancelled, the robot did not jump");
    assert_eq!(row.suggested, Some(Verdict::Void));
    // Regression: a fall and a value by hand were taken for a jump that had not been.
    for refused in [
        experiment.judge(Verdict::Fall, false),
        experiment.judge(Verdict::Accept, false),
        experiment.set_hand_value(Some(0.5)),
    ] {
        assert!(refused.unwrap_err().to_string().contains("the robot did not jump"));
    }
    assert_eq!(experiment.stage(), ExperimentStage::Review);
    experiment.judge(Verdict::Void, true).unwrap();
    // The study has begun the trial at its approval: the re-run has another number.
    assert_eq!(experiment.proposal().map(|proposal| (proposal.trial, proposal.parent)), Some((trial + 1, Some(trial))));
}

/// Regression: a session that ended in the review made the measured jump void, and the value by hand was lost with it.
#[test]
fn a_measured_trial_waits_for_its_verdict_across_sessions() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    accept(&mut session);
    let spec = run(&mut session, TrialEnd::Settled);
    session.keep_measurement().unwrap();
    session.set_hand_value(Some(0.5)).unwrap();
    // The journal holds the gains in another order.
    let measured = |row: Option<&TrialRecord>| row.map(|row| TrialRecord { gains: Default::default(), ..row.clone() });
    let before = measured(session.row(spec.trial));
    session.close_unreviewed().and_then(|()| session.close()).unwrap();
    drop(session);

    let mut session = open(folder.path());
    assert_eq!(session.stage(), ExperimentStage::Review);
    assert_eq!(measured(session.under_review()), before, "measured, value by hand and suggestion as before");
    let records = session.take_records();
    let log = records.iter().find_map(|record| match record {
        Record::Log(line) if line.message.contains("had no verdict at the end of the last session") => {
            Some(&line.message)
        }
        _ => None,
    });
    assert!(log.is_some(), "the operator is shown why it waits");
    assert!(records.iter().any(|record| matches!(record, Record::Search(search) if search.counted == 1)));
    session.judge(Verdict::Accept, false).unwrap();
    session.undo().unwrap();
    drop(session);

    // Killed after the verdict was taken back.
    let mut session = open(folder.path());
    assert_eq!(measured(session.under_review()), before);
    session.judge(Verdict::Accept, false).unwrap();
    accept(&mut session);
    let values: Vec<_> = session.rows().map(|row| (row.verdict, row.hand_value)).collect();
    let accepted = Some(Verdict::Accept);
    assert_eq!(values, [(accepted, None), (accepted, Some(0.5)), (accepted, None)]);
}

/// A stopped trial is void and comes again, as its suggestion says.
#[test]
fn a_stopped_trial_does_not_wait_for_its_verdict_across_sessions() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let spec = run(&mut session, TrialEnd::Stopped);
    session.keep_measurement().unwrap();
    drop(session);
    let session = open(folder.path());
    assert_eq!(session.stage(), ExperimentStage::Proposed);
    assert_eq!(session.row(spec.trial).unwrap().verdict, Some(Verdict::Void));
    assert_eq!(session.proposal().unwrap().parent, Some(spec.trial));
}

/// Regression: the count of judged trials and the best kept the verdict that was taken back.
#[test]
fn an_undone_verdict_is_neither_counted_nor_the_best() {
    let mut experiment = experiment(5);
    let first = accept(&mut experiment);
    accept(&mut experiment);
    experiment.take_records();
    experiment.undo().unwrap();
    let records = experiment.take_records();
    let counted = records.iter().rev().find_map(|record| match record {
        Record::Search(search) => Some(search.counted),
        _ => None,
    });
    assert_eq!((counted, experiment.counted()), (Some(1), 1));
    assert_eq!(experiment.best().map(|best| best.trial), Some(first.trial));
}

/// Regression: of a re-run whose verdict could be taken back a reader of the study knew no value.
#[test]
fn a_reader_of_the_study_has_the_same_best_as_the_session_after_every_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let read = || {
        let storage = Storage::File(folder.path().join(STUDY_FILE));
        let opened = open_stored(&storage, None, &Config::load(None).unwrap()).unwrap();
        opened.best(&opened.rows()).map(|best| best.trial)
    };
    let judged = |experiment: &mut Experiment, verdict, rerun, value| {
        let spec = run(experiment, TrialEnd::Settled);
        experiment.set_hand_value(Some(value)).unwrap();
        experiment.judge(verdict, rerun).unwrap();
        assert_eq!(read(), experiment.best().map(|best| best.trial), "after trial {}", spec.trial);
        read()
    };
    assert_eq!(judged(&mut experiment, Verdict::Accept, false, 0.4), Some(0));
    assert_eq!(judged(&mut experiment, Verdict::Void, true, 0.9), Some(0));
    assert_eq!(judged(&mut experiment, Verdict::Accept, false, 0.6), Some(2));
    // The same point again: then the mean of both counts for the earlier one.
    experiment.undo().unwrap();
    experiment.judge(Verdict::Fall, false).unwrap();
    assert_eq!(read(), Some(0));
    assert_eq!(judged(&mut experiment, Verdict::Accept, false, 0.5), Some(3));
}

/// Regression: the best of a session could be a trial that another program had marked as infeasible, which no reader showed as such.
#[test]
fn a_trial_that_violates_a_constraint_is_the_best_neither_of_the_session_nor_for_a_reader() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let journal = folder.path().join(STUDY_FILE);
    let mut experiment = open(folder.path());
    for (value, constraint) in [(0.4, -1.0), (0.6, 1.0)] {
        let spec = run(&mut experiment, TrialEnd::Settled);
        let mut file = std::fs::OpenOptions::new().append(true).open(&journal).unwrap();
        let trial = spec.trial;
        let attribute = serde_json::json!({"constraints": [constraint]});
        let line = serde_json::json!({"op_code": 9, "worker_id": "other", "trial_id": trial, "system_attr": attribute});
        writeln!(file, "{line}").unwrap();
        experiment.set_hand_value(Some(value)).unwrap();
        experiment.judge(Verdict::Accept, false).unwrap();
    }
    let opened = open_stored(&Storage::File(journal), None, &Config::load(None).unwrap()).unwrap();
    assert_eq!(opened.study.trial(1).unwrap().violation(), 1.0);
    assert_eq!(opened.best(&opened.rows()).map(|best| best.trial), Some(0));
    assert_eq!(experiment.best().map(|best| best.trial), Some(0));
}

#[test]
fn a_trial_in_which_nothing_was_measured_cannot_be_accepted_without_a_hand_measured_value() {
    let mut experiment = experiment(5);
    let spec = approve(&mut experiment);
    experiment.ended(spec.trial, &TrialEnd::Settled, &[], 0);
    let error = experiment.judge(Verdict::Accept, false).unwrap_err().to_string();
    assert!(error.contains("nothing was measured"), "{error}");
    experiment.set_hand_value(Some(0.42)).unwrap();
    experiment.judge(Verdict::Accept, false).unwrap();
    assert_eq!(experiment.row(spec.trial).unwrap().value, Some(0.42));
}

#[test]
fn a_hand_measured_value_replaces_the_measured_one_and_both_are_kept() {
    let mut experiment = experiment(5);
    let spec = run(&mut experiment, TrialEnd::Settled);
    experiment.set_hand_value(Some(0.5)).unwrap();
    experiment.judge(Verdict::Accept, false).unwrap();
    let row = experiment.row(spec.trial).unwrap();
    assert_eq!((row.value, row.hand_value), (Some(0.5), Some(0.5)));
    assert_eq!(row.measured.as_ref().unwrap().dx_m, far(&spec));
}

/// Regression: a trial of another program that was judged a fall or void could not be accepted again: its value was lost.
#[test]
fn a_trial_of_another_program_has_its_value_again_when_it_is_accepted_again() {
    let folder = tempfile::tempdir().unwrap();
    let parameters: Vec<(String, f64)> =
        [("f0", 1.3), ("Fx", 90.0), ("Fz", 240.0)].map(|(n, v)| (n.to_owned(), v)).into();
    let table = |value, state| TableTrial {
        state,
        value,
        parameters: parameters.clone(),
        attributes: serde_json::Map::new(),
        started: None,
        completed: None,
        note: String::new(),
    };
    let trials = vec![table(Some(0.45), TrialState::Complete), table(None, TrialState::Fail)];
    import(&mut study_in(folder.path()), trials).unwrap();
    let mut experiment = open(folder.path());
    let name = |experiment: &Experiment, trial| experiment.row(trial).unwrap().verdict_name().unwrap();
    assert_eq!([name(&experiment, 0), name(&experiment, 1)], ["complete", "failed"]);
    assert_eq!(experiment.change_verdict(0, Verdict::Fall, "it lay").unwrap(), "complete");
    assert_eq!((name(&experiment, 0), experiment.row(0).unwrap().value), ("fall", Some(0.0)));
    let reason = experiment.row(0).unwrap().operators_reason().unwrap();
    assert_eq!(reason, ("it lay", "changed by the operator, was complete".to_owned()));
    experiment.change_verdict(0, Verdict::Void, "the mat slid").unwrap();
    assert_eq!(name(&experiment, 0), "void");
    let mut experiment = open(folder.path());
    assert_eq!(name(&experiment, 0), "void");
    assert_eq!(experiment.change_verdict(0, Verdict::Accept, "it stood").unwrap(), "void");
    assert_eq!((name(&experiment, 0), experiment.row(0).unwrap().value), ("accept", Some(0.45)));
    let error = experiment.change_verdict(1, Verdict::Accept, "it stood").unwrap_err().to_string();
    assert!(error.contains("nothing was measured in trial 1"), "{error}");
}

/// The change is in the history from which the sampler proposes and in the journal, with the verdict before it.
#[test]
fn a_final_verdict_can_be_changed_and_the_journal_keeps_both() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.log");
    let mut experiment = Experiment::open(plan(6), study(Storage::File(path.clone()))).unwrap();
    let first = accept(&mut experiment).trial;
    let refused = |experiment: &mut Experiment, trial, verdict, reason: &str, expected: &str| {
        let error = experiment.change_verdict(trial, verdict, reason).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    };
    refused(&mut experiment, first, Verdict::Fall, "it lay", "undo takes it back");
    let second = accept(&mut experiment).trial;
    let value = experiment.row(first).unwrap().value;
    refused(&mut experiment, first, Verdict::Accept, "it lay", "is accept already");
    refused(&mut experiment, first, Verdict::Fall, " ", "give the reason");
    refused(&mut experiment, 9, Verdict::Fall, "it lay", "there is no trial 9");
    let before = experiment.proposal().unwrap();
    assert_eq!(experiment.change_verdict(first, Verdict::Fall, "it lay on its back").unwrap(), "accept");
    let after = experiment.proposal().unwrap();
    assert!(after.revision > before.revision, "the approval of an earlier card would be refused");
    let row = experiment.row(first).unwrap();
    assert_eq!((row.verdict, row.value), (Some(Verdict::Fall), Some(0.0)));
    assert!(row.cause.starts_with("it lay on its back; changed by the operator, was accept; "), "{}", row.cause);
    assert_eq!(experiment.best().unwrap().trial, second);
    experiment.change_verdict(first, Verdict::Void, "the mat slid").unwrap();
    assert_eq!((experiment.counted(), experiment.row(first).unwrap().value), (1, None));
    experiment.change_verdict(first, Verdict::Accept, "the video shows a landing").unwrap();
    assert_eq!((experiment.counted(), experiment.row(first).unwrap().value), (2, value));
    experiment.change_verdict(first, Verdict::Fall, "it lay").unwrap();
    // Regression: it held the reasons of all changes. The journal keeps them.
    assert_eq!(experiment.row(first).unwrap().cause, "it lay; changed by the operator, was accept; landed and settled");
    let shown = |row: &TrialRecord| (row.verdict, row.value, row.cause.clone());
    let rows: Vec<_> = experiment.rows().map(shown).collect();
    experiment.close().unwrap();
    drop(experiment);

    let opened = study(Storage::File(path.clone()));
    let stored = opened.trial(first).unwrap();
    assert_eq!((stored.value, stored.is_fall()), (Some(0.0), true));
    let changes = opened.attributes()[&format!("verdict:{first}")].as_array().unwrap();
    let verdicts: Vec<_> = changes.iter().map(|c| (c["old_verdict"].as_str(), c["verdict"].as_str())).collect();
    let expected = [("accept", "fall"), ("fall", "void"), ("void", "accept"), ("accept", "fall")];
    assert_eq!(verdicts, expected.map(|(old, new)| (Some(old), Some(new))));
    assert_eq!(changes[0]["old_value"].as_f64(), value);
    assert_eq!(changes[0]["reason"], "it lay on its back");
    let reopened = Experiment::open(plan(6), opened).unwrap();
    assert_eq!(
        reopened.rows().map(shown).collect::<Vec<_>>(),
        rows,
        "a session that continues shows the changed table"
    );
    // The lines of the trial itself are as they were: Optuna shows its first value.
    let text = std::fs::read_to_string(&path).unwrap();
    let told = text.lines().filter(|line| line.contains("\"op_code\": 6") || line.contains("\"op_code\":6"));
    assert!(told.clone().any(|line| line.contains(&value.unwrap().to_string())), "{text}");
}

/// Regression: a skipped proposal could be judged a fall; it counted for the budget then and was reported to the sampler.
#[test]
fn a_trial_that_was_not_run_has_no_verdict_to_change() {
    let mut experiment = experiment(5);
    let skipped = experiment.proposal().unwrap().trial;
    skip(&mut experiment);
    accept(&mut experiment);
    for verdict in Verdict::ALL {
        let error = experiment.change_verdict(skipped, verdict, "it fell").unwrap_err().to_string();
        assert_eq!(error, format!("trial {skipped} was not run: it has no verdict"));
    }
    assert_eq!(experiment.counted(), 1);
}

#[test]
fn a_verdict_cannot_be_changed_during_a_trial() {
    let mut experiment = experiment(5);
    let first = accept(&mut experiment).trial;
    let second = approve(&mut experiment);
    assert!(experiment.change_verdict(first, Verdict::Fall, "it lay").is_err(), "running");
    experiment.ended(second.trial, &TrialEnd::Settled, &[], 0);
    assert!(experiment.change_verdict(first, Verdict::Fall, "it lay").is_err(), "under review");
}

/// Six digits name a value; 17 hide it.
#[test]
fn requests_name_numbers_with_six_digits() {
    let value = 1.549_158_564_216_723_6;
    let fix = OperatorRequest::Fix { parameter: "f0".into(), value, trials: 5 };
    assert_eq!(fix.to_string(), "fix f0 = 1.54916 for 5 trials");
    let point = vec![("f0".to_owned(), value), ("Fx".to_owned(), 90.0), ("Fz".to_owned(), 242.295_872_450_586_4)];
    assert_eq!(OperatorRequest::Enqueue(point).to_string(), "queue f0 = 1.54916, Fx = 90, Fz = 242.296");
    let zero = OperatorRequest::Override { parameter: "Fx".into(), value: 0.0 };
    assert_eq!(zero.to_string(), "override Fx = 0");
}

#[test]
fn a_skipped_proposal_is_not_told_and_another_follows() {
    let mut experiment = experiment(5);
    let before = parameters(&experiment);
    skip(&mut experiment);
    assert_ne!(parameters(&experiment), before);
    assert_eq!(experiment.counted(), 0);
    assert_eq!(experiment.row(0).unwrap().verdict, Some(Verdict::Void));
}

#[test]
fn the_budget_ends_the_study_and_can_be_raised() {
    let mut experiment = experiment(2);
    accept(&mut experiment);
    accept(&mut experiment);
    assert_eq!(experiment.stage(), ExperimentStage::Finished);
    assert!(experiment.proposal().is_none());
    experiment.extend(1).unwrap();
    assert_eq!(experiment.stage(), ExperimentStage::Proposed);
}

/// Regression: five more trials of a study with more counted trials than its budget gave none.
#[test]
fn more_trials_are_more_than_those_that_count_already() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    for _ in 0..4 {
        accept(&mut experiment);
    }
    experiment.close().unwrap();
    drop(experiment);
    // As with --resume and --trials 2.
    let mut experiment = Experiment::open(plan(2), study_in(folder.path())).unwrap();
    assert_eq!((experiment.stage(), experiment.counted()), (ExperimentStage::Finished, 4));
    experiment.extend(3).unwrap();
    assert_eq!((experiment.stage(), experiment.budget()), (ExperimentStage::Proposed, 7));
    for _ in 0..3 {
        accept(&mut experiment);
    }
    assert_eq!((experiment.stage(), experiment.counted()), (ExperimentStage::Finished, 7));
}

#[test]
fn falls_nearby_are_shown_as_a_risk() {
    let mut experiment = experiment(5);
    let spec = run(&mut experiment, TrialEnd::Fell(FallCause::BodyContact));
    experiment.judge(Verdict::Fall, false).unwrap();
    experiment.set_parameter("f0", spec.jump.f0_hz).unwrap();
    experiment.set_parameter("Fx", spec.jump.fx_n).unwrap();
    experiment.set_parameter("Fz", spec.jump.fz_n).unwrap();
    let risk = experiment.proposal().unwrap().risk.unwrap();
    assert_eq!(risk.nearest_fall, Some(0.0));
    assert_eq!((risk.falls, risk.neighbours), (1, 1));
}

/// The same study with an operator's odd moments: override, fall, re-run, void, skip, undo.
fn eventful(experiment: &mut Experiment, step: u32) {
    match step % 7 {
        1 => {
            experiment.set_parameter("Fx", 60.0 + f64::from(step)).unwrap();
            accept(experiment);
        }
        3 => {
            run(experiment, TrialEnd::Fell(FallCause::BodyContact));
            experiment.judge(Verdict::Fall, false).unwrap();
        }
        4 => {
            run(experiment, TrialEnd::Settled);
            experiment.judge(Verdict::Void, true).unwrap();
        }
        5 => skip(experiment),
        _ => {
            accept(experiment);
        }
    }
}

/// The study is killed (dropped without closing it) between any two steps; verdicts given before survive, and the next
/// proposal is the one of the unbroken run.
#[test]
fn a_study_interrupted_after_every_verdict_equals_the_unbroken_one() {
    let (broken, whole) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut unbroken = open(whole.path());
    for step in 0..28 {
        eventful(&mut unbroken, step);
        let mut experiment = open(broken.path());
        eventful(&mut experiment, step);
        drop(experiment);
        let resumed = open(broken.path());
        assert_eq!(
            resumed.proposal().unwrap().parameters,
            unbroken.proposal().unwrap().parameters,
            "after step {step}"
        );
        let verdicts = |experiment: &Experiment| {
            experiment.rows().map(|row| (row.trial, row.verdict, row.value)).collect::<Vec<_>>()
        };
        assert_eq!(verdicts(&resumed), verdicts(&unbroken), "after step {step}");
    }
}

/// Killed while a trial runs: the trial is void, and its parameters come first, with the same seed.
#[test]
fn a_trial_interrupted_in_mid_jump_is_void_and_comes_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    accept(&mut experiment);
    let spec = approve(&mut experiment);
    drop(experiment);
    let mut experiment = open(folder.path());
    let row = experiment.row(spec.trial).unwrap();
    assert_eq!(row.verdict, Some(Verdict::Void));
    assert!(row.cause.contains("interrupted"), "{}", row.cause);
    let proposal = experiment.proposal().unwrap();
    assert_eq!((proposal.source, proposal.parent), (ProposalSource::Rerun, Some(spec.trial)));
    let again = experiment.approve(proposal.trial, proposal.revision).unwrap();
    assert_eq!((again.jump, again.seed), (spec.jump, spec.seed));
    assert!(again.trial > spec.trial);
}

/// Regression: the cause of a trial that was stopped, after which the program was killed, said no longer that STOP was pressed.
#[test]
fn a_trial_that_was_stopped_before_the_program_ended_says_both() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let spec = run(&mut experiment, TrialEnd::Stopped);
    experiment.keep_measurement().unwrap();
    drop(experiment);
    let experiment = open(folder.path());
    let row = experiment.row(spec.trial).unwrap();
    assert_eq!(row.verdict, Some(Verdict::Void));
    assert_eq!(row.cause, "STOP was pressed; interrupted: the program ended before the verdict");
}

/// Regression: the cause of a stopped trial that the end of its session closes stood twice in its row.
#[test]
fn a_trial_that_is_closed_for_the_reason_of_its_end_names_it_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let spec = run(&mut experiment, TrialEnd::Fault(Fault::OperatorLeft));
    experiment.keep_measurement().unwrap();
    let cause = experiment.row(spec.trial).unwrap().cause.clone();
    experiment.close_unreviewed().unwrap();
    experiment.close().unwrap();
    drop(experiment);
    let experiment = open(folder.path());
    assert_eq!(experiment.row(spec.trial).unwrap().cause, cause);
}

/// Killed between the verdict and its telling, a re-run is not forgotten; killed once more, it does not come twice.
#[test]
fn a_rerun_survives_every_moment_of_a_kill_and_comes_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let spec = run(&mut experiment, TrialEnd::Settled);
    experiment.judge(Verdict::Void, true).unwrap();
    drop(experiment);
    for _ in 0..3 {
        let experiment = open(folder.path());
        let proposal = experiment.proposal().unwrap();
        assert_eq!((proposal.source, proposal.parent), (ProposalSource::Rerun, Some(spec.trial)));
        let waiting = study_in(folder.path()).waiting().count();
        assert_eq!(waiting, 1);
    }
}

/// Regression: after an undo the revisions began anew, and an old approval matched a proposal that the operator had not seen.
#[test]
fn an_approval_from_before_an_undo_is_refused() {
    let mut experiment = experiment(5);
    accept(&mut experiment);
    let seen = experiment.proposal().unwrap();
    experiment.undo().unwrap();
    experiment.judge(Verdict::Fall, false).unwrap();
    assert_eq!(experiment.proposal().unwrap().trial, seen.trial);
    assert!(experiment.approve(seen.trial, seen.revision).is_err());
}

/// A trial of which ticks were lost is not measured, and says so. Regression: only a gap between two ticks was seen, not a
/// trial without its end.
#[test]
fn a_trial_with_lost_ticks_is_suggested_void() {
    let mut experiment = experiment(5);
    let spec = approve(&mut experiment);
    experiment.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, 0.6), 41);
    let row = experiment.row(spec.trial).unwrap();
    assert_eq!((row.suggested, row.measured.as_ref()), (Some(Verdict::Void), None));
    assert!(row.cause.contains("39 ticks"), "{}", row.cause);
}

#[test]
fn the_records_tell_what_the_study_holds() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    for step in 0..10 {
        eventful(&mut experiment, step);
    }
    experiment.close().unwrap();
    let mut shown = std::collections::BTreeMap::new();
    for record in experiment.take_records() {
        if let Record::Trial(row) = record {
            shown.insert(row.trial, row);
        }
    }
    let study = study_in(folder.path());
    let finished: Vec<_> = study.trials().iter().filter(|t| t.state.is_finished()).collect();
    assert_eq!(finished.len(), shown.len());
    for trial in finished {
        let row = &shown[&trial.number];
        let state = if row.verdict == Some(Verdict::Void) { TrialState::Fail } else { TrialState::Complete };
        assert_eq!(trial.state, state, "trial {}", trial.number);
        assert_eq!(trial.value, row.value, "trial {}", trial.number);
        assert_eq!(trial.parameters, *row.parameters, "trial {}", trial.number);
    }
}

/// Regression: the age of a trial was the difference of two hosts' clocks, and one that ran ahead voided every trial of
/// the others.
#[test]
fn a_worker_whose_clock_is_behind_keeps_its_trial() {
    let folder = tempfile::tempdir().unwrap();
    let journal = folder.path().join("study.log");
    let mut theirs = joined(folder.path(), 1000, PATIENT);
    let spec = approve(&mut theirs);
    // Its clock is a century behind ours; no line becomes longer by that.
    let text = std::fs::read_to_string(&journal).unwrap();
    let behind = text.replace("\"datetime_start\": \"20", "\"datetime_start\": \"19");
    let behind = behind.replace("\"datetime_start\":\"20", "\"datetime_start\":\"19");
    assert_ne!(behind, text);
    std::fs::write(&journal, behind).unwrap();
    let mut ours = joined(folder.path(), 1000, PATIENT);
    ours.refresh().unwrap();
    assert!(ours.others_run(), "it is alive");
    theirs.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, far(&spec)), 2);
    theirs.judge(Verdict::Accept, false).unwrap();
    theirs.close().unwrap();
    ours.refresh().unwrap();
    assert_eq!(ours.row(spec.trial).unwrap().verdict, Some(Verdict::Accept));
    assert!(!ours.others_run());
}

#[test]
fn a_trial_that_was_seen_running_for_too_long_is_void_and_comes_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut theirs = joined(folder.path(), 1000, PATIENT);
    let spec = approve(&mut theirs);
    drop(theirs);
    let mut ours = joined(folder.path(), 1000, Duration::from_millis(1));
    std::thread::sleep(Duration::from_millis(20));
    ours.refresh().unwrap();
    assert_eq!(ours.row(spec.trial).unwrap().verdict, Some(Verdict::Void));
    let proposal = ours.proposal().unwrap();
    assert_eq!((proposal.source, proposal.parent), (ProposalSource::Rerun, Some(spec.trial)));
}

/// Regression: the header said "0 of 20 counted" beside twenty trials of two workers, and the proposal stayed until its approval was
/// refused.
#[test]
fn trials_of_other_workers_are_counted_beside_an_open_proposal_and_end_it_with_the_last() {
    let folder = tempfile::tempdir().unwrap();
    let mut ours = Experiment::open(plan(3), study_in(folder.path())).unwrap();
    let counted = |experiment: &mut Experiment| {
        let records = experiment.take_records();
        let of = |record| if let Record::Search(search) = record { Some(search.counted) } else { None };
        records.into_iter().filter_map(of).next_back()
    };
    assert_eq!(counted(&mut ours), Some(0));
    let seen = ours.proposal().unwrap();
    let mut theirs = joined(folder.path(), 3, PATIENT);
    accept(&mut theirs);
    accept(&mut theirs);
    theirs.close().unwrap();
    ours.refresh().unwrap();
    assert_eq!(counted(&mut ours), Some(2));
    ours.refresh().unwrap();
    assert_eq!(counted(&mut ours), None, "published once");
    let kept = ours.proposal().unwrap();
    assert_eq!(kept.risk.map(|risk| risk.neighbours), Some(2), "the results of the others are near it");
    assert_eq!(
        kept,
        Proposal { trial: 2, risk: kept.risk, ..seen },
        "the point that the operator reads stays, with the number of its trial"
    );

    let mut last = joined(folder.path(), 3, PATIENT);
    accept(&mut last);
    last.close().unwrap();
    ours.refresh().unwrap();
    assert_eq!((counted(&mut ours), ours.stage()), (Some(3), ExperimentStage::Finished));
}

/// Regression: the verdict's teller did not look whether another worker had paid the debt already.
#[test]
fn a_rerun_that_another_worker_has_queued_comes_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut slow = joined(folder.path(), 1000, PATIENT);
    let first = run(&mut slow, TrialEnd::Stopped);
    slow.judge(Verdict::Void, true).unwrap();
    // Judged but not reported: another worker closes the trial as abandoned, reports it and queues it again.
    let mut other = joined(folder.path(), 1000, Duration::from_millis(1));
    std::thread::sleep(Duration::from_millis(20));
    other.refresh().unwrap();
    let again = run(&mut slow, TrialEnd::Settled);
    assert_eq!((again.jump, slow.row(again.trial).unwrap().parent), (first.jump, Some(first.trial)));
    let study = study_in(folder.path());
    let parent =
        |trial: &&Trial| trial.user_attributes.get("parent").and_then(|p| p.as_u64()) == Some(u64::from(first.trial));
    assert_eq!(study.trials().iter().filter(parent).count(), 1);
}

/// Regression: a session that accepts by itself judged the newest trial instead.
#[test]
fn a_trial_under_review_need_not_be_the_newest() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    experiment.enqueue(&[("f0".into(), 1.2), ("Fx".into(), 90.0), ("Fz".into(), 250.0)]).unwrap();
    let done = TableTrial {
        state: TrialState::Complete,
        value: Some(0.3),
        parameters: vec![("f0".into(), 1.0), ("Fx".into(), 50.0), ("Fz".into(), 200.0)],
        attributes: serde_json::Map::new(),
        started: None,
        completed: None,
        note: String::new(),
    };
    let newer = import(&mut study_in(folder.path()), vec![done]).unwrap();
    experiment.refresh().unwrap();
    assert!(experiment.under_review().is_none());
    let spec = run(&mut experiment, TrialEnd::Settled);
    assert!(newer[0] > spec.trial && experiment.row(newer[0]).is_some());
    let row = experiment.under_review().unwrap();
    assert_eq!((row.trial, row.suggested), (spec.trial, Some(Verdict::Accept)));
}

#[test]
fn a_raised_budget_is_kept_with_the_study() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    experiment.extend(5).unwrap();
    drop(experiment);
    let study = study_in(folder.path());
    assert_eq!(study.attributes()["budget"].as_u64(), Some(1005));
}

#[test]
fn an_interrupted_study_runs_the_trials_of_an_unbroken_one_with_the_same_seeds() {
    let seeds_of = |killed_in: &[u32]| {
        let folder = tempfile::tempdir().unwrap();
        let (mut experiment, mut seeds) = (open(folder.path()), Vec::new());
        for trial in 0..8 {
            if killed_in.contains(&trial) {
                // A program that was killed between the approval and the verdict.
                approve(&mut experiment);
                drop(experiment);
                experiment = open(folder.path());
            }
            seeds.push(accept(&mut experiment).seed);
        }
        seeds
    };
    let unbroken = seeds_of(&[]);
    assert_eq!(seeds_of(&[0]), unbroken);
    assert_eq!(seeds_of(&[2, 3, 6]), unbroken);
    let mut distinct = unbroken.clone();
    distinct.sort_unstable();
    distinct.dedup();
    assert_eq!(distinct.len(), 8, "each trial has noise of its own");
}

/// Regression: the verdict was written before its value, and a judgement that was cut off between them counted as a fall with the
/// distance that was measured.
#[test]
fn a_judgement_that_was_cut_off_is_a_fall_of_value_zero_or_waits_for_its_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    run(&mut experiment, TrialEnd::Settled);
    experiment.keep_measurement().unwrap();
    let journal = folder.path().join("study.log");
    let before = std::fs::read_to_string(&journal).unwrap();
    experiment.judge(Verdict::Fall, false).unwrap();
    drop(experiment);
    let judged = std::fs::read_to_string(&journal).unwrap();
    let added: Vec<&str> = judged[before.len()..].split_inclusive('\n').collect();
    assert!(added.len() > 3);
    for lines in 1..=added.len() {
        std::fs::write(&journal, before.clone() + &added[..lines].concat()).unwrap();
        let experiment = open(folder.path());
        let row = experiment.row(0).unwrap();
        let expected = match experiment.stage() {
            ExperimentStage::Review => (None, Some(far_of(row))),
            _ => (Some(Verdict::Fall), Some(0.0)),
        };
        assert_eq!((row.verdict, row.value), expected, "after {lines} of {} lines", added.len());
    }
}

/// Returns the measured length of the jump of a row, m.
fn far_of(row: &TrialRecord) -> f64 {
    row.measured.as_ref().unwrap().dx_m
}
