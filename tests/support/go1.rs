//! A Go1 link and an emulated robot, millisecond by millisecond over a real loopback socket.
#![allow(dead_code, reason = "each test uses its own part")]

use std::net::{Ipv4Addr, SocketAddr};

use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::go1::Go1;
use quadfrog::robot::{JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
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

/// An emulated robot behind its link as one machine: every command that goes out is followed by one millisecond of the robot's
/// life. A study over the network that repeats bit for bit.
pub struct Lockstep {
    pub emulator: Emulator,
    pub go1: Go1,
    /// Cameras tell where the robot is: what is left to see is the link alone.
    pub watched: bool,
}

impl Lockstep {
    pub fn new(config: &SimConfig, seed: u64) -> Lockstep {
        let (emulator, go1) = pair(config, seed);
        Lockstep { emulator, go1, watched: false }
    }
}

impl Robot for Lockstep {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        let mut state = self.go1.read()?;
        if self.watched {
            state.truth = self.emulator.status().truth;
        }
        Ok(state)
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        let written = self.go1.write(command);
        self.emulator.step();
        written
    }

    /// What a person does, without the wait.
    fn place(&mut self, placement: &Placement) -> bool {
        self.emulator.place(placement);
        self.write(&JointCommand::damping(0.0)).is_ok()
    }

    fn link(&self) -> Option<LinkStatus> {
        self.go1.link()
    }
}
