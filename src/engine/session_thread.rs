//! The session thread: requests as they come, events every few milliseconds.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use super::guard::{Guard, GuardState};
use super::observers::SessionNews;
use crate::optimize::journal::LOCK_GRACE;
use crate::realtime::clock::{Clock, MonotonicClock};
use crate::realtime::sleep_lock::{ALLOW_INHIBITOR, SleepLock};
use crate::recording::record::LogLevel;
use crate::session::operator_request::StampedRequest;
use crate::session::supervisor::Supervisor;

/// Longest time between two polls of the control thread's events.
const SESSION_PERIOD: Duration = Duration::from_millis(5);
/// Longest time for landing and sitting down at the end.
const LONGEST_SIT_DOWN: Duration = Duration::from_secs(10);
/// Time for which damping is sent to a real robot at the end: it sinks softly in that time.
const DAMPING_AT_THE_END: Duration = Duration::from_millis(500);
/// Longest wait for the effect of the last STOP; the control thread acts within a millisecond.
const LONGEST_STOP: Duration = Duration::from_secs(2);

/// Longest wait for the storage of the study at the end: a lock that another program left behind is broken before. What is not
/// stored then was judged and is on disk, and is reported when the study is opened again.
const LONGEST_CLOSE: Duration = Duration::from_secs(LOCK_GRACE.as_secs() + 5);

/// Runs the session until the console drops its handle; `news` of its observers go to the log. Returns the supervisor with the
/// session's channel ends, because a control thread takes their loss for a crash of the session, and the guard, because the control
/// thread commands the robot until its own end.
pub fn run(
    mut supervisor: Supervisor,
    mut guard: Option<Guard>,
    mut sleep_lock: Option<SleepLock>,
    requests: &Receiver<StampedRequest>,
    news: &Receiver<SessionNews>,
    clock: &MonotonicClock,
    hardware: bool,
) -> (Supervisor, Option<Guard>) {
    let mut guard_state = GuardState::Starting;
    if guard.is_some() {
        supervisor.await_guard();
    }
    loop {
        // Before the trial that an observer has stopped is measured.
        for news in news.try_iter() {
            if let SessionNews::Stop(observer) = &news {
                supervisor.stopped_by(observer.clone(), clock.now_ns());
            }
            let (level, message) = news.line();
            supervisor.log(level, message, clock.now_ns());
        }
        supervisor.poll(clock.now_ns());
        if let Some(guard) = &mut guard {
            let before = std::mem::replace(&mut guard_state, guard.state());
            match guard_state {
                state if state == before => {}
                GuardState::Gone => supervisor.report_guard_lost(clock.now_ns()),
                state => supervisor.report_guard_silent(state == GuardState::Silent, clock.now_ns()),
            }
        }
        if sleep_lock.as_mut().is_some_and(SleepLock::lost) {
            let message =
                format!("systemd refused the sleep lock or ended it: the computer may suspend; {ALLOW_INHIBITOR}");
            supervisor.log(LogLevel::Warning, message, clock.now_ns());
        }
        supervisor.take_wanted_control(hardware);
        match requests.recv_timeout(SESSION_PERIOD) {
            Ok(request) => supervisor.handle_request(&request, clock.now_ns()),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    let begun = clock.now_ns();
    let within = |begun: u64, limit: Duration| clock.now_ns() - begun < limit.as_nanos() as u64;
    while supervisor.end_session_step(hardware) && within(begun, LONGEST_SIT_DOWN) {
        std::thread::sleep(SESSION_PERIOD);
        supervisor.poll(clock.now_ns());
    }
    if hardware {
        supervisor.stop();
        let begun = clock.now_ns();
        // Until nothing is energised. A control thread that does not report that any more damps by itself.
        while within(begun, DAMPING_AT_THE_END) || supervisor.mode().energised() && within(begun, LONGEST_STOP) {
            std::thread::sleep(SESSION_PERIOD);
            supervisor.poll(clock.now_ns());
        }
    }
    supervisor.close(clock.now_ns());
    let begun = clock.now_ns();
    while !supervisor.is_closed() && within(begun, LONGEST_CLOSE) {
        std::thread::sleep(SESSION_PERIOD);
        supervisor.poll(clock.now_ns());
    }
    (supervisor, guard)
}
