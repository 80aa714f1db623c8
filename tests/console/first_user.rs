//! Answers and screens that a user of the README alone took for wrong.

use crate::support::{Console, assert_shows, line_with, proposal, trial};
use quadfrog::recording::record::{Record, StageRecord, Transition};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{FallCause, Mode, Snapshot, TransitionCause};
use quadfrog::trial::{
    ExperimentStage, FixedParameter, PointRecord, ProposalSource, QueuedPoint, SKIPPED, SearchStatus,
    SearchedParameter, TrialRecord, Verdict,
};
use quadfrog_console::message::{Effect, Msg};
use quadfrog_console::settings::ChartMode;

/// A trial that was skipped, and one of which nothing was measured, below an accepted one.
fn with_a_skipped_trial() -> Console {
    let mut console = Console::ready();
    console.judged(1);
    let skipped = TrialRecord { cause: SKIPPED.into(), measured: None, ..trial(1, Some(Verdict::Void), None) };
    console.record(Record::Trial(skipped));
    console.record(Record::Trial(TrialRecord { measured: None, ..trial(2, Some(Verdict::Void), None) }));
    console.record(Record::Trial(trial(3, Some(Verdict::Accept), None)));
    console
}

/// Regression: a skipped proposal could be judged a fall; it counted for the budget then, with the value 0.
#[test]
fn a_trial_that_was_not_run_is_not_judged() {
    let mut console = with_a_skipped_trial();
    console.press(&["2", "Home", "Down"]);
    for key in ["a", "f", "v"] {
        assert_eq!(console.press(&[key]), []);
        assert!(console.model.dialog.is_none(), "no reason is asked for");
        assert_eq!(console.said(), format!("{key} is not possible: trial 1 was not run: it has no verdict"));
    }
}

/// Regression: the reason was asked for first, and the verdict refused afterwards.
#[test]
fn a_trial_without_a_measurement_is_not_accepted_before_a_reason_is_asked_for() {
    let mut console = with_a_skipped_trial();
    console.press(&["2", "Home", "Down", "Down", "a"]);
    assert!(console.model.dialog.is_none(), "no reason is asked for");
    assert_shows(console.said(), &["nothing was measured in trial 2: it cannot be accepted"]);
    console.press(&["f"]);
    assert_shows(&console.screen(80, 24), &["Trial #2: void becomes fall. Why?"]);
}

/// Regression: it was said to be recorded in an earlier session.
#[test]
fn a_trial_that_was_not_run_has_no_signals_to_show() {
    let mut console = with_a_skipped_trial();
    console.press(&["2", "Home", "Down", "c"]);
    assert_eq!(console.said(), "trial 1 was not run");
}
