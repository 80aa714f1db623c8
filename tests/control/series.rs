//! Jumps in a row: duration, the wait for the landing, and what drops the further jumps.

use crate::bench;
use crate::robots;
use std::f64::consts::PI;

use bench::{Bench, shipped};
use quadfrog::config::Config;
use quadfrog::robot::LEGS;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::evaluation::{EvaluatedRun, evaluate};
use quadfrog::session::objective::suggest;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::{Command, CommandRefusal, Fault, Mode, Phase, Tick, TrialEnd, TrialInhibit, TrialSpec};
use quadfrog::trial::{Backend, JumpParameters, Task, Verdict};
use robots::LinkedRobot;

/// Five small jumps forward, one a second.
const JUMP: JumpParameters = JumpParameters { f0_hz: 1.4, f1_hz: 0.8, fx_n: 30.0, fy_n: 0.0, fz_n: 220.0 };

fn five(config: &Config) -> TrialSpec {
    TrialSpec { trial: 3, jumps: 5, ..config.task(Task::Forward).trial(Task::Forward, JUMP) }
}

/// A robot with hardware settings in the third of five jumps, in the pause.
fn in_the_third_jump() -> Bench<LinkedRobot> {
    let (config, description, mut settings) = shipped(Backend::Hardware);
    (settings.consistency.orientation_rad, settings.consistency.turn_rad) = (f64::INFINITY, f64::INFINITY);
    let lying = LinkedRobot::lying(&description, &config.simulator);
    let robot = LinkedRobot { with_truth: true, keeps_commands: true, ..lying };
    let mut bench = Bench::new(config, settings, robot).reach(Mode::Ready);
    bench.settle();
    let spec = five(&bench.config);
    bench.command(Command::RunTrial(spec, bench.permit()));
    bench.until(Mode::Jump);
    let (mut begun, mut before) = (1, true);
    for _ in 0..20_000 {
        let tick = bench.tick(None);
        assert_eq!(tick.mode, Mode::Jump, "{:?}", bench.events.last());
        let impulse = tick.phase == Phase::Impulse;
        begun += u32::from(impulse && !before);
        before = impulse;
        if begun == 3 && tick.phase == Phase::Landing {
            return bench;
        }
    }
    panic!("no third jump");
}

/// Ticks until the robot is disarmed; returns how many of them had an impulse.
fn impulses_until_disarmed(bench: &mut Bench<LinkedRobot>) -> usize {
    let mut impulses = 0;
    for _ in 0..30_000 {
        let tick = bench.tick(None);
        impulses += usize::from(tick.phase == Phase::Impulse || tick.theta_rad > PI);
        if tick.mode == Mode::Disarmed {
            return impulses;
        }
    }
    panic!("never disarmed: {:?}", bench.events.last());
}

#[test]
fn a_landing_failsafe_between_jumps_leaves_no_further_impulse() {
    let mut bench = in_the_third_jump();
    bench.inputs.guard_silent_ms = 80;
    assert_eq!(impulses_until_disarmed(&mut bench), 0);
    assert!(matches!(bench.ends()[..], [TrialEnd::Fault(Fault::GuardSilent { .. })]), "{:?}", bench.ends());
}

#[test]
fn a_silent_console_between_jumps_leaves_no_further_impulse() {
    let mut bench = in_the_third_jump();
    bench.inputs.operator_silent_ms = 1001;
    assert_eq!(impulses_until_disarmed(&mut bench), 0);
    let ends = bench.ends();
    assert!(matches!(ends[..], [TrialEnd::Fault(Fault::OperatorLost { .. })]), "{ends:?}");
    assert_eq!(suggest(&ends[0]).0, Verdict::Void);
}

/// The operator's key to sit down: the robot lands, comes to rest, sits down.
#[test]
fn sitting_down_between_jumps_leaves_no_further_impulse() {
    let mut bench = in_the_third_jump();
    bench.command(Command::SitDown);
    assert_eq!(bench.refusal(), None);
    assert_eq!(impulses_until_disarmed(&mut bench), 0);
    assert_eq!(bench.ends(), [TrialEnd::SatDown]);
    assert_eq!(suggest(&TrialEnd::SatDown), (Verdict::Void, "no further jump: sat down by the operator".to_owned()));
}

/// A second press, in the jump that the first one has made the last, and in SETTLE.
#[test]
fn sitting_down_in_the_last_jump_sits_the_robot_down_after_it() {
    let mut bench = in_the_third_jump();
    bench.command(Command::SitDown);
    bench.command(Command::SitDown);
    assert_eq!(bench.refusal(), None);
    bench.until(Mode::Settle);
    bench.command(Command::SitDown);
    assert_eq!(bench.refusal(), None);
    assert_eq!(impulses_until_disarmed(&mut bench), 0);
    assert_eq!(bench.ends(), [TrialEnd::SatDown]);
}

/// The trial ends as without the request where no jump is left to drop.
#[test]
fn sitting_down_after_a_hold_or_in_settle_sits_the_robot_down_after_the_trial() {
    let mut bench = in_the_third_jump();
    bench.robot.tamper = |state| state.motor_temperature_c[6] = 72.0;
    bench.tick(None);
    bench.command(Command::SitDown);
    assert_eq!(bench.refusal(), None);
    assert_eq!(impulses_until_disarmed(&mut bench), 0);
    let ends = bench.ends();
    assert!(matches!(ends[..], [TrialEnd::Held(TrialInhibit::MotorWarm { .. })]), "{ends:?}");
}

/// A single jump has no pause: the request is refused, and the robot stands in REVIEW.
#[test]
fn sitting_down_in_a_single_jump_is_refused() {
    let (config, description, settings) = shipped(Backend::Simulator);
    let robot = LinkedRobot::lying(&description, &config.simulator);
    let mut bench = Bench::new(config, settings, LinkedRobot { with_truth: true, ..robot }).reach(Mode::Ready);
    bench.settle();
    let spec = bench.config.task(Task::Forward).trial(Task::Forward, JUMP);
    bench.command(Command::RunTrial(spec, bench.permit()));
    bench.until(Mode::Jump);
    bench.command(Command::SitDown);
    assert_eq!(bench.refusal(), Some(CommandRefusal::Mode));
    bench.until(Mode::Review);
    for _ in 0..100 {
        assert_eq!(bench.tick(None).mode, Mode::Review);
    }
}

/// A cause that inhibits the next trial (HOLD) also ends jumps in a row; the robot stays in REVIEW.
#[test]
fn a_hold_between_jumps_leaves_no_further_impulse() {
    let mut bench = in_the_third_jump();
    bench.robot.tamper = |state| state.motor_temperature_c[6] = 72.0;
    let mut impulses = 0;
    while bench.cycle.mode() != Mode::Review {
        impulses += usize::from(bench.tick(None).phase == Phase::Impulse);
        assert!(bench.cycle.last().number < 60_000, "never in REVIEW");
    }
    assert_eq!(impulses, 0);
    let ends = bench.ends();
    assert!(matches!(ends[..], [TrialEnd::Held(TrialInhibit::MotorWarm { .. })]), "{ends:?}");
    let (verdict, cause) = suggest(&ends[0]);
    assert!(verdict == Verdict::Void && cause.starts_with("no further jump: motor RR_hip"), "{cause}");
}

fn simulated(spec: impl Fn(&Config) -> TrialSpec) -> (EvaluatedRun, Vec<Tick>) {
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = config.settings(&robot, Task::Forward, Backend::Simulator).unwrap();
    let mut rollout = Rollout::new(Simulator::new(&robot, &config.simulator).unwrap(), &settings);
    let spec = spec(&config);
    (evaluate(&mut rollout, &spec), rollout.run(&spec).1.to_vec())
}

/// The period is 0.982 s: impulses begin at 0, 0.982 and 1.964 s, and the next would at 2.946 s.
#[test]
fn the_last_impulse_begins_before_the_duration() {
    let (run, _) = simulated(|config| {
        let mut control = *config.task(Task::Forward);
        (control.duration_s, control.f1_hz) = (Some(2.9), JUMP.f1_hz);
        control.trial(Task::Forward, JUMP)
    });
    assert_eq!((run.end, run.jumps), (TrialEnd::Settled, 3));
    let measured = run.measured.unwrap();
    assert!((run.value - measured.dx_m / 3.0).abs() < 1e-12, "per jump that was made");
}

/// With a pause too short to come to rest the oscillator waits: at every start of an impulse all feet are down and the trunk is
/// quiet, and the trial ends after the last jump all the same.
#[test]
fn the_oscillator_waits_for_the_landing() {
    let hasty = JumpParameters { f1_hz: 1.2, ..JUMP };
    let of = |landing_wait_s: f64| simulated(move |config| TrialSpec { jump: hasty, landing_wait_s, ..five(config) });
    let (waits, ticks) = of(2.0);
    assert_eq!((waits.end, waits.jumps), (TrialEnd::Settled, 5));
    let mut before = Phase::Stance;
    for tick in &ticks {
        if tick.phase == Phase::Impulse && before != Phase::Impulse {
            assert_eq!(tick.estimate.contact, [true; LEGS], "at {} s", tick.trial_time_s);
            let velocity = tick.estimate.velocity_world.norm();
            assert!(velocity < 0.1, "{velocity} m/s at {} s", tick.trial_time_s);
        }
        before = tick.phase;
    }
    let starts =
        |run: &EvaluatedRun| run.measured.as_ref().unwrap().jumps.iter().map(|row| row.time_s).collect::<Vec<_>>();
    let period_s = 0.5 / hasty.f0_hz + 0.5 / hasty.f1_hz;
    let gaps = starts(&waits).windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>();
    assert!(gaps.iter().all(|gap| *gap > period_s + 0.01 && *gap < period_s + 2.0), "{gaps:?}");
    // A short limit ends the wait: 20 ms later than without.
    let (short, _) = of(0.02);
    let first = starts(&short)[1];
    assert!((first - period_s - 0.02).abs() < 0.0021, "{first}");
    let (none, _) = of(0.0);
    assert!((starts(&none)[1] - period_s).abs() < 0.0011);
}

/// Waits count for the duration: fewer jumps begin within it.
#[test]
fn jumps_that_wait_are_fewer_within_the_duration() {
    let hasty = JumpParameters { f1_hz: 1.2, ..JUMP };
    let (run, _) = simulated(|config| {
        let mut control = *config.task(Task::Forward);
        (control.duration_s, control.landing_wait_s) = (Some(4.0), 2.0);
        control.trial(Task::Forward, hasty)
    });
    assert_eq!((run.end, hasty.within(4.0)), (TrialEnd::Settled, 6));
    let starts: Vec<f64> = run.measured.unwrap().jumps.iter().map(|row| row.time_s).collect();
    assert!((2..6).contains(&starts.len()) && starts.iter().all(|start| *start < 4.0), "{starts:?}");
}

#[test]
fn the_rate_is_the_displacement_per_second_up_to_the_last_touchdown() {
    let (run, _) = simulated(|config| TrialSpec { rate: true, ..five(config) });
    let measured = run.measured.unwrap();
    let touchdown_s = measured.touchdown.unwrap().time_s;
    assert!((run.value - measured.dx_m / touchdown_s).abs() < 1e-12);
    assert!(touchdown_s > measured.jumps[4].time_s && touchdown_s < measured.end_s, "{measured:?}");
}
