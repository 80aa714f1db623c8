//! The row of a trial: values, verdict, origin.

use super::{
    CHANGED, DrawnRange, ExpectedResult, FallRisk, JudgedBy, MeasuredJump, ParameterValues, ProposalSource,
    ProposedParameter, RepeatRecord, Verdict, other_gains,
};

/// A row of the trial table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrialRecord {
    /// Number in the study.
    pub trial: u32,
    /// Origin of the parameters.
    pub source: ProposalSource,
    /// The trial whose parameters these are, for a re-run.
    pub parent: Option<u32>,
    /// Parameters by name, in table order.
    pub parameters: ParameterValues,
    /// Measured values; none while it runs, or if it was stopped before.
    pub measured: Option<MeasuredJump>,
    /// The objective that is reported to the sampler: the measured or the hand-measured value, 0 for a fall, none for void.
    pub value: Option<f64>,
    /// A value measured by hand, kept beside the measured one.
    pub hand_value: Option<f64>,
    /// The verdict that the rules suggest.
    pub suggested: Option<Verdict>,
    /// Reason of the suggestion, or of another verdict.
    pub cause: String,
    /// The verdict; none while it runs or waits.
    pub verdict: Option<Verdict>,
    /// Origin of the verdict: of a trial with several rollouts the operator if one of theirs is; none without a verdict, for a trial
    /// that did not run, and for one of another program or of an earlier version.
    pub judged_by: Option<JudgedBy>,
    /// The operator's note.
    pub note: String,
    /// Distance to earlier falls at its approval.
    pub risk: Option<FallRisk>,
    /// Expectation of the sampler's model at its approval.
    pub expected: Option<ExpectedResult>,
    /// The controller's gains that it ran with; empty for a trial of another program.
    pub gains: ParameterValues,
    /// Judged rollouts, in order, void ones included; empty for a trial that is one rollout.
    pub repeats: Vec<RepeatRecord>,
    /// Seed of its noise and terrain, of the first rollout if it has several; none for a trial of another program.
    pub seed: Option<u64>,
    /// The ranges from which its parameters were drawn; empty in older recordings.
    pub ranges: Vec<DrawnRange>,
    /// Proposed values of the parameters and gains that the operator has changed; empty in older recordings and journals.
    pub proposed: ParameterValues,
}

/// Cause of a point that the operator took from the queue: its trial is void and never runs.
pub const REMOVED: &str = "removed from the queue by the operator";
/// Cause of a proposal that the operator refused: its trial is void and never runs.
pub const SKIPPED: &str = "skipped before the jump";
/// Begin of the cause of a trial that the program did not let run.
pub const NOT_RUN: &str = "not run: ";

/// Cause of a trial that another program has pruned: it is void.
pub const PRUNED: &str = "stopped early by another program";

/// Part of the cause of a trial that jumped and was not measured, because its recording is not whole.
pub(crate) const NOT_RECORDED: &str = "not recorded: not measured";

impl TrialRecord {
    /// Returns whether it is void because it was refused before its jump.
    pub fn was_not_run(&self) -> bool {
        let refused = [REMOVED, SKIPPED].contains(&self.cause.as_str()) || self.cause.starts_with(NOT_RUN);
        self.verdict == Some(Verdict::Void) && refused
    }

    /// Returns its value of a parameter or gain.
    pub fn ran_with(&self, name: &str) -> Option<f64> {
        self.parameters.get(name).or_else(|| self.gains.get(name))
    }

    /// Returns its values in place of proposed ones; empty in older recordings and journals.
    pub fn overrides(&self) -> Vec<ProposedParameter> {
        let own = |(name, proposed): &(String, f64)| {
            Some(ProposedParameter { name: name.clone(), value: self.ran_with(name)?, proposed: *proposed })
        };
        self.proposed.iter().filter_map(own).collect()
    }

    /// Returns the origin of its parameters in words, with the trial that it repeats: `re-run of #3`.
    pub fn origin(&self) -> String {
        self.source.with_parent(self.parent)
    }

    /// Returns in words the gains that differ from those of the newest configuration of its study, which may not be the one that it
    /// ran with; empty where none does.
    pub fn other_gains(&self, newest: &ParameterValues) -> String {
        other_gains(&self.gains, ("newest configuration:", newest), |name| self.parameters.get(name).is_some())
    }

    /// Returns whether it counts for the budget: accepted or fallen. Repeats that confirm the best are beyond the budget.
    pub fn counts(&self) -> bool {
        self.has_result() && self.source != ProposalSource::Confirm
    }

    /// Returns whether it is a repeat that confirms the best, accepted or fallen.
    pub fn confirms_best(&self) -> bool {
        self.has_result() && self.source == ProposalSource::Confirm
    }

    /// Returns whether it has a value: accepted or fallen.
    pub fn has_result(&self) -> bool {
        matches!(self.verdict, Some(Verdict::Accept | Verdict::Fall))
    }

    /// Returns the name of its verdict on screens and in reports; a trial that did not run has none, and one of another
    /// program is complete, pruned or has failed until it is judged here. None while it runs or waits.
    pub fn verdict_name(&self) -> Option<&'static str> {
        let of_other_program = self.source == ProposalSource::OtherProgram && self.judged_by.is_none();
        Some(match self.verdict? {
            _ if self.was_not_run() => "not run",
            Verdict::Accept if of_other_program => "complete",
            Verdict::Void if of_other_program && self.cause == PRUNED => "pruned",
            Verdict::Void if of_other_program => "failed",
            verdict => verdict.name(),
        })
    }

    /// Returns whether it ended before its impulse: by its rules void, with nothing to measure.
    pub fn did_not_jump(&self) -> bool {
        let measurable = self.measured.is_some() || !self.repeats.is_empty() || self.cause.contains(NOT_RECORDED);
        self.suggested == Some(Verdict::Void) && !measurable
    }

    /// Returns whether it counts with a value measured by hand.
    pub fn counts_by_hand(&self) -> bool {
        self.verdict == Some(Verdict::Accept) && self.hand_value.is_some()
    }

    /// Returns whether the operator has judged it otherwise than suggested, or has changed its verdict later.
    pub fn is_overruled(&self) -> bool {
        let otherwise =
            self.verdict.is_some() && self.suggested.is_some_and(|suggested| Some(suggested) != self.verdict);
        otherwise || is_changed_verdict(&self.cause)
    }

    /// Returns the operator's reason of a verdict, empty without one, and the rest of the cause as one sentence; none where the rules
    /// have judged.
    pub fn operators_reason(&self) -> Option<(&str, String)> {
        let words = OperatorsWords::of(&self.cause)?;
        // Earlier versions have kept the words of all changes.
        Some(match self.cause_by_rule() {
            // A trial of another program has none.
            "" => (words.reason, words.act),
            rule => (words.reason, format!("{} ({rule})", words.act)),
        })
    }

    /// Returns the cause without the words of the operator: that of the rules.
    pub fn cause_by_rule(&self) -> &str {
        let mut cause = self.cause.as_str();
        while let Some(words) = OperatorsWords::of(cause) {
            cause = words.rest;
        }
        cause
    }

    /// Returns the number of repeats that count.
    pub fn counted_repeats(&self) -> u32 {
        self.repeats.iter().filter(|repeat| repeat.verdict != Some(Verdict::Void)).count() as u32
    }
}

/// Returns whether `cause` is that of a verdict that the operator has changed after it had become final.
pub fn is_changed_verdict(cause: &str) -> bool {
    OperatorsWords::of(cause).is_some_and(|words| words.act.starts_with(CHANGED))
}

/// The parts of a cause that begins with words of the operator.
struct OperatorsWords<'a> {
    /// The operator's reason; empty without one.
    reason: &'a str,
    /// `changed by the operator, was accept`, `by the operator, looked like fall`, `re-run by the operator`.
    act: String,
    /// The cause before.
    rest: &'a str,
}

impl OperatorsWords<'_> {
    fn of(cause: &str) -> Option<OperatorsWords<'_>> {
        let change = format!("{CHANGED}, was ");
        if let Some(rest) = cause.strip_prefix(&change) {
            // As earlier versions have written it.
            let (before, rest) = rest.split_once(": ")?;
            let (reason, rest) = rest.split_once("; ").unwrap_or((rest, ""));
            return Some(OperatorsWords { reason, act: change + before, rest });
        }
        if let Some((reason, rest)) = cause.split_once(&format!("; {change}")) {
            let (before, rest) = rest.split_once("; ").unwrap_or((rest, ""));
            return Some(OperatorsWords { reason, act: change + before, rest });
        }
        let by = ["by the operator", "re-run by the operator"].into_iter().find(|by| cause.starts_with(by))?;
        let words = &cause[by.len()..];
        let (words, act, rest) = match words.split_once("; looked like ") {
            Some((words, rest)) => {
                let (suggested, rest) = rest.split_once(": ")?;
                (words, format!("{by}, looked like {suggested}"), rest)
            }
            None => words.split_once("; ").map(|(words, rest)| (words, by.to_owned(), rest))?,
        };
        Some(OperatorsWords { reason: words.strip_prefix(": ").unwrap_or(words), act, rest })
    }
}
