//! The engine of quadfrog.

pub mod config;
pub mod control;
pub mod engine;
pub mod optimize;
pub mod realtime;
pub mod recording;
pub mod report;
pub mod robot;
pub mod session;
pub mod sim;
