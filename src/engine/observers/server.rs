//! The session's end: accepts observers, sets STOP when one demands it.

use std::io::{self, BufReader, ErrorKind, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use super::{Answer, Demand, SessionFacts, SessionNews, WHO_WATCHES, line, make_socket_folder, read_message};
use crate::printable::is_unprintable;
use crate::realtime::channel::StopLatch;

/// Most connections at a time; further ones are closed.
const MOST_OBSERVERS: usize = 8;
/// Period in which new observers, and the end of the session, are looked for.
const PERIOD: Duration = Duration::from_millis(20);
/// Longest wait for an observer that does not read.
const LONGEST_WRITE: Duration = Duration::from_secs(1);
/// Longest name of an observer, characters.
const LONGEST_NAME: usize = 40;
/// Time in which repeated demands of an observer are one in the log.
const ONE_PRESS: Duration = Duration::from_millis(500);

struct Shared {
    facts: SessionFacts,
    stop: StopLatch,
    /// Messages for the session's log.
    news: Sender<SessionNews>,
    connections: AtomicUsize,
    observers: AtomicUsize,
    closing: AtomicBool,
}

/// The socket of a session; it is removed when this is dropped.
pub struct ObserverServer {
    path: PathBuf,
    shared: Arc<Shared>,
}

impl ObserverServer {
    /// Opens the socket of the session of `facts` and accepts observers on a thread of its own. Their STOPs set `stop`; what
    /// they do is reported to `news`.
    ///
    /// # Errors
    /// When the socket cannot be made or the system cannot start a thread.
    pub fn start(facts: SessionFacts, stop: StopLatch, news: Sender<SessionNews>) -> io::Result<ObserverServer> {
        let path = make_socket_folder()?.join(format!("{}.sock", facts.process));
        // Of a process that was killed and had the same number.
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let named = |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", path.display()));
        let listener = UnixListener::bind(&path).map_err(named)?;
        listener.set_nonblocking(true)?;
        let shared = Arc::new(Shared {
            facts,
            stop,
            news,
            connections: AtomicUsize::new(0),
            observers: AtomicUsize::new(0),
            closing: AtomicBool::new(false),
        });
        let of_thread = Arc::clone(&shared);
        std::thread::Builder::new().name("observers".into()).spawn(move || accept(&listener, &of_thread))?;
        Ok(ObserverServer { path, shared })
    }

    /// Returns the number of observers at present.
    pub fn observers(&self) -> usize {
        self.shared.observers.load(Ordering::Relaxed)
    }

    /// Returns the path of the socket.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for ObserverServer {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::Relaxed);
        // What is left behind refuses connections and is removed by who finds it.
        let _ = std::fs::remove_file(&self.path);
    }
}

fn accept(listener: &UnixListener, shared: &Arc<Shared>) {
    while !shared.closing.load(Ordering::Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => admit(stream, shared),
            // No one waits, or the system is short of something: later again.
            Err(_) => std::thread::sleep(PERIOD),
        }
    }
}

/// Starts the thread of a connection. One beyond the most is closed.
fn admit(stream: UnixStream, shared: &Arc<Shared>) {
    let admitted = shared.connections.fetch_add(1, Ordering::Relaxed) < MOST_OBSERVERS;
    let of_thread = Arc::clone(shared);
    let serve = move || {
        serve(&stream, &of_thread);
        of_thread.connections.fetch_sub(1, Ordering::Relaxed);
    };
    if !admitted || std::thread::Builder::new().name("observer".into()).spawn(serve).is_err() {
        shared.connections.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Serves a connection until either end closes it.
fn serve(stream: &UnixStream, shared: &Shared) {
    let mut name = None;
    // The end of a connection concerns that observer alone.
    let _ = converse(stream, shared, &mut name);
    if let Some(name) = name {
        shared.observers.fetch_sub(1, Ordering::Relaxed);
        shared.report(SessionNews::Attendance(format!("{name} does not watch any longer")));
    }
}

fn converse(stream: &UnixStream, shared: &Shared, name: &mut Option<String>) -> io::Result<()> {
    stream.set_read_timeout(Some(PERIOD))?;
    stream.set_write_timeout(Some(LONGEST_WRITE))?;
    let mut writer = stream;
    writer.write_all(&line(&Answer::Session(shared.facts.clone()))?)?;
    let mut reader = BufReader::new(stream);
    let mut received = Vec::new();
    let mut reported: Option<Instant> = None;
    while !shared.closing.load(Ordering::Relaxed) {
        let Some(demand) = read_message(&mut reader, &mut received)? else { continue };
        match demand {
            Demand::Stop => {
                shared.stop.set();
                // A press of a key may demand it twice, by the thread that reads the keys and by the screen.
                if reported.is_none_or(|reported| reported.elapsed() > ONE_PRESS) {
                    let by = name.as_deref().unwrap_or("an observer");
                    shared.report(SessionNews::Stop(format!("{by}{WHO_WATCHES}")));
                    reported = Some(Instant::now());
                }
                writer.write_all(&line(&Answer::Stopped)?)?;
            }
            Demand::Watch(of) if name.is_none() => {
                let of: String = of.chars().filter(|c| !is_unprintable(*c)).take(LONGEST_NAME).collect();
                shared.observers.fetch_add(1, Ordering::Relaxed);
                shared.report(SessionNews::Attendance(format!("{of} watches this session")));
                *name = Some(of);
            }
            Demand::Watch(_) => {}
        }
    }
    Ok(())
}

impl Shared {
    /// Reports to the session's log; at its end there is none.
    fn report(&self, news: SessionNews) {
        let _ = self.news.send(news);
    }
}
