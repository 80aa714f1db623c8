//! Counts over the last five seconds, in blocks of a tenth: no allocation, and what is asked every millisecond is at hand.

/// Milliseconds in a block.
const BLOCK_MS: u32 = 100;
/// Blocks that are remembered.
const BLOCKS: usize = 50;
/// Blocks that make a second.
const SECOND: usize = 10;

/// How often something happened in the last five seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recent {
    blocks: [u32; BLOCKS],
    /// Of all blocks.
    sum: u32,
    newest: usize,
    /// Milliseconds in the newest block.
    ms: u32,
    /// Blocks that are full, the newest not among them.
    full: u32,
}

impl Default for Recent {
    fn default() -> Recent {
        Recent { blocks: [0; BLOCKS], sum: 0, newest: 0, ms: 0, full: 0 }
    }
}

impl Recent {
    /// A millisecond begins.
    pub fn advance(&mut self) {
        if self.ms == BLOCK_MS {
            self.newest = (self.newest + 1) % BLOCKS;
            self.sum -= std::mem::take(&mut self.blocks[self.newest]);
            self.ms = 0;
            self.full = (self.full + 1).min(BLOCKS as u32 - 1);
        }
        self.ms += 1;
    }

    /// It happened `times` in this millisecond.
    pub fn add(&mut self, times: u32) {
        // What does not fit is not counted, so that the sum stays that of the blocks.
        let times = times.min(u32::MAX - self.sum);
        self.blocks[self.newest] += times;
        self.sum += times;
    }

    /// The newest of them was a mistake, in whichever block it stands.
    pub fn take_back(&mut self) {
        let newest = (0..BLOCKS).map(|back| self.before(back)).find(|block| self.blocks[*block] > 0);
        if let Some(block) = newest {
            self.blocks[block] -= 1;
            self.sum -= 1;
        }
    }

    /// How often it happened.
    pub fn sum(&self) -> u32 {
        self.sum
    }

    /// How often it happened in the last second, whole blocks only: the newest is not among them.
    pub fn in_a_second(&self) -> u32 {
        (1..=SECOND).map(|back| self.blocks[self.before(back)]).sum()
    }

    /// The place of the block that is `back` blocks older than the newest.
    fn before(&self, back: usize) -> usize {
        (self.newest + BLOCKS - back) % BLOCKS
    }

    /// Milliseconds that are remembered.
    pub fn span_ms(&self) -> u32 {
        self.full * BLOCK_MS + self.ms
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pass(recent: &mut Recent, ms: u32, times: u32) {
        for _ in 0..ms {
            recent.advance();
            recent.add(times);
        }
    }

    #[test]
    fn five_seconds_are_remembered_and_no_more() {
        let mut recent = Recent::default();
        pass(&mut recent, 7, 1);
        assert_eq!((recent.sum(), recent.span_ms()), (7, 7));
        pass(&mut recent, 4893, 0);
        assert_eq!((recent.sum(), recent.span_ms()), (7, 4900));
        pass(&mut recent, 200, 0);
        assert_eq!(recent.sum(), 0, "what is older than five seconds is forgotten");
        assert!(recent.span_ms() <= 5000);
    }

    #[test]
    fn the_last_second_is_ten_whole_blocks() {
        let mut recent = Recent::default();
        pass(&mut recent, 1100, 2);
        assert_eq!((recent.in_a_second(), recent.sum()), (2000, 2200));
        recent.take_back();
        assert_eq!(recent.sum(), 2199);
        // A mistake of the block before, noticed in this one.
        let mut recent = Recent::default();
        pass(&mut recent, 100, 1);
        pass(&mut recent, 1, 0);
        recent.take_back();
        assert_eq!(recent.sum(), 99);
        pass(&mut recent, 10_000, 3);
        assert_eq!((recent.in_a_second(), recent.sum()), (3000, 3 * recent.span_ms()));
    }

    #[test]
    fn a_count_beyond_all_bounds_stays_a_sum() {
        let mut recent = Recent::default();
        recent.advance();
        recent.add(u32::MAX);
        recent.add(5);
        assert_eq!(recent.sum(), u32::MAX);
        pass(&mut recent, 5100, 0);
        assert_eq!(recent.sum(), 0);
    }
}
