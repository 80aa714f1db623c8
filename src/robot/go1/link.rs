//! The UDP link: one socket, every datagram judged, every loss counted.
//!
//! The official endpoint reads the queue to its end and judges the last datagram alone; one corrupt datagram then hides all the good
//! ones before it. Here each is judged, and the newest valid one is kept.
//!
//! Time is counted in calls of [`Link::receive`], one a millisecond: the tick reads no other clock, and a test that calls it
//! by hand sees the same ages on a machine of any speed. A thread that is itself late is the watchdog's to notice.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

use super::packet::{LOW_LEVEL, LowCmd, LowState, Rejection};
use crate::robot::recent::Recent;
use crate::robot::{LinkStatus, robot_time_passed};

/// Datagrams judged in one call at most, so that a flood cannot hold the tick; what is left waits for the next call. A robot sends
/// one.
const MOST_PER_CALL: usize = 32;
/// Commands that the system may refuse in a row: one or two are a full queue that the next millisecond empties. More is a way that
/// is closed (an address that nobody answers for fills the queue and keeps it full), and five milliseconds without a command are
/// as many as the watchdog forgives of a slow thread, well before the motors' own time-out.
const REFUSALS_FORGIVEN: u32 = 5;
/// Room for a datagram; a longer one than the robot's is cut, and judged on its beginning.
const BUFFER: usize = 2048;

/// Why a link cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The local port is not to be had.
    #[error(
        "local UDP port {port}: {source}; end the program that has it, the guard of a killed console ends by itself within three seconds; if it does not drive the robot, set another network.local_port in robot.toml"
    )]
    Bind {
        /// The port.
        port: u16,
        /// What the system says.
        source: std::io::Error,
    },
    /// There is no way to the robot's address.
    #[error(
        "no way to the robot at {address}: {source}; is the cable in, and has this machine an address in the robot's network?"
    )]
    Connect {
        /// The robot's address.
        address: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// The description of the robot has no network.
    #[error("{robot}: its robot.toml has no section [network]; only a robot with one can be driven")]
    NoNetwork {
        /// The robot's name.
        robot: String,
    },
}

/// What a link is opened with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LinkOptions {
    /// The robot.
    pub address: SocketAddr,
    /// The port of this machine; 0 takes any.
    pub local_port: u16,
    /// Time between two states on the robot's clock, ms.
    pub state_period_ms: u32,
    /// A state older than the newest by more than this begins a new life of the robot, ms.
    pub restart_ms: u32,
}

/// The link.
#[derive(Debug)]
pub struct Link {
    socket: UdpSocket,
    /// A socket that is connected to itself: what is sent there to rehearse goes nowhere else.
    mirror: Option<UdpSocket>,
    options: LinkOptions,
    newest: Option<LowState>,
    /// Of the last 64 ms before the newest state: bit k is set if the state of k ms before came.
    seen: u64,
    status: LinkStatus,
    /// Commands in a row that the system refused.
    refused: u32,
    recent: LastSeconds,
    buffer: [u8; BUFFER],
}

/// What came in the last five seconds, and what did not.
#[derive(Debug, Default)]
struct LastSeconds {
    received: Recent,
    lost: Recent,
    corrupt: Recent,
}

impl Link {
    /// Binds and connects: only datagrams from exactly the robot's address and port are seen.
    ///
    /// # Errors
    /// When the port is taken or there is no way to the address.
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
            mirror: mirror().ok(),
            options: *options,
            newest: None,
            seen: 0,
            status: LinkStatus::default(),
            refused: 0,
            recent: LastSeconds::default(),
            buffer: [0; BUFFER],
        })
    }

    /// The address of this end.
    ///
    /// # Errors
    /// When the system does not say.
    pub fn local_address(&self) -> std::io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// The same socket once more.
    ///
    /// # Errors
    /// When the system has no descriptor left.
    pub fn socket(&self) -> std::io::Result<UdpSocket> {
        self.socket.try_clone()
    }

    /// How the link is doing.
    pub fn status(&self) -> &LinkStatus {
        &self.status
    }

    /// Whether a valid state ever came.
    pub fn heard(&self) -> bool {
        self.newest.is_some()
    }

    /// Judges what has come since the last call, a millisecond ago. The newest valid state if it is a new one, otherwise none.
    pub fn receive(&mut self) -> Option<&LowState> {
        let LastSeconds { received, lost, corrupt } = &mut self.recent;
        for count in [received, lost, corrupt] {
            count.advance();
        }
        self.status.state_age_ms = self.status.state_age_ms.saturating_add(1);
        let mut is_new = false;
        for _ in 0..MOST_PER_CALL {
            match self.socket.recv(&mut self.buffer) {
                Ok(length) => is_new |= self.judge(length),
                // Nothing more; anything else (nobody listens at the robot's port, the cable is out) shows as silence.
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(_) => {}
            }
        }
        self.status.recent_received = self.recent.received.sum();
        self.status.recent_lost = self.recent.lost.sum();
        self.status.recent_corrupt = self.recent.corrupt.sum();
        self.status.rate_hz = self.recent.received.in_a_second();
        if is_new { self.newest.as_ref() } else { None }
    }

    /// Judges the datagram in the buffer; true if it is a state newer than all before.
    fn judge(&mut self, length: usize) -> bool {
        let state = match LowState::judge(&self.buffer[..length]) {
            Ok(state) => *state,
            Err(rejection) => {
                match rejection {
                    Rejection::Length { .. } => self.status.wrong_length += 1,
                    Rejection::Crc { .. } => {
                        self.status.corrupt += 1;
                        self.recent.corrupt.add(1);
                    }
                    Rejection::Head { .. } | Rejection::BatteryOff => self.status.foreign += 1,
                }
                return false;
            }
        };
        // A high-level state has another layout: its numbers would be taken for others.
        if state.header.level != LOW_LEVEL {
            self.status.foreign += 1;
            return false;
        }
        if !self.place_in_time(state.tick.get()) {
            return false;
        }
        self.newest = Some(state);
        self.status.received += 1;
        self.status.state_age_ms = 0;
        self.recent.received.add(1);
        true
    }

    /// Where a valid state of the robot's time `tick` stands among the others; true if it is newer.
    fn place_in_time(&mut self, tick: u32) -> bool {
        let Some(newest) = &self.newest else {
            self.seen = 1;
            return true;
        };
        let newer_by = robot_time_passed(tick, newest.tick.get());
        let older_by = newer_by.unsigned_abs();
        if newer_by > 0 {
            let gap = (older_by / self.options.state_period_ms).saturating_sub(1);
            self.status.lost += u64::from(gap);
            self.recent.lost.add(gap);
            self.seen = self.seen.checked_shl(older_by).unwrap_or(0) | 1;
            true
        } else if older_by > self.options.restart_ms {
            self.status.reboots += 1;
            self.seen = 1;
            true
        } else {
            let bit = 1u64.checked_shl(older_by).unwrap_or(0);
            if self.seen & bit != 0 {
                self.status.duplicate += 1;
            } else {
                self.status.late += 1;
                if bit != 0 {
                    // It was counted as lost when the gap was seen.
                    self.seen |= bit;
                    self.status.lost = self.status.lost.saturating_sub(1);
                    self.recent.lost.take_back();
                }
            }
            false
        }
    }

    /// Sends a command.
    ///
    /// # Errors
    /// The system's error number, where it cannot be sent. That nobody listened to an earlier datagram, or that the system has no
    /// room for this one, is no error but counted: the robot's silence says the first, the next millisecond mends the second. A
    /// sixth refusal in a row, and each after it, is an error: nothing has reached the network for so long.
    pub fn send(&mut self, command: &LowCmd) -> Result<(), i32> {
        // A port where nobody listens is reported at the next call in place of sending: the second try sends.
        let refused = |sent: &std::io::Result<usize>| {
            sent.as_ref().is_err_and(|error| error.kind() == ErrorKind::ConnectionRefused)
        };
        let mut sent = self.socket.send(command.bytes());
        if refused(&sent) {
            sent = self.socket.send(command.bytes());
        }
        self.account(sent)
    }

    /// Sends `command` to nobody but this link itself, takes it back, and judges the newest state once more: the way of a
    /// datagram, in the system and here. The state is given back, if there is one.
    pub fn rehearse(&mut self, mut command: LowCmd) -> Option<&LowState> {
        // No robot would obey it, wherever it went.
        command.header.head = [0; 2];
        if let Some(mirror) = &self.mirror {
            let _ = mirror.send(command.bytes());
            for _ in 0..MOST_PER_CALL {
                if mirror.recv(&mut self.buffer).is_err() {
                    break;
                }
            }
        }
        LowState::judge(self.newest.as_ref()?.bytes()).ok()
    }

    /// Counts what became of a command.
    fn account(&mut self, sent: std::io::Result<usize>) -> Result<(), i32> {
        let Err(error) = sent else {
            self.status.sent += 1;
            self.refused = 0;
            return Ok(());
        };
        self.status.send_errors += 1;
        self.refused = self.refused.saturating_add(1);
        let passes = matches!(error.kind(), ErrorKind::ConnectionRefused | ErrorKind::WouldBlock);
        if passes && self.refused <= REFUSALS_FORGIVEN { Ok(()) } else { Err(error.raw_os_error().unwrap_or(0)) }
    }
}

/// Rehearsing is worth a few microseconds, not an error: where this socket is not to be had, it is left out.
fn mirror() -> std::io::Result<UdpSocket> {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    socket.connect(socket.local_addr()?)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::go1::packet::CrcForm;

    /// (What a rehearsal does not change is compared in `tests/control_rehearsal.rs`.)
    #[test]
    fn a_rehearsal_sends_a_datagram_to_itself_that_nobody_obeys() {
        let address = (Ipv4Addr::LOCALHOST, 9).into();
        let mut link =
            Link::open(&LinkOptions { address, local_port: 0, state_period_ms: 1, restart_ms: 100 }).unwrap();
        let command = LowCmd::damping(CrcForm::Plain);
        assert_eq!(link.rehearse(command), None, "there is no state yet");
        let came = &link.buffer[..command.bytes().len()];
        assert_eq!(came[2..], command.bytes()[2..]);
        assert!(LowCmd::judge(came, CrcForm::Plain).is_err());
        assert_eq!(link.status, LinkStatus::default());
    }

    /// No socket of this machine can be made to refuse every send: what the system says is given by hand.
    #[test]
    fn a_link_that_refuses_every_send_says_so_after_a_few() {
        let address = (Ipv4Addr::LOCALHOST, 9).into();
        let options = LinkOptions { address, local_port: 0, state_period_ms: 1, restart_ms: 100 };
        let mut link = Link::open(&options).unwrap();
        let full = nix::errno::Errno::EAGAIN as i32;
        let refused = || Err(std::io::Error::from_raw_os_error(full));
        for _ in 0..2 {
            for _ in 0..REFUSALS_FORGIVEN {
                assert_eq!(link.account(refused()), Ok(()), "a full queue for a few milliseconds is forgiven");
            }
            assert_eq!(link.account(refused()), Err(full));
            assert_eq!(link.account(refused()), Err(full), "as long as it lasts");
            assert_eq!(link.account(Ok(614)), Ok(()), "and over with the first that goes out");
        }
        assert_eq!((link.status.sent, link.status.send_errors), (2, 14), "each is counted");
    }
}
