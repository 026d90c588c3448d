"""Decisions now and then: what a model leaves follows its own slope in a rhythm.

Who holds a demand for D s falls behind it by what it moves meanwhile: by its slope times the time since the decision, a
sawtooth of length D. The residual times that slope has a line at 1/D; where it is, the model that decides is fitted.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import THETA1, THETA2, pedal, with_effects
from canid.diagnosis.evidence import needed
from canid.diagnosis.likelihood import whitened
from canid.diagnosis.search import Candidate, priced_in
from canid.diagnosis.solved import Solved, polished, solve
from canid.effects.cause import Effect
from canid.types import Array

# s between decisions: faster is a hand that is never still (Gawthrop 2011), slower is looking away
SHORTEST, LONGEST = 0.4, 4.0
# decisions of a rhythm along the drive shift by one interval between two that can be told apart; tried in parts of that
PARTS, EITHER_SIDE = 4, 6
PHASES = 12
# of the highest line, from which on another counts as one
OVERTONE = 0.5
# of the distance between two phases, one after the other
FINER = (0.5, 0.25)
# of the distance between two intervals that were tried, one after the other
CLOSER = (1.0, 0.5, 0.25, 0.12)
# s in which the foot goes to what was decided: where a fit begins
RELEASE = 0.2
# iterations that tell one moment from another
GLANCE = 4
# of the evidence that is needed, that the best rhythm must explain along its direction; half an interval of waiting
# sits in the dead times, so its fit finds more than that
WORTH = 0.5


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
    index = np.flatnonzero((f >= 1 / LONGEST) & (f <= 1 / SHORTEST))
    return 1 / f[index], power[index]


def look(effect: Effect, data: DriverData, without: Solved, tried: int) -> tuple[Candidate | None, float]:
    """Search a rhythm of decisions; None where none stands out. Beside it: the evidence that it would need.

    Args:
        effect: `act_and_wait`.
        data: what is explained.
        without: the model so far.
        tried: candidates of the whole search.
    """
    rows = without.fitted.scored.slope == -1.0
    e = np.where(rows, without.fitted.scored.e, 0.0)
    D, over = spectrum(e, without.fitted.model, data.output.dt)
    bound = needed(3, tried * max(D.size // 2, 1))
    if not D.size or float(over.max()) < 0.6 * bound:
        return None, bound
    # the sawtooth's own overtones stand out as well: the slowest rhythm that does is the rhythm
    strong = D[over > OVERTONE * over.max()]
    interval = float(strong.max())
    shift = interval**2 / max(data.seen.drive, 1.0) / PARTS
    intervals = interval + shift * np.arange(-EITHER_SIDE, EITHER_SIDE + 1)
    Q = qr(without.fitted.jacobian, mode="economic")[0]
    owns = [(float(d), float(phase)) for d in intervals for phase in np.arange(PHASES) / PHASES * d]
    explained = [_explains(effect, data, without, Q, own) for own in owns]
    if max(explained) < WORTH * bound:
        return None, bound
    interval, near = owns[int(np.argmax(explained))]

    def fitted(phase: float, begin: Array, longer: float = 0.0) -> Solved:
        """Fit at a phase; an interval that is longer keeps its step in the middle of the drive."""
        own = interval + longer
        q = np.r_[begin, own, (phase - longer * round(0.5 * data.seen.drive / interval)) % own, RELEASE]
        effects = (*without.model.effects, effect)
        return solve(data, effects, q, without.noise, without.rows, turns=1, iterations=GLANCE)

    # the direction tells the rhythm, but not the moment: half an interval of waiting sits in the dead times as well
    base = without.q.copy()
    base[[THETA1, THETA2]] = np.maximum(base[[THETA1, THETA2]] - 0.5 * interval, 0.0)
    best = min(
        (fitted(near + k / PHASES * interval, base) for k in range(PHASES)), key=lambda one: one.deviance
    )
    for step in FINER:
        k = best.q.size - 2
        beside = (
            fitted(float(best.q[k]) + side * step / PHASES * interval, best.q[: without.q.size])
            for side in (-1, 1)
        )
        best = min((best, *beside), key=lambda one: one.deviance)
    # the interval itself, to where both ends of the drive are in step
    phase, longer = float(best.q[best.q.size - 2]), 0.0
    for step in CLOSER:
        some = [longer + side * step * shift for side in (-1, 1)]
        tried_there = [(fitted(phase, best.q[: without.q.size], each), each) for each in some]
        nearer, there = min(tried_there, key=lambda one: one[0].deviance)
        if nearer.deviance < best.deviance:
            best, longer = nearer, there
    best = polished(data, solve(data, best.model.effects, best.q, without.noise, without.rows))
    found = priced_in(effect, best, without, data.output.dt)
    return found._replace(parameters=3), bound


def _explains(effect: Effect, data: DriverData, without: Solved, Q: Array, own: tuple[float, float]) -> float:
    """What a rhythm explains beside the model: along its own direction, the model's (n, k) taken out."""
    model = with_effects((*without.model.effects, effect))
    held = pedal(model, data, np.r_[without.q, own, RELEASE])
    scored = without.fitted.scored
    d = whitened(without.noise, held - without.fitted.model) * scored.slope
    d[scored.slope != -1.0] = 0.0
    d = d - Q @ (Q.T @ d)
    along, size = float(d @ scored.e), float(d @ d)
    return along * along / size if size > 1e-9 and along < 0 else 0.0
