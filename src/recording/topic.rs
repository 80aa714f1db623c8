//! The topics of a recording.

use foxglove::messages::{FrameTransforms, JointStates, Log, PoseInFrame, SceneUpdate};
use foxglove::{Encode, Schema};
use strum::{EnumString, IntoStaticStr, VariantArray};

/// Schema of each message of `proto/frog.proto`: its descriptor with those of the messages that it refers to.
const SCHEMAS: &[(&str, &[u8])] = include!("../../proto/generated/schemas.rs");

/// A topic. Its order is that of the channels in files written here; readers use the name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, EnumString, IntoStaticStr, VariantArray)]
#[expect(missing_docs, reason = "the name of the topic, which proto/frog.proto describes with its message")]
pub enum Topic {
    #[strum(serialize = "/robot/joint_states")]
    JointStates,
    #[strum(serialize = "/robot/joint_cmd")]
    JointCommand,
    #[strum(serialize = "/robot/tick")]
    Tick,
    #[strum(serialize = "/robot/pose")]
    Pose,
    #[strum(serialize = "/tf")]
    Tf,
    #[strum(serialize = "/robot/counters")]
    Counters,
    #[strum(serialize = "/session")]
    Session,
    #[strum(serialize = "/fsm")]
    Transition,
    #[strum(serialize = "/opt/stage")]
    Stage,
    #[strum(serialize = "/opt/proposal")]
    Proposal,
    #[strum(serialize = "/opt/trial")]
    Trial,
    #[strum(serialize = "/operator/command")]
    Command,
    #[strum(serialize = "/log")]
    Log,
    #[strum(serialize = "/fault")]
    Fault,
    #[strum(serialize = "/marker")]
    Marker,
    #[strum(serialize = "/safety/pre_arm")]
    PreArm,
    #[strum(serialize = "/opt/search")]
    Search,
    #[strum(serialize = "/opt/insight")]
    Insight,
    #[strum(serialize = "/opt/points")]
    Points,
    #[strum(serialize = "/scene/robot")]
    RobotScene,
    #[strum(serialize = "/scene/ground")]
    GroundScene,
}

impl Topic {
    /// All topics; the place of one, plus 1, is its channel in files written here.
    pub const ALL: &'static [Topic] = Topic::VARIANTS;

    /// Returns its name in a recording, for example `/robot/tick`.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Returns the topic of that name; none for a name that no version of this program has written.
    pub fn from_name(name: &str) -> Option<Topic> {
        name.parse().ok()
    }

    /// Whether its messages are events: few, and kept in memory by a player, unlike ticks and counters.
    pub const fn is_event(self) -> bool {
        !matches!(
            self,
            Topic::JointStates
                | Topic::JointCommand
                | Topic::Tick
                | Topic::Pose
                | Topic::Tf
                | Topic::Counters
                | Topic::RobotScene
                | Topic::GroundScene
        )
    }

    /// Returns the schema of its messages.
    pub(super) fn schema(self) -> Schema {
        let own = |name: &str| {
            let (_, schema) = SCHEMAS.iter().find(|(known, _)| *known == name).expect("a message of frog.proto");
            Schema::new(format!("frog.v1.{name}"), "protobuf", *schema)
        };
        match self {
            Topic::JointStates => JointStates::get_schema().expect("a message of foxglove has a schema"),
            Topic::Pose => PoseInFrame::get_schema().expect("a message of foxglove has a schema"),
            Topic::Tf => FrameTransforms::get_schema().expect("a message of foxglove has a schema"),
            Topic::RobotScene | Topic::GroundScene => {
                SceneUpdate::get_schema().expect("a message of foxglove has a schema")
            }
            Topic::Log => Log::get_schema().expect("a message of foxglove has a schema"),
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
