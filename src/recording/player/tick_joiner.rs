//! Ticks from the messages of a chunk.

use foxglove::messages::JointStates;
use mcap::records::MessageHeader;
use prost::Message;

use super::super::wire::DecodeError;
use super::super::{frog, tick};
use crate::telemetry::Tick;

/// The messages of a chunk that the next tick needs. They are decoded with it: most are not needed while ticks are left out.
#[derive(Default)]
pub struct TickJoiner<'a> {
    /// The last message on `/robot/joint_states`; of older recordings it belongs to the tick after it.
    pub joints: Option<(MessageHeader, &'a [u8])>,
    /// The last message on `/robot/joint_cmd`.
    pub command: Option<(MessageHeader, &'a [u8])>,
    /// The same, decoded.
    decoded: Option<frog::JointCommand>,
    /// The message of the last tick, whose memory serves the next one.
    control: frog::ControlTick,
}

impl<'a> TickJoiner<'a> {
    /// Sets the command of the ticks that follow.
    pub fn set_command(&mut self, header: MessageHeader, data: &'a [u8]) {
        self.command = Some((header, data));
        self.decoded = None;
    }

    /// Returns the tick of a message on `/robot/tick`.
    pub fn tick(&mut self, header: &MessageHeader, data: &[u8]) -> Result<Tick, DecodeError> {
        let control = &mut self.control;
        control.clear();
        control.merge(data)?;
        let no_command = || DecodeError::Missing("/robot/joint_cmd of a tick");
        if tick::has_joints(control) {
            let command = match &mut self.decoded {
                Some(command) => command,
                none => {
                    let (_, command) = self.command.as_ref().ok_or_else(no_command)?;
                    none.insert(frog::JointCommand::decode(*command)?)
                }
            };
            return tick::join(command, control);
        }
        let same = |other: &MessageHeader| other.sequence == header.sequence && other.log_time == header.log_time;
        let (_, joints) = self
            .joints
            .take()
            .filter(|(other, _)| same(other))
            .ok_or(DecodeError::Missing("/robot/joint_states of a tick"))?;
        let (_, command) = self.command.take().filter(|(other, _)| same(other)).ok_or_else(no_command)?;
        tick::join_three(control, &JointStates::decode(joints)?, frog::JointCommand::decode(command)?)
    }
}
