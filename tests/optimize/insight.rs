//! Results for the operator: densities, falls nearby, repeats, the best trial and its confirmation.

use quadfrog::optimize::ask::{Direction, SamplerConfig};
use quadfrog::optimize::insight::{FallProximity, densities};
use quadfrog::optimize::mt19937::Mt19937;
use quadfrog::optimize::repeats::{Confirmation, RepeatedPoint, best, confirm, contenders, points, student_cdf};
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::trial::{Distribution, FALL, Trial, TrialState, VERDICT};

fn space() -> Space {
    Space::new([("f0".into(), Range::linear(0.75, 1.75)), ("Fz".into(), Range::logarithmic(150.0, 350.0))]).unwrap()
}

fn trial(number: u32, u: [f64; 2], value: f64, fell: bool) -> Trial {
    let mut trial = Trial::new(number, TrialState::Complete);
    for (p, u) in space().parameters().iter().zip(u) {
        trial.set(&p.name, p.range.unscale(u), Distribution::Float(p.range));
    }
    trial.value = Some(value);
    if fell {
        trial.user_attributes.insert(VERDICT.into(), FALL.into());
    }
    trial
}

/// Trials scattered over the space; those with u1 + u2 > 1.3 fell.
fn history(count: u32) -> Vec<Trial> {
    let mut stream = Mt19937::new(9);
    let point = |i| {
        let u = [stream.double(), stream.double()];
        let fell = u[0] + u[1] > 1.3;
        trial(i, u, if fell { 0.0 } else { u[0] + u[1] }, fell)
    };
    (0..count).map(point).collect()
}

#[test]
fn both_densities_have_mass_one_over_the_range() {
    for multivariate in [true, false] {
        for count in [0, 1, 12, 60] {
            let config = SamplerConfig { multivariate, ..SamplerConfig::default() };
            let all = densities(&config, &history(count), &space(), Direction::Maximize, 20_001);
            assert_eq!(all.iter().map(|d| d.name.as_str()).collect::<Vec<_>>(), ["f0", "Fz"]);
            for d in all {
                for density in [&d.good, &d.bad] {
                    let trapezoid = |i: usize| 0.5 * (density[i] + density[i - 1]) * (d.at[i] - d.at[i - 1]);
                    let mass = (1..d.at.len()).map(trapezoid).sum::<f64>();
                    assert!((mass - 1.0).abs() < 1e-4, "{} after {count} trials: mass {mass}", d.name);
                }
            }
        }
    }
}

#[test]
fn the_good_density_is_high_where_the_good_trials_are() {
    let trials: Vec<Trial> = (0..40).map(|i| trial(i, [f64::from(i) / 40.0, 0.5], -f64::from(i), false)).collect();
    let config = SamplerConfig::default();
    let density = &densities(&config, &trials, &space(), Direction::Maximize, 11)[0];
    assert!(density.good[1] > density.bad[1] && density.good[9] < density.bad[9], "{density:?}");
}

#[test]
fn the_falls_among_the_nearest_trials_are_counted() {
    let trials = history(40);
    let at = |u: [f64; 2]| trial(99, u, 0.0, false).parameters;
    let safe = FallProximity::of(&at([0.1, 0.1]), &trials, &space());
    assert_eq!((safe.fell_near, safe.neighbours), (0, 5));
    let edge = FallProximity::of(&at([0.95, 0.95]), &trials, &space());
    assert_eq!((edge.fell_near, edge.neighbours), (5, 5));
    assert!(edge.falls[0].1 < safe.falls[0].1);
    assert_eq!(edge.falls.len(), trials.iter().filter(|t| t.is_fall()).count());
    assert!(edge.falls.is_sorted_by(|a, b| a.1 <= b.1));

    // Distances by hand, in scaled units: 0.3 along one axis, 0.4 along the logarithmic one.
    let one = [trial(0, [0.5, 0.9], 0.0, true)];
    let proximity = FallProximity::of(&at([0.2, 0.5]), &one, &space());
    assert_eq!(proximity.falls[0].0, 0);
    assert!((proximity.falls[0].1 - 0.5).abs() < 1e-12);
    assert_eq!(proximity.attributes()[1].1, "1/1");
    assert!(FallProximity::of(&at([0.2, 0.5]), &[], &space()).attributes()[0].1.is_null());
}

#[test]
fn repeats_are_one_point() {
    let trials = [
        trial(0, [0.1, 0.2], 1.0, false),
        trial(1, [0.3, 0.2], 5.0, false),
        trial(2, [0.1, 0.2], 3.0, false),
        trial(3, [0.1, 0.2], 0.0, true),
    ];
    let all = points(&trials);
    assert_eq!(all.len(), 2);
    assert_eq!((all[0].trials.as_slice(), all[0].without_fall, all[0].repeats()), ([0, 2, 3].as_slice(), 2, 3));
    assert!((all[0].mean() - 4.0 / 3.0).abs() < 1e-15);
    assert!((all[0].deviation().unwrap() - (7.0_f64 / 3.0).sqrt()).abs() < 1e-12);
    assert_eq!(all[1].deviation(), None);
    assert_eq!(contenders(&trials, Direction::Maximize, 1, None)[0].trials, [1]);
    assert_eq!(contenders(&trials, Direction::Minimize, 1, None)[0].trials, [0, 2, 3]);
    // The trial that a model calls the best is compared whatever its value.
    let by_model = contenders(&trials, Direction::Maximize, 2, Some(3));
    assert_eq!(by_model.iter().map(|point| point.trials[0]).collect::<Vec<_>>(), [0, 1]);
    assert_eq!(contenders(&trials, Direction::Maximize, 1, Some(3))[0].trials, [0, 2, 3]);
}

#[test]
fn the_best_trial_is_that_of_the_best_mean_and_did_not_fall() {
    let number = |trials: &[Trial], direction| best(trials, direction).map(|trial| trial.number);
    let lucky_once = [
        trial(0, [0.1, 0.2], 9.0, false),
        trial(1, [0.3, 0.2], 5.0, false),
        trial(2, [0.1, 0.2], 0.0, true),
        trial(3, [0.5, 0.2], 5.0, false),
    ];
    assert_eq!(number(&lucky_once, Direction::Maximize), Some(1), "mean 4.5 of 2; of equals the earliest");
    assert_eq!(number(&lucky_once, Direction::Minimize), Some(0), "a fall is never the best");
    assert_eq!(number(&lucky_once[2..3], Direction::Maximize), None);
    let unknown = Trial { value: Some(f64::NAN), ..trial(0, [0.1, 0.1], 0.0, false) };
    assert_eq!(number(&[unknown, trial(1, [0.3, 0.2], 5.0, false)], Direction::Maximize), Some(1));
}

#[test]
fn students_distribution_is_that_of_the_tables() {
    // scipy.stats.t.cdf
    for (freedom, t, theirs) in [
        (1, 0.5, 0.6475836176504333),
        (1, 6.0, 0.9474315432887466),
        (2, 0.5, 0.6666666666666666),
        (3, 2.0, 0.9303370157205785),
        (4, 6.0, 0.9980587314765197),
        (5, 2.0, 0.9490302605850708),
        (6, 0.5, 0.6825600000000001),
        (9, 6.0, 0.9998987503389661),
        (30, 2.0, 0.9726874775185085),
    ] {
        let ours = student_cdf(t, freedom);
        assert!((ours - theirs).abs() < 1e-12, "t {t}, {freedom} degrees of freedom: {ours}, not {theirs}");
    }
}

/// A normal deviate (Box and Muller).
fn normal(stream: &mut Mt19937) -> f64 {
    (-2.0 * (1.0 - stream.double()).ln()).sqrt() * (std::f64::consts::TAU * stream.double()).cos()
}

/// Confirms among three points of given true means; returns the leader, if any, and the number of repeats.
fn confirmation(truth: [f64; 3], noise: f64, budget: usize, stream: &mut Mt19937) -> (Option<usize>, usize) {
    let mut run = |i: usize| truth[i] + noise * normal(stream);
    let mut contenders: Vec<RepeatedPoint> =
        (0..3).map(|i| RepeatedPoint { values: vec![run(i)], ..RepeatedPoint::default() }).collect();
    for repeats in 0..budget {
        match confirm(&contenders, Direction::Maximize, 0.95) {
            Confirmation::Leads(i, confidence) => {
                assert!(confidence >= 0.95);
                return (Some(i), repeats);
            }
            Confirmation::Repeat(i) => contenders[i].values.push(run(i)),
        }
    }
    (None, budget)
}

#[test]
fn the_best_is_confirmed_and_seldom_a_wrong_one() {
    let mut stream = Mt19937::new(1);
    let outcomes: Vec<(Option<usize>, usize)> =
        (0..500).map(|_| confirmation([0.50, 0.55, 0.45], 0.03, 60, &mut stream)).collect();
    let right = outcomes.iter().filter(|(led, _)| *led == Some(1)).count();
    let wrong = outcomes.iter().filter(|(led, _)| led.is_some_and(|i| i != 1)).count();
    let mean = outcomes.iter().map(|(_, n)| *n as f64).sum::<f64>() / 500.0;
    println!("confirm: {right} of 500 right, {wrong} wrong, {mean:.1} repeats in the mean");
    assert!(right >= 460, "{right} right");
    assert!(wrong <= 25, "{wrong} wrong");
}

#[test]
fn equal_contenders_use_up_the_budget_and_no_noise_is_certain() {
    let mut stream = Mt19937::new(2);
    let undecided = (0..200).filter(|_| confirmation([0.5; 3], 0.03, 30, &mut stream).0.is_none()).count();
    println!("confirm: {undecided} of 200 equal triples undecided after 30 repeats");
    assert!(undecided >= 120, "{undecided}");
    assert_eq!(confirmation([0.5, 0.6, 0.4], 0.0, 60, &mut stream), (Some(1), 6));
    assert_eq!(confirm(&[], Direction::Maximize, 0.95), Confirmation::Leads(0, 1.0));
}

/// Regression: a NaN was equal to every value, which is no order: sorting points or trials with such values panicked. Points with an
/// infinite value of either sign had the mean NaN.
#[test]
fn values_that_are_no_numbers_come_last_and_make_no_point() {
    for direction in [Direction::Maximize, Direction::Minimize] {
        assert!(direction.best_first(f64::NAN, 1.0).is_gt() && direction.best_first(1.0, f64::NAN).is_lt());
        assert!(direction.best_first(f64::NAN, f64::NAN).is_eq() && direction.best_first(0.0, -0.0).is_eq());
        // A fixed permutation of 200 places.
        let value = |i: u32| match (i * 77) % 200 {
            place if place % 3 == 0 => f64::NAN,
            place if place % 7 == 0 => f64::INFINITY,
            place if place % 11 == 0 => f64::NEG_INFINITY,
            place => f64::from(place),
        };
        let at = |i: u32| f64::from(i % 100) / 100.0;
        let trials: Vec<Trial> =
            (0..200).map(|i| Trial { value: Some(value(i)), ..trial(i, [at(i), 0.5], 0.0, false) }).collect();
        let points = contenders(&trials, direction, usize::MAX, None);
        assert!(points.iter().all(|point| point.mean().is_finite()), "{points:?}");
        let sorted = points.windows(2).all(|pair| direction.best_first(pair[0].mean(), pair[1].mean()).is_le());
        assert!(sorted && points.len() > 10);
        let split = quadfrog::optimize::tpe::split(&trials, direction);
        assert!(split.good.iter().all(|trial| !trial.value.unwrap().is_nan()));
    }
}
