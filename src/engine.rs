//! Wires the threads; computes nothing.

use crate::realtime::telemetry::{Snapshot, Tick};
use crate::recording::record::Stamped;
use crate::session::intent::Intent;

/// What a screen holds of a running engine: it draws from it and asks through it, and decides nothing.
pub struct Handle {}

impl Handle {
    /// Stops the robot: damping in the next tick, whatever the mode. Never waits, never fails.
    pub fn stop(&self) {}

    /// The screen is alive; to be called at least ten times a second.
    pub fn beat(&self) {}

    /// Wishes something. The answer comes as a `CommandRecord`.
    pub fn wish(&self, _intent: Intent) {}

    /// The newest tick and counters.
    pub fn snapshot(&mut self) -> Snapshot {
        Snapshot::default()
    }

    /// The next of the ticks for charts, 200 a second.
    pub fn next_tick(&mut self) -> Option<Tick> {
        None
    }

    /// The next record that the screen has not seen.
    pub fn next_record(&mut self) -> Option<Stamped> {
        None
    }

    /// Sits the robot down if it stands, closes the recording and ends the threads.
    pub fn shutdown(self) {}
}
