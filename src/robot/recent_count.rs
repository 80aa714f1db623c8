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

#[cfg(test)]
mod tests {
    use super::*;

    fn pass(recent: &mut RecentCount, ms: u32, times: u32) {
        for _ in 0..ms {
            recent.advance();
            recent.add(times);
        }
    }

    #[test]
    fn the_window_is_five_seconds() {
        let mut recent = RecentCount::default();
        pass(&mut recent, 7, 1);
        assert_eq!((recent.sum(), recent.span_ms()), (7, 7));
        pass(&mut recent, 4893, 0);
        assert_eq!((recent.sum(), recent.span_ms()), (7, 4900));
        pass(&mut recent, 200, 0);
        assert_eq!(recent.sum(), 0, "events older than five seconds do not count");
        assert!(recent.span_ms() <= 5000);
    }

    #[test]
    fn the_last_second_is_ten_whole_blocks() {
        let mut recent = RecentCount::default();
        pass(&mut recent, 1100, 2);
        assert_eq!((recent.in_a_second(), recent.sum()), (2000, 2200));
        recent.take_back();
        assert_eq!(recent.sum(), 2199);
        // An event of the previous block is taken back in this one.
        let mut recent = RecentCount::default();
        pass(&mut recent, 100, 1);
        pass(&mut recent, 1, 0);
        recent.take_back();
        assert_eq!(recent.sum(), 99);
        pass(&mut recent, 10_000, 3);
        assert_eq!((recent.in_a_second(), recent.sum()), (3000, 3 * recent.span_ms()));
    }

    #[test]
    fn the_last_second_holds_the_newest_event() {
        let mut recent = RecentCount::default();
        pass(&mut recent, 50, 0);
        assert_eq!(recent.last_second(), (0, 50));
        pass(&mut recent, 1, 1);
        assert_eq!(recent.last_second(), (1, 51));
        pass(&mut recent, 999, 0);
        assert_eq!(recent.last_second(), (1, 1050));
        pass(&mut recent, 100, 0);
        assert_eq!(recent.last_second(), (0, 1050));
    }

    #[test]
    fn a_sum_saturates() {
        let mut recent = RecentCount::default();
        recent.advance();
        recent.add(u32::MAX);
        recent.add(5);
        assert_eq!(recent.sum(), u32::MAX);
        pass(&mut recent, 5100, 0);
        assert_eq!(recent.sum(), 0);
    }
}
