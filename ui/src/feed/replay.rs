//! Playback of a recording: speeds, single steps, jumps between markers.

use std::collections::VecDeque;

use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::{Record, Stamped};
use quadfrog::telemetry::{Counters, Snapshot};

use crate::message::{Msg, ReplayCommand, ReplayStatus};

/// Ticks per tick of the charts: 200 per second, as live.
const SHOWN_EVERY: u64 = quadfrog::realtime::channel::SHOWN_EVERY;
/// Length of a single step: one tick of the charts.
const STEP_NS: u64 = SHOWN_EVERY * 1_000_000;
/// Length of the past that fills the charts after a jump.
const PAST_NS: u64 = 8_000_000_000;
/// Speeds relative to the recording.
const SPEEDS: [f64; 9] = [0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];

pub struct ReplayFeed {
    player: Player,
    playing: bool,
    /// Index in [`SPEEDS`].
    speed: usize,
    time_ns: u64,
    /// Items read that are later than `time_ns`.
    next: VecDeque<Played>,
    snapshot: Snapshot,
    /// Messages of a jump or a step that were not taken yet.
    jumped: Vec<Msg>,
}

impl ReplayFeed {
    pub fn new(player: Player) -> ReplayFeed {
        let mut replay = ReplayFeed {
            player,
            playing: true,
            speed: SPEEDS.iter().position(|speed| *speed == 1.0).unwrap_or(0),
            time_ns: 0,
            next: VecDeque::new(),
            snapshot: Snapshot::default(),
            jumped: Vec::new(),
        };
        replay.jump(0);
        replay
    }

    pub fn control_replay(&mut self, command: ReplayCommand) {
        match command {
            ReplayCommand::PlayPause => {
                if self.time_ns >= self.player.duration_ns() {
                    self.jump(0);
                    self.playing = true;
                } else {
                    self.playing = !self.playing;
                }
            }
            ReplayCommand::Slower => self.speed = self.speed.saturating_sub(1),
            ReplayCommand::Faster => self.speed = (self.speed + 1).min(SPEEDS.len() - 1),
            ReplayCommand::StepForward => {
                self.playing = false;
                let mut messages = Vec::new();
                self.advance(STEP_NS, &mut messages);
                self.jumped.extend(messages);
            }
            ReplayCommand::StepBack => {
                self.playing = false;
                self.jump(self.time_ns.saturating_sub(STEP_NS));
            }
            ReplayCommand::NextMarker => {
                let next = self.player.markers().iter().map(|marker| marker.time_ns).find(|time| *time > self.time_ns);
                self.jump(next.unwrap_or(self.player.duration_ns()));
            }
            ReplayCommand::PreviousMarker => {
                // During playback a marker passed less than 1 s ago is skipped.
                let before = self.time_ns.saturating_sub(if self.playing { 1_000_000_000 } else { 0 });
                let markers = self.player.markers().iter().rev();
                let previous = markers.map(|marker| marker.time_ns).find(|time| *time < before);
                self.jump(previous.unwrap_or(0));
            }
        }
    }

    /// Appends the messages of `elapsed_ns` of real time.
    pub fn poll(&mut self, elapsed_ns: u64, messages: &mut Vec<Msg>) {
        messages.append(&mut self.jumped);
        if self.playing {
            self.advance((elapsed_ns as f64 * SPEEDS[self.speed]) as u64, messages);
            if self.time_ns >= self.player.duration_ns() {
                self.playing = false;
            }
        }
        messages.push(Msg::Snapshot(Box::new(self.snapshot)));
        messages.push(Msg::Replay(ReplayStatus {
            playing: self.playing,
            speed: SPEEDS[self.speed],
            time_ns: self.time_ns,
            duration_ns: self.player.duration_ns(),
        }));
    }

    /// Plays the next `by_ns` of the recording.
    fn advance(&mut self, by_ns: u64, messages: &mut Vec<Msg>) {
        self.time_ns = (self.time_ns + by_ns).min(self.player.duration_ns());
        loop {
            let played = match self.next.pop_front().or_else(|| self.player.next()) {
                Some(played) if played.time_ns() <= self.time_ns => played,
                Some(later) => {
                    self.next.push_front(later);
                    return;
                }
                None => return,
            };
            self.show(played, messages);
        }
    }

    fn show(&mut self, played: Played, messages: &mut Vec<Msg>) {
        match played {
            Played::Tick(tick) => {
                self.snapshot.tick = tick;
                if tick.number % SHOWN_EVERY == 0 {
                    messages.push(Msg::Tick(Box::new(tick)));
                }
            }
            Played::Record(stamped) => {
                if let Record::Counters(counters) = stamped.record {
                    self.snapshot.counters = counters;
                }
                messages.push(Msg::Record(stamped));
            }
        }
    }

    /// Jumps to a time: replays all events before it, and the ticks of the last seconds for the charts.
    fn jump(&mut self, time_ns: u64) {
        let time_ns = time_ns.min(self.player.duration_ns());
        let from_ns = time_ns.saturating_sub(PAST_NS);
        let mut messages = vec![Msg::Rewound];
        messages.extend(self.log_until(from_ns).map(Msg::Record));
        self.snapshot.counters = Counters::default();
        self.next.clear();
        self.player.seek(from_ns);
        self.time_ns = from_ns;
        self.advance(time_ns - from_ns, &mut messages);
        self.jumped = messages;
    }

    /// Returns all events before a time; the model of the session is folded from them.
    fn log_until(&self, time_ns: u64) -> impl Iterator<Item = Stamped> + '_ {
        self.player.events().iter().take_while(move |event| event.time_ns < time_ns).cloned()
    }
}
