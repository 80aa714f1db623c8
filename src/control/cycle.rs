//! One control tick: read, estimate, watch, decide, limit, write, publish. An ordinary call: the real-time thread makes
//! it a thousand times a second, a rollout as fast as the machine goes.

use super::arming::{self, ArmingChecks};
use super::failsafe::{self, Failsafe, FailsafeAction};
use super::jump::{FallWatch, Jump, Progress};
use super::leg::{self, LegTarget};
use super::limits::{CommandGate, ticks};
use super::mode::{self, Trigger};
use super::ramp::{PoseRamp, RampProgress};
use super::settings::ControlSettings;
use crate::control::estimator::Estimator;
use crate::realtime::clock::Clock;
use crate::robot::kinematics::Foot;
use crate::robot::{JointCommand, Joints, LEGS, Leg, PerLeg, Placement, Robot, RobotError, robot_time_passed};
use crate::telemetry::{
    ArmingFindings, Command, CommandRefusal, Event, FailsafeWarning, Fault, Mode, Permit, Phase, Readiness, Tick,
    TransitionCause, TrialEnd, TrialSpec,
};
use nalgebra::{Matrix3, Vector3};

/// For how many ticks a caution is told, so that a session that looks ten times a second misses none.
const CAUTION_TICKS: u32 = 1000;

/// What a tick is told from outside.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Inputs {
    /// Planned start of the tick, ns since the engine started.
    pub time_ns: u64,
    /// How late it really started, ns.
    pub lateness_ns: u64,
    /// The stop latch.
    pub stop: bool,
    /// How long the operator's screen has been silent, ms.
    pub operator_silent_ms: u32,
    /// The next waiting command.
    pub command: Option<Command>,
    /// The ring of events was full: the session does not listen.
    pub events_lost: bool,
}

/// Events of one tick; there is room for all that one tick can cause.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Events {
    list: [Option<Event>; Events::MOST],
    count: usize,
}

impl Events {
    /// The most that one tick can cause: a refusal, two changes of mode, the end of a trial, and one to spare.
    const MOST: usize = 8;

    fn push(&mut self, event: Event) {
        debug_assert!(self.count < Self::MOST, "a tick caused more than {} events", Self::MOST);
        if let Some(place) = self.list.get_mut(self.count) {
            *place = Some(event);
            self.count += 1;
        }
    }

    /// The events, in the order in which they happened.
    pub fn iter(&self) -> impl Iterator<Item = Event> + '_ {
        self.list.iter().flatten().copied()
    }
}

/// The control cycle of one robot. `Copy`, so that a copy shares nothing with it.
#[derive(Debug, Clone, Copy)]
pub struct Cycle {
    settings: ControlSettings,
    mode: Mode,
    /// Why the mode is what it is.
    cause: TransitionCause,
    /// How often it changed.
    mode_changes: u64,
    /// Ticks since it changed.
    mode_ticks: u32,
    estimator: Estimator,
    watchdog: Failsafe,
    /// What trips in this tick.
    standing: Option<Fault>,
    /// The newest caution and for how many ticks it is still told.
    caution: Option<(FailsafeWarning, u32)>,
    pre_arm: ArmingChecks,
    findings: ArmingFindings,
    gate: CommandGate,
    ramp: Option<PoseRamp>,
    jump: Option<Jump>,
    /// Ticks that have carried the running trial so far.
    trial_ticks: u64,
    /// Between a trial and its verdict.
    fall: FallWatch,
    /// The trial that ended in this tick: the tick is still its own.
    ended: Option<Jump>,
    feet: PerLeg<Foot>,
    state_age_ms: u32,
    /// The system's error number, if the robot could not be reached last time.
    send_error: Option<i32>,
    /// Nobody watches a jump any more, and why: sit down as soon as it has landed.
    landing: Option<Fault>,
    /// The session is over: down, and nothing energises again.
    left: bool,
    tick: Tick,
    events: Events,
}

impl Cycle {
    /// A cycle that has not heard of its robot yet.
    pub fn new(settings: &ControlSettings) -> Cycle {
        Cycle {
            settings: *settings,
            mode: Mode::Offline,
            cause: TransitionCause::Course,
            mode_changes: 0,
            mode_ticks: 0,
            estimator: Estimator::default(),
            watchdog: Failsafe::default(),
            standing: None,
            caution: None,
            pre_arm: ArmingChecks::default(),
            findings: ArmingFindings::default(),
            gate: CommandGate::default(),
            ramp: None,
            jump: None,
            trial_ticks: 0,
            fall: FallWatch::default(),
            ended: None,
            feet: [Foot { position_leg: Vector3::zeros(), jacobian_leg: Matrix3::zeros() }; LEGS],
            state_age_ms: 0,
            send_error: None,
            landing: None,
            left: false,
            tick: Tick::default(),
            events: Events { list: [None; Events::MOST], count: 0 },
        }
    }

    /// A cycle whose robot stands ready for a trial: for rollouts, in which nobody arms.
    pub fn ready(settings: &ControlSettings) -> Cycle {
        Cycle { mode: Mode::Ready, ..Cycle::new(settings) }
    }

    /// The mode in which the last tick ended.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Age of the robot's newest state, ms; zero while it answers.
    pub fn state_age_ms(&self) -> u32 {
        self.state_age_ms
    }

    /// What speaks against the next arming and the next trial.
    pub fn readiness(&self) -> Readiness {
        Readiness {
            findings: self.findings,
            hold: failsafe::hold(&self.tick.state, &self.settings),
            caution: self.caution.map(|(caution, _)| caution),
        }
    }

    /// What the last tick caused.
    pub fn events(&self) -> &Events {
        &self.events
    }

    /// The last tick.
    pub fn last(&self) -> &Tick {
        &self.tick
    }

    /// Does one tick.
    pub fn tick<C: Clock, R: Robot + ?Sized>(&mut self, inputs: &Inputs, clock: &C, robot: &mut R) -> &Tick {
        let started_ns = clock.now_ns();
        self.events.count = 0;
        self.events.list = [None; Events::MOST];
        self.tick.time_ns = inputs.time_ns;
        let previous_robot_time_ms = self.tick.state.robot_time_ms;
        self.mode_ticks = self.mode_ticks.saturating_add(1);

        self.read(robot);
        let read_ns = clock.now_ns();
        self.estimate();
        let restarted = robot_time_passed(self.tick.state.robot_time_ms, previous_robot_time_ms) < 0;
        self.watch(inputs, restarted, robot);
        self.pre_arm.observe(inputs.lateness_ns, &self.tick.state, self.state_age_ms, restarted, &self.settings);
        self.check_pre_arm(robot);
        if let Some(command) = inputs.command {
            self.obey(&command, inputs, robot);
        }
        if inputs.stop {
            self.request(Trigger::Stop, TransitionCause::Stop);
        }
        let wanted = self.decide();
        let passed = self.gate.pass(&wanted, &self.tick.state, &self.settings);
        let mut sent = passed.command;
        if let Some(fault) = passed.fault {
            self.request(Trigger::Fault, TransitionCause::Fault(fault));
            sent = JointCommand::damping(self.settings.gate.damping_kd);
        }
        let decided_ns = clock.now_ns();
        if self.mode.commanded()
            && let Err(RobotError::Send { errno }) = robot.write(&sent)
        {
            // The watchdog of the next tick says so: this one has no command left to change.
            self.send_error = Some(errno);
        }
        let written_ns = clock.now_ns();
        if self.mode_ticks == 0 {
            // Disarmed just now: whoever hears of it finds the list as it is, not as it was before.
            self.check_pre_arm(robot);
        }

        self.publish(sent, passed.limited);
        let stages = &mut self.tick.stages;
        stages.lateness_ns = clamp_ns(inputs.lateness_ns);
        stages.read_ns = clamp_ns(read_ns.saturating_sub(started_ns));
        stages.decide_ns = clamp_ns(decided_ns.saturating_sub(read_ns));
        stages.write_ns = clamp_ns(written_ns.saturating_sub(decided_ns));
        if let Some(jump) = &mut self.jump {
            jump.advance();
        }
        &self.tick
    }

    /// The newest state, or one more millisecond of silence.
    fn read<R: Robot + ?Sized>(&mut self, robot: &mut R) {
        match robot.read() {
            Ok(state) => {
                self.tick.state = state;
                self.state_age_ms = 0;
                if self.mode == Mode::Offline {
                    self.request(Trigger::Heard, TransitionCause::Connected);
                }
            }
            Err(RobotError::Silent { age_ms }) => self.state_age_ms = age_ms,
            Err(RobotError::Send { errno }) => self.send_error = Some(errno),
        }
    }

    /// Feet, Jacobians, base.
    fn estimate(&mut self) {
        self.feet = leg::feet(&self.settings.geometry, &self.tick.state.joint_position);
        self.tick.estimate = *self.estimator.update(&self.tick.state, &self.feet, &self.settings);
    }

    /// The table of watchdogs; a robot that fell; one that stood waiting for too long.
    fn watch<R: Robot + ?Sized>(&mut self, inputs: &Inputs, restarted: bool, robot: &R) {
        self.watchdog.begin(inputs.time_ns, inputs.lateness_ns, &self.settings);
        let seen = failsafe::FailsafeInputs {
            mode: self.mode,
            state: &self.tick.state,
            estimate: &self.tick.estimate,
            state_age_ms: self.state_age_ms,
            restarted,
            link: robot.link(),
            lateness_ns: inputs.lateness_ns,
            send_error: self.send_error.take(),
            operator_silent_ms: inputs.operator_silent_ms,
            events_lost: inputs.events_lost,
        };
        let trip = self.watchdog.check(&seen, &self.settings);
        self.caution = match (failsafe::caution(&seen, &self.settings), self.caution) {
            (Some(caution), _) => Some((caution, CAUTION_TICKS)),
            (None, Some((caution, left))) if left > 1 => Some((caution, left - 1)),
            _ => None,
        };
        self.standing = None;
        match trip {
            Some(trip) if trip.level == FailsafeAction::Cut => {
                self.standing = Some(trip.fault);
                self.cut(trip.fault);
                return;
            }
            Some(trip) => self.land(trip.fault),
            None if self.left => self.land(Fault::OperatorLeft),
            None if self.mode == Mode::Ready => self.landing = None,
            None => {}
        }
        // Who tips over while a jump is being judged has fallen: damped as soon as by the table's row of a standing robot, but
        // not by a fault, so that the verdict goes on as after any other fall.
        if self.mode != Mode::Review {
            self.fall = FallWatch::default();
        } else if let Some(cause) = self.fall.observe_standing(&self.tick.state, &self.tick.estimate, &self.settings) {
            self.request(Trigger::Fell, TransitionCause::Fell(cause));
        }
        let allowed_s = self.settings.idle_s;
        if matches!(self.mode, Mode::Ready | Mode::Review) && allowed_s > 0.0 && self.mode_ticks > ticks(allowed_s) {
            self.request(Trigger::SitDown, TransitionCause::Idle { allowed_s });
        }
    }

    /// Damping now. The first cause keeps its name, unless a fault of another kind follows that makes the operator's word
    /// worthless: that one is told whenever it comes.
    fn cut(&mut self, fault: Fault) {
        let kind = std::mem::discriminant::<Fault>;
        let told = matches!(self.cause, TransitionCause::Fault(before) if kind(&before) == kind(&fault));
        if self.mode != Mode::Fault {
            self.request(Trigger::Fault, TransitionCause::Fault(fault));
        } else if !told && fault.voids_the_word() {
            self.change(Mode::Fault, TransitionCause::Fault(fault));
        }
    }

    /// Down as soon as the robot has its feet on the ground.
    fn land(&mut self, fault: Fault) {
        match self.mode {
            Mode::StandUp | Mode::Ready | Mode::Countdown | Mode::Review => {
                self.request(Trigger::SitDown, TransitionCause::Fault(fault));
            }
            Mode::Jump => {
                self.landing.get_or_insert(fault);
                if let Some(jump) = &mut self.jump {
                    jump.land();
                }
            }
            // It has landed: the trial is measured to its end. It sits down already, or lies.
            _ => {}
        }
    }

    /// How the pre-arm list stands: looked at while it matters, from the newest state.
    fn check_pre_arm<R: Robot + ?Sized>(&mut self, robot: &R) {
        if self.mode == Mode::Disarmed {
            let seen = arming::ArmingInputs {
                state: &self.tick.state,
                estimate: &self.tick.estimate,
                state_age_ms: self.state_age_ms,
                link: robot.link(),
            };
            self.findings = self.pre_arm.findings(&seen, &self.settings);
        }
    }

    /// One command of the session: carried out, or refused and said so.
    fn obey<R: Robot + ?Sized>(&mut self, command: &Command, inputs: &Inputs, robot: &mut R) {
        let request = match command {
            Command::TakeControl => Trigger::TakeControl,
            Command::Release => Trigger::Release,
            Command::Arm(_) => Trigger::Arm,
            Command::SitDown => Trigger::SitDown,
            Command::RunTrial(..) => Trigger::Approve,
            Command::Cancel => Trigger::Cancel,
            // A robot that fell was judged: looked at, that is. It still has to be armed anew.
            Command::EndReview if matches!(self.cause, TransitionCause::Fell(_)) => Trigger::Acknowledge,
            Command::EndReview => Trigger::EndReview,
            Command::Acknowledge { .. } => Trigger::Acknowledge,
            // No request: from the next tick on `watch` lands whatever is energised.
            Command::Leave => {
                self.left = true;
                return;
            }
        };
        if let Err(because) = self.may(command, request, inputs) {
            self.events.push(Event::Refused { command: *command, mode: self.mode, because });
            return;
        }
        match command {
            Command::RunTrial(spec, _) => {
                self.place(robot, spec);
                self.jump = Some(Jump::begin(spec, &self.settings));
                self.trial_ticks = 0;
            }
            Command::Arm(_) => {
                // A person may have carried the robot here: what was estimated on the way means nothing.
                self.estimator.reset();
                self.estimate();
                if self.needs_placing() {
                    let lying = Placement { joint_position: self.settings.lying_position, lying: true, seed: 0 };
                    self.put(robot, &lying);
                }
            }
            _ => {}
        }
        self.request(request, TransitionCause::Command);
    }

    /// What speaks against a command, if anything does.
    fn may(&self, command: &Command, request: Trigger, inputs: &Inputs) -> Result<(), CommandRefusal> {
        if mode::next(self.mode, request).is_none() {
            return Err(CommandRefusal::Mode);
        }
        match *command {
            Command::TakeControl => self.watched(inputs),
            Command::Arm(permit) => {
                self.watched(inputs)?;
                self.fresh(permit, inputs)?;
                match self.findings.failing() {
                    failing if failing.is_empty() => Ok(()),
                    failing => Err(CommandRefusal::Checks(failing)),
                }
            }
            Command::Acknowledge { .. } => self.standing.map_or(Ok(()), |fault| Err(CommandRefusal::Standing(fault))),
            Command::RunTrial(_, permit) => {
                self.fresh(permit, inputs)?;
                failsafe::hold(&self.tick.state, &self.settings)
                    .map_or(Ok(()), |hold| Err(CommandRefusal::Inhibited(hold)))
            }
            _ => Ok(()),
        }
    }

    /// Somebody watches: without that nothing is sent to a robot that was only observed, and none stands up.
    fn watched(&self, inputs: &Inputs) -> Result<(), CommandRefusal> {
        let (silent_ms, allowed_ms) = (inputs.operator_silent_ms, self.settings.watchdog.operator_silent_ms);
        if self.left {
            Err(CommandRefusal::Leaving)
        } else if silent_ms > allowed_ms {
            Err(CommandRefusal::OperatorSilent { silent_ms, allowed_ms })
        } else {
            Ok(())
        }
    }

    /// The key press is of this moment and of this mode.
    fn fresh(&self, Permit { mode_changes, given_ns }: Permit, inputs: &Inputs) -> Result<(), CommandRefusal> {
        let age_s = inputs.time_ns.saturating_sub(given_ns) as f64 * 1e-9;
        let allowed_s = self.settings.approval.expires_s;
        if self.left {
            Err(CommandRefusal::Leaving)
        } else if mode_changes != self.mode_changes {
            Err(CommandRefusal::Stale)
        } else if age_s > allowed_s {
            Err(CommandRefusal::Expired { age_s, allowed_s })
        } else {
            Ok(())
        }
    }

    /// Whether a robot that is to stand up lies in a way from which it cannot.
    fn needs_placing(&self) -> bool {
        let [roll, pitch, _] = self.tick.estimate.roll_pitch_yaw.into();
        roll.abs().max(pitch.abs()) > self.settings.watchdog.stance_tilt_rad
    }

    /// Puts a simulated robot on its mark, feet at the trial's stance.
    fn place<R: Robot + ?Sized>(&mut self, robot: &mut R, spec: &TrialSpec) {
        let mut joint_position = self.tick.state.joint_position;
        for leg in Leg::ALL {
            let foot = leg::stance_of(&spec.stance_leg, leg);
            // The session has checked that the stance can be reached; a leg that cannot stays as it is.
            if let Ok(q) = self.settings.geometry.inverse(&foot, leg.side()) {
                joint_position[3 * leg as usize..3 * leg as usize + 3].copy_from_slice(q.as_slice());
            }
        }
        self.put(robot, &Placement { joint_position, lying: false, seed: spec.seed });
    }

    fn put<R: Robot + ?Sized>(&mut self, robot: &mut R, placement: &Placement) {
        if robot.place(placement) {
            self.estimator.reset();
            self.gate.reset();
            self.read(robot);
            self.estimate();
        }
    }

    /// What the motors are to do in this mode, and the course of things that needs no command.
    fn decide(&mut self) -> JointCommand {
        if let Some(jump) = &mut self.jump {
            let progress = match jump.observe(&self.tick.state, &self.tick.estimate, &self.settings) {
                // Nobody watches: it need not become quiet, only stand.
                Progress::Settle if self.landing.is_some() && jump.landed_s() >= self.settings.watchdog.land_s => {
                    Progress::Over(TrialEnd::NotQuiet)
                }
                progress => progress,
            };
            match (self.mode, progress) {
                (Mode::Countdown, Progress::Jump | Progress::Settle) => {
                    self.request(Trigger::CountdownOver, TransitionCause::Course);
                }
                (Mode::Jump, Progress::Settle) => self.request(Trigger::Landed, TransitionCause::Course),
                (_, Progress::Over(TrialEnd::Fell(cause))) => self.request(Trigger::Fell, TransitionCause::Fell(cause)),
                (_, Progress::Over(end)) => {
                    // A jump may be over without a moment of settling.
                    if self.mode == Mode::Jump {
                        self.request(Trigger::Landed, TransitionCause::Course);
                    }
                    self.finish_trial(self.landing.map_or(end, TrialEnd::Fault));
                    self.request(Trigger::Settled, TransitionCause::Course);
                }
                _ => {}
            }
        }
        if let Some(ramp) = &mut self.ramp {
            match ramp.progress(&self.tick.state.joint_position) {
                RampProgress::Moving => {}
                RampProgress::Reached => self.request(Trigger::PoseReached, TransitionCause::Course),
                RampProgress::Late { .. } if self.mode == Mode::SitDown => {
                    // Lying down is where the floor stops it: damping is safe from here.
                    self.request(Trigger::PoseReached, TransitionCause::Course);
                }
                RampProgress::Late { error_rad } => {
                    self.request(Trigger::Fault, TransitionCause::Fault(Fault::PoseTimeout { error_rad }));
                }
            }
        }
        self.tick.torque_demanded = Joints::default();
        match (self.mode, &mut self.ramp, &self.jump) {
            (Mode::StandUp | Mode::SitDown, Some(ramp), _) => ramp.command(),
            (Mode::Countdown | Mode::Jump | Mode::Settle, _, Some(jump)) => {
                let target = jump.target(&self.tick.estimate);
                self.legs(&target)
            }
            (Mode::Ready | Mode::Review, _, _) => {
                let stand = &self.settings.stand;
                self.legs(&LegTarget {
                    gains: stand.gains,
                    stance_leg: stand.stance_leg,
                    vmc: stand.vmc,
                    attitude_rate_gain: stand.attitude_rate_gain,
                    foot_offset_leg: [Vector3::zeros(); LEGS],
                    amplitudes_leg: [Vector3::zeros(); LEGS],
                    theta_rad: 0.0,
                })
            }
            _ => JointCommand::damping(self.settings.gate.damping_kd),
        }
    }

    fn legs(&mut self, target: &LegTarget) -> JointCommand {
        let (state, estimate) = (&self.tick.state, &self.tick.estimate);
        let torques = leg::torques(target, &self.feet, &state.joint_velocity, estimate);
        self.tick.torque_demanded = torques;
        JointCommand::torques(&torques)
    }

    /// The only place where the mode changes.
    fn request(&mut self, request: Trigger, cause: TransitionCause) {
        if let Some(to) = mode::next(self.mode, request).filter(|to| *to != self.mode) {
            self.change(to, cause);
        }
    }

    fn change(&mut self, to: Mode, cause: TransitionCause) {
        let from = self.mode;
        self.mode = to;
        self.cause = cause;
        self.mode_changes += 1;
        self.mode_ticks = 0;
        self.events.push(Event::Mode { from, to, cause, time_ns: self.tick.time_ns });
        self.ramp = match to {
            Mode::StandUp => Some(PoseRamp::begin(&self.tick.state, &self.standing_pose(), &self.settings.stand_up)),
            Mode::SitDown => {
                Some(PoseRamp::begin(&self.tick.state, &self.settings.lying_position, &self.settings.sit_down))
            }
            _ => None,
        };
        if !matches!(to, Mode::Countdown | Mode::Jump | Mode::Settle) {
            self.finish_trial(match cause {
                TransitionCause::Stop => TrialEnd::Stopped,
                TransitionCause::Fell(cause) => TrialEnd::Fell(cause),
                TransitionCause::Fault(fault) => TrialEnd::Fault(fault),
                TransitionCause::Command
                | TransitionCause::Course
                | TransitionCause::Connected
                | TransitionCause::Idle { .. } => TrialEnd::Cancelled,
            });
        }
    }

    /// The trial is over, if one runs.
    fn finish_trial(&mut self, end: TrialEnd) {
        if let Some(jump) = self.jump.take() {
            let ticks = self.trial_ticks + 1;
            self.events.push(Event::TrialEnded { trial: jump.spec().trial, ticks, end });
            self.ended = Some(jump);
        }
    }

    /// Joint angles of standing: the nominal stance, lowered to where the springs carry the weight, so that nothing
    /// jerks when impedance control takes over. 4 kp dz = m g.
    fn standing_pose(&self) -> Joints {
        let stand = &self.settings.stand;
        let sag = self.settings.weight_n / (LEGS as f64 * stand.gains.kp);
        let mut pose = self.settings.lying_position;
        for leg in Leg::ALL {
            let i = 3 * leg as usize;
            let foot = leg::stance_of(&stand.stance_leg, leg) + Vector3::new(0.0, 0.0, sag);
            if let Ok(q) = self.settings.geometry.inverse(&foot, leg.side()) {
                pose[i..i + 3].copy_from_slice(q.as_slice());
            }
        }
        pose
    }

    /// Fills the tick that everybody else sees.
    fn publish(&mut self, sent: JointCommand, limited: u16) {
        let tick = &mut self.tick;
        tick.number += 1;
        tick.mode = self.mode;
        tick.command = sent;
        tick.limited = limited;
        match self.jump.or(self.ended.take()) {
            Some(jump) => {
                self.trial_ticks += 1;
                tick.phase = jump.phase();
                tick.trial = Some(jump.spec().trial);
                tick.trial_time_s = jump.time_s();
                tick.theta_rad = jump.theta_rad();
            }
            None => {
                tick.phase = Phase::Stance;
                tick.trial = None;
                tick.trial_time_s = 0.0;
                tick.theta_rad = 0.0;
            }
        }
    }
}

fn clamp_ns(ns: u64) -> u32 {
    u32::try_from(ns).unwrap_or(u32::MAX)
}
