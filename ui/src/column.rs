//! The columns of the trial table.

use strum::{EnumString, IntoStaticStr, VariantArray};

/// A column, or the group of the parameters' columns; from left to right. The names are those of `console.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, VariantArray, EnumString, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum Column {
    /// One column for each parameter.
    Parameters,
    /// Forward displacement, m.
    Dx,
    /// Displacement to the left, m.
    Dy,
    /// Turn, rad.
    Yaw,
    /// Rise of the trunk, m; `console.toml` may also call it `apex`.
    #[strum(to_string = "rise", serialize = "apex")]
    Rise,
    /// Longest time in the air, s.
    Air,
    /// Objective that the sampler receives.
    Value,
    /// The verdict, or the suggested one.
    Verdict,
    /// Source of the parameters.
    Source,
    /// Falls among the nearest trials when it was approved.
    Risk,
    /// Start, on the session's clock.
    Time,
    /// Cause and note.
    Cause,
}

impl Column {
    /// Its name in `console.toml` and in the dialog.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Its content, for the dialog.
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
            Column::Source => "source of the parameters",
            Column::Risk => "falls among the nearest trials before it ran",
            Column::Time => "when it ran, since the session began",
            Column::Cause => "cause and note",
        }
    }
}
