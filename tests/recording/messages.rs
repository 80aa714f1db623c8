//! Files made from `proto/frog.proto` are kept in the repository, so that a build of the program needs no protobuf compiler.

use crate::generate_messages;
use std::fs;
use std::path::Path;

/// `QUADFROG_WRITE=1` writes the files instead.
#[test]
fn the_types_the_schemas_and_the_page_of_messages_are_up_to_date() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (path, made) in generate_messages::files() {
        let file = root.join(path);
        if std::env::var_os("QUADFROG_WRITE").is_some() {
            fs::write(&file, &made).unwrap();
        }
        let kept = fs::read_to_string(&file).unwrap_or_default();
        assert!(
            kept == made,
            "{path} is not that of proto/frog.proto: QUADFROG_WRITE=1 cargo test --test recording messages::"
        );
    }
}

#[test]
fn the_page_of_messages_has_every_field_and_its_comment() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = fs::read_to_string(root.join("docs/reference/messages.md")).unwrap();
    let source = fs::read_to_string(root.join("proto/frog.proto")).unwrap();
    let mut rows = 0;
    for line in source.lines().map(str::trim).filter(|line| !line.starts_with("//")) {
        let Some((name, number)) = line.split_once(';').and_then(|(element, _)| element.split_once(" = ")) else {
            continue;
        };
        if number.parse::<u32>().is_err() {
            continue; // the syntax of the file
        }
        let name = name.split_whitespace().last().unwrap();
        let row = format!("| {number} | `{name}` | ");
        assert!(page.contains(&row) || page.contains(&format!("{number} `{name}`")), "{line}");
        if let Some((_, comment)) = line.split_once("; // ") {
            assert!(page.contains(comment.trim()), "{comment}");
        }
        rows += 1;
    }
    assert!(rows > 300, "{rows} fields and values");
}
