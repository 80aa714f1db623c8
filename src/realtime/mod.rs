//! The operating system: thread, scheduling, clock, channels, properties of the machine.

pub mod channel;
pub mod clock;
pub mod scheduling;
pub mod system;
pub mod thread;
