//! Random sequences of faults against an emulated Go1, from arming to rest: whatever fails, the robot ends damped, landed
//! or refused, and never moves without a permit. `QUADFROG_SEQUENCES=1000` runs more sequences than the default;
//! `QUADFROG_SEED=17` begins at another one. Stepped by hand: a sequence repeats bit for bit.

use crate::cores::on_all_cores;
use crate::emulated;
use std::collections::BTreeMap;

use emulated::{EmulatedBench, emulated_on};
use quadfrog::robot::{JOINTS, joint_name};
use quadfrog::sim::emulator::{EmulatorFault, help};
use quadfrog::telemetry::{Command, Event, Mode, Permit, Tick, TrialEnd};
use quadfrog::trial::Backend;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

const SEQUENCES: u64 = 24;
/// Time in which faults begin: control is taken at 0, armed at 1.6 s, approved at about 5 s, landed before 9 s.
const FAULTS_UNTIL_MS: u64 = 9_000;
/// Time after which the faults have ended and the robot must have come to rest: a landing, a sit-down and the limits of
/// waiting in between.
const AT_REST_MS: u64 = 25_000;

/// A fault of the robot, its network, the control thread or the operator.
#[derive(Debug, Clone)]
#[allow(dead_code, reason = "the line is for the message of a failure")]
enum Injected {
    Emulated {
        line: String,
        fault: EmulatorFault,
    },
    /// The control thread is late by this time in one tick, ms.
    Late(u64),
    /// The operator's console sends no heartbeat any more.
    OperatorSilent,
    OperatorBack,
    /// The session takes no events.
    EventsLost,
    Stop,
    /// A command that the operator did not permit now: its permit is of another mode, or old.
    StaleArm,
    StaleApproval,
}

/// A random number in `range` for an operand of this unit.
fn operand(unit: &str, random: &mut ChaCha8Rng) -> String {
    let mut number = |low: f64, high: f64| {
        let share = f64::from(random.next_u32()) / f64::from(u32::MAX);
        format!("{:.2}", low + (high - low) * share)
    };
    match unit {
        "PERCENT" => number(0.0, 100.0),
        "MS" => number(0.0, 60.0),
        "CELSIUS" => number(60.0, 100.0),
        "RAD" => number(-1.5, 1.5),
        "RAD/S" => number(-90.0, 90.0),
        "NM" => number(-60.0, 60.0),
        "N" => number(0.0, 100.0),
        "MS/S" => number(-30.0, 30.0),
        "BUTTONS" => ["none", "L2+B", "L2", "R1+up"][random.next_u32() as usize % 4].to_owned(),
        "JOINT" => joint_name(random.next_u32() as usize % JOINTS),
        _ => unit.to_owned(),
    }
}

/// Any fault of the emulator, with random operands: one line of its help.
fn emulated(random: &mut ChaCha8Rng) -> Injected {
    let help = help();
    let lines: Vec<&str> = help.lines().collect();
    let line = lines[random.next_u32() as usize % lines.len()];
    let usage = line.trim_start().split("  ").next().unwrap();
    let text: Vec<String> = usage.split_whitespace().map(|word| operand(word, random)).collect();
    let text = text.join(" ");
    let fault = text.parse().unwrap_or_else(|error| panic!("`{text}` of the emulator's help: {error}"));
    Injected::Emulated { line: text, fault }
}

fn injected(random: &mut ChaCha8Rng) -> Injected {
    match random.next_u32() % 16 {
        0 => Injected::Late(u64::from(random.next_u32() % 30)),
        1 => Injected::OperatorSilent,
        2 => Injected::OperatorBack,
        3 => Injected::EventsLost,
        4 => Injected::Stop,
        5 => Injected::StaleArm,
        6 => Injected::StaleApproval,
        _ => emulated(random),
    }
}

/// Between one and five faults with their times, ms. In one of two sequences most of them occur around the jump.
fn sequence(seed: u64) -> Vec<(u64, Injected)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let [from, until] = if random.next_u32().is_multiple_of(2) { [5_000, 8_000] } else { [0, FAULTS_UNTIL_MS] };
    let count = 1 + random.next_u32() % 5;
    let mut faults: Vec<_> =
        (0..count).map(|_| (from + u64::from(random.next_u32()) % (until - from), injected(&mut random))).collect();
    faults.sort_by_key(|(time_ms, _)| *time_ms);
    faults
}

struct Sequence {
    bench: EmulatedBench,
    silent: bool,
    /// The first permit of the run; stale after any change of mode.
    old_permit: Permit,
    /// Course of the sequence, for the message of a failure.
    log: Vec<String>,
}

impl Sequence {
    fn new(seed: u64) -> Sequence {
        let bench = emulated_on(Backend::Hardware, seed, |_| {});
        let old_permit = bench.permit();
        Sequence { bench, silent: false, old_permit, log: Vec::new() }
    }

    fn time_ms(&self) -> u64 {
        self.bench.inputs.time_ns / 1_000_000
    }

    /// One tick, with the properties that hold in every tick.
    fn tick(&mut self, command: Option<Command>, fresh: bool) -> Tick {
        let before = self.bench.cycle.mode();
        self.bench.inputs.operator_silent_ms = if self.silent { self.bench.inputs.operator_silent_ms + 1 } else { 0 };
        let events = self.bench.events.len();
        let tick = self.bench.tick(command);
        self.bench.inputs.lateness_ns = 0;
        let now = tick.mode;
        for event in &self.bench.events[events..] {
            if !matches!(event, Event::Refused { .. }) {
                self.log.push(format!("{} ms: {event:?}", self.bench.inputs.time_ns / 1_000_000));
            }
        }
        if before != now && now == Mode::StandUp {
            assert!(matches!(command, Some(Command::Arm(_))) && fresh, "{before:?} -> {now:?} without a permit");
        }
        if before != now && now == Mode::Countdown {
            assert!(matches!(command, Some(Command::RunTrial(..))) && fresh, "{before:?} -> {now:?} without a permit");
        }
        assert!(
            now == before || !now.energised() || before.energised() || now == Mode::StandUp,
            "{before:?} -> {now:?}"
        );
        if self.bench.inputs.stop {
            assert!(!now.energised(), "STOP left {now:?}");
        }
        if matches!(now, Mode::Disarmed | Mode::Damped | Mode::Fault) {
            assert!(self.bench.damps(&tick), "{now:?} does not damp: {:?}", tick.command);
        }
        for (joint, motor) in tick.command.motor.iter().enumerate() {
            let numbers = [motor.position_rad, motor.velocity_rad_s, motor.kp_joint, motor.kd_joint, motor.torque_n_m];
            assert!(numbers.iter().all(|number| number.is_finite()), "{motor:?}");
            let most = self.bench.settings.max_torque[joint];
            assert!(motor.torque_n_m.abs() <= most + 1e-9, "{} at {} N m", joint_name(joint), motor.torque_n_m);
        }
        tick
    }

    fn inject(&mut self, fault: &Injected) {
        self.log.push(format!("{} ms: {fault:?}", self.time_ms()));
        match fault {
            Injected::Emulated { fault, .. } => self.bench.robot.emulator.apply(*fault),
            Injected::Late(ms) => self.bench.inputs.lateness_ns = ms * 1_000_000,
            Injected::OperatorSilent => self.silent = true,
            Injected::OperatorBack => self.silent = false,
            Injected::EventsLost => self.bench.inputs.events_lost = true,
            Injected::Stop => {
                self.bench.inputs.stop = true;
                self.tick(None, false);
                self.bench.inputs.stop = false;
            }
            Injected::StaleArm => _ = self.tick(Some(Command::Arm(self.old_permit)), false),
            Injected::StaleApproval => {
                let approval = Command::RunTrial(self.bench.spec(), self.old_permit);
                _ = self.tick(Some(approval), false);
            }
        }
    }

    /// An operator who takes control, arms at 1.6 s and approves 0.5 s after the robot stands, once each.
    fn next_command(&self, ready_since_ms: u64, armed: bool, approved: bool) -> Option<Command> {
        let time_ms = self.time_ms();
        match self.bench.cycle.mode() {
            Mode::Observe if time_ms < 1_000 => Some(Command::TakeControl),
            Mode::Disarmed if time_ms >= 1_600 && !armed => Some(self.bench.arm()),
            Mode::Ready if time_ms >= ready_since_ms + 500 && !approved => Some(self.bench.approved()),
            Mode::Review => Some(Command::EndReview),
            _ => None,
        }
    }

    /// Runs the sequence to rest; returns how it ended.
    fn run(&mut self, faults: &[(u64, Injected)]) -> &'static str {
        let (mut armed, mut approved, mut ready_since_ms) = (false, false, u64::MAX / 2);
        let mut waiting = faults.iter().peekable();
        while self.time_ms() < AT_REST_MS {
            while let Some((_, fault)) = waiting.next_if(|(time_ms, _)| *time_ms <= self.time_ms()) {
                self.inject(fault);
            }
            if self.time_ms() == FAULTS_UNTIL_MS {
                self.inject(&Injected::Emulated { line: "clear".to_owned(), fault: EmulatorFault::Clear });
                self.inject(&Injected::OperatorBack);
                self.bench.inputs.events_lost = false;
            }
            let command = self.next_command(ready_since_ms, armed, approved);
            armed |= matches!(command, Some(Command::Arm(_)));
            approved |= matches!(command, Some(Command::RunTrial(..)));
            let tick = self.tick(command, true);
            if tick.mode != Mode::Ready {
                ready_since_ms = u64::MAX / 2;
            } else if ready_since_ms > self.time_ms() {
                ready_since_ms = self.time_ms();
            }
        }
        let settled = self.bench.ends().contains(&TrialEnd::Settled);
        match self.bench.cycle.mode() {
            Mode::Fault | Mode::Damped => "damped",
            Mode::Ready | Mode::Disarmed if settled => "landed",
            Mode::Ready if !self.bench.ends().is_empty() || approved => "refused or cancelled, stands",
            Mode::Disarmed if armed => "sat down, or refused",
            Mode::Offline | Mode::Observe | Mode::Disarmed => "refused",
            mode => panic!("not at rest but {mode:?}"),
        }
    }
}

#[test]
fn random_faults_end_damped_landed_or_refused() {
    let number = |name: &str, default| std::env::var(name).map_or(default, |text| text.parse().expect(name));
    let first = number("QUADFROG_SEED", 0);
    let last = first + number("QUADFROG_SEQUENCES", SEQUENCES);
    let seeds: Vec<u64> = (first..last).collect();
    let ended = on_all_cores(&seeds, |seed| {
        let faults = sequence(*seed);
        let mut sequence = Sequence::new(*seed);
        let run = std::panic::AssertUnwindSafe(|| sequence.run(&faults));
        std::panic::catch_unwind(run).unwrap_or_else(|cause| {
            eprintln!("QUADFROG_SEED={seed}:\n{}", sequence.log.join("\n"));
            std::panic::resume_unwind(cause)
        })
    });
    let mut ends = BTreeMap::<_, u64>::new();
    ended.iter().for_each(|end| *ends.entry(*end).or_default() += 1);
    println!("{} sequences: {ends:?}", last - first);
    assert!(ends.contains_key("damped") && ends.contains_key("landed") || last - first < SEQUENCES, "{ends:?}");
}
