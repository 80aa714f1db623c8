//! Studies of the tests, benches and examples of the optimizer.
#![allow(dead_code, reason = "each user takes its own part")]

use quadfrog::optimize::ask::{Direction, SamplerConfig};
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Outcome, Storage, Study, StudyOptions};
use serde_json::json;

/// A space of linear ranges: name, lower and upper bound.
pub fn linear<const N: usize>(ranges: [(&str, f64, f64); N]) -> Space {
    Space::new(ranges.map(|(name, low, high)| (name.to_owned(), Range::linear(low, high)))).unwrap()
}

/// The parameters of a jump forward.
pub fn forward() -> Space {
    linear([("f0", 0.75, 1.75), ("Fx", 0.0, 150.0), ("Fz", 150.0, 350.0)])
}

/// The parameters of a jump sideways.
pub fn sideways() -> Space {
    linear([("f0", 0.75, 1.75), ("Fx", 0.0, 150.0), ("Fy", 0.0, 150.0), ("Fz", 150.0, 350.0)])
}

/// [`forward`] with a logarithmic range.
pub fn forward_log() -> Space {
    let ranges = forward().parameters().to_vec().into_iter();
    Space::new(ranges.map(|p| (p.name.clone(), Range { log: p.name == "Fz", ..p.range }))).unwrap()
}

/// Options of a study that is maximized and does not wait for the disk.
pub fn options(space: Space, sampler: SamplerConfig) -> StudyOptions {
    StudyOptions {
        name: "forward".into(),
        direction: Direction::Maximize,
        metric: "distance [m]".into(),
        space,
        sampler,
        attributes: vec![("robot".into(), json!("go1"))],
        durability: Durability::Buffered,
    }
}

pub fn in_memory(options: StudyOptions) -> Study {
    Study::open(Storage::Memory, options).unwrap()
}

/// Begins the next trial.
pub fn begin(study: &mut Study) -> u32 {
    study.begin(&study.draft(), &[], &[]).unwrap()
}

/// Runs the next trial; its value is a function of its parameters.
pub fn run(study: &mut Study, value: impl Fn(&[(String, f64)]) -> f64) -> u32 {
    let number = begin(study);
    let value = value(&study.trial(number).unwrap().parameters);
    study.tell(number, Outcome::Complete(value)).unwrap();
    number
}
