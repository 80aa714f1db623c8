//! `quadfrog config`, the user's own configuration, and `quadfrog init`, by the files and lines that the program writes.

use std::fs;
use std::path::{Path, PathBuf};

use crate::program::{Program, assert_shows};
use crate::python_reader::read_by_python;

const FILES: [&str; 6] =
    ["control.toml", "safety.toml", "optimize.toml", "simulator.toml", "prior.toml", "console.toml"];

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn copy(program: &Program, from: &Path, to: &str) {
    program.write(to, &fs::read_to_string(from).unwrap());
}

#[test]
fn every_value_is_shown_with_the_file_and_line_that_gives_it() {
    let program = Program::new();
    program.write("mine/safety.toml", "[fall]\nroll_rad = 0.97\n");
    let shown = program.text(&["config", "show", "fall.", "--config", "mine"]);
    assert_shows(
        &shown,
        &["safety.toml  fall.roll_rad = 0.97  # mine/safety.toml:2\n", "fall.pitch_rad = 1.0  # built-in\n"],
    );
    assert!(!shown.contains("pre_arm"), "{shown}");
    let all = program.text(&["config", "show"]);
    for file in FILES {
        assert!(all.lines().any(|line| line.starts_with(file) && line.ends_with("# built-in")), "{file}");
    }
    for what in [&["flal"][..], &["safety.toml", "flal"]] {
        let message = program.refused(&[&["config", "show"], what].concat());
        assert_shows(&message, &["flal: no key of the configuration begins so", "quadfrog config show"]);
    }
}

/// A robot's own configuration lies under the given one; whole files of the built-in values are reported to replace it.
#[test]
fn the_values_of_a_robots_own_configuration_are_shown() {
    let program = Program::new();
    let own = "optimize.toml  bounds.Fz = [180.0, 400.0]  # robots/go2/config/optimize.toml:6\n";
    assert_shows(
        &program.text(&["config", "show", "bounds.", "--model", "go2"]),
        &[own, "bounds.f0 = [0.75, 1.75]  # built-in"],
    );
    assert_shows(
        &program.text(&["config", "diff", "--model", "go2"]),
        &["bounds.Fz: [150.0, 350.0] -> [180.0, 400.0]\n"],
    );
    program.text(&["config", "init", "whole"]);
    let output = program.command(&["config", "diff", "whole", "--model", "go2"]).output().unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), "no value differs\n");
    let noticed = String::from_utf8(output.stderr).unwrap();
    assert_shows(
        &noticed,
        &[
            "whole/optimize.toml replaces values of the robot's own configuration: bounds.Fx, bounds.Fy, bounds.Fz\n",
            // Its limits of a fall are the built-in ones.
            "whole/safety.toml replaces values of the robot's own configuration: watchdog.velocity_factor\n",
        ],
    );
}

#[test]
fn the_configuration_of_the_user_is_in_force_unless_another_one_is_given() {
    let program = Program::new();
    program.write("own/quadfrog/safety.toml", "[fall]\nroll_rad = 0.9\n");
    program.write("given/safety.toml", "[fall]\npitch_rad = 0.8\n");
    let own = program.path("own");
    let run = |arguments: &[&str]| {
        let output = program.command(arguments).env("XDG_CONFIG_HOME", &own).output().unwrap();
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let (shown, noticed) = run(&["config", "show", "fall."]);
    assert_shows(&shown, &["fall.roll_rad = 0.9  # ", "own/quadfrog/safety.toml:2"]);
    assert_shows(&noticed, &["configuration: ", "own/quadfrog"]);
    let (shown, noticed) = run(&["config", "show", "fall.", "--config", "given"]);
    assert_shows(&shown, &["fall.roll_rad = 1.0  # built-in", "fall.pitch_rad = 0.8  # given/safety.toml:2"]);
    assert_eq!(noticed, "");
    // A study keeps the one that it ran with.
    let (_, noticed) = run(&["optimize", "--trials", "1", "--sampler", "random"]);
    assert_shows(&noticed, &["own/quadfrog"]);
    let kept = fs::read_to_string(program.study("recordings").join("config/safety.toml")).unwrap();
    assert!(kept.contains("roll_rad = 0.9"), "{kept}");
    // A relative path is ignored, as the XDG Base Directory Specification demands.
    let relative =
        program.command(&["config", "diff"]).env("XDG_CONFIG_HOME", "own").env("HOME", "/nonexistent").output();
    assert_eq!(String::from_utf8(relative.unwrap().stdout).unwrap(), "no value differs\n");
    // A mistake in it is refused like one in any other folder.
    program.write("own/quadfrog/safety.toml", "[fall]\nrol_rad = 0.9\n");
    let (_, noticed) = run(&["optimize", "--trials", "1"]);
    assert_shows(&noticed, &["own/quadfrog/safety.toml:2", "rol_rad", "roll_rad"]);
    // One's own place without a TOML file is as good as none; a folder that is given is not.
    fs::remove_file(program.path("own/quadfrog/safety.toml")).unwrap();
    program.write("own/quadfrog/notes.txt", "none");
    assert_shows(&run(&["config", "check"]).0, &["hardware: all limits are inside their ranges"]);
    let (_, refused) = run(&["config", "check", "--config", "own/quadfrog"]);
    assert_shows(&refused, &["own/quadfrog: holds no configuration file"]);
}

/// Regression: a folder of the user that could not be read, as without the permission, was none: its limits were left out.
#[test]
fn a_configuration_of_the_user_that_cannot_be_read_is_refused() {
    let program = Program::new();
    let own = program.path("own");
    let run = |arguments: &[&str]| {
        let output = program.command(arguments).env("XDG_CONFIG_HOME", &own).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    // Neither is a folder; the permission does not bind the user root.
    program.write("own/quadfrog", "notes");
    let (status, message) = run(&["optimize", "--trials", "1"]);
    assert_eq!(status, Some(2), "{message}");
    assert_shows(&message, &["own/quadfrog cannot be read: ", "Not a directory", "--config DIR"]);
    assert!(!program.path("recordings").exists());
    fs::remove_file(program.path("own/quadfrog")).unwrap();
    std::os::unix::fs::symlink("quadfrog", program.path("own/quadfrog")).unwrap();
    let (status, message) = run(&["config", "show"]);
    assert_eq!(status, Some(2), "{message}");
    assert_shows(&message, &["own/quadfrog cannot be read: ", "symbolic links"]);
    program.write("given/safety.toml", "[fall]\npitch_rad = 0.8\n");
    assert_eq!(run(&["config", "show", "--config", "given"]).0, Some(0));
    // A user without a home has no configuration.
    let mut homeless = program.command(&["config", "show"]);
    homeless.env_remove("XDG_CONFIG_HOME").env("HOME", "/dev/null");
    assert!(homeless.output().unwrap().status.success());
}

#[test]
fn a_new_configuration_is_valid_and_differs_in_nothing_until_it_is_edited() {
    let program = Program::new();
    let own = program.path("home");
    let run = |arguments: &[&str]| program.command(arguments).env("XDG_CONFIG_HOME", &own).output().unwrap();
    let made = run(&["config", "init"]);
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    for file in FILES {
        let written = fs::read_to_string(own.join("quadfrog").join(file)).unwrap();
        assert_eq!(written, fs::read_to_string(repository().join("config").join(file)).unwrap(), "{file}");
    }
    assert_eq!(String::from_utf8(run(&["config", "diff"]).stdout).unwrap(), "no value differs\n");
    assert_shows(
        &program.text(&["config", "check", "home/quadfrog", "--hardware"]),
        &["simulator: all", "hardware: all"],
    );

    program.write("home/quadfrog/safety.toml", "[parameters]\nFx = [0.0, 400.0]\n");
    let differences = program.text(&["config", "diff", "home/quadfrog"]);
    assert_eq!(differences, "safety.toml  parameters.Fx: [0.0, 200.0] -> [0.0, 400.0]\n");
    let back = "safety.toml  parameters.Fx: [0.0, 400.0] -> [0.0, 200.0]\n";
    program.write("empty/safety.toml", "");
    // Regression: of two folders the values went from the second to the first.
    assert_eq!(program.text(&["config", "diff", "home/quadfrog", "empty"]), back);
    assert_eq!(program.text(&["config", "diff", "empty", "home/quadfrog"]), differences);
    // Regression: `--config` of the other commands was an error.
    assert_eq!(program.text(&["config", "diff", "--config", "home/quadfrog"]), differences);
    // Regression: of the three commands about a configuration one did not take the option of all others.
    let by_option = program.text(&["config", "check", "--config", "home/quadfrog"]);
    assert_eq!(by_option, program.text(&["config", "check", "home/quadfrog"]));
    assert_shows(&program.text(&["config", "check", "home/quadfrog"]), &["simulator: all", "hardware: refused", "Fx"]);
    assert_shows(
        &program.refused(&["config", "check", "home/quadfrog", "--hardware"]),
        &["safety.toml:2", "Fx", "300"],
    );
    program.write("home/quadfrog/console.toml", "chart_window_s = 900.0\n");
    assert_shows(
        &program.refused(&["config", "check", "home/quadfrog"]),
        &["console.toml:1", "chart_window_s", "60 s"],
    );

    // Nothing that was edited is replaced.
    assert_shows(&program.refused(&["config", "init", "home/quadfrog"]), &["exists already", "control.toml"]);
    assert_eq!(fs::read_to_string(own.join("quadfrog/console.toml")).unwrap(), "chart_window_s = 900.0\n");
}

/// Regression: the range on hardware continued the sentence of a comment without a full stop.
#[test]
fn the_range_on_hardware_is_a_sentence_of_its_own_in_a_schema() {
    let schema: serde_json::Value =
        serde_json::from_str(&Program::new().text(&["config", "schema", "safety.toml"])).unwrap();
    let expires = schema["properties"]["approval"]["properties"]["expires_s"]["description"].as_str().unwrap();
    assert_shows(expires, &["At most 5 on hardware. On hardware it must be 0.5 to 5 s."]);
    let text = schema.to_string();
    let joined = text.match_indices(" On hardware it ").filter(|(at, _)| !text[..*at].ends_with('.'));
    assert_eq!(joined.count(), 0);
}

/// The schema takes every shipped file, and refuses what the program refuses.
#[test]
fn the_schemas_agree_with_the_program() {
    let program = Program::new();
    program.text(&["config", "schema", "--output", "schemas"]);
    let mut folders = vec![repository().join("config")];
    folders.extend(fs::read_dir(repository().join("examples")).unwrap().map(|entry| entry.unwrap().path()));
    let mut accepted = Vec::new();
    for folder in folders.iter().filter(|folder| folder.is_dir()) {
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        for file in FILES.iter().filter(|file| folder.join(file).exists()) {
            copy(&program, &folder.join(file), &format!("accepted/{name}/{file}"));
            accepted.push(format!("accepted/{name}/{file}"));
        }
    }
    assert!(accepted.len() > 20, "{accepted:?}");
    let refused = [
        ("safety.toml", "[fall]\nrol_rad = 1.0\n"),
        ("safety.toml", "[fall]\nroll_rad = 4.0\n"),
        ("safety.toml", "[fall]\nroll_rad = \"1\"\n"),
        ("control.toml", "[tasks.forward]\ncutoff = \"knee\"\n"),
        ("control.toml", "[tasks.backward]\nkp = 400.0\n"),
        ("control.toml", "[realtime]\nhardware_priority = 100\n"),
        ("control.toml", "[tasks.forward]\nduration_s = 0.0\n"),
        ("optimize.toml", "objective = \"guess\"\n"),
        ("optimize.toml", "[sampler]\nkind = \"cma\"\n"),
        ("optimize.toml", "trials = 2.5\n"),
        ("optimize.toml", "[first.forward]\nFq = 1.0\n"),
        ("simulator.toml", "[terrain]\nkind = \"mud\"\n"),
        ("simulator.toml", "[terrain.slope]\nangle_rad = 2.0\n"),
        ("prior.toml", "worlds = 1\n"),
        ("console.toml", "theme = \"blue\"\n"),
        ("console.toml", "chart_series = [\"roll\", \"rol\"]\n"),
        ("console.toml", "[keys]\nstopp = [\"Space\"]\n"),
    ];
    for (index, (file, text)) in refused.iter().enumerate() {
        program.write(&format!("refused/{index}/{file}"), text);
        program.refused(&["config", "check", &format!("refused/{index}")]);
    }
    let Some(found) = read_by_python("check_schema.py", &program.path("")) else { return };
    for file in &accepted {
        assert_eq!(found[file], serde_json::json!([]), "{file}");
    }
    for (index, (file, text)) in refused.iter().enumerate() {
        let errors = found[format!("refused/{index}/{file}")].as_array().unwrap();
        assert!(!errors.is_empty(), "the schema takes {text}");
    }
}

/// The reference in the documentation is the one that the program prints: `quadfrog config reference`.
#[test]
fn the_reference_in_the_documentation_is_up_to_date() {
    let program = Program::new();
    let page = fs::read_to_string(repository().join("docs/reference/configuration.md")).unwrap();
    let printed = program.text(&["config", "reference"]);
    assert!(page == printed, "quadfrog config reference >docs/reference/configuration.md");
    // Every key of every file has its row, with its range.
    assert_shows(&page, &["| `roll_rad` | `1.0` | 0.01 to 3.15 rad | 0.3 to 1.2 rad |", "### [tasks.twist-cw]"]);
    for file in FILES {
        let text = fs::read_to_string(repository().join("config").join(file)).unwrap();
        let keys = text.lines().filter_map(|line| line.split_once('=').map(|(key, _)| key.trim()));
        for key in keys.filter(|key| !key.contains(['#', ' ', '"'])) {
            assert!(page.contains(&format!("| `{key}` |")), "{file}: {key}");
        }
    }
}

/// A new robot from the URDF of a known one: the folder can be used at once, and what is missing is said.
#[test]
fn a_robot_is_begun_from_its_urdf() {
    let program = Program::new();
    let urdf = repository().join("robots/a1/a1.urdf");
    let said = program.text(&["init", urdf.to_str().unwrap(), "robots/alpha"]);
    assert_shows(
        &said,
        &["robots/alpha/robot.toml", "alpha: ", "[motor]", "[pose] lying_rad", "forward: the stance is in reach"],
    );
    assert_eq!(fs::read(program.path("robots/alpha/a1.urdf")).unwrap(), fs::read(&urdf).unwrap());
    let trials = program.trials(&["optimize", "--model", "robots/alpha", "--trials", "2", "--json"]);
    assert_eq!(trials.len(), 2);
    assert!(trials.iter().any(|trial| trial["verdict"] == "accept"), "{trials:?}");

    assert_shows(
        &program.refused(&["init", urdf.to_str().unwrap(), "robots/alpha"]),
        &["robot.toml", "exists already"],
    );
    program.write("three.urdf", "<robot name=\"three\"><link name=\"trunk\"/></robot>");
    assert_shows(&program.refused(&["init", "three.urdf", "robots/three"]), &["three.urdf"]);
    assert!(!program.path("robots/three").exists(), "nothing is written for a URDF that is refused");
    // Regression: a file of another kind was refused in the words of the XML parser alone.
    program.write("notes.md", "# Notes\n");
    assert_shows(
        &program.refused(&["init", "notes.md", "robots/notes"]),
        &["notes.md: ", "; give the URDF of a robot"],
    );
    assert_shows(&program.refused(&["init", "none.urdf", "robots/none"]), &["none.urdf", "cannot be read"]);
    // Regression: the URDF and the new robot.toml had one name, and the folder could not be written.
    fs::copy(&urdf, program.path("robot.toml")).unwrap();
    let message = program.refused(&["init", "robot.toml", "robots/two"]);
    assert_shows(&message, &["robot.toml: is the name of the file that init writes", "give the URDF another one"]);
    // Regression: an empty URDF of a model was refused without the remedy that `init` gives.
    program.write("robots/alpha/a1.urdf", "");
    let message = program.refused(&["evaluate", "--model", "robots/alpha", "--point", "f0=1.3,Fx=40,Fz=210"]);
    assert_shows(&message, &["robots/alpha/a1.urdf: ", "; give the URDF of a robot"]);
}

/// Regressions: a robot without a name was accepted, and one in the present folder was named `robot`.
#[test]
fn a_new_robot_has_a_printable_name_or_that_of_its_folder() {
    let program = Program::new();
    let urdf = repository().join("robots/a1/a1.urdf");
    let urdf = urdf.to_str().unwrap();
    for name in ["", " ", "two\nlines", "\u{202e}left"] {
        assert_shows(&program.refused(&["init", urdf, "named", "--name", name]), &["--name", "1 to 100 characters"]);
    }
    let message = program.refused(&["init", urdf, "two\u{1b}lines"]);
    assert_shows(&message, &["1 to 100 characters", "give the robot's name with --name"]);
    assert!(!program.path("named").exists());
    fs::create_dir(program.path("pony")).unwrap();
    let output = program.command(&["init", urdf, "."]).current_dir(program.path("pony")).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(fs::read_to_string(program.path("pony/robot.toml")).unwrap().contains("name = \"pony\""));
}

/// The answers to a shell, and the script that it runs, in bash itself.
#[test]
fn a_shell_completes_studies_robots_and_trials() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "2", "--sampler", "random", "--record", "all", "--output", "recordings"]);
    let study = program.study("recordings");
    let study = format!("recordings/{}", study.file_name().unwrap().to_string_lossy());
    program.write("robots/pony/robot.toml", "");
    let completed = |line: &str| {
        let script = format!(
            "source <(quadfrog completions bash)\n\
             COMP_LINE='{line}'; COMP_POINT=${{#COMP_LINE}}; COMP_TYPE=9\n\
             read -ra COMP_WORDS <<<\"$COMP_LINE\"; [[ $COMP_LINE == *' ' ]] && COMP_WORDS+=('')\n\
             COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))\n\
             _clap_complete_quadfrog quadfrog \"${{COMP_WORDS[COMP_CWORD]}}\" ''\n\
             printf '%s\\n' \"${{COMPREPLY[@]}}\""
        );
        let folder = Path::new(env!("CARGO_BIN_EXE_quadfrog")).parent().unwrap();
        let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap());
        let output = std::process::Command::new("bash")
            .args(["-c", &script])
            .current_dir(program.path(""))
            .env("PATH", path)
            .output();
        String::from_utf8(output.unwrap().stdout).unwrap()
    };
    assert_shows(&completed("quadfrog study show "), &[study.as_str()]);
    assert_shows(&completed("quadfrog --resume "), &[study.as_str()]);
    assert_shows(&completed("quadfrog optimize --task "), &["forward", "twist-ccw"]);
    assert_shows(&completed("quadfrog optimize --model "), &["go1", "a1", "go2", "robots/pony"]);
    assert_shows(&completed("quadfrog optimize --sampler "), &["tpe", "gp", "sim"]);
    let trials = completed(&format!("quadfrog export {study}/session.mcap --trial "));
    assert_eq!(trials.lines().collect::<Vec<_>>(), ["0", "1"]);
    assert_shows(&completed("quadfrog conf"), &["config"]);
    for shell in ["zsh", "fish"] {
        assert_shows(&program.text(&["completions", shell]), &["quadfrog", "QUADFROG_COMPLETE"]);
    }
}

/// A manual page for the program and for each command, readable by `man`.
#[test]
fn each_command_has_a_manual_page() {
    let program = Program::new();
    program.text(&["man", "pages"]);
    let page = |name: &str| fs::read_to_string(program.path(&format!("pages/{name}.1"))).unwrap();
    assert_shows(&page("quadfrog"), &[".TH", "approve", "quadfrog\\-optimize(1)"]);
    let help = program.text(&["--help"]);
    let commands =
        help.lines().skip_while(|line| !line.starts_with("Commands:")).skip(1).take_while(|line| !line.is_empty());
    let commands: Vec<_> = commands
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next().filter(|name| !name.is_empty()))
        .collect();
    assert!(commands.len() > 20, "{commands:?}");
    for command in commands.iter().filter(|command| **command != "help") {
        assert!(page(&format!("quadfrog-{command}")).contains(".TH"), "{command}");
    }
    assert_shows(&page("quadfrog-config-check"), &["hardware"]);
}

#[test]
fn the_version_names_the_commit() {
    let program = Program::new();
    let version = program.text(&["--version"]);
    let commit = version.trim_end().strip_suffix(')').and_then(|version| version.split_once('('));
    let (before, commit) = commit.expect("a commit in parentheses");
    assert_eq!(before, format!("quadfrog {} ", env!("CARGO_PKG_VERSION")));
    let hexadecimal = commit.len() >= 40 && commit.chars().all(|digit| digit.is_ascii_hexdigit());
    assert!(commit == "unknown" || hexadecimal, "{version}");
}
