//! Gives the robot back to its own controller, once it lies and no other program commands it.

use std::time::{Duration, Instant};

use super::dds::{DdsError, Participant, TopicType};
use super::handover::{LYING_RAD, off_lying};
use super::message::{ResponseMessage, motion_switcher};
use super::services::{LOOK, Service, States, first_id, found_for};
use crate::robot::{Joints, joint_name};

/// Time for which commands of other programs are listened to, once states arrive. After joining a domain the endpoints of others were
/// seen to be found within 100 to 700 ms.
const LISTEN: Duration = Duration::from_secs(1);
/// Time without a response after which the request is repeated.
const REPEAT: Duration = Duration::from_millis(500);
/// Time without a state, or without a response, after which giving the robot back fails.
const UNANSWERED: Duration = Duration::from_secs(5);

/// Error of giving the robot back.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum GiveBackError {
    #[error(transparent)]
    Dds(#[from] DdsError),
    #[error("no state of the robot arrives: {0}")]
    NoState(String),
    #[error(
        "a program commands the robot: quit each console first; without one, a controller of the robot is active already"
    )]
    Commanded,
    #[error(
        "the robot does not lie: {joint} is {off_rad:.2} rad from the lying pose, the limit is {LYING_RAD} rad; lay the robot down"
    )]
    NotLying { joint: String, off_rad: f64 },
    #[error("the service motion_switcher answered {name:?} with code {code}, data {data:?}")]
    NotStarted { name: String, code: i32, data: String },
    #[error(
        "no response of the service motion_switcher within 5 s; check the interface, the domain and that the robot is switched on"
    )]
    Unanswered,
}

/// Starts the robot's own controller `name` again. `lying_rad` is the lying pose.
///
/// # Errors
/// Another program commands the robot, it sends no states or does not lie: nothing is requested then. The service does not answer
/// within 5 s, or refuses.
pub fn give_back(participant: &Participant, lying_rad: &Joints, name: &str) -> Result<(), GiveBackError> {
    check_at_rest(participant, lying_rad)?;
    let mut switcher = Service::open(participant, motion_switcher::SERVICE)?;
    let (begun, first) = (Instant::now(), first_id());
    let (mut next, mut sent) = (first, None::<Instant>);
    loop {
        if begun.elapsed() > UNANSWERED {
            return Err(GiveBackError::Unanswered);
        }
        if sent.is_none_or(|sent| sent.elapsed() >= REPEAT) {
            sent = Some(Instant::now());
            // A lost request is repeated.
            let _ = switcher.requests.write(&motion_switcher::select_mode(next, name).encode());
            next += 1;
        }
        switcher.responses.wait(LOOK);
        while let Some(response) = switcher.response() {
            if !(first..next).contains(&response.id) || response.api != motion_switcher::SELECT_MODE {
                continue;
            }
            if response.code == 0 {
                return Ok(());
            }
            let ResponseMessage { code, data, .. } = response;
            return Err(GiveBackError::NotStarted { name: name.to_owned(), code, data });
        }
    }
}

/// Listens for commands once states arrive; then the newest state must be fresh and that of a robot that lies.
fn check_at_rest(participant: &Participant, lying_rad: &Joints) -> Result<(), GiveBackError> {
    let mut states = States::open(participant)?;
    let mut commands = participant.reader(&TopicType::low_command())?;
    let (begun, mut seen) = (Instant::now(), None::<Instant>);
    while seen.map_or(begun.elapsed() < UNANSWERED, |seen| seen.elapsed() < LISTEN) {
        states.receive();
        // This program writes none.
        if commands.take().is_some() {
            return Err(GiveBackError::Commanded);
        }
        seen = seen.or_else(|| states.position_rad().map(|_| Instant::now()));
    }
    let Some(position_rad) = states.position_rad() else {
        return Err(GiveBackError::NoState(found_for(&TopicType::low_state(), &participant.writers(), "writes")));
    };
    match off_lying(position_rad, lying_rad) {
        None => Ok(()),
        Some((joint, off_rad)) => Err(GiveBackError::NotLying { joint: joint_name(joint), off_rad }),
    }
}
