//! The columns of the trial table: which there are, what they are called in `console.toml`, and how they sort.

use std::cmp::Ordering;

use quadfrog::recording::record::{TrialRecord, Verdict};

/// A column, or the group of the parameters' columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Column {
    /// One column for each parameter.
    Parameters,
    /// Forward displacement, m.
    Dx,
    /// Displacement to the left, m.
    Dy,
    /// Turn, rad.
    Yaw,
    /// Rise of the trunk, m.
    Apex,
    /// Longest time in the air, s.
    Air,
    /// The objective that the sampler is told.
    Value,
    /// The verdict, or what the rules suggest.
    Verdict,
    /// Who chose the parameters.
    Source,
    /// Falls among the nearest trials when it was approved.
    Risk,
    /// When it ran, on the session's clock.
    Time,
    /// Cause and note.
    Cause,
}

impl Column {
    /// All columns, from left to right.
    pub const ALL: [Column; 12] = [
        Column::Parameters,
        Column::Dx,
        Column::Dy,
        Column::Yaw,
        Column::Apex,
        Column::Air,
        Column::Value,
        Column::Verdict,
        Column::Source,
        Column::Risk,
        Column::Time,
        Column::Cause,
    ];

    /// Its name in `console.toml` and in the dialog.
    pub const fn name(self) -> &'static str {
        match self {
            Column::Parameters => "parameters",
            Column::Dx => "dx",
            Column::Dy => "dy",
            Column::Yaw => "yaw",
            Column::Apex => "apex",
            Column::Air => "air",
            Column::Value => "value",
            Column::Verdict => "verdict",
            Column::Source => "source",
            Column::Risk => "risk",
            Column::Time => "time",
            Column::Cause => "cause",
        }
    }

    /// What it holds, in words.
    pub const fn help(self) -> &'static str {
        match self {
            Column::Parameters => "one column for each parameter",
            Column::Dx => "displacement forward, m",
            Column::Dy => "displacement to the left, m",
            Column::Yaw => "turn, rad",
            Column::Apex => "rise of the trunk, m",
            Column::Air => "longest time in the air, s",
            Column::Value => "the objective that the sampler is told",
            Column::Verdict => "the verdict, or what the rules suggest",
            Column::Source => "who chose the parameters",
            Column::Risk => "falls among the nearest trials before it ran",
            Column::Time => "when it ran, since the session began",
            Column::Cause => "cause and note",
        }
    }

    /// The column of that name.
    pub fn from_name(name: &str) -> Option<Column> {
        Column::ALL.into_iter().find(|column| column.name() == name)
    }
}

/// What the trial table is sorted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SortBy {
    /// Number, oldest first.
    #[default]
    Number,
    /// A parameter, by its place in the session's list.
    Parameter(usize),
    /// A column other than the parameters.
    Column(Column),
}

/// The measured term of a column, where it is one.
pub fn measured(trial: &TrialRecord, column: Column) -> Option<f64> {
    let m = trial.measured?;
    match column {
        Column::Dx => Some(m.dx_m),
        Column::Dy => Some(m.dy_m),
        Column::Yaw => Some(m.dyaw_rad),
        Column::Apex => Some(m.apex_m),
        Column::Air => Some(m.air_s),
        _ => None,
    }
}

/// Larger numbers first; what is no number, or none, comes last.
pub fn descending(a: Option<f64>, b: Option<f64>) -> Ordering {
    let (a, b) = (a.filter(|a| !a.is_nan()), b.filter(|b| !b.is_nan()));
    match (a, b) {
        (Some(a), Some(b)) => b.total_cmp(&a),
        (a, b) => b.is_some().cmp(&a.is_some()),
    }
}

/// The order of verdicts: accept, fall, void, none yet.
pub fn verdict_rank(verdict: Option<Verdict>) -> usize {
    verdict.and_then(|verdict| Verdict::ALL.iter().position(|v| *v == verdict)).unwrap_or(Verdict::ALL.len())
}
