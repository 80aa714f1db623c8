//! The 1 kHz cycle: read, estimate, watch, decide, limit, write, publish. Pure functions and one `tick()`; no thread,
//! no file, no lock, no allocation.

pub mod arming;
pub mod control_loop;
pub mod cycle;
pub mod estimator;
pub mod failsafe;
pub mod foot_placement;
pub mod force_profile;
pub mod impedance;
pub mod jump;
pub mod leg;
pub mod limits;
pub mod mode;
pub mod ramp;
pub mod settings;
pub mod vmc;
