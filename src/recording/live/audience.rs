//! The viewers with their subscriptions and queues.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::protocol::message_data;
use crate::recording::topic::Topic;

/// Most subscriptions of a viewer: one of each topic, and some that are replaced.
const MOST_SUBSCRIPTIONS: usize = 64;
/// Messages that wait for a viewer: two seconds of ticks.
const QUEUE: usize = 2048;

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

/// State that the recorder's thread and the viewers' threads share.
#[derive(Default)]
pub struct Shared {
    audience: Mutex<Audience>,
    /// Connections, also those in the handshake.
    pub viewers: AtomicUsize,
    /// Messages left out.
    pub dropped: AtomicU64,
    /// Whether the server ends.
    pub closing: AtomicBool,
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
    pub fn subscribe(&self, number: u64, subscription: u32, topic: Topic) {
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

    /// Ends a subscription of a viewer.
    pub fn unsubscribe(&self, number: u64, subscription: u32) {
        if let Some(viewer) = self.audience().viewers.iter_mut().find(|viewer| viewer.number == number) {
            viewer.subscriptions.remove(&subscription);
        }
    }

    /// Removes a viewer.
    pub fn remove(&self, number: u64) {
        self.audience().viewers.retain(|viewer| viewer.number != number);
    }

    /// Adds a viewer; returns its number and the end of its queue.
    pub fn join(&self) -> (u64, Receiver<Vec<u8>>) {
        let (queue, messages) = sync_channel(QUEUE);
        let mut audience = self.audience();
        let number = audience.next;
        audience.next += 1;
        audience.viewers.push(Viewer { number, subscriptions: BTreeMap::new(), queue });
        (number, messages)
    }

    /// Hands an encoded message to the queues of all viewers that have subscribed to its topic.
    pub fn publish(&self, topic: Topic, log_time: u64, data: &[u8]) {
        let mut audience = self.audience();
        if topic.is_event() || matches!(topic, Topic::RobotScene | Topic::GroundScene) {
            audience.newest.insert(topic, (log_time, data.to_vec()));
        }
        for viewer in &audience.viewers {
            for (subscription, _) in viewer.subscriptions.iter().filter(|(_, wanted)| **wanted == topic) {
                self.put(viewer, message_data(*subscription, log_time, data));
            }
        }
    }
}
