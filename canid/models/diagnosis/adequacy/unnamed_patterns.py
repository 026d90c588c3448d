"""Residual patterns that are no function of the inputs: a pedal that stands still, a line, a rhythm, a random walk.

The search tests them as effects of the catalogue. Here they are tested as patterns of their own, because a cause that is
not in the catalogue may leave the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from canid.models.diagnosis.adequacy import skewness
from canid.models.diagnosis.driver import intermittent_control, pedal_holds, random_walk, spectral_line
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.effects.effect import Detector
from canid.values.types import Array

# bins either side of a line's highest whose power is the line's
LINE_HALF_WIDTH_BINS = 1
# exponential variables that the mean height of a spectrum around a line is worth: its median over 2·NEIGHBOUR_BINS bins
# is worth half as many
MEAN_BINS = spectral_line.NEIGHBOUR_BINS


class Pattern(NamedTuple):
    """One pattern."""

    name: str
    says: str
    p: float  # chance of more
    statistic: float
    share: float  # of the residual's variance


def detect(search: Search, original: DriverData) -> list[Pattern]:
    """Test for patterns that the search has not named.

    Args:
        search: what the search ended with.
        original: the drive, with nothing taken out of it.
    """
    data, solved = search.data, search.solved
    named = {detector for cause in search.named for detector in cause.effect.detectors}
    if any(cause.effect.intermittent for cause in search.named):
        return []  # a sawtooth has a line, a rhythm and standstills of its own
    out = []
    left = np.where(solved.rows & ~data.output.hidden, data.output.y - solved.fitted.model, 0.0)
    out.append(_still(data._replace(output=data.output._replace(y=original.output.y)), search, left, named))
    if Detector.SPECTRAL_LINE not in named:
        out.append(_line(left, solved.fitted.scored.e, data.output.dt))
    out.append(_rhythm(search))
    if search.random_walk is None:
        out.append(_random_walk(search, left))
    # an acceleration is skewed by itself: brakes are stronger than engines
    if data.pedal:
        side = skewness.detect(data, solved)
        says = "pushes to one side, now and then, that follow nothing measured"
        out.append(Pattern("one side", says, side.p, side.statistic, side.share))
    return out


def _still(data: DriverData, search: Search, left: Array, named: set[Detector]) -> Pattern:
    """Standstills of the pedal where the model moves it."""
    held = pedal_holds.detect(data, search.solved, search.holds)
    share = 0.0
    for start, stop in held.episodes:
        share += float(np.sum(left[start:stop] ** 2))
    share /= max(float(left @ left), 1e-12)
    p = float(chi2.sf(held.evidence, 2)) if held.pattern is not None and held.pattern not in named else 1.0
    return Pattern("standing still", "a pedal that stands still", p, held.evidence, min(share, 1.0))


def _line(left: Array, e: Array, dt: float) -> Pattern:
    """A spectral line above its surroundings, before or after whitening."""
    says = "a swing with a rhythm of its own"
    f, over = spectral_line.spectrum(left, dt)
    if not f.size:
        return Pattern("line", says, 1.0, 0.0, 0.0)
    tall = np.maximum(over, spectral_line.spectrum(e, dt)[1])
    at = int(np.argmax(tall))
    # an exponential over a mean of MEAN_BINS such is Pareto: above 1 + x/m with the power −m
    p = float(2 * f.size * (1 + 0.5 * tall[at] / MEAN_BINS) ** -MEAN_BINS)
    power = np.abs(np.fft.rfft(left)) ** 2
    k = round(float(f[at]) * left.size * dt)
    line_share = float(np.sum(power[max(k - LINE_HALF_WIDTH_BINS, 0) : k + LINE_HALF_WIDTH_BINS + 1])) / max(
        0.5 * left.size * float(left @ left), 1e-12
    )
    return Pattern("line", says, min(p, 1.0), float(tall[at]), min(line_share, 1.0))


def _rhythm(search: Search) -> Pattern:
    """A residual that follows the model's slope in a rhythm."""
    scored = search.solved.fitted.scored
    e = np.where(scored.slope == -1.0, scored.e, 0.0)
    intervals, over = intermittent_control.spectrum(e, search.solved.fitted.model, search.data.output.dt)
    if not intervals.size:
        return Pattern("rhythm", "decisions in a rhythm", 1.0, 0.0, 0.0)
    # relative to its surroundings as well: a band in which a smoothed output has no content is no rhythm
    most = float(np.minimum(over, spectral_line.above(over, np.arange(over.size))).max())
    p = min(1.0, intervals.size * float(chi2.sf(most, 2)))
    return Pattern("rhythm", "decisions in a rhythm", p, most, most / max(scored.free, 1))


def _random_walk(search: Search, left: Array) -> Pattern:
    """A random walk of the desired headway."""
    drift = random_walk.detect(search.data, search.solved)
    says = "a random walk of the desired headway"
    if drift is None or drift.evidence <= 0.0:
        return Pattern("wander", says, 1.0, 0.0, 0.0)
    rows = search.solved.rows & ~search.data.output.hidden
    ratio = float(np.var(drift.added[rows])) / max(float(np.var(left[rows])), 1e-12)
    # a variance is not negative: half of the chances are none (Self & Liang 1987)
    return Pattern("wander", says, 0.5 * float(chi2.sf(drift.evidence, 1)), drift.evidence, min(ratio, 1.0))
