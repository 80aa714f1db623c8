//! The table of an evaluation: a row per variant, and below it the falls and the runs that did not begin.

use quadfrog::session::evaluation::EvaluatedRun;
use quadfrog::telemetry::TrialSpec;
use quadfrog::trial::{ParameterValues, counted, parameter_unit};

use super::variant::{Variant, on_off};

/// Returns the table as text. Jumps are those of all runs, the tilt is that of the runs with an impulse, the other columns those of
/// the runs that stood.
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
            all.iter().filter(|run| run.fell()).count(),
            mean_and_spread(all.iter().map(|run| f64::from(run.jumps)), 1),
            mean_and_spread(stood.iter().map(|run| run.value), 3),
            mean_and_spread(all.iter().filter_map(|run| run.tilt_at_impulse_rad), 3),
            mean_and_spread(stood.iter().map(|run| run.roll_range_rad), 3),
            mean_and_spread(stood.iter().map(|run| run.pitch_range_rad), 3),
        );
        for run in all.iter().filter(|run| !run.stood() || run.bounced()) {
            let time = run.fall_time_s.map_or(String::new(), |time| format!(" at {time:.2} s"));
            let EvaluatedRun { seed, cause, jumps, .. } = run;
            let after =
                if run.begun() { format!(", after {}", counted(*jumps as usize, "jump")) } else { String::new() };
            text += &format!("     seed {seed}: {cause}{time}{after}\n");
        }
        let not_begun = all.iter().filter(|run| !run.begun()).count();
        if not_begun > 0 {
            text += &format!("     not begun, no falls: {}\n", counted(not_begun, "run"));
        }
    }
    text += "Means, of several runs with standard deviations; value, roll and pitch of the runs that stood.\n";
    text += "Tilt: of the trunk when an impulse starts, of the runs with an impulse.\n";
    text
}

/// Returns "0.251 (0.012)", of a single value "0.251"; "-" without values.
fn mean_and_spread(values: impl Iterator<Item = f64>, digits: usize) -> String {
    let values: Vec<f64> = values.collect();
    if values.is_empty() {
        return "-".to_owned();
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    if values.len() == 1 {
        return format!("{mean:.digits$}");
    }
    let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    let spread = (squares / (count - 1.0)).sqrt();
    format!("{mean:.digits$} ({spread:.digits$})")
}
