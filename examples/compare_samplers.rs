//! Prints the table of `src/optimize/README.md`: mean best value after 20 and 50 trials on five functions of four
//! parameters, per sampler.
//!
//! `cargo run --release --example compare_samplers [SEEDS] [SAMPLER...]`

#[path = "../tests/support/optimize.rs"]
mod support;

use quadfrog::optimize::ask::{SamplerConfig, SamplerKind};
use quadfrog::optimize::study::Outcome;
use quadfrog::optimize::trial::{FALL, VERDICT};
use support::{in_memory, options, sideways};

/// -sum (u - c)^2
fn sphere(u: &[f64]) -> f64 {
    let centre = [0.35, 0.6, 0.4, 0.55];
    -u.iter().zip(centre).map(|(u, c)| (u - c) * (u - c)).sum::<f64>()
}

/// A curved crest along u4 = 0.3 + u1/2.
fn ridge(u: &[f64]) -> f64 {
    let (u1, u2, u3, u4) = (u[0], u[1], u[2], u[3]);
    let (a, b) = (u3 - 0.3, u4 - 0.3 - 0.5 * u1);
    (0.4 + u1) * (0.3 + u2) / (0.3 + u2 * u2 + 0.5 * a * a + 4.0 * b * b + 0.6 * u1 * u1)
}

/// Hartmann's four-dimensional function, maximized, as Picheny, Wagner and Ginsbourger scale it (2013).
fn hartmann(u: &[f64]) -> f64 {
    const ALPHA: [f64; 4] = [1.0, 1.2, 3.0, 3.2];
    const A: [[f64; 4]; 4] =
        [[10.0, 3.0, 17.0, 3.5], [0.05, 10.0, 17.0, 0.1], [3.0, 3.5, 1.7, 10.0], [17.0, 8.0, 0.05, 10.0]];
    const P: [[f64; 4]; 4] = [
        [0.1312, 0.1696, 0.5569, 0.0124],
        [0.2329, 0.4135, 0.8307, 0.3736],
        [0.2348, 0.1451, 0.3522, 0.2883],
        [0.4047, 0.8828, 0.8732, 0.5743],
    ];
    let bump = |i: usize| ALPHA[i] * (-(0..4).map(|j| A[i][j] * (u[j] - P[i][j]).powi(2)).sum::<f64>()).exp();
    ((0..4).map(bump).sum::<f64>() - 1.1) / 0.839
}

/// Values that rise with the push and drop to 0, a fall, beyond an edge; the best lies along the edge.
fn edge(u: &[f64]) -> f64 {
    let push = 1.2 * u[0] + u[1] - 0.3 * u[3];
    let detour = (u[2] - 0.5) * (u[2] - 0.5) + 0.5 * (u[3] - 0.6) * (u[3] - 0.6);
    if push > 1.1 { 0.0 } else { 0.2 + 0.5 * push - 0.4 * detour }
}

/// Values that are 0, a fall, outside a ball, and rise towards one side of the ball.
fn pocket(u: &[f64]) -> f64 {
    let centre = [0.55, 0.4, 0.5, 0.6];
    let distance: f64 = u.iter().zip(centre).map(|(u, c)| (u - c) * (u - c)).sum();
    if distance > 0.16 { 0.0 } else { 0.3 + 0.5 * u[0] + 0.3 * u[1] - 0.3 * (u[2] - 0.4) * (u[2] - 0.4) }
}

type Function = fn(&[f64]) -> f64;

/// Best values after 20 and after 50 trials, and falls among the first 20.
fn run(sampler: SamplerConfig, function: Function, falls: bool) -> [f64; 3] {
    let mut study = in_memory(options(sideways(), sampler));
    let mut best = [f64::NEG_INFINITY, f64::NEG_INFINITY, 0.0];
    for trial in 0..50 {
        let draft = study.draft();
        let number = study.begin(&draft, &[], &[]).expect("begins");
        let u: Vec<f64> = draft.parameters.iter().map(|s| s.range.scale(s.value)).collect();
        let value = function(&u);
        let fell = falls && value == 0.0;
        if fell {
            study.annotate(number, &[(VERDICT.into(), FALL.into())]).expect("running");
        }
        study.tell(number, Outcome::Complete(value)).expect("reported");
        best[1] = value.max(best[1]);
        if trial < 20 {
            best[0] = best[1];
            best[2] += f64::from(u8::from(fell));
        }
    }
    best
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let seeds: u32 = arguments.next().map_or(24, |a| a.parse().expect("the first argument is the number of seeds"));
    let wanted: Vec<String> = arguments.collect();
    let samplers = [
        ("tpe multivariate", SamplerConfig::default()),
        ("tpe univariate", SamplerConfig { multivariate: false, ..SamplerConfig::default() }),
    ];
    let others = [SamplerKind::Gp, SamplerKind::Random, SamplerKind::Sobol];
    let others = others.map(|kind| (kind.name(), SamplerConfig { kind, ..SamplerConfig::default() }));
    println!("Mean of {seeds} seeds: best at 20 / 50 trials (falls among the first 20)\n");
    println!("| | sphere | ridge | Hartmann-4 | edge | pocket |\n|---|---|---|---|---|---|");
    for (name, config) in
        samplers.iter().chain(&others).filter(|(n, _)| wanted.is_empty() || wanted.iter().any(|w| n.starts_with(w)))
    {
        let cell = |function: Function, falls: bool| {
            let seeded = |seed| SamplerConfig { seed, ..config.clone() };
            let runs: Vec<[f64; 3]> = (0..seeds).map(|seed| run(seeded(seed), function, falls)).collect();
            let mean = |i: usize| runs.iter().map(|r| r[i]).sum::<f64>() / f64::from(seeds);
            let fell = if falls { format!(" ({:.1})", mean(2)) } else { String::new() };
            format!("{:.4} / {:.5}{fell}", mean(0), mean(1))
        };
        let plain = [sphere as Function, ridge, hartmann].map(|f| cell(f, false)).join(" | ");
        println!("| {name} | {plain} | {} | {} |", cell(edge, true), cell(pocket, true));
    }
}
