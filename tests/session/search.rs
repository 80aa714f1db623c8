//! The operator's changes of the search: gains, fixed parameters, bounds, confirmation of the best, and other programs.

use crate::support;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use quadfrog::optimize::insight::IMPORTANCE_TRIALS;
use quadfrog::recording::record::Record;
use quadfrog::session::experiment::{
    Experiment, RequestRefusal, confirmation_in_words, fixed_in_words, import, judged, points_of_rows, rows_of,
};
use quadfrog::telemetry::{FallCause, TrialEnd, TrialSpec};
use quadfrog::trial::{
    ExperimentStage, FixedParameter, PointRecord, Proposal, ProposalInsight, ProposalSource, SearchStatus, Verdict,
};
use support::{accept, approve, experiment, far, imported, joined, open, plan, run, skip, study_in, ticks};

#[derive(Default)]
struct News {
    search: Option<SearchStatus>,
    insight: Option<ProposalInsight>,
    points: Vec<PointRecord>,
    log: Vec<String>,
}

fn told(experiment: &mut Experiment, told: &mut News) {
    for record in experiment.take_records() {
        match record {
            Record::Search(search) => told.search = Some(search),
            Record::Insight(insight) => told.insight = Some(insight),
            Record::Points(points) => told.points = points,
            Record::Log(line) => told.log.push(line.message),
            _ => {}
        }
    }
}

fn search(experiment: &mut Experiment) -> SearchStatus {
    let mut news = News::default();
    told(experiment, &mut news);
    news.search.expect("the search has changed")
}

fn several(experiment: &mut Experiment, trials: usize) {
    for _ in 0..trials {
        accept(experiment);
    }
}

fn value(experiment: &Experiment, name: &str) -> f64 {
    experiment.proposal().unwrap().parameters.iter().find(|p| p.name == name).unwrap().value
}

#[test]
fn a_gain_is_checked_runs_in_one_trial_alone_and_stays_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let error = experiment.set_gain("kp", 1001.0).unwrap_err().to_string();
    assert!(error.contains("kp = 1001") && error.contains("100 to 1000"), "{error}");
    let error = experiment.set_gain("ki", 1.0).unwrap_err().to_string();
    assert!(error.contains("kp, kd, kd_joint, k_att"), "{error}");
    assert!(experiment.set_gain("kd", f64::NAN).is_err());

    experiment.set_gain("kp", 500.0).unwrap();
    let proposal = experiment.proposal().unwrap();
    assert_eq!(proposal.source, ProposalSource::Operator);
    let kp = &proposal.gains[0];
    assert_eq!((kp.name.as_str(), kp.value, kp.proposed), ("kp", 500.0, 400.0));
    let spec = accept(&mut experiment);
    assert_eq!((spec.gains.kp, spec.gains.kd), (500.0, 8.0));
    let next = accept(&mut experiment);
    assert_eq!(next.gains.kp, 400.0, "the next trial has the configured gains again");

    // The table of a later session knows, and a re-run has the same gains.
    let mut experiment = open(folder.path());
    let row = experiment.row(spec.trial).unwrap();
    assert_eq!(row.gains.iter().find(|(name, _)| name == "kp").unwrap().1, 500.0);
    assert!(row.note.contains("kp 500 (configured 400)"), "{}", row.note);
    assert!(experiment.row(next.trial).unwrap().note.is_empty());
    experiment.repeat(spec.trial).unwrap();
    let again = accept(&mut experiment);
    assert_eq!((again.jump, again.gains), (spec.jump, spec.gains));
}

#[test]
fn changes_of_a_card_are_taken_back_together() {
    let mut experiment = experiment(5);
    experiment.set_gain("kp", 500.0).unwrap();
    experiment.set_parameter("Fx", 100.0).unwrap();
    experiment.clear_overrides().unwrap();
    let proposal = experiment.proposal().unwrap();
    assert_eq!((proposal.source, proposal.gains[0].value), (ProposalSource::Sampler, 400.0));
}

/// Regression: values that were changed for the next trial were lost with an undone verdict and with the end of the program.
#[test]
fn changed_values_stay_with_their_trial_over_an_undo_and_over_the_end_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    accept(&mut experiment);
    experiment.set_parameter("Fx", 100.0).unwrap();
    experiment.set_gain("kp", 500.0).unwrap();
    let changed = |experiment: &Experiment| {
        let proposal = experiment.proposal().unwrap();
        (proposal.trial, proposal.source, value(experiment, "Fx"), proposal.gains[0].value)
    };
    let kept = (1, ProposalSource::Operator, 100.0, 500.0);
    assert_eq!(changed(&experiment), kept);
    experiment.undo().unwrap();
    assert_eq!(experiment.changed_proposal(), Some(1), "while the verdict is open");
    // Another verdict, another draft of the same trial.
    experiment.judge(Verdict::Fall, false).unwrap();
    assert_eq!(changed(&experiment), kept);
    drop(experiment);
    let mut experiment = open(folder.path());
    assert_eq!(changed(&experiment), kept);
    let mut news = News::default();
    told(&mut experiment, &mut news);
    assert!(news.log.iter().any(|line| line.contains("trial 1 will run with Fx 100 N, kp 500")), "{:?}", news.log);
    let spec = accept(&mut experiment);
    assert_eq!((spec.trial, spec.jump.fx_n, spec.gains.kp), (1, 100.0, 500.0));
    assert_eq!(experiment.changed_proposal(), None, "the trial has run");
    assert_ne!(value(&experiment, "Fx"), 100.0);
    assert_eq!(open(folder.path()).proposal().unwrap().source, ProposalSource::Sampler);
}

#[test]
fn changed_values_are_not_given_to_another_point_with_the_same_number() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    accept(&mut experiment);
    experiment.set_parameter("Fx", 100.0).unwrap();
    experiment.undo().unwrap();
    experiment.judge(Verdict::Void, true).unwrap();
    let proposal = experiment.proposal().unwrap();
    assert_eq!((proposal.trial, proposal.source, proposal.parent), (1, ProposalSource::Rerun, Some(0)));
    assert_eq!(experiment.changed_proposal(), None);
    // Nor do they come back with the sampler's proposal.
    experiment.undo().unwrap();
    experiment.judge(Verdict::Accept, false).unwrap();
    assert_eq!(experiment.proposal().unwrap().source, ProposalSource::Sampler);

    // A point that changes its place takes no changes of the one before.
    experiment.enqueue(&[("Fx".to_owned(), 60.0)]).unwrap();
    experiment.enqueue(&[("Fx".to_owned(), 70.0)]).unwrap();
    experiment.set_parameter("Fz", 250.0).unwrap();
    experiment.move_queued(1, false).unwrap();
    let proposal = experiment.proposal().unwrap();
    assert_eq!((proposal.trial, proposal.source, value(&experiment, "Fx")), (1, ProposalSource::Queued, 70.0));
}

/// A value that is outside the present bounds, or of no parameter, is not restored; nor are values that are no numbers.
#[test]
fn only_changed_values_within_the_bounds_are_restored() {
    let folder = tempfile::tempdir().unwrap();
    drop(open(folder.path()));
    for (kept, fx) in [
        (r#"{"trial":0,"queued":false,"parameters":{"Fx":100,"Fz":1e9,"unknown":1},"gains":{"kp":-5}}"#, Some(100.0)),
        (r#"{"trial":0,"queued":false,"parameters":{"Fx":"much"},"gains":{}}"#, None),
        (r#"{"trial":7,"queued":false,"parameters":{"Fx":100},"gains":{}}"#, None),
        ("[]", None),
    ] {
        let kept = serde_json::from_str(kept).unwrap();
        study_in(folder.path()).annotate_study(&[("changed:0".to_owned(), kept)]).unwrap();
        let proposal = open(folder.path()).proposal().unwrap();
        let changed: Vec<_> = proposal.parameters.iter().filter(|p| p.value != p.proposed).collect();
        assert_eq!(changed.first().map(|p| p.value), fx);
        assert!(changed.len() <= 1 && proposal.gains.iter().all(|gain| gain.value == gain.proposed));
    }
}

#[test]
fn a_fixed_parameter_has_its_value_for_so_many_trials_and_the_others_are_still_proposed() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    several(&mut experiment, 4);
    experiment.fix("Fx", 60.0, 3).unwrap();
    assert_eq!(search(&mut experiment).parameters[1].fixed, Some(FixedParameter { value: 60.0, trials: 3 }));
    let mut others = Vec::new();
    for left in [3, 2, 2, 1] {
        // Interrupted in between, it goes on.
        let mut experiment = open(folder.path());
        assert_eq!(search(&mut experiment).parameters[1].fixed, Some(FixedParameter { value: 60.0, trials: left }));
        assert_eq!(experiment.proposal().unwrap().source, ProposalSource::Sampler);
        let spec = run(&mut experiment, TrialEnd::Settled);
        assert_eq!(spec.jump.fx_n, 60.0);
        others.push(spec.jump.fz_n);
        // A void trial uses up none.
        let verdict = if others.len() == 2 { Verdict::Void } else { Verdict::Accept };
        experiment.judge(verdict, false).unwrap();
        experiment.close().unwrap();
    }
    others.dedup();
    assert_eq!(others.len(), 4, "the other parameters are proposed: {others:?}");
    let mut experiment = open(folder.path());
    assert_eq!(search(&mut experiment).parameters[1].fixed, None);
    assert_ne!(value(&experiment, "Fx"), 60.0);
}

/// Regression: a trial that was queued with the fixed value used up none, against the manual; the fix held for more trials than asked.
#[test]
fn a_queued_trial_and_a_re_run_with_the_fixed_value_use_up_one() {
    let mut experiment = experiment(20);
    experiment.fix("Fx", 60.0, 4).unwrap();
    let left = |experiment: &mut Experiment, trials: u32| {
        assert_eq!(search(experiment).parameters[1].fixed, Some(FixedParameter { value: 60.0, trials }));
    };
    experiment.enqueue(&[("Fx".into(), 60.0)]).unwrap();
    accept(&mut experiment);
    left(&mut experiment, 3);
    // The sampler proposes what was not queued.
    experiment.enqueue(&[("f0".into(), 1.0)]).unwrap();
    assert_eq!(accept(&mut experiment).jump.fx_n, 60.0);
    left(&mut experiment, 2);
    run(&mut experiment, TrialEnd::Settled);
    experiment.judge(Verdict::Void, true).unwrap();
    assert_eq!(accept(&mut experiment).jump.fx_n, 60.0);
    left(&mut experiment, 1);
    experiment.enqueue(&[("Fx".into(), 80.0)]).unwrap();
    accept(&mut experiment);
    left(&mut experiment, 1);
}

#[test]
fn a_fixed_parameter_can_be_freed_and_overridden_and_leaves_queued_points_alone() {
    let mut experiment = experiment(20);
    experiment.fix("Fx", 60.0, 5).unwrap();
    experiment.set_parameter("Fx", 70.0).unwrap();
    assert_eq!(accept(&mut experiment).jump.fx_n, 70.0);
    experiment.enqueue(&[("Fx".into(), 80.0)]).unwrap();
    assert_eq!(accept(&mut experiment).jump.fx_n, 80.0);
    assert_eq!(value(&experiment, "Fx"), 60.0);
    experiment.unfix("Fx").unwrap();
    assert_ne!(value(&experiment, "Fx"), 60.0);
    assert!(experiment.unfix("Fx").unwrap_err().to_string().contains("not fixed"));
    let error = experiment.fix("Fx", 200.0, 1).unwrap_err().to_string();
    assert!(error.contains("0 to 150"), "{error}");
    assert!(experiment.fix("Fx", 60.0, 0).is_err());
    experiment.fix("Fx", 60.0, 2).unwrap();
    experiment.fix("f0", 1.0, 2).unwrap();
    let error = experiment.fix("Fz", 200.0, 2).unwrap_err().to_string();
    assert!(error.contains("nothing would be left"), "{error}");
}

/// Regression: a trial whose other parameters were changed used one up, against the words of the answer; and the study did not say
/// how many are left.
#[test]
fn the_study_says_for_how_many_trials_a_parameter_is_still_fixed() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    experiment.fix("Fx", 60.0, 2).unwrap();
    let words = || fixed_in_words(&study_in(folder.path()));
    assert_eq!(words(), ["Fx is fixed at 60 for 2 trials that count, from trial 0: 2 left"]);
    experiment.set_parameter("Fz", 200.0).unwrap();
    accept(&mut experiment);
    experiment.set_parameter("Fx", 70.0).unwrap();
    accept(&mut experiment);
    experiment.enqueue(&[("Fx".into(), 80.0)]).unwrap();
    accept(&mut experiment);
    experiment.close().unwrap();
    assert_eq!(words(), ["Fx is fixed at 60 for 2 trials that count, from trial 0: 1 left"]);
    let mut experiment = open(folder.path());
    // Regression: a void verdict that could be taken back used one up here, and none on the operator's screen.
    run(&mut experiment, TrialEnd::Settled);
    experiment.judge(Verdict::Void, false).unwrap();
    assert_eq!(words(), ["Fx is fixed at 60 for 2 trials that count, from trial 0: 1 left"]);
    accept(&mut experiment);
    experiment.close().unwrap();
    assert_eq!(words(), ["Fx was fixed at 60 for 2 trials that count, from trial 0"]);
}

#[test]
fn bounds_are_changed_within_what_safety_allows_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    several(&mut experiment, 5);
    for (low, high, words) in
        [(110.0, 40.0, "no range"), (0.0, 301.0, "safety.toml allows: 0 to 300"), (0.0, f64::NAN, "")]
    {
        let error = experiment.narrow_bounds("Fx", low, high).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    experiment.set_parameter("Fz", 200.0).unwrap();
    experiment.narrow_bounds("Fx", 40.0, 50.0).unwrap();
    assert_eq!(value(&experiment, "Fz"), 200.0, "what was set on the proposal stays");
    experiment.clear_overrides().unwrap();
    for _ in 0..6 {
        let mut experiment = open(folder.path());
        let fx = value(&experiment, "Fx");
        assert!((40.0..=50.0).contains(&fx), "{fx}");
        assert!(experiment.set_parameter("Fx", 60.0).is_err());
        accept(&mut experiment);
        experiment.close().unwrap();
    }
    let mut experiment = open(folder.path());
    experiment.fix("Fx", 45.0, 1).unwrap();
    assert!(experiment.narrow_bounds("Fx", 46.0, 50.0).unwrap_err().to_string().contains("fixed at 45"));
    experiment.unfix("Fx").unwrap();
    // Wider than configured, though not than safe; and back.
    experiment.narrow_bounds("Fx", 0.0, 300.0).unwrap();
    experiment.set_parameter("Fx", 250.0).unwrap();
    experiment.narrow_bounds("Fx", 0.0, 150.0).unwrap();
    let now = search(&mut experiment);
    let fx = &now.parameters[1];
    assert_eq!((fx.low, fx.high, fx.least, fx.most), (0.0, 150.0, 0.0, 300.0));
    assert!(value(&experiment, "Fx") <= 150.0, "a value that the bounds exclude does not stay on the proposal");
}

/// A jump whose length is what its parameters say, plus noise of its seed.
fn jump(experiment: &mut Experiment, noise: f64) {
    let spec = approve(experiment);
    let u = (spec.seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
    experiment.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, far(&spec) + noise * u), 2);
    experiment.judge(Verdict::Accept, false).unwrap();
}

#[test]
fn the_best_of_a_finished_study_is_confirmed_beyond_its_budget() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    assert!(experiment.confirm_best(5).unwrap_err().to_string().contains("nothing to compare"));
    (0..12).for_each(|_| jump(&mut experiment, 0.02));
    let counted = experiment.counted();
    let trials = experiment.confirm_best(60).unwrap();
    assert_eq!(trials.len(), 3);
    let mut news = News::default();
    let mut repeats = 0;
    loop {
        told(&mut experiment, &mut news);
        if news.search.as_ref().unwrap().confirming.is_none() {
            break;
        }
        assert_eq!(news.search.as_ref().unwrap().confirming, Some(60 - repeats));
        let proposal = experiment.proposal().unwrap();
        assert_eq!(proposal.source, ProposalSource::Confirm);
        assert!(trials.contains(&proposal.parent.unwrap()));
        jump(&mut experiment, 0.02);
        repeats += 1;
        // Ended and taken up again in between: that costs nothing.
        told(&mut experiment, &mut news);
        experiment.close().unwrap();
        experiment = open(folder.path());
    }
    assert!((6..60).contains(&repeats), "each is run three times at least: {repeats}");
    assert_eq!(experiment.counted(), counted, "repeats are beyond the budget");
    let leader: Vec<_> = news.points.iter().filter(|point| point.confidence.is_some()).collect();
    assert_eq!(leader.len(), 1);
    assert!(leader[0].contender && leader[0].confidence.unwrap() >= 0.95 && leader[0].deviation.unwrap() > 0.0);
    assert_eq!(leader[0].without_fall as usize, leader[0].trials.len());
    assert_eq!(news.points.iter().filter(|point| point.contender).count(), 3);
    let words = news.log.iter().find(|line| line.starts_with("confirmed")).expect("it is said");
    assert!(words.contains("% confidence") && words.contains("stood"), "{words}");
    assert_eq!(experiment.proposal().unwrap().source, ProposalSource::Sampler, "the search goes on");
}

/// A study of twelve jumps whose best points were repeated until one of them leads.
fn confirmed(folder: &Path) -> (Experiment, News) {
    let mut experiment = open(folder);
    (0..12).for_each(|_| jump(&mut experiment, 0.02));
    experiment.confirm_best(60).unwrap();
    let mut news = News::default();
    told(&mut experiment, &mut news);
    while news.search.as_ref().unwrap().confirming.is_some() {
        jump(&mut experiment, 0.02);
        told(&mut experiment, &mut news);
    }
    (experiment, news)
}

/// Regression: after one of its verdicts was changed to a fall, the point of a confirmation still "leads with 97 % confidence".
#[test]
fn a_confirmation_is_judged_anew_when_one_of_its_verdicts_is_changed() {
    let folder = tempfile::tempdir().unwrap();
    let (mut experiment, mut news) = confirmed(folder.path());
    // One more jump, so that no verdict of the confirmation is the last one.
    jump(&mut experiment, 0.02);
    told(&mut experiment, &mut news);
    let leader = news.points.iter().find(|point| point.confidence.is_some()).unwrap().clone();
    assert!(leader.confidence.unwrap() >= 0.95);
    experiment.change_verdict(leader.trials[1], Verdict::Fall, "it fell on the video").unwrap();
    told(&mut experiment, &mut news);
    let now = news.points.iter().find(|point| point.trials == leader.trials).unwrap();
    assert_eq!(now.without_fall, leader.without_fall - 1);
    assert!(now.confidence.is_none_or(|confidence| confidence < 0.95), "{now:?}");
    experiment.close().unwrap();
    let words = confirmation_in_words(&study_in(folder.path()), 0.5).expect("it is kept");
    assert!(words.contains("the confidence is below the wanted one"), "{words}");
}

/// Regression: in an open session the repeats went on, in a continued one they were over.
#[test]
fn a_verdict_changed_after_the_last_repeat_resumes_no_confirmation() {
    for continued in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let (mut experiment, news) = confirmed(folder.path());
        if continued {
            experiment.close().unwrap();
            experiment = open(folder.path());
        }
        let leader = news.points.iter().find(|point| point.confidence.is_some()).unwrap();
        experiment.change_verdict(leader.trials[1], Verdict::Fall, "it fell on the video").unwrap();
        assert_eq!(experiment.proposal().unwrap().source, ProposalSource::Sampler, "continued: {continued}");
        assert_eq!(experiment.undoable(), None, "the result rests on it");
    }
}

/// Regression: a simulator without noise gave "100.0 % confidence", because equal repeats have no spread.
#[test]
fn equal_repeats_give_no_confidence() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    (0..12).for_each(|_| jump(&mut experiment, 0.0));
    experiment.confirm_best(60).unwrap();
    let mut news = News::default();
    while news.search.as_ref().is_none_or(|search| search.confirming.is_some()) {
        jump(&mut experiment, 0.0);
        told(&mut experiment, &mut news);
        assert!(news.points.iter().all(|point| point.confidence.is_none()), "{:?}", news.points);
    }
    let words = news.log.iter().find(|line| line.starts_with("confirmed")).expect("it is said");
    assert!(words.contains("leads without a confidence, because equal jumps give equal values here"), "{words}");
    // Regression: the words for a reader named repeats to come, as long as the last verdict could be taken back.
    let read = study_in(folder.path());
    let in_words = confirmation_in_words(&judged(&read).unwrap(), 0.95).expect("a confirmation");
    assert!(words.ends_with(&in_words), "{in_words}");
    let rows = rows_of(&read, &plan(0).parameters);
    let points: Vec<Vec<u32>> = points_of_rows(rows.iter()).into_iter().map(|point| point.trials).collect();
    assert!(news.points.iter().all(|point| points.contains(&point.trials)), "{points:?}, {:?}", news.points);
    experiment.close().unwrap();
    let kept = confirmation_in_words(&study_in(folder.path()), 0.95).expect("it is kept");
    assert!(words.ends_with(&kept), "{kept}");
}

/// The answer to a moved point names its values and its place: its number is that of the place.
/// In this study every parameter has the unit N.
#[test]
fn a_moved_point_is_named_by_its_values_and_its_place() {
    let mut experiment = experiment(20);
    for f0 in [1.1, 1.2, 1.3] {
        experiment.enqueue(&[("f0".into(), f0), ("Fx".into(), 60.0), ("Fz".into(), 250.0)]).unwrap();
    }
    let moved = experiment.move_queued(1, false).unwrap();
    assert_eq!(
        (experiment.in_words(&moved.point), moved.place, moved.of),
        ("f0 1.200 N, Fx 60.00 N, Fz 250.0 N".to_owned(), 3, 3)
    );
    let moved = experiment.move_queued(1, true).unwrap();
    assert_eq!((experiment.in_words(&moved.point), moved.place), ("f0 1.300 N, Fx 60.00 N, Fz 250.0 N".to_owned(), 1));
}

/// Regression: the answer to a re-run from the table did not say that it is the proposal at once.
#[test]
fn a_repeated_point_is_the_proposal_unless_others_wait() {
    let mut experiment = experiment(20);
    let first = accept(&mut experiment).trial;
    let proposed = experiment.repeat(first).unwrap();
    assert_eq!(proposed, experiment.proposal().map(|proposal| proposal.trial));
    assert!(proposed.is_some());
    assert_eq!(experiment.repeat(first).unwrap(), None, "the first one runs before it");
}

/// The answer to a queued point says whether it is the proposal now, and which fixed values are not its own.
#[test]
fn a_queued_point_says_what_it_takes_the_place_of() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    experiment.fix("f0", 1.2, 3).unwrap();
    let point = |f0: f64| [("f0".into(), f0), ("Fx".into(), 60.0), ("Fz".into(), 250.0)];
    let first = experiment.enqueue(&point(1.5)).unwrap();
    assert_eq!((first.proposed, first.same), (Some(0), None));
    assert_eq!(first.not_fixed, [("f0".to_owned(), 1.2)]);
    let second = experiment.enqueue(&point(1.2)).unwrap();
    assert_eq!((second.proposed, second.not_fixed), (None, vec![]), "the first one runs before it");
    assert_eq!(experiment.enqueue(&point(1.5)).unwrap().same, Some(0));
}

#[test]
fn repeats_end_with_their_budget_or_when_they_are_called_off() {
    let mut experiment = experiment(6);
    (0..6).for_each(|_| jump(&mut experiment, 0.02));
    assert_eq!(experiment.stage(), ExperimentStage::Finished);
    experiment.confirm_best(4).unwrap();
    let mut news = News::default();
    for _ in 0..4 {
        assert_eq!(experiment.stage(), ExperimentStage::Proposed);
        jump(&mut experiment, 50.0);
    }
    told(&mut experiment, &mut news);
    assert_eq!(experiment.stage(), ExperimentStage::Finished);
    // Regression: with fewer than three jumps of a point equal results passed for a confidence of 100 %.
    let said = |news: &News, end: &str| news.log.iter().any(|line| line.contains("used up") && line.ends_with(end));
    assert!(said(&news, "each point needs 3 jumps to be compared"), "{:?}", news.log);
    assert!(news.points.iter().all(|point| point.confidence.is_none()), "{:?}", news.points);
    experiment.confirm_best(6).unwrap();
    for jumps in 1.. {
        if experiment.stage() == ExperimentStage::Finished {
            break;
        }
        jump(&mut experiment, if jumps % 2 == 0 { 50.0 } else { 10.0 });
    }
    told(&mut experiment, &mut news);
    assert!(said(&news, "short of 95 %"), "{:?}", news.log);
    experiment.confirm_best(4).unwrap();
    assert_eq!(experiment.stage(), ExperimentStage::Proposed);
    assert!(experiment.confirm_best(0).unwrap().is_empty());
    assert_eq!(experiment.stage(), ExperimentStage::Finished);
    assert!(experiment.confirm_best(0).unwrap_err().to_string().contains("no confirmation of the best is running"));
    // Regression: the re-run of a repeat ran although the repeats had been called off.
    experiment.confirm_best(4).unwrap();
    let repeat = run(&mut experiment, TrialEnd::Settled).trial;
    experiment.judge(Verdict::Void, true).unwrap();
    assert_eq!(experiment.proposal().map(|proposal| proposal.parent), Some(Some(repeat)));
    experiment.confirm_best(0).unwrap();
    assert_eq!(experiment.stage(), ExperimentStage::Finished);
    assert_eq!(experiment.row(repeat + 1).map(|row| row.was_not_run()), Some(true));
    assert!(experiment.remove_queued(repeat + 1).unwrap_err().to_string().contains("is not in the queue"));
}

/// Regression: while the last repeat ran, the points were to be repeated "at most 0 times more".
#[test]
fn the_repeats_that_are_left_are_said_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    (0..5).for_each(|_| jump(&mut experiment, 0.0));
    experiment.confirm_best(3).unwrap();
    for left in [", at most 2 times more", ", at most once more", " for the last time"] {
        let spec = approve(&mut experiment);
        let words = confirmation_in_words(&study_in(folder.path()), 0.95).expect("a confirmation");
        assert!(
            words.starts_with("the points of trials ") && words.ends_with(&format!("are repeated{left}")),
            "{words}"
        );
        experiment.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, 1.0), 2);
        experiment.judge(Verdict::Accept, false).unwrap();
    }
}

/// Regressions: a trial that was queued after the last repeat said the result again, and the result did not say that the later trial
/// is higher, nor how many jumps were wanted.
#[test]
fn the_result_of_a_confirmation_is_said_once_and_names_a_later_trial_that_is_higher() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    (0..5).for_each(|_| jump(&mut experiment, 0.0));
    assert_eq!(experiment.confirm_best(3).unwrap().len(), 3);
    assert_eq!(experiment.least_repeats(), 6, "more than were asked for");
    (0..3).for_each(|_| jump(&mut experiment, 0.0));
    let said = experiment.take_conclusion().expect("the last repeat has ended it");
    assert!(said.ends_with("; each point needs 3 jumps to be compared"), "{said}");
    let mut news = News::default();
    // Before the next jump the queue and the search change, and the queued point is higher.
    experiment.enqueue(&[("f0".into(), 1.1), ("Fx".into(), 100.0), ("Fz".into(), 240.0)]).unwrap();
    experiment.fix("Fx", 60.0, 2).unwrap();
    let spec = approve(&mut experiment);
    experiment.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, 5.0), 2);
    experiment.judge(Verdict::Accept, false).unwrap();
    assert_eq!(experiment.take_conclusion(), None);
    told(&mut experiment, &mut news);
    assert_eq!(news.log.iter().filter(|line| line.contains("used up")).count(), 1, "{:?}", news.log);
    experiment.close().unwrap();
    let kept = confirmation_in_words(&study_in(folder.path()), 0.95).expect("it is kept");
    let later =
        format!("; each point needs 3 jumps to be compared; trial {}, not compared, is higher: 5.000", spec.trial);
    assert!(kept.ends_with(&later) && kept.contains("leads without a confidence"), "{kept}");
}

/// Regression: a queued point, which runs before the repeats and is higher than all of them, was in no text of the result.
#[test]
fn the_result_of_a_confirmation_names_a_higher_trial_that_ran_before_the_repeats() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let jumps_to = |experiment: &mut Experiment, value: f64| {
        let spec = approve(experiment);
        experiment.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, value), 2);
        experiment.judge(Verdict::Accept, false).unwrap();
        spec.trial
    };
    for value in [0.5, 0.2] {
        jumps_to(&mut experiment, value);
    }
    experiment.enqueue(&[("f0".into(), 1.1), ("Fx".into(), 100.0), ("Fz".into(), 240.0)]).unwrap();
    experiment.confirm_best(4).unwrap();
    let queued = jumps_to(&mut experiment, 0.9);
    while experiment.proposal().is_some_and(|proposal| proposal.source == ProposalSource::Confirm) {
        jumps_to(&mut experiment, 0.4);
    }
    let higher = format!("; trial {queued}, not compared, is higher: 0.900");
    let said = experiment.take_conclusion().expect("the last repeat has ended it");
    assert!(said.contains("the point of trial 0 leads") && said.contains(&higher), "{said}");
    experiment.close().unwrap();
    let kept = confirmation_in_words(&study_in(folder.path()), 0.95).expect("it is kept");
    assert!(kept.contains(&higher), "{kept}");
}

/// The last repeat can be judged otherwise: what was concluded from it is then concluded anew.
#[test]
fn the_verdict_that_ended_a_confirmation_can_be_undone() {
    let mut experiment = experiment(6);
    several(&mut experiment, 6);
    experiment.confirm_best(40).unwrap();
    let mut news = News::default();
    while experiment.stage() == ExperimentStage::Proposed {
        accept(&mut experiment);
    }
    told(&mut experiment, &mut news);
    assert!(news.log.iter().any(|line| line.starts_with("confirmed")));
    experiment.undo().unwrap();
    experiment.judge(Verdict::Void, false).unwrap();
    assert_eq!(experiment.stage(), ExperimentStage::Proposed, "one repeat is missing again");
    accept(&mut experiment);
    assert_eq!(experiment.stage(), ExperimentStage::Finished);
}

/// Regression: after the undo the end of the session wrote the result of the confirmation all the same, and the next session repeated
/// nothing more.
#[test]
fn a_confirmation_whose_last_verdict_was_taken_back_is_not_over_at_the_end_of_the_session() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    (0..5).for_each(|_| jump(&mut experiment, 0.0));
    experiment.confirm_best(3).unwrap();
    (0..3).for_each(|_| jump(&mut experiment, 0.0));
    experiment.undo().unwrap();
    experiment.close().unwrap();
    let words = confirmation_in_words(&study_in(folder.path()), 0.95).expect("it runs");
    assert!(words.ends_with("are repeated for the last time"), "{words}");
    let mut again = open(folder.path());
    again.judge(Verdict::Void, false).unwrap();
    assert_eq!(again.proposal().unwrap().source, ProposalSource::Confirm);
}

/// Regression: without a verdict that could be taken back, a point that waited was fixed, and fixed one trial more than asked for.
#[test]
fn a_point_that_waits_when_a_parameter_is_fixed_uses_one_trial_up() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    jump(&mut experiment, 0.0);
    experiment.enqueue(&[("f0".into(), 1.0)]).unwrap();
    experiment.close().unwrap();
    let mut experiment = open(folder.path());
    experiment.fix("Fx", 60.0, 1).unwrap();
    assert_eq!(accept(&mut experiment).jump.fx_n, 60.0);
    assert_eq!(search(&mut experiment).parameters[1].fixed, None);
    assert_ne!(value(&experiment, "Fx"), 60.0);
}

/// Regression: between approval and commit another program exchanged two points of the queue: one ran twice, the other never.
#[test]
fn an_approval_of_a_queued_point_sees_that_another_program_has_exchanged_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    for fx in [77.0, 78.0] {
        experiment.enqueue(&[("Fx".into(), fx)]).unwrap();
    }
    let seen = experiment.proposal().unwrap();
    assert_eq!((seen.trial, value(&experiment, "Fx")), (0, 77.0));
    assert!(study_in(folder.path()).exchange_waiting(0, 1).unwrap());
    let error = experiment.approve(seen.trial, seen.revision).unwrap_err();
    assert!(matches!(error, RequestRefusal::Overtaken(0)), "{error}");
    assert_eq!([accept(&mut experiment).jump.fx_n, accept(&mut experiment).jump.fx_n], [78.0, 77.0]);
    // Nobody has approved it yet: the card changes by itself.
    for fx in [79.0, 80.0] {
        experiment.enqueue(&[("Fx".into(), fx)]).unwrap();
    }
    experiment.refresh().unwrap();
    let first = experiment.proposal().unwrap().trial;
    assert!(study_in(folder.path()).exchange_waiting(first, first + 1).unwrap());
    experiment.refresh().unwrap();
    assert_eq!(value(&experiment, "Fx"), 80.0);
}

/// Regression: a result that was first read between its judgement and its report, while the other program could still take it back,
/// never changed the risk of a waiting proposal.
#[test]
fn a_result_that_another_program_could_still_take_back_counts_once_it_is_final() {
    let folder = tempfile::tempdir().unwrap();
    let mut worker = joined(folder.path(), 20, Duration::from_secs(60));
    let mut experiment = open(folder.path());
    accept(&mut worker);
    experiment.refresh().unwrap();
    assert_eq!(experiment.proposal().unwrap().risk, None);
    approve(&mut worker);
    experiment.refresh().unwrap();
    assert_eq!(experiment.proposal().unwrap().risk.map(|risk| risk.neighbours), Some(1));
}

#[test]
fn a_proposal_comes_with_its_densities_and_what_matters() {
    let mut experiment = experiment(40);
    let mut news = News::default();
    // Regression: densities stood beside a proposal of the random start, which they had not decided.
    accept(&mut experiment);
    told(&mut experiment, &mut news);
    assert!(news.insight.as_ref().unwrap().parameters.iter().all(|p| p.at.is_empty()));
    for _ in 1..IMPORTANCE_TRIALS - 1 {
        accept(&mut experiment);
    }
    told(&mut experiment, &mut news);
    assert!(news.insight.as_ref().unwrap().parameters.iter().all(|p| p.importance.is_none()));
    several(&mut experiment, 5);
    told(&mut experiment, &mut news);
    let insight = news.insight.unwrap();
    let proposal = experiment.proposal().unwrap();
    assert_eq!(insight.trial, proposal.trial);
    let shares: f64 = insight.parameters.iter().filter_map(|p| p.importance).sum();
    assert!((shares - 1.0).abs() < 1e-12, "{shares}");
    let bounds: BTreeMap<&str, (f64, f64)> = support::BOUNDS.iter().map(|(n, low, high)| (*n, (*low, *high))).collect();
    for (parameter, proposed) in insight.parameters.iter().zip(&proposal.parameters) {
        assert_eq!((&parameter.name, parameter.proposed), (&proposed.name, proposed.proposed));
        let (low, high) = bounds[parameter.name.as_str()];
        assert_eq!((parameter.at[0], *parameter.at.last().unwrap()), (low, high));
        // Both are densities over the range.
        let step = (high - low) / (parameter.at.len() - 1) as f64;
        for density in [&parameter.good, &parameter.bad] {
            let mass = step * (density.iter().sum::<f64>() - (density[0] + density.last().unwrap()) / 2.0);
            assert!((mass - 1.0).abs() < 0.02, "{}: {mass}", parameter.name);
        }
    }
}

/// Another program (a dashboard, Python, `quadfrog study enqueue`) queues a point while a proposal is on the table.
#[test]
fn a_point_queued_by_another_program_comes_next() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    accept(&mut experiment);
    let mut other = study_in(folder.path());
    other.enqueue(&[("Fx".into(), 77.0)], &[]).unwrap();
    experiment.refresh().unwrap();
    assert_eq!((experiment.proposal().unwrap().source, value(&experiment, "Fx")), (ProposalSource::Queued, 77.0));
    // Not over the operator's head.
    let mut other = study_in(folder.path());
    accept(&mut experiment);
    experiment.set_parameter("Fz", 200.0).unwrap();
    other.enqueue(&[("Fx".into(), 78.0)], &[]).unwrap();
    experiment.refresh().unwrap();
    assert_eq!(value(&experiment, "Fz"), 200.0);
    assert_eq!(accept(&mut experiment).jump.fz_n, 200.0);
    assert_eq!(value(&experiment, "Fx"), 78.0);
}

/// Regression: a changed proposal kept the number that the point of another program has in the study, and the seed of its noise.
#[test]
fn a_changed_proposal_has_the_number_of_its_trial_though_another_program_queues_a_point() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    experiment.set_parameter("Fz", 200.0).unwrap();
    let seen = experiment.proposal().unwrap();
    assert_eq!(seen.trial, 0);
    study_in(folder.path()).enqueue(&[("Fx".into(), 77.0)], &[]).unwrap();
    experiment.take_records();
    experiment.refresh().unwrap();
    let now = experiment.proposal().unwrap();
    assert_eq!(now, Proposal { trial: 1, ..seen.clone() });
    assert_eq!(experiment.changed_proposal(), Some(1), "it keeps its changes over an undo and the end of the program");
    let records = experiment.take_records();
    let stage = |record: &Record| matches!(record, Record::Stage(stage) if stage.trial == 1);
    assert!(records.contains(&Record::Proposal(now)) && records.iter().any(stage), "{records:?}");
    experiment.refresh().unwrap();
    assert_eq!(experiment.take_records(), [], "said once");
    // Approved a moment before the new number was seen.
    let spec = experiment.approve(seen.trial, seen.revision).unwrap();
    assert_eq!((spec.trial, spec.jump.fz_n), (1, 200.0));
    experiment.ended(1, &TrialEnd::Settled, &[], 0);
    experiment.judge(Verdict::Void, false).unwrap();
    let queued = accept(&mut experiment);
    assert_eq!((queued.trial, queued.jump.fx_n), (0, 77.0));
    assert_ne!(queued.seed, spec.seed, "no two trials have the same noise");
}

/// Regression: a point that was queued in the second before an approval took the number of the approved trial.
#[test]
fn an_approval_sees_a_point_that_another_program_has_just_queued() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let seen = experiment.proposal().unwrap();
    study_in(folder.path()).enqueue(&[("Fx".into(), 77.0)], &[]).unwrap();
    let error = experiment.approve(seen.trial, seen.revision).unwrap_err();
    assert!(matches!(error, RequestRefusal::Overtaken(0)), "{error}");
    assert_eq!((experiment.proposal().unwrap().source, value(&experiment, "Fx")), (ProposalSource::Queued, 77.0));
    // One that the operator has changed runs, under the number that it has now.
    let mut experiment = open(folder.path());
    accept(&mut experiment);
    experiment.set_parameter("Fz", 200.0).unwrap();
    let seen = experiment.proposal().unwrap();
    study_in(folder.path()).enqueue(&[("Fx".into(), 78.0)], &[]).unwrap();
    let spec = experiment.approve(seen.trial, seen.revision).unwrap();
    assert_eq!((seen.trial, spec.trial, spec.jump.fz_n), (1, 2, 200.0));
}

/// Regression: a proposal that waited went on to say that no judged trial is near it, after the import of some.
#[test]
fn the_risk_of_a_waiting_proposal_is_that_of_the_results_that_another_program_adds() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let before = experiment.proposal().unwrap();
    assert_eq!(before.risk, None);
    let table = [1.0, 1.1, 1.2, 1.3, 1.4].map(|f0| imported([f0, 100.0, 240.0], 0.1 * f0));
    import(&mut study_in(folder.path()), table.into()).unwrap();
    experiment.take_records();
    experiment.refresh().unwrap();
    let now = experiment.proposal().unwrap();
    assert_eq!(now.risk.map(|risk| (risk.falls, risk.neighbours)), Some((0, 5)));
    assert_eq!((now.trial, now.revision, &now.parameters), (5, before.revision, &before.parameters));
    let shown = experiment.take_records().into_iter().rev().find_map(|record| match record {
        Record::Proposal(proposal) => Some(proposal),
        _ => None,
    });
    assert_eq!(shown, Some(now.clone()));
    let spec = experiment.approve(now.trial, now.revision).unwrap();
    assert_eq!(experiment.row(spec.trial).unwrap().risk, now.risk);
}

/// Regression: the queue held the trial that ran, and not what was queued meanwhile.
#[test]
fn the_queue_is_that_of_the_study_during_a_trial_and_its_review() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let queue = |experiment: &mut Experiment| {
        experiment.refresh().unwrap();
        let mut news = News::default();
        told(experiment, &mut news);
        news.search.map(|search| search.queue.iter().map(|point| point.trial).collect::<Vec<_>>())
    };
    study_in(folder.path()).enqueue(&[("Fx".into(), 77.0)], &[]).unwrap();
    assert_eq!(queue(&mut experiment), Some(vec![0]));
    let spec = approve(&mut experiment);
    assert_eq!(queue(&mut experiment), Some(vec![]));
    study_in(folder.path()).enqueue(&[("Fx".into(), 78.0)], &[]).unwrap();
    assert_eq!(queue(&mut experiment), Some(vec![1]));
    experiment.ended(spec.trial, &TrialEnd::Settled, &[], 0);
    study_in(folder.path()).enqueue(&[("Fx".into(), 79.0)], &[]).unwrap();
    assert_eq!(queue(&mut experiment), Some(vec![1, 2]));
    assert_eq!(queue(&mut experiment), None, "published once");
    assert_eq!(experiment.under_review().map(|row| row.trial), Some(0));
}

/// A study in which this trial is to be run again, and another program has queued a point with Fx = 77 at the same moment.
fn rerun_beside_a_queued_point(folder: &Path) -> (Experiment, TrialSpec) {
    let mut experiment = open(folder);
    let spec = run(&mut experiment, TrialEnd::Fell(FallCause::BodyContact));
    experiment.judge(Verdict::Void, true).unwrap();
    let mut other = study_in(folder);
    other.enqueue(&[("Fx".into(), 77.0)], &[]).unwrap();
    (experiment, spec)
}

/// (A danger once: a re-run waits in a fork of the study, and another program may take the number that it has there.)
#[test]
fn a_rerun_runs_its_own_parameters_though_another_program_queues_a_point_at_the_same_moment() {
    let folder = tempfile::tempdir().unwrap();
    let (mut experiment, spec) = rerun_beside_a_queued_point(folder.path());
    let again = accept(&mut experiment);
    assert_eq!(again.jump, spec.jump);
    assert_eq!(experiment.row(again.trial).unwrap().parent, Some(spec.trial));
    assert_eq!(value(&experiment, "Fx"), 77.0);
}

/// Regression: seen now and then, as a session looks, the point took the re-run's parameters and was lost.
#[test]
fn a_point_queued_beside_a_rerun_runs_and_so_does_the_rerun() {
    let folder = tempfile::tempdir().unwrap();
    let (mut experiment, spec) = rerun_beside_a_queued_point(folder.path());
    experiment.refresh().unwrap();
    let both = [accept(&mut experiment), accept(&mut experiment)];
    let of = |fx: f64| both.iter().find(|spec| spec.jump.fx_n == fx);
    assert!(of(77.0).is_some(), "the queued point is lost: {both:?}");
    let again = of(spec.jump.fx_n).expect("the re-run is lost");
    assert_eq!((again.jump, experiment.row(again.trial).unwrap().parent), (spec.jump, Some(spec.trial)));
    assert_eq!(experiment.proposal().unwrap().source, ProposalSource::Sampler, "nothing comes twice");
}

/// Regression: with more trials the queue that is shown lacked the re-run.
#[test]
fn a_rerun_stays_in_the_queue_when_more_trials_are_given() {
    let mut experiment = experiment(5);
    run(&mut experiment, TrialEnd::Settled);
    experiment.judge(Verdict::Void, true).unwrap();
    experiment.take_records();
    experiment.extend(2).unwrap();
    let queue = experiment.take_records().into_iter().find_map(|record| match record {
        Record::Search(search) => Some(search.queue),
        _ => None,
    });
    assert_eq!(queue.unwrap().iter().map(|point| point.trial).collect::<Vec<_>>(), [1]);
}

/// Regression: the point came before the re-run, which had been queued earlier.
#[test]
fn a_rerun_keeps_its_place_before_a_point_that_is_queued_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut other = study_in(folder.path());
    let mut experiment = open(folder.path());
    let spec = approve(&mut experiment);
    other.enqueue(&[("Fx".into(), 75.0)], &[]).unwrap();
    experiment.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, 0.4), 0);
    experiment.judge(Verdict::Void, true).unwrap();
    // What waited already comes first.
    assert_eq!(accept(&mut experiment).jump.fx_n, 75.0);
    let again = run(&mut experiment, TrialEnd::Settled);
    assert_eq!((again.trial, again.jump), (2, spec.jump));
    experiment.judge(Verdict::Void, true).unwrap();
    let seen = experiment.proposal().unwrap();
    assert_eq!((seen.trial, seen.parent), (3, Some(2)));
    for fx in [77.0, 78.0] {
        study_in(folder.path()).enqueue(&[("Fx".into(), fx)], &[]).unwrap();
        experiment.take_records();
        experiment.refresh().unwrap();
    }
    let queue = |records: Vec<Record>| {
        let search = records.into_iter().rev().find_map(|record| match record {
            Record::Search(search) => Some(search.queue),
            _ => None,
        });
        search.unwrap().into_iter().map(|point| (point.trial, point.parameters.get("Fx"))).collect::<Vec<_>>()
    };
    let expected = vec![(3, Some(spec.jump.fx_n)), (4, Some(77.0)), (5, Some(78.0))];
    assert_eq!(queue(experiment.take_records()), expected);
    experiment.refresh().unwrap();
    assert_eq!(experiment.take_records(), [], "said once");
    assert_eq!(experiment.proposal(), Some(seen.clone()), "an open question stays");
    let again = experiment.approve(seen.trial, seen.revision).unwrap();
    assert_eq!((again.trial, again.jump), (3, spec.jump));
    experiment.ended(again.trial, &TrialEnd::Settled, &ticks(again.trial, 0.4), 0);
    // Taken back, the re-run of this verdict leaves the queue as it is.
    experiment.judge(Verdict::Void, true).unwrap();
    experiment.undo().unwrap();
    experiment.judge(Verdict::Accept, false).unwrap();
    let queued = [accept(&mut experiment), accept(&mut experiment)];
    assert_eq!(queued.map(|spec| (spec.trial, spec.jump.fx_n)), [(4, 77.0), (5, 78.0)]);
    assert_eq!(experiment.proposal().unwrap().source, ProposalSource::Sampler, "nothing comes twice");
}

/// (A danger once: it ran, with whatever it said.)
#[test]
fn a_point_of_another_program_beyond_the_limits_cannot_run() {
    for (parameters, gains, word) in [
        (vec![("Fx", 900.0)], None, "Fx = 900"),
        (vec![("f0", 0.0)], None, "f0 = 0"),
        (vec![("Fx", 50.0)], Some(9999.0), "kp = 9999"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let mut experiment = open(folder.path());
        let mut other = study_in(folder.path());
        let point: Vec<_> = parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        let attributes: Vec<_> =
            gains.map(|kp| ("gains".to_owned(), serde_json::json!({ "kp": kp }))).into_iter().collect();
        other.enqueue(&point, &attributes).unwrap();
        experiment.refresh().unwrap();
        let proposal = experiment.proposal().unwrap();
        let refusal = experiment.approve(proposal.trial, proposal.revision).unwrap_err().to_string();
        assert!(refusal.contains(word), "{refusal}");
        skip(&mut experiment);
        let row = experiment.row(proposal.trial).unwrap();
        assert!(row.verdict == Some(Verdict::Void) && row.cause.contains(word), "{row:?}");
        let next = accept(&mut experiment);
        assert!(next.jump.fx_n <= 200.0 && next.jump.f0_hz > 0.0 && next.gains.kp == 400.0);
    }
}

#[test]
fn gains_that_a_queued_point_brings_are_seen_on_its_card() {
    let mut experiment = experiment(5);
    experiment.enqueue(&[("Fx".into(), 60.0), ("kp".into(), 500.0)]).unwrap();
    let proposal = experiment.proposal().unwrap();
    assert_eq!(
        (proposal.gains[0].value, proposal.gains[0].proposed, proposal.source),
        (500.0, 400.0, ProposalSource::Queued)
    );
    assert_eq!(accept(&mut experiment).gains.kp, 500.0);
    let refusal = experiment.enqueue(&[("Fx".into(), 60.0), ("kp".into(), 5000.0)]).unwrap_err().to_string();
    assert!(refusal.contains("kp = 5000"), "{refusal}");
}

/// Regression: the refused request had reported the verdict, which could then not be undone.
#[test]
fn a_confirmation_that_is_refused_tells_nothing() {
    let mut experiment = experiment(5);
    accept(&mut experiment);
    assert!(experiment.confirm_best(10).is_err(), "one point is nothing to compare");
    experiment.undo().unwrap();
    assert_eq!(experiment.stage(), ExperimentStage::Review);
}

#[test]
fn a_verdict_against_the_suggestion_says_so_until_it_is_undone() {
    let mut experiment = experiment(5);
    let spec = run(&mut experiment, TrialEnd::Settled);
    experiment.judge(Verdict::Fall, false).unwrap();
    let cause = &experiment.row(spec.trial).unwrap().cause;
    assert_eq!(cause, "by the operator; looked like accept: landed and settled");
    experiment.undo().unwrap();
    assert_eq!(experiment.row(spec.trial).unwrap().cause, "landed and settled");
}

/// Regression: each worker counted only the repeats that were complete, and all queued the last one.
#[test]
fn workers_together_run_no_more_repeats_than_were_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let mut first = Experiment::open(plan(6), study_in(folder.path())).unwrap();
    several(&mut first, 6);
    first.confirm_best(1).unwrap();
    let mut second = joined(folder.path(), 6, Duration::from_secs(3600));
    let seen = second.proposal().unwrap();
    assert_eq!(seen.source, ProposalSource::Confirm);
    run(&mut first, TrialEnd::Stopped);
    let refused = second.approve(seen.trial, seen.revision);
    assert!(matches!(refused, Err(RequestRefusal::Overtaken(_))), "{refused:?}");
    assert!(second.proposal().is_none() && second.others_run(), "the only repeat runs already");
    // The trial is abandoned; the first worker that sees this queues it again.
    first.judge(Verdict::Void, false).unwrap();
    first.close().unwrap();
    second.refresh().unwrap();
    assert_eq!(second.proposal().unwrap().source, ProposalSource::Confirm);
    accept(&mut second);
    let late = first.proposal().unwrap();
    assert!(matches!(first.approve(late.trial, late.revision), Err(RequestRefusal::Overtaken(_))));
    second.close().unwrap();
    first.refresh().unwrap();
    assert_eq!((first.stage(), second.stage()), (ExperimentStage::Finished, ExperimentStage::Finished));
    let study = study_in(folder.path());
    let repeats = study.trials().iter().filter(|trial| trial.user_attributes["source"] == "confirm");
    let completed: Vec<bool> = repeats.map(|trial| trial.value.is_some()).collect();
    assert_eq!(completed, [false, true]);
}

/// Regression: the values that the operator had given to one queued point were given to the point that took its place.
#[test]
fn an_override_stays_with_its_queued_point() {
    let fx = |experiment: &Experiment| value(experiment, "Fx");
    let overridden = |experiment: &Experiment| {
        let proposal = experiment.proposal().unwrap();
        proposal.parameters.iter().filter(|p| p.value != p.proposed).map(|p| (p.name.clone(), p.value)).collect()
    };
    let mut experiment = experiment(20);
    for fx_n in [10.0, 20.0, 30.0] {
        experiment.enqueue(&[("Fx".into(), fx_n), ("Fz".into(), 300.0)]).unwrap();
    }
    let fz: Vec<(String, f64)> = vec![("Fz".into(), 200.0)];
    experiment.set_parameter("Fz", 200.0).unwrap();
    // Behind the proposal.
    experiment.move_queued(2, true).unwrap();
    assert_eq!((fx(&experiment), overridden(&experiment)), (10.0, fz));
    // The proposal itself.
    experiment.move_queued(0, false).unwrap();
    assert_eq!((fx(&experiment), overridden(&experiment)), (30.0, Vec::new()));
    experiment.set_parameter("Fz", 200.0).unwrap();
    experiment.remove_queued(0).unwrap();
    assert_eq!((fx(&experiment), overridden(&experiment)), (10.0, Vec::new()));
    // Its row still says which point it was.
    let removed = experiment.rows().find(|row| row.trial == 0).unwrap();
    assert_eq!(removed.parameters.get("Fx"), Some(30.0));
}

/// A journal that ends at any byte of a change, as that of a killed program may: each point waits once, or is removed.
#[test]
fn a_change_of_the_queue_that_was_cut_off_loses_and_doubles_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let journal = |folder: &Path| std::fs::read(folder.join("study.log")).unwrap();
    let mut experiment = open(folder.path());
    for (fx_n, gain) in [(10.0, None), (20.0, Some(500.0)), (30.0, None)] {
        let gain = gain.map(|kp| ("kp".to_owned(), kp));
        experiment.enqueue(&[("Fx".to_owned(), fx_n)].into_iter().chain(gain).collect::<Vec<_>>()).unwrap();
    }
    let begin = journal(folder.path()).len();
    experiment.move_queued(2, true).unwrap();
    experiment.move_queued(0, false).unwrap();
    experiment.remove_queued(0).unwrap();
    let whole = journal(folder.path());
    drop(experiment);
    let mut seen: Vec<Vec<(f64, bool)>> = Vec::new();
    for end in begin..=whole.len() {
        let cut = tempfile::tempdir().unwrap();
        std::fs::write(cut.path().join("study.log"), &whole[..end]).unwrap();
        let mut later = open(cut.path());
        let queue = search(&mut later).queue;
        let points: Vec<_> = queue
            .iter()
            .map(|point| (point.parameters.get("Fx").unwrap(), point.gains.get("kp") == Some(500.0)))
            .collect();
        if seen.last() != Some(&points) {
            seen.push(points);
        }
    }
    let [a, b, c] = [(10.0, false), (20.0, true), (30.0, false)];
    assert_eq!(seen, [vec![a, b, c], vec![a, c, b], vec![c, a, b], vec![a, b]]);
}

/// Regression: a point that was queued while the last verdict could be taken back took the number of the re-run that was proposed.
#[test]
fn a_point_queued_after_a_rerun_comes_behind_it() {
    let mut experiment = experiment(20);
    let spec = run(&mut experiment, TrialEnd::Fell(FallCause::BodyContact));
    experiment.judge(Verdict::Void, true).unwrap();
    let proposed = experiment.proposal().unwrap();
    experiment.enqueue(&[("Fx".into(), 77.0)]).unwrap();
    let now = experiment.proposal().unwrap();
    assert_eq!((now.trial, now.source, now.parent), (proposed.trial, ProposalSource::Rerun, Some(spec.trial)));
    let queue: Vec<u32> = search(&mut experiment).queue.iter().map(|point| point.trial).collect();
    assert_eq!(queue, [proposed.trial, proposed.trial + 1]);
    assert!(experiment.undo().is_err(), "the verdict is final with its re-run in the queue");
    // The re-run can be removed like any other point, also at once.
    experiment.remove_queued(proposed.trial).unwrap();
    assert_eq!(value(&experiment, "Fx"), 77.0);
}

/// Regression: of points that another program queued behind the proposal a session showed none before its next jump.
#[test]
fn points_queued_elsewhere_behind_the_proposal_are_seen() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let mut other = study_in(folder.path());
    for fx_n in [10.0, 20.0, 30.0] {
        other.enqueue(&[("Fx".into(), fx_n)], &[]).unwrap();
        experiment.refresh().unwrap();
    }
    assert_eq!(value(&experiment, "Fx"), 10.0);
    let shown = |experiment: &mut Experiment| -> Vec<f64> {
        search(experiment).queue.iter().filter_map(|point| point.parameters.get("Fx")).collect()
    };
    assert_eq!(shown(&mut experiment), [10.0, 20.0, 30.0]);
    other.exchange_waiting(1, 2).unwrap();
    let revision = experiment.proposal().unwrap().revision;
    experiment.refresh().unwrap();
    assert_eq!(shown(&mut experiment), [10.0, 30.0, 20.0]);
    assert_eq!(experiment.proposal().unwrap().revision, revision, "the proposal stays");
}

/// Regression: a point whose removal from the queue was cut off by a kill, and which ran later and was interrupted, was void for good.
#[test]
fn a_point_whose_removal_was_cut_off_is_queued_again_after_an_interruption() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    experiment.enqueue(&[("Fx".into(), 77.0)]).unwrap();
    // The lines that a killed removal may leave: the verdict, and not the state.
    study_in(folder.path()).annotate(0, &[("verdict".to_owned(), serde_json::json!("void"))]).unwrap();
    experiment.refresh().unwrap();
    let proposal = experiment.proposal().unwrap();
    experiment.approve(proposal.trial, proposal.revision).unwrap();
    drop(experiment);
    let experiment = open(folder.path());
    let proposal = experiment.proposal().unwrap();
    assert_eq!((proposal.parent, value(&experiment, "Fx")), (Some(0), 77.0));
}

/// Regression: the void first trial of a contender left its point out of the comparison although its repeats stand, and a worse
/// point led with full confidence.
#[test]
fn a_contender_whose_first_trial_becomes_void_is_compared_by_its_repeats() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = open(folder.path());
    let run_to = |experiment: &mut Experiment, value: f64| {
        let spec = approve(experiment);
        experiment.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, value), 2);
        experiment.judge(Verdict::Accept, false).unwrap();
    };
    for value in [0.9, 0.5, 0.3] {
        run_to(&mut experiment, value);
    }
    experiment.confirm_best(20).unwrap();
    let mut noise = 0.0;
    while let Some(parent) =
        experiment.proposal().filter(|p| p.source == ProposalSource::Confirm).and_then(|p| p.parent)
    {
        noise += 0.001;
        run_to(&mut experiment, [0.9, 0.5, 0.3][parent as usize] + noise);
    }
    experiment.close().unwrap();
    experiment.change_verdict(0, Verdict::Void, "wrong battery").unwrap();
    let words = confirmation_in_words(&judged(&study_in(folder.path())).unwrap(), 0.95).unwrap();
    let best = experiment.best().unwrap();
    assert!(best.value.unwrap() > 0.8 && best.trial > 0, "{best:?}");
    assert!(words.starts_with(&format!("the point of trial {} leads", best.trial)), "{words}");
    assert!(words.contains("mean 0.90"), "{words}");
}
