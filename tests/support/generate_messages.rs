//! Compiles `proto/frog.proto` to Rust types, to the descriptors that a recording carries, and to its page of documentation.

use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

/// Files made from `proto/frog.proto`, by their path in the repository.
pub fn files() -> [(&'static str, String); 4] {
    let proto = concat!(env!("CARGO_MANIFEST_DIR"), "/proto");
    let mut descriptors = protox::compile(["frog.proto"], [proto]).unwrap();
    let comments = comments(&descriptors.file[0]);
    let page = Page { file: &descriptors.file[0] }.text();
    let types = types(&descriptors);
    // The schema of a topic in a recording: without comments it has a third of the length.
    for file in &mut descriptors.file {
        file.source_code_info = None;
    }
    let names = descriptors.file[0].message_type.iter().map(|message| message.name());
    let schemas = names.map(|name| {
        let schema = reduced(&descriptors, name).encode_to_vec();
        format!("({name:?}, b\"{}\")", schema.escape_ascii())
    });
    let schemas = format!("&[\n{}\n]\n", schemas.collect::<Vec<_>>().join(",\n"));
    [
        ("proto/generated/messages.rs", types),
        ("proto/generated/comments.rs", comments),
        ("proto/generated/schemas.rs", schemas),
        ("docs/reference/messages.md", page),
    ]
}

/// Returns the messages as Rust types.
fn types(descriptors: &FileDescriptorSet) -> String {
    let folder = tempfile::tempdir().unwrap();
    let mut config = prost_build::Config::new();
    config.out_dir(folder.path());
    // A tick by the names of its fields, for `quadfrog verify`.
    for message in ["ControlTick", "Battery", "Truth", "JointCommand", "FaultTicks.Whole"] {
        config.message_attribute(format!(".frog.v1.{message}"), "#[derive(serde::Serialize)]");
    }
    config.compile_fds(descriptors.clone()).unwrap();
    std::fs::read_to_string(folder.path().join("frog.v1.rs")).unwrap()
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
    format!("&[\n{}\n]\n", rows.collect::<Vec<_>>().join(",\n"))
}

/// `docs/reference/messages.md`: the messages as tables of Markdown. Paths are those of `descriptor.proto`.
struct Page<'a> {
    file: &'a FileDescriptorProto,
}

impl Page<'_> {
    /// Comments before and behind the element at `path`.
    fn comments(&self, path: &[i32]) -> [&str; 2] {
        let found = self.file.source_code_info.iter().flat_map(|info| &info.location).find(|at| at.path == path);
        found.map_or(["", ""], |at| [at.leading_comments().trim(), at.trailing_comments().trim()])
    }

    /// The page.
    fn text(&self) -> String {
        // 12: the line `syntax`, behind the comment of the file.
        let [about, _] = self.comments(&[12]);
        let mut page = String::from(
            "# Messages of a recording\n\n\
             Made from `proto/frog.proto`; `QUADFROG_WRITE=1 cargo test --test recording messages::` writes it.\n\
             `recordings/README.md` describes the container, its topics and its attachments; each recording has this file inside.\n",
        );
        page += &format!("\n{}\n", about.lines().map(str::trim).collect::<Vec<_>>().join("\n"));
        for (index, message) in (0..).zip(&self.file.message_type) {
            self.message(message, message.name(), &[4, index], &mut page);
        }
        page
    }

    fn message(&self, message: &DescriptorProto, name: &str, path: &[i32], page: &mut String) {
        let level = if path.len() == 2 { "##" } else { "###" };
        *page += &format!("\n{level} {name}\n");
        let [about, _] = self.comments(path);
        if !about.is_empty() {
            *page += &format!("\n{}\n", about.lines().map(str::trim).collect::<Vec<_>>().join("\n"));
        }
        *page += "\n| number | field | type | meaning |\n|---|---|---|---|\n";
        for (index, field) in (0..).zip(&message.field) {
            let [before, behind] = self.comments(&[path, &[2, index]].concat()).map(cell);
            if !before.is_empty() {
                *page += &format!("| | | | *{before}* |\n");
            }
            *page += &format!("| {} | `{}` | {} | {behind} |\n", field.number(), field.name(), kind(field));
        }
        for (index, choice) in (0..).zip(&message.enum_type) {
            self.choices(choice, &[path, &[4, index]].concat(), page);
        }
        for (index, nested) in (0..).zip(&message.nested_type) {
            self.message(nested, &format!("{name}.{}", nested.name()), &[path, &[3, index]].concat(), page);
        }
    }

    fn choices(&self, choice: &EnumDescriptorProto, path: &[i32], page: &mut String) {
        let [about, _] = self.comments(path).map(cell);
        let value = |(index, value): (i32, &prost_types::EnumValueDescriptorProto)| {
            let [before, behind] = self.comments(&[path, &[2, index]].concat()).map(cell);
            let meaning = if behind.is_empty() { before } else { behind };
            let meaning = if meaning.is_empty() { meaning } else { format!(" ({meaning})") };
            format!("{} `{}`{meaning}", value.number(), value.name())
        };
        let values: Vec<_> = (0..).zip(&choice.value).map(value).collect();
        let about = about.trim_end_matches('.');
        let about = if about.is_empty() { String::new() } else { format!(" ({about})") };
        *page += &format!("\n`{}`{about}: {}.\n", choice.name(), values.join(", "));
    }
}

/// A comment in a cell of a table.
fn cell(comment: &str) -> String {
    comment.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

/// The type of a field as in the source: `optional double`, `repeated Item`.
fn kind(field: &FieldDescriptorProto) -> String {
    let label = match (field.label(), field.proto3_optional()) {
        (Label::Repeated, _) => "repeated ",
        (_, true) => "optional ",
        _ => "",
    };
    let plain = field.r#type().as_str_name().trim_start_matches("TYPE_").to_lowercase();
    let name = match field.r#type() {
        Type::Message | Type::Enum => field.type_name().trim_start_matches(".frog.v1."),
        _ => &plain,
    };
    format!("{label}{name}")
}
