//! Who may use whom: the arrows of `src/lib.rs`, checked on every `use crate::...` and `crate::...` of the sources.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A module and what of ours it may name.
const MAY_USE: [(&str, &[&str]); 12] = [
    ("robot", &[]),
    ("optimize", &[]),
    ("trial", &[]),
    ("telemetry", &["robot", "trial"]),
    ("realtime", &["telemetry", "robot"]),
    ("sim", &["robot"]),
    ("control", &["robot", "trial", "telemetry", "realtime"]),
    ("recording", &["telemetry", "trial", "robot", "optimize"]),
    ("report", &["recording", "optimize", "trial"]),
    ("session", &["optimize", "recording", "control", "sim", "realtime", "telemetry", "trial", "robot"]),
    ("config", &["optimize", "recording", "control", "sim", "realtime", "telemetry", "trial", "robot"]),
    (
        "engine",
        &[
            "config",
            "session",
            "report",
            "optimize",
            "recording",
            "control",
            "sim",
            "realtime",
            "telemetry",
            "trial",
            "robot",
        ],
    ),
];

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

/// The modules named after `crate::` in code; comments may speak of anything.
fn used(text: &str) -> BTreeSet<String> {
    let code: String =
        text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n");
    let mut modules = BTreeSet::new();
    for (place, _) in code.match_indices("crate::") {
        let rest = &code[place + "crate::".len()..];
        if let Some(group) = rest.strip_prefix('{') {
            let end = group.find('}').unwrap_or(group.len());
            for item in group[..end].split(',') {
                modules.insert(item.trim().split("::").next().unwrap_or_default().to_owned());
            }
        } else {
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            modules.insert(name);
        }
    }
    modules
}

#[test]
fn every_module_uses_only_what_it_may() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut checked = 0;
    for (module, allowed) in MAY_USE {
        let mut files = vec![root.join(format!("{module}.rs"))];
        if root.join(module).is_dir() {
            files.extend(sources(&root.join(module)));
        }
        for file in files.into_iter().filter(|file| file.exists()) {
            for name in used(&fs::read_to_string(&file).unwrap()) {
                let ours = MAY_USE.iter().any(|(known, _)| *known == name);
                let fine = !ours || name == module || allowed.contains(&name.as_str());
                assert!(fine, "{}: `{module}` may not use `{name}` (see src/lib.rs)", file.display());
            }
            checked += 1;
        }
    }
    assert!(checked > 30, "only {checked} source files were found");
}

/// The engine never learns of the terminal: its manifest has no such crate.
#[test]
fn the_engine_knows_no_terminal() {
    let manifest = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml")).unwrap();
    for name in ["ratatui", "crossterm", "clap", "indicatif", "tokio"] {
        let depends =
            manifest.lines().any(|line| line.starts_with(&format!("{name} ")) || line.starts_with(&format!("{name}=")));
        assert!(!depends, "the engine depends on {name}");
    }
}

/// `unsafe` stands in `src/realtime` alone.
#[test]
fn unsafe_code_is_in_realtime_alone() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for folder in ["src", "ui/src"] {
        for file in sources(&root.join(folder)) {
            let in_realtime = file.starts_with(root.join("src/realtime"));
            let text = fs::read_to_string(&file).unwrap();
            let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
            let found = code.flat_map(str::split_whitespace).any(|word| word == "unsafe");
            assert!(in_realtime || !found, "{}: unsafe code outside src/realtime", file.display());
        }
    }
}
