//! Landing terms: cut-off of the profile force with hysteresis, spread of the swing feet, and their keys in `control.toml`.

use std::f64::consts::PI;
use std::fs;

use quadfrog::config::Config;
use quadfrog::control::landing::LandingLegs;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::{Cutoff, LandingTerms, TrialEnd, TrialSpec};
use quadfrog::trial::{Backend, JumpParameters, Task};

const FOOT: LandingTerms = LandingTerms { cutoff: Cutoff::Foot, cutoff_lost_s: 0.02, spread_m: 0.04, spread_s: 0.3 };
const LATE_RAD: f64 = 1.5 * PI;

/// A foot that is off the ground for 19 ms keeps its force, one that is off for 20 ms loses it until it touches the ground.
#[test]
fn a_foot_is_cut_off_only_after_the_time_without_contact() {
    let mut legs = LandingLegs::default();
    let off = |legs: &LandingLegs| legs.cut_off(&FOOT, LATE_RAD);
    for _ in 0..10 {
        for _ in 0..19 {
            legs.update(&[false, true, true, true], &[false; 4]);
            assert_eq!(off(&legs), [false; 4], "flicker");
        }
        legs.update(&[true; 4], &[false; 4]);
    }
    for _ in 0..20 {
        legs.update(&[false, true, true, true], &[false; 4]);
    }
    assert_eq!(off(&legs), [true, false, false, false]);
    assert_eq!(legs.cut_off(&FOOT, 1.2 * PI), [false; 4], "begin of the impulse");
    assert_eq!(legs.cut_off(&LandingTerms { cutoff: Cutoff::None, ..FOOT }, LATE_RAD), [false; 4]);
    legs.update(&[true; 4], &[false; 4]);
    assert_eq!(off(&legs), [false; 4]);
}

/// Feet spread in swing, outward on both sides, and return to the stance in 0.3 s on the ground.
#[test]
fn feet_are_spread_in_swing_and_return_on_the_ground() {
    let mut legs = LandingLegs::default();
    let y = |legs: &LandingLegs| legs.spread_leg(&FOOT).map(|shift| shift.y);
    legs.update(&[true; 4], &[false; 4]);
    assert_eq!(y(&legs), [0.0; 4], "stance before the first flight");
    legs.update(&[false; 4], &[true; 4]);
    assert_eq!(y(&legs), [-0.04, 0.04, -0.04, 0.04]);
    for _ in 0..150 {
        legs.update(&[true, false, false, false], &[false, true, true, true]);
    }
    assert!((y(&legs)[0] + 0.02).abs() < 1e-12, "half of the time on the ground: {:?}", y(&legs));
    assert_eq!(y(&legs)[1], 0.04, "still in swing");
    for _ in 0..150 {
        legs.update(&[true; 4], &[false; 4]);
    }
    assert_eq!(y(&legs)[0], 0.0);
}

/// An impulse that outlasts the flight pushes the landing robot over; with the terms it stands.
#[test]
fn a_robot_that_lands_during_a_long_impulse_stands_with_the_terms() {
    let robot = RobotDescription::embedded("go1").unwrap();
    let config = Config::load(None).unwrap();
    let settings = config.settings(&robot, Task::LateralLeft, Backend::Simulator).unwrap();
    let mut rollout = Rollout::new(Simulator::new(&robot, &config.simulator).unwrap(), &settings);
    let jump = JumpParameters { f0_hz: 0.795, f1_hz: 0.0, fx_n: 0.0, fy_n: 90.4, fz_n: 154.0 };
    let mut control = *config.task(Task::LateralLeft);
    (control.attitude_rate_gain, control.foot_placement_s) = (30.0, 0.08);
    let mut end = |landing: LandingTerms| {
        let spec = TrialSpec { landing, ..control.trial(Task::LateralLeft, jump) };
        rollout.run(&spec).0
    };
    let without = end(LandingTerms::default());
    assert!(matches!(without, TrialEnd::Fell(_)), "without the terms: {without:?}");
    assert_eq!(end(FOOT), TrialEnd::Settled);
}

/// Values outside the ranges are refused with file, key, value and remedy; a robot has narrower ranges.
#[test]
fn keys_of_the_landing_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let load = |text: &str, backend| {
        let text = format!("[tasks.forward]\n{text}\n");
        fs::write(folder.path().join("control.toml"), text).unwrap();
        let loaded = Config::load(Some(folder.path())).map_err(|error| error.to_string())?;
        loaded.settings(&robot, Task::Forward, backend).map(|_| loaded).map_err(|error| error.to_string())
    };
    let loaded = load("cutoff = \"foot\"\nlanding_spread_m = 0.08", Backend::Simulator).unwrap();
    let expected = LandingTerms { cutoff: Cutoff::Foot, spread_m: 0.08, ..LandingTerms::default() };
    assert_eq!(loaded.task(Task::Forward).landing(), expected);
    assert_eq!(loaded.task(Task::TwistCw).landing(), LandingTerms::default());
    for (text, backend, parts) in [
        ("landing_spread_m = 0.2", Backend::Simulator, ["tasks.forward.landing_spread_m", "0 to 0.1"]),
        ("cutoff_lost_s = 0.0", Backend::Simulator, ["tasks.forward.cutoff_lost_s", "0.001 to 0.5"]),
        ("landing_spread_m = 0.08", Backend::Hardware, ["tasks.forward.landing_spread_m", "0 to 0.06"]),
        ("cutoff = \"leg\"", Backend::Simulator, ["control.toml", "`none` or `foot`"]),
    ] {
        let error = load(text, backend).unwrap_err();
        assert!(parts.iter().all(|part| error.contains(part)), "{text}: {error}");
    }
}
