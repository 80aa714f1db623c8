//! Common parts of encoding and decoding: a function per message lists the fields of our type and of the message once, for
//! both directions.

use strum::VariantArray;

use super::frog;
use crate::trial::ParameterValues;

/// A message that does not match its schema.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DecodeError {
    #[error("not a message of its schema: {0}")]
    Protobuf(#[from] prost::DecodeError),
    #[error("{0} is missing")]
    Missing(&'static str),
    #[error("{1} is no {0} that this version knows")]
    Unknown(&'static str, i32),
    #[error("{1} {0}: another number than this version expects")]
    Length(&'static str, usize),
    #[error("more than {1} {0}")]
    TooMany(&'static str, usize),
    #[error("a message of {0} bytes, more than {1}")]
    TooLong(usize, usize),
}

/// Direction in which a field is copied.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// From our type to the message. Never fails.
    Encode,
    /// From the message to our type.
    Decode,
}

/// Bits of a double that single precision does not have.
const DROPPED_BITS: u32 = f64::MANTISSA_DIGITS - f32::MANTISSA_DIGITS;

/// Returns a number rounded to the 24 significant bits of single precision, to even where two are equally near; a number of
/// single precision is unchanged, and so is what is not finite. Unlike a conversion to `f32` it keeps the range of a double: a
/// number that a defect made huge is recorded as it was. Three of its eight bytes are zero, which costs nothing in a chunk.
pub fn to_single_precision(number: f64) -> f64 {
    let bits = number.to_bits();
    let odd = bits >> DROPPED_BITS & 1;
    let up = bits.wrapping_add((1 << (DROPPED_BITS - 1)) - 1 + odd);
    let rounded = f64::from_bits(up >> DROPPED_BITS << DROPPED_BITS);
    if number.is_finite() && rounded.is_finite() { rounded } else { number }
}

/// Copies every field between our type and its message.
pub type Fields<T, M> = fn(Way, &mut T, &mut M) -> Result<(), DecodeError>;

pub fn encoded<T: Clone, M: Default>(fields: Fields<T, M>, ours: &T) -> M {
    let mut message = M::default();
    fields(Way::Encode, &mut ours.clone(), &mut message).expect("encoding does not fail");
    message
}

pub fn decoded<T: Default, M>(fields: Fields<T, M>, mut message: M) -> Result<T, DecodeError> {
    let mut ours = T::default();
    fields(Way::Decode, &mut ours, &mut message)?;
    Ok(ours)
}

/// An enum that is numbered in its order, here and in `proto/frog.proto`.
pub trait Numbered: VariantArray + Copy + PartialEq {}

impl<T: VariantArray + Copy + PartialEq> Numbered for T {}

/// Returns the variant of that number.
pub fn one_of<T: Numbered>(name: &'static str, number: i32) -> Result<T, DecodeError> {
    T::VARIANTS.get(number as usize).copied().ok_or(DecodeError::Unknown(name, number))
}

fn number_of<T: Numbered>(ours: &T) -> i32 {
    T::VARIANTS.iter().position(|known| known == ours).unwrap_or_default() as i32
}

impl Way {
    pub fn copy<T: Clone>(self, ours: &mut T, theirs: &mut T) {
        match self {
            Way::Encode => theirs.clone_from(ours),
            Way::Decode => ours.clone_from(theirs),
        }
    }

    /// Copies a number; 0, protobuf's default, if an older recording lacks it.
    pub fn number(self, ours: &mut f64, theirs: &mut Option<f64>) {
        match self {
            Way::Encode => *theirs = Some(*ours),
            Way::Decode => *ours = theirs.unwrap_or_default(),
        }
    }

    /// Copies a number of a tick like [`number`](Way::number), rounded to single precision.
    pub fn single(self, ours: &mut f64, theirs: &mut Option<f64>) {
        self.number(ours, theirs);
        if self == Way::Encode {
            *theirs = theirs.map(to_single_precision);
        }
    }

    pub fn singles<const N: usize>(self, ours: [&mut f64; N], theirs: [&mut Option<f64>; N]) {
        for (ours, theirs) in ours.into_iter().zip(theirs) {
            self.single(ours, theirs);
        }
    }

    /// Copies a list of exactly `N` numbers of a tick, rounded to single precision; `name` is for the message.
    pub fn array<const N: usize>(
        self,
        ours: &mut [f64; N],
        theirs: &mut Vec<f64>,
        name: &'static str,
    ) -> Result<(), DecodeError> {
        match self {
            Way::Encode => *theirs = ours.map(to_single_precision).to_vec(),
            Way::Decode => *ours = theirs.as_slice().try_into().map_err(|_| DecodeError::Length(name, theirs.len()))?,
        }
        Ok(())
    }

    pub fn variant<T: Numbered>(self, ours: &mut T, theirs: &mut i32, name: &'static str) -> Result<(), DecodeError> {
        match self {
            Way::Encode => *theirs = number_of(ours),
            Way::Decode => *ours = one_of(name, *theirs)?,
        }
        Ok(())
    }

    pub fn maybe_variant<T: Numbered>(
        self,
        ours: &mut Option<T>,
        theirs: &mut Option<i32>,
        name: &'static str,
    ) -> Result<(), DecodeError> {
        match self {
            Way::Encode => *theirs = ours.as_ref().map(number_of),
            Way::Decode => *ours = theirs.map(|number| one_of(name, number)).transpose()?,
        }
        Ok(())
    }

    pub fn option<T: Clone + Default, M: Clone + Default>(
        self,
        ours: &mut Option<T>,
        theirs: &mut Option<M>,
        fields: Fields<T, M>,
    ) -> Result<(), DecodeError> {
        match self {
            Way::Encode => *theirs = ours.as_ref().map(|ours| encoded(fields, ours)),
            Way::Decode => *ours = theirs.take().map(|theirs| decoded(fields, theirs)).transpose()?,
        }
        Ok(())
    }

    pub fn list<T: Clone + Default, M: Clone + Default>(
        self,
        ours: &mut Vec<T>,
        theirs: &mut Vec<M>,
        fields: Fields<T, M>,
    ) -> Result<(), DecodeError> {
        match self {
            Way::Encode => *theirs = ours.iter().map(|ours| encoded(fields, ours)).collect(),
            Way::Decode => *ours = theirs.drain(..).map(|theirs| decoded(fields, theirs)).collect::<Result<_, _>>()?,
        }
        Ok(())
    }

    pub fn values(self, ours: &mut ParameterValues, theirs: &mut Vec<frog::trial::Parameter>) {
        let parameter =
            |(name, value): &(String, f64)| frog::trial::Parameter { name: name.clone(), value: Some(*value) };
        match self {
            Way::Encode => *theirs = ours.iter().map(parameter).collect(),
            Way::Decode => *ours = theirs.drain(..).map(|p| (p.name, p.value.unwrap_or_default())).collect(),
        }
    }
}
