//! Claims on jumps in a row, rough terrain, transfer and landing.

use quadfrog::optimize::ask::SamplerKind;
use quadfrog::trial::Task;

use super::claim::{ClaimJudgement, PaperClaim, claims_of, mean, spread};
use super::jumps::bests;
use crate::subcommand::reproduce::configuration::ExperimentConfiguration::{self, *};
use crate::subcommand::reproduce::plan::{F1_HZ, PaperExperiment, RunPoint, THREE_TASKS};
use crate::subcommand::reproduce::results::{ReproduceResults, RunResult};

/// Most falls with Virtual Model Control: one in so many runs.
const RARE: usize = 25;

fn falls(runs: &[&RunResult]) -> usize {
    runs.iter().filter(|run| run.fell).count()
}

fn stood<'a>(runs: &'a [&RunResult]) -> impl Iterator<Item = &'a RunResult> {
    runs.iter().copied().filter(|run| !run.fell)
}

/// Returns the speeds of the runs that stand, m/s or rad/s.
fn speeds<'a>(runs: &'a [&RunResult]) -> impl Iterator<Item = f64> + 'a {
    stood(runs).filter_map(|run| run.period_s.map(|period_s| run.value / period_s))
}

pub fn continuous(results: &ReproduceResults) -> Vec<PaperClaim> {
    let first = results.runs_of(|job| job.configuration == Continuous && job.point == RunPoint::First);
    let standing = first.len() - falls(&first);
    let jumps = first.iter().map(|run| run.jumps).max().unwrap_or(0);
    let at = |f1_hz: f64| {
        let point = RunPoint::FirstWithF1(f1_hz);
        results.runs_of(|job| job.configuration == ContinuousLow && job.point == point)
    };
    let by_f1: Vec<(f64, Vec<&RunResult>)> = F1_HZ.iter().map(|&f1_hz| (f1_hz, at(f1_hz))).collect();
    let tilt = |runs: &[&RunResult]| mean(runs.iter().filter_map(|run| run.tilt_at_impulse_rad));
    let more = by_f1.first().zip(by_f1.last()).is_some_and(|((_, slow), (_, fast))| tilt(fast) > tilt(slow));
    let [fast, twist] = [ContinuousFast, ContinuousTwist]
        .map(|configuration| results.runs_of(|job| job.configuration == configuration && job.point == RunPoint::First));
    let standing_of = |runs: &[&RunResult]| format!("{} of {} runs stand", runs.len() - falls(runs), runs.len());
    let lateral = results.studies(ContinuousLateral, Task::LateralLeft, SamplerKind::Tpe);
    let lateral: Vec<f64> =
        lateral.iter().map(|study| study.best(u32::MAX).and_then(|best| best.value).unwrap_or(0.0)).collect();
    let mostly = |runs: &[&RunResult]| !runs.is_empty() && 10 * falls(runs) <= runs.len();
    let all_directions = mostly(&twist) && !lateral.is_empty() && lateral.iter().all(|value| *value > 0.0);
    let claim = claims_of(PaperExperiment::Continuous);
    vec![
        claim(
            "continuous forward jumping",
            "III, Continuous Jumping Optimization",
            "By decreasing the time between successive jumps, we are able to accomplish continuous jumping.",
            "accomplished",
            format!(
                "{standing} of {} runs of {jumps} jumps stand, {} a jump, {}",
                first.len(),
                spread(stood(&first).map(|run| run.value), 2, "m"),
                spread(speeds(&first), 2, "m/s")
            ),
            "at least 9 of 10 runs, each with its own sensor noise, stand after the last jump".to_owned(),
            ClaimJudgement::of(!first.is_empty() && 10 * standing >= 9 * first.len()),
            true,
        ),
        claim(
            "less time between the jumps",
            "III, Continuous Jumping Optimization",
            "with decreased time between jumps, the landing configuration becomes increasingly important in order for the next applied forces to be able to successfully have the same outcome between jumps",
            "landing matters more",
            by_f1
                .iter()
                .map(|(f1_hz, runs)| format!("f1 {f1_hz} Hz: tilt {:.3} rad, {} of {} fall", tilt(runs), falls(runs), runs.len()))
                .collect::<Vec<_>>()
                .join(", "),
            "the mean tilt at the start of the impulses is greater at the highest f1 than at the lowest, all other values equal".to_owned(),
            ClaimJudgement::of(more),
            false,
        ),
        claim(
            "fast continuous jumping",
            "III, Continuous Jumping Optimization",
            "This can be done by increasing the frequency f1",
            "accomplished",
            format!("{}, {}", standing_of(&fast), spread(stood(&fast).map(|run| run.value), 2, "m/s")),
            "at least 9 of 10 runs stand after the last jump".to_owned(),
            ClaimJudgement::of(mostly(&fast)),
            true,
        ),
        claim(
            "jumps in a row to the left and turning",
            "I-A",
            "Our framework allows us to rapidly optimize dynamic jumping behaviors to continuously perform forward, lateral, and twist jumps",
            "accomplished",
            format!(
                "twists: {}, {} a jump; lateral-left: best of each study {} a jump",
                standing_of(&twist),
                spread(stood(&twist).map(|run| run.value), 2, "rad"),
                spread(lateral.iter().copied(), 2, "m")
            ),
            "at least 9 of 10 runs of twists stand, and every lateral study has a trial that stands after the last jump"
                .to_owned(),
            ClaimJudgement::of(all_directions),
            false,
        ),
    ]
}

pub fn rough_terrain(results: &ReproduceResults) -> Vec<PaperClaim> {
    let on = |configuration: ExperimentConfiguration, vmc: bool| {
        results.runs_of(move |job| job.configuration == configuration && job.vmc == Some(vmc))
    };
    let of = |runs: &[&RunResult]| format!("{} of {} fall", falls(runs), runs.len());
    let rare = |runs: &[&RunResult]| ClaimJudgement::of(!runs.is_empty() && RARE * falls(runs) <= runs.len());
    let [added_on, added_off] = [true, false].map(|vmc| on(RoughTerrain, vmc));
    let [paper_on, paper_off] = [true, false].map(|vmc| on(RoughTerrainPaper, vmc));
    let often = |runs: &[&RunResult]| !runs.is_empty() && 5 * falls(runs) >= 4 * runs.len();
    let tilt = |runs: &[&RunResult]| mean(runs.iter().filter_map(|run| run.tilt_at_impulse_rad));
    let flat = mean(on(RoughTerrainFlat, true).iter().map(|run| run.value));
    let rough = mean(stood(&added_on).map(|run| run.value));
    let time = |runs: &[&RunResult]| spread(runs.iter().filter_map(|run| run.fall_time_s), 1, "s");
    let claim = |name, sentence, paper, ours, criterion: &str, judgement, short| PaperClaim {
        experiment: PaperExperiment::RoughTerrain,
        name,
        place: "III, Rough Terrain Adaptation; Fig. 9",
        sentence,
        paper,
        ours,
        criterion: criterion.to_owned(),
        judgement,
        short,
    };
    const RULE: &str = "at most 1 run in 25 falls within 12 s of jumps";
    const ROBUST: &str = "Our controller is robust to such disturbances for omnidirectional jumps";
    vec![
        claim(
            "blocks, with Virtual Model Control, the paper's controller",
            ROBUST,
            "no fall shown",
            of(&paper_on),
            RULE,
            rare(&paper_on),
            true,
        ),
        claim(
            "blocks, with Virtual Model Control and added terms",
            ROBUST,
            "no fall shown",
            of(&added_on),
            RULE,
            rare(&added_on),
            true,
        ),
        claim(
            "blocks, without Virtual Model Control",
            "We tested removing the VMC while jumping forward on the rough terrain, and after a few jumps [...] causing a fall",
            "a fall at 8.3 s",
            format!(
                "{}, after {}; with added terms {}, after {}",
                of(&paper_off),
                time(&paper_off),
                of(&added_off),
                time(&added_off)
            ),
            "at least 4 runs in 5 fall, with and without the added terms",
            ClaimJudgement::of(often(&paper_off) && often(&added_off)),
            true,
        ),
        claim(
            "tilt at the start of the impulses",
            "keeping the feet at their nominal heights in contact phase despite the uneven terrain caused a large initial roll angle during take-off",
            "larger without",
            format!("{:.3} rad with, {:.3} rad without", tilt(&added_on), tilt(&added_off)),
            "the mean tilt without Virtual Model Control is at least twice that with it",
            ClaimJudgement::of(tilt(&added_off) >= 2.0 * tilt(&added_on)),
            false,
        ),
        claim(
            "distance on blocks against flat ground",
            "as can be expected, the noise can cause the robot to not jump as far or turn as much as in nominal conditions",
            "less far",
            format!("{rough:.3} m a jump on blocks, {flat:.3} m on flat ground"),
            "the mean of the runs that stand is less than on flat ground",
            ClaimJudgement::of(rough < flat),
            false,
        ),
    ]
}

pub fn transfer(results: &ReproduceResults) -> Vec<PaperClaim> {
    let trials = results.size.side_trials;
    let ideal = |task| mean(bests(results, Ideal, task, trials));
    let cold = |task| mean(bests(results, HardwareLike, task, trials));
    // A fall counts with 0.
    let moved = |task| mean(results.transferred(task).iter().map(|run| run.value));
    let after = |task, warm, trials: u32| {
        let studies = results.studies_from(HardwareLike, task, SamplerKind::Tpe, warm);
        mean(studies.iter().filter_map(|study| study.best_so_far(trials).last().copied()))
    };
    let each =
        |text: &dyn Fn(Task) -> String| THREE_TASKS.map(|task| format!("{} {}", task.name(), text(task))).join(", ");
    let fell = each(&|task| {
        let runs = results.transferred(task);
        format!("{} of {}", falls(&runs), runs.len())
    });
    let turn = Task::TwistCcw;
    let claim = |name, place, sentence, paper, ours, criterion: String, judgement| PaperClaim {
        experiment: PaperExperiment::Transfer,
        name,
        place,
        sentence,
        paper,
        ours,
        criterion,
        judgement,
        short: false,
    };
    vec![
        claim(
            "turn, ideal against hardware-like",
            "III, Optimization Convergence",
            "Due to the motor dynamics and coefficient of friction causing the feet to slip at take-off, the robot cannot rotate as much during the twist jump on the hardware compared to in simulation.",
            "less on hardware",
            format!(
                "{:.2} rad ideal, {:.2} rad optimized hardware-like, {:.2} rad of the ideal's points",
                ideal(turn),
                cold(turn),
                moved(turn)
            ),
            "both hardware-like means are less than the ideal".to_owned(),
            ClaimJudgement::of(cold(turn) < ideal(turn) && moved(turn) < ideal(turn)),
        ),
        claim(
            "optimized on the machine against transferred",
            "I-A",
            "this allows us to optimize directly on the real system without any dynamics uncertainties or mismatches",
            "better on the machine",
            format!(
                "{}; falls of the transferred points {fell}",
                each(&|task| format!("{:.2} against {:.2} {}", cold(task), moved(task), task.unit()))
            ),
            format!(
                "in each task the mean best of {trials} trials in the hardware-like simulation is greater than the mean of the ideal simulation's best points there, falls with 0"
            ),
            ClaimJudgement::of(THREE_TASKS.iter().all(|&task| cold(task) > moved(task))),
        ),
        claim(
            "warm against cold start after 5 trials",
            "III, Implementation Details",
            "Initial tests and optimizations are carried out in simulation in Gazebo before moving to hardware.",
            "no figure",
            format!(
                "after 5: {}; after {trials}: {}",
                each(&|task| format!(
                    "{:.2} against {:.2} {}",
                    after(task, Some(Ideal), 5),
                    after(task, None, 5),
                    task.unit()
                )),
                each(&|task| format!(
                    "{:.2} against {:.2}",
                    after(task, Some(Ideal), trials),
                    after(task, None, trials)
                )),
            ),
            "the paper gives no figure of a start from simulated results".to_owned(),
            ClaimJudgement::NotComparable,
        ),
    ]
}

pub fn landing(results: &ReproduceResults) -> Vec<PaperClaim> {
    let trials = results.size.side_trials;
    let of = |configuration: ExperimentConfiguration| {
        let tasks = THREE_TASKS.map(|task| {
            let studies = results.studies(configuration, task, SamplerKind::Tpe);
            let fell: usize = studies.iter().map(|study| study.falls(trials)).sum();
            let all: usize = studies.iter().map(|study| study.counted(trials).count()).sum();
            let best = mean(studies.iter().filter_map(|study| study.best(trials)?.value));
            format!("{} {best:.2} {}, {fell} of {all} fall", task.name(), task.unit())
        });
        tasks.join("; ")
    };
    let pairs = [
        ("ideal", Ideal, StableLanding),
        ("hardware-like with the estimator", HardwareLikeEstimate, StableLandingEstimate),
    ];
    let claim = |(name, without, with): (&'static str, ExperimentConfiguration, ExperimentConfiguration)| PaperClaim {
        experiment: PaperExperiment::Landing,
        name: if name == "ideal" { "added terms, ideal" } else { "added terms, hardware-like with the estimator" },
        place: "IV",
        sentence: "Another direction could be to integrate a landing controller to dampen the impact",
        paper: "future work",
        ours: format!("with: {}. Without: {}", of(with), of(without)),
        criterion: "future work in the paper, without a figure".to_owned(),
        judgement: ClaimJudgement::NotComparable,
        short: false,
    };
    pairs.map(claim).to_vec()
}
