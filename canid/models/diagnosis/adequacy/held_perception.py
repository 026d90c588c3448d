"""Answers to what was seen some time ago: now and then an input is held for seconds, and taken up again.

A driver who glances into a mirror answers on to the gap and relative speed of before. The pedal moves on with the driver's
noise, so that it does not stand still, and over the whole drive the gains are nearly those of the model. Each stretch is
a hypothesis without a free parameter: it changes the model's output by a known column.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from canid.models.diagnosis.fitting.likelihood import Noise, filtered
from canid.values.findings import Flags
from canid.values.types import Array

# s; of glances away from the road (Klauer et al. 2006: 0.5 to 4 s) and of tasks
HELD_S = (1.0, 1.5, 2.0, 3.0, 4.5)
# s behind it, in which the answer comes back through its lag
RETURN_S = 1.0
# 1/s, how often a stretch begins
BEGIN_RATE_HZ = 1 / 20.0
# standard deviations; an outlier is no stretch
MAX_INNOVATION = 4.0
# s; noise in bursts is as large as it has been for so long, which is known before each sample; and the least size
BURST_S, MIN_SIZE = 5.0, 0.5


class Response(NamedTuple):
    """An input and how it is answered."""

    x: Array  # (n,) behind the dead time
    gain: float
    tau: float  # s


def log_evidence(responses: Sequence[Response], e: Array, rows: Flags, noise: Noise, dt: float) -> float:
    """Logarithm of the likelihood ratio of a driver who holds the inputs now and then, over one who never does.

    A mixture over all sequences of stretches, with begins and lengths by chance. Without any its expectation is 1, so that
    it exceeds 1/p with a probability of p at most (Ville 1939).

    Args:
        responses: of the model.
        e: (n,) standardised innovations.
        rows: (n,) samples that count.
        noise: of the model.
        dt: s.

    Example:
        >>> from canid.models.diagnosis.fitting.likelihood import Noise
        >>> rng = np.random.default_rng(1)
        >>> x = np.cumsum(rng.normal(size=3000)) / 5.0
        >>> away = np.arange(3000) % 200 < 30
        >>> held = x[np.where(away, np.arange(3000) // 200 * 200, np.arange(3000))]
        >>> e, white = rng.normal(size=3000), Noise(np.ones(1), 1.0, np.ones(3000), np.empty(0))
        >>> rows, answer = np.ones(3000, bool), [Response(x, 1.0, 0.0)]
        >>> gains = [log_evidence(answer, e + y - x, rows, white, 0.1) for y in (x, held)]
        >>> gains[0] < 3.0, gains[1] > 20.0
        (True, True)
    """
    size = _size(e, rows, dt)
    e = np.where(rows, np.clip(e / size, -MAX_INNOVATION, MAX_INNOVATION), 0.0)
    noise = noise._replace(size=noise.size * size)
    lengths = sorted({max(round(s / dt), 2) for s in HELD_S})
    behind = round(RETURN_S / dt)
    gains = [(k + behind, _gain(responses, e, rows, noise, k, behind, dt).tolist()) for k in lengths]
    enter, on = math.log(BEGIN_RATE_HZ * dt / len(gains)), math.log1p(-BEGIN_RATE_HZ * dt)
    driving = [0.0] * (e.size + 1)
    for t in range(1, e.size + 1):
        terms = [driving[t - 1] + on]
        terms += [driving[t - k] + enter + gain[t - k] for k, gain in gains if 0 <= t - k < len(gain)]
        most = max(terms)
        driving[t] = most + math.log(sum(math.exp(term - most) for term in terms))
    return driving[-1]


def _size(e: Array, rows: Flags, dt: float) -> Array:
    """Root mean square (n,) of the innovations until the sample before, forgotten with BURST_S."""
    keep = float(np.exp(-dt / BURST_S))
    square = np.where(rows, np.minimum(e * e, MAX_INNOVATION**2), 1.0)
    before = lfilter([1.0 - keep], [1.0, -keep], np.r_[1.0, square[:-1]], zi=[keep])[0]
    return np.asarray(np.sqrt(np.maximum(before, MIN_SIZE**2)))


def _gain(
    responses: Sequence[Response], e: Array, rows: Flags, noise: Noise, k: int, behind: int, dt: float
) -> Array:
    """Log likelihood ratio (n - k - behind,) of inputs held for k samples from each one on."""
    n = e.size - k - behind
    if n <= 0:
        return np.zeros(0)
    along = np.arange(n)[:, None] + np.arange(k + behind)
    column = np.zeros(along.shape)
    for response in responses:
        late = np.where(np.arange(k + behind) < k, response.x[:n, None] - response.x[along], 0.0)
        decay = np.exp(-dt / response.tau) if response.tau > 0.0 else 0.0
        column += response.gain * lfilter([1.0 - decay], [1.0, -decay], late, axis=1)
    white = filtered(noise.A, column) / (noise.sd * noise.size)[along]
    white = np.where(rows[along], white, 0.0)
    out: Array = np.sum(white * (e[along] - 0.5 * white), axis=1)
    return out
