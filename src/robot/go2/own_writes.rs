//! Times of this program's own commands. They tell a command of its guard from the same bytes of another console.
//!
//! Every console damps with the same bytes as its guard. The guard speaks only after this program was silent, so damping that arrives
//! while it speaks is of another program.

/// Silence after which the guard may speak, ms. It does so at the earliest 50 ms after the last heartbeat; a heartbeat may be 10 ms
/// older than the last command, which may take 8.5 ms to the network.
const GUARD_SILENCE_MS: u64 = 30;
/// Time after a silence in which commands of the guard may still be taken, ms: it stops at the first heartbeat, at most 10 ms later;
/// commands are taken every 2 ms, and after a stop of this process those that waited come first.
const AFTER_SILENCE_MS: u64 = 200;
const MILLISECOND_NS: u64 = 1_000_000;

/// Times of this program's commands on a clock since boot, ns.
#[derive(Debug, Default)]
pub struct OwnWrites {
    /// Time of the last command; zero before the first.
    last_ns: u64,
    /// Time at which the last silence after a command ended; zero before the first.
    silence_end_ns: u64,
}

impl OwnWrites {
    /// Notes a command that was on the network at `now_ns`.
    pub const fn note(&mut self, now_ns: u64) {
        if is_silent(self.last_ns, now_ns) {
            self.silence_end_ns = now_ns;
        }
        self.last_ns = now_ns;
    }

    /// Whether the guard may speak at `now_ns`, or its last commands may be taken: this program has fallen silent, or was silent until a
    /// moment ago. A program that never wrote has a guard that never speaks.
    pub const fn guard_may_speak(&self, now_ns: u64) -> bool {
        let since_silence_ns = now_ns.saturating_sub(self.silence_end_ns);
        is_silent(self.last_ns, now_ns)
            || self.silence_end_ns > 0 && since_silence_ns < AFTER_SILENCE_MS * MILLISECOND_NS
    }
}

const fn is_silent(last_ns: u64, now_ns: u64) -> bool {
    last_ns > 0 && now_ns.saturating_sub(last_ns) >= GUARD_SILENCE_MS * MILLISECOND_NS
}
