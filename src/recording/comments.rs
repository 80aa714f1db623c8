//! Comments of the fields of `proto/frog.proto`, with their units, and units of the messages of Foxglove: metadata of the
//! channels of a recording. Every schema would contain the whole file's comments otherwise.

use std::collections::BTreeMap;

/// Field: name, type of a nested message or nothing, comment.
type Field = (&'static str, &'static str, &'static str);

const MESSAGES: &[(&str, &[Field])] = include!("../../proto/generated/comments.rs");

/// Deepest nesting of messages; the file has three levels.
const DEEPEST: usize = 5;

/// Returns the comment of every field of a message by the field's path, for example `truth.position_x`.
pub fn of(schema: &str) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    let foxglove: &[(&str, &str)] = match schema {
        "foxglove.JointStates" => &[("joints.position", "rad"), ("joints.velocity", "rad/s"), ("joints.effort", "N m")],
        "foxglove.PoseInFrame" => &[("pose.position", "m"), ("pose.orientation", "body to world")],
        "foxglove.FrameTransforms" => &[("transforms.translation", "m"), ("transforms.rotation", "child to parent")],
        "foxglove.SceneUpdate" => &[("entities.cubes.size", "m"), ("entities.cubes.pose.position", "m")],
        _ => &[],
    };
    found.extend(foxglove.iter().map(|(name, unit)| (String::from(*name), String::from(*unit))));
    if let Some(message) = schema.strip_prefix("frog.v1.") {
        add(message, "", DEEPEST, &mut found);
    }
    found
}

fn add(message: &str, path: &str, depth: usize, found: &mut BTreeMap<String, String>) {
    let Some((_, fields)) = MESSAGES.iter().find(|(name, _)| *name == message).filter(|_| depth > 0) else { return };
    for (name, nested, comment) in *fields {
        let path = format!("{path}{name}");
        if let Some(nested) = nested.strip_prefix(".frog.v1.") {
            add(nested, &format!("{path}."), depth - 1, found);
        }
        if !comment.is_empty() {
            found.insert(path, String::from(*comment));
        }
    }
}
