//! Whole studies over the network: the engine drives emulated robots over loopback in real time, with an operator who
//! arms, approves, accepts the suggested verdicts, and after a stop places the robot and arms again. Go1s, and with the feature
//! `go2` Go2s.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::go1::{ANY_PORT, Lockstep, network};
use quadfrog::config::Config;
use quadfrog::engine::{self, EngineHandle, Options, open_experiment};
use quadfrog::optimize::journal::Durability;
use quadfrog::realtime::thread::pace;
use quadfrog::recording::record::{Record, StageRecord};
use quadfrog::robot::description::{RobotDescription, RobotFiles};
use quadfrog::robot::hardware::Network;
use quadfrog::robot::{LinkStatus, Robot, Truth};
use quadfrog::session::automatic;
use quadfrog::session::operator_request::{OperatorCheck, OperatorRequest};
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::emulator::{Emulator, EmulatorFault, EmulatorHandle};
use quadfrog::sim::{SimConfig, Simulator};
use quadfrog::telemetry::Mode;
use quadfrog::trial::{Backend, ExperimentStage, Proposal, Task, TrialRecord, Verdict};

const TASK: Task = Task::Forward;
const TRIALS: u32 = 20;
/// Time without motion before a robot can be armed, with a margin.
const STILL: Duration = Duration::from_millis(1300);
/// Lateness of the control thread that is no fault here, ms: five robots share the machine.
const LATE_MS: f64 = 10.0;
/// Longest time in which neither the mode nor the stage of the study changes.
const PATIENCE: Duration = Duration::from_secs(180);

/// A robot that can be emulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Go1,
    #[cfg(feature = "go2")]
    Go2,
}

impl Kind {
    fn files(self) -> RobotFiles {
        let name = match self {
            Kind::Go1 => "go1",
            #[cfg(feature = "go2")]
            Kind::Go2 => "go2",
        };
        RobotFiles::embedded(name).unwrap()
    }

    fn description(self) -> RobotDescription {
        self.files().description().unwrap()
    }

    /// An emulated robot and the way to it; each Go2 has a domain of its own.
    fn emulated(self, config: &Config, seed: u64) -> (Emulator, Network) {
        let asked = match self {
            Kind::Go1 => Network::Go1(network(ANY_PORT)),
            #[cfg(feature = "go2")]
            Kind::Go2 => {
                let Some(Network::Go2(mut network)) = Network::read(&self.files()).unwrap() else { unreachable!() };
                (network.domain, network.interface) = (90 + seed as u16, "127.0.0.1".to_owned());
                Network::Go2(network)
            }
        };
        let emulator = Emulator::serve(&asked, ANY_PORT, &self.description(), &config.simulator, seed).unwrap();
        let found = emulator.local_address().map_or(asked, |address| Network::Go1(network(address)));
        (emulator, found)
    }
}

fn config(kind: Kind, late_ms: f64) -> Config {
    let mut config = Config::load_for(&kind.files(), None).unwrap();
    // As long as in the simulator: no person is beside the robot.
    config.control.countdown.hardware_s = config.control.countdown.simulator_s;
    // The test machine has other load: its delays would be faults at a robot.
    config.safety.failsafe.hardware_late_ms = late_ms;
    // The whole bounds, as in the simulator.
    config.safety.hop_envelope.start = 1.0;
    config.safety.failsafe.state_age_ms = (2.0 * late_ms).max(20.0) as u32;
    config.safety.failsafe.period_ticks = 1000;
    let delay_ms = (2.0 * late_ms).max(50.0);
    let failsafe = &mut config.safety.failsafe;
    (failsafe.delay_warn_ms, failsafe.delay_hold_ms, failsafe.delay_land_ms) = (delay_ms, delay_ms, delay_ms);
    config.safety.arming.state_age_ms = config.safety.failsafe.state_age_ms;
    config.safety.arming.late_share = 1.0;
    config.safety.consistency.clock_step_ms = 1000.0;
    config.safety.consistency.loss_share = 0.5;
    // The true displacement is taken in REVIEW.
    config.safety.failsafe.hardware_review_sits_down = false;
    config
}

fn options(kind: Kind, config: Config, network: Option<Network>, backend: Backend, seed: u32, trials: u32) -> Options {
    Options { network, seed, trials: Some(trials), ..Options::new(config, kind.description(), backend, TASK) }
}

/// An emulated robot in real time in its own thread.
struct LivingRobot {
    handle: EmulatorHandle,
    network: Network,
    ending: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl LivingRobot {
    fn new(kind: Kind, config: &Config, seed: u64) -> LivingRobot {
        let (mut emulator, network) = kind.emulated(config, seed);
        let handle = emulator.handle();
        let ending = Arc::new(AtomicBool::new(false));
        let flag = ending.clone();
        let thread = std::thread::spawn(move || {
            pace(Duration::from_millis(1), Duration::ZERO, |start| {
                emulator.step_at(start.planned_ns);
                if flag.load(Ordering::Acquire) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })
            .unwrap();
        });
        LivingRobot { handle, network, ending, thread: Some(thread) }
    }
}

impl Drop for LivingRobot {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

/// Result of a study.
#[derive(Debug)]
struct Outcome {
    best: f64,
    rows: Vec<TrialRecord>,
    /// True displacement of each trial, m.
    in_truth: BTreeMap<u32, f64>,
    link: LinkStatus,
    stops: u32,
}

/// An operator who follows the screen.
struct Operator {
    engine: EngineHandle,
    robot: EmulatorHandle,
    stage: Option<StageRecord>,
    proposal: Option<Proposal>,
    rows: BTreeMap<u32, TrialRecord>,
    /// True state at the approval of the trial.
    stood: Option<Truth>,
    in_truth: BTreeMap<u32, f64>,
    /// The mode in which something was wished last: once a mode is enough.
    wished_in: Option<(Mode, Option<ExperimentStage>, u32)>,
    stops: u32,
    /// A jump was refused because the robot does not stand as it should.
    sits_down: bool,
    stop_tested: bool,
    lies_since: Option<Instant>,
    /// The last request that was refused, and why.
    refused: String,
}

impl Operator {
    fn look(&mut self) -> (Mode, LinkStatus) {
        self.engine.send_heartbeat();
        while self.engine.next_tick().is_some() {}
        while let Some(stamped) = self.engine.next_record() {
            match stamped.record {
                Record::Stage(stage) => self.stage = Some(stage),
                Record::Proposal(proposal) => self.proposal = Some(proposal),
                Record::Trial(row) => drop(self.rows.insert(row.trial, row)),
                Record::Transition(change) if matches!(change.to, Mode::Damped | Mode::Fault) => {
                    self.stops += 1;
                    println!("{} -> {}: {}", change.from.name(), change.to.name(), change.cause);
                }
                Record::Request(command) if !command.accepted => {
                    self.sits_down |= command.request.starts_with("approve") && command.answer.contains("sit down");
                    println!("{}: {}", command.request, command.answer);
                    self.refused = format!("{}: {}", command.request, command.answer);
                }
                Record::Log(line) => println!("{}", line.message),
                _ => {}
            }
        }
        let snapshot = self.engine.snapshot();
        (snapshot.tick.mode, snapshot.counters.link.unwrap_or_default())
    }

    /// The next request of an operator; none to wait.
    fn act(&mut self, mode: Mode) -> Option<OperatorRequest> {
        let (stage, trial) = (self.stage.map(|stage| stage.stage), self.stage.map_or(0, |stage| stage.trial));
        match (mode, stage) {
            (Mode::Offline | Mode::Observe, _) => Some(OperatorRequest::TakeControl),
            (_, Some(ExperimentStage::Review)) if mode != Mode::Settle && mode != Mode::Jump => {
                let row = self.rows.get(&trial)?;
                if let (Some(from), Some(to)) = (self.stood.take(), self.robot.status().truth) {
                    let moved = from.world_from_body.inverse() * (to.position_world - from.position_world);
                    self.in_truth.insert(trial, moved.x);
                }
                Some(match row.suggested? {
                    // The parameters were not the cause: run the trial again.
                    Verdict::Void => OperatorRequest::Rerun { trial: None },
                    verdict => OperatorRequest::Judge(verdict),
                })
            }
            (Mode::Damped | Mode::Fault, Some(ExperimentStage::Proposed | ExperimentStage::Finished)) => {
                Some(OperatorRequest::Acknowledge)
            }
            (Mode::Disarmed, Some(ExperimentStage::Proposed)) => {
                if !self.stop_tested {
                    self.stop_tested = true;
                    self.engine.stop();
                    return None;
                }
                if self.lies_since.is_none_or(|since| since.elapsed() > STILL * 2) {
                    self.robot.apply(EmulatorFault::Place);
                    self.lies_since = Some(Instant::now());
                    for word in OperatorCheck::ALL {
                        self.engine.request(OperatorRequest::Confirm(word));
                    }
                }
                let still = self.lies_since.is_some_and(|since| since.elapsed() > STILL);
                still.then_some(OperatorRequest::Arm)
            }
            (Mode::Ready, Some(ExperimentStage::Proposed)) if std::mem::take(&mut self.sits_down) => {
                Some(OperatorRequest::SitDown)
            }
            (Mode::Ready, Some(ExperimentStage::Proposed)) => {
                let proposal = self.proposal.as_ref()?;
                self.stood = self.robot.status().truth;
                Some(OperatorRequest::Approve { trial: proposal.trial, revision: proposal.revision })
            }
            _ => None,
        }
    }

    fn run(&mut self) -> LinkStatus {
        let mut wished_at = Instant::now();
        let mut changed = (None, wished_at);
        loop {
            let (mode, link) = self.look();
            if self.stage.is_some_and(|stage| stage.stage == ExperimentStage::Finished) {
                return link;
            }
            let here = (mode, self.stage.map(|stage| stage.stage), self.stage.map_or(0, |stage| stage.trial));
            if changed.0 != Some(here) {
                changed = (Some(here), Instant::now());
            }
            assert!(changed.1.elapsed() < PATIENCE, "{here:?} for {PATIENCE:?}; refused last: {}", self.refused);
            // Once is enough, unless nothing comes of it.
            let wishes = self.wished_in != Some(here) || wished_at.elapsed() > Duration::from_secs(3);
            if wishes && let Some(wanted) = self.act(mode) {
                self.engine.request(wanted);
                wished_at = Instant::now();
                self.wished_in = Some(here);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// Runs a study on an emulated robot.
fn over_the_network(kind: Kind, seed: u32, trials: u32, late_ms: f64) -> Outcome {
    let config = config(kind, late_ms);
    let robot = LivingRobot::new(kind, &config, seed.into());
    let folder = tempfile::tempdir().unwrap();
    robot
        .network
        .take_over(&kind.description().lying_position, &AtomicBool::new(false), &mut |step| println!("{step}"))
        .unwrap();
    let mut options = options(kind, config, Some(robot.network.clone()), Backend::Hardware, seed, trials);
    options.folder = Some(folder.path().join("study"));
    let mut operator = Operator {
        engine: engine::start(options).unwrap(),
        robot: robot.handle.clone(),
        stage: None,
        proposal: None,
        rows: BTreeMap::default(),
        stood: None,
        in_truth: BTreeMap::default(),
        wished_in: None,
        stops: 0,
        sits_down: false,
        stop_tested: false,
        lies_since: None,
        refused: String::new(),
    };
    let link = operator.run();
    let accepted = operator.rows.values().filter(|row| row.verdict == Some(Verdict::Accept));
    let best = accepted.filter_map(|row| row.value).fold(0.0, f64::max);
    let rows = operator.rows.into_values().collect();
    operator.engine.shutdown();
    Outcome { best, rows, in_truth: operator.in_truth, link, stops: operator.stops }
}

/// Runs a study without threads, in simulated time.
fn in_simulated_time<R: Robot>(
    kind: Kind,
    backend: Backend,
    seed: u32,
    robot: impl FnOnce(&SimConfig) -> R,
) -> (f64, Vec<TrialRecord>) {
    let options = options(kind, config(kind, 0.0), None, backend, seed, TRIALS);
    let settings = options.config.settings(&options.robot, TASK, backend).unwrap();
    let mut life = open_experiment(&options, Durability::Buffered, "").unwrap();
    let mut rollout = Rollout::new(robot(&options.config.simulator), &settings);
    automatic::run(&mut life, &mut rollout, |_, _| {}).unwrap();
    (life.best().and_then(|row| row.value).unwrap_or(0.0), life.rows().cloned().collect())
}

/// The same study in the simulator, without a network.
fn in_the_simulator(kind: Kind, seed: u32) -> (f64, Vec<TrialRecord>) {
    let simulator = |config: &SimConfig| Simulator::new(&kind.description(), config).unwrap();
    in_simulated_time(kind, Backend::Simulator, seed, simulator)
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn print_outcome(seed: u32, outcome: &Outcome) {
    for row in &outcome.rows {
        let value = row.value.map_or_else(|| "     ".to_owned(), |value| format!("{value:.3}"));
        let truth = outcome.in_truth.get(&row.trial).copied().unwrap_or(f64::NAN);
        println!(
            "seed {seed} trial {:>2} {value} {:?}: {}; in truth {truth:.3} m, {:?}",
            row.trial, row.verdict, row.cause, row.measured
        );
    }
    println!("seed {seed}: best {:.3} m, {} stops, {:?}", outcome.best, outcome.stops, outcome.link);
}

/// Errors of the measured displacements of the accepted jumps, m.
fn measured_wrong_by(outcome: &Outcome) -> Vec<f64> {
    let accepted = outcome.rows.iter().filter(|row| row.verdict == Some(Verdict::Accept));
    accepted.filter_map(|row| Some((row.value? - outcome.in_truth.get(&row.trial)?).abs())).collect()
}

/// Twenty trials on each of five robots over loopback, stepped by the millisecond, compared with the simulator.
fn step_by_step(with_truth: bool) -> (Vec<f64>, Vec<f64>) {
    let mut bests = (Vec::new(), Vec::new());
    for seed in 0..5 {
        let robot = |config: &SimConfig| Lockstep { with_truth, ..Lockstep::new(config, seed.into()) };
        let backend = if with_truth { Backend::Simulator } else { Backend::Hardware };
        let (over, rows) = in_simulated_time(Kind::Go1, backend, seed, robot);
        let (alone, alone_rows) = in_the_simulator(Kind::Go1, seed);
        let row = |row: &TrialRecord| format!("{:.3} {}", row.value.unwrap_or(f64::NAN), row.cause);
        for (over, alone) in rows.iter().zip(&alone_rows) {
            println!("seed {seed} trial {:>2}: network {}; simulator {}", over.trial, row(over), row(alone));
        }
        bests.0.push(over);
        bests.1.push(alone);
    }
    bests
}

/// Effect of the link alone: with the true state available, only a millisecond of delay and the fixed point.
#[test]
fn the_link_takes_nothing_from_a_study() {
    let (network, simulator) = step_by_step(true);
    assert!(compare(&network, &simulator).abs() <= 0.1);
}

/// Link and estimator: the robot's sensors alone measure the jump.
#[test]
fn a_study_over_the_network_ends_as_one_in_the_simulator() {
    let (network, simulator) = step_by_step(false);
    assert!(compare(&network, &simulator).abs() <= 0.1);
}

/// Returns the difference of the medians, relative to the simulator's.
fn compare(network: &[f64], simulator: &[f64]) -> f64 {
    let (over, alone) = (median(network), median(simulator));
    println!("best of {TRIALS} trials, seeds 0-4: network {network:.3?} m, simulator {simulator:.3?} m");
    println!("medians: network {over:.3} m, simulator {alone:.3} m: {:+.1} %", (over / alone - 1.0) * 100.0);
    over / alone - 1.0
}

#[test]
fn three_trials_run_from_end_to_end() {
    three_trials(Kind::Go1);
}

#[cfg(feature = "go2")]
#[test]
fn three_trials_of_a_go2_run_from_end_to_end() {
    three_trials(Kind::Go2);
}

fn three_trials(kind: Kind) {
    let outcome = over_the_network(kind, 0, 3, 50.0);
    print_outcome(0, &outcome);
    let counted = outcome.rows.iter().filter(|row| matches!(row.verdict, Some(Verdict::Accept | Verdict::Fall)));
    assert_eq!(counted.count(), 3);
    assert!(outcome.link.received > 5_000, "{:?}", outcome.link);
}

#[test]
#[ignore = "takes three minutes in real time; .ci/run runs it"]
fn a_study_in_real_time_ends_as_one_in_the_simulator() {
    five_studies(Kind::Go1, 5);
}

#[cfg(feature = "go2")]
#[test]
#[ignore = "takes eight minutes in real time"]
fn a_study_of_a_go2_in_real_time_ends_as_one_in_the_simulator() {
    // A robot, its DDS and a console keep a core busy; with five of them on two cores no state is on time.
    five_studies(Kind::Go2, 2);
}

/// Twenty trials on each of five robots, `at_once` of them at a time: the median of the best jumps is the simulator's within 10 %.
fn five_studies(kind: Kind, at_once: usize) {
    let study = |&seed: &u32| std::thread::spawn(move || (seed, over_the_network(kind, seed, TRIALS, LATE_MS)));
    let outcomes = [0, 1, 2, 3, 4].chunks(at_once).flat_map(|seeds| {
        let studies: Vec<_> = seeds.iter().map(study).collect();
        studies.into_iter().map(|study| study.join().unwrap())
    });
    let outcomes: Vec<_> = outcomes.collect();
    for (seed, outcome) in &outcomes {
        print_outcome(*seed, outcome);
    }
    let errors: Vec<f64> = outcomes.iter().flat_map(|(_, outcome)| measured_wrong_by(outcome)).collect();
    let most = errors.iter().copied().fold(0.0, f64::max);
    println!("{} jumps measured: wrong by {:.4} m in the median, {most:.4} m at most", errors.len(), median(&errors));
    assert!(median(&errors) <= 0.03, "the measure is not what the robot did: {errors:.3?}");
    let network: Vec<f64> = outcomes.iter().map(|(_, outcome)| outcome.best).collect();
    let simulator: Vec<f64> = (0..5).map(|seed| in_the_simulator(kind, seed).0).collect();
    // Not worse; it may be better: these robots are not placed between trials, so the start states differ, and the
    // best of twenty different jumps is higher than that of twenty equal ones.
    assert!(compare(&network, &simulator) >= -0.1);
}
