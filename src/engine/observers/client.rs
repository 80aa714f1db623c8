//! The observer's end: finds running sessions, watches one, passes STOP on.

use std::io::{self, BufReader, ErrorKind, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use super::{Answer, Demand, SessionFacts, line, read_message, require_own, socket_folders};
use crate::realtime::channel::StopLatch;

/// Longest wait for the facts of a session.
const LONGEST_WAIT: Duration = Duration::from_secs(2);
/// Period in which a STOP is looked for.
const STOP_PERIOD: Duration = Duration::from_millis(10);
/// Longest wait of an observer that leaves for the session to confirm its STOP.
const LONGEST_CONFIRMATION: Duration = Duration::from_secs(1);

/// A session that runs on this machine under this user.
#[derive(Debug)]
pub struct RunningSession {
    /// Facts about the session.
    pub facts: SessionFacts,
    reader: BufReader<UnixStream>,
}

/// Sessions in the folders of sockets.
#[derive(Debug, Default)]
pub struct FoundSessions {
    /// The sessions that run, by the number of their process.
    pub running: Vec<RunningSession>,
    /// The sockets that do not answer as a session does, with the reason.
    pub silent: Vec<(PathBuf, io::Error)>,
    /// The folders that were not searched, with the reason.
    pub skipped: Vec<(PathBuf, io::Error)>,
}

/// Finds the sessions that run on this machine under this user. The sockets of sessions that were killed are removed.
/// A folder that another user made, or may enter, is not searched.
pub fn find_sessions() -> FoundSessions {
    let mut found = FoundSessions::default();
    for folder in socket_folders() {
        let sockets = match sockets_in(&folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            Err(error) => {
                found.skipped.push((folder, error));
                continue;
            }
            Ok(sockets) => sockets,
        };
        for socket in sockets {
            match connect(&socket) {
                Ok(session) => found.running.push(session),
                Err(error) if error.kind() == ErrorKind::ConnectionRefused => drop(std::fs::remove_file(&socket)),
                Err(error) => found.silent.push((socket, error)),
            }
        }
    }
    found.running.sort_by_key(|session| session.facts.process);
    found
}

fn sockets_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    require_own(folder)?;
    let paths = std::fs::read_dir(folder)?.filter_map(|entry| Some(entry.ok()?.path()));
    Ok(paths.filter(|path| path.extension().is_some_and(|extension| extension == "sock")).collect())
}

fn connect(socket: &PathBuf) -> io::Result<RunningSession> {
    let stream = UnixStream::connect(socket)?;
    stream.set_read_timeout(Some(LONGEST_WAIT))?;
    let mut reader = BufReader::new(stream);
    match read_message(&mut reader, &mut Vec::new())? {
        Some(Answer::Session(facts)) => Ok(RunningSession { facts, reader }),
        Some(Answer::Stopped) => Err(io::Error::new(ErrorKind::InvalidData, "an answer without a demand")),
        None => Err(io::Error::new(ErrorKind::TimedOut, "the session does not answer")),
    }
}

/// State of an observer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ObserverStatus {
    /// Whether the session has ended or closed the connection.
    pub ended: bool,
    /// STOPs demanded.
    pub demanded: u64,
    /// STOPs that the session has set.
    pub stopped: u64,
}

#[derive(Default)]
struct Connection {
    stop: StopLatch,
    stopped: AtomicU64,
    ended: AtomicBool,
    closing: AtomicBool,
}

impl Connection {
    fn status(&self) -> ObserverStatus {
        ObserverStatus {
            ended: self.ended.load(Ordering::Acquire),
            demanded: self.stop.count(),
            stopped: self.stopped.load(Ordering::Acquire),
        }
    }
}

/// An observer of a session; it leaves when it is dropped, once its STOPs are confirmed or after 1 s.
pub struct Observer(Arc<Connection>);

impl Observer {
    /// Watches a session under a name. STOPs of [`stop_latch`](Observer::stop_latch) are passed on by a thread of its own.
    ///
    /// # Errors
    /// When the session has ended meanwhile, or the system cannot start a thread.
    pub fn join(session: RunningSession, name: &str) -> io::Result<Observer> {
        let RunningSession { mut reader, .. } = session;
        reader.get_mut().write_all(&line(&Demand::Watch(name.to_owned()))?)?;
        reader.get_mut().set_read_timeout(Some(STOP_PERIOD))?;
        let connection = Arc::new(Connection::default());
        let of_thread = Arc::clone(&connection);
        std::thread::Builder::new().name("observer".into()).spawn(move || {
            // Whatever ends it, nothing is passed on any longer.
            let _ = pass_on(&mut reader, &of_thread);
            of_thread.ended.store(true, Ordering::Release);
        })?;
        Ok(Observer(connection))
    }

    /// Returns the latch whose STOPs are passed on.
    pub fn stop_latch(&self) -> StopLatch {
        self.0.stop.clone()
    }

    /// Returns the present state.
    pub fn status(&self) -> ObserverStatus {
        self.0.status()
    }

    /// Returns a function that returns the present state, also after the observer has left.
    pub fn watch(&self) -> impl Fn() -> ObserverStatus + use<> {
        let connection = Arc::clone(&self.0);
        move || connection.status()
    }
}

impl Drop for Observer {
    fn drop(&mut self) {
        // The process may exit after this and end the thread that sends.
        let begun = Instant::now();
        let unconfirmed = |status: ObserverStatus| !status.ended && status.stopped < status.demanded;
        while unconfirmed(self.status()) && begun.elapsed() < LONGEST_CONFIRMATION {
            std::thread::sleep(STOP_PERIOD);
        }
        self.0.closing.store(true, Ordering::Release);
    }
}

/// Sends the STOPs that are demanded beyond the `sent` ones.
fn send_stops(stream: &mut UnixStream, connection: &Connection, sent: &mut u64) -> io::Result<()> {
    while *sent < connection.stop.count() {
        stream.write_all(&line(&Demand::Stop)?)?;
        *sent += 1;
    }
    Ok(())
}

fn pass_on(reader: &mut BufReader<UnixStream>, connection: &Connection) -> io::Result<()> {
    let mut sent = 0;
    let mut received = Vec::new();
    while !connection.closing.load(Ordering::Acquire) {
        send_stops(reader.get_mut(), connection, &mut sent)?;
        if read_message(reader, &mut received)? == Some(Answer::Stopped) {
            connection.stopped.fetch_add(1, Ordering::AcqRel);
        }
    }
    // A STOP that was set during the last read.
    send_stops(reader.get_mut(), connection, &mut sent)
}
