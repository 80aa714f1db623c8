//! The life of a trial through its public interface: what an operator may do, what the study is told, what a crash costs.

#[path = "support/experiment.rs"]
mod support;

use std::time::Duration;

use quadfrog::optimize::exchange::TableTrial;
use quadfrog::optimize::study::Storage;
use quadfrog::optimize::trial::{Trial, TrialState};
use quadfrog::recording::record::Record;
use quadfrog::session::experiment::Experiment;
use quadfrog::session::experiment::import;
use quadfrog::telemetry::{FallCause, TrialEnd};
use quadfrog::trial::{ExperimentStage, ProposalSource, Verdict};
use support::{accept, far, joined, life, open, parameters, run, study, ticks};

/// How long no test lasts.
const PATIENT: Duration = Duration::from_secs(3600);

#[test]
fn an_accepted_trial_counts_with_its_measured_value() {
    let mut life = life(5);
    let spec = accept(&mut life);
    let row = life.row(spec.trial).unwrap();
    assert_eq!(row.verdict, Some(Verdict::Accept));
    assert_eq!(row.value, Some(far(&spec)));
    assert_eq!(life.best().unwrap().trial, spec.trial);
}

#[test]
fn a_fall_counts_with_zero_and_is_never_the_best() {
    let mut life = life(5);
    let cause = FallCause::Roll { measured_rad: 1.2, allowed_rad: 1.0 };
    let spec = run(&mut life, TrialEnd::Fell(cause));
    assert_eq!(life.row(spec.trial).unwrap().suggested, Some(Verdict::Fall));
    assert!(life.row(spec.trial).unwrap().cause.contains("roll 1.20"));
    life.judge(Verdict::Fall, false).unwrap();
    assert_eq!(life.row(spec.trial).unwrap().value, Some(0.0));
    assert!(life.best().is_none());
    assert_eq!(life.counted(), 1);
}

#[test]
fn a_void_trial_does_not_count_and_a_rerun_repeats_its_parameters() {
    let mut life = life(5);
    let before = parameters(&life);
    let first = run(&mut life, TrialEnd::Stopped);
    life.judge(Verdict::Void, true).unwrap();
    assert_eq!(life.counted(), 0);
    let card = life.proposal().unwrap();
    assert_eq!((card.source, card.parent), (ProposalSource::Rerun, Some(first.trial)));
    assert_eq!(parameters(&life), before);
    let second = accept(&mut life);
    assert_eq!(second.jump, first.jump);
    assert_ne!(second.seed, first.seed, "a repetition has noise of its own");
}

#[test]
fn an_override_outside_the_bounds_is_refused_with_the_bounds() {
    let mut life = life(5);
    let error = life.set_parameter("Fx", 151.0).unwrap_err().to_string();
    assert!(error.contains("Fx = 151") && error.contains("0 to 150"), "{error}");
    let error = life.set_parameter("Fx", f64::NAN).unwrap_err().to_string();
    assert!(error.contains("outside its bounds"), "{error}");
    let error = life.set_parameter("Fw", 1.0).unwrap_err().to_string();
    assert!(error.contains("f0, Fx, Fz"), "{error}");
    assert!(parameters(&life)[1] != 151.0);
}

#[test]
fn an_override_runs_as_the_operators_and_keeps_what_was_proposed() {
    let mut life = life(5);
    let proposed = life.proposal().unwrap();
    life.set_parameter("Fx", 120.0).unwrap();
    let card = life.proposal().unwrap();
    assert_eq!(card.source, ProposalSource::Operator);
    assert_eq!(card.parameters[1].value, 120.0);
    assert_eq!(card.parameters[1].proposed, proposed.parameters[1].proposed);
    let spec = accept(&mut life);
    assert_eq!(spec.jump.fx_n, 120.0);
    assert_eq!(life.row(spec.trial).unwrap().source, ProposalSource::Operator);
}

#[test]
fn an_approval_of_an_earlier_card_is_refused() {
    let mut life = life(5);
    let seen = life.proposal().unwrap();
    life.set_parameter("Fx", 120.0).unwrap();
    let error = life.approve(seen.trial, seen.revision).unwrap_err().to_string();
    assert!(error.contains("look at the card again"), "{error}");
    assert_eq!(life.stage(), ExperimentStage::Proposed);
}

#[test]
fn a_verdict_can_be_undone_until_the_next_trial_begins() {
    let mut life = life(5);
    let spec = accept(&mut life);
    let after_accept = parameters(&life);
    life.undo().unwrap();
    assert_eq!(life.stage(), ExperimentStage::Review);
    assert_eq!(life.row(spec.trial).unwrap().verdict, None);
    life.judge(Verdict::Accept, false).unwrap();
    assert_eq!(parameters(&life), after_accept);
    accept(&mut life);
    life.undo().unwrap();
    life.judge(Verdict::Fall, false).unwrap();
    let card = life.proposal().unwrap();
    life.approve(card.trial, card.revision).unwrap();
    assert!(life.undo().is_err(), "the verdict was told when the next trial began");
}

#[test]
fn a_trial_in_which_nothing_was_measured_cannot_be_accepted_without_a_hand_measured_value() {
    let mut life = life(5);
    let card = life.proposal().unwrap();
    let spec = life.approve(card.trial, card.revision).unwrap();
    life.ended(spec.trial, &TrialEnd::Settled, &[], 0);
    let error = life.judge(Verdict::Accept, false).unwrap_err().to_string();
    assert!(error.contains("nothing was measured"), "{error}");
    life.set_hand_value(Some(0.42)).unwrap();
    life.judge(Verdict::Accept, false).unwrap();
    assert_eq!(life.row(spec.trial).unwrap().value, Some(0.42));
}

#[test]
fn a_hand_measured_value_replaces_the_measured_one_and_both_are_kept() {
    let mut life = life(5);
    let spec = run(&mut life, TrialEnd::Settled);
    life.set_hand_value(Some(0.5)).unwrap();
    life.judge(Verdict::Accept, false).unwrap();
    let row = life.row(spec.trial).unwrap();
    assert_eq!((row.value, row.hand_value), (Some(0.5), Some(0.5)));
    assert_eq!(row.measured.unwrap().dx_m, far(&spec));
}

#[test]
fn a_skipped_proposal_is_not_told_and_another_follows() {
    let mut life = life(5);
    let before = parameters(&life);
    life.skip().unwrap();
    assert_ne!(parameters(&life), before);
    assert_eq!(life.counted(), 0);
    assert_eq!(life.row(0).unwrap().verdict, Some(Verdict::Void));
}

#[test]
fn the_budget_ends_the_study_and_can_be_raised() {
    let mut life = life(2);
    accept(&mut life);
    accept(&mut life);
    assert_eq!(life.stage(), ExperimentStage::Finished);
    assert!(life.proposal().is_none());
    life.extend(1).unwrap();
    assert_eq!(life.stage(), ExperimentStage::Proposed);
}

#[test]
fn falls_nearby_are_shown_as_a_risk() {
    let mut life = life(5);
    let spec = run(&mut life, TrialEnd::Fell(FallCause::BodyContact));
    life.judge(Verdict::Fall, false).unwrap();
    life.set_parameter("f0", spec.jump.f0_hz).unwrap();
    life.set_parameter("Fx", spec.jump.fx_n).unwrap();
    life.set_parameter("Fz", spec.jump.fz_n).unwrap();
    let risk = life.proposal().unwrap().risk.unwrap();
    assert_eq!(risk.nearest_fall, Some(0.0));
    assert_eq!((risk.falls, risk.neighbours), (1, 1));
}

/// The same study with an operator's odd moments: override, fall, re-run, void, skip, undo.
fn eventful(life: &mut Experiment, step: u32) {
    match step % 7 {
        1 => {
            life.set_parameter("Fx", 60.0 + f64::from(step)).unwrap();
            accept(life);
        }
        3 => {
            run(life, TrialEnd::Fell(FallCause::BodyContact));
            life.judge(Verdict::Fall, false).unwrap();
        }
        4 => {
            run(life, TrialEnd::Settled);
            life.judge(Verdict::Void, true).unwrap();
        }
        5 => life.skip().unwrap(),
        _ => {
            accept(life);
        }
    }
}

/// The study is killed (dropped without a word) between any two steps; verdicts given before survive, and the next
/// proposal is the one of the unbroken run.
#[test]
fn a_study_interrupted_after_every_verdict_equals_the_unbroken_one() {
    let (broken, whole) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut unbroken = open(whole.path());
    for step in 0..28 {
        eventful(&mut unbroken, step);
        let mut life = open(broken.path());
        eventful(&mut life, step);
        drop(life);
        let resumed = open(broken.path());
        assert_eq!(
            resumed.proposal().unwrap().parameters,
            unbroken.proposal().unwrap().parameters,
            "after step {step}"
        );
        let verdicts =
            |life: &Experiment| life.rows().map(|row| (row.trial, row.verdict, row.value)).collect::<Vec<_>>();
        assert_eq!(verdicts(&resumed), verdicts(&unbroken), "after step {step}");
    }
}

/// Killed while a trial runs: the trial is void, and its parameters come first, with the same seed.
#[test]
fn a_trial_interrupted_in_mid_jump_is_void_and_comes_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut life = open(folder.path());
    accept(&mut life);
    let card = life.proposal().unwrap();
    let spec = life.approve(card.trial, card.revision).unwrap();
    drop(life);
    let mut life = open(folder.path());
    let row = life.row(spec.trial).unwrap();
    assert_eq!(row.verdict, Some(Verdict::Void));
    assert!(row.cause.contains("interrupted"), "{}", row.cause);
    let card = life.proposal().unwrap();
    assert_eq!((card.source, card.parent), (ProposalSource::Rerun, Some(spec.trial)));
    let again = life.approve(card.trial, card.revision).unwrap();
    assert_eq!((again.jump, again.seed), (spec.jump, spec.seed));
    assert!(again.trial > spec.trial);
}

/// Killed between the verdict and its telling, a re-run is not forgotten; killed once more, it does not come twice.
#[test]
fn a_rerun_survives_every_moment_of_a_kill_and_comes_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut life = open(folder.path());
    let spec = run(&mut life, TrialEnd::Settled);
    life.judge(Verdict::Void, true).unwrap();
    drop(life);
    for _ in 0..3 {
        let life = open(folder.path());
        let card = life.proposal().unwrap();
        assert_eq!((card.source, card.parent), (ProposalSource::Rerun, Some(spec.trial)));
        let waiting = study(Storage::File(folder.path().join("study.log"))).waiting().count();
        assert_eq!(waiting, 1);
    }
}

/// (A defect once: after an undo the revisions began anew, and an old approval fitted a card that nobody had seen.)
#[test]
fn an_approval_from_before_an_undo_is_refused() {
    let mut life = life(5);
    accept(&mut life);
    let seen = life.proposal().unwrap();
    life.undo().unwrap();
    life.judge(Verdict::Fall, false).unwrap();
    assert_eq!(life.proposal().unwrap().trial, seen.trial);
    assert!(life.approve(seen.trial, seen.revision).is_err());
}

/// A trial of which ticks were lost is not measured, and says so. (A defect once: only a gap between two ticks was seen, not a
/// trial without its end.)
#[test]
fn a_trial_with_lost_ticks_is_suggested_void() {
    let mut life = life(5);
    let card = life.proposal().unwrap();
    let spec = life.approve(card.trial, card.revision).unwrap();
    life.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, 0.6), 41);
    let row = life.row(spec.trial).unwrap();
    assert_eq!((row.suggested, row.measured), (Some(Verdict::Void), None));
    assert!(row.cause.contains("39 ticks"), "{}", row.cause);
}

/// What the screen is shown and what the study holds are the same.
#[test]
fn the_records_tell_what_the_study_holds() {
    let folder = tempfile::tempdir().unwrap();
    let mut life = open(folder.path());
    for step in 0..10 {
        eventful(&mut life, step);
    }
    life.close().unwrap();
    let mut shown = std::collections::BTreeMap::new();
    for record in life.take_records() {
        if let Record::Trial(row) = record {
            shown.insert(row.trial, row);
        }
    }
    let study = study(Storage::File(folder.path().join("study.log")));
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

/// (A defect once: the age of a trial was the difference of two hosts' clocks, and one that ran ahead voided every trial of
/// the others.)
#[test]
fn a_worker_whose_clock_is_behind_keeps_its_trial() {
    let folder = tempfile::tempdir().unwrap();
    let journal = folder.path().join("study.log");
    let mut theirs = joined(folder.path(), 1000, PATIENT);
    let card = theirs.proposal().unwrap();
    let spec = theirs.approve(card.trial, card.revision).unwrap();
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
    let card = theirs.proposal().unwrap();
    let spec = theirs.approve(card.trial, card.revision).unwrap();
    drop(theirs);
    let mut ours = joined(folder.path(), 1000, Duration::from_millis(1));
    std::thread::sleep(Duration::from_millis(20));
    ours.refresh().unwrap();
    assert_eq!(ours.row(spec.trial).unwrap().verdict, Some(Verdict::Void));
    let card = ours.proposal().unwrap();
    assert_eq!((card.source, card.parent), (ProposalSource::Rerun, Some(spec.trial)));
}

/// (A defect once: the verdict's teller did not look whether another worker had paid the debt already.)
#[test]
fn a_rerun_that_another_worker_has_queued_comes_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut slow = joined(folder.path(), 1000, PATIENT);
    let first = run(&mut slow, TrialEnd::Stopped);
    slow.judge(Verdict::Void, true).unwrap();
    // Judged and not told yet: another worker takes its owner for dead, tells it and queues it again.
    let mut other = joined(folder.path(), 1000, Duration::from_millis(1));
    std::thread::sleep(Duration::from_millis(20));
    other.refresh().unwrap();
    let again = run(&mut slow, TrialEnd::Settled);
    assert_eq!((again.jump, slow.row(again.trial).unwrap().parent), (first.jump, Some(first.trial)));
    let study = study(Storage::File(folder.path().join("study.log")));
    let parent =
        |trial: &&Trial| trial.user_attributes.get("parent").and_then(|p| p.as_u64()) == Some(u64::from(first.trial));
    assert_eq!(study.trials().iter().filter(parent).count(), 1);
}

/// (A defect once: a session that accepts by itself looked at the newest trial instead.)
#[test]
fn a_trial_under_review_need_not_be_the_newest() {
    let folder = tempfile::tempdir().unwrap();
    let mut life = open(folder.path());
    life.enqueue(&[("f0".into(), 1.2), ("Fx".into(), 90.0), ("Fz".into(), 250.0)]).unwrap();
    let done = TableTrial {
        state: TrialState::Complete,
        value: Some(0.3),
        parameters: vec![("f0".into(), 1.0), ("Fx".into(), 50.0), ("Fz".into(), 200.0)],
        attributes: serde_json::Map::new(),
        started: None,
        completed: None,
    };
    let newer = import(&mut study(Storage::File(folder.path().join("study.log"))), vec![done]).unwrap();
    life.refresh().unwrap();
    assert!(life.under_review().is_none());
    let spec = run(&mut life, TrialEnd::Settled);
    assert!(newer[0] > spec.trial && life.row(newer[0]).is_some());
    let row = life.under_review().unwrap();
    assert_eq!((row.trial, row.suggested), (spec.trial, Some(Verdict::Accept)));
}

#[test]
fn a_raised_budget_is_kept_with_the_study() {
    let folder = tempfile::tempdir().unwrap();
    let mut life = open(folder.path());
    life.extend(5).unwrap();
    drop(life);
    let study = study(Storage::File(folder.path().join("study.log")));
    assert_eq!(study.attributes()["budget"].as_u64(), Some(1005));
}
