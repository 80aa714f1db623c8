//! Tests of a session: arming, approval, trials, verdicts, folder, as one program: each file is a module.

#[path = "../support/attached_console.rs"]
mod attached_console;
#[path = "../support/bench.rs"]
mod bench;
#[path = "../support/go1.rs"]
mod go1;
#[path = "../support/robots.rs"]
mod robots;
#[path = "../support/experiment.rs"]
mod support;

mod approval;
mod arming;
mod backend_change;
mod effort;
mod expectation;
mod experiment;
mod gains;
mod guard_heartbeats;
mod journal_faults;
mod judged_by;
mod limits;
mod measure;
mod operator_lost;
mod queue;
mod repeats;
mod robot_study;
mod search;
mod storage;
mod study_folder;
mod suspend_and_guard;
mod threads;
