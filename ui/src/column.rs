//! The columns of the trial table.

use strum::{EnumString, IntoStaticStr, VariantArray};

/// A column, or the group of the parameters' columns; from left to right. The names are those of `console.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, VariantArray, EnumString, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum Column {
    Parameters,
    Dx,
    Dy,
    Yaw,
    /// `console.toml` may also call it `apex`.
    #[strum(to_string = "rise", serialize = "apex")]
    Rise,
    Air,
    Value,
    Verdict,
    #[strum(serialize = "judged_by")]
    JudgedBy,
    Source,
    Risk,
    Time,
    Cause,
}

impl Column {
    pub fn name(self) -> &'static str {
        self.into()
    }

    pub const fn help(self) -> &'static str {
        match self {
            Column::Parameters => "one column for each parameter",
            Column::Dx => "displacement forward, m",
            Column::Dy => "displacement to the left, m",
            Column::Yaw => "turn, rad",
            Column::Rise => "rise of the trunk, m",
            Column::Air => "longest time in the air, s",
            Column::Value => "the objective that the sampler receives",
            Column::Verdict => "the verdict, or the suggested one",
            Column::JudgedBy => "operator or rule; on a screen with room for the cause, too",
            Column::Source => "source of the parameters",
            Column::Risk => "falls among the nearest trials before it ran",
            Column::Time => "when it ran, since the session began",
            Column::Cause => "note and cause",
        }
    }
}
