//! Statements of the documents about the tests.

use std::fs;
use std::path::Path;

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
