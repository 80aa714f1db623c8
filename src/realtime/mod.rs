//! The real-time boundary: what crosses it (all `Copy`) and how.

pub mod command;
pub mod telemetry;
