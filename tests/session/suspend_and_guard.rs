//! A suspended computer damps, a guard that does not answer lands the robot.

use crate::bench;
use crate::robots;
use std::cell::Cell;

use bench::{Bench, shipped};
use quadfrog::control::control_loop::ControlLoop;
use quadfrog::realtime::channel::channels;
use quadfrog::realtime::clock::Clock;
use quadfrog::realtime::thread::TickStart;
use quadfrog::telemetry::{Command, Event, Fault, Mode, TransitionCause, TrialEnd};
use quadfrog::trial::Backend;
use robots::LinkedRobot;

fn linked(mode: Mode) -> Bench<LinkedRobot> {
    let (config, description, settings) = shipped(Backend::Hardware);
    let lying = LinkedRobot::lying(&description, &config.simulator);
    Bench::new(config, settings, LinkedRobot { with_truth: true, keeps_commands: true, ..lying }).reach(mode)
}

/// Regression: CLOCK_MONOTONIC stands still in a suspension, so nothing was late, and torques went on.
#[test]
fn a_suspension_of_the_computer_damps_in_the_same_tick_in_every_commanded_mode() {
    use Mode::*;
    for mode in [Disarmed, StandUp, Ready, Countdown, Jump, Settle, Review, SitDown] {
        let mut bench = linked(mode);
        bench.inputs.suspended_ms = bench.settings.failsafe.suspended_ms;
        bench.tick(None);
        assert_eq!(bench.faults(), [], "{mode:?}");
        bench.inputs.suspended_ms += 1;
        let tick = bench.tick(None);
        assert!(bench.damps(&tick) && tick.mode == Fault, "{mode:?}");
        let [fault @ quadfrog::telemetry::Fault::Suspended { .. }] = bench.faults()[..] else {
            panic!("{mode:?}: {:?}", bench.faults())
        };
        assert_eq!(fault.to_string(), "the computer was suspended for 51 ms, limit 50 ms");
        assert!(fault.voids_confirmations(), "a person may have been at the robot");
        bench.inputs.suspended_ms = 0;
        bench.ticks(1500);
        assert_eq!(bench.cycle.mode(), Fault, "latched");
        assert_eq!(bench.command(Command::Acknowledge { stops: 0 }).mode, Disarmed);
    }
    for mode in [Offline, Observe] {
        let mut bench = linked(mode);
        bench.inputs.suspended_ms = 60_000;
        bench.ticks(2);
        assert_eq!((bench.faults(), bench.robot.writes), (Vec::new(), 0), "{mode:?}");
    }
}

/// A computer whose suspensions the test decides; the readings of its clocks are 0.2 ms apart.
#[derive(Default)]
struct Computer {
    suspended_ns: Cell<u64>,
}

impl Clock for Computer {
    fn now_ns(&self) -> u64 {
        0
    }
    fn suspended_ns(&self) -> Option<[u64; 2]> {
        let suspended_ns = self.suspended_ns.get();
        Some([suspended_ns.saturating_sub(100_000), suspended_ns + 100_000])
    }
}

#[test]
fn the_control_loop_notices_a_suspension_by_the_clocks_once() {
    let (config, description, settings) = shipped(Backend::Hardware);
    let mut robot = LinkedRobot::lying(&description, &config.simulator);
    let computer = Computer::default();
    computer.suspended_ns.set(3_600_000_000_000);
    let (control, mut session, console, _ticks) = channels();
    let mut body = ControlLoop::new(&settings, control);
    let mut time_ms = 0;
    let mut ticks = |body: &mut ControlLoop, count: u32| {
        for _ in 0..count {
            console.heartbeat.beat();
            time_ms += 1;
            body.tick(TickStart { planned_ns: time_ms * 1_000_000, lateness_ns: 0 }, &computer, &mut robot);
        }
    };
    ticks(&mut body, 10);
    session.commands.push(Command::TakeControl).unwrap();
    ticks(&mut body, 10);
    assert_eq!(body.mode(), Mode::Disarmed);
    for (suspended_ms, mode) in [(40, Mode::Disarmed), (60_000, Mode::Fault)] {
        computer.suspended_ns.set(computer.suspended_ns.get() + suspended_ms * 1_000_000);
        ticks(&mut body, 1);
        assert_eq!(body.mode(), mode, "{suspended_ms} ms");
    }
    let mut causes = Vec::new();
    while let Ok(event) = session.events.pop() {
        if let Event::Mode { to: Mode::Fault, cause: TransitionCause::Fault(fault), .. } = event {
            causes.push(fault);
        }
    }
    let [Fault::Suspended { suspended_ms: 59_990..=60_000, allowed_ms: 50 }] = causes[..] else { panic!("{causes:?}") };
    ticks(&mut body, 100);
    session.commands.push(Command::Acknowledge { stops: 0 }).unwrap();
    ticks(&mut body, 10);
    assert_eq!(body.mode(), Mode::Disarmed, "it trips in one tick only");
}

#[test]
fn without_an_answer_of_the_guard_a_standing_robot_sits_down() {
    for silent_ms in [71, u32::MAX] {
        for mode in [Mode::StandUp, Mode::Ready, Mode::Countdown, Mode::Review] {
            let mut bench = linked(mode);
            bench.inputs.guard_silent_ms = 70;
            bench.tick(None);
            assert_eq!(bench.cycle.mode(), mode);
            bench.inputs.guard_silent_ms = silent_ms;
            assert_eq!(bench.tick(None).mode, Mode::SitDown, "{mode:?}");
            let cause = bench.events.iter().rev().find_map(|event| match event {
                Event::Mode { to: Mode::SitDown, cause, .. } => Some(cause.to_string()),
                _ => None,
            });
            assert!(cause.is_some_and(|cause| cause.contains("guard process")), "{mode:?}");
            bench.until(Mode::Disarmed);
            assert_eq!(bench.faults(), [], "nothing is damped in the air or on the legs");
        }
    }
}

#[test]
fn without_an_answer_of_the_guard_a_jump_lands_and_sits_down() {
    let mut bench = linked(Mode::Offline).airborne();
    bench.inputs.guard_silent_ms = 80;
    let modes = bench.modes_until(Mode::Disarmed);
    assert_eq!(modes[..2], [Mode::Jump, Mode::Settle], "{modes:?}");
    assert!(modes.contains(&Mode::SitDown) && !modes.contains(&Mode::Fault), "{modes:?}");
    assert!(matches!(bench.ends()[..], [TrialEnd::Fault(Fault::GuardSilent { silent_ms: 80, allowed_ms: 70 })]));
}
