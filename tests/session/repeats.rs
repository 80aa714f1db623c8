//! Trials of several rollouts: value, seeds, void rollouts, undo, interruption.

use crate::support as experiment;
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use experiment::{plan, skip, study, study_in, ticks, without_journal};
use quadfrog::optimize::study::Storage;
use quadfrog::recording::record::Record;
use quadfrog::session::experiment::{Experiment, ExperimentPlan};
use quadfrog::telemetry::{FallCause, TrialEnd, TrialSpec};
use quadfrog::trial::{ExperimentStage, JudgedBy, TrialRecord, Verdict};

const FELL: TrialEnd = TrialEnd::Fell(FallCause::BodyContact);

fn plan_of(repeats: u32) -> ExperimentPlan {
    let mut plan = plan(1000);
    plan.control.repeats = repeats;
    plan
}

fn three_in(folder: &Path) -> Experiment {
    Experiment::open(plan_of(3), study_in(folder)).unwrap()
}

fn three() -> Experiment {
    Experiment::open(plan_of(3), study(Storage::Memory)).unwrap()
}

/// Approves the next rollout and ends it `dx_m` ahead; it is under review then.
fn roll(experiment: &mut Experiment, end: TrialEnd, dx_m: f64) -> TrialSpec {
    let spec = experiment::approve(experiment);
    experiment.ended(spec.trial, &end, &ticks(spec.trial, dx_m), 2);
    assert_eq!(experiment.stage(), ExperimentStage::Review);
    spec
}

fn judged(experiment: &mut Experiment, end: TrialEnd, dx_m: f64, verdict: Verdict) -> TrialSpec {
    let spec = roll(experiment, end, dx_m);
    experiment.judge(verdict, false).unwrap();
    spec
}

fn repeat(experiment: &Experiment) -> (u32, u32, u32) {
    let proposal = experiment.proposal().unwrap();
    (proposal.trial, proposal.repeat, proposal.repeats)
}

fn row(experiment: &Experiment, trial: u32) -> &TrialRecord {
    experiment.row(trial).unwrap()
}

#[test]
fn the_value_is_the_mean_of_the_rollouts_and_a_fall_counts_zero() {
    let mut experiment = three();
    assert_eq!(repeat(&experiment), (0, 1, 3));
    let first = judged(&mut experiment, TrialEnd::Settled, 0.6, Verdict::Accept);
    assert_eq!(repeat(&experiment), (0, 2, 3));
    assert_eq!(row(&experiment, 0).verdict, None);
    let second = judged(&mut experiment, FELL, 0.1, Verdict::Fall);
    let third = judged(&mut experiment, TrialEnd::Settled, 0.3, Verdict::Accept);
    let seeds: BTreeSet<u64> = [first.seed, second.seed, third.seed].into();
    assert_eq!(seeds.len(), 3, "each rollout has a seed of its own");
    assert_eq!((first.jump, first.gains), (third.jump, third.gains));
    let trial = row(&experiment, 0);
    assert!((trial.value.unwrap() - 0.3).abs() < 1e-12, "{trial:?}");
    assert_eq!((trial.verdict, trial.cause.as_str()), (Some(Verdict::Accept), "mean of 3 repeats, 1 fell"));
    let recorded: Vec<_> = trial.repeats.iter().map(|repeat| (repeat.seed, repeat.verdict, repeat.value)).collect();
    let expected = [
        (first.seed, Some(Verdict::Accept), Some(0.6)),
        (second.seed, Some(Verdict::Fall), Some(0.0)),
        (third.seed, Some(Verdict::Accept), Some(0.3)),
    ];
    assert_eq!(recorded, expected);
    assert_eq!((repeat(&experiment), experiment.counted()), ((1, 1, 3), 1));
}

/// Regression: in recordings the first proposal of such a trial was repeat 0 of 0.
#[test]
fn the_first_proposal_of_a_trial_is_published_with_the_number_of_its_rollout() {
    let published = |experiment: &mut Experiment| {
        let of_proposal = |record| match record {
            Record::Proposal(proposal) => Some((proposal.trial, proposal.repeat, proposal.repeats)),
            _ => None,
        };
        experiment.take_records().into_iter().filter_map(of_proposal).collect::<Vec<_>>()
    };
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = three_in(folder.path());
    assert_eq!(published(&mut experiment), [(0, 1, 3)]);
    judged(&mut experiment, TrialEnd::Settled, 0.6, Verdict::Accept);
    assert_eq!(published(&mut experiment), [(0, 2, 3)]);
    drop(experiment);
    assert_eq!(published(&mut three_in(folder.path())), [(1, 2, 3)], "the interrupted trial is continued");
    let mut single = Experiment::open(plan_of(1), study(Storage::Memory)).unwrap();
    assert_eq!(published(&mut single), [(0, 0, 0)]);
}

#[test]
fn a_trial_whose_rollouts_all_fell_is_a_fall() {
    let mut experiment = three();
    for _ in 0..3 {
        judged(&mut experiment, FELL, 0.1, Verdict::Fall);
    }
    assert_eq!((row(&experiment, 0).verdict, row(&experiment, 0).value), (Some(Verdict::Fall), Some(0.0)));
}

#[test]
fn a_void_rollout_stays_on_record_and_is_done_again_with_another_seed() {
    let mut experiment = three();
    judged(&mut experiment, TrialEnd::Settled, 0.6, Verdict::Accept);
    let void = judged(&mut experiment, TrialEnd::Stopped, 0.2, Verdict::Void);
    assert_eq!(repeat(&experiment), (0, 2, 3));
    let again = judged(&mut experiment, TrialEnd::Settled, 0.6, Verdict::Accept);
    judged(&mut experiment, TrialEnd::Settled, 0.6, Verdict::Accept);
    assert_ne!(void.seed, again.seed);
    let trial = row(&experiment, 0);
    assert!((trial.value.unwrap() - 0.6).abs() < 1e-12);
    let verdicts: Vec<_> = trial.repeats.iter().filter_map(|repeat| repeat.verdict).collect();
    assert_eq!(verdicts, [Verdict::Accept, Verdict::Void, Verdict::Accept, Verdict::Accept]);
}

#[test]
fn a_verdict_on_a_rollout_can_be_undone() {
    let mut experiment = three();
    judged(&mut experiment, TrialEnd::Settled, 0.6, Verdict::Fall);
    experiment.undo().unwrap();
    assert_eq!((experiment.stage(), row(&experiment, 0).repeats.len()), (ExperimentStage::Review, 0));
    experiment.judge(Verdict::Accept, false).unwrap();
    judged(&mut experiment, TrialEnd::Settled, 0.6, Verdict::Accept);
    judged(&mut experiment, TrialEnd::Settled, 0.3, Verdict::Accept);
    experiment.undo().unwrap();
    assert_eq!((experiment.stage(), row(&experiment, 0).repeats.len()), (ExperimentStage::Review, 2));
    experiment.judge(Verdict::Fall, false).unwrap();
    assert!((row(&experiment, 0).value.unwrap() - 0.4).abs() < 1e-12);
}

#[test]
fn a_trial_is_the_operators_if_one_of_its_rollouts_is() {
    let (operator, rule) = (Some(JudgedBy::Operator), Some(JudgedBy::Rule));
    for (operators, expected) in [(None, rule), (Some(0), operator), (Some(2), operator)] {
        let folder = tempfile::tempdir().unwrap();
        let mut experiment = three_in(folder.path());
        for rollout in 0..3 {
            roll(&mut experiment, TrialEnd::Settled, 0.6);
            assert_eq!(row(&experiment, 0).judged_by, None, "before the verdict");
            if operators == Some(rollout) {
                experiment.judge(Verdict::Accept, false).unwrap();
            } else {
                experiment.judge_by_rule(Verdict::Accept).unwrap();
            }
        }
        experiment.close().unwrap();
        let again = three_in(folder.path());
        for experiment in [&experiment, &again] {
            let trial = row(experiment, 0);
            assert_eq!(trial.judged_by, expected);
            let of_rollouts: Vec<_> = trial.repeats.iter().map(|repeat| repeat.judged_by).collect();
            let of_rollout = |rollout| if operators == Some(rollout) { operator } else { rule };
            assert_eq!(of_rollouts, [0, 1, 2].map(of_rollout));
        }
    }
}

/// A program that is killed between or in rollouts: the next one continues with those that were judged, with the same seeds.
#[test]
fn an_interrupted_trial_goes_on_with_its_judged_rollouts() {
    let whole: Vec<u64> = {
        let folder = tempfile::tempdir().unwrap();
        let mut experiment = three_in(folder.path());
        (0..3).map(|_| judged(&mut experiment, TrialEnd::Settled, 0.5, Verdict::Accept).seed).collect()
    };
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = three_in(folder.path());
    let mut seeds = vec![judged(&mut experiment, TrialEnd::Settled, 0.5, Verdict::Accept).seed];
    // Killed in the second rollout.
    roll(&mut experiment, TrialEnd::Settled, 0.9);
    drop(experiment);
    let mut experiment = three_in(folder.path());
    assert_eq!(repeat(&experiment), (1, 2, 3));
    seeds.push(judged(&mut experiment, TrialEnd::Settled, 0.5, Verdict::Accept).seed);
    // Killed between the second and the third.
    drop(experiment);
    let mut experiment = three_in(folder.path());
    assert_eq!(repeat(&experiment), (2, 3, 3));
    seeds.push(judged(&mut experiment, TrialEnd::Settled, 0.5, Verdict::Accept).seed);
    assert_eq!(seeds, whole);
    let trial = row(&experiment, 2);
    assert_eq!((trial.repeats.len(), trial.verdict), (3, Some(Verdict::Accept)));
    assert!((trial.value.unwrap() - 0.5).abs() < 1e-12);
    drop(experiment);
    let experiment = three_in(folder.path());
    assert_eq!((experiment.counted(), row(&experiment, 2).repeats.len()), (1, 3));
}

#[test]
fn a_trial_can_be_given_up_between_its_rollouts() {
    let mut experiment = three();
    judged(&mut experiment, TrialEnd::Settled, 0.6, Verdict::Accept);
    skip(&mut experiment);
    assert_eq!((row(&experiment, 0).verdict, experiment.counted()), (Some(Verdict::Void), 0));
    assert_eq!(repeat(&experiment), (1, 1, 3));
}

#[test]
fn a_trial_whose_end_cannot_be_stored_is_not_shown_as_given_up() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = three_in(folder.path());
    judged(&mut experiment, TrialEnd::Settled, 0.6, Verdict::Accept);
    let seen = experiment.proposal().unwrap();
    without_journal(folder.path(), || experiment.skip(seen.trial, seen.revision)).unwrap_err();
    assert_eq!((row(&experiment, 0).verdict, repeat(&experiment)), (None, (0, 2, 3)));
    skip(&mut experiment);
    assert_eq!(row(&experiment, 0).verdict, Some(Verdict::Void));
}

/// A trial that is one rollout has no repeats on record, and the seed that it always had.
#[test]
fn a_single_rollout_is_as_before() {
    let mut one = Experiment::open(plan_of(1), study(Storage::Memory)).unwrap();
    let spec = judged(&mut one, TrialEnd::Settled, 0.6, Verdict::Accept);
    assert_eq!((row(&one, 0).repeats.len(), row(&one, 0).cause.as_str()), (0, "landed and settled"));
    assert_eq!(roll(&mut three(), TrialEnd::Settled, 0.6).seed, spec.seed);
}

/// Regression: news of a running trial was a greater number of attributes; the second and later rollouts replace the attribute of
/// the first, and another worker declared the trial abandoned although its rollouts were judged in time.
#[test]
fn a_worker_whose_rollouts_are_judged_in_time_is_alive() {
    let folder = tempfile::tempdir().unwrap();
    let worker = || {
        let mut study = study_in(folder.path());
        let worker = study.join().unwrap();
        Experiment::open(ExperimentPlan { worker, abandoned: Duration::from_secs(2), ..plan_of(10) }, study).unwrap()
    };
    let (mut first, mut second) = (worker(), worker());
    for _ in 0..7 {
        judged(&mut first, TrialEnd::Settled, 0.5, Verdict::Accept);
        second.refresh().unwrap();
        std::thread::sleep(Duration::from_millis(500));
        second.refresh().unwrap();
        assert!(second.others_run(), "the first worker has judged a rollout half a second ago");
    }
}
