//! The recorder thread: ticks and records into one file, and the ticks of each trial to whoever measures it.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rtrb::Consumer;

use super::error::RecordingError;
use super::record::{Record, Stamped};
use super::writer::Writer;
use crate::telemetry::{Mode, Tick};

/// How long the thread sleeps when there is nothing to write; the ring holds several seconds.
const IDLE: Duration = Duration::from_millis(2);
/// How often everything is handed to the operating system.
const FLUSH_PERIOD: Duration = Duration::from_secs(1);

/// The ticks of one trial, oldest first: what the session measures from.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialTicks {
    /// The trial's number.
    pub trial: u32,
    /// All ticks that carried it and reached the recorder.
    pub ticks: Vec<Tick>,
}

/// Ticks that are handed on with a fault, the first faulty one among them.
pub const FAULT_TICKS: usize = 200;

/// Ticks that the recorder sends to the session.
#[derive(Debug, Clone, PartialEq)]
pub enum CollectedTicks {
    /// A trial's ticks, once it is over.
    Trial(TrialTicks),
    /// The last ticks up to the first in FAULT, oldest first.
    Fault(Vec<Tick>),
}

/// How the recording is doing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecorderStatus {
    /// Bytes handed to the disk; the open chunk is not among them.
    pub bytes: u64,
    /// Ticks written.
    pub ticks: u64,
    /// Why nothing is written any more; the recording ends where it failed, under its name `*.mcap.part`.
    pub error: Option<String>,
    /// Whether the file is complete and has its final name.
    pub finished: bool,
}

/// A view of how the recording is doing, for whoever has to say so.
#[derive(Debug, Clone, Default)]
pub struct RecorderWatch(Arc<Mutex<RecorderStatus>>);

impl RecorderWatch {
    /// How it is doing now.
    pub fn get(&self) -> RecorderStatus {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// The recorder thread.
pub struct Recorder {
    ticks: Consumer<Tick>,
    records: Receiver<Stamped>,
    writer: Option<Writer>,
    handed: Sender<CollectedTicks>,
    trial: Option<TrialTicks>,
    /// The last ticks.
    last: VecDeque<Tick>,
    /// Records that came and are not written yet.
    waiting: VecDeque<Stamped>,
    flushed: Instant,
    status: Arc<Mutex<RecorderStatus>>,
}

/// The other end of a recorder thread. Dropped, the thread goes on until its producers are gone.
pub struct RecorderHandle {
    status: Arc<Mutex<RecorderStatus>>,
    thread: JoinHandle<()>,
}

impl Recorder {
    /// Starts the thread. It ends, and completes the file, once the ring's producer and every sender of records are
    /// gone and everything from them is written. Without a writer it records nothing and only hands on ticks: those
    /// of a trial when the ticks stop carrying its number, and the last ones at a fault.
    ///
    /// # Panics
    /// When the system has no thread left.
    pub fn spawn(
        ticks: Consumer<Tick>,
        records: Receiver<Stamped>,
        writer: Option<Writer>,
        handed: Sender<CollectedTicks>,
    ) -> RecorderHandle {
        let status = Arc::new(Mutex::new(RecorderStatus::default()));
        let mut recorder = Recorder {
            ticks,
            records,
            writer,
            handed,
            trial: None,
            last: VecDeque::with_capacity(FAULT_TICKS),
            waiting: VecDeque::new(),
            flushed: Instant::now(),
            status: status.clone(),
        };
        recorder.publish();
        let thread = std::thread::Builder::new()
            .name("recorder".into())
            .spawn(move || recorder.run())
            .expect("a thread can be started");
        RecorderHandle { status, thread }
    }

    fn run(&mut self) {
        loop {
            // Asked before the queues are emptied: what was sent before the end is still taken.
            let no_more_ticks = self.ticks.is_abandoned();
            let no_more_records = self.take_records();
            let idle = self.write_new();
            if self.flushed.elapsed() >= FLUSH_PERIOD {
                self.flushed = Instant::now();
                self.write(Writer::flush);
            }
            self.publish();
            if no_more_ticks && no_more_records && self.ticks.is_empty() {
                break;
            }
            if idle {
                std::thread::sleep(IDLE);
            }
        }
        self.hand_on_trial();
        if let Some(writer) = self.writer.take() {
            let (bytes, ticks) = (writer.bytes(), writer.ticks());
            let finished = writer.finish();
            let mut status = self.status.lock().unwrap_or_else(PoisonError::into_inner);
            *status = RecorderStatus {
                bytes,
                ticks,
                finished: finished.is_ok(),
                error: finished.err().map(|error| error.to_string()),
            };
        }
    }

    /// Whether all senders are gone.
    fn take_records(&mut self) -> bool {
        loop {
            match self.records.try_recv() {
                Ok(record) => self.waiting.push_back(record),
                Err(TryRecvError::Empty) => return false,
                Err(TryRecvError::Disconnected) => return true,
            }
        }
    }

    /// Writes what has come, in the order of time; whether there was nothing.
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
            self.write(Writer::sync);
        }
    }

    /// Lets the writer do something; if it fails it was its last.
    fn write(&mut self, act: impl FnOnce(&mut Writer) -> Result<(), RecordingError>) {
        let Some(writer) = &mut self.writer else { return };
        if let Err(error) = act(writer) {
            self.publish();
            self.writer = None;
            self.status.lock().unwrap_or_else(PoisonError::into_inner).error = Some(error.to_string());
        }
    }

    fn publish(&self) {
        let Some(writer) = &self.writer else { return };
        let mut status = self.status.lock().unwrap_or_else(PoisonError::into_inner);
        status.bytes = writer.bytes();
        status.ticks = writer.ticks();
    }

    fn collect(&mut self, tick: &Tick) {
        if self.trial.as_ref().map(|trial| trial.trial) != tick.trial {
            self.hand_on_trial();
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
            let _ = self.handed.send(CollectedTicks::Fault(self.last.iter().copied().collect())); // as with a trial's
        }
    }

    fn hand_on_trial(&mut self) {
        if let Some(trial) = self.trial.take() {
            let _ = self.handed.send(CollectedTicks::Trial(trial)); // nobody measures any more: nothing is lost, the file has them
        }
    }
}

impl RecorderHandle {
    /// A view that may be kept elsewhere.
    pub fn watch(&self) -> RecorderWatch {
        RecorderWatch(Arc::clone(&self.status))
    }

    /// How the recording is doing.
    pub fn status(&self) -> RecorderStatus {
        self.status.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Whether the thread has ended.
    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits for the thread to end, which it does when both producers are gone, and says how the recording ended.
    pub fn join(self) -> RecorderStatus {
        let outcome = self.thread.join();
        let mut status = self.status.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if outcome.is_err() {
            status.error.get_or_insert_with(|| "the recorder's thread broke down; please report it".into());
        }
        status
    }
}
