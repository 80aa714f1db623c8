//! Figures of the experiments.

use std::f64::consts::TAU;

use quadfrog::optimize::ask::SamplerKind;
use quadfrog::report::figure::{Axis, FALL_STYLE, Figure, Panel, Series, thinned};
use quadfrog::robot::JOINT_NAMES;
use quadfrog::robot::description::RobotDescription;
use quadfrog::trial::{Task, Verdict};

use super::configuration::ExperimentConfiguration::{self, *};
use super::plan::{F1_HZ, PaperExperiment, RunPoint, THREE_TASKS};
use super::results::{ReproduceResults, RunResult, Sample, StudyResult, TrialTrace};

/// Pairs of points of a line, at most: a printed line is not wider.
const LINE_POINTS: usize = 90;

/// Returns the figures of a complete experiment.
pub fn figures(experiment: PaperExperiment, results: &ReproduceResults) -> Vec<Figure> {
    match experiment {
        PaperExperiment::Convergence => vec![convergence(results)],
        PaperExperiment::HardwareLike => vec![
            trials("hardware-like-forward", Task::Forward, ["Fx", "Fz", "f0"], results),
            trials("hardware-like-twist", Task::TwistCcw, ["Fy", "Fz", "f0"], results),
        ],
        PaperExperiment::HighTwist => vec![high_twist(results)],
        PaperExperiment::Continuous => vec![continuous(results)],
        PaperExperiment::RoughTerrain => rough_terrain(results).into_iter().collect(),
        PaperExperiment::Directions => directions(results).to_vec(),
        PaperExperiment::Transfer => vec![transfer(results)],
        PaperExperiment::Landing => vec![landing(results)],
    }
}

/// Returns (trial, mean, deviation) of the best so far over the studies, trials counted from 1.
fn best_so_far(studies: &[&StudyResult], trials: u32) -> Vec<[f64; 3]> {
    let curves: Vec<Vec<f64>> = studies.iter().map(|study| study.best_so_far(trials)).collect();
    let length = curves.iter().map(Vec::len).min().unwrap_or(0);
    let at = |trial: usize| {
        let sample = Sample::of(curves.iter().map(|curve| curve[trial]));
        let (mean, deviation) = sample.map_or((f64::NAN, f64::NAN), |sample| (sample.mean, sample.deviation));
        [trial as f64 + 1.0, mean, deviation]
    };
    (0..length).map(at).collect()
}

/// The paper's Fig. 5, with random search beside it.
pub fn convergence(results: &ReproduceResults) -> Figure {
    let trials = results.size.convergence_trials;
    let panel = |task: Task| {
        let mut panel = Panel::new(task.name(), Axis::new("Trial", ""), Axis::new("Best J so far", task.unit()));
        for (style, sampler, label) in [(0, SamplerKind::Tpe, "TPE"), (1, SamplerKind::Random, "random search")] {
            let studies = results.studies(Ideal, task, sampler);
            panel.series.push(Series::band(label, style, best_so_far(&studies, trials)));
        }
        panel
    };
    let caption = format!(
        "Best objective so far in the ideal simulation, mean and standard deviation of {} seeds (paper: Fig. 5).",
        results.size.studies
    );
    Figure::new("convergence", caption, 3, THREE_TASKS.map(panel))
}

/// The paper's Fig. 6 and 7: objective and parameters of each trial of one study.
fn trials(name: &str, task: Task, parameters: [&str; 3], results: &ReproduceResults) -> Figure {
    let studies = results.studies(HardwareLikeEstimate, task, SamplerKind::Tpe);
    let rows: Vec<_> = studies.first().map(|study| study.counted(results.size.trials).collect()).unwrap_or_default();
    let panel = |label: &str, unit: &str, value: &dyn Fn(&super::results::TrialResult) -> f64| {
        let mut panel = Panel::new("", Axis::new("Trial", ""), Axis::new(label, unit));
        for (style, label, verdict) in [(0, "stood", Verdict::Accept), (FALL_STYLE, "fell, J = 0", Verdict::Fall)] {
            let of = rows.iter().filter(|row| row.verdict == Some(verdict));
            panel.series.push(Series::points(label, style, of.map(|row| [f64::from(row.trial), value(row)])));
        }
        panel
    };
    let mut panels = vec![panel("J", task.unit(), &|row| row.value.unwrap_or(0.0))];
    for parameter in parameters {
        let unit = if parameter == "f0" { "Hz" } else { "N" };
        panels.push(panel(parameter, unit, &|row| row.param(parameter)));
    }
    let seed = studies.first().map_or(results.size.seed, |study| study.job.seed);
    let figure = if task == Task::Forward { "6" } else { "7" };
    let caption = format!(
        "{}: objective and parameters of each trial in the hardware-like simulation, state from the estimator, seed {seed} (paper, on the robot: Fig. {figure}).",
        task.name()
    );
    Figure::new(name, caption, 2, panels)
}

fn high_twist(results: &ReproduceResults) -> Figure {
    let trials = results.size.twist_trials;
    let studies = results.studies(HighTwist, Task::TwistCcw, SamplerKind::Tpe);
    let mut turn = Panel::new("", Axis::new("Trial", ""), Axis::new("Best J so far", "rad"));
    turn.series.push(Series::band("TPE", 0, best_so_far(&studies, trials)));
    turn.limit("paper", TAU);
    let mut rise = Panel::new("", Axis::new("Turn", "rad"), Axis::new("Rise", "m"));
    let stood =
        studies.iter().flat_map(|study| study.counted(trials)).filter(|row| row.verdict == Some(Verdict::Accept));
    rise.series.push(Series::points("trials that stood", 2, stood.map(|row| [row.value.unwrap_or(0.0), row.rise_m()])));
    rise.limit("paper", 0.67);
    Figure::new(
        "high-twist",
        "High twist: best turn so far (mean and deviation over the seeds), and rise over turn of every trial that stood (paper: over 2 pi rad, 0.67 m).",
        2,
        [turn, rise],
    )
}

fn continuous(results: &ReproduceResults) -> Figure {
    let at = |f1_hz: f64| {
        let point = RunPoint::FirstWithF1(f1_hz);
        results.runs_of(|job| job.configuration == ContinuousLow && job.point == point)
    };
    let stand_share =
        |runs: &[&RunResult]| runs.iter().filter(|run| !run.fell).count() as f64 / runs.len().max(1) as f64;
    let axis = || Axis::new("f1", "Hz");
    let mut distance = Panel::new("", axis(), Axis::new("Distance per jump", "m"));
    let mut tilt = Panel::new("", axis(), Axis::new("Tilt at impulse", "rad"));
    let mut share = Panel::new("", axis(), Axis::new("Runs that stand", "").within(-0.05, 1.05));
    let runs = || F1_HZ.iter().flat_map(|&f1_hz| at(f1_hz).into_iter().map(move |run| (f1_hz, run)));
    let stood = runs().filter(|(_, run)| !run.fell).map(|(f1_hz, run)| [f1_hz, run.value]);
    distance.series.push(Series::points("run that stands", 0, stood));
    for (style, label, fell) in [(0, "run that stands", false), (FALL_STYLE, "run that falls", true)] {
        let of = runs().filter(|(_, run)| run.fell == fell);
        let of = of.filter_map(|(f1_hz, run)| Some([f1_hz, run.tilt_at_impulse_rad?]));
        tilt.series.push(Series::points(label, style, of));
    }
    share.series.push(Series::points("share", 2, F1_HZ.map(|f1_hz| [f1_hz, stand_share(&at(f1_hz))])));
    let caption = "Five low jumps in a row forward at different frequencies between the impulses: distance per jump of the \
                   runs that stand after the last jump, mean tilt at the starts of the impulses, share of runs that stand.";
    Figure::new("continuous", caption, 3, [distance, tilt, share])
}

/// The paper's Fig. 9; none where no seed stands with Virtual Model Control and falls without.
pub fn rough_terrain(results: &ReproduceResults) -> Option<Figure> {
    let [with, without] = &results.traces[..] else { return None };
    let line = |trace: &TrialTrace, values: &[f64]| {
        let points: Vec<[f64; 2]> = trace.time_s.iter().zip(values).map(|(time, value)| [*time, *value]).collect();
        thinned(&points, LINE_POINTS)
    };
    let panel = |label: &str, unit: &str, of: &dyn Fn(&TrialTrace) -> Vec<f64>| {
        let mut panel = Panel::new("", Axis::new("Time", "s"), Axis::new(label, unit));
        panel.height = Some(160);
        panel.series.push(Series::line("with Virtual Model Control", 0, line(with, &of(with))));
        panel.series.push(Series::line("without", 1, line(without, &of(without))));
        panel
    };
    let mut panels = vec![
        panel("Roll", "rad", &|trace| trace.roll_rad.clone()),
        panel("Pitch", "rad", &|trace| trace.pitch_rad.clone()),
    ];
    for (leg, name) in ["FR", "FL", "RR", "RL"].iter().enumerate() {
        panels.push(panel(&format!("{name} foot z"), "m", &move |trace: &TrialTrace| trace.foot_z_m[leg].clone()));
    }
    let caption = format!(
        "Attitude and foot heights in the leg frames over blocks, terrain seed {}, with and without Virtual Model Control; the run without it ends with a fall (paper: Fig. 9).",
        with.job.seed
    );
    Some(Figure::new("rough-terrain", caption, 2, panels))
}

/// Take-off angles; powers and torques.
fn directions(results: &ReproduceResults) -> [Figure; 2] {
    let trials = results.size.side_trials;
    let bests = |configuration: ExperimentConfiguration, task| results.bests(configuration, task, trials);
    let names = Task::ALL.map(Task::name);
    let mut angle = Panel::new("", Axis::named("", names), Axis::new("Take-off angle", "degrees"));
    let mut power = Panel::new("", Axis::named("", names), Axis::new("Power", "W"));
    for (style, configuration, name) in [(0, Ideal, "ideal"), (1, HardwareLike, "hardware-like")] {
        let each = || {
            Task::ALL
                .iter()
                .enumerate()
                .flat_map(move |(at, &task)| bests(configuration, task).into_iter().map(move |best| (at as f64, best)))
        };
        let aside = 0.12 * (style as f64 - 0.5);
        angle.series.push(Series::points(
            format!("{name}, velocity"),
            style,
            each().filter_map(|(at, best)| Some([at + aside, best.effort?.takeoff_angle_rad.to_degrees()])),
        ));
        angle.series.push(Series::points(
            format!("{name}, force"),
            style + 2,
            each().map(|(at, best)| [at + aside, best.force_angle_rad().to_degrees()]),
        ));
        power.series.push(Series::points(
            format!("{name}, all joints"),
            style,
            each().filter_map(|(at, best)| Some([at + aside, best.effort?.peak_power_w])),
        ));
        power.series.push(Series::points(
            format!("{name}, one joint"),
            style + 2,
            each().filter_map(|(at, best)| Some([at + aside, best.effort?.joint_power_w])),
        ));
    }
    let limits = RobotDescription::embedded("go1").map(|robot| robot.limits.max_torque).unwrap_or_default();
    let torque = |joint: usize| {
        let mut panel = Panel::new(
            "",
            Axis::named("", names),
            Axis::new(format!("{} torque", JOINT_NAMES[joint]), "N m").within(0.0, 1.1 * limits[joint]),
        );
        for (style, configuration, name) in [(0, Ideal, "ideal"), (1, HardwareLike, "hardware-like")] {
            let points = Task::ALL.iter().enumerate().flat_map(|(at, &task)| {
                let aside = 0.12 * (style as f64 - 0.5);
                bests(configuration, task)
                    .into_iter()
                    .filter_map(move |best| Some([at as f64 + aside, best.effort?.peak_torque_n_m[joint]]))
            });
            panel.series.push(Series::points(name, style, points));
        }
        panel.limit("limit", limits[joint]);
        panel
    };
    let of = format!("best trial of each study of {trials} trials");
    let angles = format!("Take-off angles of velocity and force, {of}.");
    let efforts = format!("Largest power and largest torques, {of}.");
    [
        Figure::new("takeoff-angles", angles, 1, [angle]),
        Figure::new("motor-effort", efforts, 2, [power, torque(0), torque(1), torque(2)]),
    ]
}

fn transfer(results: &ReproduceResults) -> Figure {
    let trials = results.size.side_trials;
    let names = ["ideal", "ideal's point", "cold start", "warm start"];
    let panel = |task: Task| {
        let mut panel = Panel::new(task.name(), Axis::named("", names), Axis::new("J", task.unit()));
        let warm = results.studies_from(HardwareLike, task, SamplerKind::Tpe, Some(Ideal));
        let columns = [
            results.bests(Ideal, task, trials).iter().filter_map(|best| best.value).collect::<Vec<f64>>(),
            results.transferred(task).iter().map(|run| run.value).collect(),
            results.bests(HardwareLike, task, trials).iter().filter_map(|best| best.value).collect(),
            warm.iter().filter_map(|study| study.best(trials)?.value).collect(),
        ];
        for (at, values) in columns.iter().enumerate() {
            let label = if at == 0 { "best in the ideal simulation" } else { "in the hardware-like simulation" };
            panel.series.push(Series::points(
                label,
                usize::from(at > 0),
                values.iter().map(|value| [at as f64, *value]),
            ));
        }
        panel
    };
    let caption = format!(
        "Best of the ideal simulation, the same points in the hardware-like simulation over noise seeds (a fall is 0), and the best of studies of {trials} trials there with a cold start and with the ideal's best as first point."
    );
    Figure::new("transfer", caption, 1, THREE_TASKS.map(panel))
}

fn landing(results: &ReproduceResults) -> Figure {
    let trials = results.size.side_trials;
    let sets = [
        ("ideal", Ideal),
        ("ideal, added terms", StableLanding),
        ("estimator", HardwareLikeEstimate),
        ("estimator, added terms", StableLandingEstimate),
    ];
    let mut falls = Panel::new("", Axis::named("", sets.map(|(name, _)| name)), Axis::new("Falls per study", ""));
    let mut torque =
        Panel::new("", Axis::named("", sets.map(|(name, _)| name)), Axis::new("Thigh torque in landing", "N m"));
    for (style, task) in THREE_TASKS.into_iter().enumerate() {
        let aside = 0.12 * (style as f64 - 1.0);
        for (at, (_, configuration)) in sets.iter().enumerate() {
            let studies = results.studies(*configuration, task, SamplerKind::Tpe);
            let x = at as f64 + aside;
            falls.series.push(Series::points(
                task.name(),
                style,
                studies.iter().map(|study| [x, study.falls(trials) as f64]),
            ));
            let bests = results.bests(*configuration, task, trials);
            let points = bests.iter().filter_map(|best| Some([x, best.effort?.landing_torque_n_m[1]]));
            torque.series.push(Series::points(task.name(), style, points));
        }
    }
    let caption = format!(
        "Falls of each study of {trials} trials, and largest thigh torque after the flight of its best trial, without and with the added terms of examples/stable_landing."
    );
    Figure::new("landing", caption, 1, [falls, torque])
}
