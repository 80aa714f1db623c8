//! Order of the work, progress with the time left, and the end by Ctrl-C.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::notice;
use quadfrog::printable::shell_word;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::parallel::in_parallel;

use super::plan::{ExperimentSize, PaperExperiment, ReproduceJob, all_jobs};
use super::results::ReproduceResults;
use super::work::{JobResult, Workplace};
use crate::subcommand::failure::Failure;
use crate::subcommand::interrupt::{AfterSignal, at_first_signal};
use crate::subcommand::progress::Progress;

/// Runs the experiments on `threads` threads; when Ctrl-C or SIGTERM ends the program, what is complete is written to
/// `interrupted`. The results do not depend on the number of threads.
///
/// # Errors
/// When a configuration or a study fails.
pub fn run_experiments(
    experiments: &[PaperExperiment],
    size: ExperimentSize,
    quick: bool,
    threads: usize,
    interrupted: &Path,
) -> Result<ReproduceResults, Failure> {
    let jobs = all_jobs(experiments, &size);
    let robot = RobotDescription::embedded("go1").map_err(Failure::input)?;
    let workplace = Workplace::new(robot, &jobs, size.side_trials)?;
    let kept = Arc::new(KeptResults {
        results: Mutex::new(ReproduceResults::new(size, quick)),
        asked: experiments.to_vec(),
        file: interrupted.to_owned(),
    });
    let at_signal = Arc::clone(&kept);
    at_first_signal(move |_| {
        let message = at_signal.keep();
        notice!("{message}");
        AfterSignal::End
    });
    let studies = jobs.iter().filter(|job| matches!(job, ReproduceJob::Study(_))).count();
    notice!("{studies} studies and {} runs on {threads} threads", jobs.len() - studies);
    let progress = Progress::new("experiments", jobs.iter().map(ReproduceJob::cost).sum(), None);
    let (later, first): (Vec<&ReproduceJob>, Vec<&ReproduceJob>) = jobs.iter().partition(|job| job.depends());
    for mut stage in [first, later] {
        let studies = kept.lock().studies.clone();
        // The longest first: the threads then end together.
        stage.sort_by_key(|job| std::cmp::Reverse(job.cost()));
        let run = |(): &mut (), job: &&ReproduceJob| {
            let result = workplace.run(job, &studies, |work| progress.add(work, ""))?;
            match result {
                JobResult::Study(study) => kept.lock().studies.push(study),
                JobResult::Run(run) => kept.lock().runs.push(*run),
            }
            Ok::<_, Failure>(())
        };
        in_parallel(threads, &stage, || Ok(()), run)?;
    }
    let mut results = kept.lock().clone();
    results.complete(experiments, &jobs);
    for job in results.runs_to_trace() {
        results.traces.push(workplace.trace(&job)?);
    }
    notice!("the experiments took {}", progress.finish());
    Ok(results)
}

/// Results of the complete jobs, written when the program is interrupted.
struct KeptResults {
    results: Mutex<ReproduceResults>,
    asked: Vec<PaperExperiment>,
    file: PathBuf,
}

impl KeptResults {
    fn lock(&self) -> MutexGuard<'_, ReproduceResults> {
        self.results.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes the results of the complete experiments and returns a sentence for the operator.
    fn keep(&self) -> String {
        let mut results = self.lock().clone();
        let complete: Vec<PaperExperiment> =
            self.asked.iter().copied().filter(|experiment| results.covers(*experiment)).collect();
        if complete.is_empty() {
            return "interrupted: no experiment was complete, nothing was written".to_owned();
        }
        let jobs = all_jobs(&complete, &results.size);
        results.complete(&complete, &jobs);
        let names: Vec<_> = complete.iter().map(|experiment| experiment.title()).collect();
        let file = self.file.display();
        match results.write(&self.file) {
            Ok(()) => format!(
                "interrupted: {file} has the complete experiments ({}); `quadfrog reproduce --from {} --output DIR` makes their report",
                names.join("; "),
                shell_word(&self.file)
            ),
            Err(failure) => format!("interrupted: {file} could not be written: {failure}"),
        }
    }
}
