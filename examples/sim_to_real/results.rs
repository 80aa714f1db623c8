//! The studies of a task, and what of them is printed.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use quadfrog::session::parallel::in_parallel;

use crate::settings::Settings;
use crate::statistics::{mean, p_value};
use crate::studies::{
    AFTER, Attainable, Job, Jumper, KnownTask, LONG, LONG_PROPOSERS, LONG_SEED, NEAR, OPTIMUM_REPEATS, Proposer,
    REACHED, StudyResult, Target, attainable, run,
};

/// A proposer after as many jumps as this entry of [`AFTER`].
pub(super) type Compared = (Proposer, usize);

/// The finished studies of a task.
pub(super) struct TaskResults<'a> {
    task: &'a KnownTask,
    settings: &'a Settings,
    targets: &'a [Target],
    studies: Vec<(Job, StudyResult)>,
    robots: Vec<JudgedRobot>,
}

/// One robot.
struct JudgedRobot {
    attainable: Attainable,
    /// Of each study that is not long, its proposer and whether it stood early at a point as good as those that [`LONG`] jumps find.
    early: Vec<(Proposer, bool)>,
}

impl<'a> TaskResults<'a> {
    /// Runs all studies on all cores.
    pub(super) fn of(task: &'a KnownTask, settings: &'a Settings, targets: &'a [Target]) -> TaskResults<'a> {
        let work = work(settings);
        let (begun, done) = (Instant::now(), AtomicUsize::new(0));
        let run = |_: &mut (), job: &Job| {
            let result = run(task, targets, u64::from(settings.seed), job);
            let (done, all) = (done.fetch_add(1, Ordering::Relaxed) + 1, work.len());
            if done * 20 / all > (done - 1) * 20 / all {
                eprintln!(
                    "{}: {done} of {all} studies after {:.1} min",
                    task.name,
                    begun.elapsed().as_secs_f64() / 60.0
                );
            }
            Ok::<_, ()>(result)
        };
        let results = in_parallel(settings.jobs, &work, || Ok(()), run).expect("cannot fail");
        let studies = work.into_iter().zip(results).collect();
        let mut results = TaskResults { task, settings, targets, studies, robots: Vec::new() };
        let indices: Vec<usize> = (0..targets.len()).collect();
        let judge = |_: &mut (), robot: &usize| Ok::<_, ()>(results.judge(*robot));
        results.robots = in_parallel(settings.jobs, &indices, || Ok(()), judge).expect("cannot fail");
        results
    }

    fn judge(&self, robot: usize) -> JudgedRobot {
        let properties = &self.targets[robot].properties;
        let mut jumper = Jumper::new(self.task, properties.apply(&self.task.plan.robot, &self.task.plan.simulator));
        let all = || self.studies.iter().filter(|(job, _)| job.target == robot);
        let of_all: Vec<&StudyResult> = all().map(|(_, result)| result).collect();
        let long: Vec<&StudyResult> = all().filter(|(job, _)| job.is_long).map(|(_, result)| result).collect();
        let noise = (u64::from(self.settings.seed) + 1) * 1_000_000_000_000;
        let attainable = attainable(&mut jumper, noise, &of_all, &long);
        let again = noise + 2 * OPTIMUM_REPEATS;
        let best = attainable.long;
        let mut reaches =
            |(point, value): &(Vec<_>, f64)| *value >= NEAR * best && jumper.reaches(point, again, REACHED * best);
        let of_proposers = all().filter(|(job, _)| !job.is_long);
        let early = of_proposers.map(|(job, result)| (job.proposer, result.early.iter().any(&mut reaches))).collect();
        JudgedRobot { attainable, early }
    }

    /// The studies of a proposer that are not long, with their robot.
    fn of_proposer(&self, proposer: Proposer) -> impl Iterator<Item = (usize, &StudyResult)> {
        let chosen = self.studies.iter().filter(move |(job, _)| job.proposer == proposer && !job.is_long);
        chosen.map(|(job, result)| (job.target, result))
    }

    /// The row of the table of a proposer. Cells of more jumps than the studies have are empty.
    pub(super) fn row(&self, proposer: Proposer) -> String {
        let all: Vec<(usize, &StudyResult)> = self.of_proposer(proposer).collect();
        let mean_of = |value: &dyn Fn(&StudyResult) -> f64| {
            mean(&all.iter().map(|(_, result)| value(result)).collect::<Vec<_>>())
        };
        let if_reached = |after: usize, cell: String| if self.settings.reach(after) { cell } else { String::new() };
        let value = |after: usize| {
            let (mean, error) = mean_of(&|result| result.best[after]);
            if_reached(after, format!("{mean:.3} ± {error:.3}"))
        };
        let falls = |after: usize| if_reached(after, format!("{:.2}", mean_of(&|result| result.falls[after]).0));
        let share = |count: usize| format!("{:.0} %", 100.0 * count as f64 / all.len() as f64);
        let at_optimum = |(robot, result): &&(usize, &StudyResult)| {
            result.best[..3].iter().any(|best| *best >= REACHED * self.robots[*robot].attainable.optimum)
        };
        let early = self.robots.iter().flat_map(|robot| &robot.early).filter(|(of, early)| *of == proposer && *early);
        let share_of_long = if self.settings.long_pairs == 0 { String::new() } else { share(early.count()) };
        format!(
            "| {} | {} | {} | {} | {} | {} | {share_of_long} |",
            self.task.name,
            proposer.name(),
            (0..AFTER.len()).map(value).collect::<Vec<_>>().join(" | "),
            falls(2),
            falls(4),
            share(all.iter().filter(at_optimum).count()),
        )
    }

    /// The difference of the means of each robot, with the paired test: the studies of a robot resemble each other, so that a robot is
    /// one observation. None where one of both was not run.
    pub(super) fn difference(&self, a: Compared, b: Compared) -> Option<String> {
        let is_there =
            |(proposer, after): Compared| self.settings.proposers.contains(&proposer) && self.settings.reach(after);
        if !is_there(a) || !is_there(b) {
            return None;
        }
        let of_robot = |robot: usize, (proposer, after): Compared| {
            let of_robot = self.of_proposer(proposer).filter(|(of, _)| *of == robot);
            mean(&of_robot.map(|(_, result)| result.best[after]).collect::<Vec<_>>()).0
        };
        let differences: Vec<f64> =
            (0..self.targets.len()).map(|robot| of_robot(robot, a) - of_robot(robot, b)).collect();
        let (mean, error) = mean(&differences);
        let named = |(proposer, after): Compared| format!("{} after {}", proposer.name(), AFTER[after]);
        let p = p_value(&differences);
        Some(format!("- {}: {} less {}: {mean:+.3} ± {error:.3}, p = {p:.3}\n", self.task.name, named(a), named(b)))
    }

    /// A line for each robot: what it can do and what it is.
    pub(super) fn robots(&self) -> impl Iterator<Item = String> {
        self.targets.iter().zip(&self.robots).map(
            |(target, JudgedRobot { attainable: Attainable { optimum, long }, .. })| {
                let of_long =
                    if self.settings.long_pairs == 0 { String::new() } else { format!(", of {LONG} jumps {long:.3}") };
                format!("{} {}: best known {optimum:.3}{of_long}, {:?}", self.task.name, target.name, target.properties)
            },
        )
    }
}

/// The studies of all robots.
fn work(settings: &Settings) -> Vec<Job> {
    let mut work = Vec::new();
    for target in 0..settings.robots {
        let job = |proposer, study| Job { target, proposer, study, trials: settings.trials, is_long: false };
        let long = |seed| LONG_PROPOSERS.map(|proposer| Job { trials: LONG, is_long: true, ..job(proposer, seed) });
        work.extend((LONG_SEED..).take(settings.long_pairs).flat_map(long));
        for &proposer in &settings.proposers {
            work.extend((0..settings.studies as u32).map(|study| job(proposer, study)));
        }
    }
    work
}
