//! Asking and telling by lines of JSON: each line has one answer, errors change nothing, no line ends the program.

use std::io::{BufReader, Cursor};
use std::sync::atomic::AtomicBool;

use proptest::prelude::*;
use quadfrog::config::{Config, ConfigLayer};
use quadfrog::engine::{Options, PriorMaker, open_study};
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::study::{Outcome, Study};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::ask_tell::{AskTell, LONGEST_LINE};
use quadfrog::trial::{Backend, Task};
use serde_json::{Value, json};

fn options(kind: SamplerKind) -> Options {
    let layer = ConfigLayer { file: "prior.toml", origin: "the test", text: "worlds = 2\npoints = 16" };
    let mut config = Config::layered(&[layer]).unwrap();
    config.choose_sampler(kind);
    let robot = RobotDescription::embedded("go1").unwrap();
    Options { seed: 3, ..Options::new(config, robot, Backend::Simulator, Task::Forward) }
}

fn study(kind: SamplerKind) -> Study {
    open_study(&options(kind), Durability::Buffered).unwrap()
}

fn answer(served: &mut AskTell, line: &str) -> Value {
    serde_json::from_str(&served.answer(line.as_bytes())).unwrap()
}

fn error(served: &mut AskTell, line: &str) -> String {
    let answer = answer(served, line);
    assert_eq!(answer.as_object().unwrap().len(), 1, "{answer}");
    answer["error"].as_str().unwrap_or_else(|| panic!("{line}: {answer}")).to_owned()
}

/// Regression: predictions that were not finite made the worst trial the best.
#[test]
fn values_of_any_size_do_not_make_the_worst_trial_the_best() {
    let mut served = AskTell::new(study(SamplerKind::Gp));
    for number in 0..10 {
        answer(&mut served, r#"{"ask":{}}"#);
        let value = if number % 2 == 0 { -1e200 } else { -0.5 };
        answer(&mut served, &json!({"tell": {"number": number, "value": value, "verdict": "accept"}}).to_string());
    }
    let best = answer(&mut served, r#"{"best":{}}"#);
    assert_eq!(best["value"], json!(-0.5), "{best}");
}

/// Regression: the squares of values beyond 1e154 or below 1e-162 are no numbers or 0. `gp` then learned nothing from them.
#[test]
fn values_of_any_scale_are_learned_from() {
    for scale in [1e-300, 1e300] {
        let mut served = AskTell::new(study(SamplerKind::Gp));
        for number in 0..20 {
            let asked = answer(&mut served, r#"{"ask":{}}"#);
            let value = scale * asked["params"]["Fx"].as_f64().unwrap() / 150.0;
            let predicted = asked["predicted"].as_f64().map(|predicted| (predicted - value) / scale);
            assert!(number < 12 || predicted.unwrap().abs() < 0.05, "{asked} instead of {value}");
            answer(&mut served, &json!({"tell": {"number": number, "value": value, "verdict": "accept"}}).to_string());
        }
    }
}

/// The points are those of a study that runs the same trials, two of them open at the same time.
#[test]
fn the_points_are_those_of_a_study_with_the_same_results() {
    for kind in [SamplerKind::Tpe, SamplerKind::Gp] {
        let mut served = AskTell::new(study(kind));
        let mut same = study(kind);
        let mut open = Vec::new();
        for number in 0..14_u32 {
            let asked = answer(&mut served, r#"{"ask":{}}"#);
            let draft = same.draft();
            assert_eq!(same.begin(&draft, &[], &[]).unwrap(), number);
            assert_eq!(asked["number"], json!(number));
            for parameter in &draft.parameters {
                assert_eq!(asked["params"][&parameter.name].as_f64(), Some(parameter.value), "{asked}");
            }
            assert_eq!(asked["predicted"].as_f64(), draft.expected.map(|expected| expected.value));
            assert_eq!(asked["p_stand"].as_f64(), draft.expected.map(|expected| expected.p_stand));
            open.push((number, draft.parameters[1].value / 150.0));
            if number % 3 == 0 {
                continue;
            }
            for (number, value) in open.drain(..) {
                let line = json!({ "tell": { "number": number, "value": value, "verdict": "accept" } }).to_string();
                assert_eq!(answer(&mut served, &line), json!({ "told": number, "verdict": "accept", "value": value }));
                same.annotate(number, &[("verdict".to_owned(), "accept".into())]).unwrap();
                same.tell(number, Outcome::Complete(value)).unwrap();
            }
        }
    }
}

/// The price of a fall is that of the task in the configuration, and on record.
#[test]
fn a_study_has_the_price_of_a_fall_of_its_task() {
    let layer = ConfigLayer { file: "optimize.toml", origin: "the test", text: "[fall_price]\ntwist-cw = 0.3" };
    let config = Config::layered(&[layer]).unwrap();
    for (task, price) in [(Task::Forward, 0.05), (Task::LateralRight, 0.5), (Task::TwistCw, 0.3)] {
        let study =
            open_study(&Options { config: config.clone(), task, ..options(SamplerKind::Gp) }, Durability::Buffered);
        let study = study.unwrap();
        assert_eq!(study.options().sampler.fall_price, price, "{task:?}");
        assert_eq!(study.attributes()["sampler"]["fall_price"], json!(price), "{task:?}");
    }
}

#[test]
fn a_sampler_with_a_prior_predicts_its_first_point() {
    let mut options = options(SamplerKind::Sim);
    let maker = PriorMaker::new(&options.config, &options.robot, options.task, options.backend).unwrap();
    options.prior = Some(maker.make(2, &|_| (), &AtomicBool::new(false)).unwrap().model);
    let mut served = AskTell::new(open_study(&options, Durability::Buffered).unwrap());
    let asked = answer(&mut served, r#"{"ask":{}}"#);
    let p_stand = asked["p_stand"].as_f64().unwrap_or_else(|| panic!("{asked}"));
    assert!((0.0..=1.0).contains(&p_stand) && asked["predicted"].is_f64(), "{asked}");
}

#[test]
fn falls_and_voids_are_told_and_errors_change_nothing() {
    let mut served = AskTell::new(study(SamplerKind::Random));
    for number in 0..3 {
        let asked = answer(&mut served, r#" {"ask": {} } "#);
        assert_eq!(
            (&asked["number"], &asked["p_stand"], &asked["predicted"]),
            (&json!(number), &Value::Null, &Value::Null)
        );
    }
    for (line, expected) in [
        (r#"{"tell":{"number":1,"verdict":"accept"}}"#, "the verdict accept needs a value"),
        (r#"{"tell":{"number":9,"value":1.0,"verdict":"accept"}}"#, "has no trial 9"),
        (r#"{"tell":{"number":1,"value":1e999,"verdict":"accept"}}"#, "number out of range"),
        (r#"{"tell":{"number":1,"value":NaN,"verdict":"accept"}}"#, "expected value"),
        (r#"{"tell":{"number":1,"value":1.0,"verdict":"good"}}"#, "unknown variant `good`"),
        (r#"{"tell":{"number":1,"value":1.0,"verdict":"accept","note":"x"}}"#, "unknown field `note`"),
        (r#"{"tell":{"number":-1,"value":1.0,"verdict":"accept"}}"#, "invalid value"),
        (r#"{"ask":{"seed":1}}"#, "unknown field `seed`"),
        (r#"{"ask":{},"tell":{}}"#, "expected"),
        (r#"{"stop":{}}"#, "unknown variant `stop`"),
        ("", "EOF"),
        ("ask", "expected value"),
    ] {
        let reason = error(&mut served, line);
        assert!(reason.contains(expected), "{line}: {reason}");
    }
    let told = answer(&mut served, r#"{"tell":{"number":1,"value":0.7,"verdict":"fall"}}"#);
    assert_eq!(told, json!({ "told": 1, "verdict": "fall", "value": 0.0 }));
    assert!(error(&mut served, r#"{"tell":{"number":1,"verdict":"void"}}"#).contains("trial 1 was told before"));
    assert_eq!(answer(&mut served, r#"{"tell":{"number":0,"verdict":"void"}}"#)["value"], Value::Null);
    assert_eq!(answer(&mut served, r#"{"tell":{"number":2,"value":-0.5,"verdict":"accept"}}"#)["value"], json!(-0.5));
    assert_eq!(answer(&mut served, r#"{"ask":{}}"#)["number"], json!(3));
}

/// Regression: the result of a queued point, for which nobody had asked, was refused with "told before".
/// Regression: values without their keys were taken by their order.
#[test]
fn a_list_in_place_of_an_object_is_refused() {
    let mut served = AskTell::new(study(SamplerKind::Random));
    answer(&mut served, r#"{"ask":{}}"#);
    for line in [r#"{"ask":[]}"#, r#"{"best":[]}"#, r#"{"tell":[0,0.5,"accept"]}"#, r#"{"tell":[0,null,"fall"]}"#] {
        let error = error(&mut served, line);
        assert!(error.contains("a map") && error.contains(r#"give {"ask":{}}"#), "{line}: {error}");
    }
    assert_eq!(answer(&mut served, r#"{"ask":{}}"#)["number"], json!(1));
    assert_eq!(answer(&mut served, r#"{"tell":{"number":0,"verdict":"fall"}}"#)["told"], json!(0));
}

#[test]
fn a_result_of_a_queued_point_asks_for_the_point_first() {
    let mut queued = study(SamplerKind::Gp);
    queued.enqueue(&[("Fx".into(), 77.0)], &[]).unwrap();
    let mut served = AskTell::new(queued);
    let tell = r#"{"tell":{"number":0,"value":0.5,"verdict":"accept"}}"#;
    assert_eq!(error(&mut served, tell), "trial 0 is queued; ask for it first");
    assert!(error(&mut served, r#"{"tell":{"number":0,"verdict":"void"}}"#).contains("is queued"));
    let asked = answer(&mut served, r#"{"ask":{}}"#);
    assert_eq!((&asked["number"], &asked["params"]["Fx"]), (&json!(0), &json!(77.0)));
    assert_eq!(answer(&mut served, tell)["told"], json!(0));
}

fn serve(served: &mut AskTell, input: &[u8], buffer: usize) -> Vec<Value> {
    let mut answers = Vec::new();
    let answered = |line: &str| answers.push(serde_json::from_str(line).unwrap());
    served.serve(&mut BufReader::with_capacity(buffer, Cursor::new(input)), answered).unwrap();
    answers
}

#[test]
fn a_line_of_any_length_has_one_answer_and_the_next_line_its_own() {
    for length in [LONGEST_LINE - 1, LONGEST_LINE, LONGEST_LINE + 1, 40 * LONGEST_LINE] {
        let mut served = AskTell::new(study(SamplerKind::Random));
        let mut input = vec![b'x'; length];
        input.extend(b"\n{\"ask\":{}}\n\n{\"ask\":{}}");
        let answers = serve(&mut served, &input, 4096);
        assert_eq!(answers.len(), 4, "{length}");
        let long = answers[0]["error"].as_str().unwrap().contains("the line has more than 65536 bytes");
        assert_eq!(long, length > LONGEST_LINE, "{length}: {}", answers[0]);
        assert_eq!((&answers[1]["number"], &answers[3]["number"]), (&json!(0), &json!(1)));
    }
    // Whitespace is JSON: a line that is only too long by it is refused as well.
    let mut line = vec![b' '; LONGEST_LINE];
    line.extend(b"{\"ask\":{}}\n");
    assert!(serve(&mut AskTell::new(study(SamplerKind::Random)), &line, 4096)[0]["error"].is_string());
}

/// Lines that are nearly right.
fn near_lines() -> impl Strategy<Value = String> {
    let part = prop_oneof![
        Just("{\"ask\":{}}".to_owned()),
        Just("{\"tell\":{\"number\":".to_owned()),
        Just(",\"value\":".to_owned()),
        Just(",\"verdict\":\"accept\"}}".to_owned()),
        Just(",\"verdict\":\"fall\"}}".to_owned()),
        any::<f64>().prop_map(|number| number.to_string()),
        any::<i64>().prop_map(|number| number.to_string()),
        Just("[".repeat(200)),
        any::<String>(),
    ];
    prop::collection::vec(part, 1..6).prop_map(|parts| parts.concat())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_line_ends_the_program(lines in prop::collection::vec(
        prop_oneof![prop::collection::vec(any::<u8>(), 0..200), near_lines().prop_map(String::into_bytes)],
        1..12,
    )) {
        let mut served = AskTell::new(study(SamplerKind::Random));
        for line in lines {
            let answer = served.answer(&line);
            prop_assert!(!answer.contains('\n'));
            prop_assert!(serde_json::from_str::<Value>(&answer).unwrap().is_object(), "{}", answer);
        }
        let next: Value = serde_json::from_str(&served.answer(b"{\"ask\":{}}")).unwrap();
        prop_assert!(next["number"].is_u64(), "{}", next);
    }
}

#[test]
fn the_best_is_that_of_the_model_and_an_error_before_a_trial_has_stood() {
    for kind in [SamplerKind::Tpe, SamplerKind::Gp] {
        let mut served = AskTell::new(study(kind));
        assert!(error(&mut served, r#"{"best":{}}"#).contains("no trial has stood"));
        let mut told = Vec::new();
        for number in 0..14_u32 {
            let asked = answer(&mut served, r#"{"ask":{}}"#);
            // The luckiest trial is one of a far point.
            let value = if number == 1 { 0.9 } else { asked["params"]["Fx"].as_f64().unwrap() / 300.0 };
            answer(&mut served, &json!({"tell": {"number": number, "value": value, "verdict": "accept"}}).to_string());
            told.push((asked["params"].clone(), value));
        }
        let best = answer(&mut served, r#"{"best":{}}"#);
        let number = best["number"].as_u64().unwrap() as usize;
        assert_eq!(best["params"], told[number].0);
        assert_eq!(best["value"].as_f64(), Some(told[number].1));
        if kind == SamplerKind::Tpe {
            assert_eq!((number, best["predicted"].clone()), (1, Value::Null));
        } else {
            assert!(best["predicted"].as_f64().is_some(), "{best}");
        }
    }
}
