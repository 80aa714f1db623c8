//! Recordings of one study as one: its files in the order of time, with their trials.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::error::RecordingError;
use super::player::{Damage, LostPart, Marker, MarkerKind, Played, Player};
use super::record::{Record, SessionInfo, StageRecord, Stamped};
use super::session_files::{place, recordings_in};
use crate::telemetry::Mode;
use crate::trial::{ExperimentStage, Overrides, TrialRecord, Verdict};

/// Longest pause between two files that is played in its length, ns; of a longer one 1 s is left.
const LONGEST_PAUSE_NS: u64 = 10_000_000_000;
const SHORTENED_PAUSE_NS: u64 = 1_000_000_000;

/// The time of a trial in a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TrialRun {
    /// Its number.
    pub trial: u32,
    /// Its first tick, the countdown's, ns.
    pub begin_ns: u64,
    /// The time from which its row is recorded, too: its begin, or the record of the session's thread where that is a little later, ns.
    pub row_ns: u64,
    /// Begin of the impulse; none where the recording has no changes of mode.
    pub impulse_ns: Option<u64>,
    /// Its first tick with damped joints; none of a trial that was not stopped.
    pub damped_ns: Option<u64>,
    /// Its end: the review, its row, or the next trial, ns.
    pub end_ns: u64,
}

/// One file and its place.
struct Part {
    player: Player,
    /// First time of the part, ns.
    begin_ns: u64,
    /// Added to the file's times, ns.
    shift_ns: i64,
}

impl Part {
    fn end_ns(&self) -> u64 {
        self.place(self.player.duration_ns())
    }

    /// Returns the time of the timeline for a time of the file. The session's record has the file's time 0, wherever it begins.
    fn place(&self, time_ns: u64) -> u64 {
        time_ns.saturating_add_signed(self.shift_ns).max(self.begin_ns)
    }

    fn in_file(&self, time_ns: u64) -> u64 {
        if time_ns <= self.begin_ns { 0 } else { time_ns.saturating_add_signed(-self.shift_ns) }
    }

    fn placed(&self, event: &Stamped) -> Stamped {
        Stamped { time_ns: self.place(event.time_ns), record: event.record.clone() }
    }
}

/// Iterator over the ticks and records of one or more files of a study, in the order of time. Times count from the start of the
/// first file's engine.
pub struct Timeline {
    parts: Vec<Part>,
    /// Recordings in the folder of the first file that were not opened and are older than the last part.
    older: BTreeSet<PathBuf>,
    /// Part that is played.
    current: usize,
    /// End and number of a sparse seek.
    sparse_until: Option<(u64, u32)>,
    markers: Vec<Marker>,
    trials: Vec<TrialRun>,
}

impl From<Player> for Timeline {
    fn from(player: Player) -> Timeline {
        let parts = vec![Part { player, begin_ns: 0, shift_ns: 0 }];
        let (older, sparse_until) = (BTreeSet::new(), None);
        let mut timeline = Timeline { parts, older, current: 0, sparse_until, markers: Vec::new(), trials: Vec::new() };
        timeline.index();
        timeline
    }
}

impl Timeline {
    /// Opens files of one study, in any order.
    ///
    /// # Errors
    /// When a file cannot be played, or is of another study than the first one. Without a file.
    pub fn open(files: &[PathBuf]) -> Result<Timeline, RecordingError> {
        let players = files.iter().map(Player::open).collect::<Result<Vec<_>, _>>()?;
        let mut players = in_order(players).into_iter();
        let first = players.next().ok_or_else(|| RecordingError::NoRecording { path: PathBuf::new(), deeper: None })?;
        let mut timeline = Timeline::from(first);
        for player in players {
            timeline.append(player)?;
        }
        timeline.index();
        Ok(timeline)
    }

    /// Appends a file after all others: with the real pause before it, or with 1 s for a long one.
    fn append(&mut self, player: Player) -> Result<(), RecordingError> {
        let (Some(first), Some(last)) = (self.parts.first(), self.parts.last()) else { return Ok(()) };
        check_same_study(&first.player, &self.rows(), &player)?;
        let end_ns = last.end_ns();
        if player.start_utc_ns() == last.player.start_utc_ns() {
            // The next file of the same session: on one clock, and no pause is shortened.
            let shift_ns = last.shift_ns;
            let begin_ns = player.first_ns().saturating_add_signed(shift_ns).max(end_ns);
            self.parts.push(Part { player, begin_ns, shift_ns });
            return Ok(());
        }
        let since_first = i128::from(player.start_utc_ns()) - i128::from(first.player.start_utc_ns());
        let real_ns = since_first + i128::from(player.first_ns());
        let pause_ns = (real_ns - i128::from(end_ns)).max(0);
        let pause_ns = if pause_ns > i128::from(LONGEST_PAUSE_NS) { SHORTENED_PAUSE_NS } else { pause_ns as u64 };
        let begin_ns = end_ns.saturating_add(pause_ns);
        let shift_ns = i128::from(begin_ns) - i128::from(player.first_ns());
        let shift_ns = i64::try_from(shift_ns).unwrap_or(if shift_ns < 0 { -i64::MAX } else { i64::MAX });
        self.parts.push(Part { player, begin_ns, shift_ns });
        Ok(())
    }

    /// The first file.
    pub fn first_player(&mut self) -> &mut Player {
        &mut self.parts[0].player
    }

    /// Reads what was written since: what was appended to the last file, and the file that continues it. Returns whether there
    /// was anything.
    ///
    /// # Errors
    /// When a file cannot be read any more.
    pub fn refresh(&mut self) -> Result<bool, RecordingError> {
        let Some(last) = self.parts.last_mut() else { return Ok(false) };
        let mut news = last.player.refresh()?;
        if last.player.is_complete() {
            let folder = self.parts[0].player.path().parent().unwrap_or(Path::new(""));
            let known = |file: &PathBuf| {
                let opened = |part: &Part| finished_name(part.player.path()) == finished_name(file);
                self.older.contains(file) || self.parts.iter().any(opened)
            };
            let new: Vec<_> = recordings_in(folder).into_iter().filter(|file| !known(file)).collect();
            for file in new {
                // A file without its first record yet is opened at the next call.
                let Ok(player) = Player::open(&file) else { continue };
                if self.parts.last().is_some_and(|last| follows(&player, &last.player)) {
                    self.append(player)?;
                    news = true;
                } else {
                    self.older.insert(file);
                }
            }
        }
        if news {
            self.index();
        }
        Ok(news)
    }

    /// Lists markers and trials.
    fn index(&mut self) {
        let markers = |part: &Part| {
            let placed = |marker: &Marker| Marker { time_ns: part.place(marker.time_ns), kind: marker.kind };
            part.player.markers().iter().map(placed).collect::<Vec<_>>()
        };
        self.markers = self.parts.iter().flat_map(markers).collect();
        let begins: Vec<(u32, u64)> = self.markers.iter().filter_map(trial_begin).collect();
        let duration_ns = self.duration_ns();
        let mut spans: Vec<TrialRun> = Vec::with_capacity(begins.len());
        let mut ended = vec![false; begins.len()];
        for (index, &(trial, begin_ns)) in begins.iter().enumerate() {
            let end_ns = begins.get(index + 1).map_or(duration_ns, |next| next.1);
            spans.push(TrialRun { trial, begin_ns, row_ns: begin_ns, impulse_ns: None, damped_ns: None, end_ns });
        }
        for part in &self.parts {
            for event in part.player.events() {
                let time_ns = part.place(event.time_ns);
                let Some(index) = spans.partition_point(|span| span.begin_ns <= time_ns).checked_sub(1) else {
                    continue;
                };
                let span = &mut spans[index];
                if let Record::Transition(change) = &event.record
                    && !ended[index]
                {
                    match change.to {
                        Mode::Jump => _ = span.impulse_ns.get_or_insert(time_ns),
                        Mode::Damped => _ = span.damped_ns.get_or_insert(time_ns),
                        _ => {}
                    }
                }
                if let Record::Stage(StageRecord { stage: ExperimentStage::Running, trial, .. }) = event.record
                    && trial == span.trial
                    && !ended[index]
                {
                    span.row_ns = time_ns;
                }
                let ends = ended_trial(&event.record) == Some(span.trial);
                if ends && !std::mem::replace(&mut ended[index], true) {
                    span.end_ns = time_ns;
                }
            }
        }
        self.trials = spans;
    }

    /// Returns the paths of the files as they were given, in the order of time.
    pub fn paths(&self) -> Vec<PathBuf> {
        self.parts.iter().map(|part| part.player.path().into()).collect()
    }

    /// Returns the begin of each file, ns, with its UTC time, ns since 1970; in the order of time.
    pub fn begins_utc_ns(&self) -> Vec<(u64, u64)> {
        let utc_ns = |part: &Part| {
            let in_session_ns = part.begin_ns.saturating_add_signed(-part.shift_ns);
            part.player.start_utc_ns().saturating_add(in_session_ns)
        };
        self.parts.iter().map(|part| (part.begin_ns, utc_ns(part))).collect()
    }

    /// Returns the facts of the first session.
    pub fn session(&self) -> &SessionInfo {
        self.parts[0].player.session()
    }

    /// Returns the time of the last message, ns.
    pub fn duration_ns(&self) -> u64 {
        self.parts.last().map_or(0, Part::end_ns)
    }

    /// Returns the begins of trials and faults, in the order of time.
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }

    /// Returns the runs of trials, in the order of time. A trial that ran more than once has several.
    pub fn trials(&self) -> &[TrialRun] {
        &self.trials
    }

    /// Returns the newest row of each trial.
    pub fn rows(&self) -> BTreeMap<u32, TrialRecord> {
        rows_of(self.parts.iter().flat_map(|part| part.player.events()))
    }

    /// Returns the trials that fell, tripped a limit or were judged a fall at any time, whatever their verdict is now.
    pub fn falls(&self) -> BTreeSet<u32> {
        let events = self.parts.iter().flat_map(|part| part.player.events());
        let fell = |row: &TrialRecord| [row.verdict, row.suggested].contains(&Some(Verdict::Fall));
        let falls = events.filter_map(|event| match &event.record {
            Record::Trial(row) => fell(row).then_some(row.trial),
            _ => None,
        });
        falls.collect()
    }

    /// Returns the values that the operator has set in place of proposed ones.
    pub fn overrides(&self) -> Overrides {
        let mut overrides = Overrides::default();
        for event in self.parts.iter().flat_map(|part| part.player.events()) {
            if let Record::Proposal(proposal) = &event.record {
                overrides.take(proposal);
            }
        }
        overrides
    }

    /// Returns all records but the counters before a time, in the order of time.
    pub fn events_before(&self, time_ns: u64) -> impl Iterator<Item = Stamped> + '_ {
        self.parts
            .iter()
            .flat_map(|part| part.player.events().iter().map(|event| part.placed(event)))
            .take_while(move |event| event.time_ns < time_ns)
    }

    /// Returns the missing parts of each file, as far as they are found.
    pub fn damage(&self) -> Vec<Damage> {
        self.parts.iter().filter_map(|part| part.player.damage()).collect()
    }

    /// Returns the reasons for which ends of files are missing, with their names.
    pub fn cuts(&self) -> Vec<String> {
        let cut = |part: &Part| Some(format!("{}: {}", part.player.path().display(), part.player.cut()?));
        self.parts.iter().filter_map(cut).collect()
    }

    /// Returns what was lost already when files were recovered from damaged ones, with their names.
    pub fn lost_before_recovery(&mut self) -> Vec<String> {
        self.parts.iter_mut().flat_map(|part| part.player.named_losses_before_recovery()).collect()
    }

    /// Returns whether the last file was completed; one that is being written is not.
    pub fn is_complete(&self) -> bool {
        self.parts.last().is_some_and(|part| part.player.is_complete())
    }

    /// Returns the parts that cannot be read, as far as they are found: file by file.
    pub fn lost(&self) -> Vec<LostPart> {
        let placed = |part: &Part, lost: LostPart| LostPart {
            from_ns: part.place(lost.from_ns),
            to_ns: part.place(lost.to_ns),
            reason: lost.reason,
        };
        self.parts.iter().flat_map(|part| part.player.lost().map(move |lost| placed(part, lost))).collect()
    }

    /// Returns the number of parts that cannot be read, as far as they are found.
    pub fn lost_count(&self) -> usize {
        self.parts.iter().map(|part| part.player.lost().len()).sum()
    }

    /// Returns the time that these parts take together, ns.
    pub fn lost_ns(&self) -> u64 {
        self.parts.iter().fold(0, |sum, part| sum.saturating_add(part.player.lost_ns()))
    }

    /// Continues at `time_ns`, forward or back, with the first tick or record not before it.
    pub fn seek(&mut self, time_ns: u64) {
        self.sparse_until = None;
        self.current = self.parts.partition_point(|part| part.begin_ns <= time_ns).saturating_sub(1);
        let part = &mut self.parts[self.current];
        part.player.seek(part.in_file(time_ns));
    }

    /// Continues at `from_ns` like [`seek`](Timeline::seek); of the ticks before `to_ns` only those are played whose number is a
    /// multiple of `every`, and those in which the mode changes.
    pub fn seek_sparse(&mut self, from_ns: u64, to_ns: u64, every: u32) {
        self.seek(from_ns);
        self.sparse_until = Some((to_ns, every));
        let part = &mut self.parts[self.current];
        part.player.seek_sparse(part.in_file(from_ns), part.in_file(to_ns), every);
    }
}

impl Iterator for Timeline {
    type Item = Played;

    fn next(&mut self) -> Option<Played> {
        loop {
            let part = self.parts.get_mut(self.current)?;
            if let Some(mut played) = part.player.next() {
                let time_ns = part.place(played.time_ns());
                match &mut played {
                    Played::Tick(tick) => tick.time_ns = time_ns,
                    Played::Record(stamped) => stamped.time_ns = time_ns,
                }
                return Some(played);
            }
            // The last part may grow.
            let next = self.parts.get_mut(self.current + 1)?;
            self.current += 1;
            match self.sparse_until {
                Some((to_ns, every)) => next.player.seek_sparse(0, next.in_file(to_ns), every),
                None => next.player.seek(0),
            }
        }
    }
}

/// Refuses files of several studies: they would mix their trials.
///
/// # Errors
/// Names the first file that is of another study than the first one.
pub fn check_one_study(players: &[Player]) -> Result<(), RecordingError> {
    let mut rows = BTreeMap::new();
    for player in players {
        check_same_study(&players[0], &rows, player)?;
        rows.extend(rows_of(player.events().iter()));
    }
    Ok(())
}

/// Refuses a file of another study than `first`; `rows` are those of the files of its study.
fn check_same_study(first: &Player, rows: &BTreeMap<u32, TrialRecord>, player: &Player) -> Result<(), RecordingError> {
    let (ours, theirs) = (first.session(), player.session());
    let other =
        |reason: String| RecordingError::OtherStudy { path: player.path().into(), first: first.path().into(), reason };
    for (what, ours, theirs) in
        [("the task", ours.task_name(), theirs.task_name()), ("the robot", &ours.robot, &theirs.robot)]
    {
        if ours != theirs {
            return Err(other(format!("{what} is {theirs}, not {ours}")));
        }
    }
    let differs = |row: &&TrialRecord| rows.get(&row.trial).is_some_and(|known| known.parameters != row.parameters);
    match rows_of(player.events().iter()).values().find(differs) {
        Some(row) => Err(other(format!("trial {} has other parameters", row.trial))),
        None => Ok(()),
    }
}

/// Returns recordings in the order in which they were begun: those of a folder by their numbers, because a clock may have been set
/// back between two sessions; those of several folders, and files with other names, by the time of their first message.
pub fn in_order(players: Vec<Player>) -> Vec<Player> {
    let mut folders: BTreeMap<PathBuf, Vec<Player>> = BTreeMap::new();
    for player in players {
        // A file with another name is by itself.
        let group = place(player.path()).map_or(player.path(), |(folder, _)| folder).to_owned();
        folders.entry(group).or_default().push(player);
    }
    for numbered in folders.values_mut() {
        numbered.sort_by_key(|player| Reverse(place(player.path()).map(|(_, number)| number)));
    }
    let mut ordered = Vec::new();
    // The last of each folder is its earliest that is left.
    while let Some(next) =
        folders.values_mut().filter(|left| !left.is_empty()).min_by_key(|left| left.last().map(begin_utc_ns))
    {
        ordered.extend(next.pop());
    }
    ordered
}

/// Whether a recording was begun after another, as in [`in_order`].
fn follows(player: &Player, last: &Player) -> bool {
    match (place(player.path()), place(last.path())) {
        (Some((folder, number)), Some((of_last, last))) if folder == of_last => number > last,
        _ => begin_utc_ns(player) >= begin_utc_ns(last),
    }
}

/// Returns the UTC time of a file's first message, ns since 1970.
fn begin_utc_ns(player: &Player) -> u64 {
    player.start_utc_ns().saturating_add(player.first_ns())
}

/// Returns the name that a recording has once it is finished.
fn finished_name(path: &Path) -> PathBuf {
    if path.extension().is_some_and(|end| end == "part") { path.with_extension("") } else { path.into() }
}

/// Returns the trial whose end a record reports: its review, or its row with a suggested verdict.
pub fn ended_trial(record: &Record) -> Option<u32> {
    match record {
        Record::Stage(stage) => (stage.stage == ExperimentStage::Review).then_some(stage.trial),
        Record::Trial(row) => row.suggested.map(|_| row.trial),
        _ => None,
    }
}

fn trial_begin(marker: &Marker) -> Option<(u32, u64)> {
    match marker.kind {
        MarkerKind::Trial(trial) => Some((trial, marker.time_ns)),
        MarkerKind::Fault => None,
    }
}

/// Returns the newest row of each trial among events.
pub fn rows_of<'a>(events: impl Iterator<Item = &'a Stamped>) -> BTreeMap<u32, TrialRecord> {
    let rows = events.filter_map(|event| match &event.record {
        Record::Trial(row) => Some((row.trial, row.clone())),
        _ => None,
    });
    rows.collect()
}
