//! UDP link to the robot: one socket; every datagram is checked, every loss counted.
//!
//! The official endpoint reads the queue to its end and checks the last datagram alone, so one corrupt datagram hides
//! all valid ones before it. Here each datagram is checked, and the newest valid state is kept.
//!
//! Time is counted in calls of [`Link::receive`], one per millisecond.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

use super::packet::{LOW_LEVEL, LowCmd, LowState, Rejection};
use crate::robot::LinkStatus;
use crate::robot::state_counter::{StateClock, StateCounter};

/// Most datagrams read in one call, so that a flood cannot delay the tick; the rest is read in the next calls. A robot
/// sends one per millisecond.
const MOST_PER_CALL: usize = 32;
/// Consecutive commands that the system may refuse to send without an error. One or two mean a full queue that the next
/// millisecond empties; more mean that the robot is unreachable (an address without an answer keeps the queue full).
/// Five milliseconds without a command are also the watchdog's limit for a slow thread, well below the motors'
/// time-out.
const TOLERATED_REFUSALS: u32 = 5;
/// Size of the receive buffer; a longer datagram is truncated.
const BUFFER: usize = 2048;

/// Error of opening a link.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum LinkError {
    #[error(
        "local UDP port {port}: {source}; end the program that uses it (the guard of a killed console ends within three seconds); if that program does not drive the robot, set another network.local_port in robot.toml"
    )]
    Bind { port: u16, source: std::io::Error },
    #[error(
        "no route to the robot at {address}: {source}; check the cable, and that this machine has an address in the robot's network"
    )]
    Connect { address: SocketAddr, source: std::io::Error },
}

/// Settings of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LinkOptions {
    /// Address of the robot.
    pub address: SocketAddr,
    /// Local port; 0 takes any free one.
    pub local_port: u16,
    /// Reading of the robot's clock: period and restart.
    pub clock: StateClock,
}

/// UDP link to a robot.
#[derive(Debug)]
pub struct Link {
    socket: UdpSocket,
    /// Socket connected to itself, for the cache warm-up.
    loopback: Option<UdpSocket>,
    newest: Option<LowState>,
    counter: StateCounter,
    /// Consecutive commands that the system refused to send.
    refused: u32,
    buffer: [u8; BUFFER],
}

impl Link {
    /// Binds and connects the socket: it receives only datagrams from the robot's address and port.
    ///
    /// # Errors
    /// The port is taken, or there is no route to the address.
    pub fn open(options: &LinkOptions) -> Result<Link, LinkError> {
        let any: IpAddr = match options.address {
            SocketAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
            SocketAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
        };
        let port = options.local_port;
        let socket = UdpSocket::bind((any, port)).map_err(|source| LinkError::Bind { port, source })?;
        let connected = socket.connect(options.address).and_then(|()| socket.set_nonblocking(true));
        connected.map_err(|source| LinkError::Connect { address: options.address, source })?;
        Ok(Link {
            socket,
            loopback: loopback_socket().ok(),
            newest: None,
            counter: StateCounter::new(options.clock),
            refused: 0,
            buffer: [0; BUFFER],
        })
    }

    /// Returns the local address.
    ///
    /// # Errors
    /// Error of the operating system.
    pub fn local_address(&self) -> std::io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Returns a second descriptor of the socket.
    ///
    /// # Errors
    /// The system has no descriptor left.
    pub fn socket(&self) -> std::io::Result<UdpSocket> {
        self.socket.try_clone()
    }

    /// Returns the statistics.
    pub fn status(&self) -> &LinkStatus {
        &self.counter.status
    }

    /// Returns the receive buffer. It begins with the newest datagram, also with an invalid one or that of a warm-up.
    pub fn buffer(&self) -> &[u8] {
        &self.buffer
    }

    /// Whether a valid state has ever arrived.
    pub fn has_received(&self) -> bool {
        self.newest.is_some()
    }

    /// Reads all datagrams since the last call, a millisecond ago. Returns the newest valid state, or none if there is
    /// no new one.
    pub fn receive(&mut self) -> Option<&LowState> {
        self.counter.advance();
        let mut is_new = false;
        for _ in 0..MOST_PER_CALL {
            match self.socket.recv(&mut self.buffer) {
                Ok(length) => is_new |= self.take_datagram(length),
                // The queue is empty. Other errors (robot's port closed, cable unplugged) become visible as a missing
                // state.
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(_) => {}
            }
        }
        self.counter.sum_recent();
        if is_new { self.newest.as_ref() } else { None }
    }

    /// Checks and counts the datagram in the buffer. Returns true if it is a state newer than all earlier ones.
    fn take_datagram(&mut self, length: usize) -> bool {
        let state = match LowState::parse(&self.buffer[..length]) {
            Ok(state) => *state,
            Err(rejection) => {
                match rejection {
                    Rejection::Length { .. } => self.counter.status.wrong_length += 1,
                    Rejection::Crc { .. } => self.counter.count_corrupt(),
                    Rejection::Head { .. } | Rejection::BatteryOff => self.counter.status.foreign += 1,
                }
                return false;
            }
        };
        // A high-level state has another layout.
        if state.header.level != LOW_LEVEL {
            self.counter.status.foreign += 1;
            return false;
        }
        let is_new = self.counter.count_state(state.robot_time_ms.get());
        if is_new {
            self.newest = Some(state);
        }
        is_new
    }

    /// Sends a command.
    ///
    /// # Errors
    /// The system's error number. A closed port (reported for an earlier datagram) and a full queue are counted and are
    /// errors only from the sixth consecutive one on: the first is visible as missing states, the second usually ends
    /// in the next millisecond.
    pub fn send(&mut self, command: &LowCmd) -> Result<(), i32> {
        // A closed port is reported by the next call in place of sending; the second try sends.
        let refused = |sent: &std::io::Result<usize>| {
            sent.as_ref().is_err_and(|error| error.kind() == ErrorKind::ConnectionRefused)
        };
        let mut sent = self.socket.send(command.bytes());
        if refused(&sent) {
            sent = self.socket.send(command.bytes());
        }
        self.count_sent(sent)
    }

    /// Cache warm-up: sends `command` to a loopback socket, receives it, and parses the newest state again. Returns
    /// that state, if there is one.
    pub fn warm_up(&mut self, mut command: LowCmd) -> Option<&LowState> {
        // Makes it invalid for every robot.
        command.header.head = [0; 2];
        if let Some(socket) = &self.loopback {
            let _ = socket.send(command.bytes());
            for _ in 0..MOST_PER_CALL {
                if socket.recv(&mut self.buffer).is_err() {
                    break;
                }
            }
        }
        LowState::parse(self.newest.as_ref()?.bytes()).ok()
    }

    /// Counts the result of sending a command; to be called once per command that was sent over [`Link::socket`].
    ///
    /// # Errors
    /// As [`Link::send`].
    pub fn count_sent(&mut self, sent: std::io::Result<usize>) -> Result<(), i32> {
        let Err(error) = sent else {
            self.counter.status.sent += 1;
            self.refused = 0;
            return Ok(());
        };
        self.counter.status.send_errors += 1;
        self.refused = self.refused.saturating_add(1);
        let tolerable = matches!(error.kind(), ErrorKind::ConnectionRefused | ErrorKind::WouldBlock);
        if tolerable && self.refused <= TOLERATED_REFUSALS { Ok(()) } else { Err(error.raw_os_error().unwrap_or(0)) }
    }
}

/// Opens the socket for the warm-up. It saves only microseconds, so a link works without it.
fn loopback_socket() -> std::io::Result<UdpSocket> {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    socket.connect(socket.local_addr()?)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}
