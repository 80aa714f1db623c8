//! Detection of a dead SSH connection under the terminal.
//!
//! A connection that ends without closing (Wi-Fi, an unplugged cable) leaves the terminal open: output is buffered, and the
//! operator cannot press STOP. The kernel retransmits data that the peer does not acknowledge, each time after twice the
//! wait, and counts the retransmissions in `/proc/net/tcp` (Linux, Documentation/networking/proc_net_tcp.rst). The screen
//! is drawn several times a second, so there is always data to acknowledge.
//!
//! Only the last hop is observed: the connection between this machine and the one before it.

use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Consecutive retransmissions of a dead connection. The first is sent after 0.2 s or more, the third after seven times
/// that: 1.4 s on a local network, 2 to 3 s on a long path.
const DEAD_RETRANSMISSIONS: u32 = 3;
const CHECK_PERIOD: Duration = Duration::from_millis(250);
const TABLES: [&str; 2] = ["/proc/net/tcp", "/proc/net/tcp6"];

/// A TCP connection by its two ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SshConnection {
    here: SocketAddr,
    there: SocketAddr,
}

impl SshConnection {
    /// Parses `SSH_CONNECTION`: address and port of the client, then of the server (sshd(8)).
    pub fn parse(text: &str) -> Option<SshConnection> {
        let mut words = text.split_whitespace();
        let mut end = || {
            // The interface after a link-local address is not in the tables.
            let address = words.next()?.split('%').next()?;
            Some(SocketAddr::new(address.parse().ok()?, words.next()?.parse().ok()?))
        };
        let (there, here) = (end()?, end()?);
        Some(SshConnection { here, there })
    }

    /// Returns the number of retransmissions of the oldest unacknowledged data; none if the table lacks the connection.
    pub fn retransmissions(&self, table: &str) -> Option<u32> {
        table.lines().find_map(|line| {
            let mut words = line.split_whitespace().skip(1);
            let ends = (end(words.next()?)?, end(words.next()?)?);
            // After state, queues and timer.
            let count = u32::from_str_radix(words.nth(3)?, 16).ok()?;
            (ends == (self.here, self.there)).then_some(count)
        })
    }

    fn dead(&self) -> bool {
        self.in_tables().is_some_and(|count| count >= DEAD_RETRANSMISSIONS)
    }

    /// Whether the kernel of this network namespace has the connection; mosh and a container's network hide it.
    fn listed(&self) -> bool {
        self.in_tables().is_some()
    }

    fn in_tables(&self) -> Option<u32> {
        let tables = TABLES.iter().filter_map(|path| std::fs::read_to_string(path).ok());
        tables.filter_map(|table| self.retransmissions(&table)).max()
    }
}

/// Parses an end as the tables print it: the 32-bit words of the address in host byte order and the port, in hexadecimal.
/// An IPv4 connection may be in the IPv6 table.
fn end(text: &str) -> Option<SocketAddr> {
    let (address, port) = text.split_once(':')?;
    let mut bytes = [0; 16];
    let words = address.len() / 8;
    for (place, i) in bytes.chunks_exact_mut(4).zip(0..words) {
        let word = u32::from_str_radix(address.get(8 * i..8 * i + 8)?, 16).ok()?;
        place.copy_from_slice(&word.to_ne_bytes());
    }
    let address = match words {
        1 => IpAddr::from([bytes[0], bytes[1], bytes[2], bytes[3]]),
        4 => Ipv6Addr::from(bytes).to_canonical(),
        _ => return None,
    };
    Some(SocketAddr::new(address, u16::from_str_radix(port, 16).ok()?))
}

/// Location of the terminal, by the environment variables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TerminalLocation {
    /// This machine.
    Local,
    /// tmux or screen: the environment names the place of their start, not of their use.
    Multiplexer,
    /// Another machine, over SSH; the connection, if `SSH_CONNECTION` can be parsed.
    Ssh(Option<SshConnection>),
    /// Not known: sudo removes `SSH_CONNECTION`.
    Sudo,
}

impl TerminalLocation {
    /// Returns the location for the environment `variable`.
    pub fn of(variable: impl Fn(&str) -> Option<String>) -> TerminalLocation {
        if ["TMUX", "STY"].iter().any(|name| variable(name).is_some()) {
            return TerminalLocation::Multiplexer;
        }
        match variable("SSH_CONNECTION") {
            Some(text) => TerminalLocation::Ssh(SshConnection::parse(&text)),
            None if variable("SUDO_USER").is_some() => TerminalLocation::Sudo,
            None => TerminalLocation::Local,
        }
    }
}

impl TerminalLocation {
    /// Returns the reason why the loss of the connection cannot be detected; none if it can, or if there is no connection.
    pub fn unseen(self) -> Option<&'static str> {
        match self {
            TerminalLocation::Local => None,
            TerminalLocation::Multiplexer => Some("tmux or screen hides its loss"),
            TerminalLocation::Sudo => Some("sudo removed SSH_CONNECTION"),
            TerminalLocation::Ssh(None) => Some("SSH_CONNECTION cannot be read"),
            TerminalLocation::Ssh(Some(connection)) if connection.listed() => None,
            TerminalLocation::Ssh(Some(_)) => Some("SSH_CONNECTION is not in /proc/net/tcp"),
        }
    }
}

/// Monitor of the connection under the terminal. Its thread ends when it is dropped.
#[derive(Debug)]
pub struct ConnectionMonitor {
    dead: Arc<AtomicBool>,
}

impl ConnectionMonitor {
    /// Returns a monitor that always reports the connection alive.
    pub fn unmonitored() -> ConnectionMonitor {
        ConnectionMonitor { dead: Arc::default() }
    }

    /// Monitors the connection to `location`, if there is one that can be monitored.
    ///
    /// # Errors
    /// When the thread cannot be started.
    pub fn watch(location: TerminalLocation) -> std::io::Result<ConnectionMonitor> {
        let monitor = ConnectionMonitor::unmonitored();
        if let TerminalLocation::Ssh(Some(connection)) = location {
            let dead = Arc::downgrade(&monitor.dead);
            let check = move || {
                while let Some(dead) = dead.upgrade() {
                    dead.store(connection.dead(), Ordering::Release);
                    drop(dead);
                    std::thread::sleep(CHECK_PERIOD);
                }
            };
            std::thread::Builder::new().name("connection".into()).spawn(check)?;
        }
        Ok(monitor)
    }

    /// Whether the peer acknowledges data.
    pub fn alive(&self) -> bool {
        !self.dead.load(Ordering::Acquire)
    }
}
