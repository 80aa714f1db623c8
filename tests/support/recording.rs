//! Arbitrary ticks and records for the tests of recordings, and a realistic session.
#![allow(dead_code, reason = "each test uses its own part")]

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use proptest::prelude::*;
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::*;
use quadfrog::recording::writer::Writer;
use quadfrog::robot::{Battery, Imu, JointCommand, LinkStatus, MotorCommand, RobotState, Truth};
use quadfrog::telemetry::{ArmingCheck, ArmingCheckState, Counters, Estimate, Mode, Phase, Tick, TickDurations};
use quadfrog::trial::*;

/// Log time of engine time 0 in these tests: 2026-11-21 00:00 UTC.
pub const START_UTC_NS: u64 = 1_795_219_200_000_000_000;

pub const MS: u64 = 1_000_000;

/// Values drawn from words that proptest chose.
#[derive(Debug)]
struct Draw {
    words: std::vec::IntoIter<u64>,
    text: String,
    /// Whether numbers have single precision, as in ticks.
    single: bool,
}

/// Returns the nearest number of single precision.
pub fn single(number: f64) -> f64 {
    f64::from(number as f32)
}

impl Draw {
    fn word(&mut self) -> u64 {
        self.words.next().expect("enough words were drawn")
    }

    /// Any bit pattern; the awkward ones often.
    fn number(&mut self) -> f64 {
        let word = self.word();
        match word % 16 {
            0 => 0.0,
            1 => -0.0,
            4.. if self.single => single(f64::from(f32::from_bits(word as u32))),
            2 => f64::from_bits(0x7ff8_0000_0000_0000 | word >> 13),
            3 => f64::NEG_INFINITY,
            4 => f64::from_bits(1),
            5 => f64::MAX,
            _ => f64::from_bits(word),
        }
    }

    fn numbers<const N: usize>(&mut self) -> [f64; N] {
        std::array::from_fn(|_| self.number())
    }

    fn yes(&mut self) -> bool {
        self.word() % 2 == 1
    }

    fn vector(&mut self) -> Vector3<f64> {
        self.numbers::<3>().into()
    }

    fn rotation(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::new_unchecked(Quaternion::from(self.numbers::<4>()))
    }

    fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.word() as usize % all.len()]
    }

    fn option<T>(&mut self, value: impl FnOnce(&mut Draw) -> T) -> Option<T> {
        let value = value(self);
        self.yes().then_some(value)
    }

    fn several<T>(&mut self, mut value: impl FnMut(&mut Draw) -> T) -> Vec<T> {
        (0..self.word() % 4).map(|_| value(self)).collect()
    }

    /// Some characters of the text that proptest chose, from anywhere in it.
    fn string(&mut self) -> String {
        let skip = self.word() as usize % (self.text.chars().count() + 1);
        self.text.chars().skip(skip).collect()
    }

    fn tick(&mut self) -> Tick {
        self.single = true;
        let tick = self.any_tick();
        self.single = false;
        tick
    }

    fn any_tick(&mut self) -> Tick {
        Tick {
            number: self.word(),
            time_ns: self.word() >> 2,
            mode: self.one_of(Mode::ALL),
            phase: self.one_of(Phase::ALL),
            trial: self.option(|d| d.word() as u32),
            trial_time_s: self.number(),
            theta_rad: self.number(),
            state: RobotState {
                robot_time_ms: self.word() as u32,
                joint_position_rad: self.numbers(),
                joint_velocity_rad_s: self.numbers(),
                joint_torque_n_m: self.numbers(),
                imu: Imu { world_from_body: self.rotation(), gyro_body: self.vector(), accel_body: self.vector() },
                foot_force_n: self.numbers(),
                motor_temperature_c: self.numbers(),
                motor_enabled: std::array::from_fn(|_| self.yes()),
                battery: self.option(|d| Battery {
                    charge_percent: d.number(),
                    voltage_v: d.number(),
                    current_a: d.number(),
                    cell_v: d.numbers(),
                }),
                truth: self.option(|d| Truth {
                    position_world: d.vector(),
                    velocity_world: d.vector(),
                    world_from_body: d.rotation(),
                    angular_velocity_body: d.vector(),
                    foot_contact: std::array::from_fn(|_| d.yes()),
                    foot_force_world: std::array::from_fn(|_| d.vector()),
                    body_contact: d.yes(),
                }),
                // Not recorded.
                remote: None,
            },
            estimate: Estimate {
                position_world: self.vector(),
                velocity_world: self.vector(),
                world_from_body: self.rotation(),
                angular_velocity_body: self.vector(),
                roll_pitch_yaw: self.vector(),
                contact: std::array::from_fn(|_| self.yes()),
                foot_position_leg: std::array::from_fn(|_| self.vector()),
            },
            torque_demanded: self.numbers(),
            command: JointCommand {
                motor: std::array::from_fn(|_| MotorCommand {
                    position_rad: self.number(),
                    velocity_rad_s: self.number(),
                    kp_joint: self.number(),
                    kd_joint: self.number(),
                    torque_n_m: self.number(),
                }),
            },
            limited: self.word() as u16,
            stages: TickDurations {
                lateness_ns: self.word() as u32,
                read_ns: self.word() as u32,
                decide_ns: self.word() as u32,
                write_ns: self.word() as u32,
            },
        }
    }

    fn link(&mut self) -> LinkStatus {
        LinkStatus {
            received: self.word(),
            lost: self.word(),
            out_of_order: self.word(),
            duplicate: self.word(),
            corrupt: self.word(),
            wrong_length: self.word(),
            foreign: self.word(),
            reboots: self.word(),
            sent: self.word(),
            send_errors: self.word(),
            state_age_ms: self.word() as u32,
            rate_hz: self.word() as u32,
            recent_received: self.word() as u32,
            recent_lost: self.word() as u32,
            recent_corrupt: self.word() as u32,
            foreign_commands: self.word(),
            // Not recorded.
            older_by_ms: 0,
        }
    }

    fn expected(&mut self) -> ExpectedResult {
        ExpectedResult {
            value: self.number(),
            deviation: self.number(),
            p_stand: self.number(),
            simulated_least: self.option(Draw::number),
            simulated_most: self.option(Draw::number),
            advises_to_stop: self.yes(),
        }
    }

    fn risk(&mut self) -> Option<FallRisk> {
        self.option(|d| FallRisk {
            nearest_fall: d.option(Draw::number),
            nearest_fall_trial: d.option(|d| d.word() as u32),
            falls: d.word() as u32,
            neighbours: d.word() as u32,
        })
    }

    fn bounds(&mut self) -> ParameterInfo {
        ParameterInfo { name: self.string(), unit: self.string(), low: self.number(), high: self.number() }
    }

    fn proposed(&mut self) -> ProposedParameter {
        ProposedParameter { name: self.string(), value: self.number(), proposed: self.number() }
    }

    fn measured(&mut self) -> MeasuredJump {
        MeasuredJump {
            dx_m: self.number(),
            dy_m: self.number(),
            dyaw_rad: self.number(),
            apex_m: self.number(),
            air_s: self.number(),
            end_s: self.number(),
            measured_value: self.option(Draw::number),
            flights: self.word() as u32,
            touchdown: self.option(Draw::displacement),
            first_landing: self.option(Draw::displacement),
            jumps: self.several(Draw::jump_row),
        }
    }

    fn displacement(&mut self) -> Displacement {
        Displacement { time_s: self.number(), dx_m: self.number(), dy_m: self.number(), dyaw_rad: self.number() }
    }

    fn jump_row(&mut self) -> JumpRow {
        JumpRow {
            time_s: self.number(),
            x_m: self.number(),
            y_m: self.number(),
            yaw_rad: self.number(),
            tilt_rad: self.number(),
            rise_m: self.number(),
            air_s: self.number(),
            value: self.number(),
        }
    }

    fn record(&mut self, kind: usize) -> Record {
        match kind {
            0 => Record::Session(SessionInfo {
                version: self.string(),
                backend: self.option(|d| d.one_of(&[Backend::Simulator, Backend::Hardware])),
                robot: self.string(),
                task: self.option(|d| d.one_of(&Task::ALL)),
                unit: self.string(),
                sampler: self.option(|d| d.one_of(SamplerKind::ALL)),
                seed: self.word(),
                budget: self.word() as u32,
                parameters: self.several(Draw::bounds),
                study: self.string(),
                recording: self.string(),
                started: self.string(),
                observe: self.yes(),
                commit: self.string(),
                host: self.string(),
                operator: self.string(),
                gains: self.several(Draw::bounds),
                approve: self.one_of(&Approval::ALL),
                limits: HealthLimits {
                    state_age_ms: self.word() as u32,
                    loss_share: self.number(),
                    motor_c: self.number(),
                    battery_percent: self.number(),
                    late_share: self.number(),
                    late_ms: self.number(),
                },
                configured_gains: self.several(|d| (d.string(), d.number())).into(),
            }),
            1 => Record::Transition(Transition {
                from: self.one_of(Mode::ALL),
                to: self.one_of(Mode::ALL),
                cause: self.string(),
            }),
            2 => Record::Stage(StageRecord {
                stage: self.one_of(&ExperimentStage::ALL),
                trial: self.word() as u32,
                can_undo: self.yes(),
                jumps: self.word() as u32,
            }),
            3 => Record::Proposal(Proposal {
                trial: self.word() as u32,
                revision: self.word() as u32,
                source: self.one_of(&ProposalSource::ALL),
                parent: self.option(|d| d.word() as u32),
                parameters: self.several(Draw::proposed),
                risk: self.risk(),
                expected: self.option(Draw::expected),
                gains: self.several(Draw::proposed),
                repeat: self.word() as u32,
                repeats: self.word() as u32,
            }),
            4 => Record::Trial(TrialRecord {
                trial: self.word() as u32,
                source: self.one_of(&ProposalSource::ALL),
                parent: self.option(|d| d.word() as u32),
                parameters: self.several(|d| (d.string(), d.number())).into(),
                measured: self.option(Draw::measured),
                value: self.option(Draw::number),
                hand_value: self.option(Draw::number),
                suggested: self.option(|d| d.one_of(&Verdict::ALL)),
                cause: self.string(),
                verdict: self.option(|d| d.one_of(&Verdict::ALL)),
                judged_by: self.option(|d| d.one_of(&JudgedBy::ALL)),
                note: self.string(),
                risk: self.risk(),
                expected: self.option(Draw::expected),
                gains: self.several(|d| (d.string(), d.number())).into(),
                seed: self.option(Draw::word),
                proposed: self.several(|d| (d.string(), d.number())).into(),
                ranges: self.several(|d| DrawnRange { name: d.string(), low: d.number(), high: d.number() }),
                repeats: self.several(|d| RepeatRecord {
                    seed: d.word(),
                    verdict: d.option(|d| d.one_of(&Verdict::ALL)),
                    judged_by: d.option(|d| d.one_of(&JudgedBy::ALL)),
                    value: d.option(Draw::number),
                    cause: d.string(),
                    measured: d.option(Draw::measured),
                }),
            }),
            5 => Record::Request(RequestRecord { request: self.string(), accepted: self.yes(), answer: self.string() }),
            6 => Record::Counters(Counters {
                late_ticks: self.word(),
                worst_lateness_ns: self.word(),
                ticks_not_recorded: self.word(),
                ticks_not_shown: self.word(),
                commands_refused: self.word(),
                state_age_ms: self.word() as u32,
                link: self.option(Draw::link),
            }),
            7 => Record::Log(LogRecord {
                level: self.one_of(&[LogLevel::Info, LogLevel::Warning, LogLevel::Error]),
                source: self.string(),
                message: self.string(),
            }),
            8 => Record::ArmingChecks(self.several(|d| ArmingCheckRecord {
                check: d.one_of(ArmingCheck::ALL),
                found: d.string(),
                needed: d.string(),
                state: d.one_of(ArmingCheckState::ALL),
            })),
            9 => Record::FaultTicks(vec![self.tick(), self.tick()]),
            10 => Record::Search(SearchStatus {
                budget: self.word() as u32,
                counted: self.word() as u32,
                parameters: self.several(|d| SearchedParameter {
                    name: d.string(),
                    low: d.number(),
                    high: d.number(),
                    least: d.number(),
                    most: d.number(),
                    fixed: d.option(|d| FixedParameter { value: d.number(), trials: d.word() as u32 }),
                }),
                confirming: self.option(|d| d.word() as u32),
                hop_share: self.option(|d| d.number()),
                queue: self.several(|d| QueuedPoint {
                    trial: d.word() as u32,
                    source: d.one_of(&ProposalSource::ALL),
                    parent: d.option(|d| d.word() as u32),
                    parameters: d.several(|d| (d.string(), d.number())).into(),
                    gains: d.several(|d| (d.string(), d.number())).into(),
                }),
            }),
            11 => Record::Insight(ProposalInsight {
                trial: self.word() as u32,
                parameters: self.several(|d| ParameterInsight {
                    name: d.string(),
                    proposed: d.number(),
                    importance: d.option(Draw::number),
                    at: d.several(Draw::number),
                    good: d.several(Draw::number),
                    bad: d.several(Draw::number),
                }),
                predicted: self.several(|d| PredictedTrial {
                    trial: d.word() as u32,
                    value: d.number(),
                    deviation: d.number(),
                }),
                best: self.option(|d| d.word() as u32),
                simulator: self.option(|d| SimulatorComparison {
                    ratio: d.number(),
                    ratio_deviation: d.number(),
                    bias: d.number(),
                    bias_deviation: d.number(),
                    worlds: d.several(|d| WorldResemblance { name: d.string(), weight: d.number() }),
                    contradicted: d.yes(),
                }),
            }),
            _ => Record::Points(self.several(|d| PointRecord {
                parameters: d.several(|d| (d.string(), d.number())).into(),
                trials: d.several(|d| d.word() as u32),
                without_fall: d.word() as u32,
                mean: d.number(),
                deviation: d.option(Draw::number),
                contender: d.yes(),
                confidence: d.option(Draw::number),
            })),
        }
    }
}

fn draw(words: usize) -> impl Strategy<Value = Draw> {
    (prop::collection::vec(any::<u64>(), words), any::<String>()).prop_map(|(words, text)| Draw {
        words: words.into_iter(),
        text,
        single: false,
    })
}

pub fn any_tick() -> impl Strategy<Value = Tick> {
    draw(400).prop_map(|mut draw| draw.tick())
}

pub fn any_record() -> impl Strategy<Value = Record> {
    (0..13_usize, draw(800)).prop_map(|(kind, mut draw)| draw.record(kind))
}

/// Returns the session of a study in the simulator.
pub fn session() -> SessionInfo {
    let parameter =
        |name: &str, unit: &str, low, high| ParameterInfo { name: name.into(), unit: unit.into(), low, high };
    SessionInfo {
        version: "0.1.0".into(),
        backend: Some(Backend::Simulator),
        robot: "go1".into(),
        task: Some(Task::Forward),
        unit: "m".into(),
        sampler: Some(SamplerKind::Tpe),
        seed: 7,
        budget: 20,
        parameters: vec![
            parameter("f0", "Hz", 0.75, 1.75),
            parameter("Fx", "N", 0.0, 150.0),
            parameter("Fz", "N", 150.0, 350.0),
        ],
        study: "study.log".into(),
        recording: "session.mcap".into(),
        started: "2026-11-21T00:00:00Z".into(),
        observe: false,
        gains: vec![parameter("kp", "N/m", 100.0, 1000.0)],
        approve: Approval::Each,
        limits: HealthLimits::default(),
        commit: "0123456789abcdef".into(),
        host: "lab".into(),
        operator: "anna".into(),
        configured_gains: Vec::new().into(),
    }
}

/// Returns tick `number` of a robot that moves smoothly, with noise in every number, like a simulator's.
pub fn moving_tick(number: u64) -> Tick {
    let time = number as f64 * 1e-3;
    let mut state = number.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut noise = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64 * 1e-3
    };
    let mut wave = |phase: f64| single((3.0 * time + phase).sin() + noise());
    let mut vector = |phase: f64| Vector3::new(wave(phase), wave(phase + 1.0), wave(phase + 2.0));
    let orientation = UnitQuaternion::from_scaled_axis(vector(0.1) * 0.1).into_inner().coords.map(single);
    let orientation = UnitQuaternion::new_unchecked(orientation.into());
    let truth = Truth {
        position_world: vector(0.2),
        velocity_world: vector(0.3),
        world_from_body: orientation,
        angular_velocity_body: vector(0.4),
        foot_contact: [true, false, true, false],
        foot_force_world: std::array::from_fn(|leg| (vector(leg as f64) * 30.0).map(single)),
        body_contact: false,
    };
    let estimate = Estimate {
        position_world: vector(0.5),
        velocity_world: vector(0.6),
        world_from_body: orientation,
        angular_velocity_body: vector(0.7),
        roll_pitch_yaw: vector(0.8),
        contact: truth.foot_contact,
        foot_position_leg: std::array::from_fn(|leg| vector(leg as f64)),
    };
    let imu = Imu { world_from_body: orientation, gyro_body: vector(0.9), accel_body: vector(1.0) };
    let mut joints = |phase: f64| std::array::from_fn(|joint| wave(phase + joint as f64));
    let torque: [f64; 12] = joints(0.0);
    Tick {
        number,
        time_ns: number * MS,
        mode: Mode::Ready,
        phase: Phase::Stance,
        state: RobotState {
            robot_time_ms: number as u32,
            joint_position_rad: joints(1.1),
            joint_velocity_rad_s: joints(1.2),
            joint_torque_n_m: joints(1.3),
            imu,
            foot_force_n: [wave(1.0), wave(2.0), wave(3.0), wave(4.0)],
            motor_temperature_c: [35.0; 12],
            motor_enabled: [true; 12],
            battery: None,
            truth: Some(truth),
            remote: None,
        },
        estimate,
        torque_demanded: torque,
        command: JointCommand::torques(&torque),
        stages: TickDurations { lateness_ns: 900, read_ns: 1_200, decide_ns: 2_500, write_ns: 20_000 },
        ..Tick::default()
    }
}

/// Returns the ticks and records of a study: trials of 1 s from 1 s on, every 2 s; the records are in the order of time.
pub fn study(seconds: u64) -> (Vec<Tick>, Vec<Stamped>) {
    let mut ticks: Vec<_> = (0..seconds * 1000).map(moving_tick).collect();
    let mut records = Vec::new();
    for (trial, start) in (0_u32..).zip((1000..seconds * 1000).step_by(2000)) {
        for tick in ticks.iter_mut().skip(start as usize).take(1000) {
            (tick.trial, tick.mode) = (Some(trial), Mode::Jump);
        }
        let mut add = |ms: u64, record| records.push(Stamped { time_ns: ms * MS, record });
        let stage = |stage| Record::Stage(StageRecord { stage, trial, can_undo: trial > 0, jumps: 0 });
        let row = |verdict: Option<Verdict>| {
            Record::Trial(TrialRecord {
                trial,
                parameters: vec![("f0".into(), 1.25), ("Fx".into(), 100.0 + f64::from(trial)), ("Fz".into(), 250.0)]
                    .into(),
                value: verdict.map(|_| 0.1 * f64::from(trial)),
                verdict,
                ..TrialRecord::default()
            })
        };
        add(start - 500, stage(ExperimentStage::Proposed));
        let parameters = vec![ProposedParameter { name: "Fx".into(), value: 100.0, proposed: 100.0 }];
        add(start - 500, Record::Proposal(Proposal { trial, parameters, ..Proposal::default() }));
        add(start, stage(ExperimentStage::Running));
        add(start, row(None));
        add(start + 100, Record::Counters(Counters { late_ticks: u64::from(trial), ..Counters::default() }));
        if start + 999 < seconds * 1000 {
            add(start + 999, row(Some(Verdict::Accept)));
        }
    }
    (ticks, records)
}

/// Both in the order of time; a record stands before a tick of the same time.
pub fn in_order(ticks: &[Tick], records: &[Stamped]) -> Vec<Played> {
    let mut all: Vec<_> = records.iter().cloned().map(Played::Record).collect();
    all.extend(ticks.iter().copied().map(Box::new).map(Played::Tick));
    all.sort_by_key(Played::time_ns);
    all
}

/// Writes everything to `path` in the given order, and finishes the file.
pub fn write(path: &Path, everything: &[Played]) {
    let mut writer = Writer::create(path, &session(), START_UTC_NS, &[]).unwrap();
    write_all(&mut writer, everything);
    assert_eq!(writer.finish().unwrap(), path);
}

pub fn write_all(writer: &mut Writer, everything: &[Played]) {
    for played in everything {
        match played {
            Played::Tick(tick) => writer.tick(tick).unwrap(),
            Played::Record(stamped) => writer.record(stamped).unwrap(),
        }
    }
}

pub fn play(path: &Path) -> Vec<Played> {
    let mut player = Player::open(path).unwrap_or_else(|error| panic!("{error}"));
    let first = player.next();
    assert_eq!(first, Some(Played::Record(Stamped { time_ns: 0, record: Record::Session(session()) })));
    let rest = player.by_ref().collect();
    assert_eq!(player.damage(), None);
    rest
}

/// Asserts that both are the same, bit for bit but for the payload of a NaN. `Debug` shows every field, the sign of zero
/// and as many digits as tell two numbers apart; `==` would call NaN unlike itself and 0.0 like -0.0.
pub fn assert_same<T: std::fmt::Debug>(found: &[T], expected: &[T]) {
    assert_eq!(found.len(), expected.len(), "another number of ticks and records");
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        let (found, expected) = (format!("{found:?}"), format!("{expected:?}"));
        assert!(found == expected, "number {index} differs\n   found: {found}\nexpected: {expected}");
    }
}
