//! A network between robot and controller that delays, loses, doubles and spoils datagrams.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

/// What the network does, each way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Conditions {
    /// Shares of datagrams, 0 to 1.
    pub loss: f64,
    pub duplicate: f64,
    pub corrupt: f64,
    /// Time under way, and how much longer it may be, ms.
    pub delay_ms: f64,
    pub jitter_ms: f64,
}

/// One direction: datagrams under way, with whom they belong to.
#[derive(Debug)]
pub(super) struct Wire<A> {
    under_way: Vec<(u64, A, Vec<u8>)>,
}

impl<A: Copy> Wire<A> {
    pub fn new() -> Wire<A> {
        Wire { under_way: Vec::new() }
    }

    /// A datagram sets out at `now_ms`.
    pub fn put(&mut self, now_ms: u64, whose: A, datagram: &[u8], conditions: &Conditions, random: &mut ChaCha8Rng) {
        // Always as many draws: what one fault does not depend on whether another is on.
        let [lost, doubled, spoilt, place, wait, wait_again] = std::array::from_fn(|_| uniform(random));
        if lost < conditions.loss {
            return;
        }
        let mut datagram = datagram.to_vec();
        if spoilt < conditions.corrupt && !datagram.is_empty() {
            let bit = (place * 8.0 * datagram.len() as f64) as usize;
            datagram[bit / 8] ^= 1 << (bit % 8);
        }
        let due = |share: f64| now_ms + (conditions.delay_ms + share * conditions.jitter_ms).round() as u64;
        if doubled < conditions.duplicate {
            self.under_way.push((due(wait_again), whose, datagram.clone()));
        }
        self.under_way.push((due(wait), whose, datagram));
    }

    /// What arrives by `now_ms`, in the order in which it set out.
    pub fn arrived(&mut self, now_ms: u64) -> Vec<(A, Vec<u8>)> {
        let due = |(due_ms, ..): &mut (u64, A, Vec<u8>)| *due_ms <= now_ms;
        self.under_way.extract_if(.., due).map(|(_, whose, datagram)| (whose, datagram)).collect()
    }
}

/// Uniform in [0, 1), 53 bits.
fn uniform(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}
