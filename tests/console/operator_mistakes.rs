//! A study of twelve jumps by an operator who has read the README alone, with the mistakes that operators made when the console was
//! reviewed: each is caught, refused or taken back, and the study is complete.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::pty::Session;
use portable_pty::CommandBuilder;

/// Jumps that count: enough for every mistake and some after the connection broke.
const TRIALS: usize = 12;
const DOWN: &str = "\x1b[B";
const ESCAPE: &str = "\x1b";

/// The study's folder.
fn study(folder: &Path) -> PathBuf {
    let entries = std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path());
    entries.into_iter().find(|path| path.join("study.log").exists()).expect("a study")
}

fn quadfrog(folder: &Path, arguments: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_quadfrog")).args(arguments).current_dir(folder).output().expect("it runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Stands the robot up, whatever stopped it.
fn stand(session: &mut Session) {
    session.wait_until("DAMPED, DISARMED or READY", || {
        ["DAMPED", "DISARMED", "READY"].iter().any(|mode| session.screen().starts_with(&format!(" {mode}")))
    });
    if session.screen().starts_with(" DAMPED") {
        session.send("k");
        session.wait_for(&["Press A to arm"]);
    }
    if session.screen().starts_with(" DISARMED") {
        session.send("A");
    }
    session.wait_for(&["Press g twice"]);
}

/// The number of the present trial, in the first line.
fn number(session: &Session) -> u32 {
    let screen = session.screen();
    let digits = screen.split("trial #").nth(1).map(|rest| rest.chars().take_while(char::is_ascii_digit).collect());
    digits.and_then(|digits: String| digits.parse().ok()).unwrap_or_else(|| panic!("no trial:\n{screen}"))
}

/// Jumps and waits for the question of the verdict; returns the number of the trial.
fn jump(session: &mut Session) -> u32 {
    stand(session);
    let trial = number(session);
    session.approve();
    session.wait_for(&[&format!("Trial #{trial}: judge it")]);
    trial
}

/// Judges a trial by a key, and waits for what follows.
fn judge(session: &mut Session, trial: u32, key: &str) {
    session.send(key);
    session.wait_until("the next trial or the end", || {
        number(session) > trial || session.screen().contains("Study finished")
    });
}

/// Judges a trial as the program suggests.
fn judge_as_suggested(session: &mut Session, trial: u32) {
    let fell = session.screen().contains("suggested verdict: fall");
    judge(session, trial, if fell { "f" } else { "a" });
}

/// Types new values of all three parameters.
fn override_by(session: &mut Session, [f0, fx, fz]: [&str; 3]) {
    session.send("o");
    session.wait_for(&["Override trial"]);
    session.send(&format!("{f0}{DOWN}{fx}{DOWN}{fz}\r"));
    let f0 = f0.replace(',', ".");
    session.wait_for(&[&format!("will run with f0 {f0} Hz, Fx {fx} N, Fz {fz} N")]);
}

#[test]
fn a_study_with_every_mistake_of_the_review_is_complete() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = Session::start(folder.path(), (80, 24), &["--trials", &TRIALS.to_string(), "--seed", "3"]);
    session.wait_for(&["Press A to arm"]);

    // A word typed where no dialog is open skips no proposal.
    stand(&mut session);
    session.send("stan");
    session.wait_for(&["Skip the proposal?"]);
    session.send(ESCAPE);
    session.wait_until("the question closes", || !session.screen().contains("Skip the proposal?"));
    session.wait_for(&["Press g twice", "Trial #0 (sampler)"]);
    // Suspending an armed robot is refused.
    session.send("\x1a");
    session.wait_for(&["Ctrl-Z is not possible: "]);

    // The jump stays on the charts while the operator measures; a note with spaces stops no robot.
    let trial = jump(&mut session);
    std::thread::sleep(Duration::from_secs(9));
    // From -0.3 s on, or a little later where a busy machine has lost the ticks there.
    session.wait_for(&["TRIAL #0", "#0, -0."]);
    session.send("m");
    session.wait_for(&["Note"]);
    session.send("foot slipped on the mat\r");
    session.wait_for(&["note"]);
    assert!(session.screen().starts_with(" REVIEW"), "{}", session.screen());
    judge(&mut session, trial, "a");

    // A value with its unit: the letter is refused, the number is taken.
    let trial = jump(&mut session);
    session.send("=");
    session.wait_for(&["by hand"]);
    session.send("0.235m\r");
    session.wait_for(&["a character was not taken; Enter again confirms 0.235"]);
    session.send("\r");
    session.wait_for(&["0.235 m by hand, but the robot measured"]);
    session.send("y");
    session.wait_for(&["0.235 m counts instead of the measured value"]);
    judge(&mut session, trial, "a");

    // The first override; a point that is queued twice is said to be, and one of both is removed again.
    override_by(&mut session, ["1,3", "80", "250"]);
    session.wait_for(&["80"]);
    session.send("Q");
    session.wait_for(&["(queued)"]);
    session.send("Q");
    session.wait_for(&["Queue it once more?"]);
    session.send("y");
    session.wait_for(&["queued once more"]);
    session.send("N");
    session.wait_for(&["Queue", "#2    queued", "#3    queued"]);
    session.send(&format!("{DOWN}x"));
    session.wait_for(&["Remove it from the queue?"]);
    session.send("y");
    session.wait_for(&["remove trial 3 from the queue: it does not run"]);
    session.send(ESCAPE);
    let trial = jump(&mut session);
    judge(&mut session, trial, "a");

    // The default of a number field is replaced by what is typed.
    session.send("4");
    session.send("X");
    session.wait_for(&["5"]);
    session.send("3");
    session.send("\r");
    session.wait_for(&["for the next 3 trials"]);
    session.send("1");
    let trial = jump(&mut session);
    judge(&mut session, trial, "a");

    // The second override falls; accepting it is asked once more.
    override_by(&mut session, ["0.95", "132", "155"]);
    let trial = jump(&mut session);
    session.wait_for(&["fall"]);
    session.send("a");
    session.wait_for(&["Accept"]);
    session.send(ESCAPE);
    session.wait_for(&["cancelled: not accepted"]);
    judge(&mut session, trial, "f");
    let fell = trial;
    // A verdict acknowledges nothing, and the simulator says that it turns the robot over.
    session.wait_for(&[" DAMPED", "k acknowledges"]);
    session.send("k");
    session.wait_for(&["Press A to arm"]);
    session.send("A");
    // Regression: the sentence took two of the 24 lines.
    session.wait_for(&["the simulated robot was laid upright and folded; a real one needs a person"]);

    // A re-run; the terminal shrinks and grows meanwhile.
    let trial = jump(&mut session);
    for size in [(40, 10), (60, 20), (200, 60), (20, 5), (80, 24)] {
        session.resize(size.0, size.1);
        std::thread::sleep(Duration::from_millis(50));
    }
    session.wait_for(&[&format!("Trial #{trial}: judge it")]);
    judge(&mut session, trial, "r");
    session.wait_for(&[&format!("re-run of #{trial}")]);

    let trial = jump(&mut session);
    judge_as_suggested(&mut session, trial);

    // An undone verdict.
    session.send("u");
    session.wait_for(&[&format!("Trial #{trial}: judge it")]);
    session.send("6");
    session.wait_for(&[&format!("undo the verdict: the verdict of trial {trial} is taken back")]);
    session.send("1");
    judge_as_suggested(&mut session, trial);

    // The connection breaks in the countdown or the jump.
    stand(&mut session);
    session.approve();
    session.wait_until("the jump begins", || ["COUNTDOWN", "JUMP"].iter().any(|mode| session.screen().contains(mode)));
    session.hang_up();
    session.wait();
    let recordings = study(folder.path());
    let place = recordings.to_str().expect("a path");
    let mut session = Session::start(folder.path(), (80, 24), &["--resume", place]);
    session.wait_for(&["Press A to arm", "re-run of #"]);

    // Regression: in the log the verdicts of the session before had the time of this one, and values by hand were not marked.
    session.send("6");
    session.wait_for(&["of another session: accept, J = 0.235 m by hand"]);
    session.send("1");

    // The best trial of the session before is laid under the charts, once its recording is read.
    for _ in 0..40 {
        session.send("c");
        std::thread::sleep(Duration::from_millis(500));
        if session.screen().contains("is laid under the charts of a jump") {
            break;
        }
    }
    session.wait_for(&["is laid under the charts of a jump"]);
    session.send("c");
    session.wait_for(&["no trial is laid under the charts"]);

    // A verdict of an earlier trial is changed, with the reason.
    session.send("2");
    session.send("\x1b[H");
    session.send("v");
    session.wait_for(&["Why?"]);
    session.send("the mat moved\r");
    session.wait_for(&["change the verdict of trial 0 to void (the mat moved): it was accept", "keeps both"]);
    // The ranges from which the trials of the session before were drawn.
    session.send("\r");
    session.wait_for(&["(searched from 0.75 to 1.75 Hz)"]);
    session.send(ESCAPE);
    session.wait_until("the details close", || !session.screen().contains("searched from"));
    session.send("1");

    // The rest of the study.
    while !session.screen().contains("Study finished") {
        let trial = jump(&mut session);
        judge_as_suggested(&mut session, trial);
    }
    session.wait_for(&[&format!("{TRIALS}/{TRIALS}")]);
    assert!(session.quit().success());

    // What it leaves is whole.
    let checked = quadfrog(folder.path(), &["replay", "--check", place]);
    assert_eq!(checked.matches("  whole\n").count(), 2, "{checked}");
    let shown = quadfrog(folder.path(), &["study", "show", place]);
    // Two spaces: in a reason the verdict has one before it.
    let (table, _) = shown.split_once("Best: ").expect("the best trial");
    let judged = table.lines().filter(|line| line.contains("  accept") || line.contains("  fall: ")).count();
    assert_eq!(judged, TRIALS, "{shown}");
    let exported = quadfrog(folder.path(), &["study", "export", place]);
    for part in ["foot slipped on the mat", "the mat moved", "0.235"] {
        assert!(exported.contains(part), "no {part} in\n{exported}");
    }

    // The replay: to the fall, and on to the end.
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["replay", place]);
    let mut replay = Session::run(folder.path(), (80, 24), command);
    replay.wait_for(&["REPLAY"]);
    replay.send("p(}");
    // A first line without room leaves the word out.
    let at_fall = |screen: &str| {
        [format!("  trial #{fell}  "), format!("  #{fell}  ")].iter().any(|shown| screen.contains(shown))
    };
    replay.wait_until("the fall", || at_fall(replay.screen().lines().next().unwrap_or_default()));
    replay.send(")");
    // The first trial's changed verdict and its note.
    replay.send("2");
    replay.send("\x1b[H");
    replay.resize(200, 60);
    replay.wait_for(&["the mat moved; changed by the operator", "foot slipped on the mat"]);
    replay.send("q");
    assert!(replay.wait().success());
}

/// Regression: beside a running console the table of the study said "running" of a trial that a STOP had ended.
#[test]
fn another_shell_shows_that_a_stopped_trial_waits_for_its_verdict() {
    let (folder, mut session) = Session::opened((120, 40), &["--trials", "1", "--seed", "3"]);
    stand(&mut session);
    session.approve();
    session.wait_for_long("the countdown is over", || session.screen().contains(" JUMP "));
    session.send(" ");
    session.wait_for(&["void (suggested)"]);
    let recordings = folder.path().join("recordings");
    let study = study(&if recordings.is_dir() { recordings } else { folder.path().to_owned() });
    let show = || quadfrog(folder.path(), &["study", "show", study.to_str().expect("a path")]);
    session.wait_until("it waits", || show().contains("Trial 0 waits for its verdict") && !show().contains("running"));
    session.send("kq");
    session.wait_for(&["Quit"]);
    session.send("y");
    session.wait();
    // Without its session it runs again.
    let shown = show();
    assert!(!shown.contains("waits for its verdict"), "{shown}");
}

/// Regression: beside a running console, report and table said "running" and "no trial was accepted" of a trial whose verdict was on
/// the screen.
#[test]
fn another_shell_shows_a_verdict_that_can_still_be_taken_back() {
    let (folder, mut session) = Session::opened((120, 40), &["--trials", "1", "--seed", "3"]);
    let trial = jump(&mut session);
    let recordings = folder.path().join("recordings");
    let at = if recordings.is_dir() { recordings } else { folder.path().to_owned() };
    let study = study(&at);
    let place = study.to_str().expect("a path");
    let show = quadfrog(folder.path(), &["study", "show", place]);
    assert!(show.contains(&format!("Trial {trial} waits for its verdict")) && !show.contains("running"), "{show}");
    // Regression: a value by hand was not shown before the verdict.
    session.send("=0.52\r");
    session.wait_for(&["by hand"]);
    let by_hand = format!("Trial {trial} waits for its verdict, by hand 0.520 m");
    let show = || quadfrog(folder.path(), &["study", "show", place]);
    session.wait_until("the value by hand is in the study", || show().contains(&by_hand));
    judge_as_suggested(&mut session, trial);
    let show = quadfrog(folder.path(), &["study", "show", place]);
    let best = show.lines().last().unwrap_or_default().to_owned();
    assert!(
        best.starts_with("Best: trial ") && best.ends_with("accept, J by hand") && !show.contains("running"),
        "{show}"
    );
    assert!(show.contains("seed: 3") && !show.contains("seed 0"), "the sampler's seed is the study's: {show}");
    let list = quadfrog(folder.path(), &["study", "list", at.to_str().expect("a path")]);
    assert!(!list.lines().nth(1).unwrap_or_default().ends_with('-'), "{list}");
    let report = quadfrog(folder.path(), &["report", place]);
    assert!(!report.contains("was accepted") && report.contains("searched last over f0"), "{report}");
    session.quit();
}
