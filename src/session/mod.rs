//! The life of a trial: proposed, approved, run, measured, judged.

pub mod approval;
pub mod automatic;
pub mod intent;
pub mod life;
pub mod objective;
pub mod pre_arm;
pub mod rollout;
pub mod supervisor;
