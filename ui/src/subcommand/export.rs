//! `quadfrog export`: signals of a recording as a table; layouts of viewers.

use std::collections::BTreeSet;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::{notice, output};
use anyhow::anyhow;
use clap::{Args, ValueEnum};
use clap_complete::ArgValueCandidates;
use quadfrog::recording::player::Player;
use quadfrog::recording::session_files::recordings_of;
use quadfrog::recording::timeline::{check_one_study, in_order};
use quadfrog::report::columns::TableFormat;
use quadfrog::report::signals::{SignalRange, SignalTopic, Signals};
use quadfrog::trial::counted;

use super::arguments::{one_of, whole_number};
use super::completion;
use super::damage::require_whole;
use super::failure::Failure;
use super::output_file::write_file;
use super::replay::{is_written, lacks_its_end_alone, without_ticks};
use super::table::{table_format, written_format};

/// Viewer with a layout for recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LayoutOf {
    /// Foxglove and Lichtblick: a JSON file to import
    Foxglove,
    /// rerun: a Python script that writes a blueprint with rerun's SDK
    Rerun,
}

impl LayoutOf {
    fn extension(self) -> &'static str {
        match self {
            LayoutOf::Foxglove => "json",
            LayoutOf::Rerun => "py",
        }
    }

    fn contents(self) -> &'static str {
        match self {
            LayoutOf::Foxglove => include_str!("../../data/foxglove-layout.json"),
            LayoutOf::Rerun => include_str!("../../data/rerun_blueprint.py"),
        }
    }
}

#[derive(Debug, Args)]
#[command(
    override_usage = "quadfrog export [OPTIONS] <FILE>\n       quadfrog export --layout <VIEWER> [--output <OUT>]"
)]
pub struct ExportArguments {
    /// A recording: session.mcap, session.mcap.part of a session that runs or was cut off, or the folder of a study for all its
    /// files, one after the other
    #[arg(value_name = "FILE", required_unless_present = "layout")]
    file: Option<PathBuf>,
    /// Write the layout of a viewer instead: 3D view, plots, changes of mode, log
    #[arg(long, value_name = "VIEWER", conflicts_with_all = ["file", "trial", "time", "topic", "format"])]
    layout: Option<LayoutOf>,
    /// Export the ticks of one trial
    #[arg(long, value_name = "N", conflicts_with = "time", value_parser = whole_number(0_u32..=u32::MAX), add = ArgValueCandidates::new(completion::trials))]
    trial: Option<u32>,
    /// Export the ticks from time A to before time B, s since the session of the file began (a replay of a folder counts on over its sessions); both may be left out, as in 12.5..
    #[arg(long, value_name = "A..B", value_parser = parse_times)]
    time: Option<(u64, u64)>,
    /// Export the signals of one topic [default: all]
    #[arg(long, value_name = "TOPIC", value_parser = one_of(SignalTopic::ALL.map(|topic| (topic, topic.name(), topic.about()))))]
    topic: Option<SignalTopic>,
    /// Format of the table [default: by the file's name; csv on standard output]
    #[arg(long, value_name = "FORM", value_parser = table_format())]
    format: Option<TableFormat>,
    /// Output file, *.csv, *.json or *.parquet [default: standard output]
    #[arg(long, short, value_name = "OUT")]
    output: Option<PathBuf>,
}

/// Parses `A..B` in seconds into nanoseconds.
fn parse_times(text: &str) -> Result<(u64, u64), String> {
    let (from, until) = text.split_once("..").ok_or("write it as A..B in seconds, for example 12.5..30")?;
    let ns = |text: &str, missing: u64| match text.trim() {
        "" => Ok(missing),
        text => match text.parse::<f64>() {
            Ok(seconds) if seconds >= 0.0 && seconds.is_finite() => Ok((seconds * 1e9).round() as u64),
            _ => Err(format!("`{text}` is no time; write A..B in seconds, for example 12.5..30")),
        },
    };
    let (from, until) = (ns(from, 0)?, ns(until, u64::MAX)?);
    if from < until { Ok((from, until)) } else { Err("the end is not after the beginning".to_owned()) }
}

pub fn run(arguments: &ExportArguments) -> Result<(), Failure> {
    match (&arguments.file, arguments.layout) {
        (_, Some(layout)) => export_layout(layout, arguments.output.as_deref()),
        (Some(file), None) => export_signals(file, arguments),
        // The command line requires one of them.
        (None, None) => Err(Failure::input("give a recording or --layout")),
    }
}

fn export_layout(layout: LayoutOf, output: Option<&Path>) -> Result<(), Failure> {
    let Some(path) = output else {
        output::data(layout.contents());
        return Ok(());
    };
    write_file(path, layout.extension(), |file| file.write_all(layout.contents().as_bytes()))?;
    notice!("layout: {}", path.display());
    Ok(())
}

fn export_signals(file: &Path, arguments: &ExportArguments) -> Result<(), Failure> {
    let format = written_format(arguments.format, arguments.output.as_deref())?;
    let files = recordings_of(file).map_err(Failure::input)?;
    // Of a folder of studies it is one that has recordings.
    if let Some(study) = files[0].parent().filter(|study| file.is_dir() && *study != file) {
        notice!("the newest study in it: {}", study.display());
    }
    let written: Vec<&PathBuf> = files.iter().filter(|file| is_written(file)).collect();
    let players = files.iter().map(Player::open).collect::<Result<Vec<_>, _>>().map_err(Failure::input)?;
    let mut players = in_order(players);
    check_one_study(&players).map_err(Failure::input)?;
    let one_session = players.windows(2).all(|pair| pair[0].start_utc_ns() == pair[1].start_utc_ns());
    if arguments.time.is_some() && !one_session {
        let several = "--time: its files are of several sessions, each with its own begin; give one of the files";
        return Err(Failure::input(format!("{}: {several}", file.display())));
    }
    let end_ns = players.iter().map(Player::duration_ns).max().unwrap_or(0);
    if let Some((from_ns, _)) = arguments.time
        && from_ns > end_ns
    {
        let (from_s, end_s) = (from_ns as f64 / 1e9, end_ns as f64 / 1e9);
        return Err(Failure::input(format!("--time {from_s}..: after the end of {}, {end_s:.3} s", file.display())));
    }
    if let Some(trial) = arguments.trial {
        require_trial(&players, trial).map_err(|refusal| Failure::input(format!("{}: {refusal}", file.display())))?;
        // What is lost of other files is no loss of this trial.
        players.retain(|player| player.trials_with_ticks().any(|with_ticks| with_ticks == trial));
    }
    let (from_ns, until_ns) = arguments.time.unwrap_or((0, u64::MAX));
    let range = SignalRange { trial: arguments.trial, from_ns, until_ns };
    let signals = Signals::of(arguments.topic);
    match &arguments.output {
        Some(path) => {
            let mut rows = 0;
            write_file(path, format.into(), |out| {
                rows = signals.export(&mut players, range, format, out)?;
                Ok(())
            })?;
            let size_mb = std::fs::metadata(path).map_or(0.0, |about| about.len() as f64 / 1e6);
            notice!("{}, {size_mb:.1} MB: {}", counted(rows as usize, "row"), path.display());
        }
        None => match signals.export(&mut players, range, format, &mut output::Data).and_then(|_| output::Data.flush())
        {
            // A reader that has read enough is no error.
            Err(error) if error.kind() == ErrorKind::BrokenPipe => return Ok(()),
            written => written.map_err(|error| Failure::Other(anyhow!("standard output: {error}")))?,
        },
    }
    let lost_before = players.iter_mut().flat_map(Player::named_losses_before_recovery).collect();
    let is_in_progress =
        |player: &&Player| written.iter().any(|file| file.as_path() == player.path()) && lacks_its_end_alone(player);
    let (in_progress, others): (Vec<_>, Vec<_>) = players.iter().partition(is_in_progress);
    for player in in_progress {
        let end_s = player.duration_ns() as f64 / 1e9;
        notice!("{}: a session still writes it; it is exported up to {end_s:.3} s", player.path().display());
    }
    let damage: Vec<_> = others.iter().filter_map(|player| player.damage()).collect();
    require_whole(&damage, lost_before, "what can be read is exported")
}

/// Refuses a trial of which no tick is recorded.
fn require_trial(players: &[Player], trial: u32) -> Result<(), String> {
    let trials: BTreeSet<u32> = players.iter().flat_map(Player::trials_with_ticks).collect();
    if trials.contains(&trial) {
        return Ok(());
    }
    let known = trials.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    let known = if known.is_empty() { "none".to_owned() } else { known };
    Err(without_ticks(trial, &known))
}
