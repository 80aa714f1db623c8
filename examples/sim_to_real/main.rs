//! Prints the table "Other simulated robots" of `src/optimize/README.md`: studies of the samplers on robots that are no members of
//! the prior's ensemble.
//!
//! `cargo run --release --example sim_to_real [KEY=VALUE...]`, keys `tasks`, `samplers` (lists with commas), `robots`, `studies`,
//! `trials`, `seed`, `long_pairs` (pairs of studies of 100 jumps on each robot; 0: none), `jobs`, `least_p_stand` and `fall_price` (left
//! out: those of the task's configuration), `backend` (`sim` or `hardware`, where the robots are controlled and judged by the estimate),
//! `prior_backend` (left out: the same), `torque_limit` (a share for all robots; left out: drawn). Twelve robots: nine drawn from the
//! ranges of `config/prior.toml` and three outside of them.
//!
//! A robot's value after n jumps is that of the trial that the study then calls its best, repeated [`REPEATS`] times with other
//! noise, falls as 0. Its optimum is chosen and valued by independent repeats ([`attainable`]): the largest of many noisy values would be
//! too high. Two shares of the studies are printed: those whose best trial after 1, 3 or 5 jumps has 95 % of this optimum, the best of
//! all studies on the robot, and those that stood in one of five jumps at a point with 95 % of what 100 jumps find
//! ([`studies::Attainable`]). Standard error says how far the work is.

mod statistics;
mod studies;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use quadfrog::config::Config;
use quadfrog::engine::prior_plan;
use quadfrog::optimize::prior::{Prior, PriorModel};
use quadfrog::optimize::space::{Range, Space};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::parallel::{cores, in_parallel};
use quadfrog::session::prior::{PriorPlan, draw_robot, simulate};
use quadfrog::sim::ensemble::RobotProperties;
use quadfrog::trial::{Backend, Task};

use statistics::{mean, p_value};
use studies::{
    AFTER, Attainable, EARLY, Job, Jumper, KnownTask, LONG, LONG_PROPOSERS, LONG_SEED, NEAR, OPTIMUM_REPEATS, Proposer,
    REACHED, REPEATS, StudyResult, Target, attainable, best_of, new_study, one_jump, run,
};

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

fn main() {
    let mut settings: BTreeMap<String, String> = [
        ("tasks", "forward,lateral-left,twist-ccw,continuous"),
        ("samplers", "sim,gp,tpe,ideal best, then gp"),
        ("robots", "12"),
        ("studies", "20"),
        ("trials", "20"),
        ("seed", "9000"),
        ("long_pairs", "4"),
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
    let long_pairs = number("long_pairs");
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
            work.extend((LONG_SEED..).take(long_pairs).flat_map(long));
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
            let mut reaches =
                |(point, value): &(Vec<_>, f64)| *value >= NEAR * best && jumper.reaches(point, again, REACHED * best);
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
            let share = |count: usize| format!("{:.0} %", 100.0 * count as f64 / all.len() as f64);
            let share_of_long = if long_pairs == 0 { String::new() } else { share(jumped.count()) };
            println!(
                "| {} | {} | {} | {} | {} | {} | {} |",
                task.name,
                proposer.name(),
                values.join(" | "),
                falls(2),
                falls(4),
                share(all.iter().filter(at_best).count()),
                share_of_long
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
            let of_long = if long_pairs == 0 { String::new() } else { format!(", of {LONG} jumps {long:.3}") };
            eprintln!("{} {}: best known {optimum:.3}{of_long}, {:?}", task.name, target.name, target.properties);
        }
    }
    if !notes.is_empty() {
        println!(
            "\nDifferences of the means of each robot: mean and standard error over the robots, paired two-sided t-test:\n\n{notes}"
        );
    }
}
