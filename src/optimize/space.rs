//! The search space: named ranges of real numbers, linear or logarithmic.

use serde::{Deserialize, Serialize};

/// The range of one parameter. Only trials whose ranges are equal to the bit are sampled jointly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// Lower bound, in the parameter's own unit, included.
    pub low: f64,
    /// Upper bound, in the parameter's own unit, included.
    pub high: f64,
    /// Whether the search coordinate is the logarithm.
    #[serde(default)]
    pub log: bool,
}

impl Range {
    /// A linear range.
    pub const fn linear(low: f64, high: f64) -> Self {
        Range { low, high, log: false }
    }

    /// A logarithmic range; both bounds must be positive.
    pub const fn logarithmic(low: f64, high: f64) -> Self {
        Range { low, high, log: true }
    }

    /// Whether `value` lies in the range, bounds included.
    pub fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// Whether the range is a single point.
    pub fn is_point(&self) -> bool {
        self.low == self.high
    }

    /// The search coordinate: the value or its natural logarithm.
    pub fn inner(&self, value: f64) -> f64 {
        if self.log { libm::log(value) } else { value }
    }

    /// The inverse of [`Range::inner`].
    pub fn outer(&self, inner: f64) -> f64 {
        if self.log { libm::exp(inner) } else { inner }
    }

    /// Bounds of the search coordinate.
    pub fn inner_bounds(&self) -> (f64, f64) {
        (self.inner(self.low), self.inner(self.high))
    }

    /// Position in the range, 0 at the lower bound and 1 at the upper, in the search coordinate; 0.5 for a point.
    pub fn scale(&self, value: f64) -> f64 {
        let (low, high) = self.inner_bounds();
        if high > low { (self.inner(value) - low) / (high - low) } else { 0.5 }
    }

    /// The value at position `unit` (0..1), clamped to the range against rounding.
    pub fn unscale(&self, unit: f64) -> f64 {
        self.extrapolate(unit).clamp(self.low, self.high)
    }

    /// The value at position `unit`, which may lie beyond 0..1.
    pub fn extrapolate(&self, unit: f64) -> f64 {
        let (low, high) = self.inner_bounds();
        self.outer(low + (high - low) * unit)
    }
}

/// A named range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Name, as in the journal and on screens: `f0`, `Fx`.
    pub name: String,
    /// Bounds and scale.
    #[serde(flatten)]
    pub range: Range,
}

/// The parameters of a study in the order in which they are sampled.
#[derive(Debug, Clone, PartialEq)]
pub struct Space(Vec<Parameter>);

/// Reason why a space cannot be searched.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message of each variant has its meaning")]
pub enum SpaceError {
    #[error("the space has no parameter: give at least one")]
    Empty,
    #[error("parameter `{0}` is given twice: names must differ")]
    Duplicate(String),
    #[error(
        "parameter `{name}`: bounds {low}..{high} are not a range: both must be finite and low must not exceed high"
    )]
    Bounds { name: String, low: f64, high: f64 },
    #[error("parameter `{name}` is logarithmic, so its lower bound must be above 0, not {low}")]
    LogBounds { name: String, low: f64 },
}

impl Space {
    /// Checks the parameters: at least one, no name twice, bounds finite, ascending, and positive if logarithmic.
    pub fn new(parameters: impl IntoIterator<Item = (String, Range)>) -> Result<Self, SpaceError> {
        let mut space: Vec<Parameter> = Vec::new();
        for (name, range) in parameters {
            let Range { low, high, log } = range;
            if space.iter().any(|p| p.name == name) {
                return Err(SpaceError::Duplicate(name));
            }
            if !(low.is_finite() && high.is_finite() && low <= high) {
                return Err(SpaceError::Bounds { name, low, high });
            }
            if log && low <= 0.0 {
                return Err(SpaceError::LogBounds { name, low });
            }
            space.push(Parameter { name, range });
        }
        if space.is_empty() { Err(SpaceError::Empty) } else { Ok(Space(space)) }
    }

    /// The parameters in order.
    pub fn parameters(&self) -> &[Parameter] {
        &self.0
    }

    /// The range of parameter `name`, if the space has it.
    pub fn range(&self, name: &str) -> Option<Range> {
        self.0.iter().find(|p| p.name == name).map(|p| p.range)
    }
}
