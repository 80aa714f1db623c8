//! `quadfrog screenshot`: the picture has the characters of the screen at their places.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::program::{Program, assert_shows};
use crate::pty::Session;
use portable_pty::CommandBuilder;
use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::{Record, Stamped, Transition};
use quadfrog::telemetry::Mode;
use xml::attribute::OwnedAttribute;
use xml::reader::{EventReader, XmlEvent};

fn sample() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/samples/forward")
}

/// The texts of a picture, put into the cells of a terminal by their places and widths, and its background.
fn cells(svg: &str, rows: usize) -> (Vec<String>, String) {
    let mut lines = vec![Vec::new(); rows];
    let (mut place, mut background) = (None, None);
    for event in EventReader::from_str(svg) {
        match event.expect("well-formed") {
            XmlEvent::StartElement { name, attributes, .. } => {
                let find = |name: &str| {
                    let found = attributes.iter().find(|attribute: &&OwnedAttribute| attribute.name.local_name == name);
                    found.map(|attribute| attribute.value.clone())
                };
                let number = |name: &str| find(name).and_then(|value| value.parse::<f64>().ok());
                place = (name.local_name == "text").then(|| {
                    let [x, y, width] = ["x", "y", "textLength"].map(|name| number(name).expect("a number"));
                    (((x - 8.0) / 8.4).round() as usize, ((y - 8.0) / 17.0) as usize, (width / 8.4).round() as usize)
                });
                if name.local_name == "rect" {
                    background = background.or(find("fill"));
                }
            }
            XmlEvent::Characters(text) if place.is_some() => {
                let (column, row, width) = place.take().unwrap();
                let line: &mut Vec<char> = &mut lines[row];
                assert_eq!(text.chars().count(), width, "{text}");
                line.resize(line.len().max(column + width), ' ');
                line.splice(column..column + width, text.chars().map(|c| if c == '\u{a0}' { ' ' } else { c }));
            }
            _ => {}
        }
    }
    let lines = lines.into_iter().map(|line| line.into_iter().collect::<String>().trim_end().to_owned());
    (lines.collect(), background.expect("a background"))
}

#[test]
fn the_picture_is_the_screen_of_the_replay() {
    let program = Program::new();
    let svg = program.text(&["screenshot", sample().to_str().unwrap(), "--keys", "2", "--size", "100x30"]);
    let (drawn, background) = cells(&svg, 30);
    assert_eq!(background, "#101010");
    let folder = tempfile::tempdir().unwrap();
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["replay", sample().to_str().unwrap()]);
    let mut session = Session::run(folder.path(), (100, 30), command);
    session.wait_for(&["REPLAY"]);
    session.send("p2)");
    session.wait_until("the screens agree", || session.screen().lines().map(str::trim_end).eq(drawn.iter()));
    session.send("q");
    session.wait();
}

#[test]
fn a_picture_for_paper_has_a_light_background_and_the_end_of_a_trial() {
    let program = Program::new();
    let sample = sample();
    let best = ["screenshot", sample.to_str().unwrap(), "--trial", "12", "--theme", "light", "--output", "a.svg"];
    let output = program.run(&best);
    // Regression: a picture that was written was not reported.
    assert_shows(&String::from_utf8(output.stderr).unwrap(), &["screenshot: a.svg"]);
    assert!(output.status.success() && output.stdout.is_empty());
    let (drawn, background) = cells(&std::fs::read_to_string(program.path("a.svg")).unwrap(), 40);
    assert_eq!(background, "#ffffff");
    assert!(drawn[38].contains("trial #12, verdict by --approve auto: accept"), "{drawn:?}");
}

/// Regression: the recording had the checklist of the start of the session, not the one with which the robot was armed.
#[test]
fn a_recording_has_the_time_of_the_first_arming_checks() {
    let program = Program::new();
    let folder = program.path("recordings");
    std::fs::create_dir(&folder).unwrap();
    let mut session = Session::start(&folder, (80, 24), &[]);
    session.wait_for(&["Press A to arm"]);
    // Some seconds later than the first list.
    std::thread::sleep(Duration::from_secs(2));
    session.send("A5");
    let armed =
        |text: &str| text.lines().find(|line| line.contains(" at ") && line.contains("passed (P)")).map(time_of);
    session.wait_until("armed", || session.screen().starts_with(" READY") && armed(&session.screen()).is_some());
    let live = armed(&session.screen());
    std::thread::sleep(Duration::from_secs(1));
    session.quit();
    let file = program.study("recordings").join("session.mcap");
    let played = Player::open(&file).unwrap();
    let ready = played.filter_map(|played| match played {
        Played::Record(Stamped { time_ns, record: Record::Transition(Transition { to: Mode::Ready, .. }) }) => {
            Some(time_ns)
        }
        _ => None,
    });
    let ready_s = ready.min().unwrap() as f64 / 1e9;
    let time = format!("--time={}", ready_s + 0.5);
    let svg = program.text(&["screenshot", file.to_str().unwrap(), &time, "--keys", "5", "--size", "80x24"]);
    assert_eq!(armed(&cells(&svg, 24).0.join("\n")), live);
}

/// Regression: beside "pitch 1.0004 rad exceeds 1.0000 rad" the heading of the chart had the sample 3 ms before, 0.994 rad.
#[test]
fn the_heading_of_a_chart_has_the_value_at_the_playhead() {
    let program = Program::new();
    let fall = sample().with_file_name("fall");
    let lines = |time: &[&str]| {
        let base = ["screenshot", fall.to_str().unwrap(), "--size", "120x40"];
        cells(&program.text(&[&base, time].concat()), 40).0.join("\n")
    };
    assert_shows(&lines(&[]), &["pitch +1.000 rad"]);
    assert_shows(&lines(&["--time", "1.276"]), &["pitch +0.998 rad"]);
}

/// The time of day behind "at".
fn time_of(line: &str) -> String {
    line.split(" at ").nth(1).unwrap_or_default().chars().take("12:34:56".len()).collect()
}

#[test]
fn wrong_input_is_refused_with_the_remedy() {
    let program = Program::new();
    let sample = sample();
    let refused =
        |arguments: &[&str]| program.refused(&[&["screenshot", sample.to_str().unwrap()], arguments].concat());
    assert_shows(&refused(&["--trial", "99"]), &["no trial 99", "trials with ticks: 12"]);
    assert_shows(&refused(&["--size", "120"]), &["COLUMNSxROWS", "for example 120x40"]);
    assert_shows(&refused(&["--size", "9999x9999"]), &["to 400x200"]);
    assert_shows(&refused(&["--keys", "2 Entr"]), &["`Entr` is no key"]);
    assert_shows(&refused(&["--time=-1"]), &["not a time in s"]);
    // Regression: a time after the end drew the end without a word.
    assert_shows(&refused(&["--time", "9999"]), &["--time 9999", "after the end of ", "forward", "2.256 s"]);
}

#[test]
fn the_pictures_of_the_manual_are_those_of_this_program() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folder = tempfile::tempdir().unwrap();
    let mut draw = Command::new("sh");
    draw.arg(root.join("docs/pictures/draw.sh")).arg(folder.path());
    assert!(draw.env("QUADFROG", env!("CARGO_BIN_EXE_quadfrog")).status().unwrap().success());
    let [manual, readme] =
        ["docs/operator.md", "README.md"].map(|page| std::fs::read_to_string(root.join(page)).unwrap());
    let mut drawn = 0;
    for entry in std::fs::read_dir(folder.path()).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let shown =
            manual.contains(&format!("(pictures/{name})")) || readme.contains(&format!("(docs/pictures/{name})"));
        assert!(shown, "{name} is in the manual or the README");
        let [now, kept] = [entry.path(), root.join("docs/pictures").join(&name)].map(std::fs::read_to_string);
        assert!(now.unwrap() == kept.unwrap(), "{name} is out of date: run docs/pictures/draw.sh");
        drawn += 1;
    }
    let shown = manual.matches("](pictures/").count() + readme.matches("](docs/pictures/").count();
    assert_eq!(drawn, shown);
}

/// A moving picture: each frame is the still picture of its moment.
#[test]
fn a_moving_picture_shows_the_screens_one_after_the_other() {
    let program = Program::new();
    let sample = sample();
    let draw = |arguments: &[&str]| {
        program.text(&[&["screenshot", sample.to_str().unwrap(), "--size", "80x24"], arguments].concat())
    };
    let moving = draw(&["--trial", "12", "--animate", "2", "--frames-per-second", "4"]);
    // The rows that stay need no animation, and each other row is in a group with the frames that show it.
    let shown_in = |frame: usize| {
        let mut kept = String::new();
        let mut shown = true;
        for line in moving.lines() {
            if let Some(span) = line.strip_prefix("<g class=\"f").and_then(|rest| rest.strip_suffix("\">")) {
                let (first, end) = span.split_once('-').unwrap();
                shown = (first.parse::<usize>().unwrap()..end.parse().unwrap()).contains(&frame);
            } else if line == "</g>" {
                shown = true;
            } else if shown && !line.contains("@keyframes") {
                kept += &format!("{line}\n");
            }
        }
        kept.replace("<style>\n</style>\n", "")
    };
    assert_eq!(cells(&shown_in(7), 24), cells(&draw(&["--trial", "12"]), 24), "the last frame is the end of the trial");
    assert_ne!(cells(&shown_in(0), 24), cells(&shown_in(7), 24), "the robot moves");
    assert_eq!(moving.matches("@keyframes").count(), moving.matches("step-end infinite").count());
    assert!(moving.contains("2.000s step-end infinite"), "8 frames at 4 a second");
    let one = draw(&["--trial", "12"]);
    assert!(moving.len() < 8 * one.len(), "{} bytes for 8 frames of {}", moving.len(), one.len());

    assert_shows(&program.refused(&["screenshot", sample.to_str().unwrap(), "--animate", "0"]), &["at most 30 s"]);
}

/// Regression: of a recording that is cut off or damaged the picture was drawn without a message, with status 0.
#[test]
fn damage_is_reported_after_the_picture_was_written() {
    let program = Program::new();
    let recording = std::fs::read_dir(sample()).unwrap().map(|entry| entry.unwrap().path());
    let recording = recording.into_iter().find(|file| file.extension().is_some_and(|extension| extension == "mcap"));
    let whole = std::fs::read(recording.unwrap()).unwrap();
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 1;
    std::fs::write(program.path("cut.mcap.part"), &whole[..whole.len() / 2]).unwrap();
    std::fs::write(program.path("flipped.mcap"), &flipped).unwrap();
    for (file, damage) in [("cut.mcap.part", "cut off"), ("flipped.mcap", "damaged")] {
        let output = program.run(&["screenshot", file, "-o", "screen.svg"]);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{message}");
        let recover = format!("`quadfrog recover {file}` keeps what can be read");
        assert_shows(&message, &["screenshot: screen.svg", file, damage, &recover, "what can be read is drawn"]);
        assert!(std::fs::read_to_string(program.path("screen.svg")).unwrap().ends_with("</svg>\n"));
        std::fs::remove_file(program.path("screen.svg")).unwrap();
    }
}
