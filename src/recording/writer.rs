//! Writer of a recording: a live session, or a single rollout at once.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use foxglove::messages::JointStates;
use mcap::McapError;
use prost::Message as _;

use super::error::RecordingError;
use super::live::LiveFeed;
pub use super::output::Sink;
use super::output::{Output, with_suffix};
use super::record::{Record, SessionInfo, Stamped};
use super::scene::{self, Ground};
use super::topic::Topic;
use super::trial_table::{self, TrialSpan};
use super::wire::encoded;
use super::{coordinate_frames, frog, tick, trials};
use crate::robot::description::RobotDescription;
use crate::telemetry::{Mode, Tick};
use crate::trial::TrialRecord;

/// Period of `/robot/pose`, `/tf` and `/robot/joint_states`, for viewers; all follow from the ticks.
const FRAMES_PERIOD_NS: u64 = 10_000_000;

/// Of the ticks while the robot is disarmed one of so many is kept by [`Writer::thin_while_disarmed`]: ten a second.
const DISARMED_EVERY: u64 = 100;

/// Returns the ground of a trial that begins, or with none that of the start; none where it is not known.
pub type GroundOf = Box<dyn Fn(Option<&TrialRecord>) -> Option<Ground> + Send>;

/// Writer of one recording. Dropped without [`finish`](Writer::finish), it leaves the file as `*.mcap.part` with everything
/// written so far.
pub struct Writer {
    out: Output,
    joints: JointStates,
    robot: Option<RobotDescription>,
    /// Whether most ticks are left out while the robot is disarmed.
    thinned: bool,
    ground_of: Option<GroundOf>,
    /// The ground written last.
    ground: Option<Ground>,
    start_utc_ns: u64,
    /// Log time of the file's first messages.
    begin_utc_ns: u64,
    /// Log times of the first and last tick of each trial of the session.
    spans: BTreeMap<u32, TrialSpan>,
    /// The newest row of each trial.
    rows: BTreeMap<u32, TrialRecord>,
    /// Trial and mode of the last tick: a change may be a marker.
    last: Option<(Option<u32>, Mode)>,
    last_frames: Option<u64>,
    /// The last joint command, encoded, and the number of its chunk.
    command: Option<(u64, Vec<u8>)>,
    records: u32,
    ticks: u64,
    part: PathBuf,
    path: PathBuf,
    /// Error number of the first failed write: the encoder refuses every later one without its reason.
    failed: Option<i32>,
}

impl Writer {
    /// Begins the recording `path` (`*.mcap`), named `*.mcap.part` until it is finished. Creates missing folders. Metadata,
    /// attachments and the session's first message are on the disk on return; before, the file is named `*.mcap.new`.
    ///
    /// `start_utc_ns` is the UTC time of engine time 0, ns since 1970; `attachments` are (name, media type, bytes).
    ///
    /// # Errors
    /// When the name does not end in `.mcap`, when one of the two files exists already, or when the disk fails.
    pub fn create(
        path: impl AsRef<Path>,
        session: &SessionInfo,
        start_utc_ns: u64,
        attachments: &[(&str, &str, &[u8])],
    ) -> Result<Writer, RecordingError> {
        Writer::create_from(path, session, start_utc_ns, 0, attachments)
    }

    /// Like [`create`](Writer::create), for a file whose first messages have the time `begin_ns` since engine time 0.
    ///
    /// # Errors
    /// As of [`create`](Writer::create).
    pub fn create_from(
        path: impl AsRef<Path>,
        session: &SessionInfo,
        start_utc_ns: u64,
        begin_ns: u64,
        attachments: &[(&str, &str, &[u8])],
    ) -> Result<Writer, RecordingError> {
        let path = path.as_ref();
        if path.extension().is_none_or(|extension| extension != "mcap") {
            return Err(RecordingError::Name { path: path.into() });
        }
        if path.exists() {
            return Err(RecordingError::Exists { path: path.into() });
        }
        let io = |path: &Path, doing| {
            let path = path.to_path_buf();
            move |source: io::Error| match source.kind() {
                io::ErrorKind::AlreadyExists => RecordingError::Exists { path },
                _ => RecordingError::Io { path, doing, source },
            }
        };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(io(folder, "make the folder"))?;
        }
        let part = with_suffix(path, ".part");
        if part.exists() {
            return Err(RecordingError::Exists { path: part });
        }
        // A recording that a kill or a full disk ends before its head is whole has no name under which it is played.
        let new = with_suffix(path, ".new");
        let file = File::create(&new).map_err(io(&part, "create the file"))?;
        let times = (start_utc_ns, begin_ns);
        let begun = Writer::begin(Box::new(file), path, part.clone(), session, times, attachments)
            .and_then(|writer| fs::rename(&new, &part).map(|()| writer).map_err(io(&part, "create the file")));
        if begun.is_err() {
            // The first error is the one to report.
            let _ = fs::remove_file(&new);
        }
        begun
    }

    /// Like [`create`](Writer::create), into any sink. `path` is for messages only; nothing is renamed.
    pub fn into_sink(
        sink: Box<dyn Sink>,
        path: impl AsRef<Path>,
        session: &SessionInfo,
        start_utc_ns: u64,
        attachments: &[(&str, &str, &[u8])],
    ) -> Result<Writer, RecordingError> {
        let path = path.as_ref();
        Writer::begin(sink, path, path.into(), session, (start_utc_ns, 0), attachments)
    }

    fn begin(
        sink: Box<dyn Sink>,
        path: &Path,
        part: PathBuf,
        session: &SessionInfo,
        (start_utc_ns, begin_ns): (u64, u64),
        attachments: &[(&str, &str, &[u8])],
    ) -> Result<Writer, RecordingError> {
        let mut writer = Writer {
            out: Output::new(sink).map_err(|error| RecordingError::of_writing(&part, error))?,
            joints: tick::named_joints(None),
            robot: None,
            thinned: false,
            ground_of: None,
            ground: None,
            start_utc_ns,
            begin_utc_ns: start_utc_ns.saturating_add(begin_ns),
            spans: BTreeMap::new(),
            rows: BTreeMap::new(),
            last: None,
            last_frames: None,
            command: None,
            records: 0,
            ticks: 0,
            part,
            path: path.into(),
            failed: None,
        };
        writer
            .out
            .head(session, start_utc_ns, attachments)
            .map_err(|error| RecordingError::of_writing(&writer.part, error))?;
        writer.record(&Stamped { time_ns: begin_ns, record: Record::Session(session.clone()) })?;
        writer.sync()?;
        Ok(writer)
    }

    /// Adds the robot for viewers in three dimensions: its URDF with primitive shapes as an attachment, named in the metadata
    /// `robot`; its shapes and the ground; the frames of its links with the following ticks; its joint names. `ground` returns
    /// the ground of a trial that begins, and with none that of the start.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn show(&mut self, robot: RobotDescription, ground: GroundOf) -> Result<(), RecordingError> {
        self.joints = tick::named_joints(Some(&robot));
        self.out
            .robot(&robot, self.start_utc_ns)
            .and_then(|()| {
                self.out.message(Topic::RobotScene, 0, self.begin_utc_ns, &scene::robot(&robot, self.begin_utc_ns))
            })
            .map_err(|error| self.failure(error))?;
        self.robot = Some(robot);
        self.ground_of = Some(ground);
        self.write_ground(None, self.begin_utc_ns).map_err(|error| self.failure(error))?;
        self.sync()
    }

    /// Sends the session and everything written from here on to the viewers of the running session, too.
    pub fn show_live(&mut self, live: LiveFeed, session: &SessionInfo) {
        self.out.show_live(live, session, self.start_utc_ns, self.begin_utc_ns);
    }

    /// Makes this recording the continuation of another one of the session: with its trial table, present ground and numbers.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn continue_after(&mut self, before: &Writer) -> Result<(), RecordingError> {
        self.spans.clone_from(&before.spans);
        for row in before.rows.values() {
            self.write_row(row, self.begin_utc_ns).map_err(|error| self.failure(error))?;
        }
        (self.records, self.last) = (before.records, before.last);
        let ground = before.ground.clone().filter(|ground| self.ground.as_ref() != Some(ground));
        if let Some(ground) = &ground {
            self.out
                .message(Topic::GroundScene, 0, self.begin_utc_ns, &scene::ground(ground, self.begin_utc_ns))
                .map_err(|error| self.failure(error))?;
        }
        self.ground = ground.or(self.ground.take());
        self.flush()
    }

    /// Writes a row of the trial table.
    fn write_row(&mut self, row: &TrialRecord, log_time: u64) -> Result<(), McapError> {
        let span = self.spans.get(&row.trial);
        let (start_ns, end_ns) = (span.map(|(start, _)| *start), span.map(|(_, end)| *end));
        let message = frog::Trial { start_ns, end_ns, ..encoded(trials::trial, row) };
        self.rows.insert(row.trial, row.clone());
        self.out.message(Topic::Trial, self.records, log_time, &message)
    }

    /// Writes the ground of a trial that begins, or of the start, if it differs from the one before.
    fn write_ground(&mut self, trial: Option<&TrialRecord>, log_time: u64) -> Result<(), McapError> {
        let Some(ground) = self.ground_of.as_ref().and_then(|ground| ground(trial)) else { return Ok(()) };
        if self.ground.as_ref() != Some(&ground) {
            self.out.message(Topic::GroundScene, 0, log_time, &scene::ground(&ground, log_time))?;
            self.ground = Some(ground);
        }
        Ok(())
    }

    /// From now on keeps ten ticks a second while the robot is disarmed, observed or not connected: the first one of each of
    /// these modes and those whose number is a multiple of 100.
    pub fn thin_while_disarmed(&mut self) {
        self.thinned = true;
    }

    fn leaves_out(&self, tick: &Tick) -> bool {
        let disarmed = matches!(tick.mode, Mode::Offline | Mode::Observe | Mode::Disarmed);
        let begun = self.last == Some((None, tick.mode)) && tick.trial.is_none();
        self.thinned && disarmed && begun && !tick.number.is_multiple_of(DISARMED_EVERY)
    }

    /// Writes one tick.
    pub fn tick(&mut self, tick: &Tick) -> Result<(), RecordingError> {
        self.write_tick(tick).map_err(|error| self.failure(error))
    }

    fn write_tick(&mut self, tick: &Tick) -> Result<(), McapError> {
        if self.leaves_out(tick) {
            return Ok(());
        }
        let log_time = self.start_utc_ns.saturating_add(tick.time_ns);
        let sequence = tick.number as u32; // joins the messages of a tick in the player
        self.write_marker(tick, log_time)?;
        let (command, control) = tick::split(tick);
        // Each chunk is played by itself.
        let command_of_chunk = (self.out.closed_chunks, command.encode_to_vec());
        if self.command.as_ref() != Some(&command_of_chunk) {
            self.out.message(Topic::JointCommand, sequence, log_time, &command)?;
            self.command = Some(command_of_chunk);
        }
        self.out.message(Topic::Tick, sequence, log_time, &control)?;
        let period = tick.time_ns / FRAMES_PERIOD_NS;
        if self.last_frames != Some(period) {
            self.last_frames = Some(period);
            tick::joint_states(&tick.state, log_time, &mut self.joints);
            self.out.message(Topic::JointStates, sequence, log_time, &self.joints)?;
            self.out.message(Topic::Pose, sequence, log_time, &coordinate_frames::pose(tick, log_time))?;
            if let Some(robot) = &self.robot {
                self.out.message(
                    Topic::Tf,
                    sequence,
                    log_time,
                    &coordinate_frames::transforms(tick, robot, log_time),
                )?;
            }
        }
        if let Some(trial) = tick.trial {
            self.spans.entry(trial).or_insert((log_time, log_time)).1 = log_time;
        }
        self.ticks += 1;
        // Not between the messages of a tick: a chunk holds whole ticks.
        self.out.close_full_chunk()
    }

    /// Writes a marker where a trial or a fault begins.
    fn write_marker(&mut self, tick: &Tick, log_time: u64) -> Result<(), McapError> {
        let (last_trial, last_mode) = self.last.replace((tick.trial, tick.mode)).unwrap_or((None, Mode::Offline));
        if tick.trial.is_some() && tick.trial != last_trial {
            let marker = frog::Marker { kind: frog::marker::Kind::Trial as i32, trial: tick.trial };
            self.out.message(Topic::Marker, 0, log_time, &marker)?;
        }
        if tick.mode == Mode::Fault && last_mode != Mode::Fault {
            let marker = frog::Marker { kind: frog::marker::Kind::Fault as i32, trial: tick.trial };
            self.out.message(Topic::Marker, 0, log_time, &marker)?;
        }
        Ok(())
    }

    /// Writes one record.
    pub fn record(&mut self, stamped: &Stamped) -> Result<(), RecordingError> {
        let log_time = self.start_utc_ns.saturating_add(stamped.time_ns);
        self.records = self.records.wrapping_add(1);
        if let Record::Trial(row) = &stamped.record
            && row.verdict.is_none()
        {
            self.write_ground(Some(row), log_time).map_err(|error| self.failure(error))?;
        }
        let written = match &stamped.record {
            Record::Trial(row) => self.write_row(row, log_time),
            record => self.out.record(record, self.start_utc_ns, self.records, log_time),
        };
        written.and_then(|()| self.out.close_full_chunk()).map_err(|error| self.failure(error))
    }

    /// Passes everything to the operating system: it then survives a crash of the program.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.out.close_chunk().map_err(|error| self.failure(error))
    }

    /// Waits until everything is on the disk: it then survives a power cut. Takes milliseconds.
    pub fn sync(&mut self) -> Result<(), RecordingError> {
        self.flush()?;
        self.out.sync().map_err(|error| self.failure(error))
    }

    /// Completes the file with the trial table as an attachment and with its index, waits until it is on the disk, renames it and returns its final name.
    ///
    /// # Errors
    /// When the disk fails, or when a file of the final name exists by now; the recording then keeps the name `*.part`.
    pub fn finish(mut self) -> Result<PathBuf, RecordingError> {
        let attached = if self.rows.is_empty() {
            Ok(())
        } else {
            let table = trial_table::csv(&self.rows, &self.spans);
            self.out.attach(trial_table::NAME, "text/csv", &table, self.start_utc_ns)
        };
        attached.and_then(|()| self.out.finish()).map_err(|error| self.failure(error))?;
        if self.part != self.path {
            if self.path.exists() {
                return Err(RecordingError::Exists { path: self.path.clone() });
            }
            fs::rename(&self.part, &self.path).map_err(|source| RecordingError::Io {
                path: self.part.clone(),
                doing: "give the file its final name",
                source,
            })?;
        }
        Ok(self.path.clone())
    }

    /// Returns the error of a failed write: that of the first one, for example a full disk, if there were several.
    fn failure(&mut self, error: McapError) -> RecordingError {
        if let McapError::Io(source) = &error {
            self.failed = self.failed.or(source.raw_os_error());
        }
        let first = self.failed.map(|number| McapError::Io(io::Error::from_raw_os_error(number)));
        RecordingError::of_writing(&self.part, first.unwrap_or(error))
    }

    /// Returns the ticks written so far.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Returns the bytes passed to the disk so far, without the open chunk.
    pub fn bytes(&self) -> u64 {
        self.out.bytes()
    }

    /// Returns the final name.
    pub fn path(&self) -> &Path {
        &self.path
    }
}
