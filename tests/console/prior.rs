//! `quadfrog prior`, studies of the sampler `sim`, and `quadfrog ask-tell`, on the running program.

use std::fs;
use std::os::unix::process::ExitStatusExt as _;
use std::path::PathBuf;
use std::process::Command;

use crate::program::{Program, assert_shows};
use crate::pty::Session;
use crate::skip::skip;
use serde_json::Value;

/// The program with a configuration of a small prior in `mine`.
fn small() -> Program {
    let program = Program::new();
    program.write("mine/prior.toml", "worlds = 2\npoints = 16\n");
    program
}

fn names(program: &Program, folder: &str) -> Vec<String> {
    let entries = fs::read_dir(program.path(folder)).into_iter().flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_prior_is_made_once_and_described() {
    let program = small();
    let made = program.text(&["prior", "--task", "twist-ccw", "--config", "mine"]);
    assert_shows(
        &made,
        &[
            "prior of twist-ccw: 2 robots, 16 jumps each",
            "  world 1: ",
            "  world 2: ",
            "kept in recordings/priors/twist-ccw-",
        ],
    );
    let again = program.trials(&["prior", "--task", "twist-ccw", "--config", "mine", "--jobs", "1", "--json"]);
    let [again] = &again[..] else { panic!("{again:?}") };
    assert_eq!((&again["reused"], &again["points"], &again["task"]), (&true.into(), &16.into(), &"twist-ccw".into()));
    assert_eq!(again["worlds"].as_array().unwrap().len(), 2);
    assert!(again["worlds"][1]["robot"]["friction"].as_f64().is_some_and(|mu| (0.45..=1.0).contains(&mu)), "{again}");

    // The same bytes on one thread, in a file of one's own.
    program.text(&["prior", "--task", "twist-ccw", "--config", "mine", "--jobs", "1", "--output", "own.json"]);
    let kept = program.path(again["file"].as_str().unwrap());
    assert_eq!(fs::read(program.path("own.json")).unwrap(), fs::read(kept).unwrap());

    program.write("notes.txt", "not a prior");
    let message = program.refused(&["prior", "--config", "mine", "--output", "notes.txt"]);
    assert_shows(&message, &["notes.txt", "is no prior of this program", "give another name or remove it"]);
    assert_eq!(fs::read_to_string(program.path("notes.txt")).unwrap(), "not a prior");
    // A prior of another task is one: it is replaced, and the program says so.
    let output = program.run(&["prior", "--config", "mine", "--output", "own.json"]);
    assert!(output.status.success());
    assert_shows(
        &String::from_utf8_lossy(&output.stderr),
        &["own.json", "of another robot, configuration, task", "it is made again"],
    );
}

/// The operating system kills the program in the middle of the file, at the limit of a file's length.
#[test]
fn a_program_that_is_killed_while_it_writes_leaves_no_half_prior() {
    let program = small();
    let prior = ["prior", "--config", "mine", "--output", "own/prior.json"];
    let killed = Command::new("sh")
        .args(["-c", "ulimit -c 0; ulimit -f 1; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_quadfrog")])
        .args(prior)
        .current_dir(program.path(""))
        .output()
        .unwrap();
    assert_eq!(killed.status.signal(), Some(25), "SIGXFSZ: {}", String::from_utf8_lossy(&killed.stderr));
    let [part] = &names(&program, "own")[..] else { panic!("{:?}", names(&program, "own")) };
    assert!(part.starts_with(".prior.json.") && part.ends_with(".part"), "{part}");

    assert_shows(&program.text(&prior), &["kept in own/prior.json"]);
    let whole = fs::read(program.path("own/prior.json")).unwrap();
    assert!(whole.len() > 1024, "the limit was in the middle of the file");
    assert_shows(&program.text(&prior), &["nothing has changed: reused own/prior.json"]);
    assert_eq!(fs::read(program.path("own/prior.json")).unwrap(), whole);
}

/// Trials of the JSON lines by seed. Only the lines of several studies name their task and seed.
fn by_seed(lines: &[Value], seed: u64) -> Vec<String> {
    let of_seed = lines.iter().filter(|line| line.get("seed").is_none_or(|given| *given == seed));
    let without = |line: &Value| {
        let mut line = line.clone();
        let keys = line.as_object_mut().unwrap();
        keys.remove("task");
        keys.remove("seed");
        line.to_string()
    };
    of_seed.map(without).collect()
}

#[test]
fn studies_of_several_seeds_share_a_prior_and_equal_separate_runs() {
    let program = small();
    let optimize = |seeds: &str, output: &str, jobs: &str| {
        let arguments =
            ["optimize", "--sampler", "sim", "--config", "mine", "--trials", "3", "--record", "none", "--json"];
        let own = ["--seeds", seeds, "--output", output, "--jobs", jobs];
        let output = program.run(&[&arguments[..], &own].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let lines = String::from_utf8(output.stdout).unwrap();
        let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        (lines, String::from_utf8(output.stderr).unwrap())
    };
    let (together, said) = optimize("0-2", "together", "3");
    // A wait is visible without a terminal, too.
    assert!(said.contains("the prior of forward: 2 simulated robots, 16 jumps each, on "), "{said}");
    assert_eq!(said.matches("the prior of forward took").count(), 1, "{said}");
    assert_eq!(together.len(), 9);
    for seed in 0..3 {
        let (alone, _) = optimize(&seed.to_string(), "alone", "1");
        assert_eq!(by_seed(&alone, seed).len(), 3);
        assert_eq!(by_seed(&together, seed), by_seed(&alone, seed));
    }
    let studies: Vec<PathBuf> =
        program.studies("together").into_iter().filter(|p| p.join("study.log").exists()).collect();
    let shared = names(&program, "together/priors");
    let shared = fs::read(program.path("together/priors").join(&shared[0])).unwrap();
    assert_eq!(studies.len(), 3);
    for study in &studies {
        assert_eq!(fs::read(study.join("prior.json")).unwrap(), shared);
    }
    // A study that is continued has its own; a damaged one is made again, and said so.
    fs::remove_dir_all(program.path("together/priors")).unwrap();
    let study = studies[0].to_str().unwrap();
    let resume = ["optimize", "--resume", study, "--trials", "4", "--record", "none"];
    let output = program.run(&resume);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    assert_shows(&said, &["the prior of forward is that of", "prior.json"]);
    fs::write(studies[0].join("prior.json"), &shared[..100]).unwrap();
    fs::remove_dir_all(program.path("together/priors")).unwrap();
    let resume = ["optimize", "--resume", study, "--trials", "5", "--record", "none"];
    let said = String::from_utf8_lossy(&program.run(&resume).stderr).into_owned();
    assert_shows(&said, &["prior.json", "it is made again"]);
    assert_eq!(fs::read(studies[0].join("prior.json")).unwrap(), shared);
}

/// Optimizes a function of its own through the program, with two points open, after a line that is no JSON.
const TOY: &str = r#"
import json, subprocess, sys
serve = subprocess.Popen(sys.argv[1:], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
def call(line):
    serve.stdin.write(line + "\n")
    serve.stdin.flush()
    return json.loads(serve.stdout.readline())
def j(p):
    return 1 - ((p["f0"] - 1.2) / 0.5) ** 2 - ((p["Fx"] - 60) / 75) ** 2 - ((p["Fz"] - 230) / 100) ** 2
assert "error" in call("no JSON")
values = []
for _ in range(12):
    points = [call('{"ask":{}}') for _ in range(2)]
    assert points[0]["number"] + 1 == points[1]["number"] and points[0]["params"] != points[1]["params"]
    for point in reversed(points):
        fell = point["params"]["Fx"] > 0.5 * point["params"]["Fz"]
        told = {"number": point["number"], "value": j(point["params"]), "verdict": "fall" if fell else "accept"}
        answer = call(json.dumps({"tell": told}))
        assert answer["told"] == point["number"] and answer["verdict"] == told["verdict"], answer
        values.append(0.0 if fell else told["value"])
serve.stdin.close()
assert serve.wait() == 0 and serve.stdout.read() == ""
print(json.dumps({"first": max(values[:5]), "best": max(values)}))
"#;

#[test]
fn a_python_program_optimizes_its_own_function() {
    if Command::new("python3").arg("--version").output().is_err() {
        skip("there is no python3");
        return;
    }
    let run = |seed: &str| {
        let output = Command::new("python3")
            .args([
                "-c",
                TOY,
                env!("CARGO_BIN_EXE_quadfrog"),
                "ask-tell",
                "--task",
                "forward",
                "--sampler",
                "gp",
                "--seed",
                seed,
            ])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let found = run("3");
    assert!(found["best"].as_f64().unwrap() > 0.95, "{found}");
    assert_eq!(run("3"), found, "the same seed, the same points");
}

/// The console on a pseudo-terminal: the prior is made behind the session; the card has the expectation, the review also what
/// came, the Optimizer view the simulated robots, and the journal both.
#[test]
fn the_console_makes_the_prior_and_shows_what_it_expects_and_what_came() {
    let program = Program::new();
    program.write("mine/prior.toml", "worlds = 2\npoints = 64\n");
    let mut console = Session::start(&program.path(""), (120, 40), &["--sampler", "sim", "--config", "mine"]);
    console.wait_for(&["Simulating the prior, ", " of 128 jumps"]);
    let card = ["Trial #0", " expected ", "stands with", "simulated robots"];
    console.wait_for_long("a proposal after the prior", || {
        let screen = console.screen();
        card.iter().all(|text| screen.contains(text)) && screen.contains("Press A to arm")
    });
    console.send("A");
    console.wait_for(&["Press g twice"]);
    console.approve();
    console.wait_for(&["judge it", "stands with"]);
    console.send("a");
    console.wait_for(&["Trial #1"]);
    console.send("3");
    console.wait_for(&["Robot beside the simulated robots", "times", "world 1", "world 2"]);
    console.send("qy");
    assert!(console.wait().success());

    let study = program.studies("").into_iter().find(|path| path.join("study.log").exists()).unwrap();
    let place = study.to_str().unwrap();
    let trials: Value = serde_json::from_str(&program.text(&["study", "export", place, "--format", "json"])).unwrap();
    let judged = &trials[0];
    let attribute = |name: &str| &judged[format!("user_attrs_{name}")];
    assert_eq!(attribute("verdict"), "accept", "{judged}");
    let expected = attribute("predicted").as_f64().unwrap();
    let worlds = ["simulated_least", "simulated_most"].map(|name| attribute(name).as_f64().unwrap());
    assert!(worlds[0] < worlds[1] && expected > 0.0, "{judged}");
    assert!(attribute("p_stand").as_f64().is_some_and(|p| (0.0..=1.0).contains(&p)));
    // The report has the same numbers.
    let page: Value = serde_json::from_str(&program.text(&["report", "--json", place])).unwrap();
    let tables = page["sections"].as_array().unwrap().iter().flat_map(|section| section["blocks"].as_array().unwrap());
    let table = |caption: &str| {
        let mut tables = tables.clone().filter_map(|block| block.get("table"));
        tables.find(|table| table["caption"].as_str().unwrap().starts_with(caption)).unwrap()
    };
    let cell = |table: &Value, name: &str| {
        let columns = table["columns"].as_array().unwrap();
        table["rows"][0][columns.iter().position(|column| column["name"] == name).unwrap()].clone()
    };
    assert_eq!(cell(table("Trials of"), "expected J").as_f64(), Some(expected));
    let value = attribute("value").as_f64().unwrap();
    let difference = cell(table("Trials with an expectation"), "J - expected, mean").as_f64().unwrap();
    assert!((difference - (value - expected)).abs() < 1e-9, "{difference} is not {value} - {expected}");
    let figures: Vec<&Value> = tables.filter_map(|block| block.get("figure")).collect();
    assert!(figures.iter().any(|figure| figure["name"] == "forward-expectations"), "{figures:?}");
}
