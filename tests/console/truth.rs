//! The screen shows the present, or the time of what it shows.

use crate::support::{Console, assert_shows, line_with, proposal, session, tick, trial};
use quadfrog::engine::ObserverStatus;
use quadfrog::recording::record::{
    ArmingCheckRecord, LogLevel, LogRecord, Record, SessionInfo, StageRecord, Transition,
};
use quadfrog::report::table;
use quadfrog::robot::{Battery, LinkStatus};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::session::storage::{ANSWERED_AFTER, ANSWERS_LATER};
use quadfrog::telemetry::{
    ArmingCheck, ArmingCheckState, Counters, FallCause, Mode, Snapshot, Tick, TransitionCause, TrialInhibit,
};
use quadfrog::trial::{
    Approval, Backend, DrawnRange, ExpectedResult, ExperimentStage, FallRisk, PointRecord, Proposal, ProposalSource,
    SearchStatus, SearchedParameter, TrialRecord, Verdict,
};
use quadfrog_console::message::{Msg, ReplayStatus};
use quadfrog_console::text::as_text;
use quadfrog_console::theme::Role;

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
            assert_eq!(title.contains(":12: 1 passed") && title.contains(" at "), past, "{mode:?}\n{screen}");
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
        assert_shows(last, &["FELL; check the robot, then k acknowledges", "f fall (suggested)"]);
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
    assert_shows(&line_with(&console.screen(120, 40), "75.00000 N"), &["(searched from 0 to 150 N)"]);
    console.press(&["Down"]);
    assert_shows(&line_with(&console.screen(120, 40), "75.00000 N"), &["(searched from 20 to 130 N)"]);
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

fn hardware() -> Console {
    let mut console = Console::ready();
    console.model.session.info.backend = Some(Backend::Hardware);
    console.model.session.info.recording = "recordings/2026-11-23T19-01-28-forward-seed0/session.mcap".into();
    console.model.session.info.study = "recordings/2026-11-23T19-01-28-forward-seed0/study.log".into();
    console
}

/// A tick whose newest state has this time of the robot's clock.
fn state_of(time_ms: u64, robot_time_ms: u32, mode: Mode) -> Tick {
    let mut tick = Tick { mode, ..tick(time_ms, 0.1, None) };
    tick.state.robot_time_ms = robot_time_ms;
    tick
}

/// Regression: before the first state the charts drew zeros, and after a lost link the last values went on as if they were new.
#[test]
fn a_silent_robot_has_no_values() {
    let mut console = hardware();
    let shows = |console: &mut Console, heard: bool| {
        console.press(&["1"]);
        for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
            let screen = console.screen(columns, rows);
            assert_eq!(screen.contains("roll +0.100 rad"), heard, "{screen}");
            assert_eq!(screen.contains("roll - rad"), !heard, "{screen}");
            assert_eq!(screen.contains("foot z● -0.200 m") || screen.contains("foot z○ -0.200 m"), heard, "{screen}");
            assert_eq!(screen.contains("no state from the robot"), !heard && columns > 80, "{screen}");
        }
        console.press(&["5"]);
        let screen = console.screen(80, 24);
        assert_eq!(screen.contains("FR_hip"), heard, "{screen}");
        assert_eq!(screen.contains("no state from the robot"), !heard, "{screen}");
    };
    console.tick(state_of(5, 0, Mode::Offline));
    shows(&mut console, false);
    for time_ms in (10..500).step_by(5) {
        console.tick(state_of(time_ms, time_ms as u32, Mode::Ready));
    }
    shows(&mut console, true);
    (500..590).step_by(5).for_each(|time_ms| console.tick(state_of(time_ms, 495, Mode::Ready)));
    shows(&mut console, true);
    (590..700).step_by(5).for_each(|time_ms| console.tick(state_of(time_ms, 495, Mode::Fault)));
    shows(&mut console, false);
    console.tick(state_of(700, 700, Mode::Fault));
    shows(&mut console, true);
}

/// Regression: after STOP the values of a robot that had never answered were shown as measured: zeros.
#[test]
fn a_robot_that_never_answered_has_no_values_after_a_stop() {
    for mode in [Mode::Damped, Mode::Fault] {
        let mut console = hardware();
        let without_state = |time_ms: u64| Tick { time_ns: time_ms * 1_000_000, mode, ..Tick::default() };
        (0..300).step_by(5).for_each(|time_ms| console.tick(without_state(time_ms)));
        let tick = without_state(295);
        console.update(Msg::Snapshot(Box::new(Snapshot { tick, ..console.model.snapshot })));
        for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
            console.press(&["1"]);
            let live = console.screen(columns, rows);
            assert_shows(&live, &["roll - rad", "foot z  - m"]);
            assert!(!live.contains("+0.000"), "{live}");
            // The panel of the joints.
            assert_eq!(live.contains("no state from the robot"), columns > 80, "{live}");
            console.press(&["5"]);
            let health = console.screen(columns, rows);
            assert_shows(&health, &["no state from the robot", "battery      -"]);
            assert!(!health.contains("FR_hip") && !health.contains("none"), "{health}");
        }
    }
    // The clock of the robot wraps after 49.7 days, a simulated robot is heard from its begin, and an old recording has no clock.
    let mut wrapped = hardware();
    wrapped.tick(state_of(5, u32::MAX, Mode::Ready));
    wrapped.tick(state_of(10, 0, Mode::Ready));
    let mut simulated = Console::ready();
    (0..300).step_by(5).for_each(|time_ms| simulated.tick(state_of(time_ms, 0, Mode::Ready)));
    let mut replay = hardware();
    replay.update(Msg::Replay(ReplayStatus::default()));
    (0..300).step_by(5).for_each(|time_ms| replay.tick(state_of(time_ms, 0, Mode::Ready)));
    for console in [wrapped, simulated, replay] {
        assert_shows(&console.screen(120, 40), &["roll +0.100 rad"]);
        assert!(!console.screen(120, 40).contains("no state from the robot"));
    }
}

/// Regression: battery and restarts had no room at 80x24 and at 120x40, and long values ended with two dots.
#[test]
fn health_of_a_robot_is_whole_at_every_size() {
    let mut console = hardware();
    let battery = Battery { charge_percent: 71.0, voltage_v: 24.1, cell_v: [3.9; 10], ..Battery::default() };
    let mut tick = state_of(5, 5, Mode::Ready);
    tick.state.battery = Some(battery);
    tick.state.motor_temperature_c = [88.0; 12];
    (tick.state.motor_enabled, tick.limited) = ([true; 12], 1);
    let link = LinkStatus { rate_hz: 1000, lost: 12_345, corrupt: 12_345, recent_corrupt: 12, ..LinkStatus::default() };
    let counters = Counters { link: Some(link), ticks_not_shown: 3, ..console.model.snapshot.counters };
    console.tick(tick);
    console.update(Msg::Snapshot(Box::new(Snapshot { tick, counters, ..console.model.snapshot })));
    console.press(&["5"]);
    for (columns, rows) in [(80, 24), (100, 30), (120, 40), (200, 60)] {
        let screen = console.screen(columns, rows);
        let always =
            ["71 %, 24.1 V, 0.0 A", "3.900 to 3.900 V", "restarts     0", "12 in 5 s, 12345 in all", "88 C max"];
        assert_shows(&screen, &always);
        assert_shows(
            &screen,
            &["session.mcap", "in 2026-11-23T19-01-28-forward-seed0", "max: limited by the gate", "N m !"],
        );
        assert!(!screen.contains(".."), "{screen}");
        assert_eq!(screen.contains("robot clock"), rows >= 40, "the last detail, where there is room\n{screen}");
    }
}

/// Regression: every motor of a robot that was only observed read "on", although nothing is known of its servo mode.
#[test]
fn a_motor_that_was_never_commanded_is_not_shown_as_on() {
    for (mode, state) in [(Mode::Observe, "- C -  "), (Mode::Disarmed, "- C on ")] {
        let mut console = hardware();
        let mut tick = state_of(5, 5, mode);
        tick.state.motor_enabled = [true; 12];
        console.tick(tick);
        console.update(Msg::Snapshot(Box::new(Snapshot { tick, ..console.model.snapshot })));
        console.press(&["5"]);
        let screen = console.screen(120, 40);
        assert_eq!(screen.matches(state).count(), 12, "{mode:?}\n{screen}");
    }
}

/// Regression: the sample of the README begins within its jump, and the card said "none yet" beside a trial that ran.
#[test]
fn a_recording_that_begins_within_a_trial_shows_what_runs() {
    let mut console = Console::new();
    console.record(Record::Session(session()));
    console.record(Record::Trial(trial(12, None, None)));
    console.update(Msg::Replay(ReplayStatus::default()));
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        let screen = console.screen(columns, rows);
        assert_shows(&screen, &["Trial #12 runs", "Fx    75.00 N"]);
        assert!(!screen.contains("none yet"), "{screen}");
    }
}

/// Regression: the axis of J ended at 0.001 m where a fall was all that had happened.
#[test]
fn a_study_of_falls_alone_has_no_scale_of_its_values() {
    let mut console = Console::ready();
    console.record(Record::Trial(TrialRecord { value: Some(0.0), ..trial(0, Some(Verdict::Fall), None) }));
    let screen = console.screen(80, 24);
    assert!(screen.contains("none accepted yet") && !screen.contains("0.001"), "{screen}");
    console.press(&["3"]);
    assert!(!console.screen(80, 24).contains("0.001"), "{}", console.screen(80, 24));
}

/// Regression: a robot that lay on its back was only said to stand up, and the line had no room for the key of the help.
#[test]
fn the_step_before_arming_says_that_a_fallen_simulated_robot_is_turned_upright() {
    let mut console = Console::proposed();
    console.model.snapshot.tick.estimate.roll_pitch_yaw.x = 3.0;
    let screen = console.screen(80, 24);
    let last = screen.lines().last().unwrap();
    assert_shows(last, &["Press A to arm: the robot is turned upright and stands.", "o override"]);
    let narrow = console.screen(60, 20);
    assert_shows(&narrow, &["turned upright", "? help"]);
    // Regression: where falls alone are judged the sentence was cut, and the key of the help was gone.
    let mut info = session();
    info.approve = Approval::FallsOnly;
    console.record(Record::Session(info));
    let screen = console.screen(80, 24);
    let last = screen.lines().last().unwrap();
    assert_shows(last, &["Press A to arm: it is turned upright, then jumps without a question.", "? more"]);
}

/// Regression: the card of a landed trial cut the cause of its suggested verdict at 80 columns.
#[test]
fn the_card_of_a_landed_trial_shows_the_whole_cause() {
    let mut console = Console::review(Mode::Damped, Verdict::Fall);
    let cause = FallCause::BodyContact.to_string();
    console.record(Record::Trial(TrialRecord { cause, ..trial(0, None, Some(Verdict::Fall)) }));
    assert_shows(&console.screen(80, 24), &["fall (a part", "ground)"]);
}

/// Regression: after `--resume` with fewer `--trials` than counted the console said that a study of 2 was finished, not why.
#[test]
fn a_study_with_more_counted_trials_than_wanted_says_so_at_the_start() {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    console.record(Record::Search(SearchStatus { budget: 2, counted: 20, ..SearchStatus::default() }));
    console.stage(ExperimentStage::Finished, 0);
    assert_shows(console.said(), &["20 trials already count; the study is finished: the best is trial 0"]);
}

/// A recording that is followed: `behind_s` from its end, which is `silent_s` old.
fn followed(behind_s: u64, silent_s: u64, watched: bool) -> Console {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus {
        playing: true,
        silent_ns: Some(silent_s * 1_000_000_000),
        behind_ns: behind_s * 1_000_000_000,
        observer: watched.then(ObserverStatus::default),
        ..ReplayStatus::default()
    }));
    console
}

/// Regression: after a pause the screen stayed 20 s behind and said FOLLOWING and "about 1 s behind".
#[test]
fn a_followed_recording_says_how_old_what_it_shows_is() {
    for watched in [false, true] {
        for (behind_s, silent_s, old) in [(0, 1, None), (1, 0, None), (2, 0, None), (20, 0, Some("OLD: 20 s behind"))] {
            for (columns, rows) in [(80, 24), (100, 30), (120, 40)] {
                let screen = followed(behind_s, silent_s, watched).screen(columns, rows);
                assert_eq!(screen.contains("FOLLOWING"), old.is_none(), "{screen}");
                assert_eq!(screen.contains("OLD"), old.is_some(), "{screen}");
                let last = screen.lines().last().unwrap();
                if let Some(old) = old {
                    assert_shows(&screen, &[old]);
                    assert_shows(last, &["Behind by 20 s: ) shows the present.", "q quit"]);
                }
                assert_eq!(last.contains("about 1 s behind"), watched && old.is_none(), "{last}");
            }
        }
    }
    let silent = followed(0, 7, true).screen(120, 40);
    // Regression: it said that STOP reaches the robot of a session that stood still.
    let doubt = "Nothing new for 7 s. The session may hang: STOP reaches its robot once it is confirmed.";
    assert_shows(&silent, &["OLD: nothing new for 7 s", doubt]);
    // Regression: below 60x20 a replay said that STOP works.
    for (watched, works) in [(true, true), (false, false)] {
        let screen = followed(0, 0, watched).screen(50, 15);
        assert_eq!((screen.contains("STOP works"), screen.contains("no robot to stop")), (works, !works), "{screen}");
    }
    // The first key beside the sentence is the way out.
    let last = followed(0, 0, true).screen(100, 30).lines().last().unwrap().to_owned();
    assert_shows(&last, &["q quit"]);
}

/// Regression: an observer of a session that continued a study saw what the session before had answered, minutes ago.
#[test]
fn an_answer_of_the_session_before_is_not_shown_in_the_next() {
    let mut console = Console::ready();
    let session_of = |started: &str| Record::Session(SessionInfo { started: started.to_owned(), ..session() });
    console.record(session_of("2026-11-27T16:00:00Z"));
    console.answer("fall", true, "trial 23; u takes it back until the next trial");
    assert_shows(console.said(), &["u takes it back"]);
    console.record(session_of("2026-11-27T16:04:17Z"));
    assert!(console.model.message.is_none());
}

/// A console in `stage` after trial 0 was accepted, which can still be undone.
fn with_accepted_trial(stage: ExperimentStage) -> Console {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 0);
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), Some(Verdict::Accept))));
    console.record(Record::Stage(StageRecord { stage, trial: 1, can_undo: true, jumps: 0 }));
    console
}

/// Regression: the details of a trial whose verdict could be undone said that its value was reported.
#[test]
fn the_details_say_that_a_value_is_reported_once_its_verdict_cannot_be_undone() {
    let mut console = with_accepted_trial(ExperimentStage::Proposed);
    console.press(&["2", "Enter"]);
    assert_shows(&console.screen(120, 40), &["reported to the optimizer once it cannot be undone"]);
    console.stage(ExperimentStage::Running, 1);
    let later = console.screen(120, 40);
    assert!(later.contains("reported to the optimizer") && !later.contains("once it cannot"), "{later}");
}

/// Regression: the replay of a finished study said of a value that it is reported once its verdict cannot be undone.
#[test]
fn a_replay_says_of_no_value_that_it_waits_for_the_optimizer() {
    let mut console = with_accepted_trial(ExperimentStage::Finished);
    console.update(Msg::Replay(ReplayStatus::default()));
    console.press(&["2", "Enter"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["0.4000 m, reported to the optimizer"]);
    assert!(!screen.contains("once it cannot"), "{screen}");
}

/// Regression: battery, temperature and clock of a silent robot stayed on the screen as if they were of now.
#[test]
fn a_silent_robot_has_no_battery_temperature_and_clock() {
    let mut console = hardware();
    let shown = |console: &mut Console, time_ms: u64, mode: Mode| {
        let mut tick = state_of(time_ms, 495, mode);
        tick.state.battery = Some(Battery { charge_percent: 71.0, voltage_v: 24.1, ..Battery::default() });
        tick.state.motor_temperature_c = [45.0; 12];
        console.tick(tick);
        console.update(Msg::Snapshot(Box::new(Snapshot { tick, ..console.model.snapshot })));
    };
    shown(&mut console, 495, Mode::Ready);
    console.press(&["5"]);
    assert_shows(&console.screen(120, 40), &["hottest 45 C", "battery 71 %", "robot clock  0.5 s since its start"]);
    (500..700).step_by(5).for_each(|time_ms| shown(&mut console, time_ms, Mode::Fault));
    for (columns, rows) in [(80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        assert!(!screen.contains("71 %") && !screen.contains("45 C") && !screen.contains("0.5 s"), "{screen}");
    }
    assert_shows(&console.screen(120, 40), &["hottest -", "battery -", "robot clock  -"]);
}

/// Regression: at 80 columns the second line of a replay ended in `SLOW JUM`.
#[test]
fn the_second_line_drops_whole_values_in_order_before_it_cuts_a_warning() {
    let mut console = Console::ready();
    let mut tick = tick(5, 0.0, None);
    tick.state.motor_temperature_c = [45.0; 12];
    tick.state.battery = Some(Battery { charge_percent: 71.0, ..Battery::default() });
    console.update(Msg::Snapshot(Box::new(Snapshot { tick, ..console.model.snapshot })));
    let replay = ReplayStatus { slow_motion: true, looping: Some(12), lost_ns: 1_234_000_000, ..Default::default() };
    console.update(Msg::Replay(replay));
    for columns in [80, 100, 120, 200] {
        let screen = console.screen(columns, 40);
        let second = screen.lines().nth(1).unwrap();
        assert_shows(second, &["recorded: no robot to stop", "LOST 1.234 s", "LOOP #12", "SLOW JUMPS"]);
        assert_shows(second, &["71 %"]);
        assert_eq!(second.contains("45 C"), columns >= 120, "{second}");
    }
}

/// Regression: `confirm..` beside empty columns.
#[test]
fn the_source_of_a_repeat_is_whole() {
    let mut console = Console::ready();
    for (number, source) in [(3, ProposalSource::Confirm), (4, ProposalSource::Rerun)] {
        let row = trial(number, Some(Verdict::Accept), None);
        console.record(Record::Trial(TrialRecord { source, parent: Some(123), ..row }));
    }
    console.press(&["2"]);
    for (columns, rows) in [(120, 40), (200, 60)] {
        let screen = console.screen(columns, rows);
        assert_shows(&screen, &["confirm of #123", "re-run of #123"]);
    }
}

/// Regression: the tables said `re-run 123`, the details and the proposal `re-run of #123`, `quadfrog study show` `re-run`.
#[test]
fn the_source_of_a_repeat_reads_the_same_everywhere() {
    let mut console = Console::ready();
    let row =
        TrialRecord { source: ProposalSource::Rerun, parent: Some(123), ..trial(124, Some(Verdict::Accept), None) };
    console.record(Record::Trial(row.clone()));
    console.press(&["2"]);
    let table = console.screen(200, 60);
    console.press(&["Enter"]);
    let details = console.screen(80, 24);
    console.press(&["Esc", "R"]);
    let report = console.screen(200, 60);
    let shown = table::table(std::slice::from_ref(&row), None, &[], "m");
    for text in [table, details, report, shown, as_text(&row, &console.model)] {
        assert_shows(&text, &["re-run of #123"]);
    }
}

/// Regression: an observer's STOP in the countdown read as the operator's own.
#[test]
fn the_stop_of_an_observer_names_who_stopped() {
    let log = |text: &str| LogRecord { level: LogLevel::Warning, source: "session".into(), message: text.into() };
    let by = "STOP by Grace, who watches this session";
    for log_first in [true, false] {
        let mut console = Console::ready();
        console.mode(Mode::Countdown);
        let stopped = Record::Transition(Transition {
            from: Mode::Countdown,
            to: Mode::Damped,
            cause: TransitionCause::Stop.to_string(),
        });
        let mut records = vec![Record::Log(log(by)), stopped];
        if !log_first {
            records.reverse();
        }
        records.into_iter().for_each(|record| drop(console.record(record)));
        assert_eq!(console.said(), by);
        let tick = Tick { mode: Mode::Damped, ..console.model.snapshot.tick };
        console.update(Msg::Snapshot(Box::new(Snapshot { tick, ..console.model.snapshot })));
        assert_shows(&console.next_step(), &["STOPPED; check the robot, then k acknowledges: STOP by Grace"]);
    }
}

/// Regression: the arrival of an observer called "STOP by Eve" replaced the cause of the stop.
#[test]
fn an_observer_called_as_a_stop_is_none() {
    let mut console = Console::ready();
    console.mode(Mode::Countdown);
    console.record(Record::Transition(Transition {
        from: Mode::Countdown,
        to: Mode::Damped,
        cause: "the link is lost".to_owned(),
    }));
    let message = "STOP by Eve, who watches this session".to_owned();
    console.record(Record::Log(LogRecord { level: LogLevel::Info, source: "session".into(), message }));
    let tick = Tick { mode: Mode::Damped, ..console.model.snapshot.tick };
    console.update(Msg::Snapshot(Box::new(Snapshot { tick, ..console.model.snapshot })));
    assert_shows(&console.next_step(), &["k acknowledges: the link is lost"]);
}

/// The warning of a wait for the simulated robots stayed in the last line after their prior was made.
#[test]
fn the_end_of_a_wait_for_the_study_takes_the_place_of_its_warning() {
    let log =
        |level, message: &str| Record::Log(LogRecord { level, source: "session".into(), message: message.into() });
    let mut console = Console::ready();
    console
        .record(log(LogLevel::Warning, &format!("waiting for the simulated robots of the sampler sim{ANSWERS_LATER}")));
    console.record(log(LogLevel::Info, "the prior of the sampler sim is made"));
    assert!(console.said().ends_with(ANSWERS_LATER));
    console.record(log(LogLevel::Info, &format!("{ANSWERED_AFTER}28.3 s")));
    assert_eq!(console.said(), format!("{ANSWERED_AFTER}28.3 s"));

    console.record(log(LogLevel::Warning, "motor FR hip 71 degrees Celsius"));
    console.record(log(LogLevel::Info, &format!("{ANSWERED_AFTER}2.0 s")));
    assert_eq!(console.said(), "motor FR hip 71 degrees Celsius", "another warning stays");
}

/// At 80x24 the advice lost its last word, `fall`, below the range of the simulated robots.
#[test]
fn the_advice_to_end_the_search_comes_before_the_range_of_the_simulated_robots() {
    let mut console = Console::ready();
    let expected = ExpectedResult {
        value: 0.309,
        deviation: 0.02,
        p_stand: 0.87,
        simulated_least: Some(0.214),
        simulated_most: Some(0.333),
        advises_to_stop: true,
    };
    let risk = Some(FallRisk { neighbours: 3, ..FallRisk::default() });
    console.record(Record::Proposal(Proposal { expected: Some(expected), risk, ..proposal(0, 1) }));
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["no gain is worth the risk", "fall: confirm the best"]);
}

/// The result of confirming the best is part of the end of the study and of its tables.
#[test]
fn the_end_of_a_confirmed_study_names_the_result() {
    let mut console = Console::ready();
    let row = trial(0, Some(Verdict::Accept), None);
    console.record(Record::Trial(row.clone()));
    console.record(Record::Points(vec![PointRecord {
        trials: vec![0, 5, 8],
        parameters: row.parameters.clone(),
        without_fall: 3,
        mean: 0.41,
        deviation: Some(0.01),
        contender: true,
        confidence: Some(0.962),
    }]));
    console.stage(ExperimentStage::Finished, 8);
    let result = "the point of trial 0 leads with 96.2 % confidence: mean 0.410 +- 0.010 m, stood 3 of 3";
    assert_shows(console.said(), &["the study is finished: the best is trial 0", result]);
    console.press(&["R"]);
    assert_shows(&console.screen(200, 60), &["Confirmation of the best"]);
}

/// Repeats that confirm the best are beyond the budget, with and without the session's own number.
#[test]
fn repeats_do_not_count() {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    let repeat = TrialRecord { source: ProposalSource::Confirm, ..trial(1, Some(Verdict::Accept), None) };
    console.record(Record::Trial(repeat));
    console.stage(ExperimentStage::Finished, 1);
    assert_shows(&console.screen(120, 40), &["1 of 20 counted"]);
}

/// The sentence of the next step is whole at 80 columns, whatever the mode, the stage and the rule of approval are. The reason of a
/// fault may be cut.
#[test]
fn the_next_step_is_never_cut_at_80_columns() {
    use ExperimentStage::{Finished, Proposed, Review, Running};
    let mut cut = std::collections::BTreeSet::new();
    let mut draw = |mode: Mode, stage: ExperimentStage, approve: Approval, lies: bool, view: &str| {
        let mut console = Console::ready();
        console.record(Record::Session(SessionInfo { approve, ..session() }));
        console.record(Record::Trial(trial(5, Some(Verdict::Accept), Some(Verdict::Accept))));
        if stage == Review {
            console.record(Record::Trial(trial(6, None, Some(Verdict::Fall))));
        }
        console.record(Record::Stage(StageRecord { stage, trial: 6, can_undo: stage == Proposed, jumps: 0 }));
        let cause =
            if mode == Mode::Fault { TransitionCause::Stop } else { TransitionCause::Fell(FallCause::BodyContact) };
        console.record(Record::Transition(Transition { from: Mode::Jump, to: mode, cause: cause.to_string() }));
        console.mode_of_ticks(mode);
        console.model.snapshot.tick.estimate.roll_pitch_yaw.x = if lies { 3.0 } else { 0.0 };
        console.press(&[view]);
        let screen = console.screen(80, 24);
        let last = screen.lines().last().unwrap();
        if last.contains("..") {
            cut.insert(format!("{mode:?} {stage:?} {approve:?}: {last}"));
        }
    };
    for &mode in Mode::ALL {
        for stage in [Proposed, Running, Review, Finished] {
            for approve in Approval::ALL {
                for (lies, view) in [(false, "1"), (true, "2")] {
                    draw(mode, stage, approve, lies, view);
                }
            }
        }
    }
    assert!(cut.is_empty(), "{cut:#?}");
}

/// Regression: while the robot was armed, Health showed the free space of the time before as the present one.
#[test]
fn the_disk_of_an_earlier_time_is_grey_and_says_when_it_was_measured() {
    let mut console = Console::proposed();
    at_time(&mut console, 192);
    console.record(Record::ArmingChecks(vec![ArmingCheckRecord {
        check: ArmingCheck::Disk,
        found: "812 MB".into(),
        needed: "at least 1000 MB".into(),
        state: ArmingCheckState::Failed,
    }]));
    console.press(&["5"]);
    for (mode, past) in [(Mode::Disarmed, false), (Mode::Ready, true), (Mode::Disarmed, false)] {
        console.mode(mode);
        for (columns, rows) in [(80, 24), (120, 40)] {
            let screen = console.screen(columns, rows);
            let line = line_with(&screen, "disk  ");
            assert_eq!(line.contains("812 MB at ") && line.contains(":12"), past, "{mode:?}\n{screen}");
            assert_eq!(line.contains("812 MB !"), !past, "{mode:?}\n{screen}");
            let row = screen.lines().position(|line| line.starts_with("disk  ")).expect("the disk") as u16;
            let buffer = console.draw(columns, rows);
            let column = (0..columns).find(|x| buffer[(*x, row)].symbol() == "8").expect("its value");
            let warning = console.model.theme.style(Role::Warning).fg;
            assert_eq!(Some(buffer[(column, row)].fg) == warning, !past, "{mode:?}");
        }
    }
}
