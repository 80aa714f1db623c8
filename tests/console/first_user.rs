//! Answers and screens that a user of the README alone took for wrong.

use crate::support::{Console, assert_shows, line_with, proposal, session, trial};
use quadfrog::recording::record::{Record, SessionInfo, StageRecord, Transition};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{FallCause, Mode, Snapshot, TransitionCause};
use quadfrog::trial::{
    Approval, ExperimentStage, FixedParameter, PointRecord, ProposalSource, QueuedPoint, SKIPPED, SearchStatus,
    SearchedParameter, TrialRecord, Verdict,
};
use quadfrog_console::message::{Effect, Msg};
use quadfrog_console::settings::ChartMode;

/// A trial that was skipped, and one of which nothing was measured, below an accepted one.
fn with_a_skipped_trial() -> Console {
    let mut console = Console::ready();
    console.judged(1);
    let skipped = TrialRecord { cause: SKIPPED.into(), measured: None, ..trial(1, Some(Verdict::Void), None) };
    console.record(Record::Trial(skipped));
    console.record(Record::Trial(TrialRecord { measured: None, ..trial(2, Some(Verdict::Void), None) }));
    console.record(Record::Trial(trial(3, Some(Verdict::Accept), None)));
    console
}

/// The words of a screen with one space between them: a text in a box may take two lines.
fn joined(screen: &str) -> String {
    screen.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Regression: a skipped proposal could be judged a fall; it counted for the budget then, with the value 0.
#[test]
fn a_trial_that_was_not_run_is_not_judged() {
    let mut console = with_a_skipped_trial();
    console.press(&["2", "Home", "Down"]);
    for key in ["a", "f", "v"] {
        assert_eq!(console.press(&[key]), []);
        assert!(console.model.dialog.is_none(), "no reason is asked for");
        assert_eq!(console.said(), format!("{key} is not possible: trial 1 was not run: it has no verdict"));
    }
}

/// Regression: the reason was asked for first, and the verdict refused afterwards.
#[test]
fn a_trial_without_a_measurement_is_not_accepted_before_a_reason_is_asked_for() {
    let mut console = with_a_skipped_trial();
    console.press(&["2", "Home", "Down", "Down", "a"]);
    assert!(console.model.dialog.is_none(), "no reason is asked for");
    assert_shows(console.said(), &["nothing was measured in trial 2: it cannot be accepted"]);
    console.press(&["f"]);
    assert_shows(&console.screen(80, 24), &["Trial #2: void becomes fall. Why?"]);
}

/// Regression: it was said to be recorded in an earlier session.
#[test]
fn a_trial_that_was_not_run_has_no_signals_to_show() {
    let mut console = with_a_skipped_trial();
    console.press(&["2", "Home", "Down", "c"]);
    assert_eq!(console.said(), "trial 1 was not run");
}

/// Regression: a queued trial that ran before the last repeat was passed over in silence.
#[test]
fn a_result_names_a_queued_trial_that_ran_before_the_repeats_and_is_higher() {
    let mut console = compared();
    let row = TrialRecord { value: Some(0.706), ..trial(19, Some(Verdict::Accept), None) };
    console.record(Record::Trial(row));
    console.stage(ExperimentStage::Finished, 22);
    assert_shows(console.said(), &["stood 2 of 2; trial 19, not compared, is higher: 0.706 m"]);
}

fn point(trials: Vec<u32>, mean: f64, confidence: Option<f64>) -> PointRecord {
    PointRecord {
        parameters: vec![("f0".into(), 1.25)].into(),
        without_fall: trials.len() as u32,
        trials,
        mean,
        deviation: Some(0.0),
        contender: true,
        confidence,
    }
}

/// A finished study of which three points were compared without a confidence.
fn compared() -> Console {
    let mut console = Console::ready();
    console.judged(1);
    console.record(Record::Points(vec![
        point(vec![3, 20], 0.61, None),
        point(vec![17, 21], 0.688, None),
        point(vec![5, 22], 0.6, None),
    ]));
    console.record(Record::Search(SearchStatus { budget: 20, counted: 20, ..SearchStatus::default() }));
    console
}

/// Regression: all points were called behind, also the leading one.
#[test]
fn the_leading_point_leads_without_a_confidence_too() {
    let mut console = compared();
    console.stage(ExperimentStage::Finished, 22);
    let leads = |screen: &str| {
        assert_shows(&line_with(screen, "#17 "), &["leads"]);
        assert!(!line_with(screen, "#17 ").contains('%'), "{screen}");
    };
    leads(&console.screen(80, 24));
    leads(&console.screen(200, 60));
    console.press(&["3"]);
    let screen = console.screen(120, 40);
    leads(&screen);
    for behind in ["#3 ", "#5 "] {
        assert_shows(&line_with(&screen, behind), &["behind"]);
    }
    assert_eq!(screen.matches("  leads").count(), 1, "{screen}");
}

/// Regression: the result of a confirmation was shown beside a better trial without a word about that.
#[test]
fn a_result_says_that_a_later_trial_is_higher() {
    let mut console = compared();
    let later = |console: &mut Console, number, value| {
        let row = TrialRecord { value: Some(value), ..trial(number, Some(Verdict::Accept), None) };
        console.record(Record::Trial(row));
    };
    console.stage(ExperimentStage::Finished, 22);
    assert_shows(
        console.said(),
        &["the point of trial 17 leads without a confidence: mean 0.688 +- 0.000 m, stood 2 of 2"],
    );
    assert!(!console.said().contains("not compared"), "{}", console.said());
    later(&mut console, 28, 0.706);
    console.stage(ExperimentStage::Proposed, 29);
    console.stage(ExperimentStage::Finished, 28);
    assert_shows(console.said(), &["stood 2 of 2; trial 28, not compared, is higher: 0.706 m"]);
}

/// Regression: three repeats over three points could decide nothing, which was said afterwards alone.
#[test]
fn the_dialog_of_a_confirmation_says_how_many_repeats_it_takes() {
    let mut console = Console::ready();
    console.model.contenders = Some(3);
    for number in 0..5 {
        let row = trial(number, Some(Verdict::Accept), None);
        // The third point of the best three ran twice already.
        let f0 = if number < 2 { 1.0 } else { 1.0 + f64::from(number) / 10.0 };
        let parameters = vec![("f0".into(), f0), ("Fx".into(), 75.0), ("Fz".into(), 250.0)].into();
        let value = if number < 2 { Some(0.43) } else { row.value };
        console.record(Record::Trial(TrialRecord { parameters, value, ..row }));
    }
    console.press(&["K"]);
    assert_shows(
        &joined(&console.screen(80, 24)),
        &["to compare them takes 5 repeats", "does not count for the budget"],
    );
    // Regression: a number that allows no comparison was accepted, and the answer said so only afterwards.
    console.enter("4");
    assert_eq!(console.requests(&["Enter"]), []);
    let few = ["To compare the best points takes 5 repeats: 4 repeats cannot confirm", "Back to the field"];
    assert_shows(&joined(&console.screen(80, 24)), &few);
    assert_shows(&console.next_step(), &["Press y to repeat all the same."]);
    console.press(&["Enter"]);
    assert_eq!(console.requests(&["Enter", "y"]), [OperatorRequest::ConfirmBest { repeats: 4 }]);
    console.press(&["K"]);
    console.enter("5");
    assert_eq!(console.requests(&["Enter"]), [OperatorRequest::ConfirmBest { repeats: 5 }]);
    console.press(&["K"]);
    // Regression: the repeats make the last verdict final, and the screen had promised `u` until the next approval.
    assert!(!joined(&console.screen(80, 24)).contains("then stays"));
    console.press(&["Esc"]);
    for verdict in [None, Some(Verdict::Accept)] {
        console.record(Record::Trial(trial(5, verdict, None)));
    }
    console.stage(ExperimentStage::Review, 5);
    console.record(Record::Stage(StageRecord { stage: ExperimentStage::Proposed, trial: 6, can_undo: true, jumps: 0 }));
    console.press(&["K"]);
    let note = "The verdict of trial #5 then stays: u does not take it back any longer.";
    assert_shows(&joined(&console.screen(80, 24)), &["to compare them takes", note]);
}

/// Regression: the names of the numbers stood over no point, and a point was left out without a sign.
#[test]
fn names_of_numbers_stand_over_a_point_and_points_that_are_left_out_are_counted() {
    let mut console = compared();
    console.record(Record::Points((0..4).map(|n| point(vec![n, 20 + n], 0.6, None)).collect()));
    for confirming in [Some(3), None] {
        console.record(Record::Search(SearchStatus { budget: 20, confirming, ..SearchStatus::default() }));
        let stage = if confirming.is_some() { ExperimentStage::Proposed } else { ExperimentStage::Finished };
        console.stage(stage, 0);
        for rows in 18..50 {
            let screen = console.screen(80, rows);
            let points = (0..4).filter(|n| screen.contains(&format!("#{n}    2/2 "))).count();
            assert!(points > 0 || !screen.contains("landed mean, std"), "{screen}");
            match points {
                4 => assert!(!screen.contains("no room"), "{screen}"),
                0 => {}
                shown => assert_shows(&screen, &[&format!("{} more have no room", 4 - shown)]),
            }
        }
        console.press(&["3"]);
        let many = (0..9).map(|n| point(vec![n, 20 + n], 0.6, None)).collect();
        console.record(Record::Points(many));
        assert_shows(&console.screen(120, 40), &["5 more have no room"]);
        console.press(&["1"]);
        console.record(Record::Points((0..4).map(|n| point(vec![n, 20 + n], 0.6, None)).collect()));
    }
}

/// Regression: the last line was cut in the middle of a key at 80 columns.
#[test]
fn the_step_of_a_dialog_over_a_stop_has_whole_keys() {
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    console.press(&["2", "Enter"]);
    console.record(Record::Transition(Transition {
        from: Mode::Review,
        to: Mode::Damped,
        cause: TransitionCause::Stop.to_string(),
    }));
    console.mode_of_ticks(Mode::Damped);
    let last = |columns| console.screen(columns, 24).lines().last().unwrap_or_default().to_owned();
    assert_eq!(last(80), " STOPPED: k acknowledges. Up Down Home End other trials, Esc Enter q close.");
    assert_eq!(
        last(100),
        " STOPPED: k acknowledges. Up Down Home End other trials, PgUp PgDn scroll, Esc Enter q close."
    );
}

/// Regression: whole verdicts were left out of the heading without a sign.
#[test]
fn counts_that_the_heading_leaves_out_have_a_sign() {
    let mut console = Console::ready();
    console.judged(68);
    for number in 68..72 {
        let row = TrialRecord { cause: SKIPPED.into(), ..trial(number, Some(Verdict::Void), None) };
        console.record(Record::Trial(row));
    }
    console.press(&["2"]);
    for columns in 80..160 {
        let screen = console.screen(columns, 24);
        let heading = line_with(&screen, "Trials ");
        let shown = ["23 accept", "23 fall", "22 void", "4 not run"].map(|count| heading.contains(count));
        let some = shown.contains(&true) && shown.contains(&false);
        assert_eq!(heading.contains(", ..;"), some, "{heading}");
    }
    let counts = "23 accept, 23 fall, 22 void, 4 not run; s by number, F all, x columns";
    assert_shows(&console.screen(80, 24), &[counts]);
}

/// Regression: the form of the bounds stayed open over a STOP, and Enter would have changed them.
#[test]
fn stop_closes_every_form_and_applies_nothing_of_it() {
    let values = "STOP: damping. The form was closed, its values are not applied";
    type Opening = (&'static [&'static str], &'static str);
    let forms: [Opening; 5] = [
        (&["4", "B"], values),
        (&["4", "X"], values),
        (&["K"], values),
        (&["2", "Home", "f", "x"], "STOP: damping. The form was closed, no verdict was given"),
        (&["2", "/", "3"], "STOP: damping"),
    ];
    for (keys, said) in forms {
        let mut console = Console::ready();
        console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
        console.record(Record::Trial(trial(3, Some(Verdict::Accept), None)));
        console.press(keys);
        assert!(console.model.dialog.is_some(), "{keys:?}: {}", console.said());
        assert_eq!(console.press(&["F12"]), [Effect::Stop], "{keys:?}");
        assert_eq!(console.said(), said, "{keys:?}");
        assert!(console.model.dialog.is_none(), "{keys:?}");
        // Regression: after Ctrl-C nothing said that the form was closed.
        console.press(keys);
        assert_eq!(console.press(&["Ctrl-C"]), [Effect::Stop], "{keys:?}");
        assert_eq!(console.said(), format!("{said}. Ctrl-C again within 2 s quits"), "{keys:?}");
        assert!(console.model.dialog.is_none(), "{keys:?}");
    }
    // The field of the bounds names a form without a space, because Space is STOP there.
    let mut console = Console::ready();
    console.press(&["4", "B"]);
    assert_shows(&console.screen(80, 24), &["write it as 0.75..1.75 or 0.75,1.75, without a space"]);
    assert_eq!(console.press(&["1", "Space"]), [Effect::Stop]);
}

/// Regression: once the bounds were changed, the field and its refusal gave the first bounds as the example.
#[test]
fn the_example_of_bounds_is_the_present_ones() {
    let mut console = Console::ready();
    let narrowed = SearchedParameter { name: "f0".into(), low: 0.9, high: 1.5, least: 0.5, most: 3.0, fixed: None };
    console.record(Record::Search(SearchStatus { parameters: vec![narrowed], ..SearchStatus::default() }));
    console.press(&["4", "B"]);
    assert_shows(&console.screen(80, 24), &["write it as 0.9..1.5 or 0.9,1.5, without a space"]);
    console.enter("1");
    console.press(&["Enter"]);
    assert_shows(&joined(&console.screen(80, 24)), &["`1` is no range; write it as 0.9..1.5 or 0.9,1.5"]);
}

/// Regression: values outside of the configured bounds were drawn at the edge of an axis that ended at these, right of their own number.
#[test]
fn the_axes_of_the_optimizer_reach_the_bounds_that_were_widened() {
    let mut console = Console::ready();
    console.press(&["3"]);
    assert!(!console.screen(120, 40).contains("180.0"));
    let fx = SearchedParameter { name: "Fx".into(), low: 60.0, high: 180.0, least: 0.0, most: 200.0, fixed: None };
    console.record(Record::Search(SearchStatus { budget: 20, parameters: vec![fx], ..SearchStatus::default() }));
    assert_shows(&console.screen(120, 40), &["180.0"]);
    // A trial beyond, after the bounds were narrowed again, stays in its place.
    let mut far = trial(0, Some(Verdict::Fall), None);
    far.parameters = vec![("f0".into(), 1.25), ("Fx".into(), 195.0), ("Fz".into(), 250.0)].into();
    console.record(Record::Trial(far));
    assert_shows(&console.screen(120, 40), &["195.0"]);
}

/// Regression: the question about a re-run said that the point waits, though it was the proposal at once.
#[test]
fn the_question_about_a_rerun_says_when_it_runs() {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    console.record(Record::Proposal(proposal(1, 0)));
    console.stage(ExperimentStage::Proposed, 1);
    console.press(&["2", "r"]);
    assert_shows(
        &console.screen(80, 24),
        &["The parameters of trial #0 will be the proposal; the sampler's comes after."],
    );
    console.press(&["Esc"]);
    let queued = |trial| QueuedPoint { trial, source: ProposalSource::Queued, ..QueuedPoint::default() };
    console.record(Record::Search(SearchStatus { queue: vec![queued(1), queued(2)], ..SearchStatus::default() }));
    console.press(&["r"]);
    assert_shows(&console.screen(80, 24), &["The parameters of trial #0 will wait in the queue behind 2 points."]);
}

/// Regression: the empty queue named the form of the override as the only place of the key.
#[test]
fn the_empty_queue_says_where_its_key_works() {
    let mut console = Console::ready();
    console.press(&["N"]);
    assert_shows(
        &console.screen(80, 24),
        &["Q queues the values of the proposal; in the form of o those of the form."],
    );
    console.press(&["Esc"]);
    assert!(matches!(console.requests(&["Q", "y"])[..], [OperatorRequest::Enqueue(_)]));
}

/// Regression: "there is no trial yet" stood below a heading that named trial #0.
#[test]
fn before_the_first_jump_a_note_has_no_trial() {
    let mut console = Console::ready();
    console.press(&["m"]);
    assert_eq!(console.said(), "m is not possible: trial #0 has not jumped yet");
    console.press(&["Enter"]);
    assert_eq!(console.said(), "trial #0 has not jumped yet");
}

/// Regression: after a fall the last line left keys out without the one that shows them.
#[test]
fn after_a_fall_the_last_line_names_the_key_that_shows_the_others() {
    let mut console = Console::review(Mode::Jump, Verdict::Fall);
    let cause = TransitionCause::Fell(FallCause::BodyContact).to_string();
    console.record(Record::Transition(Transition { from: Mode::Jump, to: Mode::Damped, cause }));
    console.mode_of_ticks(Mode::Damped);
    console.record(Record::Trial(trial(0, Some(Verdict::Fall), Some(Verdict::Fall))));
    console.record(Record::Proposal(proposal(1, 0)));
    console.record(Record::Stage(StageRecord { stage: ExperimentStage::Proposed, trial: 1, can_undo: true, jumps: 0 }));
    let mut tick = console.model.snapshot.tick;
    tick.estimate.roll_pitch_yaw.x = 1.4;
    tick.mode = Mode::Disarmed;
    console.record(Record::Transition(Transition {
        from: Mode::Damped,
        to: Mode::Disarmed,
        cause: "acknowledged".into(),
    }));
    let snapshot = Snapshot { tick, ..console.model.snapshot };
    console.update(Msg::Snapshot(Box::new(snapshot)));
    let last = console.screen(80, 24).lines().last().unwrap_or_default().to_owned();
    assert!(last.contains("o override") && last.ends_with("? more"), "{last}");
}

/// Regression: at 80x24 some charts named the middle of their axis and others did not.
#[test]
fn all_charts_of_a_screen_name_the_middle_of_their_axis_or_none() {
    let mut console = Console::ready();
    console.model.live.mode = ChartMode::Scroll;
    console.ticks(0..4000, |time_ms| 0.1 * (time_ms as f64 / 300.0).sin());
    for rows in 24..60 {
        let screen = console.screen(80, rows);
        // Roll has an axis around zero, a foot one around -0.2.
        let rows_with =
            |starts: [&str; 3]| screen.lines().filter(|line| starts.iter().any(|s| line.starts_with(s))).count();
        let (labelled, symmetric) =
            (rows_with(["    0 ", " -0.2 ", " -0.2│"]), rows_with(["roll", "FR foot", "RR foot"]));
        assert!(labelled == 0 || labelled == symmetric, "{labelled} of {symmetric}:\n{screen}");
    }
}

/// The dialog that fixes a parameter says which trials use it up.
#[test]
fn the_dialog_that_fixes_a_parameter_says_which_trials_use_it_up() {
    let mut console = Console::ready();
    let fx = SearchedParameter { name: "Fx".into(), low: 0.0, high: 150.0, least: 0.0, most: 200.0, fixed: None };
    console.record(Record::Search(SearchStatus { parameters: vec![fx.clone()], ..SearchStatus::default() }));
    console.press(&["4", "Down", "X"]);
    assert_shows(&joined(&console.screen(80, 24)), &["a trial that is void or has another Fx uses up none"]);
    let fixed = Some(FixedParameter { value: 75.0, trials: 3 });
    console.record(Record::Search(SearchStatus {
        parameters: vec![SearchedParameter { fixed, ..fx }],
        ..SearchStatus::default()
    }));
    console.press(&["Esc"]);
    assert_shows(&console.screen(80, 24), &["fixed at 75.00, 3 more"]);
}

/// Regression: under `--approve falls-only` the first repeat jumped a second after Enter; the dialog said that each is approved.
#[test]
fn the_dialog_of_a_confirmation_says_that_its_jumps_follow_without_a_question() {
    let begins = "the jumps follow without a question, the first at once if the robot stands";
    for (approve, asks) in [(Approval::Each, true), (Approval::FallsOnly, false), (Approval::Auto, false)] {
        let mut console = Console::ready();
        console.record(Record::Session(SessionInfo { approve, ..session() }));
        console.judged(5);
        console.press(&["K"]);
        let screen = joined(&console.screen(80, 24));
        assert_eq!(screen.contains("each repeat is approved"), asks, "{screen}");
        assert_eq!(screen.contains(begins), !asks, "{screen}");
        assert_shows(&screen, &["not count for the budget"]);
    }
}
