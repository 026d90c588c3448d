"""Akaike's final prediction error as a function of the number of parameters (Chen & Ulsoy 2001, eq. 2)."""

from __future__ import annotations

import numpy as np

from canid.values.types import Array


def fpe_factor(parameters: Array | int, samples: int) -> Array:
    """Factor of the loss: (1 + d / N) / (1 - d / N) (Ljung 1999, eq. 7.109; the paper prints M for one N).

    Args:
        parameters: d, one or (n,).
        samples: N.

    Example:
        >>> round(float(fpe_factor(20, 600)), 4)
        1.069
    """
    share = np.asarray(parameters, dtype=np.float64) / samples
    out: Array = (1.0 + share) / (1.0 - share)
    return out
