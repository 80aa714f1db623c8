"""Reads a recording with the independent Python reader and prints what it finds as one JSON object.

Usage: read_mcap.py FILE. Exit status 77 where the packages `mcap` and `mcap-protobuf-support` are not installed.
"""

import json
import sys

try:
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory
except ImportError as error:
    print(error, file=sys.stderr)
    sys.exit(77)


def main(path):
    counts, schemas, ticks, joints, commands, positions = {}, {}, [], [], [], []
    trials, logs, faults, frames, session, in_order, last = [], [], [], [], None, True, 0
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        header = reader.get_header()
        summary = reader.get_summary()
        metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
        attachments = {record.name: record.data.decode(errors="replace") for record in reader.iter_attachments()}
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topic = channel.topic
            counts[topic] = counts.get(topic, 0) + 1
            schemas[topic] = schema.name
            in_order = in_order and message.log_time >= last
            last = message.log_time
            if topic == "/robot/tick":
                mode = decoded.DESCRIPTOR.fields_by_name["mode"].enum_type.values_by_number[decoded.mode].name
                commands.append(list(decoded.torque_demanded or decoded.torque_command))
                positions.append(list(decoded.joint_position))
                ticks.append([message.log_time, decoded.number, decoded.roll, decoded.foot_z_rl,
                              decoded.truth.force_z_fr, mode])
            elif topic == "/robot/joint_states":
                joints.append([[joint.name, joint.position, joint.effort] for joint in decoded.joints])
            elif topic == "/opt/trial":
                trials.append([decoded.trial, {p.name: p.value for p in decoded.parameters},
                               decoded.value if decoded.HasField("value") else None,
                               decoded.verdict if decoded.HasField("verdict") else None])
            elif topic == "/log":
                logs.append([decoded.level, decoded.name, decoded.message, decoded.timestamp.ToNanoseconds()])
            elif topic == "/fault":
                faults.append([tick.tick.number for tick in decoded.ticks])
            elif topic == "/tf":
                frames.append([[t.parent_frame_id, t.child_frame_id,
                                [t.translation.x, t.translation.y, t.translation.z],
                                [t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w]]
                               for t in decoded.transforms])
            elif topic == "/session":
                session = {"robot": decoded.robot, "seed": decoded.seed, "start_utc_ns": decoded.start_utc_ns,
                           "parameters": [[p.name, p.low, p.high] for p in decoded.parameters]}
    some = [0, len(ticks) // 2, len(ticks) - 1]
    print(json.dumps({
        "profile": header.profile, "library": header.library,
        "message_count": summary.statistics.message_count, "chunks": summary.statistics.chunk_count,
        "counts": counts, "schemas": schemas, "in_order": in_order, "session": session, "metadata": metadata,
        "attachments": attachments, "ticks": [ticks[i] for i in some], "commands": [commands[i] for i in some],
        "positions": [positions[i] for i in some], "joints": joints[0], "trials": trials, "logs": logs, "faults": faults,
        "first_frames": frames[0] if frames else None,
    }))


main(sys.argv[1])
