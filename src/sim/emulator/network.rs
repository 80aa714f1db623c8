//! An emulated network that delays, loses, duplicates and corrupts datagrams.

use rand_chacha::ChaCha8Rng;

use crate::sim::terrain::unit_interval;

/// Conditions of the network; those without a direction in their name hold for both.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct NetworkConditions {
    /// Shares of datagrams, 0 to 1.
    pub loss: f64,
    pub duplicate: f64,
    pub corrupt: f64,
    /// Delay, and largest random addition to it, ms.
    pub delay_ms: f64,
    pub jitter_ms: f64,
    /// Additional delay of commands, and of states, ms.
    pub command_delay_ms: f64,
    pub state_delay_ms: f64,
}

impl NetworkConditions {
    /// Conditions of the path to the robot.
    pub fn of_commands(&self) -> NetworkConditions {
        NetworkConditions { delay_ms: self.delay_ms + self.command_delay_ms, ..*self }
    }

    /// Conditions of the path from the robot.
    pub fn of_states(&self) -> NetworkConditions {
        NetworkConditions { delay_ms: self.delay_ms + self.state_delay_ms, ..*self }
    }
}

/// One direction: datagrams under way with time of arrival, ms, and address.
#[derive(Debug)]
pub(super) struct NetworkPath<A> {
    under_way: Vec<(u64, A, Vec<u8>)>,
}

impl<A: Copy> NetworkPath<A> {
    pub fn new() -> NetworkPath<A> {
        NetworkPath { under_way: Vec::new() }
    }

    /// Sends a datagram at `now_ms`.
    pub fn send(
        &mut self,
        now_ms: u64,
        address: A,
        datagram: &[u8],
        conditions: &NetworkConditions,
        random: &mut ChaCha8Rng,
    ) {
        // Always the same number of draws: the effects of one fault do not depend on the others.
        let [lost, duplicated, corrupted, bit, wait, second_wait] = std::array::from_fn(|_| unit_interval(random));
        if lost < conditions.loss {
            return;
        }
        let mut datagram = datagram.to_vec();
        if corrupted < conditions.corrupt && !datagram.is_empty() {
            let bit = (bit * 8.0 * datagram.len() as f64) as usize;
            datagram[bit / 8] ^= 1 << (bit % 8);
        }
        let due = |share: f64| now_ms + (conditions.delay_ms + share * conditions.jitter_ms).round() as u64;
        if duplicated < conditions.duplicate {
            self.under_way.push((due(second_wait), address, datagram.clone()));
        }
        self.under_way.push((due(wait), address, datagram));
    }

    /// Removes and returns the datagrams that have arrived by `now_ms`, in the order in which they were sent.
    pub fn arrived(&mut self, now_ms: u64) -> Vec<(A, Vec<u8>)> {
        let due = |(due_ms, ..): &mut (u64, A, Vec<u8>)| *due_ms <= now_ms;
        self.under_way.extract_if(.., due).map(|(_, address, datagram)| (address, datagram)).collect()
    }
}
