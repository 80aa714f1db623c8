//! A Go2 behind a [`Transport`]: every state is checked, every loss counted.

use super::convert;
use super::message::{COMMAND_LENGTH, CommandPayload, EncodeError, MessageRejection, STATE_LENGTH, StateMessage};
use super::network::Go2Network;
use crate::robot::link_settings::LinkSettings;
use crate::robot::servo_grace::ServoGrace;
use crate::robot::state_counter::StateCounter;
use crate::robot::{JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};

/// Most states taken in one tick, so that a flood cannot delay it; the rest is taken in the next ticks.
const MOST_PER_TICK: usize = 32;
/// Time without a command on the network after which sending has failed, ms. Writing was seen to take 8.5 ms.
const UNSENT_MS: u32 = 20;

/// Way of payloads to and from a robot. The tick calls it: no call blocks, waits or allocates.
pub trait Transport: Send + std::fmt::Debug {
    /// Takes the oldest state that waits: its first bytes into `payload`, its length as the result; none if there is none.
    fn receive(&mut self, payload: &mut [u8; STATE_LENGTH]) -> Option<usize>;

    /// Hands over a command. A newer one replaces one that is not on the network yet.
    fn send(&mut self, payload: &[u8; COMMAND_LENGTH]);

    /// Returns the counts since the start.
    fn counts(&self) -> TransportCounts;
}

/// Counts of a transport since its start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TransportCounts {
    /// Commands that the library of the transport took for sending.
    pub sent: u64,
    /// Commands of this program that a second participant of it received from the network; zero where none ever arrives.
    pub returned: u64,
    /// Commands that could not be sent.
    pub send_errors: u64,
    /// Messages on the state's topic in another encoding.
    pub foreign: u64,
    /// Commands of other programs to the robot.
    pub foreign_commands: u64,
}

/// A Go2 behind its transport.
#[derive(Debug)]
pub struct Go2<T> {
    transport: T,
    counter: StateCounter,
    servo: ServoGrace,
    foot_force_n: f64,
    newest: Option<StateMessage>,
    /// The last command that damps every joint.
    damping: Option<CommandPayload>,
    /// Commands that had reached the network at the last command; none before the first.
    reached: Option<u64>,
    /// Time for which commands have been handed over and none reached the network, ms.
    unsent_ms: u32,
    buffer: [u8; STATE_LENGTH],
}

/// Encodes the command that damps every joint with `kd`, N m s/rad.
///
/// # Errors
/// `kd` is negative or not finite.
pub fn damping(kd: f64) -> Result<CommandPayload, EncodeError> {
    convert::low_command(&JointCommand::damping(kd))
}

impl<T: Transport> Go2<T> {
    /// Puts a robot behind `transport`.
    pub fn new(transport: T, network: &Go2Network) -> Go2<T> {
        let LinkSettings { clock, servo_grace_ms, foot_force_n } = network.link_settings();
        Go2 {
            transport,
            counter: StateCounter::new(clock),
            servo: ServoGrace::new(servo_grace_ms),
            foot_force_n,
            newest: None,
            damping: None,
            reached: None,
            unsent_ms: 0,
            buffer: [0; STATE_LENGTH],
        }
    }

    /// Checks and counts the state in the buffer. Returns true if it is newer than all earlier ones.
    fn take_state(&mut self, length: usize) -> bool {
        match StateMessage::decode(&self.buffer[..length.min(STATE_LENGTH)]) {
            Ok(state) => {
                let is_new = self.counter.count_state(state.tick);
                if is_new {
                    self.newest = Some(state);
                }
                is_new
            }
            Err(MessageRejection::Checksum { .. }) => {
                self.counter.count_corrupt();
                false
            }
            Err(_) => {
                self.counter.status.wrong_length += 1;
                false
            }
        }
    }

    /// Counts the time for which the commands before this one have not reached the network, one command a millisecond.
    fn count_unsent(&mut self) {
        let TransportCounts { sent, returned, .. } = self.transport.counts();
        // A library that does not report an error of the system counts the command as sent.
        let reached = if returned > 0 { returned } else { sent };
        self.unsent_ms = if self.reached == Some(reached) { self.unsent_ms.saturating_add(1) } else { 0 };
        self.reached = Some(reached);
    }

    /// Copies the transport's counts.
    fn copy_counts(&mut self) {
        let counts = self.transport.counts();
        let status = &mut self.counter.status;
        status.sent = counts.sent;
        status.send_errors = counts.send_errors;
        status.foreign = counts.foreign;
        status.foreign_commands = counts.foreign_commands;
    }
}

impl<T: Transport> Robot for Go2<T> {
    /// Returns the newest state if one arrived since the last call, its age otherwise.
    fn read(&mut self) -> Result<RobotState, RobotError> {
        self.servo.advance();
        self.counter.advance();
        self.copy_counts();
        let mut is_new = false;
        for _ in 0..MOST_PER_TICK {
            let Some(length) = self.transport.receive(&mut self.buffer) else { break };
            is_new |= self.take_state(length);
        }
        self.counter.sum_recent();
        let Some(newest) = self.newest.as_ref().filter(|_| is_new) else {
            return Err(RobotError::NoNewState { age_ms: self.counter.status.state_age_ms });
        };
        let mut state = convert::robot_state(newest, self.foot_force_n);
        self.servo.apply(&mut state, self.counter.status.reboots);
        Ok(state)
    }

    /// Hands one command over. If it cannot be encoded, the error is `EINVAL` and the last damping command is sent in its place.
    /// Every robot is damped before it is armed; one that was never damped was never commanded, and nothing is sent to it. If no
    /// command reaches the network for 20 ms, the error is `ETIMEDOUT`.
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        let encoded = convert::low_command(command);
        if *command == JointCommand::damping(command.motor[0].kd_joint) {
            self.damping = encoded.as_ref().ok().copied().or(self.damping);
        }
        if let Some(payload) = encoded.as_ref().ok().copied().or(self.damping) {
            self.count_unsent();
            self.transport.send(payload.bytes());
        }
        encoded.map_err(|_| RobotError::Send { errno: nix::errno::Errno::EINVAL as i32 })?;
        self.servo.command();
        if !self.delivers() {
            return Err(RobotError::Send { errno: nix::errno::Errno::ETIMEDOUT as i32 });
        }
        Ok(())
    }

    /// Returns false: only a person can place the robot.
    fn place(&mut self, _: &Placement) -> bool {
        false
    }

    fn link(&self) -> Option<LinkStatus> {
        Some(self.counter.status)
    }

    fn delivers(&self) -> bool {
        self.unsent_ms <= UNSENT_MS
    }

    fn warm_up(&mut self) {
        let Some(newest) = &self.newest else { return };
        std::hint::black_box(convert::robot_state(newest, self.foot_force_n));
        let _ = std::hint::black_box(damping(1.0));
    }
}
