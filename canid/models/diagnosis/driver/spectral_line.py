"""Detection of a spectral line in the residual: a swing with a rhythm of its own.

No driver keeps a rhythm like a clock: its phase drifts, and an interval of the frequency that assumes a fixed phase is
too narrow. The drift is estimated from the phase in consecutive parts of the drive.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import SIGMAS
from canid.models.diagnosis.driver.driver_candidates import DriverCandidate
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import pedal
from canid.models.diagnosis.fitting.candidates import price
from canid.models.diagnosis.fitting.fitted_model import extended, solve
from canid.models.diagnosis.fitting.likelihood import fit_noise
from canid.models.diagnosis.fitting.uncertainty import needed
from canid.models.effects.effect import Effect
from canid.values.types import Array, Interval

# Hz; slower is a drift, and no driver swings faster
MIN_LINE_HZ, MAX_LINE_HZ = 0.03, 1.2
# bins either side from which the height of the spectrum around a line is estimated, and bins left out next to it
NEIGHBOUR_BINS, GUARD_BINS = 25, 2
# a part of the drive whose phase is estimated: least s and least swings; and parts needed to estimate a walk of the phase
MIN_PART_S, MIN_PART_CYCLES, MIN_PARTS = 40.0, 5, 5
# a random walk's straight line: its slope has 6/5 of the variance of the way from end to end
SLOPE_VARIANCE_RATIO = 1.2
# rad; with larger steps from part to part the line of ten minutes is broader than the spectrum resolves, and is no line
MAX_STEP_RAD = 0.5
# of the evidence needed, that a bin or a rhythm must have before anything is fitted: the fit explains more than the
# direction that screens it
SCREEN_SHARE = 0.6
# of a line's height above its surroundings, that its evidence is at most: the fit may place it between two bins
MAX_FIT_EXCESS = 1.15


def spectrum(e: Array, dt: float) -> tuple[Array, Array]:
    """Frequencies (m,) Hz and twice the periodogram over its own surroundings (m,): chi-squared with 2 if no line.

    A smooth spectrum is divided out by the surroundings; a line is one bin wide.

    Example:
        >>> t = np.arange(6000) * 0.1
        >>> f, over = spectrum(np.random.default_rng(1).normal(size=6000) + 0.3 * np.sin(2 * np.pi * 0.2 * t), 0.1)
        >>> round(float(f[np.argmax(over)]), 3)
        0.2
    """
    power: Array = np.abs(np.fft.rfft(e)) ** 2
    f: Array = np.fft.rfftfreq(e.size, dt).astype(np.float64)
    index = np.flatnonzero((f >= MIN_LINE_HZ) & (f <= MAX_LINE_HZ))
    return f[index], above(power, index)


def above(power: Array, index: npt.NDArray[np.int64]) -> Array:
    """Twice the power at some bins over that of their surroundings, (m,).

    Example:
        >>> above(np.r_[np.ones(30), 5.0, np.ones(30)], np.array([30])).round(1)
        array([6.9])
    """
    apart = np.arange(GUARD_BINS + 1, NEIGHBOUR_BINS + 1)
    near = index[:, None] + np.r_[-apart[::-1], apart]
    # bin 0 is the mean
    known = (near >= 1) & (near < power.size)
    count = known.sum(axis=1)
    sizes = np.sort(np.where(known, power[np.clip(near, 0, power.size - 1)], np.inf), axis=1)
    middle = np.stack([np.maximum(count - 1, 0) // 2, np.minimum(count // 2, sizes.shape[1] - 1)], axis=1)
    median = np.take_along_axis(sizes, middle, axis=1).mean(axis=1)
    # the median of an exponential is ln 2 of its mean
    out: Array = np.where(count > 0, 2 * power[index] / (median / np.log(2)), 0.0)
    return out


def detect(
    effect: Effect, data: DriverData, without: FittedDriver, tried: int
) -> tuple[DriverCandidate | None, float]:
    """Detect a line; None where none stands out. Also returns the evidence needed.

    Args:
        effect: with `Detector.SPECTRAL_LINE`; parameters amplitude, frequency, phase.
        data: what is explained.
        without: the model so far.
        tried: candidates of the whole search.
    """
    rows, dt, t = without.rows, data.output.dt, data.seen.t
    residual = np.where(rows, data.output.y - without.fitted.model, 0.0)
    # before whitening as well: a noise model of high order takes a line for a root of its own and whitens it away
    f, over = spectrum(without.fitted.scored.e, dt)
    over = np.maximum(over, spectrum(residual, dt)[1])
    if not f.size:
        return None, np.inf
    bound = needed(2, tried * f.size)
    at = int(np.argmax(over))
    if over[at] < SCREEN_SHARE * bound:
        return None, bound
    phase = 2 * np.pi * f[at] * t
    shape = np.stack([np.sin(phase), np.cos(phase)], axis=1)
    a, b = np.linalg.lstsq(shape[rows], residual[rows], rcond=None)[0]
    line = [float(np.hypot(a, b)), float(f[at]), float(np.arctan2(b, a))]
    model = extended(without.model, effect)
    left = data.output.y - without.fitted.model - shape @ np.array([a, b])
    noise_before = without.noise
    bare = fit_noise(data.output, left, noise_before.A.size - 1, noise_before.size, noise_before.freedom)
    begins = (without.noise, bare._replace(state=without.noise.state))
    tried_fits = [solve(data, model, np.r_[without.q, line], noise, rows) for noise in begins]
    solved = min(tried_fits, key=lambda fitted: fitted.deviance)
    priced = price(effect, solved, without, dt)
    # limited by its height above the surroundings: a broad peak of the noise is no line
    return priced._replace(evidence=min(priced.evidence, float(over[at]) * MAX_FIT_EXCESS)), bound


def with_phase_drift(
    data: DriverData, solved: FittedDriver, where: slice, narrow: dict[str, Interval]
) -> dict[str, Interval]:
    """Widen the intervals of a line by the drift of its phase.

    Args:
        data: what was fitted.
        solved: the fit.
        where: the line's parameters in q.
        narrow: intervals for a fixed phase.
    """
    rows, dt, t = solved.rows & ~data.output.hidden, data.output.dt, data.seen.t
    amplitude, frequency = (float(x) for x in solved.q[where][:2])
    bare = solved.q.copy()
    bare[where.start] = 0.0
    left = np.where(rows, data.output.y - pedal(solved.model, data, bare, A=solved.noise.A), 0.0)
    size = round(max(MIN_PART_S, MIN_PART_CYCLES / frequency) / dt)
    parts = t.size // size
    if parts < MIN_PARTS:
        return narrow
    turned = (left * np.exp(-2j * np.pi * frequency * t))[: parts * size].reshape(parts, size).sum(axis=1)
    swing = 2 * turned / np.maximum(rows[: parts * size].reshape(parts, size).sum(axis=1), 1)
    ahead = swing[1:] * swing[:-1].conj()
    mean = complex(ahead.mean())
    likeliest, walk = walk_variance(np.angle(ahead * np.conj(mean)))
    off = SIGMAS * float(np.sqrt(SLOPE_VARIANCE_RATIO * walk / parts)) / (2 * np.pi * size * dt)
    # a drifting swing cancels in part over the whole drive, and less within a part
    lost = max(float(np.sqrt(abs(mean))) - amplitude, 0.0) if likeliest > 0.0 else 0.0
    f, a = narrow["frequency"], narrow["amplitude"]
    half = float(np.hypot(f.high - f.value, off)), float(np.hypot(f.value - f.low, off))
    return {
        **narrow,
        "frequency": Interval(f.value, f.value - half[1], f.value + half[0]),
        "amplitude": Interval(a.value + lost, a.low, a.high + lost),
    }


def walk_variance(steps: Array) -> tuple[float, float]:
    """Variance of the steps of a random walk that is seen with errors: likeliest one, and posterior mean.

    The steps seen have the covariance w I + s T: w of the walk, s of the errors, T the second difference with 2 on its
    diagonal and -1 next to it. Their mean is unknown. Over a dozen parts a small walk is mostly hidden by the errors; the
    likeliest w is then 0 about every second time, and an interval that takes it as known is too narrow. So w is averaged
    over its posterior, with a flat prior of its root.

    Args:
        steps: (n,) rad, the walk's value in one part less that in the part before.

    Example:
        >>> rng = np.random.default_rng(5)
        >>> seen = rng.normal(0.0, 0.3, 400).cumsum() + rng.normal(0.0, 0.1, 400)
        >>> [round(float(x), 2) for x in walk_variance(np.diff(seen))]
        [0.1, 0.1]
    """
    n = steps.size
    order = np.arange(1, n + 1)
    basis = np.sqrt(2 / (n + 1)) * np.sin(np.pi * np.outer(order, order) / (n + 1))
    walks, errors = np.meshgrid(
        np.linspace(0.0, MAX_STEP_RAD, 51) ** 2, np.geomspace(1e-3, 1.0, 31), indexing="ij"
    )
    variance = walks[..., None] + errors[..., None] * (2 - 2 * np.cos(np.pi * order / (n + 1)))
    seen, constant = basis @ steps, basis.sum(axis=1)
    known = (constant**2 / variance).sum(axis=-1)
    mean = (constant * seen / variance).sum(axis=-1) / known
    spread = ((seen - mean[..., None] * constant) ** 2 / variance).sum(axis=-1)
    log_likelihood = -0.5 * (np.log(variance).sum(axis=-1) + np.log(known) + spread)
    weight = np.exp(log_likelihood - log_likelihood.max()).sum(axis=1)
    return float(walks[np.argmax(weight), 0]), float(weight @ walks[:, 0] / weight.sum())
