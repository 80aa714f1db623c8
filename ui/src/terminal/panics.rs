//! A panic in any thread: STOP, then the terminal, then the report.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use quadfrog::realtime::channel::StopLatch;

use super::restore::{LEAVE_TIMEOUT, restore};
use crate::output;

/// Name of the engine's control thread.
const CONTROL: &str = "control";
/// Time limit of a report to a terminal that does not read, its restoration included.
const REPORT_TIMEOUT: Duration = LEAVE_TIMEOUT.saturating_mul(4);

/// STOP latch that a panic in any thread sets, before anything else.
static STOP: Mutex<Option<StopLatch>> = Mutex::new(None);
/// The first panic.
static PANIC: Mutex<Option<Panic>> = Mutex::new(None);
/// Notified when the first panic is reported.
static REPORTED: Condvar = Condvar::new();

struct Panic {
    thread: String,
    reported: bool,
}

/// Makes a panic in any thread set this latch first; none if there is no robot to stop.
pub fn stop_on_panic(stop: Option<StopLatch>) {
    *STOP.lock().unwrap_or_else(PoisonError::into_inner) = stop;
}

/// Returns the name of the first thread that panicked, if any; its report may not be printed yet.
pub fn panicked() -> Option<String> {
    first_panic().as_ref().map(|panic| panic.thread.clone())
}

/// Waits until the terminal is restored and the first panic reported on it, at most [`REPORT_TIMEOUT`]: the terminal may not read. A
/// program that ends earlier cuts the report off.
pub fn wait_for_report() {
    let waits = |panic: &mut Option<Panic>| panic.as_ref().is_some_and(|panic| !panic.reported);
    // Either way the program ends now.
    let _ = REPORTED.wait_timeout_while(first_panic(), REPORT_TIMEOUT, waits);
}

fn first_panic() -> MutexGuard<'static, Option<Panic>> {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes a panic in any thread set STOP, restore the terminal and print its report there, in this order.
pub fn install_hook() {
    static INSTALLED: AtomicBool = AtomicBool::new(false);
    if INSTALLED.swap(true, Ordering::AcqRel) {
        return;
    }
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        // First: the report and the unwinding take time, during which the robot would move without control.
        if let Some(stop) = &*STOP.lock().unwrap_or_else(PoisonError::into_inner) {
            stop.set();
        }
        let thread = std::thread::current();
        let thread = thread.name().unwrap_or("unnamed").to_owned();
        let is_control = thread == CONTROL;
        // Before the restoration, after which the loop would take the terminal back from what looks like a shell.
        first_panic().get_or_insert(Panic { thread, reported: false });
        if is_control {
            // The control thread goes on to damp the robot and must not wait for the terminal: another thread reports.
            let text = format!("{info}\n");
            let _ = std::thread::Builder::new().name("report".into()).spawn(move || print(|| output::message(&text)));
        } else {
            print(|| report(info));
        }
    }));
}

/// Restores the terminal and prints a report on it. Where two threads panic, the second waits for the first.
fn print(report: impl FnOnce()) {
    static PRINTING: Mutex<()> = Mutex::new(());
    let _printing = PRINTING.lock().unwrap_or_else(PoisonError::into_inner);
    restore();
    report();
    if let Some(panic) = &mut *first_panic() {
        panic.reported = true;
    }
    REPORTED.notify_all();
}
