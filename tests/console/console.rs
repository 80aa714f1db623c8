//! Tests of the console and of its command line, in one program: it is linked once, and its files run beside each other.
//! `cargo test --test console log_view` runs one file. Programs of their own are `memory`, with another allocator, and `measure`.

#[path = "support/precision.rs"]
mod precision;
#[path = "support/program.rs"]
mod program;
#[path = "support/pty.rs"]
mod pty;
#[path = "../support/python_reader.rs"]
mod python_reader;
#[path = "../support/redis.rs"]
mod redis;
#[path = "../support/skip.rs"]
mod skip;
mod support;

mod attach;
mod cell_encoder;
mod charts;
mod closing;
mod command_line;
mod configuration;
mod connection;
mod dialogs;
mod emulate;
mod evaluate;
mod export;
mod first_user;
#[cfg(feature = "go2")]
mod go2_takeover;
mod graphics;
mod guard;
mod health_view;
mod interrupts;
mod judged_by;
mod judging;
mod kept_overrides;
mod kept_robot;
mod keys;
mod live_view;
mod log_view;
mod looks;
mod narrow;
mod near_robot;
mod operator_mistakes;
mod optuna_versions;
mod output;
mod parameters;
mod places;
mod prior;
mod queue;
mod readme_rules;
mod readme_user;
mod real_keys;
mod recorded;
mod recording;
mod rejudge;
mod rejudge_estimate;
mod replay;
mod replay_answers;
mod replay_beside;
mod replay_follow;
mod replay_rejudge;
mod report;
mod reproduce;
mod robot_picture;
mod rotation;
mod safe_handling;
mod samples;
mod screens;
mod screenshot;
mod scrolling;
mod search;
mod stop_keys;
mod study_command;
mod terminal;
mod truth;
mod typing;
mod verdict_change;
mod verify;
mod views;
mod waits;
mod workers;
