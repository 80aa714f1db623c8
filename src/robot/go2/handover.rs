//! Takes the robot over from its own controller, in the order of Unitree's example (`docs/go2-wire.md`, section 6): states
//! arrive, the robot lies, the active controller is read, released, and read again until there is none.
//!
//! No DDS and no clock here: the caller gives the time, the joint positions of a fresh state and the responses, and sends the
//! requests. The release needs states at every moment: an old one does not show that a person has raised the robot.
//! Every request is repeated until it is answered, because the first one after the start may be lost. A repetition has an
//! identity of its own, so a late response to an earlier one is not taken for the answer of a later step.

use super::message::{RequestMessage, ResponseMessage, motion_switcher, sport};
use crate::robot::{JOINTS, Joints, joint_name};

/// Time without a response after which a request is repeated, ms. The official server answers within 3 ms.
const REPEAT_MS: u64 = 500;
/// Time without a response after which the handover fails, ms.
const UNANSWERED_MS: u64 = 5000;
/// Time without a state after the start that fails the handover, ms. The first one was seen after 100 to 700 ms; participants
/// announce themselves again after 10 s, should the first announcement be lost.
const NO_STATE_MS: u64 = 12_000;
/// Time that the robot may take to lie down, ms.
const LIE_DOWN_MS: u64 = 10_000;
/// Age beyond which a state is not fresh any more, ms: dozens of the robot's periods of 1 to 2 ms, and too short to lift the robot.
pub const FRESH_MS: u64 = 100;
/// Time that the robot must lie still before its controller is released, ms.
const LIES_MS: u64 = 1000;
/// Wait between a release and the next reading of the active controller, ms; 1 to 5 s in Unitree's example.
const SETTLE_MS: u64 = 2000;
/// Releases after which a controller that is still active fails the handover.
const RELEASES: u32 = 3;
/// Largest distance of a joint from the lying pose, rad.
pub const LYING_RAD: f64 = 0.5;

/// Cause of a failed handover.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum HandoverError {
    #[error(
        "no state of the robot for {after_ms} ms; check the interface, the DDS domain and that the robot is switched on"
    )]
    NoState { after_ms: u64 },
    #[error(
        "the service {service} has not answered request {api} for {after_ms} ms; only the EDU version of the robot accepts low-level commands"
    )]
    Unanswered { service: &'static str, api: i64, after_ms: u64 },
    #[error("the service {service} answered request {api} with the code {code}, data {data:?}")]
    Refused { service: &'static str, api: i64, code: i32, data: String },
    #[error(
        "the robot does not lie: {joint} is {off_rad:.2} rad from the lying pose, the limit is {LYING_RAD} rad; lay the robot down with its remote"
    )]
    NotLying { joint: String, off_rad: f64 },
    #[error(
        "the robot's controller {name:?} is still active after {RELEASES} releases; end the programs that select it"
    )]
    StillActive { name: String },
}

/// A request and the service that receives it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServiceRequest {
    /// Name of the service, which is in the name of the topic.
    pub service: &'static str,
    /// Message.
    pub message: RequestMessage,
}

/// Progress of a handover.
#[derive(Debug, Clone, PartialEq)]
pub enum HandoverStatus {
    /// No state has arrived.
    AwaitingState,
    /// The active controller is being read.
    Checking,
    /// The robot is to lie down.
    LyingDown,
    /// The active controller is being released.
    Releasing,
    /// No controller is active. The name is that of the released one, to give the robot back; none if none was active.
    Done(Option<String>),
    /// Nothing more is requested.
    Failed(HandoverError),
}

/// Function of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Function {
    CheckMode,
    StandDown,
    ReleaseMode,
}

impl Function {
    fn request(self, id: i64) -> ServiceRequest {
        let (service, message) = match self {
            Function::CheckMode => (motion_switcher::SERVICE, motion_switcher::check_mode(id)),
            Function::StandDown => (sport::SERVICE, sport::request(id, sport::STAND_DOWN)),
            Function::ReleaseMode => (motion_switcher::SERVICE, motion_switcher::release_mode(id)),
        };
        ServiceRequest { service, message }
    }
}

/// Step of a handover.
#[derive(Debug, Clone, PartialEq)]
enum Step {
    AwaitState {
        since_ms: u64,
    },
    /// Requests are repeated until one of them is answered. The identities are those from `first_id` to `next_id`.
    Request {
        function: Function,
        since_ms: u64,
        sent_ms: Option<u64>,
        first_id: i64,
    },
    LieDown {
        since_ms: u64,
    },
    Settle {
        since_ms: u64,
    },
    Done,
    Failed(HandoverError),
}

/// A handover from the robot's own controller to this program.
#[derive(Debug)]
pub struct Handover {
    step: Step,
    lying_rad: Joints,
    next_id: i64,
    releases: u32,
    release_sent: bool,
    /// First controller that was found active.
    own_controller: Option<String>,
    /// Time of the last advance with a fresh state; at first the begin.
    seen_ms: u64,
    /// Time since which every state shows a robot that lies.
    lies_since_ms: Option<u64>,
}

impl Handover {
    /// Begins at `now_ms`. `lying_rad` is the lying pose; `first_id` an identity above those of earlier requests of any
    /// program (the official library counts monotonic nanoseconds).
    pub fn begin(now_ms: u64, lying_rad: &Joints, first_id: i64) -> Handover {
        Handover {
            step: Step::AwaitState { since_ms: now_ms },
            lying_rad: *lying_rad,
            next_id: first_id,
            releases: 0,
            release_sent: false,
            own_controller: None,
            seen_ms: now_ms,
            lies_since_ms: None,
        }
    }

    /// Returns the progress.
    pub fn status(&self) -> HandoverStatus {
        match &self.step {
            Step::AwaitState { .. } => HandoverStatus::AwaitingState,
            Step::Request { function: Function::CheckMode, .. } => HandoverStatus::Checking,
            Step::Request { function: Function::StandDown, .. } | Step::LieDown { .. } => HandoverStatus::LyingDown,
            Step::Request { function: Function::ReleaseMode, .. } | Step::Settle { .. } => HandoverStatus::Releasing,
            Step::Done => HandoverStatus::Done(self.own_controller.clone()),
            Step::Failed(error) => HandoverStatus::Failed(error.clone()),
        }
    }

    /// Returns the name of the controller to which a release was sent, answered or not; none before. The robot is given back to it.
    pub fn released_controller(&self) -> Option<&str> {
        self.own_controller.as_deref().filter(|_| self.release_sent)
    }

    /// Advances to `now_ms` with the joint positions of the newest state, none if it is older than [`FRESH_MS`]; returns the
    /// request to send.
    pub fn advance(&mut self, now_ms: u64, joint_position_rad: Option<&Joints>) -> Option<ServiceRequest> {
        self.watch(now_ms, joint_position_rad);
        match &self.step {
            Step::AwaitState { since_ms } => {
                let after_ms = now_ms.saturating_sub(*since_ms);
                if joint_position_rad.is_some() {
                    self.request(Function::CheckMode, now_ms);
                } else if after_ms >= NO_STATE_MS {
                    self.fail(HandoverError::NoState { after_ms });
                }
                None
            }
            Step::Request { function, since_ms, sent_ms, .. } => {
                let (function, after_ms) = (*function, now_ms.saturating_sub(*since_ms));
                let is_due = sent_ms.is_none_or(|sent_ms| now_ms.saturating_sub(sent_ms) >= REPEAT_MS);
                if after_ms >= UNANSWERED_MS {
                    self.fail_unanswered(function, now_ms, after_ms, joint_position_rad);
                    return None;
                }
                if !is_due || function == Function::ReleaseMode && !self.may_release(now_ms, joint_position_rad) {
                    return None;
                }
                self.send(function, now_ms)
            }
            Step::LieDown { since_ms } => {
                let after_ms = now_ms.saturating_sub(*since_ms);
                if self.lies_long_enough(now_ms) {
                    self.request(Function::ReleaseMode, now_ms);
                } else if after_ms >= LIE_DOWN_MS {
                    match joint_position_rad {
                        None => self.fail_without_state(now_ms),
                        Some(position_rad) => self.fail_unless_lying(position_rad),
                    }
                }
                None
            }
            Step::Settle { since_ms } => {
                if now_ms.saturating_sub(*since_ms) >= SETTLE_MS {
                    self.request(Function::CheckMode, now_ms);
                }
                None
            }
            Step::Done | Step::Failed(_) => None,
        }
    }

    /// Takes a response of `service`. Those to other programs, and to requests of earlier steps, are ignored.
    pub fn answer(&mut self, now_ms: u64, service: &str, response: &ResponseMessage) {
        let Step::Request { function, first_id, .. } = self.step else { return };
        let asked = function.request(response.id);
        let ours = (first_id..self.next_id).contains(&response.id);
        if !ours || asked.service != service || asked.message.api != response.api {
            return;
        }
        let refused = || HandoverError::Refused {
            service: asked.service,
            api: response.api,
            code: response.code,
            data: response.data.clone(),
        };
        match function {
            Function::CheckMode => match response.active_mode() {
                None => self.fail(refused()),
                Some(name) if name.is_empty() => self.step = Step::Done,
                Some(name) if self.releases >= RELEASES => self.fail(HandoverError::StillActive { name }),
                Some(name) => {
                    self.own_controller.get_or_insert(name);
                    self.request(Function::StandDown, now_ms);
                }
            },
            // A controller without this function refuses it; the joints decide whether the robot lies.
            Function::StandDown => {
                self.lies_since_ms = None;
                self.step = Step::LieDown { since_ms: now_ms };
            }
            Function::ReleaseMode if response.code != 0 => self.fail(refused()),
            Function::ReleaseMode => {
                self.releases += 1;
                self.step = Step::Settle { since_ms: now_ms };
            }
        }
    }

    /// Notes since when the robot lies. A gap in the states, or in the calls of a program that was stopped, begins anew: nothing is
    /// known about the robot in it.
    fn watch(&mut self, now_ms: u64, joint_position_rad: Option<&Joints>) {
        if now_ms.saturating_sub(self.seen_ms) > FRESH_MS {
            self.lies_since_ms = None;
        }
        let lies = joint_position_rad.is_some_and(|position_rad| off_lying(position_rad, &self.lying_rad).is_none());
        self.lies_since_ms = lies.then(|| self.lies_since_ms.unwrap_or(now_ms));
        if joint_position_rad.is_some() {
            self.seen_ms = now_ms;
        }
    }

    fn lies_long_enough(&self, now_ms: u64) -> bool {
        self.lies_since_ms.is_some_and(|since_ms| now_ms.saturating_sub(since_ms) >= LIES_MS)
    }

    /// Whether the robot lies, now and for long enough; the handover fails if it is seen not to lie.
    fn may_release(&mut self, now_ms: u64, joint_position_rad: Option<&Joints>) -> bool {
        if let Some(position_rad) = joint_position_rad {
            self.fail_unless_lying(position_rad);
        }
        self.lies_long_enough(now_ms)
    }

    fn request(&mut self, function: Function, now_ms: u64) {
        self.step = Step::Request { function, since_ms: now_ms, sent_ms: None, first_id: self.next_id };
    }

    fn send(&mut self, function: Function, now_ms: u64) -> Option<ServiceRequest> {
        if let Step::Request { sent_ms, .. } = &mut self.step {
            *sent_ms = Some(now_ms);
        }
        self.release_sent |= function == Function::ReleaseMode;
        let id = self.next_id;
        self.next_id += 1;
        Some(function.request(id))
    }

    fn fail(&mut self, error: HandoverError) {
        self.step = Step::Failed(error);
    }

    fn fail_without_state(&mut self, now_ms: u64) {
        self.fail(HandoverError::NoState { after_ms: now_ms.saturating_sub(self.seen_ms) });
    }

    fn fail_unless_lying(&mut self, position_rad: &Joints) {
        if let Some((joint, off_rad)) = off_lying(position_rad, &self.lying_rad) {
            self.fail(HandoverError::NotLying { joint: joint_name(joint), off_rad });
        }
    }

    /// A release without a response: without states it was not sent, and the service is not the cause.
    fn fail_unanswered(&mut self, function: Function, now_ms: u64, after_ms: u64, joint_position_rad: Option<&Joints>) {
        if function == Function::ReleaseMode && joint_position_rad.is_none() {
            return self.fail_without_state(now_ms);
        }
        let ServiceRequest { service, message } = function.request(0);
        self.fail(HandoverError::Unanswered { service, api: message.api, after_ms });
    }
}

/// Returns the joint that is farthest from the lying pose, and its distance, rad, if the robot does not lie. The distance is infinite
/// if a position is not finite.
pub fn off_lying(position_rad: &Joints, lying_rad: &Joints) -> Option<(usize, f64)> {
    let off = |joint: usize| {
        let off_rad = (position_rad[joint] - lying_rad[joint]).abs();
        if off_rad.is_finite() { off_rad } else { f64::INFINITY }
    };
    // The first of equal ones.
    let farthest = (0..JOINTS).rev().map(|joint| (joint, off(joint))).max_by(|a, b| a.1.total_cmp(&b.1));
    farthest.filter(|(_, off_rad)| *off_rad > LYING_RAD)
}
