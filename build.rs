//! Compiles `proto/frog.proto` to Rust types and to the descriptor that a recording carries.

use std::path::PathBuf;

use prost::Message as _;
use prost_types::{FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=proto");
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let mut descriptors = protox::compile(["frog.proto"], ["proto"])?;
    std::fs::write(out.join("frog.v1.comments.rs"), comments(&descriptors.file[0]))?;
    let mut config = prost_build::Config::new();
    // A tick by the names of its fields, for `quadfrog verify`.
    for message in ["ControlTick", "Battery", "Truth", "JointCommand", "FaultTicks.Whole"] {
        config.message_attribute(format!(".frog.v1.{message}"), "#[derive(serde::Serialize)]");
    }
    config.compile_fds(descriptors.clone())?;
    // The schema of a topic in a recording: without comments it has a third of the length.
    for file in &mut descriptors.file {
        file.source_code_info = None;
    }
    let names = descriptors.file[0].message_type.iter().map(|message| message.name().to_owned());
    let schemas = names.map(|name| {
        let schema = reduced(&descriptors, &name).encode_to_vec();
        format!("({name:?}, &{schema:?})")
    });
    std::fs::write(out.join("frog.v1.schemas.rs"), format!("&[{}]", schemas.collect::<Vec<_>>().join(",\n")))?;
    Ok(())
}

/// Returns the descriptors with the message of that name and those that it refers to alone.
fn reduced(descriptors: &FileDescriptorSet, name: &str) -> FileDescriptorSet {
    let mut kept = vec![name.to_owned()];
    let mut next = 0;
    while let Some(name) = kept.get(next).cloned() {
        let message = descriptors.file[0].message_type.iter().find(|message| message.name() == name);
        let mut unread: Vec<_> = message.into_iter().collect();
        while let Some(message) = unread.pop() {
            unread.extend(&message.nested_type);
            // The message that contains the type: `.frog.v1.ControlTick.Mode` is of `ControlTick`.
            let types = message.field.iter().filter_map(|field| field.type_name().strip_prefix(".frog.v1."));
            for outer in types.filter_map(|path| path.split('.').next()) {
                if !kept.iter().any(|known| known == outer) {
                    kept.push(outer.to_owned());
                }
            }
        }
        next += 1;
    }
    let mut reduced = descriptors.clone();
    reduced.file[0].message_type.retain(|message| kept.iter().any(|name| name == message.name()));
    reduced
}

/// Returns a table in Rust: name of each message, and name, nested message and comment of each of its fields.
fn comments(file: &FileDescriptorProto) -> String {
    let info = file.source_code_info.as_ref();
    let text = |path: &[i32]| {
        let found = info.iter().flat_map(|info| &info.location).find(|location| location.path == path)?;
        Some(found.trailing_comments().trim().replace('\n', " ")).filter(|text| !text.is_empty())
    };
    // Message (4), nested message (3) and field (2) of `descriptor.proto`.
    let mut messages = Vec::new();
    for (index, message) in (0..).zip(&file.message_type) {
        messages.push((message.name().to_owned(), message, vec![4, index]));
    }
    let mut next = 0;
    while let Some((name, message, path)) = messages.get(next).cloned() {
        for (index, nested) in (0..).zip(&message.nested_type) {
            messages.push((format!("{name}.{}", nested.name()), nested, [&path[..], &[3, index]].concat()));
        }
        next += 1;
    }
    let rows = messages.iter().map(|(name, message, path)| {
        let field = |(index, field): (i32, &FieldDescriptorProto)| {
            let comment = text(&[&path[..], &[2, index]].concat()).unwrap_or_default();
            format!("({:?}, {:?}, {comment:?})", field.name(), field.type_name())
        };
        let fields: Vec<_> = (0..).zip(&message.field).map(field).collect();
        format!("({name:?}, &[{}])", fields.join(", "))
    });
    format!("&[{}]", rows.collect::<Vec<_>>().join(",\n"))
}
