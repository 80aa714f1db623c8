//! Rows of the trial table as text: clipboard, CSV, Markdown.

use quadfrog::optimize::ask::Direction;
use quadfrog::report::recorded::Recordings;
use quadfrog::report::study::ReportedStudy;
use quadfrog::report::{study_page, text};
use quadfrog::trial::{Displacement, JudgedBy, ParameterInfo, TrialRecord, Verdict, six_digits};

use crate::column::Column;
use crate::message::ExportedRows;
use crate::model::Model;
use crate::model::session::SessionModel;
use crate::model::trials::measured;

/// Note and cause on one line; the operator's own words come first, because a long line is cut.
pub fn remark(trial: &TrialRecord) -> String {
    match (trial.note.as_str(), trial.cause.as_str()) {
        ("", cause) => cause.to_owned(),
        (note, "") => format!("{note} |"),
        (note, cause) => format!("{note} | {cause}"),
    }
}

/// The bounds of a parameter as an operator types others.
pub fn range(parameter: &ParameterInfo) -> String {
    format!("{}..{}", six_digits(parameter.low), six_digits(parameter.high))
}

/// Both ways in which an operator can type the bounds of a parameter.
pub fn range_example(parameter: &ParameterInfo) -> String {
    let [low, high] = [parameter.low, parameter.high].map(six_digits);
    format!("{} or {low},{high}", range(parameter))
}

/// Returns the tables of the session's study as lines of at most `width` characters, as `quadfrog report` prints them.
pub fn report(session: &SessionModel, width: usize) -> Vec<String> {
    let info = &session.info;
    let rows: Vec<TrialRecord> = session.trials.records.values().cloned().collect();
    let jumps = rows.iter().filter_map(|row| row.measured.as_ref()).map(|measured| measured.jumps.len()).max();
    let machine = if info.is_hardware() { "hardware" } else { "simulated" };
    let study = ReportedStudy {
        place: info.study.clone(),
        name: info.study.clone(),
        task: info.task,
        seed: u32::try_from(info.seed).ok(),
        robot: format!("{}, {machine}", info.robot),
        direction: Direction::Maximize,
        jumps: jumps.unwrap_or(1).max(1) as u32,
        f1_hz: 0.0,
        parameters: info.parameters.iter().filter_map(|parameter| session.parameter(&parameter.name)).collect(),
        confirmation: session.confirmation(),
        best: session.trials.best().map(|best| best.trial),
        other_gains_of_best: session
            .trials
            .best()
            .map_or(String::new(), |best| best.other_gains(&session.configured_gains())),
        fixed: Vec::new(),
        model_best: session.trials.model_best,
        limits: None,
        recordings: Recordings {
            overrides: session.overrides.clone(),
            operators: info.operator_in_words().into_iter().collect(),
            ..Recordings::default()
        },
        changed: Vec::new(),
        unit: info.unit.clone(),
        configuration: Vec::new(),
        rows,
    };
    text::render(&study_page::summary(&study), width).lines().map(str::to_owned).collect()
}

/// A trial as one line of text, for the clipboard.
pub fn as_text(trial: &TrialRecord, model: &Model) -> String {
    let mut text = format!("trial {}", trial.trial);
    for (name, value) in &trial.parameters {
        text.push_str(&format!("\t{name}={value}"));
    }
    let value = trial.value.map_or("-".to_owned(), |value| value.to_string());
    let verdict = trial.verdict_name().unwrap_or("-");
    let (unit, source, remark) = (&model.session.info.unit, trial.origin(), remark(trial));
    text + &format!("\tJ={value} {unit}\t{verdict}\t{source}\t{remark}")
}

/// The names of the exported columns and the rows, numbers written by `write`.
fn export_cells(model: &Model, rows: ExportedRows, write: fn(f64) -> String) -> (Vec<String>, Vec<Vec<String>>) {
    let mut names = vec!["trial".to_owned()];
    names.extend(model.session.info.parameters.iter().map(|info| info.name.clone()));
    let rest = ["value", "hand_value", "verdict", "judged_by", "suggested", "cause", "source", "parent", "attempt"];
    names.extend(rest.map(str::to_owned));
    names.extend(["dx_m", "dy_m", "dyaw_rad", "apex_m", "air_s", "note"].map(str::to_owned));
    names.extend(["flights", "touchdown_dx_m", "touchdown_dy_m", "touchdown_dyaw_rad", "jumps"].map(str::to_owned));
    let optional = |value: Option<f64>| value.map(write).unwrap_or_default();
    let row = |trial: &&TrialRecord| {
        let mut cells = vec![trial.trial.to_string()];
        cells.extend(model.session.info.parameters.iter().map(|info| optional(trial.parameters.get(&info.name))));
        cells.extend([
            optional(trial.value),
            optional(trial.hand_value),
            trial.verdict_name().unwrap_or("").to_owned(),
            trial.judged_by.map_or("", JudgedBy::name).to_owned(),
            trial.suggested.map_or("", Verdict::name).to_owned(),
            trial.cause.clone(),
            trial.source.name().to_owned(),
            trial.parent.map(|parent| parent.to_string()).unwrap_or_default(),
            model.session.trials.attempt(trial).to_string(),
        ]);
        let quantities = [Column::Dx, Column::Dy, Column::Yaw, Column::Rise, Column::Air];
        cells.extend(quantities.map(|column| optional(measured(trial, column))));
        cells.push(trial.note.clone());
        let measured = trial.measured.as_ref();
        let touchdown = measured.and_then(|m| m.touchdown);
        cells.push(measured.map(|m| m.flights.to_string()).unwrap_or_default());
        let along: [fn(Displacement) -> f64; 3] = [|at| at.dx_m, |at| at.dy_m, |at| at.dyaw_rad];
        cells.extend(along.map(|of| optional(touchdown.map(of))));
        // The rows as JSON; numbers always serialize.
        cells.push(measured.and_then(|m| serde_json::to_string(&m.jumps).ok()).unwrap_or_default());
        cells
    };
    let rows = match rows {
        ExportedRows::All => model.every_trial(),
        ExportedRows::Shown => model.trial_rows(),
    };
    (names, rows.iter().map(row).collect())
}

/// The table as comma-separated values (RFC 4180), numbers with all digits.
pub fn as_csv(model: &Model, rows: ExportedRows) -> String {
    let (names, rows) = export_cells(model, rows, |value| value.to_string());
    let quote = |cell: &String| {
        if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.clone() }
    };
    let line = |cells: &Vec<String>| cells.iter().map(quote).collect::<Vec<_>>().join(",") + "\r\n";
    std::iter::once(&names).chain(&rows).map(line).collect()
}

/// The table as a Markdown table, for reading: numbers with six digits, without the last column, which is JSON.
pub fn as_markdown(model: &Model, rows: ExportedRows) -> String {
    let (mut names, mut rows) = export_cells(model, rows, six_digits);
    for cells in rows.iter_mut().chain([&mut names]) {
        cells.pop();
    }
    let line = |cells: &Vec<String>| {
        let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|").replace('\n', " ")).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let ruler = format!("|{}\n", " --- |".repeat(names.len()));
    line(&names) + &ruler + &rows.iter().map(line).collect::<String>()
}
