//! A recording read by the independent Python reader: every topic, its count and its values agree.

use crate::python_reader;
use crate::recording as support;
use python_reader::read_by_python;
use quadfrog::recording::record::{LogLevel, LogRecord, Record, Stamped};
use quadfrog::recording::writer::Writer;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JOINTS, Leg, joint_name};
use quadfrog::telemetry::{Mode, Tick};
use serde_json::{Value, json};
use support::*;

#[test]
fn python_reads_every_topic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let (mut ticks, mut records) = study(4);
    ticks[3990..].iter_mut().for_each(|tick| tick.mode = Mode::Fault);
    let stamped = |ms: u64, record| Stamped { time_ns: ms * MS, record };
    let log = LogRecord { level: LogLevel::Warning, source: "link".into(), message: "späte Antwort \u{1f438}".into() };
    records.push(stamped(3995, Record::Log(log)));
    records.push(stamped(3996, Record::FaultTicks(ticks[3900..3990].to_vec())));
    let attachment: [(&str, &str, &[u8]); 1] = [("config.toml", "application/toml", b"kp = 400.0\n")];
    let mut writer = Writer::create(&path, &session(), START_UTC_NS, &attachment).unwrap();
    writer.show(RobotDescription::embedded("go1").unwrap(), Box::new(|_| None)).unwrap();
    let everything = in_order(&ticks, &records);
    write_all(&mut writer, &everything);
    writer.finish().unwrap();
    assert_same(&play(&path), &everything);
    let Some(found) = read_by_python("read_mcap.py", &path) else { return };

    let of = |wanted: fn(&Record) -> bool| records.iter().filter(|stamped| wanted(&stamped.record)).count();
    let counts = json!({
        "/robot/tick": 4000, "/robot/joint_cmd": found["counts"]["/robot/joint_cmd"],
        "/robot/joint_states": 400, "/robot/pose": 400, "/tf": 400, "/scene/robot": 1,
        "/robot/counters": of(|record| matches!(record, Record::Counters(_))),
        "/session": 1, "/log": 1, "/fault": 1,
        "/opt/stage": of(|record| matches!(record, Record::Stage(_))),
        "/opt/proposal": of(|record| matches!(record, Record::Proposal(_))),
        "/opt/trial": of(|record| matches!(record, Record::Trial(_))),
        "/marker": 3, // two trials and a fault
    });
    assert_eq!(found["counts"], counts);
    let total: u64 = counts.as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(found["message_count"], total);
    assert_eq!((&found["profile"], &found["in_order"]), (&json!(""), &json!(true)));
    let schemas = [
        ("/robot/joint_states", "foxglove.JointStates"),
        ("/robot/joint_cmd", "frog.v1.JointCommand"),
        ("/robot/tick", "frog.v1.ControlTick"),
        ("/robot/pose", "foxglove.PoseInFrame"),
        ("/tf", "foxglove.FrameTransforms"),
        ("/opt/trial", "frog.v1.Trial"),
        ("/log", "foxglove.Log"),
    ];
    for (topic, schema) in schemas {
        assert_eq!(found["schemas"][topic], schema, "{topic}");
    }
    assert_eq!(found["attachments"]["config.toml"], "kp = 400.0\n");
    assert_eq!(found["metadata"]["session"]["task"], "forward");
    assert_eq!(found["metadata"]["session"]["start_utc_ns"], START_UTC_NS.to_string());
    assert_eq!(
        found["session"],
        json!({
            "robot": "go1", "seed": 7, "start_utc_ns": START_UTC_NS,
            "parameters": [["f0", 0.75, 1.75], ["Fx", 0.0, 150.0], ["Fz", 150.0, 350.0]],
        })
    );
    let some: [&Tick; 3] = [&ticks[0], &ticks[2000], &ticks[3999]];
    for (index, tick) in some.into_iter().enumerate() {
        let force = tick.state.truth.unwrap().foot_force_world[0].z;
        let mode = tick.mode.name().replace(' ', "_");
        let [roll, foot_z] = [tick.estimate.roll_pitch_yaw.x, tick.estimate.foot_position_leg[3].z];
        let expected = json!([START_UTC_NS + tick.time_ns, tick.number, roll, foot_z, force, mode]);
        assert_eq!(found["ticks"][index], expected);
        assert_eq!(found["positions"][index], json!(tick.state.joint_position_rad));
        assert_eq!(found["commands"][index], json!(tick.torque_demanded));
    }
    let state = &ticks[0].state;
    let joint =
        |i: usize| json!([format!("{}_joint", joint_name(i)), state.joint_position_rad[i], state.joint_torque_n_m[i]]);
    assert_eq!(found["joints"], (0..JOINTS).map(joint).collect::<Value>());
    // Once in each chunk with ticks: nothing but the torques changes.
    let commands = found["counts"]["/robot/joint_cmd"].as_u64().unwrap();
    assert!((1..=found["chunks"].as_u64().unwrap()).contains(&commands), "{commands}");
    let trials = json!([
        [0, { "f0": 1.25, "Fx": 100.0, "Fz": 250.0 }, null, null],
        [0, { "f0": 1.25, "Fx": 100.0, "Fz": 250.0 }, 0.0, 0],
        [1, { "f0": 1.25, "Fx": 101.0, "Fz": 250.0 }, null, null],
        [1, { "f0": 1.25, "Fx": 101.0, "Fz": 250.0 }, 0.1, 0],
    ]);
    assert_eq!(found["trials"], trials);
    let warning = 3; // foxglove.Log.Level.WARNING
    assert_eq!(found["logs"], json!([[warning, "link", "späte Antwort \u{1f438}", START_UTC_NS + 3995 * MS]]));
    assert_eq!(found["faults"], json!([(3900..3990).collect::<Vec<u64>>()]));
    frames_reach_the_feet(&found["first_frames"], &ticks[0]);
    println!("Python read {total} messages on {} topics and agrees", found["counts"].as_object().unwrap().len());
}

/// Asserts that the frames, chained from the trunk, give the feet of the closed-form kinematics up to their single precision.
fn frames_reach_the_feet(frames: &Value, tick: &Tick) {
    use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
    let frames = frames.as_array().unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    // The world's child is the trunk; the inertial unit and the feet are fixed links.
    assert_eq!(frames.len(), 1 + robot.links.len());
    let number = |value: &Value| value.as_f64().unwrap();
    let frame_of = |child: &str| frames.iter().find(|frame| frame[1] == child).unwrap();
    assert_eq!(frame_of("trunk")[0], "world");
    assert_eq!(frame_of("imu_link")[0], "trunk");
    for (leg, description) in Leg::ALL.into_iter().zip(&robot.legs) {
        let mut foot = Isometry3::identity();
        let mut parent = "trunk".to_owned();
        for name in ["hip", "thigh", "calf", "foot"] {
            let child = format!("{}_{name}", leg.name());
            let frame = frame_of(&child);
            assert_eq!(frame[0], parent.as_str());
            parent = child;
            let at = |i: usize| number(&frame[2][i]);
            let q = |i: usize| number(&frame[3][i]);
            let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q(3), q(0), q(1), q(2)));
            foot *= Isometry3::from_parts(Translation3::new(at(0), at(1), at(2)), rotation);
        }
        let angles = quadfrog::robot::leg_of(&tick.state.joint_position_rad, leg as usize);
        let position_leg = robot.leg_geometry.foot(&angles, leg.left_sign()).position_leg;
        let difference = foot.translation.vector - (description.joint_origin[0] + position_leg);
        assert!(difference.norm() < 2e-7, "{}: {difference:?}", leg.name());
    }
}
