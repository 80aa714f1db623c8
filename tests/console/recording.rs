//! Recordings that the program itself wrote, read by other people's readers.

#[path = "support/program.rs"]
mod program;

use std::path::Path;
use std::process::Command;

use program::Program;
use quadfrog::robot::description::RobotDescription;
use serde_json::Value;

/// Reads a recording with Python; none where Python or its packages are absent.
fn inspected(path: &Path) -> Option<Value> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/support/inspect_recording.py");
    let output = match Command::new("python3").arg(script).arg(path).output() {
        Ok(output) => output,
        Err(error) => {
            println!("skipped: python3 cannot be started: {error}");
            return None;
        }
    };
    let stderr = String::from_utf8_lossy(&output.stderr);
    if output.status.code() == Some(77) {
        println!("skipped: pip install mcap mcap-protobuf-support ({})", stderr.trim());
        return None;
    }
    assert!(output.status.success(), "{stderr}");
    Some(serde_json::from_slice(&output.stdout).unwrap())
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
    let times: Vec<u64> = found["tf_times"].as_array().unwrap().iter().map(|time| time.as_u64().unwrap()).collect();
    let span_ms = (times[times.len() - 1] - times[0]) / 1_000_000;
    assert!(times.len() as u64 >= span_ms / 10, "{} frames in {span_ms} ms", times.len());

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
                println!("skipped: pip install rerun-sdk ({error})");
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
