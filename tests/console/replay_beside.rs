//! Two trials, or two recordings, beside each other in `quadfrog replay`, on files that the program itself wrote.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::program::{Program, assert_shows};
use crate::pty::Session;
use portable_pty::CommandBuilder;
use quadfrog::recording::player::Played;
use quadfrog::recording::timeline::Timeline;
use quadfrog::telemetry::Tick;
use quadfrog::trial::{TrialRecord, Verdict};

/// Two studies of six trials without a screen, every tick recorded: seeds 0 and 1.
fn studies() -> &'static [PathBuf; 2] {
    static STUDIES: OnceLock<(Program, [PathBuf; 2])> = OnceLock::new();
    let (_, studies) = STUDIES.get_or_init(|| {
        let program = Program::new();
        let study = |seed: &str| {
            let arguments = ["optimize", "--trials", "6", "--seed", seed, "--record", "all", "--output", seed];
            program.text(&arguments);
            program.study(seed)
        };
        let studies = [study("0"), study("1")];
        (program, studies)
    });
    studies
}

fn file(study: usize) -> PathBuf {
    studies()[study].join("session.mcap")
}

fn timeline(study: usize) -> Timeline {
    Timeline::open(&[file(study)]).unwrap()
}

fn row(study: usize, trial: u32) -> TrialRecord {
    timeline(study).rows().remove(&trial).unwrap()
}

/// The ticks of a trial, read here and not by the console.
fn ticks(study: usize, trial: u32) -> Vec<Tick> {
    let of_trial = |played: Played| match played {
        Played::Tick(tick) => Some(*tick).filter(|tick| tick.trial == Some(trial)),
        Played::Record(_) => None,
    };
    timeline(study).filter_map(of_trial).collect()
}

/// Roll as the heading of its chart shows it, at a time since the impulse began.
fn roll(study: usize, trial: u32, time_s: f64) -> String {
    let ticks = ticks(study, trial);
    let distance = |tick: &&Tick| (tick.trial_time_s - time_s).abs();
    let shown = ticks.iter().filter(|tick| tick.number % 5 == 0);
    let tick = shown.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
    let roll = tick.estimate.roll_pitch_yaw.x;
    format!("{:+.3}", if roll.abs() < 0.0005 { 0.0 } else { roll })
}

/// A number as the panels show it.
fn number(value: f64) -> String {
    match value.abs() {
        size if size >= 100.0 => format!("{value:.1}"),
        size if size >= 10.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

/// The replay of the first study, paused at its start.
fn paused(size: (u16, u16), arguments: &[&str]) -> Session {
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["replay", file(0).to_str().unwrap()]);
    command.args(arguments);
    let mut session = Session::run(Path::new("/"), size, command);
    session.wait_for(&["REPLAY"]);
    session.send("p");
    session.wait_for(&["paused"]);
    session.send("(");
    session.wait_for(&["00:00.000"]);
    session
}

/// Goes to a time since the impulse of a trial began, s; returns that of the sample there.
fn go(session: &mut Session, trial: u32, since_impulse_s: f64) -> f64 {
    let ticks = ticks(0, trial);
    let tick = ticks.iter().find(|tick| tick.trial_time_s >= since_impulse_s - 1e-6 && tick.number % 5 == 0).unwrap();
    let ms = tick.time_ns / 1_000_000;
    session.send(&format!("G{}.{:03}\r", ms / 1000, ms % 1000));
    session.wait_for(&[&format!("{:02}:{:02}.{:03}", ms / 60_000, ms / 1000 % 60, ms % 1000)]);
    tick.trial_time_s
}

/// The line of the panel of both trials that begins with a label.
fn of_panel(session: &Session, label: &str) -> String {
    let screen = session.screen();
    let panel = |line: &str| line.find(&format!(" {label}")).map(|at| line[at..].trim().to_owned());
    let lines = screen.lines().skip(3).filter_map(panel);
    lines.into_iter().next().unwrap_or_else(|| panic!("no {label}:\n{screen}"))
}

#[track_caller]
fn assert_panel(session: &Session, [a, b]: [&TrialRecord; 2]) {
    let cells = |label: &str, values: [String; 2]| {
        let line = of_panel(session, label);
        let shown: Vec<&str> = line.split_whitespace().collect();
        for value in &values {
            assert!(shown.contains(&value.as_str()), "{label}: {line} instead of {values:?}\n{}", session.screen());
        }
    };
    cells("J m", [a, b].map(|row| number(row.value.unwrap())));
    cells("verdict ", [a, b].map(|row| row.verdict.unwrap().name().to_owned()));
    for (name, _) in a.parameters.iter() {
        cells(&format!("{name} "), [a, b].map(|row| number(row.parameters.get(name).unwrap())));
    }
    // Regression: at 80x24 the causes took the place of rise and time in the air.
    for label in ["dx m", "dy m", "yaw rad", "rise m", "air s"] {
        let measured = |row: &TrialRecord| {
            let m = row.measured.as_ref().unwrap();
            match label {
                "dx m" => m.dx_m,
                "dy m" => m.dy_m,
                "yaw rad" => m.dyaw_rad,
                "rise m" => m.apex_m,
                _ => m.air_s,
            }
        };
        let sign = |number: String| if label == "air s" { number.replace('+', "") } else { number };
        cells(label, [a, b].map(|row| sign(format!("{:+.3}", measured(row)))));
    }
    of_panel(session, &format!("A: {}", a.cause.split(' ').next().unwrap()));
}

#[test]
fn a_second_trial_lies_beside_the_present_one_aligned_at_the_impulse_until_escape() {
    for size in [(80, 24), (120, 40)] {
        let mut session = paused(size, &[]);
        let at_s = go(&mut session, 2, 0.1);
        session.send("|");
        session.wait_for(&["Which trial beside #2?"]);
        session.send("5\r");
        session.wait_for(&["A #2 line, B #5 dotted, at +0.10 s", "A is trial 2, B is trial 5; Left and Right move"]);
        let shown = format!("roll A {} B {}", roll(0, 2, at_s), roll(0, 5, at_s));
        assert_shows(&session.screen(), &[&shown, "Two trials"]);
        assert_panel(&session, [&row(0, 2), &row(0, 5)]);
        // The cursor goes with the playhead, and by its own keys.
        session.send("l");
        session.wait_for(&["at +1.10 s"]);
        assert_shows(&session.screen(), &[&format!("A {} B {}", roll(0, 2, at_s + 1.0), roll(0, 5, at_s + 1.0))]);
        session.send("\x1b");
        session.wait_until("it ends", || !session.screen().contains("dotted") && !session.screen().contains("Two tri"));
        // Playing on does not bring it back.
        session.send("]");
        session.wait_for(&["s sweep"]);
        assert!(!session.screen().contains("dotted"));
        session.send("q");
        assert!(session.wait().success());
    }
}

#[test]
fn the_trial_at_the_playhead_is_a_and_the_selected_one_in_trials_is_b() {
    let mut session = paused((120, 40), &[]);
    session.send("2\x1b[F");
    session.wait_for(&[">  5+"]);
    session.send("|");
    session.wait_for(&["A #0 line, B #5 dotted"]);
    assert_panel(&session, [&row(0, 0), &row(0, 5)]);
    session.send("]");
    session.wait_for(&["A #1 line, B #5 dotted"]);
    assert_panel(&session, [&row(0, 1), &row(0, 5)]);
    // At B itself the last pair stays.
    session.send("G#5\r");
    session.wait_for(&["A #1 line, B #5 dotted"]);
    session.send("2");
    session.wait_for(&["A and B compared", "  1A", "  5B"]);
    session.send("q");
    assert!(session.wait().success());
}

#[test]
fn a_second_recording_lies_beside_the_first_from_the_start() {
    let second = studies()[1].to_str().unwrap();
    for size in [(80, 24), (120, 40)] {
        let mut session = paused(size, &["--beside", second]);
        session.wait_for(&["A #0 line, B #0 dotted", " B of ", "session.mcap"]);
        assert_panel(&session, [&row(0, 0), &row(1, 0)]);
        let at_s = go(&mut session, 3, 0.25);
        session.wait_for(&["A #3 line, B #3 dotted, at +0.25 s"]);
        assert_shows(&session.screen(), &[&format!("A {} B {}", roll(0, 3, at_s), roll(1, 3, at_s))]);
        assert_panel(&session, [&row(0, 3), &row(1, 3)]);
        // Another trial of the second recording; one that it lacks is refused with its name.
        session.send("|");
        session.wait_for(&["Which trial beside #3?", "its number in"]);
        session.send("77\r");
        session.wait_for(&["trial 77 is not in"]);
        session.send("\x15#4\r");
        session.wait_for(&["A #3 line, B #4 dotted"]);
        assert_panel(&session, [&row(0, 3), &row(1, 4)]);
        session.send("\x1b");
        session.wait_until("it ends", || !session.screen().contains("dotted"));
        session.send("q");
        assert!(session.wait().success());
    }
}

#[test]
fn what_cannot_lie_beside_is_refused() {
    let program = Program::new();
    let recording = file(0);
    let recording = recording.to_str().unwrap();
    assert_shows(&program.refused(&["replay", recording, "--beside", "missing.mcap"]), &["missing.mcap"]);
    assert_shows(&program.refused(&["replay", recording, "--beside", recording, "--check"]), &["--check"]);
    let mut session = paused((120, 40), &[]);
    for (typed, reason) in [
        ("77", "trial 77 is not in this recording"),
        ("0", "trial 0 is the one at the playhead"),
        ("x", "`x` does not belong here: type a number; Esc cancels"),
    ] {
        session.send(&format!("|{typed}\r"));
        session.wait_for(&[reason]);
        session.send("\x1b");
        session.wait_until("closed", || !session.screen().contains("Which trial"));
    }
    // Esc has nothing to end then, and the answer of the field stays.
    session.send("\x1b");
    // Esc and a key at once are Alt and the key.
    std::thread::sleep(std::time::Duration::from_millis(300));
    session.send("|");
    session.wait_for(&["Which trial"]);
    assert!(!session.screen().contains("is not possible"), "{}", session.screen());
}

#[test]
fn damage_of_the_second_recording_is_in_the_exit_status() {
    let program = Program::new();
    let whole = std::fs::read(file(1)).unwrap();
    std::fs::write(program.path("cut.mcap"), &whole[..whole.len() / 2]).unwrap();
    let cut = program.path("cut.mcap");
    let mut session = paused((120, 40), &["--beside", cut.to_str().unwrap()]);
    session.wait_for(&["A #0 line, B #0 dotted"]);
    assert_panel(&session, [&row(0, 0), &row(1, 0)]);
    session.send("q");
    assert_eq!(session.wait().exit_code(), 1);
    assert_shows(&session.screen().replace('\n', ""), &["cut.mcap", "quadfrog recover"]);
}

/// Regression: `c` laid what was played of a trial; the countdown alone drew no line, and a trial that was not played was refused.
#[test]
fn whole_jumps_are_compared_wherever_the_playhead_is() {
    let mut session = paused((120, 40), &[]);
    // In the countdown of trial 2 nothing but its pose was played.
    let begin_ms = timeline(0).trials().iter().find(|run| run.trial == 2).unwrap().begin_ns / 1_000_000 + 20;
    session.send(&format!("G{}.{:03}\r", begin_ms / 1000, begin_ms % 1000));
    session.wait_for(&[&format!("{:02}:{:02}.{:03}", begin_ms / 60_000, begin_ms / 1000 % 60, begin_ms % 1000)]);
    session.send("2c");
    session.wait_for(&["trial 2 is laid under the charts of a jump; c on another row of Trials compares the two"]);
    session.send("\x1b[Fc");
    session.wait_for(&["A is trial 2, B is trial 5"]);
    session.send("1");
    session.wait_for(&["A #2 line, B #5 dotted, at +0.00 s"]);
    let shown = format!("roll A {} B {}", roll(0, 2, 0.0), roll(0, 5, 0.0));
    assert_shows(&session.screen(), &[&shown, "Two trials"]);
    let at_s = go(&mut session, 2, 0.25);
    session.wait_for(&["at +0.25 s"]);
    assert_shows(&session.screen(), &[&format!("roll A {} B {}", roll(0, 2, at_s), roll(0, 5, at_s))]);
    // The same again ends it.
    session.send("c");
    session.wait_until("it ends", || !session.screen().contains("dotted"));
    session.send("q");
    assert!(session.wait().success());
}

/// Regression: before anything was played there was `no jump` in a recording of six.
#[test]
fn the_best_trial_of_a_recording_is_laid_under_the_charts_from_the_start() {
    let mut session = paused((120, 40), &[]);
    let best = timeline(0).rows().into_values().filter(|row| row.verdict == Some(Verdict::Accept));
    let best = best.max_by(|a, b| a.value.partial_cmp(&b.value).unwrap()).unwrap().trial;
    session.send("c");
    session.wait_for(&[&format!("trial {best} is laid under the charts of a jump")]);
    session.send("q");
    assert!(session.wait().success());
}

/// Regression: the panel had the final verdicts above a table at the playhead, without a word.
#[test]
fn the_panel_of_two_trials_says_that_its_rows_are_of_the_end() {
    for (size, title) in
        [((80, 24), "Two trials, at the end ─"), ((120, 40), "Two trials, at the end of the recording ─")]
    {
        let mut session = paused(size, &[]);
        go(&mut session, 2, 0.1);
        session.send("|");
        session.wait_for(&["Which trial beside #2?"]);
        session.send("5\r");
        session.wait_for(&["A #2 line, B #5 dotted", title]);
        session.send(")");
        session.wait_until("the same rows in the table", || session.screen().contains("Two trials ─"));
        session.send("q");
        assert!(session.wait().success());
    }
}
