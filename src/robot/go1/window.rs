//! What came in the last five seconds, in tenths of a second.

/// Calls that make one slot, at one a millisecond.
const CALLS_PER_SLOT: u32 = 100;
/// Slots: five seconds.
const SLOTS: usize = 50;
/// Slots of the last second.
const SECOND: usize = 10;

/// What came in some time.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Slot {
    /// Valid states.
    pub received: u32,
    /// States that never came.
    pub lost: u32,
    /// Corrupt datagrams.
    pub corrupt: u32,
}

/// The slots, as a ring.
#[derive(Debug)]
pub(super) struct Window {
    slots: [Slot; SLOTS],
    at: usize,
    calls: u32,
}

impl Default for Window {
    fn default() -> Self {
        Window { slots: [Slot::default(); SLOTS], at: 0, calls: 0 }
    }
}

impl Window {
    /// A millisecond has passed.
    pub fn advance(&mut self) {
        self.calls += 1;
        if self.calls == CALLS_PER_SLOT {
            self.calls = 0;
            self.at = (self.at + 1) % SLOTS;
            self.slots[self.at] = Slot::default();
        }
    }

    /// The slot of now.
    pub fn now(&mut self) -> &mut Slot {
        &mut self.slots[self.at]
    }

    /// What came in the whole slots of the last second.
    pub fn received_in_the_last_second(&self) -> u32 {
        (1..=SECOND).map(|back| self.slots[(self.at + SLOTS - back) % SLOTS].received).sum()
    }

    /// All slots.
    pub fn total(&self) -> Slot {
        self.slots.iter().fold(Slot::default(), |sum, slot| Slot {
            received: sum.received + slot.received,
            lost: sum.lost.saturating_add(slot.lost),
            corrupt: sum.corrupt + slot.corrupt,
        })
    }
}
