//! The checksum of both datagrams: a 32-bit register, start FFFFFFFF, polynomial 04C11DB7, not reflected, no final xor, over
//! little-endian words taken from their highest bit down (`specs/go1-wire.md`, section 3).

const POLYNOMIAL: u32 = 0x04C1_1DB7;

/// `TABLES[k][b]`: the register that holds byte `b` on top and zeros below, shifted by k + 1 bytes. With one table for each byte
/// of a word, a word takes four look-ups that do not wait for each other ("slicing by 4", Kounavis and Berry, 2005).
const TABLES: [[u32; 256]; 4] = tables();

const fn tables() -> [[u32; 256]; 4] {
    let mut tables = [[0; 256]; 4];
    let mut byte = 0;
    while byte < 256 {
        let mut register = (byte as u32) << 24;
        let mut k = 0;
        while k < 4 {
            let mut bit = 0;
            while bit < 8 {
                register = if register >> 31 == 1 { (register << 1) ^ POLYNOMIAL } else { register << 1 };
                bit += 1;
            }
            tables[k][byte] = register;
            k += 1;
        }
        byte += 1;
    }
    tables
}

/// The checksum of the whole words in `data`; what is left over is not covered.
pub fn crc(data: &[u8]) -> u32 {
    let (words, _) = data.as_chunks::<4>();
    words.iter().fold(u32::MAX, |register, word| {
        let [b0, b1, b2, b3] = (register ^ u32::from_le_bytes(*word)).to_le_bytes().map(usize::from);
        TABLES[3][b3] ^ TABLES[2][b2] ^ TABLES[1][b1] ^ TABLES[0][b0]
    })
}

/// How the checksum stands in a datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CrcForm {
    /// As it is: what the official library sends in every command, and what low-level states have.
    Plain,
    /// Disguised: in states of the high-level protocol, and in the commands of the robot's own factory controller.
    Sealed,
}

impl CrcForm {
    /// The number that stands in a datagram whose checksum is `crc`.
    pub const fn apply(self, crc: u32) -> u32 {
        match self {
            CrcForm::Plain => crc,
            CrcForm::Sealed => (crc ^ 0xEDCA_B9DE).rotate_right(8),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The worked examples of `specs/go1-wire.md`, section 3.
    #[test]
    fn the_specifications_examples() {
        assert_eq!(crc(&[0; 4]), 0xC704_DD7B);
        assert_eq!(crc(&[0xFE, 0xEF, 0xFF, 0]), 0x9BF0_26DF);
        assert_eq!(crc(&[0; 608]), 0xE7CD_1C3B);
        assert_eq!(CrcForm::Sealed.apply(crc(&[0; 608])), 0xE50A_07A5);
    }

    #[test]
    fn what_is_not_a_whole_word_is_not_covered() {
        assert_eq!(crc(&[1, 2, 3, 4, 5, 6, 7]), crc(&[1, 2, 3, 4]));
    }
}
