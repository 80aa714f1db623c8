//! The program in a pseudo-terminal: a session by keys, and all ways to lose or leave the terminal.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::pty::{STRICT, Session, Setup};
use clap::Parser as _;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use portable_pty::CommandBuilder;
use quadfrog::optimize::journal::{Durability, Journal, JournalFile, LOCK_GRACE};
use quadfrog::optimize::trial::{Trial, TrialState};
use quadfrog::recording::player::Player;
use quadfrog::recording::record::Record;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{ProposalSource, TrialRecord, Verdict};
use quadfrog_console::app::{self, ConsoleOptions};
use quadfrog_console::feed::Feed;
use quadfrog_console::settings::ConsoleSettings;
use quadfrog_console::subcommand::{self, Arguments};
use quadfrog_console::theme::ThemeChoice;

const SIZE: (u16, u16) = (100, 30);

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder")
}

/// The one study that was made in the folder.
fn study(folder: &Path) -> PathBuf {
    let mut entries = std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path());
    let study = entries.next().expect("a study");
    assert!(entries.next().is_none(), "one study");
    study
}

fn player(folder: &Path) -> Player {
    Player::open(study(folder).join("session.mcap")).expect("a finished recording")
}

/// The newest row of each trial in the recording.
fn rows(player: &Player) -> Vec<TrialRecord> {
    let mut rows = std::collections::BTreeMap::new();
    for event in player.events() {
        if let Record::Trial(row) = &event.record {
            rows.insert(row.trial, row.clone());
        }
    }
    rows.into_values().collect()
}

/// Time at which `mode` was first entered, s.
fn entered(player: &Player, mode: Mode) -> f64 {
    let at = player.events().iter().find_map(|event| match &event.record {
        Record::Transition(change) if change.to == mode => Some(event.time_ns),
        _ => None,
    });
    let Some(at) = at else {
        let events: Vec<_> = player.events().iter().map(|event| &event.record).collect();
        panic!("{mode:?} was never entered: {events:#?}");
    };
    at as f64 / 1e9
}

/// The trials of a study on disk.
fn stored(file: &Path) -> Vec<Trial> {
    let journal = JournalFile::new(file, Durability::Synced, LOCK_GRACE).expect("a journal");
    let journal = Journal::open(journal).expect("a journal that can be read");
    journal.state().studies()[0].trials.clone()
}

#[test]
fn a_session_by_keys_agrees_with_the_recording_and_the_study() {
    let folder = folder();
    let mut session = Session::start(folder.path(), SIZE, &["--seed", "3"]);
    session.wait_for(&["DISARMED", "SIM", "Press A to arm", "STOP  Space F12"]);
    session.send("A");
    session.wait_for(&["READY", "Press g twice to jump"]);
    // Override Fx by hand.
    session.send("o");
    session.wait_for(&["Override trial #0"]);
    session.send("\x1b[B120\r");
    session.wait_for(&["Fx    120.0 N"]);
    session.approve();
    session.wait_for(&["Trial #0: judge it"]);
    // The suggested verdict is accept; the operator decides.
    session.send("f");
    session.wait_for(&["Did the robot fall?"]);
    session.send("y");
    session.wait_for(&["Trial #1 (sampler)"]);
    if session.screen().contains("DISARMED") {
        session.send("A");
    }
    session.wait_for(&["READY"]);
    session.approve();
    session.wait_for(&["Trial #1: judge it"]);
    session.send("r");
    session.wait_for(&["Trial #2 (re-run of #1)"]);
    assert!(session.quit().success(), "{}", session.screen());
    assert!(session.restored() && session.cooked(), "the terminal is not as before");

    let player = player(folder.path());
    assert_eq!(player.damage(), None);
    let rows = rows(&player);
    let first = &rows[0];
    assert_eq!((first.verdict, first.value, first.source), (Some(Verdict::Fall), Some(0.0), ProposalSource::Operator));
    assert_eq!(first.parameters.get("Fx"), Some(120.0));
    assert_eq!((rows[1].verdict, rows[1].value), (Some(Verdict::Void), None));
    let last = player.events().iter().rev().find_map(|event| match &event.record {
        Record::Proposal(proposal) => Some(proposal),
        _ => None,
    });
    let last = last.expect("a proposal");
    assert_eq!((last.trial, last.source, last.parent), (2, ProposalSource::Rerun, Some(1)));
    let again: Vec<f64> = last.parameters.iter().map(|p| p.value).collect();
    let before: Vec<f64> = rows[1].parameters.iter().map(|(_, value)| *value).collect();
    assert_eq!(again, before, "the same parameters again");

    let study = stored(&study(folder.path()).join("study.log"));
    let states: Vec<_> = study.iter().map(|trial| (trial.state, trial.value)).collect();
    assert_eq!(
        states,
        [(TrialState::Complete, Some(0.0)), (TrialState::Fail, None), (TrialState::Waiting, None)],
        "the fall counts with 0, the re-run trial is void, its repeat waits"
    );
    assert_eq!(study[0].parameter("Fx"), Some(120.0));
    assert_eq!(study[0].fixed(), [("Fx".to_owned(), 120.0)], "an override is a fixed parameter to the sampler");
    let queued: Vec<f64> = study[2].fixed().into_iter().map(|(_, value)| value).collect();
    let ran: Vec<f64> = study[1].parameters.iter().map(|(_, value)| *value).collect();
    let sorted = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values
    };
    assert_eq!(sorted(queued), sorted(ran));
}

#[test]
fn stop_key_stops_at_once_and_k_acknowledges() {
    let (_folder, mut session) = Session::opened(SIZE, &[]);
    session.send("A");
    session.wait_for(&["Press g twice"]);
    session.send(" ");
    session.wait_for(&["DAMPED", "k acknowledges"]);
    session.send("k");
    session.wait_for(&["DISARMED", "Press A to arm"]);
    session.send("q");
    assert!(session.wait().success());
}

#[test]
fn a_terminal_that_does_not_read_delays_no_stop() {
    let (folder, mut session) = Session::opened((200, 60), &[]);
    session.read(false);
    session.send("A");
    // The frames fill the terminal's buffer.
    std::thread::sleep(Duration::from_secs(4));
    session.send(" ");
    std::thread::sleep(Duration::from_millis(500));
    session.read(true);
    session.wait_for(&["DAMPED"]);
    session.send("kq");
    assert!(session.wait().success());
    let player = player(folder.path());
    // If drawing blocked the loop, both keys would be read together after the stall.
    let apart = entered(&player, Mode::Damped) - entered(&player, Mode::StandUp);
    assert!(apart > 3.0, "arming and stopping came {apart:.2} s apart, typed 4 s apart");
}

#[test]
fn resizing_at_any_moment_is_safe() {
    let (_folder, mut session) = Session::opened(SIZE, &[]);
    session.send("A");
    // Arming is refused on a terminal that is too small.
    session.wait_for(&["STAND UP"]);
    for step in 0..60_u16 {
        session.resize(20 + (step * 37) % 200, 5 + (step * 13) % 60);
        session.send(["1", "2", "3", "4", "5", "6", "?", "\x1b"][usize::from(step) % 8]);
        std::thread::sleep(Duration::from_millis(15));
    }
    // Esc and a key that follows at once are a key with Alt.
    session.send("\x1b");
    std::thread::sleep(Duration::from_millis(300));
    session.send("1");
    session.resize(40, 10);
    session.wait_for(&["needed 60x20"]);
    session.resize(80, 24);
    session.wait_for(&["READY", "Press g twice"]);
    session.send("qy");
    assert!(session.wait().success());
}

/// A whole trial on the smallest terminal.
#[test]
fn a_trial_runs_on_a_terminal_of_60_columns_and_20_rows() {
    let folder = folder();
    let mut session = Session::start(folder.path(), (60, 20), &["--seed", "3"]);
    session.wait_for(&["Press A to arm"]);
    session.send("A");
    session.wait_for(&["Press g twice", "f0", "Fx", "Fz"]);
    session.approve();
    session.wait_for(&["Trial #0: judge it", "suggested verdict", "a accept", "f fall"]);
    session.send("a");
    session.wait_for(&["Trial #1", "Press g twice"]);
    session.resize(59, 20);
    session.wait_for(&["needed 60x20", "STOP"]);
    session.resize(80, 24);
    session.wait_for(&["1 Live", "Trial #1"]);
    session.send("qy");
    assert!(session.wait().success());
}

#[test]
fn signals_end_the_program_with_the_terminal_restored() {
    for signal in [Signal::SIGTERM, Signal::SIGINT] {
        let (folder, mut session) = Session::opened(SIZE, &[]);
        // The mouse capture must end too.
        session.send("M");
        session.wait_for(&["mouse on"]);
        session.signal(signal);
        if signal == Signal::SIGINT {
            session.wait_for(&["Ctrl-C again within 2 s quits"]);
            session.signal(signal);
        }
        assert!(session.wait().success(), "{signal}");
        assert!(session.restored() && session.cooked(), "{signal}");
        assert_eq!(player(folder.path()).damage(), None, "{signal}");
    }
}

#[test]
fn suspending_gives_the_terminal_back_and_continuing_takes_it() {
    let folder = folder();
    let (mut session, console) = job_of_a_shell(folder.path(), &[]);
    // Refused while armed: a stopped process cannot stop a robot.
    kill(console, Signal::SIGTSTP).unwrap();
    session.wait_for(&["Ctrl-Z is not possible: the robot is armed"]);
    session.send("D");
    session.wait_for(&["Press A to arm"]);
    let from = session.bytes();
    session.send("\x1a");
    session.wait_for(&["Stopped"]);
    assert!(session.sent_after(from, b"\x1b[?1049l"), "{}", session.screen());
    session.send("fg\r");
    session.wait_for(&["Press A to arm", "STOP  Space F12"]);
    session.send("q");
    session.wait_for(&["The study and its recording are in", "shell>"]);
    end_shell(&mut session);
}

/// Regression: Ctrl-Z stopped a console without a shell above it for good, as in a terminal that runs nothing else. In a script
/// without job control the shell is a part of the process group that stops.
#[test]
fn a_console_that_no_shell_can_continue_is_not_suspended() {
    let console = format!("{} --output .", env!("CARGO_BIN_EXE_quadfrog"));
    for script in [format!("exec {console}"), format!("{console}; exit $?")] {
        let folder = folder();
        let mut shell = CommandBuilder::new("bash");
        shell.args(["--norc", "--noprofile", "-c", &script]);
        let mut session = Session::run(folder.path(), SIZE, shell);
        session.wait_for(&["Press A to arm"]);
        session.send("\x1a");
        session.wait_for(&["not suspended: there is no shell to continue it; quit instead"]);
        session.send("q");
        assert!(session.wait().success());
    }
}

/// Regression: the frame before the last one was often not written yet, and the last one, which says why the screen stands still,
/// was left out.
#[test]
fn the_last_frame_says_that_the_robot_lands() {
    let (_folder, mut session) = Session::opened(SIZE, &["--seed", "3"]);
    session.send("A");
    session.wait_for(&["READY"]);
    session.approve();
    session.wait_for(&["JUMP"]);
    session.send("q");
    session.wait_for(&["Quit?"]);
    // The frame after the key draws every cell.
    session.resize(200, 60);
    session.send("y");
    session.wait_for(&["quitting: the robot lands, then the program ends"]);
    assert!(session.wait().success());
}

/// The console as a job of a shell, armed, and its process.
fn job_of_a_shell(folder: &Path, variables: &[(&str, &str)]) -> (Session, Pid) {
    let mut session = Session::shell(folder, &Setup { size: SIZE, cell: (0, 0), variables });
    session.send(&format!("{} --output .\r", env!("CARGO_BIN_EXE_quadfrog")));
    session.wait_for(&["Press A to arm"]);
    session.send("A");
    session.wait_for(&["READY"]);
    let children = format!("/proc/{0}/task/{0}/children", session.pid());
    let console = std::fs::read_to_string(children).expect("the shell's child").trim().parse().expect("a number");
    (session, Pid::from_raw(console))
}

/// Ends the shell once it has the terminal again: what is typed before that is for the console, which drops it.
fn end_shell(session: &mut Session) {
    session.wait_until("the prompt", || session.screen().trim_end().ends_with("shell>"));
    session.send("exit\r");
    session.wait();
}

/// Regression: the shell had given the terminal its own mode, and STOP arrived with the next Enter.
#[test]
fn stop_works_after_a_shell_had_the_terminal() {
    let folder = folder();
    let (mut session, console) = job_of_a_shell(folder.path(), &[]);
    kill(console, Signal::SIGSTOP).unwrap();
    session.wait_for(&["Stopped"]);
    session.send("fg\r");
    session.wait_until("the whole screen is drawn again", || {
        let screen = session.screen();
        screen.contains("READY") && screen.contains("STOP  Space F12") && !screen.contains("Stopped")
    });
    session.send(" ");
    session.wait_for(&["DAMPED"]);
    session.send("k");
    session.wait_for(&["Press A to arm"]);
    // Another program changes the mode while the console has the terminal.
    let terminal = std::fs::File::open(format!("/proc/{console}/fd/0")).unwrap();
    assert!(std::process::Command::new("stty").arg("sane").stdin(terminal).status().unwrap().success());
    session.wait_until("the mode is restored", || !session.cooked());
    session.send("?");
    session.wait_for(&["Keys"]);
    session.send("\x1b");
    session.wait_until("the help is closed", || !session.screen().contains("Keys"));
    session.send("q");
    session.wait_for(&["The study and its recording are in", "shell>"]);
    end_shell(&mut session);
}

/// A console in the background neither reads nor draws, is not stopped for it, and does not count as a present operator.
#[test]
fn a_console_in_the_background_runs_on_and_its_robot_sits_down() {
    let folder = folder();
    let (mut session, console) = job_of_a_shell(folder.path(), &[STRICT]);
    kill(console, Signal::SIGSTOP).unwrap();
    session.wait_for(&["Stopped"]);
    session.send("clear; bg\r");
    session.send("echo a$((1+1))b\r");
    session.wait_for(&["a2b"]);
    let state = || std::fs::read_to_string(format!("/proc/{console}/stat")).unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    assert!(!state().contains(") T "), "{}", state());
    assert!(!session.screen().contains("READY"), "{}", session.screen());
    session.send("fg\r");
    session.wait_for(&["STOP  Space F12", "Press A to arm"]);
    session.send("q");
    session.wait_for(&["The study and its recording are in"]);
    end_shell(&mut session);
    assert!(entered(&player(folder.path()), Mode::SitDown) > 0.0);
}

#[test]
fn a_hang_up_closes_the_session_without_output() {
    let (folder, mut session) = Session::opened(SIZE, &[]);
    session.hang_up();
    session.wait();
    assert!(!session.sent(b"\x1b[?1049l"), "no output after a hang-up");
    assert_eq!(player(folder.path()).damage(), None);
}

/// Regression: the robot continued to jump without an operator, and the trial counted as interrupted by a crash.
#[test]
fn losing_the_operator_in_mid_jump_lands_the_robot_and_voids_the_trial() {
    // A series of seven seconds, so that the loss falls into it.
    let config = folder();
    std::fs::write(config.path().join("control.toml"), "[tasks.forward]\njumps = 5\nf1_hz = 0.5\n").expect("written");
    let first = "[first.forward]\nf0 = 1.3\nFx = 20.0\nFz = 270.0\n";
    std::fs::write(config.path().join("optimize.toml"), first).expect("written");
    let config = config.path().to_str().expect("a path");
    for way in [None, Some(Signal::SIGTERM), Some(Signal::SIGHUP)] {
        let (folder, mut session) = Session::opened(SIZE, &["--config", config]);
        session.send("A");
        session.wait_for(&["READY", "Press g twice to jump"]);
        session.approve();
        session.wait_for(&["JUMP"]);
        match way {
            Some(signal) => session.signal(signal),
            None => session.hang_up(),
        }
        session.wait();

        let player = player(folder.path());
        assert_eq!(player.damage(), None, "{way:?}");
        let changes = player.events().iter().filter_map(|event| match &event.record {
            Record::Transition(change) => Some(change.to),
            _ => None,
        });
        let landed = [Mode::Jump, Mode::Settle, Mode::Review];
        let after: Vec<Mode> = changes.skip_while(|mode| *mode != Mode::Jump).take(landed.len()).collect();
        assert_eq!(after, landed, "{way:?}");

        // The verdict and its cause are on disk.
        let study = study(folder.path());
        let trials = stored(&study.join("study.log"));
        let states: Vec<_> = trials.iter().map(|trial| trial.state).collect();
        assert_eq!(states, [TrialState::Fail, TrialState::Waiting], "{way:?}");
        assert_eq!(trials[0].user_attributes["verdict"], "void", "{way:?}");
        let cause = trials[0].user_attributes["cause"].as_str().expect("a cause");
        assert!(cause.starts_with("the session ended"), "{way:?}: {cause}");

        // Another program continues the study.
        let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
        command.arg("--resume");
        command.arg(&study);
        let mut session = Session::run(folder.path(), SIZE, command);
        session.wait_for(&["Trial #1 (re-run of #0)"]);
        session.send("q");
        assert!(session.wait().success(), "{way:?}");
    }
}

#[test]
fn a_hang_up_without_a_signal_is_detected() {
    let folder = folder();
    // After setsid the program has no controlling terminal and receives no SIGHUP.
    let mut command = CommandBuilder::new("setsid");
    command.args(["--wait", env!("CARGO_BIN_EXE_quadfrog"), "--output"]);
    command.arg(folder.path());
    let mut session = Session::run(folder.path(), SIZE, command);
    session.wait_for(&["Press A to arm"]);
    session.hang_up();
    let recording = study(folder.path()).join("session.mcap");
    session.wait_until("the recording is closed", || recording.exists());
    assert_eq!(player(folder.path()).damage(), None);
}

#[test]
fn a_panic_in_any_thread_restores_the_terminal_and_names_the_thread() {
    // While a long report of the control thread was printed, the console took the terminal back, as from a shell; of another
    // thread it did not wait for the end of the report.
    for (name, report_bytes) in [("injected", 0), ("injected", 2_000_000), ("control", 0), ("control", 2_000_000)] {
        let folder = folder();
        let mut command = ignored_test("terminal::a_console_one_of_whose_threads_panics");
        command.env("PANICKING_THREAD", name);
        command.env("REPORT_BYTES", report_bytes.to_string());
        let mut session = Session::run(folder.path(), (100, 30), command);
        session.wait_for(&["REPLAY", "no robot to stop"]);
        assert!(!session.wait().success(), "{name}, {report_bytes}");
        assert!(session.restored() && session.cooked(), "{name}, {report_bytes}: {}", session.screen());
        let texts = ["an injected defect".to_owned(), "end of the report".to_owned(), format!("`{name}` panicked")];
        for text in texts {
            assert!(session.sent(text.as_bytes()), "{name}, {report_bytes}, {text}: {}", session.screen());
        }
    }
}

#[test]
#[ignore = "run by another test in a terminal"]
fn a_console_one_of_whose_threads_panics() {
    let variable = |name: &str| std::env::var(name).expect("set by the other test");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/console/session.mcap");
    let player = Player::open(file).expect("the recorded session");
    let options = ConsoleOptions::new(ConsoleSettings::built_in(), None, ThemeChoice::Auto, false, false);
    let report = "long ".repeat(variable("REPORT_BYTES").parse::<usize>().expect("a number") / 5);
    let defect = move || {
        std::thread::sleep(Duration::from_secs(1));
        panic!("an injected defect: {report}end of the report");
    };
    std::thread::Builder::new().name(variable("PANICKING_THREAD")).spawn(defect).expect("a thread");
    let ended = app::run(Feed::replay(player), options);
    panic!("{}", ended.expect_err("the console ends with an error"));
}

#[test]
fn a_small_terminal_and_none_are_refused_with_status_2() {
    let folder = folder();
    let mut session = Session::start(folder.path(), (40, 10), &[]);
    assert_eq!(session.wait().exit_code(), 2);
    let printed: String = session.screen().split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(printed.replace(' ', "").contains("40x10") && printed.replace(' ', "").contains("60x20"), "{printed}");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_quadfrog"))
        .current_dir(folder.path())
        .stdin(std::process::Stdio::null())
        .output()
        .expect("run");
    assert_eq!(output.status.code(), Some(2));
    let printed = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(printed.contains("needs a terminal"), "{printed}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0, "no file is left");
}

/// It was status 0.
#[test]
fn a_panic_while_the_session_ends_is_an_error() {
    let folder = folder();
    let mut command = ignored_test("terminal::a_session_with_a_thread_that_panics_at_its_end");
    command.env("OUTPUT", folder.path());
    let mut session = Session::run(folder.path(), SIZE, command);
    session.wait_for(&["Press A to arm"]);
    session.send("q");
    assert!(!session.wait().success(), "{}", session.screen());
    assert!(session.restored() && session.cooked(), "{}", session.screen());
    assert!(session.sent(b"an injected defect") && session.sent(b"`injected` panicked"), "{}", session.screen());
    assert_eq!(player(folder.path()).damage(), None);
}

#[test]
#[ignore = "run by another test in a terminal"]
fn a_session_with_a_thread_that_panics_at_its_end() {
    // The thread `close` runs while the session ends.
    let ends = || {
        let threads = std::fs::read_dir("/proc/self/task").expect("the threads of this process").flatten();
        let mut names = threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("comm")).ok());
        names.any(|name| name.trim() == "close")
    };
    let defect = move || {
        while !ends() {
            std::thread::yield_now();
        }
        panic!("an injected defect");
    };
    std::thread::Builder::new().name("injected".into()).spawn(defect).expect("a thread");
    let output = std::env::var("OUTPUT").expect("set by the other test");
    if let Err(failure) = subcommand::run(Arguments::parse_from(["quadfrog", "--output", &output])) {
        failure.print();
        std::process::exit(1);
    }
}

/// This program as one ignored test.
fn ignored_test(name: &str) -> CommandBuilder {
    let mut command = CommandBuilder::new(std::env::current_exe().expect("this program"));
    command.args(["--ignored", "--exact", name, "--nocapture"]);
    command
}
