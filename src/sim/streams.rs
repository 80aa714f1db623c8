//! Random streams of the simulator: what is drawn from the same seed must not share its numbers.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Places of the blocks.
pub(super) const BLOCKS: u64 = 0;
/// Errors of the sensors.
pub(super) const SENSORS: u64 = 1;
/// Friction of the ground.
pub(super) const FRICTION: u64 = 2;
/// Friction of the blocks.
pub(super) const BLOCK_FRICTION: u64 = 3;
/// Delays and losses of the emulator's network.
pub(super) const NETWORK: u64 = 4;

/// The random numbers of a stream of a seed.
pub(super) fn random(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(stream);
    random
}
