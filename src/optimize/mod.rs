//! The optimizer: ask and tell over plain numbers. It does not know what a robot is.
//!
//! | module | what it is |
//! |---|---|
//! | [`space`], [`trial`] | what is searched, what was tried |
//! | [`sampler`] | the settings, and who proposes: [`tpe`] (on [`parzen`], [`truncnorm`]), [`gp`], [`sobol`] |
//! | [`mt19937`] | the random streams, equal to NumPy's |
//! | [`study`] | draft, begin, tell: what has been tried and what comes next |
//! | [`journal`] | the study on disk or on a Redis server, in Optuna's format |
//! | [`exchange`] | trials as tables: CSV and JSON, Optuna's columns |
//! | [`insight`], [`importance`], [`repeats`] | for the operator: densities, risk; what matters; repeats of a point, confirming the best |
//!
//! `README.md` beside this file compares the samplers and says where equality with Optuna ends.

pub mod exchange;
pub mod gp;
pub mod importance;
pub mod insight;
pub mod journal;
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
