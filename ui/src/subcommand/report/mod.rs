//! `quadfrog report`: studies as a page, as tables on the terminal, as JSON and as figures.

mod load;
mod write;

use std::io::IsTerminal;
use std::path::PathBuf;

use crate::{notice, output};
use clap::Args;
use clap_complete::ArgValueCandidates;
use quadfrog::report::study::TrialChoice;
use quadfrog::report::{html, study_page, svg, text};

use super::arguments::VERSION;
use super::completion;
use super::failure::Failure;
use super::output_file::write_text;
pub use load::load;
use write::{figure_files, require_page};

/// Width of tables where the output is no terminal, characters.
const WIDTH: usize = 80;

#[derive(Debug, Args)]
pub struct ReportArguments {
    /// Folders of studies, folders that hold them, study.log files, Optuna journals, or redis://HOST:PORT/DB
    #[arg(value_name = "STUDY", required = true, add = ArgValueCandidates::new(completion::studies))]
    places: Vec<String>,
    /// Write one HTML file with tables and figures that opens without a network
    #[arg(long, short, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Write each figure as an SVG file into this folder
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    /// Print the report as one JSON object, numbers unrounded, with the points of the figures
    #[arg(long)]
    json: bool,
    /// Trials whose ticks are drawn: best, first, last, last-fall or numbers, separated by commas
    #[arg(long, value_name = "WHICH", value_delimiter = ',', default_value = "best,first,last-fall", value_parser = choice)]
    trials: Vec<TrialChoice>,
}

fn choice(text: &str) -> Result<TrialChoice, String> {
    match text {
        "best" => Ok(TrialChoice::Best),
        "first" => Ok(TrialChoice::First),
        "last" => Ok(TrialChoice::Last),
        "last-fall" => Ok(TrialChoice::LastFall),
        number => {
            let number = number.parse().map(TrialChoice::Number);
            number.map_err(|_| "give best, first, last, last-fall or the number of a trial".to_owned())
        }
    }
}

pub fn run(arguments: &ReportArguments) -> Result<(), Failure> {
    if let Some(file) = &arguments.output {
        require_page(file)?;
    }
    let mut studies = Vec::new();
    for place in &arguments.places {
        studies.extend(load(place)?);
    }
    for choice in &arguments.trials {
        if let TrialChoice::Number(number) = choice
            && !studies.iter().any(|study| study.row(*number).is_some())
        {
            let last = studies.iter().filter_map(|study| study.rows.last()).map(|row| row.trial).max();
            let last = last.map_or("there is none".to_owned(), |last| format!("the last one is {last}"));
            let message = format!("--trials {number}: no such trial has begun; {last}");
            return Err(Failure::input(message));
        }
    }
    let page = study_page::page(&studies, &arguments.trials, VERSION);
    // Before the page is written: where a figure is refused nothing is.
    let figures = arguments.figures.as_deref().map(|folder| figure_files(folder, &page)).transpose()?;
    if let Some(file) = &arguments.output {
        write_text(file, &html::render(&page))?;
        notice!("report: {}", file.display());
    }
    if let (Some(folder), Some(figures)) = (&arguments.figures, &figures) {
        for (file, figure) in figures {
            write_text(file, &svg::draw(figure))?;
        }
        notice!("{} figures: {}", figures.len(), folder.display());
    }
    if arguments.json {
        output::line(&page.to_json().to_string());
    } else if arguments.output.is_none() {
        output::text(&text::render(&page, width()));
    }
    Ok(())
}

/// Width of the terminal, at least 80; 80 for other outputs.
fn width() -> usize {
    let terminal = std::io::stdout().is_terminal().then(crossterm::terminal::size);
    terminal.and_then(Result::ok).map_or(WIDTH, |(columns, _)| usize::from(columns).max(WIDTH))
}
