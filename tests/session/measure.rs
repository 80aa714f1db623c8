//! Measured values of a trial: touchdown, flights, bounces, jumps in a row.

use quadfrog::config::Config;
use quadfrog::control::foot_placement::SHORTEST_FLIGHT_S;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{CONTROL_PERIOD_S, ticks_in};
use quadfrog::session::evaluation::evaluate;
use quadfrog::session::objective::{
    SHORTEST_BOUNCE_S, ended_at_rest, ended_by_fall, measure, suggest, suggest_measured, tripped_limit, value,
};
use quadfrog::session::rejudge::Judgement;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::{Phase, Tick, TrialEnd, TrialSpec};
use quadfrog::trial::{Backend, BounceRule, JumpParameters, MeasuredJump, ObjectiveRule, Task, TrialRecord, Verdict};

/// Ticks of a robot that moves forward at 1 m/s: (phase, feet down, duration in s) one after the other.
fn ticks(parts: &[(Phase, bool, f64)]) -> Vec<Tick> {
    let mut ticks = Vec::new();
    for &(phase, down, duration_s) in parts {
        for _ in 0..ticks_in(duration_s) {
            let number = ticks.len() as u64;
            let time_s = number as f64 * CONTROL_PERIOD_S;
            let mut tick = Tick { number, trial: Some(0), trial_time_s: time_s, phase, ..Tick::default() };
            tick.estimate.contact = [down; 4];
            tick.estimate.position_world.x = time_s;
            ticks.push(tick);
        }
    }
    ticks
}

fn rule(bounce: BounceRule) -> ObjectiveRule {
    ObjectiveRule { bounce, ..ObjectiveRule::single(Task::Forward) }
}

fn measured(parts: &[(Phase, bool, f64)]) -> MeasuredJump {
    measure(&rule(BounceRule::Ignore), &ticks(parts)).unwrap()
}

const IMPULSE: (Phase, bool, f64) = (Phase::Impulse, true, 0.3);
const FLIGHT: (Phase, bool, f64) = (Phase::Flight, false, 0.4);

#[test]
fn a_jump_has_its_touchdown_and_one_flight() {
    let found = measured(&[IMPULSE, FLIGHT, (Phase::Landing, true, 0.5)]);
    assert_eq!(found.flights, 1);
    let touchdown = found.touchdown.unwrap();
    assert!((touchdown.time_s - 0.7).abs() < 1e-9 && (touchdown.dx_m - 0.7).abs() < 1e-9, "{touchdown:?}");
    assert!((found.dx_m - 1.199).abs() < 1e-9 && found.first_landing.is_none(), "{found:?}");
    assert_eq!(found.measured_value, Some(found.dx_m));
}

#[test]
fn feet_that_lift_for_a_moment_are_no_flight() {
    let flicker_s = SHORTEST_BOUNCE_S - 0.001;
    let landing = [(Phase::Landing, true, 0.05), (Phase::Flight, false, flicker_s), (Phase::Landing, true, 0.4)];
    let parts = [&[IMPULSE, FLIGHT][..], &landing].concat();
    assert_eq!(measured(&parts).flights, 1);
    let lifted = [IMPULSE, (Phase::Flight, false, SHORTEST_FLIGHT_S - 0.001), (Phase::Stance, true, 0.4)];
    let found = measured(&lifted);
    assert!(found.flights == 0 && found.touchdown.is_none(), "{found:?}");
}

#[test]
fn a_flight_that_ends_in_the_impulse_is_not_after_it() {
    let early = [(Phase::Impulse, true, 0.1), (Phase::Impulse, false, 0.1), (Phase::Impulse, true, 0.1)];
    let parts = [&early[..], &[FLIGHT, (Phase::Landing, true, 0.3)]].concat();
    let found = measured(&parts);
    assert_eq!(found.flights, 1);
    assert!((found.touchdown.unwrap().time_s - 0.7).abs() < 1e-9, "{found:?}");
}

#[test]
fn a_robot_that_is_still_in_the_air_at_the_end_has_no_touchdown() {
    let found = measured(&[IMPULSE, FLIGHT]);
    assert!(found.flights == 1 && found.touchdown.is_none(), "{found:?}");
    // Regression: of a robot that was stopped within the impulse, in the air, no flight was counted.
    let found = measured(&[IMPULSE, (Phase::Impulse, false, 0.1)]);
    assert!(found.flights == 1 && found.touchdown.is_none(), "{found:?}");
}

/// Each rule: the value, and the suggested verdict with its cause.
#[test]
fn a_robot_that_bounces_on_is_judged_by_the_rule() {
    let landing = (Phase::Landing, true, 0.1);
    let hop = (Phase::Flight, false, SHORTEST_BOUNCE_S);
    let ticks = ticks(&[IMPULSE, FLIGHT, landing, hop, landing, hop, (Phase::Landing, true, 0.5)]);
    let settled = TrialEnd::Settled;
    for (bounce, expected, verdict) in [
        (BounceRule::Ignore, 1.499, Verdict::Accept),
        (BounceRule::FirstLanding, 0.799, Verdict::Accept),
        (BounceRule::Zero, 0.0, Verdict::Fall),
    ] {
        let found = measure(&rule(bounce), &ticks).unwrap();
        assert_eq!(found.flights, 3);
        assert!((found.first_landing.unwrap().dx_m - 0.799).abs() < 1e-9, "{found:?}");
        assert!((value(&rule(bounce), &found) - expected).abs() < 1e-9, "{bounce:?}: {found:?}");
        let (suggested, cause) = suggest_measured(&settled, Some(&found), bounce);
        assert_eq!(suggested, verdict, "{bounce:?}");
        match bounce {
            BounceRule::Ignore => assert_eq!((suggested, cause), suggest(&settled)),
            _ => assert!(cause.starts_with("bounced: 3 flights after the impulse"), "{cause}"),
        }
        // A robot that fell has fallen, however it bounced.
        assert_eq!(suggest_measured(&TrialEnd::NotQuiet, Some(&found), bounce), suggest(&TrialEnd::NotQuiet));
    }
}

fn go1(config: &Config) -> Rollout<Simulator> {
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = config.settings(&robot, Task::Forward, Backend::Simulator).unwrap();
    Rollout::new(Simulator::new(&robot, &config.simulator).unwrap(), &settings)
}

#[test]
fn each_of_five_jumps_is_a_row_and_their_values_add_up_to_the_displacement() {
    let config = Config::load(Some("examples/continuous".as_ref())).unwrap();
    let control = config.task(Task::Forward);
    let jump = JumpParameters::from_values(&config.first(Task::Forward), control.f1_hz);
    let spec = TrialSpec { seed: 3, ..control.trial(Task::Forward, jump) };
    let run = evaluate(&mut go1(&config), &spec);
    let found = run.measured.unwrap();
    assert_eq!((run.end, found.flights, found.jumps.len()), (TrialEnd::Settled, 1, 5));
    let period_s = 0.5 / jump.f0_hz + 0.5 / jump.f1_hz;
    for (number, row) in found.jumps.iter().enumerate() {
        assert!((row.time_s - number as f64 * period_s).abs() <= CONTROL_PERIOD_S, "{row:?}");
        assert!(row.rise_m > 0.05 && row.air_s > 0.1 && row.tilt_rad < 0.5, "{row:?}");
    }
    assert_eq!((found.jumps[0].x_m, found.jumps[0].yaw_rad), (0.0, 0.0));
    let last = found.jumps.last().unwrap();
    let sum: f64 = found.jumps.iter().map(|row| row.value).sum();
    assert!((sum - found.dx_m).abs() < 1e-9 && (last.x_m + last.value - found.dx_m).abs() < 1e-9, "{found:?}");
    assert!((run.value - found.dx_m / 5.0).abs() < 1e-12);
    let air_s = found.jumps.iter().map(|row| row.air_s).fold(0.0, f64::max);
    assert!((air_s - found.air_s).abs() < 1e-9, "{found:?}");
    let touchdown = found.touchdown.unwrap();
    assert!(touchdown.time_s > last.time_s && touchdown.dx_m > last.x_m, "{found:?}");
}

/// A normal landing is one flight: no jump of a default search may change its cause.
#[test]
fn single_jumps_that_settle_have_one_flight() {
    let config = Config::load(None).unwrap();
    let mut rollout = go1(&config);
    for (f0_hz, fx_n, fz_n) in [(1.3, 60.0, 230.0), (1.5, 100.0, 260.0), (1.1, 40.0, 300.0), (1.7, 80.0, 340.0)] {
        let jump = JumpParameters { f0_hz, f1_hz: 0.0, fx_n, fy_n: 0.0, fz_n };
        let run = evaluate(&mut rollout, &config.task(Task::Forward).trial(Task::Forward, jump));
        let found = run.measured.unwrap();
        if run.end == TrialEnd::Settled {
            assert_eq!(found.flights, 1, "{jump:?}: {found:?}");
        }
        assert_eq!(found.jumps.len(), 1);
        assert!((found.jumps[0].rise_m - found.apex_m).abs() < 1e-12);
    }
}

#[test]
fn an_older_record_without_the_new_values_still_reads() {
    let text = r#"{"dx_m": 0.4, "dy_m": 0.0, "dyaw_rad": 0.1, "apex_m": 0.3, "air_s": 0.4}"#;
    let old: MeasuredJump = serde_json::from_str(text).unwrap();
    assert_eq!((old.dx_m, old.flights, old.measured_value, old.jumps.len()), (0.4, 0, None, 0));
    assert!((value(&rule(BounceRule::Zero), &old) - 0.4).abs() < 1e-12);
}

/// Regression: a trial whose verdict the operator had changed was judged again as one of another end, because his words stand before
/// the rule's.
#[test]
fn words_of_the_operator_hide_no_end_of_a_trial() {
    let row = |suggested, cause: &str| TrialRecord {
        suggested: Some(suggested),
        cause: cause.into(),
        ..TrialRecord::default()
    };
    for words in ["", "by the operator: it slipped; ", "re-run by the operator; looked like fall: "] {
        let with_words = |cause: &str| format!("{words}{cause}");
        assert!(ended_at_rest(&row(Verdict::Accept, &with_words("landed and settled"))), "{words}");
        let limited = row(Verdict::Fall, &with_words("limit: RR_hip at -1.171 rad exceeds -0.963 rad"));
        assert!(tripped_limit(&limited) && !ended_by_fall(&limited), "{words}");
        assert!(!ended_by_fall(&row(Verdict::Fall, &with_words("did not come to rest"))), "{words}");
        assert!(ended_by_fall(&row(Verdict::Fall, &with_words("roll 1.20 rad exceeds 1.00 rad"))), "{words}");
    }
}

/// Regression: a trial that the operator had re-run changed by being judged again, because his words stand before the reason.
#[test]
fn words_of_the_operator_before_the_reason_are_no_other_judgement() {
    let judged =
        |cause: &str| Judgement { value: Some(0.4), measured: None, verdict: Some(Verdict::Fall), cause: cause.into() };
    let new = judged("pitch 1.20 rad");
    for old in [
        "pitch 1.20 rad",
        "by the operator: it slipped; pitch 1.20 rad",
        "re-run by the operator; looked like fall: pitch 1.20 rad",
    ] {
        assert!(!new.differs(&judged(old)), "{old}");
    }
    assert!(new.differs(&judged("roll 1.20 rad")));
    assert!(new.differs(&judged("looked at by pitch 1.20 rad")));
}
