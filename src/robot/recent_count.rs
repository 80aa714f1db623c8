//! Event counts over the last five seconds, in blocks of 0.1 s. No allocation; the sum is always up to date.

/// Milliseconds in a block.
const BLOCK_MS: u32 = 100;
/// Number of blocks.
const BLOCKS: usize = 50;
/// Blocks per second.
const SECOND: usize = 10;

/// Number of events in the last five seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecentCount {
    blocks: [u32; BLOCKS],
    /// Sum of all blocks.
    sum: u32,
    newest: usize,
    /// Milliseconds in the newest block.
    ms: u32,
    /// Complete blocks, without the newest.
    full: u32,
}

impl Default for RecentCount {
    fn default() -> RecentCount {
        RecentCount { blocks: [0; BLOCKS], sum: 0, newest: 0, ms: 0, full: 0 }
    }
}

impl RecentCount {
    /// Starts the next millisecond.
    pub fn advance(&mut self) {
        if self.ms == BLOCK_MS {
            self.newest = (self.newest + 1) % BLOCKS;
            self.sum -= std::mem::take(&mut self.blocks[self.newest]);
            self.ms = 0;
            self.full = (self.full + 1).min(BLOCKS as u32 - 1);
        }
        self.ms += 1;
    }

    /// Adds `times` events in this millisecond.
    pub fn add(&mut self, times: u32) {
        // Saturates, so that the sum stays equal to that of the blocks.
        let times = times.min(u32::MAX - self.sum);
        self.blocks[self.newest] += times;
        self.sum += times;
    }

    /// Removes one event, from the newest block that has one.
    pub fn take_back(&mut self) {
        let newest = (0..BLOCKS).map(|back| self.before(back)).find(|block| self.blocks[*block] > 0);
        if let Some(block) = newest {
            self.blocks[block] -= 1;
            self.sum -= 1;
        }
    }

    /// Number of events.
    pub fn sum(&self) -> u32 {
        self.sum
    }

    /// Number of events in the last second, from complete blocks alone.
    pub fn in_a_second(&self) -> u32 {
        (1..=SECOND).map(|back| self.blocks[self.before(back)]).sum()
    }

    /// Number of events in the last second and in the newest, incomplete block; and that time, ms: 1001 to 1100, shorter at first.
    pub fn last_second(&self) -> (u32, u32) {
        let events = (0..=SECOND).map(|back| self.blocks[self.before(back)]).fold(0, u32::saturating_add);
        (events, self.full.min(SECOND as u32) * BLOCK_MS + self.ms)
    }

    /// Index of the block that is `back` blocks older than the newest.
    fn before(&self, back: usize) -> usize {
        (self.newest + BLOCKS - back) % BLOCKS
    }

    /// Length of the window, ms; shorter than five seconds at first.
    pub fn span_ms(&self) -> u32 {
        self.full * BLOCK_MS + self.ms
    }
}
