//! The optimizer: ask and tell over plain numbers, independent of robots.
//!
//! `README.md` in this directory compares the samplers and lists the differences from Optuna.

pub mod ask;
pub mod exchange;
pub mod gp;
pub mod importance;
pub mod insight;
pub mod journal;
pub mod model_free;
pub mod mt19937;
pub mod observations;
pub mod parzen;
pub mod prior;
pub mod repeats;
pub mod sampler;
pub mod sim;
pub mod sobol;
pub mod space;
pub mod study;
pub mod tpe;
pub mod trial;
pub mod truncnorm;
