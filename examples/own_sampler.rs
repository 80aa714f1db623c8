//! A sampler of one's own: the (1+1) evolution strategy. It proposes a point about the best so far, with a step that grows
//! after a success and shrinks after a failure. The study stores its points, so that Optuna and `quadfrog study` read them.
//! Prints one line per trial, and the best, beside that of the built-in sampler `gp` with as many trials.
//!
//! `cargo run --release --example own_sampler`
//!
//! A sampler that the console offers is a variant of [`SamplerKind`]; see `docs/extend/sampler.md`.

use quadfrog::config::Config;
use quadfrog::optimize::ask::{Direction, SamplerConfig, SamplerKind};
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::mt19937::Mt19937;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Outcome, Storage, Study, StudyError, StudyOptions};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::{evaluation, rollout::Rollout};
use quadfrog::sim::Simulator;
use quadfrog::trial::{Backend, JumpParameters, ParameterValues, Task};

const TRIALS: u32 = 20;

/// A point of the space: values by name, in the parameters' own units.
type Point = Vec<(String, f64)>;

/// The strategy. Positions are in the unit cube.
struct Evolution {
    random: Mt19937,
    best: Option<(Vec<f64>, f64)>,
    step: f64,
}

impl Evolution {
    /// Proposes the next point: the middle of the space first, then one about the best.
    fn propose(&mut self, space: &Space) -> Vec<f64> {
        let count = space.parameters().len();
        let Some((centre, _)) = &self.best else { return vec![0.5; count] };
        // The sum of twelve uniform numbers is normally distributed nearly enough: mean 6, deviation 1.
        let mut normal = || (0..12).map(|_| self.random.double()).sum::<f64>() - 6.0;
        centre.iter().map(|u| (u + self.step * normal()).clamp(0.0, 1.0)).collect()
    }

    /// Learns the value of a proposed point. The factors balance at one success in five trials.
    fn learn(&mut self, point: Vec<f64>, value: f64) {
        if self.best.as_ref().is_none_or(|(_, best)| value > *best) {
            self.best = Some((point, value));
            self.step = (self.step * 1.5).min(0.5);
        } else {
            self.step *= 1.5f64.powf(-0.25);
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = Config::load(None)?;
    let robot = RobotDescription::embedded("go1")?;
    let control = *config.task(Task::Forward);
    let settings = config.settings(&robot, Task::Forward, Backend::Simulator)?;
    let mut rollout = Rollout::new(Simulator::new(&robot, &config.simulator)?, &settings);
    // Length of a jump forward, m; 0 for a fall.
    let mut jump = |point: &Point| {
        let values: ParameterValues = point.iter().cloned().collect();
        let trial = control.trial(Task::Forward, JumpParameters::from_values(&values, control.f1_hz));
        evaluation::evaluate(&mut rollout, &trial).value
    };

    let mut study = open(SamplerKind::Random)?;
    let space = study.options().space.clone();
    let mut sampler = Evolution { random: Mt19937::new(0), best: None, step: 0.2 };
    for _ in 0..TRIALS {
        let unit = sampler.propose(&space);
        let named = space.parameters().iter().zip(&unit);
        let point: Point = named.map(|(p, u)| (p.name.clone(), p.range.unscale(*u))).collect();
        // Every value is given, so that the study's own sampler draws nothing.
        let number = study.begin(&study.draft_with(&point), &[], &[])?;
        let value = jump(&point);
        study.tell(number, Outcome::Complete(value))?;
        println!("trial {number:2}: {value:.3} m, step {:.3}", sampler.step);
        sampler.learn(unit, value);
    }

    let mut builtin = open(SamplerKind::Gp)?;
    for _ in 0..TRIALS {
        let number = builtin.begin(&builtin.draft(), &[], &[])?;
        let value = jump(&builtin.trial(number)?.parameters);
        builtin.tell(number, Outcome::Complete(value))?;
    }
    let best = |study: &Study| study.best().and_then(|trial| trial.value).unwrap_or(0.0);
    println!("best: own {:.3} m, gp {:.3} m", best(&study), best(&builtin));
    Ok(())
}

/// Opens a study of a jump forward in memory.
fn open(kind: SamplerKind) -> Result<Study, StudyError> {
    let ranges = [("f0", 0.75, 1.75), ("Fx", 0.0, 150.0), ("Fz", 150.0, 350.0)];
    let ranges = ranges.map(|(name, low, high)| (name.to_owned(), Range::linear(low, high)));
    let options = StudyOptions {
        name: kind.name().to_owned(),
        direction: Direction::Maximize,
        metric: "distance (m)".into(),
        space: Space::new(ranges).expect("the ranges are finite and in order"),
        sampler: SamplerConfig { kind, ..SamplerConfig::default() },
        attributes: Vec::new(),
        durability: Durability::Buffered,
    };
    Study::open(Storage::Memory, options)
}
