//! DDS endpoint of an emulated Go2: commands and states, the service `motion_switcher`, and the robot's own controller, which
//! commands the motors, too, until it is released.

use std::net::Ipv4Addr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::endpoint::{EmulatorClient, Endpoint};
use crate::robot::go2::convert;
use crate::robot::go2::dds::{DdsError, Participant, TopicReader, TopicType, TopicWriter};
use crate::robot::go2::message::{CommandMessage, RequestMessage, ResponseMessage, motion_switcher, sport};
use crate::robot::{JOINTS, JointCommand, Joints, MotorCommand, RobotState};

/// Controller that is active after the start.
const NORMAL: &str = "normal";
/// Names of controllers that can be selected.
const CONTROLLERS: [&str; 4] = [NORMAL, "ai", "advanced", "mcf"];
/// Code of an unknown controller.
const UNKNOWN_NAME: i32 = 7004;
/// Period of the commands of the robot's own controller, ms.
const OWN_PERIOD_MS: u64 = 2;
/// Gains of the robot's own controller, which holds the lying pose: those of Unitree's examples.
const OWN_GAINS: [f64; 2] = [40.0, 1.0];
/// Longest wait of a thread until it looks whether the emulator has ended.
const WAKE: Duration = Duration::from_millis(50);

/// The robot's end of one service.
struct EmulatedService {
    requests: TopicReader,
    responses: TopicWriter,
}

/// The robot's services.
struct Services {
    switcher: EmulatedService,
    sport: EmulatedService,
    /// Active controller; empty if released.
    active: String,
}

/// DDS endpoint of a Go2.
pub(super) struct Go2Endpoint {
    commands: Receiver<(EmulatorClient, Vec<u8>)>,
    states: TopicWriter,
    services: Services,
    own: TopicWriter,
    own_command: Vec<u8>,
    /// Time since the start, ms.
    now_ms: u64,
    foot_force_n: f64,
    ending: Arc<AtomicBool>,
    reading: Option<JoinHandle<()>>,
    _participants: [Participant; 2],
}

impl std::fmt::Debug for Go2Endpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Go2Endpoint").field("active", &self.services.active).finish_non_exhaustive()
    }
}

impl Go2Endpoint {
    /// Joins `domain` at the interface with `address`. The robot's own controller is another participant, as on the robot.
    pub fn join(
        domain: u16,
        address: Ipv4Addr,
        foot_force_n: f64,
        lying_rad: &Joints,
    ) -> Result<Go2Endpoint, DdsError> {
        let (robot, controller) = (Participant::join(domain, address)?, Participant::join(domain, address)?);
        let (to_robot, commands) = channel();
        let (reader, ending) = (robot.reader(&TopicType::low_command())?, Arc::<AtomicBool>::default());
        let flag = ending.clone();
        let read = move || take_commands(reader, &to_robot, &flag);
        let thread = std::thread::Builder::new().name("emulated-commands".into());
        let failed = |error: std::io::Error| DdsError::Thread { reason: error.to_string() };
        let hold = JointCommand::hold(lying_rad, OWN_GAINS[0], OWN_GAINS[1]);
        let own_command = convert::low_command(&hold).map(|command| command.bytes().to_vec()).unwrap_or_default();
        Ok(Go2Endpoint {
            commands,
            states: robot.writer(&TopicType::low_state())?,
            services: Services {
                switcher: EmulatedService::open(&robot, motion_switcher::SERVICE)?,
                sport: EmulatedService::open(&robot, sport::SERVICE)?,
                active: NORMAL.to_owned(),
            },
            own: controller.writer(&TopicType::low_command())?,
            own_command,
            now_ms: 0,
            foot_force_n,
            ending,
            reading: Some(thread.spawn(read).map_err(failed)?),
            _participants: [robot, controller],
        })
    }
}

impl Drop for Go2Endpoint {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        // A thread that panicked has ended.
        let _ = self.reading.take().map(JoinHandle::join);
    }
}

/// Passes the commands of all programs on.
fn take_commands(mut reader: TopicReader, to_robot: &Sender<(EmulatorClient, Vec<u8>)>, ending: &AtomicBool) {
    while !ending.load(Ordering::Acquire) {
        reader.wait(WAKE);
        while let Some(sample) = reader.take() {
            // A robot that has ended receives nothing.
            let _ = to_robot.send((EmulatorClient::Participant(sample.participant), sample.payload.to_vec()));
        }
    }
}

impl EmulatedService {
    fn open(robot: &Participant, name: &str) -> Result<EmulatedService, DdsError> {
        let requests = robot.reader(&TopicType::request(name))?;
        Ok(EmulatedService { requests, responses: robot.writer(&TopicType::response(name))? })
    }

    /// Answers all requests that wait.
    fn answer(&mut self, mut answer_to: impl FnMut(&RequestMessage) -> ResponseMessage) {
        while let Some(sample) = self.requests.take() {
            let Ok(request) = RequestMessage::decode(&sample.payload) else { continue };
            let response = answer_to(&request);
            if !request.no_reply {
                // A lost response is asked for again.
                let _ = self.responses.write(&response.encode());
            }
        }
    }
}

impl Services {
    /// Answers all requests that wait.
    fn answer(&mut self) {
        self.switcher.answer(|request| switch(&mut self.active, request));
        self.sport.answer(|request| respond(request, 0, String::new()));
    }
}

/// Answers a request to the motion switcher, whose active controller is `active`.
fn switch(active: &mut String, request: &RequestMessage) -> ResponseMessage {
    match request.api {
        motion_switcher::CHECK_MODE => {
            let name = serde_json::Value::from(active.as_str());
            respond(request, 0, format!("{{\"form\":\"0\",\"name\":{name}}}"))
        }
        motion_switcher::RELEASE_MODE => {
            active.clear();
            respond(request, 0, String::new())
        }
        motion_switcher::SELECT_MODE => {
            let parameter: serde_json::Value = serde_json::from_str(&request.parameter).unwrap_or_default();
            let name = parameter.get("name").and_then(|name| name.as_str()).unwrap_or_default();
            if CONTROLLERS.contains(&name) {
                name.clone_into(active);
                respond(request, 0, String::new())
            } else {
                respond(request, UNKNOWN_NAME, String::new())
            }
        }
        _ => respond(request, UNKNOWN_NAME, String::new()),
    }
}

fn respond(request: &RequestMessage, code: i32, data: String) -> ResponseMessage {
    ResponseMessage { id: request.id, api: request.api, code, data, binary: Vec::new() }
}

impl Endpoint for Go2Endpoint {
    fn receive(&mut self) -> Option<(EmulatorClient, Vec<u8>)> {
        self.commands.try_recv().ok()
    }

    fn decode(&self, command: &[u8]) -> Option<[Option<MotorCommand>; JOINTS]> {
        let command = CommandMessage::decode(command).ok()?;
        Some(std::array::from_fn(|i| convert::motor_command(&command.motor[i])))
    }

    fn encode(&self, state: &RobotState) -> Vec<u8> {
        convert::low_state(state, self.foot_force_n).encode().to_vec()
    }

    fn send(&mut self, state: &[u8], _: Option<EmulatorClient>) {
        // A lost state is followed by the next.
        let _ = self.states.write(state);
    }

    fn sends_to_all(&self) -> bool {
        true
    }

    /// Answers requests; the robot's own controller commands the motors until it is released.
    fn advance(&mut self) {
        self.now_ms += 1;
        self.services.answer();
        if !self.services.active.is_empty() && self.now_ms.is_multiple_of(OWN_PERIOD_MS) {
            // A lost command is followed by the next.
            let _ = self.own.write(&self.own_command);
        }
    }

    fn reboot(&mut self) {
        NORMAL.clone_into(&mut self.services.active);
    }
}
