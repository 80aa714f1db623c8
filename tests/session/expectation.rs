//! Expectation of the sampler's model of a trial, before it runs and afterwards: in the proposal, the row, the journal, and the
//! best trial that follows from it.

use crate::support;
use std::sync::Arc;

use quadfrog::config::Config;
use quadfrog::engine::{STUDY_FILE, open_stored};
use quadfrog::optimize::ask::{SamplerConfig, SamplerKind};
use quadfrog::optimize::exchange::TableTrial;
use quadfrog::optimize::mt19937::Mt19937;
use quadfrog::optimize::prior::{Prior, PriorModel, World};
use quadfrog::optimize::sobol::Sobol;
use quadfrog::optimize::space::{Parameter, Range};
use quadfrog::optimize::study::{Storage, Study, StudyOptions};
use quadfrog::recording::record::Record;
use quadfrog::session::experiment::{Experiment, import};
use quadfrog::telemetry::TrialEnd;
use quadfrog::trial::{ExperimentStage, ProposalInsight, Verdict};
use support::{approve, far, imported, plan, ticks};

fn study(kind: SamplerKind, storage: Storage) -> Study {
    let options = support::study(Storage::Memory).options().clone();
    let sampler = SamplerConfig { kind, startup_trials: Some(4), ..SamplerConfig::default() };
    Study::open(storage, StudyOptions { sampler, ..options }).unwrap()
}

/// Runs `trials` trials; the jumps of the trials `lucky` are measured 0.3 m too long.
fn run(experiment: &mut Experiment, trials: u32, lucky: &[u32]) {
    for _ in 0..trials {
        let spec = approve(experiment);
        let extra_m = if lucky.contains(&spec.trial) { 0.3 } else { 0.0 };
        experiment.ended(spec.trial, &TrialEnd::Settled, &ticks(spec.trial, far(&spec) + extra_m), 2);
        experiment.judge(Verdict::Accept, false).unwrap();
    }
}

fn newest_insight(experiment: &mut Experiment) -> ProposalInsight {
    let mut insights = experiment.take_records().into_iter().filter_map(|record| match record {
        Record::Insight(insight) => Some(insight),
        _ => None,
    });
    insights.next_back().unwrap()
}

#[test]
fn a_model_says_what_it_expects_and_the_row_keeps_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("study.log");
    let mut experiment = Experiment::open(plan(12), study(SamplerKind::Gp, Storage::File(file.clone()))).unwrap();
    assert_eq!(experiment.proposal().unwrap().expected, None, "four trials are drawn without a model");
    run(&mut experiment, 8, &[]);
    let proposal = experiment.proposal().unwrap();
    let expected = proposal.expected.unwrap();
    assert!(expected.value.is_finite() && expected.deviation > 0.0 && expected.p_stand == 1.0, "{expected:?}");
    run(&mut experiment, 1, &[]);
    assert_eq!(experiment.row(proposal.trial).unwrap().expected, Some(expected));
    experiment.close().unwrap();
    // The journal has them as numbers, and a row that is read from it is the same.
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains(&format!("\"predicted\":{}", expected.value)), "{text}");
    let again = Experiment::open(plan(12), study(SamplerKind::Gp, Storage::File(file))).unwrap();
    assert_eq!(again.row(proposal.trial).unwrap().expected, Some(expected));
}

#[test]
fn an_override_changes_the_expectation() {
    let mut experiment = Experiment::open(plan(12), study(SamplerKind::Gp, Storage::Memory)).unwrap();
    run(&mut experiment, 8, &[]);
    let before = experiment.proposal().unwrap();
    let value = before.parameters[1].value;
    let other = if value > 75.0 { value - 60.0 } else { value + 60.0 };
    experiment.set_parameter("Fx", other).unwrap();
    let after = experiment.proposal().unwrap();
    assert_ne!(after.expected.unwrap().value, before.expected.unwrap().value);
    run(&mut experiment, 1, &[]);
    assert_eq!(experiment.row(after.trial).unwrap().expected, after.expected);
}

/// Regression: a waiting proposal went on to say what had been expected of it before another program added results.
#[test]
fn the_expectation_of_a_waiting_proposal_is_that_of_the_results_that_another_program_adds() {
    for kind in [SamplerKind::Gp, SamplerKind::Sim] {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("study.log");
        let mut ours = study(kind, Storage::File(file.clone()));
        ours.use_prior(prior([0.8, 1.0, 1.6]));
        let mut experiment = Experiment::open(plan(12), ours).unwrap();
        run(&mut experiment, 8, &[]);
        let before = experiment.proposal().unwrap();
        let near = [0, 1, 2].map(|i| before.parameters[i].value + [0.01, 1.0, 1.0][i]);
        import(&mut study(kind, Storage::File(file)), vec![imported(near, 0.2)]).unwrap();
        experiment.refresh().unwrap();
        let now = experiment.proposal().unwrap();
        assert_eq!((now.revision, &now.parameters), (before.revision, &before.parameters));
        let (was, is) = (before.expected.unwrap(), now.expected.unwrap());
        assert!(is.value < was.value - 0.05, "{kind:?}: {was:?}, then {is:?}");
        let shown = experiment.take_records().into_iter().rev().find_map(|record| match record {
            Record::Proposal(proposal) => proposal.expected,
            _ => None,
        });
        assert_eq!(shown, Some(is));
        let spec = experiment.approve(now.trial, now.revision).unwrap();
        assert_eq!(experiment.row(spec.trial).unwrap().expected, Some(is));
    }
}

/// Regression: a change of one value took away the advice that no gain is worth its risk, as if the search had learned of one.
#[test]
fn the_advice_to_end_the_search_outlasts_an_override() {
    let mut study = study(SamplerKind::Sim, Storage::Memory);
    study.use_prior(prior([0.8, 1.0, 1.6]));
    let mut experiment = Experiment::open(plan(60), study).unwrap();
    let advises = |experiment: &Experiment| experiment.proposal().unwrap().expected.unwrap().advises_to_stop;
    while !advises(&experiment) {
        run(&mut experiment, 1, &[]);
    }
    let value = experiment.proposal().unwrap().parameters[1].value;
    experiment.set_parameter("Fx", value - 10.0).unwrap();
    assert!(advises(&experiment));
}

/// Regression: the reported best was the luckiest jump, 14 % above the mean of its repeats on the hardware-like robot.
#[test]
fn the_best_of_a_study_with_a_model_is_the_best_mean_and_not_the_luckiest_jump() {
    let mut experiment = Experiment::open(plan(30), study(SamplerKind::Gp, Storage::Memory)).unwrap();
    run(&mut experiment, 20, &[2]);
    let luckiest = experiment.row(2).unwrap().value.unwrap();
    assert!(experiment.rows().all(|row| row.value.unwrap() <= luckiest), "trial 2 has the largest value");
    let insight = newest_insight(&mut experiment);
    let best = experiment.best().unwrap().trial;
    assert_ne!(best, 2);
    assert_eq!(insight.best, Some(best));
    assert_eq!(insight.predicted.len(), 20);
    let mean = |trial| insight.predicted.iter().find(|predicted| predicted.trial == trial).unwrap().value;
    assert!(insight.predicted.iter().all(|predicted| predicted.value <= mean(best)));
    let model = experiment.model_best().unwrap();
    assert_eq!((model.trial, model.predicted, model.learned), (best, mean(best), 20));
}

/// Regression: the repeats compared the highest jumps, and left out the trial that every screen and report calls the best.
#[test]
fn the_best_by_a_model_is_among_the_repeated_points() {
    let mut experiment = Experiment::open(plan(30), study(SamplerKind::Gp, Storage::Memory)).unwrap();
    run(&mut experiment, 20, &[2, 5, 9]);
    let best = experiment.best().unwrap().trial;
    let value = |trial| experiment.row(trial).unwrap().value.unwrap();
    assert!(experiment.rows().filter(|row| value(row.trial) > value(best)).count() >= 3);
    let repeated = experiment.confirm_best(10).unwrap();
    assert_eq!((repeated[0], repeated.len()), (best, 3));
}

#[test]
fn a_stored_study_has_the_best_of_its_model_until_another_trial_ends() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("study.log");
    let mut experiment = Experiment::open(plan(20), study(SamplerKind::Gp, Storage::File(file.clone()))).unwrap();
    run(&mut experiment, 20, &[2]);
    let best = experiment.best().unwrap().trial;
    experiment.close().unwrap();
    let mut stored = study(SamplerKind::Tpe, Storage::File(file));
    assert_eq!(stored.best().unwrap().number, best);
    let (draft, value) = (stored.draft(), 0.1);
    let number = stored.begin(&draft, &[], &[]).unwrap();
    stored.tell(number, quadfrog::optimize::study::Outcome::Complete(value)).unwrap();
    assert_eq!(stored.model_best(), None);
    assert_eq!(stored.best().unwrap().number, 2, "by value, since the model has not learned the newest trial");
}

/// Three simulated robots that jump as the test's robot does, times a factor.
fn prior(factors: [f64; 3]) -> Arc<PriorModel> {
    let sobol = Sobol::new(3, &mut Mt19937::new(1));
    let points: Vec<Vec<f64>> = (0..96).map(|index| sobol.point(index)).collect();
    let parameters =
        support::BOUNDS.map(|(name, low, high)| Parameter { name: name.into(), range: Range::linear(low, high) });
    let value = |point: &Vec<f64>| {
        let at = |i: usize| parameters[i].range.unscale(point[i]);
        let (f, x, z) = (at(0) - 1.2, at(1) / 150.0 - 0.7, at(2) / 350.0 - 0.6);
        0.7 - f * f - x * x - z * z
    };
    let world = |(index, factor): (usize, f64)| World {
        name: format!("world {index}"),
        values: points.iter().map(|point| Some(factor * value(point))).collect(),
    };
    let worlds = factors.into_iter().enumerate().map(world).collect();
    Arc::new(PriorModel::new(Prior::new(parameters.to_vec(), points, worlds, None)))
}

#[test]
fn the_sampler_sim_expects_from_the_first_jump_on_and_compares_robot_and_simulator() {
    let mut study = study(SamplerKind::Sim, Storage::Memory);
    study.use_prior(prior([0.8, 1.0, 1.6]));
    let mut experiment = Experiment::open(plan(12), study).unwrap();
    let expected = experiment.proposal().unwrap().expected.expect("the prior knows before the first jump");
    let (least, most) = (expected.simulated_least.unwrap(), expected.simulated_most.unwrap());
    assert!(least < most && (least..=most).contains(&expected.value), "{expected:?}");
    run(&mut experiment, 6, &[]);
    let insight = newest_insight(&mut experiment);
    let simulator = insight.simulator.unwrap();
    assert!(!simulator.contradicted && simulator.ratio_deviation > 0.0 && simulator.bias_deviation > 0.0);
    assert_eq!(simulator.worlds[0].name, "world 1", "the robot is that of factor 1: {simulator:?}");
    let sum: f64 = simulator.worlds.iter().map(|world| world.weight).sum();
    assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    let best = experiment.best().unwrap();
    assert!(best.value.unwrap() > 0.66, "six jumps reach {best:?} of 0.7 m");
}

/// `sim` proposes as `gp` where it has no model, and not silently.
#[test]
fn a_proposal_of_sim_without_its_model_is_in_the_log() {
    for (known, lines) in [(false, 1), (true, 0)] {
        let mut study = study(SamplerKind::Sim, Storage::Memory);
        if known {
            study.use_prior(prior([0.8, 1.0, 1.6]));
        }
        let mut experiment = Experiment::open(plan(12), study).unwrap();
        let says = |record: &Record| matches!(record, Record::Log(log) if log.message.contains("proposed as by gp"));
        assert_eq!(experiment.take_records().iter().filter(|record| says(record)).count(), lines);
    }
}

#[test]
fn a_sampler_without_a_model_expects_nothing() {
    for kind in [SamplerKind::Tpe, SamplerKind::Random, SamplerKind::Sobol] {
        let mut experiment = Experiment::open(plan(12), study(kind, Storage::Memory)).unwrap();
        run(&mut experiment, 8, &[]);
        assert_eq!(experiment.proposal().unwrap().expected, None);
        assert_eq!(experiment.model_best(), None);
        let insight = newest_insight(&mut experiment);
        assert!(insight.predicted.is_empty() && insight.best.is_none() && insight.simulator.is_none());
    }
}

/// Regression: as long as a verdict could be taken back, readers chose the best trial without the model, and the session with it.
#[test]
fn readers_have_the_best_of_the_session_by_the_model_after_every_verdict_and_after_an_import() {
    let folder = tempfile::tempdir().unwrap();
    let storage = || Storage::File(folder.path().join(STUDY_FILE));
    let mut experiment = Experiment::open(plan(9), study(SamplerKind::Gp, storage())).unwrap();
    let agree = |experiment: &Experiment, when: &str| {
        let opened = open_stored(&storage(), None, &Config::load(None).unwrap()).unwrap();
        assert_eq!(opened.model_best(), experiment.model_best(), "{when}");
        let best = opened.best(&opened.rows()).map(|best| best.trial);
        assert_eq!(best, experiment.best().map(|best| best.trial), "{when}");
    };
    for trial in 0..8 {
        run(&mut experiment, 1, &[5]);
        agree(&experiment, &format!("after trial {trial}"));
    }
    experiment.undo().unwrap();
    agree(&experiment, "after the undo");
    experiment.judge(Verdict::Fall, false).unwrap();
    agree(&experiment, "judged a fall");
    run(&mut experiment, 1, &[]);
    assert_eq!(experiment.stage(), ExperimentStage::Finished);
    agree(&experiment, "with the last trial");
    let opened = open_stored(&storage(), None, &Config::load(None).unwrap()).unwrap();
    let best = opened.rows().into_iter().find(|row| Some(row.trial) == opened.model_best().map(|best| best.trial));
    let table = TableTrial { parameters: best.unwrap().parameters.to_vec(), ..imported([0.0; 3], 5.0) };
    let imported = import(&mut study(SamplerKind::Gp, storage()), vec![table]).unwrap();
    experiment.refresh().unwrap();
    assert_eq!(experiment.model_best().map(|best| best.learned), Some(10));
    assert!(experiment.row(imported[0]).is_some());
    agree(&experiment, "after the import");
}
