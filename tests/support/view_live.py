"""A viewer of a running session in Foxglove's WebSocket protocol; prints what it received as one JSON object.

Usage: view_live.py PORT. Exit status 77 where the packages `websockets` and `protobuf` are not installed.
"""

import base64
import json
import struct
import sys

try:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from websockets.sync.client import connect
except ImportError as error:
    print(error, file=sys.stderr)
    sys.exit(77)

WANTED = ["/robot/tick", "/session", "/scene/robot", "/scene/ground", "/tf", "/opt/stage"]
TICKS = 50


def message_class(channel):
    """Returns the class of a channel's messages, from the schema that was advertised."""
    files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))


def main(port):
    with connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
        info = json.loads(socket.recv())
        channels = {channel["topic"]: channel for channel in json.loads(socket.recv())["channels"]}
        classes = {topic: message_class(channel) for topic, channel in channels.items()}
        socket.send(json.dumps({"op": "advertise", "channels": [{"id": 1, "topic": "/cmd", "encoding": "json", "schemaName": ""}]}))
        refusal = json.loads(socket.recv())
        wanted = [{"id": 100 + place, "channelId": channels[topic]["id"]} for place, topic in enumerate(WANTED)]
        socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        counts, ticks, session = {}, [], None
        while len(ticks) < TICKS or len(counts) < len(WANTED):
            data = socket.recv()
            code, subscription, time = struct.unpack_from("<BIQ", data)
            topic = WANTED[subscription - 100]
            message = classes[topic].FromString(data[13:])
            counts[topic] = counts.get(topic, 0) + 1
            assert code == 1
            if topic == "/robot/tick":
                ticks.append([message.number, time, message.time_ns])
            elif topic == "/session":
                session = {"backend": message.backend, "start_utc_ns": message.start_utc_ns}
        print(json.dumps({
            "protocol": socket.subprotocol, "info": info, "refusal": refusal, "topics": sorted(channels),
            "counts": counts, "ticks": ticks, "session": session,
        }))


main(sys.argv[1])
