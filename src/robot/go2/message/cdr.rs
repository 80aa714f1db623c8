//! Plain CDR (XCDR1), little-endian: numbers are aligned to their own size, counted from the payload's first byte;
//! structures have no alignment of their own.

use super::rejection::MessageRejection;

/// Reads a payload from its beginning.
#[derive(Debug)]
pub(super) struct CdrReader<'a> {
    payload: &'a [u8],
    at: usize,
}

impl<'a> CdrReader<'a> {
    pub fn new(payload: &'a [u8]) -> CdrReader<'a> {
        CdrReader { payload, at: 0 }
    }

    /// Returns the next `length` bytes.
    pub fn slice(&mut self, length: usize) -> Result<&'a [u8], MessageRejection> {
        let end = self.at.saturating_add(length);
        let slice = self.payload.get(self.at..end);
        let short = MessageRejection::Length { length: self.payload.len(), expected: end };
        self.at = end;
        slice.ok_or(short)
    }

    /// Returns the next `N` bytes, not aligned.
    pub fn bytes<const N: usize>(&mut self) -> Result<[u8; N], MessageRejection> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.slice(N)?);
        Ok(bytes)
    }

    /// Returns the bytes of a number of `N` bytes, aligned.
    fn number<const N: usize>(&mut self) -> Result<[u8; N], MessageRejection> {
        self.at = self.at.next_multiple_of(N);
        self.bytes()
    }

    pub fn u8(&mut self) -> Result<u8, MessageRejection> {
        self.number().map(u8::from_le_bytes)
    }

    /// Reads a temperature: unsigned in the IDL, signed by its meaning.
    pub fn i8(&mut self) -> Result<i8, MessageRejection> {
        self.number().map(i8::from_le_bytes)
    }

    pub fn u16(&mut self) -> Result<u16, MessageRejection> {
        self.number().map(u16::from_le_bytes)
    }

    pub fn i16(&mut self) -> Result<i16, MessageRejection> {
        self.number().map(i16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Result<u32, MessageRejection> {
        self.number().map(u32::from_le_bytes)
    }

    pub fn i32(&mut self) -> Result<i32, MessageRejection> {
        self.number().map(i32::from_le_bytes)
    }

    pub fn i64(&mut self) -> Result<i64, MessageRejection> {
        self.number().map(i64::from_le_bytes)
    }

    pub fn f32(&mut self) -> Result<f32, MessageRejection> {
        self.number().map(f32::from_le_bytes)
    }

    /// Reads `N` values.
    pub fn array<T: Copy + Default, const N: usize>(
        &mut self,
        read: fn(&mut Self) -> Result<T, MessageRejection>,
    ) -> Result<[T; N], MessageRejection> {
        let mut array = [T::default(); N];
        for value in &mut array {
            *value = read(self)?;
        }
        Ok(array)
    }

    /// Reads a truth value.
    pub fn truth(&mut self, field: &'static str) -> Result<bool, MessageRejection> {
        match self.u8()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(MessageRejection::Malformed { field, at: self.at - 1 }),
        }
    }

    /// Reads a sequence of bytes: its length, then the bytes.
    pub fn sequence(&mut self) -> Result<&'a [u8], MessageRejection> {
        let length = self.u32()?;
        // A length that does not fit the address space is longer than any payload.
        self.slice(usize::try_from(length).unwrap_or(usize::MAX))
    }

    /// Reads a text: its length with the final zero byte, then both.
    pub fn text(&mut self, field: &'static str) -> Result<&'a str, MessageRejection> {
        let bytes = self.sequence()?;
        let malformed = MessageRejection::Malformed { field, at: self.at - bytes.len() };
        let text = bytes.strip_suffix(&[0]).and_then(|text| std::str::from_utf8(text).ok());
        text.ok_or(malformed)
    }
}

/// Writes a payload from its beginning into zeroed bytes that are long enough.
#[derive(Debug)]
pub(super) struct CdrWriter<'a> {
    payload: &'a mut [u8],
    at: usize,
}

impl<'a> CdrWriter<'a> {
    pub fn new(zeroed: &'a mut [u8]) -> CdrWriter<'a> {
        CdrWriter { payload: zeroed, at: 0 }
    }

    /// Number of bytes written so far.
    pub fn length(&self) -> usize {
        self.at
    }

    /// Appends bytes, not aligned.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.payload[self.at..self.at + bytes.len()].copy_from_slice(bytes);
        self.at += bytes.len();
    }

    /// Appends a number, aligned.
    pub fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        self.at = self.at.next_multiple_of(N);
        self.bytes(&bytes);
    }

    /// Appends 32-bit floating-point numbers.
    pub fn floats(&mut self, values: &[f32]) {
        for value in values {
            self.number(value.to_le_bytes());
        }
    }

    /// Appends a sequence of bytes, with `terminator` after them.
    pub fn sequence(&mut self, bytes: &[u8], terminator: &[u8]) {
        self.number(((bytes.len() + terminator.len()) as u32).to_le_bytes());
        self.bytes(bytes);
        self.bytes(terminator);
    }
}

/// Collects the parts of a payload in the layout of the C struct, which the checksum covers.
pub(super) struct CLayout<const N: usize> {
    bytes: [u8; N],
    at: usize,
}

impl<const N: usize> CLayout<N> {
    pub fn new() -> CLayout<N> {
        CLayout { bytes: [0; N], at: 0 }
    }

    /// Appends bytes of the payload, then `padding` zeros.
    pub fn put(&mut self, part: &[u8], padding: usize) {
        self.bytes[self.at..self.at + part.len()].copy_from_slice(part);
        self.at += part.len() + padding;
    }

    /// Computes the checksum of the struct without its last word.
    pub fn crc(&self) -> u32 {
        debug_assert_eq!(self.at, N);
        crate::robot::crc::crc(&self.bytes)
    }
}
