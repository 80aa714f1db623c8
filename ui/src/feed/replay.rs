//! Playing a recording at a speed, step by step, from marker to marker.

use std::collections::VecDeque;

use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::{Record, Stamped};
use quadfrog::telemetry::{Counters, Snapshot};

use crate::message::{Msg, ReplayCommand, ReplayStatus};

/// Ticks per sample of the charts: 200 samples a second, as live.
const SHOWN_EVERY: u64 = quadfrog::realtime::channel::SHOWN_EVERY;
/// Ticks are 1 ms apart; a step moves by one tick of the charts.
const STEP_NS: u64 = SHOWN_EVERY * 1_000_000;
/// Charts are filled with this much of the past after a jump, ns.
const PAST_NS: u64 = 8_000_000_000;
/// Speeds that can be chosen.
const SPEEDS: [f64; 9] = [0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];

/// A recording being played.
pub struct ReplayFeed {
    player: Player,
    file: String,
    playing: bool,
    /// Index of the speed.
    speed: usize,
    time_ns: u64,
    /// Read, later than the present.
    next: VecDeque<Played>,
    snapshot: Snapshot,
    /// Messages of a jump, not yet taken.
    jumped: Vec<Msg>,
}

impl ReplayFeed {
    /// A replay that plays from the start.
    pub fn new(player: Player) -> ReplayFeed {
        let mut replay = ReplayFeed {
            file: player.session().recording.clone(),
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

    /// Carries out a command.
    pub fn command(&mut self, command: ReplayCommand) {
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
                let mut news = Vec::new();
                self.advance(STEP_NS, &mut news);
                self.jumped.extend(news);
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
                // While it plays, the marker just passed is skipped.
                let before = self.time_ns.saturating_sub(if self.playing { 1_000_000_000 } else { 0 });
                let markers = self.player.markers().iter().rev();
                let previous = markers.map(|marker| marker.time_ns).find(|time| *time < before);
                self.jump(previous.unwrap_or(0));
            }
        }
    }

    /// Appends the messages of `elapsed_ns` of the operator's time.
    pub fn take(&mut self, elapsed_ns: u64, news: &mut Vec<Msg>) {
        news.append(&mut self.jumped);
        if self.playing {
            self.advance((elapsed_ns as f64 * SPEEDS[self.speed]) as u64, news);
            if self.time_ns >= self.player.duration_ns() {
                self.playing = false;
            }
        }
        news.push(Msg::Snapshot(Box::new(self.snapshot)));
        news.push(Msg::Replay(ReplayStatus {
            file: self.file.clone(),
            playing: self.playing,
            speed: SPEEDS[self.speed],
            time_ns: self.time_ns,
            duration_ns: self.player.duration_ns(),
        }));
    }

    /// Plays up to a later time.
    fn advance(&mut self, by_ns: u64, news: &mut Vec<Msg>) {
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
            self.show(played, news);
        }
    }

    fn show(&mut self, played: Played, news: &mut Vec<Msg>) {
        match played {
            Played::Tick(tick) => {
                self.snapshot.tick = tick;
                if tick.number % SHOWN_EVERY == 0 {
                    news.push(Msg::Tick(Box::new(tick)));
                }
            }
            Played::Record(stamped) => {
                if let Record::Counters(counters) = stamped.record {
                    self.snapshot.counters = counters;
                }
                news.push(Msg::Record(stamped));
            }
        }
    }

    /// Jumps to a time: the state of the session then, and the seconds before it for the charts.
    fn jump(&mut self, time_ns: u64) {
        let time_ns = time_ns.min(self.player.duration_ns());
        let from_ns = time_ns.saturating_sub(PAST_NS);
        let mut news = vec![Msg::Rewound];
        news.extend(self.log_until(from_ns).map(Msg::Record));
        self.snapshot.counters = Counters::default();
        self.next.clear();
        self.player.seek(from_ns);
        self.time_ns = from_ns;
        self.advance(time_ns - from_ns, &mut news);
        self.jumped = news;
    }

    /// All events before a time: the model's session is their fold.
    fn log_until(&self, time_ns: u64) -> impl Iterator<Item = Stamped> + '_ {
        self.player.events().iter().take_while(move |event| event.time_ns < time_ns).cloned()
    }
}
