"""Detection of intermittent control: a residual that follows the model's own slope in a rhythm.

A driver who holds a demand for D s falls behind it by its slope times the time since the decision, a sawtooth of period
D. The residual times that slope has a line at 1/D. Where a line stands out, the intermittent model is fitted.
"""

from __future__ import annotations

import numpy as np

from canid.models.diagnosis.driver.driver_candidates import DriverCandidate
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import THETA1, THETA2, pedal
from canid.models.diagnosis.driver.spectral_line import SCREEN_SHARE
from canid.models.diagnosis.fitting.candidates import model_directions, price
from canid.models.diagnosis.fitting.fitted_model import extended, polished, solve
from canid.models.diagnosis.fitting.likelihood import whitened
from canid.models.diagnosis.fitting.uncertainty import needed
from canid.models.effects.effect import Effect
from canid.values.types import Array

# s between decisions: faster is continuous control (Gawthrop 2011), slower is looking away
MIN_INTERVAL_S, MAX_INTERVAL_S = 0.4, 4.0
# two rhythms are distinguishable when their decisions shift by one interval along the drive; steps are parts of that,
# and so many are tried either side
INTERVAL_SUBSTEPS, INTERVAL_STEPS = 4, 6
PHASE_STEPS = 12
# of the highest line, from which on another one counts
OVERTONE_SHARE = 0.5
# of the distance between two phases, refinements one after the other
PHASE_REFINEMENTS = (0.5, 0.25)
# of the distance between two intervals, refinements one after the other
INTERVAL_REFINEMENTS = (1.0, 0.5, 0.25, 0.12)
# s in which the pedal moves to the decided position: initial guess
INITIAL_RELEASE_S = 0.2
# iterations of a quick fit that ranks phases
QUICK_ITERATIONS = 4
# of the evidence needed, that the best rhythm must explain along its direction; the dead times have absorbed half an
# interval of waiting, so the fit explains more than that
MIN_DIRECTION_SHARE = 0.5


def spectrum(e: Array, x: Array, dt: float) -> tuple[Array, Array]:
    """Intervals (m,) s and how much the residual follows the slope of x in each rhythm (m,): chi-squared with 2.

    Example:
        >>> t = np.arange(6000) * 0.1
        >>> x = np.sin(0.3 * t)
        >>> e = np.random.default_rng(1).normal(size=6000) + 2 * np.gradient(x, 0.1) * (t % 1.3 - 0.65)
        >>> D, over = spectrum(e, x, 0.1)
        >>> round(float(D[np.argmax(over)]), 2)
        1.3
    """
    z = e * np.gradient(x, dt)
    power = 2 * np.abs(np.fft.rfft(z, 2 * z.size)) ** 2 / max(float(z @ z), 1e-300)
    f = np.fft.rfftfreq(2 * z.size, dt)
    index = np.flatnonzero((f >= 1 / MAX_INTERVAL_S) & (f <= 1 / MIN_INTERVAL_S))
    return 1 / f[index], power[index]


def detect(
    effect: Effect, data: DriverData, without: FittedDriver, tried: int
) -> tuple[DriverCandidate | None, float]:
    """Detect a rhythm of decisions; None where none stands out. Also returns the evidence needed.

    Args:
        effect: with `Detector.INTERMITTENT_CONTROL`; parameters interval, phase, release.
        data: what is explained.
        without: the model so far.
        tried: candidates of the whole search.
    """
    rows = without.fitted.scored.slope == -1.0
    e = np.where(rows, without.fitted.scored.e, 0.0)
    D, over = spectrum(e, without.fitted.model, data.output.dt)
    bound = needed(3, tried * max(D.size // 2, 1))
    if not D.size or float(over.max()) < SCREEN_SHARE * bound:
        return None, bound
    # the sawtooth's own overtones stand out as well: the slowest rhythm that does is the rhythm
    strong = D[over > OVERTONE_SHARE * over.max()]
    interval = float(strong.max())
    shift = interval**2 / max(data.seen.duration, 1.0) / INTERVAL_SUBSTEPS
    intervals = interval + shift * np.arange(-INTERVAL_STEPS, INTERVAL_STEPS + 1)
    Q = model_directions(without)
    owns = [(float(d), float(phase)) for d in intervals for phase in np.arange(PHASE_STEPS) / PHASE_STEPS * d]
    explained = [_explains(effect, data, without, Q, rhythm) for rhythm in owns]
    if max(explained) < MIN_DIRECTION_SHARE * bound:
        return None, bound
    interval, near = owns[int(np.argmax(explained))]

    def fitted(phase: float, begin: Array, longer: float = 0.0) -> FittedDriver:
        """Fit at a phase; an interval that is longer keeps its step in the middle of the drive."""
        fitted_interval = interval + longer
        q = np.r_[
            begin,
            fitted_interval,
            (phase - longer * round(0.5 * data.seen.duration / interval)) % fitted_interval,
            INITIAL_RELEASE_S,
        ]
        return solve(
            data,
            extended(without.model, effect),
            q,
            without.noise,
            without.rows,
            joint=False,
            iterations=QUICK_ITERATIONS,
        )

    # the direction gives the rhythm but not its phase: the dead times have absorbed half an interval of waiting
    base = without.q.copy()
    base[[THETA1, THETA2]] = np.maximum(base[[THETA1, THETA2]] - 0.5 * interval, 0.0)
    best = min(
        (fitted(near + k / PHASE_STEPS * interval, base) for k in range(PHASE_STEPS)),
        key=lambda fit: fit.deviance,
    )
    for step in PHASE_REFINEMENTS:
        k = best.q.size - 2
        neighbours = (
            fitted(float(best.q[k]) + side * step / PHASE_STEPS * interval, best.q[: without.q.size])
            for side in (-1, 1)
        )
        best = min((best, *neighbours), key=lambda fit: fit.deviance)
    # the interval itself, to where both ends of the drive are in step
    phase, longer = float(best.q[best.q.size - 2]), 0.0
    for step in INTERVAL_REFINEMENTS:
        some = [longer + side * step * shift for side in (-1, 1)]
        tried_there = [(fitted(phase, best.q[: without.q.size], each), each) for each in some]
        nearer, there = min(tried_there, key=lambda pair: pair[0].deviance)
        if nearer.deviance < best.deviance:
            best, longer = nearer, there
    best = polished(data, solve(data, best.model, best.q, without.noise, without.rows))
    priced = price(effect, best, without, data.output.dt)
    return priced._replace(parameters=3), bound


def _explains(
    effect: Effect, data: DriverData, without: FittedDriver, Q: Array, rhythm: tuple[float, float]
) -> float:
    """Evidence of a rhythm along its own direction, the model's directions (n, k) projected out."""
    model = extended(without.model, effect)
    held = pedal(model, data, np.r_[without.q, rhythm, INITIAL_RELEASE_S], A=without.noise.A)
    scored = without.fitted.scored
    d = whitened(without.noise, held - without.fitted.model) * scored.slope
    d[scored.slope != -1.0] = 0.0
    d = d - Q @ (Q.T @ d)
    along, size = float(d @ scored.e), float(d @ d)
    return along * along / size if size > 1e-9 and along < 0 else 0.0
