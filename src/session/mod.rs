//! The life of a trial: proposed, approved, run, measured, judged.

pub mod intent;
pub mod objective;
