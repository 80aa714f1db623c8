//! Sentences of the paper beside figures of the program, each with a criterion by which the figures decide.

mod claim;
mod jumps;
mod robust;

pub use claim::{ClaimJudgement, PaperClaim};

use super::plan::PaperExperiment;
use super::results::ReproduceResults;

/// Returns the claims of the complete experiments.
pub fn claims(results: &ReproduceResults) -> Vec<PaperClaim> {
    let of = |experiment: &PaperExperiment| match experiment {
        PaperExperiment::Convergence => jumps::convergence(results),
        PaperExperiment::HardwareLike => jumps::hardware_like(results),
        PaperExperiment::HighTwist => jumps::high_twist(results),
        PaperExperiment::Directions => jumps::directions(results),
        PaperExperiment::Continuous => robust::continuous(results),
        PaperExperiment::RoughTerrain => robust::rough_terrain(results),
        PaperExperiment::Transfer => robust::transfer(results),
        PaperExperiment::Landing => robust::landing(results),
    };
    results.experiments.iter().flat_map(of).collect()
}
