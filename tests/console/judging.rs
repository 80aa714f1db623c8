//! From the landing to the verdict: the trial on the charts, the countdown, the questions before what cannot be meant.

use crate::support::{Console, assert_shows, line_with, proposal, session, tick, trial};
use quadfrog::recording::record::{Record, SessionInfo, StageRecord, Transition};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{FallCause, Mode, Phase, Snapshot, Tick, TransitionCause};
use quadfrog::trial::{Backend, ExperimentStage, Proposal, REMOVED, SKIPPED, TrialRecord, Verdict};
use quadfrog_console::message::{Effect, ExportedRows, Msg, ReplayStatus};
use quadfrog_console::model::dialog::Dialog;
use quadfrog_console::text;
use quadfrog_console::theme::Role;
use ratatui::buffer::Cell;

/// A trial runs: countdown of 1 s, impulse, flight, landing until 1.2 s after the impulse began.
fn run(console: &mut Console, number: u32, from_ms: u64) {
    console.stage(ExperimentStage::Running, number);
    for time_ms in (0..2_200).step_by(5) {
        let phase = match time_ms {
            0..1_000 => Phase::Stance,
            1_000..1_200 => Phase::Impulse,
            1_200..1_500 => Phase::Flight,
            _ => Phase::Landing,
        };
        let roll = 0.1 * f64::from(number) + 0.1 * (time_ms as f64 / 200.0).sin();
        console.tick(tick(from_ms + time_ms, roll, Some((number, time_ms as f64 / 1e3 - 1.0, phase))));
    }
}

/// Trial 0 was accepted, trial 1 waits for its verdict; `after_ms` later.
fn landed(after_ms: u64) -> Console {
    let mut console = Console::ready();
    run(&mut console, 0, 1_000);
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    run(&mut console, 1, 5_000);
    console.record(Record::Trial(trial(1, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 1);
    console.mode(Mode::Review);
    console.ticks(7_200..7_200 + after_ms, |_| 0.0);
    console
}

/// The columns of impulse and flight in the line under the charts; none without a jump in it.
fn impulse_and_flight(screen: &str) -> Option<(usize, usize)> {
    let line = screen.lines().find(|line| line.contains("flight"))?;
    let column = |name: &str| line.find(name).map(|at| line[..at].chars().count());
    let (impulse, flight, landing) =
        (column("impulse").or_else(|| column("push"))?, column("flight")?, column("landing")?);
    Some((flight - impulse, landing - flight))
}

#[test]
fn the_landed_trial_stays_on_the_charts_until_its_verdict() {
    for size in [(80, 24), (120, 40), (200, 60)] {
        let at_once = landed(0).screen(size.0, size.1);
        let mut console = landed(40_000);
        let later = console.screen(size.0, size.1);
        assert_shows(&later, &["TRIAL #1", "#1, #0 under it, -0.3 to +1.2 s"]);
        let charts = |screen: &str| screen.lines().skip(3).take(9).map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(charts(&at_once), charts(&later), "40 s later the charts have changed at {size:?}");
        console.record(Record::Trial(trial(1, Some(Verdict::Accept), None)));
        console.stage(ExperimentStage::Proposed, 2);
        let judged = console.screen(size.0, size.1);
        assert!(!judged.contains("TRIAL #1") && judged.contains(" 8 s sweep"), "{judged}");
        assert_eq!(impulse_and_flight(&judged), None, "the jump left the live charts long ago:\n{judged}");
    }
}

/// The impulse takes 0.2 s of 1.5 s and the flight 0.3 s: of the 34 columns of the left charts over 80 columns four and seven.
#[test]
fn the_jump_fills_the_charts_and_at_80_columns_these_the_terminal() {
    let screen = landed(20_000).screen(80, 24);
    let (impulse, flight) = impulse_and_flight(&screen).unwrap_or_else(|| panic!("no phases:\n{screen}"));
    assert!((4..=5).contains(&impulse) && (6..=8).contains(&flight), "{impulse} and {flight} columns:\n{screen}");
    // The description under the right charts covers no name.
    assert_shows(&line_with(&screen, "flight"), &["landing", "#1, #0 under it, -0.3 to +1.2 s"]);
    assert_shows(&screen, &["suggested verdict: accept", "rise", "#", "verdict"]);
}

/// A series under the samples is the best trial; the one chosen by its key replaces it.
#[test]
fn the_best_trial_lies_under_the_landed_one() {
    let console = landed(1_000);
    let buffer = console.draw(120, 40);
    let dim = console.model.theme.style(Role::Ghost).add_modifier;
    let dots = |cell: &&Cell| ("\u{2801}".."\u{2900}").contains(&cell.symbol()) && cell.modifier == dim;
    let count = buffer.content().iter().filter(dots).count();
    assert!(count > 20, "{count} cells of the ghost");
}

#[test]
fn a_key_returns_to_the_present_and_back_to_the_landed_trial() {
    let mut console = landed(20_000);
    console.press(&["z"]);
    let present = console.screen(80, 24);
    assert!(present.contains(" 8 s sweep") && !present.contains("TRIAL #1"), "{present}");
    assert_shows(&present, &["the charts show the present; z shows trial 1 again"]);
    console.press(&["z"]);
    assert_eq!(console.said(), "the charts show trial 1; z shows the present");
    assert_shows(&console.screen(80, 24), &["TRIAL #1", "#0 under it"]);
    console.press(&["2"]);
    assert!(!console.screen(80, 24).contains("TRIAL #1"), "the other views show the present");
}

#[test]
fn the_cursor_reads_the_landed_trial() {
    let mut console = landed(20_000);
    console.press(&["Right", "Right"]);
    assert_shows(&console.screen(80, 24), &["at +0.03 s"]);
    // 5 ms steps; the impulse of trial 1 begins at 6 s.
    let roll = 0.1 + 0.1 * (1_030_f64 / 200.0).sin();
    assert_shows(&line_with(&console.screen(80, 24), "roll"), &[&format!("{roll:+.3} rad")]);
    console.press(&["+"]);
    assert_shows(console.said(), &["trial 1 is fitted to the charts"]);
}

#[test]
fn charts_that_were_frozen_before_the_jump_show_the_landed_trial() {
    let mut console = Console::ready();
    console.ticks(0..1_000, |_| 0.3);
    console.press(&["z"]);
    run(&mut console, 0, 1_000);
    console.record(Record::Trial(trial(0, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 0);
    let screen = console.screen(80, 24);
    assert!(screen.contains("TRIAL #0") && !screen.contains("VIEW FROZEN"), "{screen}");
}

#[test]
fn a_replay_and_a_trial_without_signals_show_the_playhead() {
    let mut console = landed(1_000);
    console.update(Msg::Replay(ReplayStatus { playing: true, speed: 1.0, ..ReplayStatus::default() }));
    assert!(!console.screen(80, 24).contains("TRIAL #1"));
    let console = Console::review(Mode::Review, Verdict::Accept);
    assert!(!console.screen(80, 24).contains("TRIAL #0"), "no signals of it");
}

fn count_down(console: &mut Console, left_s: f64) -> Vec<Effect> {
    let number = console.model.snapshot.tick.number + 1;
    let tick = Tick { number, mode: Mode::Countdown, trial_time_s: -left_s, ..console.model.snapshot.tick };
    console.update(Msg::Snapshot(Box::new(Snapshot { tick, ..console.model.snapshot })))
}

#[test]
fn the_countdown_counts_in_large_digits_with_the_bell() {
    let mut console = Console::ready();
    for (left_s, seconds) in [(3.0, 3), (2.01, 3), (1.99, 2), (0.7, 1)] {
        let rings = count_down(&mut console, left_s) == [Effect::Bell];
        assert_eq!(rings, left_s != 2.01, "{left_s}");
        for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
            let screen = console.screen(columns, rows);
            let lead = format!("Jump in {seconds} s: any key cancels it.");
            assert_eq!(screen.matches(&lead).count(), 2, "beside the digits and as the next step:\n{screen}");
            let lines: Vec<&str> = screen.lines().collect();
            assert!(lines[1].contains("STOP"), "{screen}");
        }
    }
    // The five rows of the digit 1.
    let screen = console.screen(80, 24);
    let full = console.model.theme.fill().0;
    let rows: Vec<usize> = screen.lines().map(|line| line.matches(&full.repeat(2)).count()).collect();
    let digit: Vec<usize> = rows.iter().copied().filter(|count| *count > 0).collect();
    assert!(digit.ends_with(&[3]) && digit.len() >= 5, "{digit:?}\n{screen}");
    console.mode(Mode::Jump);
    assert!(!console.screen(80, 24).contains("any key cancels"));
}

#[test]
fn accepting_what_was_not_suggested_asks_once_more() {
    let accept = [OperatorRequest::Judge(Verdict::Accept)];
    for mode in [Mode::Review, Mode::Damped, Mode::Disarmed] {
        let mut console = Console::review(mode, Verdict::Fall);
        assert_eq!(console.requests(&["a"]), [], "{mode:?}");
        let screen = console.screen(80, 24);
        assert_shows(&screen, &["Accept a fall?", "fall: roll 1.200 rad", "exceeds 1.000 rad.", "J = 0.420 m"]);
        assert_eq!(console.requests(&["y"]), accept);
        for key in ["a", "Enter", "Esc", "f", "n"] {
            assert_eq!(console.requests(&["a", key]), [], "{key} in {mode:?}");
            assert_eq!(console.said(), "cancelled: not accepted");
        }
        assert_eq!(console.requests(&["f"]), [OperatorRequest::Judge(Verdict::Fall)]);
    }
    let mut console = Console::review(Mode::Damped, Verdict::Void);
    assert_eq!(console.requests(&["a"]), []);
    let screen = console.screen(80, 24);
    assert_shows(
        &screen,
        &["Accept a void trial?", "The suggested verdict of trial #0 is void", "void hides the trial"],
    );
    assert_eq!(console.requests(&["y"]), accept);
    // Nothing was measured, or the operator stopped it: a fall would keep the sampler away from its parameters.
    let mut console = Console::review(Mode::Damped, Verdict::Void);
    assert_eq!(console.requests(&["f", "n"]), []);
    assert_eq!(console.said(), "cancelled: not judged a fall");
    assert_eq!(console.requests(&["f"]), []);
    let parts = ["Judge a void trial a fall?", "Fall reports J = 0", "Press y to judge trial #0 a fall"];
    assert_shows(&console.screen(80, 24), &parts);
    assert_eq!(console.requests(&["y"]), [OperatorRequest::Judge(Verdict::Fall)]);
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    assert_eq!(console.requests(&["a"]), accept, "a suggested accept needs one key");
}

/// Regression: a trial without a value was offered to be accepted, and the session refused it.
#[test]
fn a_trial_without_a_value_cannot_be_accepted_before_one_is_given() {
    let mut console = Console::review(Mode::Review, Verdict::Void);
    let cause = "3 ticks of it not recorded: not measured".into();
    console.record(Record::Trial(TrialRecord { measured: None, cause, ..trial(0, None, Some(Verdict::Void)) }));
    assert!(!console.screen(120, 40).contains("a accept"), "it is not offered");
    assert_eq!(console.requests(&["a"]), []);
    assert_shows(console.said(), &["a is not possible: nothing was measured: = gives a value measured by hand"]);
    assert!(console.model.dialog.is_none());
}

/// Regression: 99 m for a jump was taken without a question, and became the best of the study.
#[test]
fn a_value_by_hand_far_from_the_measured_one_is_asked_about() {
    for (typed, value) in [("99", 99.0), ("-5", -5.0), ("0.042", 0.042), ("4.2", 4.2)] {
        let mut console = Console::review(Mode::Review, Verdict::Accept);
        console.press(&["="]);
        console.enter(typed);
        assert_eq!(console.requests(&["Enter"]), [], "{typed}");
        let text = format!("Trial #0: {value} m by hand, but the robot measured 0.420 m.");
        let screen = console.screen(80, 24);
        assert_shows(&screen, &["Is this value right?", &text, "Press y to use the value", "goes back to the field."]);
        // Regression: "any other key cancels" was said of a key that leads back to the field.
        assert!(screen.contains(" Back to the field ") && !screen.contains("ancel"), "{screen}");
        assert_eq!(console.requests(&["n"]), []);
        assert_shows(&console.screen(80, 24), &["Trial #0, measured by hand", &value.to_string()]);
        console.enter(typed);
        assert_eq!(console.requests(&["Enter", "y"]), [OperatorRequest::HandValue(Some(value))]);
    }
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    console.press(&["="]);
    console.enter("99.12345678");
    console.press(&["Enter", "n"]);
    assert_shows(&console.screen(80, 24), &["99.12345678"]);
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    console.press(&["="]);
    console.enter("0.45");
    assert_eq!(console.requests(&["Enter"]), [OperatorRequest::HandValue(Some(0.45))], "a tape measure's correction");
}

/// Regression: after an undone verdict the header said READY while the trial waited for its verdict.
#[test]
fn a_standing_robot_with_a_trial_to_judge_is_in_review() {
    let console = Console::review(Mode::Ready, Verdict::Accept);
    assert!(console.screen(80, 24).starts_with(" REVIEW "), "{}", console.screen(80, 24));
    let console = Console::review(Mode::Disarmed, Verdict::Accept);
    assert!(console.screen(80, 24).starts_with(" DISARMED "), "a robot that lies is disarmed in any case");
}

/// Regression: a jump that leaves the ground while its impulse acts showed no flight, although its time in the air was given.
#[test]
fn the_flight_on_the_charts_is_that_of_the_feet() {
    let mut console = Console::ready();
    console.stage(ExperimentStage::Running, 0);
    for time_ms in (0..2_200).step_by(5) {
        let phase = if time_ms < 1_000 { Phase::Stance } else { Phase::Impulse };
        let mut tick = tick(1_000 + time_ms, 0.0, Some((0, time_ms as f64 / 1e3 - 1.0, phase)));
        // The feet flicker for 10 ms, too short for a flight.
        let airborne = matches!(time_ms, 1_050..1_060 | 1_200..1_600);
        tick.estimate.contact = [!airborne; 4];
        console.tick(tick);
    }
    console.record(Record::Trial(trial(0, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 0);
    let screen = console.screen(80, 24);
    let line = screen.lines().find(|line| line.contains("flight")).unwrap_or_else(|| panic!("no flight:\n{screen}"));
    let (flight, landing) = (line.find("flight"), line.find("landing"));
    assert!(flight < landing && line.find('│') < flight, "impulse, flight, landing: {line}");
}

#[test]
fn the_question_closes_when_the_trial_is_judged_elsewhere() {
    let mut console = Console::review(Mode::Review, Verdict::Fall);
    console.press(&["a"]);
    console.record(Record::Trial(trial(0, Some(Verdict::Fall), None)));
    console.stage(ExperimentStage::Proposed, 1);
    assert_eq!(console.requests(&["y"]), []);
}

/// The letters of the arming confirmation, typed where its dialog did not open, contain the key that skips.
#[test]
fn letters_typed_without_a_dialog_never_skip_a_proposal() {
    for console in [Console::ready(), Console::proposed()] {
        let mut console = console;
        assert_eq!(console.requests(&["s", "t", "a", "n", "d"]), []);
        assert_eq!(console.said(), "cancelled: not skipped");
        assert_eq!(console.requests(&["n"]), []);
        assert_shows(&console.screen(80, 24), &["Skip the proposal?", "Trial #0", "Press y to skip trial #0"]);
        assert_eq!(console.requests(&["y"]), [OperatorRequest::Skip { trial: 0, revision: 0 }]);
        console.press(&["n"]);
        console.record(Record::Proposal(proposal(0, 1)));
        assert_eq!(console.requests(&["y"]), [], "another proposal than the one of the question");
    }
}

#[test]
fn the_verdict_of_a_selected_row_is_changed_with_a_reason() {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    console.record(Record::Trial(trial(1, Some(Verdict::Fall), None)));
    assert_eq!(console.requests(&["f"]), []);
    assert_shows(console.said(), &["no trial waits for a verdict; in Trials, select a judged one"]);
    console.press(&["2", "Up", "a"]);
    assert_shows(console.said(), &["a is not possible: trial 0 is accept already"]);
    console.press(&["f"]);
    assert_shows(&console.screen(80, 24), &["Trial #0: accept becomes fall. Why?", "the journal keeps the"]);
    assert_eq!(console.requests(&["Enter"]), [], "a change needs a reason");
    assert_shows(&console.screen(80, 24), &["give the reason of the change"]);
    console.enter("it");
    console.press(&["Space"]);
    console.enter("lay");
    let change = OperatorRequest::ChangeVerdict { trial: 0, verdict: Verdict::Fall, reason: "it lay".into() };
    assert_eq!(console.requests(&["Enter"]), [change]);
    // While a trial waits for its verdict the keys are for that one, and refused on another row.
    console.stage(ExperimentStage::Running, 2);
    assert_eq!(console.requests(&["f"]), [], "during a trial");
    console.record(Record::Trial(trial(2, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 2);
    for key in ["a", "f", "v", "r", "="] {
        assert_eq!(console.requests(&[key]), [], "{key}");
        assert_shows(
            console.said(),
            &[&format!("{key} is not possible: trial 2 waits for its verdict, but 0 is selected")],
        );
        assert!(console.model.dialog.is_none(), "{key}");
    }
    console.press(&["End"]);
    assert_eq!(console.requests(&["v"]), [OperatorRequest::Judge(Verdict::Void)]);
}

/// Regression: the arrows of the details showed other trials, and the keys of the verdict still judged the waiting one.
#[test]
fn the_keys_act_on_the_trial_whose_details_are_shown() {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, Some(Verdict::Fall), None)));
    console.record(Record::Trial(trial(1, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 1);
    console.press(&["Enter"]);
    assert_shows(&console.screen(80, 24), &["Trial #1"]);
    console.press(&["Up"]);
    assert_eq!(console.requests(&["a"]), []);
    assert_shows(console.said(), &["trial 1 waits for its verdict, but 0 is selected"]);
}

/// Regression: once a newer trial had come, the keys over the details acted on that one.
#[test]
fn the_keys_over_details_act_on_their_trial_when_a_newer_one_comes() {
    for view in ["1", "2", "5"] {
        let opened = || {
            let mut console = Console::ready();
            console.record(Record::Trial(trial(7, Some(Verdict::Accept), None)));
            console.press(&[view, "Enter"]);
            assert_shows(&console.screen(80, 24), &["Trial #7"]);
            console.record(Record::Trial(trial(8, Some(Verdict::Accept), None)));
            console
        };
        let mut console = opened();
        console.press(&["m"]);
        assert_shows(&console.screen(80, 24), &["Note on trial #7"]);
        let mut console = opened();
        console.press(&["f"]);
        assert_shows(&console.screen(80, 24), &["Trial #7: accept becomes fall. Why?"]);
        // The newer one waits for its verdict: no key judges it over the details of another.
        let mut console = opened();
        console.record(Record::Trial(trial(8, None, Some(Verdict::Accept))));
        console.stage(ExperimentStage::Review, 8);
        assert_eq!(console.requests(&["a"]), []);
        assert_shows(console.said(), &["trial 8 waits for its verdict, but 7 is selected"]);
    }
    // A row that the filter leaves out.
    let mut console = Console::ready();
    console.judged(2);
    console.press(&["2", "F"]);
    assert_shows(&console.screen(120, 40), &["only accept (F)"]);
    console.press(&["Enter", "Down"]);
    assert_shows(&console.screen(80, 24), &["Trial #1"]);
    console.press(&["m"]);
    assert_shows(&console.screen(80, 24), &["Note on trial #1"]);
}

/// Regression: keys acted on a row that the filter left out.
#[test]
fn no_key_acts_on_a_row_that_the_filter_leaves_out() {
    let mut console = Console::ready();
    for (number, verdict) in [(0, Verdict::Fall), (1, Verdict::Accept), (2, Verdict::Accept)] {
        console.record(Record::Trial(trial(number, Some(verdict), None)));
    }
    console.stage(ExperimentStage::Proposed, 3);
    console.press(&["2", "F", "F"]);
    assert_shows(&console.screen(120, 40), &["only fall (F)", ">  0"]);
    console.press(&["v"]);
    assert_shows(&console.screen(80, 24), &["Trial #0: fall becomes void. Why?"]);
    console.press(&["Esc", "/", "2", "Enter"]);
    assert_shows(&console.screen(120, 40), &["the table shows all trials: it had left trial 2 out", ">  2"]);
    console.press(&["b"]);
    assert_shows(&console.screen(120, 40), &["best only (b)"]);
}

#[test]
fn the_question_before_quitting_says_what_becomes_of_the_waiting_trial() {
    for (suggested, follows) in [
        (Verdict::Accept, "It keeps its measurement and waits"),
        (Verdict::Void, "It is void, as suggested, and its parameters run again."),
    ] {
        let mut console = Console::review(Mode::Review, suggested);
        assert_eq!(console.press(&["q"]), []);
        assert_shows(
            &console.screen(120, 40),
            &["Quit?", "The simulation ends as the robot stands", "Trial #0 has no verdict yet.", follows],
        );
    }
}

#[test]
fn the_field_for_a_value_by_hand_says_what_is_measured_and_what_the_robot_has_measured() {
    let mut console = Console::review(Mode::Disarmed, Verdict::Accept);
    console.press(&["="]);
    let parts = ["displacement forward, start to rest", "the robot measured 0.420 m", "Space is STOP"];
    assert_shows(&console.screen(120, 40), &parts);
}

#[test]
fn the_help_of_a_waiting_trial_begins_with_the_verdicts() {
    let first = |console: &mut Console| {
        console.press(&["?"]);
        let screen = console.screen(80, 24);
        screen.lines().nth(4).map(|line| line.trim_matches(['│', ' ']).to_owned())
    };
    assert_eq!(first(&mut Console::review(Mode::Review, Verdict::Accept)).as_deref(), Some("Verdict"));
    assert_eq!(first(&mut Console::ready()).as_deref(), Some("Robot"));
}

/// Regression: the line offered `a` while another row was selected, and `a` was refused.
#[test]
fn the_next_step_leads_to_the_waiting_trial_while_another_row_is_selected() {
    let mut console = landed(0);
    console.press(&["2"]);
    assert_shows(&console.next_step(), &["Judge it: a accept (suggested)"]);
    console.press(&["Up"]);
    for (columns, rows) in [(80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        let last = screen.lines().last().unwrap();
        assert_shows(last, &["Trial 1 waits for its verdict: ", "press 1."]);
        assert!(!last.contains("accept") && !last.contains("Judge"), "{last}");
    }
    assert_eq!(console.requests(&["a"]), [], "it is refused");
    console.press(&["1"]);
    assert_shows(&console.next_step(), &["Judge it: a accept (suggested)"]);
    // No filter hides the trial that waits.
    for keys in [&["2", "F"][..], &["F"], &["F"], &["F", "b"]] {
        console.press(keys);
        let waits = console.model.trial_rows().iter().any(|row| row.trial == 1);
        assert!(waits, "{keys:?}:\n{}", console.screen(80, 24));
    }
    assert_eq!(console.requests(&["End", "a"]), [OperatorRequest::Judge(Verdict::Accept)]);
}

/// Regression: the second press of a verdict was refused because no trial waited any longer, as if the first had failed.
#[test]
fn a_verdict_key_that_is_pressed_twice_judges_once_and_keeps_the_first_answer() {
    for (key, verdict) in [("a", Verdict::Accept), ("f", Verdict::Fall), ("v", Verdict::Void)] {
        // Before the answer of the session and after it.
        for answered in [false, true] {
            let mut console = landed(0);
            // A fall that was not suggested is asked about.
            let suggested = if verdict == Verdict::Fall { verdict } else { Verdict::Accept };
            console.record(Record::Trial(trial(1, None, Some(suggested))));
            assert_eq!(console.requests(&[key]), [OperatorRequest::Judge(verdict)]);
            if answered {
                console.answer(verdict.name(), true, "trial 1; u takes it back");
                console.record(Record::Trial(trial(1, Some(verdict), Some(Verdict::Accept))));
                console.stage(ExperimentStage::Proposed, 2);
            }
            let said = console.said().to_owned();
            assert_eq!(console.requests(&[key]), [], "{key}, answered: {answered}");
            assert_eq!(console.said(), said);
            // Later the key is an answer of its own.
            console.wait(1_000);
            let later = console.requests(&[key]);
            assert_eq!(later.is_empty(), answered, "{key}: {}", console.said());
        }
    }
}

/// Regression: void alone gives a point up, and the line did not name the key that runs it again.
#[test]
fn after_a_cancelled_countdown_the_line_names_the_key_that_keeps_the_point() {
    let mut console = Console::ready();
    console.stage(ExperimentStage::Running, 0);
    let cause = "countdown cancelled, the robot did not jump".into();
    console.record(Record::Trial(TrialRecord { cause, ..trial(0, None, Some(Verdict::Void)) }));
    console.stage(ExperimentStage::Review, 0);
    for (columns, rows) in [(80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        assert_shows(screen.lines().last().unwrap(), &["Judge it: v void (suggested)", "r re-run of this point"]);
    }
}

/// Regression: the last line of a fall named neither the key of a value by hand nor that of a note, also where it had room for them.
#[test]
fn the_line_of_a_fall_names_value_by_hand_and_note_where_it_has_room() {
    let console = Console::review(Mode::Damped, Verdict::Fall);
    let last = |columns: u16| console.screen(columns, 40).lines().last().unwrap().to_owned();
    assert_shows(&last(200), &["FELL", "f fall (suggested)", "q quit", "= value by hand", "m note"]);
    assert_shows(&last(80), &["FELL", "k acknowledges", "f fall (suggested)"]);
    // Regression: at 120 columns the key that quits stood in the place of the note, and 16 columns were empty.
    assert_shows(&last(120), &["r re-run", "m note", "? more"]);
}

/// Regression: letters of a reason whose field had not opened were commands; the r among them queued a jump.
#[test]
fn a_judged_row_is_queued_again_after_a_question() {
    let mut console = Console::ready();
    console.judged(2);
    console.press(&["2", "Home"]);
    assert_eq!(console.requests(&["r"]), []);
    assert_shows(&console.screen(80, 24), &["Queue it again?", "Press y to queue trial #0 again"]);
    assert_eq!(console.requests(&["x"]), []);
    assert_eq!(console.requests(&["r", "y"]), [OperatorRequest::Rerun { trial: Some(0) }]);
    // Regression: the question did not say that typed values are lost by it.
    let mut changed = proposal(2, 0);
    changed.parameters[0].value += 0.1;
    console.record(Record::Proposal(changed));
    console.press(&["r"]);
    let dropped = "The changed values of proposal #2 are dropped; Q queues them before.";
    assert_shows(&console.screen(120, 40), &["Queue it again?", dropped]);
}

/// Regression: the question said that a simulated robot sits down, and nothing of the trial that was under way.
#[test]
fn the_question_before_quitting_says_what_becomes_of_the_robot_and_of_the_trial() {
    let question = |mode: Mode, stage: ExperimentStage, backend: Backend| {
        let mut console = Console::ready();
        console.record(Record::Session(SessionInfo { backend: Some(backend), ..session() }));
        console.stage(stage, 0);
        console.mode(mode);
        console.press(&["q"]);
        console.screen(120, 40)
    };
    let (simulator, hardware) = (Backend::Simulator, Backend::Hardware);
    let ends = "The simulation ends as the robot stands";
    assert_shows(&question(Mode::Ready, ExperimentStage::Proposed, simulator), &[ends, "trials count so far"]);
    assert_shows(&question(Mode::Ready, ExperimentStage::Proposed, hardware), &["it will sit down before"]);
    // Regression: nothing was said of the proposal.
    let again = "Trial #0 is not run: it is proposed again then, with these values.";
    assert_shows(&question(Mode::Ready, ExperimentStage::Proposed, simulator), &[again]);
    let mut console = Console::ready();
    let mut changed = proposal(0, 1);
    changed.parameters[1].value = 99.0;
    console.record(Record::Proposal(changed));
    console.press(&["q"]);
    assert_shows(&console.screen(120, 40), &["proposed again then, with the values set here."]);
    let lands = "the robot lands first; it is void, and its parameters run again";
    assert_shows(&question(Mode::Jump, ExperimentStage::Running, simulator), &["Trial #0 is under way", lands]);
    let waits = "it has landed, is measured, and waits until the study is continued";
    assert_shows(&question(Mode::Settle, ExperimentStage::Running, hardware), &["Trial #0 is under way", waits]);
    // Regression: of a trial of several jumps, too, which keeps none of its measurements.
    let mut console = Console::ready();
    console.record(Record::Proposal(Proposal { repeats: 3, ..proposal(0, 1) }));
    console.stage(ExperimentStage::Running, 0);
    console.mode(Mode::Settle);
    console.press(&["q"]);
    assert_shows(&console.screen(120, 40), &["this jump is done again when the study is continued"]);
}

/// Regression: after STOP the line left out the key that runs the point again, and `u undo` did not name its trial.
#[test]
fn the_line_after_a_stop_names_the_rerun_and_that_of_undo_its_trial() {
    let console = Console::review(Mode::Damped, Verdict::Void);
    assert_shows(console.screen(120, 40).lines().last().unwrap(), &["STOPPED", "r re-run"]);
    let mut console = Console::ready();
    for verdict in [None, Some(Verdict::Accept)] {
        console.record(Record::Trial(trial(0, verdict, Some(Verdict::Accept))));
    }
    console.stage(ExperimentStage::Review, 0);
    console.record(Record::Stage(StageRecord { stage: ExperimentStage::Proposed, trial: 1, can_undo: true, jumps: 0 }));
    console.mode(Mode::Disarmed);
    assert_shows(console.screen(120, 40).lines().last().unwrap(), &["u undo #0"]);
    // Regression: at 80 columns the row of the last trial, where other verdicts are refused, hid it behind the help.
    console.mode(Mode::Ready);
    console.press(&["2", "Home"]);
    let last = console.screen(80, 24).lines().last().unwrap().to_owned();
    assert_shows(&last, &["Enter open", "u undo #0"]);
    assert_eq!(last.matches("undo").count(), 1, "{last}");
    assert_eq!(console.screen(160, 40).lines().last().unwrap().matches("undo").count(), 1);
}

/// Regression: Esc with nothing to close said that no trial is beside another, and hid the message before it.
#[test]
fn esc_with_nothing_to_close_says_nothing() {
    let mut console = Console::ready();
    console.press(&["b"]);
    let said = console.said().to_owned();
    assert!(!said.is_empty());
    console.press(&["Esc", "Esc"]);
    assert_eq!(console.said(), said);
}

/// Regression: beside a suggested fall a value by hand was shown as if it counted.
#[test]
fn a_value_by_hand_beside_a_suggested_fall_counts_if_accepted() {
    let mut console = Console::ready();
    console.stage(ExperimentStage::Running, 0);
    let row = TrialRecord { hand_value: Some(0.66), value: Some(0.0), ..trial(0, None, Some(Verdict::Fall)) };
    console.record(Record::Trial(row));
    console.stage(ExperimentStage::Review, 0);
    console.mode(Mode::Review);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["0.660 m by hand, if accepted"]);
    assert!(!screen.contains("0.000h"), "{screen}");
}

/// Regression: a fall has J = 0 by the rules, and beside a 0 by hand the table marked it as measured by hand.
#[test]
fn a_value_by_hand_counts_of_an_accepted_trial_alone() {
    let mut console = Console::ready();
    for (number, verdict, value) in [(0, Verdict::Fall, 0.0), (1, Verdict::Accept, 0.0)] {
        let row = TrialRecord { hand_value: Some(0.0), value: Some(value), ..trial(number, Some(verdict), None) };
        console.record(Record::Trial(row));
    }
    console.press(&["2"]);
    let screen = console.screen(120, 40);
    assert_shows(&line_with(&screen, "x fall"), &["0.000  x fall"]);
    // One that waits and looks like an accept has the mark before its verdict.
    let waiting = trial(2, None, Some(Verdict::Accept));
    console.record(Record::Trial(TrialRecord { hand_value: Some(0.5), value: Some(0.5), ..waiting }));
    assert_shows(&line_with(&console.screen(120, 40), "accept?"), &["0.500h"]);
    assert_shows(&line_with(&screen, "o accept"), &["0.000h o accept"]);
}

/// Regression: at 80 columns the reason of a fault was cut, and the next refused key replaced the line that had all of it.
#[test]
fn the_reason_of_a_fault_comes_back_after_an_answer() {
    let mut console = Console::ready();
    let cause = "FR_thigh blocked: demanded torque -16.7 N m exceeds 11.8 N m".to_owned();
    console.mode(Mode::Fault);
    console.record(Record::Transition(Transition { from: Mode::StandUp, to: Mode::Fault, cause: cause.clone() }));
    console.press(&["g"]);
    assert_shows(console.said(), &["g is not possible"]);
    console.wait(6_000);
    assert_eq!(console.said(), format!("FAULT: {cause}"));
}

/// Regression: after the change of an earlier verdict `u` took the last trial's back, whatever row was selected.
#[test]
fn the_last_verdict_is_taken_back_from_another_row_after_a_question_alone() {
    let mut console = Console::ready();
    console.judged(2);
    for verdict in [None, Some(Verdict::Void)] {
        console.record(Record::Trial(trial(2, verdict, None)));
    }
    console.stage(ExperimentStage::Review, 2);
    console.record(Record::Stage(StageRecord { stage: ExperimentStage::Proposed, trial: 3, can_undo: true, jumps: 0 }));
    assert_eq!(console.requests(&["2", "Home", "u"]), [], "trial 0 is selected");
    let screen = console.screen(80, 24);
    assert_shows(
        &screen,
        &["Take the last verdict back?", "of trial #2 will be taken back", "Press y to take the verdict"],
    );
    assert_eq!(console.requests(&["Enter"]), []);
    assert_eq!(console.requests(&["u", "y"]), [OperatorRequest::Undo]);
    // On its own row, and in another view, it is taken back at once.
    assert_eq!(console.requests(&["End", "u"]), [OperatorRequest::Undo]);
    assert_eq!(console.requests(&["Home", "1", "u"]), [OperatorRequest::Undo]);
}

/// Regressions: after the first of several repeats the screen named the trial before, and after the verdict of another program's trial
/// that one.
#[test]
fn undo_names_the_trial_whose_verdict_the_session_takes_back() {
    let mut console = Console::review(Mode::Ready, Verdict::Accept);
    let next = |console: &mut Console, trial: u32| {
        let (stage, can_undo, jumps) = (ExperimentStage::Proposed, true, 0);
        console.record(Record::Proposal(proposal(trial, trial)));
        console.record(Record::Stage(StageRecord { stage, trial, can_undo, jumps }));
    };
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    next(&mut console, 1);
    assert_shows(&console.screen(120, 40), &["undo #0"]);
    // Another program's trial.
    for verdict in [None, Some(Verdict::Fall)] {
        console.record(Record::Trial(trial(7, verdict, None)));
    }
    assert_shows(&console.screen(120, 40), &["undo #0"]);
    // The first repeat of trial 1 was accepted: the trial has no verdict yet.
    console.stage(ExperimentStage::Running, 1);
    console.record(Record::Trial(trial(1, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 1);
    next(&mut console, 1);
    assert_shows(&console.screen(120, 40), &["undo #1"]);
}

/// Regression: after a fall without a STOP the line said "STOPPED", and with another row selected the line hid the trial
/// that waits.
#[test]
fn a_fall_is_no_stop_and_a_waiting_trial_is_named_while_another_row_is_selected() {
    let mut console = Console::review(Mode::Damped, Verdict::Fall);
    assert_shows(&console.next_step(), &["FELL; check the robot, then k acknowledges"]);
    console.record(Record::Trial(trial(1, None, Some(Verdict::Fall))));
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    console.stage(ExperimentStage::Review, 1);
    console.press(&["2", "Home"]);
    assert_shows(&console.next_step(), &["Trial 1 waits for its verdict"]);
}

/// Regression: after the verdict on a detected fall the robot was called STOPPED, as after the STOP of an operator.
#[test]
fn a_robot_that_fell_is_not_called_stopped_after_the_verdict() {
    let mut console = Console::review(Mode::Jump, Verdict::Fall);
    let pitch = FallCause::Pitch { measured_rad: 1.001, allowed_rad: 1.0 };
    let cause = TransitionCause::Fell(pitch).to_string();
    console.record(Record::Transition(Transition { from: Mode::Jump, to: Mode::Damped, cause }));
    console.mode_of_ticks(Mode::Damped);
    assert_shows(&console.next_step(), &["FELL; check the robot"]);
    console.record(Record::Trial(trial(0, Some(Verdict::Fall), Some(Verdict::Fall))));
    console.stage(ExperimentStage::Proposed, 1);
    assert_shows(&console.next_step(), &["FELL; check the robot, then k acknowledges: pitch "]);
    // Regression: at 80 columns the limit was cut behind "fell: pitch 1.001 rad exceeds".
    assert_shows(&console.screen(80, 24), &["k acknowledges: pitch 1.001 rad exceeds 1.000 rad"]);
    console.press(&["m"]);
    assert_shows(&console.next_step(), &["FELL: Enter keeps the note, Esc drops it; then k acknowledges."]);
}

/// Regression: a skipped proposal and a point removed from the queue were void trials in the table, its counts and the chart of J.
#[test]
fn what_never_ran_is_not_run_and_no_void_trial() {
    let mut console = Console::ready();
    console.judged(1);
    for (number, cause) in [(1, SKIPPED), (2, REMOVED)] {
        let row = TrialRecord { cause: cause.into(), value: None, ..trial(number, Some(Verdict::Void), None) };
        console.record(Record::Trial(row));
    }
    console.press(&["2"]);
    for (columns, rows) in [(80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        // Where the keys leave no room, the counts that are zero give way.
        let counts = if columns == 80 { "1 accept, 2 not run; by" } else { "0 void, 2 not run; by" };
        assert_shows(&screen, &["v not run", counts]);
        assert!(!screen.contains("v void"), "{screen}");
    }
    // Regression: the exported table and the log called it void.
    let table = text::as_csv(&console.model, ExportedRows::All);
    assert_eq!((table.matches(",not run,").count(), table.matches(",void,").count()), (2, 0), "{table}");
    console.press(&["6"]);
    let log = console.screen(120, 40);
    assert!(log.contains("trial 1: not run") && log.contains("trial 2: not run"), "{log}");
}

/// Regression: beyond 17 trials the heading of Trials at 80 columns lost the number of each verdict.
#[test]
fn the_counts_of_verdicts_stand_over_a_long_table() {
    let mut console = Console::ready();
    console.judged(40);
    console.press(&["2"]);
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        assert_shows(&console.screen(columns, rows), &[" accept, "]);
    }
}

/// Regression: the question before a jump did not tell a changed value from a proposed one.
#[test]
fn the_question_before_a_jump_marks_changed_values() {
    let mut console = Console::ready();
    let mut changed = proposal(0, 2);
    (changed.parameters[1].value, changed.gains[0].value) = (80.0, 450.0);
    console.record(Record::Proposal(changed));
    console.press(&["g"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["Fx 80.00 N (was 75.00)", "(was 400.0)", "A countdown follows"]);
}

/// Regression: the key that acknowledges closed the details, and the next `q`, which was to close them, ended the program.
#[test]
fn the_details_stay_open_when_a_stop_is_acknowledged() {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    console.mode(Mode::Damped);
    console.press(&["2", "Enter"]);
    assert_eq!(console.requests(&["k"]), [OperatorRequest::Acknowledge]);
    console.mode(Mode::Disarmed);
    assert!(matches!(console.model.dialog, Some(Dialog::Details { .. })), "{:?}", console.model.dialog);
    assert_eq!(console.press(&["q"]), []);
    assert!(console.model.dialog.is_none());
}
