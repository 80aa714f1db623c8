//! The 1 kHz control cycle: pure functions and one `tick()`, without thread, file, lock or allocation.

pub mod arming;
pub mod command_gate;
pub mod consistency;
pub mod control_loop;
pub mod cycle;
pub mod estimator;
pub mod failsafe;
mod failsafe_causes;
mod failsafe_inputs;
pub mod fault_landing;
pub mod foot_placement;
pub mod force_profile;
pub mod gain_blend;
pub mod impedance;
pub mod landing;
pub mod leg;
pub mod limit_key;
pub mod link_quality;
pub mod mode;
pub mod ramp;
pub mod readiness;
pub mod running_trial;
pub mod settings;
mod task_control;
pub mod vmc;
