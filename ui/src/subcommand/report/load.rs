//! Studies of a place with their recordings and configuration.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use quadfrog::config::Config;
use quadfrog::engine::{Opened, has_journal, kept_robot, open_stored, stored_studies, study_files};
use quadfrog::optimize::study::Storage;
use quadfrog::recording::player::Player;
use quadfrog::recording::session_files::recordings_in;
use quadfrog::report::configuration;
use quadfrog::report::recorded::Recordings;
use quadfrog::report::study::{ReportedStudy, limits_of};
use quadfrog::robot::description::{RobotDescription, RobotFiles};
use quadfrog::session::experiment::fixed_in_words;
use quadfrog::trial::{Backend, ParameterValues, PredictedTrial, TrialRecord};
use serde_json::Value;

use crate::subcommand::arguments::last_config;
use crate::subcommand::failure::Failure;
use crate::subcommand::replay::{is_written, lacks_its_end_alone};
use crate::subcommand::selection::parse_storage;

/// Returns the studies of a place: of a study's folder, of the studies in a folder, of a journal's file or of a server.
pub fn load(place: &str) -> Result<Vec<ReportedStudy>, Failure> {
    let path = Path::new(place);
    let storage = parse_storage(place);
    if path.is_dir() && !has_journal(&storage)? {
        let files = study_files(path).map_err(|error| Failure::input(format!("{place}: {error}")))?;
        if files.is_empty() {
            let message =
                format!("{place}: there is no study in this folder; give the folder of a study, as printed at its end");
            return Err(Failure::input(message));
        }
        let studies = files.iter().map(|file| of_storage(&Storage::File(file.clone())));
        return Ok(studies.collect::<Result<Vec<_>, _>>()?.concat());
    }
    of_storage(&storage)
}

/// Returns all studies of this program in a journal, or its only study of another program.
fn of_storage(storage: &Storage) -> Result<Vec<ReportedStudy>, Failure> {
    let folder = match storage {
        Storage::File(file) => file.parent().map(Path::to_owned),
        _ => None,
    };
    let kept = folder.as_deref().and_then(last_config);
    let config = Config::load(kept.as_deref())?;
    let ours = if has_journal(storage)? { stored_studies(storage)? } else { Vec::new() };
    let mut opened: Vec<Opened> = Vec::new();
    for study in &ours {
        opened.push(open_stored(storage, study.name.as_deref(), &config)?);
    }
    if opened.is_empty() {
        opened.push(open_stored(storage, None, &config)?);
    }
    let defaults = Config::load(None)?;
    opened
        .iter()
        .map(|opened| reported(opened, storage, folder.as_deref(), kept.as_deref(), &config, &defaults))
        .collect()
}

fn reported(
    opened: &Opened,
    storage: &Storage,
    folder: Option<&Path>,
    kept: Option<&Path>,
    config: &Config,
    defaults: &Config,
) -> Result<ReportedStudy, Failure> {
    let (study, ours) = (&opened.study, opened.ours.as_ref());
    let robot = ours.and_then(|ours| description(kept, &ours.robot));
    let rows = opened.rows();
    // A trial of a given duration has as many jumps as fit.
    let jumps = rows.iter().filter_map(|row| row.measured.as_ref()).map(|measured| measured.jumps.len() as u32);
    let jumps = jumps.max().unwrap_or(1);
    let control = ours.map(|ours| config.task(ours.task));
    let configured = control.map(|control| control.gains().values()).unwrap_or_default();
    let best = opened.best(&rows);
    let recordings = match &robot {
        Some(robot) => {
            let own = folder.map_or_else(Vec::new, recordings_in);
            let elsewhere = elsewhere(opened, &rows, &own);
            let parameters = rows.iter().map(|row| (row.trial, row.parameters.clone())).collect();
            read(&own, &parameters, &elsewhere, robot)
        }
        None => Recordings::default(),
    };
    let backend = study.attributes().get("backend").and_then(Value::as_str).and_then(|name| name.parse().ok());
    let machine = if backend == Some(Backend::Hardware) { "hardware" } else { "simulated" };
    Ok(ReportedStudy {
        place: folder.map_or_else(|| storage.to_string(), |folder| folder.display().to_string()),
        name: study.options().name.clone(),
        task: ours.map(|ours| ours.task),
        seed: ours.map(|ours| ours.seed),
        robot: ours.map_or_else(String::new, |ours| format!("{}, {machine}", ours.robot)),
        direction: study.options().direction,
        unit: opened.unit().to_owned(),
        jumps: control.map_or(1, |control| control.jumps).max(jumps),
        f1_hz: control.map_or(0.0, |control| control.f1_hz),
        parameters: opened.parameters.clone(),
        best: best.map(|best| best.trial),
        other_gains_of_best: best.map_or(String::new(), |best| best.other_gains(&configured)),
        rows,
        confirmation: opened.confirmation_in_words().map(str::to_owned),
        fixed: ours.map_or_else(Vec::new, |_| fixed_in_words(study)),
        model_best: opened.model_best().map(|best| PredictedTrial {
            trial: best.trial,
            value: best.predicted,
            deviation: best.predicted_deviation,
        }),
        limits: robot.as_ref().map(limits_of),
        recordings,
        changed: kept.map_or_else(Vec::new, |_| configuration::differences(&defaults.as_run, &config.as_run)),
        configuration: kept.map_or_else(Vec::new, |_| config.as_run.clone()),
    })
}

/// Reads the recordings in a study's folder, in the order of their sessions, then those that its trials name elsewhere; what a session
/// still writes is not damaged by having no end. `parameters` are those of the trials of the study.
fn read(
    own: &[PathBuf],
    parameters: &BTreeMap<u32, ParameterValues>,
    elsewhere: &NamedRecordings,
    robot: &RobotDescription,
) -> Recordings {
    let written: Vec<&PathBuf> = own.iter().chain(elsewhere.keys()).filter(|file| is_written(file)).collect();
    let mut recordings = Recordings::read(own, parameters, robot);
    for (file, named) in elsewhere {
        recordings.add(file, named, robot);
    }
    for player in written.into_iter().filter_map(|file| Player::open(file).ok()).filter(lacks_its_end_alone) {
        let no_end = player.damage().map(|damage| damage.to_string());
        for damage in recordings.damages.iter_mut().filter(|damage| no_end.as_ref() == Some(*damage)) {
            *damage = format!("{}: a session still writes it", player.path().display());
        }
    }
    recordings
}

/// Returns the robot of a kept configuration, else the built-in one of that name.
fn description(kept: Option<&Path>, name: &str) -> Option<RobotDescription> {
    let own = kept.and_then(kept_robot);
    let own = own.and_then(|robot| RobotFiles::open(robot.to_str()?).ok()?.description().ok());
    own.or_else(|| RobotDescription::embedded(name).ok())
}

/// Recordings with the parameters of the trials that name them, by number.
type NamedRecordings = BTreeMap<PathBuf, BTreeMap<u32, ParameterValues>>;

/// Returns the recordings that trials name and that are not among the study's `own`.
fn elsewhere(opened: &Opened, rows: &[TrialRecord], own: &[PathBuf]) -> NamedRecordings {
    let mut named = NamedRecordings::new();
    for row in rows {
        let trial = opened.study.trial(row.trial).ok();
        let name = trial.and_then(|trial| trial.user_attributes.get("recording")?.as_str());
        // A name without a folder is that of a file beside the journal.
        let Some(path) = name.filter(|name| name.contains('/')).map(PathBuf::from) else { continue };
        let found = [path.clone(), path.with_extension("mcap.part")].into_iter().find(|path| path.is_file());
        if let Some(file) = found.filter(|file| !own.contains(file)) {
            named.entry(file).or_default().insert(row.trial, row.parameters.clone());
        }
    }
    named
}
