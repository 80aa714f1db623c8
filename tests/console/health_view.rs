//! View Health: the history of temperature, battery, link and lateness.

use crate::support::{Console, assert_shows, line_with, session, tick};
use quadfrog::recording::record::{Record, SessionInfo};
use quadfrog::recording::recorder::RecorderStatus;
use quadfrog::robot::{Battery, LinkStatus};
use quadfrog::telemetry::{Counters, RecentLateness, Snapshot, Tick};
use quadfrog::trial::Backend;
use quadfrog_console::message::Msg;

/// Ten minutes of a robot: a tick a second, with the values of each second.
fn ran(temperature_c: f64, battery_percent: Option<f64>, link: bool) -> Console {
    let mut console = Console::new();
    console.record(Record::Session(session()));
    let link = link.then(|| LinkStatus { state_age_ms: 3, ..LinkStatus::default() });
    for second in 0..500 {
        let mut tick = tick(1000 * second, 0.0, None);
        tick.state.motor_temperature_c = [temperature_c; 12];
        tick.state.battery = battery_percent.map(|charge_percent| Battery { charge_percent, ..Battery::default() });
        // The last second is late by 2 ms.
        tick.stages.lateness_ns = if second == 499 { 2_000_000 } else { 100_000 };
        let counters = Counters { link, ..Counters::default() };
        console.update(Msg::Snapshot(Box::new(Snapshot { tick, counters, ..Snapshot::default() })));
        console.tick(tick);
    }
    console.press(&["5"]);
    console
}

#[test]
fn a_key_shows_the_history_in_place_of_the_numbers() {
    for (columns, rows) in [(80, 24), (120, 40)] {
        let mut console = ran(45.0, Some(80.0), true);
        assert!(!console.screen(columns, rows).contains("Health of the last"), "{columns}");
        assert_shows(&console.screen(columns, rows), &["history (t)"]);
        console.press(&["t"]);
        let screen = console.screen(columns, rows);
        assert_shows(
            &screen,
            &[
                "Health of the last 10 minutes",
                "numbers (t)",
                "hottest motor 45.00 C, limit 60.00 C",
                "battery 80.00 %, limit 30.00 %",
                "age of the state 3.000 ms",
                "lateness 2.000 ms",
                "0 s",
            ],
        );
        assert!(screen.contains('╌'), "no limit:\n{screen}");
        console.press(&["t"]);
        assert_shows(&console.screen(columns, rows), &["Motors"]);
    }
}

/// Regression: the history had the lateness of the shown ticks, one of five, and contradicted the worst one beside it.
#[test]
fn the_history_has_the_worst_tick_of_a_second_also_if_it_is_not_shown() {
    let mut console = ran(45.0, Some(80.0), true);
    let lateness = RecentLateness { second: 499, present_ns: 17_650_000, before_ns: 12_500_000 };
    console.update(Msg::Snapshot(Box::new(Snapshot { lateness, ..console.model.snapshot })));
    let kept: Vec<f64> =
        console.model.health_history.seconds().rev().take(3).map(|second| second.lateness_ms).collect();
    assert_eq!(kept, [17.65, 12.5, 0.1]);
    console.press(&["t"]);
    assert_shows(&console.screen(80, 24), &["lateness 17.65 ms", "worst of each second"]);
}

#[test]
fn a_large_terminal_shows_numbers_and_history() {
    for (columns, rows) in [(200, 60), (200, 40), (120, 60)] {
        let console = ran(45.0, Some(80.0), true);
        assert_shows(
            &console.screen(columns, rows),
            &["Motors", "RL_calf", "Health of the last 10 minutes", "lateness"],
        );
    }
}

#[test]
fn values_beyond_their_limits_are_marked() {
    let mut console = ran(71.0, Some(12.0), true);
    console.press(&["t"]);
    let screen = console.screen(120, 40);
    assert_shows(&line_with(&screen, "hottest motor"), &["71.00 C !", "12.00 % !"]);
    assert!(!line_with(&screen, "age of the state").contains('!'), "{screen}");
}

#[test]
fn what_a_robot_does_not_report_is_said_and_not_drawn_as_zero() {
    let mut console = ran(0.0, None, false);
    console.press(&["t"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["the robot reports no temperatures", "the robot has no battery", "SIM: no link"]);
    assert_shows(&line_with(&screen, "lateness"), &["2.000 ms"]);
}

#[test]
fn a_second_costs_a_few_cells() {
    let mut console = ran(45.0, Some(80.0), true);
    console.press(&["t"]);
    let before = console.draw(120, 40);
    let mut next = tick(500_000, 0.0, None);
    next.state.motor_temperature_c = [45.0; 12];
    next.state.battery = Some(Battery { charge_percent: 80.0, ..Battery::default() });
    next.stages.lateness_ns = 2_000_000;
    console.tick(next);
    let changed = before.diff(&console.draw(120, 40)).len();
    assert!(changed <= 40, "{changed} cells");
}

#[test]
fn a_rewound_replay_forgets_the_health_after_the_playhead() {
    let mut console = ran(45.0, Some(80.0), true);
    console.press(&["t"]);
    console.update(Msg::Rewound);
    assert!(!console.screen(120, 40).contains("45.00 C"));
}

/// Regression: on a full disk the frame still showed a green `REC`, and the last line offered a jump that the session refuses.
#[test]
fn a_failed_recording_is_not_shown_as_running_and_offers_no_jump() {
    let mut console = Console::ready();
    assert_shows(&console.screen(80, 24), &[" REC 00:00"]);
    let full = || Some("session.mcap.part: File too large".to_owned());
    let failed = RecorderStatus { error: full(), ..RecorderStatus::default() };
    let of_another_file = RecorderStatus { warning: full(), ..RecorderStatus::default() };
    for (status, shown) in [(failed, "NOT RECORDED 00:00"), (of_another_file, "REC INCOMPLETE 00:00")] {
        console.update(Msg::Recorder(status));
        for (columns, rows) in [(60, 20), (80, 24), (120, 40)] {
            let screen = console.screen(columns, rows);
            assert_shows(&screen, &[shown]);
            assert!(!screen.contains(" REC 0"), "{screen}");
        }
        assert_eq!(console.next_step(), "No jump now: the recording is not complete; 5 shows why.");
        assert_eq!(console.press(&["g"]), []);
        assert_shows(console.said(), &["g is not possible: the recording is not complete (session.mcap.part: File"]);
        assert!(console.model.dialog.is_none());
    }
}

/// Regression: the history went on with the last temperature and charge of a robot that was silent, as values of now.
#[test]
fn the_history_of_a_silent_robot_ends_with_its_last_state() {
    let mut console = Console::new();
    console.record(Record::Session(SessionInfo { backend: Some(Backend::Hardware), ..session() }));
    let state = |time_ms: u64, robot_time_ms: u32| {
        let mut tick = tick(time_ms, 0.0, None);
        tick.state.robot_time_ms = robot_time_ms;
        tick.state.motor_temperature_c = [45.0; 12];
        tick.state.battery = Some(Battery { charge_percent: 80.0, ..Battery::default() });
        tick
    };
    let headings = |console: &Console| {
        let screen = console.screen(120, 40);
        ["hottest motor", "battery", "lateness"].map(|name| line_with(&screen, name))
    };
    console.press(&["5", "t"]);
    // A robot that has not answered yet.
    console.tick(Tick { time_ns: 0, ..Tick::default() });
    assert_shows(&headings(&console)[0], &["hottest motor no state from the robot", "battery no state from the robot"]);
    (1..500).for_each(|second| console.tick(state(1000 * second, 1000 * second as u32)));
    assert_shows(&headings(&console)[0], &["hottest motor 45.00 C", "battery 80.00 %"]);
    let drawn =
        |console: &Console| console.screen(120, 40).chars().filter(|c| ('\u{2801}'..='\u{28ff}').contains(c)).count();
    let before = drawn(&console);
    // In the second of the last state, and later.
    for end_ms in [499_200, 510_000] {
        (499_005..=end_ms).step_by(5).for_each(|time_ms| console.tick(state(time_ms, 499_000)));
        let [motor, battery, lateness] = headings(&console);
        assert_shows(&motor, &["hottest motor no state from the robot"]);
        assert_shows(&battery, &["battery no state from the robot"]);
        assert_shows(&lateness, &["lateness 0.000 ms"]);
        // What it sent before stays.
        assert!(drawn(&console) > before / 2, "{}", console.screen(120, 40));
    }
    let newest = console.model.health_history.seconds().next_back().copied().expect("a second");
    assert!(newest.motor_c.is_nan() && newest.battery_percent.is_nan(), "{newest:?}");
    console.tick(state(510_005, 510_005));
    assert_shows(&headings(&console)[0], &["hottest motor 45.00 C", "battery 80.00 %"]);
}
