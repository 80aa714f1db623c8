//! What a study without a screen prints.

use std::collections::HashMap;
use std::io::{IsTerminal, Write};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressStyle};
use quadfrog::config::Config;
use quadfrog::engine::Options;
use quadfrog::report::table;
use quadfrog::trial::{MeasuredJump, Task, TrialRecord, Verdict};
use serde::{Serialize, Serializer};

use super::OptimizeArguments;
use crate::command::chosen::Chosen;

/// What the operator sees: a bar on a terminal, lines elsewhere, JSON if asked for.
pub struct Printer {
    json: bool,
    several: bool,
    bar: Option<ProgressBar>,
    /// Whether the bar is that of one study, whoever runs its trials.
    one: bool,
    units: HashMap<String, String>,
    output: Mutex<()>,
    /// Task, best value and falls of each finished study.
    results: Mutex<Vec<(Task, f64, usize)>>,
}

impl Printer {
    pub fn new(arguments: &OptimizeArguments, config: &Config, studies: &[Chosen]) -> Printer {
        let budget =
            |study: &Chosen| u64::from(arguments.study.trials.or(study.budget).unwrap_or(config.optimize.trials));
        // All workers that join work off the budget of the same study.
        let one = arguments.join.is_some() || studies.len() == 1;
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(studies.iter().take(if one { 1 } else { studies.len() }).map(budget).sum());
            let style = ProgressStyle::with_template("{bar:30} {pos}/{len} trials  {msg}");
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        let units = Task::ALL.iter().flat_map(|task| config.parameters(*task)).map(|p| (p.name, p.unit)).collect();
        Printer {
            json: arguments.json,
            several: studies.len() > 1,
            bar,
            one,
            units,
            output: Mutex::new(()),
            results: Mutex::default(),
        }
    }

    /// A trial has been judged; `counted` are those of its study that count by now, other workers' among them.
    pub fn trial(&self, study: &Chosen, row: &TrialRecord, counted: u32) {
        let _alone = self.output.lock();
        if self.json {
            let line = JsonLine {
                task: self.several.then(|| study.task.name()),
                seed: self.several.then_some(study.seed),
                trial: row.trial,
                params: &row.parameters,
                value: row.value,
                verdict: row.verdict,
                measured: row.measured,
            };
            // Numbers and names: there is nothing in it that JSON cannot say.
            say(&serde_json::to_string(&line).unwrap_or_default());
        }
        let line = table::line(row, study.task.unit(), &self.units);
        match &self.bar {
            Some(bar) => {
                match self.one {
                    // Of several workers here one may know more than the other.
                    true => bar.set_position(bar.position().max(u64::from(counted))),
                    false => bar.inc(1),
                }
                bar.set_message(line);
            }
            None if self.json => {}
            None if self.several => say(&format!("{} seed {}: {line}", study.task.name(), study.seed)),
            None => say(&line),
        }
    }

    pub fn finished(&self, study: &Chosen, rows: &[TrialRecord], best: Option<&TrialRecord>, options: &Options) {
        let _alone = self.output.lock();
        let falls = rows.iter().filter(|row| row.verdict == Some(Verdict::Fall)).count();
        let value = best.and_then(|best| best.value).unwrap_or(0.0);
        self.results.lock().unwrap_or_else(PoisonError::into_inner).push((study.task, value, falls));
        let mut text = String::new();
        if self.several {
            text += &format!("{} seed {}\n", study.task.name(), study.seed);
        }
        text += &table::table(rows, &options.config.parameters(study.task), study.task.unit());
        text += &match best {
            Some(best) => format!("Best: {}\n", table::line(best, study.task.unit(), &self.units)),
            None => "No trial was accepted.\n".to_owned(),
        };
        text += &match &options.join {
            Some(storage) => format!("The study is in {storage}; this worker's part in {}\n", study.folder.display()),
            None => format!("The study is in {}\n", study.folder.display()),
        };
        self.print(&text);
    }

    fn print(&self, text: &str) {
        let print = || if self.json { eprint!("{text}") } else { say(text.trim_end()) };
        match &self.bar {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }

    /// What several studies of a task amount to; a study in which nothing was accepted counts with 0.
    pub fn summary(&self) {
        let results = self.results.lock().unwrap_or_else(PoisonError::into_inner);
        for task in Task::ALL {
            let of: Vec<_> = results.iter().filter(|(of, ..)| *of == task).collect();
            let count = of.len() as f64;
            if of.len() > 1 {
                let best = of.iter().map(|(_, best, _)| best).sum::<f64>() / count;
                let falls = of.iter().map(|(.., falls)| *falls as f64).sum::<f64>() / count;
                self.print(&format!(
                    "{}: {} studies, mean best {best:.4} {}, {falls:.2} falls a study\n",
                    task.name(),
                    of.len(),
                    task.unit()
                ));
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

/// One line on standard output; a reader that has gone away (`| head`) wants no more.
fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// A finished trial as the JSON line says it; task and seed only where several studies run at once.
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
    measured: Option<MeasuredJump>,
}

fn in_table_order<S: Serializer>(parameters: &&[(String, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(parameters.iter().map(|(name, value)| (name, value)))
}
