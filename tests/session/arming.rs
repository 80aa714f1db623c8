//! The arming checklist of a session: all failing checks at once, the operator's confirmations, the test of STOP.

use crate::robots;
use std::sync::mpsc::{Receiver, channel};

use proptest::prelude::*;
use quadfrog::config::Config;
use quadfrog::control::control_loop::ControlLoop;
use quadfrog::control::settings::ControlSettings;
use quadfrog::engine::{Options, fingerprint, open_experiment, session_info};
use quadfrog::optimize::journal::Durability;
use quadfrog::realtime::channel::{ConsolePorts, channels};
use quadfrog::realtime::clock::SimulatedClock;
use quadfrog::realtime::scheduling::{ALLOW_LOCKING, ALLOW_PRIORITY, DeniedSetting, RealtimeSetting};
use quadfrog::realtime::thread::TickStart;
use quadfrog::recording::disk::FreeSpace;
use quadfrog::recording::record::{ArmingCheckRecord, Record, RequestRecord, Stamped};
use quadfrog::recording::recorder::RecorderWatch;
use quadfrog::robot::RobotState;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::arming_checklist::ArmingChecklist;
use quadfrog::session::operator_request::{OperatorCheck, OperatorRequest, StampedRequest};
use quadfrog::session::supervisor::{RecordSinks, Supervisor, SupervisorParts};
use quadfrog::telemetry::{ArmingCheck, ArmingCheckState, Mode, Tick};
use quadfrog::trial::{Approval, Backend, Task, Verdict};
use robots::LinkedRobot;

/// A session and the control thread's body that share channels, on one thread and in simulated time.
struct Session {
    supervisor: Supervisor,
    operator: ConsolePorts,
    _ticks: rtrb::Consumer<Tick>,
    body: ControlLoop,
    robot: LinkedRobot,
    screen: Receiver<Stamped>,
    _recorder: Receiver<Stamped>,
    _folder: Option<tempfile::TempDir>,
    records: Vec<Record>,
    time_ms: u64,
    /// Whether a screen sends heartbeats.
    watched: bool,
}

impl Session {
    fn new(backend: Backend, folder: Option<std::path::PathBuf>) -> Session {
        let mut session = Session::begin(backend, folder, false);
        session.ticks(10);
        session.supervisor.take_control();
        session.ticks(1500);
        session
    }

    /// On hardware's terms, with a folder for the recording.
    fn hardware() -> Session {
        let folder = tempfile::tempdir().unwrap();
        let session = Session::new(Backend::Hardware, Some(folder.path().to_owned()));
        Session { _folder: Some(folder), ..session }
    }

    fn begin(backend: Backend, folder: Option<std::path::PathBuf>, observe: bool) -> Session {
        Session::start(backend, folder, observe, None)
    }

    fn begin_unseen(backend: Backend, folder: Option<std::path::PathBuf>, unseen: Option<String>) -> Session {
        Session::start(backend, folder, false, unseen)
    }

    fn start(backend: Backend, folder: Option<std::path::PathBuf>, observe: bool, unseen: Option<String>) -> Session {
        Session::of(Config::load(None).unwrap(), backend, folder, observe, unseen)
    }

    fn of(
        config: Config,
        backend: Backend,
        folder: Option<std::path::PathBuf>,
        observe: bool,
        unseen: Option<String>,
    ) -> Session {
        let robot = RobotDescription::embedded("go1").unwrap();
        let space = folder.map(FreeSpace::watch).transpose().unwrap();
        let options = Options { trials: Some(5), observe, ..Options::new(config, robot, backend, Task::Forward) };
        let settings: ControlSettings = options.config.settings(&options.robot, options.task, backend).unwrap();
        let robot = LinkedRobot::lying(&options.robot, &options.config.simulator);
        let (control, session_end, operator, ticks) = channels();
        let (to_recorder, recorder) = channel();
        let (to_screen, screen) = channel();
        let (_, collected) = channel();
        let parts = SupervisorParts {
            experiment: open_experiment(&options, Durability::Buffered, "").unwrap(),
            control: session_end,
            ticks: collected,
            sinks: RecordSinks { recorder: to_recorder, console: to_screen },
            recorder: RecorderWatch::default(),
            checklist: ArmingChecklist::new(&settings, fingerprint(&options.config, &options.robot), space)
                .with_unseen_connection(unseen),
            approval: settings.approval,
            info: session_info(&options, ""),
        };
        Session {
            supervisor: Supervisor::new(parts, 0),
            operator,
            _ticks: ticks,
            body: ControlLoop::new(&settings, control),
            robot: LinkedRobot { charge_percent: 90.0, ..robot },
            screen,
            _recorder: recorder,
            _folder: None,
            records: Vec::new(),
            time_ms: 0,
            watched: true,
        }
    }

    fn ticks(&mut self, count: u32) {
        for _ in 0..count {
            self.time_ms += 1;
            if self.watched {
                self.operator.heartbeat.beat();
            }
            let instant = TickStart { planned_ns: self.time_ms * 1_000_000, lateness_ns: 0 };
            self.body.tick(instant, &SimulatedClock, &mut self.robot);
            self.supervisor.poll(self.time_ms * 1_000_000);
            self.records.extend(self.screen.try_iter().map(|stamped| stamped.record));
        }
    }

    fn request(&mut self, request: OperatorRequest) -> RequestRecord {
        let time_ns = self.time_ms * 1_000_000;
        self.supervisor
            .handle_request(&StampedRequest { request, stops: self.operator.stop.count(), time_ns }, time_ns);
        let records: Vec<Record> = self.screen.try_iter().map(|stamped| stamped.record).collect();
        let answer = records.iter().find_map(|record| match record {
            Record::Request(command) => Some(command.clone()),
            _ => None,
        });
        self.records.extend(records);
        self.ticks(5);
        answer.expect("every request is answered")
    }

    fn list(&self) -> Vec<ArmingCheckRecord> {
        let list = self.records.iter().rev().find_map(|record| match record {
            Record::ArmingChecks(list) => Some(list.clone()),
            _ => None,
        });
        list.expect("the list is shown while the robot is disarmed")
    }

    fn state(&self, check: ArmingCheck) -> ArmingCheckState {
        self.list().iter().find(|item| item.check == check).expect("every check is on the list").state
    }

    fn test_stop(&mut self) {
        self.operator.stop.set();
        self.ticks(5);
        assert_eq!(self.body.mode(), Mode::Damped);
        assert!(self.request(OperatorRequest::Acknowledge).accepted);
        self.ticks(1500);
        assert_eq!(self.body.mode(), Mode::Disarmed);
    }
}

#[test]
fn a_simulated_robot_is_armed_without_ceremony() {
    let mut session = Session::new(Backend::Simulator, None);
    assert_eq!(session.list().len(), ArmingCheck::ALL.len());
    let needed: Vec<_> = session.list().into_iter().filter(|item| item.state != ArmingCheckState::NotNeeded).collect();
    assert_eq!(needed.iter().map(|item| item.check).collect::<Vec<_>>(), [ArmingCheck::StateFresh]);
    let answer = session.request(OperatorRequest::Arm);
    assert!(answer.accepted, "{answer:?}");
    assert_eq!(session.body.mode(), Mode::StandUp);
}

#[test]
fn a_real_robot_is_not_armed_before_every_item_holds_and_the_refusal_names_all() {
    let mut session = Session::hardware();
    session.robot.charge_percent = 20.0;
    session.ticks(110);
    let answer = session.request(OperatorRequest::Arm);
    assert!(!answer.accepted);
    for words in [
        "battery: 20 %, needed: at least 30 %",
        "low-level mode, damped: not confirmed",
        "configuration: ",
        "area clear, remote in hand: not confirmed",
        "STOP tested: not in this session",
    ] {
        assert!(answer.answer.contains(words), "{words}: {}", answer.answer);
    }
    session.robot.charge_percent = 90.0;
    for check in OperatorCheck::ALL {
        assert!(session.request(OperatorRequest::Confirm(check)).accepted);
    }
    session.ticks(600);
    let answer = session.request(OperatorRequest::Arm);
    assert!(!answer.accepted && answer.answer.starts_with("STOP tested") && !answer.answer.contains(';'), "{answer:?}");
    session.test_stop();
    assert_eq!(session.state(ArmingCheck::StopTested), ArmingCheckState::Passed);
    let answer = session.request(OperatorRequest::Arm);
    assert!(answer.accepted, "{answer:?}");
    assert_eq!(session.body.mode(), Mode::StandUp);
}

/// Regression: low-level mode could be confirmed while the robot was still off, or was switched off and on while it was only observed,
/// when restarts are not watched; the list then showed it as confirmed.
#[test]
fn what_was_confirmed_before_control_is_taken_is_confirmed_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::begin(Backend::Hardware, Some(folder.path().to_owned()), false);
    session.ticks(10);
    for check in OperatorCheck::ALL {
        assert!(session.request(OperatorRequest::Confirm(check)).accepted);
    }
    assert!(!session.body.mode().commanded());
    session.supervisor.take_control();
    session.ticks(1500);
    assert_eq!(session.body.mode(), Mode::Disarmed);
    assert_eq!(session.state(ArmingCheck::LowLevel), ArmingCheckState::Waiting);
    assert_eq!(session.state(ArmingCheck::AreaClear), ArmingCheckState::Waiting);
    assert_eq!(session.state(ArmingCheck::Configuration), ArmingCheckState::Passed);
}

/// The confirmation of a clear area holds for one arming: afterwards a person may have been at the robot.
#[test]
fn the_area_is_asked_about_before_each_arming() {
    let mut session = Session::hardware();
    session.test_stop();
    for check in OperatorCheck::ALL {
        session.request(OperatorRequest::Confirm(check));
    }
    assert!(session.request(OperatorRequest::Arm).accepted);
    assert!(!session.request(OperatorRequest::Confirm(OperatorCheck::AreaClear)).accepted, "not while it is armed");
    session.operator.stop.set();
    session.ticks(3000);
    session.request(OperatorRequest::Acknowledge);
    session.ticks(1500);
    assert_eq!(session.state(ArmingCheck::AreaClear), ArmingCheckState::Waiting);
    assert_eq!(session.state(ArmingCheck::LowLevel), ArmingCheckState::Passed);
    assert_eq!(session.state(ArmingCheck::StopTested), ArmingCheckState::Passed);
    let answer = session.request(OperatorRequest::Arm);
    assert!(!answer.accepted && answer.answer.contains("area clear"), "{answer:?}");
}

/// Nothing new begins on a robot without a guard: it would not be damped if this program were killed.
#[test]
fn without_its_guard_a_robot_is_not_armed() {
    let mut session = Session::cleared();
    session.supervisor.report_guard_lost(session.time_ms * 1_000_000);
    let answer = session.request(OperatorRequest::Arm);
    assert!(!answer.accepted && answer.answer.starts_with("the guard process has ended"), "{answer:?}");
    assert!(
        session.request(OperatorRequest::Confirm(OperatorCheck::AreaClear)).accepted,
        "what energises nothing goes on"
    );
    assert_eq!(session.body.mode(), Mode::Disarmed);
}

/// Regression: a stopped guard was not noticed, and jumps were approved meanwhile.
#[test]
fn while_its_guard_does_not_answer_a_robot_is_not_armed() {
    let mut session = Session::cleared();
    session.supervisor.await_guard();
    let answer = session.request(OperatorRequest::Arm);
    assert!(!answer.accepted && answer.answer.contains("wait until it answers"), "{answer:?}");
    session.supervisor.report_guard_silent(true, session.time_ms * 1_000_000);
    let answer = session.request(OperatorRequest::Arm);
    assert!(!answer.accepted && answer.answer.contains("does not answer"), "{answer:?}");
    session.supervisor.report_guard_silent(false, session.time_ms * 1_000_000);
    assert!(session.request(OperatorRequest::Arm).accepted);
}

/// Regression: what the system denied was a line in the log.
#[test]
fn denied_real_time_settings_are_confirmed_before_arming_each_with_its_remedy() {
    let cleared = |granted: &[RealtimeSetting], denied: &[DeniedSetting]| {
        let mut session = Session::hardware();
        session.supervisor.report_scheduling(granted, denied, session.time_ms * 1_000_000);
        session.test_stop();
        for check in [OperatorCheck::LowLevel, OperatorCheck::Configuration, OperatorCheck::AreaClear] {
            assert!(session.request(OperatorRequest::Confirm(check)).accepted);
        }
        session
    };
    let settings = [RealtimeSetting::Priority(80), RealtimeSetting::LockedMemory];
    assert!(cleared(&settings, &[]).request(OperatorRequest::Arm).accepted, "granted");

    let remedies = [ALLOW_PRIORITY, ALLOW_LOCKING];
    let denied = |i: usize| DeniedSetting { setting: settings[i], reason: "not permitted".into(), remedy: remedies[i] };
    let checks = [OperatorCheck::Priority, OperatorCheck::LockedMemory];
    for i in [0, 1] {
        let mut session = cleared(&[settings[1 - i]], &[denied(i)]);
        let answer = session.request(OperatorRequest::Arm);
        let name = checks[i].check().name();
        assert!(!answer.accepted && answer.answer.starts_with(name), "{answer:?}");
        assert!(answer.answer.contains(remedies[i]) && answer.answer.contains("not permitted"), "{answer:?}");
        assert!(session.request(OperatorRequest::Confirm(checks[i])).accepted);
        assert!(session.request(OperatorRequest::Arm).accepted);
    }
    let answer = cleared(&[], &[]).request(OperatorRequest::Arm);
    assert!(!answer.accepted && answer.answer.contains("not requested"), "{answer:?}");
}

/// Regression: a confirmation of the morning armed the robot in the evening.
#[test]
fn the_word_on_the_area_is_forgotten_after_a_minute() {
    let mut session = Session::cleared();
    session.ticks(50_000);
    assert_eq!(session.state(ArmingCheck::AreaClear), ArmingCheckState::Passed);
    session.ticks(11_000);
    assert_eq!(session.state(ArmingCheck::AreaClear), ArmingCheckState::Waiting);
    let answer = session.request(OperatorRequest::Arm);
    assert!(!answer.accepted && answer.answer.contains("area clear"), "{answer:?}");
    assert!(session.request(OperatorRequest::Confirm(OperatorCheck::AreaClear)).accepted);
    assert!(session.request(OperatorRequest::Arm).accepted);
    // It holds until the robot lies again, however long the session stands.
    session.ticks(3000);
    assert_eq!(session.body.mode(), Mode::Ready);
}

impl Session {
    /// On hardware's terms, disarmed, and every item holds.
    fn cleared() -> Session {
        let mut session = Session::hardware();
        session.test_stop();
        for check in OperatorCheck::ALL {
            assert!(session.request(OperatorRequest::Confirm(check)).accepted);
        }
        session
    }

    /// Trial and revision of the newest proposal.
    fn proposal(&self) -> (u32, u32) {
        let proposal = self.records.iter().rev().find_map(|record| match record {
            Record::Proposal(proposal) => Some((proposal.trial, proposal.revision)),
            _ => None,
        });
        proposal.expect("a proposal")
    }

    fn faults_told(&self) -> Vec<String> {
        let faults = self.records.iter().filter_map(|record| match record {
            Record::Transition(change) if change.to == Mode::Fault => Some(change.cause.clone()),
            _ => None,
        });
        faults.collect()
    }

    fn must_confirm_low_level_again(&mut self) {
        assert!(self.request(OperatorRequest::Acknowledge).accepted);
        self.ticks(1500);
        assert_eq!(self.body.mode(), Mode::Disarmed);
        let answer = self.request(OperatorRequest::Arm);
        assert!(!answer.accepted && answer.answer.contains("low-level mode, damped: not confirmed"), "{answer:?}");
        assert!(answer.answer.contains("area clear, remote in hand: not confirmed"), "{answer:?}");
        assert_eq!(self.state(ArmingCheck::LowLevel), ArmingCheckState::Waiting);
    }
}

/// A power cycle behind another fault: the lost link and the restart are reported as well and withdraw the operator's confirmations. (A defect
/// once: the first fault hid them, and a robot whose own controller ran again was armed.)
#[test]
fn a_restart_during_another_fault_is_told_and_takes_the_word_back() {
    let mut session = Session::cleared();
    assert!(session.request(OperatorRequest::Arm).accepted);
    session.robot.tamper = |state| state.joint_position_rad[3] = 2.0;
    session.ticks(10);
    session.robot.tamper = |_| {};
    session.ticks(10);
    for check in [OperatorCheck::LowLevel, OperatorCheck::AreaClear] {
        assert!(
            session.request(OperatorRequest::Confirm(check)).accepted,
            "given too early: the robot is switched off only now"
        );
    }
    session.robot.silent_ms = 1;
    session.ticks(2000);
    session.robot.silent_ms = 0;
    // Both clocks go on from there.
    session.robot.tamper = |state| state.robot_time_ms = state.robot_time_ms.saturating_sub(5000);
    session.ticks(100);
    let told = session.faults_told();
    let words = ["FL_hip at 2.000 rad", "link to the robot lost", "the robot restarted"];
    assert_eq!(told.len(), words.len(), "each once: {told:?}");
    for (told, words) in told.iter().zip(words) {
        assert!(told.contains(words), "{told} instead of {words}");
    }
    session.must_confirm_low_level_again();
}

/// The link's count of restarts alone withdraws the confirmations, whatever the mode and whether or not it changed.
#[test]
fn a_restart_that_changes_no_mode_takes_the_word_back() {
    let mut session = Session::cleared();
    session.robot.tamper = |state| state.motor_temperature_c[3] = 90.0;
    session.ticks(10);
    assert_eq!(session.body.mode(), Mode::Fault);
    session.robot.tamper = |_| {};
    session.robot.link.reboots = 1;
    session.ticks(200);
    assert_eq!(session.faults_told().len(), 1, "{:?}", session.faults_told());
    let logged = session.records.iter().any(|r| matches!(r, Record::Log(log) if log.message.contains("restarted")));
    assert!(logged);
    session.must_confirm_low_level_again();
}

/// Every item with its value, twice a second while the robot is disarmed, and at once when one changes.
#[test]
fn the_list_is_shown_twice_a_second_and_on_change() {
    let mut session = Session::hardware();
    let lists = |session: &Session| session.records.iter().filter(|r| matches!(r, Record::ArmingChecks(_))).count();
    let before = lists(&session);
    session.ticks(2000);
    assert!((3..=5).contains(&(lists(&session) - before)), "{} lists in 2 s", lists(&session) - before);
    assert_eq!(session.state(ArmingCheck::Battery), ArmingCheckState::Passed);
    let before = lists(&session);
    session.robot.charge_percent = 29.0;
    session.ticks(110);
    assert!(lists(&session) > before);
    let battery = session.list().into_iter().find(|item| item.check == ArmingCheck::Battery).unwrap();
    assert_eq!((battery.found.as_str(), battery.state), ("29 %", ArmingCheckState::Failed));
}

#[test]
fn a_full_disk_and_a_missing_recording_are_named() {
    let session = Session::new(Backend::Hardware, None);
    assert_eq!(session.state(ArmingCheck::Recorder), ArmingCheckState::Failed);
    let gone = std::path::PathBuf::from("/no/such/folder");
    let session = Session::new(Backend::Simulator, Some(gone));
    assert_eq!(session.state(ArmingCheck::Disk), ArmingCheckState::Failed);
}

/// Regression: the session asked the file system itself, and hung with a server of files that was gone.
#[test]
fn a_file_system_that_does_not_answer_holds_the_trials_and_not_the_session() {
    let settings = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = settings.settings(&robot, Task::Forward, Backend::Hardware).unwrap();
    let (file_system, answers) = channel();
    file_system.send(5000).unwrap();
    let (space, thread) = FreeSpace::watch_by(move || answers.recv().map_err(std::io::Error::other)).unwrap();
    let list = ArmingChecklist::new(&settings, String::new(), Some(space));
    assert_eq!(list.disk_low(), None);
    let until = |wanted: &dyn Fn(Option<String>) -> bool| {
        while !wanted(list.disk_low()) {
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
    };
    until(&|low| low.is_some_and(|reason| reason.contains("the file system has not answered for")));
    file_system.send(100).unwrap();
    until(&|low| low.is_some_and(|reason| reason.contains("100 MB free")));
    file_system.send(5000).unwrap();
    until(&|low| low.is_none());
    // Its thread ends with the list, at the next answer.
    drop(list);
    drop(file_system);
    thread.join().unwrap();
}

/// STOP is everybody's: who only looks may press it, damping is sent then, and an acknowledgement gives the robot back to whose
/// it is. Regression: a session that only observes was damping for ever after its STOP.
#[test]
fn an_observer_may_stop_and_then_lets_go_of_the_robot() {
    let mut session = Session::begin(Backend::Hardware, None, true);
    session.ticks(100);
    assert_eq!((session.body.mode(), session.robot.writes), (Mode::Observe, 0));
    session.operator.stop.set();
    session.ticks(50);
    assert_eq!((session.body.mode(), session.robot.writes), (Mode::Damped, 50));
    let answer = session.request(OperatorRequest::Arm);
    assert!(!answer.accepted && answer.answer.contains("only observes"), "{answer:?}");
    let answer = session.request(OperatorRequest::Acknowledge);
    // Regression: the answer was "disarmed; arm when ready".
    assert!(answer.accepted && answer.answer == "nothing is sent any more", "{answer:?}");
    session.ticks(10);
    assert_eq!(session.body.mode(), Mode::Observe);
    let writes = session.robot.writes;
    session.ticks(100);
    assert_eq!(session.robot.writes, writes, "nothing is sent any more");
}

/// Regression: the end of the session judged by the last known mode, and an arming on its way left the robot standing.
#[test]
fn an_arming_on_its_way_when_the_session_ends_energises_nothing() {
    let mut session = Session::new(Backend::Simulator, None);
    let time_ns = session.time_ms * 1_000_000;
    session.supervisor.handle_request(&StampedRequest { request: OperatorRequest::Arm, stops: 0, time_ns }, time_ns);
    assert_eq!(session.supervisor.mode(), Mode::Disarmed, "of the arming nothing is heard yet");
    session.supervisor.end_session_step(true);
    session.supervisor.stop();
    for _ in 0..3000 {
        session.ticks(1);
        assert!(!session.body.mode().energised(), "{:?}", session.body.mode());
    }
}

/// The last STOP is none to a robot that this session never spoke to.
#[test]
fn the_end_of_a_session_that_only_observes_sends_nothing() {
    let mut session = Session::begin(Backend::Hardware, None, true);
    session.ticks(20);
    assert!(!session.supervisor.end_session_step(true));
    session.supervisor.stop();
    session.ticks(100);
    assert_eq!((session.body.mode(), session.robot.writes), (Mode::Observe, 0));
}

/// Regression: `auto` went on judging and arming while the program said goodbye.
#[test]
fn nothing_is_done_by_itself_any_more_once_the_session_ends() {
    let mut session = Session::begin(Backend::Simulator, None, false);
    session.supervisor = session.supervisor.approving(Approval::Auto, true);
    session.ticks(10);
    session.supervisor.take_control();
    session.supervisor.end_session_step(true);
    session.ticks(3000);
    assert_eq!(session.body.mode(), Mode::Disarmed);
}

/// Regression: control of a robot was taken before the first heartbeat of a screen.
#[test]
fn control_is_taken_only_once_a_screen_was_heard() {
    let mut session = Session::begin(Backend::Simulator, None, false);
    session.watched = false;
    session.ticks(10);
    session.supervisor.take_control();
    session.ticks(10);
    assert_eq!(session.body.mode(), Mode::Observe);
    session.watched = true;
    session.ticks(1);
    session.supervisor.take_control();
    session.ticks(10);
    assert_eq!(session.body.mode(), Mode::Disarmed);
}

/// Regression: a request for control held without end: a robot that was switched on a minute later was commanded without a key.
#[test]
fn a_request_for_control_of_a_silent_robot_holds_for_ten_seconds() {
    let mut session = Session::begin(Backend::Hardware, None, false);
    let run = |session: &mut Session, ms: u32| {
        for _ in 0..ms {
            session.ticks(1);
            session.supervisor.take_wanted_control(true);
        }
    };
    session.robot.silent_ms = 1;
    run(&mut session, 1000);
    assert!(session.request(OperatorRequest::TakeControl).accepted);
    session.records.clear();
    let answers = |session: &Session| -> Vec<RequestRecord> {
        let answer = |record: &Record| match record {
            Record::Request(answer) => Some(answer.clone()),
            _ => None,
        };
        session.records.iter().filter_map(answer).collect()
    };
    run(&mut session, 9900);
    assert_eq!(answers(&session), []);
    run(&mut session, 200);
    let [expired] = &answers(&session)[..] else { panic!("{:?}", session.records) };
    assert_eq!((expired.accepted, expired.request.as_str()), (false, "take control"));
    assert_eq!(expired.answer, "no state of the robot for 10 s: nothing is sent to the robot; ask for control again");
    session.robot.silent_ms = 0;
    run(&mut session, 1000);
    assert_eq!((session.body.mode(), session.robot.writes), (Mode::Observe, 0));
    assert!(session.request(OperatorRequest::TakeControl).accepted);
    run(&mut session, 20_000);
    assert_eq!(session.body.mode(), Mode::Disarmed);
    assert!(answers(&session).iter().skip(1).all(|answer| answer.accepted), "{:?}", answers(&session));
}

/// On the console, too, the operator reads which number ended the trial.
#[test]
fn a_limit_that_ends_a_trial_is_logged_with_its_key() {
    let mut session = Session::new(Backend::Simulator, None);
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = config.settings(&robot, Task::Forward, Backend::Simulator).unwrap();
    session.supervisor = session.supervisor.naming_limits(settings);
    assert!(session.request(OperatorRequest::Arm).accepted);
    session.ticks(4000);
    assert_eq!(session.body.mode(), Mode::Ready);
    let (trial, revision) = session.proposal();
    assert!(session.request(OperatorRequest::Approve { trial, revision }).accepted);
    session.ticks(500);
    session.robot.tamper = |state| state.joint_velocity_rad_s[2] = 90.0;
    session.ticks(20);
    assert_eq!(session.body.mode(), Mode::Fault);
    let logged = session.records.iter().find_map(|record| match record {
        Record::Log(line) if line.message.contains("FR_calf at 90.0 rad/s") => Some(line.message.clone()),
        _ => None,
    });
    let logged = logged.expect("the end of the trial is logged");
    assert!(logged.contains("watchdog.velocity_factor = 2 in safety.toml"), "{logged}");
}

#[derive(Debug, Clone, Copy)]
enum Step {
    Request(fn() -> OperatorRequest),
    Stop,
    Tamper(fn(&mut RobotState)),
    PowerCycle,
    Mend,
}

fn any_step() -> impl Strategy<Value = Step> {
    let wishes: [fn() -> OperatorRequest; 8] = [
        || OperatorRequest::Arm,
        || OperatorRequest::Acknowledge,
        || OperatorRequest::Confirm(OperatorCheck::LowLevel),
        || OperatorRequest::Confirm(OperatorCheck::Configuration),
        || OperatorRequest::Confirm(OperatorCheck::AreaClear),
        || OperatorRequest::SitDown,
        || OperatorRequest::Cancel,
        || OperatorRequest::Judge(Verdict::Void),
    ];
    let tampers: [fn(&mut RobotState); 4] = [
        |state| state.motor_enabled[7] = false,
        |state| state.motor_temperature_c[3] = 90.0,
        |state| state.imu.gyro_body.z = 0.5,
        |state| state.joint_velocity_rad_s[4] = f64::NAN,
    ];
    prop_oneof![
        3 => Just(Step::Request(wishes[0])),
        3 => Just(Step::Request(wishes[1])),
        6 => (2..wishes.len()).prop_map(move |i| Step::Request(wishes[i])),
        2 => Just(Step::Stop),
        2 => (0..tampers.len()).prop_map(move |i| Step::Tamper(tampers[i])),
        2 => Just(Step::PowerCycle),
        4 => Just(Step::Mend),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// For any sequence of requests and faults, through the session and the control loop: the robot stands up only after an
    /// accepted request to arm, made while the operator's confirmations since the robot's last boot were valid and its motors
    /// followed; and it never jumps without an approval. The test keeps its own account of the confirmations.
    #[test]
    fn no_session_energises_without_arm_and_confirmations_since_the_boot(
        steps in proptest::collection::vec((any_step(), 1..1500_u32), 1..25),
        begins_cleared: bool,
    ) {
        let mut session = if begins_cleared { Session::cleared() } else { Session::hardware() };
        // The operator's confirmations since the robot's last boot; whether its motors follow.
        let (mut low_level, mut area, mut follow) = (begins_cleared, begins_cleared, true);
        for (step, ticks) in steps {
            let before = session.body.mode();
            match step {
                Step::Request(wanted) => {
                    let wanted = wanted();
                    let answer = session.request(wanted.clone());
                    low_level |= answer.accepted && wanted == OperatorRequest::Confirm(OperatorCheck::LowLevel);
                    area |= answer.accepted && wanted == OperatorRequest::Confirm(OperatorCheck::AreaClear);
                    if !before.energised() && session.body.mode().energised() {
                        prop_assert!(answer.accepted && wanted == OperatorRequest::Arm, "{wanted:?} energises");
                        prop_assert!(before == Mode::Disarmed && low_level && area && follow, "armed without a word");
                    }
                }
                Step::Stop => session.operator.stop.set(),
                Step::Tamper(tamper) => {
                    session.robot.tamper = tamper;
                    let mut state = RobotState { motor_enabled: [true; 12], ..RobotState::default() };
                    tamper(&mut state);
                    follow = state.motor_enabled == [true; 12];
                }
                Step::PowerCycle => {
                    session.robot.silent_ms = 1;
                    session.ticks(300);
                    session.robot.silent_ms = 0;
                    session.robot.link.reboots += 1;
                    session.robot.tamper = |state| state.robot_time_ms = 0;
                    session.ticks(1);
                    session.robot.tamper = |_| {};
                    (low_level, area, follow) = (false, false, true);
                }
                Step::Mend => {
                    session.robot.tamper = |_| {};
                    follow = true;
                }
            }
            for _ in 0..ticks {
                let before = session.body.mode();
                session.ticks(1);
                let mode = session.body.mode();
                prop_assert!(before.energised() || !mode.energised(), "{mode:?} by itself");
                prop_assert!(!matches!(mode, Mode::Countdown | Mode::Jump | Mode::Settle), "{mode:?} without approval");
            }
            area &= session.body.mode().energised() || !before.energised();
        }
    }
}

/// A person with a tape goes to the robot in REVIEW.
#[test]
fn a_robot_sits_down_at_the_end_of_a_trial_if_so_configured() {
    for sits_down in [true, false] {
        let session = Session::hardware();
        let supervisor = session.supervisor.sitting_down_for_review(sits_down);
        let mut session = Session { supervisor, ..session };
        session.test_stop();
        for check in OperatorCheck::ALL {
            assert!(session.request(OperatorRequest::Confirm(check)).accepted);
        }
        let answer = session.request(OperatorRequest::Arm);
        assert!(answer.accepted, "{answer:?}");
        session.ticks(4000);
        assert_eq!(session.body.mode(), Mode::Ready);
        let (trial, revision) = session.proposal();
        let answer = session.request(OperatorRequest::Approve { trial, revision });
        assert!(answer.accepted, "{answer:?}");
        session.records.clear();
        session.ticks(15_000);
        let entered = session.records.iter().filter_map(|record| match record {
            Record::Transition(change) => Some(change.to),
            _ => None,
        });
        let after: Vec<Mode> = entered.skip_while(|mode| *mode != Mode::Review).collect();
        let expected = if sits_down { &[Mode::Review, Mode::SitDown, Mode::Disarmed][..] } else { &[Mode::Review] };
        assert_eq!(after, expected);
        if sits_down {
            assert_eq!(session.state(ArmingCheck::AreaClear), ArmingCheckState::Waiting, "a person may go to it now");
        }
    }
}

/// Regression: in the last of several jumps the request was answered as accepted, the control thread refused it, and the robot
/// stayed standing in REVIEW.
#[test]
fn an_accepted_request_to_sit_down_in_the_last_jump_sits_the_robot_down() {
    let mut config = Config::load(None).unwrap();
    let forward = config.control.tasks.get_mut("forward").unwrap();
    (forward.jumps, forward.f1_hz) = (2, 0.8);
    let mut session = Session::of(config, Backend::Simulator, None, false, None);
    session.ticks(10);
    session.supervisor.take_control();
    session.ticks(1500);
    assert!(session.request(OperatorRequest::Arm).accepted);
    session.ticks(4000);
    for (parameter, value) in [("f0", 1.4), ("Fx", 30.0), ("Fz", 220.0)] {
        let answer = session.request(OperatorRequest::Override { parameter: parameter.to_owned(), value });
        assert!(answer.accepted, "{answer:?}");
    }
    let (trial, revision) = session.proposal();
    let answer = session.request(OperatorRequest::Approve { trial, revision });
    assert!(answer.accepted, "{answer:?}");
    while session.body.mode() != Mode::Jump {
        session.ticks(1);
    }
    // The first press makes the present jump the last one.
    for _ in 0..2 {
        let answer = session.request(OperatorRequest::SitDown);
        assert!(answer.accepted, "{answer:?}");
    }
    session.records.clear();
    session.ticks(15_000);
    let entered = session.records.iter().filter_map(|record| match record {
        Record::Transition(change) => Some(change.to),
        _ => None,
    });
    assert_eq!(entered.collect::<Vec<_>>(), [Mode::Settle, Mode::Review, Mode::SitDown, Mode::Disarmed]);
    let refused = |record: &&Record| matches!(record, Record::Log(log) if log.message.contains("refused"));
    assert_eq!(session.records.iter().find(refused), None);
}

/// Regression: of a jump that the control thread refused before its countdown the cause was that the countdown was cancelled; the
/// reason was in the log alone.
#[test]
fn a_jump_that_is_refused_before_its_countdown_has_the_reason_as_its_cause() {
    let mut session = Session::new(Backend::Simulator, None);
    assert!(session.request(OperatorRequest::Arm).accepted);
    session.ticks(4000);
    assert_eq!(session.body.mode(), Mode::Ready);
    let (trial, revision) = session.proposal();
    let time_ns = session.time_ms * 1_000_000;
    let request = OperatorRequest::Approve { trial, revision };
    session.supervisor.handle_request(&StampedRequest { request, stops: 0, time_ns }, time_ns);
    // Between the session's approval and the tick in which the control thread receives it.
    session.operator.stop.set();
    session.ticks(2000);
    let row = session.records.iter().rev().find_map(|record| match record {
        Record::Trial(row) if row.trial == trial => Some(row.clone()),
        _ => None,
    });
    let row = row.expect("its row");
    assert_eq!((row.suggested, row.verdict), (Some(Verdict::Void), None));
    assert_eq!(row.cause, "not begun: STOP is set");
}

/// With mosh or in tmux the loss of the operator is not detected, so the robot would go on.
#[test]
fn a_connection_that_cannot_be_seen_is_confirmed_before_a_real_robot_is_armed() {
    let mut session = Session::hardware();
    assert_eq!(session.state(ArmingCheck::Connection), ArmingCheckState::Passed);
    let folder = tempfile::tempdir().unwrap();
    session =
        Session::begin_unseen(Backend::Hardware, Some(folder.path().to_owned()), Some("tmux hides it".to_owned()));
    session.ticks(10);
    session.supervisor.take_control();
    session.ticks(1500);
    session.test_stop();
    for check in OperatorCheck::ALL.into_iter().filter(|check| *check != OperatorCheck::Connection) {
        session.request(OperatorRequest::Confirm(check));
    }
    let answer = session.request(OperatorRequest::Arm);
    assert!(!answer.accepted, "{answer:?}");
    assert!(answer.answer.contains("operator's connection: tmux hides it, not confirmed"), "{answer:?}");
    session.request(OperatorRequest::Confirm(OperatorCheck::Connection));
    let answer = session.request(OperatorRequest::Arm);
    assert!(answer.accepted, "{answer:?}");
}

/// Regression: by the document a STOP in OFFLINE was the test of STOP. Without a state the robot is in FAULT 20 ms later: the screen does
/// not show that STOP has acted.
#[test]
fn a_stop_of_a_robot_that_has_not_answered_tests_nothing() {
    for silent_ms in [5, 100] {
        let mut session = Session::begin(Backend::Hardware, None, false);
        session.robot.silent_ms = 1;
        session.ticks(silent_ms);
        session.operator.stop.set();
        session.ticks(5);
        let expected = if silent_ms == 5 { Mode::Damped } else { Mode::Fault };
        assert_eq!(session.body.mode(), expected, "after {silent_ms} ms without a state");
        session.robot.silent_ms = 0;
        session.ticks(5);
        assert!(session.request(OperatorRequest::Acknowledge).accepted);
        session.ticks(1500);
        assert_eq!(session.body.mode(), Mode::Disarmed);
        assert_eq!(session.state(ArmingCheck::StopTested), ArmingCheckState::Waiting, "{silent_ms} ms");
        session.test_stop();
        assert_eq!(session.state(ArmingCheck::StopTested), ArmingCheckState::Passed);
    }
}

/// Regressions: a STOP in DAMPED or FAULT left no line in the log, and the arming check that it does not meet did not say so.
#[test]
fn a_stop_of_a_damped_robot_is_logged_and_tests_nothing() {
    let logged = |session: &Session, mode: &str| {
        let text = format!("STOP while {mode}: the robot stays damped");
        session.records.iter().filter(|it| matches!(it, Record::Log(line) if line.message == text)).count()
    };
    let mut session = Session::hardware();
    session.operator.stop.set();
    session.ticks(5);
    assert_eq!((session.body.mode(), logged(&session, "DAMPED")), (Mode::Damped, 0), "the change of mode reports it");
    for pressed in 1..=2 {
        session.operator.stop.set();
        session.ticks(20);
        assert_eq!(logged(&session, "DAMPED"), pressed);
    }
    assert!(session.request(OperatorRequest::Acknowledge).accepted);

    let mut session = Session::hardware();
    session.robot.tamper = |state| state.motor_temperature_c[3] = 90.0;
    session.ticks(10);
    session.operator.stop.set();
    session.ticks(5);
    assert_eq!((session.body.mode(), logged(&session, "FAULT")), (Mode::Fault, 1));
    session.robot.tamper = |_| {};
    session.ticks(10);
    assert!(session.request(OperatorRequest::Acknowledge).accepted);
    session.ticks(1500);
    let check = session.list().into_iter().find(|item| item.check == ArmingCheck::StopTested).unwrap();
    assert_eq!(check.state, ArmingCheckState::Waiting);
    assert_eq!(check.needed, "press STOP while DISARMED, then acknowledge");
    session.test_stop();
    assert_eq!(session.state(ArmingCheck::StopTested), ArmingCheckState::Passed);
}
