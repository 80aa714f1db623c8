//! The operating system: thread, scheduling, clock, channels, properties of the machine.

pub mod channel;
pub mod clock;
pub mod scheduling;
pub mod sleep_lock;
pub mod system;
pub mod thread;
