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
from numpy.lib.stride_tricks import sliding_window_view
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
# of one stretch, where the largest number ends; and of all, from which on they are scaled anew
MAX_LOG_RATIO, MAX_RATIO = 450.0, 1e100
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
    enter, on = BEGIN_RATE_HZ * dt / len(lengths), 1.0 - BEGIN_RATE_HZ * dt
    of_lengths = _gains(responses, e, rows, noise, lengths, behind, dt)
    # (k, n): of a stretch that ends before each sample
    ended = np.zeros((len(lengths), e.size + 1))
    for into, k, gain in zip(ended, lengths, of_lengths, strict=True):
        into[k + behind : k + behind + gain.size] = enter * np.exp(np.minimum(gain, MAX_LOG_RATIO))
    # likelihood ratios until each sample, over that of `level`
    spans, level = [k + behind for k in lengths], 0.0
    driving = [0.0] * max(spans) + [1.0]
    for ratios in ended.T[1:].tolist():
        now = on * driving[-1]
        for k, ratio in zip(spans, ratios, strict=True):
            now += ratio * driving[-k]
        driving.append(now)
        if not 1.0 / MAX_RATIO < now < MAX_RATIO:
            driving = [before / now for before in driving[-max(spans) - 1 :]]
            level += math.log(now)
    return level + math.log(driving[-1])


def _size(e: Array, rows: Flags, dt: float) -> Array:
    """Root mean square (n,) of the innovations until the sample before, forgotten with BURST_S."""
    keep = float(np.exp(-dt / BURST_S))
    square = np.where(rows, np.minimum(e * e, MAX_INNOVATION**2), 1.0)
    before = lfilter([1.0 - keep], [1.0, -keep], np.r_[1.0, square[:-1]], zi=[keep])[0]
    return np.asarray(np.sqrt(np.maximum(before, MIN_SIZE**2)))


def _gains(
    responses: Sequence[Response],
    e: Array,
    rows: Flags,
    noise: Noise,
    lengths: Sequence[int],
    behind: int,
    dt: float,
) -> list[Array]:
    """Log likelihood ratios of inputs held from each sample on, one (n - k - behind,) for each length k.

    While two stretches last they are the same: each further one is computed from where the shorter one ends.
    """
    longest, p = lengths[-1], noise.A.size - 1
    n = e.size - lengths[0] - behind
    if n <= 0:
        return [np.zeros(0) for _ in lengths]

    def ahead(x: Array) -> Array:
        """Of each sample, those from it on, (n, longest + behind)."""
        return sliding_window_view(np.r_[x, np.zeros(longest - lengths[0])], longest + behind)[:n]

    held, after = np.zeros((n, longest)), np.zeros((len(lengths), n, behind))
    for response in responses:
        decay = float(np.exp(-dt / response.tau)) if response.tau > 0.0 else 0.0
        late = response.x[:n, None] - ahead(response.x)[:, :longest]
        late = response.gain * lfilter([1.0 - decay], [1.0, -decay], late, axis=1)
        held += late
        for returned, k in zip(after, lengths, strict=True):
            returned += late[:, k - 1 : k] * decay ** np.arange(1, behind + 1)
    weight, left = ahead(np.where(rows, 1.0 / (noise.sd * noise.size), 0.0)), ahead(e)

    def gain(column: Array, part: slice) -> Array:
        white = column * weight[:, part]
        return white * (left[:, part] - 0.5 * white)

    until = np.cumsum(gain(filtered(noise.A, held), slice(longest)), axis=1)
    out = []
    for returned, k in zip(after, lengths, strict=True):
        past = min(p, k)
        column = filtered(noise.A, np.hstack([held[:, k - past : k], returned]))[:, past:]
        whole = until[:, k - 1] + gain(column, slice(k, k + behind)).sum(axis=1)
        out.append(whole[: max(e.size - k - behind, 0)])
    return out
