//! Rules of approval: the engine with its threads, on the simulator in real time.

use std::time::{Duration, Instant};

use quadfrog::config::Config;
use quadfrog::engine::{self, EngineError, EngineHandle, Options};
use quadfrog::recording::record::{Record, Stamped};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{Approval, Backend, ExperimentStage, Task, Verdict};

fn options(approve: Approval, backend: Backend) -> Options {
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    Options { trials: Some(3), approve, ..Options::new(config, robot, backend, Task::Forward) }
}

/// A screen that sends heartbeats and presses no key by itself.
struct Screen {
    handle: EngineHandle,
    records: Vec<Record>,
}

impl Screen {
    fn new(approve: Approval) -> Screen {
        Screen { handle: engine::start(options(approve, Backend::Simulator)).unwrap(), records: Vec::new() }
    }

    /// Waits until `wanted` of all records so far; the time-out only ends a test that fails.
    fn until(&mut self, what: &str, wanted: impl Fn(&[Record]) -> bool) {
        let end = Instant::now() + Duration::from_secs(60);
        while !wanted(&self.records) {
            assert!(Instant::now() < end, "{what} did not happen: {:#?}", self.tail());
            self.step();
        }
    }

    fn pass(&mut self, time: Duration) {
        let end = Instant::now() + time;
        while Instant::now() < end {
            self.step();
        }
    }

    fn step(&mut self) {
        self.handle.send_heartbeat();
        while let Some(Stamped { record, .. }) = self.handle.next_record() {
            if !matches!(record, Record::Counters(_)) {
                self.records.push(record);
            }
        }
        while self.handle.next_tick().is_some() {}
        std::thread::sleep(Duration::from_millis(10));
    }

    fn tail(&self) -> &[Record] {
        &self.records[self.records.len().saturating_sub(8)..]
    }
}

fn mode(records: &[Record]) -> Option<Mode> {
    records.iter().rev().find_map(|r| if let Record::Transition(t) = r { Some(t.to) } else { None })
}

fn stage(records: &[Record]) -> Option<ExperimentStage> {
    records.iter().rev().find_map(|r| if let Record::Stage(s) = r { Some(s.stage) } else { None })
}

fn judged(records: &[Record], verdict: Verdict) -> usize {
    let row =
        |r: &Record| if let Record::Trial(t) = r { t.verdict.filter(|v| *v == verdict).map(|_| t.trial) } else { None };
    records.iter().filter_map(row).collect::<std::collections::BTreeSet<u32>>().len()
}

#[test]
fn auto_runs_a_whole_study_without_a_question_and_stop_still_holds_it() {
    let mut screen = Screen::new(Approval::Auto);
    screen.until("a first verdict", |r| judged(r, Verdict::Accept) + judged(r, Verdict::Fall) >= 1);
    screen.until("the second jump", |r| mode(r) == Some(Mode::Jump) || stage(r) == Some(ExperimentStage::Running));
    screen.handle.stop();
    screen.until("damping", |r| mode(r) == Some(Mode::Damped));
    let before = screen.records.len();
    screen.pass(Duration::from_secs(2));
    assert_eq!(mode(&screen.records), Some(Mode::Damped), "nobody acknowledges a STOP but a person");
    assert!(!screen.records[before..].iter().any(|r| matches!(r, Record::Transition(t) if t.to.energised())));
    // A person judges the stopped jump, acknowledges and arms: then it goes on by itself.
    screen.until("the review", |r| stage(r) == Some(ExperimentStage::Review));
    screen.handle.request(OperatorRequest::Acknowledge);
    screen.handle.request(OperatorRequest::Judge(Verdict::Void));
    screen.until("disarmed", |r| mode(r) == Some(Mode::Disarmed));
    screen.pass(Duration::from_secs(1));
    assert_eq!(mode(&screen.records), Some(Mode::Disarmed), "it is armed by a person after a stop");
    screen.handle.request(OperatorRequest::Arm);
    screen.until("the end of the study", |r| stage(r) == Some(ExperimentStage::Finished));
    assert_eq!(judged(&screen.records, Verdict::Accept) + judged(&screen.records, Verdict::Fall), 3);
    let asked =
        screen.records.iter().filter(|r| matches!(r, Record::Request(c) if c.request.starts_with("approve"))).count();
    assert_eq!(asked, 0);
}

#[test]
fn falls_only_waits_for_a_person_to_arm_and_then_accepts_what_landed() {
    let mut screen = Screen::new(Approval::FallsOnly);
    screen.until("disarmed", |r| mode(r) == Some(Mode::Disarmed));
    screen.pass(Duration::from_secs(1));
    assert_eq!(mode(&screen.records), Some(Mode::Disarmed));
    screen.handle.request(OperatorRequest::Arm);
    // The first jump of seed 0 lands; a fall would wait for a verdict.
    screen.until("an accepted jump or a fall that waits", |r| {
        judged(r, Verdict::Accept) >= 1
            || r.iter().any(|r| matches!(r, Record::Trial(t) if t.suggested == Some(Verdict::Fall)))
    });
    if judged(&screen.records, Verdict::Accept) == 0 {
        screen.pass(Duration::from_secs(1));
        assert_eq!(stage(&screen.records), Some(ExperimentStage::Review), "a fall is judged by a person");
    } else {
        screen.until("the next jump, approved by itself", |r| {
            r.iter().filter(|r| matches!(r, Record::Stage(s) if s.stage == ExperimentStage::Running)).count() >= 2
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
