//! The simulator served as a Go1 over UDP: the motor law inside the motors, states at 1 kHz to where commands come from, and
//! faults on demand. One [`Emulator::step`] is one millisecond of the robot's life; who calls it a thousand times a second
//! has a robot in real time, who calls it in turn with a control cycle has one that repeats bit for bit.
//!
//! What is not established for the real robot is a key of `[emulator]` in `config/simulator.toml`, with the assumption.

mod fault;
mod network;

use std::net::{SocketAddr, UdpSocket};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

pub use fault::{Fault, FaultError, help};

use super::{SimConfig, SimError, Simulator};
use crate::robot::description::RobotDescription;
use crate::robot::go1::packet::{CrcForm, LowCmd};
use crate::robot::go1::{Network, convert};
use crate::robot::{Battery, JOINTS, JointCommand, Joints, MotorCommand, Placement, Robot, RobotState, Truth};
use network::{Conditions, Wire};

/// Room for a datagram.
const BUFFER: usize = 2048;
/// Cells of the emulated battery and the voltage of one, empty and full, V. Ours: a six-cell pack, as the Go1's 21.6 V suggest.
const CELLS: usize = 6;
const CELL_V: [f64; 2] = [3.3, 4.2];
/// What the robot's computers draw, W. Ours.
const IDLE_W: f64 = 30.0;
/// A stuck joint is held by this stiffness, N m/rad, and damping, N m s/rad, up to the motor's torque.
const STUCK: [f64; 2] = [600.0, 10.0];

/// Why an emulator cannot be started.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// The address is not to be had.
    #[error("{address}: {source}; give an address of this machine and a free port, for example 127.0.0.1:8007")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// The simulator's configuration.
    #[error(transparent)]
    Simulator(#[from] SimError),
    /// The description has no network, so nobody would know how to talk to it.
    #[error("{robot}: its robot.toml has no section [network]; only a robot with one can be emulated")]
    NoNetwork {
        /// The robot's name.
        robot: String,
    },
}

/// How the emulated robot is doing: what a person who stands beside it sees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EmulatorStatus {
    /// Where commands come from and states go to.
    pub client: Option<SocketAddr>,
    /// Commands that were obeyed.
    pub commands: u64,
    /// Datagrams that were no command.
    pub rejected: u64,
    /// States that set out.
    pub states: u64,
    /// No command came for longer than the motors wait: they brake.
    pub timed_out: bool,
    /// Faults that were applied so far.
    pub faults: u64,
    /// Where the robot is and what it touches.
    pub truth: Option<Truth>,
}

/// A hold on an emulator that runs elsewhere.
#[derive(Debug, Clone)]
pub struct EmulatorHandle {
    faults: Sender<Fault>,
    status: Arc<Mutex<EmulatorStatus>>,
}

impl EmulatorHandle {
    /// From the next millisecond on. An emulator that has ended does not mind.
    pub fn apply(&self, fault: Fault) {
        let _ = self.faults.send(fault);
    }

    /// How it was doing after its last step.
    pub fn status(&self) -> EmulatorStatus {
        *self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What is wrong with the robot itself.
#[derive(Debug, Clone, Copy, Default)]
struct Defects {
    frozen: bool,
    repeating: bool,
    hot: [Option<f64>; JOINTS],
    charge_percent: Option<f64>,
    servo_off: [bool; JOINTS],
    stuck_at: [Option<f64>; JOINTS],
    angle: [Option<f64>; JOINTS],
    speed: [Option<f64>; JOINTS],
    torque: [Option<f64>; JOINTS],
    tilt_rad: f64,
}

/// An emulated Go1.
#[derive(Debug)]
pub struct Emulator {
    simulator: Simulator,
    config: SimConfig,
    network: Network,
    lying_position: Joints,
    seed: u64,
    socket: UdpSocket,
    /// Milliseconds since the emulator began; the robot's own clock begins anew when it restarts.
    now_ms: u64,
    robot_time_ms: u32,
    to_robot: Wire<SocketAddr>,
    from_robot: Wire<SocketAddr>,
    conditions: Conditions,
    defects: Defects,
    random: ChaCha8Rng,
    /// What each motor does; none where it brakes.
    motors: [Option<MotorCommand>; JOINTS],
    since_command_ms: u32,
    /// Until when a restart lasts.
    booting_until_ms: u64,
    last_state: Vec<u8>,
    placed: u64,
    faults: (Sender<Fault>, Receiver<Fault>),
    status: EmulatorStatus,
    shared: Arc<Mutex<EmulatorStatus>>,
}

impl Emulator {
    /// A robot that lies folded on its belly and listens on `address` (port 0 takes any).
    ///
    /// # Errors
    /// When the address is taken, the description has no network, or a value of `config` is out of range.
    pub fn bind(
        address: SocketAddr,
        description: &RobotDescription,
        config: &SimConfig,
        seed: u64,
    ) -> Result<Emulator, EmulatorError> {
        let Some(network) = description.network else {
            return Err(EmulatorError::NoNetwork { robot: description.name.clone() });
        };
        let simulator = Simulator::new(description, config)?;
        let socket = UdpSocket::bind(address).and_then(|socket| {
            socket.set_nonblocking(true)?;
            Ok(socket)
        });
        // Another stream than those of the simulator's sensors and terrain, which begin with the same seed.
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(2);
        let mut emulator = Emulator {
            simulator,
            config: config.clone(),
            network,
            lying_position: description.lying_position,
            seed,
            socket: socket.map_err(|source| EmulatorError::Bind { address, source })?,
            now_ms: 0,
            robot_time_ms: 0,
            to_robot: Wire::new(),
            from_robot: Wire::new(),
            conditions: Conditions::default(),
            defects: Defects::default(),
            random,
            motors: [None; JOINTS],
            since_command_ms: 0,
            booting_until_ms: 0,
            last_state: Vec::new(),
            placed: 0,
            faults: channel(),
            status: EmulatorStatus::default(),
            shared: Arc::default(),
        };
        emulator.lay_down();
        Ok(emulator)
    }

    /// Where it listens.
    ///
    /// # Errors
    /// When the system does not say.
    pub fn local_address(&self) -> std::io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// A hold on it for elsewhere.
    pub fn handle(&self) -> EmulatorHandle {
        EmulatorHandle { faults: self.faults.0.clone(), status: self.shared.clone() }
    }

    /// How it is doing.
    pub fn status(&self) -> &EmulatorStatus {
        &self.status
    }

    /// Applies one fault.
    pub fn apply(&mut self, fault: Fault) {
        let (conditions, defects) = (&mut self.conditions, &mut self.defects);
        match fault {
            Fault::Loss(percent) => conditions.loss = percent / 100.0,
            Fault::Delay(ms) => conditions.delay_ms = ms,
            Fault::Jitter(ms) => conditions.jitter_ms = ms,
            Fault::Duplicate(percent) => conditions.duplicate = percent / 100.0,
            Fault::Corrupt(percent) => conditions.corrupt = percent / 100.0,
            Fault::Freeze => defects.frozen = true,
            Fault::Repeat => defects.repeating = true,
            Fault::Reboot => {
                self.booting_until_ms = self.now_ms + u64::from(self.config.emulator.reboot_ms);
                self.robot_time_ms = 0;
                self.motors = [None; JOINTS];
                self.status.client = None;
            }
            Fault::Hot { joint, celsius } => defects.hot[joint] = Some(celsius),
            Fault::Battery(percent) => defects.charge_percent = Some(percent),
            Fault::ServoOff { joint } => defects.servo_off[joint] = true,
            Fault::Stuck { joint } => defects.stuck_at[joint] = Some(self.simulator.state().joint_position[joint]),
            Fault::Angle { joint, radians } => defects.angle[joint] = Some(radians),
            Fault::Speed { joint, radians_per_s } => defects.speed[joint] = Some(radians_per_s),
            Fault::Torque { joint, newton_metres } => defects.torque[joint] = Some(newton_metres),
            Fault::NotANumber { joint } => defects.angle[joint] = Some(f64::NAN),
            Fault::Tilt(radians) => defects.tilt_rad = radians,
            Fault::Place => self.lay_down(),
            Fault::Clear => {
                self.conditions = Conditions::default();
                self.defects = Defects::default();
            }
        }
        self.status.faults += 1;
    }

    /// Puts the robot on its mark in any pose.
    pub fn place(&mut self, placement: &Placement) {
        self.simulator.place(placement);
    }

    /// One millisecond: commands in, motors and body, a state out.
    pub fn step(&mut self) {
        while let Ok(fault) = self.faults.1.try_recv() {
            self.apply(fault);
        }
        self.now_ms += 1;
        self.take_commands();
        // The simulator takes every command; it never refuses one.
        let _ = self.simulator.write(&self.drive());
        self.send_state();
        self.status.truth = self.simulator.read().ok().and_then(|state| state.truth);
        *self.shared.lock().unwrap_or_else(PoisonError::into_inner) = self.status;
    }

    /// Whether its computer runs.
    fn is_awake(&self) -> bool {
        !self.defects.frozen && self.now_ms >= self.booting_until_ms
    }

    fn take_commands(&mut self) {
        let mut buffer = [0; BUFFER];
        while let Ok((length, from)) = self.socket.recv_from(&mut buffer) {
            self.to_robot.put(self.now_ms, from, &buffer[..length], &self.conditions, &mut self.random);
        }
        self.since_command_ms = self.since_command_ms.saturating_add(1);
        for (from, datagram) in self.to_robot.arrived(self.now_ms) {
            if self.is_awake() {
                self.obey(from, &datagram);
            }
        }
        self.status.timed_out = self.since_command_ms > self.config.emulator.command_timeout_ms;
        if self.status.timed_out {
            self.motors = [None; JOINTS];
        }
    }

    fn obey(&mut self, from: SocketAddr, datagram: &[u8]) {
        let form: CrcForm = self.network.crc;
        let Ok(command) = LowCmd::judge(datagram, form) else {
            self.status.rejected += 1;
            return;
        };
        self.motors = std::array::from_fn(|i| convert::motor_command(&command.motor(i)));
        self.since_command_ms = 0;
        self.status.client = Some(from);
        self.status.commands += 1;
    }

    /// Whether each motor is in servo mode.
    fn in_servo(&self, joint: usize) -> bool {
        self.motors[joint].is_some() && !self.defects.servo_off[joint]
    }

    /// What the motors do this millisecond.
    fn drive(&self) -> JointCommand {
        let braking = MotorCommand { kd: self.config.emulator.braking_kd, ..MotorCommand::default() };
        let mut drive = JointCommand::default();
        for (joint, motor) in drive.motor.iter_mut().enumerate() {
            *motor = match (self.defects.stuck_at[joint], self.motors[joint]) {
                (Some(position), _) => MotorCommand { position, kp: STUCK[0], kd: STUCK[1], ..MotorCommand::default() },
                (None, Some(command)) if self.in_servo(joint) => command,
                _ => braking,
            };
        }
        drive
    }

    fn send_state(&mut self) {
        if self.is_awake() {
            self.robot_time_ms += 1;
            if !self.defects.repeating || self.last_state.is_empty() {
                self.last_state = self.state();
            }
            if let Some(client) = self.status.client {
                self.from_robot.put(self.now_ms, client, &self.last_state, &self.conditions, &mut self.random);
                self.status.states += 1;
            }
        }
        for (client, datagram) in self.from_robot.arrived(self.now_ms) {
            // A controller that is gone does not keep the robot from living.
            let _ = self.socket.send_to(&datagram, client);
        }
    }

    /// What the robot reports.
    fn state(&mut self) -> Vec<u8> {
        let mut state = self.simulator.read().unwrap_or_default();
        state.robot_time_ms = self.robot_time_ms;
        state.motor_enabled = std::array::from_fn(|joint| self.in_servo(joint));
        state.motor_temperature_c =
            self.defects.hot.map(|celsius| celsius.unwrap_or(self.config.emulator.motor_temperature_c));
        state.battery = Some(self.battery(&state));
        for joint in 0..JOINTS {
            let position = &mut state.joint_position[joint];
            *position = self.defects.angle[joint].unwrap_or(*position);
            let velocity = &mut state.joint_velocity[joint];
            *velocity = self.defects.speed[joint].unwrap_or(*velocity);
            let torque = &mut state.joint_torque[joint];
            *torque = self.defects.torque[joint].unwrap_or(*torque);
        }
        state.imu.orientation_world *= UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.defects.tilt_rad);
        let mut datagram = convert::low_state(&state, self.network.foot_force_n);
        datagram.seal();
        let mut bytes = datagram.bytes().to_vec();
        bytes.resize(self.config.emulator.state_length, 0);
        bytes
    }

    fn battery(&self, state: &RobotState) -> Battery {
        let charge_percent = self.defects.charge_percent.unwrap_or(self.config.emulator.battery_percent);
        let cell = CELL_V[0] + (CELL_V[1] - CELL_V[0]) * charge_percent / 100.0;
        let voltage_v = cell * CELLS as f64;
        let mechanical: f64 =
            state.joint_torque.iter().zip(&state.joint_velocity).map(|(torque, dq)| torque * dq).sum();
        Battery {
            charge_percent,
            voltage_v,
            current_a: -(IDLE_W + mechanical.max(0.0)) / voltage_v,
            cell_v: std::array::from_fn(|i| if i < CELLS { cell } else { 0.0 }),
        }
    }

    /// A person puts the robot on its mark, lying.
    fn lay_down(&mut self) {
        let seed = self.seed.wrapping_add(self.placed);
        self.place(&Placement { joint_position: self.lying_position, lying: true, seed });
        self.placed += 1;
    }
}
