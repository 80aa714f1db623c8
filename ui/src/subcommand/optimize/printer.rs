//! Output of a study without a screen: a progress bar on a terminal, lines elsewhere, JSON on request.

use std::collections::HashMap;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressStyle};
use quadfrog::config::Config;
use quadfrog::engine::Options;
use quadfrog::printable::shell_word;
use quadfrog::report::table;
use quadfrog::session::experiment::Experiment;
use quadfrog::trial::{self, MeasuredJump, RepeatRecord, Task, TrialRecord, Verdict};
use serde::{Serialize, Serializer};

use crate::output;
use crate::subcommand::selection::SelectedStudy;

pub struct Printer {
    json: bool,
    several: bool,
    bar: Option<ProgressBar>,
    /// Whether the bar counts the trials of one study, of all its workers.
    one: bool,
    /// Unit of each parameter.
    units: HashMap<String, String>,
    /// Unit of the objective of each task, in the order of [`Task::ALL`].
    objective_units: [&'static str; Task::ALL.len()],
    output: Mutex<()>,
    /// Task, best value and falls of each finished study.
    results: Mutex<Vec<(Task, f64, usize)>>,
    /// Notice of the configuration with which a study is continued, until it is printed.
    continued: Mutex<Option<String>>,
}

impl Printer {
    /// `budgets`: number of trials of each study, or, if `joined`, of the one study for each worker here; `continued`: the
    /// notice of the configuration with which a study is continued.
    pub fn new(json: bool, joined: bool, config: &Config, budgets: &[u32], continued: Option<String>) -> Printer {
        let one = joined || budgets.len() == 1;
        let bar = std::io::stderr().is_terminal().then(|| {
            let budgets = if one { &budgets[..1] } else { budgets };
            let bar = ProgressBar::new(budgets.iter().copied().map(u64::from).sum());
            let style = ProgressStyle::with_template("{bar:30} {pos}/{len} trials  {msg}");
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        let units = Task::ALL.iter().flat_map(|task| config.parameters(*task)).map(|p| (p.name, p.unit)).collect();
        Printer {
            json,
            several: budgets.len() > 1,
            bar,
            one,
            units,
            objective_units: Task::ALL.map(|task| config.task(task).unit(task)),
            output: Mutex::new(()),
            results: Mutex::default(),
            continued: Mutex::new(continued),
        }
    }

    fn unit(&self, task: Task) -> &'static str {
        self.objective_units[task as usize]
    }

    /// Prints a judged trial; `counted` is the number of counted trials of its study, of all workers.
    pub fn trial(&self, study: &SelectedStudy, row: &TrialRecord, counted: u32) {
        let _output = self.output.lock();
        if self.json {
            let line = JsonLine {
                task: self.several.then(|| study.task.name()),
                seed: self.several.then_some(study.seed),
                trial: row.trial,
                params: &row.parameters,
                value: row.value,
                verdict: row.verdict,
                measured: row.measured.as_ref(),
                repeats: &row.repeats,
            };
            // Numbers and names always serialize.
            output::line(&serde_json::to_string(&line).unwrap_or_default());
        }
        let line = table::line(row, self.unit(study.task), &self.units);
        match &self.bar {
            Some(bar) => {
                match self.one {
                    // Counts of several workers may arrive out of order.
                    true => bar.set_position(bar.position().max(u64::from(counted))),
                    false => bar.inc(1),
                }
                bar.set_message(output::printable(&line).into_owned());
            }
            None if self.json => {}
            None if self.several => output::line(&format!("{} seed {}: {line}", study.task.name(), study.seed)),
            None => output::line(&line),
        }
    }

    /// Prints once, when a study was opened and not refused, which configuration it continues with.
    pub fn opened(&self) {
        if let Some(continued) = self.continued.lock().unwrap_or_else(PoisonError::into_inner).take() {
            self.notice(&continued);
        }
    }

    /// Prints a warning about a study on standard error.
    pub fn warn(&self, study: &SelectedStudy, warning: &str) {
        self.notice(&format!("{} seed {}: {warning}", study.task.name(), study.seed));
    }

    fn notice(&self, text: &str) {
        let _output = self.output.lock();
        self.printer_of_notices()(text);
    }

    /// Returns a function that prints a line on standard error, above the bar, from any thread.
    pub fn printer_of_notices(&self) -> impl Fn(&str) + Send + use<> {
        let bar = self.bar.clone();
        move |text| match &bar {
            Some(bar) => bar.suspend(|| output::notice(text)),
            None => output::notice(text),
        }
    }

    pub fn finished(&self, study: &SelectedStudy, experiment: &Experiment, options: &Options) {
        let rows: Vec<TrialRecord> = experiment.rows().cloned().collect();
        let best = experiment.best();
        let _output = self.output.lock();
        let falls = rows.iter().filter(|row| row.verdict == Some(Verdict::Fall)).count();
        let value = best.and_then(|best| best.value).unwrap_or(0.0);
        self.results.lock().unwrap_or_else(PoisonError::into_inner).push((study.task, value, falls));
        let mut text = String::new();
        if self.several {
            text += &format!("{} seed {}\n", study.task.name(), study.seed);
        }
        let (parameters, unit) = (options.config.parameters(study.task), self.unit(study.task));
        text += &table::table(&rows, best.map(|best| best.trial), &parameters, unit);
        let gains = options.config.task(study.task).gains().values();
        text += &table::best_line(best, experiment.model_best(), &gains, unit, &self.units);
        let folder = study.folder.display();
        text += &match &options.join {
            Some(storage) => format!("The study is in {storage}; the files of this worker are in {folder}\n"),
            None => format!("The study is in {folder}\n"),
        };
        self.print(&text);
    }

    /// Prints on standard error that a signal has ended the study, and how it continues.
    pub fn interrupted(&self, study: &SelectedStudy, counted: u32, options: &Options) {
        let again = match &options.join {
            // The budget of a worker is not kept in the study, and its journal may have several.
            Some(storage) => {
                let (place, budget) = (storage.to_string(), options.budget());
                let (task, seed) = (study.task.name(), study.seed);
                format!("--join {} --task {task} --seed {seed} --trials {budget}", shell_word(Path::new(&place)))
            }
            None => format!("--resume {}", shell_word(&study.folder)),
        };
        self.notice(&format!(
            "{counted} of {} counted; `quadfrog optimize {again}` continues the study",
            trial::counted(options.budget() as usize, "trial")
        ));
    }

    fn print(&self, text: &str) {
        let print = || if self.json { output::message(text) } else { output::line(text.trim_end()) };
        match &self.bar {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }

    /// Prints mean best value and falls of each task with several studies; a study without an accepted trial counts with 0.
    pub fn summary(&self) {
        let results = self.results.lock().unwrap_or_else(PoisonError::into_inner);
        for task in Task::ALL {
            let of: Vec<_> = results.iter().filter(|(of, ..)| *of == task).collect();
            let count = of.len() as f64;
            if of.len() > 1 {
                let best = of.iter().map(|(_, best, _)| best).sum::<f64>() / count;
                let falls = of.iter().map(|(.., falls)| *falls as f64).sum::<f64>() / count;
                let (name, unit) = (task.name(), self.unit(task));
                self.print(&format!("{name}: {count} studies, mean best {best:.4} {unit}, {falls:.2} falls a study\n"));
            }
        }
    }
}

impl Drop for Printer {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// A finished trial in JSON; task and seed only if several studies run.
#[derive(Serialize)]
struct JsonLine<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    task: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u32>,
    trial: u32,
    #[serde(serialize_with = "in_table_order")]
    params: &'a [(String, f64)],
    value: Option<f64>,
    verdict: Option<Verdict>,
    measured: Option<&'a MeasuredJump>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    repeats: &'a [RepeatRecord],
}

fn in_table_order<S: Serializer>(parameters: &&[(String, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(parameters.iter().map(|(name, value)| (name, value)))
}
