//! Workers of a shared study.

use super::{Study, StudyError};
use crate::optimize::journal::{AttributeKind, Operation};

/// Study system attribute: number of workers that have joined.
const WORKERS: &str = "quadfrog:workers";

impl Study {
    /// Joins as a worker with the next free number, from 1 (0 is the session that created the study), and continues with
    /// the random streams of that worker's seed, [`worker_seed`]. [`StudyError::NoWorkerLeft`] after the largest number.
    pub fn join(&mut self) -> Result<u32, StudyError> {
        let study = self.id;
        let mut worker = 0;
        self.commit(|journal| {
            let joined =
                journal.studies().get(study).and_then(|record| record.system_attributes.get(WORKERS)?.as_u64());
            let joined = joined.unwrap_or(0);
            let next = u32::try_from(joined).ok().and_then(|joined| joined.checked_add(1));
            worker = next.ok_or(StudyError::NoWorkerLeft { attribute: WORKERS, joined })?;
            Ok(vec![Operation::study_attribute(study, AttributeKind::System, WORKERS, worker)])
        })?;
        self.options.sampler.seed = worker_seed(self.options.sampler.seed, worker);
        self.begin_streams();
        Ok(worker)
    }
}

/// The seed of a worker's streams: that of the study for worker 0; for others the upper half of a hash of study and worker
/// (SplitMix64 finalizer, Steele et al. 2014), so that workers propose different points.
pub fn worker_seed(study: u32, worker: u32) -> u32 {
    if worker == 0 {
        return study;
    }
    let mut z = (u64::from(worker) << 32 | u64::from(study)).wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z >> 32) as u32
}
