//! The report: a summary, then each experiment with the paper's sentences, figures and tables.

use quadfrog::optimize::ask::SamplerKind;
use quadfrog::report::page::{Block, Cell, Column, Page, Section, Table};
use quadfrog::trial::Task;

use super::claims::{ClaimJudgement, PaperClaim, claims};
use super::configuration::ExperimentConfiguration::{self, *};
use super::figures::figures;
use super::plan::{ExperimentSize, PaperExperiment, THREE_TASKS};
use super::results::{ReproduceResults, RunResult, Sample, StudyResult};

/// Returns the report.
pub fn page(results: &ReproduceResults) -> Page {
    let claims = claims(results);
    let size = &results.size;
    let seeds = format!(
        "studies with seeds {} to {}, runs from seed {}",
        size.seed,
        // Results of a file may have any seed.
        size.seed.saturating_add(size.studies.saturating_sub(1)),
        size.seed.saturating_add(100)
    );
    let mut page = Page::new(
        "Quadruped-Frog reproduced in simulation",
        format!("quadfrog {}, {}, {seeds}", results.version, if results.quick { "quick size" } else { "whole size" }),
    );
    page.sections.push(summary(results, &claims));
    for experiment in &results.experiments {
        let of: Vec<&PaperClaim> = claims.iter().filter(|claim| claim.experiment == *experiment).collect();
        page.sections.push(section(*experiment, results, &of));
    }
    page.sections.push(configurations(results));
    page
}

fn summary(results: &ReproduceResults, claims: &[PaperClaim]) -> Section {
    let mut section = Section::new("Summary");
    section.paragraph(
        "Each row compares a statement of Bellegarda, Shafiee, Ozberk, Ijspeert, \"Quadruped-Frog: Rapid Online Optimization of \
         Continuous Quadruped Jumping\" (ICRA 2024) with figures that this command has computed on the built-in simulator of the \
         Unitree Go1. The judgement follows from the figures by the criterion that stands with the experiment. The stored source \
         of the paper has no curves; only numbers of its text and captions can be compared.",
    );
    section.paragraph(size_text(results));
    let count = |judgement| claims.iter().filter(|claim| claim.judgement == judgement).count();
    section.paragraph(format!(
        "{} statements: {} agree, {} do not agree, {} cannot be compared.",
        claims.len(),
        count(ClaimJudgement::Agrees),
        count(ClaimJudgement::Differs),
        count(ClaimJudgement::NotComparable)
    ));
    let columns = ["Quantity", "Paper", "Program", "Judgement"].map(Column::text);
    let mut table =
        Table::new("Statements of the paper and figures of the program; mean (range over the seeds).", columns);
    table.rows.extend(
        claims
            .iter()
            .map(|claim| [claim.name, claim.paper, &claim.ours, claim.judgement.text()].map(Cell::text).to_vec()),
    );
    section.blocks.push(Block::Table(table));
    section
}

/// Returns the numbers of seeds and trials as sentences.
pub fn size_text(results: &ReproduceResults) -> String {
    let ExperimentSize { seed, studies, convergence_trials, twist_trials, rough_runs, .. } = results.size;
    let text = format!(
        "{} size: {studies} seeds a study from {seed} on, {convergence_trials} trials for convergence, {twist_trials} for the high \
         twist, {rough_runs} runs over blocks.",
        if results.quick { "Quick" } else { "Whole" }
    );
    let fewer = " Criteria on all seeds or on long studies can come out otherwise than in the whole size.";
    if results.quick { text + fewer } else { text }
}

fn section(experiment: PaperExperiment, results: &ReproduceResults, claims: &[&PaperClaim]) -> Section {
    let mut section = Section::new(experiment.title());
    section.paragraph(method(experiment, &results.size));
    section.blocks.extend(figures(experiment, results).into_iter().map(Block::Figure));
    section.blocks.extend(tables(experiment, results).into_iter().map(Block::Table));
    for claim in claims {
        section.blocks.push(Block::Quote { text: claim.sentence.to_owned(), source: claim.place.to_owned() });
        section.paragraph(format!("Program, {}: {}. Judgement: {}.", claim.name, claim.ours, claim.reason()));
    }
    section
}

/// Returns what was run.
fn method(experiment: PaperExperiment, size: &ExperimentSize) -> String {
    let ExperimentSize {
        studies,
        trials,
        side_trials,
        convergence_trials,
        twist_trials,
        runs,
        rough_runs,
        noise_runs,
        ..
    } = *size;
    match experiment {
        PaperExperiment::Convergence => format!(
            "Forward, lateral-left and twist-ccw with the default configuration: {studies} studies each of {convergence_trials} trials with TPE and with uniform random search."
        ),
        PaperExperiment::HardwareLike => format!(
            "examples/hardware_like: torque limits that fall with speed, motor lag, joint friction, friction 0.6, sensor noise. {studies} studies of {trials} trials a task, with the simulator's true state and with the estimator's, as on a robot; the latter is drawn."
        ),
        PaperExperiment::HighTwist => {
            format!(
                "examples/high_twist: {studies} studies of {twist_trials} trials, counterclockwise, ideal simulation."
            )
        }
        PaperExperiment::Continuous => format!(
            "examples/continuous: its point over {runs} seeds of sensor noise. The lower jumps of examples/rough_terrain at other f1. The points of examples/continuous_fast and examples/continuous_twist over the same seeds. Jumps in a row to the left (f1 0.9 Hz): {studies} studies of {side_trials} trials, ideal simulation."
        ),
        PaperExperiment::RoughTerrain => format!(
            "examples/rough_terrain: its point for 12 s over {rough_runs} terrains of overlapping blocks 0.03 m thick, with the added terms of that example and with the paper's controller alone, each with and without Virtual Model Control."
        ),
        PaperExperiment::Directions => format!(
            "The five tasks with the default configuration and with examples/hardware_like: {studies} studies of {side_trials} trials each; values of the best trial of each study."
        ),
        PaperExperiment::Transfer => format!(
            "The best point of each ideal study of {side_trials} trials runs in the hardware-like simulation with {noise_runs} seeds of sensor noise; it is also the first point of a study there (warm start)."
        ),
        PaperExperiment::Landing => format!(
            "The paper's controller against examples/stable_landing (docs/method.md, \"Added terms\"): {studies} studies of {side_trials} trials a task."
        ),
    }
}

fn tables(experiment: PaperExperiment, results: &ReproduceResults) -> Vec<Table> {
    let size = &results.size;
    let (short, long) = (size.side_trials, size.convergence_trials);
    let sets = |configurations: &[ExperimentConfiguration], tasks: &[Task], trials| {
        let mut table = Table::new(
            format!("Best trial of each study of {trials} trials, means over the studies."),
            study_columns(),
        );
        for (&configuration, &task) in
            configurations.iter().flat_map(|configuration| tasks.iter().map(move |task| (configuration, task)))
        {
            table.rows.extend(study_row(
                configuration,
                task,
                &results.studies(configuration, task, SamplerKind::Tpe),
                trials,
            ));
        }
        table
    };
    match experiment {
        PaperExperiment::Convergence => vec![convergence_table(results, long)],
        PaperExperiment::HardwareLike => vec![sets(&[HardwareLike, HardwareLikeEstimate], &THREE_TASKS, size.trials)],
        PaperExperiment::HighTwist => vec![sets(&[HighTwist], &[Task::TwistCcw], size.twist_trials)],
        PaperExperiment::Directions => vec![sets(&[Ideal, HardwareLike], &Task::ALL, short)],
        PaperExperiment::Continuous => vec![
            run_table(results, "Five jumps in a row.", |run| {
                let f1_hz = run.params.get("f1").unwrap_or(f64::NAN);
                let name = match run.job.configuration {
                    Continuous => "point of examples/continuous",
                    ContinuousLow => "low jumps",
                    ContinuousFast => "examples/continuous_fast, J per s",
                    ContinuousTwist => "examples/continuous_twist",
                    _ => return None,
                };
                Some(format!("{name}, f1 {f1_hz:.2} Hz"))
            }),
            sets(&[ContinuousLateral], &[Task::LateralLeft], short),
        ],
        PaperExperiment::RoughTerrain => vec![run_table(results, "Runs of 12 s.", |run| {
            let vmc = match run.job.vmc? {
                true => "with VMC",
                false => "without VMC",
            };
            Some(format!("{}, {vmc}", run.job.configuration.name()))
        })],
        PaperExperiment::Transfer => {
            vec![run_table(results, "Best points of the ideal simulation in the hardware-like one.", |run| {
                matches!(run.job.point, super::plan::RunPoint::BestOf(..)).then(|| run.job.task.name().to_owned())
            })]
        }
        PaperExperiment::Landing => {
            vec![sets(&[Ideal, StableLanding, HardwareLikeEstimate, StableLandingEstimate], &THREE_TASKS, short)]
        }
    }
}

fn convergence_table(results: &ReproduceResults, trials: u32) -> Table {
    let at: Vec<u32> = [5, 10, 20, 50, 100].into_iter().filter(|at| *at <= trials).collect();
    let mut columns = vec![Column::text("Task"), Column::text("Sampler")];
    columns.extend(at.iter().map(|at| Column::text(format!("J after {at}"))));
    columns.push(Column::number("Falls per study", ""));
    let mut table = Table::new(
        "Best objective so far (m; rad for the twist), mean and standard deviation over the seeds.",
        columns,
    );
    for (task, sampler) in
        THREE_TASKS.iter().flat_map(|&task| [SamplerKind::Tpe, SamplerKind::Random].map(|sampler| (task, sampler)))
    {
        let studies = results.studies(Ideal, task, sampler);
        let mut row = vec![Cell::text(task.name()), Cell::text(sampler.name())];
        row.extend(at.iter().map(|&at| {
            let sample = Sample::of(studies.iter().filter_map(|study| study.best_so_far(at).last().copied()));
            sample.map_or(Cell::Missing, |sample| Cell::text(format!("{:.3} +- {:.3}", sample.mean, sample.deviation)))
        }));
        row.push(Cell::optional(
            Sample::of(studies.iter().map(|study| study.falls(trials) as f64)).map(|sample| sample.mean),
            1,
        ));
        table.rows.push(row);
    }
    table
}

fn study_columns() -> Vec<Column> {
    let mut columns = vec![Column::text("Configuration"), Column::text("Task")];
    columns.extend(["J", "Deviation"].map(|name| Column::number(name, "m or rad")));
    columns.extend(
        [("Rise", "m"), ("Air", "s"), ("Angle of v", "degrees"), ("Angle of F", "degrees")]
            .map(|(name, unit)| Column::number(name, unit)),
    );
    columns.extend(
        [("Hip", "N m"), ("Thigh", "N m"), ("Calf", "N m"), ("Power", "W"), ("Falls per study", "")]
            .map(|(name, unit)| Column::number(name, unit)),
    );
    columns
}

fn study_row(
    configuration: ExperimentConfiguration,
    task: Task,
    studies: &[&StudyResult],
    trials: u32,
) -> Option<Vec<Cell>> {
    let bests: Vec<_> = studies.iter().filter_map(|study| study.best(trials)).collect();
    let value = Sample::of(bests.iter().filter_map(|best| best.value))?;
    let mean = |values: Vec<f64>, digits| Cell::optional(Sample::of(values).map(|sample| sample.mean), digits);
    let measured = |of: &dyn Fn(&quadfrog::trial::MeasuredJump) -> f64| {
        bests.iter().filter_map(|best| best.measured.as_ref()).map(of).collect::<Vec<_>>()
    };
    let effort = |of: &dyn Fn(&quadfrog::session::effort::JumpEffort) -> f64| {
        bests.iter().filter_map(|best| best.effort.as_ref()).map(of).collect::<Vec<_>>()
    };
    Some(vec![
        Cell::text(configuration.name()),
        Cell::text(task.name()),
        Cell::number(value.mean, 3),
        Cell::number(value.deviation, 3),
        mean(measured(&|measured| measured.apex_m), 3),
        mean(measured(&|measured| measured.air_s), 3),
        mean(effort(&|effort| effort.takeoff_angle_rad.to_degrees()), 0),
        mean(bests.iter().map(|best| best.force_angle_rad().to_degrees()).collect(), 0),
        mean(effort(&|effort| effort.peak_torque_n_m[0]), 1),
        mean(effort(&|effort| effort.peak_torque_n_m[1]), 1),
        mean(effort(&|effort| effort.peak_torque_n_m[2]), 1),
        mean(effort(&|effort| effort.peak_power_w), 0),
        mean(studies.iter().map(|study| study.falls(trials) as f64).collect(), 1),
    ])
}

/// Returns a row for each group of runs, in the order of the runs.
fn run_table(results: &ReproduceResults, caption: &str, group: impl Fn(&RunResult) -> Option<String>) -> Table {
    let mut columns = vec![Column::text("Runs")];
    columns.extend(
        [
            ("Number", ""),
            ("Falls", ""),
            ("Jumps", ""),
            ("J per jump", "m or rad"),
            ("Speed", "per s"),
            ("Tilt at impulse", "rad"),
            ("Roll range", "rad"),
            ("Pitch range", "rad"),
        ]
        .map(|(name, unit)| Column::number(name, unit)),
    );
    let mut groups: Vec<(String, Vec<&RunResult>)> = Vec::new();
    for run in &results.runs {
        let Some(name) = group(run) else { continue };
        match groups.iter_mut().find(|(known, _)| *known == name) {
            Some((_, runs)) => runs.push(run),
            None => groups.push((name, vec![run])),
        }
    }
    let mut table =
        Table::new(format!("{caption} Values, speed and ranges are means of the runs that stand."), columns);
    for (name, runs) in groups {
        let stood: Vec<_> = runs.iter().filter(|run| !run.fell).collect();
        let mean_of = |values: &mut dyn Iterator<Item = f64>| Sample::of(values).map(|sample| sample.mean);
        let mean = |of: &dyn Fn(&RunResult) -> f64| Cell::optional(mean_of(&mut stood.iter().map(|run| of(run))), 3);
        table.rows.push(vec![
            Cell::text(name),
            Cell::count(runs.len()),
            Cell::count(runs.len() - stood.len()),
            Cell::optional(mean_of(&mut runs.iter().map(|run| f64::from(run.jumps))), 1),
            mean(&|run| run.value),
            mean(&|run| run.period_s.map_or(f64::NAN, |period_s| run.value / period_s)),
            Cell::optional(mean_of(&mut runs.iter().filter_map(|run| run.tilt_at_impulse_rad)), 3),
            mean(&|run| run.roll_range_rad),
            mean(&|run| run.pitch_range_rad),
        ]);
    }
    table
}

/// The configurations that ran, as keys that differ from the defaults. Its blocks are all folded: a page as text leaves it out.
fn configurations(results: &ReproduceResults) -> Section {
    let mut used: Vec<ExperimentConfiguration> = results.studies.iter().map(|study| study.job.configuration).collect();
    used.extend(results.runs.iter().map(|run| run.job.configuration));
    used.sort();
    used.dedup();
    let mut section =
        Section::new("Configurations: keys that differ from the defaults of config/, in the order of their files");
    for configuration in used {
        let text: Vec<String> = configuration.files().map(|(path, text)| format!("# {path}\n{text}")).collect();
        let text = if text.is_empty() { "# the defaults\n".to_owned() } else { text.join("\n") };
        section.blocks.push(Block::Folded { summary: configuration.name().to_owned(), text });
    }
    section
}
