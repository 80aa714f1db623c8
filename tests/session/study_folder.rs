//! The folder of a study: the configuration and the robot that ran, and the fingerprint that an operator confirms.

use std::fs;
use std::path::Path;

use quadfrog::config::{Config, ConfigError, write_new_files};
use quadfrog::engine::{
    Options, attachments, check_kept_config, fingerprint, newest_config, open_experiment, prepare_folder,
};
use quadfrog::optimize::journal::Durability;
use quadfrog::robot::description::RobotDescription;
use quadfrog::trial::{Backend, Task};

const TOML: &str = include_str!("../../robots/go1/robot.toml");
const URDF: &str = include_str!("../../robots/go1/go1.urdf");

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

/// Regression: a configuration that a full disk or a kill had cut was taken for the one that ran last, with built-in limits in place
/// of those of the study.
#[test]
fn a_cut_configuration_is_not_the_one_that_ran_last() {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("study");
    drop(prepare_folder(&options(robot(TOML, URDF), &study)).unwrap());
    // The session was killed while it kept another one.
    fs::create_dir(study.join(".config-2.4711.part")).unwrap();
    fs::write(study.join(".config-2.4711.part/safety.toml"), "").unwrap();
    assert_eq!(newest_config(&study).unwrap().1, study.join("config"));
    let other = robot(&changed(TOML, "foot_force_n = 1.0", "foot_force_n = 0.05"), URDF);
    drop(prepare_folder(&options(other, &study)).unwrap());
    let (number, newest) = newest_config(&study).unwrap();
    assert_eq!(number, 2);
    assert!(!study.join(".config-2.4711.part").exists(), "what a killed session left is removed");
    // As an earlier version left it on a full disk.
    fs::write(newest.join("safety.toml"), "").unwrap();
    let refusal = check_kept_config(&newest).unwrap_err().to_string();
    assert!(refusal.contains("config-2/safety.toml: is empty"), "{refusal}");
}

#[test]
fn new_files_are_written_whole_or_not_at_all_and_replace_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let new = folder.path().join("new");
    let unwritable = [("a.toml", "x = 1"), ("b\0.toml", "y = 2")];
    let entries = |folder: &Path| fs::read_dir(folder).unwrap().count();
    assert!(matches!(write_new_files(&new, &unwritable), Err(ConfigError::Write { .. })));
    assert_eq!(entries(folder.path()), 0, "no folder, no part of it");
    fs::create_dir(&new).unwrap();
    assert!(matches!(write_new_files(&new, &unwritable), Err(ConfigError::Write { .. })));
    assert_eq!(entries(&new), 0);
    let files = [("a.toml", "x = 1"), ("robot/b.toml", "y = 2")];
    write_new_files(&new, &files).unwrap();
    assert!(matches!(write_new_files(&new, &[("a.toml", "x = 3")]), Err(ConfigError::Exists { .. })));
    assert_eq!(fs::read_to_string(new.join("a.toml")).unwrap(), "x = 1");
    assert_eq!(fs::read_to_string(new.join("robot/b.toml")).unwrap(), "y = 2");
    // Regression: in a container each program has the same number, and what a killed one had left was in the way for ever.
    let left = folder.path().join(format!(".again.{}.part", std::process::id()));
    fs::create_dir(&left).unwrap();
    fs::write(left.join("a.toml"), "").unwrap();
    write_new_files(&folder.path().join("again"), &files).unwrap();
    assert_eq!(fs::read_to_string(folder.path().join("again/a.toml")).unwrap(), "x = 1");
}

/// Regression: a lock that was a link had the file to which it leads emptied; one that was a pipe was waited for without end.
#[test]
fn a_lock_that_is_no_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let lock = folder.path().join("session.lock");
    fs::write(folder.path().join("other"), "kept").unwrap();
    let refused = || prepare_folder(&options(robot(TOML, URDF), folder.path())).err().unwrap().to_string();
    std::os::unix::fs::symlink("other", &lock).unwrap();
    assert!(refused().contains("session.lock"), "{}", refused());
    assert_eq!(fs::read_to_string(folder.path().join("other")).unwrap(), "kept");
    fs::remove_file(&lock).unwrap();
    nix::unistd::mkfifo(&lock, nix::sys::stat::Mode::S_IRWXU).unwrap();
    assert!(refused().contains("session.lock"), "{}", refused());
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
