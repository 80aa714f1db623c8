//! Mutations of valid inputs by a seeded generator: an input is a function of corpus, seed and number.

/// Random numbers by SplitMix64 (Steele, Lea, Flood 2014).
pub struct Random(pub u64);

impl Random {
    fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `bound`, or 0 for 0.
    pub fn below(&mut self, bound: usize) -> usize {
        (self.word() % bound.max(1) as u64) as usize
    }
}

/// Longest input, bytes: above every limit of length but that of files, which has tests of its own.
const LONGEST: usize = 1 << 16;

/// Input `number` of the stream of `seed`: an item of the corpus with one to eight mutations.
pub fn input(corpus: &[Vec<u8>], words: &[&[u8]], seed: u64, number: u64) -> Vec<u8> {
    let mut random = Random(seed ^ number.wrapping_mul(0xd134_2543_de82_ef95));
    let mut bytes = corpus[random.below(corpus.len())].clone();
    for _ in 0..=random.below(8) {
        mutate(&mut bytes, corpus, words, &mut random);
    }
    bytes.truncate(LONGEST.max(corpus.iter().map(Vec::len).max().unwrap_or(0)));
    bytes
}

fn mutate(bytes: &mut Vec<u8>, corpus: &[Vec<u8>], words: &[&[u8]], random: &mut Random) {
    let at = random.below(bytes.len());
    // Mostly a few bytes, sometimes any number of them.
    let most = if random.below(4) == 0 { bytes.len() - at } else { 16.min(bytes.len() - at) };
    let end = at + random.below(most + 1);
    match random.below(11) {
        0 => bytes[at..end].iter_mut().for_each(|byte| *byte ^= 1 << random.below(8)),
        1 => bytes[at..end].iter_mut().for_each(|byte| *byte = random.below(256) as u8),
        2 => drop(bytes.drain(at..end)),
        3 => bytes.truncate(at),
        4 => {
            let copy = bytes[at..end].to_vec();
            let times = 1 + random.below(8);
            bytes.splice(at..at, copy.repeat(times));
        }
        5 | 6 => drop(bytes.splice(at..end.min(at + 4), words[random.below(words.len())].iter().copied())),
        7 => {
            let other = &corpus[random.below(corpus.len())];
            let from = random.below(other.len());
            let until = from + random.below(other.len() - from + 1);
            bytes.splice(at..end, other[from..until].iter().copied());
        }
        8 => {
            // A whole number at the edge of its type, little-endian.
            let number = [0, 1, u64::MAX, i64::MAX as u64, u64::from(u32::MAX), 0x7fff_ffff, 0xffff][random.below(7)];
            let number = number.wrapping_add(random.below(3) as u64).wrapping_sub(1).to_le_bytes();
            let width = [1, 2, 4, 8][random.below(4)].min(bytes.len() - at);
            bytes[at..at + width].copy_from_slice(&number[..width]);
        }
        9 => number_as_text(bytes, at, words, random),
        _ => bytes.insert(at, random.below(256) as u8),
    }
    if bytes.is_empty() {
        bytes.push(random.below(256) as u8);
    }
}

/// Replaces the next number in digits by one of the words.
fn number_as_text(bytes: &mut Vec<u8>, at: usize, words: &[&[u8]], random: &mut Random) {
    let is_number = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
    let Some(begin) = bytes[at..].iter().position(is_number).map(|found| at + found) else { return };
    let length = bytes[begin..].iter().take_while(|byte| is_number(byte)).count();
    bytes.splice(begin..begin + length, words[random.below(words.len())].iter().copied());
}
