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
use super::failure::{Failure, not_written};
use super::output_file::{require_own, require_writable, write_text};

/// Name of the results in the output folder.
const RESULTS_FILE: &str = "results.json";
/// Name of the results of an interrupted run, beside those of a complete one.
const INTERRUPTED_FILE: &str = "results.interrupted.json";
/// Name of the report in the output folder.
const REPORT_FILE: &str = "report.html";
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
    #[arg(long, value_name = "DIR", conflicts_with = "only")]
    readme: Option<PathBuf>,
}

pub fn run(arguments: &ReproduceArguments) -> Result<(), Failure> {
    // Before minutes of work: what cannot be read or written is an error of the input.
    let given = arguments.from.as_deref().map(ReproduceResults::read).transpose().map_err(Failure::input)?;
    if let Some(checkout) = &arguments.readme {
        readme::check(checkout, given.as_ref())?;
    }
    let folder = &arguments.output;
    let file = folder.join(RESULTS_FILE);
    require_replaceable(folder)?;
    require_writable(&file, "give another folder by --output")?;
    let results = match given {
        Some(results) => results,
        None => {
            let experiments = chosen(&arguments.only);
            let size = ExperimentSize::new(arguments.seed, arguments.quick);
            let size = arguments.trials.map_or(size, |trials| size.at_most(trials));
            let threads = arguments.jobs.map_or_else(cores, usize::from);
            schedule::run_experiments(&experiments, size, arguments.quick, threads, &folder.join(INTERRUPTED_FILE))?
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
    notice!("the report is {}", folder.join(REPORT_FILE).display());
    Ok(())
}

/// Returns the experiments in the order of the report, each once; all if none is named.
fn chosen(only: &[PaperExperiment]) -> Vec<PaperExperiment> {
    let all = <PaperExperiment as clap::ValueEnum>::value_variants();
    all.iter().copied().filter(|experiment| only.is_empty() || only.contains(experiment)).collect()
}

fn write(page: &Page, folder: &Path) -> Result<(), Failure> {
    write_text(&folder.join(REPORT_FILE), &html::render(page))?;
    for figure in page.figures() {
        write_text(&folder.join(format!("{}.svg", figure.name)), &svg::draw(figure))?;
    }
    Ok(())
}

/// Refuses an output folder with a page, results or a figure that are not of this program: they may be replaced.
fn require_replaceable(folder: &Path) -> Result<(), Failure> {
    let Ok(entries) = folder.read_dir() else { return Ok(()) };
    for file in entries.flatten().map(|entry| entry.path()) {
        let name = file.file_name().unwrap_or_default();
        if name == REPORT_FILE {
            require_own("--output", &file, html::is_report)?;
        } else if name == RESULTS_FILE || name == INTERRUPTED_FILE {
            require_own("--output", &file, results::is_results)?;
        } else if file.extension().is_some_and(|extension| extension == "svg") {
            require_own("--output", &file, svg::is_figure)?;
        }
    }
    Ok(())
}
