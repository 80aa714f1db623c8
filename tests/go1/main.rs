//! Tests of the link to a Go1: packets, faults, watchdogs, as one program: each file is a module.

#[path = "../support/bench.rs"]
mod bench;
#[path = "../support/cores.rs"]
mod cores;
#[path = "../support/emulated.rs"]
mod emulated;
#[path = "../support/go1.rs"]
mod go1;

mod emulator_faults;
mod faults;
mod link;
mod packets;
mod random_faults;
mod recent_count;
mod remote;
mod socket;
