//! Writer of a session's recording: in numbered files, each complete in itself, with whole trials.

use std::mem::discriminant;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use super::error::RecordingError;
use super::record::{Record, StageRecord, Stamped};
use super::session_files::next_recording;
use super::writer::Writer;
use crate::telemetry::Tick;
use crate::trial::ExperimentStage;

/// Size and duration after which a recording continues in the next file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RotationLimits {
    /// Bytes on the disk.
    pub bytes: u64,
    /// Time since the file's first message, ns.
    pub duration_ns: u64,
}

/// Begins a file of the session: its path, and the time since the engine started of its first messages, ns.
pub type BeginFile = Box<dyn FnMut(&Path, u64) -> Result<Writer, RecordingError> + Send>;

/// A file that is being completed.
type Completing = JoinHandle<Result<PathBuf, RecordingError>>;

/// Writer of a session's recording. After a file has reached one of its limits, the next one is begun as soon as the present
/// trial has its verdict: all ticks and rollouts of a trial are in one file. The old file is completed on a thread of its own.
pub struct SessionWriter {
    writer: Writer,
    rotation: Option<(RotationLimits, BeginFile)>,
    completing: Option<Completing>,
    /// Bytes and ticks of the files before the present one.
    before: (u64, u64),
    files: u32,
    begun_ns: u64,
    /// Time of the latest tick or record, ns.
    latest_ns: u64,
    /// The newest record of each kind that describes the session's present state.
    state: Vec<Record>,
    stage: Option<StageRecord>,
    /// Trial of the last tick that had one.
    ran: Option<u32>,
    /// First error of a file that could not be begun or completed.
    trouble: Option<RecordingError>,
}

impl From<Writer> for SessionWriter {
    /// Returns the writer of a single file.
    fn from(writer: Writer) -> SessionWriter {
        SessionWriter {
            writer,
            rotation: None,
            completing: None,
            before: (0, 0),
            files: 1,
            begun_ns: 0,
            latest_ns: 0,
            state: Vec::new(),
            stage: None,
            ran: None,
            trouble: None,
        }
    }
}

impl SessionWriter {
    /// Begins the session's first file `path`.
    ///
    /// # Errors
    /// Those of `begin_file`.
    pub fn create(
        path: &Path,
        limits: RotationLimits,
        mut begin_file: BeginFile,
    ) -> Result<SessionWriter, RecordingError> {
        let writer = begin_file(path, 0)?;
        Ok(SessionWriter { rotation: Some((limits, begin_file)), ..SessionWriter::from(writer) })
    }

    /// Writes one tick.
    ///
    /// # Errors
    /// When the present file cannot be written.
    pub fn tick(&mut self, tick: &Tick) -> Result<(), RecordingError> {
        self.rotate_if_due(tick.time_ns);
        self.latest_ns = self.latest_ns.max(tick.time_ns);
        self.ran = tick.trial.or(self.ran);
        self.writer.tick(tick)
    }

    /// Writes one record.
    ///
    /// # Errors
    /// When the present file cannot be written.
    pub fn record(&mut self, stamped: &Stamped) -> Result<(), RecordingError> {
        let record = &stamped.record;
        if let Record::Stage(stage) = record {
            // In simulated time there are no ticks between trials.
            if stage.stage == ExperimentStage::Running {
                self.rotate_if_due(stamped.time_ns);
            }
            self.stage = Some(*stage);
        }
        self.latest_ns = self.latest_ns.max(stamped.time_ns);
        if is_state(record) {
            self.state.retain(|known| discriminant(known) != discriminant(record));
            self.state.push(record.clone());
        }
        self.writer.record(stamped)
    }

    /// Whether no trial runs, waits for a verdict, or has rollouts to come.
    fn between_trials(&self) -> bool {
        match self.stage {
            None => self.ran.is_none(),
            Some(StageRecord { stage: ExperimentStage::Proposed, trial, .. }) => self.ran != Some(trial),
            Some(stage) => stage.stage == ExperimentStage::Finished,
        }
    }

    /// Begins the next file at `time_ns` if the present one has reached a limit and holds nothing later: a record can be ahead of
    /// the ticks of its time. If that fails, the present one goes on.
    fn rotate_if_due(&mut self, time_ns: u64) {
        let Some((limits, _)) = &self.rotation else { return };
        let due = time_ns.saturating_sub(self.begun_ns) >= limits.duration_ns || self.writer.bytes() >= limits.bytes;
        if !due || time_ns < self.latest_ns || !self.between_trials() {
            return;
        }
        let last = self.writer.path();
        let folder = last.parent().unwrap_or(Path::new(""));
        let Some(path) = next_recording(folder, Some(last)) else { return };
        let Some((_, begin_file)) = &mut self.rotation else { return };
        match begin(begin_file, &path, time_ns, &self.writer, &self.state) {
            Ok(next) => {
                let old = std::mem::replace(&mut self.writer, next);
                self.before = (self.before.0 + old.bytes(), self.before.1 + old.ticks());
                self.files += 1;
                self.begun_ns = time_ns;
                self.complete(old);
            }
            Err(error) => {
                if !matches!(error, RecordingError::Exists { .. }) {
                    // It was begun here and holds nothing that the present file does not hold.
                    let _ = std::fs::remove_file(path.with_extension("mcap.part"));
                }
                self.trouble.get_or_insert(error);
                self.rotation = None;
            }
        }
    }

    /// Completes a file without delay for the next one: its index and its last bytes may take seconds on a slow disk.
    fn complete(&mut self, old: Writer) {
        // Of two files one after the other the first is waited for.
        self.take_completed();
        match std::thread::Builder::new().name("recording's end".into()).spawn(move || old.finish()) {
            Ok(thread) => self.completing = Some(thread),
            Err(source) => {
                let (path, doing) = (self.writer.path().to_path_buf(), "start a thread that completes the file before");
                self.trouble.get_or_insert(RecordingError::Io { path, doing, source });
            }
        }
    }

    /// Waits for the file that is being completed.
    fn take_completed(&mut self) {
        let Some(thread) = self.completing.take() else { return };
        let completed = thread.join().unwrap_or_else(|_| {
            let source = std::io::Error::other("the thread panicked; please report it");
            let path = self.writer.path().to_path_buf();
            Err(RecordingError::Io { path, doing: "complete the file before", source })
        });
        if let Err(error) = completed {
            self.trouble.get_or_insert(error);
        }
    }

    /// Passes everything to the operating system, as [`Writer::flush`].
    ///
    /// # Errors
    /// When the present file cannot be written.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        if self.completing.as_ref().is_some_and(JoinHandle::is_finished) {
            self.take_completed();
        }
        self.writer.flush()
    }

    /// Waits until everything is on the disk, as [`Writer::sync`].
    ///
    /// # Errors
    /// When the present file cannot be written.
    pub fn sync(&mut self) -> Result<(), RecordingError> {
        self.writer.sync()
    }

    /// Completes all files. Returns the name of the last one or the error for which it is not complete, and the first error of
    /// the others.
    pub fn finish(mut self) -> (Result<PathBuf, RecordingError>, Option<RecordingError>) {
        self.take_completed();
        (self.writer.finish(), self.trouble)
    }

    /// Completes the file before and leaves the present one, which cannot be written any more.
    pub fn abandon(mut self) {
        self.take_completed();
    }

    /// Returns the first error of a file that could not be begun or completed. The recording goes on.
    pub fn trouble(&self) -> Option<&RecordingError> {
        self.trouble.as_ref()
    }

    /// Returns the ticks written so far into all files.
    pub fn ticks(&self) -> u64 {
        self.before.1 + self.writer.ticks()
    }

    /// Returns the bytes passed to the disk so far in all files, without the open chunk.
    pub fn bytes(&self) -> u64 {
        self.before.0 + self.writer.bytes()
    }

    /// Returns the number of files begun.
    pub fn files(&self) -> u32 {
        self.files
    }

    /// Returns the final name of the present file.
    pub fn path(&self) -> &Path {
        self.writer.path()
    }
}

/// Begins the file after `before`, with the session's state at its beginning.
fn begin(
    begin_file: &mut BeginFile,
    path: &Path,
    time_ns: u64,
    before: &Writer,
    state: &[Record],
) -> Result<Writer, RecordingError> {
    let mut next = begin_file(path, time_ns)?;
    next.continue_after(before)?;
    for record in state {
        next.record(&Stamped { time_ns, record: record.clone() })?;
    }
    Ok(next)
}

/// Whether the newest record of its kind describes the session's present state.
fn is_state(record: &Record) -> bool {
    match record {
        Record::Stage(_)
        | Record::Proposal(_)
        | Record::ArmingChecks(_)
        | Record::Search(_)
        | Record::Insight(_)
        | Record::Points(_) => true,
        // Each file begins with the session; the writer keeps the rows of the trials.
        Record::Session(_) | Record::Trial(_) => false,
        Record::Transition(_) | Record::Request(_) | Record::Counters(_) | Record::Log(_) => false,
        Record::FaultTicks(_) => false,
    }
}
