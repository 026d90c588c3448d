"""Driver noise sample by sample, its innovations as effects on the remnant make them: heavy tails, a varying scale."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from canid.models.effects.effect import Remnant, ScaleFeature
from canid.models.simulation.noise import DAMPING, RESONANCE_HZ, WHITE_SHARE, first_order
from canid.values.identified_model import NoiseLaw

# s for which one draw of Student's precision lasts: a push of the pedal, and a step of the estimators' grid. Drawn for
# each of the simulator's steps, the sum of ten would be Gaussian again
PUSH_S = 0.1
# m/s²; mean and standard deviation of |acceleration| on ordinary roads, in which slopes are given
ORDINARY_ACCEL = (0.3, 0.3)
# s; bursts last so long. With 4 s of past innovations a law knows about as much of the log scale as PREDICTED_SHARE of its
# standard deviation (drives of 6 min): a slope is drawn as a log scale of that standard deviation over it
BURST_S, PREDICTED_SHARE = 4.0, 0.42
# standard deviations from the mean; beyond it a feature counts as so much
MAX_FEATURE = 3.0
# of log scale: a factor of 5 either way
MAX_LOG_SCALE = 1.6
# degrees of freedom above 2 of which the variance is brought to 1; with fewer only the scale is
MIN_VARIANCE_FREEDOM = 0.5

Step = Callable[[float, float], float]  # own and lead acceleration, m/s² -> noise of variance about 1


def stepper(
    kind: str | NoiseLaw,
    n: int,
    dt: float,
    rng: np.random.Generator,
    effects: Sequence[tuple[Remnant, Sequence[float]]],
) -> Step:
    """Make the noise of one drive.

    Args:
        kind: as in `unit_noise`; or an identified law, of innovations of variance 1.
        n: steps of the drive.
        dt: s.
        rng: source of random numbers.
        effects: on the remnant, with their parameters.

    Example:
        >>> step = stepper("ar1", 9000, 0.01, np.random.default_rng(1), [(Remnant(heavy_tailed=True), (3.0,))])
        >>> push = np.diff([step(0.0, 0.0) for _ in range(9000)])
        >>> bool(np.mean(push**4) / np.mean(push**2) ** 2 > 5)  # of a Gaussian: 3
        True
    """
    shocks, whites = (rng.standard_normal(n).tolist() for _ in range(2))
    spread, slopes = np.ones(n), dict[ScaleFeature, float]()
    push = PUSH_S if isinstance(kind, str) else kind.step
    for remnant, p in effects:
        values = list(p)
        if remnant.heavy_tailed:
            spread = spread * _student(values.pop(0), n, dt, rng, push)
        for feature, slope in zip(remnant.scale, values, strict=True):
            if feature is ScaleFeature.PAST_INNOVATIONS:
                spread = spread * _bursts(slope, n, dt, rng)
            else:
                slopes[feature] = slopes.get(feature, 0.0) + slope
    spreads = spread.tolist()
    filtered = _filter(kind, dt) if isinstance(kind, str) else _autoregressive(kind, dt)
    k = -1

    def step(own_accel: float, lead: float) -> float:
        nonlocal k
        k += 1
        seen = {
            ScaleFeature.OWN_ACCELERATION: (abs(own_accel) - ORDINARY_ACCEL[0]) / ORDINARY_ACCEL[1],
            ScaleFeature.LEAD_ACCELERATION: (abs(lead) - ORDINARY_ACCEL[0]) / ORDINARY_ACCEL[1],
        }
        log = sum(
            slope * max(min(seen[feature], MAX_FEATURE), -MAX_FEATURE) for feature, slope in slopes.items()
        )
        size = math.exp(max(min(log, MAX_LOG_SCALE), -MAX_LOG_SCALE)) * spreads[k]
        return filtered(size * shocks[k], size * whites[k])

    return step


def _student(freedom: float, n: int, dt: float, rng: np.random.Generator, push: float) -> np.ndarray:
    """Scale (n,) that makes a Gaussian Student's t, of variance 1 where that is finite."""
    hold = max(round(push / dt), 1)
    precision = rng.chisquare(freedom, n // hold + 1) / freedom
    variance = freedom / max(freedom - 2.0, MIN_VARIANCE_FREEDOM)
    return np.asarray(np.repeat(1.0 / np.sqrt(precision * variance), hold)[:n])


def _bursts(slope: float, n: int, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Scale (n,) whose log is a first-order process: the innovations of the last seconds predict it."""
    sd = slope / PREDICTED_SHARE
    # the mean of a lognormal square is exp(2 sd²)
    return np.asarray(np.exp(sd * first_order(BURST_S, n, dt, rng) - sd * sd))


def _autoregressive(law: NoiseLaw, dt: float) -> Callable[[float, float], float]:
    """Noise of an identified law: new at each of its steps, straight in between, one of them late."""
    every = max(round(law.step / dt), 1)
    past = [0.0] * (1 + len(law.coefficients))
    k = -1

    def step(shock: float, white: float) -> float:
        nonlocal k
        k += 1
        if k % every == 0:
            past.insert(0, sum(a * x for a, x in zip(law.coefficients, past, strict=False)) + shock)
            past.pop()
        part = (k % every) / every
        return (1 - part) * past[1] + part * past[0] if len(past) > 1 else past[0]

    return step


def _filter(kind: str, dt: float) -> Callable[[float, float], float]:
    """Filter of one kind of noise: innovation and white noise -> noise."""
    if kind == "none":
        return lambda shock, white: 0.0
    if kind == "white":
        return lambda shock, white: shock
    w, z = 2 * math.pi * RESONANCE_HZ, DAMPING
    a = math.exp(-dt / (4.0 if kind == "ar4" else 1.0))
    slow, fast = (math.sqrt(1 - WHITE_SHARE), math.sqrt(WHITE_SHARE)) if kind == "mix" else (1.0, 0.0)
    x = rate = 0.0

    def first_order(shock: float, white: float) -> float:
        nonlocal x
        x = a * x + math.sqrt(1 - a * a) * shock
        return slow * x + fast * white

    def second_order(shock: float, white: float) -> float:
        nonlocal x, rate
        rate += (-2 * z * w * rate - w * w * x) * dt + math.sqrt(4 * z * w**3 * dt) * shock
        x += rate * dt
        return x

    return second_order if kind == "resonant" else first_order
