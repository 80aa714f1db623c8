//! The message line of a replay: answers to the viewer's keys, and the recorded answers to the operator of the session.

use std::path::PathBuf;

use crate::program::Program;
use crate::pty::Session;
use crate::support::{Console, assert_shows, trial};
use portable_pty::CommandBuilder;
use quadfrog::engine::ObserverStatus;
use quadfrog::recording::record::{LogLevel, LogRecord, Record};
use quadfrog::trial::Verdict;
use quadfrog_console::message::{Msg, ReplayStatus, ReplayTimeline};

const NO_FURTHER: &str = "no further fall or fault";

fn replayed() -> Console {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus { playing: true, ..ReplayStatus::default() }));
    console
}

/// Regression: while a replay played, the answer to a key of who watches was replaced by the next one that the session had recorded,
/// before it could be read.
#[test]
fn the_answer_to_a_key_in_a_replay_stays_until_it_is_read() {
    let mut console = replayed();
    console.update(Msg::Answer(NO_FURTHER.to_owned()));
    console.wait(300);
    console.answer("fall", true, "trial 3; u takes it back");
    let warning = |text: &str| {
        let (level, source, message) = (LogLevel::Warning, "control".to_owned(), text.to_owned());
        Record::Log(LogRecord { level, source, message })
    };
    console.wait(300);
    assert_eq!(console.said(), NO_FURTHER);
    // The newest one follows.
    console.record(warning("the battery is low"));
    console.wait(3000);
    assert_eq!(console.said(), NO_FURTHER);
    console.wait(1000);
    assert_eq!(console.said(), "the battery is low");
    // The next key takes its own answer away, not what the session said meanwhile.
    console.update(Msg::Answer(NO_FURTHER.to_owned()));
    console.record(warning("the battery is empty"));
    console.press(&["2"]);
    console.wait(100);
    assert_eq!(console.said(), "the battery is empty");
    // At another place it was not said.
    console.update(Msg::Answer(NO_FURTHER.to_owned()));
    console.record(warning("the battery is full"));
    console.update(Msg::Rewound);
    console.wait(5000);
    assert_eq!(console.said(), "");
}

/// Regression: the trials of `quadfrog optimize`, which records the ticks of the best one alone, were "of another session".
#[test]
fn a_trial_without_ticks_in_a_replay_is_not_of_another_session() {
    let mut console = replayed();
    console.record(Record::Trial(trial(13, Some(Verdict::Accept), None)));
    console.press(&["6"]);
    assert_shows(&console.screen(120, 40), &["trial 13 without ticks: accept"]);
    console.press(&["2", "Home", "Enter"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["not in this recording"]);
    assert!(!screen.contains("session"), "{screen}");
}

/// Regression: `u takes it back` in a replay was read as an answer to who watches.
#[test]
fn a_replay_names_the_operator_in_an_answer_that_he_got() {
    let mut console = replayed();
    console.answer("fall", true, "trial 3; u takes it back");
    assert_eq!(console.said(), "the operator: fall: trial 3; u takes it back");
    let mut live = Console::ready();
    live.answer("fall", true, "trial 3; u takes it back");
    assert_eq!(live.said(), "fall: trial 3; u takes it back");
}

/// An observer of a robot that moves sees at once what its session says.
#[test]
fn an_answer_to_an_observer_does_not_hide_the_session() {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus { observer: Some(ObserverStatus::default()), ..ReplayStatus::default() }));
    console.update(Msg::Answer(NO_FURTHER.to_owned()));
    console.answer("fall", true, "trial 3");
    assert_eq!(console.said(), "the operator: fall: trial 3");
}

#[test]
fn the_next_fall_is_offered_only_where_there_is_one() {
    let mut console = replayed();
    let offers = |console: &mut Console, last_fall_ns, time_ns| {
        console.update(Msg::Timeline(Box::new(ReplayTimeline { last_fall_ns, ..ReplayTimeline::default() })));
        console.update(Msg::Replay(ReplayStatus { time_ns, ..ReplayStatus::default() }));
        console.screen(160, 40).contains("} next fall")
    };
    assert!(!offers(&mut console, None, 0));
    assert!(offers(&mut console, Some(5), 4));
    assert!(!offers(&mut console, Some(5), 5));
}

#[test]
fn the_queue_of_a_replay_names_no_key_that_it_refuses() {
    let mut console = replayed();
    console.press(&["N"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["Nothing is queued."]);
    assert!(!screen.contains("queues the"), "{screen}");
}

/// The same on the program's own recording of six trials, of which the fifth falls.
#[test]
fn the_only_fall_of_a_recording_is_offered_once() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "6", "--seed", "0", "--record", "all"]);
    let file: PathBuf = program.study("recordings").join("session.mcap");
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["replay", file.to_str().unwrap()]);
    let mut session = Session::run(&program.path(""), (120, 40), command);
    session.wait_for(&["REPLAY", "} next fall"]);
    session.send("}");
    session.wait_until("the only fall is shown", || !session.screen().contains("} next fall"));
    session.send("}");
    session.wait_for(&[NO_FURTHER]);
    session.send("q");
    assert!(session.wait().success());
}
