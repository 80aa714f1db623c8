//! Requests that change the study, as jobs on the experiment.

use std::collections::BTreeMap;

use super::unfinished::Asker;
use crate::session::experiment::{Experiment, RequestRefusal};
use crate::session::operator_request::OperatorRequest;
use crate::session::storage::JobOutput;
use crate::trial::{ExperimentStage, FixedParameter, Verdict, counted, four_digits, parameter_unit, six_digits};

/// Carries out a request of `asker`. One that is not of the study is refused.
pub fn carry_out(experiment: &mut Experiment, request: &OperatorRequest, asker: Asker) -> JobOutput {
    let before = Before::of(experiment, request);
    let number = experiment.under_review().map(|row| row.trial);
    let trial = number.map_or(String::new(), |number| format!("trial {number}"));
    // What was queued already comes before a re-run.
    let again = |experiment: &Experiment| match experiment.proposal() {
        Some(next) if next.parent != number && Some(next.trial) != number => {
            format!("{trial} is void, and its parameters are queued; trial {} comes first", next.trial)
        }
        _ => format!("{trial} is void, and its parameters are proposed again"),
    };
    let output = match request {
        OperatorRequest::Judge(verdict) => {
            let answer = format!("{trial}; u takes it back until the next trial");
            let done = match asker {
                Asker::Operator => experiment.judge(*verdict, false),
                Asker::Rule => experiment.judge_by_rule(*verdict),
            };
            judged(done, answer)
        }
        OperatorRequest::Rerun { trial: None } => {
            let done = experiment.judge(Verdict::Void, true);
            judged(done, again(experiment))
        }
        OperatorRequest::VoidBecause { reason, rerun: false } => {
            judged(experiment.void_because(reason, false), format!("{trial} is void"))
        }
        OperatorRequest::VoidBecause { reason, rerun: true } => {
            let done = experiment.void_because(reason, true);
            judged(done, again(experiment))
        }
        _ => JobOutput::Answer(change(experiment, request).map_err(|refusal| refusal.to_string())),
    };
    let effects = side_effects(experiment, request, &before);
    let say = |answer: String| answer + &effects;
    match output {
        JobOutput::Answer(answer) => JobOutput::Answer(answer.map(say)),
        JobOutput::Judged(answer, over) => JobOutput::Judged(answer.map(say), over),
        other => other,
    }
}

/// State that a request may change beside what it is asked for.
struct Before {
    /// The trial whose verdict can be taken back.
    undoable: Option<u32>,
    /// The proposal whose values the operator has changed.
    changed: Option<u32>,
    /// Values of the open proposal.
    values: Option<Vec<f64>>,
    /// Number and proposed values of the open proposal, for a request that may draw it again.
    drawn: Option<(u32, Vec<f64>)>,
    /// The fixed parameters and whether the study is finished, for a changed verdict.
    counts: Option<(BTreeMap<String, FixedParameter>, bool)>,
}

impl Before {
    fn of(experiment: &Experiment, request: &OperatorRequest) -> Before {
        use OperatorRequest::{ChangeVerdict, Fix, NarrowBounds, Unfix};
        let searches = matches!(request, Fix { .. } | Unfix { .. } | NarrowBounds { .. } | ChangeVerdict { .. });
        let drawn = if searches { drawn(experiment) } else { None };
        let counts = matches!(request, ChangeVerdict { .. })
            .then(|| (experiment.fixed(), experiment.stage() == ExperimentStage::Finished));
        Before {
            undoable: experiment.undoable(),
            changed: experiment.changed_proposal(),
            values: values(experiment),
            drawn,
            counts,
        }
    }
}

/// Returns in words what a request has done beside what it was asked for: put a verdict beyond undo, kept or dropped changed values,
/// drawn the proposal again, ended the confirmation of the best. Empty if nothing.
fn side_effects(experiment: &mut Experiment, request: &OperatorRequest, before: &Before) -> String {
    use OperatorRequest::{ClearOverrides, Judge, Override, OverrideGain, Skip, Undo};
    let mut text = String::new();
    if let Some(trial) = before.undoable.filter(|_| experiment.undoable().is_none() && *request != Undo) {
        text += &format!("; undo no longer reaches the verdict of trial {trial}");
    }
    if let Some(trial) = before.changed {
        match request {
            ClearOverrides | Override { .. } | OverrideGain { .. } | Skip { .. } => {}
            // A queued point with the same values takes the place of the proposal.
            _ if experiment.changed_proposal().is_none() && values(experiment) != before.values => {
                text += &format!("; the changed values of proposal {trial} are dropped: change them again");
            }
            Undo | Judge(_) => text += &format!("; proposal {trial} keeps its changed values"),
            _ => {}
        }
    }
    if let Some((trial, values)) = &before.drawn
        && drawn(experiment).is_some_and(|(now, new)| now == *trial && new != *values)
    {
        text += &format!("; proposal {trial} is drawn again");
    }
    if let Some((fixed, finished)) = &before.counts {
        text += &of_changed_count(experiment, fixed, *finished);
    }
    if let Some(conclusion) = experiment.take_conclusion() {
        text += &format!("; {conclusion}");
    }
    text
}

/// Returns in words what follows from another number of trials that count: fixed parameters, room in a finished study.
fn of_changed_count(experiment: &Experiment, fixed: &BTreeMap<String, FixedParameter>, finished: bool) -> String {
    let mut text = String::new();
    let now = experiment.fixed();
    for (name, FixedParameter { value, trials }) in now.iter().filter(|(name, now)| fixed.get(*name) != Some(now)) {
        let unit =
            Some(parameter_unit(name)).filter(|unit| !unit.is_empty()).map_or(String::new(), |u| format!(" {u}"));
        text += &format!("; {name} {}{unit} fixed, {trials} more", four_digits(*value));
    }
    for name in fixed.keys().filter(|name| !now.contains_key(*name)) {
        text += &format!("; {name} is searched again");
    }
    if let Some(proposal) = experiment.proposal().filter(|_| finished) {
        text += &format!("; the study has room again: trial {} waits for you", proposal.trial);
    }
    text
}

/// Returns number and proposed values of the open proposal.
fn drawn(experiment: &Experiment) -> Option<(u32, Vec<f64>)> {
    let proposal = experiment.proposal()?;
    Some((proposal.trial, proposal.parameters.iter().map(|p| p.proposed).collect()))
}

fn values(experiment: &Experiment) -> Option<Vec<f64>> {
    let proposal = experiment.proposal()?;
    Some(proposal.parameters.iter().chain(&proposal.gains).map(|p| p.value).collect())
}

/// The answer to a verdict. If another program has ended the trial, the review is over as well.
fn judged(judged: Result<(), RequestRefusal>, answer: String) -> JobOutput {
    let over = matches!(judged, Ok(()) | Err(RequestRefusal::EndedElsewhere(_)));
    JobOutput::Judged(judged.map(|()| answer).map_err(|refusal| refusal.to_string()), over)
}

/// Returns in words that a queued point is the proposal now; empty where others run before it.
fn as_proposal(proposed: Option<u32>) -> String {
    proposed.map_or(String::new(), |trial| {
        format!(" as trial {trial}, the proposal now; the sampler proposes again after it")
    })
}

fn change(experiment: &mut Experiment, request: &OperatorRequest) -> Result<String, RequestRefusal> {
    Ok(match request {
        OperatorRequest::Skip { trial, revision } => {
            experiment.skip(*trial, *revision)?;
            "skipped; a new proposal follows".to_owned()
        }
        OperatorRequest::Override { parameter, value } => {
            experiment.set_parameter(parameter, *value)?;
            experiment.overrides_in_words()
        }
        OperatorRequest::ClearOverrides => {
            experiment.clear_overrides()?;
            experiment.overrides_in_words()
        }
        OperatorRequest::OverrideGain { gain, value } => {
            experiment.set_gain(gain, *value)?;
            experiment.overrides_in_words()
        }
        OperatorRequest::Fix { parameter, value, trials } => {
            experiment.fix(parameter, *value, *trials)?;
            let next = match trials {
                1 => "next trial that counts".to_owned(),
                trials => format!("next {trials} trials that count"),
            };
            let value = six_digits(*value);
            format!(
                "{parameter} is {value} for the {next}; one with another {parameter}, queued or changed, uses up none"
            )
        }
        OperatorRequest::Unfix { parameter } => {
            experiment.unfix(parameter)?;
            format!("{parameter} is searched again")
        }
        OperatorRequest::NarrowBounds { parameter, low, high } => {
            experiment.narrow_bounds(parameter, *low, *high)?;
            format!("{parameter} is searched from {} to {}", six_digits(*low), six_digits(*high))
        }
        OperatorRequest::ConfirmBest { repeats } => {
            let trials: Vec<String> = experiment.confirm_best(*repeats)?.iter().map(u32::to_string).collect();
            match trials.len() {
                0 => "no more repeats".to_owned(),
                _ => {
                    let most = if *repeats == 1 { "once".to_owned() } else { format!("{repeats} times") };
                    let least = experiment.least_repeats();
                    let needed = match *repeats < least {
                        true => format!("; to compare them takes {least}"),
                        false => String::new(),
                    };
                    format!("the points of trials {} are repeated, at most {most}{needed}", trials.join(", "))
                }
            }
        }
        OperatorRequest::Rerun { trial: Some(trial) } => {
            let proposed = experiment.repeat(*trial)?;
            format!("the parameters of trial {trial} are queued{}", as_proposal(proposed))
        }
        OperatorRequest::Undo => {
            experiment.undo()?;
            match experiment.under_review() {
                Some(row) => format!("the verdict of trial {} is taken back; it waits for another", row.trial),
                None => "it is taken back".to_owned(),
            }
        }
        OperatorRequest::ChangeVerdict { trial, verdict, reason } => {
            let before = experiment.change_verdict(*trial, *verdict, reason)?;
            format!("it was {before}; the journal keeps both")
        }
        OperatorRequest::HandValue(value) => {
            experiment.set_hand_value(*value)?;
            let accepted = experiment.under_review().is_some_and(|row| row.suggested == Some(Verdict::Accept));
            match value {
                Some(value) => {
                    let when = if accepted { "" } else { " if the trial is accepted" };
                    format!("{} {} counts instead of the measured value{when}", six_digits(*value), experiment.unit())
                }
                None => "the measured value counts".to_owned(),
            }
        }
        OperatorRequest::Note { trial, text } => {
            experiment.note(*trial, text)?;
            "noted".to_owned()
        }
        OperatorRequest::Enqueue(parameters) => {
            let queued = experiment.enqueue(parameters)?;
            let mut text = match queued.same {
                None => "queued".to_owned(),
                Some(same) => format!("queued once more: trial {same} is the same point and waits, too"),
            };
            text += &as_proposal(queued.proposed);
            for (name, fixed) in queued.not_fixed {
                text += &format!("; its {name} is not the fixed {}", six_digits(fixed));
            }
            text
        }
        OperatorRequest::RemoveQueued { trial } => {
            experiment.remove_queued(*trial)?;
            "it does not run".to_owned()
        }
        OperatorRequest::MoveQueued { trial, earlier } => {
            let moved = experiment.move_queued(*trial, *earlier)?;
            let values = experiment.in_words(&moved.point);
            format!("{values} is number {} of {} in the queue now", moved.place, moved.of)
        }
        OperatorRequest::Continue(trials) => {
            experiment.extend(*trials)?;
            format!("the study ends with {}", counted(experiment.budget() as usize, "counted trial"))
        }
        _ => return Err(RequestRefusal::NotNow("this is no request to the study".to_owned())),
    })
}
