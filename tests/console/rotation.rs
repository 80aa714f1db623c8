//! Recordings in several files, as the program itself writes them: each complete in itself, together one session.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use crate::program::{Program, assert_shows};
use crate::pty::Session;
use crate::python_reader::read_by_python;
use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::Record;
use quadfrog::recording::session_files::recordings_in;
use quadfrog::recording::timeline::Timeline;
use quadfrog::telemetry::Tick;

/// Files of 1 MB: one or two trials each.
const SMALL: &str = "[recording]\nrotate_mb = 1\n";
const TRIALS: usize = 6;

/// A program that has recorded the same study in one file, below `whole`, and in small ones, below `split`.
fn recorded() -> (Program, PathBuf, Vec<PathBuf>) {
    let program = Program::new();
    program.write("small/control.toml", SMALL);
    let trials = TRIALS.to_string();
    let study = ["optimize", "--seed", "3", "--record", "all", "--trials", &trials];
    program.text(&[&study[..], &["--output", "whole"]].concat());
    program.text(&[&study[..], &["--output", "split", "--config", "small"]].concat());
    let whole = program.study("whole").join("session.mcap");
    let files = recordings_in(&program.study("split"));
    assert!(files.len() > 2, "{files:?}");
    (program, whole, files)
}

fn ticks(played: impl Iterator<Item = Played>) -> Vec<Tick> {
    played
        .filter_map(|played| match played {
            Played::Tick(tick) => Some(*tick),
            Played::Record(_) => None,
        })
        .collect()
}

/// The numbers of the trials of ticks in their order, once each.
fn trials_of(ticks: &[Tick]) -> Vec<u32> {
    let mut trials: Vec<u32> = ticks.iter().filter_map(|tick| tick.trial).collect();
    trials.dedup();
    trials
}

fn names(files: &[PathBuf]) -> Vec<String> {
    files.iter().map(|file| file.file_name().unwrap().to_string_lossy().into_owned()).collect()
}

#[test]
fn a_study_continues_in_numbered_files_that_play_as_one() {
    let (_program, whole, files) = recorded();
    let expected: Vec<String> = (1..=files.len())
        .map(|number| if number == 1 { "session.mcap".into() } else { format!("session-{number}.mcap") })
        .collect();
    assert_eq!(names(&files), expected);

    let mut single = Timeline::open(&[whole]).unwrap();
    let mut folder = Timeline::open(&files).unwrap();
    assert!(folder.damage().is_empty() && folder.cuts().is_empty());
    assert_eq!(folder.rows(), single.rows());
    assert_eq!(folder.trials(), single.trials());
    assert_eq!(folder.markers(), single.markers());
    assert_eq!(folder.duration_ns(), single.duration_ns());
    // The files that come later are found, as by `replay --follow`.
    let mut followed = Timeline::open(&files[..1]).unwrap();
    assert!(followed.refresh().unwrap());
    assert_eq!(followed.trials(), single.trials());
    assert!(followed.eq(Timeline::open(&files).unwrap()));
    let (single, folder) = (ticks(single.by_ref()), ticks(folder.by_ref()));
    assert_eq!(trials_of(&single).len(), TRIALS);
    assert!(folder == single, "the same ticks at the same times");
}

#[test]
fn each_file_is_complete_in_itself_and_has_whole_trials() {
    let (_program, whole, files) = recorded();
    let mut all = Vec::new();
    let mut start_utc_ns = None;
    let mut end_ns = 0;
    for file in &files {
        let mut player = Player::open(file).unwrap();
        let name = file.file_name().unwrap().to_string_lossy();
        assert_eq!(player.damage(), None);
        assert_eq!(player.check_extras().unwrap(), Vec::<String>::new());
        assert_eq!(*start_utc_ns.get_or_insert(player.start_utc_ns()), player.start_utc_ns(), "one clock");
        assert!(player.session().recording.ends_with(&*name), "{}", player.session().recording);
        assert!(player.first_ns() >= end_ns, "{name} begins where the file before ended");
        end_ns = player.duration_ns();
        for attached in ["control.toml", "robot.toml", "go1.urdf", "go1.visual.urdf", "frog.proto", "trials.csv"] {
            assert!(player.attachment(attached).unwrap().is_some(), "{name}: {attached}");
        }
        let mut rows = BTreeMap::new();
        for event in player.events() {
            if let Record::Trial(row) = &event.record {
                rows.insert(row.trial, row.clone());
            }
        }
        let trials = trials_of(&ticks(player.by_ref()));
        all.extend(&trials);
        // The table so far: the rows of earlier files and those of the trials in this one, each with its verdict.
        for trial in &all {
            assert!(rows.get(trial).is_some_and(|row| row.verdict.is_some()), "{name}: trial {trial}");
        }
        let table = String::from_utf8(player.attachment("trials.csv").unwrap().unwrap()).unwrap();
        for trial in &all {
            let line = table.lines().find(|line| line.starts_with(&format!("{trial},"))).unwrap();
            assert!(line.contains(",accept,") || line.contains(",fall,"), "{line}");
        }
    }
    let single = trials_of(&ticks(Player::open(whole).unwrap()));
    assert_eq!(all, single, "no trial is in two files");
}

#[test]
fn python_reads_each_file_with_robot_and_table() {
    let (_program, _, files) = recorded();
    let mut jumped = 0;
    for file in &files {
        let Some(found) = read_by_python("inspect_recording.py", file) else { return };
        assert_eq!(found["counts"]["/session"], 1);
        assert_eq!(found["counts"]["/scene/robot"], 1);
        assert_eq!(found["shapes"].as_object().unwrap().len(), 13);
        assert_eq!(found["metadata"]["robot"]["root_link"], "trunk");
        assert!(found["attachments"]["control.toml"].as_str().unwrap().contains("rotate_mb = 1"));
        let trials: std::collections::BTreeSet<u64> =
            found["trials"].as_array().unwrap().iter().map(|row| row[0].as_u64().unwrap()).collect();
        let lines = found["attachments"]["trials.csv"].as_str().unwrap().lines().count() - 1;
        assert_eq!(trials.len(), lines, "every row of the table is a message of the file too");
        assert!(lines >= jumped);
        jumped = lines;
    }
    assert!(jumped >= TRIALS);
}

#[test]
fn the_commands_take_the_folder_and_each_of_its_files() {
    let (program, whole, files) = recorded();
    let folder = files[0].parent().unwrap().to_str().unwrap();
    let single = whole.to_str().unwrap();

    let verified = program.text(&["verify", folder]);
    assert_eq!(verified.matches("every one the same bit for bit").count(), files.len(), "{verified}");
    program.text(&["verify", files[1].to_str().unwrap()]);

    let checked = program.text(&["replay", "--check", folder]);
    assert_eq!(checked.matches("  whole").count(), files.len(), "{checked}");

    let rejudged = program.text(&["rejudge", folder, "--json"]);
    assert_eq!(rejudged, program.text(&["rejudge", single, "--json"]));
    assert_eq!(rejudged.lines().count(), TRIALS);

    // Without the first column, the time of day.
    let table = |arguments: &[&str]| {
        let text = program.text(&[&["export"], arguments].concat());
        text.lines().map(|line| line.split_once(',').unwrap().1.to_owned()).collect::<Vec<_>>()
    };
    let all = table(&[folder, "--topic", "/robot/tick"]);
    assert!(all == table(&[single, "--topic", "/robot/tick"]), "the same rows in the same order");
    let last = (TRIALS - 1).to_string();
    let of_trial = table(&[folder, "--trial", &last]);
    assert!(of_trial.len() > 100 && of_trial == table(&[single, "--trial", &last]));
    assert!(table(&[folder, "--time", "1..3"]) == table(&[single, "--time", "1..3"]));
    assert!(program.refused(&["export", folder, "--trial", "77"]).contains("no tick of trial 77"));
}

#[test]
fn a_file_that_cannot_be_begun_is_reported_and_the_recording_goes_on() {
    let program = Program::new();
    program.write("small/control.toml", SMALL);
    let arguments = ["optimize", "--trials", "4", "--record", "all", "--config", "small"];
    // The study's folder is named by the time: it is made first, and continued.
    program.text(&["optimize", "--trials", "1", "--record", "none"]);
    let study = program.study("recordings");
    std::fs::create_dir(study.join("session-2.mcap.new")).unwrap();
    let output = program.run(&[&arguments[..], &["--resume", study.to_str().unwrap()]].concat());
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_shows(&message, &["the recording is not complete", "session-2.mcap.part: could not create the file"]);
    assert_eq!(names(&recordings_in(&study)), ["session.mcap"]);
    let mut player = Player::open(study.join("session.mcap")).unwrap();
    assert_eq!(trials_of(&ticks(player.by_ref())).len(), 3, "nothing is lost");
    assert_eq!(player.damage(), None);
}

/// Regression: the approval was refused with "nothing is recorded", while the present file went on.
#[test]
fn a_console_session_says_that_the_next_file_could_not_be_begun() {
    let program = Program::new();
    program.write("small/control.toml", SMALL);
    program.text(&["optimize", "--trials", "1", "--record", "none"]);
    let study = program.study("recordings");
    std::fs::create_dir(study.join("session-2.mcap.new")).unwrap();
    let config = program.path("small");
    let resumed = [study.to_str().unwrap(), config.to_str().unwrap()];
    let arguments = ["--approve", "auto", "--trials", "6", "--resume", resumed[0], "--config", resumed[1]];
    let mut session = Session::start(program.path("").as_path(), (160, 40), &arguments);
    session.send("6");
    session.wait_for_long("the cause", || session.screen().contains("could not be begun or completed"));
    // A jump that was approved in the same moment runs to its end; the next one is refused.
    session.wait_for_long("the refusal", || session.screen().contains("auto waits for a person"));
    assert!(!session.screen().contains("nothing is recorded"), "{}", session.screen());
    session.send("qy");
    session.wait_for(&["the recording is not complete"]);
    assert_eq!(session.wait().exit_code(), 1);
}

/// Starts a long study and kills it as soon as `count` files have been begun; returns its folder.
fn killed_after(program: &Program, count: usize) -> PathBuf {
    let arguments =
        ["optimize", "--trials", "400", "--record", "all", "--config", "small", "--output", &count.to_string()];
    let mut child = program.command(&arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begun = || program.studies(&count.to_string()).first().map_or(0, |study| recordings_in(study).len());
    while begun() < count {
        assert_eq!(child.try_wait().unwrap(), None, "it ended before it had begun {count} files");
        std::thread::yield_now();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    program.study(&count.to_string())
}

#[test]
fn a_kill_leaves_files_that_open_and_can_be_recovered() {
    let program = Program::new();
    program.write("small/control.toml", SMALL);
    for count in [1, 2, 3, 5] {
        let study = killed_after(&program, count);
        let files = recordings_in(&study);
        let recording = Timeline::open(&files).unwrap();
        assert!(!recording.is_complete());
        assert!(recording.damage().len() <= 2, "{:?}", recording.damage());
        let before = ticks(recording);
        let parts = files.iter().filter(|file| file.extension().is_some_and(|end| end == "part"));
        let mut recovered = 0;
        for part in parts {
            program.text(&["recover", part.to_str().unwrap()]);
            recovered += 1;
        }
        assert!((1..=2).contains(&recovered), "the last file, and the one before while it is completed");
        program.text(&["replay", "--check", study.to_str().unwrap()]);
        let after = Timeline::open(&recordings_in(&study)).unwrap();
        let after = ticks(after);
        let differs = after.iter().zip(&before).position(|(after, before)| after != before);
        let place = |index: usize| [&before, &after].map(|ticks| (ticks[index].number, ticks[index].time_ns));
        assert_eq!((after.len(), differs.map(place)), (before.len(), None));
    }
}

#[test]
fn a_console_session_rotates_between_its_trials_and_loses_no_tick() {
    let config = tempfile::tempdir().unwrap();
    std::fs::write(config.path().join("control.toml"), SMALL).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let config = config.path().to_str().unwrap();
    let arguments = ["--approve", "auto", "--trials", "4", "--seed", "1", "--config", config];
    let mut session = Session::start(folder.path(), (120, 40), &arguments);
    let study = || std::fs::read_dir(folder.path()).unwrap().next().map(|entry| entry.unwrap().path());
    // A key cancels a countdown: none before the study ends.
    session.wait_for_long("four trials", || session.screen().contains("4 of 4 count"));
    assert!(recordings_in(&study().unwrap()).len() >= 3);
    // The present file is named.
    session.send("5");
    session.wait_for_long("the present file", || session.screen().contains("session-"));
    session.send("qy");
    session.wait_for(&["play the recording:  quadfrog replay"]);
    let shown = session.screen();
    session.wait();
    let study = study().unwrap();
    assert!(!shown.contains("session.mcap"), "the folder is played: {shown}");

    let files = recordings_in(&study);
    assert!(files.iter().all(|file| file.extension().is_some_and(|end| end == "mcap")), "{files:?}");
    let recording = Timeline::open(&files).unwrap();
    assert!(recording.damage().is_empty());
    let idle = |tick: &Tick| !tick.mode.energised();
    let ticks = ticks(recording);
    assert!(ticks.len() > 3000);
    for pair in ticks.windows(2) {
        if !idle(&pair[0]) && !idle(&pair[1]) {
            assert_eq!(pair[1].number, pair[0].number + 1, "no tick is lost");
        }
        assert!(pair[1].time_ns > pair[0].time_ns);
    }
    let in_files: Vec<u32> =
        files.iter().flat_map(|file| trials_of(&self::ticks(Player::open(file).unwrap()))).collect();
    assert_eq!(in_files, trials_of(&ticks), "no trial is in two files");
}

#[test]
fn a_limit_out_of_its_range_is_refused_with_the_key() {
    let program = Program::new();
    for (text, key) in [("rotate_mb = 0", "rotate_mb"), ("rotate_minutes = 0.0", "rotate_minutes")] {
        program.write("wrong/control.toml", &format!("[recording]\n{text}\n"));
        let message = program.refused(&["optimize", "--trials", "1", "--config", "wrong"]);
        assert_shows(&message, &["control.toml", key]);
    }
}

#[test]
fn the_time_of_a_file_is_limited_too() {
    let program = Program::new();
    // 0.05 min: 3 s of the recording's time, less than two trials.
    program.write("short/control.toml", "[recording]\nrotate_minutes = 0.05\n");
    program.text(&["optimize", "--trials", "5", "--record", "all", "--config", "short"]);
    let files = recordings_in(&program.study("recordings"));
    assert!(files.len() >= 2, "{files:?}");
    for file in &files[..files.len() - 1] {
        let player = Player::open(file).unwrap();
        assert!(player.duration_ns() - player.first_ns() < 3_000_000_000 + trial_ns(file), "{}", file.display());
    }
}

/// The duration of the longest trial in a file, ns.
fn trial_ns(file: &Path) -> u64 {
    let timeline = Timeline::open(&[file.to_path_buf()]).unwrap();
    timeline.trials().iter().map(|trial| trial.end_ns - trial.begin_ns).max().unwrap_or_default()
}
