"""Price of a planted effect: the expected likelihood ratio of the true model against the best baseline on this drive.

The oracle knows the driver, the noise model and the form of the effect. Its price is a common scale for effects, noises
and lengths of drives, independent of the engine that is tested.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from benchmarks.hidden_effects.known_inputs import GRID_S, MIN_SPEED_M_S, answer, known
from benchmarks.hidden_effects.metric import Metric, metric, size
from canid.values.types import Trace
from tests.plants.planted_drive import EFFECTS, Array, Planted

FINE_STEP_S = 0.02  # s: answers are made here, where a dead time between grid points costs nothing
# %; a pedal position in 8 bits has 0.4 % steps, whose error is uniform
PEDAL_STEP_PERCENT = 0.4
# s; what a baseline may have, wider than any driver that is planted
TAU, DEAD_TIME = (0.5 * FINE_STEP_S, 5.0), (0.0, 2.5)
# lags and dead times (4,) s -> headway (n,) s and range rate (n,) m/s through them
Answers = Callable[[Array], tuple[Array, Array]]


class Price(NamedTuple):
    """What an effect is worth on its drive."""

    lr: float  # expected 2 log likelihood ratio, true model against the best baseline
    share: float  # of what the best baseline leaves over: variance of the effect's part over that with the remnant


class Baseline(NamedTuple):
    """The best p0 + K1 L1[headway] + K2 L2[range rate], and how far it stays from what it was fitted to."""

    p0: float  # %
    K: tuple[float, float]  # % per s, % per m/s
    tau: tuple[float, float]  # s
    dead_time: tuple[float, float]  # s
    pedal: Array  # (n,) % at 10 Hz
    distance: float  # squared, in the metric


def expected(planted: Planted, trace: Trace | None = None) -> Price:
    """Price of all that is planted in the driver and in the sensing of the inputs, together.

    A clean drive has a price near 0, and so has an effect that sits in the vehicle or that the baseline absorbs.

    Args:
        planted: from a planting simulator.
        trace: as the drive's log has it. Given, the price is that for a reader of the log: what the log
            does not hold of the inputs is noise. Faulty sensing has no such price, and is priced by the truth.

    Returns:
        The price. NaN where the pedal is hardly ever free.

    Example:
        >>> from tests.plants.plant_two import plant
        >>> dear = plant({"asymmetric_gain": {"share": 0.4}}, seed=1, minutes=2, noise="ar1", profile="mixed")
        >>> cheap = plant({}, seed=1, minutes=2, noise="ar1", profile="mixed")
        >>> expected(dear).lr > 10.0 * expected(cheap).lr
        True
    """
    far, answers, unknown, _ = _reader(planted, trace)
    if far is None:
        return Price(float("nan"), float("nan"))
    demand = planted.demand[_rows(planted)] + unknown
    if answers is None:
        answers = _answers(_seen(planted, _sensing(planted)), len(demand))
    best = baseline(far, answers, demand, _starts(planted))
    return _price(planted, best, demand)


def each(planted: Planted, trace: Trace | None = None) -> dict[str, Price]:
    """Price of each effect given all the others: they are known but for their strength, which is fitted anew.

    Args:
        planted: with `without` given for every effect of the driver.
        trace: as in `expected`.

    Returns:
        Effect -> price, for effects in the driver and in the sensing; others have no price in the driver's answers.
    """
    far, answers, unknown, lead = _reader(planted, trace)
    rows = _rows(planted)
    effects = _sensing(planted)
    names = [*planted.without, *effects]
    if far is None:
        return dict.fromkeys(names, Price(float("nan"), float("nan")))
    own = {name: (planted.demand - other)[rows] for name, other in planted.without.items()}
    if "lead_acceleration" in own:
        own["lead_acceleration"] = own["lead_acceleration"] + lead
    plain = _plain(planted) if answers is None else planted.demand[rows] + unknown - sum(own.values())
    out = {}
    for name in names:
        target = plain + own.get(name, 0.0)
        others = [shape for other, shape in own.items() if other != name]
        seen = answers or _answers(_seen(planted, [name] if name in effects else []), len(target))
        best = baseline(far, seen, target, _starts(planted), others)
        out[name] = _price(planted, best, target)
    return out


def baseline(
    far: Metric,
    answers: Answers,
    target: Array,
    starts: Sequence[Array],
    others: Sequence[Array] = (),
) -> Baseline:
    """Fit the baseline to a pedal in a metric: what is linear exactly, the rest by Levenberg and Marquardt.

    Kaufman's variable projection (BIT 15, 1975): the linear coefficients are solved for in each step, and the
    derivatives by lags and dead times are projected off the linear columns.

    Args:
        far: the metric.
        answers: (tau1, dead_time1, tau2, dead_time2) s -> both inputs through them, (n,) s and (n,) m/s.
        target: (n,) % at 10 Hz.
        starts: (tau1, dead_time1, tau2, dead_time2) s each; the best end counts.
        others: (n,) % each, fitted along.
    """
    fixed = far(np.column_stack([np.ones(len(target)), *others]))
    aim = far(target)
    low, high = np.array([TAU[0], DEAD_TIME[0]] * 2), np.array([TAU[1], DEAD_TIME[1]] * 2)
    # s; a difference over which an answer is straight, and far above rounding
    h = 2e-3

    def solved(p: Array) -> tuple[float, Array, Array, Array]:
        X = np.column_stack([far(np.column_stack(answers(p))), fixed])
        Q, R = np.linalg.qr(X)
        left = aim - Q @ (Q.T @ aim)
        return float(left @ left), left, Q, np.linalg.lstsq(R, Q.T @ aim, rcond=None)[0]

    def slopes(p: Array, Q: Array, K: Array) -> Array:
        columns = []
        for i in range(4):
            # inwards at the upper edge of the box
            step = h if p[i] + h <= high[i] else -h
            moved = p.copy()
            moved[i] += step
            columns.append(K[i // 2] * (answers(moved)[i // 2] - answers(p)[i // 2]) / step)
        J = far(np.column_stack(columns))
        out: Array = J - Q @ (Q.T @ J)
        return out

    best: tuple[float, Array, Array] | None = None
    for start in starts:
        p = np.clip(start, low, high)
        cost, left, Q, c = solved(p)
        damping = 1e-3
        for _ in range(40):
            J = slopes(p, Q, c[:2])
            A, g = J.T @ J, J.T @ left
            # a direction that runs out of the box is not one
            held = ((p <= low) & (g < 0)) | ((p >= high) & (g > 0))
            A[held], A[:, held], g[held] = 0.0, 0.0, 0.0
            before = cost
            while damping < 1e8:
                trial = np.clip(
                    p + np.linalg.solve(A + np.diag(damping * np.diag(A) + 1e-12 + held), g), low, high
                )
                tried = solved(trial)
                if tried[0] <= cost:
                    p, (cost, left, Q, c) = trial, tried
                    damping *= 0.1
                    break
                damping *= 10.0
            # a thousandth of a likelihood ratio is nothing, and so is a ten-thousandth part of a large one
            if before - cost < 1e-3 + 1e-4 * cost or damping >= 1e8:
                break
        if best is None or cost < best[0]:
            best = cost, p, c
    assert best is not None, "at least one start"
    cost, p, c = best
    one, two = answers(p)
    pedal = c[0] * one + c[1] * two + c[2] + sum(k * shape for k, shape in zip(c[3:], others, strict=True))
    return Baseline(
        float(c[2]), (float(c[0]), float(c[1])), (p[0], p[2]), (p[1], p[3]), np.asarray(pedal), cost
    )


def _price(planted: Planted, best: Baseline, target: Array) -> Price:
    free = _free(planted)
    effect = float(np.var((target - best.pedal)[free]))
    return Price(best.distance, effect / (effect + float(np.var(planted.remnant[_rows(planted)][free]))))


def _reader(planted: Planted, trace: Trace | None) -> tuple[Metric | None, Answers | None, Array, Array]:
    """Metric and inputs for a reader of the log; the reader's demand less the true one, and the lead's part of it, (n,) %.

    Without a log, or where its sensing is faulty, the reader knows the truth.
    """
    t = planted.columns["t"][_rows(planted)]
    nothing = np.zeros(len(t))
    if trace is None or _sensing(planted):
        return _metric(planted, nothing), None, nothing, nothing
    d = planted.truth["driver"]
    read = known(planted, trace, t)
    p = np.array([d["tau1"], d["dead_time1"], d["tau2"], d["dead_time2"]])
    true = _answers(_seen(planted, []), len(t))(p)
    unknown = sum(
        (
            K * (read_ - true_)
            for K, read_, true_ in zip((d["K1"], d["K2"]), read.answers(p), true, strict=True)
        ),
        nothing,
    )
    lead = nothing
    gain = planted.truth["effects"].get("lead_acceleration", {}).get("gain", 0.0)
    if gain:
        accel = np.gradient(planted.columns["range_rate"] + planted.columns["speed"], planted.dt)
        every = max(round(FINE_STEP_S / planted.dt), 1)
        true_lead = _answer(accel[::every], every * planted.dt, d["tau2"], d["dead_time2"])[: len(t)]
        lead = gain * (answer(read.lead_accel, d["tau2"], d["dead_time2"]) - true_lead)
    return _metric(planted, unknown + lead), read.answers, unknown + lead, lead


def _answers(inputs: tuple[Array, Array, float], n: int) -> Answers:
    """Both inputs (m,), on a fine grid with some step in s, through lags and dead times: (n,) each."""

    def answers(p: Array) -> tuple[Array, Array]:
        return _answer(inputs[0], inputs[2], p[0], p[1])[:n], _answer(inputs[1], inputs[2], p[2], p[3])[:n]

    return answers


def _metric(planted: Planted, unknown: Array) -> Metric | None:
    """The metric of this drive's own noise on the samples where the pedal is free; None: hardly any.

    Args:
        planted: the drive.
        unknown: (n,) %, the reader's demand less the true one.
    """
    free = _free(planted)
    # a minute identifies the noise model and seven parameters
    if np.count_nonzero(free) < 60.0 / GRID_S:
        return None
    rows = _rows(planted)
    white = PEDAL_STEP_PERCENT / np.sqrt(12.0)
    remnant = planted.remnant[rows] - unknown
    scale = np.ones(len(remnant))
    if planted.truth["noise"] == "state":
        scale = size(remnant, planted.demand[rows] - planted.truth["driver"]["offset"], white)
    return metric(remnant, white, scale, free)


def _rows(planted: Planted) -> slice:
    return slice(None, None, round(GRID_S / planted.dt))


def _free(planted: Planted) -> np.ndarray:
    pedal = planted.columns["pedal"][_rows(planted)]
    out: np.ndarray = (pedal > 0.0) & (pedal < 100.0)
    return out


def _sensing(planted: Planted) -> list[str]:
    return [effect for effect in planted.truth["effects"] if effect in EFFECTS["sensing"]]


def _starts(planted: Planted) -> list[Array]:
    """The driver himself; one who waits less and lags more; one whose headway channel is slow enough to do other work."""
    d = planted.truth["driver"]
    true = np.array([d["tau1"], d["dead_time1"], d["tau2"], d["dead_time2"]])
    return [true, true * np.array([2.0, 0.5, 2.0, 0.5]), np.array([4.0, 2.0, *true[2:]])]


def _seen(planted: Planted, effects: Sequence[str]) -> tuple[Array, Array, float]:
    """Headway and range rate as sensors with these faults, but without noise, say them; and their step in s."""
    every = max(round(FINE_STEP_S / planted.dt), 1)
    c, given = planted.columns, {name: planted.truth["effects"][name] for name in effects}
    t = c["t"]
    rate = given.get("clock_skew", {}).get("rate", 0.0)
    done = t / float(t[-1])
    late = given.get("radar_latency", {}).get("delay", 0.0) + (
        rate * done if rate >= 0.0 else -rate * (1.0 - done)
    )
    gap, relative, speed = (
        np.interp(t - late, t, c["gap"]),
        np.interp(t - late, t, c["range_rate"]),
        c["speed"],
    )
    gap = gap + given.get("range_offset", {}).get("distance", 0.0)
    relative = relative * (1.0 + given.get("range_rate_scale", {}).get("share", 0.0))
    if "range_rate_sign" in given:
        relative = -relative
    speed = speed * (1.0 + given.get("speed_scale", {}).get("share", 0.0))
    headway = gap / np.maximum(speed, MIN_SPEED_M_S)
    return headway[::every], relative[::every], every * planted.dt


def _plain(planted: Planted) -> Array:
    """The planted driver without any effect along this trajectory, (n,) % at 10 Hz."""
    d = planted.truth["driver"]
    headway, relative, step = _seen(planted, [])
    out: Array = (
        d["offset"]
        + d["K1"] * (_answer(headway, step, d["tau1"], d["dead_time1"]) - d["headway_desired"])
        + d["K2"] * _answer(relative, step, d["tau2"], d["dead_time2"])
    )
    return out[: len(planted.demand[_rows(planted)])]


def _answer(x: Array, step: float, tau: float, dead_time: float) -> Array:
    """1 / (1 + tau s) of what was `dead_time` ago, at 10 Hz; before the first sample everything stood still."""
    k = np.arange(len(x))
    delayed = np.interp(k - dead_time / step, k, x)
    keep = (2.0 * tau - step) / (2.0 * tau + step)
    b = step / (2.0 * tau + step)
    out, _ = lfilter([b, b], [1.0, -keep], delayed, zi=np.array([(b + keep) * delayed[0]]))
    every: Array = out[:: round(GRID_S / step)]
    return every
