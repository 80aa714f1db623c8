//! The end of studies by a signal, or with the reader of their trials: each ends after its present trial, with a whole recording; a
//! second signal ends the program at once.

use std::sync::atomic::{AtomicI32, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use nix::sys::signal::Signal;
use quadfrog::optimize::journal::JournalWait;

use crate::output;
use crate::subcommand::interrupt::{AfterSignal, at_first_signal};

#[derive(Debug, Default)]
pub struct StudiesStop {
    /// Number of the signal; 0 without one.
    signal: AtomicI32,
    /// Number of studies that run.
    running: AtomicUsize,
    /// Waits of the studies that have begun.
    waits: Mutex<Vec<JournalWait>>,
}

/// A study that runs, until this is dropped.
pub struct RunningStudy<'a>(&'a StudiesStop);

impl StudiesStop {
    /// Returns a stop that the first signal sets; `print` prints a line for the operator.
    pub fn at_signal(print: impl Fn(&str) + Send + 'static) -> Arc<StudiesStop> {
        let stop: Arc<StudiesStop> = Arc::default();
        let set = Arc::clone(&stop);
        at_first_signal(move |signal| set.set(signal, print));
        stop
    }

    /// Sets the stop as SIGPIPE does if the reader of standard output has ended.
    pub fn end_with_reader(&self, print: impl Fn(&str)) {
        let begin = |signal| self.signal.compare_exchange(0, signal, Ordering::AcqRel, Ordering::Acquire).is_ok();
        if output::reader_has_ended() && begin(Signal::SIGPIPE as i32) {
            print("the reader of standard output has ended: the present trial and its recording are completed");
        }
    }

    /// Returns the signal that has set it.
    pub fn signal(&self) -> Option<Signal> {
        Signal::try_from(self.signal.load(Ordering::Acquire)).ok()
    }

    /// Enters a study whose waits for its journal end with a signal.
    pub fn enter(&self, wait: JournalWait) -> RunningStudy<'_> {
        // The only job of this study.
        wait.begin(1);
        self.waits.lock().unwrap_or_else(PoisonError::into_inner).push(wait);
        self.running.fetch_add(1, Ordering::AcqRel);
        RunningStudy(self)
    }

    fn set(&self, signal: Signal, print: impl Fn(&str)) -> AfterSignal {
        self.signal.store(signal as i32, Ordering::Release);
        if self.running.load(Ordering::Acquire) == 0 {
            return AfterSignal::End;
        }
        print("interrupted: the present trial and its recording are completed; Ctrl-C again ends at once");
        for wait in self.waits.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            if wait.waits_for().is_some() {
                wait.interrupt_all();
            }
        }
        AfterSignal::Finish
    }
}

impl Drop for RunningStudy<'_> {
    fn drop(&mut self) {
        self.0.running.fetch_sub(1, Ordering::AcqRel);
    }
}
