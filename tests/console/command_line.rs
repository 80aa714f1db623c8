//! The command line: output and exit status of complete runs of the program.

use std::collections::BTreeMap;
use std::fs::{self, Permissions};
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Stdio;

use crate::program::{Program, assert_shows, hold, journal_trials, with_small_files};
use crate::skip::skip;
use quadfrog::recording::player::Player;
use quadfrog::recording::record::Record;
use serde_json::Value;

#[test]
fn optimize_prints_one_json_object_per_trial_in_the_promised_form() {
    let program = Program::new();
    let trials = program.trials(&["optimize", "--task", "twist-cw", "--trials", "3", "--seed", "1", "--json"]);
    assert_eq!(trials.len(), 3);
    for (number, trial) in trials.iter().enumerate() {
        assert_eq!(trial["trial"], number);
        for name in ["f0", "Fy", "Fz"] {
            assert!(trial["params"][name].is_f64(), "{trial}");
        }
        for name in ["dx_m", "dy_m", "dyaw_rad", "apex_m", "air_s"] {
            assert!(trial["measured"][name].is_f64(), "{trial}");
        }
        let verdict = trial["verdict"].as_str().unwrap();
        let measured = -trial["measured"]["dyaw_rad"].as_f64().unwrap();
        let expected = if verdict == "fall" { 0.0 } else { measured };
        assert_eq!(trial["value"].as_f64().unwrap(), expected, "{trial}");
    }
    let study = program.study("recordings");
    assert!(study.join("study.log").is_file() && study.join("session.mcap").is_file());
    assert!(study.join("config/control.toml").is_file());
}

/// Regression: the writer's own session record was followed by a second one.
#[test]
fn the_recording_of_optimize_holds_one_session_record() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1"]);
    let player = Player::open(program.study("recordings").join("session.mcap")).unwrap();
    let sessions = player.events().iter().filter(|event| matches!(event.record, Record::Session(_)));
    assert_eq!(sessions.count(), 1);
}

#[test]
fn without_a_terminal_optimize_prints_plain_lines_a_table_and_the_best() {
    let program = Program::new();
    let text = program.text(&["optimize", "--trials", "3", "--record", "none"]);
    assert!(text.lines().next().unwrap().starts_with("trial   0"), "{text}");
    assert!(text.contains("f0 (Hz)") && text.contains("Best: trial"), "{text}");
    assert!(!text.contains('\u{1b}'), "escape sequences without a terminal: {text:?}");
    let study = program.study("recordings");
    assert!(!study.join("session.mcap").exists());
}

#[test]
fn the_same_seed_prints_the_same_bytes_on_any_number_of_threads() {
    let program = Program::new();
    let sorted = |jobs: &str| {
        let arguments =
            ["optimize", "--task", "forward,lateral-left", "--seed", "0-1", "--trials", "3", "--json", "--jobs", jobs];
        let mut lines: Vec<String> = program.text(&arguments).lines().map(str::to_owned).collect();
        lines.sort();
        lines
    };
    let one = sorted("1");
    assert_eq!(one.len(), 12);
    assert_eq!(one, sorted("2"));
}

/// Killed with SIGKILL, then continued: no judged trial is lost, and the trials are those of an uninterrupted run.
#[test]
fn a_killed_study_continues_as_if_it_had_not_been_interrupted() {
    let program = Program::new();
    const TRIALS: &str = "16";
    let whole = program.trials(&["optimize", "--trials", TRIALS, "--seed", "5", "--json", "--output", "whole"]);
    let mut printed = Vec::new();
    let mut resumed = None;
    // Killed after trials 3 and 12: while the sampler draws at random, and while it uses its model.
    for after in [3, 12] {
        let mut command = program.command(&["optimize", "--trials", TRIALS, "--json"]);
        match &resumed {
            None => command.args(["--seed", "5", "--output", "broken"]),
            Some(study) => command.arg("--resume").arg(study),
        };
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        for line in BufReader::new(child.stdout.take().unwrap()).lines() {
            printed.push(serde_json::from_str::<Value>(&line.unwrap()).unwrap());
            if printed.len() >= after {
                break;
            }
        }
        child.kill().unwrap();
        child.wait().unwrap();
        resumed = Some(program.study("broken"));
    }
    let study = resumed.unwrap();
    program.text(&["optimize", "--trials", TRIALS, "--json", "--resume", study.to_str().unwrap()]);

    // Counted trials in order: a trial killed before its verdict was repeated under another number.
    let table: BTreeMap<u64, Value> = journal_trials(&study.join("study.log"));
    let counted = |trial: &Value| (trial["params"].clone(), trial["value"].clone());
    assert!(table.values().map(counted).eq(whole.iter().map(counted)), "{table:?}");
    for trial in &printed {
        let kept = &table[&trial["trial"].as_u64().unwrap()];
        assert_eq!((&kept["params"], &kept["value"]), (&trial["params"], &trial["value"]), "a judged trial changed");
    }
}

#[test]
fn bad_input_is_refused_with_file_key_and_value_and_no_study_is_made() {
    let program = Program::new();
    fs::create_dir(program.path("mine")).unwrap();
    for (file, text, parts) in [
        ("control.toml", "[tasks.forward]\nkpp = 3.0\n", ["mine/control.toml:2", "kpp", "kp`?"]),
        ("optimize.toml", "[bounds]\nFz = [150.0, 900.0]\n", ["mine/optimize.toml:2", "900", "400"]),
        ("simulator.toml", "[terrain]\nfriction = -1.0\n", ["simulator.toml", "friction", "-1"]),
    ] {
        let file = format!("mine/{file}");
        program.write(&file, text);
        assert_shows(&program.refused(&["optimize", "--config", "mine"]), &parts);
        fs::remove_file(program.path(&file)).unwrap();
    }
    for (arguments, parts) in [
        (["optimize", "--config", "elsewhere"], &["elsewhere"][..]),
        // Regression: options before the subcommand were silently ignored.
        (["--config", "mine", "optimize"], &["--config", "optimize"]),
        (["optimize", "--model", "spot"], &["spot", "go1"]),
        (["optimize", "--task", "backward"], &["backward", "forward"]),
        (["optimize", "--seed", "minus"], &["minus"]),
        (["optimize", "--resume", "mine"], &["mine", "study.log"]),
    ] {
        assert_shows(&program.refused(&arguments), parts);
    }
    assert!(program.studies("recordings").is_empty(), "something was made: {:?}", program.studies("recordings"));
}

#[test]
fn a_urdf_without_a_foot_is_refused() {
    let program = Program::new();
    let ours = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/go1");
    program.write("cripple/robot.toml", &fs::read_to_string(ours.join("robot.toml")).unwrap());
    let mut urdf = fs::read_to_string(ours.join("go1.urdf")).unwrap();
    for (start, end) in [("<link", "</link>"), ("<joint", "</joint>")] {
        let line = urdf.lines().find(|line| line.contains(start) && line.contains("FL_foot")).unwrap().trim();
        let from = urdf.find(line).unwrap();
        let to = from + urdf[from..].find(end).unwrap() + end.len();
        urdf.replace_range(from..to, "");
    }
    program.write("cripple/go1.urdf", &urdf);
    assert_shows(&program.refused(&["optimize", "--model", "cripple"]), &["cripple/go1.urdf", "foot"]);
}

#[test]
fn a_file_that_is_no_recording_is_refused() {
    let program = Program::new();
    program.write("noise.mcap", "this is no recording");
    program.write("empty.mcap", "");
    for file in ["noise.mcap", "nothing.mcap", "empty.mcap"] {
        assert_shows(&program.refused(&["replay", file]), &[file]);
    }
}

#[test]
fn an_incomplete_recording_is_reported_and_can_be_repaired() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "all"]);
    let study = program.study("recordings");
    let bytes = fs::read(study.join("session.mcap")).unwrap();
    let cut = program.path("cut.mcap");
    fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    assert_shows(&program.refused(&["replay", "cut.mcap"]), &["cut.mcap", "quadfrog recover cut.mcap"]);
    assert_shows(&program.text(&["recover", "cut.mcap"]), &["cut.recovered.mcap", "ticks"]);
    assert!(cut.is_file(), "the damaged file is kept");
}

/// Regression: of several failed studies only the first was reported; an output folder that cannot be one was no unusable input.
#[test]
fn every_failed_study_is_reported_and_an_unusable_output_folder_is_unusable_input() {
    let program = Program::new();
    // A file in place of the parent folder.
    program.write("taken", "");
    let output = program.run(&["optimize", "--seed", "0-1", "--trials", "1", "--output", "taken"]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("seed0") && message.contains("seed1"), "{message}");
    assert!(message.contains("give another folder with --output"), "{message}");
}

#[test]
fn several_studies_are_summarized_and_the_sampler_can_be_chosen() {
    let program = Program::new();
    let arguments =
        ["optimize", "--seed", "0-1", "--trials", "2", "--record", "none", "--sampler", "sobol", "--output", "mine"];
    let text = program.text(&arguments);
    assert!(text.trim_end().lines().last().unwrap().starts_with("forward: 2 studies, mean best"), "{text}");
    let kept = fs::read_to_string(program.studies("mine")[0].join("config/optimize.toml")).unwrap();
    assert!(kept.contains("kind = \"sobol\""), "{kept}");
}

/// It also belongs to one session at a time.
#[test]
fn a_continued_study_keeps_its_configuration_and_robot() {
    let program = Program::new();
    program.write("mine/optimize.toml", "trials = 3\n[bounds]\nFz = [200.0, 300.0]\n");
    assert_eq!(program.trials(&["optimize", "--config", "mine", "--json", "--record", "none"]).len(), 3);
    let study = program.study("recordings");
    let study = study.to_str().unwrap();
    assert_shows(&program.refused(&["optimize", "--resume", study, "--model", "a1"]), &["--model a1", "go1"]);
    let resumed = program.run(&["optimize", "--resume", study, "--trials", "5", "--json", "--record", "none"]);
    let notices = String::from_utf8_lossy(&resumed.stderr);
    assert_eq!(notices.matches("continuing with the last configuration of the study").count(), 1, "{notices}");
    let rest: Vec<Value> =
        String::from_utf8_lossy(&resumed.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(rest.len(), 2);
    assert!(rest.iter().all(|trial| (200.0..=300.0).contains(&trial["params"]["Fz"].as_f64().unwrap())));
    let _held = hold(Path::new(study));
    // Regression: a refusal came after the notice of the configuration with which the refused session would continue.
    let refused = program.refused(&["optimize", "--resume", study, "--trials", "6"]);
    assert_shows(&refused, &["another session"]);
    assert!(!refused.contains("continuing with"), "{refused}");
    let refused = program.refused(&["--robot", "go1", "--resume", study]);
    assert_shows(&refused, &["--accept-backend-change"]);
    assert!(!refused.contains("continuing with"), "{refused}");
}

#[test]
fn the_doctor_reports_each_item_and_a_remedy_for_each_warning() {
    let program = Program::new();
    let printed = program.text(&["doctor"]);
    let machine = ["kernel", "real-time priority", "locked memory", "cores", "timer"];
    for item in machine.into_iter().chain(["control thread", "wake-up latency", "connection", "disk"]) {
        let line = printed.lines().find(|line| line.get(6..).is_some_and(|rest| rest.starts_with(item)));
        let line = line.unwrap_or_else(|| panic!("no line on {item}: {printed}"));
        assert!(line.starts_with("ok ") || line.starts_with("warn "), "{line}");
    }
    let warnings = printed.lines().filter(|line| line.starts_with("warn ")).count();
    assert_eq!(printed.lines().filter(|line| line.trim_start().starts_with("-> ")).count(), warnings, "{printed}");
}

/// Regression: the latency was compared with 500 us at the 99th percentile, whatever the configuration asks for at arming.
#[test]
fn the_doctor_compares_the_latency_with_the_limits_of_its_configuration() {
    let program = Program::new();
    assert_shows(&program.text(&["doctor"]), &[" % later than 0.5 ms, limit 1.0 %"]);
    program.write("lax/safety.toml", "[pre_arm]\nlate_ms = 2.0\nlate_share = 0.05\n");
    assert_shows(&program.text(&["doctor", "--config", "lax"]), &[" % later than 2 ms, limit 5.0 %"]);
}

#[test]
fn without_a_terminal_the_console_names_the_alternatives() {
    let program = Program::new();
    assert_shows(&program.refused(&[]), &["terminal", "optimize"]);
    assert!(program.studies("recordings").is_empty());
}

/// Regression: the study was continued on the robot without a word.
#[test]
fn a_simulated_study_is_not_continued_on_the_robot_without_the_flag() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--record", "none"]);
    let study = program.study("recordings");
    let study = study.to_str().unwrap();
    let message = program.refused(&["--robot", "go1", "--resume", study]);
    assert_shows(
        &message,
        &["forward-seed0", "made on sim (go1)", "runs on hardware (go1)", "--accept-backend-change"],
    );
    let accepted = program.refused(&["--robot", "go1", "--resume", study, "--accept-backend-change"]);
    assert_shows(&accepted, &["terminal"]);
}

/// Regressions: the usage of `export` had its file as optional, and a wrong path ended with an error of the system.
#[test]
fn a_missing_file_is_named_in_words_and_the_usage_says_what_is_required() {
    let program = Program::new();
    assert_shows(&program.text(&["export", "--help"]), &["quadfrog export [OPTIONS] <FILE>", "--layout <VIEWER>"]);
    for command in [&["replay", "nowhere/session.mcap"][..], &["replay", "--check", "nowhere"], &["export", "nowhere"]]
    {
        let message = program.refused(command);
        assert_shows(&message, &["nowhere", "there is no such file or folder; name a recording"]);
        assert!(!message.contains("os error"), "{message}");
    }
}

/// Regression: the observed simulator stood still above its ground, since nothing commands it, and was shown as live.
#[test]
fn a_simulated_robot_is_not_observed() {
    let remedy = "add --robot go1 or --robot go2, or watch a running session: quadfrog attach";
    assert_shows(&Program::new().refused(&["--observe"]), &["--observe: the simulated robot", remedy]);
}

/// Regression: a wrong number was refused with "invalid digit found in string".
#[test]
fn a_wrong_number_is_refused_with_the_numbers_that_are_asked_for() {
    let program = Program::new();
    for (arguments, wanted) in [
        (&["--trials", "-3"][..], "for '--trials <N>': give a whole number from 1 to 4294967295"),
        (&["--trials", "abc"], "give a whole number from 1 to 4294967295"),
        (&["--trials", "0"], "give a whole number from 1 to 4294967295"),
        (&["--seed", "x"], "for '--seed <N>': give a whole number from 0 to 4294967295"),
        (&["--seed", "4294967296"], "give a whole number from 0 to 4294967295"),
        (&["export", "--trial", "x", "session.mcap"], "for '--trial <N>': give a whole number from 0 to 4294967295"),
        (&["prior", "--jobs", "1.5"], "for '--jobs <N>': give a whole number from 1 to 65535"),
        (&["evaluate", "--jobs", "-1"], "for '--jobs <N>': give a whole number from 1 to 65535"),
        (&["bench", "loop", "--seconds", "-1"], "for '--seconds <S>': give 0.1 to 86400"),
        (&["study", "list"], "recordings: there is no such folder; give a folder that holds studies"),
        (&["--observe", "--resume", "recordings"], "'--observe' cannot be used with '--resume <DIR>'"),
        (&["--observe", "--approve", "auto"], "'--observe' cannot be used with '--approve <WHAT>'"),
        (&["replay", "notes.txt"], "give one, or the folder of its study"),
        (
            &["optimize", "--trials", "1", "--output", "notes.txt/below"],
            "a part of its path is a file; give another folder with --output",
        ),
    ] {
        program.write("notes.txt", "notes");
        assert_shows(&program.refused(arguments), &[wanted]);
    }
}

/// Regression: such a place was refused with status 1 and without a remedy, for a prior after the simulation of its robots.
#[test]
fn a_place_that_cannot_be_written_is_refused_before_the_work() {
    let program = Program::new();
    program.write("notes.txt", "notes");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let (urdf, sample) = (root.join("robots/go1/go1.urdf"), root.join("recordings/samples/forward"));
    let (urdf, sample) = (urdf.to_str().unwrap(), sample.to_str().unwrap());
    for (arguments, place) in [
        (&["prior", "--output", "/proc/none/prior.json"][..], "/proc/none/prior.json"),
        (&["optimize", "--trials", "1", "--sampler", "sim", "--output", "notes.txt/below"], "notes.txt/below/priors"),
        (&["ask-tell", "--sampler", "sim", "--output", "notes.txt/below"], "notes.txt/below/priors"),
        (&["config", "init", "notes.txt"], "notes.txt"),
        (&["config", "schema", "--output", "notes.txt"], "notes.txt"),
        (&["man", "notes.txt"], "notes.txt"),
        (&["init", urdf, "notes.txt"], "notes.txt"),
        (&["report", sample, "--figures", "notes.txt/below"], "notes.txt/below"),
    ] {
        let message = program.refused(arguments);
        assert_shows(&message, &[place, "cannot be written: ", "; give another place"]);
        assert!(!message.contains("the prior of"), "nothing was simulated: {message}");
        assert_eq!(fs::read_to_string(program.path("notes.txt")).unwrap(), "notes");
    }
    let message = program.refused(&["screenshot", sample, "--output", "-"]);
    assert_shows(&message, &["--output -: it is not standard output here", "./-"]);
    // Regressions: `report` and `prior` wrote a file of the name `-`.
    for arguments in [&["report", sample, "-o", "-"][..], &["prior", "--output", "-"]] {
        assert_shows(&program.refused(arguments), &["--output -: it is not standard output here", "./-"]);
    }
    assert!(!program.path("-").exists());
}

/// Regression: on a full disk a page and a schema were cut off, and nothing was left of what stood there before.
#[test]
fn manual_pages_and_schemas_are_written_whole_or_not_at_all() {
    let program = Program::new();
    let complete = |folder: &str, file: &str| fs::read_to_string(program.path(folder).join(file)).unwrap();
    program.text(&["man", "man"]);
    program.text(&["config", "schema", "-o", "schemas"]);
    // 512 bytes are less than each of them.
    for (arguments, folder) in [(&["man", "man"][..], "man"), (&["config", "schema", "-o", "schemas"], "schemas")] {
        let names = || fs::read_dir(program.path(folder)).unwrap().map(|entry| entry.unwrap().file_name());
        let mut before: Vec<_> = names().map(|name| name.into_string().unwrap()).collect();
        before.sort();
        let texts: Vec<_> = before.iter().map(|name| complete(folder, name)).collect();
        let (status, message) = with_small_files(&program, 1, arguments);
        assert_eq!(status, Some(1), "{message}");
        assert_shows(&message, &[folder, "cannot be written", "File too large"]);
        let mut after: Vec<_> = names().map(|name| name.into_string().unwrap()).collect();
        after.sort();
        assert_eq!(before, after);
        assert!(before.iter().map(|name| complete(folder, name)).eq(texts), "{folder}: a file is cut off");
    }
    assert!(complete("man", "quadfrog.1").contains("quadfrog"));
    assert!(complete("man", "quadfrog-study-list.1").contains("quadfrog"));
}

/// Regression: the first measurement of an hour ran before cyclictest was looked for.
#[test]
fn a_bench_beside_cyclictest_looks_for_it_first() {
    let program = Program::new();
    let mut bench = program.command(&["bench", "loop", "--cyclictest", "--seconds", "3600"]);
    let output = bench.env("PATH", program.path("")).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && output.stdout.is_empty(), "{message}");
    assert_shows(&message, &["cyclictest: No such file or directory", "apt-get install rt-tests"]);
}

/// Regressions: `bench` hid the reason for which `optimize` had failed, took the figure of a script that had failed and one of 0,
/// and a duration that is too short for a measurement.
#[test]
fn bench_reports_why_a_program_failed_and_refuses_a_duration_that_measures_nothing() {
    let program = Program::new();
    for seconds in ["0", "1e-9", "601", "nan", "x"] {
        assert_shows(&program.refused(&["bench", "--seconds", seconds]), &["for '--seconds <S>': give 0.1 to 600"]);
    }
    let failed = |script: &str| {
        program.write("mujoco.py", script);
        let output = program.run(&["bench", "--seconds", "0.1", "--mujoco", "mujoco.py"]);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).unwrap()
    };
    let figure = "print('{\"mj_steps_per_s_standing\": 1000}')";
    let message = failed(&format!("import sys\n{figure}\nsys.exit('no model')"));
    assert_shows(&message, &["mujoco.py ended with exit status: 1: no model"]);
    for none in ["0", "-1", "NaN", "1e999"] {
        assert_shows(
            &failed(&figure.replace("1000", none)),
            &["mujoco.py: printed no mj_steps_per_s_standing above 0"],
        );
    }
    program.write("own/quadfrog/safety.toml", "[fall]\nrol_rad = 0.9\n");
    let mut bench = program.command(&["bench", "--seconds", "0.1"]);
    let output = bench.env("XDG_CONFIG_HOME", program.path("own")).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8(output.stderr).unwrap();
    assert_shows(&message, &["optimize ended with exit status: 2: ", "safety.toml:2", "rol_rad"]);
}

/// Regression: a server that does not answer was reported as "Resource temporarily unavailable", without a remedy.
#[test]
fn a_redis_server_that_does_not_answer_is_reported_with_the_remedy() {
    let program = Program::new();
    let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("redis://{}/0", silent.local_addr().unwrap());
    let message = || {
        let output = program.run(&["report", &address]);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).unwrap()
    };
    let unanswered = message();
    assert_shows(&unanswered, &[&address, "it does not answer within 5 s; start it or correct the address"]);
    assert!(!unanswered.contains("os error"), "{unanswered}");
    drop(silent);
    assert_shows(&message(), &[&address, "Connection refused", "; start it or correct the address"]);
}

/// Regression: the operator of a user without a name, as in a container, was unknown without a word.
#[test]
fn an_unknown_operator_is_reported_once_with_the_remedy() {
    let program = Program::new();
    let run = |arguments: &[&str]| {
        let mut command = program.command(&["optimize", "--seed", "0-1", "--trials", "1", "--record", "none"]);
        // A user without an entry in /etc/passwd.
        command.args(arguments).env("USER", "").env("LOGNAME", "").uid(54_321);
        command.output()
    };
    fs::set_permissions(program.path("."), Permissions::from_mode(0o777)).unwrap();
    let output = match run(&[]) {
        Ok(output) => output,
        Err(error) => return skip(&format!("this user cannot run a program as another: {error}")),
    };
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
    assert_eq!(text.matches("the operator is unknown").count(), 1, "{text}");
    assert_shows(&text, &["--operator NAME"]);
    let output = run(&["--operator", "Ada"]).unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !text.contains("unknown"), "{text}");
}
