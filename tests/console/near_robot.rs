//! Safety of people near the robot: the first command, approvals on hardware, the countdown, an observer's STOP.

use crate::support::{Console, assert_shows, session, tick};
use quadfrog::engine::ObserverStatus;
use quadfrog::recording::record::{LogLevel, Record, SessionInfo};
use quadfrog::robot::LinkStatus;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{Counters, Mode, Snapshot, Tick};
use quadfrog::trial::{Approval, Backend};
use quadfrog_console::message::{Effect, Msg, ReplayStatus};

fn approval(trial: u32, revision: u32) -> Vec<OperatorRequest> {
    vec![OperatorRequest::Approve { trial, revision }]
}

fn on_hardware(mut console: Console) -> Console {
    console.record(Record::Session(SessionInfo { backend: Some(Backend::Hardware), ..session() }));
    console
}

/// People walk between two jumps: arming once is not enough.
#[test]
fn a_jump_on_hardware_needs_a_clear_area_each_time() {
    let mut console = on_hardware(Console::ready());
    assert!(console.next_step().starts_with("Press g to jump: y confirms the area, g again jumps."));
    console.press(&["g"]);
    console.wait(1000);
    assert_eq!(console.press(&["g"]), [], "the area was not confirmed");
    assert_eq!(console.said(), "not yet: type y first if the area is clear");
    assert!(console.next_step().contains("Type y if the area is clear"), "{}", console.next_step());
    console.wait(1000);
    assert_eq!(console.press(&["y"]), []);
    assert!(console.screen(80, 24).contains("The area is clear, confirmed for this jump."));
    console.wait(1000);
    assert_eq!(console.requests(&["g"]), approval(0, 0));
    console.press(&["g"]);
    console.wait(1000);
    assert_eq!(console.press(&["g"]), [], "the next jump is asked for again");
    assert_eq!(console.press(&["n"]), [], "any other key cancels");
    assert_eq!(console.said(), "cancelled: no jump");
}

#[test]
fn pasted_letters_do_not_arm_a_real_robot() {
    let mut console = on_hardware(Console::proposed());
    let paste = |console: &mut Console| {
        "Astand".chars().flat_map(|c| console.update(Msg::Key(c.to_string().parse().unwrap()))).collect::<Vec<_>>()
    };
    assert_eq!(paste(&mut console), []);
    assert!(console.said().contains("the letters came within 0 ms"), "{}", console.said());
    assert_eq!(console.requests(&["A", "s", "t", "a", "n", "d"]), [OperatorRequest::Arm]);
}

#[test]
fn each_second_of_a_countdown_rings_the_bell() {
    let mut console = Console::ready();
    let mut shown = |mode, trial_time_s| {
        let tick = Tick { mode, trial_time_s, ..Tick::default() };
        console.update(Msg::Snapshot(Box::new(Snapshot { tick, ..Snapshot::default() }))) == [Effect::Bell]
    };
    let countdown = (1..=60).rev().map(|fifties| f64::from(fifties) * 0.05);
    let rung: Vec<f64> = countdown.filter(|left_s| shown(Mode::Countdown, -left_s)).collect();
    assert_eq!(rung, [3.0, 2.0, 1.0]);
    assert!(!shown(Mode::Jump, 0.1));
    assert!(shown(Mode::Countdown, -3.0), "the next countdown");
}

/// A STOP that another console's commands follow is no stop; the screen says what it achieved.
#[test]
fn an_observers_stop_is_a_request_and_its_effect_is_shown() {
    let mut observer = Console::new();
    observer.record(Record::Session(SessionInfo { observe: true, ..session() }));
    assert_eq!(observer.press(&["Space"]), [Effect::Stop]);
    assert!(
        observer.said().starts_with("STOP requested: damping is sent, a console in control"),
        "{}",
        observer.said()
    );
    observer.mode(Mode::Damped);
    assert!(observer.next_step().starts_with("STOP requested and followed"), "{}", observer.next_step());
    let mut tick = Tick { mode: Mode::Damped, ..Tick::default() };
    tick.state.joint_torque_n_m[2] = -12.3;
    observer.update(Msg::Snapshot(Box::new(Snapshot { tick, ..Snapshot::default() })));
    let step = observer.next_step();
    assert!(step.starts_with("NOT STOPPED: ") && step.contains(" holds -12.3 N m, another console"), "{step}");
}

/// Regression: beside `STOP Space F12` an observer's session "can change nothing", and its arming checks ran "while the robot is
/// disarmed".
#[test]
fn an_observer_is_shown_the_one_key_that_reaches_the_robot_and_no_arming() {
    let mut observer = Console::new();
    observer.record(Record::Session(SessionInfo { observe: true, ..session() }));
    observer.mode(Mode::Observe);
    assert!(observer.next_step().contains("of the keys STOP alone reaches the robot"), "{}", observer.next_step());
    observer.press(&["5"]);
    assert_shows(&observer.screen(120, 40), &["not checked: a session that only observes does not arm"]);
    observer.press(&["P"]);
    assert_shows(&observer.screen(120, 40), &["Arming checks: none of an observer"]);
}

#[test]
fn control_of_a_real_robot_is_taken_with_a_key_after_a_second_of_listening() {
    for mode in [Mode::Offline, Mode::Observe] {
        let mut console = on_hardware(Console::new());
        console.mode(mode);
        assert_eq!(console.press(&["L", "y"]), []);
        console.wait(1000);
        console.press(&["L"]);
        let screen = console.screen(80, 24);
        let expected =
            if mode == Mode::Offline { "has sent nothing since the start" } else { "States arrive although" };
        assert!(screen.contains("Take control?") && screen.contains(expected), "{screen}");
        assert_eq!(console.press(&["Enter"]), [], "Cancel is the default");
        assert_eq!(console.said(), "cancelled: nothing was sent to the robot");
        assert_eq!(console.requests(&["L", "y"]), [OperatorRequest::TakeControl]);
    }
    let mut console = Console::proposed();
    console.wait(2000);
    assert_eq!(console.press(&["L", "y"]), []);
}

/// Regression: commands of another program, which a Go2's console hears, were shown nowhere before the robot stood.
#[test]
fn commands_of_another_program_are_said_before_control_is_taken() {
    let mut console = on_hardware(Console::new());
    console.mode(Mode::Observe);
    console.wait(1000);
    let heard = |foreign_commands| {
        let link = Some(LinkStatus { foreign_commands, ..LinkStatus::default() });
        let tick = Tick { mode: Mode::Observe, ..Tick::default() };
        let counters = Counters { link, ..Counters::default() };
        Msg::Snapshot(Box::new(Snapshot { tick, counters, ..Snapshot::default() }))
    };
    console.press(&["5"]);
    console.update(heard(0));
    assert!(!console.screen(120, 40).contains("others sent"));
    console.update(heard(41));
    assert_shows(&console.screen(120, 40), &["others sent", "41 commands !"]);
    console.press(&["L"]);
    let screen = console.screen(80, 24);
    assert!(screen.contains("Another program commands the robot: 41 commands"), "{screen}");
}

/// Regression: a second press approved however long ago the first one was.
#[test]
fn a_forgotten_first_press_does_not_jump() {
    for hardware in [false, true] {
        let mut console = if hardware { on_hardware(Console::ready()) } else { Console::ready() };
        console.press(&["g"]);
        console.wait(1000);
        if hardware {
            console.press(&["y"]);
        }
        (0..20).for_each(|_| console.wait(1000));
        // Regression: the line offered the jump although the next press was refused.
        assert_eq!(console.said(), "cancelled: no jump, the question was 20 s old");
        assert!(!console.screen(80, 24).contains("Jump?"), "{}", console.screen(80, 24));
        assert_eq!(console.requests(&["g", "Esc"]), [], "it begins the question anew");
        assert!(console.next_step().starts_with("Press g"), "{}", console.next_step());
    }
}

/// Regression: with `--approve falls-only` on the simulator the line promised that the robot stands up, and it jumped.
#[test]
fn arming_says_that_a_robot_which_needs_no_approval_jumps() {
    let armed = |approve: Approval, backend: Backend| {
        let mut console = Console::proposed();
        console.record(Record::Session(SessionInfo { approve, backend: Some(backend), ..session() }));
        let arm = console.next_step();
        console.press(&[":", "a", "r", "m", "Enter"]);
        let question = console.screen(80, 24);
        console.press(&["Esc"]);
        console.mode(Mode::StandUp);
        (arm, question, console.next_step())
    };
    for approve in [Approval::FallsOnly, Approval::Auto] {
        let (arm, question, stands) = armed(approve, Backend::Simulator);
        assert_eq!(arm, "Press A to arm: it stands up, then jumps without a question.");
        assert_shows(
            &question,
            &["The robot will stand up and jump without a question.", "arm: it stands up and jumps"],
        );
        assert_eq!(stands, "Standing up; the robot then jumps without a question.");
        // Regression: after an interruption nothing said that the rule goes on.
        let mut console = Console::ready();
        console.record(Record::Session(SessionInfo { approve, backend: Some(Backend::Simulator), ..session() }));
        assert_eq!(
            console.screen(80, 24).lines().last().unwrap().trim_end().split(" ·").next(),
            Some(" Press g twice to jump. The next jumps follow without a question.")
        );
    }
    for (approve, backend) in [(Approval::Each, Backend::Simulator), (Approval::FallsOnly, Backend::Hardware)] {
        let (arm, question, stands) = armed(approve, backend);
        assert_eq!(arm, "Press A to arm: the robot stands up.");
        assert_shows(&question, &["The robot will stand up. Is the area clear?"]);
        assert_eq!(stands, "Standing up.");
    }
}

/// Regression: Ctrl-C said "STOP: damping." of a STOP that was only requested, or that reached nothing.
#[test]
fn ctrl_c_gives_the_answer_of_the_stop_key() {
    let mut observing = Console::new();
    observing.record(Record::Session(SessionInfo { observe: true, ..session() }));
    let watched = |ended| {
        let mut console = Console::ready();
        let observer = Some(ObserverStatus { ended, ..ObserverStatus::default() });
        console.update(Msg::Replay(ReplayStatus { observer, ..ReplayStatus::default() }));
        console
    };
    let cases = [
        (observing, "STOP requested: damping is sent, a console in control", LogLevel::Warning),
        (watched(false), "STOP demanded from the session", LogLevel::Warning),
        (watched(true), "the session has ended: its robot cannot be stopped from here", LogLevel::Error),
    ];
    for (mut console, answer, level) in cases {
        let effects = console.press(&["F12"]);
        let of_stop = console.said().to_owned();
        assert!(of_stop.starts_with(answer), "{of_stop}");
        assert_eq!(console.press(&["Ctrl-C"]), effects);
        assert_eq!(console.said(), format!("{of_stop}. Ctrl-C again within 2 s quits"));
        assert_eq!(console.model.message.as_ref().map(|message| message.level), Some(level));
        assert_eq!(console.press(&["Ctrl-C"]), [Effect::Quit]);
    }
}

/// Regression: while braking commands were sent, the last line said that nothing was sent, and Ctrl-Z stopped the program.
#[test]
fn a_silent_robot_whose_control_is_taken_is_sent_commands() {
    let mut console = on_hardware(Console::new());
    console.mode(Mode::Offline);
    console.wait(1000);
    assert_eq!(console.next_step(), "The robot is silent, nothing is sent to it. L takes control.");
    assert_eq!(console.press(&["Ctrl-Z"]), [Effect::Suspend], "nothing was sent");
    assert_eq!(console.requests(&["L", "y"]), [OperatorRequest::TakeControl]);
    console.answer("take control", false, "the robot is DISARMED");
    assert_shows(&console.next_step(), &["nothing is sent to it"]);
    console.answer("take control", true, "braking commands are sent until the robot answers, then damping");
    assert_eq!(console.next_step(), "Braking commands are sent for at most 10 s; a robot that answers is damped.");
    assert_eq!(console.press(&["Ctrl-Z"]), []);
    assert_shows(console.said(), &["a suspended program sends the robot nothing"]);
    console.mode(Mode::Observe);
    assert_eq!(console.next_step(), "The robot sends states; it is damped from now on.");
    // A Go2 is sent nothing before its first state.
    let go2 = SessionInfo { backend: Some(Backend::Hardware), robot: "go2".into(), ..session() };
    console.model.session.info = go2;
    console.mode(Mode::Offline);
    assert_eq!(console.next_step(), "Braking commands may be sent for at most 10 s; a robot that answers is damped.");
}

/// Regression: after a request for control that no robot answered, the last line spoke of braking commands without end.
#[test]
fn a_robot_that_was_called_in_vain_is_shown_as_sent_nothing() {
    let mut console = on_hardware(Console::new());
    console.mode(Mode::Offline);
    console.wait(1000);
    assert_eq!(console.requests(&["L", "y"]), [OperatorRequest::TakeControl]);
    console.answer("take control", true, "a Go1 is sent braking commands");
    console.answer("take control", false, "no state of the robot for 10 s");
    assert_eq!(console.next_step(), "The robot is silent, nothing is sent to it. L takes control.");
    console.mode(Mode::Observe);
    assert_eq!(console.next_step(), "The robot sends states, nothing is sent to it. L takes control.");
    assert_eq!(console.requests(&["L", "y"]), [OperatorRequest::TakeControl]);
}

/// Regression: of a robot that sent nothing it was shown that it followed an observer's STOP, from torques of zero.
#[test]
fn an_observers_stop_of_a_silent_robot_is_not_shown_as_followed() {
    const UNKNOWN: &str = "STOP requested; no state shows whether the robot follows. Use the remote.";
    let state_of = |time_ms, robot_time_ms, mode| {
        let mut tick = Tick { mode, ..tick(time_ms, 0.0, None) };
        tick.state.robot_time_ms = robot_time_ms;
        tick
    };
    let shows = |observer: &Console, lead: &str| {
        assert!(observer.next_step().starts_with(lead), "{}", observer.next_step());
        assert_shows(observer.screen(80, 24).lines().last().unwrap_or_default(), &[lead]);
    };
    for mode in [Mode::Damped, Mode::Fault] {
        let mut observer = on_hardware(Console::new());
        observer.model.session.info.observe = true;
        assert_eq!(observer.press(&["Space"]), [Effect::Stop]);
        observer.mode(mode);
        shows(&observer, UNKNOWN);
        (0..300).step_by(5).for_each(|time_ms| observer.tick(state_of(time_ms, 0, mode)));
        shows(&observer, UNKNOWN);
        (300..600).step_by(5).for_each(|time_ms| observer.tick(state_of(time_ms, time_ms as u32, mode)));
        shows(&observer, "STOP requested and followed: the joints are damped.");
        (600..800).step_by(5).for_each(|time_ms| observer.tick(state_of(time_ms, 595, mode)));
        shows(&observer, UNKNOWN);
    }
}

/// Regression: below 60x20, where no question is drawn, `L` and `y` took control of a real robot.
#[test]
fn a_terminal_too_small_for_the_question_takes_no_control() {
    let mut console = on_hardware(Console::new());
    console.mode(Mode::Observe);
    console.wait(1000);
    console.update(Msg::Resize(50, 12));
    assert_eq!(console.press(&["L"]), []);
    assert_shows(console.said(), &["enlarge the terminal to 60x20: the question must be visible"]);
    assert_eq!(console.press(&["y"]), []);
    // The terminal shrinks under the question.
    console.update(Msg::Resize(60, 20));
    console.press(&["L"]);
    assert_shows(&console.screen(60, 20), &["Take control?"]);
    console.update(Msg::Resize(59, 20));
    assert_eq!(console.press(&["y"]), []);
    console.update(Msg::Resize(60, 20));
    assert_eq!(console.requests(&["L", "y"]), [OperatorRequest::TakeControl]);
}

/// Regression: the last line was cut before "A arms" at 80 columns.
#[test]
fn the_arming_checks_name_the_key_that_arms() {
    let mut console = on_hardware(Console::proposed());
    console.press(&["P"]);
    for (columns, rows) in [(60, 20), (80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        let last: Vec<&str> = screen.lines().skip(usize::from(rows) - 2).collect();
        assert_shows(&last.join(" "), &["A arms.", "q close."]);
    }
}

/// Regression: the keys of a jump in an empty table were those of the simulator, and a dialog said of `g` that it cancels.
#[test]
fn the_hints_of_a_real_robot_are_the_keys_that_it_takes() {
    let mut console = on_hardware(Console::ready());
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        let screen = console.screen(columns, rows);
        assert_shows(&screen, &["A arm: type stand, it stands up"]);
        assert_shows(&screen, &["g approve the jump; y: the area is clear; g: countdown and jump"]);
    }
    console.press(&["?"]);
    assert_shows(
        &console.screen(120, 60),
        &["approve the jump; y: the area is clear; again after 0.8 s: countdown and jump"],
    );
    assert_shows(&console.screen(120, 60), &["arm: type the letters that it asks for, the robot stands up"]);
    console.press(&["Esc", "g"]);
    assert_shows(&console.screen(80, 24), &["Enter, or any key but g     y the area is clear"]);
    assert_shows(&console.next_step(), &["Type y if the area is clear (trial #0). Any key but g cancels."]);
    // On the simulator they are shorter.
    let console = Console::ready();
    assert_shows(&console.screen(80, 24), &["A arm: it stands up ", "g approve the jump; again after 0.8 s"]);
}
