//! Time and space of a recorded tick: printed, not asserted. Build with `--release` to measure:
//! `cargo test --release --test recording speed -- --nocapture`. On Linux it is CPU time of this thread, so that other
//! programs do not count.

use crate::recording as support;
use std::sync::LazyLock;
use std::time::Instant;

use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::writer::Writer;
use support::*;

/// Returns the time used so far, us: CPU time of this thread if the system reports it, else wall-clock time.
fn now_us() -> f64 {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let on_processor = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = on_processor.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| START.elapsed().as_secs_f64() * 1e6, |nanoseconds| nanoseconds / 1e3)
}

#[test]
fn cost_of_a_tick() {
    let folder = tempfile::tempdir().unwrap();
    let ticks: Vec<_> = (0..30_000).map(moving_tick).collect();
    let us_per_tick = |start: f64, count: usize| (now_us() - start) / count as f64;

    for (name, ticks) in [("a rollout of 3 s", &ticks[..3000]), ("half a minute", &ticks[..])] {
        let path = folder.path().join(format!("{}.mcap", ticks.len()));
        let start = now_us();
        let mut writer = Writer::create(&path, &session(), START_UTC_NS, &[]).unwrap();
        let created = us_per_tick(start, 1);
        let start = now_us();
        ticks.iter().for_each(|tick| writer.tick(tick).unwrap());
        let written = us_per_tick(start, ticks.len());
        let start = now_us();
        writer.finish().unwrap();
        let finished = us_per_tick(start, 1);

        let start = now_us();
        let mut player = Player::open(&path).unwrap();
        let opened = us_per_tick(start, 1);
        let start = now_us();
        let played = player.by_ref().filter(|played| matches!(played, Played::Tick(_))).count();
        let read = us_per_tick(start, played);
        assert_eq!(played, ticks.len());

        let bytes = std::fs::metadata(&path).unwrap().len() as usize / ticks.len();
        println!(
            "{name}: write {written:.2} us a tick (create {:.1} ms, finish and sync {:.1} ms), {bytes} bytes a tick; \
             open {:.2} ms, play {read:.2} us a tick",
            created / 1e3,
            finished / 1e3,
            opened / 1e3,
        );
    }
}
