//! Robots over a network: which one a `robot.toml` describes, and how it is opened. A further robot is a module beside
//! [`go1`] and [`go2`] and a variant here (`docs/extend/robot.md`).

use std::net::{Ipv4Addr, UdpSocket};
use std::sync::atomic::AtomicBool;

use super::description::{DescriptionError, RobotFiles};
use super::go1::{self, Go1};
use super::go2;
use super::{JOINTS, Joints, Robot};

/// Settings of the network to a robot, from its `robot.toml`.
#[derive(Debug, Clone, PartialEq)]
pub enum Network {
    /// Section `[network]`: a Go1 over UDP.
    Go1(go1::Go1Network),
    /// Section `[dds]`: a Go2 over DDS.
    Go2(go2::network::Go2Network),
}

/// Error of opening a robot.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum HardwareError {
    #[error(transparent)]
    Link(#[from] go1::link::LinkError),
    #[error("the damping command of the guard: {0}")]
    Damping(String),
    #[error("the socket for the guard: {0}")]
    Socket(std::io::Error),
    #[error(transparent)]
    Interface(#[from] go2::network::InterfaceError),
    #[cfg(feature = "go2")]
    #[error(transparent)]
    Dds(#[from] go2::dds::DdsError),
    #[cfg(feature = "go2")]
    #[error("the robot was not taken over: {0}")]
    Takeover(go2::services::TakeoverFailure),
    #[cfg(feature = "go2")]
    #[error("the robot's own controller was not started: {0}")]
    GiveBack(go2::give_back::GiveBackError),
    #[error("this program was built without the Go2: build it with `cargo build --release --features go2`")]
    WithoutGo2,
    #[error("a {robot} has no controller of its own to give it back to")]
    NoController { robot: &'static str },
}

impl HardwareError {
    /// Returns the name of the robot's own controller if a takeover that failed may have released it.
    pub fn released_controller(&self) -> Option<&str> {
        #[cfg(feature = "go2")]
        if let HardwareError::Takeover(failure) = self {
            return failure.released.as_deref();
        }
        None
    }
}

/// Way by which a second process damps the robot when this one does not answer any more.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[expect(missing_docs, reason = "the doc of the variant describes its fields")]
pub enum DampingRoute {
    /// A Go1's datagram that damps every joint, over a socket that is connected to the robot.
    Go1 { command: Vec<u8> },
    /// A Go2's payload that damps every joint, by a writer in this domain at the interface with this address; reliable for a robot
    /// whose reader demands that.
    Go2 { command: Vec<u8>, domain: u16, address: Ipv4Addr, reliable: bool },
}

/// An opened robot: its driver, and how a second process damps it, where that needs one over a socket.
pub type OpenedRobot = (Box<dyn Robot>, (DampingRoute, Option<UdpSocket>));

/// Puts the command that damps every joint on the network.
pub type SendDamping = Box<dyn FnMut() -> std::io::Result<()>>;

impl DampingRoute {
    /// Opens the way to the robot; `socket` is that of a Go1. The command must damp every joint with at least `least_kd`, N m s/rad.
    ///
    /// # Errors
    /// It does not, or the way to the robot cannot be opened.
    pub fn open(self, socket: UdpSocket, least_kd: f32) -> Result<SendDamping, HardwareError> {
        if let Some((_, kd)) = self.damps()?.iter().find(|(servo, kd)| !servo || *kd < least_kd) {
            return Err(HardwareError::Damping(format!("kd {kd} N m s/rad does not damp; at least {least_kd}")));
        }
        match self {
            DampingRoute::Go1 { command } => Ok(Box::new(move || socket.send(&command).map(drop))),
            DampingRoute::Go2 { command, domain, address, reliable } => {
                open_damping_go2(command, domain, address, reliable)
            }
        }
    }

    /// Whether each joint is in servo mode, and its damping, N m s/rad.
    fn damps(&self) -> Result<[(bool, f32); JOINTS], HardwareError> {
        match self {
            DampingRoute::Go1 { command } => {
                use go1::packet::{CrcForm, LowCmd, MODE_SERVO};
                let command = LowCmd::parse(command, CrcForm::Plain)
                    .or_else(|_| LowCmd::parse(command, CrcForm::Sealed))
                    .map_err(|rejection| HardwareError::Damping(rejection.to_string()))?;
                Ok(std::array::from_fn(|joint| (command.motor(joint).mode == MODE_SERVO, command.motor(joint).kd)))
            }
            DampingRoute::Go2 { command, .. } => {
                use go2::message::{CommandMessage, MODE_SERVO};
                let command = CommandMessage::decode(command)
                    .map_err(|rejection| HardwareError::Damping(rejection.to_string()))?;
                Ok(std::array::from_fn(|joint| (command.motor[joint].mode == MODE_SERVO, command.motor[joint].kd)))
            }
        }
    }
}

#[cfg(feature = "go2")]
fn open_damping_go2(
    command: Vec<u8>,
    domain: u16,
    address: Ipv4Addr,
    reliable: bool,
) -> Result<SendDamping, HardwareError> {
    let participant = go2::dds::Participant::join(domain, address)?;
    let writer = participant.writer(&go2::dds::TopicType::low_command().with_reliable(reliable))?;
    Ok(Box::new(move || {
        // The writer lives as long as the participant.
        let _ = &participant;
        writer.write(&command)
    }))
}

#[cfg(not(feature = "go2"))]
fn open_damping_go2(_: Vec<u8>, _: u16, _: Ipv4Addr, _: bool) -> Result<SendDamping, HardwareError> {
    Err(HardwareError::WithoutGo2)
}

impl Network {
    /// Reads and checks the network's section of a robot's `robot.toml`; none if it has none.
    ///
    /// # Errors
    /// A key is unknown or missing, a value is out of range, or there are two sections.
    pub fn read(files: &RobotFiles) -> Result<Option<Network>, DescriptionError> {
        match (go1::Go1Network::read(files)?, go2::network::Go2Network::read(files)?) {
            (Some(_), Some(_)) => {
                Err(files.invalid("dds", "beside [network]".to_owned(), "keep the section of the robot's protocol"))
            }
            (network, dds) => Ok(network.map(Network::Go1).or(dds.map(Network::Go2))),
        }
    }

    /// Returns what puts the robot into low-level mode, for the operator's confirmation.
    pub const fn low_level(&self) -> &'static str {
        match self {
            Network::Go1(_) => "remote L2+A, L2+A, L2+B, L1+L2+START",
            Network::Go2(_) => {
                "its own controller released by the start of this program (after a restart of the robot quit and start again)"
            }
        }
    }

    /// Returns the file descriptors of the connection beyond a socket: two DDS participants have some hundred (117 were counted in a
    /// session with an emulated Go2).
    pub const fn descriptors(&self) -> u64 {
        match self {
            Network::Go1(_) => 0,
            Network::Go2(_) => 120,
        }
    }

    /// Opens the robot without sending anything to it. `damping_kd` is the gain of the guard's command, N m s/rad.
    ///
    /// # Errors
    /// A port is taken, there is no route or no interface to the robot, or the program was built without the robot.
    pub fn open(&self, damping_kd: f64) -> Result<OpenedRobot, HardwareError> {
        match self {
            Network::Go1(network) => {
                let go1 = Go1::open(network, true)?;
                let command = go1.damping(damping_kd).map_err(|error| HardwareError::Damping(error.to_string()))?;
                let socket = go1.socket().map_err(HardwareError::Socket)?;
                let route = DampingRoute::Go1 { command: command.bytes().to_vec() };
                Ok((Box::new(go1), (route, Some(socket))))
            }
            Network::Go2(network) => open_go2(network, damping_kd),
        }
    }

    /// Takes a robot over from its own controller, which lets it lie down first; a robot without one is left alone. `report`
    /// receives each step; `interrupted` ends it. Returns the name of the released controller; none if none was active.
    ///
    /// # Errors
    /// The robot does not answer, does not lie, or keeps its controller, or the takeover was interrupted; nothing was sent to its
    /// motors. The error holds the name of a controller that may be released.
    pub fn take_over(
        &self,
        lying_rad: &Joints,
        interrupted: &AtomicBool,
        report: &mut dyn FnMut(&str),
    ) -> Result<Option<String>, HardwareError> {
        match self {
            Network::Go1(_) => Ok(None),
            Network::Go2(network) => take_over_go2(network, lying_rad, interrupted, report),
        }
    }

    /// Starts the robot's own controller `name` again. `lying_rad` is the lying pose.
    ///
    /// # Errors
    /// The robot has none, is commanded by another program, does not lie, does not answer, or refuses.
    pub fn give_back(&self, lying_rad: &Joints, name: &str) -> Result<(), HardwareError> {
        match self {
            Network::Go1(_) => Err(HardwareError::NoController { robot: "Go1" }),
            Network::Go2(network) => give_back_go2(network, lying_rad, name),
        }
    }
}

#[cfg(feature = "go2")]
fn take_over_go2(
    network: &go2::network::Go2Network,
    lying_rad: &Joints,
    interrupted: &AtomicBool,
    report: &mut dyn FnMut(&str),
) -> Result<Option<String>, HardwareError> {
    let participant = go2::dds::Participant::join(network.domain, network.address()?)?;
    go2::services::take_over(&participant, lying_rad, network.reliable_commands, interrupted, report)
        .map_err(HardwareError::Takeover)
}

#[cfg(not(feature = "go2"))]
fn take_over_go2(
    _: &go2::network::Go2Network,
    _: &Joints,
    _: &AtomicBool,
    _: &mut dyn FnMut(&str),
) -> Result<Option<String>, HardwareError> {
    Err(HardwareError::WithoutGo2)
}

#[cfg(feature = "go2")]
fn give_back_go2(network: &go2::network::Go2Network, lying_rad: &Joints, name: &str) -> Result<(), HardwareError> {
    let participant = go2::dds::Participant::join(network.domain, network.address()?)?;
    go2::give_back::give_back(&participant, lying_rad, name).map_err(HardwareError::GiveBack)
}

#[cfg(not(feature = "go2"))]
fn give_back_go2(_: &go2::network::Go2Network, _: &Joints, _: &str) -> Result<(), HardwareError> {
    Err(HardwareError::WithoutGo2)
}

#[cfg(feature = "go2")]
fn open_go2(network: &go2::network::Go2Network, damping_kd: f64) -> Result<OpenedRobot, HardwareError> {
    let address = network.address()?;
    let command = go2::link::damping(damping_kd).map_err(|error| HardwareError::Damping(error.to_string()))?;
    let join = || go2::dds::Participant::join(network.domain, address);
    let (participant, witness) = (join()?, join()?);
    let commands = go2::dds::TopicType::low_command().with_reliable(network.reliable_commands);
    let transport = go2::dds::DdsTransport::open(&participant, &witness, &commands, command.bytes())?;
    let robot = go2::link::Go2::new(transport, network);
    let (domain, reliable) = (network.domain, network.reliable_commands);
    let route = DampingRoute::Go2 { command: command.bytes().to_vec(), domain, address, reliable };
    Ok((Box::new(robot), (route, None)))
}

#[cfg(not(feature = "go2"))]
fn open_go2(_: &go2::network::Go2Network, _: f64) -> Result<OpenedRobot, HardwareError> {
    Err(HardwareError::WithoutGo2)
}
