//! Work on a prior in one thread, seen and ended from another.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::PriorProgress;

/// Progress and interrupt of the work on a prior.
#[derive(Debug, Clone, Default)]
pub struct PriorWork(Arc<WorkState>);

#[derive(Debug, Default)]
struct WorkState {
    done: AtomicUsize,
    /// Jumps of the whole prior; 0 while there is no work.
    total: AtomicUsize,
    interrupt: AtomicBool,
}

impl PriorWork {
    /// Returns the progress; none while no prior is made.
    pub fn progress(&self) -> Option<PriorProgress> {
        let total = self.0.total.load(Ordering::Acquire);
        (total > 0).then(|| PriorProgress { done: self.0.done.load(Ordering::Acquire), total })
    }

    /// Reports progress, from any thread.
    pub fn report(&self, progress: PriorProgress) {
        self.0.done.fetch_max(progress.done, Ordering::AcqRel);
        self.0.total.store(progress.total, Ordering::Release);
    }

    /// Reports that the work has ended.
    pub fn end(&self) {
        self.0.total.store(0, Ordering::Release);
    }

    /// Ends the work within one jump.
    pub fn interrupt(&self) {
        self.0.interrupt.store(true, Ordering::Release);
    }

    /// Whether the work is to end, for [`simulate`](super::simulate).
    pub fn interrupted(&self) -> &AtomicBool {
        &self.0.interrupt
    }
}
