//! Claims on studies of single jumps.

use std::f64::consts::TAU;

use quadfrog::optimize::ask::SamplerKind;
use quadfrog::robot::description::RobotDescription;
use quadfrog::trial::{Task, Verdict};

use super::claim::{ClaimJudgement, PaperClaim, REACHED, claims_of, mean, robot_value, spread};
use crate::subcommand::reproduce::configuration::ExperimentConfiguration::{self, *};
use crate::subcommand::reproduce::plan::{PAPER_POINT_F0_HZ, PAPER_TRIALS, PaperExperiment, RunPoint, THREE_TASKS};
use crate::subcommand::reproduce::results::{ReproduceResults, TrialResult};

/// Largest Fz of the paper's Table I, N.
const MOST_FZ_N: f64 = 350.0;

fn value(trial: &&TrialResult) -> f64 {
    trial.value.unwrap_or(0.0)
}

/// Returns a quantity of the best trial of each study of a task; 0 of a study in which nothing stood.
fn of_bests(
    results: &ReproduceResults,
    (configuration, task, trials): (ExperimentConfiguration, Task, u32),
    of: &dyn Fn(&&TrialResult) -> f64,
) -> Vec<f64> {
    let studies = results.studies(configuration, task, SamplerKind::Tpe);
    studies.iter().map(|study| study.best(trials).map_or(0.0, |best| of(&best))).collect()
}

/// Returns the best values of the studies of a task, as [`of_bests`].
pub(super) fn bests(
    results: &ReproduceResults,
    configuration: ExperimentConfiguration,
    task: Task,
    trials: u32,
) -> Vec<f64> {
    of_bests(results, (configuration, task, trials), &value)
}

pub fn convergence(results: &ReproduceResults) -> Vec<PaperClaim> {
    let trials = results.size.convergence_trials;
    let of = |task, sampler, trials| -> Vec<f64> {
        let studies = results.studies(Ideal, task, sampler);
        studies.iter().map(|study| study.best_so_far(trials).last().copied().unwrap_or(0.0)).collect()
    };
    let all: Vec<(Task, f64)> = THREE_TASKS
        .iter()
        .flat_map(|&task| of(task, SamplerKind::Tpe, trials).into_iter().map(move |value| (task, value)))
        .collect();
    let successful = all.iter().filter(|(task, value)| *value >= 0.5 * robot_value(*task)).count();
    let each =
        |text: &dyn Fn(Task) -> String| THREE_TASKS.map(|task| format!("{} {}", task.name(), text(task))).join(", ");
    let at_paper = |task| mean(of(task, SamplerKind::Tpe, PAPER_TRIALS)) / mean(of(task, SamplerKind::Tpe, trials));
    let longer = trials > PAPER_TRIALS;
    let final_mean = |task, sampler| mean(of(task, sampler, trials));
    let better =
        THREE_TASKS.iter().all(|&task| final_mean(task, SamplerKind::Tpe) > final_mean(task, SamplerKind::Random));
    let claim = claims_of(PaperExperiment::Convergence);
    vec![
        claim(
            "successful studies, ideal simulation",
            "Fig. 5",
            "All runs result in successful jumping.",
            "15 of 15",
            format!("{successful} of {}", all.len()),
            "the best trial of every study stands and reaches at least half of what the paper reports of the robot (0.5 m forward, 0.3 m lateral, 2 rad)".to_owned(),
            ClaimJudgement::of(successful == all.len() && !all.is_empty()),
            true,
        ),
        claim(
            "share of the final value after 20 trials",
            "III, Optimization Convergence",
            "In all cases, we can observe the rapid convergence and improvement of the quadruped's ability to jump forward, laterally, and twist-turn.",
            "rapid",
            if longer { format!("{} of that after {trials}", each(&|task| format!("{:.0} %", 100.0 * at_paper(task)))) } else { "-".to_owned() },
            if longer {
                "the mean best of each task after 20 trials is at least 90 % of that at the end".to_owned()
            } else {
                format!("studies of {trials} trials do not show how it goes on after 20")
            },
            if longer { ClaimJudgement::of(THREE_TASKS.iter().all(|&task| at_paper(task) >= REACHED)) } else { ClaimJudgement::NotComparable },
            true,
        ),
        claim(
            "TPE against random search",
            "II-D",
            "TPE adaptively selects and evaluates candidate configurations that are more likely to improve the objective, which makes it highly sample-efficient.",
            "TPE better",
            each(&|task| format!("{:.3} against {:.3} {}", final_mean(task, SamplerKind::Tpe), final_mean(task, SamplerKind::Random), task.unit())),
            format!("the mean best after {trials} trials is greater than that of random search in each task"),
            ClaimJudgement::of(better),
            false,
        ),
    ]
}

pub fn hardware_like(results: &ReproduceResults) -> Vec<PaperClaim> {
    let trials = results.size.trials;
    let both = |task: Task, of: &dyn Fn(&&TrialResult) -> f64, digits: usize, unit: &str| {
        let [truth, estimate] = [HardwareLike, HardwareLikeEstimate]
            .map(|configuration| spread(of_bests(results, (configuration, task, trials), of), digits, unit));
        format!("{truth}; with the estimator {estimate}")
    };
    let reached = |task: Task, of: &dyn Fn(&&TrialResult) -> f64, least: f64| {
        ClaimJudgement::of(
            [HardwareLike, HardwareLikeEstimate]
                .iter()
                .all(|&configuration| mean(of_bests(results, (configuration, task, trials), of)) >= REACHED * least),
        )
    };
    let rise = |trial: &&TrialResult| trial.rise_m();
    let angle_deg = |trial: &&TrialResult| trial.force_angle_rad().to_degrees();
    let turns = [HardwareLike, HardwareLikeEstimate]
        .map(|configuration| bests(results, configuration, Task::TwistCcw, trials))
        .concat();

    let over = |least: &str| {
        format!(
            "the mean best of the studies is at least 90 % of {least}, with the true state and with the estimator's"
        )
    };
    let forward = results.bests(HardwareLike, Task::Forward, trials);
    let below = forward.iter().filter(|best| best.param("Fz") <= 0.95 * MOST_FZ_N).count();
    let learned = |(first, last): (u32, u32)| {
        let studies = results.studies(HardwareLike, Task::Forward, SamplerKind::Tpe);
        let values =
            studies.iter().flat_map(|study| study.counted(trials).skip(first as usize).take((last - first) as usize));
        mean(values.map(|trial| trial.value.unwrap_or(0.0)))
    };
    let half = trials / 2;
    let (early, late) = (learned((0, half)), learned((half, trials)));
    let ideal_and_like =
        |task| (mean(bests(results, Ideal, task, trials)), mean(bests(results, HardwareLike, task, trials)));
    let farther = THREE_TASKS.iter().all(|&task| {
        let (ideal, like) = ideal_and_like(task);
        ideal > like
    });
    let compared = THREE_TASKS.map(|task| {
        let (ideal, like) = ideal_and_like(task);
        format!("{} {ideal:.2} against {like:.2} {}", task.name(), task.unit())
    });
    let angle = mean(forward.iter().map(angle_deg));
    let claim = claims_of(PaperExperiment::HardwareLike);
    const CONVERGENCE: &str = "III, Optimization Convergence";
    vec![
        claim(
            "forward, 20 trials, hardware-like simulation",
            CONVERGENCE,
            "we see rapid convergence to being able to jump 0.5 m forward",
            "0.5 m",
            both(Task::Forward, &value, 2, "m"),
            over("0.5 m"),
            reached(Task::Forward, &value, 0.5),
            true,
        ),
        claim(
            "rise of the forward jump, hardware-like simulation",
            "abstract; IV",
            "jumping forward (0.5 m in height, 0.5 m in distance)",
            "0.5 m",
            both(Task::Forward, &rise, 2, "m"),
            over("0.5 m"),
            reached(Task::Forward, &rise, 0.5),
            true,
        ),
        claim(
            "lateral, 20 trials, hardware-like simulation",
            "Fig. 1",
            "lateral jumping 0.3 m",
            "0.3 m",
            both(Task::LateralLeft, &value, 2, "m"),
            over("0.3 m"),
            reached(Task::LateralLeft, &value, 0.3),
            true,
        ),
        claim(
            "twist, 20 trials, hardware-like simulation",
            "abstract; Fig. 1",
            "jump-turn over 2 rad",
            "over 2 rad",
            both(Task::TwistCcw, &value, 2, "rad"),
            "the best of every study turns by more than 2 rad".to_owned(),
            ClaimJudgement::of(!turns.is_empty() && turns.iter().all(|turn| *turn > 2.0)),
            true,
        ),
        claim(
            "take-off angle of the force",
            CONVERGENCE,
            "corresponding to an overall take-off angle (from the force direction) of approximately 60 degrees",
            "60 degrees",
            spread(forward.iter().map(angle_deg), 0, "degrees"),
            "the mean of the best forward trials is within 10 degrees of 60".to_owned(),
            ClaimJudgement::of((angle - 60.0).abs() <= 10.0),
            false,
        ),
        claim(
            "Fz of the best forward trials",
            CONVERGENCE,
            "The best jumps can be seen when Fz is not at its maximum.",
            "below 350 N",
            spread(forward.iter().map(|best| best.param("Fz")), 0, "N"),
            format!("Fz of the best of every study is at most 95 % of {MOST_FZ_N} N"),
            ClaimJudgement::of(
                below == results.studies(HardwareLike, Task::Forward, SamplerKind::Tpe).len() && below > 0,
            ),
            false,
        ),
        claim(
            "forward value, later against earlier trials",
            CONVERGENCE,
            "We observe that the objective value increases during the training",
            "increases",
            format!("{early:.2} m in the first half, {late:.2} m in the second"),
            "the mean J, falls with 0, is greater in the second half of the trials".to_owned(),
            ClaimJudgement::of(late > early),
            false,
        ),
        claim(
            "ideal against hardware-like",
            CONVERGENCE,
            "Due to the ideal modeling (i.e. motors are not modeled, the feet do not slip as the coefficient of friction is high), the robot can typically jump farther and better in simulation.",
            "ideal farther",
            compared.join(", "),
            format!("the mean best after {trials} trials is greater in the ideal simulation in each task"),
            ClaimJudgement::of(farther),
            false,
        ),
        paper_point(results),
    ]
}

/// The best point of the robot in the paper, whose f0 is in a figure only.
fn paper_point(results: &ReproduceResults) -> PaperClaim {
    let at = PAPER_POINT_F0_HZ.map(|f0_hz| {
        let runs =
            results.runs_of(|job| matches!(&job.point, RunPoint::Given(values) if values.get("f0") == Some(f0_hz)));
        let falls = runs.iter().filter(|run| run.fell).count();
        let stood = spread(runs.iter().filter(|run| !run.fell).map(|run| run.value), 2, "m");
        format!("f0 {f0_hz} Hz: {falls} of {} fall, the others {stood}", runs.len())
    });
    PaperClaim {
        experiment: PaperExperiment::HardwareLike,
        name: "the robot's best point",
        place: "III, Optimization Convergence",
        sentence: "the best jump occurs at Trial 17, where Fx = 140 N and Fz = 239 N",
        paper: "0.5 m",
        ours: at.join("; "),
        criterion: "the f0 of that trial is in Fig. 6 only, which is not in the paper's text".to_owned(),
        judgement: ClaimJudgement::NotComparable,
        short: false,
    }
}

pub fn high_twist(results: &ReproduceResults) -> Vec<PaperClaim> {
    let trials = results.size.twist_trials;
    let studies = results.studies(HighTwist, Task::TwistCcw, SamplerKind::Tpe);
    let bests: Vec<&TrialResult> = studies.iter().filter_map(|study| study.best(trials)).collect();
    let both = bests.iter().filter(|best| value(best) > TAU && best.rise_m() >= 0.67).count();
    let limit = RobotDescription::embedded("go1").map(|robot| robot.limits.max_torque).unwrap_or_default();
    let torques: Vec<[f64; 3]> =
        bests.iter().filter_map(|best| best.effort).map(|effort| effort.peak_torque_n_m).collect();
    let within = torques.iter().all(|torque| torque.iter().zip(limit).all(|(torque, limit)| *torque <= limit + 1e-6));
    let most = |joint: usize| torques.iter().map(|torque| torque[joint]).fold(0.0, f64::max);
    let speed = bests.iter().filter_map(|best| best.effort).map(|effort| effort.joint_speed_rad_s).fold(0.0, f64::max);
    let claim = |name, sentence, paper, ours, criterion: String, judgement, short| PaperClaim {
        experiment: PaperExperiment::HighTwist,
        name,
        place: "III, Optimization Convergence; Fig. 8",
        sentence,
        paper,
        ours,
        criterion,
        judgement,
        short,
    };
    vec![
        claim(
            "high twist, ideal simulation",
            "the robot is able to optimize a twist-turn jump of 0.67 m in height and over 360 degrees in rotation in simulation",
            "over 6.28 rad, 0.67 m",
            format!(
                "{}, rise {}",
                spread(bests.iter().map(value), 2, "rad"),
                spread(bests.iter().map(|best| best.rise_m()), 2, "m")
            ),
            format!(
                "the best of each of the {} studies of {trials} trials turns by more than 2 pi rad and rises by at least 0.67 m",
                studies.len()
            ),
            ClaimJudgement::of(both == studies.len() && both > 0),
            true,
        ),
        claim(
            "torques of the high twist",
            "while respecting the torque limits of the robot",
            "within limits",
            format!("hip {:.1}, thigh {:.1}, calf {:.1} N m; joints up to {speed:.0} rad/s", most(0), most(1), most(2)),
            format!("no torque of the best trials exceeds {:.1}, {:.1}, {:.2} N m", limit[0], limit[1], limit[2]),
            ClaimJudgement::of(within && !torques.is_empty()),
            false,
        ),
    ]
}

pub fn directions(results: &ReproduceResults) -> Vec<PaperClaim> {
    let trials = results.size.side_trials;
    let of = |task| bests(results, HardwareLike, task, trials);
    let fell = |task| {
        let studies = results.studies(HardwareLike, task, SamplerKind::Tpe);
        studies
            .iter()
            .flat_map(|study| study.counted(trials))
            .filter(|trial| trial.verdict == Some(Verdict::Fall))
            .count()
    };
    let all = Task::ALL.iter().all(|&task| {
        let values = of(task);
        !values.is_empty() && values.iter().all(|value| *value >= 0.5 * robot_value(task))
    });
    let ours =
        Task::ALL.map(|task| format!("{} {} ({} falls)", task.name(), spread(of(task), 2, task.unit()), fell(task)));
    vec![PaperClaim {
        experiment: PaperExperiment::Directions,
        name: "five directions, hardware-like",
        place: "abstract",
        sentence: "this control architecture is capable of diverse and omnidirectional jumps including forward, lateral, and twist (turning) jumps",
        paper: "all directions",
        ours: ours.join(", "),
        criterion: format!(
            "the best of every study of {trials} trials reaches at least half of what the paper reports of the robot"
        ),
        judgement: ClaimJudgement::of(all),
        short: false,
    }]
}
