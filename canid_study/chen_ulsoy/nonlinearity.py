"""Lagrange multiplier test of a dead zone in what the driver sees (Godfrey 1988): "complacency" of Chen & Ulsoy's ref. 18.

A driver who sees nothing within +-w acts on y - clip(y, -w, w). Whether the past of clip(y) explains innovations of the
linear model, beyond what its parameters could explain, is tested without fitting it. |Delta|, a linear model of what is
left, hardly sees a dead zone: it is a gain that depends on the amplitude, and the fitted gain has taken its mean.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from canid.mathematics.identification.first_order import scan
from canid.values.types import Array
from canid_study.chen_ulsoy.segment_fits import Fits, regressors, solve

# half widths that are tried, in standard deviations of the error: a narrower zone hides in the noise, a wider one in
# the gain
_WIDTHS = np.array([0.25, 0.5, 1.0])


class DeadZone(NamedTuple):
    """Result of the test."""

    statistic: float  # standard normal without a dead zone; positive: less answer to small errors
    half_width: float  # m, of the largest
    p_value: float  # Bonferroni's over the widths


def half_widths(error: Array) -> Array:
    """The half widths that are tried, m."""
    out: Array = _WIDTHS * float(error.std())
    return out


def scores(fits: Fits, angle: Array, error: Array, widths: Array) -> Array:
    """Standardized score of each half width, all segments together.

    Args:
        fits: ARMAX(2,2,1) of the segments.
        angle: (S, N).
        error: (S, N).
        widths: (w,) m.

    Returns:
        (w,), of variance one without a dead zone. Its mean is not quite 0: fits of a minute are biased.
    """
    phi = regressors(angle, error, 2, 2)
    e = fits.residual[:, 2:]
    c = fits.theta[:, -1]
    before = np.concatenate([np.zeros((len(e), 1)), e[:, :-1]], axis=1)
    psi = scan(np.concatenate([phi, before[:, None]], axis=1), -c[:, None, None])
    H = psi @ psi.swapaxes(1, 2)
    weight = fits.sigma**-2
    out = np.zeros(len(widths))
    for k, width in enumerate(widths):
        hidden = np.clip(error, -width, width)
        # minus the answer that a dead zone takes away
        x = -(fits.theta[:, 2:3] * hidden[:, 1:-1] + fits.theta[:, 3:4] * hidden[:, :-2])
        x = scan(x, -c[:, None])
        x = x - np.einsum("sk,skt->st", solve(H, np.einsum("skt,st->sk", psi, x)), psi)
        information = float(weight @ np.einsum("st,st->s", x, x))
        out[k] = float(weight @ np.einsum("st,st->s", x, e)) / information**0.5 if information > 0.0 else 0.0
    return out


def dead_zone(fits: Fits, angle: Array, error: Array, null: Array | None = None) -> DeadZone:
    """Test all segments of a driver together.

    Args:
        fits: ARMAX(2,2,1) of the segments.
        angle: (S, N).
        error: (S, N).
        null: (3,) mean scores of the same driver without a dead zone, from repetitions; None: 0.
    """
    widths = half_widths(error)
    z = scores(fits, angle, error, widths) - (0.0 if null is None else null)
    k = int(np.argmax(np.abs(z)))
    p = min(1.0, 2.0 * len(widths) * float(norm.sf(abs(z[k]))))
    return DeadZone(float(z[k]), float(widths[k]), p)
