//! `quadfrog replay`: the console on a recorded session, or a check of the files without a screen.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::PoisonError;

use crate::app::{self, ConsoleExit};
use crate::feed::Feed;
use crate::model::RobotFacts;
use crate::{notice, put_line, terminal};
use anyhow::anyhow;
use clap::Args;
use quadfrog::engine::{Rejudging, VerifyError, attached_config, attached_robot, config_for_recorded, running_session};
use quadfrog::recording::RecordingError;
use quadfrog::recording::player::{Damage, Played, Player};
use quadfrog::recording::session_files::{recordings_in, recordings_of};
use quadfrog::recording::timeline::Timeline;
use quadfrog::report::study_page::WAYS_TO_RECORD_EVERY_TRIAL;
use quadfrog::robot::description::RobotDescription;
use quadfrog::trial::counted;

use super::arguments;
use super::console::{ScreenArguments, options};
use super::damage::{damage_text, require_no_damage, without_present_ends};
use super::failure::Failure;

/// Folder of the studies, where no file is named.
const RECORDINGS: &str = "recordings";
/// Use of a damaged recording.
const DONE: &str = "what can be read is played";

#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// Recordings (session.mcap, complete or incomplete) or study folders; several of one study are played as one. Without: the
    /// newest session in recordings
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Show a session that is being written, from its present end on
    #[arg(long, conflicts_with = "check")]
    follow: bool,
    /// Another recording (or study folder): its trials are laid beside those at the playhead, aligned where the impulses begin
    #[arg(long, value_name = "FILE", conflicts_with = "check")]
    beside: Option<PathBuf>,
    /// Show in Trials, beside the recorded judgements, those by the configuration in this folder; the file is not changed
    #[arg(long, value_name = "DIR", conflicts_with = "check")]
    rejudge: Option<PathBuf>,
    /// Read the files whole without a screen and print what is lost; exit status 1 if anything is
    #[arg(long)]
    check: bool,
    /// Folder with your own console.toml
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    #[command(flatten)]
    screen: ScreenArguments,
}

pub fn run(arguments: &ReplayArguments) -> Result<(), Failure> {
    let newest = [PathBuf::from(RECORDINGS)];
    let named = if arguments.files.is_empty() { &newest[..] } else { &arguments.files };
    if arguments.files.is_empty() && !newest[0].is_dir() {
        let [path] = newest;
        return Err(RecordingError::NoRecording { path, deeper: None }.into());
    }
    let mut files = Vec::new();
    for path in named {
        files.extend(recordings_of(path)?);
    }
    if arguments.check {
        return check(&files);
    }
    let config = arguments::load_config(arguments.config.as_deref())?;
    let console = options(&arguments.screen, &config)?;
    let mut recording = Timeline::open(&files)?;
    if let Some(folder) = &arguments.rejudge {
        // What cannot be judged is refused before the screen opens.
        let config = config_for_recorded(&files, Some(folder)).map_err(Failure::input)?;
        Rejudging::open(&files, &config).map_err(Failure::input)?;
    }
    let mut second = None;
    if let Some(path) = &arguments.beside {
        let of_second = recordings_of(path)?;
        second = Some(Timeline::open(&of_second)?);
        files.extend(of_second);
    }
    // What a session still writes is not damaged by having no end.
    let written: Vec<PathBuf> = files.iter().filter(|file| is_written(file)).cloned().collect();
    let mut cuts = recording.cuts();
    cuts.extend(second.iter().flat_map(Timeline::cuts));
    let damage_of = |mut damage: Vec<Damage>| {
        without_present_ends(&mut damage, &written, &cuts);
        damage
    };
    terminal::check().map_err(|error| match damage_of(recording.damage()) {
        damage if damage.is_empty() => Failure::input(error),
        damage => Failure::Input(format!("{}\n{error}", damage_text(&damage, DONE))),
    })?;
    let console = console.with_robot(recorded_robot(&mut recording));
    let mut feed = Feed::beside(recording, second, arguments.follow);
    if let Some(folder) = &arguments.rejudge {
        feed.rejudge(Some(folder.clone()));
    }
    let damage = feed.damage();
    let ended = app::run(feed, console)?;
    let damage = damage_of(std::mem::take(&mut *damage.lock().unwrap_or_else(PoisonError::into_inner)));
    if ended == ConsoleExit::HungUp { Ok(()) } else { require_no_damage(&damage, DONE) }
}

/// Returns what a recording tells of its robot. Of an older one, without its files: the built-in robot of that name. Of one whose
/// files cannot be read: nothing, and a line on standard error; the panels that need the robot's limits say so.
pub fn recorded_robot(recording: &mut Timeline) -> RobotFacts {
    let robot = match attached_robot(recording.first_player()) {
        Ok(robot) => robot,
        Err(VerifyError::NotAttached { .. }) => {
            let description = RobotDescription::embedded(&recording.session().robot).ok();
            return RobotFacts { description, ..RobotFacts::default() };
        }
        Err(error) => {
            notice!("its robot cannot be read and is not shown: {error}");
            return RobotFacts::default();
        }
    };
    let config = attached_config(recording.first_player());
    let session = recording.session();
    match (config, session.backend) {
        (Ok(config), Some(backend)) => RobotFacts::new(robot, &config, backend, session.seed),
        _ => RobotFacts { description: Some(robot), ..RobotFacts::default() },
    }
}

impl From<RecordingError> for Failure {
    fn from(error: RecordingError) -> Failure {
        match &error {
            // A missing file is unusable input, a failing disk is not.
            RecordingError::Io { source, .. }
                if !matches!(source.kind(), ErrorKind::NotFound | ErrorKind::PermissionDenied) =>
            {
                Failure::Other(error.into())
            }
            _ => Failure::input(error),
        }
    }
}

/// Reads every message of the files and prints what is lost. A file that cannot be opened does not end the check of the others.
fn check(files: &[PathBuf]) -> Result<(), Failure> {
    let (mut incomplete, mut unopened, mut recoverable) = (0, 0, false);
    for file in files {
        match check_file(file) {
            Ok(CheckedFile::Whole) => {}
            Ok(CheckedFile::Incomplete { is_recoverable }) => {
                incomplete += 1;
                recoverable |= is_recoverable;
            }
            Err(failure) if files.len() == 1 => return Err(failure),
            Err(failure) => {
                failure.print();
                incomplete += 1;
                unopened += 1;
            }
        }
    }
    if incomplete == 0 {
        return Ok(());
    }
    let remedy = if recoverable { "; quadfrog recover FILE keeps what can be read" } else { "" };
    let text = format!("not whole: {incomplete} of {}{remedy}", counted(files.len(), "file"));
    Err(if unopened == files.len() { Failure::Input(text) } else { Failure::Other(anyhow!(text)) })
}

/// Whether a session that runs in its folder still writes a recording: the newest there. An older unfinished one is what a
/// killed session left. To be asked before the file is read: a session that ends meanwhile gives it another name.
pub fn is_written(file: &Path) -> bool {
    let folder = match file.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let newest = recordings_in(folder).pop();
    file.extension().is_some_and(|extension| extension == "part")
        && newest.is_some_and(|newest| newest.file_name() == file.file_name())
        && matches!(running_session(folder), Ok(Some(_)))
}

/// Returns the refusal of a trial of which no tick is recorded; `known` are the trials with ticks.
pub fn without_ticks(trial: u32, known: &str) -> String {
    format!("no tick of trial {trial} is recorded; trials with ticks: {known}; {WAYS_TO_RECORD_EVERY_TRIAL}")
}

/// Whether nothing is missing in a recording but its end.
pub fn lacks_its_end_alone(player: &Player) -> bool {
    player.damage().is_some_and(|damage| player.cut() == Some(&damage.parts))
}

/// Returns how much of a file is lost. Of an end that was cut off nothing tells how long it was.
fn lost_in_words(player: &Player) -> String {
    let within = player.lost_ns() as f64 / 1e9;
    let after =
        format!("what followed {:.3} s, and nothing tells how much that was", player.duration_ns() as f64 / 1e9);
    match (player.lacks_data_at_its_end(), player.lost_ns()) {
        (false, 0) => "no chunk is lost".to_owned(),
        (false, _) => format!("{within:.3} s lost"),
        (true, 0) => format!("lost: {after}"),
        (true, _) => format!("lost: {within:.3} s, and {after}"),
    }
}

/// Result of the check of a file that can be opened.
enum CheckedFile {
    /// Nothing is missing but what the session that still writes it has not written yet.
    Whole,
    Incomplete {
        /// Whether `quadfrog recover` makes it whole.
        is_recoverable: bool,
    },
}

/// Reads every message of a file and prints what is lost.
fn check_file(file: &Path) -> Result<CheckedFile, Failure> {
    let written = is_written(file);
    let mut player = Player::open(file)?;
    let (mut ticks, mut records) = (0_u64, 0_u64);
    for played in player.by_ref() {
        match played {
            Played::Tick(_) => ticks += 1,
            Played::Record(_) => records += 1,
        }
    }
    let extras = player.check_extras()?;
    let seconds = player.duration_ns() as f64 / 1e9;
    put_line!(
        "{}: {seconds:.3} s, {}, {}",
        file.display(),
        counted(ticks as usize, "tick"),
        counted(records as usize, "record")
    );
    for lost in player.lost() {
        let [from_s, to_s] = [lost.from_ns, lost.to_ns].map(|time_ns| time_ns as f64 / 1e9);
        put_line!("  lost: {:.3} s from {from_s:.3} s to {to_s:.3} s ({})", (to_s - from_s).max(0.0), lost.reason);
    }
    let lost_before = player.lost_before_recovery();
    for lost in &lost_before {
        put_line!("  {lost}");
    }
    if written && extras.is_empty() && lacks_its_end_alone(&player) {
        put_line!("  a session still writes it");
        return Ok(CheckedFile::Whole);
    }
    let damage = player.damage();
    for line in damage.iter().map(ToString::to_string).chain(extras.iter().cloned()) {
        put_line!("  {line}");
    }
    let whole = damage.is_none() && extras.is_empty();
    put_line!(
        "  {}",
        match (whole, lost_before.is_empty()) {
            (true, true) => "whole".to_owned(),
            (true, false) => "everything that was recovered is there".to_owned(),
            (false, _) => lost_in_words(&player),
        }
    );
    let is_recoverable = !extras.is_empty() || damage.as_ref().is_some_and(|damage| damage.is_recoverable);
    Ok(if whole { CheckedFile::Whole } else { CheckedFile::Incomplete { is_recoverable } })
}
