//! The threads of an engine: the control thread damps the robot at its end, also after a panic, and dropped threads have ended.

use std::io::Read;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::Duration;

use crate::bench::shipped;
use quadfrog::engine::control_thread::{ControlThreadParts, drive, lead};
use quadfrog::engine::{EngineThreads, GuardHeartbeat, Options};
use quadfrog::realtime::channel::{SHOWN_EVERY, channels};
use quadfrog::realtime::clock::{MonotonicClock, SimulatedClock};
use quadfrog::realtime::scheduling::Scheduling;
use quadfrog::realtime::thread::{PeriodicTask, TickStart, WARM_UP_LEAD};
use quadfrog::recording::recorder::Recorder;
use quadfrog::robot::{JointCommand, Placement, Robot, RobotError, RobotState};
use quadfrog::sim::Simulator;
use quadfrog::telemetry::{Command, Mode};
use quadfrog::trial::{Backend, Task};

/// Answers until `reads` or `warm_ups` is used up, then panics; keeps what it is sent.
struct Brittle {
    reads: u32,
    warm_ups: u32,
    sent: Vec<JointCommand>,
}

impl Robot for Brittle {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        self.reads = self.reads.checked_sub(1).expect("an injected defect");
        Ok(RobotState::default())
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.sent.push(*command);
        Ok(())
    }
    fn place(&mut self, _: &Placement) -> bool {
        false
    }
    fn warm_up(&mut self) {
        self.warm_ups = self.warm_ups.checked_sub(1).expect("an injected defect");
    }
}

/// Returns the commands that a robot received and the number of waits, if `reads` ticks or `warm_ups` go well with it and the thread is
/// closed after `closes_after` waits.
fn damped(controlled: bool, [reads, warm_ups]: [u32; 2], closes_after: u32) -> (Vec<JointCommand>, u32) {
    let (_, _, settings) = shipped(Backend::Hardware);
    let (control, mut session, console, _ticks) = channels();
    console.heartbeat.beat();
    if controlled {
        session.commands.push(Command::TakeControl).unwrap();
    }
    let mut robot = Brittle { reads, warm_ups, sent: Vec::new() };
    let closing = AtomicBool::new(closes_after == 0);
    let mut start = ControlThreadParts {
        settings: &settings,
        scheduling: Scheduling::default(),
        report: channel().0,
        clock: &SimulatedClock,
        closing: &closing,
        hardware: true,
        guard_heartbeat: None,
    };
    let mut ms = 0;
    let unpaced = |ticking: &mut dyn PeriodicTask| {
        while ticking.tick(TickStart { planned_ns: ms * 1_000_000, lateness_ns: 0 }).is_continue() {
            ticking.warm_up();
            ms += 1;
        }
        Ok(())
    };
    let mut waited = 0;
    let ended = drive(&mut start, control, &mut robot, unpaced, || {
        waited += 1;
        closing.fetch_or(waited >= closes_after, Ordering::AcqRel);
    });
    assert_eq!(ended.is_err(), closes_after > 0, "a panic is not swallowed");
    let is_damping = |command: &&JointCommand| **command == JointCommand::damping(settings.gate.damping_kd);
    let last = robot.sent.iter().rev().take_while(is_damping).copied().collect();
    (last, waited)
}

/// Regression: a panic in a tick ended the thread, and the motors kept the last torques.
#[test]
fn a_panic_in_a_tick_or_its_warm_up_is_followed_by_damping_for_half_a_second_and_until_the_end() {
    for until in [[20, u32::MAX], [u32::MAX, 20]] {
        let (sent, waited) = damped(true, until, 1);
        assert_eq!(waited, 500);
        assert!(sent.len() >= 500, "{}", sent.len());
        assert_eq!(damped(true, until, 800).1, 800, "it continues until the engine closes");
    }
}

/// Regression: the tick in which a limit trips was not among those of the charts, whose last value lay below the limit.
#[test]
fn the_ticks_for_charts_are_every_fifth_and_those_in_which_the_mode_changes() {
    let (_, _, settings) = shipped(Backend::Simulator);
    let (control, session, mut console, _ticks) = channels();
    let mut robot = Brittle { reads: u32::MAX, warm_ups: u32::MAX, sent: Vec::new() };
    let mut start = ControlThreadParts {
        settings: &settings,
        scheduling: Scheduling::default(),
        report: channel().0,
        clock: &SimulatedClock,
        closing: &AtomicBool::new(false),
        hardware: false,
        guard_heartbeat: None,
    };
    let unpaced = |ticking: &mut dyn PeriodicTask| {
        for ms in 0..30 {
            if ms == 13 {
                session.stop.set();
            }
            let _ = ticking.tick(TickStart { planned_ns: ms * 1_000_000, lateness_ns: 0 });
        }
        Ok(())
    };
    drive(&mut start, control, &mut robot, unpaced, || {}).unwrap();
    let shown: Vec<_> = std::iter::from_fn(|| console.shown.pop().ok()).map(|tick| (tick.number, tick.mode)).collect();
    // The first tick leaves Offline, the fourteenth sees STOP.
    let numbers = [1, 5, 10, 14, 15, 20, 25, 30];
    assert_eq!(SHOWN_EVERY, 5);
    assert_eq!(shown, numbers.map(|number| (number, if number < 14 { Mode::Observe } else { Mode::Damped })));
}

#[test]
fn only_a_real_robot_has_a_cache_warm_up() {
    assert_eq!((lead(true), lead(false)), (WARM_UP_LEAD, Duration::ZERO));
}

#[test]
fn the_last_word_to_a_robot_that_is_controlled_is_damping_and_to_another_there_is_none() {
    assert_eq!(damped(true, [u32::MAX; 2], 0).1, 500, "an end in order, too");
    assert_eq!(damped(false, [20, u32::MAX], 1), (Vec::new(), 0), "a robot that is only observed");
}

/// A robot whose commands reach it while `reached` is positive; each write decreases it.
struct CutOff {
    reached: u32,
    sent: u32,
}

impl Robot for CutOff {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        Ok(RobotState::default())
    }
    fn write(&mut self, _: &JointCommand) -> Result<(), RobotError> {
        self.reached = self.reached.saturating_sub(1);
        self.sent += 1;
        Ok(())
    }
    fn place(&mut self, _: &Placement) -> bool {
        false
    }
    fn delivers(&self) -> bool {
        self.reached > 0
    }
}

/// Returns the heartbeats that a guard receives in 100 ticks of a robot that `reached` commands reach, and the number of commands.
fn heartbeats(reached: u32) -> (String, u32) {
    let (_, _, settings) = shipped(Backend::Hardware);
    let (control, mut session, console, _ticks) = channels();
    console.heartbeat.beat();
    session.commands.push(Command::TakeControl).unwrap();
    let (ours, mut guard) = UnixStream::pair().unwrap();
    let mut robot = CutOff { reached, sent: 0 };
    let mut start = ControlThreadParts {
        settings: &settings,
        scheduling: Scheduling::default(),
        report: channel().0,
        clock: &SimulatedClock,
        closing: &AtomicBool::new(true),
        hardware: true,
        guard_heartbeat: Some(GuardHeartbeat::new(ours).unwrap()),
    };
    let unpaced = |ticking: &mut dyn PeriodicTask| {
        for ms in 0..100 {
            let _ = ticking.tick(TickStart { planned_ns: ms * 1_000_000, lateness_ns: 0 });
        }
        Ok(())
    };
    drive(&mut start, control, &mut robot, unpaced, || {}).unwrap();
    let mut received = String::new();
    guard.read_to_string(&mut received).unwrap();
    (received, robot.sent)
}

/// Regression: where the library of a robot's network failed, the guard received heartbeats, and at the end that the robot was left
/// alone: the robot held its last torques.
#[test]
fn a_robot_that_commands_do_not_reach_is_left_to_the_guard() {
    let (received, sent) = heartbeats(u32::MAX);
    assert!(received.starts_with('+') && received.ends_with("+-") && received.len() > 50, "{received}");
    assert!(sent >= 500, "{sent}");
    // It fails after 45 ticks: no heartbeat from then on, and no last one; damping is tried all the same.
    let (received, sent) = heartbeats(45);
    assert!(received.chars().all(|heartbeat| heartbeat == '+') && (4..=6).contains(&received.len()), "{received}");
    assert!(sent >= 500, "{sent}");
    // It never worked: the guard knows of the robot.
    assert_eq!(heartbeats(0).0, "+");
}

/// A simulated robot that counts as running until its thread has dropped it.
struct Watched(Simulator, #[expect(dead_code, reason = "its count is read")] Arc<()>);

impl Robot for Watched {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        self.0.read()
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.0.write(command)
    }
    fn place(&mut self, placement: &Placement) -> bool {
        self.0.place(placement)
    }
}

/// An error after the start of the control thread leaves no thread behind: `start` drops what it has made.
#[test]
fn dropped_threads_have_ended() {
    let (config, robot, settings) = shipped(Backend::Simulator);
    let running = Arc::new(());
    let simulator = Watched(Simulator::new(&robot, &config.simulator).unwrap(), running.clone());
    let options = Options::new(config, robot, Backend::Simulator, Task::Forward);
    let (control_end, session_end, console_end, tick_end) = channels();
    let (to_recorder, records) = channel();
    let (to_session, _ticks) = channel();
    let recorder = Recorder::spawn(tick_end, records, None, to_session).unwrap();
    let mut threads = EngineThreads::of(recorder);
    let watch = threads.recorder().unwrap().watch();
    let clock = MonotonicClock::start();
    let scheduled =
        threads.spawn_control((Box::new(simulator), None), control_end, &options, &settings, clock).unwrap();
    scheduled.recv().unwrap();
    assert_eq!(Arc::strong_count(&running), 2, "here, in the control thread");
    drop((to_recorder, session_end, console_end));
    drop(threads);
    assert_eq!(Arc::strong_count(&running), 1);
    assert_eq!(watch.get().error, None);
}
