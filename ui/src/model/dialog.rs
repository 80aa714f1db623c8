//! Dialogs over a view: questions, text fields, lists, help.

use std::time::Duration;

use quadfrog::trial::{ParameterInfo, Proposal, ProposedParameter, Verdict};
use tui_input::Input;

use super::session::SessionModel;
use crate::action::Action;

/// Least time in which a person types the letters that arm the robot: a pasted text arrives at once.
pub const ARMING_TIME: Duration = Duration::from_millis(250);

/// Least time between the two presses that approve a jump. It exceeds the delay before a held key repeats (660 ms on X11,
/// at most 500 ms elsewhere as delivered): a repetition cannot be distinguished from a press.
pub const APPROVAL_PAUSE: Duration = Duration::from_millis(800);

/// Time after the first press in which the second one approves: a forgotten press must not leave the robot one key from a jump.
pub const APPROVAL_TIME: Duration = Duration::from_secs(20);

/// Most columns of a dialog: longer lines are hard to read.
pub const MAX_WIDTH: u16 = 120;

/// A dialog over the view; `selected` is a line of its list, or the content of a line that can move, `scroll` counts lines above the
/// shown ones.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum Dialog {
    /// The second press that approves a jump.
    Approve {
        trial: u32,
        revision: u32,
        /// Time of the last press of the approving key.
        pressed_at: Duration,
        /// Whether the operator has confirmed that the area is clear; needed on hardware, for each jump.
        area_clear: bool,
    },
    /// Confirmation of the first command to a real robot.
    TakeControl,
    /// Confirmation of arming, on hardware and where arming was chosen with Enter, with the number of letters typed.
    Arm {
        typed: usize,
        opened_at: Duration,
    },
    /// The arming checks; those of the operator can be selected.
    ArmingChecks {
        selected: usize,
        /// One more than the lines above the shown ones; 0 shows the selected item.
        scroll: usize,
    },
    /// A question that `y` answers; every other key cancels.
    Confirm(Question),
    /// Confirmation of quitting while the robot is armed or a trial waits.
    Quit,
    Override(OverrideForm),
    /// One line of text, and the reason why it was refused.
    Field {
        purpose: Purpose,
        input: Input,
        /// Whether the whole text is selected: the first character typed replaces it.
        replaces: bool,
        problem: Option<Problem>,
    },
    /// The table does not show all trials: which of them to write.
    Export {
        shown: usize,
        all: usize,
    },
    /// All actions with a filter.
    Palette {
        input: Input,
        /// None where no action passes the filter.
        selected: Option<Action>,
    },
    Help {
        scroll: usize,
    },
    /// The tables of the study as they were when it was opened.
    Report {
        lines: Vec<String>,
        scroll: usize,
    },
    Choose {
        subject: Choice,
        selected: usize,
    },
    /// The queued points.
    Queue {
        /// Trial of a point; the next one is selected once it has left the queue. None selects the first one.
        selected: Option<u32>,
    },
    Details {
        trial: u32,
        scroll: usize,
    },
    /// The selected line of the log, whole.
    LogLine {
        scroll: usize,
    },
}

/// A question before an action that a single key would carry out by accident.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum Question {
    /// Skip this proposal.
    Skip { trial: u32, revision: u32 },
    /// Accept a trial, or judge it a fall, whose suggested verdict is another.
    JudgeAnyway { trial: u32, verdict: Verdict },
    /// Queue the values of the open proposal, which is queued itself or the sampler's, unchanged: they may run twice.
    QueueProposed { trial: u32, revision: u32 },
    /// Remove a point from the queue.
    RemoveQueued { trial: u32 },
    /// Take a verdict back while another row is selected.
    Undo { trial: u32 },
    /// Confirm the best with fewer repeats than a comparison takes.
    FewRepeats { repeats: u32 },
    /// End the repeats that confirm the best.
    EndRepeats,
    /// Queue the parameters of a judged trial again.
    Rerun { trial: u32 },
    /// Use a value measured by hand that lies far from the robot's own measurement.
    HandValue { trial: u32, value: f64 },
}

/// Purpose of a text field. A parameter is its index in the session's list.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum Purpose {
    Note(u32),
    /// A value measured by hand, for the trial under review.
    HandValue(u32),
    Continue,
    /// The number of trials for which a parameter keeps `value`, in its unit.
    Fix {
        parameter: usize,
        value: f64,
    },
    Bounds {
        parameter: usize,
    },
    ConfirmBest,
    /// The reason to judge a trial that tripped a limit void.
    VoidReason {
        trial: u32,
        rerun: bool,
    },
    /// The reason to change the final verdict of a trial.
    ChangeVerdict {
        trial: u32,
        verdict: Verdict,
    },
    TrialNumber,
    LogSearch,
    /// A time or a trial of a replay, by number or word.
    Seek,
    /// The trial beside the one at the playhead of a replay.
    Beside,
    /// The folder of the configuration by which the trials of a replay are judged again.
    Rejudge,
}

/// Reason why a form has not taken what was typed.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// The reason.
    pub text: String,
    /// Whether a character was not taken and this is not yet acknowledged: 1.5 would become 15 unseen.
    pub refused_character: bool,
}

impl Problem {
    /// A character that is not part of a number.
    pub fn not_of_a_number(character: char) -> Problem {
        Problem::refused(character, "a number")
    }

    /// A character that is not part of a place in a recording.
    pub fn not_of_a_place(character: char) -> Problem {
        Problem::refused(character, "a time, #7 for a trial, best or fall")
    }

    fn refused(character: char, expected: &str) -> Problem {
        let text = format!("`{character}` does not belong here: type {expected}");
        Problem { text, refused_character: true }
    }

    /// The answer to the key that would use a number without a character that was not taken.
    pub fn acknowledged(key_again: &str) -> Problem {
        format!("a character was not taken; {key_again}").into()
    }
}

impl From<String> for Problem {
    fn from(text: String) -> Problem {
        Problem { text, refused_character: false }
    }
}

/// The places in a recording that can be typed; without a space where Space is STOP.
pub fn places(space_is_text: bool) -> &'static str {
    if space_is_text { "12:34, 75.5 s, #7 or trial 7, best or fall" } else { "12:34, 75.5, #7, best or fall" }
}

impl Purpose {
    /// The characters that its text may hold; none for any.
    pub fn characters(self) -> Option<&'static str> {
        match self {
            Purpose::HandValue(_) | Purpose::Bounds { .. } => Some("0123456789.,+-e"),
            Purpose::Continue | Purpose::Fix { .. } | Purpose::ConfirmBest | Purpose::TrialNumber => Some("0123456789"),
            Purpose::Beside => Some("0123456789#"),
            Purpose::Seek => Some("0123456789.,:# abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"),
            Purpose::Note(_)
            | Purpose::VoidReason { .. }
            | Purpose::ChangeVerdict { .. }
            | Purpose::LogSearch
            | Purpose::Rejudge => None,
        }
    }

    /// The content without which the field confirms nothing; none for a field that may be empty or asks for a reason.
    pub fn needed(self) -> Option<&'static str> {
        match self {
            Purpose::Continue | Purpose::Fix { .. } => Some("a number of trials from 1 to 1000"),
            Purpose::ConfirmBest => Some("a number of repeats from 1 to 1000"),
            Purpose::Bounds { .. } => Some("a range as LOW..HIGH"),
            Purpose::TrialNumber | Purpose::Beside => Some("the number of a trial"),
            Purpose::Seek => Some("a time, #7 for a trial, best or fall"),
            Purpose::HandValue(_)
            | Purpose::Note(_)
            | Purpose::VoidReason { .. }
            | Purpose::ChangeVerdict { .. }
            | Purpose::LogSearch
            | Purpose::Rejudge => None,
        }
    }

    /// Whether its text is a remark of the operator.
    pub fn is_remark(self) -> bool {
        matches!(self, Purpose::Note(_) | Purpose::VoidReason { .. } | Purpose::ChangeVerdict { .. })
    }
}

/// Subject of a list of switches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum Choice {
    Series,
    Columns,
}

impl Dialog {
    /// A text field with an initial text. A number is selected, so that typing replaces it; other text is not.
    pub fn field(purpose: Purpose, text: &str) -> Dialog {
        let replaces = purpose.characters().is_some() && !text.is_empty();
        Dialog::Field { purpose, input: Input::new(text.to_owned()), replaces, problem: None }
    }

    /// A line with a text that was refused.
    pub fn refused_field(purpose: Purpose, text: &str, problem: String) -> Dialog {
        Dialog::Field { purpose, input: Input::new(text.to_owned()), replaces: false, problem: Some(problem.into()) }
    }

    /// Whether the field or the form waits for an acknowledgement of a character that it has not taken: the next Enter confirms
    /// nothing.
    pub fn has_refused_character(&self) -> bool {
        match self {
            Dialog::Field { problem, .. } => problem.as_ref().is_some_and(|problem| problem.refused_character),
            Dialog::Override(form) => form.has_refused_character(),
            _ => false,
        }
    }

    /// Whether it is an empty field that needs a content.
    pub fn lacks_content(&self) -> bool {
        matches!(self, Dialog::Field { purpose, input, .. } if purpose.needed().is_some() && input.value().trim().is_empty())
    }

    /// Whether a space is text here: not where a number is typed, and in a place of a recording unless Space stops a robot.
    pub fn takes_spaces(&self, can_stop: bool) -> bool {
        match self {
            Dialog::Field { purpose: Purpose::Seek, .. } => !can_stop,
            Dialog::Field { purpose, .. } => purpose.characters().is_none(),
            Dialog::Palette { .. } => true,
            _ => false,
        }
    }

    /// Whether it only shows something, or lists what a key changes at once: it asks nothing.
    pub fn only_shows(&self) -> bool {
        match self {
            Dialog::ArmingChecks { .. }
            | Dialog::Help { .. }
            | Dialog::Report { .. }
            | Dialog::Choose { .. }
            | Dialog::Queue { .. }
            | Dialog::Details { .. }
            | Dialog::LogLine { .. } => true,
            Dialog::Approve { .. }
            | Dialog::TakeControl
            | Dialog::Arm { .. }
            | Dialog::Confirm(_)
            | Dialog::Quit
            | Dialog::Override(_)
            | Dialog::Field { .. }
            | Dialog::Export { .. }
            | Dialog::Palette { .. } => false,
        }
    }

    /// Whether it is a field or a form, with values that the operator must see.
    pub fn holds_values(&self) -> bool {
        self.takes_text() || matches!(self, Dialog::Override(_))
    }

    /// Whether keys are text here.
    pub fn takes_text(&self) -> bool {
        matches!(self, Dialog::Field { .. } | Dialog::Palette { .. })
            || matches!(self, Dialog::Override(form) if form.typing.is_some())
    }
}

/// A form that changes a proposal. The session receives the values with Enter; only an approval moves the robot.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct OverrideForm {
    pub trial: u32,
    /// Revision of the proposal whose values the form holds.
    pub revision: u32,
    /// Parameters, then gains.
    pub rows: Vec<OverrideRow>,
    pub selected: usize,
    pub typing: Option<Input>,
    /// Whether the whole typed number is selected, because it was refused: the first character typed replaces it.
    pub replaces: bool,
    pub problem: Option<Problem>,
    /// The typed number that Esc has dropped, until the next key.
    pub dropped: Option<String>,
}

/// One parameter or gain of the form.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub struct OverrideRow {
    pub name: String,
    pub unit: String,
    pub low: f64,
    pub high: f64,
    /// The value of the sampler or the queue; of a gain that of the configuration.
    pub proposed: f64,
    /// The value of the proposal when the form was opened.
    pub before: f64,
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
        OverrideForm {
            trial: proposal.trial,
            revision: proposal.revision,
            rows,
            selected,
            typing: None,
            replaces: false,
            problem: None,
            dropped: None,
        }
    }

    /// Whether it waits for an acknowledgement of a character that it has not taken.
    pub fn has_refused_character(&self) -> bool {
        self.problem.as_ref().is_some_and(|problem| problem.refused_character)
    }

    /// Whether it holds values that the session has not received.
    pub fn is_changed(&self) -> bool {
        self.typing.is_some() || self.rows.iter().any(|row| row.value != row.before)
    }
}
