//! Server for viewers of the running session: the messages of the recording over WebSocket in Foxglove's protocol, view only.
//!
//! The recorder's thread hands each message over and never waits for a viewer: each viewer has a queue of bounded length and a
//! thread of its own. A message that finds a queue full is left out for that viewer and counted.

mod audience;
mod protocol;
mod viewer;

use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use self::audience::Shared;
use super::topic::Topic;

/// Most viewers at a time; further ones are refused.
const MOST_VIEWERS: usize = 8;
/// Period in which new viewers are looked for.
const ACCEPT_PERIOD: Duration = Duration::from_millis(20);

/// State of the server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LiveStatus {
    /// Address on which it listens.
    pub address: SocketAddr,
    /// Viewers at present.
    pub viewers: usize,
    /// Messages left out, of all viewers together.
    pub dropped: u64,
}

/// The recording's end: hands messages to the viewers.
#[derive(Clone)]
pub struct LiveFeed(Arc<Shared>);

impl LiveFeed {
    /// Hands an encoded message to all viewers that have subscribed to its topic. Neither waits nor fails.
    pub(super) fn send(&self, topic: Topic, log_time: u64, data: &[u8]) {
        self.0.publish(topic, log_time, data);
    }
}

/// A server that listens; it ends when it is dropped.
pub struct LiveServer {
    address: SocketAddr,
    shared: Arc<Shared>,
}

impl LiveServer {
    /// Listens on `address`, on port 0 on a free one, and accepts viewers on a thread of its own.
    ///
    /// # Errors
    /// When the address is not one of this machine alone (loopback), or in use, or the system cannot start a thread.
    pub fn start(address: SocketAddr) -> io::Result<LiveServer> {
        if !address.ip().is_loopback() {
            let reason = "not an address of this machine alone; the view has no password and is not encrypted";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        std::thread::Builder::new().name("live".into()).spawn(move || accept(&listener, &of_thread))?;
        Ok(LiveServer { address, shared })
    }

    /// Returns the end for a recording.
    pub fn feed(&self) -> LiveFeed {
        LiveFeed(Arc::clone(&self.shared))
    }

    /// Returns the present state.
    pub fn status(&self) -> LiveStatus {
        LiveStatus {
            address: self.address,
            viewers: self.shared.viewers.load(Ordering::Relaxed),
            dropped: self.shared.dropped.load(Ordering::Relaxed),
        }
    }
}

impl Drop for LiveServer {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::Relaxed);
    }
}

/// Accepts viewers until the server is dropped.
fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    while !shared.closing.load(Ordering::Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => admit(stream, shared),
            // No viewer waits, or the system is short of something: later again.
            Err(_) => std::thread::sleep(ACCEPT_PERIOD),
        }
    }
}

/// Starts the thread of a viewer. A viewer beyond the most is disconnected.
fn admit(stream: TcpStream, shared: &Arc<Shared>) {
    if shared.viewers.fetch_add(1, Ordering::Relaxed) >= MOST_VIEWERS {
        shared.viewers.fetch_sub(1, Ordering::Relaxed);
        return;
    }
    let of_thread = Arc::clone(shared);
    let started = std::thread::Builder::new().name("live viewer".into()).spawn(move || {
        // The end of a connection concerns that viewer alone.
        let _ = viewer::serve(stream, &of_thread);
        of_thread.viewers.fetch_sub(1, Ordering::Relaxed);
    });
    if started.is_err() {
        shared.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}
