//! The page on the messages of a recording is that of `proto/frog.proto`.

use std::fs;
use std::path::Path;

use quadfrog::recording::MESSAGES_PAGE;

/// `QUADFROG_WRITE=1` writes the page instead.
#[test]
fn the_page_of_messages_is_up_to_date() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let file = root.join("docs/reference/messages.md");
    if std::env::var_os("QUADFROG_WRITE").is_some() {
        fs::write(&file, MESSAGES_PAGE).unwrap();
    }
    let page = fs::read_to_string(&file).unwrap_or_default();
    assert!(page == MESSAGES_PAGE, "QUADFROG_WRITE=1 cargo test --test messages_page");
    // Every field and every value of an enum is in it, with its number and its comment.
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
