//! Counts over the last five seconds, in blocks of a tenth: no allocation, and forgetting costs one addition a block.

/// Ticks in a block.
const BLOCK_TICKS: u32 = 100;
/// Blocks that are remembered.
const BLOCKS: usize = 50;

/// How often something happened in the last five seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recent {
    blocks: [u32; BLOCKS],
    newest: usize,
    /// Ticks in the newest block.
    ticks: u32,
    /// Blocks that are full, the newest not among them.
    full: u32,
}

impl Default for Recent {
    fn default() -> Recent {
        Recent { blocks: [0; BLOCKS], newest: 0, ticks: 0, full: 0 }
    }
}

impl Recent {
    /// One more tick, in which it happened `times`.
    pub fn tick(&mut self, times: u32) {
        if self.ticks == BLOCK_TICKS {
            self.newest = (self.newest + 1) % BLOCKS;
            self.blocks[self.newest] = 0;
            self.ticks = 0;
            self.full = (self.full + 1).min(BLOCKS as u32 - 1);
        }
        self.ticks += 1;
        self.blocks[self.newest] = self.blocks[self.newest].saturating_add(times);
    }

    /// How often it happened.
    pub fn sum(&self) -> u32 {
        self.blocks.iter().fold(0, |sum, block| sum.saturating_add(*block))
    }

    /// Ticks that are remembered.
    pub fn span(&self) -> u32 {
        self.full * BLOCK_TICKS + self.ticks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_seconds_are_remembered_and_no_more() {
        let mut recent = Recent::default();
        for _ in 0..7 {
            recent.tick(1);
        }
        assert_eq!((recent.sum(), recent.span()), (7, 7));
        for _ in 0..4893 {
            recent.tick(0);
        }
        assert_eq!((recent.sum(), recent.span()), (7, 4900));
        for _ in 0..200 {
            recent.tick(0);
        }
        assert_eq!(recent.sum(), 0, "what is older than five seconds is forgotten");
        assert!(recent.span() <= 5000);
    }
}
