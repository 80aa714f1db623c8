//! Tables of trials.

pub mod table;
