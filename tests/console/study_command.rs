//! `quadfrog study` on stored studies.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::program::{Program, assert_shows, counted_trials, hold, with_small_files};
use crate::pty::Session;
use crate::skip::skip;
use serde_json::Value;

/// A finished study of six trials, and its folder.
fn study(task: &str) -> (Program, String) {
    let program = Program::new();
    program.text(&["optimize", "--task", task, "--trials", "6", "--record", "none"]);
    let study = program.study("recordings");
    (program, study.to_str().unwrap().to_owned())
}

#[test]
fn studies_are_listed_and_shown() {
    let (program, study) = study("forward");
    let list = program.text(&["study", "list"]);
    let mut lines = list.lines();
    assert!(lines.next().unwrap().starts_with("study"), "{list}");
    let line = lines.next().unwrap();
    assert!(line.contains("forward") && line.contains(" m"), "{list}");
    let name = Path::new(&study).file_name().unwrap().to_str().unwrap();
    assert!(line.contains(name), "{list}");
    let cells: Vec<&str> = line.split_whitespace().collect();
    let falls =
        program.exported(&study).iter().filter(|row| row["user_attrs"]["verdict"] == "fall").count().to_string();
    // Trials, those that count (without a person none is void), falls; task and seed are in the folder's name.
    assert_eq!(cells[1..4], ["6", "6", &falls], "{list}");
    assert!(list.lines().all(|line| line.chars().count() <= 80), "{list}");
    let show = program.text(&["study", "show", &study]);
    assert!(
        show.contains("forward-seed0") && show.contains("robot: go1") && show.contains("Fz from 150 to 350 N"),
        "{show}"
    );
    assert!(show.contains("f0 (Hz)") && show.contains("Best: trial ") && !show.contains("Best: trial  "), "{show}");
    let best = program.text(&["study", "best", &format!("{study}/study.log")]);
    assert!(show.ends_with(&best), "{best}");
    // Regression: beside a journal that cannot be read the list ended as if it were complete.
    fs::create_dir(program.path("recordings/other")).unwrap();
    program.write("recordings/other/study.log", "no journal\nat all\n");
    let incomplete = program.run(&["study", "list"]);
    assert_eq!(incomplete.status.code(), Some(2));
    assert_eq!(String::from_utf8_lossy(&incomplete.stdout), list);
    let message = String::from_utf8_lossy(&incomplete.stderr);
    assert_shows(&message, &["recordings/other/study.log is no journal", "cannot be read and are not listed: 1"]);
    fs::remove_dir_all(program.path("recordings/other")).unwrap();
    // Regression: "no study below a folder" was said of a folder whose folder holds some.
    let deeper = ["There is no study in . or directly below it; `quadfrog study list ./recordings` finds some"];
    assert_shows(&program.text(&["study", "list", "."]), &deeper);
    assert!(program.text(&["study", "list", &study]).contains(name));
    assert!(program.refused(&["study", "list", "elsewhere"]).contains("elsewhere"));
    assert!(program.refused(&["study", "show", "elsewhere"]).contains("no such journal"));
    assert!(!program.path("elsewhere").exists());
    // Regression: of a folder without a journal, too, there was "no such journal".
    let message = program.refused(&["study", "show", "recordings"]);
    let way = "give the folder of a study, as `quadfrog study list recordings` names it";
    assert_shows(&message, &["recordings: this folder holds no study itself (studies in its folders: 1)", way]);
    // Regression: where one of the studies is in a folder of the name `config`, the folder was taken for a kept configuration.
    fs::create_dir(program.path("recordings/config")).unwrap();
    assert_eq!(program.refused(&["study", "show", "recordings"]), message);
    let refused = program.refused(&["optimize", "--resume", "recordings"]);
    assert_shows(&refused, &["recordings: there is no study.log in this folder; give the folder of a study"]);
    fs::create_dir(program.path("empty")).unwrap();
    let message = program.refused(&["study", "best", "empty"]);
    assert_shows(&message, &["empty: this folder holds no study; give", "as `quadfrog study list` names it"]);
    assert!(program.refused(&["study", "show", &study, "--name", "other"]).contains("forward-seed0"));
}

/// Regression: the list of a folder with studies of other programs alone was an empty table.
#[test]
fn a_study_of_another_program_is_listed() {
    let program = Program::new();
    program.write("recordings/optuna/study.log", include_str!("../golden/tpe/journal.log"));
    let list = program.text(&["study", "list"]);
    let rows: Vec<Vec<&str>> = list.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(rows[0], ["study", "task", "seed", "trials", "counted", "falls", "best"]);
    assert_eq!(rows[1][..3], ["recordings/optuna", "-", "-"], "{list}");
    assert_eq!(rows[1][5], "-", "{list}");
}

#[test]
fn an_exported_study_is_imported_unchanged_in_both_formats() {
    let (program, first) = study("forward");
    for form in ["csv", "json"] {
        let file = format!("table.{form}");
        let output = program.run(&["study", "export", &first, "--output", &file]);
        // Regression: a table that was written was not reported.
        let reported = String::from_utf8(output.stderr).unwrap();
        assert!(output.stdout.is_empty() && reported.contains(&format!(" trials: {file}")), "{reported}");
        let printed = program.text(&["study", "export", &first, "--format", form]);
        assert_eq!(printed, fs::read_to_string(program.path(&file)).unwrap());
        // Into a study of one trial.
        let output = format!("other-{form}");
        program.text(&["optimize", "--trials", "1", "--seed", "7", "--record", "none", "--output", &output]);
        let other = program.study(&output);
        let other = other.to_str().unwrap();
        let printed = program.text(&["study", "import", other, &file]);
        assert!(printed.starts_with("6 trials"), "{printed}");
        let trials = |study: &str| -> Vec<Value> {
            serde_json::from_str(&program.text(&["study", "export", study, "--format", "json"])).unwrap()
        };
        let (theirs, ours) = (trials(other), trials(&first));
        assert_eq!(theirs.len(), 7);
        for (theirs, ours) in theirs[1..].iter().zip(&ours) {
            let value = theirs.as_object().unwrap().keys().find(|name| name.starts_with("value_")).unwrap();
            for (key, value) in ours.as_object().unwrap() {
                if ["state", "duration", "datetime_start", "datetime_complete"].contains(&key.as_str())
                    || key.starts_with("value_")
                    || key.starts_with("params_")
                {
                    assert_eq!(&theirs[key], value, "{key}");
                }
                // A table has no null; trial numbers and pending re-runs do not apply to another study.
                if let Some(name) = key.strip_prefix("user_attrs_") {
                    let left_out = value.is_null() || ["worker", "rerun"].contains(&name);
                    let same = theirs.get(key).filter(|value| !value.is_null()) == Some(value);
                    assert!(same != left_out, "{name}: {value}");
                }
            }
            assert!(theirs[value].is_number() || theirs["state"] != "COMPLETE", "{theirs}");
        }
        // Imported trials count: the budget of seven is met.
        let rest = program.run(&["optimize", "--resume", other, "--trials", "7", "--json", "--record", "none"]);
        assert!(rest.status.success() && rest.stdout.is_empty());
    }
}

#[test]
fn an_invalid_table_is_refused_as_a_whole_with_row_and_column() {
    let (program, study) = study("forward");
    let import = |name: &str, table: &str, parts: &[&str]| {
        program.write(name, table);
        let message = program.refused(&["study", "import", &study, name]);
        assert_shows(&message, parts);
        assert_shows(&message, &[name]);
    };
    let head = "params_f0,params_Fx,params_Fz,value,state\n";
    import(
        "text.csv",
        &format!("{head}1.0,60,200,0.5,COMPLETE\n1.0,much,200,0.5,COMPLETE\n"),
        &["trial 2", "params_Fx", "much"],
    );
    import(
        "outside.csv",
        &format!("{head}1.0,60,200,0.5,COMPLETE\n1.0,160,200,0.5,COMPLETE\n"),
        &["Fx = 160", "0 to 150"],
    );
    import("stranger.csv", "params_speed,value\n1.0,0.5\n", &["speed", "f0, Fx, Fz"]);
    import("state.csv", &format!("{head}1.0,60,200,0.5,DONE\n"), &["state", "DONE", "COMPLETE"]);
    import("nothing.csv", "a,b\n1,2\n", &["params_<name>"]);
    import("ragged.csv", &format!("{head}1.0\n"), &["CSV"]);
    import("object.json", "{}", &["JSON", "array"]);
    import("value.json", "[{\"params\":{\"f0\":1},\"state\":\"COMPLETE\"}]", &["trial 1", "value"]);
    import("none.csv", "", &["params_<name>"]);
    let left = program.text(&["study", "export", &study, "--format", "csv"]);
    assert_eq!(left.lines().count(), 7, "nothing was added: {left}");
}

#[test]
fn a_queued_point_runs_next_and_points_of_a_table_can_be_queued() {
    let (program, study) = study("forward");
    for (setting, part) in
        [("Fx=151", "0 to 150"), ("Fw=1", "f0, Fx, Fz"), ("Fx=NaN", "finite"), ("Fx", "Fx=120"), ("Fx=much", "much")]
    {
        assert_shows(&program.refused(&["study", "enqueue", &study, setting]), &[part]);
    }
    assert!(program.refused(&["study", "enqueue", &study, "Fx=1", "Fx=2"]).contains("twice"));
    // The lock of a running session does not prevent it.
    let held = hold(Path::new(&study));
    assert!(program.text(&["study", "enqueue", &study, "Fx=77", "Fz=222.5"]).contains("trial 6"));
    drop(held);
    program.write("points.csv", "params_f0,params_Fx,params_Fz\n1.25,66,211\n");
    assert!(program.text(&["study", "import", &study, "points.csv", "--queue"]).contains("1 point queued"));
    assert!(program.text(&["study", "show", &study]).contains("2 queued"));
    let trials = program.trials(&["optimize", "--resume", &study, "--trials", "8", "--json", "--record", "none"]);
    assert_eq!((&trials[0]["params"]["Fx"], &trials[0]["params"]["Fz"]), (&77.0.into(), &222.5.into()));
    assert_eq!((&trials[1]["params"]["f0"], &trials[1]["params"]["Fx"]), (&1.25.into(), &66.0.into()));
}

#[test]
fn the_best_begins_the_next_study() {
    let (program, study) = study("twist-cw");
    let printed = program.text(&["study", "best", &study, "--config", "found"]);
    assert!(printed.contains("--config found"), "{printed}");
    let next = ["optimize", "--task", "twist-cw", "--config", "found", "--trials", "2", "--seed", "5"];
    let first = program.trials(&[&next[..], &["--json", "--record", "none"]].concat()).remove(0);
    let trials = program.exported(&study);
    let value = |trial: &Value| trial["value"].as_f64().unwrap_or(f64::NEG_INFINITY);
    let best = trials.iter().max_by(|a, b| value(a).total_cmp(&value(b)));
    assert_eq!(first["params"], best.unwrap()["params"]);
    // No folder is overwritten, and values written by hand are checked.
    assert!(program.refused(&["study", "best", &study, "--config", "found"]).contains("new folder"));
    let write = |text: &str| program.write("mine/optimize.toml", text);
    write("[first.forward]\nFx = 151.0\n");
    let message = program.refused(&["optimize", "--config", "mine"]);
    assert!(message.contains("mine/optimize.toml:2") && message.contains("[0, 150]"), "{message}");
    write("[first.backward]\nFx = 1.0\n");
    assert!(program.refused(&["optimize", "--config", "mine"]).contains("first.backward"));
}

#[test]
fn a_closed_output_pipe_is_no_error() {
    let (program, study) = study("forward");
    for arguments in [&["study", "export", &study][..], &["study", "show", &study], &["study", "list"]] {
        let mut child = program.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && !errors.contains("panicked"), "{errors}");
    }
}

#[test]
fn python_reads_our_table_and_we_read_its_journal_and_its_table() {
    let has = Command::new("python3").args(["-c", "import optuna, pandas"]).stderr(Stdio::null()).status();
    if !has.is_ok_and(|status| status.success()) {
        skip("python3 has no optuna with pandas");
        return;
    }
    let (program, ours) = study("forward");
    let script = "import sys, optuna, pandas\n\
        from optuna.storages import JournalStorage\n\
        from optuna.storages.journal import JournalFileBackend\n\
        study = optuna.create_study(storage=JournalStorage(JournalFileBackend('python.log')), study_name='theirs', direction='maximize')\n\
        study.optimize(lambda t: -(t.suggest_float('Fx', 0, 150) - 60) ** 2 + t.suggest_float('f0', 0.75, 1.75), n_trials=5)\n\
        study.trials_dataframe().to_csv('python.csv', index=False)\n\
        table = pandas.read_csv('ours.csv')\n\
        assert len(table) == 6 and table['params_Fx'].between(0, 150).all() and (table['state'] == 'COMPLETE').any()\n";
    program.text(&["study", "export", &ours, "--output", "ours.csv"]);
    let python = Command::new("python3").args(["-c", script]).current_dir(program.path("")).output().unwrap();
    assert!(python.status.success(), "{}", String::from_utf8_lossy(&python.stderr));
    let show = program.text(&["study", "show", "python.log"]);
    assert!(show.contains("theirs") && show.contains("Fx from 0 to 150"), "{show}");
    assert_eq!(program.text(&["study", "export", "python.log"]).lines().count(), 6);
    let printed = program.text(&["study", "import", &ours, "python.csv"]);
    assert!(printed.starts_with("5 trials"), "{printed}");
    assert!(program.text(&["study", "enqueue", "python.log", "Fx=60"]).contains("trial 5"));
}

/// Regression: every row was imported again, and each point appeared to be repeated.
#[test]
fn a_table_that_is_imported_twice_is_no_repeat() {
    let (program, study) = study("forward");
    program.text(&["study", "export", &study, "--output", "own.csv"]);
    let printed = program.text(&["study", "import", &study, "own.csv"]);
    assert!(printed.starts_with("0 trials") && printed.contains("6 were there already"), "{printed}");
    // Written by hand, without times: equal rows of one table are repeats.
    let rows = "params_f0,params_Fx,params_Fz,value\n1.0,100,250,0.5\n1.0,100,250,0.5\n";
    program.write("hand.csv", rows);
    assert!(program.text(&["study", "import", &study, "hand.csv"]).starts_with("2 trials"));
    let printed = program.text(&["study", "import", &study, "hand.csv"]);
    assert!(printed.starts_with("0 trials") && printed.contains("2 were there already"), "{printed}");
}

/// Regression: notes were lost without a word.
#[test]
fn notes_are_imported_with_their_trials() {
    let (program, study) = study("forward");
    program.text(&["study", "export", &study, "--output", "own.csv"]);
    let rows = "params_f0,params_Fx,params_Fz,value,note\n1.0,100,250,0.5,\"slipped, \"\"far\"\"\"\n1.1,100,250,0.4,\n1.2,100,250,0.3,0070\n";
    program.write("noted.csv", rows);
    assert!(program.text(&["study", "import", &study, "noted.csv"]).starts_with("3 trials imported"));
    let shown = program.text(&["study", "show", &study]);
    assert_shows(&shown, &["Note on trial 6: slipped, \"far\"", "Note on trial 8: 0070"]);
    assert_eq!(shown.matches("Note on trial").count(), 2, "{shown}");
    // As JSON, into another study.
    program.text(&["study", "export", &study, "--output", "own.json"]);
    program.text(&["optimize", "--trials", "1", "--seed", "9", "--output", "other", "--record", "none"]);
    let other = program.study("other").display().to_string();
    program.text(&["study", "import", &other, "own.json"]);
    let shown = program.text(&["study", "show", &other]);
    assert_eq!(shown.matches("Note on trial").count(), 2, "{shown}");
}

/// Regression: the help of import offered Parquet, which it refuses.
#[test]
fn import_offers_the_formats_that_it_reads() {
    let program = Program::new();
    let help = program.text(&["study", "import", "--help"]);
    assert!(help.contains("csv") && !help.contains("parquet"), "{help}");
    assert!(program.text(&["study", "export", "--help"]).contains("parquet"));
}

/// Regression: a point that was removed from the queue came again as a trial without values, and was queued as one.
#[test]
fn a_removed_point_is_not_imported() {
    let (program, study) = study("forward");
    program.text(&["study", "enqueue", &study, "Fx=60"]);
    // The line that the console writes of a point that is removed.
    let removed = r#"{"op_code":6,"worker_id":"w","trial_id":6,"state":3,"values":null,"datetime_complete":"2026-11-27T14:26:21.127202+00:00"}"#;
    let mut journal = fs::OpenOptions::new().append(true).open(Path::new(&study).join("study.log")).unwrap();
    writeln!(journal, "{removed}").unwrap();
    let shown = program.text(&["study", "show", &study]);
    program.text(&["study", "export", &study, "--output", "own.csv"]);
    let printed = program.text(&["study", "import", &study, "own.csv"]);
    assert_shows(&printed, &["0 trials imported", "6 were there already", "1 row without parameters left out"]);
    assert_eq!(program.text(&["study", "show", &study]), shown);
    let printed = program.text(&["study", "import", &study, "own.csv", "--queue"]);
    assert_shows(&printed, &["6 points queued; 1 row without parameters left out"]);
}

/// Regression: the budget of the configuration replaced the stored one.
#[test]
fn a_continued_study_keeps_its_budget() {
    let (program, study) = study("forward");
    let rest = program.text(&["optimize", "--resume", &study, "--json", "--record", "none"]);
    assert_eq!(rest, "", "its budget of six is met");
    assert!(program.text(&["study", "show", &study]).contains("budget: 6"));
}

/// Regression: it ran with its first configuration.
#[test]
fn a_continued_study_keeps_its_last_configuration() {
    let (program, study) = study("forward");
    program.write("mine/optimize.toml", "[bounds]\nFz = [200.0, 210.0]\n");
    let resume = |more: &[&str]| {
        let base = ["optimize", "--resume", &study, "--json", "--record", "none"];
        let output = program.run(&[&base, more].concat());
        assert!(output.status.success());
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    resume(&["--trials", "7", "--config", "mine"]);
    let (trials, printed) = resume(&["--trials", "9"]);
    assert!(printed.contains("config-2"), "{printed}");
    assert_eq!(trials.lines().count(), 2);
    for line in trials.lines() {
        let trial: Value = serde_json::from_str(line).unwrap();
        assert!((200.0..=210.0).contains(&trial["params"]["Fz"].as_f64().unwrap()), "{line}");
    }
    assert!(program.text(&["study", "show", &study]).contains("Fz from 200 to 210"));
    // The first configuration, given explicitly, becomes the last one.
    resume(&["--trials", "10", "--config", &format!("{study}/config")]);
    let (_, printed) = resume(&[]);
    assert!(printed.contains("config-3") && !Path::new(&study).join("config-4").exists(), "{printed}");
}

/// Regressions: a mistyped place became a new study, and a worker's folder had the name of another seed.
#[test]
fn a_mistyped_place_to_join_is_refused_and_a_worker_is_named_after_its_study() {
    let program = Program::new();
    for more in [&[][..], &["--task", "forward"], &["--seed", "5"]] {
        let message = program.refused(&[&["optimize", "--join", "recordigs/study"], more].concat());
        assert!(message.contains("no such journal") && message.contains("--task and --seed"), "{message}");
    }
    assert!(!program.path("recordigs").exists());
    let new = ["optimize", "--join", "shared.log", "--task", "twist-cw", "--seed", "5", "--trials", "1"];
    let made_new = program.run(&new);
    let printed = String::from_utf8_lossy(&made_new.stderr);
    assert!(made_new.status.success() && printed.contains("a new study of twist-cw seed 5 is made in"), "{printed}");
    let rest = program.text(&["optimize", "--join", "shared.log", "--json"]);
    assert_eq!(rest, "", "its budget of 1 is met");
    let names: Vec<String> = program.studies("recordings").iter().map(|path| path.display().to_string()).collect();
    assert_eq!(names.len(), 2);
    assert!(names.iter().all(|name| name.contains("twist-cw-seed5-joined-")), "{names:?}");
}

/// Regression: the point of the interrupted trial, which is run again, reduced the acquisition of `gp` around it, and the last
/// digits of later proposals differed from those of an unbroken study.
#[test]
fn a_study_of_gp_that_ended_within_a_trial_continues_with_the_same_bits() {
    let program = Program::new();
    let gp = ["optimize", "--sampler", "gp", "--seed", "1", "--trials", "9", "--record", "none"];
    program.text(&[&gp[..], &["--output", "whole"]].concat());
    let whole = program.study("whole").join("study.log");
    let lines = fs::read_to_string(&whole).unwrap();
    for interrupted in [2, 5, 6] {
        // As SIGKILL leaves it: without the result of the running trial and all that follows.
        let result = format!("\"trial_id\":{interrupted},\"state\":1,");
        let broken = format!("broken{interrupted}");
        program.text(&[
            "optimize",
            "--sampler",
            "gp",
            "--seed",
            "1",
            "--trials",
            "1",
            "--record",
            "none",
            "--output",
            &broken,
        ]);
        let study = program.study(&broken);
        let kept: Vec<&str> = lines.lines().take_while(|line| !line.contains(&result)).collect();
        assert!(kept.len() < lines.lines().count(), "trial {interrupted} has no result: {lines}");
        fs::write(study.join("study.log"), kept.join("\n") + "\n").unwrap();
        program.text(&[
            "optimize",
            "--resume",
            study.to_str().unwrap(),
            "--sampler",
            "gp",
            "--trials",
            "9",
            "--record",
            "none",
        ]);
        assert_eq!(counted_trials(&study.join("study.log")), counted_trials(&whole), "trial {interrupted}");
    }
}

/// Regression: a recording, and any other file that was named in place of a study, was to be "repaired" by the removal of its first line.
#[test]
fn a_file_that_is_no_journal_is_not_to_be_repaired() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "1", "--seed", "0", "--output", "studies"]);
    let recording = program.study("studies").join("session.mcap").display().to_string();
    program.write("readme.md", "# A title\n\nand a text\n");
    for file in [recording.as_str(), "readme.md"] {
        for command in [&["study", "show", file][..], &["report", file]] {
            let message = program.refused(command);
            assert_shows(&message, &[file, "is no journal of a study (line 1: ", "give the study's folder"]);
            assert!(!message.contains("repair"), "{message}");
        }
    }
}

/// Regression: after `--resume` with another sampler `study show` named that of the study's begin alone.
#[test]
fn a_study_names_its_last_sampler_and_which_trials_each_has_proposed() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "2", "--sampler", "random", "--record", "none"]);
    let study = program.study("recordings");
    let study = study.to_str().unwrap();
    assert!(!program.text(&["study", "show", study]).contains("proposed:"));
    // A session that proposes nothing: the trials keep their sampler.
    program.text(&["optimize", "--resume", study, "--trials", "2", "--sampler", "gp", "--record", "none"]);
    assert_shows(&program.text(&["study", "show", study]), &["proposed: 2 by random (from trial 0)", "kind gp"]);
    program.text(&["optimize", "--resume", study, "--trials", "5", "--sampler", "sobol", "--record", "none"]);
    let shown = program.text(&["study", "show", study]);
    assert_shows(&shown, &["proposed: 2 by random (from trial 0), 3 by sobol (from trial 2)", "kind sobol"]);
    assert!(!shown.contains("kind random"), "{shown}");
    let table: Vec<String> = program.text(&["study", "export", study]).lines().map(str::to_owned).collect();
    assert!(table[0].contains("user_attrs_sampler") && table[3].contains("sobol"), "{table:?}");
}

/// Regression: `--trials` below what counts already lowered the budget of the study for good.
#[test]
fn a_budget_below_what_counts_is_refused_and_changes_nothing() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "3", "--record", "none"]);
    let study = program.study("recordings");
    let journal = || fs::read_to_string(study.join("study.log")).unwrap();
    let before = journal();
    let place = study.to_str().unwrap();
    let refused = program.refused(&["optimize", "--resume", place, "--trials", "2", "--record", "none"]);
    assert_shows(&refused, &["--trials 2: 3 trials of this study count already; give that number or more"]);
    assert_eq!(journal(), before);
    program.text(&["optimize", "--resume", place, "--trials", "3", "--record", "none"]);
}

/// Regression: attributes of the program's own search were shown as they are stored, `fixed: f0 from 11, trials 1, value 0.97`.
#[test]
fn fixed_parameters_and_a_confirmation_are_shown_as_sentences() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "3", "--seed", "0"]);
    let study = program.study("recordings");
    let journal = study.join("study.log");
    let mut text = fs::read_to_string(&journal).unwrap();
    for attribute in [
        r#"{"fixed":{"f0":{"from":11,"trials":1,"value":0.9719578839321814}}}"#,
        r#"{"confirm":null}"#,
        r#"{"confirmed":{"confidence":0.962,"leader":0,"sure":true,"trials":[0,1]}}"#,
    ] {
        text += &format!("{{\"op_code\":2,\"worker_id\":\"test\",\"study_id\":0,\"user_attr\":{attribute}}}\n");
    }
    fs::write(&journal, text).unwrap();
    let shown = program.text(&["study", "show", study.to_str().unwrap()]);
    assert_shows(&shown, &["f0 is fixed at 0.971958 for 1 trial that counts, from trial 11: 1 left"]);
    // What was concluded is not what the trials say now: neither point was repeated.
    assert_shows(&shown, &["confirmation of the best: the point of trial ", " leads without a confidence"]);
    assert_shows(&shown, &["stood 1 of 1; each point needs 3 jumps to be compared"]);
    let report = program.text(&["report", study.to_str().unwrap()]);
    assert_shows(&report, &["f0 is fixed at 0.971958 for 1 trial that counts"]);
    for raw in ["confirm:", "confirmed:", "fixed:", "model_best", "none"] {
        assert!(!shown.contains(raw), "{raw}:\n{shown}");
    }
}

/// Regression: the list of the studies counted a skipped proposal as a trial, the report did not.
#[test]
fn a_proposal_that_was_not_run_is_no_trial_in_the_list_and_in_the_report() {
    let program = Program::new();
    fs::create_dir(program.path("recordings")).unwrap();
    let mut session = Session::start(&program.path("recordings"), (100, 30), &[]);
    session.wait_for(&["Press A to arm"]);
    session.send("n");
    session.wait_for(&["Press y to skip trial #0"]);
    session.send("y");
    session.wait_for(&["Trial #1"]);
    session.quit();
    let study = program.study("recordings");
    let study = study.to_str().unwrap();
    program.text(&["optimize", "--resume", study, "--trials", "3", "--record", "all"]);
    assert_shows(
        &program.text(&["study", "show", study]),
        &["not run: skipped before the jump", "3 trials that ran, 1 proposal that did not"],
    );
    let list = program.text(&["study", "list"]);
    let cells: Vec<&str> = list.lines().nth(1).unwrap().split_whitespace().collect();
    // Trials, and those that count.
    assert_eq!(cells[1..3], ["3", "3"], "{list}");
    let report = program.text(&["report", study]);
    assert_shows(&report, &["Ticks of 3 of 3 trials are recorded"]);
    let page: Value = serde_json::from_str(&program.text(&["report", "--json", study])).unwrap();
    let studies = table_of_studies(&page);
    assert_eq!(studies["rows"][0][1], 3, "{studies}");
}

/// The table of the studies in a report as JSON.
fn table_of_studies(page: &Value) -> &Value {
    let blocks = page["sections"].as_array().unwrap().iter().flat_map(|section| section["blocks"].as_array().unwrap());
    let mut tables = blocks.filter_map(|block| block.get("table"));
    tables.find(|table| table["caption"].as_str().unwrap().starts_with("Studies.")).unwrap()
}

/// Regression: the list of the studies counted the falls of repeats that confirm the best, the report did not.
#[test]
fn a_repeat_that_fell_is_no_fall_in_the_list_and_in_the_report() {
    let (program, study) = study("forward");
    let falls_of_five =
        program.exported(&study).iter().take(5).filter(|row| row["user_attrs"]["verdict"] == "fall").count();
    let journal = Path::new(&study).join("study.log");
    let mut text = fs::read_to_string(&journal).unwrap();
    for (accepted, repeat) in
        [(r#""source":"sampler""#, r#""source":"confirm""#), (r#"{"verdict":"accept"}"#, r#"{"verdict":"fall"}"#)]
    {
        let of_last = text.rfind(accepted).expect(accepted);
        text.replace_range(of_last..of_last + accepted.len(), repeat);
    }
    fs::write(&journal, text).unwrap();
    let list = program.text(&["study", "list"]);
    let cells: Vec<&str> = list.lines().nth(1).unwrap().split_whitespace().collect();
    assert_eq!(cells[1..4], ["6", "5", &falls_of_five.to_string()], "{list}");
    let page: Value = serde_json::from_str(&program.text(&["report", "--json", &study])).unwrap();
    // Trials, accepted, falls, repeats.
    let row = &table_of_studies(&page)["rows"][0];
    assert_eq!([&row[1], &row[3], &row[4]], [&Value::from(6), &Value::from(falls_of_five), &Value::from(1)]);
}

/// Regression: a conclusion that an earlier version had kept from equal repeats was shown with full confidence.
#[test]
fn a_kept_conclusion_of_equal_repeats_is_shown_without_a_confidence() {
    let (program, place) = study("forward");
    let row = |f0: f64, value: f64| format!("{f0},100,250,{value}\n").repeat(3);
    program.write("equal.csv", &format!("params_f0,params_Fx,params_Fz,value\n{}{}", row(1.0, 0.5), row(1.1, 0.4)));
    program.text(&["study", "import", &place, "equal.csv"]);
    let journal = Path::new(&place).join("study.log");
    let mut text = fs::read_to_string(&journal).unwrap();
    let attribute = r#"{"confirmed":{"confidence":1.0,"leader":6,"sure":true,"trials":[6,9]}}"#;
    text += &format!("{{\"op_code\":2,\"worker_id\":\"test\",\"study_id\":0,\"user_attr\":{attribute}}}\n");
    fs::write(&journal, text).unwrap();
    let reason =
        "the point of trial 6 leads without a confidence, because equal jumps give equal values here: mean 0.500";
    assert_shows(&program.text(&["study", "show", &place]), &[reason]);
    let mut session = Session::start(&program.path(""), (120, 40), &["--resume", &place]);
    session.send("3");
    session.wait_for(&["Repeated points", "3/3 landed  0.500 m"]);
    let screen = session.screen();
    let line = |text: &str| screen.lines().find(|line| line.contains(text)).unwrap_or_default().to_owned();
    assert!(line("0.500 m").contains("leads") && !line("0.500 m").contains('%'), "{screen}");
    assert!(line("0.400 m").contains("behind"), "{screen}");
    session.send("q");
    assert!(session.wait().success());
}

/// Regression: a study that another program had renamed was begun anew by `--resume`, and neither listed nor reported.
#[test]
fn a_study_renamed_by_another_program_is_continued_listed_and_reported() {
    let (program, study) = study("forward");
    let journal = Path::new(&study).join("study.log");
    let text = fs::read_to_string(&journal).unwrap();
    fs::write(&journal, text.replace("\"forward-seed0\"", "\"weekend\"")).unwrap();
    let list = program.text(&["study", "list"]);
    assert!(list.lines().nth(1).is_some_and(|line| line.contains(" 6 ")), "{list}");
    program.text(&["report", &study, "--output", "page.html"]);
    let trials = program.trials(&["optimize", "--resume", &study, "--trials", "8", "--json", "--record", "none"]);
    assert_eq!(trials.len(), 2, "the six trials before count");
    let text = fs::read_to_string(&journal).unwrap();
    assert_eq!(text.matches("\"op_code\":0,").count(), 1, "no second study was made");
}

/// Regression: `study import --queue` dropped the gains of the points, which ran with those of the configuration.
#[test]
fn a_queued_row_runs_with_its_gains() {
    let (program, study) = study("forward");
    let table = "params_f0,params_Fx,params_Fz,user_attrs_gains,state\n1.25,66,211,\"{\"\"kp\"\": 450.0}\",WAITING\n";
    program.write("points.csv", table);
    program.text(&["study", "import", &study, "points.csv", "--queue"]);
    program.text(&["optimize", "--resume", &study, "--trials", "7", "--record", "none"]);
    let last = program.exported(&study).pop().unwrap();
    assert_eq!((&last["params"]["Fx"], &last["user_attrs"]["gains"]["kp"]), (&66.0.into(), &450.0.into()));
}

/// Regression: on a full disk a part of the points stayed queued, and a plain import named the table as the fault, with exit status 2.
#[test]
fn a_table_on_a_full_disk_is_added_whole_or_not_at_all() {
    let (program, study) = study("forward");
    let journal = Path::new(&study).join("study.log");
    let before = fs::read(&journal).unwrap();
    let rows: String = (0..60).map(|i| format!("1.25,{i},211,0.5\n")).collect();
    program.write("points.csv", &format!("params_f0,params_Fx,params_Fz,value\n{rows}"));
    let blocks = before.len() as u32 / 512 + 4;
    for queue in [&["--queue"][..], &[]] {
        let arguments = [&["study", "import", &study, "points.csv"][..], queue].concat();
        let (status, message) = with_small_files(&program, blocks, &arguments);
        assert_eq!(status, Some(1), "{message}");
        assert!(message.contains("study.log") && !message.contains("points.csv"), "{message}");
        assert!(fs::read(&journal).unwrap() == before, "a part of the table stays");
    }
    assert!(program.text(&["study", "import", &study, "points.csv", "--queue"]).contains("60 points queued"));
}

/// Regression: parameters of another program, which have no unit, were rounded to one decimal: a rate of 0.00123 was 0.0.
#[test]
fn parameters_of_another_program_have_six_digits() {
    let program = Program::new();
    let distribution = r#"{\"name\": \"FloatDistribution\", \"attributes\": {\"step\": null, \"low\": 0.0, \"high\": 1.0, \"log\": false}}"#;
    let journal = format!(
        r#"{{"op_code":0,"worker_id":"a","study_name":"theirs","directions":[2]}}
{{"op_code":4,"worker_id":"a","study_id":0,"datetime_start":"2026-01-01T00:00:00Z"}}
{{"op_code":5,"worker_id":"a","trial_id":0,"param_name":"rate","param_value_internal":0.00123456789,"distribution":"{distribution}"}}
{{"op_code":6,"worker_id":"a","trial_id":0,"state":1,"values":[0.5],"datetime_complete":"2026-01-01T00:00:01Z"}}
"#
    );
    program.write("theirs.log", &journal);
    for command in ["show", "best"] {
        let best = program.text(&["study", command, "theirs.log"]);
        assert_shows(&best, &["Best: trial 0  rate 0.00123457 "]);
    }
}

/// Regression: a trial that Optuna had pruned was shown as failed in a study of this program.
#[test]
fn a_pruned_trial_of_another_program_is_no_failed_one() {
    let (program, study) = study("forward");
    let journal = program.path(&study).join("study.log");
    let text = fs::read_to_string(&journal).unwrap()
        + r#"{"op_code":4,"worker_id":"py","study_id":0,"datetime_start":"2026-01-01T00:00:00+00:00"}
{"op_code":7,"worker_id":"py","trial_id":6,"step":1,"intermediate_value":0.3}
{"op_code":6,"worker_id":"py","trial_id":6,"state":2,"values":[0.3],"datetime_complete":"2026-01-01T00:00:01+00:00"}
{"op_code":4,"worker_id":"py","study_id":0,"datetime_start":"2026-01-01T00:00:00+00:00"}
{"op_code":6,"worker_id":"py","trial_id":7,"state":3,"values":null,"datetime_complete":"2026-01-01T00:00:01+00:00"}
"#;
    fs::write(&journal, text).unwrap();
    let shown = program.text(&["study", "show", &study]);
    let line = |trial: &str| shown.lines().find(|line| line.trim_start().starts_with(trial)).unwrap();
    assert!(line("6 ").ends_with("pruned: stopped early by another program"), "{shown}");
    assert!(line("7 ").ends_with("failed"), "{shown}");
    let counted = program.text(&["study", "list"]);
    assert_eq!(counted.lines().nth(1).unwrap().split_whitespace().collect::<Vec<_>>()[1..3], ["8", "6"], "{counted}");
}
