//! The recorder thread: writes ticks and records into the session's files, and delivers each trial's ticks to the session.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rtrb::Consumer;

use super::error::RecordingError;
use super::record::{Record, Stamped};
use super::session_writer::SessionWriter;
use crate::telemetry::{Mode, Tick};

/// Sleep of the thread when there is nothing to write; the ring holds several seconds.
const IDLE: Duration = Duration::from_millis(2);
/// Period of flushes to the operating system.
const FLUSH_PERIOD: Duration = Duration::from_secs(1);

/// Ticks of one trial, oldest first, from which the session measures the jump.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialTicks {
    /// The trial's number.
    pub trial: u32,
    /// All ticks that carried it and reached the recorder.
    pub ticks: Vec<Tick>,
}

/// Number of ticks delivered with a fault, including the first tick in FAULT.
pub const FAULT_TICKS: usize = 200;

/// Ticks that the recorder sends to the session.
#[derive(Debug, Clone, PartialEq)]
pub enum CollectedTicks {
    /// A trial's ticks, once it is over.
    Trial(TrialTicks),
    /// The last ticks up to the first in FAULT, oldest first.
    Fault(Vec<Tick>),
}

/// State of the recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecorderStatus {
    /// Bytes passed to the disk in all files, without the open chunk.
    pub bytes: u64,
    /// Ticks written in all files.
    pub ticks: u64,
    /// Final name of the present file; empty without a recording.
    pub file: PathBuf,
    /// Number of files begun.
    pub files: u32,
    /// Error of the present file, which ended the recording and keeps its name `*.mcap.part`. None without an error.
    pub error: Option<String>,
    /// First error of another file, which could not be begun or completed: the recording goes on in the present one. None without
    /// an error.
    pub warning: Option<String>,
    /// Whether the last file is complete and has its final name.
    pub finished: bool,
}

impl RecorderStatus {
    /// Returns the error of the present file, or of another one; none for a recording that is complete so far.
    pub fn incomplete(&self) -> Option<&str> {
        self.error.as_deref().or(self.warning.as_deref())
    }
}

/// Shared view of the state of the recording.
#[derive(Debug, Clone, Default)]
pub struct RecorderWatch(Arc<Mutex<RecorderStatus>>);

impl RecorderWatch {
    /// Returns the present state.
    pub fn get(&self) -> RecorderStatus {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// The recorder thread.
pub struct Recorder {
    ticks: Consumer<Tick>,
    records: Receiver<Stamped>,
    writer: Option<SessionWriter>,
    /// The writer after an error.
    failed: Option<SessionWriter>,
    handed: Sender<CollectedTicks>,
    trial: Option<TrialTicks>,
    /// The last ticks.
    last: VecDeque<Tick>,
    /// Received records that are not written yet.
    waiting: VecDeque<Stamped>,
    flushed: Instant,
    status: Arc<Mutex<RecorderStatus>>,
}

/// Handle of a recorder thread. After it is dropped, the thread runs until its producers are dropped.
pub struct RecorderHandle {
    status: Arc<Mutex<RecorderStatus>>,
    thread: JoinHandle<()>,
}

impl Recorder {
    /// Starts the thread. It completes the file and exits after the ring's producer and all senders of records are
    /// dropped and everything from them is written. Without a writer it records nothing and only delivers ticks: those of
    /// a trial at its end, the last ones at a fault.
    ///
    /// # Errors
    /// When the system cannot start a thread.
    pub fn spawn(
        ticks: Consumer<Tick>,
        records: Receiver<Stamped>,
        writer: Option<SessionWriter>,
        handed: Sender<CollectedTicks>,
    ) -> std::io::Result<RecorderHandle> {
        let status = Arc::new(Mutex::new(RecorderStatus::default()));
        let mut recorder = Recorder {
            ticks,
            records,
            writer,
            failed: None,
            handed,
            trial: None,
            last: VecDeque::with_capacity(FAULT_TICKS),
            waiting: VecDeque::new(),
            flushed: Instant::now(),
            status: status.clone(),
        };
        recorder.publish_present();
        let thread = std::thread::Builder::new().name("recorder".into()).spawn(move || recorder.run())?;
        Ok(RecorderHandle { status, thread })
    }

    fn run(&mut self) {
        loop {
            // Read before the queues are emptied, so that everything sent before the end is written.
            let no_more_ticks = self.ticks.is_abandoned();
            let no_more_records = self.take_records();
            let idle = self.write_new();
            if self.flushed.elapsed() >= FLUSH_PERIOD {
                self.flushed = Instant::now();
                self.write(SessionWriter::flush);
            }
            self.publish_present();
            if no_more_ticks && no_more_records && self.ticks.is_empty() {
                break;
            }
            if idle {
                std::thread::sleep(IDLE);
            }
        }
        self.deliver_trial();
        if let Some(writer) = self.writer.take() {
            self.publish(&writer);
            let (finished, trouble) = writer.finish();
            let mut status = self.status.lock().unwrap_or_else(PoisonError::into_inner);
            status.finished = finished.is_ok();
            status.error = finished.err().map(|error| error.to_string());
            status.warning = trouble.map(|error| error.to_string());
        }
        if let Some(failed) = self.failed.take() {
            failed.abandon();
        }
    }

    /// Takes the received records; returns whether all senders are dropped.
    fn take_records(&mut self) -> bool {
        loop {
            match self.records.try_recv() {
                Ok(record) => self.waiting.push_back(record),
                Err(TryRecvError::Empty) => return false,
                Err(TryRecvError::Disconnected) => return true,
            }
        }
    }

    /// Writes the received ticks and records in the order of time; returns whether there were none.
    fn write_new(&mut self) -> bool {
        let new_ticks = self.ticks.slots();
        let idle = new_ticks == 0 && self.waiting.is_empty();
        for _ in 0..new_ticks {
            let Ok(tick) = self.ticks.pop() else { break };
            while self.waiting.front().is_some_and(|record| record.time_ns <= tick.time_ns) {
                self.write_waiting();
            }
            self.write(|writer| writer.tick(&tick));
            self.collect(&tick);
        }
        while !self.waiting.is_empty() {
            self.write_waiting();
        }
        idle
    }

    fn write_waiting(&mut self) {
        let Some(stamped) = self.waiting.pop_front() else { return };
        self.write(|writer| writer.record(&stamped));
        if matches!(&stamped.record, Record::Trial(row) if row.verdict.is_some()) {
            self.write(SessionWriter::sync);
        }
    }

    /// Calls the writer; no more after an error.
    fn write(&mut self, act: impl FnOnce(&mut SessionWriter) -> Result<(), RecordingError>) {
        let Some(writer) = &mut self.writer else { return };
        if let Err(error) = act(writer) {
            self.publish_present();
            self.failed = self.writer.take();
            self.status.lock().unwrap_or_else(PoisonError::into_inner).error = Some(error.to_string());
        }
    }

    fn publish_present(&self) {
        if let Some(writer) = &self.writer {
            self.publish(writer);
        }
    }

    fn publish(&self, writer: &SessionWriter) {
        let mut status = self.status.lock().unwrap_or_else(PoisonError::into_inner);
        status.bytes = writer.bytes();
        status.ticks = writer.ticks();
        status.files = writer.files();
        if status.file != writer.path() {
            status.file = writer.path().to_path_buf();
        }
        if status.warning.is_none() {
            status.warning = writer.trouble().map(ToString::to_string);
        }
    }

    fn collect(&mut self, tick: &Tick) {
        if self.trial.as_ref().map(|trial| trial.trial) != tick.trial {
            self.deliver_trial();
            self.trial = tick.trial.map(|trial| TrialTicks { trial, ticks: Vec::new() });
        }
        if let Some(trial) = &mut self.trial {
            trial.ticks.push(*tick);
        }
        if self.last.len() == FAULT_TICKS {
            self.last.pop_front();
        }
        let before = self.last.back().map(|last| last.mode);
        self.last.push_back(*tick);
        if tick.mode == Mode::Fault && before != Some(Mode::Fault) {
            self.hand(CollectedTicks::Fault(self.last.iter().copied().collect()));
        }
    }

    fn deliver_trial(&mut self) {
        if let Some(trial) = self.trial.take() {
            self.hand(CollectedTicks::Trial(trial));
        }
    }

    fn hand(&self, ticks: CollectedTicks) {
        // A closed channel means that the session has ended; the file holds the ticks.
        let _ = self.handed.send(ticks);
    }
}

impl RecorderHandle {
    /// Returns a shared view of the state.
    pub fn watch(&self) -> RecorderWatch {
        RecorderWatch(Arc::clone(&self.status))
    }

    /// Returns the state of the recording.
    pub fn status(&self) -> RecorderStatus {
        self.status.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Whether the thread has exited.
    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits until the thread exits, after both producers are dropped, and returns the final state.
    pub fn join(self) -> RecorderStatus {
        let outcome = self.thread.join();
        let mut status = self.status.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if outcome.is_err() {
            status.error.get_or_insert_with(|| "the recorder thread panicked; please report it".into());
        }
        status
    }
}
