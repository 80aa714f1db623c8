//! The study: drafts without effect, interruptions without loss, other writers.

use crate::support;
use nix::sys::resource::{Resource, getrlimit, setrlimit};
use quadfrog::optimize::ask::{Direction, SamplerConfig};
use quadfrog::optimize::journal::{Durability, Journal, JournalError, JournalFile, LOCK_GRACE, Operation};
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Outcome, Storage, Study, StudyError, StudyOptions, TellOutcome};
use quadfrog::optimize::trial::{Trial, TrialState, value_of};
use serde_json::{Value, json};
use std::fs::OpenOptions;
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use support::{begin, forward_log, in_memory};
use tempfile::{TempDir, tempdir};

fn options(seed: u32, multivariate: bool) -> StudyOptions {
    support::options(forward_log(), SamplerConfig { seed, multivariate, ..SamplerConfig::default() })
}

fn open(path: &Path, seed: u32, multivariate: bool) -> Study {
    Study::open(Storage::File(path.to_owned()), options(seed, multivariate)).unwrap()
}

/// A study on disk with its folder and journal.
fn on_disk() -> (TempDir, PathBuf, Study) {
    let folder = tempdir().unwrap();
    let path = folder.path().join("study.log");
    let study = open(&path, 0, true);
    (folder, path, study)
}

/// [`on_disk`] with one trial.
fn with_a_trial() -> (TempDir, PathBuf, Study) {
    let (folder, path, mut study) = on_disk();
    one_trial(&mut study, &[]);
    (folder, path, study)
}

fn objective(parameters: &[(String, f64)]) -> f64 {
    let x = |name: &str| value_of(parameters, name).unwrap();
    let (a, b, c) = (x("f0") - 1.1, x("Fx") / 150.0 - 0.6, x("Fz") / 350.0 - 0.7);
    1.0 / (1.0 + 4.0 * a * a + 3.0 * b * b + 5.0 * c * c)
}

/// Runs one trial; every third has the value 0, every seventh fails.
fn one_trial(study: &mut Study, overrides: &[(String, f64)]) {
    let draft = study.draft();
    let trial = study.begin(&draft, overrides, &[("source".into(), json!("sampler"))]).unwrap();
    let value = objective(&study.trial(trial).unwrap().parameters);
    study.annotate(trial, &[("verdict".into(), json!("accept"))]).unwrap();
    let outcome = match trial {
        n if n % 7 == 6 => Outcome::Fail,
        n if n % 3 == 2 => Outcome::Complete(0.0),
        _ => Outcome::Complete(value),
    };
    assert_eq!(study.tell(trial, outcome).unwrap(), TellOutcome::Recorded);
}

/// The bit-identical part of a trial: number, state, parameters, value, positions of the random streams.
type Row = (u32, TrialState, Vec<(String, f64)>, Option<f64>, Value);

fn table(study: &Study) -> Vec<Row> {
    let row =
        |t: &Trial| (t.number, t.state, t.parameters.clone(), t.value, t.system_attributes["quadfrog:draws"].clone());
    study.trials().iter().map(row).collect()
}

#[test]
fn a_draft_has_no_effect_and_is_what_begins() {
    let (_folder, path, mut study) = on_disk();
    for _ in 0..14 {
        let before = std::fs::read(&path).unwrap();
        let draft = study.draft();
        assert_eq!(study.draft(), draft);
        assert_eq!(std::fs::read(&path).unwrap(), before);
        let trial = study.begin(&draft, &[], &[]).unwrap();
        let begun = study.trial(trial).unwrap().clone();
        let drafted: Vec<_> = draft.parameters.iter().map(|s| (s.name.clone(), s.value)).collect();
        assert_eq!((begun.number, begun.state, &begun.parameters), (draft.number, TrialState::Running, &drafted));
        assert!(matches!(study.begin(&draft, &[], &[]), Err(StudyError::StaleDraft { .. })));
        let value = objective(&begun.parameters);
        study.tell(trial, Outcome::Complete(value)).unwrap();
    }
}

#[test]
fn interrupted_at_every_trial_it_equals_the_unbroken_one() {
    for (seed, multivariate) in [(0, true), (1, false), (4_000_000_000, true)] {
        let folder = tempdir().unwrap();
        let path = folder.path().join("study.log");
        let mut unbroken = in_memory(options(seed, multivariate));
        for number in 0..30 {
            let override_fx = [("Fx".to_owned(), 75.0)];
            let overrides: &[_] = if number % 5 == 4 { &override_fx } else { &[] };
            one_trial(&mut unbroken, overrides);
            one_trial(&mut open(&path, seed, multivariate), overrides);
        }
        assert_eq!(table(&open(&path, seed, multivariate)), table(&unbroken));
    }
}

#[test]
fn a_verdict_given_before_a_crash_is_there_afterwards() {
    let (_folder, path, mut study) = on_disk();
    let trial = begin(&mut study);
    study.annotate(trial, &[("verdict".into(), json!("fall")), ("value".into(), json!(0.0))]).unwrap();
    drop(study); // as if killed before the tell

    let mut study = open(&path, 0, true);
    assert!(study.running().map(|t| t.number).eq([trial]));
    assert_eq!(study.trial(trial).unwrap().user_attributes["verdict"], json!("fall"));
    assert_eq!(study.tell(trial, Outcome::Complete(0.0)).unwrap(), TellOutcome::Recorded);
    assert_eq!(study.running().count(), 0);
}

#[test]
fn overrides_are_recorded_as_fixed() {
    let mut study = in_memory(options(0, true));
    let draft = study.draft();
    let trial = study.begin(&draft, &[("Fz".into(), 200.0)], &[]).unwrap();
    let trial = study.trial(trial).unwrap();
    assert_eq!(trial.parameter("Fz"), Some(200.0));
    assert_eq!(trial.parameter("f0"), Some(draft.parameters[0].value), "a parameter without override is as drafted");
    assert_eq!(trial.fixed(), [("Fz".to_owned(), 200.0)]);

    // A trial with all parameters given uses no random numbers.
    let before = study.draft();
    let all: Vec<_> = before.parameters.iter().map(|s| (s.name.clone(), s.range.low)).collect();
    study.begin(&before, &all, &[]).unwrap();
    assert_eq!(study.draft().parameters, before.parameters);
}

#[test]
fn refusals_say_what_is_wrong() {
    let mut study = in_memory(options(0, true));
    let draft = study.draft();
    let error = |e: Result<u32, StudyError>| e.unwrap_err().to_string();
    let unknown = error(study.begin(&draft, &[("Fq".into(), 1.0)], &[]));
    assert!(unknown.contains("`Fq`") && unknown.contains("f0, Fx, Fz"), "{unknown}");
    let nan = error(study.enqueue(&[("f0".into(), f64::NAN)], &[]));
    assert!(nan.contains("`f0`") && nan.contains("NaN"), "{nan}");
    let log = error(study.enqueue(&[("Fz".into(), 0.0)], &[]));
    assert!(log.contains("`Fz`") && log.contains("above 0"), "{log}");
    assert_eq!(study.trials().len(), 0, "a refused call changes nothing");
    let trial = study.begin(&draft, &[], &[]).unwrap();
    assert!(matches!(study.tell(trial, Outcome::Complete(f64::NAN)), Err(StudyError::Value { .. })));
    study.tell(trial, Outcome::Complete(1.0)).unwrap();
    assert_eq!(study.tell(trial, Outcome::Complete(2.0)).unwrap(), TellOutcome::AlreadyFinished);
    assert_eq!(study.trial(trial).unwrap().value, Some(1.0));
    let late = study.annotate(trial, &[("verdict".into(), json!("fall"))]).unwrap_err().to_string();
    assert!(late.contains("note"), "{late}");
    assert!(matches!(study.trial(9), Err(StudyError::UnknownTrial { trial: 9, .. })));
}

#[test]
fn enqueued_trials_come_first_in_their_order_and_keep_their_numbers() {
    let mut study = in_memory(options(0, true));
    let draft = study.draft();
    let first =
        study.enqueue(&[("f0".into(), 1.0), ("Fx".into(), 1.5), ("Fz".into(), 160.0)], &[("by".into(), json!("A"))]);
    let second = study.enqueue(&[("Fx".into(), 99.0)], &[]);
    assert_eq!((first.unwrap(), second.unwrap()), (0, 1));
    assert!(study.draft().enqueued);
    let taken = study.draft();
    assert_eq!((taken.number, taken.attributes["by"].clone()), (0, json!("A")));
    let values = taken.parameters.iter().map(|s| (s.value, s.fixed));
    assert!(values.eq([(1.0, true), (1.5, true), (160.0, true)]));
    study.begin(&taken, &[], &[]).unwrap();
    let partly = study.draft();
    assert_eq!(partly.number, 1);
    assert_eq!(partly.parameters[1].value, 99.0);
    assert_eq!(partly.parameters[0].value, draft.parameters[0].value, "the first random number is unused");
    study.begin(&partly, &[], &[]).unwrap();
    assert_eq!(study.waiting().count(), 0);
}

#[test]
fn a_torn_last_line_is_cut_off_and_kept_aside() {
    let (cut, cut_in_text) = (r#"{"op_code":6,"worker_id":"x","tri"#, "{\"op_code\":8,\"worker_id\":\"\u{e9}");
    for torn in [cut, "garbage\n", "\n", "garbage\n{\"op", cut_in_text] {
        let (folder, path, mut study) = with_a_trial();
        let before = table(&study);
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, [&whole, torn.as_bytes()].concat()).unwrap();

        let mut resumed = open(&path, 0, true);
        assert_eq!(table(&resumed), before, "readers ignore {torn:?}");
        study.refresh().unwrap();
        assert_eq!(table(&study), before);
        one_trial(&mut resumed, &[]);
        assert_eq!(std::fs::read(folder.path().join("study.log.torn-0")).unwrap(), torn.as_bytes());
        study.refresh().unwrap();
        assert_eq!(study.trials().len(), 2, "the other session continues reading");
        assert_eq!(table(&open(&path, 0, true)), table(&study));
    }
}

/// Set in the child process of the test below.
const FULL_DISK: &str = "QUADFROG_TEST_FULL_DISK";

/// A disk that is full after the first lines of a commit. In a child process, whose limit on the length of files cuts the write off;
/// the signal of that limit is ignored.
#[test]
fn a_commit_that_a_full_disk_cuts_off_leaves_no_line() {
    if std::env::var_os(FULL_DISK).is_none() {
        let name = "study::a_commit_that_a_full_disk_cuts_off_leaves_no_line";
        let mut child = Command::new("sh");
        child.args(["-c", "trap '' XFSZ; exec \"$@\"", "sh"]).arg(std::env::current_exe().unwrap());
        let ended = child.args(["--exact", name]).env(FULL_DISK, "1").output().unwrap();
        // A name that is not found would run nothing and succeed.
        let passed = String::from_utf8_lossy(&ended.stdout).contains("1 passed");
        assert!(ended.status.success() && passed, "{ended:?}");
        return;
    }
    let (_folder, path, mut study) = with_a_trial();
    let before = std::fs::read(&path).unwrap();
    let draft = study.draft();
    let (free, most) = getrlimit(Resource::RLIMIT_FSIZE).unwrap();
    // Room for the first line, the creation of the trial.
    setrlimit(Resource::RLIMIT_FSIZE, before.len() as u64 + 400, most).unwrap();
    let error = study.begin(&draft, &[], &[]).unwrap_err();
    setrlimit(Resource::RLIMIT_FSIZE, free, most).unwrap();
    assert!(error.to_string().contains("append to"), "{error}");
    assert!(std::fs::read(&path).unwrap() == before, "lines of the commit stay");
    study.refresh().unwrap();
    assert_eq!((study.trials().len(), study.running().count()), (1, 0));
    assert_eq!(study.begin(&draft, &[], &[]).unwrap(), 1);
}

/// A writer that is stopped between its reading and its writing, while another one takes its lock to be stale.
#[test]
fn a_writer_that_was_stopped_for_longer_than_the_grace_deletes_no_line_of_another() {
    type Failure = Box<dyn std::error::Error>;
    let (_folder, path, study) = with_a_trial();
    drop(study);
    OpenOptions::new().append(true).open(&path).unwrap().write_all(b"{\"op_code\": 4").unwrap();
    let journal = |grace| Journal::open(JournalFile::new(&path, Durability::Buffered, grace).unwrap()).unwrap();
    let create = |name: &str| Operation::CreateStudy { name: name.to_owned(), directions: vec![2] };
    let (mut stopped, mut other) = (journal(LOCK_GRACE), journal(Duration::from_millis(20)));
    let mut decisions = 0;
    let committed = stopped.commit(|_| {
        decisions += 1;
        if decisions == 1 {
            other.commit(|_| Ok::<_, Failure>(vec![create("other")])).unwrap();
        }
        Ok::<_, Failure>(vec![create("stopped")])
    });
    assert!(committed.is_ok() && decisions == 2, "decided {decisions} times: {committed:?}");
    let names: Vec<String> = journal(LOCK_GRACE).state().studies().iter().map(|study| study.name.clone()).collect();
    assert!(names.ends_with(&["other".to_owned(), "stopped".to_owned()]), "{names:?}");

    // The lock of a third writer is not released with one that was broken.
    let lock = path.with_file_name("study.log.lock");
    let refused = stopped.commit(|_| {
        std::fs::remove_file(&lock).unwrap();
        std::thread::sleep(Duration::from_millis(20));
        symlink(&path, &lock).unwrap();
        Err::<Vec<Operation>, Failure>("refused".into())
    });
    assert!(refused.is_err() && lock.is_symlink());
}

/// Regression: of several writers that waited for a dead one each broke the lock of the next.
#[test]
fn a_lock_that_passes_from_one_writer_to_another_is_not_stale() {
    let grace = Duration::from_millis(500);
    let (_folder, path, study) = with_a_trial();
    drop(study);
    let (lock, next) = (path.with_file_name("study.log.lock"), path.with_file_name("next"));
    symlink(&path, &lock).unwrap();
    let mut waiting = Journal::open(JournalFile::new(&path, Durability::Buffered, grace).unwrap()).unwrap();
    let waiter = std::thread::spawn(move || waiting.commit::<JournalError>(|_| Ok(Vec::new())).map(|_| Instant::now()));
    let (begun, mut newest, mut longest) = (Instant::now(), Instant::now(), Duration::ZERO);
    while begun.elapsed() < 3 * grace {
        symlink(&path, &next).unwrap();
        std::fs::rename(&next, &lock).unwrap();
        longest = longest.max(newest.elapsed());
        newest = Instant::now();
        std::thread::sleep(grace / 20);
    }
    // The last one is dead: its lock is broken.
    let locked = waiter.join().unwrap().unwrap();
    // A machine that did not let this thread run for the grace time has made one stale.
    assert!(locked >= newest || longest >= grace / 2, "{:?} before the last writer", newest - locked);
}

/// Regression: each name had its own lock, and two writers wrote at the same time.
#[test]
fn writers_that_reach_a_journal_by_several_names_share_its_lock() {
    let folder = tempdir().unwrap();
    let place = folder.path().canonicalize().unwrap();
    let (file, link, link_to_link) = (place.join("study.log"), place.join("link.log"), place.join("again.log"));
    symlink("study.log", &link).unwrap();
    symlink(&link, &link_to_link).unwrap();
    let lock_of = |name: &Path| {
        let file = JournalFile::new(name, Durability::Buffered, LOCK_GRACE).unwrap();
        let mut journal = Journal::open(file).unwrap();
        journal.wait().begin(1);
        journal.wait().interrupt(1);
        match journal.commit::<JournalError>(|_| Ok(Vec::new())) {
            Err(JournalError::Interrupted { lock }) => lock,
            other => panic!("{other:?}"),
        }
    };
    // Before the journal exists, and after.
    for _ in 0..2 {
        for name in [&file, &link, &link_to_link] {
            assert_eq!(lock_of(name), place.join("study.log.lock"));
        }
        open(&link_to_link, 0, true);
        assert!(file.is_file());
    }
}

#[test]
fn an_unreadable_line_in_the_middle_is_named() {
    let (_folder, path, _) = with_a_trial();
    let mut text = std::fs::read_to_string(&path).unwrap();
    text.insert_str(text.find('\n').unwrap() + 1, "{\"op_code\":77,\"worker_id\":\"x\"}\n");
    std::fs::write(&path, text).unwrap();
    let error = Study::open(Storage::File(path), options(0, true)).unwrap_err().to_string();
    assert!(error.contains("study.log, line 2") && error.contains("77"), "{error}");
}

#[test]
fn a_file_that_became_shorter_is_noticed() {
    let (_folder, path, mut study) = with_a_trial();
    std::fs::write(&path, "").unwrap();
    let error = study.refresh().unwrap_err().to_string();
    assert!(error.contains("shortened or replaced"), "{error}");
}

#[test]
fn infinities_and_nan_are_read_and_written_as_by_python() {
    let (_folder, path, mut study) = on_disk();
    let trial = begin(&mut study);
    study.tell(trial, Outcome::Complete(f64::NEG_INFINITY)).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("\"values\":[-Infinity]"), "{text}");
    let trial = begin(&mut study);
    let id = study.trial(trial).unwrap().id;
    let lines = format!(
        "{{\"op_code\":7,\"worker_id\":\"p\",\"trial_id\":{id},\"step\":1,\"intermediate_value\":NaN}}\n\
         {{\"op_code\":8,\"worker_id\":\"p\",\"trial_id\":{id},\"user_attr\":{{\"a\":[Infinity, \"NaN \\\" Infinity \\ud800\"]}}}}\r\n"
    );
    std::fs::write(&path, [text.as_bytes(), &std::fs::read(&path).unwrap()[text.len()..], lines.as_bytes()].concat())
        .unwrap();
    study.refresh().unwrap();
    assert_eq!(study.trials()[0].value, Some(f64::NEG_INFINITY));
    assert!(study.trial(trial).unwrap().intermediate[&1].is_nan());
    assert_eq!(study.trial(trial).unwrap().user_attributes["a"], json!(["Infinity", "NaN \" Infinity \u{fffd}"]));
}

#[test]
fn notes_can_be_written_on_finished_trials_and_shortened() {
    let (_folder, path, mut study) = with_a_trial();
    let long = "é".repeat(5000);
    study.note(0, &long).unwrap();
    assert_eq!(study.note_of(0), long);
    study.note(0, "short").unwrap();
    assert_eq!(open(&path, 0, true).note_of(0), "short");
}

#[test]
fn a_study_of_another_kind_is_refused() {
    let (_folder, path, _) = with_a_trial();
    let refuse = |options: StudyOptions| Study::open(Storage::File(path.clone()), options).unwrap_err().to_string();
    let direction = refuse(StudyOptions { direction: Direction::Minimize, ..options(0, true) });
    assert!(direction.contains("maximize") && direction.contains("another name"), "{direction}");
    let space = Space::new([("Fz".into(), Range::linear(150.0, 350.0))]).unwrap();
    let scale = refuse(StudyOptions { space, ..options(0, true) });
    assert!(scale.contains("`Fz`") && scale.contains("logarithmic"), "{scale}");
    // Bounds may differ.
    let space = Space::new([("Fz".into(), Range::logarithmic(200.0, 300.0))]).unwrap();
    Study::open(Storage::File(path.clone()), StudyOptions { space, ..options(0, true) }).unwrap();
}

/// Regression: a last line that is complete, and that Optuna reads, was cut out of the shared journal as a torn one where this
/// program cannot read it: nested deeper than 128 levels, or with an integer beyond the range of a double.
#[test]
fn a_complete_last_line_that_cannot_be_read_stays_in_the_journal() {
    let deep = format!("{}1{}", "[".repeat(200), "]".repeat(200));
    let large = format!("1{}", "0".repeat(400));
    let attribute = |value: &str| {
        format!("{{\"op_code\": 2, \"worker_id\": \"py\", \"study_id\": 0, \"user_attr\": {{\"a\": {value}}}}}\n")
    };
    let unknown = "{\"op_code\": 77, \"worker_id\": \"py\"}\n".to_owned();
    for line in [attribute(&deep), attribute(&large), unknown] {
        let (folder, path, mut study) = with_a_trial();
        let written = std::fs::read_to_string(&path).unwrap() + &line;
        std::fs::write(&path, &written).unwrap();
        let draft = study.draft();
        let error = study.begin(&draft, &[], &[]).unwrap_err().to_string();
        let last = written.lines().count();
        assert!(error.contains(&format!("line {last} is complete")), "{error}");
        assert!(error.len() < 600, "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), written);
        assert!(!folder.path().join("study.log.torn-0").exists());
        assert_eq!(open(&path, 0, true).trials().len(), 1, "it can still be looked at");
    }
}

/// Regression: a position in the random streams of 10^15, which no trial can have reached, was read up to there: no command that
/// opened the study came to an end.
#[test]
fn an_absurd_position_in_the_random_streams_is_not_read_up_to() {
    let (_folder, path, study) = with_a_trial();
    let expected = study.draft().before;
    drop(study);
    let text = std::fs::read_to_string(&path).unwrap();
    let absurd = |draws: &str| {
        format!(
            "{{\"op_code\":4,\"worker_id\":\"x\",\"study_id\":0,\"datetime_start\":null,\"state\":3,\"value\":null,\
             \"values\":null,\"distributions\":{{}},\"params\":{{}},\"user_attrs\":{{}},\
             \"system_attrs\":{{\"quadfrog:draws\":{draws}}},\"intermediate_values\":{{}}}}\n"
        )
    };
    for draws in
        [r#"{"seed":0,"model":1000000000000000,"startup":0}"#, r#"{"seed":0,"model":0,"startup":18446744073709551615}"#]
    {
        std::fs::write(&path, text.clone() + &absurd(draws)).unwrap();
        let (path, (answer, drafted)) = (path.clone(), std::sync::mpsc::channel());
        std::thread::spawn(move || answer.send(open(&path, 0, true).draft().before));
        let before = drafted.recv_timeout(Duration::from_secs(60)).expect("the study opens");
        assert_eq!(before, expected, "{draws}");
    }
}

/// Regression: after the largest number of a worker the next worker had number 0, that of the session with the study's folder.
#[test]
fn no_worker_joins_after_the_last_number() {
    for joined in ["4294967295", "4294967296", "18446744073709551615"] {
        let (_folder, path, study) = with_a_trial();
        drop(study);
        let line = format!(
            "{{\"op_code\":3,\"worker_id\":\"x\",\"study_id\":0,\"system_attr\":{{\"quadfrog:workers\":{joined}}}}}\n"
        );
        std::fs::write(&path, std::fs::read_to_string(&path).unwrap() + &line).unwrap();
        let error = open(&path, 0, true).join().unwrap_err().to_string();
        assert!(error.contains("no worker can join") && error.contains("quadfrog:workers"), "{error}");
    }
}
