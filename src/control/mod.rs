//! The 1 kHz cycle: read, estimate, watch, decide, limit, write, publish. Pure functions and one `tick()`; no thread,
//! no file, no lock, no allocation.

pub mod force_profile;
pub mod impedance;
pub mod leg;
pub mod vmc;
