//! The arguments: KEY=VALUE.

use std::collections::BTreeMap;
use std::str::FromStr;

use quadfrog::session::parallel::cores;
use quadfrog::trial::Backend;

use crate::studies::{AFTER, Proposer};

/// The comparison; `main.rs` lists the keys.
pub(super) struct Settings {
    pub(super) tasks: Vec<String>,
    pub(super) proposers: Vec<Proposer>,
    pub(super) robots: usize,
    /// Studies of each proposer on each robot.
    pub(super) studies: usize,
    /// Jumps of a study.
    pub(super) trials: usize,
    pub(super) seed: u32,
    /// Pairs of studies of 100 jumps on each robot.
    pub(super) long_pairs: usize,
    /// Threads.
    pub(super) jobs: usize,
    /// In place of the task's configuration.
    pub(super) least_p_stand: Option<f64>,
    pub(super) fall_price: Option<f64>,
    /// Where the robots jump, and where those of the prior do.
    pub(super) backend: Backend,
    pub(super) prior_backend: Backend,
    /// Share of the torque limit of all robots.
    pub(super) torque_limit: Option<f64>,
}

impl Settings {
    /// Reads the arguments of the program.
    ///
    /// # Panics
    /// With a message if one is wrong.
    pub(super) fn from_arguments() -> Settings {
        let mut texts: BTreeMap<String, String> = [
            ("tasks", "forward,lateral-left,twist-ccw,continuous"),
            ("samplers", "sim,gp,tpe,ideal-first"),
            ("robots", "12"),
            ("studies", "20"),
            ("trials", "20"),
            ("seed", "9000"),
            ("long_pairs", "4"),
            ("jobs", ""),
            ("least_p_stand", ""),
            ("fall_price", ""),
            ("backend", Backend::Simulator.name()),
            ("prior_backend", ""),
            ("torque_limit", ""),
        ]
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .into();
        for argument in std::env::args().skip(1) {
            let known = argument.split_once('=').filter(|(key, _)| texts.contains_key(*key));
            let (key, value) =
                known.unwrap_or_else(|| panic!("`{argument}`: write KEY=VALUE, keys {:?}", texts.keys()));
            texts.insert(key.to_owned(), value.to_owned());
        }
        let backend = required(&texts, "backend", "sim or hardware");
        Settings {
            tasks: texts["tasks"].split(',').map(str::to_owned).collect(),
            proposers: texts["samplers"].split(',').map(Proposer::named).collect(),
            robots: required::<usize>(&texts, "robots", "a whole number").max(4),
            studies: required(&texts, "studies", "a whole number"),
            trials: required(&texts, "trials", "a whole number"),
            seed: required(&texts, "seed", "a whole number"),
            long_pairs: required(&texts, "long_pairs", "a whole number"),
            jobs: optional(&texts, "jobs", "a whole number").unwrap_or_else(cores),
            least_p_stand: optional(&texts, "least_p_stand", "a number"),
            fall_price: optional(&texts, "fall_price", "a number"),
            backend,
            prior_backend: optional(&texts, "prior_backend", "sim or hardware").unwrap_or(backend),
            torque_limit: optional(&texts, "torque_limit", "a number"),
        }
    }

    /// Whether studies have as many jumps as entry `after` of [`AFTER`].
    pub(super) fn reach(&self, after: usize) -> bool {
        AFTER[after] <= self.trials
    }
}

fn required<T: FromStr>(texts: &BTreeMap<String, String>, key: &str, wanted: &str) -> T {
    texts[key].parse().unwrap_or_else(|_| panic!("`{key}` is {wanted}"))
}

/// None where the value is empty.
fn optional<T: FromStr>(texts: &BTreeMap<String, String>, key: &str, wanted: &str) -> Option<T> {
    (!texts[key].is_empty()).then(|| required(texts, key, wanted))
}
