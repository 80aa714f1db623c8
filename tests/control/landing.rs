//! Faults by phase of the motion, injected at an emulated Go1 in flight and landing: landing under the controller, landing with the motors
//! alone, damping at once. Prints the measured times.

use crate::bench;
use crate::emulated;
use emulated::{EmulatedBench, emulated, hardware_like};
use quadfrog::control::failsafe::{FailsafeAction, descriptions};
use quadfrog::robot::Truth;
use quadfrog::sim::SimConfig;
use quadfrog::telemetry::{Event, FailsafeWarning, Mode, TrialEnd};
use quadfrog::trial::Backend;

type Model = fn(&mut SimConfig);
const MODELS: [(&str, Model); 2] = [("ideal", |_| {}), ("hardware-like", hardware_like)];

/// Times of a trial, s: rising in the impulse, end of the impulse, top, falling.
const IN_THE_AIR: [f64; 4] = [0.3, 0.366, 0.42, 0.6];

fn truth(bench: &EmulatedBench) -> Truth {
    bench.robot.emulator.status().truth.unwrap()
}

fn tilt_rad(truth: &Truth) -> f64 {
    let (roll, pitch, _) = truth.world_from_body.euler_angles();
    roll.abs().max(pitch.abs())
}

/// Course of a landing with a fault.
#[derive(Debug)]
struct Landing {
    /// Largest tilt until the damping, rad.
    tilt_rad: f64,
    /// Whether a part other than the feet touched the ground before the damping.
    body_contact: bool,
    /// From the fault to the damping, ms.
    damped_ms: u32,
    /// From the touchdown to the damping, ms.
    landed_ms: u32,
}

/// Ticks until the robot is damped; every command before is energised.
fn land(bench: &mut EmulatedBench) -> Landing {
    let mut landing = Landing { tilt_rad: 0.0, body_contact: false, damped_ms: 0, landed_ms: 0 };
    while bench.cycle.mode() != Mode::Fault {
        let tick = bench.tick(None);
        landing.damped_ms += 1;
        assert!(landing.damped_ms < 2000, "never damped: {:?}", tick.mode);
        assert!(tick.mode == Mode::Fault || !bench.damps(&tick), "damped in {:?}", tick.mode);
        let truth = truth(bench);
        landing.tilt_rad = landing.tilt_rad.max(tilt_rad(&truth));
        landing.body_contact |= truth.body_contact;
        let down = truth.foot_contact.iter().any(|&down| down) && truth.velocity_world.z < 0.5;
        landing.landed_ms = if down || landing.landed_ms > 0 { landing.landed_ms + 1 } else { 0 };
    }
    landing
}

/// Regression: a tick that was 11 ms late at the end of the impulse damped the legs in the air.
#[test]
fn a_fault_in_the_air_that_leaves_the_state_known_is_landed_by_the_controller() {
    type Inject = fn(&mut EmulatedBench);
    let faults: [(&str, Inject, &str); 4] = [
        (
            "tick 11.1 ms late",
            |bench| {
                bench.inputs.lateness_ns = 11_100_000;
                bench.tick(None);
                bench.inputs.lateness_ns = 0;
            },
            "control thread late: 11.1 ms",
        ),
        ("hot FR_calf 80", |bench| bench.inject("hot FR_calf 80"), "motor FR_calf at 80 degrees"),
        (
            "corrupt 50 for 60 ms",
            |bench| {
                bench.inject("corrupt 50");
                for _ in 0..60 {
                    bench.tick(None);
                }
                bench.inject("clear");
            },
            "states with a wrong checksum",
        ),
        ("session gone", |bench| bench.inputs.events_lost = true, "the session does not take events"),
    ];
    for (name, model) in MODELS {
        for (fault, inject, words) in faults {
            for time_s in IN_THE_AIR {
                let mut bench = emulated(model).with_short_countdown().reach(Mode::Jump);
                bench.until_trial_time(time_s);
                bench.events.clear();
                inject(&mut bench);
                assert!(bench.cycle.mode().energised(), "{fault}: {:?}", bench.events);
                let landing = land(&mut bench);
                println!("{name}: {fault} at {time_s} s: {landing:.2?}");
                assert!(!landing.body_contact && landing.tilt_rad < 0.5, "{fault}: {landing:?}");
                assert!(landing.landed_ms <= 640, "{fault}: {landing:?}");
                let warned = bench.cycle.readiness().warning;
                assert!(matches!(warned, Some(FailsafeWarning::Landing(_))), "{warned:?}");
                let latched = bench.faults();
                assert!(latched.len() == 1 && latched[0].to_string().contains(words), "{fault}: {latched:?}");
                assert!(matches!(bench.ends()[..], [TrialEnd::Fault(_)]), "{fault}: {:?}", bench.ends());
            }
        }
    }
}

/// No state arrives any more, commands do: from the limit of the state's age on, the motors hold the stance for 0.6 s.
#[test]
fn a_fault_in_the_air_that_leaves_the_state_unknown_is_landed_by_the_motors() {
    for (name, model) in MODELS {
        for time_s in IN_THE_AIR {
            let mut bench = emulated(model).with_short_countdown().reach(Mode::Jump);
            bench.until_trial_time(time_s);
            bench.robot.deaf_ms = 1;
            bench.ticks(21);
            assert_eq!(bench.cycle.mode(), Mode::Jump);
            let held = bench.robot.sent.motor[0];
            assert_eq!((held.kp_joint, held.kd_joint, held.torque_n_m), (50.0, 2.0, 0.0), "the motors' own law");
            let landing = land(&mut bench);
            println!("{name}: no state from {time_s} s on: {landing:.2?}");
            assert!(!landing.body_contact && landing.tilt_rad < 0.6, "{landing:?}");
            assert!((595..=605).contains(&landing.damped_ms), "{landing:?}");
            let latched = bench.faults();
            assert!(latched[0].to_string().contains("no state from the robot for 21 ms"), "{latched:?}");
        }
    }
}

/// A frozen computer of the robot executes no command; the controller tries nevertheless, and latches the fault.
#[test]
fn a_robot_that_freezes_in_the_air_is_latched_as_a_fault() {
    let mut bench = emulated(|_| {}).with_short_countdown().reach(Mode::Jump);
    bench.until_trial_time(0.42);
    bench.inject("freeze");
    let ms = bench.ticks_in_mode(Mode::Jump, 1000);
    println!("freeze in the air: latched after {ms} ms");
    assert!((615..=630).contains(&ms) && bench.cycle.mode() == Mode::Fault, "{ms} ms: {:?}", bench.events.last());
}

/// With a foot on the ground the legs are compressed: without a state they are damped.
#[test]
fn a_landing_without_a_state_is_damped() {
    for (name, model) in MODELS {
        for after_ms in [5, 30, 100] {
            let mut bench = emulated(model).with_short_countdown().reach(Mode::Settle);
            bench.ticks(after_ms);
            bench.robot.deaf_ms = 1;
            let ms = bench.ticks_in_mode(Mode::Settle, 100);
            assert_eq!((bench.cycle.mode(), ms), (Mode::Fault, 21), "{:?}", bench.events.last());
            let mut most = 0.0_f64;
            for _ in 0..1500 {
                bench.tick(None);
                most = most.max(tilt_rad(&truth(&bench)));
            }
            println!(
                "{name}: no state from {after_ms} ms after the touchdown on: damped after {ms} ms, tilt {most:.2} rad"
            );
            assert!(most < 0.6, "{most}");
        }
    }
}

/// Motors that cannot be trusted, and STOP, damp in the air, also while the robot lands with another fault.
#[test]
fn a_fault_of_a_motor_and_stop_damp_at_once() {
    for landing in [false, true] {
        for fault in
            ["angle FL_hip 1.3", "speed RR_thigh 90", "torque RR_calf 50", "servo-off RL_thigh", "nan FL_calf", "stop"]
        {
            let mut bench = emulated(|_| {}).with_short_countdown().reach(Mode::Jump);
            bench.until_trial_time(0.42);
            if landing {
                bench.inject("hot FR_calf 80");
                bench.ticks(20);
                assert_eq!(bench.cycle.mode(), Mode::Jump);
            }
            let mut ms = 1;
            if fault == "stop" {
                bench.stop(None);
            } else {
                bench.inject(fault);
                ms = bench.ticks_in_mode(Mode::Jump, 10);
            }
            println!("{fault} in the air: damped after {ms} ms");
            assert!(ms <= 3 && bench.damps(bench.cycle.last()), "{fault}: {ms} ms");
        }
    }
}

/// A series of jumps ends with the jump in which a fault was found.
#[test]
fn a_fault_ends_a_series_of_jumps() {
    let mut bench = emulated(|_| {}).with_short_countdown().reach(Mode::Ready);
    bench.settle();
    let mut spec = bench.spec();
    (spec.jumps, spec.jump.f1_hz, spec.jump.fx_n) = (5, 0.5, 20.0);
    bench.command(quadfrog::telemetry::Command::RunTrial(spec, bench.permit()));
    bench.until(Mode::Jump);
    bench.until_trial_time(0.42);
    bench.inject("hot FR_calf 80");
    bench.ticks(2);
    for _ in 0..3000 {
        let tick = bench.tick(None);
        assert!(tick.theta_rad < std::f64::consts::PI, "another impulse began");
    }
    assert_eq!(bench.cycle.mode(), Mode::Fault);
    let stops = |event: &&Event| matches!(event, Event::Mode { to: Mode::Fault, .. });
    assert_eq!(bench.events.iter().filter(stops).count(), 1);
}

/// The first table of "Failsafes" in `docs/safety.md` is the table of the program.
#[test]
fn the_documented_table_is_the_programs() {
    let (_, _, settings) = bench::shipped(Backend::Hardware);
    let text = include_str!("../../docs/safety.md");
    let section = text.split("## Failsafes").nth(1).unwrap();
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let rows = section.lines().skip_while(|line| !line.starts_with('|')).take_while(|line| line.starts_with('|'));
    let documented: Vec<_> = rows.skip(2).map(cells).collect();
    let described: Vec<_> = descriptions(&settings)
        .into_iter()
        .map(|row| {
            let [ground, air, landing] = row.actions.map(|action: FailsafeAction| action.name().to_owned());
            vec![row.cause.to_owned(), row.limit, row.watched, ground, air, landing]
        })
        .collect();
    for row in &described {
        println!("| {} |", row.join(" | "));
    }
    assert_eq!(documented, described);
}
