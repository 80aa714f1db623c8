//! Statements of the documents about the tests and the packages.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

#[path = "support/skip.rs"]
mod skip;

/// Every test that docs/reliability.md names is in the file that it names.
#[test]
fn every_test_of_the_reliability_document_exists() {
    let document = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reliability.md")).unwrap();
    let mut named = 0;
    let mut violations = Vec::new();
    for cell in document.lines().filter(|line| line.starts_with("| F")).flat_map(|line| line.split(['|', ';'])) {
        let mut quoted = cell.split('`').skip(1).step_by(2);
        let Some(file) = quoted.next().filter(|file| file.starts_with("tests/")) else { continue };
        let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(file))
            .unwrap_or_else(|error| panic!("{file}: {error}"));
        for test in quoted {
            named += 1;
            if !text.contains(&format!("#[test]\nfn {test}()")) {
                violations.push(format!("{file} has no test {test}"));
            }
        }
    }
    assert!(named > 16, "only {named} tests are named");
    assert!(violations.is_empty(), "name the test that keeps the mend:\n{}", violations.join("\n"));
}

/// Prints the files of the Debian package, as `packaging/deb.py` places them.
const PACKED: &str = r#"
import importlib.util, tomllib
spec = importlib.util.spec_from_file_location("deb", "packaging/deb.py")
deb = importlib.util.module_from_spec(spec)
spec.loader.exec_module(deb)
table = tomllib.load(open("ui/Cargo.toml", "rb"))["package"]["metadata"]["deb"]
for pattern, destination, _ in table["assets"]:
    for source, below in deb.sources(pattern):
        print(destination + str(below or source.name))
"#;

/// Regression: the Debian package had the examples that the console compiles in, without `diagonal` and `far`.
#[test]
fn every_example_configuration_is_in_the_debian_package() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = fs::read_dir(root.join("examples")).unwrap().map(|entry| entry.unwrap().path());
    let files = folders.filter(|folder| folder.is_dir()).flat_map(|folder| fs::read_dir(folder).unwrap());
    let files =
        files.map(|entry| entry.unwrap().path()).filter(|file| file.extension().is_some_and(|end| end == "toml"));
    let examples: BTreeSet<String> =
        files.map(|file| file.strip_prefix(root.join("examples")).unwrap().display().to_string()).collect();
    let python = Command::new("python3").args(["-c", PACKED]).current_dir(root).output();
    let Some(output) = python.ok().filter(|output| output.status.success()) else {
        return skip::skip("Python 3.11 or newer is not installed");
    };
    let packed = String::from_utf8(output.stdout).unwrap();
    let place = "usr/share/doc/quadfrog/examples/config/";
    let packed: BTreeSet<String> =
        packed.lines().filter_map(|line| line.strip_prefix(place)).map(str::to_owned).collect();
    assert!(examples.len() > 15, "{examples:?}");
    assert_eq!(packed, examples);
}
