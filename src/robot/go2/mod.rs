//! The Unitree Go2: [`message`] defines its DDS messages as bytes, [`convert`] their meaning, [`handover`] the way from the robot's
//! own controller to this program, [`link`] the robot behind a transport. They know no DDS library; with the feature `go2`
//! the module `dds` carries the bytes.
//!
//! `robots/go2/README.md` lists the known and unknown properties of the robot with their sources.

pub mod convert;
#[cfg(feature = "go2")]
pub mod dds;
#[cfg(feature = "go2")]
pub mod give_back;
pub mod handover;
pub mod link;
pub mod message;
pub mod network;
pub mod own_writes;
#[cfg(feature = "go2")]
pub mod services;
