//! Real-time settings: each is requested by itself, a denied one is a value with its remedy, and the thread runs without it.
//! Suspensions of the computer, and the lock that prevents them.

use std::ops::ControlFlow;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use nix::time::{ClockId, clock_gettime};
use quadfrog::config::Config;
use quadfrog::realtime::clock::{SuspendWatch, suspended_ns};
use quadfrog::realtime::scheduling::{RealtimeSetting, Scheduling};
use quadfrog::realtime::sleep_lock::SleepLock;
use quadfrog::realtime::system::cores;
use quadfrog::realtime::{system, thread};
use quadfrog::trial::Backend;

/// Applies the settings in a thread of its own, because they stay with the thread.
fn apply(scheduling: Scheduling) -> (Vec<RealtimeSetting>, Vec<String>) {
    let granted = std::thread::spawn(move || {
        let granted = scheduling.apply();
        let mut ticks = 0;
        thread::pace(Duration::from_millis(1), Duration::ZERO, |_| {
            ticks += 1;
            if ticks == 20 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
        .unwrap();
        (granted.granted, granted.denied.iter().map(ToString::to_string).collect())
    });
    granted.join().unwrap()
}

fn now_ns() -> u64 {
    Duration::from(clock_gettime(ClockId::CLOCK_MONOTONIC).unwrap()).as_nanos() as u64
}

/// Ticks start at the offset after whole periods of the system's clock, also after a stall with skipped periods.
#[test]
fn the_pace_keeps_its_phase() {
    let (period, phase) = (Duration::from_millis(10), Duration::from_millis(3));
    let mut planned = Vec::new();
    thread::pace(period, phase, |instant| {
        planned.push((now_ns() - instant.lateness_ns, instant.planned_ns));
        if planned.len() == 10 {
            std::thread::sleep(Duration::from_millis(333));
        }
        if planned.len() == 20 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap();
    // Least time between two readings of a clock: of ten pairs at least one is not interrupted.
    let past_phase = |calls: &[(u64, u64)]| {
        calls.iter().map(|(ns, _)| (ns - phase.as_nanos() as u64) % period.as_nanos() as u64).min().unwrap()
    };
    for calls in [&planned[..10], &planned[11..]] {
        assert!(past_phase(calls) < 2_000_000, "{} ns past the phase", past_phase(calls));
    }
    assert!(planned.iter().all(|(_, planned_ns)| planned_ns.is_multiple_of(10_000_000)), "{planned:?}");
    let (before, after) = (planned[9].1, planned[11].1);
    assert!(after - before >= 300_000_000, "the stall is not made up for: {planned:?}");
}

/// A cache warm-up starts before its tick and in time, or not at all if there is no time for it.
#[test]
fn a_warm_up_precedes_its_tick_or_is_left_out() {
    const LEAD: Duration = Duration::from_millis(6);

    #[derive(Default)]
    struct Course {
        /// The tick that comes next.
        next: u64,
        /// Ticks with a warm-up, and its time.
        warmed: Vec<(u64, u64)>,
        /// Time from the begin of each warm-up to the planned start of its tick, ns, or somewhat more: the clock is read late.
        leads: Vec<u64>,
    }
    impl thread::PeriodicTask for Course {
        fn warm_up(&mut self) {
            self.warmed.push((self.next, now_ns()));
            if self.next >= 20 {
                // Over after the tick is due: the third in a row is the last for a while.
                std::thread::sleep(LEAD + LEAD / 2);
            }
        }
        fn tick(&mut self, instant: thread::TickStart) -> ControlFlow<()> {
            if let Some((next, began_ns)) = self.warmed.last()
                && *next == self.next
            {
                self.leads.push(now_ns() - instant.lateness_ns - began_ns);
            }
            if self.next == 10 {
                // The next two are overdue when this one ends.
                std::thread::sleep(Duration::from_millis(25));
            }
            self.next += 1;
            if self.next == 40 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }
    let mut course = Course::default();
    thread::pace_with_warm_up(Duration::from_millis(10), Duration::ZERO, LEAD, &mut course).unwrap();
    let Course { warmed, leads, .. } = course;
    let warmed: Vec<u64> = warmed.iter().map(|(number, _)| *number).collect();
    assert!(warmed.is_sorted_by(|a, b| a < b), "twice before one tick: {warmed:?}");
    assert!(!warmed.contains(&11) && !warmed.contains(&12), "{warmed:?}");
    let overrun = warmed.iter().filter(|number| **number >= 20).count();
    assert!(overrun <= 3, "{warmed:?}");
    let least = leads.iter().min().expect("none of forty had a warm-up");
    assert!(*least < LEAD.as_nanos() as u64 + 2_000_000, "all begin too early: {leads:?}");
}

#[test]
fn an_ordinary_thread_asks_for_nothing() {
    let (granted, denied) = apply(Scheduling { priority: 0, core: Some(0), lock_memory: true });
    assert!(granted.is_empty() && denied.is_empty(), "{granted:?} {denied:?}");
}

#[test]
fn each_favour_is_granted_or_its_refusal_says_what_to_do() {
    let (granted, denied) = apply(Scheduling { priority: 10, core: Some(0), lock_memory: true });
    assert_eq!(granted.len() + denied.len(), 4, "{granted:?} {denied:?}");
    if system::priority_limit() >= 10 {
        assert!(granted.contains(&RealtimeSetting::Priority(10)), "{denied:?}");
    } else {
        assert!(denied.iter().any(|words| words.contains("setcap cap_sys_nice")), "{denied:?}");
    }
    if system::memlock_limit().is_some() {
        assert!(denied.iter().any(|words| words.contains("memlock unlimited")), "{denied:?}");
    }
}

#[test]
fn a_core_that_is_not_there_is_named_and_the_rest_is_still_asked_for() {
    let (granted, denied) = apply(Scheduling { priority: 10, core: Some(1000), lock_memory: false });
    let named = denied.iter().find(|words| words.starts_with("core 1000 not granted"));
    assert!(named.is_some_and(|words| words.contains("realtime.core")), "{denied:?}");
    assert_eq!(granted.len() + denied.len(), 3);
}

/// A simulator requests no real-time setting; a robot's thread requests all.
#[test]
fn the_defaults_ask_for_a_robot_alone() {
    let config = Config::load(None).unwrap();
    assert_eq!(config.scheduling(Backend::Simulator).priority, 0);
    let hardware = config.scheduling(Backend::Hardware);
    assert!(hardware.priority > 50 && hardware.lock_memory && hardware.core.is_none());
}

#[test]
fn a_suspension_is_measured_once_and_slow_readings_are_none() {
    const S: u64 = 1_000_000_000;
    let mut watch = SuspendWatch::default();
    // The upper bound is far too high: the reader was interrupted for 2 s.
    assert_eq!(watch.observe([10 * S, 12 * S]), 0);
    assert_eq!(watch.observe([10 * S, 10 * S + 100]), 0);
    assert_eq!(watch.observe([8 * S, 10 * S + 100]), 0, "interrupted again");
    assert_eq!(watch.observe([10 * S + S / 10, 13 * S]), 99, "suspended for 0.1 s, reported with the known bound");
    assert_eq!(watch.observe([10 * S + S / 10, 10 * S + S / 10 + 100]), 0);
    assert_eq!(watch.observe([70 * S, 70 * S + 100]), 59_899);
    assert_eq!(watch.observe([70 * S, 70 * S + 100]), 0);
}

#[test]
fn the_system_reports_bounds_that_do_not_fall() {
    let mut watch = SuspendWatch::default();
    for _ in 0..10_000 {
        let bounds = suspended_ns().unwrap();
        assert!(bounds[0] <= bounds[1]);
        assert_eq!(watch.observe(bounds), 0);
    }
}

/// A program in place of systemd-inhibit.
fn program(folder: &Path, script: &str) -> PathBuf {
    let path = folder.join("inhibit");
    std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path
}

#[test]
fn a_lock_is_held_until_it_is_dropped_and_a_refused_one_is_reported_once() {
    let folder = tempfile::tempdir().unwrap();
    let held = folder.path().join("held");
    let script = format!("touch {0}; cat; rm {0}", held.display());
    let mut lock = SleepLock::take(&program(folder.path(), &script)).unwrap();
    while !held.exists() {
        std::thread::yield_now();
    }
    assert!(!lock.lost());
    drop(lock);
    let mut refused = SleepLock::take(&program(folder.path(), "exit 1")).unwrap();
    while !refused.lost() {
        std::thread::yield_now();
    }
    assert!(!refused.lost());
    assert!(SleepLock::take(&folder.path().join("none")).is_err());
}

#[test]
fn lists_of_cores_are_read_as_the_kernel_writes_them() {
    assert!(cores("\n").is_empty());
    assert_eq!(cores("3\n"), [3]);
    assert_eq!(cores("0,2-4,7\n"), [0, 2, 3, 4, 7]);
}
