//! One claim, its judgement, and the figures that the claims have in common.

use quadfrog::trial::Task;

use crate::subcommand::reproduce::plan::PaperExperiment;
use crate::subcommand::reproduce::results::Sample;

/// Share of a figure of the paper that counts as reached: the robot and its model differ by more than this.
pub const REACHED: f64 = 0.9;

/// Outcome of a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClaimJudgement {
    Agrees,
    Differs,
    NotComparable,
}

impl ClaimJudgement {
    /// Returns the words in tables.
    pub fn text(self) -> &'static str {
        match self {
            ClaimJudgement::Agrees => "agrees",
            ClaimJudgement::Differs => "does not agree",
            ClaimJudgement::NotComparable => "cannot be compared",
        }
    }

    pub fn of(agrees: bool) -> ClaimJudgement {
        if agrees { ClaimJudgement::Agrees } else { ClaimJudgement::Differs }
    }
}

/// A statement of the paper and its comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct PaperClaim {
    pub experiment: PaperExperiment,
    /// Short name of the compared quantity.
    pub name: &'static str,
    /// Section or figure of the paper.
    pub place: &'static str,
    /// Words of the paper.
    pub sentence: &'static str,
    /// The paper's figure, short.
    pub paper: &'static str,
    /// The program's figures.
    pub ours: String,
    /// Statement that holds where the figures agree; for a statement that cannot be compared, the reason.
    pub criterion: String,
    pub judgement: ClaimJudgement,
    /// Whether it is in the short table of README.md.
    pub short: bool,
}

type Text = &'static str;

/// Returns the constructor of the claims of an experiment, which takes the other fields in their order.
pub fn claims_of(
    experiment: PaperExperiment,
) -> impl Fn(Text, Text, Text, Text, String, String, ClaimJudgement, bool) -> PaperClaim {
    move |name, place, sentence, paper, ours, criterion, judgement, short| PaperClaim {
        experiment,
        name,
        place,
        sentence,
        paper,
        ours,
        criterion,
        judgement,
        short,
    }
}

impl PaperClaim {
    /// Returns the judgement with its rule.
    pub fn reason(&self) -> String {
        match self.judgement {
            ClaimJudgement::NotComparable => format!("{}: {}", self.judgement.text(), self.criterion),
            _ => format!("{}; it agrees if {}", self.judgement.text(), self.criterion),
        }
    }
}

/// Returns what the paper reports of the robot: 0.5 m forward, 0.3 m to a side, a turn of 2 rad.
pub fn robot_value(task: Task) -> f64 {
    match task {
        Task::Forward => 0.5,
        Task::LateralLeft | Task::LateralRight => 0.3,
        Task::TwistCcw | Task::TwistCw => 2.0,
    }
}

/// Returns a mean with its range and unit; `-` for an empty sample.
pub fn spread(values: impl IntoIterator<Item = f64>, digits: usize, unit: &str) -> String {
    Sample::of(values).map_or_else(
        || "-".to_owned(),
        |sample| match sample.count {
            1 => format!("{:.digits$} {unit}", sample.mean),
            _ => format!("{:.digits$} {unit} ({:.digits$} to {:.digits$})", sample.mean, sample.least, sample.most),
        },
    )
}

/// Returns the mean; NaN for an empty sample, which no criterion accepts.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    Sample::of(values).map_or(f64::NAN, |sample| sample.mean)
}
