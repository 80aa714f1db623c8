//! `quadfrog rejudge`: estimate, fall detection and objective of another configuration on recorded ticks: the recorded suggestion
//! beside the new one, and the verdict in force.

use std::path::PathBuf;

use crate::{notice, put_line};
use clap::Args;
use quadfrog::engine::{EstimateChange, RejudgeError, RejudgedTrial, Rejudging, changes_in_words, config_for_recorded};
use quadfrog::recording::session_files::recordings_of;
use quadfrog::session::rejudge::Judgement;
use quadfrog::trial::Verdict;
use serde_json::{Value, json};

use super::arguments;
use super::damage::{require_whole, without_present_ends};
use super::failure::Failure;
use super::replay::is_written;

#[derive(Debug, Args)]
pub struct RejudgeArguments {
    /// Recordings (session.mcap) or the folder of a study; they are not changed
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Folder with the configuration to judge by, for example examples/hardware_like or a study's config [default:
    /// ~/.config/quadfrog if it exists, else the built-in values]
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// Print one JSON object per trial instead of the table
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &RejudgeArguments) -> Result<(), Failure> {
    let folder = arguments::given_or_user(arguments.config.as_deref())?;
    let mut files = Vec::new();
    for path in &arguments.files {
        files.extend(recordings_of(path)?);
    }
    let written: Vec<PathBuf> = files.iter().filter(|file| is_written(file)).cloned().collect();
    let refuse = |error| match error {
        RejudgeError::Recording(error) => error.into(),
        error => Failure::input(error),
    };
    let config = config_for_recorded(&files, folder.as_deref()).map_err(refuse)?;
    let mut rejudging = Rejudging::open(&files, &config).map_err(refuse)?;
    let mut results: Vec<RejudgedTrial> = Vec::new();
    for result in rejudging.by_ref() {
        // Of several runs of a trial the last one has the row.
        results.retain(|known| known.trial != result.trial);
        results.push(result);
    }
    if arguments.json {
        results.iter().for_each(|result| put_line!("{}", json_of(result)));
    } else {
        print(&results, rejudging.unit());
    }
    let lost_before = rejudging.lost_before_recovery();
    for file in &written {
        notice!("{}: a session still writes it; the trials that have ended are judged", file.display());
    }
    let mut damage = rejudging.damage();
    without_present_ends(&mut damage, &written, &rejudging.cuts());
    require_whole(&damage, lost_before, "a trial of which ticks are missing there has no new judgement")
}

fn name(verdict: Option<Verdict>) -> &'static str {
    verdict.map_or("?", Verdict::name)
}

fn print(results: &[RejudgedTrial], unit: &str) {
    put_line!(
        "{:>5}  {:<7}  {:>10}  {:<9}  {:>10}  {:<9}  {:>11}  cause",
        "trial",
        "verdict",
        "old J",
        "suggested",
        "new J",
        "suggested",
        "difference"
    );
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
    for result in results {
        let RejudgedTrial { trial, judged, old, new, .. } = result;
        let difference = result.difference().map_or("-".to_owned(), |difference| format!("{difference:+.4}"));
        let (old_value, new_value) = (number(old.value), number(new.value));
        let [verdict, old_name, new_name] = [*judged, old.verdict, new.verdict].map(name);
        let cause = &new.cause;
        put_line!(
            "{trial:>5}  {verdict:<7}  {old_value:>10}  {old_name:<9}  {new_value:>10}  {new_name:<9}  {difference:>11}  {cause}"
        );
    }
    let metres = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4} m"));
    for RejudgedTrial { trial, estimate, .. } in results {
        let Some(EstimateChange { distance_m, old_error_m, new_error_m }) = estimate else { continue };
        let (old, new) = (metres(*old_error_m), metres(*new_error_m));
        put_line!(
            "trial {trial}: the estimate is recomputed, at most {distance_m:.4} m from the recorded one; error at the end {old}, now {new}"
        );
    }
    put_line!(
        "{}; verdicts are those in force. J in {unit}, as measured; a fall counts as 0.",
        changes_in_words(results.iter())
    );
}

fn json_of(result: &RejudgedTrial) -> Value {
    let judgement = |judgement: &Judgement| {
        json!({
            "value": judgement.value,
            "verdict": judgement.verdict.map(Verdict::name),
            "cause": judgement.cause,
            "measured": judgement.measured,
        })
    };
    let RejudgedTrial { trial, judged, old, new, estimate } = result;
    let estimate = estimate.map(|change| {
        let EstimateChange { distance_m, old_error_m, new_error_m } = change;
        json!({ "distance_m": distance_m, "old_error_m": old_error_m, "new_error_m": new_error_m })
    });
    let difference = result.difference();
    json!({
        "trial": trial,
        "verdict": judged.map(Verdict::name),
        "old": judgement(old),
        "new": judgement(new),
        "difference": difference,
        "estimate": estimate,
    })
}
