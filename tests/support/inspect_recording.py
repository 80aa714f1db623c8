"""Reads a recording with the independent Python reader and prints what a viewer needs of it as one JSON object.

Usage: inspect_recording.py FILE. Exit status 77 where the packages `mcap` and `mcap-protobuf-support` are not installed.
"""

import json
import sys
import xml.etree.ElementTree as ElementTree

try:
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory
except ImportError as error:
    print(error, file=sys.stderr)
    sys.exit(77)


def urdf(text):
    """Links, joints that move, and the links with shapes of the two kinds."""
    root = ElementTree.fromstring(text)
    shaped = lambda kind: sorted(
        link.get("name")
        for link in root.findall("link")
        if any(shape.find("geometry/mesh") is None for shape in link.findall(kind))
    )
    return {
        "links": sorted(link.get("name") for link in root.findall("link")),
        "joints": sorted(joint.get("name") for joint in root.findall("joint") if joint.get("type") == "revolute"),
        "visual": shaped("visual"),
        "collision": shaped("collision"),
    }


def bytes_a_tick_of_jumps(summary, modes):
    """Mean size of a tick in the file, with its share in the index of its chunk, over the chunks within jumps."""
    total = ticks = 0
    for chunk in summary.chunk_indexes:
        inside = [mode for time, mode in modes if chunk.message_start_time <= time <= chunk.message_end_time]
        if inside and set(inside) <= {"JUMP", "SETTLE"}:
            total += chunk.chunk_length + chunk.message_index_length
            ticks += len(inside)
    return total / ticks if ticks else None


def main(path):
    counts, frames, ground, shapes, joints, times, trials, logs, modes = {}, [], [], {}, set(), [], [], [], []
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
        attachments = {record.name: record.data.decode(errors="replace") for record in reader.iter_attachments()}
        channels = {channel.topic: dict(channel.metadata) for channel in summary.channels.values()}
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topic = channel.topic
            counts[topic] = counts.get(topic, 0) + 1
            if topic == "/robot/tick":
                mode = decoded.DESCRIPTOR.fields_by_name["mode"].enum_type.values_by_number[decoded.mode].name
                modes.append((message.log_time, mode))
            elif topic == "/tf":
                times.append(message.log_time)
                frames.append(sorted([t.parent_frame_id, t.child_frame_id] for t in decoded.transforms))
            elif topic == "/robot/joint_states":
                joints.add(tuple(joint.name for joint in decoded.joints))
            elif topic == "/scene/robot":
                for entity in decoded.entities:
                    count = len(entity.cubes) + len(entity.spheres) + len(entity.cylinders)
                    shapes[entity.frame_id] = shapes.get(entity.frame_id, 0) + count
            elif topic == "/scene/ground":
                ground.append({"cubes": [len(entity.cubes) for entity in decoded.entities],
                               "tops": [round(cube.pose.position.z + cube.size.z / 2, 6)
                                        for entity in decoded.entities for cube in entity.cubes]})
            elif topic == "/opt/trial":
                given = {field.name: value for field, value in decoded.ListFields()}
                trials.append([decoded.trial] + [given.get(name) for name in ("verdict", "seed", "start_ns", "end_ns")])
            elif topic == "/log":
                logs.append(decoded.message)
    print(json.dumps({
        "counts": counts, "metadata": metadata, "attachments": attachments, "channels": channels,
        "schemas": {schema.name: schema.data.decode("latin-1") for schema in summary.schemas.values()},
        "frames": frames[0] if frames else [], "frames_change": any(f != frames[0] for f in frames), "tf_times": times,
        "joints": [list(names) for names in joints], "shapes": shapes, "ground": ground, "trials": trials, "logs": logs,
        "bytes_a_tick_of_jumps": bytes_a_tick_of_jumps(summary, modes),
        "urdf": {name: urdf(text) for name, text in attachments.items() if name.endswith(".urdf")},
    }))


main(sys.argv[1])
