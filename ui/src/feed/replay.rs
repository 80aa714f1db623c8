//! Playback of a recording: speeds, slow motion, loops, single steps, jumps to times, trials, falls and faults.

use std::collections::{BTreeSet, VecDeque};
use std::path::PathBuf;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, PoisonError};

use quadfrog::engine::Observer;
use quadfrog::realtime::channel::{SHOWN_EVERY, StopLatch};
use quadfrog::recording::player::{Damage, Marker, MarkerKind, Played};
use quadfrog::recording::record::{LogLevel, LogRecord, Record, Stamped};
use quadfrog::recording::timeline::{Timeline, TrialRun};
use quadfrog::telemetry::{Phase, Snapshot};

use super::beside::TrialPair;
use super::rejudge::rejudge;
use crate::message::{Msg, RejudgeNews, ReplayCommand, ReplayStatus, ReplayStep, ReplayTimeline};
use crate::model::trials::Trials;

/// Most results of judging again per call.
const BATCH: usize = 256;
const TICK_NS: u64 = 1_000_000;
const FRAME_NS: u64 = SHOWN_EVERY * TICK_NS;
/// Length of the past that fills the charts after a jump.
const PAST_NS: u64 = 8_000_000_000;
/// Speeds relative to the recording.
const SPEEDS: [f64; 9] = [0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
/// Speed of impulse and flight in slow motion, relative to the chosen one: a jump of 0.6 s takes 5 s.
const SLOW_MOTION: f64 = 0.125;
/// Time before the impulse at which a loop begins: the robot stands still.
const BEFORE_IMPULSE_NS: u64 = 500_000_000;
/// Period of looking for what was appended to a followed file.
const FOLLOW_NS: u64 = 250_000_000;

/// Period in which a recording grows while it is written, and the distance to its end from which playback at the end catches up.
const FLUSH_NS: u64 = 1_000_000_000;
const MOST_BEHIND_NS: u64 = 2 * FLUSH_NS;

/// Descriptions of the damage found so far, file by file; they outlive the feed.
pub type DamageWatch = Arc<Mutex<Vec<Damage>>>;

pub struct ReplayFeed {
    recording: Timeline,
    whole: ReplayTimeline,
    playing: bool,
    /// Index in [`SPEEDS`].
    speed: usize,
    slow_motion: bool,
    looping: Option<TrialRun>,
    /// Time until the next look at a followed file, ns; none for one that is not followed.
    follow_in_ns: Option<u64>,
    /// Time since the followed file grew, ns.
    silent_ns: u64,
    /// Whether a followed file is played at its end: a stall of its writer is caught up.
    at_present: bool,
    /// The end of a session that another process runs.
    observer: Option<Observer>,
    time_ns: u64,
    /// Items read that are later than `time_ns`.
    next: VecDeque<Played>,
    snapshot: Snapshot,
    /// Begins of the lost parts that are in the log.
    logged: BTreeSet<u64>,
    damage: DamageWatch,
    pair: TrialPair,
    /// Results of judging the trials again.
    rejudged: Option<Receiver<RejudgeNews>>,
    /// Messages of a jump or a step that were not taken yet.
    jumped: Vec<Msg>,
}

impl ReplayFeed {
    /// Creates the feed of a recording; `second` is one whose trials are laid beside its own.
    pub fn new(recording: Timeline, second: Option<Timeline>, follow: bool) -> ReplayFeed {
        let mut replay = ReplayFeed {
            recording,
            whole: ReplayTimeline::default(),
            playing: true,
            speed: SPEEDS.iter().position(|speed| *speed == 1.0).unwrap_or(0),
            slow_motion: false,
            looping: None,
            follow_in_ns: follow.then_some(FOLLOW_NS),
            silent_ns: 0,
            at_present: follow,
            observer: None,
            time_ns: 0,
            next: VecDeque::new(),
            snapshot: Snapshot::default(),
            logged: BTreeSet::new(),
            damage: DamageWatch::default(),
            pair: TrialPair::new(second),
            rejudged: None,
            jumped: Vec::new(),
        };
        replay.list();
        replay.jump(if follow { replay.recording.duration_ns() } else { 0 });
        replay
    }

    /// The same with the session that writes the recording.
    pub fn with_observer(self, observer: Observer) -> ReplayFeed {
        ReplayFeed { observer: Some(observer), ..self }
    }

    pub fn stop_latch(&self) -> Option<StopLatch> {
        self.observer.as_ref().map(Observer::stop_latch)
    }

    pub fn damage(&self) -> DamageWatch {
        self.damage.clone()
    }

    pub fn rejudge(&mut self, folder: Option<PathBuf>) {
        self.rejudged = Some(rejudge(self.recording.paths(), folder));
    }

    pub fn end_rejudge(&mut self) {
        self.rejudged = None;
    }

    pub fn control_replay(&mut self, command: ReplayCommand) {
        let end_ns = self.recording.duration_ns();
        let at = self.time_ns;
        match command {
            ReplayCommand::PlayPause if at >= end_ns && self.follow_in_ns.is_none() => {
                self.jump(0);
                self.playing = true;
            }
            // What was recorded meanwhile is skipped: a session that runs is watched as it is now.
            ReplayCommand::PlayPause if !self.playing && self.follow_in_ns.is_some() => {
                self.go_to_end();
                self.playing = true;
            }
            ReplayCommand::PlayPause => self.playing = !self.playing,
            ReplayCommand::Slower => {
                self.at_present = false;
                self.speed = self.speed.saturating_sub(1);
            }
            ReplayCommand::Faster => self.speed = (self.speed + 1).min(SPEEDS.len() - 1),
            ReplayCommand::SlowMotion => self.slow_motion = !self.slow_motion,
            ReplayCommand::Forward(step) => {
                self.playing &= step == ReplayStep::Second;
                let mut messages = std::mem::take(&mut self.jumped);
                self.advance(length_ns(step), &mut messages);
                self.jumped = messages;
            }
            ReplayCommand::Back(step) => {
                self.playing &= step == ReplayStep::Second;
                self.go_to(at.saturating_sub(length_ns(step)));
            }
            ReplayCommand::NextMarker => self.go_to_place(after(self.markers(), at), "no further trial or fault"),
            ReplayCommand::PreviousMarker => {
                self.go_to_place(before(self.markers(), self.passed()), "no earlier trial or fault");
            }
            ReplayCommand::NextFall => self.go_to_place(after(self.falls(), at), "no further fall or fault"),
            ReplayCommand::PreviousFall => {
                self.go_to_place(before(self.falls(), self.passed()), "no earlier fall or fault");
            }
            ReplayCommand::Start => self.go_to(0),
            ReplayCommand::End => self.go_to_end(),
            ReplayCommand::Time(time_ns) => self.go_to(time_ns),
            ReplayCommand::Trial(trial) => {
                if let Some(span) = self.whole.trials.iter().rev().find(|span| span.trial == trial) {
                    self.go_to(span.row_ns);
                }
            }
            ReplayCommand::Loop if self.looping.is_some() => self.looping = None,
            ReplayCommand::Loop => {
                self.looping = self.present();
                if let Some(span) = self.looping {
                    self.at_present = false;
                    self.jump(loop_begin(&span));
                    self.playing = true;
                }
            }
            ReplayCommand::Beside(trial) => self.pair.choose(trial),
            ReplayCommand::EndBeside => self.pair.end(),
            ReplayCommand::Lay(trial) => self.jumped.push(match self.pair.jump_of(&self.recording, trial) {
                Ok(ticks) => Msg::EarlierJump { trial, ticks },
                Err(reason) => logged(at, reason),
            }),
        }
    }

    /// The run at the playhead, or else the last one before it, or the first one.
    fn present(&self) -> Option<TrialRun> {
        let runs = &self.whole.trials;
        runs.iter().rev().find(|run| run.begin_ns <= self.time_ns).or(runs.first()).copied()
    }

    /// Goes to a time; a loop ends where the time is not in it.
    fn go_to(&mut self, time_ns: u64) {
        self.at_present = false;
        self.looping = self.looping.filter(|span| (span.begin_ns..=span.end_ns).contains(&time_ns));
        self.jump(time_ns);
    }

    /// Goes to the end, where a followed recording is played on.
    fn go_to_end(&mut self) {
        self.go_to(self.recording.duration_ns());
        self.at_present = self.follow_in_ns.is_some();
        // What is watched goes on.
        self.playing |= self.at_present;
    }

    /// Goes to a place; without one the replay stays where it is and reports that there is none.
    fn go_to_place(&mut self, place: Option<u64>, none: &str) {
        match place {
            Some(time_ns) => self.go_to(time_ns),
            None => self.jumped.push(Msg::Answer(none.to_owned())),
        }
    }

    fn markers(&self) -> impl DoubleEndedIterator<Item = u64> + '_ {
        self.recording.markers().iter().map(|marker| self.place_of(marker))
    }

    /// The time at which the replay shows what a marker marks: of a trial also its row.
    fn place_of(&self, marker: &Marker) -> u64 {
        let begun = self.whole.trials.binary_search_by_key(&marker.time_ns, |run| run.begin_ns);
        let run = begun.ok().filter(|_| marker.kind != MarkerKind::Fault).and_then(|at| self.whole.trials.get(at));
        run.map_or(marker.time_ns, |run| run.row_ns)
    }

    /// Begins of faults, and of trials that fell without one the ticks that stopped them or their last ones, in the order of time.
    fn falls(&self) -> impl DoubleEndedIterator<Item = u64> + use<> {
        let faults = self.recording.markers().iter().filter(|marker| marker.kind == MarkerKind::Fault);
        let mut places: Vec<u64> = faults.map(|marker| marker.time_ns).collect();
        let ended_by_fault = |run: &&TrialRun| places.iter().any(|fault| (run.begin_ns..=run.end_ns).contains(fault));
        let fell = self.whole.trials.iter().filter(|run| self.whole.falls.contains(&run.trial));
        let fell: Vec<u64> = fell.filter(|run| !ended_by_fault(run)).map(fall_tick).collect();
        places.extend(fell);
        places.sort_unstable();
        places.into_iter()
    }

    /// The time before which a place counts as previous: during playback one passed less than 1 s ago is skipped.
    fn passed(&self) -> u64 {
        self.time_ns.saturating_sub(if self.playing { 1_000_000_000 } else { 0 })
    }

    /// Appends the messages of `elapsed_ns` of real time.
    pub fn poll(&mut self, elapsed_ns: u64, messages: &mut Vec<Msg>) {
        messages.append(&mut self.jumped);
        self.follow(elapsed_ns, messages);
        messages.extend(self.rejudged.iter().flat_map(|news| news.try_iter().take(BATCH)).map(Msg::Rejudged));
        if self.playing {
            self.play(elapsed_ns, messages);
            messages.append(&mut self.jumped);
            if self.time_ns >= self.recording.duration_ns() && self.looping.is_none() && self.follow_in_ns.is_none() {
                self.playing = false;
            }
        }
        let present = self.present();
        match self.pair.changed(&self.recording, present.as_ref()) {
            Ok(Some(both)) => {
                messages.push(Msg::SideBySide(Box::new(both)));
                self.report_damage(messages);
            }
            Ok(None) => {}
            Err(reason) => messages.push(logged(self.time_ns, reason)),
        }
        messages.push(Msg::Snapshot(Box::new(self.snapshot)));
        messages.push(Msg::Replay(ReplayStatus {
            playing: self.playing,
            speed: SPEEDS[self.speed],
            time_ns: self.time_ns,
            duration_ns: self.recording.duration_ns(),
            slow_motion: self.slow_motion,
            looping: self.looping.map(|span| span.trial),
            present: present.map(|run| run.trial),
            silent_ns: self.follow_in_ns.map(|_| self.silent_ns),
            behind_ns: self.recording.duration_ns().saturating_sub(self.time_ns),
            observer: self.observer.as_ref().map(Observer::status),
            lost_ns: self.recording.lost_ns(),
        }));
    }

    /// Plays `elapsed_ns` of real time; in slow motion and in a loop in parts, since speed and place change on the way.
    fn play(&mut self, elapsed_ns: u64, messages: &mut Vec<Msg>) {
        if !self.slow_motion && self.looping.is_none() {
            return self.advance((elapsed_ns as f64 * SPEEDS[self.speed]) as u64, messages);
        }
        let mut left_ns = elapsed_ns as f64;
        while left_ns >= 1.0 {
            let jumping = matches!(self.snapshot.tick.phase, Phase::Impulse | Phase::Flight);
            let slowed = if self.slow_motion && jumping { SLOW_MOTION } else { 1.0 };
            let speed = SPEEDS[self.speed] * slowed;
            let by_ns = (left_ns * speed).min(FRAME_NS as f64);
            left_ns -= by_ns / speed;
            self.advance(by_ns.ceil() as u64, messages);
            if let Some(span) = self.looping.filter(|span| self.time_ns >= span.end_ns) {
                self.jump(loop_begin(&span));
                // What follows belongs to the time after the jump.
                messages.append(&mut self.jumped);
            }
            if self.time_ns >= self.recording.duration_ns() {
                break;
            }
        }
    }

    /// Reads what was appended to a followed file.
    fn follow(&mut self, elapsed_ns: u64, messages: &mut Vec<Msg>) {
        let Some(left_ns) = self.follow_in_ns else { return };
        self.silent_ns = self.silent_ns.saturating_add(elapsed_ns);
        self.follow_in_ns = Some(left_ns.saturating_sub(elapsed_ns));
        if left_ns > elapsed_ns {
            return;
        }
        self.follow_in_ns = Some(FOLLOW_NS);
        match self.recording.refresh() {
            Ok(true) => {
                self.silent_ns = 0;
                self.list();
                messages.append(&mut self.jumped);
                let behind_ns = self.recording.duration_ns().saturating_sub(self.time_ns);
                if self.at_present && self.playing && behind_ns > MOST_BEHIND_NS {
                    self.advance(behind_ns - FLUSH_NS, messages);
                }
            }
            Ok(false) => {}
            Err(error) => {
                self.follow_in_ns = None;
                messages.push(logged(self.time_ns, format!("not followed any longer: {error}")));
            }
        }
    }

    /// Lists the whole recording anew.
    fn list(&mut self) {
        let faults = self.recording.markers().iter().filter(|marker| marker.kind == MarkerKind::Fault);
        self.whole = ReplayTimeline {
            trials: self.recording.trials().to_vec(),
            faults_ns: faults.map(|marker| marker.time_ns).collect(),
            lost_ns: self.recording.lost().iter().map(|lost| (lost.from_ns, lost.to_ns)).collect(),
            rows: self.recording.rows(),
            falls: self.recording.falls(),
            last_fall_ns: None,
            overrides: self.recording.overrides(),
            best: best_of(&self.recording),
            begins_utc_ns: self.recording.begins_utc_ns(),
            second: self.pair.second(),
        };
        self.whole.last_fall_ns = self.falls().next_back();
        self.jumped.push(Msg::Timeline(Box::new(self.whole.clone())));
    }

    /// Plays the next `by_ns` of the recording.
    fn advance(&mut self, by_ns: u64, messages: &mut Vec<Msg>) {
        self.time_ns = self.time_ns.saturating_add(by_ns).min(self.recording.duration_ns());
        while let Some(played) = self.next.pop_front().or_else(|| self.recording.next()) {
            if played.time_ns() > self.time_ns {
                self.next.push_front(played);
                break;
            }
            self.show(played, messages);
        }
        self.report_damage(messages);
    }

    fn show(&mut self, played: Played, messages: &mut Vec<Msg>) {
        match played {
            Played::Tick(tick) => {
                let changes_mode = tick.mode != self.snapshot.tick.mode;
                self.snapshot.tick = *tick;
                if tick.number % SHOWN_EVERY == 0 || changes_mode {
                    messages.push(Msg::Tick(tick));
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

    /// Logs lost parts that were not known before.
    fn report_damage(&mut self, messages: &mut Vec<Msg>) {
        if self.recording.lost_count() > self.whole.lost_ns.len() {
            let lost = self.recording.lost();
            self.whole.lost_ns = lost.iter().map(|lost| (lost.from_ns, lost.to_ns)).collect();
            messages.push(Msg::Timeline(Box::new(self.whole.clone())));
        }
        if self.logged.len() < self.whole.lost_ns.len() {
            for lost in self.recording.lost() {
                if lost.from_ns <= self.time_ns && self.logged.insert(lost.from_ns) {
                    let lost_s = lost.to_ns.saturating_sub(lost.from_ns) as f64 / 1e9;
                    messages.push(logged(
                        lost.from_ns,
                        format!("{lost_s:.3} s of the recording are lost: {}", lost.reason),
                    ));
                }
            }
        }
        let mut damage = self.recording.damage();
        if self.follow_in_ns.is_some() && self.recording.lost_count() == 0 {
            damage.clear(); // a file that is being written has no end
        }
        damage.extend(self.pair.damage());
        *self.damage.lock().unwrap_or_else(PoisonError::into_inner) = damage;
    }

    /// Jumps to a time: replays all events before it, and the ticks of the last seconds for the charts.
    fn jump(&mut self, time_ns: u64) {
        let time_ns = time_ns.min(self.recording.duration_ns());
        let from_ns = time_ns.saturating_sub(PAST_NS);
        // What a jump before this one has left is out of date, but for the list of trials and a jump for the charts.
        let stays = |message: &Msg| matches!(message, Msg::Timeline(_) | Msg::EarlierJump { .. });
        let mut messages: Vec<Msg> = self.jumped.drain(..).filter(stays).collect();
        messages.push(Msg::Rewound);
        if self.follow_in_ns.is_none() {
            messages.extend(self.recording.cuts().into_iter().map(|cut| logged(0, cut)));
        }
        messages.extend(self.recording.events_before(from_ns).map(Msg::Record));
        // No tick may lie in the seconds before the time: the robot of another time is not shown then.
        self.snapshot = Snapshot::default();
        self.logged.clear();
        self.next.clear();
        // The charts show every fifth tick, and changes of the mode; the newest one is shown in numbers.
        self.recording.seek_sparse(from_ns, time_ns.saturating_sub(2 * FRAME_NS), SHOWN_EVERY as u32);
        self.time_ns = from_ns;
        self.advance(time_ns - from_ns, &mut messages);
        self.jumped = messages;
    }
}

fn length_ns(step: ReplayStep) -> u64 {
    match step {
        ReplayStep::Tick => TICK_NS,
        ReplayStep::Frame => FRAME_NS,
        ReplayStep::Second => 1_000_000_000,
    }
}

fn after(mut times: impl Iterator<Item = u64>, time_ns: u64) -> Option<u64> {
    times.find(|time| *time > time_ns)
}

fn before(times: impl DoubleEndedIterator<Item = u64>, time_ns: u64) -> Option<u64> {
    times.rev().find(|time| *time < time_ns)
}

/// The tick in which a trial was stopped, or its last one: at the end itself the next trial may have begun.
fn fall_tick(run: &TrialRun) -> u64 {
    run.damped_ns.unwrap_or_else(|| run.end_ns.saturating_sub(TICK_NS).max(run.begin_ns))
}

/// The begin of a loop: shortly before the impulse, or the begin of a trial whose impulse is not recorded as an event.
fn loop_begin(span: &TrialRun) -> u64 {
    span.impulse_ns.map_or(span.begin_ns, |impulse| impulse.saturating_sub(BEFORE_IMPULSE_NS).max(span.begin_ns))
}

/// Returns the best trial at the end of a recording: that of the sampler's model, or of the highest mean over its repeats.
fn best_of(recording: &Timeline) -> Option<u32> {
    let mut trials = Trials { records: recording.rows(), ..Trials::default() };
    for event in recording.events_before(u64::MAX) {
        match event.record {
            Record::Insight(insight) => trials.model_best = insight.predicted_best().copied(),
            Record::Points(points) => trials.points = points,
            _ => {}
        }
    }
    trials.best().map(|best| best.trial)
}

/// A line of the log about the recording itself.
fn logged(time_ns: u64, message: String) -> Msg {
    let record = Record::Log(LogRecord { level: LogLevel::Error, source: "recording".to_owned(), message });
    Msg::Record(Stamped { time_ns, record })
}
