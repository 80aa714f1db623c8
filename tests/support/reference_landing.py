#!/usr/bin/env python3
"""Reference jumps of the Go1 in MuJoCo with the landing terms; writes tests/golden/jumps_landing.json.

    pip install mujoco numpy
    python3 tests/support/reference_landing.py tests/golden/jumps_landing.json --seed 20261122 --cases 12

Protocol: flat floor, friction 1.0, spherical feet, collisions of feet and trunk only, ideal motors clamped to the torque limits,
control at 1 kHz with zero-order hold, physics at 0.25 ms. 1.0 s of settling, one impulse, 1.5 s until the outcome is read. Bodies
come from robots/go1/go1.urdf, the control law is written from docs/method.md. SI units, radians, legs FR FL RR RL.
"""

import argparse
import json
import pathlib
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np

URDF = pathlib.Path(__file__).resolve().parents[2] / "robots/go1/go1.urdf"
PARTS = ("hip", "thigh", "calf")
LEGS, SIDE, FRONT = ["FR", "FL", "RR", "RL"], np.array([-1, 1, -1, 1.0]), np.array([1, 1, -1, -1.0])
ABDUCTION, THIGH, CALF, FOOT_RADIUS = 0.08, 0.213, 0.213, 0.02
STANCE = np.array([0.0, 0.14, -0.25])
KP, KD, KD_JOINT, K_ATT = 400.0, 8.0, 0.8, 200.0
CORNERS = np.array([FRONT, SIDE, np.zeros(4)])
TERMS = dict(
    attitude_rate_gain=30.0,
    foot_placement_s=0.08,
    landing=dict(cutoff="foot", cutoff_lost_s=0.02, spread_m=0.04, spread_s=0.3),
)
# The controller without added terms.
PAPER = dict(
    attitude_rate_gain=0.0, foot_placement_s=0.0, landing=dict(cutoff="none", cutoff_lost_s=0.02, spread_m=0.0, spread_s=0.3)
)
BOUNDS = dict(f0_hz=(0.75, 1.75), along_n=(0, 150), up_n=(150, 350))
TASKS = ["forward", "lateral-left", "twist-ccw"]


def joint_limits(attribute):
    """Limits of the joints by the URDF: `effort`, N m, or `velocity`, rad/s."""
    joints = {joint.find("child").get("link"): joint for joint in ElementTree.parse(URDF).getroot().findall("joint")}
    return np.array([float(joints[f"{leg}_{part}"].find("limit").get(attribute)) for leg in LEGS for part in PARTS])


def model():
    urdf = ElementTree.parse(URDF).getroot()
    links = {link.get("name"): link for link in urdf.findall("link")}
    joints = {joint.find("child").get("link"): joint for joint in urdf.findall("joint")}

    def inertial(name):
        found = links[name].find("inertial")
        i = found.find("inertia")
        full = " ".join(i.get(axes) for axes in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
        origin, mass = found.find("origin").get("xyz"), found.find("mass").get("value")
        return f'<inertial pos="{origin}" mass="{mass}" fullinertia="{full}"/>'

    def shape(collision):
        origin, geometry = collision.find("origin").get("xyz"), collision.find("geometry")[0]
        if geometry.tag == "box":
            half = " ".join(str(float(side) / 2) for side in geometry.get("size").split())
            return f'<geom type="box" pos="{origin}" size="{half}"/>'
        radius, length = geometry.get("radius"), geometry.get("length")
        half = f"{radius} {float(length) / 2}" if length else radius
        return f'<geom type="{geometry.tag}" pos="{origin}" size="{half}"/>'

    legs, motors = "", ""
    for leg in LEGS:
        names = [f"{leg}_{part}" for part in PARTS]
        for name in names:
            joint = joints[name]
            limit = joint.find("limit")
            bounds = f'{limit.get("lower")} {limit.get("upper")}'
            legs += f'<body pos="{joint.find("origin").get("xyz")}">{inertial(name)}'
            legs += f'<joint name="{name}" axis="{joint.find("axis").get("xyz")}" range="{bounds}"/>'
            motors += f'<motor joint="{name}"/>'
        legs += f'<geom name="{leg}" type="sphere" size="{FOOT_RADIUS}" pos="0 0 -{CALF}"/></body></body></body>'
    trunk = "".join(shape(collision) for collision in links["trunk"].findall("collision"))
    text = f"""<mujoco><compiler angle="radian" autolimits="true"/>
<option timestep="0.00025" cone="elliptic" impratio="10" gravity="0 0 -9.81"/>
<default><geom friction="1 0 0" condim="3" solref="0.002 1" solimp="0.98 0.999 0.0005"/><joint solreflimit="0.004 1"/></default>
<worldbody><geom type="plane" size="50 50 .1"/><body name="trunk" pos="0 0 1">{inertial("trunk")}<freejoint/>
{trunk}{legs}</body></worldbody><actuator>{motors}</actuator></mujoco>"""
    return mujoco.MjModel.from_xml_string(text), joint_limits("effort")


def foot(q, side):
    """Position and Jacobian of a foot in the leg frame."""
    s1, c1, s2, c2 = np.sin(q[0]), np.cos(q[0]), np.sin(q[1]), np.cos(q[1])
    s23, c23 = np.sin(q[1] + q[2]), np.cos(q[1] + q[2])
    a, w, d = THIGH * c2 + CALF * c23, THIGH * s2 + CALF * s23, side * ABDUCTION
    position = np.array([-w, d * c1 + s1 * a, d * s1 - c1 * a])
    jacobian = [[0, -a, -CALF * c23], [-d * s1 + c1 * a, -s1 * w, -CALF * s1 * s23], [d * c1 + s1 * a, c1 * w, CALF * c1 * s23]]
    return position, np.array(jacobian)


def stance():
    """Joint angles of the stance."""
    found = []
    for side in SIDE:
        q = np.array([0.0, 0.8, -1.6])
        for _ in range(100):
            position, jacobian = foot(q, side)
            q = q + np.linalg.solve(jacobian, STANCE * [1, side, 1] - position)
        found.append(q)
    return np.concatenate(found)


def amplitude(case, leg):
    signs = {"forward": 0.0, "lateral-left": 1.0, "twist-ccw": FRONT[leg]}
    return np.array([case["Fx_n"], signs[case["task"]] * case["Fy_n"], case["Fz_n"]])


def ideal_motors(demanded, speed, limits):
    return np.clip(demanded, -limits, limits)


def exact_sensors(*state):
    return state


def touching(d, leg_of):
    """The feet with a contact point."""
    contact = np.zeros(4, bool)
    for geom in d.contact.geom.flatten():
        if geom in leg_of:
            contact[leg_of[geom]] = True
    return contact


def foot_loads(m, d, leg_of):
    """Normal forces on the feet, N."""
    loads, force = np.zeros(4), np.zeros(6)
    for number, pair in enumerate(d.contact.geom):
        for geom in pair:
            if geom in leg_of:
                mujoco.mj_contactForce(m, d, number, force)
                loads[leg_of[geom]] += force[0]
    return loads


def jump(m, limits, case, terms, motors=ideal_motors, sensors=exact_sensors, control=None):
    """One jump, or `jumps` of the case in a row with the frequency `f1_hz` between them. `motors` gives the torques of a physics step
    from demanded torques and joint speeds; `sensors` what the controller reads of joint positions and speeds and of the trunk's angular
    and linear velocity in its own frame. With `control`, the content of config/control.toml, contact and end of the trial are those of
    quadfrog: a foot is down by its mean load of a tick, and the outcome is read at rest; a robot that does not come to rest fell."""
    landing = terms["landing"]
    d = mujoco.MjData(m)
    d.qpos[:7] = [0, 0, -STANCE[2] + FOOT_RADIUS, 1, 0, 0, 0]
    d.qpos[7:] = stance()
    mujoco.mj_forward(m, d)
    leg_of = {m.geom(name).id: leg for leg, name in enumerate(LEGS)}
    start, impulse = 1.0, 0.5 / case["f0_hz"]
    period = impulse + 0.5 / case.get("f1_hz", 1.0)
    end = start + (case.get("jumps", 1) - 1) * period + impulse
    expect = dict(fell=False, takeoff_s=None, apex_rise_m=0.0)
    yaw, last_yaw, origin, airborne = 0.0, 0.0, None, 0
    swing, lost, landed = np.zeros(4, bool), np.zeros(4, int), [None] * 4
    loads, quiet, steps = np.zeros(4), 0, round(0.001 / m.opt.timestep)
    longest_s = control["settle"]["cap_s"] if control else 1.5
    for tick in range(int(round((end + longest_s) * 1000))):
        t = tick * 0.001
        rotation = d.xmat[1].reshape(3, 3)
        contact = loads >= control["contact"]["force_n"] if control else touching(d, leg_of)
        roll, pitch = np.arctan2(rotation[2, 1], rotation[2, 2]), -np.arcsin(np.clip(rotation[2, 0], -1, 1))
        heading = np.arctan2(rotation[1, 0], rotation[0, 0])
        yaw += (heading - last_yaw + np.pi) % (2 * np.pi) - np.pi
        last_yaw = heading
        if origin is None and t >= start - 1e-9:
            origin, initial_yaw = d.qpos[:3].copy(), yaw
        if control and t >= end:
            speed, rate = np.linalg.norm(d.qvel[:3]), np.linalg.norm(d.qvel[3:6])
            settle = control["settle"]
            quiet = quiet + 1 if contact.all() and speed < settle["speed_m_s"] and rate < settle["rate_rad_s"] else 0
            if quiet >= 1000 * settle["quiet_s"]:
                break
        since = (t - start) % period if start - 1e-9 <= t < end else -1.0
        theta = np.pi + 2 * np.pi * case["f0_hz"] * max(since, 0.0)
        force = np.sin(theta) if -1e-9 <= since < impulse else 0.0
        if t > start:
            airborne = 0 if contact.any() else airborne + 1
            if airborne >= 20:
                swing[:] = True
            swing &= ~contact
            lost = np.where(contact, 0, lost + 1)
            landed = [0 if s else None if n is None else n + 1 for s, n in zip(swing, landed)]
        q, speed, omega, velocity = sensors(d.qpos[7:], d.qvel[6:], d.qvel[3:6], rotation.T @ d.qvel[:3])
        tau = np.zeros(12)
        for leg in range(4):
            k = slice(3 * leg, 3 * leg + 3)
            dq = speed[k]
            position, jacobian = foot(q[k], SIDE[leg])
            desired = STANCE * [1, SIDE[leg], 1]
            if swing[leg]:
                desired[:2] += terms["foot_placement_s"] * velocity[:2]
            share = 0.0 if landed[leg] is None else max(0.0, 1 - 0.001 * landed[leg] / landing["spread_s"])
            desired[1] += share * landing["spread_m"] * SIDE[leg]
            f = KP * (desired - position) - KD * (jacobian @ dq)
            cut = landing["cutoff"] == "foot" and theta > 1.25 * np.pi and lost[leg] >= 1000 * landing["cutoff_lost_s"]
            if force < 0 and not cut:
                f = f + amplitude(case, leg) * force
            if contact[leg]:
                f[2] += K_ATT * (rotation @ CORNERS)[2, leg]
                f[2] += terms["attitude_rate_gain"] * np.cross(omega, CORNERS[:, leg])[2]
            tau[k] = jacobian.T @ f - KD_JOINT * dq
        if origin is not None:
            expect["apex_rise_m"] = max(expect["apex_rise_m"], float(d.qpos[2] - origin[2]))
            if expect["takeoff_s"] is None and not contact.any():
                expect["takeoff_s"] = t - start
            expect["fell"] |= bool(abs(roll) > 1.0 or abs(pitch) > 1.0)
        loads[:] = 0
        for _ in range(steps):
            d.ctrl[:] = motors(tau, d.qvel[6:], limits)
            mujoco.mj_step(m, d)
            if control:
                loads += foot_loads(m, d, leg_of) / steps
    else:
        expect["fell"] |= control is not None
    expect.update(displacement_m=(d.qpos[:3] - origin).tolist(), yaw_change_rad=float(yaw - initial_yaw))
    return expect


def read_arguments(description, seed, cases):
    """File to write, seed and number of cases of the command line."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument("--cases", type=int, default=cases)
    return parser.parse_args()


def write(output, description, cases):
    """Writes a golden file."""
    head = dict(
        note=" ".join(description.split()),
        stance_m=dict(zip("xyz", STANCE.tolist())),
        gains=dict(kp=KP, kd=KD, kd_joint=KD_JOINT, k_att=K_ATT),
        floor_friction=1.0,
    )
    output.write_text(json.dumps(dict(head, cases=cases)) + "\n")


def main():
    arguments = read_arguments(__doc__, seed=20261122, cases=12)
    m, limits = model()
    random, cases = np.random.default_rng(arguments.seed), []
    for number in range(arguments.cases):
        task = TASKS[number % 3]
        f0, along, up = (random.uniform(*BOUNDS[name]) for name in ("f0_hz", "along_n", "up_n"))
        case = dict(task=task, f0_hz=f0, Fx_n=along * (task == "forward"), Fy_n=along * (task != "forward"), Fz_n=up)
        case.update(terms=TERMS, expect=jump(m, limits, case, TERMS))
        cases.append(case)
        print(task, case["expect"], flush=True)
    write(arguments.output, __doc__, cases)


if __name__ == "__main__":
    main()
