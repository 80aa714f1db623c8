//! The table of an evaluation: a row per variant, and the falls below it.

use quadfrog::session::evaluation::EvaluatedRun;
use quadfrog::telemetry::TrialSpec;
use quadfrog::trial::{ParameterValues, counted, parameter_unit};

use super::variant::{Variant, on_off};

/// Returns the table as text. Jumps and tilt are those of all runs, the other columns those of the runs that stood.
pub fn table(spec: &TrialSpec, robot: &str, point: &ParameterValues, runs: &[(Variant, EvaluatedRun)]) -> String {
    let TrialSpec { task, jumps, rate, .. } = *spec;
    let values: Vec<String> =
        point.iter().map(|(name, value)| format!("{name} {value:.4} {}", parameter_unit(name))).collect();
    let mut text =
        format!("{} of the {robot}, {}, {}\n", task.name(), values.join(", "), counted(jumps as usize, "jump"));
    let with_friction = runs.iter().any(|(variant, _)| variant.friction.is_some());
    let friction = |text: &str| if with_friction { format!("{text:>8}  ") } else { String::new() };
    text += &format!(
        "vmc  {}runs  falls  {:>13}  {:>20}  {:>13}  {:>15}  {:>16}\n",
        friction("friction"),
        "jumps",
        format!("{}, {}", if rate { "value" } else { "value per jump" }, task.objective_unit(rate)),
        "tilt, rad",
        "roll range, rad",
        "pitch range, rad"
    );
    let mut variants: Vec<Variant> = Vec::new();
    for (variant, _) in runs {
        if !variants.contains(variant) {
            variants.push(*variant);
        }
    }
    for variant in variants {
        let all: Vec<&EvaluatedRun> = runs.iter().filter(|(of, _)| *of == variant).map(|(_, run)| run).collect();
        let stood: Vec<&EvaluatedRun> = all.iter().copied().filter(|run| run.stood()).collect();
        text += &format!(
            "{:<3}  {}{:>4}  {:>5}  {:>13}  {:>20}  {:>13}  {:>15}  {:>16}\n",
            on_off(variant.vmc),
            friction(&variant.friction.map_or_else(String::new, |friction| format!("{friction}"))),
            all.len(),
            all.len() - stood.len(),
            mean_and_spread(&all, 1, |run| f64::from(run.jumps)),
            mean_and_spread(&stood, 3, |run| run.value),
            mean_and_spread(&all, 3, |run| run.tilt_at_impulse_rad),
            mean_and_spread(&stood, 3, |run| run.roll_range_rad),
            mean_and_spread(&stood, 3, |run| run.pitch_range_rad),
        );
        for run in all.iter().filter(|run| !run.stood() || run.bounced()) {
            let time = run.fall_time_s.map_or(String::new(), |time| format!(" at {time:.2} s"));
            let EvaluatedRun { seed, cause, jumps, .. } = run;
            text += &format!("     seed {seed}: {cause}{time}, after {}\n", counted(*jumps as usize, "jump"));
        }
    }
    text += "Means, of several runs with standard deviations; value, roll and pitch of the runs that stood.\n";
    text += "Tilt: of the trunk when an impulse starts.\n";
    text
}

/// Returns "0.251 (0.012)", of a single run "0.251"; "-" without runs.
fn mean_and_spread(runs: &[&EvaluatedRun], digits: usize, value: fn(&EvaluatedRun) -> f64) -> String {
    if runs.is_empty() {
        return "-".to_owned();
    }
    let count = runs.len() as f64;
    let mean = runs.iter().map(|run| value(run)).sum::<f64>() / count;
    if runs.len() == 1 {
        return format!("{mean:.digits$}");
    }
    let squares = runs.iter().map(|run| (value(run) - mean).powi(2)).sum::<f64>();
    let spread = (squares / (count - 1.0)).sqrt();
    format!("{mean:.digits$} ({spread:.digits$})")
}
