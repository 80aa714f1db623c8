//! A Go1 link and an emulated robot, stepped by the millisecond over a real loopback socket.
#![allow(dead_code, reason = "each test uses its own part")]

use std::net::{Ipv4Addr, SocketAddr};

use quadfrog::robot::description::{RobotDescription, RobotFiles};
use quadfrog::robot::go1::{Go1, Go1Network};
use quadfrog::robot::{JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use quadfrog::sim::SimConfig;
use quadfrog::sim::emulator::Emulator;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Any free loopback port.
pub const ANY_PORT: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

/// The embedded Go1.
pub fn description() -> RobotDescription {
    RobotDescription::embedded("go1").unwrap()
}

/// Network settings for a robot at `address`, with any local port.
pub fn network(address: SocketAddr) -> Go1Network {
    let network = Go1Network::read(&RobotFiles::embedded("go1").unwrap()).unwrap().unwrap();
    Go1Network { address, local_port: 0, ..network }
}

/// An emulated robot on a port of its own.
pub fn emulator(config: &SimConfig, seed: u64) -> Emulator {
    Emulator::bind(ANY_PORT, &description(), &network(ANY_PORT), config, seed).unwrap()
}

/// An emulated robot and a link to it.
pub fn pair(config: &SimConfig, seed: u64) -> (Emulator, Go1) {
    let emulator = emulator(config, seed);
    let go1 = Go1::open(&network(emulator.local_address().unwrap()), false).unwrap();
    (emulator, go1)
}

/// Gaps in the timing of control thread and robot. In half of the gaps the robot runs some milliseconds ahead under the
/// last command and the missed ticks then follow at once; in the other half the robot is late and then catches up.
pub struct Late {
    random: ChaCha8Rng,
    /// One tick in this many starts a gap, on average.
    one_in: u32,
    /// The longest gap, ms.
    most_ms: u32,
    /// Milliseconds that the robot is ahead of the ticks (behind, if negative).
    ahead_ms: i32,
    /// Value of `ahead_ms` at which a late robot catches up.
    until_ms: i32,
}

impl Late {
    pub fn new(one_in: u32, most_ms: u32, seed: u64) -> Late {
        Late { random: ChaCha8Rng::seed_from_u64(seed), one_in, most_ms, ahead_ms: 0, until_ms: 0 }
    }

    /// The same rate of gaps with another seed.
    pub fn seeded(&self, seed: u64) -> Late {
        Late::new(self.one_in, self.most_ms, seed)
    }

    /// Number of emulator steps after this tick.
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

/// An emulated robot and its link as one [`Robot`]: every command is followed by one millisecond of the robot. Repeats
/// bit for bit.
pub struct Lockstep {
    pub emulator: Emulator,
    pub go1: Go1,
    /// Whether states contain the emulator's true state, so that only the link differs from a simulator.
    pub with_truth: bool,
    /// Timing gaps; none if every command is followed by one millisecond.
    pub late: Option<Late>,
}

impl Lockstep {
    pub fn new(config: &SimConfig, seed: u64) -> Lockstep {
        let (emulator, go1) = pair(config, seed);
        Lockstep { emulator, go1, with_truth: false, late: None }
    }
}

impl Robot for Lockstep {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        let mut state = self.go1.read()?;
        if self.with_truth {
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

    /// Places the robot as a person would, without the wait.
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
