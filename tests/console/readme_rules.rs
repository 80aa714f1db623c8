//! Screens of automatic sessions, of replays and of jumps that land early, which users of the README took for wrong.

use crate::support::{Console, assert_shows, line_with, proposal, session, tick, trial};
use quadfrog::recording::record::{Record, SessionInfo, StageRecord, Stamped};
use quadfrog::recording::timeline::Timeline;
use quadfrog::recording::writer::Writer;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{Mode, Phase, Snapshot, Tick};
use quadfrog::trial::{Approval, Backend, ExperimentStage, ParameterValues, ProposedParameter, TrialRecord, Verdict};
use quadfrog_console::feed::Feed;
use quadfrog_console::message::{Effect, Msg, ReplayCommand, ReplayStatus, ReplayStep};

/// The last line of a screen.
fn last(screen: &str) -> &str {
    screen.lines().last().unwrap_or_default()
}

/// Regression: with automatic approval a look at another view cancelled the countdown, and the trial was void.
#[test]
fn the_keys_of_views_cancel_no_countdown_of_automatic_jumps() {
    let of = |approve, backend| {
        let mut console = Console::ready();
        console.record(Record::Session(SessionInfo { approve, backend: Some(backend), ..session() }));
        console.judged(2);
        let before = console.model.snapshot;
        let tick = Tick { number: before.tick.number + 1, mode: Mode::Countdown, trial_time_s: -2.5, ..before.tick };
        console.update(Msg::Snapshot(Box::new(Snapshot { tick, ..before })));
        console
    };
    for approve in [Approval::FallsOnly, Approval::Auto] {
        for key in ["1", "2", "3", "4", "5", "6", "Tab", "Shift-Tab"] {
            let mut console = of(approve, Backend::Simulator);
            assert_eq!(console.press(&[key]), [], "{key}");
            for (columns, rows) in [(80, 24), (120, 40)] {
                let screen = console.screen(columns, rows);
                let lead = "Jump in 3 s: any key but those of views cancels it.";
                // Regression: in Trials the line named keys of the row, which cancel.
                assert_eq!(last(&screen).trim(), lead, "{key}");
                assert_eq!(screen.matches(lead).count(), 2, "{key}: beside the digits and as the next step:\n{screen}");
            }
        }
        for key in ["x", "Down", "Enter", "Esc", "g", "7", "?"] {
            assert_eq!(of(approve, Backend::Simulator).requests(&[key]), [OperatorRequest::Cancel], "{key}");
        }
        assert!(of(approve, Backend::Simulator).press(&["Space"]).contains(&Effect::Stop));
        // Where no view is shown, or something covers it, any key cancels.
        let mut console = of(approve, Backend::Simulator);
        console.update(Msg::Resize(60, 20));
        assert_shows(&console.screen(60, 20), &["Jump in 3 s: any key cancels it."]);
        assert_eq!(console.requests(&["2"]), [OperatorRequest::Cancel]);
    }
    for (approve, backend) in [(Approval::Each, Backend::Simulator), (Approval::FallsOnly, Backend::Hardware)] {
        assert_eq!(of(approve, backend).requests(&["2"]), [OperatorRequest::Cancel]);
    }
}

/// Regression: the line below still called the verdict of an automatic session a suggestion.
#[test]
fn a_verdict_by_rule_is_reported_as_one() {
    let review = |approve| {
        let mut console = Console::review(Mode::Review, Verdict::Accept);
        console.record(Record::Session(SessionInfo { approve, backend: Some(Backend::Simulator), ..session() }));
        let waits = TrialRecord { cause: "landed and settled".into(), ..trial(0, None, Some(Verdict::Accept)) };
        console.record(Record::Trial(waits.clone()));
        console.record(Record::Trial(TrialRecord { verdict: Some(Verdict::Accept), ..waits }));
        console.said().to_owned()
    };
    assert_eq!(review(Approval::Auto), "trial #0, verdict by --approve auto: accept (landed and settled)");
    assert_eq!(review(Approval::FallsOnly), "trial #0, verdict by --approve falls-only: accept (landed and settled)");
    assert_eq!(review(Approval::Each), "trial #0, suggested verdict: accept (landed and settled)");
}

/// Regression: the range after 1 rad was 3.2 rad, and the pitch of a fall at 1.001 rad took a third of its chart.
#[test]
fn the_chart_of_a_fall_has_a_range_near_its_tilt() {
    for (pitch_rad, most) in [(0.9, "1"), (1.001, "1.5"), (1.6, "2"), (2.5, "3.2")] {
        let mut console = Console::ready();
        console.ticks(0..2_000, |_| pitch_rad);
        let charts = console.screen(120, 40);
        assert_shows(&charts, &[&format!("\n{most:>5} ")]);
    }
}

/// Regression: the axis of the yaw went from -3.2 to 3.2 rad straight to 13 rad, where a turn of half a circle takes two rows.
#[test]
fn the_chart_of_a_turn_has_a_range_near_it() {
    for (yaw_rad, most) in [(3.1, "4"), (-3.1, "0.5"), (5.9, "7")] {
        let mut console = Console::ready();
        for time_ms in (0..2_000).step_by(5) {
            let mut turned = tick(time_ms, 0.0, None);
            turned.estimate.roll_pitch_yaw.z = yaw_rad * time_ms as f64 / 2_000.0;
            console.tick(turned);
        }
        while !console.screen(120, 40).contains("yaw") {
            console.press(&["t"]);
        }
        let charts = console.screen(120, 40);
        assert!(charts.lines().any(|line| line.trim_start().starts_with(&format!("{most} "))), "{yaw_rad}: {charts}");
    }
}

/// Regression: a replay asked for a verdict.
#[test]
fn a_replay_asks_for_no_verdict_and_offers_no_stop() {
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    assert_shows(&console.screen(80, 24), &["Trial #0: judge it"]);
    console.update(Msg::Replay(ReplayStatus::default()));
    for (columns, rows) in [(60, 20), (80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        assert_shows(&screen, &["Trial #0: no verdict yet"]);
        assert!(!screen.to_lowercase().contains("judge it"), "{screen}");
    }
    console.press(&[":", "s", "t", "o", "p"]);
    assert_shows(
        &console.screen(120, 40),
        &["(this is a replay: there is no robot to stop)", "twice within 2 s: quit"],
    );
}

/// Regression: without room for the keys the step of a rule that goes on was cut.
#[test]
fn the_step_before_an_automatic_jump_begins_like_that_before_any() {
    let mut console = Console::ready();
    console.judged(2);
    console.record(Record::Proposal(proposal(2, 0)));
    console.stage(ExperimentStage::Proposed, 2);
    console.record(Record::Session(SessionInfo { approve: Approval::Auto, ..session() }));
    assert_shows(last(&console.screen(120, 24)), &["Press g twice to jump. The next jumps follow without a question."]);
    console.press(&["2", "Home"]);
    assert_eq!(last(&console.screen(80, 24)), " Press g twice to jump. · Enter open · f v judge · r re-run · ? more");
}

/// Regression: a jump that lands before the end of its impulse had no landing in the line of phases: the controller calls it stance.
#[test]
fn a_jump_that_lands_before_the_end_of_its_impulse_has_a_landing() {
    let mut console = Console::ready();
    for time_ms in (0..2_500).step_by(5) {
        let time_s = time_ms as f64 / 1000.0 - 0.5;
        let phase = if (0.0..0.6).contains(&time_s) { Phase::Impulse } else { Phase::Stance };
        let mut tick = tick(time_ms, 0.0, Some((0, time_s, phase)));
        tick.estimate.contact = [!(0.2..0.5).contains(&time_s); 4];
        console.tick(tick);
    }
    console.record(Record::Trial(trial(0, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 0);
    console.mode(Mode::Review);
    let screen = console.screen(120, 40);
    let phases = line_with(&screen, "landing");
    let (before, landing) = phases.split_once("landing").unwrap();
    assert_shows(before, &["air"]);
    assert!(landing.starts_with("──────────"), "it lasts until the robot is at rest: {phases}");
    // Neither the countdown of the next trial nor the time between them belongs to it.
    for time_ms in (2_500..5_000).step_by(5) {
        let next = (time_ms >= 3_000).then(|| (1, time_ms as f64 / 1000.0 - 6.0, Phase::Stance));
        console.tick(tick(time_ms, 0.0, next));
    }
    console.press(&["z"]);
    console.update(Msg::Resize(120, 40));
    let screen = console.screen(120, 40);
    assert_eq!(screen.matches("│land").count(), 1, "{screen}");
    assert!(line_with(&screen, "│land").split_once("│land").unwrap().1.contains("─ "), "{screen}");
}

/// Regression: a replay that went to a trial could stand one tick before the record of its session, and Trials showed the trial as
/// one after the playhead.
#[test]
fn a_replay_that_goes_to_a_trial_shows_its_row() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let mut writer = Writer::create(&path, &SessionInfo::default(), 0, &[]).unwrap();
    for number in 1..=4_000 {
        let trial = (number / 1_000 % 2 == 1).then_some(number as u32 / 1_000);
        let tick = Tick { number, time_ns: number * 1_000_000, mode: Mode::Ready, trial, ..Tick::default() };
        writer.tick(&tick).unwrap();
        if number % 2_000 == 1_000 {
            // The session's thread writes after the tick.
            let (trial, time_ns) = (number as u32 / 1_000, number * 1_000_000 + 60_000);
            let stage = StageRecord { stage: ExperimentStage::Running, trial, can_undo: false, jumps: 1 };
            let row = TrialRecord { trial, ..TrialRecord::default() };
            for record in [Record::Trial(row), Record::Stage(stage)] {
                writer.record(&Stamped { time_ns, record }).unwrap();
            }
        }
    }
    writer.finish().unwrap();
    let mut feed = Feed::replay(Timeline::open(&[path]).unwrap());
    let mut console = Console::ready();
    let mut go = |commands: &[ReplayCommand]| {
        for command in commands {
            feed.control_replay(*command);
        }
        for message in feed.poll(0) {
            console.update(message);
        }
        let trial = console.model.snapshot.tick.trial;
        (trial, trial.map(|trial| console.model.is_later(trial)))
    };
    use ReplayCommand::{Back, Forward, NextMarker, PlayPause, PreviousMarker, Start, Trial};
    assert_eq!(go(&[PlayPause, Start]).0, None);
    for (command, trial) in [(NextMarker, 1), (NextMarker, 3), (PreviousMarker, 1), (Trial(3), 3)] {
        assert_eq!(go(&[command]), (Some(trial), Some(false)));
    }
    // One step on, the previous one is the begin of the trial itself.
    assert_eq!(go(&[Forward(ReplayStep::Second), PreviousMarker]), (Some(3), Some(false)));
    // Regression: a second forward or back ended the playback without a word; a sample does, to be looked at.
    let mut plays = |commands: &[ReplayCommand]| {
        commands.iter().for_each(|command| feed.control_replay(*command));
        let mut status = feed.poll(0).into_iter().filter_map(|message| match message {
            Msg::Replay(status) => Some(status.playing),
            _ => None,
        });
        status.next_back()
    };
    assert_eq!(plays(&[Start, PlayPause]), Some(true));
    assert_eq!(plays(&[Forward(ReplayStep::Second), Back(ReplayStep::Second)]), Some(true));
    assert_eq!(plays(&[Forward(ReplayStep::Frame)]), Some(false));
}

/// Regression: the proposed value of an override stood in no table and in no details.
#[test]
fn the_details_of_a_trial_hold_the_proposed_value_of_an_override() {
    let mut console = Console::ready();
    let changed = |list: &mut [ProposedParameter], name: &str, proposed| {
        list.iter_mut().find(|p| p.name == name).unwrap().proposed = proposed;
    };
    let mut first = proposal(0, 1);
    changed(&mut first.parameters, "Fx", 61.234_5);
    changed(&mut first.gains, "kp", 350.0);
    // An override that was taken back before the approval.
    let mut second = proposal(1, 3);
    changed(&mut second.parameters, "f0", 1.1);
    for proposal in [first, second, proposal(1, 4)] {
        console.record(Record::Proposal(proposal));
    }
    let gains = ParameterValues::from(vec![("kp".to_owned(), 400.0)]);
    for number in [0, 1] {
        let row = TrialRecord { gains: gains.clone(), ..trial(number, Some(Verdict::Accept), Some(Verdict::Accept)) };
        console.record(Record::Trial(row));
    }
    console.press(&["2", "Home", "Enter"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["75.00000 N, overridden; proposed 61.23", "kp 400 N/m, overridden; proposed 350.0"]);
    console.press(&["Down"]);
    assert!(!console.screen(120, 40).contains("overridden"), "{}", console.screen(120, 40));
    console.press(&["Esc", "R", "PgDn"]);
    assert_shows(&console.screen(120, 40), &["Values that an operator has set in place of the proposed ones."]);
}

/// Regression: a verdict that was changed three times had four reasons and causes in a row.
#[test]
fn the_cause_of_the_operator_is_a_reason_and_a_sentence() {
    for (cause, reason, sentence) in [
        ("landed and settled", None, "landed and settled"),
        ("by the operator; looked like fall: roll 1.2 rad", None, "by the operator, looked like fall (roll 1.2 rad)"),
        (
            "re-run by the operator: a cable pulled; looked like fall: roll 1.2 rad",
            Some("a cable pulled"),
            "re-run by the operator, looked like fall (roll 1.2 rad)",
        ),
        (
            "by the operator: a cable pulled; STOP was pressed",
            Some("a cable pulled"),
            "by the operator (STOP was pressed)",
        ),
        (
            "the video shows it; changed by the operator, was void; a cable pulled; changed by the operator, was fall; by the \
             operator: it slid; looked like accept: landed and settled",
            Some("the video shows it"),
            "changed by the operator, was void (landed and settled)",
        ),
    ] {
        let mut console = Console::ready();
        let row = TrialRecord { cause: cause.into(), ..trial(0, Some(Verdict::Void), None) };
        console.record(Record::Trial(row));
        console.press(&["2", "Enter"]);
        let screen = console.screen(120, 40);
        let at = |name: &str| {
            let line = screen.lines().find_map(|line| line.split_once(&format!("│ {name} ")));
            line.map(|(_, value)| value.trim_matches([' ', '│']).to_owned())
        };
        assert_eq!((at("reason").as_deref(), at("cause").as_deref()), (reason, Some(sentence)), "{screen}");
    }
}
