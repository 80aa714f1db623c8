//! The Mersenne Twister MT19937 as NumPy's `RandomState` seeds and reads it, with a count of the draws.
//!
//! Matsumoto and Nishimura, "Mersenne Twister", ACM TOMACS 8(1), 1998; the seeding is their `init_genrand` of 2002.

const N: usize = 624;
const M: usize = 397;
const MATRIX_A: u32 = 0x9908_B0DF;
const UPPER: u32 = 0x8000_0000;
const LOWER: u32 = 0x7FFF_FFFF;

/// A stream of doubles in [0, 1); the count of draws is the position from which it can be continued.
#[derive(Clone)]
pub struct Mt19937 {
    state: [u32; N],
    next: usize,
    drawn: u64,
}

impl Mt19937 {
    /// The stream of `seed` at its start.
    pub fn new(seed: u32) -> Self {
        // x_i = 1812433253 (x_{i-1} xor (x_{i-1} >> 30)) + i  (mod 2^32)
        let mut state = [seed; N];
        for i in 1..N {
            let previous = state[i - 1];
            state[i] = 1_812_433_253_u32.wrapping_mul(previous ^ (previous >> 30)).wrapping_add(i as u32);
        }
        Mt19937 { state, next: N, drawn: 0 }
    }

    /// Number of doubles drawn since the seed.
    pub fn drawn(&self) -> u64 {
        self.drawn
    }

    /// Discards doubles up to position `drawn`; a stream beyond it does not move.
    pub fn advance_to(&mut self, drawn: u64) {
        while self.drawn < drawn {
            self.double();
        }
    }

    /// The next double, 53 random bits: u = ((A >> 5) 2^26 + (B >> 6)) / 2^53 of two outputs A, B.
    pub fn double(&mut self) -> f64 {
        self.drawn += 1;
        let a = u64::from(self.word() >> 5);
        let b = u64::from(self.word() >> 6);
        ((a << 26) + b) as f64 / (1_u64 << 53) as f64
    }

    fn word(&mut self) -> u32 {
        if self.next == N {
            self.twist();
        }
        let mut y = self.state[self.next];
        self.next += 1;
        y ^= y >> 11;
        y ^= (y << 7) & 0x9D2C_5680;
        y ^= (y << 15) & 0xEFC6_0000;
        y ^ (y >> 18)
    }

    fn twist(&mut self) {
        for k in 0..N {
            // x_{k+n} = x_{k+m} xor (x_k^upper | x_{k+1}^lower) A
            let y = (self.state[k] & UPPER) | (self.state[(k + 1) % N] & LOWER);
            let twisted = (y >> 1) ^ if y & 1 == 1 { MATRIX_A } else { 0 };
            self.state[k] = self.state[(k + M) % N] ^ twisted;
        }
        self.next = 0;
    }
}

impl std::fmt::Debug for Mt19937 {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Mt19937").field("drawn", &self.drawn).finish_non_exhaustive()
    }
}
