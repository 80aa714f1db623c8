//! Output of the commands: no control character of any file, name or argument reaches the terminal, a full disk behind
//! standard output is an error, colours and defect reports.

use std::fs;
use std::path::Path;
use std::process::Stdio;

use crate::program::{Program, assert_shows, with_small_files};
use crate::pty::Session;
use crate::support::{Console, trial};
use portable_pty::CommandBuilder;
use quadfrog::recording::record::Record;
use quadfrog::trial::Verdict;
use quadfrog_console::message::Msg;
use quadfrog_console::output::printable;

/// Sets the title of a terminal, rings, colours the rest red by an 8-bit control character, and turns the direction of the rest.
const HOSTILE: &str = "\u{1b}]0;owned\u{7}\u{9b}31m\u{202e}";
/// The same in a string of JSON or of TOML.
const ESCAPED: &str = r"\u001b]0;owned\u0007\u009b31m\u202e";

/// A study whose name, notes, causes and attributes are hostile, in a folder with a hostile name.
fn hostile_study(program: &Program) -> String {
    program.text(&["optimize", "--trials", "2", "--record", "all"]);
    let study = program.study("recordings");
    let journal = study.join("study.log");
    let text = fs::read_to_string(&journal).unwrap();
    let hostile = text
        .replace("forward-seed0", &format!("forward-seed0{ESCAPED}"))
        .replace("\"landed and settled\"", &format!("\"landed {ESCAPED}\""))
        .replace("\"robot\":\"go1\"", &format!("\"robot\":\"go1\",\"extra\":\"{ESCAPED}\""));
    assert_ne!(hostile, text);
    fs::write(&journal, hostile).unwrap();
    let named = study.with_file_name(format!("study{HOSTILE}"));
    fs::rename(study, &named).unwrap();
    named.to_str().unwrap().to_owned()
}

/// Starts a command in a terminal.
fn begin_in_terminal(program: &Program, arguments: &[&str]) -> Session {
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(arguments);
    Session::run(&program.path(""), (120, 40), command)
}

/// Runs a command in a terminal to its end.
fn in_terminal(program: &Program, arguments: &[&str]) -> Session {
    let mut session = begin_in_terminal(program, arguments);
    session.wait();
    session
}

/// Checks that a command printed no part of [`HOSTILE`] raw.
fn assert_clean(session: &Session, command: &[&str]) {
    for part in ["\u{1b}]0;owned", "owned\u{7}", "\u{9b}", "\u{202e}"] {
        assert!(!session.sent(part.as_bytes()), "{command:?} prints {part:?}:\n{}", session.screen());
    }
}

#[test]
fn no_control_character_of_a_file_a_name_or_an_argument_reaches_the_terminal() {
    let program = Program::new();
    let study = hostile_study(&program);
    program.write("bad/optimize.toml", &format!("trials = \"{ESCAPED}\"\n"));
    program.write("unknown/control.toml", &format!("\"{ESCAPED}\" = 1\n"));
    program.write("robot/robot.toml", &format!("name = \"{ESCAPED}\"\nurdf = \"{ESCAPED}.urdf\"\n"));
    program.write("table.csv", &format!("number,state,value,params_{HOSTILE}\n0,COMPLETE,1,2\n"));
    let mcap = Path::new(&study).join("session.mcap");
    let mcap = mcap.to_str().unwrap();
    let log = format!("{study}/study.log");
    let missing = format!("{HOSTILE}.mcap");
    let commands: &[&[&str]] = &[
        &["study", "list"],
        &["study", "show", &study],
        &["study", "best", &study],
        &["study", "export", &study, "--format", "csv"],
        &["study", "export", &study, "--format", "json"],
        &["study", "import", &study, "table.csv"],
        &["study", "enqueue", &study, HOSTILE],
        &["study", "show", &study, "--name", HOSTILE],
        &["optimize", "--resume", &study, "--trials", "3"],
        &["optimize", "--join", &log, "--trials", "3"],
        &["optimize", "--join", HOSTILE, "--trials", "3"],
        &["optimize", "--trials", "1", "--output", HOSTILE],
        &["optimize", "--config", "bad"],
        &["optimize", "--config", "unknown"],
        &["optimize", "--config", HOSTILE],
        &["optimize", "--model", "robot"],
        &["optimize", "--task", HOSTILE],
        &["optimize", "--trials", HOSTILE],
        &["evaluate", "--point", HOSTILE],
        &["evaluate", "--config", HOSTILE],
        &["replay", &missing],
        &["replay", &log],
        &["recover", HOSTILE],
        &["recover", mcap],
        &["emulate", "--model", "robot"],
        &["emulate", "--bind", HOSTILE],
        &["doctor", "--output", HOSTILE],
        &["doctor", "--config", "bad"],
        &["--config", "bad"],
        &["--resume", HOSTILE],
        &["--robot", "go1", "--address", HOSTILE],
        &[HOSTILE],
    ];
    for command in commands {
        assert_clean(&in_terminal(&program, command), command);
    }
    let replay = &["replay", &study][..];
    let mut session = begin_in_terminal(&program, replay);
    session.wait_for(&["REPLAY"]);
    session.send("q");
    session.wait();
    assert_clean(&session, replay);
    assert!(in_terminal(&program, &["study", "list"]).sent(br"\u001b]0;owned"), "what was removed is not shown");
}

/// Regression: characters that turn the direction of a text reached the terminal from notes and names.
#[test]
fn no_character_that_turns_the_direction_of_a_text_is_printed_or_drawn() {
    let turned = "\u{202e}\u{2066}\u{200f}";
    assert_eq!(printable(&format!("a{turned}\tb\n")), "a\\u202e\\u2066\\u200f\tb\n");
    let program = Program::new();
    assert_shows(&program.refused(&["--operator", &format!("Ada{turned}")]), &["none of them a control character"]);
    let mut console = Console::ready();
    let mut row = trial(0, Some(Verdict::Accept), None);
    row.note = format!("before{turned}after");
    console.record(Record::Trial(row));
    for keys in [&["2"][..], &["Enter"], &["Esc", "m"]] {
        console.press(keys);
        let screen = console.screen(120, 40);
        assert!(screen.contains("beforeafter") && !turned.chars().any(|c| screen.contains(c)), "{screen}");
    }
    console.update(Msg::Paste(format!(" pasted{turned}text")));
    assert_shows(&console.screen(120, 40), &["pastedtext"]);
}

#[test]
fn a_full_disk_behind_the_standard_output_is_an_error() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "none"]);
    let study = program.study("recordings");
    let study = study.to_str().unwrap();
    let evaluate: &[&str] = &["evaluate", "--point", "f0=1.3,Fx=40,Fz=210", "--json"];
    // Of a small ensemble.
    program.write("small/prior.toml", "worlds = 2\npoints = 16\n");
    for arguments in [
        &["optimize", "--trials", "1", "--record", "none", "--json"][..],
        &["optimize", "--trials", "1", "--record", "none"],
        &["study", "show", study],
        &["study", "export", study],
        evaluate,
        &["report", study, "--json"],
        &["prior", "--json", "--config", "small"],
        &["doctor"],
        &["--help"],
        &["study", "--help"],
        &["--version"],
    ] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = program.command(arguments).stdout(full).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert!(message.contains("No space left on device"), "{message}");
    }
    // A reader that has read enough is no error.
    let mut child = program.command(&["study", "export", study]).stdout(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    assert!(child.wait().unwrap().success());
}

/// Regression: the message was "attempted another write after a write method failed", with status 2.
#[test]
fn a_recording_that_does_not_fit_is_named_with_its_cause() {
    let program = Program::new();
    let (status, message) = with_small_files(&program, 600, &["optimize", "--trials", "4", "--record", "all"]);
    assert_eq!(status, Some(1), "{message}");
    assert!(message.contains("session.mcap") && message.contains("File too large"), "{message}");
    assert!(!message.contains("another write"), "{message}");
    // No judged trial is lost.
    let study = program.study("recordings");
    let table = program.text(&["study", "show", study.to_str().unwrap()]);
    assert!(table.contains("4") && table.contains("Best: trial"), "{table}");
}

#[test]
fn two_studies_that_begin_in_the_same_second_have_two_folders() {
    let program = Program::new();
    let arguments = ["optimize", "--trials", "1", "--record", "none"];
    let children: Vec<_> = (0..6).map(|_| program.command(&arguments).stdout(Stdio::null()).spawn().unwrap()).collect();
    for mut child in children {
        assert!(child.wait().unwrap().success());
    }
    assert_eq!(program.studies("recordings").len(), 6);
}

#[test]
fn doctor_names_a_folder_that_cannot_be_written() {
    let program = Program::new();
    program.write("file", "");
    for folder in ["/proc/quadfrog", "file/below"] {
        let output = program.run(&["doctor", "--output", folder]);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(1), "{text}");
        let line = text.lines().find(|line| line.contains("folder")).expect("a line about the folder");
        assert!(line.starts_with("FAIL"), "{line}");
    }
    let text = String::from_utf8(program.run(&["doctor", "--output", "new/studies"]).stdout).unwrap();
    assert!(text.lines().any(|line| line.starts_with("ok") && line.contains("can be written")), "{text}");
    assert!(!program.path("new").exists(), "doctor changes nothing");
}

/// Regression: with a `console.toml` that the console refuses, `doctor` called the machine usable.
#[test]
fn doctor_refuses_the_appearance_and_keys_that_the_console_refuses() {
    let program = Program::new();
    program.write("mine/console.toml", "[keys]\narm = [\"F99\"]\n");
    let message = program.refused(&["doctor", "--config", "mine"]);
    assert_shows(&message, &["mine/console.toml:2", "`keys.arm` = F99", "is no key"]);
}

/// Regression: it has no screen, and was refused for a key of the screen.
#[test]
fn a_check_of_a_recording_needs_no_console_toml() {
    let program = Program::new();
    program.write("mine/console.toml", "[keys]\narm = [\"F99\"]\n");
    program.text(&["optimize", "--trials", "1", "--config", "mine"]);
    let study = program.study("recordings");
    program.text(&["replay", "--check", study.to_str().unwrap(), "--config", "mine"]);
}

#[test]
fn an_error_is_one_plain_line_without_colours_and_repetitions() {
    let program = Program::new();
    program.write("recordings", "a file in place of the folder");
    let output = program.command(&["optimize", "--trials", "1"]).env_remove("NO_COLOR").output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(!message.contains('\u{1b}') && !message.contains("BACKTRACE"), "{message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    assert_eq!(message.matches("a part of its path is a file").count(), 1, "the cause stands once: {message}");
}

/// Regression: long messages and paths were broken in the middle of a word at the width of the terminal.
#[test]
fn messages_in_a_terminal_are_broken_between_words() {
    let program = Program::new();
    let folder = "a-folder-with-a-long-name/".repeat(2);
    let message = String::from_utf8(program.run(&["study", "show", &folder]).stderr).unwrap();
    assert!(message.lines().any(|line| line.chars().count() > 60), "in a file the message has one line: {message}");
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["study", "show", &folder]);
    let mut session = Session::run(&program.path(""), (60, 24), command);
    session.wait();
    let rows = session.screen();
    for word in message.split_whitespace().filter(|word| !word.contains('`')) {
        assert!(rows.lines().any(|row| row.split(' ').any(|shown| shown == word)), "{word} is broken:\n{rows}");
    }
}

/// The commands at the end of a session are whole in a line of their own, to be copied.
#[test]
fn the_commands_at_the_end_of_a_session_begin_in_a_line_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let long = folder.path().join("a-folder-with-a-long-name");
    let mut session = Session::start(&long, (80, 24), &[]);
    session.wait_for(&["Press A to arm"]);
    session.send("q");
    assert!(session.wait().success());
    let sent = String::from_utf8_lossy(&session.sent_bytes()).into_owned();
    let shown = sent.split("The study and its recording are in").nth(1).expect("the end of the session");
    assert_shows(
        shown,
        &["continue the study:\r\n    quadfrog --resume /", "play the recording:\r\n    quadfrog replay /"],
    );
    // Regression: neither command that shows the results was named.
    assert_shows(
        shown,
        &["show its trials:\r\n    quadfrog study show /", "make its report:\r\n    quadfrog report /"],
    );
}

/// Regression: a new session named the recording of another one, which had begun in the same second and was running, as one to be
/// repaired.
#[test]
fn the_end_of_a_new_session_names_no_recording_of_another_one() {
    let program = Program::new();
    let now = jiff::Zoned::now();
    for second in 0..60 {
        let stamp = now.checked_add(jiff::SignedDuration::from_secs(second)).unwrap().strftime("%Y-%m-%dT%H-%M-%S");
        program.write(&format!("recordings/{stamp}-forward-seed0/session.mcap.part"), "");
    }
    let mut session = Session::start(&program.path("recordings"), (120, 40), &["--seed", "0"]);
    session.wait_for(&["Press A to arm"]);
    session.send("q");
    assert!(session.wait().success());
    let sent = String::from_utf8_lossy(&session.sent_bytes()).into_owned();
    let shown = sent.split("The study and its recording are in").nth(1).expect("the end of the session");
    assert_shows(shown, &["-forward-seed0-2", "make its report"]);
    assert!(!shown.contains("repair"), "{shown}");
}

/// Regression: a path in a dialog was broken in the middle of a name.
#[test]
fn a_path_in_a_dialog_is_broken_behind_a_slash() {
    let mut console = Console::ready();
    let mut row = trial(0, Some(Verdict::Accept), None);
    row.note = "recordings/forward-seed0/".repeat(8);
    console.record(Record::Trial(row));
    console.press(&["2", "Enter", "PgDn"]);
    let screen = console.screen(80, 24);
    let path: Vec<&str> = screen.lines().filter(|line| line.contains("recordings/")).collect();
    assert!(path.len() > 2, "{screen}");
    for line in path {
        assert!(line.trim_end_matches(['│', ' ']).ends_with('/'), "{screen}");
    }
}

/// Regression: the cause of a fall was broken in the middle of a word at the width of the terminal.
#[test]
fn the_trials_of_a_study_in_a_terminal_are_broken_between_words() {
    let program = Program::new();
    program.write("fall/safety.toml", "[fall]\npitch_rad = 0.02\n");
    program.text(&["optimize", "--config", "fall", "--trials", "2", "--seed", "1", "--output", "recordings"]);
    let study = program.study("recordings");
    let show = ["study", "show", study.to_str().unwrap()];
    let piped = program.text(&show);
    let long: Vec<&str> = piped.lines().filter(|line| line.contains("fall: pitch")).collect();
    assert!(!long.is_empty() && long.iter().all(|line| line.chars().count() > 80), "one line in a pipe: {piped}");
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(show);
    let mut session = Session::run(&program.path(""), (80, 60), command);
    session.wait();
    let rows = session.screen();
    for word in long.iter().flat_map(|line| line.split_whitespace()) {
        assert!(rows.lines().any(|row| row.split(' ').any(|shown| shown == word)), "{word} is broken:\n{rows}");
    }
    assert!(rows.lines().any(|row| row.starts_with("       ") && row.contains("rad")), "{rows}");
}
