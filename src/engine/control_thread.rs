//! The control thread: applies the real-time settings, then runs the control loop at 1 kHz. On exit, also after a panic, it
//! keeps sending damping commands; a robot that they do not reach is left to the guard.

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
    /// Settings of the controller, its limits and its failsafes.
    pub settings: &'a ControlSettings,
    /// Real-time settings that are requested of the system.
    pub scheduling: Scheduling,
    /// Receives the granted and denied real-time settings once, before the first tick.
    pub report: Sender<(Vec<RealtimeSetting>, Vec<DeniedSetting>)>,
    /// Clock of the ticks' stages and of suspensions.
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
pub const fn lead(hardware: bool) -> Duration {
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
    /// Whether the robot is commanded and the commands do not reach it.
    fn is_cut_off(&self) -> bool {
        self.control_loop.mode().commanded() && !self.robot.delivers()
    }

    /// Sends the guard a heartbeat when one is due; none while the robot is cut off, so that the guard damps it.
    fn send_guard_heartbeat(&mut self) {
        let is_cut_off = self.is_cut_off();
        // A guard that the robot was not reported to as commanded learns it first.
        if let Some(guard_heartbeat) = self.guard_heartbeat.as_mut().filter(|sent| !is_cut_off || !sent.commanded()) {
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

/// As [`run`], but with the real-time settings and the pace of the caller: ticks as `paced` calls them, then the damping with
/// `wait` after each command.
///
/// # Errors
/// The panic of a tick, of `paced`, or of a clock that cannot be read; the robot has been damped by then.
pub fn drive<C: Clock>(
    start: &mut ControlThreadParts<C>,
    end: ControlPorts,
    robot: &mut dyn Robot,
    paced: impl FnOnce(&mut dyn PeriodicTask) -> Result<(), nix::Error>,
    mut wait: impl FnMut(),
) -> std::thread::Result<()> {
    let control_loop = ControlLoop::new(start.settings, end);
    let guard_heartbeat = start.guard_heartbeat.take();
    let mut ticking = Ticking { control_loop, robot, clock: start.clock, closing: start.closing, guard_heartbeat };
    // Afterwards the control loop is asked for its mode and takes the guard's silence, which a panic does not leave half changed.
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
    let is_cut_off = ticking.is_cut_off();
    if let Some(guard_heartbeat) = ticking.guard_heartbeat {
        if is_cut_off { guard_heartbeat.leave_robot() } else { guard_heartbeat.release() }
    }
    ended
}
