//! `quadfrog replay` on files that the program itself wrote: table, timeline, keys, damage, folders, a session that runs.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::program::{Program, assert_shows};
use crate::pty::Session;
use nix::sys::signal::Signal;
use portable_pty::CommandBuilder;
use quadfrog::recording::player::{MarkerKind, Played, Player};
use quadfrog::recording::record::SessionInfo;
use quadfrog::recording::session_files::recordings_in;
use quadfrog::recording::timeline::{Timeline, TrialRun};
use quadfrog::recording::writer::Writer;
use quadfrog::telemetry::{Mode, Phase, Tick};
use quadfrog::trial::Verdict;
use quadfrog_console::feed::Feed;
use quadfrog_console::message::{Msg, ReplayCommand, ReplayStatus};

/// A study of six trials without a screen, every tick recorded; the fifth falls.
fn study() -> &'static PathBuf {
    static STUDY: OnceLock<(Program, PathBuf)> = OnceLock::new();
    let (_, study) = STUDY.get_or_init(|| {
        let program = Program::new();
        program.text(&["optimize", "--trials", "6", "--seed", "0", "--record", "all"]);
        let study = program.study("recordings");
        (program, study)
    });
    study
}

fn recording() -> PathBuf {
    study().join("session.mcap")
}

fn timeline() -> Timeline {
    Timeline::open(&[recording()]).unwrap()
}

fn span(trial: u32) -> TrialRun {
    *timeline().trials().iter().find(|span| span.trial == trial).unwrap()
}

/// The trials that fell.
fn falls() -> Vec<u32> {
    let rows = timeline().rows();
    rows.values().filter(|row| row.verdict.or(row.suggested) == Some(Verdict::Fall)).map(|row| row.trial).collect()
}

/// Time of the first tick of a trial with damped joints.
fn first_damped(trial: u32) -> u64 {
    let damped = |played: Played| match played {
        Played::Tick(tick) if tick.mode == Mode::Damped && tick.trial == Some(trial) => Some(tick.time_ns),
        _ => None,
    };
    timeline().find_map(damped).unwrap()
}

/// A time as the frame shows it.
fn shown(time_ns: u64) -> String {
    let ms = time_ns / 1_000_000;
    format!("{:02}:{:02}.{:03}", ms / 60_000, ms / 1000 % 60, ms % 1000)
}

fn replay(folder: &Path, size: (u16, u16), arguments: &[&str]) -> Session {
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.arg("replay");
    command.args(arguments);
    let session = Session::run(folder, size, command);
    session.wait_for(&["REPLAY"]);
    session
}

/// The replay of a file, paused at its start.
fn paused(file: &Path) -> Session {
    let folder = file.parent().unwrap();
    let mut session = replay(folder, (120, 40), &[file.to_str().unwrap()]);
    session.send("p");
    session.wait_for(&["paused"]);
    session.send("(");
    session.wait_for(&["00:00.000"]);
    session
}

/// Types a place and waits until the replay is there.
fn go(session: &mut Session, place: &str, time: &str) {
    session.send(&format!("G{place}"));
    session.wait_for(&["Go to a time or a trial"]);
    session.send("\r");
    session.wait_for(&[time]);
}

fn line_of(session: &Session, number: u32) -> Option<String> {
    let start = number.to_string();
    let of_row = |line: &&str| {
        line.trim_start_matches(['>', ' ']).strip_prefix(&start).is_some_and(|rest| rest.starts_with(['+', ' ', '~']))
    };
    // Below the frame, the tabs and the heading.
    session.screen().lines().skip(4).find(of_row).map(str::to_owned)
}

#[test]
fn the_table_of_the_whole_file_is_there_from_the_start_and_enter_goes_to_a_trial() {
    let mut session = paused(&recording());
    session.send("2");
    session.wait_for(&["Trials, ", "after the playhead (+)"]);
    let rows = timeline().rows();
    assert_eq!(rows.len(), 6);
    // The first trial begins with the file.
    assert!(line_of(&session, 0).unwrap().contains("runs"), "{}", session.screen());
    for (trial, row) in rows.iter().filter(|(trial, _)| **trial > 0) {
        let line = line_of(&session, *trial).unwrap_or_else(|| panic!("no row {trial}:\n{}", session.screen()));
        assert!(line.contains(&format!("{trial}+")) && line.contains(row.verdict.unwrap().name()), "{line}");
    }
    session.send("\x1b[F\r");
    session.wait_for(&[&shown(span(5).begin_ns)]);
    for trial in 0..5 {
        assert!(!line_of(&session, trial).unwrap().contains(&format!("{trial}+")), "{}", session.screen());
    }
    // At its end nothing is later, and nothing marked.
    session.send(")");
    session.wait_until("no mark", || !session.screen().contains("after the playhead"));
    session.send("q");
    assert!(session.wait().success());
}

#[test]
fn the_live_view_shows_the_trials_of_the_whole_file_from_the_start() {
    let file = recording();
    for size in [(80, 24), (120, 40)] {
        let mut session = replay(file.parent().unwrap(), size, &[file.to_str().unwrap()]);
        session.send("p(");
        session.wait_for(&["00:00.000", "8 s sweep"]);
        let rows = timeline().rows();
        // The table is at the lower end; at 80x24 it has four rows.
        for (trial, row) in rows.range(1..if size.1 > 24 { 6 } else { 3 }) {
            let line = line_of(&session, *trial).unwrap_or_else(|| panic!("no row {trial}:\n{}", session.screen()));
            assert!(line.contains(&format!("{trial}+")) && line.contains(row.verdict.unwrap().name()), "{line}");
        }
        // Regression: nothing in this view said what the sign behind a number means.
        assert_shows(&session.screen(), &["note | cause", "+ later"]);
        // The rows around the playhead stay in view.
        session.send(")");
        session.wait_until("no later row", || line_of(&session, 5).is_some_and(|line| !line.contains("5+")));
        assert!(!session.screen().contains("+ later"), "{}", session.screen());
        session.send("q");
        assert!(session.wait().success());
    }
}

#[test]
fn the_timeline_shows_verdicts_and_the_playhead() {
    for size in [(80, 24), (120, 40)] {
        let file = recording();
        let mut session = replay(file.parent().unwrap(), size, &[file.to_str().unwrap()]);
        session.send("p(");
        session.wait_for(&["00:00.000"]);
        let line = |session: &Session| session.screen().lines().rev().nth(2).unwrap().to_owned();
        let marks = |session: &Session, c: char| line(session).chars().filter(|mark| *mark == c).count();
        assert_eq!((marks(&session, 'x'), marks(&session, '│')), (falls().len(), 1), "{}", session.screen());
        let at = |session: &Session| line(session).chars().position(|mark| mark == '│');
        assert_eq!(at(&session), Some(1));
        session.send(")");
        session.wait_until("the playhead is at the end", || at(&session) == Some(usize::from(size.0) - 2));
    }
}

#[test]
fn places_are_typed_as_times_seconds_and_trials() {
    let mut session = paused(&recording());
    go(&mut session, "0:05", "00:05.000");
    go(&mut session, "7.25", "00:07.250");
    // Regression: the help names the form "75.5 s", which was refused.
    go(&mut session, "7.5s", "00:07.500");
    go(&mut session, "#3", &shown(span(3).begin_ns));
    // Regression: the hint named the form "trial #7", of which the space vanished before it was refused.
    for place in ["trial #3", "trial 3", "# 3", "trial3"] {
        go(&mut session, "7.5 s", "00:07.500");
        go(&mut session, place, &shown(span(3).begin_ns));
    }
    for (place, problem) in [
        ("99:00", "is after the end"),
        ("soon", "`soon` is no place"),
        ("1:75", "is no place"),
        ("#77", "trial 77 is not in"),
        ("trial 77", "trial 77 is not in"),
        ("trial x", "`trial x` is not the number of a trial"),
    ] {
        session.send(&format!("G{place}\r"));
        session.wait_for(&[problem]);
        session.send("\x1b");
        session.wait_until("closed", || !session.screen().contains("Go to a time"));
    }
    assert_shows(&session.screen(), &[&shown(span(3).begin_ns)]);
}

#[test]
fn keys_step_by_a_tick_a_sample_and_a_second_and_find_falls() {
    let mut session = paused(&recording());
    go(&mut session, "5", "00:05.000");
    for (key, time) in [
        ("'", "00:05.001"),
        (".", "00:05.006"),
        ("l", "00:06.006"),
        ("j", "00:05.006"),
        (";", "00:05.005"),
        (",", "00:05.000"),
    ] {
        session.send(key);
        session.wait_for(&[time]);
    }
    // Regression: they led to the countdown of the trial that fell, and within that trial nowhere; then to ticks after the fall, whose
    // pitch was not the one of its cause.
    let fallen = |trial| shown(first_damped(trial));
    session.send("(");
    for trial in falls() {
        session.send("}");
        // The pitch beside the cause is the one that it names.
        let cause = timeline().rows()[&trial].cause.clone();
        let pitch = cause.split_once("pitch ").and_then(|(_, rest)| rest.get(..4)).unwrap_or(&cause);
        session.wait_for(&[&fallen(trial), &format!("pitch +{pitch}")]);
    }
    // After the last one it stays there and says so.
    session.send("}");
    session.wait_for(&["no further fall or fault", &fallen(*falls().last().unwrap())]);
    session.send(")");
    session.wait_for(&[&shown(timeline().duration_ns())]);
    session.send("]");
    session.wait_for(&["no further trial or fault", &shown(timeline().duration_ns())]);
    session.send("{");
    session.wait_for(&[&fallen(*falls().last().unwrap())]);
    session.send("([");
    session.wait_for(&["no earlier trial or fault", "00:00.000"]);
}

/// Regression: a fault that ended a trial as a fall was two places, 10 ms apart: the key seemed to do nothing.
#[test]
fn a_fault_that_ends_a_trial_is_one_place() {
    let program = Program::new();
    program.write("mine/safety.toml", "[watchdog]\nvelocity_factor = 1.1\n");
    let arguments = ["optimize", "--config", "mine", "--trials", "6", "--seed", "0", "--record", "all"];
    program.text(&arguments);
    let file = program.study("recordings").join("session.mcap");
    let timeline = Timeline::open(std::slice::from_ref(&file)).unwrap();
    let rows = timeline.rows();
    let faults: Vec<u64> =
        timeline.markers().iter().filter(|m| m.kind == MarkerKind::Fault).map(|m| m.time_ns).collect();
    let place = |run: &TrialRun| {
        let fault = faults.iter().find(|fault| (run.begin_ns..=run.end_ns).contains(fault));
        (fault.copied().or(run.damped_ns).unwrap(), fault.is_some())
    };
    let fell = |run: &&TrialRun| rows[&run.trial].verdict == Some(Verdict::Fall);
    let places: Vec<(u64, bool)> = timeline.trials().iter().filter(fell).map(place).collect();
    let of_faults = places.iter().filter(|(_, by_fault)| *by_fault).count();
    assert!(1 < of_faults && of_faults == faults.len() && of_faults < places.len(), "{places:?}, {rows:?}");
    let mut session = paused(&file);
    for (time_ns, _) in places {
        session.send("}");
        session.wait_for(&[&shown(time_ns)]);
    }
    session.send("}");
    session.wait_for(&["no further fall or fault"]);
}

/// Regression: a replay that was stopped for a while had played on meanwhile.
#[test]
fn a_replay_does_not_play_while_its_process_is_stopped() {
    const STOPPED: Duration = Duration::from_secs(3);
    let mut session = paused(&recording());
    let begun = Instant::now();
    session.send("p");
    session.wait_until("it plays", || !session.screen().contains("paused"));
    session.signal(Signal::SIGSTOP);
    std::thread::sleep(STOPPED);
    session.signal(Signal::SIGCONT);
    session.send("p");
    session.wait_for(&["paused"]);
    let screen = session.screen();
    let first = screen.lines().next().unwrap();
    let clock = first.split_whitespace().find_map(|word| word.strip_prefix("00:")?.parse::<f64>().ok()).unwrap();
    // However slow the machine is, it plays no longer than it runs, but for half a second each in which it may be late: when it begins, and
    // when it goes on.
    assert!(clock <= (begun.elapsed() - STOPPED).as_secs_f64() + 1.0, "{clock} s in: {first}");
}

/// Regression: from the start of a recording `best` led nowhere, and later to the best before the playhead.
#[test]
fn the_best_is_that_of_the_whole_recording() {
    let mut session = paused(&recording());
    go(&mut session, "0", "00:00.000");
    go(&mut session, "best", &shown(span(2).begin_ns));
}

/// Lets time pass; the state of the replay after it.
fn status(feed: &mut Feed, milliseconds: u64) -> ReplayStatus {
    let messages = feed.poll(milliseconds * 1_000_000);
    let status = messages.into_iter().rev().find_map(|message| match message {
        Msg::Replay(status) => Some(status),
        _ => None,
    });
    status.unwrap()
}

/// Regression: at the start of a recording, before its first tick, the robot of the end was shown.
#[test]
fn a_time_without_ticks_shows_no_robot_of_another_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let mut writer = Writer::create(&path, &SessionInfo::default(), 0, &[]).unwrap();
    for number in 1..=2000 {
        let time_ns = 1_000_000_000 + number * 1_000_000;
        writer.tick(&Tick { number, time_ns, mode: Mode::Ready, ..Tick::default() }).unwrap();
    }
    writer.finish().unwrap();
    let mut feed = Feed::replay(Timeline::open(&[path]).unwrap());
    let mut mode_at = |command: ReplayCommand| {
        feed.control_replay(command);
        let newest = feed.poll(0).into_iter().rev().find_map(|message| match message {
            Msg::Snapshot(snapshot) => Some(snapshot.tick.mode),
            _ => None,
        });
        newest.unwrap()
    };
    assert_eq!(mode_at(ReplayCommand::End), Mode::Ready);
    assert_eq!(mode_at(ReplayCommand::Start), Mode::Offline);
}

#[test]
fn a_jump_is_repeated_until_the_loop_ends_or_the_playhead_leaves_it() {
    let span = span(2);
    let mut feed = Feed::replay(timeline());
    feed.control_replay(ReplayCommand::Trial(2));
    feed.control_replay(ReplayCommand::Loop);
    let (mut last_ns, mut turns) = (0, 0);
    for _ in 0..400 {
        let status = status(&mut feed, 50);
        assert_eq!(status.looping, Some(2));
        assert!((span.begin_ns..=span.end_ns).contains(&status.time_ns), "{} outside of {span:?}", status.time_ns);
        turns += usize::from(status.time_ns < last_ns);
        last_ns = status.time_ns;
    }
    assert!(turns >= 2, "20 s hold several turns");
    feed.control_replay(ReplayCommand::Loop);
    assert_eq!(status(&mut feed, 10_000).looping, None);
    assert!(status(&mut feed, 50).time_ns > span.end_ns, "it plays on");
    feed.control_replay(ReplayCommand::Loop);
    feed.control_replay(ReplayCommand::Start);
    assert_eq!(status(&mut feed, 50).looping, None, "the start is not in the loop");
}

#[test]
fn slow_motion_takes_eight_times_as_long_in_impulse_and_flight_only() {
    let span = span(1);
    let jumping = |played: &Played| match played {
        Played::Tick(tick) => {
            (span.begin_ns..span.end_ns).contains(&tick.time_ns) && matches!(tick.phase, Phase::Impulse | Phase::Flight)
        }
        Played::Record(_) => false,
    };
    let jumping_ms = timeline().filter(jumping).count() as u64;
    assert!(jumping_ms > 500, "{jumping_ms} ms of impulse and flight");
    let needed_ms = |slow: bool| {
        let mut feed = Feed::replay(timeline());
        if slow {
            feed.control_replay(ReplayCommand::SlowMotion);
        }
        feed.control_replay(ReplayCommand::Trial(1));
        (1..).find(|_| status(&mut feed, 10).time_ns >= span.end_ns).unwrap() * 10
    };
    let (normal_ms, slow_ms) = (needed_ms(false), needed_ms(true));
    let expected_ms = normal_ms + 7 * jumping_ms;
    // The phase is known after a sample of 5 ms: at both ends of impulse and flight that is 40 ms.
    assert!(slow_ms.abs_diff(expected_ms) <= 200, "{slow_ms} ms instead of {expected_ms} ms");
}

/// Kind, offset and length of each record of a file (MCAP specification).
fn records(bytes: &[u8]) -> Vec<(u8, usize, usize)> {
    let (mut found, mut at) = (Vec::new(), 8);
    while at + 9 <= bytes.len() - 8 {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        found.push((bytes[at], at + 9, length));
        at += 9 + length;
    }
    found
}

/// The begin of the content of a record of a kind: the middle one of them.
fn middle(bytes: &[u8], kind: u8) -> (usize, usize) {
    let of_kind: Vec<_> = records(bytes).into_iter().filter(|record| record.0 == kind).collect();
    let (_, at, length) = of_kind[of_kind.len() / 2];
    (at, length)
}

const CHUNK: u8 = 6;
const MESSAGE_INDEX: u8 = 7;
const ATTACHMENT: u8 = 9;

#[test]
fn damage_is_seen_on_the_screen_in_the_log_and_in_the_exit_status() {
    let program = Program::new();
    let mut bytes = fs::read(recording()).unwrap();
    let (at, length) = middle(&bytes, CHUNK);
    bytes[at + length / 2] ^= 1;
    let file = program.path("damaged.mcap");
    fs::write(&file, &bytes).unwrap();
    let mut player = Player::open(&file).unwrap();
    player.by_ref().for_each(drop);
    let lost = player.lost().next().unwrap();
    let mut session = paused(&file);
    go(&mut session, &format!("{}", (lost.to_ns + 20_000_000) as f64 / 1e9), "LOST 0.");
    session.send("6");
    session.wait_for(&["s of the recording are lost"]);
    session.send("q");
    assert_eq!(session.wait().exit_code(), 1);
    assert_shows(&session.screen().replace('\n', ""), &["1 of ", "chunks are damaged", "quadfrog recover"]);
}

#[test]
fn a_check_reads_the_whole_file_and_prints_what_is_lost() {
    let program = Program::new();
    let whole = fs::read(recording()).unwrap();
    let footer = whole.len() - 8 - 20;
    let summary = u64::from_le_bytes(whole[footer..footer + 8].try_into().unwrap()) as usize;
    let (chunk, chunk_length) = middle(&whole, CHUNK);
    let (list, _) = middle(&whole, MESSAGE_INDEX);
    let (attachment, attachment_length) = middle(&whole, ATTACHMENT);
    let flipped = |places: &[usize]| {
        let mut bytes = whole.clone();
        places.iter().for_each(|at| bytes[*at] ^= 1);
        bytes
    };
    let zeroed = |from: usize| {
        let mut bytes = whole.clone();
        bytes[from..from + 4].fill(0);
        bytes
    };
    let cases: [(&str, Vec<u8>, &[&str]); 7] = [
        ("chunk", flipped(&[chunk + chunk_length / 2]), &["lost: 0.", "1 of ", "chunks are damaged", "s lost"]),
        ("unguarded", zeroed(chunk + 24), &["1 chunk without a checksum"]),
        ("list", flipped(&[list + 8]), &["bytes between its chunks are damaged; every message is there"]),
        ("summary", flipped(&[summary + 100]), &["its index is damaged"]),
        ("unguarded-summary", zeroed(footer + 16), &["its index is damaged"]),
        ("attachment", flipped(&[attachment + attachment_length / 2]), &["1 attachment is damaged"]),
        ("cut", whole[..whole.len() * 2 / 3].to_vec(), &["cut off"]),
    ];
    let text = program.text(&["replay", "--check", recording().to_str().unwrap()]);
    assert_shows(&text, &["session.mcap: ", "whole"]);
    for (name, bytes, parts) in cases {
        let file = format!("{name}.mcap");
        fs::write(program.path(&file), bytes).unwrap();
        let output = program.run(&["replay", "--check", &file]);
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(1), "{name}: {printed}");
        assert_shows(&printed, parts);
        assert_shows(&String::from_utf8_lossy(&output.stderr), &["not whole: 1 of 1 file; ", "quadfrog recover"]);
    }
}

#[test]
fn a_pipe_a_device_and_a_folder_without_a_recording_are_refused_at_once() {
    let program = Program::new();
    let pipe = program.path("pipe.mcap");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    fs::create_dir(program.path("empty")).unwrap();
    for (file, part) in
        [("pipe.mcap", "not a regular file"), ("/dev/zero", "not a regular file"), ("empty", "no recording there")]
    {
        for check in [&["replay", file][..], &["replay", "--check", file]] {
            assert_shows(&program.refused(check), &[file, part]);
        }
    }
    assert_shows(&program.refused(&["replay"]), &["recordings", "no recording there"]);
}

#[test]
fn folders_and_several_files_are_one_timeline() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "2", "--seed", "1", "--record", "all"]);
    let study = program.study("recordings");
    let name = study.to_str().unwrap();
    program.text(&["optimize", "--resume", name, "--trials", "4", "--record", "all"]);
    let files = recordings_in(&study);
    let names: Vec<_> = files.iter().map(|file| file.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["session.mcap", "session-2.mcap"]);
    // Without a file the newest session, of a folder its files: both print their names.
    for arguments in [&["replay", "--check"][..], &["replay", "--check", name]] {
        assert_shows(&program.text(arguments), &["session.mcap: ", "session-2.mcap: "]);
    }
    let parts: Vec<_> = files.iter().map(|file| Player::open(file).unwrap()).collect();
    let ticks = |played: &Played| matches!(played, Played::Tick(_));
    let mut whole = Timeline::open(&[files[1].clone(), files[0].clone()]).unwrap();
    let spans: BTreeMap<u32, u64> = whole.trials().iter().map(|span| (span.trial, span.begin_ns)).collect();
    assert_eq!(spans.keys().copied().collect::<Vec<_>>(), [0, 1, 2, 3]);
    assert!(spans[&2] >= parts[0].duration_ns(), "the second file follows the first");
    let played: Vec<Played> = whole.by_ref().collect();
    assert!(played.is_sorted_by_key(Played::time_ns), "in the order of time");
    let expected: usize = parts.into_iter().map(|part| part.filter(ticks).count()).sum();
    assert_eq!(played.iter().filter(|played| ticks(played)).count(), expected);
    let mut session = replay(&program.path(""), (120, 40), &[]);
    session.send("p");
    go(&mut session, "#2", &shown(spans[&2]));
    session.send("2");
    session.wait_for(&["Trials, 1 after the playhead (+)"]);
    session.send("q");
    assert!(session.wait().success());
    program.text(&["optimize", "--trials", "1", "--task", "twist-ccw", "--record", "all", "--output", "other"]);
    let other = program.study("other").join("session.mcap");
    assert_shows(
        &program.refused(&["replay", name, other.to_str().unwrap()]),
        &["not of the study of", "the task is twist-ccw"],
    );
}

#[test]
fn a_session_that_is_being_written_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let mut live = Session::start(folder.path(), (100, 30), &["--approve", "auto", "--seed", "0", "--trials", "3"]);
    let part = || {
        let studies = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
        studies.map(|study| study.join("session.mcap.part")).find(|file| Player::open(file).is_ok())
    };
    live.wait_until("a recording has begun", || part().is_some());
    let file = part().unwrap();
    let mut follower = replay(folder.path(), (120, 40), &["--follow", file.to_str().unwrap()]);
    follower.wait_for(&["FOLLOWING"]);
    // Trials appear that were not written when it was opened.
    follower.send("2");
    for trial in 0..3 {
        follower.wait_for_long("the next trial", || {
            line_of(&follower, trial).is_some_and(|line| line.contains("accept") || line.contains("fall"))
        });
    }
    assert!(live.quit().success());
    follower.send("q");
    assert!(follower.wait().success(), "{}", follower.screen());
}
