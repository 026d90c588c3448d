"""A line in the residual's spectrum: a swing with a rhythm of its own.

Nobody keeps a rhythm like a clock: its phase wanders, and a frequency that is told as if it did not is told too well.
How far it wanders shows in the phase from part to part of the drive.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import pedal, with_effects
from canid.diagnosis.evidence import needed
from canid.diagnosis.likelihood import colour
from canid.diagnosis.search import Candidate, priced_in
from canid.diagnosis.solved import Solved, solve
from canid.effects.cause import Effect
from canid.types import Array, Interval

# Hz; slower is a drift, faster no foot swings
SLOWEST, FASTEST = 0.03, 1.2
# bins either side that tell how high the spectrum is around a line, and of those left out next to it
AROUND, NEXT = 25, 2
# a part of the drive whose phase is told: so many s and so many swings at least; and fewer parts than this tell no walk
PART, SWINGS, FEWEST = 40.0, 5, 5
# a random walk's straight line: its slope has 6/5 of the variance of the way from end to end
SLOPE = 1.2


def spectrum(e: Array, dt: float) -> tuple[Array, Array]:
    """Frequencies (m,) Hz and twice the periodogram over its own surroundings (m,): chi-squared with 2 if no line.

    Any colour that is smooth is taken out by the surroundings; a line is one bin wide.

    Example:
        >>> t = np.arange(6000) * 0.1
        >>> f, over = spectrum(np.random.default_rng(1).normal(size=6000) + 0.3 * np.sin(2 * np.pi * 0.2 * t), 0.1)
        >>> round(float(f[np.argmax(over)]), 3)
        0.2
    """
    power: Array = np.abs(np.fft.rfft(e)) ** 2
    f: Array = np.fft.rfftfreq(e.size, dt).astype(np.float64)
    index = np.flatnonzero((f >= SLOWEST) & (f <= FASTEST))
    return f[index], above(power, index)


def above(power: Array, index: npt.NDArray[np.int64]) -> Array:
    """Twice the power at some bins over that of their surroundings, (m,).

    Example:
        >>> above(np.r_[np.ones(30), 5.0, np.ones(30)], np.array([30])).round(1)
        array([6.9])
    """
    over = np.empty(index.size)
    for k, at in enumerate(index.tolist()):
        near = np.r_[power[max(at - AROUND, 1) : max(at - NEXT, 1)], power[at + NEXT + 1 : at + AROUND + 1]]
        # the median of an exponential is ln 2 of its mean
        over[k] = 2 * power[at] / (np.median(near) / np.log(2)) if near.size else 0.0
    return over


def look(effect: Effect, data: DriverData, without: Solved, tried: int) -> tuple[Candidate | None, float]:
    """Search a line; None where none stands out. Beside it: the evidence that it would need.

    Args:
        effect: `periodic_task`.
        data: what is explained.
        without: the model so far.
        tried: candidates of the whole search.
    """
    rows, dt, t = without.rows, data.output.dt, data.seen.t
    residual = np.where(rows, data.output.y - without.fitted.model, 0.0)
    # before whitening as well: a noise of high order takes a line for its own colour, and whitens it away
    f, over = spectrum(without.fitted.scored.e, dt)
    over = np.maximum(over, spectrum(residual, dt)[1])
    if not f.size:
        return None, np.inf
    bound = needed(2, tried * f.size)
    at = int(np.argmax(over))
    if over[at] < 0.6 * bound:
        return None, bound
    phase = 2 * np.pi * f[at] * t
    shape = np.stack([np.sin(phase), np.cos(phase)], axis=1)
    a, b = np.linalg.lstsq(shape[rows], residual[rows], rcond=None)[0]
    own = [float(np.hypot(a, b)), float(f[at]), float(np.arctan2(b, a))]
    model = with_effects((*without.model.effects, effect))
    left = data.output.y - without.fitted.model - shape @ np.array([a, b])
    bare = colour(data.output, left, without.noise.A.size - 1, without.noise.size)
    begins = (without.noise, bare._replace(state=without.noise.state))
    tried_fits = [solve(data, model.effects, np.r_[without.q, own], noise, rows) for noise in begins]
    solved = min(tried_fits, key=lambda one: one.deviance)
    found = priced_in(effect, solved, without, dt)
    # how far it stands above its surroundings counts, if that is less: a bump of the noise is no line
    return found._replace(evidence=min(found.evidence, float(over[at]) * 1.15)), bound


def told(data: DriverData, solved: Solved, where: slice, narrow: dict[str, Interval]) -> dict[str, Interval]:
    """Widen the intervals of a line by what its phase wanders.

    The steps of the phase from part to part are those of a walk and the difference of two errors; the latter are
    correlated at one step, the walk's are not.

    Args:
        data: what was fitted.
        solved: the fit.
        where: the line's parameters in q.
        narrow: intervals for a phase that stands still.
    """
    rows, dt, t = solved.rows & ~data.output.hidden, data.output.dt, data.seen.t
    amplitude, frequency = (float(x) for x in solved.q[where][:2])
    bare = solved.q.copy()
    bare[where.start] = 0.0
    left = np.where(rows, data.output.y - pedal(solved.model, data, bare), 0.0)
    size = round(max(PART, SWINGS / frequency) / dt)
    parts = t.size // size
    if parts < FEWEST:
        return narrow
    turned = (left * np.exp(-2j * np.pi * frequency * t))[: parts * size].reshape(parts, size).sum(axis=1)
    swing = 2 * turned / np.maximum(rows[: parts * size].reshape(parts, size).sum(axis=1), 1)
    ahead = swing[1:] * swing[:-1].conj()
    mean = complex(ahead.mean())
    steps = np.angle(ahead * np.conj(mean))
    walk = max(float(np.mean(steps**2) + 2 * np.mean(steps[1:] * steps[:-1])), 0.0)
    off = 1.96 * float(np.sqrt(SLOPE * walk / parts)) / (2 * np.pi * size * dt)
    # what wanders cancels in part over a drive, and less from part to part
    lost = max(float(np.sqrt(abs(mean))) - amplitude, 0.0) if walk > 0.0 else 0.0
    f, a = narrow["frequency"], narrow["amplitude"]
    half = float(np.hypot(f.high - f.value, off)), float(np.hypot(f.value - f.low, off))
    return {
        **narrow,
        "frequency": Interval(f.value, f.value - half[1], f.value + half[0]),
        "amplitude": Interval(a.value + lost, a.low, a.high + lost),
    }
