//! The Unitree Go1 over its low-level UDP protocol.

pub mod packet;
