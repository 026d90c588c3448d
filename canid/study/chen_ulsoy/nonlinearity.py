"""Lagrange multiplier test of a dead zone in the driver's sight (Godfrey 1988): Chen & Ulsoy's "complacency" (their ref. 18).

A driver who sees nothing within +-w acts on y - clip(y, -w, w). Whether the past of clip(y) explains innovations of the
linear model, beyond what its parameters could explain, is tested without fitting it. |Delta|, a linear model of what is
left, hardly sees a dead zone: it is a gain that depends on the amplitude, and the fitted gain has taken its mean.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from canid.identification.first_order import scan
from canid.study.chen_ulsoy.segment_fits import Fits, regressors
from canid.types import NAN, Array

# half widths that are tried, in standard deviations of the error: a narrower zone hides in the noise, a wider one in the gain
_WIDTHS = (0.25, 0.5, 1.0)


class DeadZone(NamedTuple):
    """Result of the test."""

    statistic: float  # standard normal without a dead zone; positive: less answer to small errors
    half_width: float  # m, of the largest
    p_value: float  # Bonferroni's over the widths


def dead_zone(fits: Fits, angle: Array, error: Array) -> DeadZone:
    """Test all segments of a driver together.

    Args:
        fits: ARMAX(2,2,1) of the segments.
        angle: (S, N).
        error: (S, N).
    """
    phi = regressors(angle, error, 2, 2)
    e = fits.residual[:, 2:]
    c = fits.theta[:, -1]
    before = np.concatenate([np.zeros((len(e), 1)), e[:, :-1]], axis=1)
    psi = scan(np.concatenate([phi, before[:, None]], axis=1), -c[:, None, None])
    scale = float(error.std())
    best = DeadZone(0.0, NAN, 1.0)
    H = psi @ psi.swapaxes(1, 2)
    for width in _WIDTHS:
        hidden = np.clip(error, -width * scale, width * scale)
        # minus the answer that a dead zone takes away
        x = -(fits.theta[:, 2:3] * hidden[:, 1:-1] + fits.theta[:, 3:4] * hidden[:, :-2])
        x = scan(x, -c[:, None])
        along = np.linalg.solve(H, np.einsum("skt,st->sk", psi, x)[..., None])[..., 0]
        x = x - np.einsum("sk,skt->st", along, psi)
        weight = fits.sigma**-2
        score = float(weight @ np.einsum("st,st->s", x, e))
        information = float(weight @ np.einsum("st,st->s", x, x))
        z = score / information**0.5 if information > 0.0 else 0.0
        if abs(z) > abs(best.statistic):
            best = DeadZone(z, width * scale, min(1.0, 2.0 * len(_WIDTHS) * float(norm.sf(abs(z)))))
    return best
