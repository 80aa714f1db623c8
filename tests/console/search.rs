//! Search and readiness on the screen: view Override, densities, repeats, a finished study, the arming checks, the link.

use std::time::Duration;

use crate::support::{Console, assert_shows, line_with, proposal, requests, session, tick, trial};
use quadfrog::config::Config;
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::optimize::journal::WaitedFor;
use quadfrog::recording::record::{ArmingCheckRecord, HealthLimits, Record, SessionInfo};
use quadfrog::recording::recorder::RecorderStatus;
use quadfrog::robot::{Battery, LinkStatus};
use quadfrog::session::operator_request::{OperatorCheck, OperatorRequest};
use quadfrog::session::prior::PriorProgress;
use quadfrog::session::storage::StorageWait;
use quadfrog::telemetry::{ArmingCheck, ArmingCheckState, Counters, Mode, Snapshot, Tick};
use quadfrog::trial::{
    Backend, ExperimentStage, FixedParameter, ParameterInsight, PointRecord, PredictedTrial, Proposal, ProposalInsight,
    ProposalSource, ProposedParameter, SearchStatus, SearchedParameter, SimulatorComparison, Task, TrialRecord,
    Verdict,
};
use quadfrog_console::export;
use quadfrog_console::message::{Effect, ExportedRows, Msg};
use quadfrog_console::model::View;
use quadfrog_console::model::dialog::Dialog;
use strum::VariantArray;

/// The search space: Fx as given, the others as the session began.
fn search(fx: (f64, f64), fixed: Option<FixedParameter>) -> SearchStatus {
    let parameter = |name: &str, (low, high), (least, most), fixed| SearchedParameter {
        name: name.into(),
        low,
        high,
        least,
        most,
        fixed,
    };
    SearchStatus {
        budget: 20,
        counted: 0,
        parameters: vec![
            parameter("f0", (0.75, 1.75), (0.5, 3.0), None),
            parameter("Fx", fx, (0.0, 200.0), fixed),
            parameter("Fz", (150.0, 350.0), (0.0, 400.0), None),
        ],
        confirming: None,
        hop_share: None,
        queue: Vec::new(),
    }
}

/// View Override with a proposal on the table and Fx chosen.
fn overriding() -> Console {
    let mut console = Console::proposed();
    console.record(Record::Search(search((0.0, 150.0), None)));
    console.press(&["4", "Down"]);
    console
}

#[test]
fn gains_are_set_within_their_own_safe_ranges() {
    let mut console = overriding();
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["Gains of the controller", "kp        400.0 N/m", "k_att     200.0 N/m", "600.0"]);
    // From f0 down to kp, past the three parameters.
    let sent = console.press(&["Up", "o", "Down", "Down", "Down", "5", "0", "0", "Enter"]);
    assert_eq!(requests(&sent), [OperatorRequest::OverrideGain { gain: "kp".into(), value: 500.0 }]);
    console.press(&["o", "Down", "2", "0", "0", "0", "Enter"]);
    let screen = console.screen(80, 24);
    assert!(screen.contains("is outside"), "{screen}");
    assert!(matches!(console.model.dialog, Some(Dialog::Override(_))), "a refusal keeps the form open");
}

/// Regression: a repeat of trial 124 was called "confirm of #12" at 80x24: the title was cut within the number.
#[test]
fn the_title_of_a_repeat_names_the_whole_trial() {
    let mut console = Console::proposed();
    let repeat = Proposal { source: ProposalSource::Confirm, parent: Some(124), ..proposal(125, 0) };
    console.record(Record::Proposal(repeat));
    console.stage(ExperimentStage::Proposed, 125);
    for (width, height) in [(60, 20), (80, 24), (120, 40)] {
        assert_shows(&console.screen(width, height), &["Trial #125 (confirm of #124)"]);
    }
}

/// A point with another value than the fixed one is not called fixed: that comes with the sampler's next proposal.
#[test]
fn a_queued_point_is_not_called_fixed_at_another_value() {
    let mut console = overriding();
    for (value, words) in [(75.0, "  fixed at 75.00, 2 more"), (90.0, " then fixed at 90.00, 2 more")] {
        console.record(Record::Search(search((0.0, 150.0), Some(FixedParameter { value, trials: 2 }))));
        assert_shows(&console.screen(120, 40), &[words]);
        assert_shows(&line_with(&console.screen(80, 24), "> Fx"), &["fixed at"]);
    }
}

#[test]
fn a_parameter_is_fixed_for_some_trials_and_searched_again() {
    let mut console = overriding();
    assert!(line_with(&console.screen(80, 24), "  X  ").contains("fix Fx at 75.00 N for the next trials"));
    assert_eq!(console.press(&["X"]), []);
    assert!(console.screen(80, 24).contains("Fix Fx at 75.00 N for how many trials?"), "{}", console.screen(80, 24));
    let sent = console.requests(&["Backspace", "3", "Enter"]);
    assert_eq!(sent, [OperatorRequest::Fix { parameter: "Fx".into(), value: 75.0, trials: 3 }]);
    console.record(Record::Search(search((0.0, 150.0), Some(FixedParameter { value: 75.0, trials: 3 }))));
    let screen = console.screen(80, 24);
    assert!(line_with(&screen, "Fx  ").contains("fixed at 75.00, 3 more"), "{screen}");
    assert!(line_with(&screen, "  X  ").contains("search Fx again"), "{screen}");
    assert_eq!(console.requests(&["X"]), [OperatorRequest::Unfix { parameter: "Fx".into() }]);
    let refusals = [
        ("0", "is not a number of trials"),
        ("-1", "was not taken"),
        ("many", "`y` does not belong here: type a number; Esc cancels"),
    ];
    for (wrong, refusal) in refusals {
        let mut console = overriding();
        console.press(&["X", "Backspace"]);
        console.enter(wrong);
        assert_eq!(console.press(&["Enter"]), [], "{wrong}");
        assert!(console.screen(80, 24).contains(refusal), "{wrong}");
    }
}

#[test]
fn bounds_are_checked_and_each_refusal_is_explained() {
    let typed = |text: &str| {
        let mut console = overriding();
        console.press(&["B", "Ctrl-U"]);
        console.enter(text);
        let sent = console.requests(&["Enter"]);
        (sent, console.screen(80, 24))
    };
    // Space is STOP here, so that another sign separates the numbers.
    for text in ["50..120.5", "50,120.5", "50..120,5", "50.0,120.5"] {
        let (sent, _) = typed(text);
        let expected = OperatorRequest::NarrowBounds { parameter: "Fx".into(), low: 50.0, high: 120.5 };
        assert_eq!(sent, [expected], "{text}");
    }
    let mut open = overriding();
    open.press(&["B"]);
    assert_shows(&open.screen(80, 24), &["write it as 0..150 or 0,150, without a space"]);
    for (text, reason) in [
        ("120..50", "120 is not below 50"),
        ("50", "is no range; write it as 0..150"),
        ("50..fast", "was not taken"),
        ("50,60,70", "is no range; write it as 0..150 or 0,150"),
        ("50..220", "Fx may be searched from 0 to 200 N (safety.toml)"),
    ] {
        let (sent, screen) = typed(text);
        assert_eq!(sent, [], "{text}");
        assert!(screen.contains(reason), "{text}: no {reason}:\n{screen}");
    }
    let mut console = overriding();
    console.record(Record::Search(search((50.0, 120.0), None)));
    let screen = console.screen(80, 24);
    assert!(line_with(&screen, "Fx  ").contains("initial 0.000..150.0"), "{screen}");
}

#[test]
fn an_override_outside_narrowed_bounds_is_refused_with_the_present_ones() {
    let mut console = overriding();
    console.record(Record::Search(search((50.0, 120.0), None)));
    assert_eq!(console.press(&["o", "1", "3", "0", "Enter"]), []);
    assert!(console.screen(80, 24).contains("Fx = 130 N is outside 50 to 120 N"), "{}", console.screen(80, 24));
}

#[test]
fn the_point_on_the_card_or_in_the_form_can_be_queued() {
    let point = |fx: f64| OperatorRequest::Enqueue(vec![("f0".into(), 1.25), ("Fx".into(), fx), ("Fz".into(), 250.0)]);
    let mut console = overriding();
    // Regression: the sampler's own values ran twice without a question.
    assert_eq!(console.requests(&["Q"]), []);
    for (columns, rows) in [(60, 20), (80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        let words = screen.split(|c: char| c.is_whitespace() || c == '│').filter(|word| !word.is_empty());
        let words = words.collect::<Vec<_>>().join(" ");
        assert!(
            words.contains("it may propose them again after that; as long as it draws at random, it does."),
            "{screen}"
        );
    }
    assert_eq!(console.requests(&["y"]), [point(75.0)]);
    let sent = console.requests(&["o", "1", "0", "0", "Q"]);
    assert_eq!(sent, [point(100.0)], "as typed; the card stays as it is");
    assert!(console.model.dialog.is_none());
}

#[test]
fn the_search_cannot_be_changed_while_a_trial_is_under_way() {
    for stage in [ExperimentStage::Running, ExperimentStage::Review] {
        let mut console = overriding();
        console.stage(stage, 0);
        for key in ["X", "B", "Q", "K"] {
            assert_eq!(console.press(&[key]), [], "{key} in {stage:?}");
            assert!(console.model.dialog.is_none(), "{key} in {stage:?}");
            assert!(!console.said().is_empty(), "{key} in {stage:?} says why");
        }
    }
    // Gains are not searched.
    let mut console = overriding();
    console.press(&["End", "X"]);
    assert_eq!(console.said(), "X is not possible: gains are not searched");
    console.press(&["1", "B"]);
    assert_eq!(console.said(), "B is not possible: only in the view Override");
}

fn insight() -> ProposalInsight {
    let at: Vec<f64> = (0..=40).map(|i| 0.75 + f64::from(i) / 40.0).collect();
    let bump = |middle: f64| at.iter().map(|x| (-((x - middle) / 0.1).powi(2)).exp()).collect::<Vec<f64>>();
    ProposalInsight {
        trial: 12,
        parameters: vec![ParameterInsight {
            name: "f0".into(),
            proposed: 1.0,
            importance: Some(0.62),
            good: bump(1.0),
            bad: bump(1.5),
            at,
        }],
        ..ProposalInsight::default()
    }
}

#[test]
fn densities_say_why_a_point_was_proposed_without_colours_too() {
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        let mut console = Console::proposed();
        console.record(Record::Insight(insight()));
        console.press(&["3"]);
        let screen = console.screen(columns, rows);
        let why = line_with(&screen, "TPE ");
        assert_eq!(why.contains("(#12)"), columns > 80, "{why}");
        assert!(why.contains("importance 62 %"), "{why}");
        assert!(screen.contains("importance: for best tenth"), "{screen}");
        assert!(why.contains("Fx") && why.contains("Fz"), "{why}");
        // Peak and proposal of the good trials are at a quarter of the panel, the peak of the rest at three quarters.
        let width = why.find("Fx").map(|_| usize::from(columns) / 3).expect("three panels");
        let letter = |letter: &str| {
            let at = screen.lines().skip_while(|line| !line.contains("TPE ")).skip(1);
            at.filter_map(|line| line.find(letter).map(|at| line[..at].chars().count()).filter(|at| *at < width)).next()
        };
        let (good, rest) = (letter("g").expect("good"), letter("r").expect("rest"));
        assert_shows(&line_with(&screen, "o accept  x"), &["g good", "r rest"]);
        assert!(good < width / 2 && rest > width / 2, "{good}, {rest} of {width}:\n{screen}");
        assert!(letter("│").expect("the proposal") < width / 2, "{screen}");
    }
}

/// Regression: after an override the view showed two different lines, both explained as the proposal.
#[test]
fn an_override_is_the_proposal_beside_the_value_of_the_sampler() {
    let mut console = Console::proposed();
    let mut overridden = proposal(12, 0);
    overridden.parameters[0] = ProposedParameter { value: 1.5, proposed: 1.0, ..overridden.parameters[0].clone() };
    console.record(Record::Proposal(overridden));
    console.stage(ExperimentStage::Proposed, 12);
    console.record(Record::Insight(insight()));
    console.press(&["3"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["│ proposal  │ of the sampler  g good"]);
    let lines: Vec<usize> =
        screen.lines().rev().filter(|line| line.contains('│')).map(|line| line.matches('│').count()).collect();
    assert_eq!(screen.lines().filter(|line| line.contains("1.500")).count(), 2, "below both panels:\n{screen}");
    assert!(lines[1..4].iter().all(|count| *count >= 2), "{lines:?}\n{screen}");
}

#[test]
fn before_the_first_trials_both_densities_are_the_prior() {
    let mut console = Console::proposed();
    let mut insight = insight();
    insight.parameters[0].bad = insight.parameters[0].good.clone();
    insight.parameters[0].importance = None;
    console.record(Record::Insight(insight));
    console.press(&["3"]);
    let screen = console.screen(120, 40);
    assert!(screen.contains("g=r") && !screen.contains("importance"), "{screen}");
}

/// Regression: after the last trial the view said "drawn without a model".
#[test]
fn the_reasons_for_the_last_proposal_stay_when_the_study_is_finished() {
    let mut console = Console::proposed();
    console.record(Record::Insight(insight()));
    console.record(Record::Insight(ProposalInsight { trial: 19, ..ProposalInsight::default() }));
    console.press(&["3"]);
    assert_shows(&console.screen(120, 40), &["TPE f0 (#12)", "importance 62 %", "g good"]);
}

/// Regression: a finished study that was continued said "drawn without a model" of its last trial.
#[test]
fn a_continued_study_that_is_finished_has_no_reasons_of_a_proposal() {
    let mut console = Console::ready();
    console.record(Record::Insight(ProposalInsight { trial: 19, ..ProposalInsight::default() }));
    console.press(&["3"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["no proposal in this session"]);
    assert!(!screen.contains("without a model") && !screen.contains("(#19)"), "{screen}");
}

#[test]
fn panels_of_one_parameter_have_the_same_axis_when_the_search_is_narrowed() {
    let mut console = Console::proposed();
    console.judged(4);
    let mut narrowed = insight();
    let parameter = &mut narrowed.parameters[0];
    parameter.at = (0..=40).map(|i| 0.9 + 0.2 * f64::from(i) / 40.0).collect();
    console.record(Record::Insight(narrowed));
    console.press(&["3"]);
    let screen = console.screen(120, 40);
    let axes: Vec<&str> = screen.lines().filter(|line| line.contains("0.750")).collect();
    let ends = |line: &str| [line.find("0.750"), line.find("1.750")];
    let [scatter, densities] = axes[..] else { panic!("two axes of f0: {axes:?}\n{screen}") };
    assert_eq!(ends(scatter), ends(densities), "{screen}");
}

#[test]
fn a_sampler_with_a_model_shows_its_mean_and_deviation() {
    let mut console = Console::proposed();
    console.judged(4);
    let mut insight = insight();
    insight.parameters[0].at.clear();
    insight.predicted = vec![PredictedTrial { trial: 0, value: 0.4, deviation: 0.2 }];
    insight.best = Some(0);
    console.record(Record::Insight(insight));
    console.press(&["3"]);
    let wide = console.screen(200, 60);
    assert_shows(&wide, &["Predicted J over f0 (#12): mean and deviation", "importance 62 %", "proposal, deviation"]);
    assert!(!wide.contains("TPE"), "{wide}");
    let rows: Vec<&str> = wide.lines().skip_while(|line| !line.contains("Predicted J")).collect();
    let mean = rows.iter().position(|line| line.chars().take(66).any(|c| c == '*')).expect("the mean");
    assert!(rows[mean - 1].contains('│') && rows[mean + 1].contains('│'), "{wide}");
    // Beside the importance only the name has room.
    assert_shows(&console.screen(80, 24), &["f0 ───── importance 62 %", "Model Fx "]);
}

/// Regression: the panels of a study with another sampler were titled TPE before its first proposal, and those of `sim` explained an
/// importance that is not shown beside the simulated robots.
#[test]
fn the_optimizer_names_the_sampler_before_its_first_proposal() {
    for (kind, title) in [(SamplerKind::Sim, "sim f0 "), (SamplerKind::Gp, "gp f0 "), (SamplerKind::Tpe, "TPE f0 ")] {
        let mut console = Console::new();
        console.record(Record::Session(SessionInfo { sampler: Some(kind), ..session() }));
        console.press(&["3"]);
        let screen = console.screen(120, 40);
        assert_shows(&screen, &[title, "no proposal yet"]);
        assert_eq!(screen.contains("TPE"), kind == SamplerKind::Tpe, "{screen}");
    }
    let mut console = Console::proposed();
    let simulator =
        Some(SimulatorComparison { ratio: 1.085, ratio_deviation: 0.202, ..SimulatorComparison::default() });
    console.record(Record::Insight(ProposalInsight { simulator, ..insight() }));
    console.press(&["3"]);
    assert!(!console.screen(120, 40).contains("importance"), "{}", console.screen(120, 40));
    assert_shows(
        &console.screen(80, 24),
        &["the robot shows 1.085 ±0.202 times the simulated change over the parameters"],
    );
}

/// Regression: the first line, the chart and the answer at the end of a study gave the mean of the model as the value of a jump.
#[test]
fn the_best_by_a_model_is_shown_with_the_value_of_its_jump() {
    let mut console = Console::proposed();
    console.judged(4);
    let mut insight = insight();
    insight.predicted = vec![PredictedTrial { trial: 0, value: 0.437, deviation: 0.02 }];
    insight.best = Some(0);
    console.record(Record::Insight(insight));
    let first = |screen: &str| screen.lines().next().unwrap().to_owned();
    assert_shows(&first(&console.screen(200, 60)), &["best 0.400 m (#0 by the model)"]);
    assert_shows(&first(&console.screen(80, 24)), &["best 0.400 m (#0)"]);
    console.press(&["3"]);
    assert_shows(&console.screen(120, 40), &["best 0.400 m #0 by the model"]);
    console.stage(ExperimentStage::Finished, 3);
    console.press(&["1"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["the best by the model is trial 0, J = 0.400 m", "its mean by the model 0.437"]);
    assert_eq!(screen.matches("0.437").count(), 1, "{screen}");
    console.press(&["2", "Home", "Enter"]);
    assert_shows(&console.screen(120, 40), &["by the sampler's model: mean 0.437 ±0.020 m"]);
}

#[test]
fn the_signs_of_the_optimizer_are_explained_at_every_size() {
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        let mut console = Console::proposed();
        console.judged(4);
        console.press(&["3"]);
        let signs = ["o accept", "x fall", "v void", "* best", "│ proposal", "─ best so far"];
        assert_shows(&line_with(&console.screen(columns, rows), "o accept  x"), &signs);
        console.record(Record::Insight(insight()));
        console.record(Record::Trial(trial(4, None, Some(Verdict::Accept))));
        // Regression: at 80 columns the last signs had no room.
        let screen = console.screen(columns, rows);
        let legend: Vec<&str> = screen.lines().skip_while(|line| !line.contains("o accept  x")).collect();
        let more = ["? not judged", "g good", "r rest", "importance: for best tenth"];
        assert_shows(&legend[..2].join("  "), &[&signs[..], &more].concat());
    }
}

/// Regression: the title explained a star that no line had.
#[test]
fn a_star_is_explained_where_the_best_was_repeated() {
    for (trials, mean, starred) in [(vec![0, 3], 0.3, false), (vec![2, 3], 0.61, true)] {
        let mut console = finished();
        let point = PointRecord { trials, without_fall: 2, mean, ..PointRecord::default() };
        console.record(Record::Points(vec![point]));
        let screen = console.screen(120, 40);
        assert_shows(&screen, &["repeated points"]);
        assert_eq!(screen.contains("*: that of the best"), starred, "{screen}");
        assert_eq!(screen.contains("* best 0.610 m (#2)"), starred, "{screen}");
    }
}

/// A finished study of four trials; trial 2 is the best.
fn finished() -> Console {
    let mut console = Console::ready();
    console.record(Record::Session(SessionInfo { budget: 4, ..session() }));
    for (number, value) in [(0, 0.3), (1, 0.2), (2, 0.61), (3, 0.4)] {
        let row = TrialRecord {
            value: Some(value),
            gains: vec![("kp".into(), 450.0), ("kd".into(), 8.0)].into(),
            ..trial(number, Some(Verdict::Accept), None)
        };
        console.record(Record::Trial(row));
    }
    console.stage(ExperimentStage::Finished, 3);
    console
}

/// Regression: a finished study that was resumed has no proposal, and neither its panel nor its tables named the changed gains of the
/// best trial.
#[test]
fn the_changed_gains_of_the_best_are_known_without_a_proposal() {
    let mut console = Console::new();
    let configured_gains = vec![("kp".into(), 400.0), ("kd".into(), 8.0)].into();
    console.record(Record::Session(SessionInfo { budget: 1, configured_gains, ..session() }));
    let gains = vec![("kp".into(), 450.0), ("kd".into(), 8.0)].into();
    console.record(Record::Trial(TrialRecord { gains, ..trial(0, Some(Verdict::Accept), None) }));
    console.stage(ExperimentStage::Finished, 0);
    for (columns, rows) in [(80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        assert_shows(&line_with(&screen, "450.0"), &["kp", "was 400.0"]);
        assert!(!screen.contains("kd "), "{screen}");
    }
    console.press(&["R", "PgDn"]);
    let words = console.screen(120, 40).replace(['│', '\n'], "").split_whitespace().collect::<Vec<_>>().join(" ");
    assert_shows(&words, &["other gains: kp 450 (newest configuration: 400)"]);
}

#[test]
fn a_finished_study_says_so_and_what_comes_next() {
    let mut console = finished();
    assert_eq!(console.said(), "the study is finished: the best is trial 2, J = 0.610 m");
    let screen = console.screen(80, 24);
    assert_shows(
        &screen,
        &["Study finished", "best 0.610 m (#2)", "C more", "K confirm", "E export", "The study is finished."],
    );
    // Regression: the gains with which the best was reached stood in its note alone.
    for (columns, rows) in [(80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        let gain = line_with(&screen, "450.0");
        assert!(gain.contains("kp") && gain.contains("was 400.0"), "{screen}");
    }
    // One that the study searches stands among the parameters, once.
    let best = TrialRecord {
        value: Some(0.61),
        parameters: vec![("kp".into(), 450.0)].into(),
        gains: vec![("kp".into(), 450.0)].into(),
        ..trial(2, Some(Verdict::Accept), None)
    };
    console.record(Record::Trial(best));
    let screen = console.screen(120, 40);
    assert!(screen.matches("450.0").count() == 1 && !screen.contains("was 400.0"), "{screen}");
    console = finished();
    console.press(&["C"]);
    // Regression: the field did not say what it takes and to what the trials are added.
    assert_shows(&console.screen(80, 24), &["1 to 1000, added to the budget of 4; 4 of them count so far"]);
    assert_eq!(console.requests(&["Enter"]), [OperatorRequest::Continue(20)]);
    console.press(&["K"]);
    assert!(console.screen(80, 24).contains("How many repeats at most"));
    assert_eq!(console.requests(&["Enter"]), [OperatorRequest::ConfirmBest { repeats: 10 }]);
    console.record(Record::Search(SearchStatus { confirming: Some(7), ..search((0.0, 150.0), None) }));
    assert_eq!(console.requests(&["K", "y"]), [OperatorRequest::ConfirmBest { repeats: 0 }], "the same key ends it");
    assert_eq!(console.press(&["E"]), [Effect::ExportBest]);
}

#[test]
fn repeats_are_shown_as_k_of_n_with_their_spread() {
    let mut console = finished();
    let point = |trials: Vec<u32>, stood, mean, deviation, confidence| PointRecord {
        parameters: vec![("f0".into(), 1.25)].into(),
        trials,
        without_fall: stood,
        mean,
        deviation,
        contender: true,
        confidence,
    };
    console.record(Record::Points(vec![
        point(vec![0, 5, 6], 2, 0.41, Some(0.05), None),
        point(vec![2, 4], 2, 0.6, Some(0.012), Some(0.96)),
    ]));
    let screen = console.screen(80, 24);
    assert!(
        screen.contains("*#2    2/2    0.600 ±0.012 96 %") && screen.contains(" #0    2/3    0.410 ±0.050"),
        "{screen}"
    );
    console.press(&["3"]);
    let screen = console.screen(120, 40);
    assert!(screen.contains("2/2 landed  0.600 m ±0.012  leads, 96 %"), "{screen}");
    // Regression: a point that the leader has beaten still contended.
    assert!(line_with(&screen, "2/3 landed").contains("behind"), "{screen}");
    console.record(Record::Search(SearchStatus { confirming: Some(7), ..search((0.0, 150.0), None) }));
    let screen = console.screen(120, 40);
    assert!(line_with(&screen, "2/3 landed").contains("contends"), "{screen}");
    let certain = point(vec![2, 4], 2, 0.6, Some(0.012), Some(0.9999));
    console.record(Record::Points(vec![point(vec![0, 5, 6], 2, 0.41, Some(0.05), None), certain]));
    let screen = console.screen(120, 40);
    assert!(screen.contains("leads, 100 %") && line_with(&screen, "2/3 landed").contains("behind"), "{screen}");
    console.record(Record::Search(search((0.0, 150.0), None)));
    console.press(&["2", "/", "2", "Enter", "Enter"]);
    let screen = console.screen(80, 24);
    assert!(line_with(&screen, "repeats").contains("2/2 landed, 0.6000 ± 0.0120 m (#2 #4)"), "{screen}");
}

#[test]
fn the_best_is_written_as_a_configuration_that_the_program_takes() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = folder.path().join("study.log");
    let mut console = finished();
    console.record(Record::Session(SessionInfo { study: study.display().to_string(), ..session() }));
    let best = export::best(&console.model).expect("written");
    assert_eq!(best, folder.path().join("best-trial-2"));
    let config = Config::load(Some(&best)).expect("a configuration");
    let first = vec![("f0".into(), 1.25), ("Fx".into(), 75.0), ("Fz".into(), 250.0)];
    assert_eq!(*config.first(Task::Forward), first, "the point that a study begins with");
    let gains = config.task(Task::Forward);
    assert_eq!((gains.kp, gains.kd), (450.0, 8.0));
    // Regression: a second export ended with "entity already exists".
    let kept = std::fs::read_to_string(best.join("optimize.toml")).expect("the first one");
    for number in [2, 3] {
        let again = export::best(&console.model).expect("written beside the first");
        assert_eq!(again, folder.path().join(format!("best-trial-2-{number}")));
    }
    assert_eq!(std::fs::read_to_string(best.join("optimize.toml")).expect("the first one"), kept, "nothing is lost");
    let table = export::table(&console.model, ExportedRows::All).expect("written");
    assert_eq!(std::fs::read_to_string(table).expect("the table").lines().count(), 5);
    // Regression: after a change of the bounds the written point was outside the written bounds.
    for (bounds, written) in [((0.0, 180.0), [0.0, 180.0]), ((90.0, 120.0), [75.0, 120.0])] {
        console.record(Record::Search(search(bounds, None)));
        let config = Config::load(Some(&export::best(&console.model).expect("written"))).expect("a configuration");
        let fx = config.parameters(Task::Forward).into_iter().find(|p| p.name == "Fx").expect("it");
        assert_eq!([fx.low, fx.high], written);
    }
    // A folder that cannot be written is named.
    console.record(Record::Session(SessionInfo { study: "/proc/study.log".into(), ..session() }));
    let error = export::best(&console.model).expect_err("no such place").to_string();
    assert!(error.contains("/proc/best-trial-2"), "{error}");
}

#[test]
fn the_best_of_a_continued_study_is_exported_with_its_newest_configuration() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = folder.path().join("study.log");
    let mut console = finished();
    console.record(Record::Session(SessionInfo { study: study.display().to_string(), ..session() }));
    // Two exported configurations serve as those of the study; the newer one has another time window.
    for name in ["config", "config-2"] {
        std::fs::rename(export::best(&console.model).expect("written"), folder.path().join(name)).expect("renamed");
    }
    let newest = folder.path().join("config-2/console.toml");
    let text = std::fs::read_to_string(&newest).expect("the console's settings");
    std::fs::write(&newest, text.replace("chart_window_s = 8.0", "chart_window_s = 4.0")).expect("written");
    let best = export::best(&console.model).expect("written");
    let exported = std::fs::read_to_string(best.join("console.toml")).expect("the console's settings");
    assert!(exported.contains("chart_window_s = 4.0"), "{exported}");
}

/// A Go1 that lies disarmed with these arming checks.
fn on_hardware(list: Vec<ArmingCheckRecord>) -> Console {
    let mut console = Console::proposed();
    console.record(Record::Session(SessionInfo { backend: Some(Backend::Hardware), ..session() }));
    console.record(Record::ArmingChecks(list));
    console
}

fn item(check: ArmingCheck, state: ArmingCheckState, found: &str, needed: &str) -> ArmingCheckRecord {
    ArmingCheckRecord { check, state, found: found.into(), needed: needed.into() }
}

fn fresh() -> ArmingCheckRecord {
    item(ArmingCheck::StateFresh, ArmingCheckState::Passed, "2 ms", "at most 10 ms")
}

#[test]
fn arming_shows_every_check_that_fails_and_takes_the_operators_confirmation() {
    let mut console = on_hardware(vec![
        fresh(),
        item(ArmingCheck::Battery, ArmingCheckState::Failed, "21 %", "at least 30 %"),
        item(ArmingCheck::MotorsCool, ArmingCheckState::Failed, "FR_calf 64 C", "below 60 C"),
        item(ArmingCheck::AreaClear, ArmingCheckState::Waiting, "", "your confirmation"),
    ]);
    assert_eq!(console.next_step(), "Not ready to arm: 3 checks have not passed. P shows them.");
    let mut resumed = on_hardware(vec![fresh()]);
    resumed.update(Msg::Resumed);
    assert_eq!(resumed.next_step(), "Checking the robot.");
    assert_eq!(resumed.press(&["A"]), [], "what was checked before the program was stopped is old");
    assert_eq!(console.press(&["A"]), [], "nothing is armed");
    let screen = console.screen(80, 24);
    assert_shows(
        &screen,
        &[
            "3 of 4 not yet",
            "FAIL battery",
            "21 %",
            "at least 30 %",
            "FAIL motors cool",
            "you  area clear",
            "ok   state fresh",
        ],
    );
    assert!(console.said().contains("3 arming checks have not passed"), "{}", console.said());
    // The operator's own items, in their order.
    let mut sent = Vec::new();
    for _ in OperatorCheck::ALL {
        sent.extend(console.requests(&["x", "Down"]));
    }
    assert_eq!(sent, OperatorCheck::ALL.map(OperatorRequest::Confirm));
    console.press(&["Esc", "5"]);
    assert!(console.screen(120, 40).contains("3 of 4 not yet (P)"));
}

#[test]
fn hardware_is_armed_by_a_typed_confirmation() {
    let mut console = on_hardware(vec![fresh()]);
    assert_eq!(console.press(&["A"]), []);
    assert!(console.next_step().contains("Type stand to stand the robot up"), "{}", console.next_step());
    assert_eq!(console.press(&["s", "t", "a", "n"]), []);
    assert_eq!(console.requests(&["d"]), [OperatorRequest::Arm]);
    for keys in [&["Enter"][..], &["s", "t", "e"], &["s", "s"], &["A"], &["y"]] {
        let mut console = on_hardware(vec![fresh()]);
        console.press(&["A"]);
        assert_eq!(console.requests(keys), [], "{keys:?}");
        assert!(console.model.dialog.is_none(), "{keys:?} cancels");
    }
    // A check that fails meanwhile ends it.
    let mut console = on_hardware(vec![fresh()]);
    console.press(&["A", "s", "t", "a", "n"]);
    let failed = item(ArmingCheck::Battery, ArmingCheckState::Failed, "20 %", "at least 30 %");
    console.record(Record::ArmingChecks(vec![failed]));
    assert_eq!(console.requests(&["d"]), []);
}

#[test]
fn the_frame_says_how_link_battery_and_the_hottest_motor_are_at_every_size() {
    let mut console = on_hardware(Vec::new());
    let mut newest = tick(5_000, 0.0, None);
    newest.state.robot_time_ms = 5_000;
    newest.state.motor_temperature_c[5] = 63.0;
    let battery = Battery { charge_percent: 87.0, voltage_v: 24.1, current_a: -2.0, cell_v: [3.4; 10] };
    newest.state.battery = Some(battery);
    let link = LinkStatus {
        state_age_ms: 3,
        rate_hz: 998,
        recent_received: 4_900,
        recent_lost: 100,
        lost: 123,
        corrupt: 4,
        reboots: 1,
        ..LinkStatus::default()
    };
    let counters = Counters { link: Some(link), ..Counters::default() };
    console.tick(newest);
    console.update(Msg::Snapshot(Box::new(Snapshot { tick: newest, counters, ..Snapshot::default() })));
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        for view in View::VARIANTS.iter().copied() {
            console.model.view = view;
            let screen = console.screen(columns, rows);
            let second = screen.lines().nth(1).unwrap_or_default();
            for part in ["link 3 ms, 2.0 % lost", "63 C", "87 %"] {
                assert!(second.contains(part), "no {part} at {columns}x{rows}: {second}");
            }
        }
    }
    console.model.view = View::Health;
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["998 Hz, 3 ms old", "2.00 %, 123 in all", "4 in all", "restarts     1 !"]);
    let motor = screen.lines().skip(3).find(|line| line.contains("FL_calf")).expect("the motor").to_owned();
    assert!(motor.contains("63 C") && motor.contains('!'), "{motor}");
    // Too small for anything else, the link is still there.
    assert!(console.screen(40, 10).contains("link 3 ms, 2.0 % lost"));
}

/// Regression: the screen compared with 60 C, 30 % and 5 ms, whatever `safety.toml` said.
#[test]
fn health_is_coloured_by_the_limits_of_the_session() {
    let mut console = on_hardware(Vec::new());
    let mut newest = tick(5_000, 0.0, None);
    newest.state.robot_time_ms = 5_000;
    newest.state.motor_temperature_c[5] = 63.0;
    newest.state.battery = Some(Battery { charge_percent: 87.0, voltage_v: 24.1, current_a: -2.0, cell_v: [3.4; 10] });
    let link = LinkStatus { state_age_ms: 8, rate_hz: 998, recent_received: 5_000, ..LinkStatus::default() };
    let counters = Counters { link: Some(link), ..Counters::default() };
    console.tick(newest);
    console.update(Msg::Snapshot(Box::new(Snapshot { tick: newest, counters, ..Snapshot::default() })));
    console.model.view = View::Health;
    let mut marked = |limits: HealthLimits| {
        console.record(Record::Session(SessionInfo { backend: Some(Backend::Hardware), limits, ..session() }));
        let screen = console.screen(120, 40);
        ["63 C off", "battery      87 %", "998 Hz"].map(|row| line_with(&screen, row).contains('!'))
    };
    assert_eq!(marked(HealthLimits::default()), [true, false, true]);
    let limits = HealthLimits { motor_c: 80.0, battery_percent: 90.0, state_age_ms: 10, ..HealthLimits::default() };
    assert_eq!(marked(limits), [false, true, false]);
}

#[test]
fn a_simulator_has_no_link_and_says_so() {
    let mut console = Console::proposed();
    for view in ["1", "5"] {
        console.press(&[view]);
        assert!(console.screen(80, 24).lines().nth(1).is_some_and(|line| line.contains("link none: SIM")));
    }
    assert!(console.screen(80, 24).contains("SIM: no link"), "{}", console.screen(80, 24));
}

#[test]
fn health_says_what_the_recorder_writes_and_why_it_stopped() {
    let mut console = Console::proposed();
    console.press(&["5"]);
    let newest = Tick { mode: Mode::Disarmed, ..tick(10_000, 0.0, None) };
    let counters = Counters { ticks_not_recorded: 12, ..Counters::default() };
    console.update(Msg::Snapshot(Box::new(Snapshot { tick: newest, counters, ..Snapshot::default() })));
    console.update(Msg::Recorder(RecorderStatus { bytes: 4_000_000, ticks: 10_000, ..RecorderStatus::default() }));
    let disk = item(ArmingCheck::Disk, ArmingCheckState::Failed, "812 MB", "at least 1000 MB");
    console.record(Record::ArmingChecks(vec![disk]));
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["4.0 MB, 400 kB/s", "812 MB !", "12 ticks !"]);
    let error = Some("no space left on device".to_owned());
    console.update(Msg::Recorder(RecorderStatus { error, ..RecorderStatus::default() }));
    assert!(console.screen(120, 40).contains("no space left on device !"));
}

#[test]
fn details_that_do_not_fit_are_reached_with_the_paging_keys() {
    let mut console = finished();
    let row = TrialRecord {
        note: "slid on the mat, then the cable was in the way ".repeat(6),
        hand_value: Some(0.3),
        gains: vec![("kp".into(), 450.0)].into(),
        ..trial(0, Some(Verdict::Accept), Some(Verdict::Fall))
    };
    console.record(Record::Trial(row));
    console.press(&["2", "Home", "Enter"]);
    let top = console.screen(80, 24);
    assert!(top.contains("PgUp PgDn") && top.contains("verdict  "), "{top}");
    console.press(&["PgDn"]);
    let bottom = console.screen(80, 24);
    assert!(bottom != top && bottom.contains("STOP") && !bottom.contains("verdict  "), "{bottom}");
    console.press(&["PgUp"]);
    assert_eq!(console.screen(80, 24), top);
}

/// The operator sees why nothing happens, and since when.
#[test]
fn a_wait_for_the_storage_is_shown_until_it_ends() {
    let mut console = Console::ready();
    let waited = Duration::from_secs(14);
    console.update(Msg::Storage(Some(StorageWait { waited, journal: Some(WaitedFor::Lock), prior: None })));
    assert_shows(&console.screen(80, 24), &["Waiting for the study's lock, 14 s"]);
    console.update(Msg::Storage(Some(StorageWait { waited, journal: None, prior: None })));
    assert_shows(&console.screen(80, 24), &["Waiting for the disk, 14 s"]);
    let prior = Some(PriorProgress { done: 640, total: 2560 });
    console.update(Msg::Storage(Some(StorageWait { waited, journal: None, prior })));
    assert_shows(&console.screen(80, 24), &["Simulating the prior, 640 of 2560 jumps, 14 s"]);
    console.update(Msg::Storage(None));
    assert!(!console.screen(80, 24).contains("Waiting for"));
}

#[test]
fn the_hop_envelope_is_shown_beside_the_proposal() {
    let mut console = Console::ready();
    console.record(Record::Search(SearchStatus { hop_share: Some(0.5), ..search((0.0, 150.0), None) }));
    assert_shows(&console.screen(80, 24), &["hop envelope: 50 % of force"]);
    console.record(Record::Search(search((0.0, 150.0), None)));
    assert!(!console.screen(80, 24).contains("hop envelope"));
}

/// Regression: the tables were written in place, and an export that ended early left the beginning of a table.
#[test]
fn a_table_replaces_the_last_one_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut console = finished();
    let study = folder.path().join("study.log").display().to_string();
    console.record(Record::Session(SessionInfo { study, ..session() }));
    let tables = ["trials.csv", "trials.md"].map(|name| folder.path().join(name));
    for table in &tables {
        std::fs::write(table, "the last one").expect("written");
        std::fs::hard_link(table, table.with_extension("last")).expect("linked");
        assert_eq!(export::table(&console.model, ExportedRows::All).expect("written"), tables[0]);
        assert_eq!(std::fs::read_to_string(table.with_extension("last")).expect("read"), "the last one");
        assert_ne!(std::fs::read_to_string(table).expect("read"), "the last one");
        std::fs::remove_file(table.with_extension("last")).expect("removed");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 2, "nothing else is left");
}
