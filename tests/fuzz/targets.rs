//! Targets of fuzzing: functions of arbitrary bytes that must neither panic nor use memory or time without bound. Shared by
//! the runner on stable Rust (`tests/fuzz/fuzz.rs`) and by cargo-fuzz (`fuzz/fuzz_targets`).

use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;

use quadfrog::config::{Config, ConfigLayer};
use quadfrog::optimize::journal::{JournalLine, JournalState, Operation};
use quadfrog::realtime::channel::StopLatch;
use quadfrog::recording::player::Player;
use quadfrog::recording::recover::recover;
use quadfrog::robot::description::{RobotDescription, RobotFiles};
use quadfrog::robot::go1::convert::{decode_motor, low_cmd, low_state, robot_state};
use quadfrog::robot::go1::packet::{COMMAND_LENGTH, CrcForm, HEAD, LowCmd, LowState, MOTORS, STATE_LENGTH, crc};
use quadfrog::robot::go2::message::{
    self as go2, CommandMessage, MessageRejection, RequestMessage, ResponseMessage, StateMessage,
};
use quadfrog_console::input::{KeyReader, NumberedEvent, SpaceBarIsText, TerminalEvent};
use quadfrog_console::settings::ConsoleSettings;

/// Files of the target `config`; the first byte of its input chooses one.
pub const CONFIG_FILES: [&str; 6] =
    ["control.toml", "safety.toml", "optimize.toml", "simulator.toml", "console.toml", "robot.toml"];

/// Datagrams of the Go1, as they came and with a right head and checksum, and messages of the Go2.
pub fn packets(bytes: &[u8]) {
    read_messages(bytes);
    read_packets(bytes);
    for (length, covered, sum_at) in [(STATE_LENGTH, 800, 803), (COMMAND_LENGTH, 608, 610)] {
        let mut repaired = bytes.to_vec();
        repaired.resize(length, 0);
        repaired[..2].copy_from_slice(&HEAD);
        let sum = crc(&repaired[..covered]);
        repaired[sum_at..sum_at + 4].copy_from_slice(&sum.to_le_bytes());
        read_packets(&repaired);
    }
}

fn read_packets(bytes: &[u8]) {
    for form in [CrcForm::Plain, CrcForm::Sealed] {
        if let Ok(command) = LowCmd::parse(bytes, form) {
            assert_eq!((command.bytes(), bytes[562]), (bytes, 0), "a command is its bytes and leaves the battery on");
            for motor in 0..MOTORS {
                let _ = decode_motor(&command.motor(motor));
            }
        }
    }
    if let Ok(state) = LowState::parse(bytes) {
        let state = robot_state(state, 1.0);
        let again = robot_state(&low_state(&state, 1.0), 1.0);
        assert_eq!((again.robot_time_ms, again.motor_enabled), (state.robot_time_ms, state.motor_enabled));
        let mut command = quadfrog::robot::JointCommand::default();
        for (motor, position) in command.motor.iter_mut().zip(state.joint_position_rad) {
            (motor.position_rad, motor.kp_joint) = (position, position);
        }
        if let Ok(command) = low_cmd(&command, CrcForm::Plain) {
            assert_eq!(command.bytes()[562], 0, "no command switches the battery off");
        }
    }
}

/// Messages of the Go2, as they came and with a right checksum: what is accepted is encoded again, or refused.
fn read_messages(bytes: &[u8]) {
    let mut repaired = bytes.to_vec();
    repaired.resize(go2::STATE_LENGTH, 0);
    if let Err(MessageRejection::Checksum { computed, .. }) = StateMessage::decode(&repaired) {
        repaired[go2::STATE_LENGTH - 4..].copy_from_slice(&computed.to_le_bytes());
    }
    let state = StateMessage::decode(&repaired).expect("the checksum is right");
    let again = StateMessage::decode(&state.encode()).expect("a state that was encoded");
    assert_eq!((again.tick, again.foot_force, again.battery), (state.tick, state.foot_force, state.battery));
    repaired.truncate(go2::COMMAND_LENGTH);
    if let Err(MessageRejection::Checksum { computed, .. }) = CommandMessage::decode(&repaired) {
        repaired[go2::COMMAND_LENGTH - 4..].copy_from_slice(&computed.to_le_bytes());
    }
    if let Ok(command) = CommandMessage::decode(&repaired).expect("the checksum is right").encode() {
        assert_eq!(command.bytes()[740..744], [0; 4], "no command switches the battery off");
    }
    for part in [Some(bytes), go2::payload(bytes).ok()].into_iter().flatten() {
        if let Ok(request) = RequestMessage::decode(part) {
            assert_eq!(RequestMessage::decode(&request.encode()), Ok(request));
        }
        if let Ok(response) = ResponseMessage::decode(part) {
            assert_eq!(ResponseMessage::decode(&response.encode()), Ok(response));
        }
    }
}

/// Lines of a journal. An accepted line is written as a line that is read alike.
pub fn journal(bytes: &[u8]) {
    let mut state = JournalState::default();
    for line in String::from_utf8_lossy(bytes).split('\n') {
        let Ok(JournalLine { worker, operation, times }) = Operation::parse(line) else { continue };
        let written = operation.to_line(&worker, times);
        let JournalLine { worker: reader, operation: read, .. } =
            Operation::parse(written.trim_end()).expect("a written line is readable");
        assert_eq!((&reader, read.to_line(&reader, times)), (&worker, written), "a line changed by being read");
        state.apply(operation, &worker);
    }
    for study in state.studies() {
        assert!(study.trials.iter().enumerate().all(|(i, trial)| trial.number as usize == i));
    }
}

/// A recording: opened, played, searched, and recovered.
pub fn player(bytes: &[u8]) {
    let file = scratch("fuzz.mcap");
    fs::write(&file, bytes).expect("written");
    if let Ok(mut player) = Player::open(&file) {
        let length = player.duration_ns();
        player.by_ref().for_each(drop);
        player.seek(length / 2);
        player.by_ref().take(10).for_each(drop);
        let _ = (player.damage(), player.attachment("config.toml"), player.markers().len());
    }
    if let Ok(recovered) = recover(&file) {
        let played = Player::open(&recovered.path).map(|player| player.count());
        fs::remove_file(&recovered.path).expect("removed");
        // Without a session, or with a damaged one, nothing is played.
        let _ = played;
    }
}

/// A robot's description.
pub fn urdf(bytes: &[u8]) {
    fs::write(scratch("robot.toml"), include_str!("../../robots/go1/robot.toml")).expect("written");
    fs::write(scratch("go1.urdf"), bytes).expect("written");
    if let Ok(robot) = RobotDescription::from_folder(&folder()) {
        assert!(robot.total_mass().is_finite() && robot.total_mass() > 0.0);
    }
}

/// A file of the configuration, or `robot.toml`.
pub fn config(bytes: &[u8]) {
    let Some((first, text)) = bytes.split_first() else { return };
    let file = CONFIG_FILES[usize::from(*first) % CONFIG_FILES.len()];
    let text = String::from_utf8_lossy(text);
    if file == "robot.toml" {
        fs::write(scratch("robot.toml"), &*text).expect("written");
        fs::write(scratch("go1.urdf"), include_str!("../../robots/go1/go1.urdf")).expect("written");
        let _ = RobotFiles::from_folder(&folder()).and_then(|files| files.description());
        return;
    }
    match Config::layered(&[ConfigLayer { file, origin: "fuzz.toml", text: &text }]) {
        Ok(config) => drop(ConsoleSettings::from_table(&config.console)),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// A terminal's bytes. Every byte of Ctrl-C and Ctrl-Space stops, and of Space where no paste is possible (in a paste it is
/// text); splits change no event.
pub fn keys(bytes: &[u8]) {
    let Some((first, stream)) = bytes.split_first() else { return };
    let pastes = first & 1 == 1;
    let read = |length: usize| {
        let stop = StopLatch::default();
        let mut reader = KeyReader::new(pastes, Some(stop.clone()), SpaceBarIsText::default());
        let mut events: Vec<NumberedEvent> = Vec::new();
        for part in stream.chunks(length) {
            let before = stop.count();
            reader.take(part, |event| events.push(event));
            let stopping = |byte: &&u8| matches!(byte, 0x03 | 0x00) || **byte == b' ' && !pastes;
            let stops = part.iter().filter(stopping).count() as u64;
            assert!(stop.count() - before >= stops, "a STOP is lost");
        }
        let _ = reader.wait();
        reader.idle(|event| events.push(event));
        events
    };
    let events = read(1);
    assert_eq!(events, read(1 + usize::from(first >> 1)), "a split changes the events");
    let pasted = events.iter().map(|event| match &event.event {
        TerminalEvent::Paste(text) => text.chars().count(),
        _ => 1,
    });
    // A byte that is no character becomes one; a sequence that is none may leave its key.
    assert!(pasted.sum::<usize>() <= 2 * stream.len() + 1, "more inputs than bytes");
}

/// Removes the files of this thread's inputs.
pub fn clean() {
    let _ = fs::remove_dir_all(folder());
    // The process's folder, once no thread has one in it.
    let _ = folder().parent().map(fs::remove_dir);
}

/// The folder of the files of this process's present thread.
fn folder() -> PathBuf {
    static FOLDERS: OnceLock<PathBuf> = OnceLock::new();
    let base = FOLDERS.get_or_init(|| {
        let memory = PathBuf::from("/dev/shm");
        let base = if memory.is_dir() { memory } else { std::env::temp_dir() };
        base.join(format!("quadfrog-fuzz-{}", std::process::id()))
    });
    base.join(format!("{:?}", std::thread::current().id()))
}

/// A file in [`folder`].
fn scratch(name: &str) -> PathBuf {
    let folder = folder();
    fs::create_dir_all(&folder).expect("a folder");
    folder.join(name)
}
