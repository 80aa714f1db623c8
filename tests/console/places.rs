//! Places of files in commands: without permission, with spaces, with names that are not UTF-8.

use std::ffi::OsStr;
use std::fs::{self, Permissions};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::PermissionsExt;

use crate::program::{Program, assert_shows, with_permissions};
use serde_json::Value;

/// Regression: what could not be looked at was called empty, or missing, or was left out.
#[test]
fn a_folder_without_permission_is_not_called_empty() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--output", "perm"]);
    let study = program.study("perm");
    fs::rename(&study, program.path("perm/st")).unwrap();
    let closed = |mode| fs::set_permissions(program.path("perm/st"), Permissions::from_mode(mode)).unwrap();
    closed(0o000);
    for arguments in [
        &["study", "list", "perm"][..],
        &["study", "show", "perm/st"],
        &["study", "best", "perm/st"],
        &["study", "enqueue", "perm/st", "f0=1.2"],
        &["report", "perm/st"],
        &["optimize", "--resume", "perm/st"],
        &["optimize", "--join", "perm/st"],
        &["replay", "--check", "perm/st"],
        &["replay", "--check", "perm"],
        &["export", "perm/st"],
        &["rejudge", "perm/st"],
        &["screenshot", "perm/st"],
        &["config", "check", "perm/st/config"],
        &["config", "check", "perm/st"],
        &["optimize", "--trials", "1", "--config", "perm/st/config"],
        &["optimize", "--trials", "1", "--model", "perm/st/config/robot"],
    ] {
        let output = with_permissions(&program, arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{arguments:?}: {message}");
        assert!(message.contains("Permission denied") && message.contains("perm"), "{arguments:?}: {message}");
    }
    closed(0o755);
}

/// Regression: of a file without a study, or one that is no journal, "no such study" was reported where none was named, without a remedy.
#[test]
fn a_journal_without_a_study_is_refused_with_the_remedy() {
    let program = Program::new();
    program.write("empty/study.log", "");
    program.write("notes.txt", "a line\n");
    for command in [&["study", "show"][..], &["study", "best"], &["study", "export"], &["report"]] {
        for place in ["empty", "notes.txt"] {
            let message = program.refused(&[command, &[place]].concat());
            assert_shows(&message, &[place, "there is no study in it", "quadfrog study list"]);
        }
    }
}

/// Regression: a table of a user's own became readable for all.
#[test]
fn a_replaced_file_keeps_its_permissions() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "none"]);
    let study = program.study("recordings");
    let study = study.to_str().unwrap();
    for (arguments, file) in [(&["study", "export", study][..], "trials.csv"), (&["report", study][..], "report.html")]
    {
        let write = [arguments, &["--output", file]].concat();
        program.text(&write);
        fs::set_permissions(program.path(file), Permissions::from_mode(0o640)).unwrap();
        program.text(&write);
        assert_eq!(program.path(file).metadata().unwrap().permissions().mode() & 0o777, 0o640, "{file}");
    }
}

/// Regression: a shell read such a path as several words.
#[test]
fn printed_commands_have_paths_with_spaces_as_one_word() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "2", "--seed", "0", "--output", "sp ace/it's"]);
    let study = program.study("sp ace/it's");
    let best = program.text(&["study", "best", study.to_str().unwrap(), "--config", "sp ace/best"]);
    assert_shows(&best, &["--config 'sp ace/best'\n"]);
    assert_shows(&program.text(&["study", "list", "sp ace"]), &[r"`quadfrog study list 'sp ace/it'\''s'` finds"]);
    let recording = fs::read(study.join("session.mcap")).unwrap();
    fs::write(study.join("session.mcap"), &recording[..recording.len() / 2]).unwrap();
    let output = program.run(&["export", study.to_str().unwrap()]);
    assert_shows(&String::from_utf8_lossy(&output.stderr), &[r"/it'\''s/", "session.mcap'` keeps what can be read"]);
}

/// Regression: a panic after the work.
#[test]
fn a_prior_is_described_also_where_its_name_is_not_utf_8() {
    let program = Program::new();
    program.write("mine/prior.toml", "worlds = 2\npoints = 16\n");
    let mut command = program.command(&["prior", "--config", "mine", "--json", "--output"]);
    let output = command.arg(OsStr::from_bytes(b"na\xffme.json")).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let made: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(made["file"], "na\u{fffd}me.json");
}

/// Regression: a folder of studies with the name of the built-in robot was taken for a robot that lacks its file.
#[test]
fn a_folder_of_studies_does_not_hide_the_built_in_robot() {
    let program = Program::new();
    fs::create_dir(program.path("go1")).unwrap();
    program.text(&["optimize", "--trials", "1", "--output", "go1"]);
    // A robot of the user's own comes first.
    fs::write(program.path("go1/robot.toml"), "legs = 5").unwrap();
    assert_shows(&program.refused(&["optimize", "--trials", "1"]), &["go1/robot.toml"]);
}

/// Regression: the folder `config` beside a journal that is shared was taken for the configuration of its study.
#[test]
fn a_folder_beside_a_shared_journal_is_not_its_configuration() {
    let program = Program::new();
    program.write("config/optimize.toml", "[bounds]\nFz = [200.0, 210.0]\n");
    let journal = program.path("shared.log").to_str().unwrap().to_owned();
    let join = ["optimize", "--task", "forward", "--seed", "3", "--trials", "2", "--record", "none", "--join"];
    program.text(&[&join[..], &[&journal]].concat());
    assert_shows(&program.text(&["study", "show", &journal]), &["Fz from 150 to 350 N\n"]);
    program.text(&["study", "enqueue", &journal, "Fz=300"]);
    program.write("config/optimize.toml", "no configuration");
    for command in [&["study", "show"][..], &["report"]] {
        program.text(&[command, &[&journal]].concat());
    }
}
