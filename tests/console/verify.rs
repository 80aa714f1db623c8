//! `quadfrog verify` on files that the program itself wrote, whole and altered.

use std::path::{Path, PathBuf};

use crate::program::{Program, assert_shows};
use crate::pty::Session;
use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::SessionInfo;
use quadfrog::recording::writer::Writer;
use quadfrog::robot::description::RobotDescription;
use quadfrog::telemetry::Tick;
use quadfrog::trial::Backend;

/// Attachments from which a session is simulated again.
pub const PARTS: [&str; 8] = [
    "control.toml",
    "safety.toml",
    "optimize.toml",
    "simulator.toml",
    "prior.toml",
    "console.toml",
    "robot.toml",
    "go1.urdf",
];

/// Copies a recording with the given attachments and with ticks changed by `change`; one without a result is left out.
pub fn copied(from: &Path, to: PathBuf, parts: &[&str], mut change: impl FnMut(Tick) -> Option<Tick>) -> PathBuf {
    let mut player = Player::open(from).unwrap();
    let attached: Vec<_> = parts.iter().map(|name| (*name, player.attachment(name).unwrap().unwrap())).collect();
    let attachments: Vec<(&str, &str, &[u8])> =
        attached.iter().map(|(name, bytes)| (*name, "text/plain", bytes.as_slice())).collect();
    let (session, start_utc_ns) = (player.session().clone(), player.start_utc_ns());
    let mut writer = Writer::create(&to, &session, start_utc_ns, &attachments).unwrap();
    for played in player {
        match played {
            Played::Tick(tick) => change(*tick).iter().for_each(|tick| writer.tick(tick).unwrap()),
            Played::Record(stamped) => writer.record(&stamped).unwrap(),
        }
    }
    writer.finish().unwrap()
}

/// Exit status, standard output and standard error of a verification.
fn verified(program: &Program, file: &Path) -> (Option<i32>, String, String) {
    let output = program.run(&["verify", file.to_str().unwrap()]);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

fn ticks_of_trials(file: &Path) -> usize {
    Player::open(file).unwrap().filter(|played| matches!(played, Played::Tick(tick) if tick.trial.is_some())).count()
}

#[test]
fn a_fresh_recording_is_simulated_again_bit_for_bit() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "3", "--record", "all"]);
    let file = program.study("recordings").join("session.mcap");
    let (status, out, error) = verified(&program, &file);
    assert_eq!(status, Some(0), "{error}");
    assert_shows(&out, &[&format!("{} ticks of 3 trials", ticks_of_trials(&file)), "bit for bit"]);
}

#[test]
fn blocks_sensor_errors_repeats_and_a_model_folder_are_simulated_again() {
    let program = Program::new();
    for (name, text) in &RobotDescription::embedded("go1").unwrap().files {
        program
            .write(&format!("robot/{name}"), &text.replace("\"go1\"", "\"pony\"").replace("5.561079999999999", "5.4"));
    }
    program.write(
        "config/simulator.toml",
        "[terrain]\nkind = \"blocks\"\n[terrain.blocks]\ncount = 20\n[sensors]\nenabled = true\n",
    );
    program.write("config/control.toml", "[tasks.forward]\nrepeats = 2\n");
    program.text(&["optimize", "--trials", "3", "--record", "all", "--config", "config", "--model", "robot"]);
    // Nothing but the file is needed.
    let file = program.study("recordings").join("session.mcap");
    let elsewhere = Program::new();
    let (status, out, error) = verified(&elsewhere, &file);
    assert_eq!(status, Some(0), "{error}");
    assert_shows(&out, &["of 3 trials", "bit for bit"]);
}

#[test]
fn a_flipped_bit_is_found() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "2", "--record", "all"]);
    let file = program.study("recordings").join("session.mcap");
    let same = copied(&file, program.path("same.mcap"), &PARTS, Some);
    assert_eq!(verified(&program, &same).0, Some(0));

    let mut altered = None;
    let flipped = copied(&file, program.path("flipped.mcap"), &PARTS, |mut tick| {
        if tick.trial == Some(1) && tick.trial_time_s >= 0.1 && altered.is_none() {
            let value = &mut tick.state.joint_velocity_rad_s[7];
            let before = *value;
            // The last bit that a recording keeps.
            *value = f64::from_bits(value.to_bits() ^ 1 << 29);
            altered = Some((tick.number, before, *value));
        }
        Some(tick)
    });
    let (number, before, after) = altered.unwrap();
    let (status, _, error) = verified(&program, &flipped);
    assert_eq!(status, Some(1), "{error}");
    assert_shows(
        &error,
        &["trial 1", &format!("number {number}"), "velocity[7]", &before.to_string(), &after.to_string()],
    );

    // A tick that is missing, and a last one.
    for last in [false, true] {
        let name = program.path(if last { "short.mcap" } else { "gap.mcap" });
        let total = ticks_of_trials(&file);
        let mut seen = 0;
        let missing = copied(&file, name, &PARTS, |tick| {
            seen += usize::from(tick.trial.is_some());
            let left_out = tick.trial.is_some() && seen == if last { total } else { 100 };
            (!left_out).then_some(tick)
        });
        assert_eq!(verified(&program, &missing).0, Some(1), "last: {last}");
    }
}

#[test]
fn a_file_that_cannot_be_verified_is_refused_with_the_reason() {
    let program = Program::new();
    let old = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/console/session.mcap"));
    let (status, _, error) = verified(&program, old);
    assert_eq!(status, Some(2), "{error}");
    assert_shows(&error, &["session.mcap", "not verifiable", "older version"]);

    program.text(&["optimize", "--trials", "1", "--record", "all"]);
    let file = program.study("recordings").join("session.mcap");
    let without = copied(&file, program.path("without.mcap"), &PARTS[..7], Some);
    let (status, _, error) = verified(&program, &without);
    assert_eq!(status, Some(2), "{error}");
    assert_shows(&error, &["without.mcap", "go1.urdf is not attached"]);

    let player = Player::open(&file).unwrap();
    let session = SessionInfo { backend: Some(Backend::Hardware), ..player.session().clone() };
    let robot = program.path("robot.mcap");
    Writer::create(&robot, &session, player.start_utc_ns(), &[]).unwrap().finish().unwrap();
    let (status, _, error) = verified(&program, &robot);
    assert_eq!(status, Some(2), "{error}");
    assert_shows(&error, &["robot.mcap", "recorded on a robot"]);

    // Regression: of a file that was only read it said that it could not be written.
    let mut bytes = std::fs::read(&file).unwrap();
    let at = bytes.windows(12).position(|bytes| bytes == b"control.toml").expect("an attachment");
    bytes[at + 100] ^= 1;
    std::fs::write(program.path("flipped.mcap"), bytes).unwrap();
    let (status, _, error) = verified(&program, &program.path("flipped.mcap"));
    assert_eq!(status, Some(2), "{error}");
    assert_shows(&error, &["flipped.mcap: could not read: Attachment CRC failed"]);

    program.write("noise.mcap", "this is no recording");
    assert_eq!(verified(&program, &program.path("noise.mcap")).0, Some(2));
    assert_eq!(verified(&program, &program.path("nothing.mcap")).0, Some(2));
}

/// Regression: the ticks that a damaged chunk has lost were reported as a difference of the simulation.
#[test]
fn damage_is_no_difference_of_the_simulation() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "3", "--record", "all"]);
    let mut bytes = std::fs::read(program.study("recordings").join("session.mcap")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(program.path("damaged.mcap"), bytes).unwrap();
    let (status, _, error) = verified(&program, &program.path("damaged.mcap"));
    assert_eq!(status, Some(2), "{error}");
    assert_shows(&error, &["damaged.mcap: not verifiable: it is damaged: 1 of "]);
    assert_shows(&error, &["; `quadfrog recover ", "damaged.mcap` keeps what can be read"]);
    assert!(!error.contains("in the simulation"), "{error}");
    // Regression: once the file was recovered they were.
    program.text(&["recover", "damaged.mcap"]);
    let (status, _, error) = verified(&program, &program.path("damaged.recovered.mcap"));
    assert_eq!(status, Some(2), "{error}");
    assert_shows(&error, &["not verifiable: it was recovered from a file that was not whole: 1 of "]);
    assert!(!error.contains("in the simulation"), "{error}");
}

/// Of a recording whose session was killed every trial that came to its own end is verified, and the loss of its end is reported.
#[test]
fn a_loss_before_a_recovery_is_reported_beside_equal_ticks() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "3", "--record", "all"]);
    let bytes = std::fs::read(program.study("recordings").join("session.mcap")).unwrap();
    std::fs::write(program.path("cut.mcap.part"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    program.text(&["recover", "cut.mcap.part"]);
    let (status, out, error) = verified(&program, &program.path("cut.mcap"));
    assert_eq!(status, Some(0), "{error}");
    assert_shows(&out, &["bit for bit"]);
    assert_shows(&error, &["cut.mcap: recovered from a file that was not whole: it was cut off"]);
}

/// Regression: of a trial with repeats that was continued, the rollouts of the session before were expected in the next file, too;
/// one that a person had stopped was expected to go on to its end.
#[test]
fn stopped_and_continued_rollouts_of_a_trial_are_no_difference() {
    let program = Program::new();
    program.write("config/control.toml", "[tasks.forward]\nrepeats = 2\n");
    let recordings = program.path("recordings");
    std::fs::create_dir(&recordings).unwrap();
    let start = |arguments: &[&str]| Session::start(&recordings, (100, 30), arguments);
    let jump = |session: &mut Session| {
        session.send("A");
        session.wait_for(&["Press g twice"]);
        session.approve();
    };
    let mut session = start(&["--config", "../config"]);
    session.wait_for(&["Press A to arm"]);
    jump(&mut session);
    session.wait_for(&["JUMP"]);
    session.send("\x1b[24~");
    session.wait_for(&["judge it"]);
    session.send("v");
    session.wait_for(&["u undo #0"]);
    session.send("k");
    session.wait_for(&["repeat 1 of 2", "Press A to arm"]);
    jump(&mut session);
    session.wait_for(&["judge it"]);
    session.send("a");
    session.wait_for(&["repeat 2 of 2"]);
    assert!(session.quit().success(), "{}", session.screen());

    let study = program.study("recordings");
    let mut session = start(&["--resume", study.to_str().unwrap()]);
    session.wait_for(&["repeat 2 of 2", "Press A to arm"]);
    jump(&mut session);
    session.wait_for(&["judge it"]);
    session.send("a");
    session.wait_for(&["Trial #2"]);
    assert!(session.quit().success(), "{}", session.screen());

    let (status, out, error) = verified(&program, &study);
    assert_eq!(status, Some(0), "{error}");
    let ended = "not compared, because a person, a fault or a crash ended it: rollout 1 of trial 0\n";
    assert_shows(&out, &["ticks of 1 trial are simulated again", ended]);
    assert_eq!(out.matches("bit for bit").count(), 2, "{out}");
    assert_eq!(out.matches("not compared").count(), 1, "{out}");
}
