#!/usr/bin/env python3
"""Reference jumps of robots like those of a prior in MuJoCo; writes tests/golden/jumps_motors.json.

    pip install mujoco numpy
    python3 tests/support/reference_motors.py tests/golden/jumps_motors.json --seed 20261128 --cases 30

Protocol: that of reference_landing.py with the paper's controller, but contact and end of a jump are those of quadfrog's trials
(config/control.toml): a foot is down by its mean load of a tick, and the outcome is read at rest. Each robot has a mass, a friction of the
floor and motors of its own, with rotors, drawn from the ranges of config/prior.toml; states are read exactly and without delay. Jumps
that stand or fall by the step of the physics (0.25 or 0.125 ms) are left out. SI units, radians, legs FR FL RR RL.
"""

import tomllib

import numpy as np
from reference_landing import BOUNDS, LEGS, PAPER, TASKS, URDF, joint_limits, jump, model, read_arguments, write

ROOT = URDF.parents[2]
CONTROL = tomllib.loads((ROOT / "config/control.toml").read_text())
RANGES = tomllib.loads((ROOT / "config/prior.toml").read_text())["ranges"]


class Motors:
    """Motors with a torque-speed curve and a lag; a call is one step of the physics."""

    def __init__(self, lag_s, full_torque_speed_share, step_s):
        self.reached, self.full_torque_speed_share = 1 - np.exp(-step_s / lag_s), full_torque_speed_share
        self.no_load_speed, self.torque = joint_limits("velocity"), np.zeros(12)

    def __call__(self, demanded, speed, limits):
        torque = self.torque + self.reached * (np.clip(demanded, -limits, limits) - self.torque)
        share = np.clip((1 - np.abs(speed) / self.no_load_speed) / (1 - self.full_torque_speed_share), 0, 1)
        # The curve limits the torque that drives, not the one that brakes.
        most = np.where(torque * speed > 0, share * limits, limits)
        self.torque = np.clip(torque, -most, most)
        return self.torque


def add_joints(m, dry_friction_nm, viscous_friction_nm_s):
    """Adds rotors and friction to the joints."""
    rotor = tomllib.loads((ROOT / "robots/go1/robot.toml").read_text())["motor"]
    # The trunk has the first six degrees of freedom.
    m.dof_armature[6:] = np.tile(np.square(rotor["gear_ratio"]) * rotor["rotor_inertia_kgm2"], len(LEGS))
    m.dof_frictionloss[6:] = dry_friction_nm
    m.dof_damping[6:] = viscous_friction_nm_s


def outcome(case, step_s):
    """The jump of a case with steps of `step_s`."""
    (m, limits), robot = model(), case["robot"]
    m.opt.timestep = step_s
    m.geom_friction[:, 0] = robot["friction"]
    m.body_mass[:] *= robot["mass"]
    m.body_inertia[:] *= robot["mass"]
    m.body("trunk").inertia *= robot["inertia"]
    add_joints(m, robot["dry_friction_nm"], robot["viscous_friction_nm_s"])
    motors = Motors(robot["torque_lag_s"], robot["full_torque_speed_share"], step_s)
    return jump(m, limits * robot["torque_limit"], case, PAPER, motors, control=CONTROL)


def draw(random, number):
    """A jump of a robot within the ranges of config/prior.toml."""
    robot = {name: float(random.uniform(*RANGES[name])) for name in sorted(RANGES) if name != "delay_ms"}
    f0, along, up = (float(random.uniform(*BOUNDS[name])) for name in ("f0_hz", "along_n", "up_n"))
    task = TASKS[number % len(TASKS)]
    return dict(task=task, f0_hz=f0, Fx_n=along * (task == "forward"), Fy_n=along * (task != "forward"), Fz_n=up, robot=robot)


def main():
    arguments = read_arguments(__doc__, seed=20261128, cases=30)
    random, cases, left_out = np.random.default_rng(arguments.seed), [], 0
    while len(cases) < arguments.cases:
        case = draw(random, len(cases))
        found, finer = (outcome(case, step_s) for step_s in (0.00025, 0.000125))
        if found["fell"] != finer["fell"]:
            left_out += 1
            continue
        cases.append(dict(case, expect=found))
        print(case["task"], found, flush=True)
    print(f"{left_out} left out")
    write(arguments.output, __doc__, cases)


if __name__ == "__main__":
    main()
