//! Where the screen's news comes from: a running engine or a recording. Both give the same messages.

pub mod replay;

use quadfrog::engine::Handle;
use quadfrog::realtime::channel::{Heartbeat, StopLatch};
use quadfrog::recording::player::Player;
use quadfrog::recording::record::Stamped;
use quadfrog::session::operator_request::OperatorRequest;

use crate::update::{Msg, ReplayCommand};
use replay::Replay;

/// Messages taken at once; more wait for the next time, so that keys are never kept waiting.
const BATCH: usize = 4096;

/// A running engine or a recording.
pub enum Feed {
    /// A running engine.
    Live(Box<Handle>),
    /// A recording; nothing can be sent to it.
    Replay(Box<Replay>),
}

impl Feed {
    /// The feed of a running engine.
    pub fn live(handle: Handle) -> Feed {
        Feed::Live(Box::new(handle))
    }

    /// The feed of a recording; it plays from the start.
    pub fn replay(player: Player) -> Feed {
        Feed::Replay(Box::new(Replay::new(player)))
    }

    /// The screen is alive.
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

    /// The stop latch itself, for threads that must be able to stop without the loop; none in a replay.
    pub fn stop_latch(&self) -> Option<StopLatch> {
        match self {
            Feed::Live(handle) => Some(handle.stop_latch()),
            Feed::Replay(_) => None,
        }
    }

    /// The sign of life itself, for the time when the session is being ended; none in a replay.
    pub fn heartbeat(&self) -> Option<Heartbeat> {
        match self {
            Feed::Live(handle) => Some(handle.heartbeat()),
            Feed::Replay(_) => None,
        }
    }

    /// Asks the session; a recording is not asked.
    pub fn wish(&self, intent: OperatorRequest) {
        if let Feed::Live(handle) = self {
            handle.request(intent);
        }
    }

    /// Moves the replay; a live session does not move.
    pub fn command(&mut self, command: ReplayCommand) {
        if let Feed::Replay(replay) = self {
            replay.command(command);
        }
    }

    /// What is new since the last call, `elapsed_ns` later, oldest first.
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

    /// Ends the session and returns its last records: the robot sits down, the files are closed.
    pub fn shutdown(self) -> Vec<Stamped> {
        match self {
            Feed::Live(handle) => handle.shutdown(),
            Feed::Replay(_) => Vec::new(),
        }
    }
}
