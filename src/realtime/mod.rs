//! The real-time boundary: what crosses it (all `Copy`) and how.

pub mod channel;
pub mod clock;
pub mod command;
pub mod pre_arm;
pub mod telemetry;
pub mod thread;
