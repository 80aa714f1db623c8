//! The control thread: the system's favours, then one body a millisecond until it is told to end.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::time::Duration;

use crate::control::body::Body;
use crate::control::settings::{PERIOD_S, Settings};
use crate::realtime::channel::ControlEnd;
use crate::realtime::clock::Clock;
use crate::realtime::scheduling::{Favour, Scheduling, Shortfall};
use crate::realtime::thread::pace;
use crate::robot::Robot;

/// What the thread is started with.
pub struct Start<'a, C> {
    /// What the cycle is made with.
    pub settings: &'a Settings,
    /// What is asked of the system.
    pub scheduling: Scheduling,
    /// Told once what the system granted, before the first tick.
    pub told: Sender<(Vec<Favour>, Vec<Shortfall>)>,
    /// The clock of the engine.
    pub clock: &'a C,
    /// Set when the thread is to end.
    pub closing: &'a AtomicBool,
}

/// Runs until `closing` is set.
pub fn run<C: Clock>(start: Start<C>, end: ControlEnd, robot: &mut dyn Robot) {
    let granted = start.scheduling.apply();
    let _ = start.told.send((granted.favours.clone(), granted.shortfalls.clone()));
    drop(start.told);
    let mut body = Body::new(start.settings, end, start.clock.now_ns());
    let paced = pace(Duration::from_secs_f64(PERIOD_S), |instant| {
        body.tick(instant, start.clock, robot);
        if start.closing.load(Ordering::Acquire) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    if let Err(error) = paced {
        // Without a clock there is no control: the panic hook tells the operator, the robot's own time-out damps.
        panic!("the control thread cannot read the monotonic clock: {error}");
    }
}
