//! `quadfrog reproduce` on the running program.

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Instant;

use crate::program::ending_signals;
use nix::sys::signal::{Signal, kill};
use nix::sys::stat::Mode;
use nix::unistd::{Pid, mkfifo};
use quadfrog::control::settings::TaskControl;
use quadfrog::trial::Task;
use quadfrog_console::subcommand::{EXAMPLES, ExperimentConfiguration, minutes, seconds_left};
use serde_json::Value;
use strum::VariantArray;

const QUADFROG: &str = env!("CARGO_BIN_EXE_quadfrog");

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn quadfrog(arguments: &[&str]) -> Output {
    // Another folder than the checkout: the program carries its configurations.
    let elsewhere = tempfile::tempdir().unwrap();
    Command::new(QUADFROG).current_dir(elsewhere.path()).args(arguments).output().unwrap()
}

fn reproduce(folder: &Path, arguments: &[&str]) -> Output {
    let fixed = ["reproduce", "--output", folder.to_str().unwrap()];
    let output = quadfrog(&[&fixed, arguments].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn results(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("results.json")).unwrap()).unwrap()
}

fn json_lines(output: &Output) -> Vec<Value> {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout.clone()).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn studies_are_those_of_optimize_and_do_not_depend_on_the_threads() {
    let [one, two] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let arguments = ["--quick", "--only", "convergence", "--trials", "3", "--seed", "41"];
    let table = reproduce(one.path(), &[&arguments[..], &["--jobs", "1"]].concat());
    let again = reproduce(two.path(), &[&arguments[..], &["--jobs", "2"]].concat());
    assert_eq!(table.stdout, again.stdout);
    // Regression: the text had the heading of the configurations, which are in the report alone.
    assert!(!String::from_utf8_lossy(&table.stdout).contains("Configurations"));
    for file in ["results.json", "report.html", "convergence.svg"] {
        let [one, two] = [one.path(), two.path()].map(|folder| fs::read_to_string(folder.join(file)).unwrap());
        assert!(one == two, "{file} differs");
    }
    let results = results(one.path());
    let study = results["studies"].as_array().unwrap().iter().find(|study| {
        let job = &study["job"];
        job["task"] == "twist-ccw" && job["seed"] == 42 && job["sampler"] == "tpe"
    });
    let trials = study.unwrap()["trials"].as_array().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let optimized = json_lines(&quadfrog(&[
        "optimize",
        "--task",
        "twist-ccw",
        "--seed",
        "42",
        "--trials",
        "3",
        "--record",
        "none",
        "--json",
        "--output",
        folder.path().to_str().unwrap(),
    ]));
    assert_eq!((trials.len(), optimized.len()), (3, 3));
    for (ours, theirs) in trials.iter().zip(&optimized) {
        assert_eq!(ours["value"], theirs["value"]);
        assert_eq!(ours["verdict"], theirs["verdict"]);
        for pair in ours["params"].as_array().unwrap() {
            assert_eq!(pair[1], theirs["params"][pair[0].as_str().unwrap()]);
        }
    }
}

#[test]
fn runs_are_those_of_evaluate_and_the_report_opens_without_a_network() {
    let folder = tempfile::tempdir().unwrap();
    let output = reproduce(folder.path(), &["--quick", "--only", "continuous", "--trials", "1", "--seed", "40"]);
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(table.contains("Continuous jumping") && table.contains("continuous forward jumping"), "{table}");
    let results = results(folder.path());
    let config = root().join("examples/continuous");
    let evaluated = json_lines(&quadfrog(&[
        "evaluate",
        "--config",
        config.to_str().unwrap(),
        "--task",
        "forward",
        "--seeds",
        "140-141",
        "--json",
    ]));
    let runs: Vec<&Value> =
        results["runs"].as_array().unwrap().iter().filter(|run| run["job"]["point"] == "first").collect();
    for (ours, theirs) in runs.iter().zip(&evaluated) {
        assert_eq!(ours["job"]["seed"], theirs["seed"]);
        for key in ["fell", "value", "jumps", "tilt_at_impulse_rad", "roll_range_rad", "pitch_range_rad"] {
            assert_eq!(ours[key], theirs[key], "{key}");
        }
    }
    let html = fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(html.contains("By decreasing the time between successive jumps"));
    for reference in ["<script", "<link", "<img", "src=", "@import", "url(", "href=\"http"] {
        assert!(!html.contains(reference), "{reference}");
    }
    let svg = fs::read_to_string(folder.path().join("continuous.svg")).unwrap();
    assert!(svg.contains("Distance per jump (m)"));
    // The results alone make the same report.
    let again = tempfile::tempdir().unwrap();
    reproduce(again.path(), &["--from", folder.path().join("results.json").to_str().unwrap()]);
    assert!(fs::read_to_string(again.path().join("report.html")).unwrap() == html);
}

/// Table and figures are those of the reduced results in the checkout; without these there are none.
#[test]
fn the_texts_and_figures_of_the_checkout_are_those_of_its_results() {
    const TEXTS: [&str; 2] = ["README.md", "docs/paper.md"];
    const FIGURES: [&str; 2] = ["docs/convergence.svg", "docs/rough-terrain.svg"];
    let from = root().join("docs/reproduced.json");
    if !from.exists() {
        let begin = "<!-- begin: written by `quadfrog reproduce --readme` -->\n";
        let end = "<!-- end: written by `quadfrog reproduce --readme` -->\n";
        for file in TEXTS {
            let text = fs::read_to_string(root().join(file)).unwrap();
            assert!(text.contains(&format!("{begin}{end}")), "{file} has a table without docs/reproduced.json");
        }
        assert!(FIGURES.iter().all(|file| !root().join(file).exists()));
        return;
    }
    let [copy, folder] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    fs::create_dir(copy.path().join("docs")).unwrap();
    for file in TEXTS {
        fs::copy(root().join(file), copy.path().join(file)).unwrap();
    }
    reproduce(folder.path(), &["--from", from.to_str().unwrap(), "--readme", copy.path().to_str().unwrap()]);
    for file in TEXTS.iter().chain(&FIGURES).chain(&["docs/reproduced.json"]) {
        let [theirs, ours] = [copy.path(), &root()].map(|place| fs::read_to_string(place.join(file)).ok());
        assert!(theirs == ours, "{file}: renew it with `quadfrog reproduce --from docs/reproduced.json --readme .`");
        assert!(!file.ends_with("svg") || ours.is_none_or(|svg| svg.len() < 60_000), "{file} is too large");
    }
    assert!(
        fs::read_to_string(root().join("README.md"))
            .unwrap()
            .contains("| forward, 20 trials, hardware-like simulation | 0.5 m |")
    );
}

#[test]
fn tables_of_a_checkout_need_every_experiment_and_are_written_between_their_markers() {
    let [one, copy] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    fs::create_dir(copy.path().join("docs")).unwrap();
    let text = "before\n<!-- begin: written by `quadfrog reproduce --readme` -->\nold\n<!-- end: written by `quadfrog reproduce --readme` -->\nafter\n";
    for file in ["README.md", "docs/paper.md"] {
        fs::write(copy.path().join(file), text).unwrap();
    }
    let copied = copy.path().to_str().unwrap();
    let arguments = ["--quick", "--only", "convergence", "--trials", "1", "--seed", "41"];
    reproduce(one.path(), &arguments);
    let results = one.path().join("results.json");
    let from = ["reproduce", "--output", one.path().to_str().unwrap(), "--from", results.to_str().unwrap()];
    let output = quadfrog(&[&from[..], &["--readme", copied]].concat());
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("needs every experiment"));
    assert_eq!(fs::read_to_string(copy.path().join("README.md")).unwrap(), text);
    // Regressions: this was refused after the work, and after the report was written.
    let other = copy.path().join("report");
    let begin = ["reproduce", "--readme", copied, "--output", other.to_str().unwrap()];
    let output = quadfrog(&[&begin[..], &["--from", results.to_str().unwrap()]].concat());
    assert_eq!(output.status.code(), Some(2));
    assert!(!other.exists());
    let output = quadfrog(&[&begin[..], &arguments].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && message.contains("cannot be used with"), "{message}");
    assert!(!other.exists());
    // The same results, marked as complete: an experiment without studies has rows without figures.
    let mut whole: Value = serde_json::from_str(&fs::read_to_string(&results).unwrap()).unwrap();
    let all = [
        "convergence",
        "hardware-like",
        "high-twist",
        "continuous",
        "rough-terrain",
        "directions",
        "transfer",
        "landing",
    ];
    whole["experiments"] = all.into();
    fs::write(&results, whole.to_string()).unwrap();
    reproduce(one.path(), &["--from", results.to_str().unwrap(), "--readme", copied]);
    let readme = fs::read_to_string(copy.path().join("README.md")).unwrap();
    assert!(readme.starts_with("before\n<!-- begin") && readme.ends_with("-->\nafter\n"), "{readme}");
    assert!(
        readme.contains("| successful studies, ideal simulation | 15 of 15 |")
            && readme.contains("(docs/convergence.svg)")
    );
    assert!(readme.contains("| high twist, ideal simulation |") && !readme.contains("old") && !readme.contains("NaN"));
    assert!(fs::read_to_string(copy.path().join("docs/convergence.svg")).unwrap().contains("<svg"));
}

#[test]
fn a_signal_ends_at_once_and_says_what_is_kept() {
    ending_signals().into_iter().for_each(end_by);
}

fn end_by(signal: Signal) {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(QUADFROG);
    command.args(["reproduce", "--only", "convergence", "--output"]).arg(folder.path());
    let mut child = command.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(lines.next().unwrap().unwrap().contains("30 studies"));
    kill(Pid::from_raw(child.id() as i32), signal).unwrap();
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(128 + signal as i32));
    assert!(rest.concat().contains("interrupted: no experiment was complete, nothing was written"), "{rest:?}");
    assert!(!folder.path().join("results.json").exists());
}

/// Regression: the fewer results of an interrupted run replaced complete ones.
#[test]
fn an_interrupt_leaves_complete_results_alone() {
    // The runs of the transfer follow the studies of the convergence and take half of the time.
    let arguments = ["--quick", "--trials", "6", "--jobs", "2", "--seed", "41", "--only", "convergence,transfer"];
    let folder = tempfile::tempdir().unwrap();
    let begun = Instant::now();
    reproduce(folder.path(), &arguments);
    let whole = begun.elapsed();
    let [complete, kept] = ["results.json", "results.interrupted.json"].map(|name| folder.path().join(name));
    let before = fs::read(&complete).unwrap();
    let mut wait = whole.mul_f64(0.8);
    for _ in 0..20 {
        let mut command = Command::new(QUADFROG);
        command.args(["reproduce", "--output"]).arg(folder.path()).args(arguments);
        let mut child = command.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(wait);
        kill(Pid::from_raw(child.id() as i32), Signal::SIGTERM).unwrap();
        let message = std::io::read_to_string(child.stderr.take().unwrap()).unwrap();
        let was_late = child.wait().unwrap().success();
        assert!(fs::read(&complete).unwrap() == before, "{message}");
        if message.contains("the complete experiments") {
            let from = kept.to_str().unwrap();
            assert!(message.contains(&format!("`quadfrog reproduce --from {from} --output DIR`")), "{message}");
            let again = tempfile::tempdir().unwrap();
            reproduce(again.path(), &["--from", from]);
            assert_eq!(results(again.path())["experiments"], serde_json::json!(["convergence"]));
            return;
        }
        // The computer is faster or slower than in the first run.
        wait = wait.mul_f64(if was_late { 0.9 } else { 1.15 });
    }
    panic!("no run was interrupted between its two parts");
}

/// Regression: a page, a figure and results that are not of this program were replaced.
#[test]
fn files_of_another_origin_are_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let from = root().join("docs/reproduced.json");
    for (name, text) in [
        ("report.html", "<!DOCTYPE html><p>mine</p>"),
        ("results.json", "{\"mine\": 1}"),
        ("results.interrupted.json", ""),
        ("convergence.svg", "<svg/>"),
    ] {
        let file = folder.path().join(name);
        fs::write(&file, text).unwrap();
        for arguments in [&["--from", from.to_str().unwrap()][..], &["--quick"]] {
            let output = quadfrog(&[&["reproduce", "--output", folder.path().to_str().unwrap()], arguments].concat());
            let message = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{message}");
            assert!(message.contains(name) && message.contains("give another name or remove it"), "{message}");
        }
        assert_eq!(fs::read_to_string(&file).unwrap(), text);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        fs::remove_file(&file).unwrap();
    }
    // What the same command wrote is replaced.
    for _ in 0..2 {
        reproduce(folder.path(), &["--from", from.to_str().unwrap()]);
    }
}

/// Regressions: results were read without a limit, and refused without the name of the option, after the folder was made.
#[test]
fn results_that_cannot_be_read_are_refused_before_a_folder_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("made");
    let pipe = folder.path().join("pipe");
    mkfifo(&pipe, Mode::S_IRWXU).unwrap();
    let foreign = folder.path().join("foreign.json");
    fs::write(&foreign, "{}").unwrap();
    for from in [&folder.path().join("missing.json"), folder.path(), &pipe, Path::new("/dev/zero"), &foreign] {
        let from = from.to_str().unwrap();
        let output = quadfrog(&["reproduce", "--output", made.to_str().unwrap(), "--from", from]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(
            message.contains(&format!("--from {from}: ")) && message.contains("give the results.json"),
            "{message}"
        );
        assert!(!made.exists(), "{from}");
    }
}

/// Regression: studies in which nothing stood were left out of the mean best, which then agreed with the paper's.
#[test]
fn studies_in_which_nothing_stood_count_in_the_mean_best() {
    let folder = tempfile::tempdir().unwrap();
    let mut results: Value =
        serde_json::from_str(&fs::read_to_string(root().join("docs/reproduced.json")).unwrap()).unwrap();
    for study in results["studies"].as_array_mut().unwrap() {
        let job = &study["job"];
        let like = ["hardware-like", "hardware-like-estimate"].contains(&job["configuration"].as_str().unwrap());
        if like && job["task"] == "forward" && job["seed"] != 2000 {
            for trial in study["trials"].as_array_mut().unwrap() {
                (trial["verdict"], trial["value"]) = ("fall".into(), 0.0.into());
            }
        }
    }
    let from = folder.path().join("fallen.json");
    fs::write(&from, results.to_string()).unwrap();
    let report = folder.path().join("report");
    reproduce(&report, &["--from", from.to_str().unwrap()]);
    let html = fs::read_to_string(report.join("report.html")).unwrap();
    let row = html.split("<tr>").find(|row| row.contains("forward, 20 trials, hardware-like simulation")).unwrap();
    assert!(row.contains("0.11 m (0.00 to 0.54)") && row.contains("does not agree"), "{row}");
}

#[test]
fn unusable_input_is_refused_before_the_work_with_its_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "text").unwrap();
    let path = |path: &Path| path.to_str().unwrap().to_owned();
    let below_file = path(&file.join("below"));
    let (good, missing) = (path(&folder.path().join("good")), path(&folder.path().join("missing.json")));
    for (arguments, parts) in [
        (vec!["--output", &below_file], vec!["--output", "give another folder"]),
        (vec!["--output", &good, "--from", &missing], vec!["missing.json"]),
        (vec!["--output", &good, "--from", file.to_str().unwrap()], vec!["file", "results.json"]),
        (vec!["--output", &good, "--only", "divergence"], vec!["divergence", "convergence"]),
        (vec!["--output", &good, "--readme", &good], vec!["--readme", "README.md", "root of a checkout"]),
        (vec!["--output", &good, "--trials", "0"], vec!["--trials", "0"]),
        (vec!["--output", &good, "--seed", "4294967295"], vec!["--seed", "4294966295"]),
    ] {
        let output = quadfrog(&[&["reproduce"], &arguments[..]].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{arguments:?}: {message}");
    }
}

#[test]
fn every_configuration_loads() {
    for configuration in ExperimentConfiguration::VARIANTS {
        let loaded = configuration.load();
        assert!(loaded.is_ok(), "{}: {}", configuration.name(), loaded.unwrap_err());
    }
}

/// Regression: the cut-off of the example stayed on beside the words "the paper's controller".
#[test]
fn the_papers_controller_over_blocks_has_no_added_term() {
    let task = |configuration: ExperimentConfiguration| *configuration.load().unwrap().task(Task::Forward);
    let example = task(ExperimentConfiguration::RoughTerrain);
    let TaskControl { stance_m, jumps, f1_hz, .. } = example;
    let paper = TaskControl { stance_m, jumps, f1_hz, ..task(ExperimentConfiguration::Ideal) };
    assert_eq!(task(ExperimentConfiguration::RoughTerrainPaper), paper);
    assert_ne!(example, paper);
}

#[test]
fn the_whole_folder_of_each_example_is_compiled_in() {
    for files in EXAMPLES {
        let folder = Path::new(files[0].0).parent().unwrap();
        let compiled: BTreeSet<_> =
            files.iter().map(|(path, _)| Path::new(path).file_name().unwrap().to_owned()).collect();
        let entries = fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path());
        let toml = entries.filter(|path| path.extension().is_some_and(|extension| extension == "toml"));
        let found: BTreeSet<_> = toml.map(|path| path.file_name().unwrap().to_owned()).collect();
        assert_eq!(compiled, found, "{}", folder.display());
    }
}

#[test]
fn the_time_left_follows_the_rate_and_is_not_given_before_it_is_known() {
    assert_eq!(seconds_left(4, 100, 10.0), None);
    assert_eq!(seconds_left(25, 100, 30.0), Some(90.0));
    assert_eq!(seconds_left(100, 100, 30.0), Some(0.0));
    assert_eq!((minutes(89.2), minutes(150.0)), ("90 s".to_owned(), "2.5 min".to_owned()));
}
