//! The life of a trial: proposed, approved, run, measured, judged.

pub mod arming_checklist;
pub mod automatic;
pub mod experiment;
pub mod objective;
pub mod operator_request;
pub mod rollout;
pub mod supervisor;
