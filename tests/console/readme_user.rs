//! Further answers and screens that a user of the README alone took for wrong.

use crate::support::{Console, assert_shows, line_with, proposal, tick, trial};
use quadfrog::recording::record::{
    LogLevel, LogRecord, Record, RequestRecord, SessionInfo, StageRecord, Stamped, Transition,
};
use quadfrog::recording::timeline::{Timeline, TrialRun};
use quadfrog::recording::writer::Writer;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{Fault, Mode, Phase, Tick, TransitionCause};
use quadfrog::trial::{
    ExperimentStage, FallRisk, PointRecord, Proposal, ProposalSource, QueuedPoint, SKIPPED, SearchStatus, TrialRecord,
    Verdict,
};
use quadfrog_console::message::{Effect, Msg, ReplayCommand, ReplayStatus, ReplayTimeline};

fn change(console: &mut Console, to: Mode, cause: &TransitionCause) {
    let from = console.model.mode();
    console.record(Record::Transition(Transition { from, to, cause: cause.to_string() }));
    console.mode_of_ticks(to);
}

/// The last line of the screen.
fn last(console: &Console, columns: u16) -> String {
    console.screen(columns, 24).lines().last().unwrap_or_default().to_owned()
}

/// Regression: the reason was in the log alone and no warning there; Live kept the warning before it.
#[test]
fn live_says_why_the_robot_sat_down_until_the_operator_does_something() {
    let reason = "the robot sat down: operator lost: no heartbeat of the operator's console for 1002 ms";
    let mut console = Console::ready();
    change(&mut console, Mode::SitDown, &TransitionCause::Fault(Fault::OperatorLost { silent_ms: 1002 }));
    change(&mut console, Mode::Disarmed, &TransitionCause::StepFinished);
    assert_eq!(console.said(), reason);
    // Neither a later report nor a look at other views removes it.
    console.record(Record::Trial(trial(0, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 0);
    console.press(&["2", "1"]);
    console.wait(6_000);
    assert_shows(&console.screen(80, 24).replace("\n ", " "), &[reason]);
    console.press(&["6", "F"]);
    assert_shows(&console.screen(120, 24), &["warnings and errors", "operator lost: no heartbeat"]);
    assert!(line_with(&console.screen(120, 24), "SIT DOWN: operator lost").contains("W "));
    console.press(&["1"]);
    let accepted = RequestRecord { request: "accept".into(), accepted: true, answer: "trial 0".into() };
    console.record(Record::Request(accepted));
    console.wait(20_000);
    assert!(!console.said().contains("sat down"), "{}", console.said());
}

#[test]
fn a_robot_that_sits_down_for_the_operator_needs_no_reason() {
    for cause in [TransitionCause::Command, TransitionCause::Fault(Fault::OperatorLeft)] {
        let mut console = Console::ready();
        change(&mut console, Mode::SitDown, &cause);
        console.wait(6_000);
        assert!(!console.said().contains("sat down"), "{}", console.said());
    }
    let mut console = Console::ready();
    change(&mut console, Mode::SitDown, &TransitionCause::Idle { allowed_s: 60.0 });
    assert_eq!(console.said(), "the robot sat down: idle: no approval or verdict for 60 s");
}

/// Regression: `best` was the best before the playhead.
#[test]
fn the_best_of_a_replay_is_that_of_the_recording() {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus::default()));
    let best = |console: &mut Console, best| {
        let trials = TrialRun { trial: 7, begin_ns: 1, row_ns: 1, impulse_ns: None, damped_ns: None, end_ns: 2 };
        let timeline = ReplayTimeline { trials: vec![trials], best, ..ReplayTimeline::default() };
        console.update(Msg::Timeline(Box::new(timeline)));
        console.press(&["G", "b", "e", "s", "t", "Enter"])
    };
    assert_eq!(best(&mut console, Some(7)), [Effect::Replay(ReplayCommand::Trial(7))]);
    assert_eq!(best(&mut console, None), []);
    assert_shows(&console.screen(80, 24), &["the recording has no accepted trial"]);
    console.press(&["Esc"]);
    assert_eq!(best(&mut console, Some(3)), []);
    assert_shows(&console.screen(80, 24), &["the best is trial 3, which is not in this recording"]);
    console.press(&["Esc", "G"]);
    assert_shows(&console.screen(80, 24), &["best of the recording"]);
}

/// Regression: the timeline showed the suggested verdict of a trial as a given one.
#[test]
fn a_trial_that_waits_for_its_verdict_has_none_on_the_timeline() {
    let mut console = Console::ready();
    let row = TrialRecord { verdict: None, ..trial(7, None, Some(Verdict::Accept)) };
    let run = TrialRun {
        trial: 7,
        begin_ns: 1_000_000_000,
        row_ns: 1,
        impulse_ns: None,
        damped_ns: None,
        end_ns: 8_000_000_000,
    };
    console.update(Msg::Replay(ReplayStatus { duration_ns: 10_000_000_000, ..ReplayStatus::default() }));
    let timeline = ReplayTimeline { trials: vec![run], rows: [(7, row)].into(), ..ReplayTimeline::default() };
    console.update(Msg::Timeline(Box::new(timeline)));
    let screen = console.screen(80, 24);
    let line = screen.lines().rev().nth(2).unwrap();
    assert!(line.contains('?') && !line.contains('o'), "{line}");
}

/// Regression: before the playhead the timeline had the verdict of the recording's end, and the table above it the one until then.
#[test]
fn the_timeline_has_the_verdict_of_the_table_until_the_playhead() {
    let mut console = Console::ready();
    let run = |trial: u32, begin_s: u64| TrialRun {
        trial,
        begin_ns: begin_s * 1_000_000_000,
        row_ns: 1,
        impulse_ns: None,
        damped_ns: None,
        end_ns: (begin_s + 1) * 1_000_000_000,
    };
    let changed = |number| (number, trial(number, Some(Verdict::Void), None));
    let rows = [changed(0), changed(1), (2, trial(2, Some(Verdict::Accept), None))].into();
    let timeline = ReplayTimeline { trials: vec![run(0, 1), run(1, 4), run(2, 8)], rows, ..ReplayTimeline::default() };
    console.update(Msg::Timeline(Box::new(timeline)));
    let at = |time_ns| ReplayStatus { time_ns, duration_ns: 10_000_000_000, ..ReplayStatus::default() };
    console.update(Msg::Replay(at(3_000_000_000)));
    console.record(Record::Trial(trial(0, Some(Verdict::Fall), None)));
    let marks = |console: &Console| {
        let line = console.screen(80, 24).lines().rev().nth(2).unwrap().to_owned();
        line.chars().filter(char::is_ascii_alphabetic).collect::<String>()
    };
    // Trials 1 and 2 are after the playhead.
    assert_eq!(marks(&console), "xvo");
    console.record(Record::Trial(trial(0, Some(Verdict::Void), None)));
    assert_eq!(marks(&console), "vvo");
}

/// Regression: frozen charts of a replay stayed beside every other place, and counted seconds of the clock on the wall.
#[test]
fn frozen_charts_of_a_replay_end_where_the_playhead_goes_elsewhere() {
    let at = |ms: u64| tick(ms, 0.1, None);
    for key in ["i", "[", ")", "p"] {
        let mut console = Console::ready();
        console.update(Msg::Replay(ReplayStatus { duration_ns: 10_000_000_000, ..ReplayStatus::default() }));
        (0..2000).step_by(5).for_each(|ms| console.tick(at(ms)));
        console.press(&["Left"]);
        console.wait(3000);
        assert_shows(&console.screen(120, 40), &["VIEW FROZEN 0.0 s"]);
        console.tick(at(2500));
        assert_shows(&console.screen(120, 40), &["VIEW FROZEN -0.5 s"]);
        console.press(&[key]);
        assert!(!console.screen(120, 40).contains("FROZEN"), "{key}: {}", console.screen(120, 40));
    }
}

/// Regression: a number without a mark went to that second without a word, and was meant as a trial.
#[test]
fn a_bare_number_says_what_it_was_taken_for() {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus { duration_ns: 20_000_000_000, ..ReplayStatus::default() }));
    let run = TrialRun { trial: 12, begin_ns: 1, row_ns: 1, impulse_ns: None, damped_ns: None, end_ns: 2 };
    console.update(Msg::Timeline(Box::new(ReplayTimeline { trials: vec![run], ..ReplayTimeline::default() })));
    let effects = console.press(&["G", "1", "2", "Enter"]);
    assert_eq!(effects, [Effect::Replay(ReplayCommand::Time(12_000_000_000))]);
    assert_eq!(console.said(), "12 s after the beginning; trial 12 is #12");
}

/// Two judged trials with signals, and trial 2 proposed.
fn with_two_jumps() -> Console {
    let mut console = Console::ready();
    for (number, verdict) in [(0, Verdict::Accept), (1, Verdict::Fall)] {
        for time_ms in (0..1500).step_by(5) {
            let time_s = time_ms as f64 / 1000.0 - 0.5;
            let phase = if time_s < 0.0 { Phase::Stance } else { Phase::Flight };
            console.tick(tick(u64::from(number) * 5000 + time_ms, 0.1, Some((number, time_s, phase))));
        }
        console.record(Record::Trial(trial(number, Some(verdict), None)));
    }
    console.ticks(9_000..9_100, |_| 0.0);
    console.record(Record::Proposal(proposal(2, 0)));
    console.stage(ExperimentStage::Proposed, 2);
    console
}

/// Regression: while Live showed the joints or the robot in place of the charts, two compared trials were nowhere to be seen.
#[test]
fn a_comparison_shows_the_charts() {
    for (sets, picture) in [(4, "Joints"), (5, "Robot")] {
        let mut console = with_two_jumps();
        console.press(&vec!["t"; sets]);
        assert_shows(&console.screen(80, 24), &[picture]);
        console.press(&["2", "Home", "c", "Down", "c", "1"]);
        assert_shows(&console.screen(80, 24), &["A #0 line, B #1 dotted"]);
        assert_shows(&last(&console, 120), &["Left Right cursor"]);
        // Without charts there is no cursor.
        console.press(&["t"]);
        assert!(!last(&console, 120).contains("cursor"), "{}", last(&console, 120));
        assert_shows(&last(&console, 120), &["Esc end comparison"]);
    }
}

/// Regression: the last line of Trials named no key of the selected row.
#[test]
fn the_last_line_of_trials_names_the_keys_of_the_row() {
    let mut console = with_two_jumps();
    console.press(&["2", "Home"]);
    assert_eq!(last(&console, 80), " Press g twice to jump. · Enter open · c compare · f v judge · r re-run · ? more");
    assert_shows(&last(&console, 120), &["r re-run · o override"]);
    console.press(&["Down"]);
    assert_shows(&last(&console, 80), &["a v judge"]);
    console.mode(Mode::Disarmed);
    assert_eq!(last(&console, 80), " Press A to arm. · Enter open · c compare · a v judge · r re-run · ? more");
    assert_shows(&last(&console, 120), &["Press A to arm: the robot stands up. · Enter open"]);
    // While a trial runs its row is no row of a verdict.
    console.mode(Mode::Jump);
    console.stage(ExperimentStage::Running, 2);
    assert_eq!(last(&console, 80), " Jumping. · Enter open · c compare · r re-run");
    console.press(&["1"]);
    assert!(!last(&console, 80).contains("open"), "{}", last(&console, 80));
}

/// A verdict that waits comes before the row.
#[test]
fn a_verdict_that_waits_comes_before_the_keys_of_the_row() {
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    console.press(&["2"]);
    let last = last(&console, 120);
    assert!(last.find("a accept (suggested)") < last.find("Enter open"), "{last}");
}

/// Of another row only the keys are named that are accepted while a trial waits.
#[test]
fn while_a_trial_waits_the_other_rows_can_be_opened_and_compared() {
    let mut console = with_two_jumps();
    console.record(Record::Trial(trial(2, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 2);
    console.mode(Mode::Review);
    console.press(&["2", "Home"]);
    let keys = " Trial 2 waits for its verdict: press 1. · Enter open · c compare · ? more";
    assert_eq!(last(&console, 80), keys);
}

/// Regression: neither the answer to the first `c` nor the comparison named the next key.
#[test]
fn the_keys_of_a_comparison_are_named() {
    let mut console = with_two_jumps();
    console.press(&["2", "Home", "c"]);
    assert_eq!(
        console.said(),
        "trial 0 is laid under the charts of a jump; c on another row of Trials compares the two"
    );
    let keys = " Press g twice to jump. · Enter open · c clear · f v judge · r re-run · ? more";
    assert_eq!(last(&console, 80), keys);
    console.press(&["Down", "c"]);
    let said = "A is trial 0, B is trial 1: 1 shows both in Live; there Left and Right move the cursor, Esc ends it";
    assert_eq!(console.said(), said);
    console.press(&["1"]);
    assert_shows(&last(&console, 80), &["Esc end comparison", "Left Right cursor"]);
    console.press(&["Esc"]);
    assert!(console.model.live.comparison.is_none());
    assert!(!last(&console, 120).contains("comparison"), "{}", last(&console, 120));
}

/// Regression: the reason stood between the old cause and the old verdict, and was cut.
#[test]
fn the_reason_of_a_changed_verdict_comes_first_and_whole() {
    let reason = "the video shows that the left hind foot slid off the mat, and that the cable pulled the trunk to the side \
                  before it landed";
    let cause = format!("{reason}; changed by the operator, was accept; landed and settled");
    // As earlier versions have written it.
    let before = format!("changed by the operator, was accept: {reason}; landed and settled");
    for cause in [cause, before] {
        let mut console = Console::ready();
        console.record(Record::Trial(TrialRecord { cause, ..trial(0, Some(Verdict::Void), None) }));
        for (columns, rows) in [(80, 24), (120, 40)] {
            console.update(Msg::Resize(columns, rows));
            console.press(&["2", "Enter"]);
            let screen = console.screen(columns, rows);
            assert!(line_with(&screen, "reason").contains("the video shows that"), "{screen}");
            let text = screen.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
            let cause = "cause changed by the operator, was accept (landed and settled)";
            assert_shows(&text, &[&format!("reason {reason} {cause}")]);
            console.press(&["Esc"]);
        }
    }
}

/// Regression: the question about a re-run sounded as if it was queued already.
#[test]
fn questions_say_what_will_happen() {
    let mut console = with_two_jumps();
    console.press(&["2", "Home", "r"]);
    let asked = "The parameters of trial #0 will be the proposal; the sampler's comes after.";
    assert_shows(&console.screen(80, 24), &[asked]);
    console.press(&["Esc", "n"]);
    assert_shows(&console.screen(80, 24), &["Trial #2 will not be run"]);
}

/// Regression: `*best` looked like a misprint.
#[test]
fn the_sign_of_the_best_stands_apart_from_its_word() {
    let mut console = Console::ready();
    console.judged(1);
    let point = PointRecord { trials: vec![0, 5], mean: 0.4, without_fall: 2, ..PointRecord::default() };
    console.record(Record::Points(vec![point]));
    console.stage(ExperimentStage::Finished, 5);
    for (columns, rows) in [(80, 24), (120, 40)] {
        assert_shows(&console.screen(columns, rows), &["* best 0.400 m (#0)"]);
    }
}

/// Regression: the queue showed six digits without units.
#[test]
fn queued_points_have_the_digits_and_units_of_the_card() {
    let mut console = Console::ready();
    let parameters = vec![("f0".into(), 1.234_567), ("Fx".into(), 90.0), ("Fz".into(), 240.123)].into();
    let gains = vec![("kp".into(), 450.0)].into();
    let point = QueuedPoint { trial: 3, source: ProposalSource::Queued, parameters, gains, ..QueuedPoint::default() };
    console.record(Record::Search(SearchStatus { queue: vec![point], ..SearchStatus::default() }));
    console.press(&["N"]);
    assert_shows(
        &console.screen(120, 40),
        &["#3    queued          f0 1.235 Hz, Fx 90.00 N, Fz 240.1 N, kp 450.0 N/m"],
    );
}

/// Regression: "0 of the 1 nearest fell".
#[test]
fn the_falls_near_a_proposal_are_named_in_their_number() {
    for (falls, neighbours, text) in [
        (0, 1, "the only judged trial stood"),
        (1, 1, "the only judged trial fell"),
        (0, 5, "none of the 5 nearest trials fell"),
        (2, 5, "2 of the 5 nearest trials fell"),
        (5, 5, "all 5 nearest trials fell"),
    ] {
        let mut console = Console::ready();
        let risk = Some(FallRisk { falls, neighbours, nearest_fall: None, nearest_fall_trial: None });
        console.record(Record::Proposal(Proposal { risk, ..proposal(0, 1) }));
        assert_shows(&console.screen(120, 40), &[text]);
        console.record(Record::Trial(TrialRecord { risk, ..trial(0, Some(Verdict::Accept), None) }));
        console.press(&["2", "Enter"]);
        assert_shows(&console.screen(120, 40), &[&format!("risk before    {text}")]);
    }
}

/// Regression: the sentence about the nearest fall took three lines, and the chart of J lost its axis.
#[test]
fn the_nearest_fall_leaves_the_chart_its_axis() {
    let mut console = Console::ready();
    console.judged(2);
    let with = |console: &mut Console, risk| {
        console.record(Record::Proposal(Proposal { risk, ..proposal(2, 1) }));
        console.stage(ExperimentStage::Proposed, 2);
        console.screen(80, 24)
    };
    // Below a message of two lines, too.
    let long = "a report of the session that is longer than the eighty columns of a small terminal are wide";
    console.record(Record::Log(LogRecord { level: LogLevel::Warning, source: "test".into(), message: long.into() }));
    for (falls, text) in [(0, "none of the 5 nearest trials"), (2, "2 of the 5 nearest trials fell;")] {
        let risk = FallRisk { falls, neighbours: 5, nearest_fall: Some(1.06), nearest_fall_trial: Some(112) };
        let screen = with(&mut console, Some(risk));
        assert_shows(&screen, &[text, "nearest fall #112: 106 %", "columns of a small", "#19"]);
    }
}

/// Regression: the key that ends a confirmation made the last verdict final without a word.
#[test]
fn the_end_of_a_confirmation_is_asked_for() {
    let mut console = Console::ready();
    for (number, verdict) in [(0, Some(Verdict::Accept)), (1, None), (1, Some(Verdict::Accept))] {
        console.record(Record::Trial(trial(number, verdict, None)));
    }
    console.record(Record::Search(SearchStatus { confirming: Some(4), ..SearchStatus::default() }));
    console.stage(ExperimentStage::Review, 1);
    console.record(Record::Stage(StageRecord { stage: ExperimentStage::Proposed, trial: 2, can_undo: true, jumps: 0 }));
    assert_eq!(console.requests(&["K"]), []);
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["End the repeats?", "4 repeats will not be run", "Press y to end the repeats"]);
    assert_shows(&screen, &["The verdict of trial #1 then stays: u does not take it back any longer."]);
    assert_eq!(console.requests(&["Enter"]), []);
    assert_eq!(console.said(), "cancelled: the repeats go on");
    assert_eq!(console.requests(&["K", "y"]), [OperatorRequest::ConfirmBest { repeats: 0 }]);
}

/// Regression: the details of a trial at whose begin the playhead of a replay stood said that it was not judged, and nothing opened
/// those of the last trial.
#[test]
fn the_details_of_a_replay_are_those_of_the_whole_recording() {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus::default()));
    console.model.snapshot.tick = tick(100, 0.0, Some((4, 0.0, Phase::Stance)));
    let running = TrialRecord { value: None, measured: None, cause: String::new(), ..trial(4, None, None) };
    console.record(Record::Trial(running));
    console.stage(ExperimentStage::Running, 4);
    let judged = TrialRecord { cause: "landed and settled".into(), ..trial(4, Some(Verdict::Accept), None) };
    let later = trial(5, Some(Verdict::Fall), None);
    let span = TrialRun { trial: 4, begin_ns: 1, row_ns: 1, impulse_ns: None, damped_ns: None, end_ns: 2 };
    let rows = [judged, later].into_iter().map(|row| (row.trial, row)).collect();
    let timeline = ReplayTimeline { trials: vec![span], rows, ..ReplayTimeline::default() };
    console.update(Msg::Timeline(Box::new(timeline)));
    console.press(&["2", "Home", "Enter"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["Trial #4, at the end of the recording", "accept", "landed and settled"]);
    assert!(!screen.contains("not judged") && !screen.contains("no end so far"), "{screen}");
    console.press(&["Down"]);
    assert_shows(&console.screen(120, 40), &["Trial #5", "fall"]);
}

/// Regression: the question of a field stayed beside another one.
#[test]
fn an_override_says_nothing_of_the_field_that_was_left() {
    let mut console = Console::ready();
    console.press(&["o", "Down", "x", "Enter"]);
    assert_shows(&console.screen(120, 40), &["a character was not taken; Enter again"]);
    console.press(&["Down"]);
    assert!(!console.screen(120, 40).contains("Enter again"), "{}", console.screen(120, 40));
}

/// Regression: the keys to the next fall passed a robot that fell where the trial was judged void, and a trial that was judged a
/// fall until its verdict was changed.
#[test]
fn a_fall_is_found_whatever_its_verdict_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("session.mcap");
    let mut writer = Writer::create(&path, &SessionInfo::default(), 0, &[]).expect("a writer");
    writer.tick(&Tick::default()).expect("a tick");
    let [accept, fall, void] = [Verdict::Accept, Verdict::Fall, Verdict::Void].map(Some);
    let judged = [
        (1, fall, void),
        (2, accept, fall),
        (3, fall, None),
        (4, accept, accept),
        (5, void, void),
        (6, accept, fall),
        (6, accept, accept),
    ];
    for (time_ns, (number, suggested, verdict)) in (1..).zip(judged) {
        let row = TrialRecord { suggested, ..trial(number, verdict, None) };
        writer.record(&Stamped { time_ns, record: Record::Trial(row) }).expect("a record");
    }
    writer.finish().expect("a recording");
    let recording = Timeline::open(&[path]).expect("the recording");
    assert_eq!(recording.falls().into_iter().collect::<Vec<_>>(), [1, 2, 3, 6]);
}

/// Regression: a trial that was not run was "not in this recording" where the playhead was before its proposal.
#[test]
fn a_trial_that_was_not_run_is_named_so_wherever_the_playhead_is() {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus::default()));
    let skipped = TrialRecord { cause: SKIPPED.into(), ..trial(7, Some(Verdict::Void), None) };
    let timeline = ReplayTimeline { rows: [(7, skipped)].into(), ..ReplayTimeline::default() };
    console.update(Msg::Timeline(Box::new(timeline)));
    console.press(&["G"]);
    console.enter("#7");
    console.press(&["Enter"]);
    assert_shows(&console.screen(80, 24), &["trial 7 was not run"]);
}

/// Regression: for one screen after the jump the last line said that the sampler was choosing the next trial.
#[test]
fn between_the_jump_and_its_measured_values_no_next_trial_is_named() {
    let mut console = Console::ready();
    console.stage(ExperimentStage::Running, 0);
    console.mode(Mode::Review);
    let last = last(&console, 80);
    assert!(last.contains("Measuring the jump.") && !last.contains("sit down"), "{last}");
}

/// Regression: of a re-run after a fall the card counted the falls of judged trials alone.
#[test]
fn a_re_run_of_a_point_that_fell_says_so() {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, Some(Verdict::Void), Some(Verdict::Fall))));
    let again = Proposal { parent: Some(0), source: ProposalSource::Rerun, ..proposal(1, 0) };
    console.record(Record::Proposal(again.clone()));
    console.stage(ExperimentStage::Proposed, 1);
    for (columns, rows) in [(60, 20), (80, 24), (120, 40)] {
        assert_shows(&console.screen(columns, rows), &["this point fell in #0"]);
    }
    // With another value it is another point.
    let mut changed = again;
    changed.parameters[0].value += 0.1;
    console.record(Record::Proposal(changed));
    let screen = console.screen(120, 40);
    assert!(!screen.contains("this point fell"), "{screen}");
}

/// Trial 1 is proposed, and the verdict of trial 0 can still be taken back.
fn proposed_after_a_verdict() -> Console {
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), Some(Verdict::Accept))));
    console.record(Record::Proposal(proposal(1, 0)));
    console.record(Record::Stage(StageRecord { stage: ExperimentStage::Proposed, trial: 1, can_undo: true, jumps: 0 }));
    console.mode(Mode::Ready);
    console
}

/// Regression: the question before a proposal is skipped did not say that the last verdict becomes final.
#[test]
fn skipping_says_that_the_last_verdict_stays() {
    let mut console = proposed_after_a_verdict();
    console.press(&["n"]);
    let screen = console.screen(80, 24);
    assert_shows(
        &screen,
        &["Skip the proposal?", "The verdict of trial #0 then stays: u does not take it back any longer."],
    );
}

/// Regression: the question before quitting did not say that the last verdict becomes final.
#[test]
fn quitting_says_that_the_last_verdict_stays() {
    let mut console = proposed_after_a_verdict();
    console.press(&["q"]);
    assert_shows(&console.screen(80, 24), &["Quit?", "The verdict of trial #0 then stays; Trials changes it"]);
}

/// Regression: a void trial covered an accepted one that came down at the same place.
#[test]
fn a_void_trial_covers_no_accepted_one_among_the_landings() {
    let mut console = Console::ready();
    for (number, verdict) in [(0, Verdict::Accept), (1, Verdict::Accept), (2, Verdict::Void)] {
        let mut row = trial(number, Some(verdict), None);
        row.measured.as_mut().expect("measured").dx_m = if number == 1 { 0.9 } else { 0.4 };
        console.record(Record::Trial(row));
    }
    console.press(&["3"]);
    let screen = console.screen(120, 40);
    let accepted = |line: &str| line.trim_end().ends_with(" o");
    assert!(screen.lines().any(accepted), "{screen}");
}

/// Regression: after a cancelled countdown the program offered a fall, and a value by hand of a jump that had not been.
#[test]
fn of_a_trial_that_did_not_jump_void_and_the_same_again_are_left() {
    let mut console = Console::ready();
    console.stage(ExperimentStage::Running, 0);
    let cause = "countdown cancelled, the robot did not jump".into();
    let cancelled = TrialRecord { cause, measured: None, ..trial(0, None, Some(Verdict::Void)) };
    console.record(Record::Trial(cancelled));
    console.stage(ExperimentStage::Review, 0);
    for key in ["a", "f", "="] {
        console.wait(1_000);
        assert_eq!(console.requests(&[key]), [], "{key}");
        assert_shows(console.said(), &["the robot did not jump: v void gives the point up, r runs it again"]);
    }
    let last = last(&console, 120);
    assert_shows(&last, &["v void (suggested)", "r re-run"]);
    assert!(!last.contains("f fall") && !last.contains("by hand"), "{last}");
    // Regression: its details said when it ran and how long, as those of a jump do.
    console.press(&["2", "Enter"]);
    assert_shows(&console.screen(120, 40), &["the countdown alone, at 00:00 of the session"]);
}

/// Regression: a trial of an earlier session, with which nothing is recorded here, was "no jump has been recorded yet".
#[test]
fn a_trial_of_another_session_that_cannot_be_compared_says_where_it_is() {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, None, Some(Verdict::Accept))));
    console.press(&["2", "Home", "c"]);
    assert_shows(console.said(), &["trial 0 was recorded in another session: quadfrog replay"]);
}
