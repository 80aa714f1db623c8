//! `quadfrog screenshot`: the screen of a replay as a picture.

use std::io::Write;
use std::path::PathBuf;
use std::sync::PoisonError;

use crate::feed::Feed;
use crate::keymap::Key;
use crate::message::{Effect, Msg, ReplayCommand};
use crate::model::Model;
use crate::screenshot::Film;
use crate::settings::ConsoleSettings;
use crate::theme::{Colours, Glyphs, Theme, ThemeChoice};
use crate::update::update;
use crate::{notice, output};
use clap::Args;
use quadfrog::recording::session_files::recordings_of;
use quadfrog::recording::timeline::Timeline;

use super::arguments::{self, whole_number};
use super::console::{settings, theme};
use super::damage::{require_whole, without_present_ends};
use super::failure::Failure;
use super::output_file::{require_format, write_file};
use super::replay::{is_written, recorded_robot, without_ticks};

/// Of the pictures.
const EXTENSION: &str = "svg";

#[derive(Debug, Args)]
pub struct ScreenshotArguments {
    /// A recording, or the folder of a study
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Show the end of this trial [default: the end of the recording]
    #[arg(long, value_name = "N", conflicts_with = "time", value_parser = whole_number(0_u32..=u32::MAX))]
    trial: Option<u32>,
    /// Show this time, s since the recording began
    #[arg(long, value_name = "S", value_parser = parse_time)]
    time: Option<u64>,
    /// Show so many seconds up to that moment as a moving picture
    #[arg(long, value_name = "S", value_parser = parse_length)]
    animate: Option<f64>,
    /// Frames of a moving picture in a second
    #[arg(long, value_name = "N", default_value_t = 8, requires = "animate", value_parser = whole_number(1_u8..=30))]
    frames_per_second: u8,
    /// Keys pressed before, as in a replay: 2 for Trials, t for the next set of charts; separated by spaces
    #[arg(long, value_name = "KEYS", default_value = "1", value_parser = parse_keys)]
    keys: Keys,
    /// Size of the terminal
    #[arg(long, value_name = "COLUMNSxROWS", default_value = "120x40", value_parser = parse_size)]
    size: (u16, u16),
    /// Background of the picture
    #[arg(long, value_name = "WHICH", default_value = "dark", value_parser = theme())]
    theme: ThemeChoice,
    /// Folder with your own console.toml
    #[arg(long, value_name = "DIR")]
    config: Option<PathBuf>,
    /// Picture, *.svg [default: standard output]
    #[arg(long, short, value_name = "OUT")]
    output: Option<PathBuf>,
}

#[derive(Debug, Clone)]
struct Keys(Vec<Key>);

fn parse_keys(text: &str) -> Result<Keys, String> {
    let keys = text.split_whitespace().map(|name| name.parse::<Key>().map_err(|error| error.to_string()));
    keys.collect::<Result<_, _>>().map(Keys)
}

fn parse_time(text: &str) -> Result<u64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds.is_finite() && seconds >= 0.0 => Ok((seconds * 1e9) as u64),
        _ => Err("not a time in s from 0".to_owned()),
    }
}

fn parse_length(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| *seconds > 0.0 && *seconds <= 30.0);
    seconds.ok_or_else(|| "not a time above 0 and at most 30 s".to_owned())
}

fn parse_size(text: &str) -> Result<(u16, u16), String> {
    let wanted = || "write it as COLUMNSxROWS, from 20x6 to 400x200, for example 120x40".to_owned();
    let (columns, rows) = text.split_once('x').ok_or_else(wanted)?;
    match (columns.parse(), rows.parse()) {
        (Ok(columns @ 20..=400), Ok(rows @ 6..=200)) => Ok((columns, rows)),
        _ => Err(wanted()),
    }
}

/// Plays the recording up to the moment without a terminal, presses the keys and draws the screen.
pub fn run(arguments: &ScreenshotArguments) -> Result<(), Failure> {
    if let Some(path) = &arguments.output {
        require_format(path, &[EXTENSION], "a screenshot is a picture in SVG")?;
    }
    let config = arguments::load_config(arguments.config.as_deref())?;
    let files = recordings_of(&arguments.file)?;
    let written: Vec<PathBuf> = files.iter().filter(|file| is_written(file)).cloned().collect();
    let mut recording = Timeline::open(&files)?;
    let (cuts, lost_before) = (recording.cuts(), recording.lost_before_recovery());
    let time_ns = match (arguments.trial, arguments.time) {
        (Some(trial), _) => end_of(trial, &recording)
            .map_err(|reason| Failure::input(format!("{}: {reason}", arguments.file.display())))?,
        (None, Some(time)) if time > recording.duration_ns() => {
            let (at_s, end_s) = (time as f64 / 1e9, recording.duration_ns() as f64 / 1e9);
            let text = format!("--time {at_s}: after the end of {}, {end_s:.3} s", arguments.file.display());
            return Err(Failure::input(text));
        }
        (None, time) => time.unwrap_or(recording.duration_ns()),
    };
    let settings = ConsoleSettings { theme: arguments.theme, ..settings(&config)? };
    let theme = Theme::new(Colours::True, Glyphs::Braille);
    let mut model = Model::new(settings, theme, recorded_robot(&mut recording));
    let mut feed = Feed::replay(recording);
    let (columns, rows) = arguments.size;
    update(&mut model, Msg::Resize(columns, rows));
    let rate = f64::from(arguments.frames_per_second);
    let frames = arguments.animate.map_or(1, |seconds| (seconds * rate).ceil() as u32);
    let time_of = |frame: u32| time_ns.saturating_sub((f64::from(frames - 1 - frame) / rate * 1e9) as u64);
    // It plays from its beginning; stopped, it stays at the moment.
    feed.control_replay(ReplayCommand::PlayPause);
    feed.control_replay(ReplayCommand::Time(time_of(0)));
    show(&mut model, &mut feed);
    for key in &arguments.keys.0 {
        for effect in update(&mut model, Msg::Key(*key)) {
            if let Effect::Replay(command) = effect {
                feed.control_replay(command);
            }
        }
        show(&mut model, &mut feed);
    }
    let mut film = Film::default();
    film.add(&model);
    for frame in 1..frames {
        feed.control_replay(ReplayCommand::Time(time_of(frame)));
        show(&mut model, &mut feed);
        film.add(&model);
    }
    let picture = film.svg(rate);
    match &arguments.output {
        Some(path) => {
            write_file(path, EXTENSION, |file| file.write_all(picture.as_bytes()))?;
            notice!("screenshot: {}", path.display());
        }
        None => output::data(&picture),
    }
    let mut damage = std::mem::take(&mut *feed.damage().lock().unwrap_or_else(PoisonError::into_inner));
    without_present_ends(&mut damage, &written, &cuts);
    require_whole(&damage, lost_before, "what can be read is drawn")
}

fn show(model: &mut Model, feed: &mut Feed) {
    for message in feed.poll(0) {
        update(model, message);
    }
}

fn end_of(trial: u32, recording: &Timeline) -> Result<u64, String> {
    let runs = recording.trials();
    runs.iter().rev().find(|run| run.trial == trial).map(|run| run.end_ns).ok_or_else(|| {
        let known = runs.iter().map(|run| run.trial.to_string()).collect::<Vec<_>>().join(", ");
        let known = if known.is_empty() { "none" } else { &known };
        match recording.rows().get(&trial) {
            Some(row) if row.was_not_run() => format!("trial {trial} was not run; trials with ticks: {known}"),
            Some(_) => without_ticks(trial, known),
            None => format!("no trial {trial}; trials with ticks: {known}"),
        }
    })
}
