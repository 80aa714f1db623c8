//! The source of the screen's messages: a running engine or a recording. Both give the same messages.

pub mod replay;

use quadfrog::engine::Handle;
use quadfrog::realtime::channel::{Heartbeat, StopLatch};
use quadfrog::recording::player::Player;
use quadfrog::session::operator_request::OperatorRequest;

use crate::message::{Msg, ReplayCommand};
use replay::ReplayFeed;

/// Maximum number of records, and of ticks, per call of [`Feed::take`]: bounds the delay of the next key.
const BATCH: usize = 4096;

/// A running engine or a recording.
pub enum Feed {
    /// A running engine.
    Live(Box<Handle>),
    /// A recording, which ignores requests.
    Replay(Box<ReplayFeed>),
}

impl Feed {
    /// Creates the feed of a running engine.
    pub fn live(handle: Handle) -> Feed {
        Feed::Live(Box::new(handle))
    }

    /// Creates the feed of a recording, playing from the start.
    pub fn replay(player: Player) -> Feed {
        Feed::Replay(Box::new(ReplayFeed::new(player)))
    }

    /// Sends the operator heartbeat.
    pub fn beat(&self) {
        if let Feed::Live(handle) = self {
            handle.send_heartbeat();
        }
    }

    /// Stops the robot.
    pub fn stop(&self) {
        if let Feed::Live(handle) = self {
            handle.stop();
        }
    }

    /// Returns the stop latch, for threads that stop the robot without the loop; none in a replay.
    pub fn stop_latch(&self) -> Option<StopLatch> {
        match self {
            Feed::Live(handle) => Some(handle.stop_latch()),
            Feed::Replay(_) => None,
        }
    }

    /// Returns the operator heartbeat, for use while the session ends; none in a replay.
    pub fn heartbeat(&self) -> Option<Heartbeat> {
        match self {
            Feed::Live(handle) => Some(handle.heartbeat()),
            Feed::Replay(_) => None,
        }
    }

    /// Sends a request to the session.
    pub fn request(&self, request: OperatorRequest) {
        if let Feed::Live(handle) = self {
            handle.request(request);
        }
    }

    /// Controls the replay.
    pub fn command(&mut self, command: ReplayCommand) {
        if let Feed::Replay(replay) = self {
            replay.command(command);
        }
    }

    /// Returns the messages since the last call, `elapsed_ns` ago, oldest first.
    pub fn take(&mut self, elapsed_ns: u64) -> Vec<Msg> {
        let mut messages = Vec::new();
        match self {
            Feed::Live(handle) => {
                // Records before ticks: a tick may belong to a trial that a record begins.
                messages.extend(std::iter::from_fn(|| handle.next_record()).take(BATCH).map(Msg::Record));
                messages.extend(
                    std::iter::from_fn(|| handle.next_tick()).take(BATCH).map(|tick| Msg::Tick(Box::new(tick))),
                );
                messages.push(Msg::Snapshot(Box::new(handle.snapshot())));
                messages.extend(handle.recorder().map(Msg::Recorder));
            }
            Feed::Replay(replay) => replay.take(elapsed_ns, &mut messages),
        }
        messages
    }

    /// Ends the session: sits the robot down and closes the files.
    pub fn shutdown(self) {
        if let Feed::Live(handle) = self {
            handle.shutdown();
        }
    }
}
