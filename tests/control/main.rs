//! Tests of the controller, its modes and failsafes, and the estimator, as one program: each file is a module.

#[path = "../support/bench.rs"]
mod bench;
#[path = "../support/cores.rs"]
mod cores;
#[path = "../support/emulated.rs"]
mod emulated;
#[path = "../support/estimation.rs"]
mod estimation;
#[path = "../support/go1.rs"]
mod go1;
#[path = "../support/robots.rs"]
mod robots;

mod accelerometer;
mod arming;
mod consistency;
mod covariance;
mod cycle;
mod estimator;
mod estimator_late;
mod failsafe;
mod force_signs;
mod gaps;
mod landing;
mod landing_terms;
mod mode;
mod readiness;
mod rotation;
mod series;
mod slewed_clock;
mod standing;
mod warm_up;
