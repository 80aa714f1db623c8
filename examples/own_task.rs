//! A task of one's own: the highest jump on the spot. A task is a force profile and an objective; here the profile has no
//! horizontal force, and the objective is the rise of the trunk, measured from the ticks of the trial. Prints one line per
//! trial, and the best.
//!
//! `cargo run --release --example own_task`
//!
//! A task that the console offers is a variant of [`Task`]; see `docs/extend/task.md`.

use quadfrog::config::Config;
use quadfrog::optimize::ask::{Direction, SamplerConfig};
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Outcome, Storage, Study, StudyOptions};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::{objective, rollout::Rollout};
use quadfrog::sim::Simulator;
use quadfrog::telemetry::TrialEnd;
use quadfrog::trial::{Backend, JumpParameters, Task};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = Config::load(None)?;
    let robot = RobotDescription::embedded("go1")?;
    // Gains and stance are those of a jump forward.
    let control = *config.task(Task::Forward);
    let settings = config.settings(&robot, Task::Forward, Backend::Simulator)?;
    let mut rollout = Rollout::new(Simulator::new(&robot, &config.simulator)?, &settings);

    let ranges = [("f0", Range::linear(0.75, 1.75)), ("Fz", Range::linear(150.0, 350.0))];
    let options = StudyOptions {
        name: "highest-jump".into(),
        direction: Direction::Maximize,
        metric: "rise (m)".into(),
        space: Space::new(ranges.map(|(name, range)| (name.to_owned(), range)))?,
        sampler: SamplerConfig { startup_trials: Some(5), ..SamplerConfig::default() },
        attributes: Vec::new(),
        durability: Durability::Buffered,
    };
    // `Storage::File` keeps the trials as an Optuna journal.
    let mut study = Study::open(Storage::Memory, options)?;

    for _ in 0..20 {
        let draft = study.draft();
        let number = study.begin(&draft, &[], &[])?;
        let value = |name: &str| draft.parameters.iter().find(|p| p.name == name).map_or(0.0, |p| p.value);
        let jump = JumpParameters { f0_hz: value("f0"), f1_hz: control.f1_hz, fx_n: 0.0, fy_n: 0.0, fz_n: value("Fz") };
        let mut trial = control.trial(Task::Forward, jump);
        trial.seed = u64::from(number);
        let (end, ticks) = rollout.run(&trial);
        let rise_m = objective::measure(&trial.objective(), ticks).map_or(0.0, |measured| measured.apex_m);
        // A robot that does not stand at the end has not done the task.
        let stood = matches!(end, TrialEnd::Settled);
        let rise_m = if stood { rise_m } else { 0.0 };
        study.tell(number, Outcome::Complete(rise_m))?;
        println!("trial {number:2}: f0 {:.2} Hz, Fz {:3.0} N: {rise_m:.3} m", jump.f0_hz, jump.fz_n);
    }
    let best = study.best().ok_or("no trial stood")?;
    println!("best: trial {} with {:.3} m", best.number, best.value.unwrap_or(0.0));
    Ok(())
}
