//! `quadfrog report` on studies that the program made.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::program::{Program, assert_shows};
use serde_json::Value;
use xml::reader::{EventReader, XmlEvent};

/// A finished study of five trials with all ticks, and its folder.
fn study(more: &[&str]) -> (Program, String) {
    let program = Program::new();
    program.text(&[&["optimize", "--trials", "5", "--record", "all"], more].concat());
    let study = program.study("recordings").to_str().unwrap().to_owned();
    (program, study)
}

/// The exported trials of a study.
fn exported(program: &Program, study: &str) -> Vec<Value> {
    program.exported(study)
}

/// The page of `--json`.
fn page(program: &Program, arguments: &[&str]) -> Value {
    serde_json::from_str(&program.text(&[&["report", "--json"], arguments].concat())).unwrap()
}

/// The blocks of a page that are of a kind.
fn blocks<'a>(page: &'a Value, kind: &'a str) -> Vec<&'a Value> {
    let sections = page["sections"].as_array().unwrap().iter();
    sections.flat_map(|section| section["blocks"].as_array().unwrap()).filter_map(|block| block.get(kind)).collect()
}

/// The table whose caption begins so.
#[track_caller]
fn table<'a>(page: &'a Value, caption: &str) -> &'a Value {
    let found = |table: &&Value| table["caption"].as_str().unwrap().starts_with(caption);
    blocks(page, "table").into_iter().find(found).unwrap_or_else(|| panic!("no table {caption}"))
}

/// The cells of a column.
fn column(table: &Value, name: &str) -> Vec<Value> {
    let columns = table["columns"].as_array().unwrap();
    let at = columns.iter().position(|column| column["name"] == name).unwrap();
    table["rows"].as_array().unwrap().iter().map(|row| row[at].clone()).collect()
}

/// Names and texts of the elements; fails where the document is not well-formed.
fn parse(document: &str) -> (Vec<String>, Vec<String>) {
    let (mut names, mut texts) = (Vec::new(), Vec::new());
    for event in EventReader::from_str(document) {
        match event.unwrap_or_else(|error| panic!("{error}")) {
            XmlEvent::StartElement { name, .. } => names.push(name.local_name),
            XmlEvent::Characters(text) => texts.push(text.trim().to_owned()),
            _ => {}
        }
    }
    (names, texts)
}

/// An HTML document as XML: the only void elements of a report are `meta`.
fn as_xml(html: &str) -> String {
    let parts = html.strip_prefix("<!DOCTYPE html>").unwrap().split("<meta ");
    let closed = parts.enumerate().map(|(i, part)| if i == 0 { part.into() } else { part.replacen("\">", "\"/>", 1) });
    closed.collect::<Vec<String>>().join("<meta ")
}

fn svgs(folder: &Path) -> Vec<(String, String)> {
    let mut files: Vec<(String, String)> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read_to_string(path).unwrap()))
        .collect();
    files.sort();
    files
}

#[test]
fn a_page_is_well_formed_opens_offline_and_has_the_numbers_of_the_export() {
    let (program, study) = study(&[]);
    program.text(&["report", &study, "--output", "page.html", "--figures", "figures"]);
    let html = fs::read_to_string(program.path("page.html")).unwrap();
    let (names, texts) = parse(&as_xml(&html));
    for reference in ["<script", "http:", "https:", "src=", "href=", "url(", "@import"] {
        assert!(!html.contains(reference), "the page contains {reference}");
    }
    // The program that wrote the report, and the one that recorded.
    let version = program.text(&["--version"]);
    assert_eq!(html.matches(version.trim()).count(), 2, "{version}");
    let page = page(&program, &[&study]);
    let figures = blocks(&page, "figure");
    assert_eq!(names.iter().filter(|name| *name == "svg").count(), figures.len());
    for name in ["convergence", "parameters", "landings", "force", "motion", "torque", "peaks", "angles"] {
        assert!(figures.iter().any(|figure| figure["name"] == format!("forward-{name}")), "no figure {name}");
    }
    let files = svgs(&program.path("figures"));
    assert_eq!(files.len(), figures.len());
    for (file, svg) in &files {
        parse(svg);
        let figure =
            figures.iter().find(|figure| format!("{}.svg", figure["name"].as_str().unwrap()) == *file).unwrap();
        for panel in figure["panels"].as_array().unwrap() {
            for axis in [&panel["x"], &panel["y"]] {
                let (label, unit) = (axis["label"].as_str().unwrap(), axis["unit"].as_str().unwrap());
                let counted = label.starts_with("Trial") || label == "Joint";
                assert_eq!(unit.is_empty(), counted, "{file}: axis {label}");
                let shown = if unit.is_empty() { label.to_owned() } else { format!("{label} ({unit})") };
                assert!(svg.contains(&format!("\n{shown}\n")), "{file}: axis {shown} is not drawn");
            }
        }
    }
    let trials = exported(&program, &study);
    assert_eq!(trials.len(), 5);
    let rows = table(&page, "Trials of forward, seed 0");
    for (column_name, of) in [("J", "value"), ("rise", "apex_m"), ("dx", "dx_m"), ("air", "air_s")] {
        let shown = column(rows, column_name);
        for (trial, shown) in trials.iter().zip(&shown) {
            let own = if of == "value" { &trial["value"] } else { &trial["user_attrs"][of] };
            assert_eq!(shown.as_f64(), own.as_f64(), "trial {}: {column_name}", trial["number"]);
            if let Some(number) = own.as_f64() {
                let text = format!("{number:.3}").replace('-', "\u{2212}");
                assert!(texts.contains(&text), "{column_name} {text} is not on the page");
            }
        }
    }
    for (trial, fx) in trials.iter().zip(column(rows, "Fx")) {
        assert_eq!(trial["params"]["Fx"].as_f64(), fx.as_f64());
    }
}

#[test]
fn text_fits_a_terminal_and_has_the_tables_of_the_page() {
    let (program, study) = study(&[]);
    let text = program.text(&["report", &study]);
    let place_lines = |line: &&str| !line.contains('/');
    for line in text.lines().filter(place_lines) {
        assert!(line.chars().count() <= 80, "{line}");
    }
    assert_shows(
        &text,
        &["J_forward = x_final - x_init", "Studies.", "(deg)", "(N m)", "(W)", "Best value of a single trial so far"],
    );
    let best = exported(&program, &study).iter().filter_map(|trial| trial["value"].as_f64()).fold(0.0, f64::max);
    assert!(text.contains(&format!("{best:.3}")), "{text}");
}

#[test]
fn takeoff_and_power_are_those_of_the_recorded_ticks() {
    let (program, study) = study(&[]);
    let page = page(&program, &[&study, "--trials", "best,1"]);
    let takeoff = table(&page, "Take-off");
    let number = |name: &str| column(takeoff, name)[0].as_f64().unwrap();
    let trials = exported(&program, &study);
    let best =
        trials.iter().max_by(|a, b| a["value"].as_f64().unwrap().total_cmp(&b["value"].as_f64().unwrap())).unwrap();
    let (fx, fz) = (best["params"]["Fx"].as_f64().unwrap(), best["params"]["Fz"].as_f64().unwrap());
    assert!((number("angle of F") - fz.atan2(fx).to_degrees()).abs() < 1e-9);
    // A ballistic flight of the recorded rise and time: v.z = g t / 2, and not below sqrt(2 g rise) less the push's part.
    assert!((45.0..85.0).contains(&number("angle of v")), "{takeoff}");
    assert!((2.0..4.5).contains(&number("speed")), "{takeoff}");
    for (name, limit) in [("push torque hip", 23.7), ("push torque thigh", 23.7), ("push torque calf", 35.55)] {
        let torque = number(name);
        assert!(torque > 1.0 && torque <= limit * (1.0 + 1e-7), "{name} {torque}");
    }
    assert!(number("push power") > number("joint power") && number("push power") < 4000.0, "{takeoff}");
}

#[test]
fn hostile_notes_are_text_in_every_form() {
    let (program, study) = study(&[]);
    let note = "<script>alert(1)</script> \\u001b[31mred & \\\"x\\\"";
    let line = |name: &str, value: &str| {
        format!(
            "{{\"op_code\": 3, \"worker_id\": \"other\", \"study_id\": 0, \"system_attr\": {{\"{name}\": {value}}}}}\n"
        )
    };
    let journal = Path::new(&study).join("study.log");
    let mut text = fs::read_to_string(&journal).unwrap();
    text += &line("dashboard:0:note_ver", "0");
    text += &line("dashboard:0:note_str:0", &format!("\"{note}\""));
    fs::write(&journal, text).unwrap();
    let shown = program.text(&["report", &study]);
    assert!(shown.contains("<script>alert(1)</script>") && shown.contains("\\u001b[31mred"), "{shown}");
    assert!(shown.chars().all(|c| c == '\n' || !c.is_control()));
    program.text(&["report", &study, "--output", "page.html"]);
    let html = fs::read_to_string(program.path("page.html")).unwrap();
    assert!(html.contains("&lt;script&gt;alert(1)&lt;/script&gt;") && !html.contains("<script"));
    assert!(html.chars().all(|c| c == '\n' || !c.is_control()));
    parse(&as_xml(&html));
    let page = page(&program, &[&study]);
    assert!(column(table(&page, "Falls"), "note").iter().any(|cell| cell.as_str().unwrap().contains('\u{1b}')));
}

#[test]
fn several_studies_are_grouped_by_task_with_mean_and_deviation() {
    let program = Program::new();
    program.text(&["optimize", "--task", "forward,twist-ccw", "--seed", "0-1", "--trials", "5", "--record", "best"]);
    let page = page(&program, &["recordings"]);
    assert_eq!(table(&page, "Studies")["rows"].as_array().unwrap().len(), 4);
    let best: Vec<f64> = program
        .studies("recordings")
        .iter()
        .filter(|study| study.to_str().unwrap().contains("forward"))
        .map(|study| {
            let values = exported(&program, study.to_str().unwrap());
            values.iter().filter_map(|trial| trial["value"].as_f64()).fold(0.0, f64::max)
        })
        .collect();
    let (mean, deviation) = ((best[0] + best[1]) / 2.0, (best[0] - best[1]).abs() / 2f64.sqrt());
    let row = &table(&page, "Best value of a single trial so far")["rows"][0];
    assert_eq!(row.as_array().unwrap().last().unwrap(), &format!("{mean:.3} +- {deviation:.3}"));
    let names: Vec<&str> = blocks(&page, "figure").iter().map(|figure| figure["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"forward-convergence") && names.contains(&"twist-ccw-motion"), "{names:?}");
    let convergence =
        blocks(&page, "figure").into_iter().find(|figure| figure["name"] == "forward-convergence").unwrap();
    let band = convergence["panels"][0]["series"][0]["shape"]["band"].as_array().unwrap().last().unwrap().clone();
    assert!((band[1].as_f64().unwrap() - mean).abs() < 1e-12 && (band[2].as_f64().unwrap() - deviation).abs() < 1e-12);
}

#[test]
fn trials_without_ticks_are_named() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "3", "--record", "none"]);
    let study = program.study("recordings").to_str().unwrap().to_owned();
    assert_shows(&program.text(&["report", &study]), &["No recording of this study exists", "--record"]);
    let program = Program::new();
    program.text(&["optimize", "--trials", "4", "--record", "best"]);
    let study = program.study("recordings").to_str().unwrap().to_owned();
    let trials = exported(&program, &study);
    let best =
        trials.iter().max_by(|a, b| a["value"].as_f64().unwrap().total_cmp(&b["value"].as_f64().unwrap())).unwrap();
    let other = if best["number"] == 3 { 2 } else { 3 };
    let text = program.text(&["report", &study, "--trials", &format!("best,{other}")]).replace('\n', " ");
    assert_shows(&text, &["Ticks of 1 of 4 trials are recorded", &format!("those of trial {other} are missing")]);
    // Regression: several were "those of trial 0, 2", and its motion could not be drawn.
    let [first, second] = if best["number"].as_u64() > Some(1) { [0, 1] } else { [2, 3] };
    let text = program.text(&["report", &study, "--trials", &format!("best,{first},{second}")]).replace('\n', " ");
    assert_shows(&text, &[&format!("those of trials {first}, {second} are missing: motion, torque and power cannot")]);
    // Regression: a picture was refused with "no trial 3", signals without the remedy.
    let (other, best) = (other.to_string(), &best["number"]);
    for command in ["screenshot", "export"] {
        let refused = program.refused(&[command, &study, "--trial", &other]);
        let known = format!("no tick of trial {other} is recorded; trials with ticks: {best}");
        assert_shows(&refused, &[&known, "`quadfrog optimize --record all` and the console record every trial"]);
    }
}

#[test]
fn a_recording_that_was_cut_off_is_used_and_reported() {
    let (program, study) = study(&[]);
    assert_eq!(column(table(&page(&program, &[&study]), "Trials of"), "ticks"), ["yes"; 5]);
    let whole = Path::new(&study).join("session.mcap");
    let bytes = fs::read(&whole).unwrap();
    fs::write(whole.with_extension("mcap.part"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    fs::remove_file(&whole).unwrap();
    let page = page(&program, &[&study]);
    let ticks = column(table(&page, "Trials of"), "ticks");
    assert_eq!(ticks[0], "yes");
    assert_eq!(ticks[4], "no");
    // Regression: the trial in which the recording ends had ticks like any other.
    let last = ticks.iter().rposition(|ticks| ticks != "no").unwrap();
    assert!(ticks[..last].iter().all(|ticks| ticks == "yes") && ticks[last] == "in part", "{ticks:?}");
    let paragraphs: Vec<&str> = blocks(&page, "paragraph").iter().map(|text| text.as_str().unwrap()).collect();
    assert!(paragraphs.iter().any(|text| text.contains(&format!(", of trial {last} in part"))), "{paragraphs:?}");
    assert!(
        paragraphs.iter().any(|text| text.contains("session.mcap.part") && text.contains("cut off")),
        "{paragraphs:?}"
    );
}

/// Regression: the best trial of a study without a screen, whose ticks end the file, had ticks "in part": later trials end after it.
#[test]
fn the_recorded_trial_of_a_study_without_a_screen_is_whole() {
    let program = Program::new();
    program.text(&["optimize", "--trials", "5", "--seed", "5", "--output", "studies"]);
    let study = program.study("studies").display().to_string();
    let ticks = column(table(&page(&program, &[&study]), "Trials of"), "ticks");
    assert!(ticks.iter().all(|ticks| ["yes", "no"].contains(&ticks.as_str().unwrap())), "{ticks:?}");
    assert!(ticks.iter().any(|ticks| ticks == "yes"), "{ticks:?}");
    assert!(program.text(&["replay", "--check", &study]).contains("whole"));
    // Regression: a point that waits was denied by a number of trials that counted it.
    assert!(program.text(&["study", "enqueue", &study, "f0=1.2"]).contains("Queued as trial 5"));
    assert_shows(
        &program.refused(&["report", &study, "--trials", "5"]),
        &["--trials 5: no such trial has begun; the last one is 4"],
    );
}

/// Regression: the rollouts of a trial were one: "in part", with the torques of all and curves that ran back in time.
#[test]
fn the_rollouts_of_a_trial_with_repeats_are_apart() {
    let program = Program::new();
    program.write("config/control.toml", "[tasks.forward]\nrepeats = 2\n");
    program.text(&["optimize", "--trials", "3", "--record", "all", "--config", "config"]);
    let study = program.study("recordings").to_str().unwrap().to_owned();
    let page = page(&program, &[&study, "--trials", "0,1,2"]);
    assert_eq!(column(table(&page, "Trials of"), "ticks"), ["yes"; 3]);
    let motion = blocks(&page, "figure").into_iter().find(|figure| figure["name"] == "forward-motion").unwrap();
    for series in motion["panels"].as_array().unwrap().iter().flat_map(|panel| panel["series"].as_array().unwrap()) {
        let points = series["shape"]["line"].as_array().unwrap();
        let time_s = |point: &Value| point[0].as_f64().unwrap();
        assert!(points.windows(2).all(|pair| time_s(&pair[0]) <= time_s(&pair[1])), "{}", series["label"]);
    }
}

/// Regression: the figures of two studies of one name were written into one file, and their identifiers in the page were one.
#[test]
fn figures_of_studies_of_one_name_have_names_of_their_own() {
    let program = Program::new();
    for journal in ["a.log", "b.log"] {
        program.write(journal, include_str!("../golden/tpe/journal.log"));
    }
    program.text(&["report", "a.log", "b.log", "--figures", "figures", "--output", "page.html"]);
    let files = svgs(&program.path("figures"));
    let html = fs::read_to_string(program.path("page.html")).unwrap();
    assert_eq!(files.len(), html.matches("<figure id=").count());
    assert_eq!(files.iter().filter(|(file, _)| file.ends_with("-2.svg")).count(), files.len() / 2, "{:?}", files.len());
    for (file, _) in &files {
        let id = file.strip_suffix(".svg").unwrap();
        assert_eq!(html.matches(&format!("<figure id=\"{id}\"")).count(), 1, "{id}");
    }
}

#[test]
fn a_hardware_like_study_lists_the_keys_that_differ() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/hardware_like");
    let (program, study) = study(&["--config", folder.to_str().unwrap()]);
    let page = page(&program, &[&study]);
    let keys = column(table(&page, "Keys that differ"), "key");
    assert!(keys.iter().any(|key| key.as_str().unwrap().starts_with("simulator.toml: ")), "{keys:?}");
    assert!(
        blocks(&page, "folded").iter().any(|folded| folded["summary"].as_str().unwrap().starts_with("control.toml"))
    );
    assert!(!blocks(&page, "figure").is_empty());
}

#[test]
fn other_files_are_not_overwritten_and_a_report_is() {
    let (program, study) = study(&[]);
    program.write("letter.html", "<!DOCTYPE html><p>mine</p>");
    let message = program.refused(&["report", &study, "--output", "letter.html"]);
    assert_shows(&message, &["letter.html", "not part of a report", "another name"]);
    assert_eq!(fs::read_to_string(program.path("letter.html")).unwrap(), "<!DOCTYPE html><p>mine</p>");
    program.write("figures/forward-motion.svg", "<svg/>");
    assert!(program.refused(&["report", &study, "--figures", "figures"]).contains("forward-motion.svg"));
    assert_eq!(svgs(&program.path("figures")).len(), 1);
    // Regression: the page was written before the figures were refused.
    for figures in ["letter.html", "figures"] {
        assert_shows(&program.refused(&["report", &study, "-o", "new.html", "--figures", figures]), &["--figures"]);
        assert!(!program.path("new.html").exists(), "{figures}");
    }
    assert!(program.refused(&["report", &study, "--output", "missing/page.html"]).contains("missing"));
    assert!(program.refused(&["report", &study, "--output", "figures"]).contains("folder"));
    program.text(&["report", &study, "--output", "page.html"]);
    let first = fs::read_to_string(program.path("page.html")).unwrap();
    program.text(&["report", &study, "--output", "page.html", "--trials", "1"]);
    assert_ne!(fs::read_to_string(program.path("page.html")).unwrap(), first);
    // A file of at most 4 kB, as on a full disk: the report of before stays, and nothing else.
    let program_path = env!("CARGO_BIN_EXE_quadfrog");
    let limited = format!("trap '' XFSZ; ulimit -f 8; exec {program_path} report {study} --output page.html");
    let before = fs::read_to_string(program.path("page.html")).unwrap();
    let output = Command::new("sh").args(["-c", &limited]).current_dir(program.path("")).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_shows(&message, &["page.html", "cannot be written"]);
    assert_eq!(fs::read_to_string(program.path("page.html")).unwrap(), before);
    let names = fs::read_dir(program.path("")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert!(names.into_iter().all(|name| !name.ends_with(".part")));
}

#[test]
fn unusable_input_is_refused_with_the_remedy() {
    let (program, study) = study(&[]);
    assert_shows(&program.refused(&["report", "elsewhere"]), &["elsewhere", "no such journal"]);
    assert!(!program.path("elsewhere").exists());
    fs::create_dir(program.path("empty")).unwrap();
    assert_shows(&program.refused(&["report", "empty"]), &["no study in this folder", "give"]);
    assert_shows(&program.refused(&["report", &study, "--trials", "99"]), &["--trials 99", "the last one is 4"]);
    assert!(program.refused(&["report", &study, "--trials", "worst"]).contains("last-fall"));
    program.refused(&["report"]);
}

/// Regression: an imported trial named the recording of its own study, whose ticks were shown under the numbers of this one.
#[test]
fn ticks_of_another_study_are_not_shown() {
    let program = Program::new();
    let record = ["--trials", "2", "--record", "all", "--output"];
    let run = |more: &[&str]| drop(program.text(&[&["optimize"], &record[..], more].concat()));
    run(&["workers", "--task", "forward", "--seed", "9", "--join", "shared.log"]);
    assert_eq!(column(table(&page(&program, &["shared.log"]), "Trials of"), "ticks"), ["yes"; 2]);
    program.text(&["study", "export", "shared.log", "-o", "trials.csv"]);
    program.text(&["optimize", "--trials", "3", "--seed", "1", "--record", "none"]);
    let study = program.study("recordings").to_str().unwrap().to_owned();
    assert!(program.text(&["study", "import", &study, "trials.csv"]).starts_with("2 trials"));
    assert_shows(&program.text(&["report", &study]), &["No recording of this study exists"]);
    // A journal of an earlier version, and another recording in the place of that of a worker.
    run(&["others", "--seed", "4"]);
    fs::copy(program.study("others").join("session.mcap"), program.study("workers").join("session.mcap")).unwrap();
    assert_shows(&program.text(&["report", "shared.log"]), &["No recording of this study exists"]);
}

/// Regression: ticks of a recording of another study, which lies in the folder, were taken for those of the study.
#[test]
fn a_recording_of_another_study_in_the_folder_is_left_out() {
    let (program, study) = study(&[]);
    program.text(&["optimize", "--trials", "1", "--record", "all", "--seed", "7", "--output", "others"]);
    let other = program.study("others").join("session.mcap");
    fs::copy(other, Path::new(&study).join("session-2.mcap")).unwrap();
    let report = program.text(&["report", &study]);
    let words = report.split_whitespace().collect::<Vec<_>>().join(" ");
    let reason = "session-2.mcap: left out, because it is of another study: trial 0 has other parameters there.";
    assert_shows(&words, &[reason]);
    assert!(!words.contains(", session-2.mcap"), "{words}");
    // Regression: they were among the exported ones.
    let refused = program.refused(&["export", &study, "-o", "ticks.csv"]);
    assert_shows(&refused, &["session-2.mcap: not of the study of", "trial 0 has other parameters"]);
    assert!(!program.path("ticks.csv").exists());
}
