//! Jobs on the experiment: given without waiting; their answers are published when they are finished.

use std::sync::Arc;

use super::Supervisor;
use super::unfinished::{ApprovalState, Asker, JobPurpose, UnfinishedJob};
use crate::optimize::prior::PriorModel;
use crate::recording::record::{LogLevel, Record, RequestRecord};
use crate::session::experiment::Experiment;
use crate::session::operator_request::StampedRequest;
use crate::session::prior::PriorWork;
use crate::session::storage::{ANSWERED_AFTER, ANSWERS_LATER, FinishedJob, JobOutput, StorageWatch};
use crate::telemetry::{Command, CommandRefusal, Mode, TrialSpec};
use crate::trial::{ExperimentStage, NOT_RUN};

/// A longer wait for the storage of the study is logged, ns.
const LOGGED_WAIT_NS: u64 = 1_000_000_000;
const STORAGE_LOST: &str = "the thread that stores the study has ended: sit down, quit and start again";

impl Supervisor {
    /// Moves the experiment to a thread of its own: neither a lock nor a slow disk delays this session then.
    ///
    /// # Errors
    /// When the system has no thread.
    pub fn with_storage_thread(mut self) -> std::io::Result<Supervisor> {
        self.experiment = self.experiment.on_a_thread()?;
        Ok(self)
    }

    /// Shows a screen whether the session waits for the storage of its study.
    pub fn storage_watch(&self) -> StorageWatch {
        self.experiment.watch()
    }

    /// Makes the prior of the sampler behind the session: requests to the study are answered after it, STOP, sit down and cancel
    /// at once. `make` returns the prior and adds messages for the operator, also where it fails; it ends soon after
    /// [`PriorWork::interrupt`], which the end of the session calls.
    pub fn make_prior(
        &mut self,
        time_ns: u64,
        make: impl FnOnce(&PriorWork, &mut Vec<(LogLevel, String)>) -> Result<Arc<PriorModel>, String> + Send + 'static,
    ) {
        let work = self.experiment.prior_work();
        self.give(JobPurpose::Prior, time_ns, move |experiment| {
            let mut messages = Vec::new();
            let made = make(&work, &mut messages);
            work.end();
            let used = made.and_then(|prior| experiment.use_prior(prior).map_err(|error| error.to_string()));
            JobOutput::Prior(messages, used)
        });
    }

    /// Gives a job on the experiment.
    pub(super) fn give(
        &mut self,
        purpose: JobPurpose,
        time_ns: u64,
        job: impl FnOnce(&mut Experiment) -> JobOutput + Send + 'static,
    ) {
        let number = self.experiment.give(time_ns, Box::new(job));
        self.unfinished.push_back(UnfinishedJob { number, given_ns: time_ns, purpose });
    }

    /// Publishes the results of the finished jobs, and ends the wait of an approval that does not hold any more.
    pub(super) fn finish_jobs(&mut self, time_ns: u64) {
        while let Some(FinishedJob { output, records, .. }) = self.experiment.take() {
            for record in records {
                self.publish(record, time_ns);
            }
            if let Some(job) = self.unfinished.pop_front() {
                self.finish(job.purpose, output, time_ns);
            }
        }
        if self.experiment.is_lost() {
            for job in std::mem::take(&mut self.unfinished) {
                if let JobPurpose::Request(stamped, asker) | JobPurpose::Approve(stamped, asker, _) = job.purpose {
                    self.respond(&stamped, asker, Err(STORAGE_LOST.to_owned()), time_ns);
                }
            }
            if !self.storage_lost {
                self.storage_lost = true;
                self.log(LogLevel::Error, STORAGE_LOST.to_owned(), time_ns);
            }
        }
        let void = |job: &&UnfinishedJob| match &job.purpose {
            JobPurpose::Approve(_, _, state) => self.approval_holds(state, time_ns).is_err(),
            _ => false,
        };
        if let Some(job) = self.unfinished.iter().find(void) {
            self.experiment.interrupt(job.number);
        }
        self.log_wait(time_ns);
    }

    fn finish(&mut self, purpose: JobPurpose, output: JobOutput, time_ns: u64) {
        match (purpose, output) {
            (JobPurpose::Request(stamped, asker), JobOutput::Answer(answer)) => {
                self.unattended.answered(&stamped.request, answer.is_ok());
                self.respond(&stamped, asker, answer, time_ns);
            }
            (JobPurpose::Request(stamped, asker), JobOutput::Judged(answer, over)) => {
                let ended = if over { self.end_review(asker) } else { Ok(()) };
                self.respond(&stamped, asker, ended.and(answer), time_ns);
            }
            (JobPurpose::Approve(stamped, asker, state), JobOutput::Approved(approved)) => {
                let answer = match (approved, self.approval_holds(&state, time_ns)) {
                    (Ok(spec), holds) => self.run_approved(&spec, &state, holds, time_ns),
                    (Err(refusal), Ok(())) => Err(refusal),
                    (Err(refusal), Err(reason)) => Err(format!("{reason} ({refusal})")),
                };
                self.respond(&stamped, asker, answer, time_ns);
            }
            (JobPurpose::Measure(trial), _) => {
                let review = self.experiment.view().stage == ExperimentStage::Review;
                if review && matches!(self.mode, Mode::Damped | Mode::Fault) {
                    let message = format!("trial {trial} ended in {}: {}", self.mode.name(), self.cause);
                    self.log(LogLevel::Warning, message, time_ns);
                }
            }
            (JobPurpose::KeepMeasurement(trial), JobOutput::Done(Err(error))) => {
                let message =
                    format!("the measurement of trial {trial} is not in the study yet: {error}; its verdict writes it");
                self.log(LogLevel::Warning, message, time_ns);
            }
            (JobPurpose::Refresh, JobOutput::Done(Err(error))) => {
                self.log(LogLevel::Error, format!("the study could not be read: {error}"), time_ns);
            }
            (JobPurpose::Prior, JobOutput::Prior(messages, used)) => {
                for (level, message) in messages {
                    self.log(level, message, time_ns);
                }
                // A session that ends has interrupted it.
                if let Err(reason) = used
                    && !self.closing
                {
                    let message = format!(
                        "the sampler sim has no prior: {reason}. Nothing is proposed; quit, and start again or with another --sampler"
                    );
                    self.log(LogLevel::Error, message, time_ns);
                }
            }
            (JobPurpose::Withdraw | JobPurpose::Close, JobOutput::Done(Err(error))) => {
                self.log(LogLevel::Error, format!("the study could not be written: {error}"), time_ns);
            }
            _ => {}
        }
    }

    /// Sends an approved trial to the control thread if its approval holds; otherwise it is void and proposed again.
    fn run_approved(
        &mut self,
        spec: &TrialSpec,
        state: &ApprovalState,
        holds: Result<(), String>,
        time_ns: u64,
    ) -> Result<String, String> {
        let trial = spec.trial;
        self.in_a_row = spec.jumps > 1;
        match holds.and_then(|()| self.command(Command::RunTrial(*spec, state.permit))) {
            Ok(()) => Ok("the countdown begins".to_owned()),
            Err(reason) => {
                let cause = format!("{NOT_RUN}{reason}");
                self.give(JobPurpose::Withdraw, time_ns, move |experiment| {
                    JobOutput::Done(experiment.withdraw(trial, &cause))
                });
                Err(format!("{reason}; trial {trial} was not run, its parameters are proposed again"))
            }
        }
    }

    /// Refuses an approval after STOP, a request to sit down or to cancel, a change of mode, or its time limit.
    pub(super) fn approval_holds(&self, state: &ApprovalState, time_ns: u64) -> Result<(), String> {
        if self.control.stop.count() != state.stops {
            return Err("STOP was pressed after it".to_owned());
        }
        self.fresh(state.permit.given_ns, time_ns)?;
        if self.mode_changes == state.permit.mode_changes { Ok(()) } else { Err(CommandRefusal::Stale.to_string()) }
    }

    /// Refuses a key press that is too old to energise, or was followed by a request to sit down or to cancel.
    pub(super) fn fresh(&self, given_ns: u64, time_ns: u64) -> Result<(), String> {
        if given_ns < self.control.lowering.newest_ns() {
            return Err(CommandRefusal::Lowered.to_string());
        }
        let (age_s, allowed_s) = (time_ns.saturating_sub(given_ns) as f64 * 1e-9, self.approval.expires_s);
        if age_s > allowed_s { Err(CommandRefusal::Expired { age_s, allowed_s }.to_string()) } else { Ok(()) }
    }

    /// Publishes an answer.
    pub(super) fn respond(
        &mut self,
        stamped: &StampedRequest,
        asker: Asker,
        answer: Result<String, String>,
        time_ns: u64,
    ) {
        if asker == Asker::Rule {
            self.rule_answered(&stamped.request, answer, time_ns);
            return;
        }
        let (accepted, answer) = match answer {
            Ok(answer) => (true, answer),
            Err(reason) => (false, reason),
        };
        let request = stamped.request.to_string();
        self.publish(Record::Request(RequestRecord { request, accepted, answer }), time_ns);
    }

    /// Logs a long wait for the storage, and its end.
    fn log_wait(&mut self, time_ns: u64) {
        let front = self.unfinished.front().map(|job| job.given_ns);
        match (front, self.waited_since_ns) {
            (Some(given_ns), None) if time_ns >= given_ns + LOGGED_WAIT_NS => {
                self.waited_since_ns = Some(given_ns);
                let place = self.experiment.waits_for();
                self.log(LogLevel::Warning, format!("waiting for {place}{ANSWERS_LATER}"), time_ns);
            }
            (front, Some(given_ns)) if front != Some(given_ns) => {
                self.waited_since_ns = None;
                let waited_s = time_ns.saturating_sub(given_ns) as f64 * 1e-9;
                self.log(LogLevel::Info, format!("{ANSWERED_AFTER}{waited_s:.1} s"), time_ns);
            }
            _ => {}
        }
    }
}
