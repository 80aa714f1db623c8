"""The same table as examples/compare_samplers.rs, of Python's Optuna: compare_optuna.py [SEEDS]."""

import math
import sys

import optuna

optuna.logging.set_verbosity(optuna.logging.ERROR)

ALPHA = [1.0, 1.2, 3.0, 3.2]
A = [[10.0, 3.0, 17.0, 3.5], [0.05, 10.0, 17.0, 0.1], [3.0, 3.5, 1.7, 10.0], [17.0, 8.0, 0.05, 10.0]]
P = [
    [0.1312, 0.1696, 0.5569, 0.0124],
    [0.2329, 0.4135, 0.8307, 0.3736],
    [0.2348, 0.1451, 0.3522, 0.2883],
    [0.4047, 0.8828, 0.8732, 0.5743],
]


def sphere(u):
    return -sum((x - c) ** 2 for x, c in zip(u, (0.35, 0.6, 0.4, 0.55)))


def ridge(u):
    u1, u2, u3, u4 = u
    return (0.4 + u1) * (0.3 + u2) / (
        0.3 + u2**2 + 0.5 * (u3 - 0.3) ** 2 + 4.0 * (u4 - 0.3 - 0.5 * u1) ** 2 + 0.6 * u1**2
    )


def hartmann(u):
    bumps = (ALPHA[i] * math.exp(-sum(A[i][j] * (u[j] - P[i][j]) ** 2 for j in range(4))) for i in range(4))
    return (sum(bumps) - 1.1) / 0.839


def edge(u):
    push = 1.2 * u[0] + u[1] - 0.3 * u[3]
    detour = (u[2] - 0.5) ** 2 + 0.5 * (u[3] - 0.6) ** 2
    return 0.0 if push > 1.1 else 0.2 + 0.5 * push - 0.4 * detour


def pocket(u):
    distance = sum((x - c) ** 2 for x, c in zip(u, (0.55, 0.4, 0.5, 0.6)))
    return 0.0 if distance > 0.16 else 0.3 + 0.5 * u[0] + 0.3 * u[1] - 0.3 * (u[2] - 0.4) ** 2


RANGES = {"f0": (0.75, 1.75), "Fx": (0.0, 150.0), "Fy": (0.0, 150.0), "Fz": (150.0, 350.0)}


def run(sampler, function):
    study = optuna.create_study(direction="maximize", sampler=sampler)
    values = []
    for _ in range(50):
        trial = study.ask({n: optuna.distributions.FloatDistribution(*r) for n, r in RANGES.items()})
        u = [(trial.params[n] - low) / (high - low) for n, (low, high) in RANGES.items()]
        values.append(function(u))
        study.tell(trial, values[-1])
    return max(values[:20]), max(values), sum(v == 0.0 for v in values[:20])


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 24
    samplers = {
        f"Optuna {optuna.__version__} TPE multivariate": lambda s: optuna.samplers.TPESampler(seed=s),
        f"Optuna {optuna.__version__} TPE univariate": lambda s: optuna.samplers.TPESampler(seed=s, multivariate=False),
    }
    for name, sampler in samplers.items():
        cells = []
        for function, falls in ((sphere, 0), (ridge, 0), (hartmann, 0), (edge, 1), (pocket, 1)):
            runs = [run(sampler(s), function) for s in range(seeds)]
            at20, at50, fell = (sum(column) / seeds for column in zip(*runs))
            cells.append(f"{at20:.4f} / {at50:.5f}" + (f" ({fell:.1f})" if falls else ""))
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
