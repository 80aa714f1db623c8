//! The topics of a recording.

use foxglove::messages::{FrameTransforms, JointStates, Log, PoseInFrame};
use foxglove::{Encode, Schema};

/// The description of `proto/frog.proto`, as every channel carries it.
const FROG_DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/frog.v1.bin"));

/// A topic; its place in `ALL` plus one is its channel in files written here (readers go by the name).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Topic {
    JointStates,
    JointCommand,
    Tick,
    Pose,
    Tf,
    Counters,
    Session,
    Transition,
    Stage,
    Proposal,
    Trial,
    Command,
    Log,
    Fault,
    Marker,
    PreArm,
    Search,
    Insight,
    Points,
}

impl Topic {
    pub const ALL: [Topic; 19] = [
        Topic::JointStates,
        Topic::JointCommand,
        Topic::Tick,
        Topic::Pose,
        Topic::Tf,
        Topic::Counters,
        Topic::Session,
        Topic::Transition,
        Topic::Stage,
        Topic::Proposal,
        Topic::Trial,
        Topic::Command,
        Topic::Log,
        Topic::Fault,
        Topic::Marker,
        Topic::PreArm,
        Topic::Search,
        Topic::Insight,
        Topic::Points,
    ];

    /// The name in the file.
    pub const fn name(self) -> &'static str {
        match self {
            Topic::JointStates => "/robot/joint_states",
            Topic::JointCommand => "/robot/joint_cmd",
            Topic::Tick => "/robot/tick",
            Topic::Pose => "/robot/pose",
            Topic::Tf => "/tf",
            Topic::Counters => "/robot/counters",
            Topic::Session => "/session",
            Topic::Transition => "/fsm",
            Topic::Stage => "/opt/stage",
            Topic::Proposal => "/opt/proposal",
            Topic::Trial => "/opt/trial",
            Topic::Command => "/operator/command",
            Topic::Log => "/log",
            Topic::Fault => "/fault",
            Topic::Marker => "/marker",
            Topic::PreArm => "/safety/pre_arm",
            Topic::Search => "/opt/search",
            Topic::Insight => "/opt/insight",
            Topic::Points => "/opt/points",
        }
    }

    /// The topic of that name.
    pub fn from_name(name: &str) -> Option<Topic> {
        Topic::ALL.into_iter().find(|topic| topic.name() == name)
    }

    /// Whether its messages are few: events, of which a player keeps all at hand, unlike ticks and counters.
    pub const fn is_event(self) -> bool {
        !matches!(
            self,
            Topic::JointStates | Topic::JointCommand | Topic::Tick | Topic::Pose | Topic::Tf | Topic::Counters
        )
    }

    /// What its messages look like.
    pub fn schema(self) -> Schema {
        let own = |name: &str| Schema::new(format!("frog.v1.{name}"), "protobuf", FROG_DESCRIPTORS);
        match self {
            Topic::JointStates => JointStates::get_schema().expect("foxglove's messages have schemas"),
            Topic::Pose => PoseInFrame::get_schema().expect("foxglove's messages have schemas"),
            Topic::Tf => FrameTransforms::get_schema().expect("foxglove's messages have schemas"),
            Topic::Log => Log::get_schema().expect("foxglove's messages have schemas"),
            Topic::JointCommand => own("JointCommand"),
            Topic::Tick => own("ControlTick"),
            Topic::Counters => own("Counters"),
            Topic::Session => own("Session"),
            Topic::Transition => own("Transition"),
            Topic::Stage => own("StageInfo"),
            Topic::Proposal => own("Proposal"),
            Topic::Trial => own("Trial"),
            Topic::Command => own("OperatorCommand"),
            Topic::Fault => own("FaultTicks"),
            Topic::Marker => own("Marker"),
            Topic::PreArm => own("PreArm"),
            Topic::Search => own("Search"),
            Topic::Insight => own("Insight"),
            Topic::Points => own("Points"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_found_by_name_and_by_number() {
        for topic in Topic::ALL {
            assert_eq!(Topic::from_name(topic.name()), Some(topic));
            assert_eq!(Topic::ALL[topic as usize], topic);
        }
    }
}
