//! Tests of a Go2 without DDS: link, choice of the interface, handover, as one program: each file is a module.

mod handover;
mod link;
mod network;
mod own_writes;
