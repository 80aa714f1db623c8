//! The control thread: applies the real-time settings, then runs the control loop at 1 kHz. On exit, also after a panic, it
//! keeps sending damping commands.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::time::Duration;

use super::guard::GuardHeartbeat;
use crate::control::control_loop::ControlLoop;
use crate::control::settings::ControlSettings;
use crate::realtime::channel::ControlPorts;
use crate::realtime::clock::Clock;
use crate::realtime::scheduling::{DeniedSetting, RealtimeSetting, Scheduling};
use crate::realtime::thread::{CONTROL_TICK_OFFSET, PeriodicTask, TickStart, WARM_UP_LEAD, pace_with_warm_up};
use crate::robot::{CONTROL_PERIOD_S, JointCommand, Robot};

/// Parts of the control thread.
pub struct ControlThreadParts<'a, C> {
    pub settings: &'a ControlSettings,
    /// Real-time settings that are requested of the system.
    pub scheduling: Scheduling,
    /// Receives the granted and denied real-time settings once, before the first tick.
    pub report: Sender<(Vec<RealtimeSetting>, Vec<DeniedSetting>)>,
    pub clock: &'a C,
    /// Set when the thread is to end.
    pub closing: &'a AtomicBool,
    /// Whether the robot is real. A real robot keeps the last command when nothing more is sent, a simulated one stands still;
    /// and the caches are warmed before each tick of a real one.
    pub hardware: bool,
    /// Heartbeat to the guard; none without a guard.
    pub guard_heartbeat: Option<GuardHeartbeat>,
}

/// Least number of damping commands after the last tick: half a second, in which the damped robot lowers to the floor.
const LAST_DAMPINGS: u32 = 500;

/// Runs until `closing` is set.
///
/// # Panics
/// When a tick does, or the clock cannot be read: once the robot has been damped, and `closing` is set.
pub fn run<C: Clock>(mut start: ControlThreadParts<C>, end: ControlPorts, robot: &mut dyn Robot) {
    let granted = start.scheduling.apply();
    let _ = start.report.send((granted.granted.clone(), granted.denied.clone()));
    let period = Duration::from_secs_f64(CONTROL_PERIOD_S);
    let lead = lead(start.hardware);
    let paced = |ticking: &mut dyn PeriodicTask| pace_with_warm_up(period, CONTROL_TICK_OFFSET, lead, ticking);
    // Damping at the end is timed with sleep: the monotonic clock may have failed.
    if let Err(panic) = drive(&mut start, end, robot, paced, || std::thread::sleep(period)) {
        resume_unwind(panic);
    }
}

/// Returns the time before a tick at which the caches are warmed; zero for a simulated robot, whose tick has no deadline.
const fn lead(hardware: bool) -> Duration {
    if hardware { WARM_UP_LEAD } else { Duration::ZERO }
}

/// The control loop and its robot, until the engine closes.
struct Ticking<'a, C> {
    control_loop: ControlLoop,
    robot: &'a mut dyn Robot,
    clock: &'a C,
    closing: &'a AtomicBool,
    guard_heartbeat: Option<GuardHeartbeat>,
}

impl<C> Ticking<'_, C> {
    fn send_guard_heartbeat(&mut self) {
        if let Some(guard_heartbeat) = &mut self.guard_heartbeat {
            let silent_ms = guard_heartbeat.count_tick(self.control_loop.mode().commanded());
            self.control_loop.set_guard_silent(silent_ms);
        }
    }
}

impl<C: Clock> PeriodicTask for Ticking<'_, C> {
    fn warm_up(&mut self) {
        self.control_loop.warm_up(self.clock, self.robot);
    }

    fn tick(&mut self, instant: TickStart) -> ControlFlow<()> {
        self.control_loop.tick(instant, self.clock, self.robot);
        self.control_loop.prepare();
        self.send_guard_heartbeat();
        if self.closing.load(Ordering::Acquire) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Ticks as `paced` calls them, then the damping with `wait` after each; what panicked is given back.
fn drive<C: Clock>(
    start: &mut ControlThreadParts<C>,
    end: ControlPorts,
    robot: &mut dyn Robot,
    paced: impl FnOnce(&mut dyn PeriodicTask) -> Result<(), nix::Error>,
    mut wait: impl FnMut(),
) -> std::thread::Result<()> {
    let control_loop = ControlLoop::new(start.settings, end);
    let guard_heartbeat = start.guard_heartbeat.take();
    let mut ticking = Ticking { control_loop, robot, clock: start.clock, closing: start.closing, guard_heartbeat };
    // Afterwards the control loop is only asked for its mode, which a panic does not leave half changed.
    let ended = catch_unwind(AssertUnwindSafe(|| {
        if let Err(error) = paced(&mut ticking) {
            panic!("the control thread cannot read the monotonic clock: {error}");
        }
    }));
    if start.hardware && ticking.control_loop.mode().commanded() {
        let damping = JointCommand::damping(start.settings.gate.damping_kd);
        let mut sent = 0;
        while sent < LAST_DAMPINGS || !start.closing.load(Ordering::Acquire) {
            // A lost datagram is followed by the next.
            let _ = ticking.robot.write(&damping);
            ticking.send_guard_heartbeat();
            sent = sent.saturating_add(1);
            wait();
        }
    }
    if let Some(guard_heartbeat) = ticking.guard_heartbeat {
        guard_heartbeat.release();
    }
    ended
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::realtime::channel::channels;
    use crate::realtime::clock::SimulatedClock;
    use crate::robot::description::RobotDescription;
    use crate::robot::{Placement, RobotError, RobotState};
    use crate::telemetry::Command;
    use crate::trial::Backend;
    use crate::trial::Task;

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
        let description = RobotDescription::embedded("go1").unwrap();
        let settings = Config::load(None).unwrap().settings(&description, Task::Forward, Backend::Hardware).unwrap();
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
            report: std::sync::mpsc::channel().0,
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

    #[test]
    fn only_a_real_robot_has_a_cache_warm_up() {
        assert_eq!((lead(true), lead(false)), (WARM_UP_LEAD, Duration::ZERO));
    }

    #[test]
    fn the_last_word_to_a_robot_that_is_controlled_is_damping_and_to_another_there_is_none() {
        assert_eq!(damped(true, [u32::MAX; 2], 0).1, 500, "an end in order, too");
        assert_eq!(damped(false, [20, u32::MAX], 1), (Vec::new(), 0), "a robot that is only observed");
    }
}
