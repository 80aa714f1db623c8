//! Samples of the charts: the last minute of telemetry, and a short trace of each trial.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use nalgebra::Vector3;
use quadfrog::robot::{JOINTS, PerLeg};
use quadfrog::telemetry::{Mode, Phase, Tick};

/// Samples that are kept: a minute at 200 a second.
const CAPACITY: usize = 12_000;
/// Samples of one trace: ten seconds at 200 a second.
const TRACE_CAPACITY: usize = 2_000;
/// Samples of all traces, 4.5 MB; where there are more, the trace farthest from the running trial goes first, except that of the
/// best trial.
const TRACES_CAPACITY: usize = 10_000;
/// Time between two samples of a thinned trace in its jump, and before and after it, ns.
const THINNED_JUMP_NS: u64 = 10_000_000;
pub const THINNED_NS: u64 = 50_000_000;
/// Time after which a state that does not change is none, ns.
const SILENT_NS: u64 = 100_000_000;
/// Time before the impulse at which the jump begins, s.
pub const BEFORE_IMPULSE_S: f32 = 0.3;

/// The part of one tick that the charts draw; single precision is finer than any screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartSample {
    /// Time since the engine started, ns.
    pub time_ns: u64,
    /// Phase of the jump.
    pub phase: Phase,
    /// The running trial.
    pub trial: Option<u32>,
    /// Whether the robot sends states: without them the values below are of an earlier time, or none at all.
    pub heard: bool,
    /// Time since the impulse began, s.
    pub trial_time_s: f32,
    /// Roll, rad.
    pub roll: f32,
    /// Pitch, rad.
    pub pitch: f32,
    /// Height of the trunk's origin over the world's zero, m.
    pub height: f32,
    /// From the planned start of the tick to its real start, ns.
    pub lateness_ns: u32,
    /// From its start to its end, ns.
    pub busy_ns: u32,
    /// Phase of the oscillator, rad.
    pub theta: f32,
    /// z of each foot in its leg frame, m.
    pub foot_z: PerLeg<f32>,
    /// Normal force at each foot's sensor, N.
    pub foot_force: PerLeg<f32>,
    /// Whether each foot is on the ground.
    pub contact: PerLeg<bool>,
    /// Yaw, rad; full turns count.
    pub yaw: f32,
    /// Position of the trunk's origin, world, x and y, m.
    pub position_world: [f32; 2],
    /// Velocity of the trunk's origin, world, m/s.
    pub velocity_world: [f32; 3],
    /// Angular velocity as the inertial unit measures it, body axes, rad/s.
    pub gyro_body: [f32; 3],
    /// Specific force as the inertial unit measures it, body axes, m/s^2.
    pub accel_body: [f32; 3],
    pub joints: JointSample,
}

/// The joints in a sample, FR FL RR RL, hip thigh calf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSample {
    /// Angles, rad.
    pub angle: [f32; JOINTS],
    /// Desired angles, rad; no number while no stiffness acts on them.
    pub commanded_angle: [f32; JOINTS],
    /// Torques as the motors estimate them, N m.
    pub torque: [f32; JOINTS],
    /// Torques that the command as sent demands at the measured angles and speeds, N m.
    pub commanded_torque: [f32; JOINTS],
    /// Speeds, rad/s.
    pub speed: [f32; JOINTS],
    /// Temperatures of the motors, degrees Celsius.
    pub temperature: [f32; JOINTS],
}

impl ChartSample {
    /// Whether no foot is down in a countdown: a simulator that places the robot has not loaded its feet yet.
    pub fn is_before_footing(&self) -> bool {
        self.trial.is_some() && self.trial_time_s < 0.0 && !self.contact.contains(&true)
    }
}

impl From<&Tick> for JointSample {
    fn from(tick: &Tick) -> JointSample {
        let (state, motor) = (&tick.state, &tick.command.motor);
        let single = |values: &[f64; JOINTS]| values.map(|value| value as f32);
        let stiff = |joint: usize| motor[joint].kp_joint > 0.0;
        JointSample {
            angle: single(&state.joint_position_rad),
            commanded_angle: std::array::from_fn(|joint| match stiff(joint) {
                true => motor[joint].position_rad as f32,
                false => f32::NAN,
            }),
            torque: single(&state.joint_torque_n_m),
            commanded_torque: std::array::from_fn(|joint| {
                motor[joint].torque_at(state.joint_position_rad[joint], state.joint_velocity_rad_s[joint]) as f32
            }),
            speed: single(&state.joint_velocity_rad_s),
            temperature: single(&state.motor_temperature_c),
        }
    }
}

impl From<&Tick> for ChartSample {
    fn from(tick: &Tick) -> ChartSample {
        let rpy = tick.estimate.roll_pitch_yaw;
        let (position, imu) = (tick.estimate.position_world, &tick.state.imu);
        let axes = |v: Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
        ChartSample {
            time_ns: tick.time_ns,
            phase: tick.phase,
            trial: tick.trial,
            heard: tick.mode != Mode::Offline,
            trial_time_s: tick.trial_time_s as f32,
            roll: rpy.x as f32,
            pitch: rpy.y as f32,
            height: position.z as f32,
            lateness_ns: tick.stages.lateness_ns,
            busy_ns: tick.stages.read_ns.saturating_add(tick.stages.decide_ns).saturating_add(tick.stages.write_ns),
            theta: tick.theta_rad as f32,
            foot_z: tick.estimate.foot_position_leg.map(|foot| foot.z as f32),
            foot_force: tick.state.foot_force_n.map(|force| force as f32),
            contact: tick.estimate.contact,
            yaw: rpy.z as f32,
            position_world: [position.x as f32, position.y as f32],
            velocity_world: axes(tick.estimate.velocity_world),
            gyro_body: axes(imu.gyro_body),
            accel_body: axes(imu.accel_body),
            joints: JointSample::from(tick),
        }
    }
}

/// The sample whose time within its trial is nearest.
pub fn at_trial_time(trace: &[ChartSample], trial_time_s: f32) -> Option<&ChartSample> {
    let distance = |sample: &&ChartSample| (sample.trial_time_s - trial_time_s).abs();
    trace.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// The newest samples, oldest first, and the trials' traces.
#[derive(Debug, Clone, Default)]
pub struct SignalHistory {
    samples: VecDeque<ChartSample>,
    /// Shared with frozen copies of this history.
    traces: BTreeMap<u32, Arc<Vec<ChartSample>>>,
    /// The newest traces that were read from the recording of a replay, as far as it goes: at most two.
    read: Vec<(u32, Arc<Vec<ChartSample>>)>,
    /// The trial whose trace is kept however old it is.
    kept: Option<u32>,
    /// The trial of the newest sample that has one.
    running: Option<u32>,
    /// The robot's clock, ms, and when the newest state arrived, ns; zeros before the first state.
    state: (u32, u64),
}

/// A trace with fewer samples, its ends among them; none where it has no more than that.
fn thinned(trace: &[ChartSample]) -> Option<Vec<ChartSample>> {
    let mut kept_ns = None;
    let (last, others) = trace.split_last()?;
    let kept = others.iter().filter(|sample| {
        let jumps = sample.phase != Phase::Stance || (-BEFORE_IMPULSE_S..=0.0).contains(&sample.trial_time_s);
        let step_ns = if jumps { THINNED_JUMP_NS } else { THINNED_NS };
        let keep = kept_ns.is_none_or(|kept_ns| sample.time_ns >= kept_ns + step_ns);
        if keep {
            kept_ns = Some(sample.time_ns);
        }
        keep
    });
    let thin: Vec<_> = kept.chain([last]).copied().collect();
    (thin.len() < trace.len()).then_some(thin)
}

impl SignalHistory {
    /// Appends one tick; `clocked`: every state has the time of the robot's clock. A tick older than the newest one (a replay was
    /// rewound) clears the samples first.
    pub fn push(&mut self, tick: &Tick, clocked: bool) {
        let mut sample = ChartSample::from(tick);
        let rewound = tick.time_ns < self.state.1;
        if tick.state.robot_time_ms != self.state.0 || rewound {
            self.state = (tick.state.robot_time_ms, tick.time_ns);
        }
        let recent = tick.time_ns - self.state.1 <= SILENT_NS;
        sample.heard &= match clocked {
            true => recent && self.state != (0, 0),
            // A recording without the robot's clock has zeros, and so has a simulated robot before its first step.
            false => recent || self.state.0 == 0,
        };
        if self.samples.back().is_some_and(|newest| newest.time_ns >= sample.time_ns) {
            self.samples.clear();
        }
        if self.samples.len() == CAPACITY {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
        if let Some(trial) = sample.trial {
            if self.running != Some(trial) {
                self.begin(trial);
            }
            let trace = Arc::make_mut(self.traces.entry(trial).or_default());
            // A trial that starts again (a cancelled countdown, a replay) replaces its trace.
            if trace
                .last()
                .is_some_and(|last| last.time_ns >= sample.time_ns || last.trial_time_s > sample.trial_time_s)
            {
                trace.clear();
            }
            if trace.len() < TRACE_CAPACITY {
                trace.push(sample);
            }
        }
    }

    /// Makes room for the trace of a trial: those of the others are thinned, and the farthest ones removed.
    fn begin(&mut self, trial: u32) {
        self.running = Some(trial);
        for (_, trace) in self.traces.iter_mut().filter(|(other, _)| **other != trial) {
            if let Some(thin) = thinned(trace) {
                *trace = Arc::new(thin);
            }
        }
        let mut samples: usize = self.traces.values().map(|trace| trace.len()).sum();
        while samples + TRACE_CAPACITY > TRACES_CAPACITY {
            let removable = self.traces.keys().copied().filter(|other| *other != trial && self.kept != Some(*other));
            let Some(farthest) = removable.max_by_key(|other| other.abs_diff(trial)) else { break };
            samples -= self.traces.remove(&farthest).map_or(0, |trace| trace.len());
        }
    }

    /// Adds the trace of a trial of an earlier session; one of this session stays.
    pub fn add_trace(&mut self, trial: u32, ticks: &[Tick]) {
        let mut earlier = SignalHistory::default();
        ticks.iter().for_each(|tick| earlier.push(tick, false));
        if let Some(trace) = earlier.traces.remove(&trial) {
            self.traces.entry(trial).or_insert(trace);
        }
    }

    /// Adds the trace of a trial as the recording of a replay holds it.
    pub fn read_trace(&mut self, trial: u32, ticks: &[Tick]) {
        self.read.retain(|(of, _)| *of != trial);
        if self.read.len() == 2 {
            self.read.remove(0);
        }
        self.read.push((trial, Arc::new(ticks.iter().map(ChartSample::from).collect())));
    }

    /// Keeps the trace of a trial, the best, however old it is.
    pub fn keep(&mut self, trial: Option<u32>) {
        self.kept = trial;
    }

    /// The samples of one trace.
    pub fn of_trace(trace: &[ChartSample]) -> SignalHistory {
        SignalHistory { samples: trace.iter().copied().collect(), ..SignalHistory::default() }
    }

    /// Clears the samples, not the traces: time has jumped.
    pub fn clear(&mut self) {
        self.samples.clear();
    }

    /// All samples, oldest first.
    pub fn samples(&self) -> impl DoubleEndedIterator<Item = &ChartSample> + '_ {
        self.samples.iter()
    }

    /// The samples of the last `window_ns`, oldest first.
    pub fn window(&self, window_ns: u64) -> impl Iterator<Item = &ChartSample> + '_ {
        let from = self.newest_ns().saturating_sub(window_ns);
        let start = self.samples.partition_point(|sample| sample.time_ns <= from && from > 0);
        self.samples.range(start..)
    }

    /// Whether the robot sends no state at the newest sample; none without a sample.
    pub fn is_silent(&self) -> Option<bool> {
        self.samples.back().map(|sample| !sample.heard)
    }

    /// Time of the newest sample, ns; 0 without any.
    pub fn newest_ns(&self) -> u64 {
        self.samples.back().map_or(0, |sample| sample.time_ns)
    }

    /// The sample nearest to a time.
    pub fn at(&self, time_ns: u64) -> Option<&ChartSample> {
        let after = self.samples.partition_point(|sample| sample.time_ns < time_ns);
        let before = after.checked_sub(1).and_then(|index| self.samples.get(index));
        let after = self.samples.get(after);
        [before, after].into_iter().flatten().min_by_key(|sample| sample.time_ns.abs_diff(time_ns))
    }

    /// The trace of a trial, countdown to end.
    pub fn trace(&self, trial: u32) -> Option<&[ChartSample]> {
        self.traces.get(&trial).map(|trace| trace.as_slice())
    }

    /// The trace of a trial, of a replay as far as it was recorded: the longer one where it was played in part and read.
    pub fn whole(&self, trial: u32) -> Option<&[ChartSample]> {
        let read = self.read.iter().filter(|(of, _)| *of == trial).map(|(_, trace)| trace);
        let end_ns = |trace: &&Arc<Vec<ChartSample>>| trace.last().map(|sample| sample.time_ns);
        self.traces.get(&trial).into_iter().chain(read).max_by_key(end_ns).map(|trace| trace.as_slice())
    }

    /// [`SignalHistory::whole`] of a trial that has reached its impulse.
    pub fn jump(&self, trial: u32) -> Option<&[ChartSample]> {
        self.whole(trial).filter(|trace| trace.last().is_some_and(|last| last.trial_time_s >= 0.0))
    }

    /// The trials that have a trace.
    pub fn traces(&self) -> impl Iterator<Item = u32> + '_ {
        self.traces.keys().copied()
    }
}
