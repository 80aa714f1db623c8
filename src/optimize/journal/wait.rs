//! Waits of a journal: for the lock of its file, or for its server. Another thread sees and ends them; a program without a
//! screen prints them.

use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use strum::FromRepr;

/// A wait is printed after this time.
const NOTICED_AFTER: Duration = Duration::from_secs(1);

/// Cause of a journal's wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr)]
#[repr(u8)]
pub enum WaitedFor {
    /// The lock of its file, which another program holds.
    Lock = 1,
    /// A connection to its server.
    Server = 2,
}

impl WaitedFor {
    /// Returns the words for a message.
    pub fn words(self) -> &'static str {
        match self {
            WaitedFor::Lock => "the study's lock, which another program holds",
            WaitedFor::Server => "the study's server, which does not answer",
        }
    }
}

/// The waits of one thread for a journal, seen and ended from another thread.
#[derive(Debug, Clone, Default)]
pub struct JournalWait(Arc<WaitState>);

#[derive(Debug, Default)]
struct WaitState {
    /// Cause of the wait; 0 for none.
    waits_for: AtomicU8,
    /// Number of the present job.
    job: AtomicU64,
    /// Number of the job that is not to wait any more; `u64::MAX` for every job.
    interrupted: AtomicU64,
}

impl JournalWait {
    /// Returns what is waited for at present.
    pub fn waits_for(&self) -> Option<WaitedFor> {
        WaitedFor::from_repr(self.0.waits_for.load(Ordering::Acquire))
    }

    /// Begins job `number`, counted from 1, in the thread that writes.
    pub fn begin(&self, number: u64) {
        self.0.job.store(number, Ordering::Release);
    }

    /// Lets job `number` fail before it writes again; other jobs are not affected.
    pub fn interrupt(&self, number: u64) {
        self.0.interrupted.fetch_max(number, Ordering::AcqRel);
    }

    /// Lets every job fail before it writes again.
    pub fn interrupt_all(&self) {
        self.interrupt(u64::MAX);
    }

    pub(super) fn is_interrupted(&self) -> bool {
        let (job, interrupted) = (self.0.job.load(Ordering::Acquire), self.0.interrupted.load(Ordering::Acquire));
        job > 0 && (interrupted == job || interrupted == u64::MAX)
    }

    /// Sets what is waited for.
    pub(super) fn set(&self, waits_for: Option<WaitedFor>) {
        self.0.waits_for.store(waits_for.map_or(0, |what| what as u8), Ordering::Release);
    }
}

type Notice = Box<dyn Fn(&str) + Send>;

static NOTICE: Mutex<Option<Notice>> = Mutex::new(None);

/// Sends one line about each wait of more than a second to `notice`, for a program without a screen; none while there is one.
pub fn notice_waits(notice: Option<Notice>) {
    *NOTICE.lock().unwrap_or_else(PoisonError::into_inner) = notice;
}

/// One wait, announced once if it lasts.
#[derive(Debug)]
pub struct LongWait {
    since: Instant,
    announced: bool,
}

impl LongWait {
    /// A wait that begins now.
    pub fn begin() -> LongWait {
        LongWait { since: Instant::now(), announced: false }
    }

    /// Time since its begin.
    pub fn elapsed(&self) -> Duration {
        self.since.elapsed()
    }

    /// Announces the wait with `text` if it has lasted for more than a second and was not announced before. To be called
    /// in the loop that waits.
    pub fn announce(&mut self, text: impl FnOnce() -> String) {
        if self.announced || self.elapsed() < NOTICED_AFTER {
            return;
        }
        self.announced = true;
        if let Some(notice) = &*NOTICE.lock().unwrap_or_else(PoisonError::into_inner) {
            notice(&text());
        }
    }
}
