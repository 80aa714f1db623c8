//! Rules of approval: the engine with its threads, on the simulator in real time.

use crate::attached_console;
use std::time::Duration;

use attached_console::AttachedConsole;
use quadfrog::config::Config;
use quadfrog::engine::{self, EngineError, Options};
use quadfrog::recording::record::Record;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{Approval, Backend, ExperimentStage, Task, Verdict};

fn options(approve: Approval, backend: Backend) -> Options {
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    Options { trials: Some(3), approve, ..Options::new(config, robot, backend, Task::Forward) }
}

fn judged(records: &[Record], verdict: Verdict) -> usize {
    let row =
        |r: &Record| if let Record::Trial(t) = r { t.verdict.filter(|v| *v == verdict).map(|_| t.trial) } else { None };
    records.iter().filter_map(row).collect::<std::collections::BTreeSet<u32>>().len()
}

fn started(approve: Approval) -> AttachedConsole {
    AttachedConsole::start(options(approve, Backend::Simulator))
}

#[test]
fn auto_runs_a_whole_study_without_a_question_and_stop_still_holds_it() {
    let mut screen = started(Approval::Auto);
    screen.until("a first verdict", |s| judged(&s.records, Verdict::Accept) + judged(&s.records, Verdict::Fall) >= 1);
    screen.until("the second jump", |s| s.mode() == Some(Mode::Jump) || s.stage() == Some(ExperimentStage::Running));
    screen.handle.stop();
    screen.until("damping", |s| s.mode() == Some(Mode::Damped));
    let before = screen.records.len();
    screen.pass(Duration::from_secs(2));
    assert_eq!(screen.mode(), Some(Mode::Damped), "nobody acknowledges a STOP but a person");
    assert!(!screen.records[before..].iter().any(|r| matches!(r, Record::Transition(t) if t.to.energised())));
    // A person judges the stopped jump, acknowledges and arms: then it goes on by itself.
    screen.until("the review", |s| s.stage() == Some(ExperimentStage::Review));
    screen.handle.request(OperatorRequest::Acknowledge);
    screen.handle.request(OperatorRequest::Judge(Verdict::Void));
    screen.until("disarmed", |s| s.mode() == Some(Mode::Disarmed));
    screen.pass(Duration::from_secs(1));
    assert_eq!(screen.mode(), Some(Mode::Disarmed), "it is armed by a person after a stop");
    screen.handle.request(OperatorRequest::Arm);
    screen.until("the end of the study", |s| s.stage() == Some(ExperimentStage::Finished));
    assert_eq!(judged(&screen.records, Verdict::Accept) + judged(&screen.records, Verdict::Fall), 3);
    let asked =
        screen.records.iter().filter(|r| matches!(r, Record::Request(c) if c.request.starts_with("approve"))).count();
    assert_eq!(asked, 0);
}

#[test]
fn falls_only_waits_for_a_person_to_arm_and_then_accepts_what_landed() {
    let mut screen = started(Approval::FallsOnly);
    screen.until("disarmed", |s| s.mode() == Some(Mode::Disarmed));
    screen.pass(Duration::from_secs(1));
    assert_eq!(screen.mode(), Some(Mode::Disarmed));
    screen.handle.request(OperatorRequest::Arm);
    // The first jump of seed 0 lands; a fall would wait for a verdict.
    screen.until("an accepted jump or a fall that waits", |s| {
        judged(&s.records, Verdict::Accept) >= 1
            || s.records.iter().any(|r| matches!(r, Record::Trial(t) if t.suggested == Some(Verdict::Fall)))
    });
    if judged(&screen.records, Verdict::Accept) == 0 {
        screen.pass(Duration::from_secs(1));
        assert_eq!(screen.stage(), Some(ExperimentStage::Review), "a fall is judged by a person");
    } else {
        screen.until("the next jump, approved by itself", |s| {
            s.records.iter().filter(|r| matches!(r, Record::Stage(s) if s.stage == ExperimentStage::Running)).count()
                >= 2
        });
    }
}

#[test]
fn auto_is_refused_on_hardware() {
    match engine::start(options(Approval::Auto, Backend::Hardware)) {
        Err(error @ EngineError::Unattended) => assert!(error.to_string().contains("only on the simulator"), "{error}"),
        Err(error) => panic!("another refusal: {error}"),
        Ok(_) => panic!("it started"),
    }
}

#[test]
fn a_recording_holds_one_session_record() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options { folder: Some(folder.path().join("study")), ..options(Approval::Each, Backend::Simulator) };
    let handle = engine::start(options).unwrap();
    let path = handle.recording().unwrap().to_owned();
    handle.shutdown();
    let bytes = std::fs::read(path).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let sessions = messages.filter(|message| message.channel.topic == "/session").count();
    assert_eq!(sessions, 1);
}
