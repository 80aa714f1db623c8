//! The folder of a study: the configuration and the robot that ran, and the fingerprint that an operator confirms.

use std::fs;
use std::path::Path;

use quadfrog::config::Config;
use quadfrog::engine::{Options, attachments, fingerprint, newest_config, open_experiment, prepare_folder};
use quadfrog::optimize::journal::Durability;
use quadfrog::robot::description::RobotDescription;
use quadfrog::trial::{Backend, Task};

const TOML: &str = include_str!("../robots/go1/robot.toml");
const URDF: &str = include_str!("../robots/go1/go1.urdf");

fn robot(toml: &str, urdf: &str) -> RobotDescription {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("robot.toml"), toml).unwrap();
    fs::write(folder.path().join("go1.urdf"), urdf).unwrap();
    RobotDescription::from_folder(folder.path()).unwrap()
}

fn options(robot: RobotDescription, folder: &Path) -> Options {
    let config = Config::load(None).unwrap();
    Options {
        folder: Some(folder.to_owned()),
        trials: Some(3),
        ..Options::new(config, robot, Backend::Simulator, Task::Forward)
    }
}

fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1)
}

/// Regression: a sensor scale of 0.05 instead of 1, with which four standing feet are in the air, gave the same
/// fingerprint.
#[test]
fn the_fingerprint_covers_the_robots_files() {
    let config = Config::load(None).unwrap();
    let of = |toml: &str, urdf: &str| fingerprint(&config, &robot(toml, urdf));
    let shipped = of(TOML, URDF);
    assert_eq!(shipped, fingerprint(&config, &RobotDescription::embedded("go1").unwrap()), "wherever the files are");
    assert_ne!(shipped, of(&changed(TOML, "foot_force_n = 1.0", "foot_force_n = 0.05"), URDF));
    assert_ne!(shipped, of(TOML, &changed(URDF, "effort=\"23.7\"", "effort=\"23.8\"")));
}

#[test]
fn a_study_keeps_the_robots_files_as_a_model_and_an_old_study_without_them_opens() {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("study");
    let kept = |number: u32| {
        let (newest, path) = newest_config(&study).unwrap();
        assert_eq!(newest, number);
        RobotDescription::from_folder(&path.join("robot")).unwrap()
    };
    let go1 = robot(TOML, URDF);
    drop(prepare_folder(&options(go1.clone(), &study)).unwrap());
    assert_eq!(kept(1), go1);
    drop(prepare_folder(&options(go1.clone(), &study)).unwrap());
    assert_eq!(kept(1), go1, "the same robot is not kept twice");

    let other = robot(&changed(TOML, "foot_force_n = 1.0", "foot_force_n = 0.05"), URDF);
    drop(prepare_folder(&options(other.clone(), &study)).unwrap());
    assert_eq!(kept(2), other);

    // As older versions kept it.
    let (_, newest) = newest_config(&study).unwrap();
    fs::remove_dir_all(newest.join("robot")).unwrap();
    Config::load(Some(&newest)).unwrap();
    let again = options(other.clone(), &study);
    drop(prepare_folder(&again).unwrap());
    assert_eq!(open_experiment(&again, Durability::Buffered, "").unwrap().budget(), 3);
    assert_eq!(kept(3), other);
    Config::load(Some(&newest_config(&study).unwrap().1)).unwrap();
}

#[test]
fn a_recording_holds_the_robots_files() {
    let folder = tempfile::tempdir().unwrap();
    let options = options(robot(TOML, URDF), folder.path());
    let attached = attachments(&options);
    for (name, media, text) in [("robot.toml", "application/toml", TOML), ("go1.urdf", "application/xml", URDF)] {
        assert!(attached.contains(&(name, media, text.as_bytes())), "{name}");
    }
}
