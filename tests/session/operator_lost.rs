//! The operator's console falls silent in mid-jump, on a running engine: the robot lands, sits down and is damped, the trial is
//! void with that cause, and the next session goes on with the same parameters.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use quadfrog::config::Config;
use quadfrog::engine::{self, EngineHandle, Options};
use quadfrog::recording::player::Player;
use quadfrog::recording::record::Record;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{Backend, ExperimentStage, Proposal, Task, TrialRecord, Verdict};

/// Longest wait; ends only a test that fails.
const PATIENCE: Duration = Duration::from_secs(60);

fn start(folder: &Path, config: Option<&Path>) -> EngineHandle {
    let config = Config::load(config).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let options = Options::new(config, robot, Backend::Simulator, Task::Forward);
    engine::start(Options { seed: 3, trials: Some(5), folder: Some(folder.to_owned()), ..options })
        .unwrap_or_else(|error| panic!("{error}"))
}

/// A screen: sends heartbeats in a thread of its own until it is lost, and keeps the records that it receives.
struct Screen {
    handle: EngineHandle,
    records: Vec<Record>,
    alive: Arc<AtomicBool>,
}

impl Screen {
    fn new(handle: EngineHandle) -> Screen {
        let alive = Arc::new(AtomicBool::new(true));
        let (heart, flag) = (handle.heartbeat(), alive.clone());
        std::thread::spawn(move || {
            while flag.load(Ordering::Relaxed) {
                heart.beat();
                std::thread::sleep(Duration::from_millis(20));
            }
        });
        Screen { handle, records: Vec::new(), alive }
    }

    fn lost(&self) {
        self.alive.store(false, Ordering::Relaxed);
    }

    fn until(&mut self, what: &str, mut holds: impl FnMut(&mut Screen) -> bool) {
        let begun = Instant::now();
        loop {
            while let Some(stamped) = self.handle.next_record() {
                self.records.push(stamped.record);
            }
            if holds(self) {
                return;
            }
            assert!(begun.elapsed() < PATIENCE, "{what}: still {:?}", self.handle.snapshot().tick.mode);
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn until_mode(&mut self, mode: Mode) {
        self.until(mode.name(), |screen| screen.handle.snapshot().tick.mode == mode);
    }

    fn proposal(&mut self) -> Proposal {
        let mut found = None;
        self.until("a proposal", |screen| {
            found = screen.records.iter().rev().find_map(|record| match record {
                Record::Proposal(proposal) => Some(proposal.clone()),
                _ => None,
            });
            found.is_some()
        });
        found.unwrap()
    }

    fn row(&self, trial: u32) -> Option<&TrialRecord> {
        self.records.iter().rev().find_map(|record| match record {
            Record::Trial(row) if row.trial == trial => Some(row),
            _ => None,
        })
    }

    fn jump(&mut self) -> Proposal {
        self.until_mode(Mode::Disarmed);
        self.handle.request(OperatorRequest::Arm);
        self.until_mode(Mode::Ready);
        let proposal = self.proposal();
        self.handle.request(OperatorRequest::Approve { trial: proposal.trial, revision: proposal.revision });
        self.until_mode(Mode::Jump);
        proposal
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.lost();
    }
}

#[test]
fn a_lost_operator_costs_the_trial_but_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let mut screen = Screen::new(start(folder.path(), None));
    let before = screen.jump();
    screen.lost();
    screen.until_mode(Mode::Disarmed);
    let trial = before.trial;
    screen.until("the trial is looked at", |screen| screen.row(trial).is_some_and(|row| row.suggested.is_some()));
    let row = screen.row(trial).unwrap().clone();
    // A silence of a second may end after the landing of a short jump; then the trial counts as it is.
    if row.suggested == Some(Verdict::Void) {
        assert!(row.cause.contains("no heartbeat of the operator's console"), "{}", row.cause);
    } else {
        assert!(row.measured.is_some(), "{row:?}");
    }
    // The snapshot is faster than the records.
    let landed = [Mode::Jump, Mode::Settle, Mode::Review, Mode::SitDown, Mode::Disarmed];
    screen.until("landed, sat down, disarmed", |screen| {
        let changes = screen.records.iter().filter_map(|record| match record {
            Record::Transition(change) => Some(change.to),
            _ => None,
        });
        let after: Vec<Mode> = changes.skip_while(|mode| *mode != Mode::Jump).collect();
        assert!(landed.starts_with(&after), "{after:?}");
        after == landed
    });
    drop(screen);

    // All of it is in the recording, which was closed in order.
    let player = Player::open(folder.path().join("session.mcap")).unwrap();
    assert_eq!(player.damage(), None);

    let mut again = Screen::new(start(folder.path(), None));
    if row.suggested != Some(Verdict::Void) {
        // It was measured: it waits for its verdict.
        again.until("the review", |screen| {
            let stage = |record: &Record| match record {
                Record::Stage(info) => Some((info.stage, info.trial)),
                _ => None,
            };
            screen.records.iter().rev().find_map(stage) == Some((ExperimentStage::Review, trial))
        });
        assert_eq!(again.row(trial).and_then(|kept| kept.suggested), row.suggested);
        return;
    }
    // Not judged, it is void, and its parameters come again.
    let proposal = again.proposal();
    let values = |proposal: &Proposal| proposal.parameters.iter().map(|p| p.value).collect::<Vec<_>>();
    assert_eq!(values(&proposal), values(&before));
    assert_eq!(proposal.parent, Some(trial));
    again.until("the old trial", |screen| screen.row(trial).is_some_and(|row| row.verdict == Some(Verdict::Void)));
    let stages =
        again.records.iter().any(|r| matches!(r, Record::Stage(info) if info.stage == ExperimentStage::Proposed));
    assert!(stages, "the study goes on");
}

/// A fault outside of any trial: its last 200 ticks are in the recording all the same, and STOP latches.
#[test]
fn the_last_ticks_go_with_a_fault_outside_a_trial() {
    let folder = tempfile::tempdir().unwrap();
    let config = tempfile::tempdir().unwrap();
    // Any robot is too hot for this configuration: the fault comes with the first damping.
    std::fs::write(config.path().join("safety.toml"), "[watchdog]\nmotor_warm_c = -300.0\nmotor_c = -280.0\n").unwrap();
    let refused = Config::load(Some(config.path()));
    assert!(refused.is_err(), "a limit below any temperature is refused");
    std::fs::write(config.path().join("safety.toml"), "[watchdog]\nsimulator_late_ms = 0.000001\n").unwrap();
    let mut screen = Screen::new(start(folder.path(), Some(config.path())));
    screen.until_mode(Mode::Fault);
    screen.until("the fault's ticks", |screen| screen.records.iter().any(|r| matches!(r, Record::FaultTicks(_))));
    drop(screen);
    let player = Player::open(folder.path().join("session.mcap")).unwrap();
    let kept = player.events().iter().find_map(|event| match &event.record {
        Record::FaultTicks(ticks) => Some(ticks.clone()),
        _ => None,
    });
    let kept = kept.expect("the ticks are in the recording");
    assert_eq!(kept.last().map(|tick| tick.mode), Some(Mode::Fault));
    let numbers: Vec<u64> = kept.iter().map(|tick| tick.number).collect();
    assert!(numbers.windows(2).all(|pair| pair[1] == pair[0] + 1), "without a gap");
    let named = player.events().iter().any(|event| {
        matches!(&event.record, Record::Transition(change) if change.to == Mode::Fault && change.cause.contains("control thread late"))
    });
    assert!(named);
}
