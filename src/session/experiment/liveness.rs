//! Liveness of the running trials of other workers. Workers may run on hosts whose clocks disagree, so no time stamp of
//! the journal is compared: a trial counts as abandoned when this session has seen it run for too long without news.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use crate::optimize::trial::{Trial, TrialState};

/// Times at which this session has seen the last news of running trials.
#[derive(Debug)]
pub struct Liveness {
    /// Time without news after which a running trial counts as abandoned.
    abandoned: Duration,
    /// By number: time of the last news, and the trial then.
    last_news: BTreeMap<u32, (Instant, Trial)>,
}

impl Liveness {
    pub fn new(abandoned: Duration) -> Liveness {
        Liveness { abandoned, last_news: BTreeMap::new() }
    }

    /// Records the present state of the trials; to be called whenever the study was read.
    pub fn update(&mut self, trials: &[Trial]) {
        let now = Instant::now();
        let mut before = std::mem::take(&mut self.last_news);
        let running = trials.iter().filter(|trial| trial.state == TrialState::Running);
        self.last_news = running
            .map(|trial| {
                // Every line is news: a judgement replaces the attributes of the rollout before, another program reports values.
                let since = before.remove(&trial.number).filter(|(_, had)| had == trial);
                (trial.number, since.unwrap_or_else(|| (now, trial.clone())))
            })
            .collect();
    }

    /// Returns whether a running trial may still be run by its worker; true for one that was never seen before.
    pub fn is_alive(&self, trial: &Trial) -> bool {
        self.last_news.get(&trial.number).is_none_or(|(since, _)| since.elapsed() < self.abandoned)
    }
}
