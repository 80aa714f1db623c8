//! What is asked of the operating system: each favour by itself, what is not granted is a value with a way out, and the thread
//! runs all the same.

use std::ops::ControlFlow;
use std::time::Duration;

use nix::time::{ClockId, clock_gettime};
use quadfrog::config::Config;
use quadfrog::realtime::scheduling::{RealtimeSetting, Scheduling};
use quadfrog::realtime::{system, thread};
use quadfrog::trial::Backend;

/// In a thread of its own: a priority stays with the thread that asked for it.
fn apply(scheduling: Scheduling) -> (Vec<RealtimeSetting>, Vec<String>) {
    let granted = std::thread::spawn(move || {
        let granted = scheduling.apply();
        let mut ticks = 0;
        thread::pace(Duration::from_millis(1), Duration::ZERO, |_| {
            ticks += 1;
            if ticks == 20 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
        .unwrap();
        (granted.favours, granted.shortfalls.iter().map(ToString::to_string).collect())
    });
    granted.join().unwrap()
}

fn now_ns() -> u64 {
    Duration::from(clock_gettime(ClockId::CLOCK_MONOTONIC).unwrap()).as_nanos() as u64
}

/// Calls come a phase after whole periods of the system's clock, also after a stall that was not made up for.
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
    // What passes between two readings of a clock, at best; of ten calls one is not interrupted there.
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

/// A rehearsal comes before its tick and in time, and not at all where the time for it has passed.
#[test]
fn a_rehearsal_comes_before_its_tick_or_not_at_all() {
    const LEAD: Duration = Duration::from_millis(6);

    #[derive(Default)]
    struct Course {
        /// The tick that comes next.
        next: u64,
        /// Which were rehearsed, and when.
        rehearsed: Vec<(u64, u64)>,
        /// How long before its tick was due each rehearsal began, ns, or somewhat more: the clock is read late.
        leads: Vec<u64>,
    }
    impl thread::Paced for Course {
        fn rehearse(&mut self) {
            self.rehearsed.push((self.next, now_ns()));
            if self.next >= 20 {
                // Over after the tick is due: the third in a row is the last for a while.
                std::thread::sleep(LEAD + LEAD / 2);
            }
        }
        fn tick(&mut self, instant: thread::Instant) -> ControlFlow<()> {
            if let Some((next, began_ns)) = self.rehearsed.last()
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
    thread::pace_rehearsed(Duration::from_millis(10), Duration::ZERO, LEAD, &mut course).unwrap();
    let Course { rehearsed, leads, .. } = course;
    let rehearsed: Vec<u64> = rehearsed.iter().map(|(number, _)| *number).collect();
    assert!(rehearsed.is_sorted_by(|a, b| a < b), "twice before one tick: {rehearsed:?}");
    assert!(!rehearsed.contains(&11) && !rehearsed.contains(&12), "{rehearsed:?}");
    let overrun = rehearsed.iter().filter(|number| **number >= 20).count();
    assert!(overrun <= 3, "{rehearsed:?}");
    let least = leads.iter().min().expect("none of forty was rehearsed");
    assert!(*least < LEAD.as_nanos() as u64 + 2_000_000, "all begin too early: {leads:?}");
}

#[test]
fn an_ordinary_thread_asks_for_nothing() {
    let (favours, shortfalls) = apply(Scheduling { priority: 0, core: Some(0), lock_memory: true });
    assert!(favours.is_empty() && shortfalls.is_empty(), "{favours:?} {shortfalls:?}");
}

#[test]
fn each_favour_is_granted_or_its_refusal_says_what_to_do() {
    let (favours, shortfalls) = apply(Scheduling { priority: 10, core: Some(0), lock_memory: true });
    assert_eq!(favours.len() + shortfalls.len(), 4, "{favours:?} {shortfalls:?}");
    if system::priority_limit() >= 10 {
        assert!(favours.contains(&RealtimeSetting::Priority(10)), "{shortfalls:?}");
    } else {
        assert!(shortfalls.iter().any(|words| words.contains("setcap cap_sys_nice")), "{shortfalls:?}");
    }
    if system::memlock_limit().is_some() {
        assert!(shortfalls.iter().any(|words| words.contains("memlock unlimited")), "{shortfalls:?}");
    }
}

#[test]
fn a_core_that_is_not_there_is_named_and_the_rest_is_still_asked_for() {
    let (favours, shortfalls) = apply(Scheduling { priority: 10, core: Some(1000), lock_memory: false });
    let named = shortfalls.iter().find(|words| words.starts_with("core 1000 not granted"));
    assert!(named.is_some_and(|words| words.contains("realtime.core")), "{shortfalls:?}");
    assert_eq!(favours.len() + shortfalls.len(), 3);
}

/// A simulator never holds a core against the rest of a desktop; a robot's thread asks for all of it.
#[test]
fn the_defaults_ask_for_a_robot_alone() {
    let config = Config::load(None).unwrap();
    assert_eq!(config.scheduling(Backend::Simulator).priority, 0);
    let hardware = config.scheduling(Backend::Hardware);
    assert!(hardware.priority > 50 && hardware.lock_memory && hardware.core.is_none());
}
