//! Workers that take part in a study that others run too.

use serde_json::Value;

use super::{Study, StudyError};
use crate::optimize::journal::{JournalError, Operation};
use crate::optimize::sampler::Streams;

/// Study system attribute: how many workers have joined so far.
const WORKERS: &str = "quadfrog:workers";

impl Study {
    /// Takes part as one more worker: gets the next free number, from 1 (0 is the session that made the study), and
    /// proposes from then on with streams of its own seed, [`worker_seed`].
    ///
    /// # Errors
    /// If the journal cannot be read or written.
    pub fn join(&mut self) -> Result<u32, StudyError> {
        let study = self.id;
        let mut worker = 0;
        self.journal.commit(|replay| {
            let joined = replay.studies().get(study).and_then(|record| record.system_attributes.get(WORKERS)?.as_u64());
            worker = joined.unwrap_or(0) as u32 + 1;
            let key = WORKERS.to_owned();
            Ok::<_, JournalError>(vec![Operation::StudySystemAttribute { study, key, value: Value::from(worker) }])
        })?;
        self.options.sampler.seed = worker_seed(self.options.sampler.seed, worker);
        self.streams = Streams::new(self.options.sampler.seed);
        self.streams.advance_to(self.draws_so_far());
        Ok(worker)
    }
}

/// The seed of a worker's streams: that of the study for worker 0; for the others the upper half of a mix of both
/// (SplitMix64 finalizer, Steele et al. 2014), so that no two workers propose the same points.
pub fn worker_seed(study: u32, worker: u32) -> u32 {
    if worker == 0 {
        return study;
    }
    let mut z = (u64::from(worker) << 32 | u64::from(study)).wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z >> 32) as u32
}
