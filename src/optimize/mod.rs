//! The optimizer: ask and tell over plain numbers, independent of robots.
//!
//! | module | content |
//! |---|---|
//! | [`space`], [`trial`] | search space and trials |
//! | [`ask`] | settings, random streams, question and answer of a sampler |
//! | [`sampler`] | dispatch to [`tpe`] (with [`parzen`], [`truncnorm`]), [`gp`] and [`model_free`] (with [`sobol`]) |
//! | [`mt19937`] | random streams equal to NumPy's |
//! | [`study`] | draft, begin, tell: history and next proposal |
//! | [`journal`] | the study on disk or on a Redis server, in Optuna's format |
//! | [`exchange`] | trials as tables: CSV and JSON with Optuna's columns |
//! | [`insight`], [`importance`] | for the operator: densities, falls nearby, importance of parameters |
//! | [`repeats`] | repeats of a point, the best trial, its confirmation |
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
pub mod parzen;
pub mod repeats;
pub mod sampler;
pub mod sobol;
pub mod space;
pub mod study;
pub mod tpe;
pub mod trial;
pub mod truncnorm;
