//! Signs of another program that commands the robot: its commands, lost states, torques that are not ours, motors in another mode.

use super::inputs::ConsistencyInputs;
use super::leaky::kept;
use crate::control::settings::{ConsistencyLimits, ControlSettings};
use crate::robot::{CONTROL_PERIOD_S, JOINTS, Joints, LinkStatus, RobotState};
use crate::telemetry::{CommanderSign, Mode};

/// Time constant of the count of states, s.
const STATES_S: f64 = 1.0;
/// Time constant of the averaged torques, s.
const TORQUE_S: f64 = 0.1;
/// Least number of states within the time constant from which a share is known: less is a missing link.
const LEAST_STATES: f64 = 100.0;
/// Most commands of other programs within the time constant. A program that looks once at the topic sends none.
pub(in crate::control) const FOREIGN_COMMANDS: f64 = 2.0;

/// History of the link and the motors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct CommandEcho {
    /// Received and lost states up to the last tick.
    counted: Option<[u64; 2]>,
    /// Received and lost states within the time constant.
    recent: [f64; 2],
    /// Commands of other programs up to the last tick, and within the time constant.
    foreign_counted: Option<u64>,
    foreign: f64,
    /// Averaged reported torque less that of the last command, N m.
    torque_error_n_m: Joints,
}

impl CommandEcho {
    /// Counts states; to be called once per tick.
    pub fn count_states(&mut self, link: Option<&LinkStatus>) {
        let Some(link) = link else { return };
        let now = [link.received, link.lost];
        let before = self.counted.replace(now).unwrap_or(now);
        let share = kept(CONTROL_PERIOD_S, STATES_S);
        for ((recent, now), before) in self.recent.iter_mut().zip(now).zip(before) {
            // A state that arrives late is no longer lost.
            *recent = (*recent * share + (now as f64 - before as f64)).max(0.0);
        }
        let before = self.foreign_counted.replace(link.foreign_commands).unwrap_or(link.foreign_commands);
        self.foreign = self.foreign * share + link.foreign_commands.saturating_sub(before) as f64;
    }

    /// Compares the reported torques with those of the last command, in modes in which the robot stands.
    pub fn compare_torques(&mut self, inputs: &ConsistencyInputs, dt_s: f64, settings: &ControlSettings) {
        if !stands(inputs.mode) {
            self.torque_error_n_m = Joints::default();
            return;
        }
        let (state, share) = (inputs.state, kept(dt_s, TORQUE_S));
        for joint in 0..JOINTS {
            let motor = &inputs.sent.motor[joint];
            let ours = motor.torque_at(state.joint_position_rad[joint], state.joint_velocity_rad_s[joint]);
            let ours = ours.clamp(-settings.max_torque[joint], settings.max_torque[joint]);
            let error = state.joint_torque_n_m[joint] - ours;
            self.torque_error_n_m[joint] = self.torque_error_n_m[joint] * share + error * (1.0 - share);
        }
    }

    /// The first sign, with measured value and limit.
    pub fn sign(
        &self,
        state: &RobotState,
        mode: Mode,
        limits: &ConsistencyLimits,
    ) -> Option<(CommanderSign, f64, f64)> {
        if mode.energised() && state.motor_enabled == [false; JOINTS] {
            return Some((CommanderSign::ForeignMode, JOINTS as f64, 0.0));
        }
        if mode.energised() && self.foreign > FOREIGN_COMMANDS {
            return Some((CommanderSign::ForeignCommands, self.foreign, FOREIGN_COMMANDS));
        }
        let [received, lost] = self.recent;
        let loss_share = if received + lost < LEAST_STATES { 0.0 } else { lost / (received + lost) };
        if mode.energised() && loss_share > limits.loss_share {
            return Some((CommanderSign::LostStates, loss_share * 100.0, limits.loss_share * 100.0));
        }
        let torque = self.torque_error_n_m.iter().fold(0.0, |most: f64, error| most.max(error.abs()));
        (stands(mode) && torque > limits.torque_n_m).then_some((
            CommanderSign::ForeignTorque,
            torque,
            limits.torque_n_m,
        ))
    }
}

const fn stands(mode: Mode) -> bool {
    matches!(mode, Mode::Ready | Mode::Countdown | Mode::Review)
}
