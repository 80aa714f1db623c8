//! Hostile inputs: each is refused by name, without a panic, an endless read or minutes of work.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

use quadfrog::config::Config;
use quadfrog::optimize::journal::{Durability, Journal, JournalFile, LOCK_GRACE};
use quadfrog::robot::description::{LARGEST_FILE, RobotDescription};

const URDF: &str = include_str!("../robots/go1/go1.urdf");
const TOML: &str = include_str!("../robots/go1/robot.toml");

fn refused(urdf: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("go1.urdf"), urdf).unwrap();
    fs::write(folder.path().join("robot.toml"), TOML).unwrap();
    RobotDescription::from_folder(folder.path()).expect_err("should be refused").to_string()
}

/// (Defects once: NaN and infinity in origins, axes and radii were accepted, and ten trials were void.)
#[test]
fn numbers_that_are_not_finite_are_refused_with_file_element_and_value() {
    let places = [
        ("<origin xyz=\"0 0 -0.213\"", "<origin xyz=\"0 0 VALUE\"", "joint FR_"),
        ("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 VALUE 0\"/>", "joint FR_thigh_joint"),
        ("<sphere radius=\"0.02\"/>", "<sphere radius=\"VALUE\"/>", "link FR_foot"),
        ("effort=\"23.7\"", "effort=\"VALUE\"", "joint FR_hip_joint"),
        ("velocity=\"30.1\"", "velocity=\"VALUE\"", "joint FR_hip_joint"),
        ("lower=\"-0.863\"", "lower=\"VALUE\"", "joint FR_hip_joint"),
        ("<mass value=\"5.561079999999999\"/>", "<mass value=\"VALUE\"/>", "link trunk"),
        ("ixx=\"", "ixx=\"VALUE\" x=\"", "link trunk"),
        ("rpy=\"0 0 0\"", "rpy=\"0 VALUE 0\"", ""),
    ];
    for (from, to, element) in places {
        assert!(URDF.contains(from), "{from}");
        for value in ["nan", "inf", "-inf", "1e300"] {
            let message = refused(&URDF.replacen(from, &to.replace("VALUE", value), 1));
            let printed = value.parse::<f64>().unwrap().to_string();
            for word in ["go1.urdf", element, &printed, "give a finite number"] {
                assert!(message.contains(word), "{word} is not in: {message}");
            }
        }
    }
}

fn chain(links: usize) -> String {
    let mut text = "<robot name=\"r\"><link name=\"l0\"/>".to_owned();
    for i in 1..links {
        let parent = i - 1;
        text += &format!(
            "<link name=\"l{i}\"/><joint name=\"j{i}\" type=\"fixed\"><parent link=\"l{parent}\"/><child link=\"l{i}\"/></joint>"
        );
    }
    text + "</robot>"
}

/// (Defects once: 20,000 chained links overflowed the stack, 50,000 links and deep nesting took more than 40 s.)
#[test]
fn endless_and_deep_descriptions_are_refused() {
    assert!(refused(&chain(20_000)).contains("1048576 bytes"));
    assert!(refused(&chain(50_000)).contains("1048576 bytes"));
    assert!(refused(&chain(4000)).contains("4000 links"));
    assert!(refused(&chain(9000)).contains("20000 elements"));
    assert!(refused(&format!("<robot name=\"r\">{}", "<a>".repeat(100_000))).contains("nested"));
    assert!(refused(&"<a b='/>'>".repeat(100)).contains("nested"), "an end in quotes is none");
    assert!(!refused(&format!("<robot name=\"r\"><!--{}--></robot>", "<a>".repeat(100_000))).contains("nested"));
    assert!(refused("<").contains("go1.urdf"));
}

/// Regression: a link with two parents was added once for each way to it: its mass was doubled, and 30 links with two joints each
/// took longer than anybody waits.
#[test]
fn a_link_with_two_parents_is_refused_at_once() {
    let joint = |name: &str, link: usize| {
        let (parent, link) = (format!("<parent link=\"l{link}\"/>"), format!("<child link=\"l{}\"/>", link + 1));
        format!("<joint name=\"{name}\" type=\"fixed\">{parent}{link}</joint>")
    };
    let second: String = (0..29).map(|link| joint(&format!("k{link}"), link)).collect();
    let message = refused(&chain(30).replace("</robot>", &(second + "</robot>")));
    assert!(message.contains("link l1") && message.contains("several joints have it as their child"), "{message}");
}

/// Regression: the read never ended.
#[test]
fn a_file_without_an_end_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    symlink("/dev/zero", folder.path().join("go1.urdf")).unwrap();
    fs::write(folder.path().join("robot.toml"), TOML).unwrap();
    let error = RobotDescription::from_folder(folder.path()).unwrap_err().to_string();
    assert!(error.contains("go1.urdf") && error.contains("not a regular file"), "{error}");

    for name in ["control.toml", "console.toml"] {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(name);
        symlink("/dev/zero", &file).unwrap();
        let error = Config::load(Some(folder.path())).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("not a regular file"), "{error}");
        fs::remove_file(&file).unwrap();
        fs::write(&file, "#".repeat(LARGEST_FILE as usize + 1)).unwrap();
        let error = Config::load(Some(folder.path())).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("1048576 bytes"), "{error}");
    }
}

/// Opens a journal of one study with this text after it; the message about it.
fn journal(folder: &Path, text: &str) -> Option<String> {
    let path = folder.join("study.log");
    let study = "{\"op_code\":0,\"worker_id\":\"a\",\"study_name\":\"s\",\"directions\":[2]}\n{\"op_code\":4,\"worker_id\":\"a\",\"study_id\":0,\"datetime_start\":\"2026-01-01T00:00:00Z\"}\n";
    let end = "{\"op_code\":10,\"worker_id\":\"a\"}\n";
    fs::write(&path, [study, text, end].concat()).unwrap();
    let file = JournalFile::new(&path, Durability::Buffered, LOCK_GRACE).unwrap();
    Journal::open(file).err().map(|error| error.to_string())
}

fn parameter(low: &str, high: &str, log: bool) -> String {
    format!(
        "{{\"op_code\":5,\"worker_id\":\"a\",\"trial_id\":0,\"param_name\":\"x\",\"param_value_internal\":1.0,\"distribution\":\"{{\\\"name\\\": \\\"FloatDistribution\\\", \\\"attributes\\\": {{\\\"step\\\": null, \\\"low\\\": {low}, \\\"high\\\": {high}, \\\"log\\\": {log}}}}}\"}}\n"
    )
}

/// Regression: the sampler panicked.
#[test]
fn a_distribution_that_is_no_range_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    for (low, high, log) in [("2.0", "1.0", false), ("NaN", "1.0", false), ("0.0", "1.0", true), ("-1.0", "1.0", true)]
    {
        let message = journal(folder.path(), &parameter(low, high, log)).expect("should be refused");
        assert!(message.contains("line 3") && message.contains("no range"), "{message}");
    }
    assert_eq!(journal(folder.path(), &parameter("1.0", "1.0", false)), None);
    assert_eq!(journal(folder.path(), &parameter("-Infinity", "Infinity", false)), None, "another program's");
}

#[test]
fn a_line_without_an_end_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{{\"op_code\":10,\"worker_id\":\"{}\"}}\n", "a".repeat(17 << 20));
    let message = journal(folder.path(), &text).expect("should be refused");
    assert!(message.contains("line 3") && message.contains("16777216"), "{message}");
    let path = folder.path().join("study.log");
    fs::write(&path, "a".repeat(17 << 20)).unwrap();
    let file = JournalFile::new(&path, Durability::Buffered, LOCK_GRACE).unwrap();
    assert!(Journal::open(file).err().is_some_and(|error| error.to_string().contains("16777216")));
}
