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
        if field.name == "motor_enabled":
            yield from ((f"{name}_{joint}", bool(value >> i & 1)) for i, joint in enumerate(LEGS))
        elif field.type == FieldDescriptor.TYPE_MESSAGE:
            yield from cells_of(value, f"{name}_")
        elif field.type == FieldDescriptor.TYPE_ENUM:
            yield name, field.enum_type.values_by_number[value].name
        elif field.name == "motor_temperature":
            yield from ((f"{name}_{joint}", each) for joint, each in zip(LEGS, value))
        elif field.name != "cell":
            yield name, value


def expected(path):
    """Rows by log time."""
    rows = {}
    topics = ["/robot/tick", "/robot/joint_states", "/robot/joint_cmd"]
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, content in reader.iter_decoded_messages(topics=topics):
            row = rows.setdefault(message.log_time, {})
            if channel.topic == "/robot/tick":
                row.update(cells_of(content))
            elif channel.topic == "/robot/joint_states":
                for joint in content.joints:
                    name = joint.name.removesuffix("_joint")
                    row.update({f"{part}_{name}": getattr(joint, part) for part in ["position", "velocity", "effort"]})
            else:
                for field, values in [(field.name, value) for field, value in content.ListFields()]:
                    if field == "torque_demanded":
                        row.update({f"{field}_{joint}": value for joint, value in zip(LEGS, values)})
                    elif field == "limited":
                        row.update({f"{field}_{joint}": bool(values >> i & 1) for i, joint in enumerate(LEGS)})
                    elif field in ["position", "velocity", "kp", "kd", "torque"]:
                        row.update({f"command_{field}_{joint}": value for joint, value in zip(LEGS, values)})
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
