"""Compares an exported recording with the Python mcap reader: compare_export.py RECORDING TABLE.csv TABLE.json TABLE.parquet.

Every field of the messages that is there must be a cell of the tables of pandas and polars with the same value."""

import json
import sys

import pandas as pd
import polars as pl
from google.protobuf.descriptor import FieldDescriptor
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

LEGS = [f"{leg}_{joint}" for leg in ["FR", "FL", "RR", "RL"] for joint in ["hip", "thigh", "calf"]]


def cells_of(message, prefix=""):
    """Cells of a message by column."""
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if field.has_presence and not message.HasField(field.name):
            continue
        name = prefix + field.name
        if field.name in ["motor_enabled", "limited"]:
            yield from ((f"{name}_{joint}", bool(value >> i & 1)) for i, joint in enumerate(LEGS))
        elif field.type == FieldDescriptor.TYPE_MESSAGE:
            yield from cells_of(value, f"{name}_")
        elif field.type == FieldDescriptor.TYPE_ENUM:
            yield name, field.enum_type.values_by_number[value].name
        elif field.name in LISTS:
            # The controller's torques are left out where they are those of the command.
            values = value or message.torque_command
            yield from ((f"{LISTS[field.name]}_{joint}", each) for joint, each in zip(LEGS, values))
        elif field.name == "cell":
            yield from ((f"{name}_{number}", each) for number, each in enumerate(value, 1))
        else:
            yield name, value


# Columns of the lists of a tick.
LISTS = {
    "motor_temperature": "motor_temperature", "joint_position": "position", "joint_velocity": "velocity",
    "joint_torque": "effort", "torque_command": "command_torque", "torque_demanded": "torque_demanded",
}


def expected(path):
    """Rows by log time. A joint command holds until the next one."""
    rows, command = {}, {}
    topics = ["/robot/tick", "/robot/joint_cmd"]
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, content in reader.iter_decoded_messages(topics=topics):
            if channel.topic == "/robot/joint_cmd":
                for field in ["position", "velocity", "kp", "kd"]:
                    command.update({f"command_{field}_{j}": value for j, value in zip(LEGS, getattr(content, field))})
            else:
                rows[message.log_time] = dict(cells_of(content)) | command
    return rows


def same(name, ours, theirs):
    if name in ["mode", "phase"]:
        return ours.upper().replace(" ", "_").replace("-", "_") == theirs
    return ours == theirs or (theirs != theirs and (ours is None or ours != ours))


if __name__ == "__main__":
    recording, csv, jsn, parquet = sys.argv[1:]
    rows = {at: row for at, row in expected(recording).items() if "number" in row}
    tables = {
        "pandas csv": pd.read_csv(csv, float_precision="round_trip").to_dict("list"),
        "pandas json": pd.DataFrame(json.load(open(jsn))).to_dict("list"),
        "pandas parquet": pd.read_parquet(parquet).to_dict("list"),
        "polars csv": pl.read_csv(csv, infer_schema_length=None).to_dict(as_series=False),
        "polars parquet": pl.read_parquet(parquet).to_dict(as_series=False),
    }
    compared = set()
    for name, table in tables.items():
        assert table["log_time"] == sorted(rows), f"{name}: other times"
        for index, at in enumerate(table["log_time"]):
            for column, theirs in rows[at].items():
                ours = table[column][index]
                ours = {"True": True, "true": True, "False": False, "false": False}.get(ours, ours)
                assert same(column, ours, theirs), f"{name}: {column} at {at}: {ours!r}, not {theirs!r}"
                compared.add(column)
    print(json.dumps({"rows": len(rows), "columns": sorted(compared)}))
