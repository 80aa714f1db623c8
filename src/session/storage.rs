//! The experiment behind a queue of jobs. On a thread of its own a journal's lock or a slow disk delays the answers of the
//! study, never the session thread.
//!
//! Jobs are carried out one after the other in the order in which they were given: a verdict is on disk before the next
//! proposal is made, and the proposals are those of a session that waits.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::time::Duration;

use super::experiment::{Experiment, RequestRefusal};
use super::prior::{PriorProgress, PriorWork};
use crate::optimize::journal::{JournalWait, WaitedFor};
use crate::recording::record::{LogLevel, Record};
use crate::telemetry::TrialSpec;
use crate::trial::{ExperimentStage, Verdict};

/// A piece of work on the experiment.
pub type ExperimentJob = Box<dyn FnOnce(&mut Experiment) -> JobOutput + Send>;

/// Result of a job.
pub enum JobOutput {
    /// Answer to a request.
    Answer(Result<String, String>),
    /// Answer to a verdict, and whether the review is over.
    Judged(Result<String, String>, bool),
    /// The approved trial.
    Approved(Result<TrialSpec, String>),
    /// A trial was measured or withdrawn, or the study was read or closed.
    Done(Result<(), RequestRefusal>),
    /// Messages of the work on the sampler's prior, and the reason if it has none.
    Prior(Vec<(LogLevel, String)>, Result<(), String>),
}

/// A job that was carried out.
pub struct FinishedJob {
    /// Its number.
    pub number: u64,
    /// Its result.
    pub output: JobOutput,
    /// Records since the job before.
    pub records: Vec<Record>,
    view: ExperimentView,
}

/// State of the experiment after a job.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExperimentView {
    /// Stage.
    pub stage: ExperimentStage,
    /// Trial and revision of the proposal.
    pub proposal: Option<(u32, u32)>,
    /// Verdict of the trial under review that holds without a person.
    pub suggested: Option<Verdict>,
}

impl ExperimentView {
    fn of(experiment: &Experiment) -> ExperimentView {
        ExperimentView {
            stage: experiment.stage(),
            proposal: experiment.proposal().map(|proposal| (proposal.trial, proposal.revision)),
            suggested: experiment.verdict_without_person(),
        }
    }
}

/// Name of the wait for the prior of the sampler `sim`.
const PRIOR: &str = "the simulated robots of the sampler sim";

/// End of the log line of a wait for the storage; the place that the session waits for comes before it.
pub const ANSWERS_LATER: &str = ": requests to the study are answered later; STOP, sit down and cancel do not wait";

/// Begin of the log line of the end of that wait; its length follows.
pub const ANSWERED_AFTER: &str = "the study answered after ";

/// Wait of the session for the storage of its study.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StorageWait {
    /// Time since the oldest unfinished job was given.
    pub waited: Duration,
    /// Cause of the journal's wait; none where the disk is slow.
    pub journal: Option<WaitedFor>,
    /// Progress of the prior of the sampler, where that is what is waited for.
    pub prior: Option<PriorProgress>,
}

impl StorageWait {
    /// Returns what is waited for.
    pub fn place(&self) -> &'static str {
        match (self.prior, self.journal) {
            (Some(_), _) => PRIOR,
            (None, Some(WaitedFor::Lock)) => "the study's lock",
            (None, Some(WaitedFor::Server)) => "the study's server",
            (None, None) => "the disk",
        }
    }
}

/// Shows a screen whether the session waits for the storage of its study.
#[derive(Debug, Clone, Default)]
pub struct StorageWatch {
    /// Time at which the oldest unfinished job was given, ns; 0 without one.
    since_ns: Arc<AtomicU64>,
    journal: JournalWait,
    prior: PriorWork,
}

/// Jobs that take less are not shown as a wait.
const SHOWN_AFTER: Duration = Duration::from_millis(300);

impl StorageWatch {
    /// Returns the present wait, if it is long enough to be shown.
    pub fn get(&self, now_ns: u64) -> Option<StorageWait> {
        let since_ns = self.since_ns.load(Ordering::Acquire);
        let waited = Duration::from_nanos(now_ns.saturating_sub(since_ns));
        let wait = || StorageWait { waited, journal: self.journal.waits_for(), prior: self.prior.progress() };
        (since_ns > 0 && waited >= SHOWN_AFTER).then(wait)
    }
}

/// The experiment and its jobs.
pub struct ExperimentQueue {
    place: JobPlace,
    view: ExperimentView,
    /// Number of the last job.
    given: u64,
    /// Times at which the unfinished jobs were given, ns, oldest first.
    unfinished: VecDeque<u64>,
    watch: StorageWatch,
}

enum JobPlace {
    /// In the calling thread: a job is finished when it has been given.
    Here(Box<Experiment>, VecDeque<FinishedJob>),
    Thread(Sender<(u64, ExperimentJob)>, Receiver<FinishedJob>),
    /// The thread has ended by a panic.
    Lost,
}

impl ExperimentQueue {
    /// Carries out the jobs in the calling thread.
    pub fn here(experiment: Experiment) -> ExperimentQueue {
        let watch =
            StorageWatch { since_ns: Arc::default(), journal: experiment.journal_wait(), prior: PriorWork::default() };
        ExperimentQueue {
            view: ExperimentView::of(&experiment),
            place: JobPlace::Here(Box::new(experiment), VecDeque::new()),
            given: 0,
            unfinished: VecDeque::new(),
            watch,
        }
    }

    /// Moves the experiment to a thread of its own, which ends with this queue.
    ///
    /// # Errors
    /// When the system has no thread.
    pub fn on_a_thread(mut self) -> std::io::Result<ExperimentQueue> {
        let mut experiment = match std::mem::replace(&mut self.place, JobPlace::Lost) {
            JobPlace::Here(experiment, _) => experiment,
            place => {
                self.place = place;
                return Ok(self);
            }
        };
        let (jobs, to_do) = channel::<(u64, ExperimentJob)>();
        let (to_session, done) = channel();
        let journal = self.watch.journal.clone();
        std::thread::Builder::new().name("storage".into()).spawn(move || {
            while let Ok((number, job)) = to_do.recv() {
                journal.begin(number);
                if to_session.send(carry_out(&mut experiment, number, job)).is_err() {
                    break;
                }
            }
        })?;
        self.place = JobPlace::Thread(jobs, done);
        Ok(self)
    }

    /// Gives a job. Returns its number.
    pub fn give(&mut self, time_ns: u64, job: ExperimentJob) -> u64 {
        self.given += 1;
        self.unfinished.push_back(time_ns.max(1));
        self.show_wait();
        match &mut self.place {
            JobPlace::Here(experiment, finished) => finished.push_back(carry_out(experiment, self.given, job)),
            // A thread that has ended is noticed by `take`.
            JobPlace::Thread(jobs, _) => drop(jobs.send((self.given, job))),
            JobPlace::Lost => {}
        }
        self.given
    }

    /// Takes the next finished job.
    pub fn take(&mut self) -> Option<FinishedJob> {
        let finished = match &mut self.place {
            JobPlace::Here(_, finished) => finished.pop_front()?,
            JobPlace::Thread(_, done) => match done.try_recv() {
                Ok(finished) => finished,
                Err(TryRecvError::Empty) => return None,
                Err(TryRecvError::Disconnected) => {
                    self.place = JobPlace::Lost;
                    return None;
                }
            },
            JobPlace::Lost => return None,
        };
        self.unfinished.pop_front();
        self.show_wait();
        self.view = finished.view;
        Some(finished)
    }

    /// Returns what an unfinished job waits for.
    pub fn waits_for(&self) -> &'static str {
        if self.watch.prior.progress().is_some() {
            return PRIOR;
        }
        self.watch.journal.waits_for().map_or("the disk", WaitedFor::words)
    }

    /// Returns the progress and the interrupt of the work on a prior, for a job that makes one.
    pub fn prior_work(&self) -> PriorWork {
        self.watch.prior.clone()
    }

    /// Ends the wait of job `number` for the journal: it fails, with nothing written.
    pub fn interrupt(&self, number: u64) {
        self.watch.journal.interrupt(number);
    }

    /// State after the last job that was taken.
    pub fn view(&self) -> &ExperimentView {
        &self.view
    }

    /// Whether the thread has ended by a panic: nothing is carried out any more.
    pub fn is_lost(&self) -> bool {
        matches!(self.place, JobPlace::Lost)
    }

    /// Shows a screen whether the session waits.
    pub fn watch(&self) -> StorageWatch {
        self.watch.clone()
    }

    fn show_wait(&self) {
        self.watch.since_ns.store(self.unfinished.front().copied().unwrap_or(0), Ordering::Release);
    }
}

impl Drop for ExperimentQueue {
    /// A thread that waits for a lock must not write after the session has ended: the folder is free then.
    fn drop(&mut self) {
        self.watch.journal.interrupt_all();
        self.watch.prior.interrupt();
    }
}

fn carry_out(experiment: &mut Experiment, number: u64, job: ExperimentJob) -> FinishedJob {
    let output = job(experiment);
    FinishedJob { number, output, records: experiment.take_records(), view: ExperimentView::of(experiment) }
}
