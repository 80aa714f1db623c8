//! A Go1 link and an emulated robot, millisecond by millisecond over a real loopback socket.
#![allow(dead_code, reason = "each test uses its own part")]

use std::net::{Ipv4Addr, SocketAddr};

use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::go1::Go1;
use quadfrog::sim::SimConfig;
use quadfrog::sim::emulator::Emulator;

/// Any free port of this machine.
pub const ANY_PORT: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

/// The Go1 whose link takes any port and goes to `address`.
pub fn description(address: SocketAddr) -> RobotDescription {
    let mut description = RobotDescription::embedded("go1").unwrap();
    let network = description.network.as_mut().unwrap();
    network.local_port = 0;
    network.address = address;
    description
}

/// An emulated robot on a port of its own, and a link to it.
pub fn pair(config: &SimConfig, seed: u64) -> (Emulator, Go1) {
    let emulator = Emulator::bind(ANY_PORT, &description(ANY_PORT), config, seed).unwrap();
    let go1 = Go1::open(&description(emulator.local_address().unwrap()), false).unwrap();
    (emulator, go1)
}
