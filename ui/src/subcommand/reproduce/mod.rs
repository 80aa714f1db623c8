//! `quadfrog reproduce`: the experiments of the paper, each beside the paper's sentence, in one report.

mod claims;
mod configuration;
mod figures;
mod page;
mod plan;
mod readme;
mod results;
mod schedule;
mod work;

use std::path::{Path, PathBuf};

use crate::{notice, output};
use clap::Args;
use quadfrog::report::page::Page;
use quadfrog::report::{html, svg, text};
use quadfrog::session::parallel::cores;

pub use self::configuration::{EXAMPLES, ExperimentConfiguration};
use self::plan::{ExperimentSize, PaperExperiment};
use self::results::ReproduceResults;
use super::arguments::whole_number;
use super::failure::Failure;
use super::output_file::{not_written, write_text};
pub use schedule::{minutes, seconds_left};

/// Name of the results in the output folder.
const RESULTS_FILE: &str = "results.json";
/// Width of the tables on the terminal, characters.
const WIDTH: usize = 120;

#[derive(Debug, Args)]
pub struct ReproduceArguments {
    /// Fewer trials and seeds: about a minute in place of ten on two cores
    #[arg(long)]
    quick: bool,
    /// Folder of report.html, results.json and the figures; it is created
    #[arg(long, value_name = "DIR", default_value = "reproduced")]
    output: PathBuf,
    /// Experiments to run, with commas [default: all]
    #[arg(long, value_name = "EXPERIMENT", value_delimiter = ',', value_enum)]
    only: Vec<PaperExperiment>,
    /// First seed: studies have this one and the next four, runs those from 100 above on. The examples name and were chosen on
    /// others
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = whole_number(0_u32..=u32::MAX - 1000))]
    seed: u32,
    /// Most trials of a study
    #[arg(long, value_name = "N", value_parser = whole_number(1_u32..=u32::MAX))]
    trials: Option<u32>,
    /// Threads; the results do not depend on it [default: the number of cores]
    #[arg(long, value_name = "N", value_parser = whole_number(1_u16..=u16::MAX))]
    jobs: Option<u16>,
    /// Make the report of these results and run nothing
    #[arg(long, value_name = "FILE", conflicts_with_all = ["quick", "only", "seed", "trials", "jobs"])]
    from: Option<PathBuf>,
    /// Also renew the table and figures of README.md and docs/ in this checkout
    #[arg(long, value_name = "DIR")]
    readme: Option<PathBuf>,
}

pub fn run(arguments: &ReproduceArguments) -> Result<(), Failure> {
    // Before minutes of work: a folder that cannot be written is an error of the input.
    let folder = &arguments.output;
    std::fs::create_dir_all(folder).map_err(|error| unusable(folder, &error))?;
    let file = folder.join(RESULTS_FILE);
    let permit = std::fs::OpenOptions::new().append(true).create(true).open(&file).and_then(|opened| opened.metadata());
    if permit.map_err(|error| unusable(&file, &error))?.len() == 0 {
        std::fs::remove_file(&file).map_err(|error| unusable(&file, &error))?;
    }
    if let Some(checkout) = &arguments.readme {
        readme::check(checkout)?;
    }
    let results = match &arguments.from {
        Some(from) => ReproduceResults::read(from).map_err(Failure::input)?,
        None => {
            let experiments = chosen(&arguments.only);
            let size = ExperimentSize::new(arguments.seed, arguments.quick);
            let size = arguments.trials.map_or(size, |trials| size.at_most(trials));
            let threads = arguments.jobs.map_or_else(cores, usize::from);
            schedule::run_experiments(&experiments, size, arguments.quick, threads, &file)?
        }
    };
    // Before the page: what took minutes is kept whatever comes of it.
    results.write(&file).map_err(|error| not_written(&file, &error))?;
    let page = page::page(&results);
    write(&page, folder)?;
    if let Some(checkout) = &arguments.readme {
        readme::renew(&results, checkout)?;
    }
    output::text(&text::render(&page, WIDTH));
    notice!("the report is {}", folder.join("report.html").display());
    Ok(())
}

/// Returns the experiments in the order of the report, each once; all if none is named.
fn chosen(only: &[PaperExperiment]) -> Vec<PaperExperiment> {
    let all = <PaperExperiment as clap::ValueEnum>::value_variants();
    all.iter().copied().filter(|experiment| only.is_empty() || only.contains(experiment)).collect()
}

fn write(page: &Page, folder: &Path) -> Result<(), Failure> {
    write_text(&folder.join("report.html"), &html::render(page))?;
    for figure in page.figures() {
        write_text(&folder.join(format!("{}.svg", figure.name)), &svg::draw(figure))?;
    }
    Ok(())
}

fn unusable(path: &Path, error: &std::io::Error) -> Failure {
    Failure::input(format!("--output: {}: cannot be written: {error}; give another folder", path.display()))
}
