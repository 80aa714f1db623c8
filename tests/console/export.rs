//! `quadfrog export` on recordings of the running program, read by pandas, polars and Python's mcap reader; `.ci/run` installs
//! them, and the comparison is skipped with a message where they are missing.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::program::{Program, assert_shows, with_small_files, without_threads};
use crate::skip::skip;
use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::SessionInfo;
use quadfrog::recording::writer::Writer;
use quadfrog::telemetry::Tick;
use serde_json::Value;

/// A recording of two trials of the program, as an argument.
fn recording(program: &Program) -> String {
    program.text(&["optimize", "--trials", "2", "--record", "all"]);
    program.study("recordings").join("session.mcap").to_str().unwrap().to_owned()
}

fn ticks(recording: &str) -> Vec<Tick> {
    let tick = |played| if let Played::Tick(tick) = played { Some(*tick) } else { None };
    Player::open(recording).unwrap().filter_map(tick).collect()
}

/// Header and rows of a table.
fn csv(text: &str) -> (Vec<&str>, Vec<Vec<&str>>) {
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    (lines.next().unwrap(), lines.collect())
}

#[test]
fn pandas_and_polars_read_what_the_mcap_reader_gives() {
    let check = "import pandas, polars, pyarrow, mcap_protobuf";
    let found = Command::new("python3").args(["-c", check]).output().is_ok_and(|output| output.status.success());
    if !found {
        skip("python3 has no pandas, polars, pyarrow and mcap-protobuf-support");
        return;
    }
    let program = Program::new();
    let recording = recording(&program);
    for file in ["all.csv", "all.json", "all.parquet"] {
        program.text(&["export", &recording, "-o", file]);
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/support/compare_export.py");
    let python = Command::new("python3")
        .arg(script)
        .args([&recording, "all.csv", "all.json", "all.parquet"])
        .current_dir(program.path(""))
        .output()
        .unwrap();
    assert!(python.status.success(), "{}", String::from_utf8_lossy(&python.stderr));
    let compared: Value = serde_json::from_slice(&python.stdout).unwrap();
    assert_eq!(compared["rows"], ticks(&recording).len());
    let columns: Vec<&str> = compared["columns"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    for column in
        ["mode", "trial", "roll", "position_z", "foot_z_fr", "position_FR_hip", "effort_RL_calf", "truth_position_z"]
    {
        assert!(columns.contains(&column), "{column} was not compared: {columns:?}");
    }
    assert!(columns.len() >= 100, "{columns:?}");
}

#[test]
fn a_trial_a_time_and_a_topic_are_selected() {
    let program = Program::new();
    let recording = recording(&program);
    let ticks = ticks(&recording);
    let export = |more: &[&str]| program.text(&[&["export", recording.as_str()], more].concat());

    let text = export(&["--trial", "1"]);
    let (header, rows) = csv(&text);
    let of_trial: Vec<&Tick> = ticks.iter().filter(|tick| tick.trial == Some(1)).collect();
    assert!(of_trial.len() > 1000 && of_trial.len() < ticks.len(), "{}", of_trial.len());
    assert_eq!(rows.len(), of_trial.len());
    let column = |name: &str| header.iter().position(|of| *of == name).unwrap();
    assert!(rows.iter().all(|row| row[column("trial")] == "1" && row.len() == header.len()));
    let number = |row: &[&str]| row[column("number")].parse::<u64>().unwrap();
    assert_eq!(
        (number(&rows[0]), number(&rows[rows.len() - 1])),
        (of_trial[0].number, of_trial[of_trial.len() - 1].number)
    );
    for (row, tick) in rows.iter().zip(&of_trial) {
        assert_eq!(row[column("roll")].parse::<f64>().unwrap(), tick.estimate.roll_pitch_yaw[0]);
        assert_eq!(row[column("mode")], tick.mode.name());
    }

    let text = export(&["--time", "0.5..1.25"]);
    let (_, rows) = csv(&text);
    let within = |tick: &&Tick| (500_000_000..1_250_000_000).contains(&tick.time_ns);
    assert_eq!(rows.len(), ticks.iter().filter(within).count());
    assert_eq!(csv(&export(&["--time", "0.5.."])).1.len() + csv(&export(&["--time", "..0.5"])).1.len(), ticks.len());

    let rows: Vec<Value> =
        serde_json::from_str(&export(&["--topic", "/robot/joint_cmd", "--format", "json", "--time", "..0.1"])).unwrap();
    assert_eq!(rows.len(), ticks.iter().filter(|tick| tick.time_ns < 100_000_000).count());
    assert_eq!(rows[0].as_object().unwrap().len(), 1 + 7 * 12);
    assert_eq!(rows[9]["command_kd_FR_hip"].as_f64(), Some(ticks[9].command.motor[0].kd_joint));
}

#[test]
fn unusable_arguments_are_refused_with_the_remedy() {
    let program = Program::new();
    let recording = recording(&program);
    let refused = |more: &[&str]| program.refused(&[&["export", recording.as_str()], more].concat());
    assert_shows(&refused(&["--trial", "9"]), &["session.mcap", "no tick of trial 9", "0, 1"]);
    assert_shows(&refused(&["--time", "3..1"]), &["--time", "not after the beginning"]);
    assert_shows(&refused(&["--time", "now"]), &["A..B", "12.5..30"]);
    assert_shows(&refused(&["--topic", "/tf"]), &["/robot/joint_states"]);
    assert_shows(&refused(&["-o", "t.parquet", "--format", "csv"]), &["t.parquet", "another name"]);
    assert_shows(&refused(&["-o", "t.dat"]), &["t.dat", ".parquet"]);
    assert_shows(&refused(&["--format", "parquet"]), &["--output"]);
    assert_shows(&program.refused(&["export", "nothing.mcap"]), &["nothing.mcap"]);
    assert!(!program.path("t.parquet").exists() && !program.path("t.dat").exists());
}

/// Regression: a slip in a file's name replaced the journal of a study by a picture, and a recording by a table.
#[test]
fn no_file_of_another_kind_is_replaced() {
    let program = Program::new();
    let recording = recording(&program);
    let study = program.study("recordings");
    let journal = study.join("study.log").to_str().unwrap().to_owned();
    let unfinished = format!("{recording}.part");
    fs::write(&unfinished, "the beginning of a session").unwrap();
    std::os::unix::fs::symlink(&journal, program.path("link.csv")).unwrap();
    let kept = [&journal, &recording, &unfinished];
    let contents = || kept.map(|file| fs::read(file).unwrap());
    let before = contents();
    let folder = study.to_str().unwrap();
    for file in [&journal, &recording, "link.csv"] {
        let exists = [file, "exists", ".csv", "another name"];
        assert_shows(&program.refused(&["study", "export", folder, "--format", "csv", "-o", file]), &exists);
        assert_shows(&program.refused(&["export", &recording, "--format", "csv", "-o", file]), &exists);
    }
    for file in [&journal, "new.png"] {
        let screenshot = program.refused(&["screenshot", &recording, "-o", file]);
        assert_shows(&screenshot, &[file, "a screenshot is a picture in SVG", ".svg"]);
        assert_shows(&program.refused(&["report", folder, "--output", file]), &[file, "HTML", ".html"]);
    }
    assert!(!program.path("new.png").exists());
    // Regression: a folder that does not exist was an error of the system, without the way out.
    fs::create_dir(program.path("folder")).unwrap();
    for (place, what) in [("nowhere/x.csv", "the folder nowhere does not exist"), ("folder", "it is a folder")] {
        let refused = program.refused(&["study", "export", folder, "--format", "csv", "-o", place]);
        assert_shows(&refused, &["--output", place, what]);
    }
    // What the same command wrote is replaced.
    for _ in 0..2 {
        program.text(&["study", "export", folder, "-o", "trials.csv"]);
        program.text(&["screenshot", &recording, "-o", "last.svg"]);
    }
    assert!(contents() == before, "a file was replaced");
}

#[test]
fn damage_and_a_full_disk_are_errors_and_a_closed_pipe_is_none() {
    let program = Program::new();
    let recording = recording(&program);
    let whole = fs::read(&recording).unwrap();
    // Cut off: the beginning is exported, and the exit status says that the rest is missing.
    fs::write(program.path("cut.mcap.part"), &whole[..whole.len() / 2]).unwrap();
    let output = program.run(&["export", "cut.mcap.part", "-o", "cut.csv"]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_shows(
        &message,
        &["cut.mcap.part", "cut off", "what can be read is exported", "`quadfrog recover cut.mcap.part`"],
    );
    // A trial that is whole in another file is exported without an error.
    fs::create_dir(program.path("both")).unwrap();
    fs::copy(&recording, program.path("both/session.mcap")).unwrap();
    fs::copy(program.path("cut.mcap.part"), program.path("both/session-2.mcap.part")).unwrap();
    program.text(&["export", "both", "--trial", "1", "-o", "trial.csv"]);
    let output = program.run(&["export", "both", "-o", "both.csv"]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    // Regression: the advice named the folder, which `recover` refuses.
    assert_shows(&message, &["`quadfrog recover both/session-2.mcap.part`"]);
    assert!(!message.contains("the newest study"), "{message}");
    // Regression: of a folder of studies one was exported, and nothing said which.
    fs::create_dir(program.path("studies")).unwrap();
    fs::rename(program.path("both"), program.path("studies/both")).unwrap();
    let output = program.run(&["export", "studies", "--trial", "1", "-o", "trial.csv"]);
    assert_shows(&String::from_utf8_lossy(&output.stderr), &["the newest study in it: studies/both"]);
    let rows = fs::read_to_string(program.path("cut.csv")).unwrap().lines().count() - 1;
    assert_eq!(rows, ticks(program.path("cut.mcap.part").to_str().unwrap()).len());
    assert!(rows > 1000);

    let (status, message) = with_small_files(&program, 200, &["export", &recording, "-o", "all.parquet"]);
    assert_eq!(status, Some(1), "{message}");
    assert_shows(&message, &["all.parquet", "File too large"]);
    let left = fs::read_dir(program.path("")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert_eq!(left.filter(|name| name.contains("all.parquet")).count(), 0);
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = program.command(&["export", &recording, "--format", "json"]).stdout(full).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && message.contains("No space left on device"), "{message}");

    let mut child = program.command(&["export", &recording]).stdout(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    assert!(child.wait().unwrap().success());
}

/// The strings of a JSON document.
fn strings(value: &Value) -> Vec<&str> {
    match value {
        Value::String(text) => vec![text],
        Value::Array(list) => list.iter().flat_map(strings).collect(),
        Value::Object(members) => members.values().flat_map(strings).collect(),
        _ => Vec::new(),
    }
}

#[test]
fn the_layout_of_foxglove_names_topics_and_fields_of_a_recording() {
    let program = Program::new();
    let reported = program.run(&["export", "--layout", "foxglove", "-o", "layout.json"]).stderr;
    assert!(String::from_utf8(reported).unwrap().contains("layout: layout.json"));
    let text = fs::read_to_string(program.path("layout.json")).unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    assert_eq!(text, fs::read_to_string(root.join("docs/foxglove-layout.json")).unwrap());
    assert_eq!(program.text(&["export", "--layout", "foxglove"]), text);
    let layout: Value = serde_json::from_str(&text).unwrap();
    let panels = layout["configById"].as_object().unwrap();
    let shown = strings(&layout["layout"]);
    assert!(panels.keys().all(|panel| shown.contains(&panel.as_str())), "{shown:?}");
    for kind in ["3D!", "Plot!", "StateTransitions!", "RosOut!"] {
        assert!(panels.keys().any(|panel| panel.starts_with(kind)), "{kind}");
    }
    // The end of a recording lists its channels uncompressed, and the schemas name every field.
    let recording = fs::read(recording(&program)).unwrap();
    let holds = |name: &str| recording.windows(name.len()).any(|window| window == name.as_bytes());
    let schema = fs::read_to_string(root.join("proto/frog.proto")).unwrap();
    let topics = panels["3D!robot"]["topics"].as_object().unwrap().keys().map(String::as_str);
    let mut fields = 0;
    for name in strings(&layout).into_iter().chain(topics).filter(|text| text.starts_with('/')) {
        let (topic, field) = name.split_once('.').map_or((name, None), |(topic, field)| (topic, Some(field)));
        assert!(holds(topic), "{topic} is not recorded");
        if let Some(field) = field {
            let field = field.split('[').next().unwrap();
            assert!(schema.contains(&format!(" {field} = ")), "{name}: no such field");
            fields += 1;
        }
    }
    assert!(fields >= 20, "{fields}");
    assert_shows(&program.refused(&["export", "--layout", "foxglove", "--trial", "1"]), &["--layout", "--trial"]);
    assert_shows(&program.refused(&["export"]), &["FILE"]);
}

#[test]
fn rerun_takes_the_blueprint_that_the_script_writes() {
    let found = Command::new("python3").args(["-c", "import rerun.blueprint"]).output();
    if !found.is_ok_and(|output| output.status.success()) {
        skip("python3 has no rerun-sdk");
        return;
    }
    let program = Program::new();
    program.text(&["export", "--layout", "rerun", "-o", "blueprint.py"]);
    let run = |command: &str| {
        let done = Command::new("sh").args(["-c", command]).current_dir(program.path("")).output().unwrap();
        assert!(done.status.success(), "{command}: {}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8_lossy(&done.stdout).into_owned()
    };
    run("python3 blueprint.py view.rbl");
    let blueprint = run("python3 -m rerun rrd print view.rbl");
    assert_shows(&blueprint, &["Blueprint", "\"quadfrog\""]);
    // Every topic of the blueprint is one of a recording.
    let recording = fs::read(recording(&program)).unwrap();
    let script = fs::read_to_string(program.path("blueprint.py")).unwrap();
    let topics: Vec<&str> = script.split('"').filter(|text| text.starts_with('/') && text.len() > 1).collect();
    assert!(topics.len() >= 7, "{topics:?}");
    for topic in topics {
        assert!(recording.windows(topic.len()).any(|window| window == topic.as_bytes()), "{topic} is not recorded");
    }
}

/// Regression: a time after the end of the recording gave a table without a row, with status 0.
#[test]
fn a_time_after_the_end_is_refused_with_the_end() {
    let program = Program::new();
    let recording = recording(&program);
    let end_s = Player::open(&recording).unwrap().duration_ns() as f64 / 1e9;
    for time in ["500..600", "500.."] {
        let message = program.refused(&["export", &recording, "--time", time, "-o", "late.csv"]);
        assert_shows(&message, &["--time 500..: after the end of ", "session.mcap", &format!("{end_s:.3} s")]);
    }
    assert!(!program.path("late.csv").exists());
    program.text(&["export", &recording, "--time", "0..600", "-o", "all.csv"]);
}

/// Regression: without a free thread, as in a container with a limit of processes, the export ended with a panic.
#[test]
fn without_a_free_thread_the_table_is_the_same() {
    let program = Program::new();
    let recording = recording(&program);
    for file in ["csv", "json", "parquet"] {
        let [with, without] = [format!("with.{file}"), format!("without.{file}")];
        program.text(&["export", &recording, "-o", &with]);
        let output = without_threads(&program, &["export", &recording, "-o", &without]);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(fs::read(program.path(&with)).unwrap() == fs::read(program.path(&without)).unwrap(), "{file} differs");
    }
}

/// Regression: the files of a folder were exported in the order of the clock, which may be set back between two sessions.
#[test]
fn the_files_of_a_folder_are_exported_in_the_order_of_their_numbers() {
    let program = Program::new();
    fs::create_dir(program.path("study")).unwrap();
    for (name, start_utc_ns, number) in [("session.mcap", 2_000_000_000, 1), ("session-2.mcap", 1_000_000_000, 2)] {
        let path = program.path("study").join(name);
        let mut writer = Writer::create(&path, &SessionInfo::default(), start_utc_ns, &[]).unwrap();
        writer.tick(&Tick { number, ..Tick::default() }).unwrap();
        writer.finish().unwrap();
    }
    let table = program.text(&["export", "study", "--topic", "/robot/tick"]);
    let (header, rows) = csv(&table);
    let number = header.iter().position(|name| *name == "number").unwrap();
    assert_eq!(rows.iter().map(|row| row[number]).collect::<Vec<_>>(), ["1", "2"]);
}
