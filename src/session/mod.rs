//! The session: the experiment with its trials, the requests of the operator, the checks before arming.

pub mod arming_checklist;
pub mod ask_tell;
pub mod automatic;
pub mod effort;
pub mod evaluation;
pub mod experiment;
pub mod objective;
pub mod operator_request;
pub mod parallel;
pub mod prior;
pub mod rejudge;
pub mod rollout;
pub mod storage;
pub mod supervisor;
