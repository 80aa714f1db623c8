//! The source of the screen's messages: a running engine or a recording. Both give the same messages.

mod beside;
mod earlier;
mod rejudge;
mod replay;

use std::path::PathBuf;

use quadfrog::engine::{EngineHandle, Observer};
use quadfrog::realtime::channel::StopLatch;
use quadfrog::recording::timeline::Timeline;

use crate::message::{Msg, ReplayCommand};
pub use earlier::read_best_jump;
pub use replay::DamageWatch;
use replay::ReplayFeed;

/// Maximum number of records, and of ticks, per call of [`Feed::poll`]: bounds the delay of the next key.
const BATCH: usize = 4096;

/// A running engine or a recording.
#[expect(missing_docs, reason = "the names say the rest")]
pub enum Feed {
    Live(Box<EngineHandle>),
    Replay(Box<ReplayFeed>),
}

impl Feed {
    /// Creates the feed of a running engine.
    pub fn live(handle: EngineHandle) -> Feed {
        Feed::Live(Box::new(handle))
    }

    /// Creates the feed of a recording, playing from the start.
    pub fn replay(recording: impl Into<Timeline>) -> Feed {
        Feed::Replay(Box::new(ReplayFeed::new(recording.into(), None, false)))
    }

    /// Creates the feed of a recording with another one beside it: from its present end if it is being written.
    pub fn beside(recording: Timeline, second: Option<Timeline>, follow: bool) -> Feed {
        Feed::Replay(Box::new(ReplayFeed::new(recording, second, follow)))
    }

    /// Creates the feed of a recording that is being written, playing from its present end.
    pub fn follow(recording: impl Into<Timeline>) -> Feed {
        Feed::Replay(Box::new(ReplayFeed::new(recording.into(), None, true)))
    }

    /// Creates the feed of a session that another process runs, from its recording, with STOP.
    pub fn attached(recording: Timeline, observer: Observer) -> Feed {
        Feed::Replay(Box::new(ReplayFeed::new(recording, None, true).with_observer(observer)))
    }

    /// Returns the latch that stops the robot; none in the replay of a recording.
    pub fn stop_latch(&self) -> Option<StopLatch> {
        match self {
            Feed::Live(handle) => Some(handle.stop_latch()),
            Feed::Replay(replay) => replay.stop_latch(),
        }
    }

    /// Returns the damage of the recording that a replay has found, also after the feed has ended.
    pub fn damage(&self) -> DamageWatch {
        match self {
            Feed::Live(_) => DamageWatch::default(),
            Feed::Replay(replay) => replay.damage(),
        }
    }

    /// Returns the running engine; none in a replay, which nothing commands.
    pub fn handle(&self) -> Option<&EngineHandle> {
        match self {
            Feed::Live(handle) => Some(handle),
            Feed::Replay(_) => None,
        }
    }

    /// Controls the replay.
    pub fn control_replay(&mut self, command: ReplayCommand) {
        if let Feed::Replay(replay) = self {
            replay.control_replay(command);
        }
    }

    /// Judges the trials of a replay again by the configuration in a folder, or by the defaults; the results follow as messages.
    pub fn rejudge(&mut self, folder: Option<PathBuf>) {
        if let Feed::Replay(replay) = self {
            replay.rejudge(folder);
        }
    }

    /// Ends judging the trials again.
    pub fn end_rejudge(&mut self) {
        if let Feed::Replay(replay) = self {
            replay.end_rejudge();
        }
    }

    /// Returns the messages since the last call, `elapsed_ns` ago, oldest first.
    pub fn poll(&mut self, elapsed_ns: u64) -> Vec<Msg> {
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
                messages.extend(handle.live().map(Msg::Viewers));
                messages.extend(handle.observers().map(Msg::Observers));
                messages.push(Msg::Storage(handle.storage_wait()));
            }
            Feed::Replay(replay) => replay.poll(elapsed_ns, &mut messages),
        }
        messages
    }

    /// Takes no further request, whereupon the session begins to end: a standing robot sits down.
    pub fn end_requests(&mut self) {
        if let Feed::Live(handle) = self {
            handle.end_requests();
        }
    }

    /// Whether the session has ended after [`Feed::end_requests`]; of a recording there is none.
    pub fn session_has_ended(&self) -> bool {
        self.handle().is_none_or(EngineHandle::session_has_ended)
    }

    /// Ends the session: sits the robot down and closes the files. An observer of a session leaves it once its STOP is confirmed, or
    /// after 1 s.
    pub fn shutdown(self) {
        if let Feed::Live(handle) = self {
            handle.shutdown();
        }
    }
}
