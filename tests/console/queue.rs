//! The running program: the queue as the operator sees, orders and shortens it, and as Python Optuna reads it afterwards.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use crate::pty::Session;
use crate::skip::skip;
use crate::support::{Console, assert_shows, line_with, proposal, session as session_info};
use quadfrog::recording::record::{Record, SessionInfo};
use quadfrog::trial::{ParameterInfo, ProposalSource, QueuedPoint, SearchStatus};

fn quadfrog(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_quadfrog")).args(arguments).current_dir(folder).output().expect("it runs")
}

fn text(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Arms the robot and lets it jump; the trial waits for its verdict then.
fn jump(session: &mut Session) {
    session.send("A");
    session.wait_for(&["Press g twice"]);
    session.approve();
    session.wait_for(&["judge it"]);
}

/// The study of the only session in `folder`.
fn study_of(folder: &Path) -> PathBuf {
    let mut entries = std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path());
    entries.find(|path| path.join("study.log").exists()).expect("a study")
}

/// A session with three queued points, and the folder of its study.
fn session_with_queue(folder: &Path) -> (Session, PathBuf) {
    let mut session = Session::start(folder, (120, 40), &["--seed", "3", "--sampler", "random"]);
    session.wait_for(&["Press A to arm"]);
    let study = study_of(folder);
    for f0 in ["1.1", "1.2", "1.3"] {
        let point = [&format!("f0={f0}"), "Fx=60", "Fz=240"];
        text(&quadfrog(
            folder,
            &[&["study", "enqueue", study.to_str().unwrap()][..], &point.map(|p| p as &str)].concat(),
        ));
    }
    // Regression: the proposal changed, and the log alone said why.
    session.wait_for(&["another program has changed the queue: another point is proposed"]);
    session.send("N");
    session.wait_for(&[
        "Queue",
        "#0    queued          f0 1.100 Hz, Fx 60.00 N, Fz 240.0 N",
        "#1",
        "#2    queued          f0 1.3",
    ]);
    (session, study)
}

/// Regression: the answer said that the parameters of a re-run are proposed again, and another point was.
#[test]
fn the_answer_to_a_rerun_names_what_was_queued_before_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut session, _) = session_with_queue(folder.path());
    session.send("\r");
    session.wait_for(&["Press A to arm"]);
    jump(&mut session);
    session.send("r");
    session.wait_for(&["trial 0 is void, and its parameters are queued; trial 1 comes first"]);
    session.send("N");
    session.wait_for(&["#3    re-run of #0"]);
}

/// Regression: the queue view of a finished study did not show what another program had queued since, nor say when it runs; and that
/// program said nothing of it while the last verdict could be taken back. An exported table's queued points were counted as trials.
#[test]
fn a_point_that_is_queued_for_a_finished_study_is_shown_and_waits_for_more_trials() {
    let folder = tempfile::tempdir().expect("a folder");
    let arguments = ["--seed", "3", "--sampler", "random", "--trials", "1"];
    let mut session = Session::start(folder.path(), (120, 40), &arguments);
    session.wait_for(&["Press A to arm"]);
    jump(&mut session);
    session.send("a");
    session.wait_for(&["The study is finished."]);
    session.send("N");
    session.wait_for(&["Nothing is queued: the study is finished, and C gives it more trials.", "in Trials queues"]);
    let study = study_of(folder.path());
    let study = study.to_str().unwrap();
    let queued = text(&quadfrog(folder.path(), &["study", "enqueue", study, "f0=1.1", "Fx=60", "Fz=240"]));
    let expected =
        "Queued as trial 1; the study has all of its trials: what is queued runs once `C` in the console gives more";
    assert_eq!(queued.split_whitespace().collect::<Vec<_>>().join(" "), expected);
    session
        .wait_for(&["The study is finished: these run once C gives it more trials.", "#1    queued          f0 1.100"]);
    let exported = quadfrog(folder.path(), &["study", "export", study, "-o", "table.csv"]);
    let said = String::from_utf8_lossy(&exported.stderr).into_owned();
    assert!(said.contains("1 trial and 1 queued point: table.csv"), "{said}");
    // Regression: the advice to queue the unfinished ones queued all of them.
    let imported = text(&quadfrog(folder.path(), &["study", "import", study, "table.csv"]));
    assert!(imported.contains("2 unfinished trials ignored, --queue=waiting queues 1"), "{imported}");
    let again = text(&quadfrog(folder.path(), &["study", "import", "--queue=waiting", study, "table.csv"]));
    assert!(again.contains("1 point queued"), "{again}");
    let table = std::fs::read_to_string(folder.path().join("table.csv")).unwrap();
    std::fs::write(folder.path().join("far.csv"), table.replace("240", "900")).unwrap();
    let refused = quadfrog(folder.path(), &["study", "import", "--queue", study, "far.csv"]);
    let said = String::from_utf8_lossy(&refused.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    let expected = "far.csv: row 2: Fz = 900 is outside its bounds 150 to 350; widen them with `B` in the console, or \
                    leave the row out";
    assert!(said.contains(expected), "{said}");
    session.wait_for(&["#2    queued          f0 1.100"]);
    assert!(session.screen().contains("#1") && !session.screen().contains("#3"), "{}", session.screen());
}

/// Regression: the approval, the header and the log named the number that the queued point had, and the jump had another one.
#[test]
fn a_changed_proposal_is_approved_under_the_number_of_its_trial_beside_a_point_of_another_program() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = Session::start(folder.path(), (120, 40), &["--seed", "5"]);
    session.wait_for(&["Press A to arm"]);
    session.send("A");
    session.wait_for(&["Press g twice"]);
    session.send("o");
    session.wait_for(&["Override trial #0"]);
    session.send("1.2\r");
    session.wait_for(&["trial 0 will run with f0 1.2 Hz"]);
    // The question stays open: it is the same point.
    session.send("g");
    session.wait_for(&["to jump (trial #0)"]);
    let study = study_of(folder.path());
    text(&quadfrog(folder.path(), &["study", "enqueue", study.to_str().unwrap(), "f0=1.1"]));
    session.wait_for(&["to jump (trial #1)", "Trial #1 (operator)"]);
    assert!(session.screen().lines().next().unwrap().contains("trial #1 "), "{}", session.screen());
    std::thread::sleep(Duration::from_secs(1));
    session.send("g");
    session.wait_for(&["approve trial 1: the countdown begins"]);
    session.wait_for(&["Trial #1: judge it"]);
    session.send("v");
    session.wait_for(&["Trial #0 (queued)"]);
    assert!(session.quit().success());
}

#[test]
fn queued_points_are_seen_moved_and_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut session, study) = session_with_queue(folder.path());
    // The last point becomes the first one, and the proposal follows.
    session.send("\x1b[B\x1b[B");
    session.send("\x1b[D");
    session.wait_for(&["#1    queued          f0 1.3", "#2    queued          f0 1.2"]);
    session.wait_for(&["move earlier: f0 1.300 Hz, Fx 60.00 N, Fz 240.0 N is number 2 of 3 in the queue now"]);
    session.send("\x1b[D");
    session.wait_for(&["#0    queued          f0 1.3", "#1    queued          f0 1.1"]);
    session.send("\x1b[D");
    session.wait_for(&["trial 0 is the first of the queue"]);
    session.send("\r");
    session.wait_for(&["1.300"]);
    // The middle one is removed; its trial is void and never runs.
    session.send("N");
    session.wait_for(&["#1    queued          f0 1.1"]);
    session.send("\x1b[Bx");
    session.wait_for(&["Remove it from the queue?", "Trial #1 will leave the queue"]);
    session.send("y");
    session.wait_for(&["remove trial 1 from the queue: it does not run", "#2    queued          f0 1.2"]);
    assert!(!session.screen().contains("#1    queued"), "{}", session.screen());
    session.send("\r");
    session.send("2");
    session.wait_for(&["v not run", "queued", "removed from the queue", "1 not run"]);
    session.send("1");
    assert!(session.quit().success());

    let shown = text(&quadfrog(folder.path(), &["study", "show", study.to_str().unwrap()]));
    assert!(shown.contains("0 running, 2 queued\n  #0 f0 1.3, Fx 60, Fz 240\n  #2 f0 1.2, Fx 60, Fz 240"), "{shown}");
    let report = text(&quadfrog(folder.path(), &["report", study.to_str().unwrap()]));
    assert!(report.contains("not run"), "{report}");
    let row = line_with(&report, "forward, seed 3, go1,");
    let counts: Vec<&str> = row.split_whitespace().rev().skip(2).take(5).collect();
    assert_eq!(counts, ["0"; 5], "void, repeats, falls, accepted, trials: {report}");
    // A resumed session has the same queue.
    let mut session = Session::start(folder.path(), (80, 24), &["--resume", study.to_str().unwrap()]);
    session.wait_for(&["Press A to arm"]);
    session.send("N");
    session.wait_for(&["#0    queued          f0 1.3", "#2    queued          f0 1.2"]);
    session.send("\r");
    assert!(session.quit().success());

    let script = "import sys, optuna\n\
                  from optuna.storages.journal import JournalFileBackend\n\
                  storage = optuna.storages.JournalStorage(JournalFileBackend(sys.argv[1]))\n\
                  study = optuna.load_study(study_name=None, storage=storage)\n\
                  for t in study.get_trials():\n    print(t.number, t.state.name, t.system_attrs.get('fixed_params', {}).get('f0'))\n\
                  print(study.ask().number)\n";
    let read = Command::new("python3").args(["-c", script]).arg(study.join("study.log")).output();
    match read {
        Ok(read) if read.status.success() => {
            // Optuna takes the points in the same order, and never the removed one.
            let read = String::from_utf8_lossy(&read.stdout).into_owned();
            assert_eq!(read, "0 WAITING 1.3\n1 FAIL 1.1\n2 WAITING 1.2\n0\n");
        }
        Ok(read) => {
            assert!(String::from_utf8_lossy(&read.stderr).contains("No module named"), "{read:?}");
            skip("python3 has no optuna");
        }
        Err(error) => skip(&format!("python3 cannot be started: {error}")),
    }
}

/// Regressions: the gains that the operator has changed for the best trial were in its note alone, and were called different from
/// the configured ones after another session had configured others.
#[test]
fn changed_gains_of_the_best_trial_are_shown_with_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = Session::start(folder.path(), (120, 40), &["--seed", "3", "--trials", "1"]);
    session.wait_for(&["Press A to arm"]);
    session.send("o");
    session.wait_for(&["Override trial #0", "kp"]);
    session.send("\x1b[B\x1b[B\x1b[B");
    session.send("600\r");
    session.wait_for(&["trial 0 will run with kp 600"]);
    jump(&mut session);
    session.send("a");
    session.wait_for(&["Study finished"]);
    assert!(session.quit().success());
    let study = study_of(folder.path());
    let study = study.to_str().unwrap();
    let shown = text(&quadfrog(folder.path(), &["study", "show", study]));
    let best: Vec<&str> = shown.lines().skip_while(|line| !line.starts_with("Best: trial")).collect();
    assert_eq!(best.get(1), Some(&"      other gains: kp 600 (newest configuration: 400)"), "{shown}");
    let report = text(&quadfrog(folder.path(), &["report", study]));
    assert!(
        report.contains("Best trial of forward, seed 3, other gains: kp 600 (newest configuration: 400)."),
        "{report}"
    );
    // Regression: the runs of the best trial had the configured gains, without a word.
    let evaluated = quadfrog(folder.path(), &["evaluate", "--config", study, "--point", "best", "--json"]);
    let run: serde_json::Value = serde_json::from_str(&text(&evaluated)).expect("one run");
    let said = String::from_utf8_lossy(&evaluated.stderr).into_owned();
    assert!(said.contains("trial 0 ran with other gains: kp 600 (configured 400): so do these runs"), "{said}");
    let usual = ["evaluate", "--config", study, "--point", &best_point(study, folder.path()), "--json"];
    let usual: serde_json::Value = serde_json::from_str(&text(&quadfrog(folder.path(), &usual))).expect("one run");
    assert_ne!(run["value"], usual["value"]);
    // The note has the configuration with which the trial ran; the comparison that with which the study runs now.
    std::fs::create_dir(folder.path().join("other")).expect("a folder");
    std::fs::write(folder.path().join("other/control.toml"), "[tasks.forward]\nkp = 500.0\n").expect("a configuration");
    let mut session = Session::start(folder.path(), (120, 40), &["--resume", study, "--config", "other"]);
    session.wait_for(&["Study finished"]);
    assert!(session.quit().success());
    let shown = text(&quadfrog(folder.path(), &["study", "show", study]));
    assert!(shown.contains("other gains: kp 600 (newest configuration: 500)"), "{shown}");
    assert!(shown.contains("other gains: kp 600 (configured 400)"), "{shown}");
}

/// The parameters of the only trial of a study, as `--point` takes them.
fn best_point(study: &str, folder: &Path) -> String {
    let table: serde_json::Value =
        serde_json::from_str(&text(&quadfrog(folder, &["study", "export", study, "--format", "json"])))
            .expect("a table");
    let row = if table.is_array() { &table[0] } else { &table };
    ["f0", "Fx", "Fz"].map(|name| format!("{name}={}", row[format!("params_{name}")])).join(",")
}

/// The first point of the queue is the proposal: when it is moved or removed, the next one is proposed, and STOP works over the list.
#[test]
fn the_proposal_follows_the_queue_and_stop_works_over_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut session, _) = session_with_queue(folder.path());
    session.send("x");
    session.wait_for(&["Trial #0, the present proposal, will leave the queue"]);
    session.send("n");
    session.wait_for(&["cancelled: not removed", "#0    queued          f0 1.1"]);
    session.send("x");
    session.wait_for(&["Remove it from the queue?"]);
    session.send("y");
    session.wait_for(&["remove trial 0 from the queue: it does not run", "#1    queued          f0 1.2"]);
    session.send("\r");
    session.wait_for(&["Trial #1", "1.200"]);
    session.send("A");
    session.wait_for(&["Press g twice"]);
    session.send("N");
    session.wait_for(&["Left Right move it"]);
    session.send(" ");
    session.wait_for(&["DAMPED"]);
    session.send("k");
    session.wait_for(&["Press A to arm"]);
    // Nothing is changed while a trial runs.
    jump(&mut session);
    session.send("N");
    session.wait_for(&["#2    queued          f0 1.3"]);
    session.send("xy");
    session.wait_for(&["finish the present trial first"]);
    session.send("\r");
    session.send("a");
    session.wait_for(&["Trial #2"]);
    session.send("N");
    session.wait_for(&["#2    queued          f0 1.3"]);
    session.send("xy");
    session.wait_for(&["Nothing is queued: the sampler proposes."]);
    session.send("\r");
    session.wait_for(&["Trial #3"]);
}

#[test]
fn a_point_that_is_queued_twice_is_said_to_be() {
    let (_folder, mut session) = Session::opened((80, 24), &["--seed", "3", "--sampler", "random"]);
    session.send("Q");
    session.wait_for(&["Queue the sampler's values?"]);
    session.send("y");
    session.wait_for(&["Trial #0 (queued)"]);
    session.send("Q");
    session.wait_for(&["Queue it once more?", "remains the proposal"]);
    session.send("n");
    session.wait_for(&["cancelled: not queued"]);
    session.send("Q");
    session.wait_for(&["Queue it once more?"]);
    session.send("y");
    session.wait_for(&["queued once more", "1 more queued (N)"]);
    session.send("N");
    session.wait_for(&["#0    queued", "#1    queued"]);
}

/// Regression: a point that is queued behind a re-run made its verdict final without a word.
#[test]
fn a_change_of_the_queue_that_makes_a_re_run_final_says_so() {
    let (_folder, mut session) = Session::opened((120, 40), &["--seed", "3", "--sampler", "random"]);
    jump(&mut session);
    session.send("r");
    session.wait_for(&["Trial #1 (re-run of #0)"]);
    session.send("Q");
    session.wait_for(&["Queue it once more?"]);
    session.send("y");
    session.wait_for(&["undo no longer reaches the verdict of trial 0"]);
}

/// Regression: undo dropped the values that were changed for the next proposal, and so did quitting.
#[test]
fn the_changed_values_of_the_proposal_stay_over_an_undo_and_a_new_session() {
    let (folder, mut session) = Session::opened((120, 40), &["--seed", "3", "--sampler", "random"]);
    jump(&mut session);
    session.send("a");
    session.wait_for(&["Trial #1 (sampler)"]);
    session.send("o");
    session.wait_for(&["Override trial #1"]);
    session.send("1.2\r");
    session.wait_for(&["trial 1 will run with f0 1.2 Hz"]);
    session.send("u");
    session.wait_for(&["proposal 1 keeps its changed values"]);
    session.send("a");
    session.wait_for(&["Trial #1 (operator)"]);
    assert!(session.quit().success());
    let study = study_of(folder.path());
    let arguments = ["--resume", study.to_str().unwrap(), "--sampler", "sobol"];
    let mut session = Session::start(folder.path(), (120, 40), &arguments);
    session.wait_for(&["Trial #1 (operator)", "the sampler is sobol from now on"]);
    session.send("6");
    session.wait_for(&["kept from before: trial 1 will run with f0 1.2 Hz"]);
    // A re-run takes the number.
    session.send("1");
    jump(&mut session);
    session.send("a");
    session.wait_for(&["Trial #2 (sampler)"]);
    session.send("o");
    session.wait_for(&["Override trial #2"]);
    session.send("1.3\r");
    session.wait_for(&["trial 2 will run with f0 1.3 Hz"]);
    session.send("u");
    session.wait_for(&["proposal 2 keeps its changed values"]);
    session.send("r");
    session.wait_for(&["the changed values of proposal 2 are"]);
    assert!(session.quit().success());
}

/// Regression: a parameter that was fixed changed the other values of the shown proposal without a word.
#[test]
fn a_change_of_the_search_says_that_the_proposal_is_drawn_again() {
    let (_folder, mut session) = Session::opened((120, 40), &["--seed", "3", "--sampler", "random"]);
    session.send("4");
    session.wait_for(&["fix f0 at"]);
    session.send("X");
    session.wait_for(&["for how many trials"]);
    session.send("3\r");
    session.wait_for(&["proposal 0 is drawn again"]);
    assert!(session.quit().success());
}

/// Regression: a number and its unit stood on two lines of the list.
#[test]
fn a_number_of_the_queue_stays_on_the_line_of_its_unit() {
    let mut console = Console::ready();
    let gains = [("kp", 450.0), ("kd", 12.0), ("kp_joint", 60.0), ("kd_joint", 0.8)];
    let info = |(name, _): &(&str, f64)| ParameterInfo {
        name: (*name).into(),
        unit: "N m / s/rad".into(),
        ..ParameterInfo::default()
    };
    let known = gains.iter().map(info).collect();
    console.record(Record::Session(SessionInfo { gains: known, ..session_info() }));
    let gains: Vec<(String, f64)> = gains.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
    let point =
        QueuedPoint { trial: 3, source: ProposalSource::Operator, gains: gains.into(), ..QueuedPoint::default() };
    console.record(Record::Search(SearchStatus { queue: vec![point], ..SearchStatus::default() }));
    console.press(&["N"]);
    for columns in 80..=160 {
        let screen = console.screen(columns, 24);
        assert_shows(&screen, &["kp 450.0 N m / s/rad", "kp_joint 60.00 N m / s/rad", "kd_joint 0.800 N m / s/rad"]);
    }
}

/// Regression: the list showed the stored values of the proposal where the operator had changed them.
#[test]
fn the_queue_shows_the_values_that_will_run() {
    let mut console = Console::ready();
    let point = QueuedPoint {
        trial: 0,
        source: ProposalSource::Rerun,
        parent: Some(3),
        parameters: vec![("f0".into(), 1.299), ("Fx".into(), 75.0), ("Fz".into(), 250.0)].into(),
        ..QueuedPoint::default()
    };
    let next = QueuedPoint { trial: 1, ..point.clone() };
    console.record(Record::Search(SearchStatus { queue: vec![point, next], ..SearchStatus::default() }));
    let mut changed = proposal(0, 1);
    (changed.source, changed.parent) = (ProposalSource::Operator, Some(3));
    (changed.parameters[0].value, changed.parameters[0].proposed) = (1.4, 1.299);
    changed.gains[0].value = 450.0;
    console.record(Record::Proposal(changed));
    console.press(&["N"]);
    let screen = console.screen(120, 40);
    let row = line_with(&screen, "│ #0 ");
    assert_shows(&row, &["changed re-run of #3", "f0 1.400 Hz, Fx 75.00 N, Fz 250.0 N, kp 450.0 N/m"]);
    assert!(!row.contains("kd"), "{row}");
    assert_shows(&line_with(&screen, "│ #1 "), &["re-run of #3", "f0 1.299 Hz, Fx 75.00 N, Fz 250.0 N"]);
}
