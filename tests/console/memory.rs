//! Memory of the console in long sessions, and the traces of trials that it keeps.
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with unsafe; this one hands everything to the system's"
)]

#[path = "../support/count_alloc.rs"]
mod count_alloc;
mod support;

use quadfrog::recording::record::{LogLevel, LogRecord, Record};
use quadfrog::telemetry::Phase;
use quadfrog::trial::{ExperimentStage, Verdict};
use support::{Console, tick, trial};

/// Time between the begins of two trials, ms.
const PERIOD_MS: u64 = 5_000;

/// The ticks of a trial for the charts: countdown, jump and 2.5 s of rest, beginning at a time.
fn jump(console: &mut Console, number: u32, begin_ms: u64) {
    for since_ms in (0..4_000).step_by(5) {
        let trial_time_s = since_ms as f64 / 1e3 - 1.0;
        let phase = match since_ms {
            1_000..1_300 => Phase::Impulse,
            1_300..1_600 => Phase::Flight,
            1_600..2_500 => Phase::Landing,
            _ => Phase::Stance,
        };
        console.tick(tick(begin_ms + since_ms, 0.1, Some((number, trial_time_s, phase))));
    }
}

/// A trial with its records, and a pause after it.
fn run(console: &mut Console, number: u32) {
    let begin_ms = u64::from(number) * PERIOD_MS;
    console.record(Record::Proposal(support::proposal(number, 0)));
    console.stage(ExperimentStage::Running, number);
    jump(console, number, begin_ms);
    console.record(Record::Trial(trial(number, Some(Verdict::ALL[number as usize % 3]), None)));
    console.record(Record::Log(LogRecord {
        level: LogLevel::Info,
        source: "session".into(),
        message: format!("trial {number}: landed and settled"),
    }));
    console.ticks(begin_ms + 4_000..begin_ms + PERIOD_MS, |_| 0.0);
    std::hint::black_box(console.draw(80, 24));
}

/// After the first minute, which fills the charts, 480 trials take at most 5 MB.
#[test]
fn memory_is_flat_over_500_trials() {
    let mut console = Console::ready();
    (0..20).for_each(|number| run(&mut console, number));
    let ((), bytes) = count_alloc::most_memory(|| (20..500).for_each(|number| run(&mut console, number)));
    println!("{:.2} MB beyond the first 20 trials", bytes as f64 / 1e6);
    assert!(bytes < 5_000_000, "{bytes} bytes");
    let kept: Vec<u32> = console.model.history.traces().collect();
    println!("traces of {} trials: {kept:?}", kept.len());
    assert!(kept.len() >= 20 && kept.contains(&499), "{kept:?}");
    // Every third trial is accepted, with a larger value than the one before.
    assert!(kept.contains(&498), "the best trial has no trace: {kept:?}");
}

/// A replay of many trials goes back to the first one: its trace is there while it plays, and grows.
#[test]
fn a_replay_that_goes_back_keeps_the_trace_of_the_trial_that_plays() {
    let mut console = Console::ready();
    (0..100).for_each(|number| run(&mut console, number));
    assert!(console.model.history.trace(0).is_none(), "this test needs more trials");
    jump(&mut console, 0, 0);
    let trace = console.model.history.trace(0).expect("the trace of the trial that plays");
    assert_eq!(trace.len(), 800);
}

/// The trace of an earlier trial has a sample in 10 ms of its jump, and one in 50 ms before and after it.
#[test]
fn an_earlier_trial_keeps_its_jump() {
    let mut console = Console::ready();
    run(&mut console, 0);
    assert_eq!(console.model.history.trace(0).map(<[_]>::len), Some(800), "the landed trial is not thinned");
    run(&mut console, 1);
    let thin = console.model.history.trace(0).expect("a trace");
    assert_eq!((thin[0].time_ns, thin[thin.len() - 1].time_ns), (0, 3_995_000_000));
    let longest_ms = |jump: bool| {
        let pairs = thin.windows(2).filter(|pair| (pair[1].phase != Phase::Stance) == jump);
        pairs.map(|pair| (pair[1].time_ns - pair[0].time_ns) / 1_000_000).max()
    };
    assert_eq!((longest_ms(true), longest_ms(false)), (Some(10), Some(50)));
    assert!(thin.len() < 250, "{}", thin.len());
}
