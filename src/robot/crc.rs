//! Checksum of Unitree's messages: a 32-bit register, start FFFFFFFF, polynomial 04C11DB7, not reflected, no final xor,
//! over little-endian words, each from bit 31 to bit 0 (`docs/go1-wire.md`, section 3; `docs/go2-wire.md`, section 4).

/// Words that are reflected at a time: a datagram of the Go1 or a command of the Go2 whole.
const BLOCK: usize = 256;

/// Computes the checksum of the whole words in `data`; remaining bytes are not covered.
///
/// Uses the common CRC-32, which has the same polynomial and start but is reflected and inverts the register at the
/// end: the words are bit-reversed before, the result after.
pub fn crc(data: &[u8]) -> u32 {
    let (words, _) = data.as_chunks::<4>();
    let mut common = crc32fast::Hasher::new();
    for block in words.chunks(BLOCK) {
        let mut mirrored = [[0; 4]; BLOCK];
        for (mirrored, word) in mirrored.iter_mut().zip(block) {
            *mirrored = u32::from_le_bytes(*word).reverse_bits().to_le_bytes();
        }
        common.update(mirrored[..block.len()].as_flattened());
    }
    (!common.finalize()).reverse_bits()
}
