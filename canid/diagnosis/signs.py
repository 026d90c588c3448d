"""Signs of a cause that are no function of the inputs: a pedal that stands still, a line, a rhythm, a wandering wish.

The search looks for them by the causes that leave them. Here they are looked for by themselves: a cause that is not in
the catalogue may leave the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from canid.diagnosis import holds, line, one_sided, rhythm, wander
from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.naming import Search
from canid.types import Array

# bins either side of a line's highest whose power is the line's
WIDE = 1
# the height of a spectrum around a line is told by so many exponentials: a median of 2·AROUND is worth half as many
AROUND = line.AROUND


class Sign(NamedTuple):
    """One sign."""

    name: str
    says: str
    p: float  # chance of more
    statistic: float
    share: float  # of the residual's variance


def look(found: Search, original: DriverData) -> list[Sign]:
    """Look for what the search has not named.

    Args:
        found: what the search ended with.
        original: the drive, with nothing taken out of it.
    """
    data, solved = found.data, found.solved
    named = {one.effect.id for one in found.named}
    if "act_and_wait" in named:
        return []  # a sawtooth has a line, a rhythm and standstills of its own
    out = []
    left = np.where(solved.rows & ~data.output.hidden, data.output.y - solved.fitted.model, 0.0)
    out.append(_still(data._replace(output=data.output._replace(y=original.output.y)), found, left, named))
    if "periodic_task" not in named:
        out.append(_line(left, solved.fitted.scored.e, data.output.dt))
    out.append(_rhythm(found))
    if found.wander is None:
        out.append(_wander(found, left))
    # an acceleration is skewed by itself: brakes are stronger than engines
    if data.pedal:
        side = one_sided.look(data, solved)
        says = "pushes to one side, now and then, that follow nothing measured"
        out.append(Sign("one side", says, side.p, side.statistic, side.share))
    return out


def _still(data: DriverData, found: Search, left: Array, named: set[str]) -> Sign:
    """The pedal stands still where the model moves it."""
    held = holds.look(data, found.solved, found.held)
    share = 0.0
    for start, stop in held.episodes:
        share += float(np.sum(left[start:stop] ** 2))
    share /= max(float(left @ left), 1e-12)
    p = float(chi2.sf(held.evidence, 2)) if held.effect and held.effect not in named else 1.0
    return Sign("standing still", "a pedal that stands still", p, held.evidence, min(share, 1.0))


def _line(left: Array, e: Array, dt: float) -> Sign:
    """One frequency stands out of its surroundings, before or after whitening."""
    says = "a swing with a rhythm of its own"
    f, over = line.spectrum(left, dt)
    if not f.size:
        return Sign("line", says, 1.0, 0.0, 0.0)
    tall = np.maximum(over, line.spectrum(e, dt)[1])
    at = int(np.argmax(tall))
    # an exponential over a mean of AROUND such is Pareto: above 1 + x/m with the power −m
    p = float(2 * f.size * (1 + 0.5 * tall[at] / AROUND) ** -AROUND)
    power = np.abs(np.fft.rfft(left)) ** 2
    k = round(float(f[at]) * left.size * dt)
    own = float(np.sum(power[max(k - WIDE, 0) : k + WIDE + 1])) / max(
        0.5 * left.size * float(left @ left), 1e-12
    )
    return Sign("line", says, min(p, 1.0), float(tall[at]), min(own, 1.0))


def _rhythm(found: Search) -> Sign:
    """The residual follows the model's slope in a rhythm."""
    scored = found.solved.fitted.scored
    e = np.where(scored.slope == -1.0, scored.e, 0.0)
    intervals, over = rhythm.spectrum(e, found.solved.fitted.model, found.data.output.dt)
    if not intervals.size:
        return Sign("rhythm", "decisions in a rhythm", 1.0, 0.0, 0.0)
    # by its surroundings too: what a smoothed output has no content for is no rhythm
    most = float(np.minimum(over, line.above(over, np.arange(over.size))).max())
    p = min(1.0, intervals.size * float(chi2.sf(most, 2)))
    return Sign("rhythm", "decisions in a rhythm", p, most, most / max(scored.free, 1))


def _wander(found: Search, left: Array) -> Sign:
    """The wish wanders."""
    drift = wander.look(found.data, found.solved)
    says = "a wish that wanders"
    if drift is None or drift.evidence <= 0.0:
        return Sign("wander", says, 1.0, 0.0, 0.0)
    rows = found.solved.rows & ~found.data.output.hidden
    ratio = float(np.var(drift.added[rows])) / max(float(np.var(left[rows])), 1e-12)
    # a variance is not negative: half of the chances are none (Self & Liang 1987)
    return Sign("wander", says, 0.5 * float(chi2.sf(drift.evidence, 1)), drift.evidence, min(ratio, 1.0))
