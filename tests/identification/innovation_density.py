"""Density of innovations under a fitted law: how well it predicts held-out data."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from canid.mathematics.identification.innovation_law import Weights
from canid.values.types import Array


def log_density(e: Array, weights: Weights) -> Array:
    """Return (n,) log density of innovations; the weights' own mixture is not used."""
    law, scale = weights.law, weights.law.sd * weights.size
    if not math.isfinite(law.freedom):
        return np.asarray(stats.norm.logpdf(e, scale=scale))
    return np.asarray(stats.t.logpdf(e, law.freedom, scale=scale))
