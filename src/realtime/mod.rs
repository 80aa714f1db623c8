//! The real-time boundary: what crosses it (all `Copy`) and how.

pub mod channel;
pub mod clock;
pub mod scheduling;
pub mod system;
pub mod thread;
