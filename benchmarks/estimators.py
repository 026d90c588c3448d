"""Measures the estimators: coverage of the 95 % intervals, error against the truth, time per update.

Run as `python benchmarks/estimators.py [runs]` (40 runs a row, the default, take about a minute and a half).
The loop is written here, apart from canid's own simulator: driver K1 4.4, tau1 0.685, theta1 0.3, K2 5.6,
tau2 0.4, theta2 0.2 (Grover 2021, case 1), vehicle v' = (0.8 (P - P0) - (v - v0)) / 20.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

from canid.estimators import ESTIMATORS
from canid.identification import armax_batch, armax_recursive, moments, process_fit
from canid.types import Gate, Sample

DT = 0.1
TRUTH = {"K1": 4.4, "tau1": 0.685, "theta1": 0.3, "K2": 5.6, "tau2": 0.4, "theta2": 0.2}


def colour(kind: str, n: int, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Noise of variance one."""

    def ou(T: float) -> np.ndarray:
        a, x, out = math.exp(-dt / T), rng.normal(), np.empty(n)
        w = rng.normal(size=n) * math.sqrt(1 - a * a)
        for k in range(n):
            x = a * x + w[k]
            out[k] = x
        return out

    if kind == "white":  # per sample of the 10 Hz grid
        return np.repeat(rng.normal(size=n // 10 + 1), 10)[:n]
    if kind == "OU + white":
        return math.sqrt(0.7) * ou(1.0) + math.sqrt(0.3) * colour("white", n, dt, rng)
    if kind == "resonant":
        w0, z, x, v, out = 2 * math.pi * 0.6, 0.15, 0.0, 0.0, np.empty(n)
        for k, f in enumerate(rng.normal(size=n)):
            v += dt * (-2 * z * w0 * v - w0 * w0 * x) + f
            x += dt * v
            out[k] = x
        return out / out.std()
    return ou(float(kind.split()[1]))


def closed_loop(seed: int, kind: str, T: float, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Pedal (n,) and inputs (n, 2) at 10 Hz, from a loop at 100 Hz."""
    rng, dt = np.random.default_rng(seed), 0.01
    n = round(T / dt)
    a, lead = math.exp(-2 * math.pi * 0.05 * dt), np.zeros(n + 6000)
    w = rng.normal(size=n + 6000)
    for k in range(2, n + 6000):
        lead[k] = 2 * a * lead[k - 1] - a * a * lead[k - 2] + w[k]
    lead = lead[6000:]
    lead = 25 + 1.5 * (lead - lead.mean()) / lead.std()
    noise = size * colour(kind, n, dt, rng)
    a1, a2 = math.exp(-dt / TRUTH["tau1"]), math.exp(-dt / TRUTH["tau2"])
    d1, d2 = round(TRUTH["theta1"] / dt), round(TRUTH["theta2"] / dt)
    v, gap, x1, x2 = 25.0, 45.0, 0.0, 0.0
    E, R, P = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(n):
        E[k], R[k] = gap / v - 1.8, lead[k] - v
        x1 = a1 * x1 + (1 - a1) * (0.5 * (E[k - d1] + E[k - d1 - 1]) if k > d1 else 0.0)
        x2 = a2 * x2 + (1 - a2) * (0.5 * (R[k - d2] + R[k - d2 - 1]) if k > d2 else 0.0)
        P[k] = 20 + TRUTH["K1"] * x1 + TRUTH["K2"] * x2 + noise[k]
        v += dt * (0.8 * (P[k] - 20) - (v - 25)) / 20
        gap += dt * (lead[k] - v)
    return P[::10], np.column_stack([E, R])[::10]


def open_loop(seed: int, kind: str, T: float, cut: float) -> tuple[np.ndarray, np.ndarray]:
    """One input of bandwidth `cut` Hz, K 4.4 tau 0.685 theta 0.3, noise 20 dB below."""
    rng, dt = np.random.default_rng(seed), 0.01
    n = round(T / dt)
    a, u = math.exp(-2 * math.pi * cut * dt), np.zeros(n + 3000)
    w = rng.normal(size=n + 3000)
    for k in range(2, n + 3000):
        u[k] = 2 * a * u[k - 1] - a * a * u[k - 2] + w[k]
    u = 0.3 * u[3000:] / u[3000:].std()
    x, y, al = 0.0, np.zeros(n), math.exp(-dt / 0.685)
    for k in range(31, n):
        x = al * x + (1 - al) * 0.5 * (u[k - 30] + u[k - 31])  # joined by lines
        y[k] = 4.4 * x
    y += 0.1 * y.std() * colour(kind, n, dt, rng)
    return y[::10], u[::10, None]


def row(label: str, told: list[tuple[float, float, float]], truth: float) -> str:
    """One line: how often told, how often right, how far off."""
    known = [i for i in told if math.isfinite(i[0])]
    if not known:
        return f"  {label:<26} told   0 %"
    cover = np.mean([low <= truth <= high for _, low, high in known])
    error = np.array([value for value, _, _ in known]) - truth
    width = np.median([high - low for _, low, high in known])
    return (
        f"  {label:<26} told {100 * len(known) / len(told):3.0f} %  covered {cover:.2f}"
        f"  bias {error.mean():+.3f}  rmse {math.sqrt(np.mean(error**2)):.3f}  median width {width:.3f}"
    )


def process(runs: int) -> None:
    """FOPDT over one window."""
    print("FOPDT, closed loop, 60 s at 10 Hz")
    kinds = [
        ("white", 1.0),
        ("OU 0.5", 1.0),
        ("OU 1", 1.0),
        ("OU 2", 1.0),
        ("OU + white", 1.0),
        ("resonant", 1.0),
    ]
    for kind, size in kinds:
        fits = []
        for seed in range(runs):
            y, u = closed_loop(seed, kind, 64.5, size)
            fits.append(process_fit.fit_process(y, u, np.full(len(y), True), DT))
        for i in (0, 1):
            for name, field in (("K", 0), ("tau", 1), ("theta", 2)):
                told = [tuple(f.channels[i][field]) for f in fits]
                print(row(f"{kind}: {name}{i + 1}", told, TRUTH[f"{name}{i + 1}"]))
        verdicts = [tuple(c.status.value for c in f.channels) for f in fits]
        print("   ", {v: verdicts.count(v) for v in sorted(set(verdicts))})
    print("FOPDT, open loop, one input, 60 s at 10 Hz, 20 dB")
    for kind, cut in (("white", 0.2), ("OU 0.5", 0.2), ("OU 2", 0.2), ("OU + white", 0.2), ("OU 0.5", 0.05)):
        fits = []
        for seed in range(runs):
            y, u = open_loop(seed, kind, 64.5, cut)
            fits.append(process_fit.fit_process(y, u, np.full(len(y), True), DT))
        for name, field, truth in (("K", 0, 4.4), ("tau", 1, 0.685), ("theta", 2, 0.3)):
            told = [tuple(f.channels[0][field]) for f in fits]
            print(row(f"{kind}, {cut} Hz: {name}", told, truth))


def table1(seed: int, N: int = 600, decibel: float = 10.0) -> tuple[np.ndarray, np.ndarray]:
    """Chen & Ulsoy 2001, table 1, mean parameters, c1 = -0.5, input below 0.5 Hz."""
    rng = np.random.default_rng(seed)
    n = N + 300
    a, u, w = math.exp(-2 * math.pi * 0.35 * DT), np.zeros(n), rng.normal(size=n)
    for k in range(2, n):
        u[k] = 2 * a * u[k - 1] - a * a * u[k - 2] + w[k]
    u *= 0.3 / u.std()
    e, x, z = rng.normal(size=n), np.zeros(n), np.zeros(n)
    for k in range(2, n):
        x[k] = 1.2623 * x[k - 1] - 0.3697 * x[k - 2] + 4.134 * u[k - 1] - 4.0337 * u[k - 2]
        z[k] = 1.2623 * z[k - 1] - 0.3697 * z[k - 2] + e[k] - 0.5 * e[k - 1]
    z *= x.std() / z.std() * 10 ** (-decibel / 20)
    return (x + z)[300:], u[300:, None]


def armax(runs: int) -> None:
    """ARMAX: batch against recursion, and K in closed loop."""
    truth = np.array([-1.2623, 0.3697, 4.134, -4.0337, 0.0, -0.5])
    orders = armax_batch.Orders()
    print("ARMAX(2,2,1), Chen & Ulsoy table 1, N = 600, 10 dB: error over the batch's own standard deviation")
    batch, online, sds = [], [], []
    for seed in range(runs):
        y, u = table1(seed)
        fit = armax_batch.fit_armax(y, u, np.full(600, True))
        start = armax_batch.fit_armax(y[:150], u[:150], np.full(150, True))
        assert fit is not None
        assert start is not None
        state = armax_recursive.begin(start)
        for k in range(150, 600):
            state, _ = armax_recursive.step(state, orders, float(y[k]), u[k].tolist(), 1.0)
        batch.append(fit.theta - truth)
        online.append(np.array(state.theta) - truth)
        sds.append(np.sqrt(np.diag(fit.covariance / fit.temper)))
    sd = np.mean(sds, axis=0)
    for label, error in (("batch", batch), ("15 s start, then recursive", online)):
        print(
            f"  {label:<27}",
            np.round(np.sqrt(np.mean(np.square(error), axis=0)) / sd, 2),
            "a1 a2 b1 b2 c0 c1",
        )
    print(f"  covered (batch): {np.mean(np.abs(batch) < 1.96 * np.array(sds), axis=0).round(2)}")
    print("ARMAX(2,2,1), closed loop, batch")
    for kind, T in (("OU 1", 60.0), ("OU 1", 200.0), ("white", 60.0)):
        told: list[list[tuple[float, float, float]]] = [[], []]
        for seed in range(runs):
            y, u = closed_loop(seed, kind, T)
            fit = armax_batch.fit_armax(y, u, np.full(len(y), True))
            assert fit is not None
            for i in (0, 1):
                index = np.r_[0:2, 2 + 2 * i : 4 + 2 * i]
                cov = fit.covariance[np.ix_(index, index)]
                told[i].append(tuple(moments.channel(fit.A, fit.B[i], 1, cov, DT).K))
        for i in (0, 1):
            print(row(f"{kind}, {T:.0f} s: K{i + 1}", told[i], TRUTH[f"K{i + 1}"]))


def speed() -> None:
    """Time per sample of each estimator over 3 minutes."""
    y, u = closed_loop(0, "OU 1", 180.0)
    print("time per sample at 10 Hz, and per refit")
    for name, make in ESTIMATORS:
        estimator = make(("headway_error", "range_rate"), DT)
        state, plain, told = estimator.init(), [], []
        for k in range(len(y)):
            sample = Sample(k * DT, float(y[k]), tuple(u[k].tolist()), Gate.OPEN, True, 0, {})
            before = time.perf_counter()
            state, estimate = estimator.step(state, sample)
            (told if estimate else plain).append(1e6 * (time.perf_counter() - before))
        print(
            f"  {name:<6} sample {np.median(plain):7.0f} us   with estimate {np.median(told):7.0f} us median"
        )


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    began = time.perf_counter()
    speed()
    armax(count)
    process(count)
    print(f"{time.perf_counter() - began:.0f} s")
