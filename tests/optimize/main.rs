//! Tests of samplers, studies, journal and prior, as one program: each file is a module.

#[path = "../support/attached_console.rs"]
mod attached_console;
#[path = "../support/redis.rs"]
mod redis;
#[path = "../support/simulated.rs"]
mod simulated;
#[path = "../support/skip.rs"]
mod skip;
#[path = "../support/optimize.rs"]
mod support;

mod ask_tell;
mod exchange;
mod insight;
mod prior_file;
mod prior_worlds;
mod python;
mod redis_storage;
mod samplers;
mod sim;
mod studies;
mod study;
