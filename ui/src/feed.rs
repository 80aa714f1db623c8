//! Source of the screen's messages: a running engine or a recording. Both send the same messages.

pub mod replay;

use quadfrog::engine::Handle;
use quadfrog::realtime::channel::{Heartbeat, StopLatch};
use quadfrog::recording::player::Player;
use quadfrog::session::operator_request::OperatorRequest;

use crate::message::{Msg, ReplayCommand};
use replay::ReplayFeed;

/// Messages taken at once; the rest waits for the next call, so that keys are handled in between.
const BATCH: usize = 4096;

/// A running engine or a recording.
pub enum Feed {
    /// A running engine.
    Live(Box<Handle>),
    /// A recording; nothing can be sent to it.
    Replay(Box<ReplayFeed>),
}

impl Feed {
    /// The feed of a running engine.
    pub fn live(handle: Handle) -> Feed {
        Feed::Live(Box::new(handle))
    }

    /// The feed of a recording; it plays from the start.
    pub fn replay(player: Player) -> Feed {
        Feed::Replay(Box::new(ReplayFeed::new(player)))
    }

    /// Sends a heartbeat.
    pub fn beat(&self) {
        if let Feed::Live(handle) = self {
            handle.beat();
        }
    }

    /// Stops the robot.
    pub fn stop(&self) {
        if let Feed::Live(handle) = self {
            handle.stop();
        }
    }

    /// The stop latch itself, for threads that must be able to stop without the loop; none in a replay.
    pub fn stop_latch(&self) -> Option<StopLatch> {
        match self {
            Feed::Live(handle) => Some(handle.stop_latch()),
            Feed::Replay(_) => None,
        }
    }

    /// The heartbeat's sender, for the time when the session is being ended; none in a replay.
    pub fn heartbeat(&self) -> Option<Heartbeat> {
        match self {
            Feed::Live(handle) => Some(handle.heartbeat()),
            Feed::Replay(_) => None,
        }
    }

    /// Sends a request to the session; none in a replay.
    pub fn request(&self, intent: OperatorRequest) {
        if let Feed::Live(handle) = self {
            handle.wish(intent);
        }
    }

    /// Controls the replay; nothing in a live session.
    pub fn command(&mut self, command: ReplayCommand) {
        if let Feed::Replay(replay) = self {
            replay.command(command);
        }
    }

    /// Returns the messages since the last call, `elapsed_ns` ago, oldest first.
    pub fn take(&mut self, elapsed_ns: u64) -> Vec<Msg> {
        let mut news = Vec::new();
        match self {
            Feed::Live(handle) => {
                // Records before ticks: a tick may belong to a trial that a record opens.
                news.extend(std::iter::from_fn(|| handle.next_record()).take(BATCH).map(Msg::Record));
                news.extend(
                    std::iter::from_fn(|| handle.next_tick()).take(BATCH).map(|tick| Msg::Tick(Box::new(tick))),
                );
                news.push(Msg::Snapshot(Box::new(handle.snapshot())));
                news.extend(handle.recorder().map(Msg::Recorder));
            }
            Feed::Replay(replay) => replay.take(elapsed_ns, &mut news),
        }
        news
    }

    /// Ends the session: the robot sits down, the files are closed.
    pub fn shutdown(self) {
        if let Feed::Live(handle) = self {
            handle.shutdown();
        }
    }
}
