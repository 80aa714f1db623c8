//! A lock that another program holds never delays the robot: sit down, cancel and STOP pass the session by, approvals expire,
//! and nothing that was judged is lost. The engine with its threads, on the simulator in real time.

use crate::attached_console;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::Duration;

use attached_console::AttachedConsole;
use quadfrog::config::Config;
use quadfrog::engine::Options;
use quadfrog::optimize::journal::{Durability, Journal, JournalFile, LOCK_GRACE, StudyRecord, WaitedFor};
use quadfrog::optimize::trial::TrialState;
use quadfrog::recording::record::{LogLevel, Record, RequestRecord};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{Backend, ExperimentStage, Proposal, Task, Verdict};

fn options(folder: &Path) -> Options {
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let options = Options::new(config, robot, Backend::Simulator, Task::Forward);
    Options { trials: Some(5), folder: Some(folder.to_owned()), ..options }
}

/// The lock as another program holds it, stopped or slow.
struct HeldLock(PathBuf);

impl HeldLock {
    fn hold(folder: &Path) -> HeldLock {
        let lock = folder.join("study.log.lock");
        while symlink(folder.join("study.log"), &lock).is_err() {
            std::thread::sleep(Duration::from_millis(1));
        }
        HeldLock(lock)
    }
}

impl Drop for HeldLock {
    fn drop(&mut self) {
        std::fs::remove_file(&self.0).expect("the lock was broken");
    }
}

impl AttachedConsole {
    fn open(folder: &Path) -> AttachedConsole {
        AttachedConsole::start(options(folder))
    }

    /// A standing robot with a proposal.
    fn ready(folder: &Path) -> AttachedConsole {
        let mut screen = AttachedConsole::open(folder);
        screen.until_grace("disarmed", |s| s.mode() == Some(Mode::Disarmed));
        screen.until_grace("arming checks", |s| s.records.iter().any(|r| matches!(r, Record::ArmingChecks(_))));
        screen.pass(Duration::from_millis(300));
        screen.handle.request(OperatorRequest::Arm);
        screen.until_grace("ready", |s| s.mode() == Some(Mode::Ready));
        screen
    }

    /// Waits for less than the time after which a stale lock is broken.
    fn until_grace(&mut self, what: &str, wanted: impl Fn(&AttachedConsole) -> bool) {
        self.until_within(LOCK_GRACE - Duration::from_secs(5), what, wanted);
    }

    fn proposal(&self) -> Proposal {
        let newest = self.records.iter().rev();
        newest.clone().find_map(|r| if let Record::Proposal(p) = r { Some(p.clone()) } else { None }).unwrap()
    }

    fn approve(&self) {
        let Proposal { trial, revision, .. } = self.proposal();
        self.handle.request(OperatorRequest::Approve { trial, revision });
    }

    fn answer(&self, request: &str) -> Option<&RequestRecord> {
        self.records.iter().rev().find_map(|r| match r {
            Record::Request(answer) if answer.request.starts_with(request) => Some(answer),
            _ => None,
        })
    }

    fn has_been(&self, mode: Mode) -> bool {
        self.records.iter().any(|r| matches!(r, Record::Transition(t) if t.to == mode))
    }
}

/// The study as another program reads it.
fn stored(folder: &Path) -> StudyRecord {
    let file = JournalFile::new(&folder.join("study.log"), Durability::Buffered, LOCK_GRACE).unwrap();
    Journal::open(file).unwrap().state().studies()[0].clone()
}

/// Regression: the approval waited 14 s for the lock with nothing on the screen, sit down did nothing, and the countdown
/// began when the lock was free.
#[test]
fn sit_down_acts_and_an_approval_dies_while_another_program_holds_the_lock() {
    let folder = tempfile::tempdir().unwrap();
    let mut screen = AttachedConsole::ready(folder.path());
    let lock = HeldLock::hold(folder.path());
    screen.approve();
    screen.until_grace("the wait on the screen", |s| {
        s.handle.storage_wait().is_some_and(|wait| wait.journal == Some(WaitedFor::Lock))
    });
    assert_eq!(screen.handle.storage_wait().unwrap().place(), "the study's lock");
    screen.handle.request(OperatorRequest::SitDown);
    screen.until_grace("sitting down", |s| s.mode() == Some(Mode::SitDown));
    screen.until_grace("the answers", |s| s.answer("approve").is_some() && s.answer("sit down").is_some());
    let answer = screen.answer("approve").unwrap();
    assert!(!answer.accepted && answer.answer.contains("sit down or cancel was pressed"), "{answer:?}");
    assert!(screen.answer("sit down").unwrap().accepted);
    screen.until_grace("disarmed", |s| s.mode() == Some(Mode::Disarmed));
    drop(lock);
    screen.pass(Duration::from_millis(500));
    assert!(!screen.has_been(Mode::Countdown));
    assert!(stored(folder.path()).trials.is_empty(), "nothing has begun");
    assert_eq!(screen.stage(), Some(ExperimentStage::Proposed));
}

#[test]
fn an_approval_expires_two_seconds_after_the_key_press_and_the_next_one_runs() {
    let folder = tempfile::tempdir().unwrap();
    let mut screen = AttachedConsole::ready(folder.path());
    let lock = HeldLock::hold(folder.path());
    screen.approve();
    screen.until_grace("the answer", |s| s.answer("approve").is_some());
    let answer = screen.answer("approve").unwrap();
    assert!(!answer.accepted && answer.answer.contains("limit 2.0 s"), "{answer:?}");
    assert!(answer.answer.contains("another program holds the lock"), "{answer:?}");
    let logged = |s: &AttachedConsole, text: &str| {
        s.records.iter().any(|r| matches!(r, Record::Log(line) if line.message.contains(text)))
    };
    assert!(logged(&screen, "waiting for the study's lock"));
    drop(lock);
    screen.until_grace("the end of the wait", |s| s.handle.storage_wait().is_none());
    assert!(stored(folder.path()).trials.is_empty(), "nothing has begun");
    assert_eq!(screen.mode(), Some(Mode::Ready));
    screen.approve();
    screen.until_grace("the countdown", |s| s.has_been(Mode::Countdown));
    let errors = screen.records.iter().filter(|r| matches!(r, Record::Log(line) if line.level == LogLevel::Error));
    assert_eq!(errors.count(), 0);
}

/// The session goes on with records, ticks and the robot's own requests; the verdict is on disk before the next proposal.
#[test]
fn a_verdict_waits_for_the_lock_and_the_robot_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let mut screen = AttachedConsole::ready(folder.path());
    screen.approve();
    screen.until_grace("the review", |s| s.stage() == Some(ExperimentStage::Review));
    let suggested = screen.records.iter().rev().find_map(|r| match r {
        Record::Trial(row) => row.suggested,
        _ => None,
    });
    let lock = HeldLock::hold(folder.path());
    let before = screen.records.len();
    screen.handle.request(OperatorRequest::Judge(suggested.unwrap()));
    screen.handle.request(OperatorRequest::Note { trial: 0, text: "while it waits".into() });
    screen.until_grace("the wait on the screen", |s| {
        s.handle.storage_wait().is_some_and(|wait| wait.journal == Some(WaitedFor::Lock))
    });
    let ticks = screen.handle.snapshot().tick.number;
    screen.handle.stop();
    screen.until_grace("damping", |s| s.mode() == Some(Mode::Damped));
    screen.handle.request(OperatorRequest::Acknowledge);
    screen.until_grace("disarmed", |s| s.mode() == Some(Mode::Disarmed));
    assert!(screen.handle.snapshot().tick.number > ticks);
    assert!(screen.answer("acknowledge").unwrap().accepted);
    let proposed = |s: &AttachedConsole| s.records[before..].iter().any(|r| matches!(r, Record::Proposal(_)));
    assert!(!proposed(&screen), "the verdict is on disk before the next proposal");
    assert!(screen.answer("note").is_none());
    drop(lock);
    screen.until_grace("the next proposal", proposed);
    screen.until_grace("the note", |s| s.answer("note").is_some_and(|answer| answer.accepted));
    let trials = stored(folder.path()).trials;
    assert_eq!(trials[0].user_attributes["verdict"], suggested.unwrap().name());
    drop(screen);
    let trials = stored(folder.path()).trials;
    let state = if suggested == Some(Verdict::Void) { TrialState::Fail } else { TrialState::Complete };
    assert_eq!(trials[0].state, state, "reported at the end");
}

/// With and without a wait for the lock the same points are proposed.
#[test]
fn a_wait_changes_no_proposal() {
    let points = [false, true].map(|waits| {
        let folder = tempfile::tempdir().unwrap();
        let mut screen = AttachedConsole::open(folder.path());
        screen.until_grace("a proposal", |s| s.stage() == Some(ExperimentStage::Proposed));
        let mut points = Vec::new();
        for _ in 0..4 {
            let shown = screen.proposal();
            points.push(shown.parameters.iter().map(|p| p.value).collect::<Vec<_>>());
            let lock = waits.then(|| HeldLock::hold(folder.path()));
            screen.handle.request(OperatorRequest::Skip { trial: shown.trial, revision: shown.revision });
            if waits {
                screen.until_grace("the wait", |s| s.handle.storage_wait().is_some());
            }
            drop(lock);
            screen.until_grace("the next proposal", |s| s.proposal().trial > shown.trial);
        }
        points
    });
    assert_eq!(points[0], points[1]);
}
