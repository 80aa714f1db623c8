//! Counts the states of a link: new, lost, overtaken, duplicated, of a restarted robot, by the robot's clock.
//!
//! Time is counted in calls of [`StateCounter::advance`], one per millisecond, so the ages in a test do not depend on the
//! machine's speed. A late control thread is detected by the watchdog, not here.

use super::recent_count::RecentCount;
use super::{LinkStatus, robot_time_passed};

/// Reading of the robot's clock: period and restart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StateClock {
    /// Time between two states on the robot's clock, ms.
    pub state_period_ms: u32,
    /// A state older than the newest by more than this means that the robot has restarted, ms.
    pub restart_ms: u32,
}

/// Counts of a link, and what they are made from.
#[derive(Debug)]
pub struct StateCounter {
    clock: StateClock,
    /// Counts since the program's start, for those who send and receive to add to.
    pub status: LinkStatus,
    /// Robot time of the newest state, ms; none before the first.
    newest_ms: Option<u32>,
    /// Bit k is set if the state of k ms before the newest one has arrived.
    arrived: u64,
    recent: RecentCounts,
}

/// Counts of the last five seconds.
#[derive(Debug, Default)]
struct RecentCounts {
    received: RecentCount,
    lost: RecentCount,
    corrupt: RecentCount,
}

impl StateCounter {
    /// Begins without a state.
    pub fn new(clock: StateClock) -> StateCounter {
        StateCounter {
            clock,
            status: LinkStatus::default(),
            newest_ms: None,
            arrived: 0,
            recent: RecentCounts::default(),
        }
    }

    /// Counts one millisecond; to be called before the states that arrived in it.
    pub fn advance(&mut self) {
        let RecentCounts { received, lost, corrupt } = &mut self.recent;
        for count in [received, lost, corrupt] {
            count.advance();
        }
        self.status.state_age_ms = self.status.state_age_ms.saturating_add(1);
    }

    /// Counts a message with a wrong checksum.
    pub fn count_corrupt(&mut self) {
        self.status.corrupt += 1;
        self.recent.corrupt.add(1);
    }

    /// Counts a valid state. Returns true if it is newer than all earlier ones.
    pub fn count_state(&mut self, robot_time_ms: u32) -> bool {
        if !self.classify(robot_time_ms) {
            return false;
        }
        self.newest_ms = Some(robot_time_ms);
        self.status.received += 1;
        self.status.state_age_ms = 0;
        self.recent.received.add(1);
        true
    }

    /// Brings the counts of the last seconds up to date; to be called after the states of a millisecond.
    pub fn sum_recent(&mut self) {
        self.status.recent_received = self.recent.received.sum();
        self.status.recent_lost = self.recent.lost.sum();
        self.status.recent_corrupt = self.recent.corrupt.sum();
        self.status.rate_hz = self.recent.received.in_a_second();
    }

    /// Counts a valid state as new, lost, late, duplicate or of a restarted robot. Returns true if it is newer.
    fn classify(&mut self, robot_time_ms: u32) -> bool {
        let Some(newest_ms) = self.newest_ms else {
            self.arrived = 1;
            return true;
        };
        let newer_by = robot_time_passed(robot_time_ms, newest_ms);
        let older_by = newer_by.unsigned_abs();
        if newer_by > 0 {
            let gap = (older_by / self.clock.state_period_ms).saturating_sub(1);
            self.status.lost += u64::from(gap);
            self.recent.lost.add(gap);
            self.arrived = self.arrived.checked_shl(older_by).unwrap_or(0) | 1;
            true
        } else if older_by > self.clock.restart_ms {
            self.status.reboots += 1;
            self.arrived = 1;
            true
        } else {
            self.status.older_by_ms = older_by;
            let bit = 1u64.checked_shl(older_by).unwrap_or(0);
            if self.arrived & bit != 0 {
                self.status.duplicate += 1;
            } else {
                self.status.out_of_order += 1;
                if bit != 0 {
                    // It was counted as lost when a newer state arrived.
                    self.arrived |= bit;
                    self.status.lost = self.status.lost.saturating_sub(1);
                    self.recent.lost.take_back();
                }
            }
            false
        }
    }
}
