//! The simulator served as a Go1 over UDP, or with the feature `go2` as a Go2 over DDS: commands are received, the motors' control
//! law is simulated, states are sent at 1 kHz, and faults are injected on demand. One [`Emulator::step`] is one millisecond of
//! the robot: called in turn with a control cycle it repeats bit for bit. [`Emulator::step_at`], called at 1 kHz, is a robot in
//! real time.
//!
//! Unknown properties of the real robot are keys of `[emulator]` in `config/simulator.toml`, with the assumption.

mod endpoint;
mod fault;
#[cfg(feature = "go2")]
mod go2;
mod network;
mod robot;

use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use rand_chacha::ChaCha8Rng;

pub use endpoint::EmulatorClient;
pub use fault::{EmulatorFault, EmulatorFaultError, help};

use super::{EmulatorConfig, SimConfig, SimError, streams};
use crate::robot::description::RobotDescription;
use crate::robot::go1::Go1Network;
use crate::robot::hardware::{self, HardwareError};
use crate::robot::{JOINTS, JointCommand, Placement, Truth};
use crate::sim::terrain::unit_interval;
use endpoint::{Endpoint, Go1Endpoint};
use network::{NetworkConditions, NetworkPath};
use robot::{EmulatedRobot, RobotDefects};

const MILLISECOND_NS: u64 = 1_000_000;

/// Error of starting an emulator.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum EmulatorError {
    /// The address is not available.
    #[error("{address}: {source}; give an address of this machine and a free port, for example 127.0.0.1:8007")]
    Bind { address: SocketAddr, source: std::io::Error },
    /// The DDS domain cannot be joined.
    #[cfg(feature = "go2")]
    #[error(transparent)]
    Dds(#[from] crate::robot::go2::dds::DdsError),
    /// The interface of a Go2, or a program without it.
    #[error(transparent)]
    Hardware(#[from] HardwareError),
    /// The simulator's configuration.
    #[error(transparent)]
    Simulator(#[from] SimError),
}

/// Status of an emulated robot.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EmulatorStatus {
    /// Source of the last command; a Go1 sends its states there.
    pub client: Option<EmulatorClient>,
    /// Executed commands.
    pub commands: u64,
    /// Received datagrams that were no command.
    pub rejected: u64,
    /// Sent states, those lost in the emulated network among them.
    pub states: u64,
    /// Whether the motors brake because no command arrived within their time-out.
    pub timed_out: bool,
    /// Faults applied so far.
    pub faults: u64,
    /// True state of the robot.
    pub truth: Option<Truth>,
}

/// Handle of an emulator in another thread.
#[derive(Debug, Clone)]
pub struct EmulatorHandle {
    faults: Sender<EmulatorFault>,
    status: Arc<Mutex<EmulatorStatus>>,
}

impl EmulatorHandle {
    /// Applies a fault from the next millisecond on; no effect on an emulator that has ended.
    pub fn apply(&self, fault: EmulatorFault) {
        let _ = self.faults.send(fault);
    }

    /// Returns the status after the last step.
    pub fn status(&self) -> EmulatorStatus {
        *self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A second program that commands the robot: it damps every joint.
#[derive(Debug, Clone, Copy)]
struct SecondCommander {
    /// Share of the milliseconds in which its command is the last one.
    share: f64,
    /// Whether the robot sends it the states of these milliseconds.
    takes_states: bool,
}

/// An emulated robot.
#[derive(Debug)]
pub struct Emulator {
    robot: EmulatedRobot,
    config: EmulatorConfig,
    endpoint: Box<dyn Endpoint>,
    local_address: Option<SocketAddr>,
    /// Time since the emulator's start, ms. The robot's own clock restarts when it reboots.
    now_ms: u64,
    /// This computer's time of the next millisecond in real time, ns.
    due_ns: Option<u64>,
    to_robot: NetworkPath<EmulatorClient>,
    from_robot: NetworkPath<Option<EmulatorClient>>,
    conditions: NetworkConditions,
    second: Option<SecondCommander>,
    /// Whether the state of this millisecond goes to the second program.
    state_taken: bool,
    random: ChaCha8Rng,
    since_command_ms: u32,
    /// End of the last reboot, ms.
    booting_until_ms: u64,
    faults: (Sender<EmulatorFault>, Receiver<EmulatorFault>),
    status: EmulatorStatus,
    shared: Arc<Mutex<EmulatorStatus>>,
}

impl Emulator {
    /// Starts a Go1 that lies folded on its belly and receives on `address` (port 0 takes any free one).
    ///
    /// # Errors
    /// The address is taken, or a value of `config` is out of range.
    pub fn bind(
        address: SocketAddr,
        description: &RobotDescription,
        network: &Go1Network,
        config: &SimConfig,
        seed: u64,
    ) -> Result<Emulator, EmulatorError> {
        let bound = Go1Endpoint::bind(address, network, config.emulator.state_length);
        let endpoint = bound.map_err(|source| EmulatorError::Bind { address, source })?;
        let local_address = endpoint.local_address().ok();
        Emulator::new(Box::new(endpoint), local_address, description, config, seed)
    }

    /// Starts a Go2 that lies folded on its belly, in a DDS domain at the interface with `address`.
    ///
    /// # Errors
    /// The domain cannot be joined, or a value of `config` is out of range.
    #[cfg(feature = "go2")]
    pub fn join(
        domain: u16,
        address: std::net::Ipv4Addr,
        description: &RobotDescription,
        network: &crate::robot::go2::network::Go2Network,
        config: &SimConfig,
        seed: u64,
    ) -> Result<Emulator, EmulatorError> {
        let endpoint = go2::Go2Endpoint::join(domain, address, network.foot_force_n, &description.lying_position)?;
        Emulator::new(Box::new(endpoint), None, description, config, seed)
    }

    /// Starts the robot of `network`: a Go1 on `address`, or a Go2 in the domain and at the interface of `network`.
    ///
    /// # Errors
    /// The address or the domain is not available, a value of `config` is out of range, or the program was built without the Go2.
    pub fn serve(
        network: &hardware::Network,
        address: SocketAddr,
        description: &RobotDescription,
        config: &SimConfig,
        seed: u64,
    ) -> Result<Emulator, EmulatorError> {
        match network {
            hardware::Network::Go1(network) => Emulator::bind(address, description, network, config, seed),
            #[cfg(feature = "go2")]
            hardware::Network::Go2(network) => {
                let address = network.address().map_err(HardwareError::from)?;
                Emulator::join(network.domain, address, description, network, config, seed)
            }
            #[cfg(not(feature = "go2"))]
            hardware::Network::Go2(_) => Err(HardwareError::WithoutGo2.into()),
        }
    }

    fn new(
        endpoint: Box<dyn Endpoint>,
        local_address: Option<SocketAddr>,
        description: &RobotDescription,
        config: &SimConfig,
        seed: u64,
    ) -> Result<Emulator, EmulatorError> {
        let random = streams::random(seed, streams::NETWORK);
        Ok(Emulator {
            robot: EmulatedRobot::new(description, config, seed)?,
            config: config.emulator,
            endpoint,
            local_address,
            now_ms: 0,
            due_ns: None,
            to_robot: NetworkPath::new(),
            from_robot: NetworkPath::new(),
            conditions: NetworkConditions::default(),
            second: None,
            state_taken: false,
            random,
            since_command_ms: 0,
            booting_until_ms: 0,
            faults: channel(),
            status: EmulatorStatus::default(),
            shared: Arc::default(),
        })
    }

    /// Returns the address on which a Go1 receives; none for a Go2.
    pub fn local_address(&self) -> Option<SocketAddr> {
        self.local_address
    }

    /// Returns a handle for another thread.
    pub fn handle(&self) -> EmulatorHandle {
        EmulatorHandle { faults: self.faults.0.clone(), status: self.shared.clone() }
    }

    /// Returns the status.
    pub fn status(&self) -> &EmulatorStatus {
        &self.status
    }

    /// Applies one fault.
    pub fn apply(&mut self, fault: EmulatorFault) {
        let (conditions, defects) = (&mut self.conditions, &mut self.robot.defects);
        match fault {
            EmulatorFault::Loss(percent) => conditions.loss = percent / 100.0,
            EmulatorFault::Delay(ms) => conditions.delay_ms = ms,
            EmulatorFault::Jitter(ms) => conditions.jitter_ms = ms,
            EmulatorFault::Duplicate(percent) => conditions.duplicate = percent / 100.0,
            EmulatorFault::Corrupt(percent) => conditions.corrupt = percent / 100.0,
            EmulatorFault::Freeze => defects.frozen = true,
            EmulatorFault::Repeat => defects.repeating = true,
            EmulatorFault::Reboot => {
                self.booting_until_ms = self.now_ms + u64::from(self.config.reboot_ms);
                self.robot.time_ms = 0;
                self.robot.motors = [None; JOINTS];
                self.status.client = None;
                self.endpoint.reboot();
            }
            EmulatorFault::Hot { joint, celsius } => defects.hot[joint] = Some(celsius),
            EmulatorFault::Battery(percent) => defects.charge_percent = Some(percent),
            EmulatorFault::ServoOff { joint } => defects.servo_off[joint] = true,
            EmulatorFault::Stuck { joint } => self.robot.block(joint),
            EmulatorFault::Angle { joint, radians } => defects.angle[joint] = Some(radians),
            EmulatorFault::Speed { joint, radians_per_s } => defects.speed[joint] = Some(radians_per_s),
            EmulatorFault::Torque { joint, newton_metres } => defects.torque[joint] = Some(newton_metres),
            EmulatorFault::NotANumber { joint } => defects.angle[joint] = Some(f64::NAN),
            EmulatorFault::Tilt(radians) => defects.tilt_rad = radians,
            EmulatorFault::Place => self.robot.lay_down(),
            EmulatorFault::CommandDelay(ms) => conditions.command_delay_ms = ms,
            EmulatorFault::StateDelay(ms) => conditions.state_delay_ms = ms,
            EmulatorFault::ImuFreeze => defects.imu_frozen = true,
            EmulatorFault::FlipRoll => defects.flipped[0] = true,
            EmulatorFault::FlipPitch => defects.flipped[1] = true,
            EmulatorFault::Feet(newtons) => defects.foot_force_n = Some(newtons),
            EmulatorFault::ClockStep(ms) => self.robot.step_clock(ms),
            EmulatorFault::ClockDrift(ms_per_s) => defects.clock_drift_ms_per_s = ms_per_s,
            EmulatorFault::Commander(percent) => {
                self.second = Some(SecondCommander { share: percent / 100.0, takes_states: true });
            }
            EmulatorFault::HiddenCommander(percent) => {
                self.second = Some(SecondCommander { share: percent / 100.0, takes_states: false });
            }
            EmulatorFault::MotorFreeze { joint } => defects.motor_frozen[joint] = true,
            EmulatorFault::Remote(buttons) => defects.remote_buttons = buttons,
            EmulatorFault::RemoteOff => defects.remote_off = true,
            EmulatorFault::Clear => {
                self.conditions = NetworkConditions::default();
                self.second = None;
                self.robot.defects = RobotDefects::default();
            }
        }
        self.status.faults += 1;
    }

    /// Places the robot.
    pub fn place(&mut self, placement: &Placement) {
        self.robot.place(placement);
    }

    /// Emulates the millisecond that begins at `time_ns` of this computer's clock, whose zero is any.
    ///
    /// Milliseconds that were left out since the last call (this process was stopped, the machine slept) pass on the robot's
    /// clock, which does not depend on this computer; its body stands still in them.
    pub fn step_at(&mut self, time_ns: u64) {
        let missed_ms = time_ns.saturating_sub(self.due_ns.unwrap_or(time_ns)) / MILLISECOND_NS;
        if missed_ms > 0 {
            self.now_ms += missed_ms;
            self.since_command_ms = self.since_command_ms.saturating_add(u32::try_from(missed_ms).unwrap_or(u32::MAX));
            if self.is_awake() {
                self.robot.step_clock(missed_ms as f64);
            }
        }
        self.due_ns = Some(time_ns + MILLISECOND_NS);
        self.step();
    }

    /// Emulates one millisecond: receives commands, simulates, sends a state.
    pub fn step(&mut self) {
        while let Ok(fault) = self.faults.1.try_recv() {
            self.apply(fault);
        }
        self.now_ms += 1;
        if self.is_awake() {
            self.endpoint.advance();
        }
        self.receive_commands();
        self.robot.step();
        self.send_state();
        self.status.truth = self.robot.truth();
        *self.shared.lock().unwrap_or_else(PoisonError::into_inner) = self.status;
    }

    /// Whether the robot's computer runs.
    fn is_awake(&self) -> bool {
        !self.robot.defects.frozen && self.now_ms >= self.booting_until_ms
    }

    fn receive_commands(&mut self) {
        while let Some((from, command)) = self.endpoint.receive() {
            let conditions = self.conditions.of_commands();
            self.to_robot.send(self.now_ms, from, &command, &conditions, &mut self.random);
        }
        self.since_command_ms = self.since_command_ms.saturating_add(1);
        for (from, datagram) in self.to_robot.arrived(self.now_ms) {
            if self.is_awake() {
                self.execute(from, &datagram);
            }
        }
        self.receive_second_commander();
        self.status.timed_out = self.since_command_ms > self.config.command_timeout_ms;
        if self.status.timed_out {
            self.robot.motors = [None; JOINTS];
        }
    }

    /// Executes the second program's command after those of the first.
    fn receive_second_commander(&mut self) {
        self.state_taken = false;
        if let Some(SecondCommander { share, takes_states }) = self.second
            && unit_interval(&mut self.random) < share
            && self.is_awake()
        {
            self.robot.motors = JointCommand::damping(self.config.braking_kd).motor.map(Some);
            self.since_command_ms = 0;
            self.state_taken = takes_states;
        }
    }

    fn execute(&mut self, from: EmulatorClient, datagram: &[u8]) {
        let Some(motors) = self.endpoint.decode(datagram) else {
            self.status.rejected += 1;
            return;
        };
        self.robot.motors = motors;
        self.since_command_ms = 0;
        self.status.client = Some(from);
        self.status.commands += 1;
    }

    fn send_state(&mut self) {
        if self.is_awake() {
            let state = self.robot.next_state();
            let client = self.status.client.filter(|_| !self.state_taken);
            if client.is_some() || self.endpoint.sends_to_all() {
                let conditions = self.conditions.of_states();
                let bytes = self.endpoint.encode(&state);
                self.from_robot.send(self.now_ms, client, &bytes, &conditions, &mut self.random);
                self.status.states += 1;
            }
        }
        for (client, datagram) in self.from_robot.arrived(self.now_ms) {
            self.endpoint.send(&datagram, client);
        }
    }
}
