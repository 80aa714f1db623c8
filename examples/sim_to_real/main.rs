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

mod results;
mod settings;
mod statistics;
mod studies;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use quadfrog::config::Config;
use quadfrog::engine::prior_plan;
use quadfrog::optimize::prior::{Prior, PriorModel};
use quadfrog::optimize::space::{Range, Space};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::prior::{PriorPlan, draw_robot, simulate};
use quadfrog::sim::ensemble::RobotProperties;
use quadfrog::trial::Task;

use results::{Compared, TaskResults};
use settings::Settings;
use studies::{
    AFTER, EARLY, Jumper, KnownTask, LONG, Proposer, REACHED, REPEATS, Target, best_of, new_study, one_jump,
};

/// Differences that are tested, where both samplers were run: the first less the second.
const COMPARED: [(Compared, Compared); 3] = [
    ((Proposer::Sim, 2), (Proposer::Gp, 4)),
    ((Proposer::SimMirrored, 3), (Proposer::Gp, 3)),
    ((Proposer::Gp, 4), (Proposer::Tpe, 4)),
];

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

/// The task with its prior, simulated on all cores.
fn known(name: &str, settings: &Settings) -> KnownTask {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let continuous = name == "continuous";
    let mut config = Config::load(continuous.then(|| root.join("examples/continuous")).as_deref()).expect("loads");
    // With its first point the study would begin at the best.
    config.optimize.first.clear();
    let task = if continuous { Task::Forward } else { name.parse().expect("`tasks` are names of tasks or continuous") };
    let robot = RobotDescription::embedded("go1").expect("embedded");
    let plan_for = |backend| prior_plan(&config, &robot, task, backend).expect("fits the robot");
    let plan = plan_for(settings.backend);
    let begun = Instant::now();
    let prior = simulate(&plan_for(settings.prior_backend), settings.jobs, &|_| {}, &AtomicBool::new(false))
        .expect("simulates");
    let simulated_s = begun.elapsed().as_secs_f64();
    let mirror = |point: &Vec<f64>| point.iter().map(|u| 1.0 - u).collect();
    let mirrored = prior.points.iter().map(mirror).collect();
    let mirrored = Prior::new(prior.parameters.clone(), mirrored, prior.worlds.clone(), prior.slip.clone());
    let space =
        Space::new(plan.parameters.iter().map(|p| (p.name.clone(), Range::linear(p.low, p.high)))).expect("a space");
    let mut sampler = config.sampler(task);
    sampler.least_p_stand = settings.least_p_stand.unwrap_or(sampler.least_p_stand);
    sampler.fall_price = settings.fall_price.unwrap_or(sampler.fall_price);
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
    let settings = Settings::from_arguments();
    println!(
        "{} robots of seed {}, three of them outside the ensemble's ranges; {} studies of {} jumps of each sampler on each robot. Value of \
         the best trial, repeated {REPEATS} times, falls as 0: mean and standard error over all studies.\n",
        settings.robots, settings.seed, settings.studies, settings.trials
    );
    println!(
        "| task | sampler | {} | falls in 5 | in 20 | best after 5 has {REACHED} of the optimum | stood in {EARLY} at {REACHED} of what {LONG} find |",
        AFTER.map(|n| format!("after {n}")).join(" | ")
    );
    println!("|---|---|{}---|---|---|", "---|".repeat(AFTER.len() + 1));
    let mut differences = String::new();
    for name in &settings.tasks {
        let task = known(name, &settings);
        let targets = targets(&task.plan, settings.robots, settings.seed, settings.torque_limit);
        let results = TaskResults::of(&task, &settings, &targets);
        settings.proposers.iter().for_each(|proposer| println!("{}", results.row(*proposer)));
        differences.extend(COMPARED.iter().filter_map(|(a, b)| results.difference(*a, *b)));
        results.robots().for_each(|robot| eprintln!("{robot}"));
    }
    if !differences.is_empty() {
        println!(
            "\nDifferences of the means of each robot: mean and standard error over the robots, paired two-sided t-test:\n\n{differences}"
        );
    }
}
