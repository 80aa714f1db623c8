//! Columns of an exported recording.

use prost_types::FileDescriptorSet;
use quadfrog::report::columns::TableFormat;
use quadfrog::report::signals::{SignalRange, Signals};
use quadfrog::robot::{Battery, JOINTS, joint_name};

/// Returns the columns of a message's fields in the schema, each with `prefix`.
fn columns_of(schema: &FileDescriptorSet, message: &str, prefix: &str) -> Vec<String> {
    let message = schema.file[0].message_type.iter().find(|known| known.name() == message).unwrap();
    let of_joints = |name: &str| (0..JOINTS).map(|joint| format!("{name}_{}", joint_name(joint))).collect();
    let columns = message.field.iter().map(|field| -> Vec<String> {
        match field.name() {
            "battery" => columns_of(schema, "Battery", "battery_"),
            "truth" => columns_of(schema, "Truth", "truth_"),
            "cell" => (1..=Battery::default().cell_v.len()).map(|cell| format!("{prefix}cell_{cell}")).collect(),
            "joint_position" => of_joints("position"),
            "joint_velocity" => of_joints("velocity"),
            "joint_torque" => of_joints("effort"),
            "torque_command" => of_joints("command_torque"),
            name @ ("motor_temperature" | "motor_enabled" | "torque_demanded" | "limited") => of_joints(name),
            name => vec![format!("{prefix}{name}")],
        }
    });
    columns.flatten().collect()
}

/// Regression: the voltages of the battery's cells had no columns.
#[test]
fn every_field_of_a_tick_has_its_columns() {
    let proto = concat!(env!("CARGO_MANIFEST_DIR"), "/proto");
    let schema = protox::compile(["frog.proto"], [proto]).unwrap();
    let range = SignalRange { trial: None, from_ns: 0, until_ns: u64::MAX };
    let mut table = Vec::new();
    Signals::of(None).export(&mut [], range, TableFormat::Csv, &mut table).unwrap();
    let table = String::from_utf8(table).unwrap();
    let found: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let missing = columns_of(&schema, "ControlTick", "").into_iter().filter(|name| !found.contains(&name.as_str()));
    assert_eq!(missing.collect::<Vec<_>>(), Vec::<String>::new());
}
