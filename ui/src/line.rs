//! The operator's line: whether the SSH connection under this terminal still answers.
//!
//! A line that just dies (Wi-Fi, a pulled cable) closes nothing: the terminal is there, what is drawn goes into a buffer, and nobody
//! can press STOP. The system knows better. It repeats what the other side does not acknowledge, each time after twice the
//! wait, and counts the repetitions in `/proc/net/tcp` (Linux, Documentation/networking/proc_net_tcp.rst); the screen is drawn
//! several times a second, so there is always something to acknowledge.
//!
//! Seen is the last leg alone: the connection between this machine and the one before it.

use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Repetitions in a row after which a line counts as dead. The first waits for 0.2 s or more, the third is sent after seven times
/// as long: 1.4 s in a room, two or three seconds over a distance.
const REPETITIONS: u32 = 3;
/// How often it is looked at.
const LOOK: Duration = Duration::from_millis(250);
/// Where the system tells of its connections.
const TABLES: [&str; 2] = ["/proc/net/tcp", "/proc/net/tcp6"];

/// A TCP connection by its two ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Connection {
    here: SocketAddr,
    there: SocketAddr,
}

impl Connection {
    /// That of `SSH_CONNECTION`: address and port of the client, then of the server (sshd(8)).
    pub fn of_ssh(words: &str) -> Option<Connection> {
        let mut words = words.split_whitespace();
        let mut end = || {
            // A link-local address has its interface behind it, which the tables do not tell.
            let address = words.next()?.split('%').next()?;
            Some(SocketAddr::new(address.parse().ok()?, words.next()?.parse().ok()?))
        };
        let (there, here) = (end()?, end()?);
        Some(Connection { here, there })
    }

    /// How often what was sent last was repeated so far; none where the table does not know the connection.
    pub fn repetitions(&self, table: &str) -> Option<u32> {
        table.lines().find_map(|line| {
            let mut words = line.split_whitespace().skip(1);
            let ends = (end(words.next()?)?, end(words.next()?)?);
            // State, queues and timer come between.
            let repeated = u32::from_str_radix(words.nth(3)?, 16).ok()?;
            (ends == (self.here, self.there)).then_some(repeated)
        })
    }

    fn dead(&self) -> bool {
        let tables = TABLES.iter().filter_map(|path| std::fs::read_to_string(path).ok());
        tables.filter_map(|table| self.repetitions(&table)).any(|repetitions| repetitions >= REPETITIONS)
    }
}

/// An end as the tables write it: the address's words as this machine reads them from memory, in hexadecimal, and the port. A
/// connection of version 4 may stand in the table of version 6.
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

/// What is at the other end of the terminal, as the environment tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// This machine.
    Here,
    /// tmux or screen: the environment tells where they were started from, not where they are looked at.
    Multiplexer,
    /// Another machine, by SSH; the connection, if it can be read.
    Ssh(Option<Connection>),
}

impl Place {
    /// That of the environment.
    pub fn of(variable: impl Fn(&str) -> Option<String>) -> Place {
        if ["TMUX", "STY"].iter().any(|name| variable(name).is_some()) {
            return Place::Multiplexer;
        }
        variable("SSH_CONNECTION").map_or(Place::Here, |words| Place::Ssh(Connection::of_ssh(&words)))
    }
}

/// The line under this terminal, looked at by a thread of its own; its end ends the thread.
#[derive(Debug)]
pub struct Line {
    dead: Arc<AtomicBool>,
}

impl Line {
    /// A line that is never dead: a terminal of this machine, or a recording that is looked at.
    pub fn here() -> Line {
        Line { dead: Arc::default() }
    }

    /// The line to `place`, as far as it is known.
    ///
    /// # Errors
    /// When there is no thread to be had.
    pub fn watch(place: Place) -> std::io::Result<Line> {
        let line = Line::here();
        if let Place::Ssh(Some(connection)) = place {
            let dead = Arc::downgrade(&line.dead);
            let look = move || {
                while let Some(dead) = dead.upgrade() {
                    dead.store(connection.dead(), Ordering::Release);
                    drop(dead);
                    std::thread::sleep(LOOK);
                }
            };
            std::thread::Builder::new().name("line".into()).spawn(look)?;
        }
        Ok(line)
    }

    /// Whether somebody may be at its other end.
    pub fn alive(&self) -> bool {
        !self.dead.load(Ordering::Acquire)
    }
}
