//! The network side of an emulated robot: how commands arrive and states leave.

use std::net::{SocketAddr, UdpSocket};

use crate::robot::go1::packet::{CrcForm, LowCmd};
use crate::robot::go1::{self, convert};
use crate::robot::{JOINTS, MotorCommand, RobotState};

/// Size of the receive buffer.
const BUFFER: usize = 2048;

/// A program that commands an emulated robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EmulatorClient {
    /// Its UDP address.
    Address(SocketAddr),
    /// Its identity in a DDS domain.
    Participant([u8; 12]),
}

impl std::fmt::Display for EmulatorClient {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            EmulatorClient::Address(address) => write!(f, "{address}"),
            EmulatorClient::Participant(identity) => {
                write!(f, "DDS participant ")?;
                identity.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
            }
        }
    }
}

/// Protocol and network of an emulated robot. No call waits.
pub(super) trait Endpoint: Send + std::fmt::Debug {
    /// Takes the next command that arrived.
    fn receive(&mut self) -> Option<(EmulatorClient, Vec<u8>)>;

    /// Decodes a command; none if it is rejected. A motor without a command brakes.
    fn decode(&self, command: &[u8]) -> Option<[Option<MotorCommand>; JOINTS]>;

    /// Encodes a state.
    fn encode(&self, state: &RobotState) -> Vec<u8>;

    /// Puts a state on the network, `to` the program that commands; the robot goes on if that fails.
    fn send(&mut self, state: &[u8], to: Option<EmulatorClient>);

    /// Whether states are sent before the first command, and to everyone.
    fn sends_to_all(&self) -> bool;

    /// One millisecond of the robot's own services.
    fn advance(&mut self) {}

    /// The robot boots again: its own controller starts as after the robot was switched on.
    fn reboot(&mut self) {}
}

/// UDP endpoint of a Go1.
#[derive(Debug)]
pub(super) struct Go1Endpoint {
    socket: UdpSocket,
    crc: CrcForm,
    foot_force_n: f64,
    /// Length of a state's datagram.
    state_length: usize,
    buffer: [u8; BUFFER],
}

impl Go1Endpoint {
    /// Receives on `address`; port 0 takes any free one.
    pub fn bind(address: SocketAddr, network: &go1::Go1Network, state_length: usize) -> std::io::Result<Go1Endpoint> {
        let socket = UdpSocket::bind(address)?;
        socket.set_nonblocking(true)?;
        let (crc, foot_force_n) = (network.crc, network.foot_force_n);
        Ok(Go1Endpoint { socket, crc, foot_force_n, state_length, buffer: [0; BUFFER] })
    }

    pub fn local_address(&self) -> std::io::Result<SocketAddr> {
        self.socket.local_addr()
    }
}

impl Endpoint for Go1Endpoint {
    fn receive(&mut self) -> Option<(EmulatorClient, Vec<u8>)> {
        let (length, from) = self.socket.recv_from(&mut self.buffer).ok()?;
        Some((EmulatorClient::Address(from), self.buffer[..length].to_vec()))
    }

    fn decode(&self, command: &[u8]) -> Option<[Option<MotorCommand>; JOINTS]> {
        let command = LowCmd::parse(command, self.crc).ok()?;
        Some(std::array::from_fn(|i| convert::decode_motor(&command.motor(i))))
    }

    fn encode(&self, state: &RobotState) -> Vec<u8> {
        let mut datagram = convert::low_state(state, self.foot_force_n);
        datagram.write_crc();
        let mut bytes = datagram.bytes().to_vec();
        bytes.resize(self.state_length, 0);
        bytes
    }

    fn send(&mut self, state: &[u8], to: Option<EmulatorClient>) {
        if let Some(EmulatorClient::Address(client)) = to {
            // The robot goes on if the controller's port is closed.
            let _ = self.socket.send_to(state, client);
        }
    }

    fn sends_to_all(&self) -> bool {
        false
    }
}
