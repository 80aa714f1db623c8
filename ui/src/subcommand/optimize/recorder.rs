//! Recording of trials that ran in simulated time, one after the other on the recording's clock.

use std::path::Path;

use quadfrog::engine::{self, EngineError, Options};
use quadfrog::recording::record::{LogLevel, LogRecord, Record, Stamped, Transition};
use quadfrog::recording::session_writer::SessionWriter;
use quadfrog::session::automatic::JudgedTrial;
use quadfrog::telemetry::{Counters, Tick};
use quadfrog::trial::{TrialRecord, Verdict};

/// Period of the counters, as of a session in real time.
const COUNTERS_PERIOD_NS: u64 = 100_000_000;
/// Period of the control cycle.
const TICK_NS: u64 = 1_000_000;
/// Source of this program's lines in the log.
const SOURCE: &str = "optimize";

/// One rollout with its records. Its ticks are several megabytes: they are taken, not copied.
pub struct RecordedRollout {
    before: Vec<Record>,
    ticks: Vec<Tick>,
    transitions: Vec<(u64, Transition)>,
    after: Vec<Record>,
}

impl RecordedRollout {
    /// Copies the records of a judged trial with its line of the log and takes its ticks; the next rollout fills `spare`.
    pub fn of(trial: JudgedTrial, spare: Vec<Tick>) -> RecordedRollout {
        let mut after = trial.after.to_vec();
        let log = |level, message| Record::Log(LogRecord { level, source: SOURCE.to_owned(), message });
        let verdict = trial.row.verdict.map_or("its next rollout follows", Verdict::name);
        after.push(log(LogLevel::Info, format!("trial {}: {verdict}: {}", trial.row.trial, trial.cause)));
        after.extend(trial.warning.map(|warning| log(LogLevel::Warning, warning.to_owned())));
        RecordedRollout {
            before: trial.before.to_vec(),
            ticks: std::mem::replace(trial.ticks, spare),
            transitions: trial.transitions.to_vec(),
            after,
        }
    }

    /// Its ticks, to be filled by another rollout.
    pub fn into_ticks(self) -> Vec<Tick> {
        self.ticks
    }
}

/// A recording in simulated time.
pub struct StudyRecorder {
    writer: SessionWriter,
    time_ns: u64,
    counters_ns: u64,
}

impl StudyRecorder {
    pub fn create(path: &Path, options: &Options) -> Result<StudyRecorder, EngineError> {
        Ok(StudyRecorder { writer: engine::create_recording(path, options)?, time_ns: 0, counters_ns: 0 })
    }

    /// Adds a rollout after everything before it.
    pub fn rollout(&mut self, rollout: &RecordedRollout) -> Result<(), EngineError> {
        self.records(&rollout.before)?;
        let start_ns = self.time_ns;
        let mut transitions = rollout.transitions.iter().peekable();
        for tick in &rollout.ticks {
            self.time_ns = start_ns + tick.time_ns;
            while let Some((_, transition)) = transitions.next_if(|(time_ns, _)| *time_ns <= tick.time_ns) {
                self.record(Record::Transition(transition.clone()))?;
            }
            if self.time_ns >= self.counters_ns {
                // Simulated time: no tick is late and none is lost.
                self.record(Record::Counters(Counters::default()))?;
                self.counters_ns = self.time_ns + COUNTERS_PERIOD_NS;
            }
            self.writer.tick(&Tick { time_ns: self.time_ns, ..*tick })?;
        }
        for (_, transition) in transitions {
            self.record(Record::Transition(transition.clone()))?;
        }
        self.time_ns += TICK_NS;
        self.records(&rollout.after)
    }

    /// Adds rows of the trial table.
    pub fn rows<'a>(&mut self, rows: impl Iterator<Item = &'a TrialRecord>) -> Result<(), EngineError> {
        rows.into_iter().try_for_each(|row| self.record(Record::Trial(row.clone())))
    }

    /// Adds the last records and the whole table, and completes the file.
    pub fn finish<'a>(
        mut self,
        records: &[Record],
        rows: impl Iterator<Item = &'a TrialRecord>,
    ) -> Result<(), EngineError> {
        self.time_ns += TICK_NS;
        self.records(records)?;
        self.rows(rows)?;
        let (finished, trouble) = self.writer.finish();
        finished?;
        Ok(trouble.map_or(Ok(()), Err)?)
    }

    fn records(&mut self, records: &[Record]) -> Result<(), EngineError> {
        records.iter().try_for_each(|record| self.record(record.clone()))
    }

    fn record(&mut self, record: Record) -> Result<(), EngineError> {
        Ok(self.writer.record(&Stamped { time_ns: self.time_ns, record })?)
    }
}
