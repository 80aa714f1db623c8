//! What the screen says is so now, or says of when it is.

mod support;

use quadfrog::recording::record::{ArmingCheckRecord, Record};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{ArmingCheck, ArmingCheckState, Mode, Snapshot, Tick, TrialInhibit};
use quadfrog::trial::{DrawnRange, ExperimentStage, SearchStatus, SearchedParameter, TrialRecord, Verdict};
use quadfrog_console::message::{Msg, ReplayStatus};
use quadfrog_console::theme::Role;
use support::{Console, assert_shows, line_with, trial};

fn at_time(console: &mut Console, time_s: u64) {
    let tick = Tick { time_ns: time_s * 1_000_000_000, ..console.model.snapshot.tick };
    console.model.snapshot = Snapshot { tick, ..console.model.snapshot };
}

fn checks(console: &mut Console, found: &str) {
    console.record(Record::ArmingChecks(vec![ArmingCheckRecord {
        check: ArmingCheck::StateFresh,
        found: found.into(),
        needed: "at most 10 ms".into(),
        state: ArmingCheckState::Passed,
    }]));
}

/// The session began at full minutes of UTC; every time zone has these minutes or half an hour more.
#[test]
fn arming_checks_of_an_earlier_time_are_grey_and_say_when_they_were_made() {
    let mut console = Console::proposed();
    at_time(&mut console, 192);
    checks(&mut console, "0 ms old");
    for keys in [&["5"][..], &["P"]] {
        for (mode, past) in [(Mode::Disarmed, false), (Mode::Ready, true), (Mode::Fault, true), (Mode::Disarmed, false)]
        {
            console.mode(mode);
            console.press(keys);
            let screen = console.screen(120, 40);
            let title = line_with(&screen, "1 passed");
            assert_eq!(title.contains(":12: 1 passed") && title.contains("checked at "), past, "{mode:?}\n{screen}");
            let buffer = console.draw(120, 40);
            let row = screen.lines().position(|line| line.contains("ok   state fresh")).expect("the check") as u16;
            let column = (0..120).find(|x| buffer[(*x, row)].symbol() == "o" && buffer[(x + 1, row)].symbol() == "k");
            let cell = &buffer[(column.expect("ok"), row)];
            let good = console.model.theme.style(Role::Good).fg;
            assert_eq!(Some(cell.fg) == good, !past, "{mode:?}: {cell:?}");
            console.press(&["Esc"]);
        }
    }
}

#[test]
fn a_fault_and_a_stop_come_before_a_pending_verdict() {
    for suggested in [Verdict::Fall, Verdict::Accept] {
        let mut console = Console::review(Mode::Fault, suggested);
        console.model.session.stopped_because = "the link is silent for 52 ms".into();
        let screen = console.screen(120, 40);
        let last = screen.lines().last().unwrap();
        assert_shows(last, &["FAULT; check the robot, then k acknowledges: the link is silent", "f fall"]);
        assert!(!screen.contains("FAULT: fault"), "{screen}");
    }
    let mut console = Console::review(Mode::Damped, Verdict::Fall);
    for (columns, rows) in [(80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        let last = screen.lines().last().unwrap();
        assert_shows(last, &["STOPPED; check the robot, then k acknowledges", "f fall (suggested)"]);
    }
    assert_eq!(console.requests(&["f"]), [OperatorRequest::Judge(Verdict::Fall)], "it is offered and it acts");
    // STOP after the landing has a cause of its own.
    let mut stopped = Console::review(Mode::Damped, Verdict::Accept);
    stopped.model.session.stopped_because = "operator pressed STOP".into();
    let screen = stopped.screen(120, 40);
    assert_shows(screen.lines().last().unwrap(), &["k acknowledges: operator pressed STOP", "a accept (suggested)"]);
    console.mode(Mode::Review);
    assert_shows(&console.next_step(), &["Judge it: f fall (suggested)"]);
    assert!(!console.screen(120, 40).lines().last().unwrap().contains("acknowledge"), "nothing was stopped");
}

#[test]
fn details_show_the_bounds_with_which_a_trial_ran() {
    let mut console = Console::ready();
    for (number, low, high) in [(0, 0.0, 150.0), (1, 20.0, 130.0)] {
        let ranges = vec![DrawnRange { name: "Fx".into(), low, high }];
        console.record(Record::Trial(TrialRecord { ranges, ..trial(number, Some(Verdict::Accept), None) }));
    }
    // A trial of an older recording.
    console.record(Record::Trial(trial(2, Some(Verdict::Accept), None)));
    let searched = SearchedParameter { name: "Fx".into(), low: 40.0, high: 60.0, least: 0.0, most: 200.0, fixed: None };
    console.record(Record::Search(SearchStatus { parameters: vec![searched], ..SearchStatus::default() }));
    console.stage(ExperimentStage::Proposed, 3);
    console.press(&["2", "Home", "Enter"]);
    assert_shows(&line_with(&console.screen(120, 40), "75.00000 N"), &["(searched from 0 to 150)"]);
    console.press(&["Down"]);
    assert_shows(&line_with(&console.screen(120, 40), "75.00000 N"), &["(searched from 20 to 130)"]);
    console.press(&["Down"]);
    assert!(!line_with(&console.screen(120, 40), "75.00000 N").contains("searched"), "its bounds are not known here");
}

/// The control thread says of every tick whether a trial could be approved.
#[test]
fn the_next_step_offers_a_jump_only_while_one_is_accepted() {
    let mut console = Console::ready();
    assert_shows(&console.next_step(), &["Press g twice to jump."]);
    let warm = TrialInhibit::MotorWarm { joint: 0, measured_c: 71.0, allowed_c: 70.0 };
    console.update(Msg::Snapshot(Box::new(Snapshot { unready: Some(warm), ..console.model.snapshot })));
    assert_shows(&console.next_step(), &["No jump now: motor FR_hip at 71 degrees Celsius, a jump needs less than 70"]);
    let last = console.screen(120, 40).lines().last().unwrap().to_owned();
    assert!(!last.contains("Press g") && last.contains("D sit down"), "{last}");
    console.update(Msg::Snapshot(Box::new(Snapshot { unready: None, ..console.model.snapshot })));
    assert_shows(&console.next_step(), &["Press g twice to jump."]);
}

#[test]
fn a_replay_says_once_that_nothing_can_be_changed() {
    let mut console = Console::proposed();
    console.press(&["4"]);
    console.update(Msg::Replay(ReplayStatus::default()));
    let screen = console.screen(120, 40);
    assert_eq!(screen.matches("this is a replay").count(), 1, "{screen}");
    assert_shows(&screen, &["Nothing can be changed: this is a replay"]);
}
