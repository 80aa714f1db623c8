//! The trial table as CSV, attached to a finished recording.

use std::collections::BTreeMap;

use crate::trial::{JudgedBy, TrialRecord, Verdict};

/// Name of the attachment.
pub const NAME: &str = "trials.csv";

/// Log times of the first and the last tick of a trial, ns since 1970.
pub type TrialSpan = (u64, u64);

/// Returns the newest row of each trial: one line a trial, numbers as text that reads back bit for bit, empty where there is none.
pub fn csv(rows: &BTreeMap<u32, TrialRecord>, spans: &BTreeMap<u32, TrialSpan>) -> Vec<u8> {
    let mut parameters: Vec<&str> = Vec::new();
    for (name, _) in rows.values().flat_map(|row| row.parameters.iter()) {
        if !parameters.contains(&name.as_str()) {
            parameters.push(name);
        }
    }
    let mut table = csv::Writer::from_writer(Vec::new());
    let verdict = ["verdict", "judged_by", "cause", "value", "hand_value"];
    let measured = ["dx_m", "dy_m", "dyaw_rad", "rise_m", "air_s", "note"];
    let head = ["trial", "source", "parent"].iter().chain(&verdict).chain(&["seed", "start_ns", "end_ns"]);
    let head = head.chain(&parameters).chain(&measured);
    // A Vec takes every line.
    let _ = table.write_record(head);
    for row in rows.values() {
        let span = spans.get(&row.trial);
        let whole = |value: Option<u64>| value.map_or_else(String::new, |value| value.to_string());
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        let mut line = vec![
            row.trial.to_string(),
            row.source.name().to_owned(),
            whole(row.parent.map(u64::from)),
            row.verdict.map_or("", Verdict::name).to_owned(),
            row.judged_by.map_or("", JudgedBy::name).to_owned(),
            row.cause.clone(),
            number(row.value),
            number(row.hand_value),
            whole(row.seed),
            whole(span.map(|(start, _)| *start)),
            whole(span.map(|(_, end)| *end)),
        ];
        line.extend(parameters.iter().map(|name| number(row.parameters.get(name))));
        let m = row.measured.as_ref();
        line.extend([
            number(m.map(|m| m.dx_m)),
            number(m.map(|m| m.dy_m)),
            number(m.map(|m| m.dyaw_rad)),
            number(m.map(|m| m.apex_m)),
            number(m.map(|m| m.air_s)),
            row.note.clone(),
        ]);
        let _ = table.write_record(line);
    }
    table.into_inner().unwrap_or_default()
}
