//! The handover from the robot's own controller: order of the requests, lost requests, failed releases, and each failure.

use std::collections::VecDeque;

use quadfrog::robot::go2::handover::{Handover, HandoverStatus, ServiceRequest};
use quadfrog::robot::go2::message::{ResponseMessage, motion_switcher, sport};
use quadfrog::robot::{JOINTS, Joints};

const LYING: Joints = [0.35; JOINTS];
const STANDING: Joints = [1.0; JOINTS];

/// Services of a robot, with their faults.
struct Services {
    active: String,
    /// First requests that are lost.
    lost: u32,
    /// Releases that change nothing.
    deaf_releases: u32,
    release_code: i32,
    lies_down: bool,
    position_rad: Option<Joints>,
    /// Time of the first advance without a fresh state, and of the first with one again.
    without_states_ms: std::ops::Range<u64>,
    /// The release after which a person raises the robot; its requests are lost.
    raised_after_release: bool,
    /// Requests that arrived: service and function.
    arrived: Vec<(&'static str, i64)>,
    /// Released while the robot did not lie.
    dropped: bool,
}

impl Services {
    fn new(active: &str) -> Services {
        Services {
            active: active.to_owned(),
            lost: 0,
            deaf_releases: 0,
            release_code: 0,
            lies_down: true,
            position_rad: Some(STANDING),
            without_states_ms: 0..0,
            raised_after_release: false,
            arrived: Vec::new(),
            dropped: false,
        }
    }

    fn serve(&mut self, request: &ServiceRequest) -> Option<ResponseMessage> {
        if self.lost > 0 {
            self.lost -= 1;
            return None;
        }
        let ServiceRequest { service, message } = request;
        if self.raised_after_release && message.api == motion_switcher::RELEASE_MODE {
            self.dropped |= self.position_rad != Some(LYING);
            self.position_rad = Some(STANDING);
            return None;
        }
        self.arrived.push((service, message.api));
        let mut response = ResponseMessage {
            id: message.id,
            api: message.api,
            code: 0,
            data: format!("{{\"form\":\"0\",\"name\":\"{}\"}}", self.active),
            binary: Vec::new(),
        };
        match (*service, message.api) {
            (sport::SERVICE, sport::STAND_DOWN) if self.lies_down => self.position_rad = Some(LYING),
            (motion_switcher::SERVICE, motion_switcher::RELEASE_MODE) => {
                self.dropped |= self.position_rad != Some(LYING);
                response.code = self.release_code;
                if self.deaf_releases > 0 {
                    self.deaf_releases -= 1;
                } else {
                    self.active.clear();
                }
            }
            _ => {}
        }
        Some(response)
    }
}

/// Steps of 10 ms until the handover ends, with responses after 20 ms; returns its end and the time, ms.
fn run(services: &mut Services) -> (HandoverStatus, u64) {
    let (handover, ms) = run_to_end(services);
    (handover.status(), ms)
}

fn run_to_end(services: &mut Services) -> (Handover, u64) {
    let mut handover = Handover::begin(0, &LYING, 1000);
    let mut late: VecDeque<(u64, &str, ResponseMessage)> = VecDeque::new();
    let mut ids = Vec::new();
    for now_ms in (0..120_000).step_by(10) {
        while late.front().is_some_and(|(at_ms, ..)| *at_ms <= now_ms) {
            let (_, service, response) = late.pop_front().unwrap();
            // A response to another program, and one of another function, come first.
            handover.answer(now_ms, service, &ResponseMessage { id: 5, ..response.clone() });
            handover.answer(now_ms, service, &ResponseMessage { api: 77, ..response.clone() });
            handover.answer(now_ms, service, &response);
        }
        let has_states = !services.without_states_ms.contains(&now_ms);
        if let Some(request) = handover.advance(now_ms, services.position_rad.as_ref().filter(|_| has_states)) {
            assert!(!ids.contains(&request.message.id), "an identity is used once");
            ids.push(request.message.id);
            late.extend(services.serve(&request).map(|response| (now_ms + 20, request.service, response)));
        }
        if let HandoverStatus::Done(_) | HandoverStatus::Failed(_) = handover.status() {
            return (handover, now_ms);
        }
    }
    panic!("no end in two minutes: {:?}", handover.status());
}

const CHECK: (&str, i64) = (motion_switcher::SERVICE, motion_switcher::CHECK_MODE);
const RELEASE: (&str, i64) = (motion_switcher::SERVICE, motion_switcher::RELEASE_MODE);
const DOWN: (&str, i64) = (sport::SERVICE, sport::STAND_DOWN);

#[test]
fn the_robot_lies_before_its_controller_is_released_and_the_release_is_verified() {
    let mut services = Services::new("normal");
    let (end, ms) = run(&mut services);
    assert_eq!(end, HandoverStatus::Done(Some("normal".to_owned())));
    assert_eq!(services.arrived, [CHECK, DOWN, RELEASE, CHECK]);
    assert!(!services.dropped && (3000..4000).contains(&ms), "{ms} ms");
}

#[test]
fn a_robot_without_a_controller_is_only_checked() {
    let mut services = Services::new("");
    assert_eq!(run(&mut services).0, HandoverStatus::Done(None));
    assert_eq!(services.arrived, [CHECK]);
}

#[test]
fn a_lost_request_is_repeated_and_a_failed_release_too() {
    let mut services = Services { lost: 3, deaf_releases: 2, ..Services::new("mcf") };
    assert_eq!(run(&mut services).0, HandoverStatus::Done(Some("mcf".to_owned())));
    assert_eq!(services.arrived, [CHECK, DOWN, RELEASE, CHECK, DOWN, RELEASE, CHECK, DOWN, RELEASE, CHECK]);
}

#[test]
fn each_cause_of_a_failure_is_named() {
    let failure = |mut services: Services| match run(&mut services).0 {
        HandoverStatus::Failed(error) if !services.dropped => error.to_string(),
        other => panic!("{other:?}"),
    };
    let error = failure(Services { position_rad: None, ..Services::new("normal") });
    assert!(error.contains("no state of the robot for 12000 ms"), "{error}");
    let error = failure(Services { lost: u32::MAX, ..Services::new("normal") });
    assert!(error.contains("motion_switcher has not answered request 1001 for 5000 ms"), "{error}");
    let error = failure(Services { lies_down: false, ..Services::new("normal") });
    assert!(error.contains("FR_hip is 0.65 rad from the lying pose"), "{error}");
    let error = failure(Services { lies_down: false, position_rad: Some([f64::NAN; 12]), ..Services::new("ai") });
    assert!(error.contains("inf rad from the lying pose"), "{error}");
    let error = failure(Services { release_code: 7008, ..Services::new("normal") });
    assert!(error.contains("request 1003 with the code 7008"), "{error}");
    let error = failure(Services { deaf_releases: 9, ..Services::new("advanced") });
    assert!(error.contains("\"advanced\" is still active after 3 releases"), "{error}");
}

/// Regression: the position of the first state was used without an end, so that a robot that a person had raised was released.
#[test]
fn without_fresh_states_the_robot_is_not_released() {
    let lying = || Services { position_rad: Some(LYING), ..Services::new("normal") };
    // After the first state, and while the robot lies down: its second without a move is not complete.
    for end_ms in [10, 60, 500, 1000] {
        let mut services = Services { without_states_ms: end_ms..u64::MAX, ..lying() };
        let (end, ms) = run(&mut services);
        let HandoverStatus::Failed(error) = end else { panic!("states end at {end_ms} ms: {end:?}") };
        assert!(error.to_string().contains("no state of the robot for"), "{error}");
        assert!(!services.arrived.contains(&RELEASE) && (10_000..12_000).contains(&ms), "{:?}", services.arrived);
    }
    // A gap: the robot may have been moved in it, and lies for one more second.
    let mut services = Services { without_states_ms: 500..800, ..lying() };
    let (end, ms) = run(&mut services);
    assert_eq!(end, HandoverStatus::Done(Some("normal".to_owned())));
    assert!((3800..4800).contains(&ms) && !services.dropped, "{ms} ms");
}

/// Regression: a release without a response was repeated for 5 s, whatever the robot did meanwhile.
#[test]
fn a_release_is_not_repeated_on_a_robot_that_was_raised_or_is_not_seen() {
    let mut services = Services { raised_after_release: true, ..Services::new("normal") };
    let (end, _) = run(&mut services);
    let HandoverStatus::Failed(error) = end else { panic!("{end:?}") };
    assert!(error.to_string().contains("the robot does not lie: FR_hip"), "{error}");
    assert!(!services.dropped && !services.arrived.contains(&RELEASE), "{:?}", services.arrived);
    // The release is due at 1060 ms; the states end in that moment.
    let without_states_ms = 1060..u64::MAX;
    let mut services = Services { position_rad: Some(LYING), without_states_ms, ..Services::new("normal") };
    let (end, _) = run(&mut services);
    let HandoverStatus::Failed(error) = end else { panic!("{end:?}") };
    assert!(error.to_string().contains("no state of the robot for"), "{error}");
    assert!(!services.arrived.contains(&RELEASE), "{:?}", services.arrived);
}

/// Regression: the name was known only at a good end, so that a robot whose takeover failed later was not given back to it.
#[test]
fn the_name_of_the_controller_is_known_from_the_first_release_on() {
    let new = || Services::new("mcf");
    let sent = [
        new(),
        Services { release_code: 7008, ..new() },
        Services { deaf_releases: 9, ..new() },
        Services { raised_after_release: true, ..new() },
    ];
    let not_sent = [Services::new(""), Services { lies_down: false, ..new() }, Services { lost: u32::MAX, ..new() }];
    let named = sent.map(|services| (services, Some("mcf"))).into_iter();
    for (mut services, name) in named.chain(not_sent.map(|services| (services, None))) {
        let (handover, _) = run_to_end(&mut services);
        assert_eq!(handover.released_controller(), name, "{:?}", handover.status());
    }
}

/// A program that was stopped finds the states of the time before: it does not know what happened since.
#[test]
fn the_time_of_a_program_that_was_stopped_is_not_the_time_of_a_robot_that_lies() {
    let mut handover = Handover::begin(0, &LYING, 1000);
    let mut answered = None;
    let mut now_ms = 0;
    let mut releases_at_ms = Vec::new();
    for step in 0..300 {
        // 60 s pass in one step.
        now_ms += if step == 50 { 60_000 } else { 10 };
        if let Some((service, response)) = answered.take() {
            handover.answer(now_ms, service, &response);
        }
        if let Some(request) = handover.advance(now_ms, Some(&LYING)) {
            if request.message.api == motion_switcher::RELEASE_MODE {
                releases_at_ms.push(now_ms);
            }
            answered = Services::new("ai").serve(&request).map(|response| (request.service, response));
        }
    }
    assert!(matches!(releases_at_ms[..], [ms] if ms >= 61_490), "{releases_at_ms:?}");
}
