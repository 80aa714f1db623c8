//! The robot of a study that is continued: that of its folder, not another one of the same name.

use std::fs;

use crate::program::{Program, assert_shows};

const A1: &str = include_str!("../../robots/a1/a1.urdf");
const A1_TOML: &str = include_str!("../../robots/a1/robot.toml");

/// A study of three trials of a robot that has the name of the built-in A1, a lighter trunk and bounds of its own, and its folder.
fn study_of_a_light_a1() -> (Program, String) {
    let program = Program::new();
    assert!(A1.contains("<mass value=\"6\"/>"));
    program.write("light/a1.urdf", &A1.replace("<mass value=\"6\"/>", "<mass value=\"5.5\"/>"));
    program.write("light/robot.toml", A1_TOML);
    program.write("light/config/optimize.toml", "[bounds]\nFz = [200.0, 220.0]\n");
    let first = ["optimize", "--model", "light", "--trials", "3", "--sampler", "sobol", "--record", "none"];
    program.text(&first);
    let study = program.study("recordings").to_str().unwrap().to_owned();
    (program, study)
}

/// Regression: without `--model` the study was refused with the remedy `--model a1`, which continued it with the built-in A1.
#[test]
fn a_continued_study_has_the_robot_of_its_folder() {
    let (program, study) = study_of_a_light_a1();
    program.text(&["optimize", "--resume", &study, "--trials", "4", "--record", "none"]);
    program.text(&["optimize", "--resume", &study, "--trials", "5", "--record", "none", "--model", "light"]);
    assert!(!program.path(&study).join("config-2").exists(), "the robot and the configuration are the same");
    program.text(&["optimize", "--join", &study, "--trials", "6", "--record", "none"]);
    let joined = program.studies("recordings").into_iter().find(|folder| !folder.join("study.log").exists()).unwrap();
    assert!(fs::read_to_string(joined.join("config/robot/a1.urdf")).unwrap().contains("<mass value=\"5.5\"/>"));
    // The console has checked the robot before it counts the trials.
    let message = program.refused(&["--resume", &study, "--trials", "1"]);
    assert_shows(&message, &["--trials 1: 6 trials of this study count already"]);
    for arguments in [["optimize", "--resume"], ["optimize", "--join"], ["--output=recordings", "--resume"]] {
        let message = program.refused(&[&arguments[..], &[&study, "--model", "a1"]].concat());
        let kept = format!("{study}/config/robot");
        assert_shows(&message, &["--model a1: the study ran with another robot, the a1 in", &kept, "omit --model"]);
    }
}

/// A configuration of one key replaces that key of the robot's own configuration, which the study's has taken up.
#[test]
fn a_given_configuration_keeps_the_own_one_of_the_robot_of_a_continued_study() {
    let (program, study) = study_of_a_light_a1();
    program.write("mine/optimize.toml", "[sampler]\nkind = \"sobol\"\n");
    let resume = ["optimize", "--resume", &study, "--trials", "6", "--config", "mine", "--record", "none", "--json"];
    let trials = program.trials(&resume);
    assert_eq!(trials.len(), 3);
    assert!(
        trials.iter().all(|trial| (200.0..=220.0).contains(&trial["params"]["Fz"].as_f64().unwrap())),
        "{trials:?}"
    );
}

/// Studies of earlier versions.
#[test]
fn a_study_without_a_kept_robot_is_continued_by_its_name() {
    let (program, study) = study_of_a_light_a1();
    fs::remove_dir_all(program.path(&study).join("config/robot")).unwrap();
    let resume = ["optimize", "--resume", &study, "--trials", "4", "--record", "none"];
    assert_shows(&program.refused(&resume), &["holds a study of the a1; give --model a1"]);
    program.text(&[&resume[..], &["--model", "light"]].concat());
}

/// Regression: a worker joined a journal without a folder, as on a Redis server, with any robot of the study's name.
#[test]
fn a_worker_joins_with_the_robot_of_the_study_and_not_with_another_of_its_name() {
    let (program, _) = study_of_a_light_a1();
    let journal = program.path("shared/any.log").to_str().unwrap().to_owned();
    let join = ["optimize", "--record", "none", "--join", &journal, "--trials"];
    program.text(&[&join[..], &["2", "--model", "light", "--task", "forward", "--seed", "3"]].concat());
    program.text(&[&join[..], &["3", "--model", "light"]].concat());
    let before = fs::read_to_string(&journal).unwrap();
    let message = program.refused(&[&join[..], &["4", "--model", "a1"]].concat());
    assert_shows(&message, &["any.log, study forward-seed3", "another robot of the name a1", "give --model"]);
    assert_eq!(fs::read_to_string(&journal).unwrap(), before);
    // A study of an earlier version does not say which robot it had.
    let earlier: String = before.split_inclusive('\n').filter(|line| !line.contains("robot_files")).collect();
    fs::write(&journal, earlier).unwrap();
    program.text(&[&join[..], &["4", "--model", "a1"]].concat());
}
