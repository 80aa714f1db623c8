//! Studies as a report takes them, and statistics over several seeds.

use super::configuration::ChangedKey;
use super::jump::force_angle_rad;
use super::recorded::{RecordedTrial, Recordings};
use crate::optimize::ask::Direction;
use crate::robot::description::RobotDescription;
use crate::trial::{ExpectedResult, JumpParameters, ParameterInfo, PredictedTrial, Task, TrialRecord, Verdict};

/// A study with everything that its report shows.
#[derive(Debug, Clone)]
pub struct ReportedStudy {
    /// Folder, journal or address.
    pub place: String,
    /// Name in its journal.
    pub name: String,
    /// Task; none for a study of another program.
    pub task: Option<Task>,
    /// Seed; none for a study of another program.
    pub seed: Option<u32>,
    /// Robot model and backend as text, for example `go1, simulated`.
    pub robot: String,
    /// Whether J is minimised, as another program's may be.
    pub direction: Direction,
    /// Unit of J; empty for a study of another program.
    pub unit: String,
    /// Most jumps in a row of a trial.
    pub jumps: u32,
    /// Frequency of the pause where it is no parameter, Hz.
    pub f1_hz: f64,
    /// Parameters with their bounds.
    pub parameters: Vec<ParameterInfo>,
    /// Trials by number, and the proposals that were not run.
    pub rows: Vec<TrialRecord>,
    /// Number of the best trial.
    pub best: Option<u32>,
    /// Gains of the best trial that differ from the configured ones, in words; empty where none does.
    pub other_gains_of_best: String,
    /// Result of the newest confirmation of the best, a sentence without its end; none without one.
    pub confirmation: Option<String>,
    /// Parameters that the operator has fixed for some trials, each a sentence without its end.
    pub fixed: Vec<String>,
    /// The best trial by the sampler's model; none without one.
    pub model_best: Option<PredictedTrial>,
    /// Largest torque of hip, thigh and calf, N m, and their no-load speeds, rad/s; none for an unknown robot.
    pub limits: Option<[[f64; 3]; 2]>,
    /// Recorded trials.
    pub recordings: Recordings,
    /// Keys that differ from the defaults.
    pub changed: Vec<ChangedKey>,
    /// Name and text of the files of its configuration; empty where none was kept.
    pub configuration: Vec<(String, String)>,
}

impl ReportedStudy {
    /// Short label: seed, or the name in the journal.
    pub fn label(&self) -> String {
        self.seed.map_or_else(|| self.name.clone(), |seed| format!("seed {seed}"))
    }

    /// Returns a trial.
    pub fn row(&self, trial: u32) -> Option<&TrialRecord> {
        self.rows.iter().find(|row| row.trial == trial)
    }

    /// The best trial.
    pub fn best_row(&self) -> Option<&TrialRecord> {
        self.row(self.best?)
    }

    /// Whether ticks of a trial are recorded; those of one that ended before the impulse hold no jump.
    pub fn has_ticks_of(&self, trial: u32) -> bool {
        self.recorded(trial).is_some() || self.recordings.with_ticks.contains(&trial)
    }

    /// Returns in words whether the ticks of a trial are recorded.
    pub fn ticks_of(&self, trial: u32) -> &'static str {
        match self.has_ticks_of(trial) {
            true if self.recordings.in_part.contains(&trial) => "in part",
            true => "yes",
            false => "no",
        }
    }

    /// A trial's jump, if its ticks were recorded.
    pub fn recorded(&self, trial: u32) -> Option<&RecordedTrial> {
        self.recordings.trials.get(&trial)
    }

    /// Trials without the proposals that were not run.
    pub fn trials(&self) -> impl Iterator<Item = &TrialRecord> {
        self.rows.iter().filter(|row| !row.was_not_run())
    }

    /// Trials that ran and have that verdict.
    pub fn with(&self, verdict: Verdict) -> impl Iterator<Item = &TrialRecord> {
        self.trials().filter(move |row| row.verdict == Some(verdict))
    }

    /// Trials that count.
    pub fn counted(&self) -> impl Iterator<Item = &TrialRecord> {
        self.rows.iter().filter(|row| row.counts())
    }

    /// Trials of which the sampler's model expected something before they ran.
    pub fn expecting(&self) -> impl Iterator<Item = (&TrialRecord, &ExpectedResult)> {
        self.counted().filter_map(|row| Some((row, row.expected.as_ref()?)))
    }

    /// Best accepted value after each trial that counts; not a number before the first accepted trial.
    pub fn best_so_far(&self) -> Vec<f64> {
        self.best_so_far_rows().map(|best| best.and_then(|row| row.value).unwrap_or(f64::NAN)).collect()
    }

    /// The accepted trial of the best value after each trial that counts; none before the first accepted one.
    pub fn best_so_far_rows(&self) -> impl Iterator<Item = Option<&TrialRecord>> {
        let mut best: Option<(f64, &TrialRecord)> = None;
        self.counted().map(move |row| {
            if let Some(value) = row.value.filter(|_| row.verdict == Some(Verdict::Accept))
                && best.is_none_or(|(most, _)| self.direction.best_first(value, most).is_lt())
            {
                best = Some((value, row));
            }
            best.map(|(_, row)| row)
        })
    }

    /// The force profile of a trial.
    pub fn jump(&self, row: &TrialRecord) -> JumpParameters {
        JumpParameters::from_values(&row.parameters, self.f1_hz)
    }

    /// Angle of the profile's force from the horizontal, rad; none for a trial without force.
    pub fn force_angle_rad(&self, row: &TrialRecord) -> Option<f64> {
        row.parameters.get("Fz")?;
        Some(force_angle_rad(&self.jump(row), self.task?))
    }
}

/// Returns the largest torques and the no-load speeds of hip, thigh and calf, the smallest of the four legs.
pub fn limits_of(robot: &RobotDescription) -> [[f64; 3]; 2] {
    let least = |joints: &[f64]| {
        std::array::from_fn(|kind| joints.iter().skip(kind).step_by(3).copied().fold(f64::INFINITY, f64::min))
    };
    [least(&robot.limits.max_torque), least(&robot.limits.max_velocity)]
}

/// Studies whose values can be compared: of one task, one unit of J, and either of one jump or of jumps in a row.
#[derive(Debug, Clone)]
pub struct StudyGroup<'a> {
    /// Name of the task, with the unit and the kind where other groups of the task differ in them; or of a study of another program.
    pub name: String,
    /// Studies, at least one.
    pub studies: Vec<&'a ReportedStudy>,
}

impl StudyGroup<'_> {
    /// Name with the unit of J.
    pub fn name_with_unit(&self) -> String {
        let unit = &self.studies[0].unit;
        let is_named = unit.is_empty() || self.name.ends_with(&in_unit(unit));
        if is_named { self.name.clone() } else { format!("{} ({unit})", self.name) }
    }
}

fn in_unit(unit: &str) -> String {
    format!(" in {unit}")
}

/// Returns the groups of the studies in the order of the tasks; studies of other programs come last, each by itself.
pub fn groups(studies: &[ReportedStudy]) -> Vec<StudyGroup<'_>> {
    let of_task = |task: Task| {
        let mut kinds: Vec<(&str, bool, Vec<&ReportedStudy>)> = Vec::new();
        for study in studies.iter().filter(|study| study.task == Some(task)) {
            let (unit, in_a_row) = (study.unit.as_str(), study.jumps > 1);
            match kinds.iter_mut().find(|kind| (kind.0, kind.1) == (unit, in_a_row)) {
                Some(kind) => kind.2.push(study),
                None => kinds.push((unit, in_a_row, vec![study])),
            }
        }
        let several_units = kinds.iter().any(|kind| kind.0 != kinds[0].0);
        let several_kinds = kinds.iter().any(|kind| kind.1 != kinds[0].1);
        let group = move |(unit, in_a_row, studies): (&str, bool, _)| {
            let kind = match in_a_row {
                _ if !several_kinds => "",
                true => " of jumps in a row",
                false => " of one jump",
            };
            let unit = if several_units { in_unit(unit) } else { String::new() };
            StudyGroup { name: format!("{}{kind}{unit}", task.name()), studies }
        };
        kinds.into_iter().map(group)
    };
    let others = studies.iter().filter(|study| study.task.is_none());
    let others = others.map(|study| StudyGroup { name: study.name.clone(), studies: vec![study] });
    Task::ALL.into_iter().flat_map(of_task).chain(others).collect()
}

/// Mean and standard deviation of a sample (n - 1); the deviation is 0 for one value, both are not a number for none.
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    let deviation = match values.len() {
        0 => f64::NAN,
        1 => 0.0,
        _ => (squares / (count - 1.0)).sqrt(),
    };
    (mean, deviation)
}

/// Returns mean and deviation of the best so far after each trial, as far as every study has a value.
pub fn mean_best_so_far(studies: &[&ReportedStudy]) -> Vec<(usize, f64, f64)> {
    let curves: Vec<Vec<f64>> = studies.iter().map(|study| study.best_so_far()).collect();
    let shortest = curves.iter().map(Vec::len).min().unwrap_or(0);
    let at = |index: usize| curves.iter().map(|curve| curve[index]).collect::<Vec<_>>();
    let all = (0..shortest).map(|index| (index + 1, mean_and_deviation(&at(index))));
    all.filter(|(_, (mean, _))| mean.is_finite()).map(|(trial, (mean, deviation))| (trial, mean, deviation)).collect()
}

/// Trials whose ticks are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrialChoice {
    /// The best trial.
    Best,
    /// The first trial that counts.
    First,
    /// The last trial that counts.
    Last,
    /// The last fall.
    LastFall,
    /// The trial of that number.
    Number(u32),
}

impl TrialChoice {
    /// Returns the trial of `study` and its label; none if there is no such trial.
    pub fn of<'a>(&self, study: &'a ReportedStudy) -> Option<(&'a TrialRecord, String)> {
        let (row, what) = match self {
            TrialChoice::Best => (study.best_row()?, "best"),
            TrialChoice::First => (study.counted().next()?, "first"),
            TrialChoice::Last => (study.counted().last()?, "last"),
            TrialChoice::LastFall => (study.with(Verdict::Fall).last()?, "last fall"),
            TrialChoice::Number(number) => (study.row(*number)?, ""),
        };
        let fell = if row.verdict == Some(Verdict::Fall) && *self != TrialChoice::LastFall { ", fall" } else { "" };
        let what = if what.is_empty() { String::new() } else { format!("{what}, ") };
        Some((row, format!("{what}trial {}{fell}", row.trial)))
    }
}
