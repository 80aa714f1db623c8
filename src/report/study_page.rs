//! The page of one or several studies.

use std::collections::BTreeSet;

use super::page::{Block, Page, Section};
use super::study::{ReportedStudy, StudyGroup, TrialChoice, groups};
use super::study_figures::{DrawnTrial, GroupFigures, drawn};
use super::study_tables::{self as tables, title};
use super::table::{self, changed_bounds};
use crate::optimize::ask::Direction;
use crate::trial::{ParameterInfo, Task, counted, six_digits};

/// Ways to record the ticks of every trial: the remedy of messages about a trial without ticks.
pub const WAYS_TO_RECORD_EVERY_TRIAL: &str = "`quadfrog optimize --record all` and the console record every trial";

/// Returns the report of `studies`, at least one; `choices`: the trials whose ticks are drawn; `version`: that of the program
/// that writes the report, with its commit.
pub fn page(studies: &[ReportedStudy], choices: &[TrialChoice], version: &str) -> Page {
    let groups = groups(studies);
    let name = match studies {
        [only] => format!("Study {}", title(only)),
        several => format!("{} studies", several.len()),
    };
    let places: Vec<String> = studies.iter().map(place).collect();
    let mut page = Page::new(format!("quadfrog report: {name}"), format!("{}; quadfrog {version}", places.join(", ")));
    page.sections.push(objective(&groups));
    page.sections.push(results(studies, &groups));
    let mut trials = Section::new("Parameters and landings");
    for group in &groups {
        let figures = GroupFigures::new(group);
        trials.blocks.extend([figures.parameters(), figures.landings()].map(Block::Figure));
    }
    page.sections.push(trials);
    for group in &groups {
        page.sections.push(jumps(group, choices));
    }
    page.sections.push(verdicts(studies));
    page.sections.push(configuration(studies));
    page.sections.push(recordings(studies));
    number_repeated_names(&mut page);
    page
}

/// Numbers the names of figures that are there already: studies of two journals may have one name. A name is that of a file.
fn number_repeated_names(page: &mut Page) {
    let mut known = BTreeSet::new();
    for block in page.sections.iter_mut().flat_map(|section| &mut section.blocks) {
        let Block::Figure(figure) = block else { continue };
        let own = figure.name.clone();
        let numbered = (2..).map(|number| format!("{own}-{number}"));
        figure.name = std::iter::once(own.clone()).chain(numbered).find(|name| !known.contains(name)).unwrap_or(own);
        known.insert(figure.name.clone());
    }
}

/// Returns the tables of a running study: objective, results, falls and trials.
pub fn summary(study: &ReportedStudy) -> Page {
    let studies = std::slice::from_ref(study);
    let groups = groups(studies);
    let sections = vec![objective(&groups), results(studies, &groups), verdicts(studies)];
    Page { sections, ..Page::new(format!("Study {}", title(study)), place(study)) }
}

/// The place of a study, with the operators of its recorded sessions.
fn place(study: &ReportedStudy) -> String {
    let operators: Vec<&str> = study.recordings.operators.iter().map(String::as_str).collect();
    if operators.is_empty() { study.place.clone() } else { format!("{} ({})", study.place, operators.join("; ")) }
}

/// Equation of the objective of a task.
fn equation(task: Task, jumps: u32, unit: &str) -> String {
    let (left, right) = match task {
        Task::Forward => ("J_forward", "x_final - x_init"),
        Task::LateralLeft => ("J_lateral-left", "y_final - y_init"),
        Task::LateralRight => ("J_lateral-right", "-(y_final - y_init)"),
        Task::TwistCcw => ("J_twist-ccw", "yaw_final - yaw_init"),
        Task::TwistCw => ("J_twist-cw", "-(yaw_final - yaw_init)"),
    };
    match jumps {
        _ if unit.ends_with("/s") => format!("{left} = ({right}) / t_touchdown   [{unit}]"),
        0 | 1 => format!("{left} = {right}   [{unit}]"),
        _ => format!("{left} = ({right}) / jumps   [{unit} per jump]"),
    }
}

fn objective(groups: &[StudyGroup]) -> Section {
    let mut section = Section::new("Objective");
    for study in groups.iter().map(|group| group.studies[0]) {
        match study.task {
            Some(task) => section.blocks.push(Block::Equation(equation(task, study.jumps, &study.unit))),
            None => {
                let direction = if study.direction == Direction::Minimize { "minimized" } else { "maximized" };
                section.paragraph(format!("{}: a study of another program; its value is {direction}.", study.name));
            }
        }
    }
    if groups.iter().any(|group| group.studies[0].task.is_some()) {
        section.paragraph(
            "J is maximized. The initial values are read when the impulse begins, the final ones when the robot has come to \
             rest, both in the world frame turned so that the trial starts at yaw 0; yaw is unwrapped. A fall gives J = 0 \
             and is reported to the sampler; a void trial is not. The paper is Quadruped-Frog (ICRA 2024), section II-D.",
        );
    }
    section
}

fn results(studies: &[ReportedStudy], groups: &[StudyGroup]) -> Section {
    let mut section = Section::new("Results");
    section.blocks.push(Block::Table(tables::studies(studies)));
    section.blocks.extend(tables::checkpoints(groups).map(Block::Table));
    for group in groups {
        section.blocks.push(Block::Figure(GroupFigures::new(group).convergence()));
        let best = tables::best(group);
        if best.rows.is_empty() {
            section.paragraph(format!("No trial of {} was accepted.", group.name));
        } else {
            section.blocks.push(Block::Table(best));
        }
        for study in group.studies.iter().filter(|study| !study.other_gains_of_best.is_empty()) {
            section.paragraph(format!("Best trial of {}, {}.", title(study), study.other_gains_of_best));
        }
        for study in &group.studies {
            if let Some(confirmation) = &study.confirmation {
                section.paragraph(format!("Confirmation of the best of {}: {confirmation}.", title(study)));
            }
        }
        section.blocks.extend(tables::expectations(&group.studies).map(Block::Table));
        section.blocks.extend(GroupFigures::new(group).expectations().map(Block::Figure));
    }
    section
}

/// Motion, force, torque and power of chosen trials of the best study of a group.
fn jumps(group: &StudyGroup, choices: &[TrialChoice]) -> Section {
    let figures = GroupFigures::new(group);
    let mut section = Section::new(format!("Jumps, {}", figures.name));
    // The best study with ticks; without ticks the best study.
    let rank = |study: &&&ReportedStudy| {
        let value = study.best_row().and_then(|row| row.value).unwrap_or(f64::NEG_INFINITY);
        let value = if study.direction == Direction::Minimize { -value } else { value };
        (!study.recordings.trials.is_empty(), value)
    };
    let best = group.studies.iter().max_by(|a, b| {
        let (a, b) = (rank(a), rank(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    let Some(&study) = best else { return section };
    let trials: Vec<DrawnTrial> = drawn(study, choices);
    if trials.is_empty() {
        section.paragraph("None of the chosen trials exists.");
        return section;
    }
    let labels: Vec<&str> = trials.iter().map(|trial| trial.label.as_str()).collect();
    let of = if group.studies.len() > 1 {
        format!(" of {}, the best study with ticks", study.label())
    } else {
        String::new()
    };
    section.paragraph(format!("Trials shown{of}: {}.", labels.join("; ")));
    section.paragraph(ticks(study, &trials));
    section.blocks.extend(figures.force(study, &trials).map(Block::Figure));
    section.blocks.extend(tables::takeoff(study, &trials).map(Block::Table));
    section.blocks.extend(tables::jumps(study, &trials).map(Block::Table));
    let drawings =
        [figures.motion(&trials), figures.torque(study, &trials), figures.peaks(study, &trials), figures.angles()];
    section.blocks.extend(drawings.into_iter().flatten().map(Block::Figure));
    section
}

/// Returns which of the drawn trials have ticks, and the remedy where some are missing.
fn ticks(study: &ReportedStudy, trials: &[DrawnTrial]) -> String {
    let without_curves = trials.iter().filter(|trial| trial.curves.is_none()).map(|trial| trial.row.trial);
    let (without_jump, missing): (Vec<u32>, Vec<u32>) = without_curves.partition(|trial| study.has_ticks_of(*trial));
    let in_part = study.trials().map(|row| row.trial).filter(|trial| study.recordings.in_part.contains(trial));
    let in_part: Vec<u32> = in_part.collect();
    let recorded = study.trials().filter(|row| study.has_ticks_of(row.trial)).count();
    let in_part = if in_part.is_empty() { String::new() } else { format!(", of {} in part", numbered(&in_part)) };
    let recorded = format!("Ticks of {recorded} of {} are recorded{in_part}", counted(study.trials().count(), "trial"));
    let end = match without_jump.as_slice() {
        [] => String::new(),
        trials => format!(" The ticks of {} end before the impulse: there is no jump to draw.", numbered(trials)),
    };
    let text = match (study.recordings.files.is_empty(), missing.as_slice()) {
        (true, _) => format!(
            "No recording of this study exists: motion, torque and power cannot be drawn; {WAYS_TO_RECORD_EVERY_TRIAL}."
        ),
        (false, []) => format!("{recorded}."),
        (false, missing) => format!(
            "{recorded}; those of {} are missing: motion, torque and power cannot be drawn. They were not recorded \
             ({WAYS_TO_RECORD_EVERY_TRIAL}), or are in a file that is damaged or was taken away.",
            numbered(missing)
        ),
    };
    text + &end
}

/// Returns trials in words: `trial 3` or `trials 0, 16`.
fn numbered(trials: &[u32]) -> String {
    let numbers: Vec<String> = trials.iter().map(u32::to_string).collect();
    format!("trial{} {}", if trials.len() == 1 { "" } else { "s" }, numbers.join(", "))
}

fn verdicts(studies: &[ReportedStudy]) -> Section {
    let mut section = Section::new("Trials, verdicts and notes");
    for study in studies {
        let interventions = table::interventions(&study.rows);
        if !interventions.is_empty() {
            section.paragraph(format!("{}: {interventions}.", title(study)));
        }
    }
    section.blocks.extend(tables::remarks(studies).map(Block::Table));
    section.blocks.extend(tables::overrides(studies).map(Block::Table));
    section.blocks.extend(studies.iter().map(|study| Block::Table(tables::trials(study))));
    section
}

fn configuration(studies: &[ReportedStudy]) -> Section {
    let mut section = Section::new("Configuration");
    let mut shown: Vec<&ReportedStudy> = Vec::new();
    for study in studies {
        section.paragraph(bounds(study));
        if !study.fixed.is_empty() {
            section.paragraph(format!("{}: {}.", title(study), study.fixed.join("; ")));
        }
        if study.configuration.is_empty() {
            section.paragraph(format!("{}: no configuration was kept.", title(study)));
            continue;
        }
        if let Some(same) = shown.iter().find(|known| known.configuration == study.configuration) {
            section.paragraph(format!("{}: the configuration of {}.", title(study), title(same)));
            continue;
        }
        match tables::configuration(study) {
            Some(table) => {
                section.paragraph(format!("{}:", title(study)));
                section.blocks.push(Block::Table(table));
            }
            None => section.paragraph(format!("{}: its configuration files have the defaults.", title(study))),
        }
        for (name, text) in &study.configuration {
            let summary = format!("{name}, {}", title(study));
            section.blocks.push(Block::Folded { summary, text: text.clone() });
        }
        shown.push(study);
    }
    section
}

/// The present bounds, which the operator may have changed during the study.
fn bounds(study: &ReportedStudy) -> String {
    let range = |p: &ParameterInfo| {
        let changed = changed_bounds(p, &study.rows).map_or(String::new(), |changed| format!(" ({changed})"));
        let range = format!("{} {} to {} {}", p.name, six_digits(p.low), six_digits(p.high), p.unit);
        range.trim_end().to_owned() + &changed
    };
    let ranges: Vec<String> = study.parameters.iter().map(range).collect();
    format!("{}: searched last over {}.", title(study), ranges.join(", "))
}

fn recordings(studies: &[ReportedStudy]) -> Section {
    let mut section = Section::new("Recordings");
    for study in studies {
        let files: Vec<String> = study.recordings.files.iter().map(|file| file.display().to_string()).collect();
        let read = if files.is_empty() { "no recording exists".to_owned() } else { files.join(", ") };
        section.paragraph(format!("{}: {} with {read}.", title(study), study.place));
        let programs: Vec<&str> = study.recordings.programs.iter().map(String::as_str).collect();
        if !programs.is_empty() {
            section.paragraph(format!("{}: recorded by quadfrog {}.", title(study), programs.join(", ")));
        }
        for damage in &study.recordings.damages {
            section.paragraph(format!("{}: {damage}.", title(study)));
        }
    }
    section
}
