//! An operator's console on a running engine: heartbeats, requests and the records that it receives.
#![allow(dead_code, reason = "each test uses its own part")]

use std::time::{Duration, Instant};

use quadfrog::engine::{self, EngineHandle, Options};
use quadfrog::recording::record::{Record, Stamped};
use quadfrog::telemetry::Mode;
use quadfrog::trial::ExperimentStage;

/// A console that sends heartbeats and presses no key by itself.
pub struct AttachedConsole {
    pub handle: EngineHandle,
    /// Records so far, without the counters.
    pub records: Vec<Record>,
}

impl AttachedConsole {
    /// Starts an engine.
    pub fn start(options: Options) -> AttachedConsole {
        AttachedConsole { handle: engine::start(options).unwrap(), records: Vec::new() }
    }

    /// Waits until `wanted`; the time-out `most` only ends a test that fails.
    pub fn until_within(&mut self, most: Duration, what: &str, wanted: impl Fn(&AttachedConsole) -> bool) {
        let end = Instant::now() + most;
        while !wanted(self) {
            let tail = &self.records[self.records.len().saturating_sub(8)..];
            assert!(Instant::now() < end, "{what} did not happen: {tail:#?}");
            self.step();
        }
    }

    /// Waits for at most a minute.
    pub fn until(&mut self, what: &str, wanted: impl Fn(&AttachedConsole) -> bool) {
        self.until_within(Duration::from_secs(60), what, wanted);
    }

    pub fn pass(&mut self, time: Duration) {
        let end = Instant::now() + time;
        while Instant::now() < end {
            self.step();
        }
    }

    pub fn step(&mut self) {
        self.handle.send_heartbeat();
        while let Some(Stamped { record, .. }) = self.handle.next_record() {
            if !matches!(record, Record::Counters(_)) {
                self.records.push(record);
            }
        }
        while self.handle.next_tick().is_some() {}
        std::thread::sleep(Duration::from_millis(5));
    }

    /// Mode after the last change; none before the first.
    pub fn mode(&self) -> Option<Mode> {
        self.records.iter().rev().find_map(|r| if let Record::Transition(t) = r { Some(t.to) } else { None })
    }

    pub fn stage(&self) -> Option<ExperimentStage> {
        self.records.iter().rev().find_map(|r| if let Record::Stage(s) = r { Some(s.stage) } else { None })
    }
}
