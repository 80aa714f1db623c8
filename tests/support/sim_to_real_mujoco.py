#!/usr/bin/env python3
"""Studies of quadfrog's samplers on robots in MuJoCo: another contact law than that of the prior's simulated robots.

    pip install mujoco numpy
    python3 tests/support/sim_to_real_mujoco.py target/release/quadfrog --tasks forward,twist-ccw --samplers sim,gp --studies 3

Each study speaks with `quadfrog ask-tell`. Its robot is the Go1 of reference_landing.py with the controller of the paper, the motors of
reference_motors.py, noise on joints and gyroscope, and a friction and a mass of its own, drawn with the study's seed. Contact, end and
value of a jump are those of quadfrog's trials (config/control.toml). Prints a JSON line for each study: the value of the best trial after
1, 3, 5, 10 and 20 jumps, jumped three times with other noise, falls as 0 and counted; the point and value of each jump, null for a fall,
and with which probability the sampler `sim` expected it to stand. `--joints` gives the robots the rotors of the Go1, and dry and viscous
friction of the joints drawn from the ranges of config/prior.toml. The task `continuous` is five jumps forward in a row, its value their
mean length; `--config` is then a folder with that task, as examples/continuous without its first point. SI units, radians.
"""

import argparse
import json
import subprocess

import numpy as np
from reference_landing import PAPER, jump, model
from reference_motors import CONTROL, RANGES, Motors, add_joints

AFTER = [1, 3, 5, 10, 20]
IN_A_ROW = 5


class Robot:
    """A Go1 in MuJoCo with motors and sensors that are not ideal."""

    def __init__(self, seed, joints=False):
        random = np.random.default_rng(seed)
        self.m, self.limits = model()
        self.friction, self.mass = random.uniform(0.5, 0.9), random.uniform(0.95, 1.1)
        self.lag_s, self.full_torque_share = random.uniform(0.002, 0.006), random.uniform(0.5, 0.7)
        self.m.geom_friction[:, 0] = self.friction
        self.m.body_mass[:] *= self.mass
        self.m.body_inertia[:] *= self.mass
        if joints:
            random = np.random.default_rng(seed + 1_000_000)
            add_joints(self.m, random.uniform(*RANGES["dry_friction_nm"]), random.uniform(*RANGES["viscous_friction_nm_s"]))

    def value(self, task, params, seed):
        """Objective of a jump, none for a fall."""
        random = np.random.default_rng(seed)
        motors = Motors(self.lag_s, self.full_torque_share, self.m.opt.timestep)

        def sensors(q, speed, omega, velocity):
            noise = lambda size, deviation: random.normal(0, deviation, size)
            return q + noise(12, 0.001), speed + noise(12, 0.1), omega + noise(3, 0.02), velocity

        case = dict(f0_hz=params["f0"], Fx_n=params.get("Fx", 0.0), Fy_n=params.get("Fy", 0.0), Fz_n=params["Fz"])
        if task == "continuous":
            case.update(task="forward", f1_hz=params["f1"], jumps=IN_A_ROW)
        else:
            case.update(task=task)
        outcome = jump(self.m, self.limits, case, PAPER, motors, sensors, CONTROL)
        if outcome["fell"]:
            return None
        x, y, _ = outcome["displacement_m"]
        return {"forward": x, "lateral-left": y, "continuous": x / IN_A_ROW}.get(task, outcome["yaw_change_rad"])


def study(program, task, sampler, seed, config, jumps, joints):
    robot = Robot(seed, joints)
    command = [program, "ask-tell", "--task", "forward" if task == "continuous" else task, "--sampler", sampler, "--seed", str(seed)]
    talk = subprocess.Popen(command + (["--config", config] if config else []), stdin=-1, stdout=-1, text=True)

    def say(message):
        talk.stdin.write(json.dumps(message) + "\n")
        talk.stdin.flush()
        return json.loads(talk.stdout.readline())

    trials, best, falls, known, expected = [], [], [], {}, []
    for number in range(jumps):
        asked = say({"ask": {}})
        value = robot.value(task, asked["params"], 1000 * seed + number)
        verdict = "fall" if value is None else "accept"
        say({"tell": {"number": asked["number"], "value": value or 0.0, "verdict": verdict}})
        trials.append((asked["params"], value))
        expected.append(asked.get("p_stand"))
        if number + 1 in AFTER:
            chosen = say({"best": {}}).get("number", 0)
            if chosen not in known:
                again = [robot.value(task, trials[chosen][0], 1000 * seed + 500 + i) for i in range(3)]
                known[chosen] = float(np.mean([value or 0.0 for value in again]))
            best.append(round(known[chosen], 4))
            falls.append(sum(value is None for _, value in trials))
    talk.stdin.close()
    talk.wait()
    robot = dict(friction=robot.friction, mass=robot.mass, lag_s=robot.lag_s, full_torque_share=robot.full_torque_share)
    after, points, values = AFTER[: len(best)], [params for params, _ in trials], [value for _, value in trials]
    found = dict(after=after, best=best, falls=falls, points=points, values=values, p_stand=expected)
    return dict(task=task, sampler=sampler, seed=seed, **found, robot=robot)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--tasks", default="forward,lateral-left,twist-ccw")
    parser.add_argument("--samplers", default="sim,gp")
    parser.add_argument("--studies", type=int, default=3)
    parser.add_argument("--seed", type=int, default=7000)
    parser.add_argument("--jumps", type=int, default=AFTER[-1])
    parser.add_argument("--config")
    parser.add_argument("--joints", action="store_true")
    arguments = parser.parse_args()
    for task in arguments.tasks.split(","):
        for seed in range(arguments.seed, arguments.seed + arguments.studies):
            for sampler in arguments.samplers.split(","):
                outcome = study(arguments.program, task, sampler, seed, arguments.config, arguments.jumps, arguments.joints)
                print(json.dumps(outcome), flush=True)


if __name__ == "__main__":
    main()
