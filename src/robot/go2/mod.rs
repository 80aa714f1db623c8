//! The Unitree Go2: [`message`] defines its DDS messages as bytes, [`convert`] their meaning. Nothing here knows a DDS
//! library; a transport carries the bytes.
//!
//! `robots/go2/README.md` lists the known and unknown properties of the robot with their sources.

pub mod convert;
pub mod message;
