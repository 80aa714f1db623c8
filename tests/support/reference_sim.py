#!/usr/bin/env python3
"""Reference predictions of the sampler `sim` by dense linear algebra; writes tests/golden/sim_prior.json.

    pip install numpy
    python3 tests/support/reference_sim.py tests/golden/sim_prior.json

Written from the equations of src/optimize/README.md, "Simulated robots as the prior", not from the Rust sources: inverse matrices
in place of factors, a pattern search in place of a gradient ascent, expectation propagation with all factors changed at once, by
half, and their moments by quadrature, in place of one after the other in closed form. Points, worlds and trials are made here; the hyperparameters of the surfaces are given.
"""

import json
import math
import sys

import numpy as np

NAMES, LOW, HIGH = ["Fx", "Fz"], np.array([0.0, 150.0]), np.array([150.0, 350.0])
VALUE_THETA = np.log([0.8, 1.1, 1.3, 0.01])
LABEL_THETA = np.log([0.6, 0.9, 1.0, 0.05])
WIDTH = 1.702


def matern(a, b, lengthscale):
    difference = (a[:, None] - b[None]) / lengthscale
    q = np.sqrt(5.0 * (difference**2).sum(2))
    return (1 + q + q * q / 3) * np.exp(-q)


def sobol(count, seed):
    """First two coordinates of the sequence with a digital shift of the seed's two doubles."""
    shift = [int(u * 4294967295.0) for u in np.random.RandomState(seed).random_sample(2)]
    v = [[1 << (31 - i) for i in range(32)], [1 << 31]]
    for i in range(1, 32):
        v[1].append(v[1][i - 1] ^ (v[1][i - 1] >> 1))
    points = np.zeros((count, 2))
    for n in range(count):
        gray = n ^ (n >> 1)
        for c in range(2):
            x = shift[c]
            for j in range(32):
                if gray >> j & 1:
                    x ^= v[c][j]
            points[n, c] = x / 2.0**32
    return points


def surface(points, y, theta):
    """Mean function of a Gaussian process with a constant term of variance 1."""
    lengthscale, signal, noise = np.exp(theta[:2]), np.exp(theta[2]), np.exp(theta[3])
    covariance = lambda a, b: signal * matern(a, b, lengthscale) + 1.0
    weights = np.linalg.inv(covariance(points, points) + noise * np.eye(len(y))) @ y
    return lambda x: covariance(x, points) @ weights


def reserve(x):
    fx, fz = (LOW + x * (HIGH - LOW)).T
    return (0.5 - np.minimum(fx / fz, 2.0)) / 0.15


def logistic(rows, target):
    w = np.zeros(rows.shape[1])
    for _ in range(200):
        p = 1 / (1 + np.exp(-rows @ w))
        hessian = (rows * (p * (1 - p))[:, None]).T @ rows + np.eye(3) / 9
        w = w + 0.5 * np.linalg.solve(hessian, rows.T @ (target - p) - w / 9)
    return w


def maximize(f, start, bounds):
    """Pattern search with shrinking steps along the axes and their diagonals."""
    x, best, step = np.array(start), f(np.array(start)), 0.5
    axes = [np.array(a) for a in np.ndindex(3, 3, 3, 3)]
    axes = [a - 1.0 for a in axes if (np.array(a) != 1).any()]
    while step > 1e-7:
        moved = False
        for a in axes:
            y = np.clip(x + step * a, bounds[:, 0], bounds[:, 1])
            value = f(y)
            if value > best:
                x, best, moved = y, value, True
        if not moved:
            step *= 0.5
    return x, best


def cdf(z):
    return 0.5 * math.erfc(-z / math.sqrt(2))


def propagate(k, mean, signs):
    """Precisions and means of the normal factors that stand for Phi(sign f / WIDTH)."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    tau, nu = np.zeros(len(mean)), np.zeros(len(mean))
    for _ in range(200):
        posterior = np.linalg.inv(np.linalg.inv(k) + np.diag(tau))
        centre = posterior @ (np.linalg.solve(k, mean) + nu)
        without = 1 / posterior.diagonal() - tau
        around = (centre / posterior.diagonal() - nu) / without
        for i, sign in enumerate(signs):
            f = around[i] + 12 / np.sqrt(without[i]) * nodes
            density = weights * np.exp(-0.5 * without[i] * (f - around[i]) ** 2) * [cdf(sign * v / WIDTH) for v in f]
            density /= density.sum()
            first = density @ f
            second = density @ (f - first) ** 2
            tau[i] += 0.5 * (1 / second - without[i] - tau[i])
            nu[i] += 0.5 * (first / second - without[i] * around[i] - nu[i])
    return tau, nu / tau


class Ensemble:
    def __init__(self, points, worlds):
        self.values, self.labels = [], []
        for world in worlds:
            stood = np.array([v is not None for v in world])
            y = np.array([v for v in world if v is not None])
            fit = surface(points[stood], (y - y.mean()) / y.std(), VALUE_THETA)
            self.values.append(lambda x, fit=fit, y=y: y.mean() + y.std() * fit(x))
            fit = surface(points, np.where(stood, 1.0, -1.0), LABEL_THETA)
            self.labels.append(lambda x, fit=fit: np.clip(fit(x), -1.3, 1.3))
        z = sobol(1024, 3)
        v, g = self.raw(z)
        self.offset, self.scale = v.mean(), v.std(1).mean()
        components = lambda d: np.linalg.svd(d - d.mean(0), full_matrices=False)[0][:, : min(len(d) - 1, 3)]
        self.a, self.b = components(v / self.scale), components(g)
        fits = []
        for k in range(len(worlds)):
            rows = np.stack([np.ones(len(z)), np.delete(g, k, 0).mean(0), reserve(z)], 1)
            fits.append(logistic(rows, np.where(g[k] > 0, 0.98, 0.02)))
        fits = np.array(fits)
        self.mean, self.covariance = fits.mean(0), 2.25 * np.cov(fits.T) + np.diag(np.square([1.5, 0.7, 0.5]))

    def raw(self, x):
        return np.array([f(x) for f in self.values]), np.array([f(x) for f in self.labels])

    def terms(self, x):
        v, g = self.raw(x)
        one = np.ones(len(x))
        value = [one, (v.mean(0) - self.offset) / self.scale, *(self.a.T @ (v - v.mean(0)) / self.scale)]
        standing = [one, g.mean(0), reserve(x), *(self.b.T @ (g - g.mean(0)))]
        return np.stack(value, 1), np.stack(standing, 1)

    def shares(self, point, stood, y):
        """Share of each world in the label: 0.3 / n, and 0.7 by the root of its likelihood."""
        v, g = self.raw(point)
        b0, b1, b2 = self.mean
        p = np.clip(1 / (1 + np.exp(-(b0 + b1 * g + b2 * reserve(point)))), 0.0, 1.0)
        labels = np.log(np.maximum(np.where(stood, p, 1 - p), 0.02)).sum(1)
        n, x = stood.sum(), point[stood]
        covariance = np.exp(-2) * matern(x, x, np.full(2, np.exp(-0.35))) + 0.25 + np.exp(-6) * np.eye(n)
        residual = y - (v[:, stood] - self.offset) / self.scale
        fit = -0.5 * (residual @ np.linalg.inv(covariance) * residual).sum(1)
        likelihood = np.exp(labels + fit - (labels + fit).max())
        return 0.3 / len(v) + 0.7 * np.sqrt(likelihood) / np.sqrt(likelihood).sum()


def predict(ensemble, trials, x):
    point = np.array([t["unit"] for t in trials])
    stood = np.array([not t["fell"] for t in trials])
    y = (np.array([t["value"] for t in trials])[stood] - ensemble.offset) / ensemble.scale
    h, c = ensemble.terms(point)
    hx, cx = ensemble.terms(x)
    shares = ensemble.shares(point, stood, y)
    c[:, 1], cx[:, 1] = shares @ ensemble.raw(point)[1], shares @ ensemble.raw(x)[1]
    # value
    r = ensemble.a.shape[1]
    mean, variance = np.array([0, 1.0] + [0] * r), np.array([0.25, 0.09] + [2.0 / r] * r)
    xs, hs = point[stood], h[stood]
    median, width = np.array([-0.35, -0.35, -2, -6]), np.array([0.5, 0.5, 1, 1.5])
    bounds = np.log([[0.05, 20], [0.05, 20], [1e-4, 20], [1e-6, 0.5]])

    def covariance(theta):
        k = np.exp(theta[2]) * matern(xs, xs, np.exp(theta[:2]))
        return k + (hs * variance) @ hs.T + np.exp(theta[3]) * np.eye(len(y))

    def posterior(theta):
        k, residual = covariance(theta), y - hs @ mean
        sign, determinant = np.linalg.slogdet(k)
        fit = -0.5 * residual @ np.linalg.solve(k, residual) - 0.5 * determinant - 0.5 * len(y) * np.log(2 * np.pi)
        return fit - 0.5 * (((theta - median) / width) ** 2).sum() if sign > 0 else -np.inf

    starts = median, np.array([-1.15, -1.15, -2, -4.5])
    theta, _ = max((maximize(posterior, start, bounds) for start in starts), key=lambda s: s[1])
    inverse = np.linalg.inv(covariance(theta))
    k = np.exp(theta[2]) * matern(x, xs, np.exp(theta[:2])) + (hx * variance) @ hs.T
    value = hx @ mean + k @ inverse @ (y - hs @ mean)
    spread = np.exp(theta[2]) + (hx * hx * variance).sum(1) - (k @ inverse * k).sum(1)
    # standing
    r = ensemble.b.shape[1]
    mean, spreads = np.r_[ensemble.mean, [0] * r], np.diag([8.0 / r] * (3 + r))
    spreads[:3, :3] = ensemble.covariance
    kernel = lambda a, ha, b, hb: 3.0 * matern(a, b, np.full(2, 0.4)) + ha @ spreads @ hb.T
    m, centre = propagate(kernel(point, c, point, c), c @ mean, np.where(stood, 1.0, -1.0))
    k = kernel(x, cx, point, c)
    inverse = np.linalg.inv(kernel(point, c, point, c) + np.diag(1 / m))
    latent = cx @ mean + k @ inverse @ (centre - c @ mean)
    uncertainty = kernel(x, cx, x, cx).diagonal() - (k @ inverse * k).sum(1)
    chance = np.array([cdf(q) for q in latent / np.sqrt(WIDTH**2 + uncertainty)])
    worlds = ensemble.raw(x)[0]
    return [
        dict(unit=list(u), value=float(v), deviation=float(s), p_stand=float(q), worlds=[float(lo), float(hi)])
        for u, v, s, q, lo, hi in zip(
            x.tolist(),
            ensemble.offset + ensemble.scale * value,
            ensemble.scale * np.sqrt(spread),
            chance,
            worlds.min(0),
            worlds.max(0),
        )
    ]


def main():
    rng = np.random.RandomState(20261122)
    points = rng.random_sample((40, 2))

    def jump(u, gain, curve, grip):
        fx, fz = LOW + u * (HIGH - LOW)
        value = gain * (0.2 + u[0] * (0.6 + 0.4 * u[1])) - curve * (u[1] - 0.5) ** 2
        return None if fx / fz > grip else float(value)

    robots = [(0.9, 0.3, 0.45), (1.1, 0.2, 0.55), (1.0, 0.5, 0.5), (1.2, 0.1, 0.4)]
    worlds = [[jump(u, *robot) for u in points] for robot in robots]
    trials = []
    for u in rng.random_sample((9, 2)):
        value = jump(u, 0.8, 0.4, 0.42)
        noise = 0.01 * rng.standard_normal()
        trials.append(dict(unit=u.tolist(), fell=value is None, value=0.0 if value is None else value + noise))
    ensemble = Ensemble(points, worlds)
    queries = rng.random_sample((8, 2))
    golden = dict(
        prior=dict(
            parameters=[dict(name=n, low=lo, high=hi) for n, lo, hi in zip(NAMES, LOW, HIGH)],
            points=points.tolist(),
            worlds=[dict(name=f"world {k + 1}", values=values) for k, values in enumerate(worlds)],
            slip=dict(horizontal=["Fx"], vertical="Fz"),
            hyperparameters=dict(value=VALUE_THETA.tolist(), label=LABEL_THETA.tolist()),
        ),
        trials=trials,
        after=[dict(trials=n, predictions=predict(ensemble, trials[:n], queries)) for n in (4, 9)],
    )
    with open(sys.argv[1], "w") as file:
        json.dump(golden, file, indent=1)
        file.write("\n")


main()
