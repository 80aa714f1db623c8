//! Recordings that the program itself wrote, read by other people's readers.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use crate::program::Program;
use crate::pty::Session;
use crate::python_reader::read_by_python;
use crate::skip::skip;
use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::{Record, Stamped};
use quadfrog::robot::description::RobotDescription;
use quadfrog::telemetry::Mode;
use serde_json::Value;

const SIZE: (u16, u16) = (100, 30);

/// Returns what viewers need of a recording; none without Python or its packages.
fn inspected(path: &Path) -> Option<Value> {
    read_by_python("inspect_recording.py", path)
}

/// Writes the robot `go1` with other names of links and joints as the model folder `robot`.
fn renamed_robot(program: &Program) {
    for (name, text) in &RobotDescription::embedded("go1").unwrap().files {
        let text = text.replace("FR_", "front_right_").replace("\"trunk\"", "\"torso\"").replace("\"go1\"", "\"pony\"");
        program.write(&format!("robot/{name}"), &text);
    }
}

fn names(value: &Value) -> Vec<&str> {
    value.as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect()
}

/// Asserts that the file shows a moving robot: frames of all links at 100 Hz, names and shapes of the URDF.
fn shows_a_robot(found: &Value, root: &str, hip: &str) {
    let robot = &found["metadata"]["robot"];
    let (kept, shown) = (robot["urdf"].as_str().unwrap(), robot["urdf_with_shapes"].as_str().unwrap());
    let (kept, shown) = (&found["urdf"][kept], &found["urdf"][shown]);
    assert_eq!(kept["links"], shown["links"]);
    assert_eq!(kept["joints"], shown["joints"]);
    assert_eq!(kept["collision"], shown["visual"], "every shape of a collision is one to look at");
    assert_eq!(robot["root_link"], root);

    // Every link is a child exactly once; the trunk's parent is the world.
    let frames = found["frames"].as_array().unwrap();
    assert!(frames.iter().any(|pair| pair[0] == "world" && pair[1] == root), "{frames:?}");
    let mut children: Vec<&str> = frames.iter().map(|pair| pair[1].as_str().unwrap()).collect();
    children.sort_unstable();
    assert_eq!(children, names(&kept["links"]));
    assert_eq!(found["frames_change"], false);
    // One with each pose, and none twice within 10 ms.
    let times: Vec<u64> = found["tf_times"].as_array().unwrap().iter().map(|time| time.as_u64().unwrap()).collect();
    assert_eq!(found["counts"]["/robot/pose"], times.len());
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]));

    let [joints] = &found["joints"].as_array().unwrap()[..] else { panic!("one set of joint names") };
    assert_eq!(joints[0], hip);
    let mut joints = names(joints);
    joints.sort_unstable();
    assert_eq!(joints, names(&kept["joints"]));

    // Shapes hang on links; every leg has its foot.
    let shapes = found["shapes"].as_object().unwrap();
    assert!(shapes.keys().all(|frame| children.contains(&frame.as_str())), "{shapes:?}");
    assert!(shapes.len() == 13 && shapes.values().all(|count| count.as_u64() > Some(0)), "{shapes:?}");
}

#[test]
fn a_recording_shows_a_moving_robot() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "2", "--record", "all"]);
    let Some(found) = inspected(&program.study("recordings").join("session.mcap")) else { return };
    shows_a_robot(&found, "trunk", "FR_hip_joint");
    // Simulated time has no gaps: 100 Hz.
    let ticks = found["counts"]["/robot/tick"].as_u64().unwrap();
    assert!(found["counts"]["/tf"].as_u64().unwrap().abs_diff(ticks / 10) <= 2, "{}", found["counts"]);
    // Flat ground does not change.
    assert_eq!(found["ground"], serde_json::json!([{ "cubes": [1], "tops": [0.0] }]));
}

#[test]
fn the_recording_of_a_model_folder_has_the_names_of_its_urdf() {
    let program = Program::new();
    renamed_robot(&program);
    program.text(&["optimize", "--trials", "1", "--model", "robot"]);
    let Some(found) = inspected(&program.study("recordings").join("session.mcap")) else { return };
    shows_a_robot(&found, "torso", "front_right_hip_joint");
    assert_eq!(found["metadata"]["robot"]["name"], "pony");
}

#[test]
fn the_blocks_of_each_trial_are_in_its_recording() {
    let program = Program::new();
    program.write("config/simulator.toml", "[terrain]\nkind = \"blocks\"\n[terrain.blocks]\ncount = 30\n");
    program.text(&["optimize", "--trials", "3", "--record", "all", "--config", "config"]);
    let Some(found) = inspected(&program.study("recordings").join("session.mcap")) else { return };
    let ground = found["ground"].as_array().unwrap();
    // At the start, and for each of the three trials, whose seeds differ.
    assert_eq!(ground.len(), 4);
    for ground in ground {
        assert!(ground["cubes"][1].as_u64().is_some_and(|count| (2..=30).contains(&count)), "{ground}");
    }
}

#[test]
fn rerun_finds_the_transforms() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "all"]);
    let recording = program.study("recordings").join("session.mcap");
    let rerun = |arguments: &[&str]| {
        let run = Command::new("rerun").args(arguments).current_dir(program.path("")).output();
        match run {
            Ok(output) if output.status.success() => Some(String::from_utf8_lossy(&output.stdout).into_owned()),
            Ok(output) => panic!("rerun {arguments:?}: {}", String::from_utf8_lossy(&output.stderr)),
            Err(error) => {
                skip(&format!("rerun of rerun-sdk cannot be started: {error}"));
                None
            }
        }
    };
    let recording = recording.to_str().unwrap();
    if rerun(&["mcap", "check", recording]).is_none() {
        return;
    }
    rerun(&["mcap", "convert", recording, "-o", "session.rrd"]);
    let printed = rerun(&["rrd", "print", "-v", "session.rrd"]).unwrap();
    assert!(printed.contains("Transform3D"), "no Transform3D:\n{}", &printed[..printed.len().min(4000)]);
}

#[test]
fn a_study_without_a_screen_records_the_topics_of_the_console() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "2", "--record", "all"]);
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::start(folder.path(), SIZE, &["--approve", "auto", "--trials", "2"]);
    session.wait_for_long("two trials", || session.screen().contains("finished"));
    session.send("qy");
    session.wait();
    let study = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
    let Some(console) = inspected(&study.join("session.mcap")) else { return };
    let Some(headless) = inspected(&program.study("recordings").join("session.mcap")) else { return };
    let topics = |found: &Value| found["counts"].as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>();
    shows_a_robot(&console, "trunk", "FR_hip_joint");
    // Nothing is armed in simulated time; the console records arming checks that change their state.
    let mut of_console = topics(&console);
    of_console.remove("/safety/pre_arm");
    assert_eq!(topics(&headless), of_console);
    // The console's robot stood up and waited in real time; its trials are those of the simulator all the same.
    let verified = program.run(&["verify", study.join("session.mcap").to_str().unwrap()]);
    assert_eq!(verified.status.code(), Some(0), "{}", String::from_utf8_lossy(&verified.stderr));
    // Two trials: mode by mode, counters ten times a second.
    for found in [&console, &headless] {
        assert!(found["counts"]["/fsm"].as_u64() >= Some(8), "{}", found["counts"]);
        assert!(!found["logs"].as_array().unwrap().is_empty());
    }
    let per_second = headless["counts"]["/robot/tick"].as_u64().unwrap() / 100;
    let counters = headless["counts"]["/robot/counters"].as_u64().unwrap();
    assert!(counters.abs_diff(per_second) <= 2, "{counters} counters in {per_second} tenths of a second");
}

/// The text of an attachment.
/// Regression: a change of mode had the time of the tick before it.
#[test]
fn a_change_of_mode_has_the_time_of_its_first_tick() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "6", "--seed", "0", "--record", "all"]);
    let file = program.study("recordings").join("session.mcap");
    let (mut mode, mut of_ticks, mut recorded) = (Mode::Ready, Vec::new(), Vec::new());
    for played in Player::open(&file).unwrap() {
        match played {
            Played::Tick(tick) if tick.mode != mode => {
                mode = tick.mode;
                of_ticks.push((tick.time_ns, mode));
            }
            Played::Record(Stamped { time_ns, record: Record::Transition(change) }) => {
                recorded.push((time_ns, change.to));
            }
            _ => {}
        }
    }
    // The robot of a study without a screen stands at the begin of each trial: that is no change.
    of_ticks.retain(|(_, mode)| *mode != Mode::Ready);
    assert!(recorded.iter().any(|(_, mode)| *mode == Mode::Damped), "{recorded:?}");
    assert_eq!(recorded, of_ticks);
}

fn attached<'a>(found: &'a Value, name: &str) -> &'a str {
    found["attachments"][name].as_str().unwrap_or_else(|| panic!("no {name}: {:?}", found["attachments"]))
}

#[test]
fn a_session_can_be_rebuilt_from_its_file_alone() {
    let program = Program::new();
    renamed_robot(&program);
    program.write("config/safety.toml", "[fall]\nroll_rad = 0.97\n");
    let arguments = ["--model", "robot", "--config", "config", "--operator", "Anna Lindh", "--seed", "5"];
    let run = ["optimize", "--trials", "2", "--record", "all"];
    let printed = program.trials(&[&run[..], &["--json"], &arguments].concat());
    let study = program.study("recordings");
    let Some(found) = inspected(&study.join("session.mcap")) else { return };

    let session = &found["metadata"]["session"];
    assert_eq!(session["operator"], "Anna Lindh");
    assert_eq!(session["version"], env!("CARGO_PKG_VERSION"));
    let host =
        std::fs::read_to_string("/proc/sys/kernel/hostname").map_or("unknown".into(), |host| host.trim().to_owned());
    assert_eq!(session["host"], host.as_str());
    let commit = session["commit"].as_str().unwrap();
    let hexadecimal = commit.len() >= 40 && commit.chars().all(|digit| digit.is_ascii_hexdigit());
    assert!(commit == "unknown" || hexadecimal, "{commit}");
    assert!(session["parameters"].as_str().unwrap().contains("f0 0.75..1.75 Hz"), "{session}");
    assert_eq!(found["counts"]["/session"], 1);

    // The whole configuration with the keys of the console, the robot, and the sources of the messages.
    for name in ["control", "console", "optimize", "prior", "safety", "simulator"] {
        let kept = std::fs::read_to_string(study.join(format!("config/{name}.toml"))).unwrap();
        assert_eq!(attached(&found, &format!("{name}.toml")), kept);
    }
    assert!(attached(&found, "safety.toml").contains("roll_rad = 0.97"));
    assert!(attached(&found, "console.toml").contains("[keys"), "the keymap");
    for (name, path) in [("robot.toml", "robot/robot.toml"), ("go1.urdf", "robot/go1.urdf")] {
        assert_eq!(attached(&found, name), std::fs::read_to_string(program.path(path)).unwrap());
    }
    let proto = concat!(env!("CARGO_MANIFEST_DIR"), "/../proto/frog.proto");
    assert_eq!(attached(&found, "frog.proto"), std::fs::read_to_string(proto).unwrap());

    // Seeds and times of the trials, in their rows and in the table.
    let rows = found["trials"].as_array().unwrap();
    let table = attached(&found, "trials.csv");
    let mut lines = table.lines();
    assert!(
        lines
            .next()
            .unwrap()
            .starts_with("trial,source,parent,verdict,judged_by,cause,value,hand_value,seed,start_ns,end_ns,f0,")
    );
    let mut last_end = 0;
    for (trial, line) in (0_u64..).zip(lines) {
        let row = rows.iter().rfind(|row| row[0] == trial).unwrap();
        let [seed, start, end] = [&row[2], &row[3], &row[4]].map(|value| value.as_u64().unwrap());
        assert!(start > last_end && end - start > 1_000_000_000 && end - start < 10_000_000_000, "{row}");
        last_end = end;
        assert!(line.contains(&format!(",{seed},{start},{end},")), "{line}");
        let value = printed[trial as usize]["value"].as_f64().unwrap();
        assert!(line.contains(&format!(",{value},")), "{value}: {line}");
    }
    assert_eq!(table.lines().count(), 3);
}

#[test]
fn a_tick_of_a_jump_takes_at_most_400_bytes() {
    let program = Program::new();
    program.write("noisy/simulator.toml", "[sensors]\nenabled = true\n");
    // Sensor errors make the simulator's truth another set of numbers than the robot's state.
    for (arguments, most) in [(&[][..], 400.0), (&["--config", "noisy"], 430.0)] {
        program.text(&[&["optimize", "--trials", "3", "--record", "all", "--output", "out"], arguments].concat());
        let study = program.studies("out").pop().unwrap();
        let Some(found) = inspected(&study.join("session.mcap")) else { return };
        let bytes = found["bytes_a_tick_of_jumps"].as_f64().unwrap();
        assert!((100.0..=most).contains(&bytes), "{bytes} bytes");
        std::fs::remove_dir_all(program.path("out")).unwrap();
    }
}

#[test]
fn units_are_in_the_file() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "all"]);
    let Some(found) = inspected(&program.study("recordings").join("session.mcap")) else { return };
    let unit = |topic: &str, field: &str| found["channels"][topic][field].as_str().unwrap_or_default().to_owned();
    assert_eq!(unit("/robot/tick", "roll"), "rad");
    assert_eq!(unit("/robot/tick", "truth.velocity_z"), "world, m/s");
    assert_eq!(unit("/robot/joint_cmd", "kp"), "N m/rad");
    assert_eq!(unit("/robot/joint_states", "joints.effort"), "N m");
    assert_eq!(unit("/opt/trial", "measured.dyaw"), "counterclockwise, unwrapped, rad");
    assert_eq!(unit("/robot/counters", "link.state_age_ms"), "age of the newest valid state");
}

#[test]
fn an_operator_without_a_name_is_refused() {
    let program = Program::new();
    for name in ["", " ", "Anna\u{1b}[2J"] {
        let message = program.refused(&["optimize", "--trials", "1", "--operator", name]);
        assert!(message.contains("--operator") && !message.contains('\u{1b}'), "{message:?}");
    }
    assert!(program.studies("recordings").is_empty());
}

/// Modes and numbers of the ticks of a console session in which the robot waits disarmed, stands up and the session ends.
fn waited_and_stood_up(arguments: &[&str]) -> Vec<(Mode, u64)> {
    let (folder, mut session) = Session::opened(SIZE, arguments);
    std::thread::sleep(std::time::Duration::from_secs(1));
    session.send("A");
    session.wait_for(&["READY"]);
    session.send("qy");
    session.wait();
    let mut studies = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
    let study = studies.find(|path| path.join("session.mcap").is_file()).expect("a finished recording");
    Player::open(study.join("session.mcap"))
        .unwrap()
        .filter_map(|played| match played {
            Played::Tick(tick) => Some((tick.mode, tick.number)),
            Played::Record(_) => None,
        })
        .collect()
}

#[test]
fn ten_ticks_a_second_are_recorded_while_the_robot_is_disarmed() {
    let idle = |mode| matches!(mode, Mode::Offline | Mode::Observe | Mode::Disarmed);
    let ticks = waited_and_stood_up(&[]);
    let armed = ticks.iter().position(|(mode, _)| !idle(*mode)).expect("the robot stood up");
    assert!((3..500).contains(&armed), "{armed} ticks while disarmed");
    for pair in ticks.windows(2) {
        let [(before, last), (mode, number)] = pair else { continue };
        if idle(*mode) && before == mode {
            assert!(number % 100 == 0, "tick {number} of {mode:?} after {last}");
        } else if !idle(*mode) && !idle(*before) {
            assert_eq!(*number, last + 1, "no tick is left out while the robot is armed");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("control.toml"), "[recording]\nfull_rate = true\n").unwrap();
    let whole = waited_and_stood_up(&["--config", folder.path().to_str().unwrap()]);
    assert!(whole.windows(2).all(|pair| pair[1].1 == pair[0].1 + 1), "every tick with full_rate");
    assert!(whole.iter().take_while(|(mode, _)| idle(*mode)).count() > 900);
}

#[test]
fn a_recovered_recording_keeps_its_units() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "all"]);
    let whole = std::fs::read(program.study("recordings").join("session.mcap")).unwrap();
    std::fs::write(program.path("cut.mcap.part"), &whole[..whole.len() * 2 / 3]).unwrap();
    program.text(&["recover", "cut.mcap.part"]);
    let Some(found) = inspected(&program.path("cut.mcap")) else { return };
    assert_eq!(found["channels"]["/robot/tick"]["roll"], "rad");
}
