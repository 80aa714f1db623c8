//! One control tick: read, STOP, estimate, failsafes, arming checks, command, decide, limit, send. A plain call: the control
//! thread makes it at 1 kHz, a rollout as fast as the machine allows.

mod commands;
mod decision;
mod failsafes;
mod fault_landing;

use super::arming::{self, ArmingHistory};
use super::command_gate::CommandGate;
use super::consistency::{Consistency, ConsistencyInputs};
use super::failsafe::{self, PeriodWatch};
use super::fault_landing::FaultLanding;
use super::gain_blend::GainBlend;
use super::leg;
use super::link_quality::LinkQuality;
use super::mode::{self, Trigger};
use super::ramp::PoseRamp;
use super::readiness::{self, QuietTime, ReadinessInputs};
use super::running_trial::{FallWatch, RunningTrial};
use super::settings::ControlSettings;
use crate::control::estimator::Estimator;
use crate::realtime::clock::Clock;
use crate::robot::kinematics::FootPosition;
use crate::robot::{JointCommand, Joints, PerLeg, Robot, RobotError, robot_time_passed};
use crate::telemetry::{
    ArmingFindings, Command, Event, FailsafeWarning, Fault, Mode, Readiness, Tick, TickDurations, TransitionCause,
    TrialEnd, TrialInhibit,
};

/// Inputs of one tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TickInputs {
    /// Planned start of the tick, ns since the engine started.
    pub time_ns: u64,
    /// Delay of the real start, ns.
    pub lateness_ns: u64,
    /// Time of the tick by [`Clock::unslewed_ns`].
    pub unslewed_ns: Option<u64>,
    /// The STOP latch.
    pub stop: bool,
    /// Time since the last heartbeat of the operator's console, ms.
    pub operator_silent_ms: u32,
    /// The next waiting command.
    pub command: Option<Command>,
    /// The ring of events was full: the session takes none.
    pub events_lost: bool,
    /// Time for which the computer was suspended since the last tick, ms.
    pub suspended_ms: u32,
    /// Time for which the guard has not answered, ms; `u32::MAX` when it is gone, zero without a guard.
    pub guard_silent_ms: u32,
}

impl TickInputs {
    /// Time with which the robot's clock is compared, ns: of a clock that is not slewed, else the real start of the tick.
    fn compared_ns(&self) -> u64 {
        self.unslewed_ns.unwrap_or(self.time_ns.saturating_add(self.lateness_ns))
    }
}

/// Events of one tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Events {
    list: [Option<Event>; Events::MOST],
    count: usize,
}

impl Events {
    /// One tick causes at most a refusal, changes of mode and the end of a trial: fewer than this.
    const MOST: usize = 8;

    fn push(&mut self, event: Event) {
        debug_assert!(self.count < Self::MOST, "a tick caused more than {} events", Self::MOST);
        if let Some(place) = self.list.get_mut(self.count) {
            *place = Some(event);
            self.count += 1;
        }
    }

    /// The events, oldest first.
    pub fn iter(&self) -> impl Iterator<Item = Event> + '_ {
        self.list.iter().flatten().copied()
    }
}

/// The control cycle of one robot. `Copy`: a tick on a copy does not change the original.
#[derive(Debug, Clone, Copy)]
pub struct Cycle {
    settings: ControlSettings,
    mode: Mode,
    /// Cause of the last change of mode.
    cause: TransitionCause,
    mode_changes: u64,
    /// Ticks since the last change of mode.
    mode_ticks: u32,
    estimator: Estimator,
    period_watch: PeriodWatch,
    consistency: Consistency,
    /// The fault whose failsafe trips in this tick.
    tripped: Option<Fault>,
    /// The newest warning and the ticks for which it stays set.
    warning: Option<(FailsafeWarning, u32)>,
    arming_history: ArmingHistory,
    link_quality: LinkQuality,
    quiet: QuietTime,
    findings: ArmingFindings,
    gate: CommandGate,
    ramp: Option<PoseRamp>,
    trial: Option<RunningTrial>,
    /// Ticks of the running trial so far.
    trial_ticks: u64,
    /// Fall detection in REVIEW.
    fall: FallWatch,
    /// The trial that ended in this tick; the tick still belongs to it.
    ended: Option<RunningTrial>,
    feet: PerLeg<FootPosition>,
    state_age_ms: u32,
    /// Time for which a remote control that is needed has not answered, ms.
    remote_silent_ms: u32,
    /// `errno` of the last failed send; taken by the failsafes of the next tick.
    send_error: Option<i32>,
    /// Fault during a jump after which the robot sits down once it has landed.
    landing: Option<Fault>,
    /// Fault in the air or in the landing after which the robot is damped once it has landed.
    fault_landing: Option<FaultLanding>,
    gains: GainBlend,
    /// The session ended: the robot sits down, and nothing energises it again.
    session_left: bool,
    /// End of a trial of which jumps in a row were dropped.
    dropped: Option<TrialEnd>,
    /// Cause for which the robot sits down in REVIEW: a request during jumps in a row, or LAND, whose own cause may be gone.
    sits_down_after: Option<TransitionCause>,
    /// Time of the newest command to sit down or to cancel, ns: a permit from before it is void.
    lowered_ns: u64,
    /// Time of the newest permit that was granted or refused, ns: it holds once.
    answered_permit_ns: Option<u64>,
    tick: Tick,
    events: Events,
}

impl Cycle {
    /// A cycle in OFFLINE, without a state of its robot.
    pub fn new(settings: &ControlSettings) -> Cycle {
        Cycle {
            settings: *settings,
            mode: Mode::Offline,
            cause: TransitionCause::StepFinished,
            mode_changes: 0,
            mode_ticks: 0,
            estimator: Estimator::default(),
            period_watch: PeriodWatch::default(),
            consistency: Consistency::default(),
            tripped: None,
            warning: None,
            arming_history: ArmingHistory::default(),
            link_quality: LinkQuality::default(),
            quiet: QuietTime::default(),
            findings: ArmingFindings::default(),
            gate: CommandGate::default(),
            ramp: None,
            trial: None,
            trial_ticks: 0,
            fall: FallWatch::default(),
            ended: None,
            feet: PerLeg::default(),
            state_age_ms: 0,
            remote_silent_ms: 0,
            send_error: None,
            landing: None,
            fault_landing: None,
            gains: GainBlend::default(),
            session_left: false,
            dropped: None,
            sits_down_after: None,
            lowered_ns: 0,
            answered_permit_ns: None,
            tick: Tick::default(),
            events: Events::default(),
        }
    }

    /// A cycle in READY, for rollouts without an operator.
    pub fn ready(settings: &ControlSettings) -> Cycle {
        Cycle { mode: Mode::Ready, ..Cycle::new(settings) }
    }

    /// The mode in which the last tick ended.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Age of the robot's newest state, ms; zero while states arrive.
    pub fn state_age_ms(&self) -> u32 {
        self.state_age_ms
    }

    /// Arming findings, trial inhibit and warning as of the last tick.
    pub fn readiness(&self) -> Readiness {
        Readiness {
            findings: self.findings,
            inhibit: self.inhibit(),
            unready: if self.mode == Mode::Ready { self.unready(&self.standing_pose()) } else { None },
            warning: self.warning.map(|(warning, _)| warning),
        }
    }

    /// Returns the reason to refuse the next trial; none before the first state, of which nothing is known.
    fn inhibit(&self) -> Option<TrialInhibit> {
        if self.mode == Mode::Offline {
            return None;
        }
        failsafe::trial_inhibit(&self.tick.state, self.link_quality.delay_growth_ms(), &self.settings)
    }

    /// Returns a condition of a jump from the joint angles `pose_rad` that does not hold.
    fn unready(&self, pose_rad: &Joints) -> Option<TrialInhibit> {
        let inputs = ReadinessInputs {
            state: &self.tick.state,
            estimate: &self.tick.estimate,
            quiet: &self.quiet,
            history: &self.arming_history,
            link: &self.link_quality,
            pose_rad,
        };
        readiness::unready(&inputs, &self.settings)
    }

    /// Consistency of sensors, clocks and commands as of the last tick.
    pub fn consistency(&self) -> &Consistency {
        &self.consistency
    }

    /// Events of the last tick.
    pub fn events(&self) -> &Events {
        &self.events
    }

    /// The last tick.
    pub fn last(&self) -> &Tick {
        &self.tick
    }

    /// Runs one tick. STOP acts before every failsafe, command and decision.
    pub fn tick<C: Clock, R: Robot + ?Sized>(&mut self, inputs: &TickInputs, clock: &C, robot: &mut R) -> &Tick {
        let started_ns = clock.now_ns();
        let previous_robot_time_ms = self.tick.state.robot_time_ms;
        self.begin(inputs);

        self.read(robot);
        self.measure_link(inputs, robot);
        let read_ns = clock.now_ns();
        if inputs.stop {
            self.trigger(Trigger::Stop, TransitionCause::Stop);
        }
        self.estimate();
        self.quiet.update(&self.tick.estimate, self.state_age_ms, &self.settings);
        let restarted = robot_time_passed(self.tick.state.robot_time_ms, previous_robot_time_ms) < 0;
        self.check_consistency(inputs, restarted, robot);
        self.run_failsafes(inputs, restarted, robot);
        self.arming_history.update(inputs.lateness_ns, &self.tick.state, self.state_age_ms, restarted, &self.settings);
        self.run_arming_checks(robot);
        if let Some(command) = &inputs.command {
            self.handle_command(command, inputs, robot);
        }
        let wanted = self.decide();
        let (sent, limited) = self.limit(&wanted);
        let decided_ns = clock.now_ns();
        self.send(&sent, robot);
        let written_ns = clock.now_ns();
        if self.mode_ticks == 0 {
            // Disarmed in this tick: the session reads current findings together with the event.
            self.run_arming_checks(robot);
        }

        self.complete_tick(sent, limited);
        self.stamp(inputs.lateness_ns, [started_ns, read_ns, decided_ns, written_ns]);
        if let Some(jump) = &mut self.trial {
            jump.advance();
        }
        &self.tick
    }

    fn begin(&mut self, inputs: &TickInputs) {
        self.events = Events::default();
        self.tick.time_ns = inputs.time_ns;
        self.mode_ticks = self.mode_ticks.saturating_add(1);
    }

    /// Takes the newest state, or the age of the last one.
    fn read<R: Robot + ?Sized>(&mut self, robot: &mut R) {
        match robot.read() {
            Ok(state) => {
                self.tick.state = state;
                self.state_age_ms = 0;
                if self.mode == Mode::Offline {
                    self.trigger(Trigger::Connected, TransitionCause::Connected);
                }
            }
            Err(RobotError::NoNewState { age_ms }) => self.state_age_ms = age_ms,
            Err(RobotError::Send { errno }) => self.send_error = Some(errno),
        }
        let silent = self.settings.misses_remote(&self.tick.state);
        self.remote_silent_ms = if silent { self.remote_silent_ms.saturating_add(1) } else { 0 };
    }

    /// Measures the quality of the link with the state of this tick.
    fn measure_link<R: Robot + ?Sized>(&mut self, inputs: &TickInputs, robot: &R) {
        let now_ns = inputs.compared_ns();
        let (robot_time_ms, drift_ppm) = (self.tick.state.robot_time_ms, self.settings.failsafe.clock_drift_ppm);
        self.link_quality.update(now_ns, robot_time_ms, self.state_age_ms, robot.link(), drift_ppm);
    }

    /// Computes feet, Jacobians and the base's estimate.
    fn estimate(&mut self) {
        self.feet = leg::feet(&self.settings.geometry, &self.tick.state.joint_position_rad);
        self.tick.estimate = *self.estimator.update(&self.tick.state, &self.feet, &self.settings);
    }

    /// Compares sensors, clocks and commands with each other.
    fn check_consistency<R: Robot + ?Sized>(&mut self, inputs: &TickInputs, restarted: bool, robot: &R) {
        let consistency_inputs = ConsistencyInputs {
            mode: self.mode,
            state: &self.tick.state,
            is_new: self.state_age_ms == 0,
            restarted,
            accel_body: self.estimator.accel_body(),
            estimate: &self.tick.estimate,
            now_ns: inputs.compared_ns(),
            link: robot.link(),
            sent: &self.tick.command,
        };
        self.consistency.update(&consistency_inputs, &self.settings);
    }

    /// Runs the arming checks while DISARMED.
    fn run_arming_checks<R: Robot + ?Sized>(&mut self, robot: &R) {
        if self.mode == Mode::Disarmed {
            let inputs = arming::ArmingInputs {
                state: &self.tick.state,
                estimate: &self.tick.estimate,
                state_age_ms: self.state_age_ms,
                link: robot.link(),
                delay_growth_ms: self.link_quality.delay_growth_ms(),
                history: &self.arming_history,
                consistency: &self.consistency,
            };
            self.findings = arming::findings(&inputs, &self.settings);
        }
    }

    /// Passes `wanted` through the last gate; a fault there damps. Returns the command to send and the mask of limited joints.
    fn limit(&mut self, wanted: &JointCommand) -> (JointCommand, u16) {
        let passed = if self.holds_stance() {
            self.gate.pass_unmeasured(wanted, &self.settings)
        } else {
            let torque_share = if self.ramp.is_some() { self.settings.failsafe.ramp_torque_share } else { 1.0 };
            self.gate.pass_within(torque_share, wanted, &self.tick.state, &self.settings)
        };
        match passed.fault {
            None => (passed.command, passed.limited),
            Some(fault) => {
                self.trigger(Trigger::Fault, TransitionCause::Fault(fault));
                (JointCommand::damping(self.settings.gate.damping_kd), passed.limited)
            }
        }
    }

    /// Sends the command, in modes in which the robot is sent any. The failsafes of the next tick take a failure.
    fn send<R: Robot + ?Sized>(&mut self, command: &JointCommand, robot: &mut R) {
        if self.mode.commanded()
            && let Err(RobotError::Send { errno }) = robot.write(command)
        {
            self.send_error = Some(errno);
        }
    }

    /// Changes the mode if `mode::next` allows it.
    fn trigger(&mut self, trigger: Trigger, cause: TransitionCause) {
        if let Some(to) = mode::next(self.mode, trigger).filter(|to| *to != self.mode) {
            self.change(to, cause);
        }
    }

    /// Enters a mode: event, ramp, end of the trial.
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
        if to == Mode::StandUp {
            self.gains.reset();
        }
        if !matches!(to, Mode::Countdown | Mode::Jump | Mode::Settle) {
            self.fault_landing = None;
            self.finish_trial(match cause {
                TransitionCause::Stop => TrialEnd::Stopped,
                TransitionCause::Fell(cause) => TrialEnd::Fell(cause),
                TransitionCause::Fault(fault) => TrialEnd::Fault(fault),
                TransitionCause::NotReady(inhibit) => TrialEnd::NotReady(inhibit),
                TransitionCause::Command
                | TransitionCause::StepFinished
                | TransitionCause::Connected
                | TransitionCause::Idle { .. } => TrialEnd::Cancelled,
            });
        }
    }

    /// Ends the running trial, if any.
    fn finish_trial(&mut self, end: TrialEnd) {
        if let Some(jump) = self.trial.take() {
            let ticks = self.trial_ticks + 1;
            self.events.push(Event::TrialEnded { trial: jump.spec().trial, ticks, end });
            self.ended = Some(jump);
        }
    }

    /// Completes the tick for recorder, console and session.
    fn complete_tick(&mut self, sent: JointCommand, limited: u16) {
        let tick = &mut self.tick;
        tick.number += 1;
        tick.mode = self.mode;
        tick.command = sent;
        tick.limited = limited;
        match self.trial.or(self.ended.take()) {
            Some(jump) => {
                self.trial_ticks += 1;
                tick.phase = jump.phase();
                tick.trial = Some(jump.spec().trial);
                tick.trial_time_s = jump.time_s();
                tick.theta_rad = jump.theta_rad();
            }
            None => (tick.phase, tick.trial, tick.trial_time_s, tick.theta_rad) = Default::default(),
        }
    }

    fn stamp(&mut self, lateness_ns: u64, [started, read, decided, written]: [u64; 4]) {
        self.tick.stages = TickDurations {
            lateness_ns: span_ns(0, lateness_ns),
            read_ns: span_ns(started, read),
            decide_ns: span_ns(read, decided),
            write_ns: span_ns(decided, written),
        };
    }
}

/// Nanoseconds from `from` to `to`, saturated.
fn span_ns(from: u64, to: u64) -> u32 {
    u32::try_from(to.saturating_sub(from)).unwrap_or(u32::MAX)
}
