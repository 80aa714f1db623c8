"""A Go2, or a program that commands one, made from the types, checksum and RPC messages of Unitree's own Python SDK over Cyclone DDS.

    python3 tests/support/go2_peer.py robot DOMAIN SECONDS       sends states, answers as the services, counts commands
    python3 tests/support/go2_peer.py host DOMAIN SECONDS        releases the controller, commands damping, counts states
    python3 tests/support/go2_peer.py commander DOMAIN SECONDS   a second program that commands the robot
    python3 tests/support/go2_peer.py wrong-type DOMAIN SECONDS  a writer of another type on the topic of the states

The last line is a JSON object with what was counted. Needs cyclonedds 11.0.1 and unitree_sdk2 1.0.1 from the package index. The
package imports a module that it does not contain, and the library of its checksum is missing in it: its modules are loaded one by
one, and its checksum in Python is used.
"""

import importlib.util
import json
import os
import platform
import sys
import threading
import time
import types

mode, domain, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
# The loopback interface carries no multicast everywhere: participants are found at the ports of the standard.
os.environ["CYCLONEDDS_URI"] = (
    "<CycloneDDS><Domain Id='any'>"
    "<General><Interfaces><NetworkInterface name='lo' multicast='false'/></Interfaces></General>"
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery>"
    "</Domain></CycloneDDS>"
)

folder = os.path.dirname(importlib.util.find_spec("unitree_sdk2py").origin) if importlib.util.find_spec(
    "unitree_sdk2py"
) else None
if folder is None:
    sys.exit("unitree_sdk2 is not installed: pip install --no-deps unitree_sdk2==1.0.1 cyclonedds==11.0.1")
for name in ["unitree_sdk2py", "unitree_sdk2py.utils", "unitree_sdk2py.idl"]:
    package = types.ModuleType(name)
    package.__path__ = [os.path.join(folder, *name.split(".")[1:])]
    sys.modules[name] = package

import unitree_sdk2py.idl.unitree_api.msg.dds_ as api  # noqa: E402
import unitree_sdk2py.idl.unitree_go.msg.dds_ as go  # noqa: E402

sys.modules["unitree_sdk2py.idl"].unitree_go = sys.modules["unitree_sdk2py.idl.unitree_go"]
sys.modules["unitree_sdk2py.idl"].unitree_api = sys.modules["unitree_sdk2py.idl.unitree_api"]
import unitree_sdk2py  # noqa: E402

unitree_sdk2py.idl = sys.modules["unitree_sdk2py.idl"]
from unitree_sdk2py.idl.default import (  # noqa: E402
    unitree_go_msg_dds__LowCmd_ as new_command,
    unitree_go_msg_dds__LowState_ as new_state,
)

real_system, platform.system = platform.system, lambda: "without the library"
from unitree_sdk2py.utils.crc import CRC  # noqa: E402

checksum = CRC()
platform.system = real_system

from cyclonedds.core import Qos, Policy  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.pub import DataWriter  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402
from cyclonedds.util import duration  # noqa: E402

participant = DomainParticipant(domain)
newest = Qos(Policy.History.KeepLast(16))
reliable = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepLast(16))


def take(reader):
    return [sample for sample in reader.take(64) if sample.sample_info.valid_data]


def request_of(service):
    return Topic(participant, f"rt/api/{service}/request", api.Request_)


def response_of(service):
    return Topic(participant, f"rt/api/{service}/response", api.Response_)


def robot():
    states = DataWriter(participant, Topic(participant, "rt/lowstate", go.LowState_))
    commands = DataReader(participant, Topic(participant, "rt/lowcmd", go.LowCmd_), newest)
    services = {
        name: (DataReader(participant, request_of(name), reliable), DataWriter(participant, response_of(name), reliable))
        for name in ["motion_switcher", "sport"]
    }
    active, asked = "normal", []
    counts = {"commands": 0, "bad_checksums": 0, "states": 0}
    state, last, begun = new_state(), None, time.monotonic()
    lying = [-0.35, 1.36, -2.65, 0.35, 1.36, -2.65, -0.35, 1.36, -2.65, 0.35, 1.36, -2.65]
    state.head, state.level_flag = [0xFE, 0xEF], 0xFF
    state.imu_state.quaternion = [1.0, 0.0, 0.0, 0.0]
    state.imu_state.accelerometer = [0.0, 0.0, 9.81]
    state.bms_state.soc, state.foot_force = 87, [10, 20, 30, 40]
    for i, angle in enumerate(lying):
        state.motor_state[i].mode, state.motor_state[i].q, state.motor_state[i].temperature = 1, angle, 30 + i
    while time.monotonic() - begun < seconds:
        state.tick = (state.tick + 2) & 0xFFFFFFFF
        state.imu_state.gyroscope = [0.0, 0.0, 0.001 * (state.tick % 7)]
        state.crc = checksum.Crc(state)
        states.write(state)
        counts["states"] += 1
        for command in take(commands):
            counts["commands"] += 1
            counts["bad_checksums"] += checksum.Crc(command) != command.crc
            last = command
        for name, (requests, responses) in services.items():
            for request in take(requests):
                identity, data = request.header.identity, ""
                asked.append([name, identity.api_id])
                if (name, identity.api_id) == ("motion_switcher", 1001):
                    data = json.dumps({"form": "0", "name": active})
                elif (name, identity.api_id) == ("motion_switcher", 1003):
                    active = ""
                elif (name, identity.api_id) == ("motion_switcher", 1002):
                    active = json.loads(request.parameter)["name"]
                header = api.ResponseHeader_(identity, api.ResponseStatus_(0))
                responses.write(api.Response_(header, data, []))
        time.sleep(0.0015)
    counts |= {"asked": asked, "active": active}
    if last is not None:
        motor = last.motor_cmd[0]
        counts["last"] = {"mode": motor.mode, "kp": motor.kp, "kd": motor.kd, "dq": motor.dq, "tau": motor.tau}
        counts["battery_off"] = last.bms_cmd.off
    return counts


def host():
    states = DataReader(participant, Topic(participant, "rt/lowstate", go.LowState_), newest)
    commands = DataWriter(participant, Topic(participant, "rt/lowcmd", go.LowCmd_))
    requests = DataWriter(participant, request_of("motion_switcher"), reliable)
    responses = DataReader(participant, response_of("motion_switcher"), reliable)
    counts, answers, number = {"states": 0, "bad_checksums": 0}, [], 1

    def ask(function, parameter="{}"):
        """Repeats a request until it is answered."""
        nonlocal number
        for _ in range(20):
            number += 1
            header = api.RequestHeader_(
                api.RequestIdentity_(number, function), api.RequestLease_(0), api.RequestPolicy_(0, False)
            )
            requests.write(api.Request_(header, parameter, []))
            until = time.monotonic() + 0.5
            while time.monotonic() < until:
                for response in take(responses):
                    if response.header.identity.id == number:
                        answers.append([function, response.header.status.code, response.data])
                        return response
                time.sleep(0.01)
        sys.exit(f"no response to {function}")

    ask(1001)
    ask(1003)
    ask(1001)
    command = new_command()
    command.head, command.level_flag = [0xFE, 0xEF], 0xFF
    for motor in command.motor_cmd:
        motor.mode, motor.q, motor.dq, motor.kp, motor.kd, motor.tau = 1, 2.146e9, 16000.0, 0.0, 0.0, 0.0
    for motor in command.motor_cmd[:12]:
        motor.dq, motor.kd = 0.0, 3.0
    command.crc = checksum.Crc(command)
    begun, modes = time.monotonic(), []
    while time.monotonic() - begun < seconds:
        commands.write(command)
        for state in take(states):
            counts["states"] += 1
            counts["bad_checksums"] += checksum.Crc(state) != state.crc
            modes = [motor.mode for motor in state.motor_state[:12]]
        time.sleep(0.002)
    ask(1002, json.dumps({"name": "nonsense"}))
    ask(1002, json.dumps({"name": "ai"}))
    ask(1001)
    return counts | {"answers": answers, "modes": modes}


def commander():
    commands = DataWriter(participant, Topic(participant, "rt/lowcmd", go.LowCmd_))
    command = new_command()
    command.head, command.level_flag = [0xFE, 0xEF], 0xFF
    for motor in command.motor_cmd:
        motor.mode, motor.q, motor.dq, motor.kd = 1, 2.146e9, 0.0, 1.0
    command.crc = checksum.Crc(command)
    begun, sent = time.monotonic(), 0
    while time.monotonic() - begun < seconds:
        commands.write(command)
        sent += 1
        time.sleep(0.01)
    return {"sent": sent}


def wrong_type():
    states = DataWriter(participant, Topic(participant, "rt/lowstate", go.LowCmd_))
    begun, sent = time.monotonic(), 0
    while time.monotonic() - begun < seconds:
        states.write(new_command())
        sent += 1
        time.sleep(0.01)
    return {"sent": sent}


modes = {"robot": robot, "host": host, "commander": commander, "wrong-type": wrong_type}
print(json.dumps(modes[mode]()), flush=True)
