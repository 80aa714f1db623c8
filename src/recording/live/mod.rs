//! Server for viewers of the running session: the messages of the recording over WebSocket in Foxglove's protocol, view only.
//!
//! The recorder's thread hands each message over and never waits for a viewer: each viewer has a queue of bounded length and a
//! thread of its own. A message that finds a queue full is left out for that viewer and counted.

mod protocol;
mod viewer;

use std::collections::BTreeMap;
use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use self::protocol::message_data;
use super::topic::Topic;

/// Most viewers at a time; further ones are refused.
const MOST_VIEWERS: usize = 8;
/// Most subscriptions of a viewer: one of each topic, and some that are replaced.
const MOST_SUBSCRIPTIONS: usize = 64;
/// Messages that wait for a viewer: two seconds of ticks.
const QUEUE: usize = 2048;
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

/// A viewer's subscriptions (number by topic) and the queue to its thread.
struct Viewer {
    number: u64,
    subscriptions: BTreeMap<u32, Topic>,
    queue: SyncSender<Vec<u8>>,
}

/// Viewers, and the newest message of each topic that a new subscription begins with.
#[derive(Default)]
struct Audience {
    viewers: Vec<Viewer>,
    newest: BTreeMap<Topic, (u64, Vec<u8>)>,
    /// Number of the next viewer.
    next: u64,
}

struct Shared {
    audience: Mutex<Audience>,
    viewers: AtomicUsize,
    dropped: AtomicU64,
    closing: AtomicBool,
}

impl Shared {
    /// Never held while anything is sent or received.
    fn audience(&self) -> MutexGuard<'_, Audience> {
        self.audience.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(&self, viewer: &Viewer, message: Vec<u8>) {
        if let Err(TrySendError::Full(_)) = viewer.queue.try_send(message) {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Subscribes a viewer to a topic, and sends it the newest message if the topic has seldom one.
    fn subscribe(&self, number: u64, subscription: u32, topic: Topic) {
        let mut audience = self.audience();
        let newest = audience.newest.get(&topic).cloned();
        let Some(viewer) = audience.viewers.iter_mut().find(|viewer| viewer.number == number) else { return };
        if viewer.subscriptions.len() >= MOST_SUBSCRIPTIONS {
            return;
        }
        viewer.subscriptions.insert(subscription, topic);
        if let Some((log_time, data)) = newest {
            let message = message_data(subscription, log_time, &data);
            self.put(viewer, message);
        }
    }

    fn unsubscribe(&self, number: u64, subscription: u32) {
        if let Some(viewer) = self.audience().viewers.iter_mut().find(|viewer| viewer.number == number) {
            viewer.subscriptions.remove(&subscription);
        }
    }

    fn remove(&self, number: u64) {
        self.audience().viewers.retain(|viewer| viewer.number != number);
    }
}

/// The recording's end: hands messages to the viewers.
#[derive(Clone)]
pub struct LiveFeed(Arc<Shared>);

impl LiveFeed {
    /// Hands an encoded message to all viewers that have subscribed to its topic. Neither waits nor fails.
    pub(super) fn send(&self, topic: Topic, log_time: u64, data: &[u8]) {
        let mut audience = self.0.audience();
        if topic.is_event() || matches!(topic, Topic::RobotScene | Topic::GroundScene) {
            audience.newest.insert(topic, (log_time, data.to_vec()));
        }
        for viewer in &audience.viewers {
            for (subscription, _) in viewer.subscriptions.iter().filter(|(_, wanted)| **wanted == topic) {
                self.0.put(viewer, message_data(*subscription, log_time, data));
            }
        }
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
        let shared = Arc::new(Shared {
            audience: Mutex::default(),
            viewers: AtomicUsize::new(0),
            dropped: AtomicU64::new(0),
            closing: AtomicBool::new(false),
        });
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

/// Adds a viewer; returns its number and the end of its queue.
fn join(shared: &Shared) -> (u64, std::sync::mpsc::Receiver<Vec<u8>>) {
    let (queue, messages) = sync_channel(QUEUE);
    let mut audience = shared.audience();
    let number = audience.next;
    audience.next += 1;
    audience.viewers.push(Viewer { number, subscriptions: BTreeMap::new(), queue });
    (number, messages)
}
