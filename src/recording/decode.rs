//! Common parts of decoding: the error, numbers and enums.

/// A message that does not match its schema.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DecodeError {
    /// Not protobuf, or not of this message.
    #[error("not a message of its schema: {0}")]
    Protobuf(#[from] prost::DecodeError),
    /// A required part is missing.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// A number without a variant.
    #[error("{1} is no {0} that this version knows")]
    Unknown(&'static str, i32),
    /// An array of the wrong length.
    #[error("{1} {0}: another number than this version expects")]
    Length(&'static str, usize),
}

/// Returns the number, or 0 if an older recording lacks it, protobuf's default.
pub fn number(value: Option<f64>) -> f64 {
    value.unwrap_or_default()
}

/// Returns the variant of that number: enums are numbered in the order of `all`, here and in `proto/frog.proto`.
pub fn one_of<T: Copy>(all: &[T], name: &'static str, number: i32) -> Result<T, DecodeError> {
    all.get(number as usize).copied().ok_or(DecodeError::Unknown(name, number))
}
