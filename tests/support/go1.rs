//! A Go1 link and an emulated robot, millisecond by millisecond over a real loopback socket.
#![allow(dead_code, reason = "each test uses its own part")]

use std::net::{Ipv4Addr, SocketAddr};

use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::go1::Go1;
use quadfrog::robot::{JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use quadfrog::sim::SimConfig;
use quadfrog::sim::emulator::Emulator;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

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

/// A control thread that does not always get its processor: now and then the robot lives on for some milliseconds under the
/// last command. Half of the time the ticks that were missed follow at once and find nothing new; half of the time it is
/// the robot that is late, and then catches up.
pub struct Late {
    random: ChaCha8Rng,
    /// One tick of so many begins a gap.
    one_in: u32,
    /// The longest gap, ms.
    most_ms: u32,
    /// Milliseconds that the robot is ahead of the ticks (or behind, if negative), and not yet made up for.
    ahead_ms: i32,
    /// When a robot that is behind catches up.
    until_ms: i32,
}

impl Late {
    pub fn new(one_in: u32, most_ms: u32, seed: u64) -> Late {
        Late { random: ChaCha8Rng::seed_from_u64(seed), one_in, most_ms, ahead_ms: 0, until_ms: 0 }
    }

    /// The same with other moments.
    pub fn seeded(&self, seed: u64) -> Late {
        Late::new(self.one_in, self.most_ms, seed)
    }

    /// How many milliseconds of the robot's life follow this tick.
    fn steps(&mut self) -> u32 {
        match self.ahead_ms {
            0 if self.random.next_u32().is_multiple_of(self.one_in) => {
                let gap_ms = 1 + self.random.next_u32() % self.most_ms;
                if self.random.next_u32().is_multiple_of(2) {
                    self.ahead_ms = gap_ms as i32;
                    return 1 + gap_ms;
                }
                (self.ahead_ms, self.until_ms) = (-1, -(gap_ms as i32));
                0
            }
            0 => 1,
            1.. => {
                self.ahead_ms -= 1;
                0
            }
            behind if behind == self.until_ms => {
                self.ahead_ms = 0;
                1 + behind.unsigned_abs()
            }
            _ => {
                self.ahead_ms -= 1;
                0
            }
        }
    }
}

/// An emulated robot behind its link as one machine: every command that goes out is followed by one millisecond of the robot's
/// life. A study over the network that repeats bit for bit.
pub struct Lockstep {
    pub emulator: Emulator,
    pub go1: Go1,
    /// Cameras tell where the robot is: what is left to see is the link alone.
    pub watched: bool,
    /// Who does not keep time; none where every command is followed by one millisecond.
    pub late: Option<Late>,
}

impl Lockstep {
    pub fn new(config: &SimConfig, seed: u64) -> Lockstep {
        let (emulator, go1) = pair(config, seed);
        Lockstep { emulator, go1, watched: false, late: None }
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
        for _ in 0..self.late.as_mut().map_or(1, Late::steps) {
            self.emulator.step();
        }
        written
    }

    /// What a person does, without the wait.
    fn place(&mut self, placement: &Placement) -> bool {
        self.emulator.place(placement);
        if let Some(late) = &mut self.late {
            (late.ahead_ms, late.until_ms) = (0, 0);
        }
        self.write(&JointCommand::damping(0.0)).is_ok()
    }

    fn link(&self) -> Option<LinkStatus> {
        self.go1.link()
    }
}
