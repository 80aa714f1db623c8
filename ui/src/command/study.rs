//! `quadfrog study`: studies as they lie on disk or on a server, ours and those of other Optuna programs.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use color_eyre::eyre::{WrapErr, eyre};
use quadfrog::config::Config;
use quadfrog::engine::{Opened, newest_config, open_stored, stored_studies, study_files};
use quadfrog::optimize::exchange::{self, TableTrial};
use quadfrog::optimize::repeats;
use quadfrog::optimize::study::Storage;
use quadfrog::optimize::trial::{Trial, TrialState};
use quadfrog::report::table;
use quadfrog::session::experiment;
use quadfrog::session::experiment::rows_of;
use quadfrog::trial::TrialRecord;

use super::Failure;
use super::chosen::journal;

#[derive(Debug, Args)]
pub struct StudyCommand {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// All studies below a folder: task, trials, falls, best
    List {
        /// The folder
        #[arg(value_name = "DIR", default_value = "recordings")]
        folder: PathBuf,
    },
    /// One study: its table and what it was made with
    Show {
        #[command(flatten)]
        which: Which,
    },
    /// All trials as a table, with the columns of Optuna's trials_dataframe
    Export {
        #[command(flatten)]
        which: Which,
        /// The form of the table [default: by the name of the file, else csv]
        #[arg(long, value_name = "FORM")]
        format: Option<Format>,
        /// Where it goes [default: standard output]
        #[arg(long, short, value_name = "FILE")]
        output: Option<PathBuf>,
    },
    /// Trials of a table, as this program or Optuna's trials_dataframe wrote it, join a study as finished ones
    Import {
        #[command(flatten)]
        which: Which,
        /// The table
        #[arg(value_name = "FILE")]
        table: PathBuf,
        /// The form of the table [default: by the name of the file, else csv]
        #[arg(long, value_name = "FORM")]
        format: Option<Format>,
        /// Queue the points to be run instead; their results are left out
        #[arg(long)]
        queue: bool,
    },
    /// The best trial
    Best {
        #[command(flatten)]
        which: Which,
        /// Write a configuration into this folder whose next study begins with it: quadfrog --config DIR
        #[arg(long, value_name = "DIR")]
        config: Option<PathBuf>,
    },
    /// Queue a point: it is proposed next, also by a session that is running
    Enqueue {
        #[command(flatten)]
        which: Which,
        /// Parameters; those left out are proposed when it is its turn
        #[arg(value_name = "PARAM=VALUE", required = true, value_parser = parse_setting)]
        point: Vec<(String, f64)>,
    },
}

/// Which study.
#[derive(Debug, Args)]
struct Which {
    /// A study's folder, its study.log, any Optuna journal, or redis://HOST:PORT/DB
    #[arg(value_name = "STUDY")]
    study: String,
    /// Its name, where the journal holds several
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
}

/// The form of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Csv,
    Json,
}

impl Format {
    /// As given, else by the file's name.
    fn of(given: Option<Format>, file: Option<&Path>) -> Format {
        let json = file.is_some_and(|file| file.extension().is_some_and(|extension| extension == "json"));
        given.unwrap_or(if json { Format::Json } else { Format::Csv })
    }
}

fn parse_setting(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("write it as Fx=120")?;
    let number =
        value.trim().parse::<f64>().map_err(|_| format!("`{value}` is not a number; write it as {name}=120"))?;
    Ok((name.trim().to_owned(), number))
}

pub fn run(command: &StudyCommand) -> Result<(), Failure> {
    match &command.what {
        What::List { folder } => list(folder),
        What::Show { which } => show(which),
        What::Export { which, format, output } => export(which, *format, output.as_deref()),
        What::Import { which, table, format, queue } => import(which, table, *format, *queue),
        What::Best { which, config } => best(which, config.as_deref()),
        What::Enqueue { which, point } => enqueue(which, point),
    }
}

impl Which {
    /// The configuration that the study ran with last, where its folder has kept it.
    fn config(&self) -> Result<Config, Failure> {
        let own = match journal(&self.study) {
            Storage::File(file) => file.parent().and_then(newest_config),
            _ => None,
        };
        Ok(Config::load(own.as_ref().map(|(_, config)| config.as_path()))?)
    }

    fn open(&self) -> Result<Opened, Failure> {
        Ok(open_stored(&journal(&self.study), self.name.as_deref(), &self.config()?)?)
    }
}

/// Text on standard output; a reader that has gone away (`| head`) wants no more.
fn say(text: &str) -> Result<(), Failure> {
    let mut output = std::io::stdout();
    match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::Other(eyre!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}

fn list(folder: &Path) -> Result<(), Failure> {
    let files = study_files(folder)
        .map_err(|error| Failure::input(format!("{}: {error}; give a folder that holds studies", folder.display())))?;
    if files.is_empty() {
        return say(&format!("There is no study in {}\n", folder.display()));
    }
    let mut rows = vec![["study", "task", "seed", "trials", "counted", "falls", "best"].map(str::to_owned)];
    for file in &files {
        let place = file.parent().unwrap_or(file).display().to_string();
        // One study that cannot be read does not hide the others.
        match stored_studies(&Storage::File(file.clone())) {
            Err(error) => eprintln!("quadfrog: {error}"),
            Ok(studies) => {
                for stored in studies {
                    let which = Which {
                        study: file.display().to_string(),
                        name: Some(quadfrog::engine::study_name(stored.task, stored.seed)),
                    };
                    match which.open() {
                        Err(Failure::Input(message)) => eprintln!("quadfrog: {message}"),
                        Err(other) => return Err(other),
                        Ok(opened) => {
                            let trials = opened.study.trials();
                            let counted = trials.iter().filter(|t| t.state == TrialState::Complete).count();
                            let falls = trials.iter().filter(|t| t.is_fall()).count();
                            let best = best_of(&opened).and_then(|trial| trial.value);
                            let best = best.map_or("-".to_owned(), |best| format!("{best:.3} {}", opened.unit()));
                            rows.push([
                                place.clone(),
                                stored.task.name().to_owned(),
                                stored.seed.to_string(),
                                trials.len().to_string(),
                                counted.to_string(),
                                falls.to_string(),
                                best,
                            ]);
                        }
                    }
                }
            }
        }
    }
    let mut text = String::new();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..7).map(width).collect();
    for row in &rows {
        let cell = |(column, cell): (usize, &String)| match column {
            0 | 1 => format!("{cell:<0$}", widths[column]),
            _ => format!("{cell:>0$}", widths[column]),
        };
        let _ = writeln!(text, "{}", row.iter().enumerate().map(cell).collect::<Vec<_>>().join("  ").trim_end());
    }
    say(&text)
}

/// The best trial that the robot stood through.
fn best_of(opened: &Opened) -> Option<&Trial> {
    // As everywhere: a repeated point is worth the mean of its repeats.
    let best_first = repeats::contenders(opened.study.trials(), opened.study.options().direction, usize::MAX);
    let best = best_first.iter().find(|point| point.stood > 0)?;
    let standing = |trial: &&Trial| best.trials.contains(&trial.number) && !trial.is_fall();
    opened.study.trials().iter().find(standing)
}

fn show(which: &Which) -> Result<(), Failure> {
    let opened = which.open()?;
    let Opened { study, ours, parameters } = &opened;
    let mut text = String::new();
    let _ = writeln!(text, "{} in {}", study.options().name, journal(&which.study));
    for (name, value) in study.attributes() {
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let _ = writeln!(text, "  {name}: {value}");
    }
    for parameter in parameters {
        let _ = writeln!(text, "  {} from {} to {} {}", parameter.name, parameter.low, parameter.high, parameter.unit);
    }
    text.push('\n');
    let rows: Vec<TrialRecord> = rows_of(study, parameters);
    let unit = if ours.is_some() { opened.unit() } else { "value" };
    text += &table::table(&rows, parameters, unit);
    for row in rows.iter().filter(|row| !row.note.is_empty()) {
        let _ = writeln!(text, "Note on trial {}: {}", row.trial, row.note);
    }
    for point in repeats::points(study.trials()).iter().filter(|point| point.repeats() > 1) {
        let trials: Vec<String> = point.trials.iter().map(u32::to_string).collect();
        let _ = writeln!(
            text,
            "Trials {} are one point: stood {}/{}, mean {:.3} {unit}, deviation {:.3}",
            trials.join(", "),
            point.stood,
            point.repeats(),
            point.mean(),
            point.deviation().unwrap_or(0.0)
        );
    }
    let count = |state: TrialState| study.trials().iter().filter(|trial| trial.state == state).count();
    let (running, waiting) = (count(TrialState::Running), count(TrialState::Waiting));
    if running + waiting > 0 {
        let _ = writeln!(text, "{running} running, {waiting} queued");
    }
    text += &best_line(&opened, &rows);
    say(&text)
}

fn best_line(opened: &Opened, rows: &[TrialRecord]) -> String {
    let best = best_of(opened).and_then(|best| rows.iter().find(|row| row.trial == best.number));
    let units: HashMap<String, String> =
        opened.parameters.iter().map(|parameter| (parameter.name.clone(), parameter.unit.clone())).collect();
    match best {
        Some(best) => format!("Best: {}\n", table::line(best, opened.unit(), &units)),
        None => "No trial was accepted.\n".to_owned(),
    }
}

fn export(which: &Which, format: Option<Format>, output: Option<&Path>) -> Result<(), Failure> {
    let opened = which.open()?;
    let note = |number| opened.study.note_of(number);
    let text = match Format::of(format, output) {
        Format::Csv => exchange::to_csv(opened.study.trials(), note),
        Format::Json => exchange::to_json(opened.study.trials(), note),
    };
    match output {
        None => say(&text),
        Some(path) => std::fs::write(path, text)
            .wrap_err_with(|| format!("{}: cannot be written", path.display()))
            .map_err(Failure::Other),
    }
}

fn import(which: &Which, table: &Path, format: Option<Format>, queue: bool) -> Result<(), Failure> {
    let wrong = |error: &dyn std::fmt::Display| Failure::input(format!("{}: {error}", table.display()));
    let text = std::fs::read_to_string(table).map_err(|error| wrong(&error))?;
    let trials = match Format::of(format, Some(table)) {
        Format::Csv => exchange::from_csv(&text),
        Format::Json => exchange::from_json(&text),
    }
    .map_err(|error| wrong(&error))?;
    let mut study = which.open()?.study;
    let (finished, unfinished): (Vec<TableTrial>, Vec<TableTrial>) =
        trials.into_iter().partition(|trial| trial.state.is_finished());
    if !queue {
        let given = finished.len();
        let added = experiment::import(&mut study, finished).map_err(|error| wrong(&error))?.len();
        let known = match given - added {
            0 => String::new(),
            known => format!("; {known} were there already, with the same parameters, value and times"),
        };
        let left = if unfinished.is_empty() {
            String::new()
        } else {
            format!("; {} that had not finished are left out, --queue queues them", unfinished.len())
        };
        return say(&format!("{added} trials are in the study now{known}{left}\n"));
    }
    let points: Vec<TableTrial> = finished.into_iter().chain(unfinished).collect();
    // All or none: looked at before the first is queued.
    for point in &points {
        study.check_point(&point.parameters).map_err(|error| wrong(&error))?;
    }
    for point in &points {
        study.enqueue(&point.parameters, &[])?;
    }
    say(&format!("{} points are queued\n", points.len()))
}

fn best(which: &Which, config: Option<&Path>) -> Result<(), Failure> {
    let opened = which.open()?;
    let rows = rows_of(&opened.study, &opened.parameters);
    let Some(folder) = config else {
        return say(&best_line(&opened, &rows));
    };
    let best = best_of(&opened).and_then(|best| rows.iter().find(|row| row.trial == best.number));
    let (Some(best), Some(ours)) = (best, &opened.ours) else {
        return Err(Failure::input(format!("{}: no accepted trial of this program to write", which.study)));
    };
    which.config()?.export(folder, ours.task, &best.parameters, &best.gains)?;
    let text = best_line(&opened, &rows);
    say(&format!(
        "{text}Begin a new study with it:  quadfrog --task {} --config {}\n",
        ours.task.name(),
        folder.display()
    ))
}

fn enqueue(which: &Which, point: &[(String, f64)]) -> Result<(), Failure> {
    if let Some((name, _)) =
        point.iter().enumerate().find(|(i, (name, _))| point[..*i].iter().any(|(n, _)| n == name)).map(|(_, p)| p)
    {
        return Err(Failure::input(format!("{name} is given twice")));
    }
    let mut study = which.open()?.study;
    study.check_point(point)?;
    let number = study.enqueue(point, &[])?;
    say(&format!("Queued as trial {number}\n"))
}
