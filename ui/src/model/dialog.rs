//! Dialogs over a view: questions, text fields, lists, help.

use std::time::Duration;

use quadfrog::trial::{ParameterInfo, Proposal, ProposedParameter};
use tui_input::Input;

use super::session::SessionModel;

/// Least time between the two presses that approve a jump. It exceeds the delay before a held key repeats (660 ms on X11,
/// at most 500 ms elsewhere as delivered): a repetition cannot be told from a press.
pub const APPROVAL_PAUSE: Duration = Duration::from_millis(800);

/// A dialog over the view.
#[derive(Debug, Clone)]
pub enum Dialog {
    /// The second press that approves a jump.
    Approve {
        /// Number of the shown proposal.
        trial: u32,
        /// Its revision.
        revision: u32,
        /// Time of the last press of the approving key.
        pressed_at: Duration,
    },
    /// Confirmation of arming, on hardware and where arming was chosen with Enter.
    Arm {
        /// Letters of the confirming word that were typed.
        typed: usize,
    },
    /// The arming checks.
    ArmingChecks {
        /// The selected one of the operator's own items.
        selected: usize,
    },
    /// Confirmation of quitting while the robot is armed or a trial waits.
    Quit,
    /// Changes to the proposal.
    Override(OverrideForm),
    /// One line of text.
    Field {
        /// Purpose of the text.
        purpose: Purpose,
        /// The text so far.
        input: Input,
        /// Reason why it was refused.
        problem: Option<String>,
    },
    /// All actions with a filter.
    Palette {
        /// The filter.
        input: Input,
        /// The selected line among the filtered ones.
        selected: usize,
    },
    /// The active keys.
    Help {
        /// Lines scrolled off.
        scroll: usize,
    },
    /// A list of switches.
    Choose {
        /// Subject of the list.
        what: Choice,
        /// The selected line.
        selected: usize,
    },
    /// All details of one trial.
    Details {
        /// Its number.
        trial: u32,
        /// Lines scrolled off.
        scroll: usize,
    },
}

/// Purpose of a text field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Purpose {
    /// A note on this trial.
    Note(u32),
    /// A value measured by hand, for the trial under review.
    HandValue(u32),
    /// More trials for a finished study.
    Continue,
    /// The number of trials for which a parameter is fixed.
    Fix {
        /// Its index in the session's list.
        parameter: usize,
        /// The value that it keeps, in its unit.
        value: f64,
    },
    /// New bounds of a parameter.
    Bounds {
        /// Its index in the session's list.
        parameter: usize,
    },
    /// The number of repeats of the best points.
    ConfirmBest,
    /// The number of a trial to select.
    TrialNumber,
    /// A text to search in the log.
    LogSearch,
}

/// Subject of a list of switches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// The series of the charts.
    Series,
    /// The columns of the trial table.
    Columns,
}

impl Dialog {
    /// A text field with an initial text.
    pub fn field(purpose: Purpose, text: &str) -> Dialog {
        Dialog::Field { purpose, input: Input::new(text.to_owned()), problem: None }
    }

    /// Whether keys are text here.
    pub fn takes_text(&self) -> bool {
        matches!(self, Dialog::Field { .. } | Dialog::Palette { .. })
            || matches!(self, Dialog::Override(form) if form.typing.is_some())
    }
}

/// A form that changes a proposal. The session receives the values with Enter; only an approval moves the robot.
#[derive(Debug, Clone)]
pub struct OverrideForm {
    /// Number of the proposal.
    pub trial: u32,
    /// Parameters, then gains.
    pub rows: Vec<OverrideRow>,
    /// The selected row.
    pub selected: usize,
    /// A value being typed.
    pub typing: Option<Input>,
    /// Reason why the typed value was refused.
    pub problem: Option<String>,
}

/// One parameter or gain of the form.
#[derive(Debug, Clone, PartialEq)]
pub struct OverrideRow {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// The value of the sampler or the queue; of a gain that of the configuration.
    pub proposed: f64,
    /// The value of the proposal when the form was opened.
    pub before: f64,
    /// The present value.
    pub value: f64,
    /// Whether it is a gain of the controller, not a searched parameter.
    pub gain: bool,
}

impl OverrideForm {
    /// The form for a proposal; parameters without known bounds are left out.
    pub fn new(proposal: &Proposal, session: &SessionModel, selected: usize) -> OverrideForm {
        let row = |p: &ProposedParameter, info: ParameterInfo, gain| OverrideRow {
            name: p.name.clone(),
            unit: info.unit,
            low: info.low,
            high: info.high,
            proposed: p.proposed,
            before: p.value,
            value: p.value,
            gain,
        };
        let parameters = proposal.parameters.iter().filter_map(|p| Some(row(p, session.parameter(&p.name)?, false)));
        let gains = proposal.gains.iter().filter_map(|p| Some(row(p, session.gain(&p.name)?.clone(), true)));
        let rows: Vec<OverrideRow> = parameters.chain(gains).collect();
        let selected = selected.min(rows.len().saturating_sub(1));
        OverrideForm { trial: proposal.trial, rows, selected, typing: None, problem: None }
    }
}
