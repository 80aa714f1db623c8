//! Prints the table "Other simulated robots" of `src/optimize/README.md`: studies of the samplers on robots that are no members of
//! the prior's ensemble.
//!
//! `cargo run --release --example sim_to_real [KEY=VALUE...]`, keys `tasks`, `samplers` (lists with commas), `robots`, `studies`,
//! `trials`, `seed`, `jobs`, `least_p_stand` and `fall_price` (left out: those of the task's configuration), `backend` (`sim` or
//! `hardware`, where the robots are controlled and judged by the estimate), `prior_backend` (left out: the same), `torque_limit` (a
//! share for all robots; left out: drawn). Twelve robots: nine drawn from the ranges of `config/prior.toml` and three outside of them.
//!
//! A robot's value after n jumps is that of the trial that the study then calls its best, repeated [`REPEATS`] times with other
//! noise, falls as 0. Its optimum is chosen and valued by independent repeats ([`attainable`]): the largest of many noisy values would be
//! too high. Two shares of the studies are printed: those whose best trial after 1, 3 or 5 jumps has 95 % of this optimum, the best of
//! all studies on the robot, and those that stood in one of five jumps at a point with 95 % of what 100 jumps find ([`Attainable`]).
//! Standard error says how far the work is.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use quadfrog::config::Config;
use quadfrog::engine::prior_plan;
use quadfrog::optimize::ask::{Direction, SamplerConfig, SamplerKind};
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::prior::{Prior, PriorModel};
use quadfrog::optimize::repeats::student_cdf;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Outcome, Storage, Study, StudyOptions};
use quadfrog::optimize::trial::{FALL, VERDICT};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::evaluation::evaluate;
use quadfrog::session::parallel::{cores, in_parallel};
use quadfrog::session::prior::{PriorPlan, draw_robot, simulate};
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::ensemble::RobotProperties;
use quadfrog::sim::{SimConfig, Simulator};
use quadfrog::telemetry::TrialSpec;
use quadfrog::trial::{Backend, JumpParameters, ParameterValues, Task};

/// Repetitions of the best trial.
const REPEATS: u64 = 4;
/// Numbers of jumps after which a study is judged.
const AFTER: [usize; 5] = [1, 3, 5, 10, 20];
/// Jumps within which a good point is to be jumped.
const EARLY: usize = 5;
/// Trials of the long studies of each robot.
const LONG: usize = 100;
/// Their samplers.
const LONG_PROPOSERS: [Proposer; 2] = [Proposer::Gp, Proposer::Sim];
/// Their seeds, which no other study has: what one study happens to find differs by a third of its value.
const LONG_SEEDS: std::ops::Range<u32> = 900..904;
/// Points of which the optimum is chosen.
const SHORTLIST: usize = 10;
/// Repetitions by which it is chosen, and as many others by which it is valued.
const OPTIMUM_REPEATS: u64 = 16;
/// Share of the optimum that counts as reached.
const REACHED: f64 = 0.95;
/// Share of it that the jump of a study must have had for its point to be repeated: saves the time of the hopeless ones.
const NEAR: f64 = 0.75;

/// Source of the jumps of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Proposer {
    /// The sampler about the ensemble.
    Sim,
    /// The same with the ensemble's results at the mirrored points: a wrong simulator.
    SimMirrored,
    Gp,
    Tpe,
    /// First the best point of the configured simulator, then `gp`.
    IdealFirst,
}

impl Proposer {
    const ALL: [(&'static str, Proposer); 5] = [
        ("sim", Proposer::Sim),
        ("sim, mirrored simulator", Proposer::SimMirrored),
        ("gp", Proposer::Gp),
        ("tpe", Proposer::Tpe),
        ("ideal best, then gp", Proposer::IdealFirst),
    ];

    fn name(self) -> &'static str {
        Proposer::ALL.iter().find(|(_, proposer)| *proposer == self).map_or("", |(name, _)| name)
    }

    fn kind(self) -> SamplerKind {
        match self {
            Proposer::Sim | Proposer::SimMirrored => SamplerKind::Sim,
            Proposer::Gp | Proposer::IdealFirst => SamplerKind::Gp,
            Proposer::Tpe => SamplerKind::Tpe,
        }
    }
}

/// A task with what is known of it before the first jump.
struct KnownTask {
    name: String,
    plan: PriorPlan,
    sampler: SamplerConfig,
    space: Space,
    prior: Arc<PriorModel>,
    mirrored: Arc<PriorModel>,
    ideal_best: Vec<(String, f64)>,
}

/// A robot that jumps.
struct Target {
    name: String,
    properties: RobotProperties,
}

/// A study of one proposer on one robot.
#[derive(Clone, Copy)]
struct Job {
    target: usize,
    proposer: Proposer,
    study: u32,
    trials: usize,
    /// Whether it tells of the robot, not of the proposer: one of [`LONG`] trials.
    is_long: bool,
}

/// Repeated best values and falls so far after [`AFTER`] jumps, the points of the first [`EARLY`] jumps that stood with the values of
/// these jumps, and the best point in the end.
#[derive(Debug, Clone)]
struct StudyResult {
    best: [f64; AFTER.len()],
    falls: [f64; AFTER.len()],
    early: Vec<(Vec<(String, f64)>, f64)>,
    point: Vec<(String, f64)>,
}

/// Ability of a robot, as far as it is known.
struct Attainable {
    /// Value of its best known point.
    optimum: f64,
    /// What 100 jumps find: value of the better one of the points that the long studies of a seed call their best, mean over
    /// [`LONG_SEEDS`].
    long: f64,
}

/// Jumps of one robot, with noise of its own for each.
struct Jumper<'a> {
    task: &'a KnownTask,
    rollout: Rollout<Simulator>,
}

impl<'a> Jumper<'a> {
    fn new(task: &'a KnownTask, (robot, simulator): (RobotDescription, SimConfig)) -> Jumper<'a> {
        let simulator = Simulator::new(&robot, &simulator).expect("the robot can be simulated");
        Jumper { task, rollout: Rollout::new(simulator, &task.plan.settings) }
    }

    /// The objective of a jump that stands; none for a fall.
    fn jump(&mut self, point: &[(String, f64)], seed: u64) -> Option<f64> {
        let control = &self.task.plan.control;
        let values: ParameterValues = point.iter().cloned().collect();
        let spec = control.trial(self.task.plan.task, JumpParameters::from_values(&values, control.f1_hz));
        let run = evaluate(&mut self.rollout, &TrialSpec { gains: control.gains().with(&values), seed, ..spec });
        run.stood().then_some(run.value)
    }

    /// Mean of `count` jumps at a point, falls as 0.
    fn repeated(&mut self, point: &[(String, f64)], seed: u64, count: u64) -> f64 {
        (0..count).map(|i| self.jump(point, seed + i).unwrap_or(0.0)).sum::<f64>() / count as f64
    }
}

fn new_study(task: &KnownTask, proposer: Proposer, seed: u32) -> Study {
    let sampler = SamplerConfig { kind: proposer.kind(), seed, ..task.sampler.clone() };
    let options = StudyOptions {
        name: proposer.name().to_owned(),
        direction: Direction::Maximize,
        metric: "J".to_owned(),
        space: task.space.clone(),
        sampler,
        attributes: Vec::new(),
        durability: Durability::Buffered,
    };
    let mut study = Study::open(Storage::Memory, options).expect("opens in memory");
    match proposer {
        Proposer::Sim => study.use_prior(task.prior.clone()),
        Proposer::SimMirrored => study.use_prior(task.mirrored.clone()),
        Proposer::IdealFirst => drop(study.enqueue(&task.ideal_best, &[]).expect("within the bounds")),
        Proposer::Gp | Proposer::Tpe => {}
    }
    study
}

/// Runs one more jump; returns its value if the robot stood.
fn one_jump(study: &mut Study, jumper: &mut Jumper<'_>, seed: u64) -> Option<f64> {
    let draft = study.draft();
    let point = draft.point();
    let number = study.begin(&draft, &[], &[]).expect("begins");
    let value = jumper.jump(&point, seed);
    if value.is_none() {
        study.annotate(number, &[(VERDICT.into(), FALL.into())]).expect("running");
    }
    study.tell(number, Outcome::Complete(value.unwrap_or(0.0))).expect("reported");
    value
}

/// Number of the trial that the study calls its best.
fn best_of(study: &Study) -> Option<u32> {
    study.predict().best.map(|best| best.trial).or_else(|| study.best().map(|best| best.number))
}

fn run(task: &KnownTask, targets: &[Target], seed: u64, job: &Job) -> StudyResult {
    let target = &targets[job.target];
    let mut jumper = Jumper::new(task, target.properties.apply(&task.plan.robot, &task.plan.simulator));
    let mut study = new_study(task, job.proposer, job.study);
    let (best, falls) = ([0.0; AFTER.len()], [0.0; AFTER.len()]);
    let mut result = StudyResult { best, falls, early: Vec::new(), point: Vec::new() };
    // The same noise for all proposers.
    let noise = seed * 1_000_000 + u64::from(job.study) * 10_000 + job.target as u64 * 100_000_000;
    let (mut falls, mut known): (f64, BTreeMap<u32, f64>) = (0.0, BTreeMap::new());
    for trial in 1..=job.trials {
        match one_jump(&mut study, &mut jumper, noise + trial as u64) {
            Some(value) if trial <= EARLY => result.early.push((study.trials()[trial - 1].parameters.clone(), value)),
            Some(_) => {}
            None => falls += 1.0,
        }
        let after = AFTER.iter().position(|after| *after == trial);
        let Some(index) = after.or((trial == job.trials).then_some(AFTER.len() - 1)) else { continue };
        if let Some(number) = best_of(&study) {
            result.point.clone_from(&study.trials()[number as usize].parameters);
            let repeated = || jumper.repeated(&result.point, noise + 1_000, REPEATS);
            result.best[index..].fill(*known.entry(number).or_insert_with(repeated));
        }
        result.falls[index..].fill(falls);
    }
    result
}

/// Values a robot by all its results and those of its long studies, which are in the order of their seeds. For the optimum the best points of the [`SHORTLIST`] studies
/// of the largest values are repeated with new noise; the largest mean chooses one, and repeats with again other noise are its value.
fn attainable(jumper: &mut Jumper<'_>, noise: u64, results: &[&StudyResult], long: &[&StudyResult]) -> Attainable {
    let mut ranked: Vec<&StudyResult> = results.iter().copied().filter(|result| !result.point.is_empty()).collect();
    let value = |result: &StudyResult| result.best[AFTER.len() - 1];
    ranked.sort_by(|a, b| value(b).total_cmp(&value(a)));
    ranked.truncate(SHORTLIST);
    let valued = ranked.iter().map(|result| (jumper.repeated(&result.point, noise, OPTIMUM_REPEATS), &result.point));
    let chosen = valued.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, point)| point);
    let mut again = |point: &Vec<_>| jumper.repeated(point, noise + OPTIMUM_REPEATS, OPTIMUM_REPEATS);
    let optimum = chosen.map_or(0.0, &mut again);
    let mut found = |result: &&StudyResult| if result.point.is_empty() { 0.0 } else { again(&result.point) };
    let of_seeds = long.chunks(LONG_PROPOSERS.len());
    let bests: Vec<f64> = of_seeds.map(|of_seed| of_seed.iter().map(&mut found).fold(0.0, f64::max)).collect();
    Attainable { optimum, long: mean(&bests).0 }
}

/// The robots: `count` - 3 from the ranges of the ensemble, the others outside of them; all with `torque_limit`, where it is given.
fn targets(plan: &PriorPlan, count: usize, seed: u32, torque_limit: Option<f64>) -> Vec<Target> {
    let drawn = |index: usize| draw_robot(&plan.ensemble.ranges, seed + index as u32);
    let target = |index: usize| {
        let (name, properties) = match count - index {
            1 => ("outside: heavy", RobotProperties { mass: 1.3, inertia: 1.4, ..drawn(index) }),
            2 => ("outside: slippery and late", RobotProperties { friction: 0.4, delay_ms: 7, ..drawn(index) }),
            3 => (
                "outside: weak and sticky",
                RobotProperties {
                    torque_limit: 0.65,
                    full_torque_speed_share: 0.35,
                    dry_friction_nm: 0.8,
                    ..drawn(index)
                },
            ),
            _ => ("inside", drawn(index)),
        };
        let torque_limit = torque_limit.unwrap_or(properties.torque_limit);
        Target { name: format!("{name} {}", index + 1), properties: RobotProperties { torque_limit, ..properties } }
    };
    (0..count).map(target).collect()
}

fn known(
    name: &str,
    jobs: usize,
    [least_p_stand, fall_price]: [Option<f64>; 2],
    [backend, prior_backend]: [Backend; 2],
) -> KnownTask {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let continuous = name == "continuous";
    let mut config = Config::load(continuous.then(|| root.join("examples/continuous")).as_deref()).expect("loads");
    // With its first point the study would begin at the best.
    config.optimize.first.clear();
    let task = if continuous { Task::Forward } else { name.parse().expect("`tasks` are names of tasks or continuous") };
    let robot = RobotDescription::embedded("go1").expect("embedded");
    let plan_for = |backend| prior_plan(&config, &robot, task, backend).expect("fits the robot");
    let plan = plan_for(backend);
    let begun = Instant::now();
    let prior = simulate(&plan_for(prior_backend), jobs, &|_| {}, &AtomicBool::new(false)).expect("simulates");
    let simulated_s = begun.elapsed().as_secs_f64();
    let mirror = |point: &Vec<f64>| point.iter().map(|u| 1.0 - u).collect();
    let mirrored = prior.points.iter().map(mirror).collect();
    let mirrored = Prior::new(prior.parameters.clone(), mirrored, prior.worlds.clone(), prior.slip.clone());
    let space =
        Space::new(plan.parameters.iter().map(|p| (p.name.clone(), Range::linear(p.low, p.high)))).expect("a space");
    let mut sampler = config.sampler(task);
    sampler.least_p_stand = least_p_stand.unwrap_or(sampler.least_p_stand);
    sampler.fall_price = fall_price.unwrap_or(sampler.fall_price);
    let mut task = KnownTask {
        name: name.to_owned(),
        sampler,
        space,
        prior: Arc::new(PriorModel::new(prior)),
        mirrored: Arc::new(PriorModel::new(mirrored)),
        ideal_best: Vec::new(),
        plan,
    };
    eprintln!("{name}: prior simulated in {simulated_s:.1} s, with its models {:.1} s", begun.elapsed().as_secs_f64());
    let mut ideal = Jumper::new(&task, (task.plan.robot.clone(), task.plan.simulator.clone()));
    let mut study = new_study(&task, Proposer::Gp, 0);
    for trial in 0..LONG as u64 {
        one_jump(&mut study, &mut ideal, trial);
    }
    let best = best_of(&study).map(|number| study.trials()[number as usize].parameters.clone());
    task.ideal_best = best.expect("the ideal robot stands");
    task
}

/// Mean and standard error.
fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, (variance / n).sqrt())
}

/// Two-sided p of the paired t-test.
fn p_value(differences: &[f64]) -> f64 {
    let (mean, error) = mean(differences);
    if error > 0.0 { 2.0 * (1.0 - student_cdf((mean / error).abs(), differences.len() - 1)) } else { 1.0 }
}

fn main() {
    let mut settings: BTreeMap<String, String> = [
        ("tasks", "forward,lateral-left,twist-ccw,continuous"),
        ("samplers", "sim,gp,tpe,ideal best, then gp"),
        ("robots", "12"),
        ("studies", "20"),
        ("trials", "20"),
        ("seed", "9000"),
        ("jobs", ""),
        ("least_p_stand", ""),
        ("fall_price", ""),
        ("backend", Backend::Simulator.name()),
        ("prior_backend", ""),
        ("torque_limit", ""),
    ]
    .map(|(key, value)| (key.to_owned(), value.to_owned()))
    .into();
    for argument in std::env::args().skip(1) {
        let known = argument.split_once('=').filter(|(key, _)| settings.contains_key(*key));
        let (key, value) = known.unwrap_or_else(|| panic!("`{argument}`: write KEY=VALUE, keys {:?}", settings.keys()));
        settings.insert(key.to_owned(), value.to_owned());
    }
    let number = |key: &str| settings[key].parse::<usize>().unwrap_or_else(|_| panic!("`{key}` is a whole number"));
    let jobs = if settings["jobs"].is_empty() { cores() } else { number("jobs") };
    let (robots, studies, trials, seed) =
        (number("robots").max(4), number("studies"), number("trials"), number("seed"));
    let is_reached = |after: usize| AFTER[after] <= trials;
    let share = |key: &str| {
        let given = Some(&settings[key]).filter(|text| !text.is_empty());
        given.map(|text| text.parse::<f64>().unwrap_or_else(|_| panic!("`{key}` is a number")))
    };
    let (risk, torque_limit) = (["least_p_stand", "fall_price"].map(share), share("torque_limit"));
    let backend = |key: &str| settings[key].parse().unwrap_or_else(|_| panic!("`{key}` is sim or hardware"));
    let prior_backend = if settings["prior_backend"].is_empty() { "backend" } else { "prior_backend" };
    let backends = ["backend", prior_backend].map(backend);
    let wanted = &settings["samplers"];
    let proposers: Vec<Proposer> = Proposer::ALL
        .iter()
        .filter(|(name, _)| {
            wanted == name || wanted.starts_with(&format!("{name},")) || wanted.contains(&format!(",{name}"))
        })
        .map(|(_, proposer)| *proposer)
        .collect();
    println!(
        "{robots} robots of seed {seed}, three of them outside the ensemble's ranges; {studies} studies of {trials} jumps of each sampler on \
         each robot. Value of the best trial, repeated {REPEATS} times, falls as 0: mean and standard error over all studies.\n"
    );
    println!(
        "| task | sampler | {} | falls in 5 | in 20 | best after 5 has {REACHED} of the optimum | stood in {EARLY} at {REACHED} of what {LONG} find |",
        AFTER.map(|n| format!("after {n}")).join(" | ")
    );
    println!("|---|---|{}---|---|---|", "---|".repeat(AFTER.len() + 1));
    let mut notes = String::new();
    for name in settings["tasks"].split(',') {
        let task = known(name, jobs, risk, backends);
        let targets = targets(&task.plan, robots, seed as u32, torque_limit);
        let mut work = Vec::new();
        for target in 0..robots {
            let job = |proposer, study| Job { target, proposer, study, trials, is_long: false };
            let long = |seed| LONG_PROPOSERS.map(|proposer| Job { trials: LONG, is_long: true, ..job(proposer, seed) });
            work.extend(LONG_SEEDS.flat_map(long));
            for &proposer in &proposers {
                work.extend((0..studies as u32).map(|study| job(proposer, study)));
            }
        }
        let (begun, done) = (Instant::now(), AtomicUsize::new(0));
        let run = |_: &mut (), job: &Job| {
            let result = run(&task, &targets, seed as u64, job);
            let (done, all) = (done.fetch_add(1, Ordering::Relaxed) + 1, work.len());
            if done * 20 / all > (done - 1) * 20 / all {
                eprintln!("{name}: {done} of {all} studies after {:.1} min", begun.elapsed().as_secs_f64() / 60.0);
            }
            Ok::<_, ()>(result)
        };
        let results = in_parallel(jobs, &work, || Ok(()), run).expect("cannot fail");
        let of = |target: usize, proposer: Proposer| -> Vec<StudyResult> {
            let is_of = |job: &Job| job.target == target && job.proposer == proposer && !job.is_long;
            let chosen = work.iter().zip(&results).filter(|(job, _)| is_of(job));
            chosen.map(|(_, result)| result.clone()).collect()
        };
        // For each robot what it can do, and of each study whether it stood early at a point as good as those that 100 jumps find.
        let judge = |_: &mut (), index: &usize| {
            let target = &targets[*index];
            let mut jumper = Jumper::new(&task, target.properties.apply(&task.plan.robot, &task.plan.simulator));
            let all = || work.iter().zip(&results).filter(|(job, _)| job.target == *index);
            let of_all: Vec<&StudyResult> = all().map(|(_, result)| result).collect();
            let long: Vec<&StudyResult> = all().filter(|(job, _)| job.is_long).map(|(_, result)| result).collect();
            let noise = (seed as u64 + 1) * 1_000_000_000_000;
            let attainable = attainable(&mut jumper, noise, &of_all, &long);
            let again = noise + 2 * OPTIMUM_REPEATS;
            let best = attainable.long;
            let mut reaches = |(point, value): &(Vec<_>, f64)| {
                *value >= NEAR * best && jumper.repeated(point, again, OPTIMUM_REPEATS) >= REACHED * best
            };
            let of_proposers = all().filter(|(job, _)| !job.is_long);
            let early = of_proposers.map(|(job, result)| (job.proposer, result.early.iter().any(&mut reaches)));
            let early: Vec<(Proposer, bool)> = early.collect();
            Ok::<_, ()>((attainable, early))
        };
        let indices: Vec<usize> = (0..robots).collect();
        let judged = in_parallel(jobs, &indices, || Ok(()), judge).expect("cannot fail");
        for &proposer in &proposers {
            let all: Vec<(usize, StudyResult)> =
                (0..robots).flat_map(|t| of(t, proposer).into_iter().map(move |result| (t, result))).collect();
            let of_all =
                |value: &dyn Fn(&StudyResult) -> f64| mean(&all.iter().map(|(_, r)| value(r)).collect::<Vec<_>>());
            // Empty after more jumps than the studies have.
            let value = |i: usize| {
                let (mean, error) = of_all(&|result| result.best[i]);
                if is_reached(i) { format!("{mean:.3} ± {error:.3}") } else { String::new() }
            };
            let falls = |i: usize| {
                if is_reached(i) { format!("{:.2}", of_all(&|result| result.falls[i]).0) } else { String::new() }
            };
            let values: Vec<String> = (0..AFTER.len()).map(value).collect();
            let at_best =
                |(t, r): &&(usize, StudyResult)| r.best[..3].iter().any(|best| *best >= REACHED * judged[*t].0.optimum);
            let jumped = judged.iter().flat_map(|(_, early)| early).filter(|(of, early)| *of == proposer && *early);
            let share = |count: usize| 100.0 * count as f64 / all.len() as f64;
            println!(
                "| {} | {} | {} | {} | {} | {:.0} % | {:.0} % |",
                task.name,
                proposer.name(),
                values.join(" | "),
                falls(2),
                falls(4),
                share(all.iter().filter(at_best).count()),
                share(jumped.count())
            );
        }
        // The studies of a robot resemble each other: a robot is one observation.
        let compare = |a: (Proposer, usize), b: (Proposer, usize)| {
            let of_robot = |robot: usize, (proposer, after): (Proposer, usize)| {
                mean(&of(robot, proposer).iter().map(|result| result.best[after]).collect::<Vec<_>>()).0
            };
            let differences: Vec<f64> = (0..robots).map(|robot| of_robot(robot, a) - of_robot(robot, b)).collect();
            let (mean, error) = mean(&differences);
            format!(
                "- {}: {} after {} less {} after {}: {mean:+.3} ± {error:.3}, p = {:.3}\n",
                task.name,
                a.0.name(),
                AFTER[a.1],
                b.0.name(),
                AFTER[b.1],
                p_value(&differences)
            )
        };
        let pairs = [
            ((Proposer::Sim, 2), (Proposer::Gp, 4)),
            ((Proposer::SimMirrored, 3), (Proposer::Gp, 3)),
            ((Proposer::Gp, 4), (Proposer::Tpe, 4)),
        ];
        let is_there = |(proposer, after): (Proposer, usize)| proposers.contains(&proposer) && is_reached(after);
        notes.extend(pairs.iter().filter(|(a, b)| is_there(*a) && is_there(*b)).map(|(a, b)| compare(*a, *b)));
        for (target, (Attainable { optimum, long }, _)) in targets.iter().zip(&judged) {
            eprintln!(
                "{} {}: best known {optimum:.3}, of {LONG} jumps {long:.3}, {:?}",
                task.name, target.name, target.properties
            );
        }
    }
    if !notes.is_empty() {
        println!(
            "\nDifferences of the means of each robot: mean and standard error over the robots, paired two-sided t-test:\n\n{notes}"
        );
    }
}
