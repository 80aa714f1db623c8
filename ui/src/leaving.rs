//! The console while its session ends: heartbeat and STOP go on, no other key has an effect.

use std::time::Duration;

use quadfrog::realtime::channel::{Heartbeat, StopLatch};
use tokio::sync::mpsc::UnboundedReceiver;

use crate::connection::ConnectionMonitor;
use crate::input::{NumberedEvent, ReadEvent, TerminalEvent};

/// Period of heartbeat and keys.
const PERIOD: Duration = Duration::from_millis(10);

/// Links of a console to a session that ends.
pub struct Leaving<'a> {
    /// Heartbeat of an operator who is present.
    pub heartbeat: Option<Heartbeat>,
    /// Latch that stops the robot.
    pub stop: Option<StopLatch>,
    /// Keys that wait.
    pub inputs: &'a mut UnboundedReceiver<ReadEvent>,
}

impl Leaving<'_> {
    /// Sends a heartbeat over a living connection, sets STOP for each stop key, then waits for one period.
    pub fn pause(&mut self, connection: &ConnectionMonitor) {
        if let Some(heartbeat) = &self.heartbeat
            && connection.alive()
        {
            heartbeat.beat();
        }
        while let Ok(input) = self.inputs.try_recv() {
            if let (Some(NumberedEvent { event: TerminalEvent::Key(key), .. }), Some(stop)) = (input, &self.stop)
                && key.stops()
            {
                stop.set();
            }
        }
        std::thread::sleep(PERIOD);
    }
}
