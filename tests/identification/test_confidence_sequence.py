"""The confidence sequence misses as seldom as it promises, at all times simultaneously, and is as narrow as can be."""

import math

import numpy as np
from scipy.optimize import minimize_scalar

from canid.mathematics.identification.armax import confidence_sequence


def test_is_narrowest_where_it_says():
    """Against the plain interval the sequence is narrowest at the reference information."""
    lowest = minimize_scalar(
        lambda x: confidence_sequence.widening(math.exp(x)), bounds=(-3, 3), method="bounded"
    )
    assert abs(lowest.x) < 0.02


def test_ever_missing_is_as_rare_as_promised():
    """A mean watched after each of 20 000 samples: at most 5 % of 400 runs ever miss, and the plain one misses often."""
    rng = np.random.default_rng(0)
    n = np.arange(1.0, 20_001.0)
    wide = np.array([confidence_sequence.widening(x / 500.0) for x in n])
    missed, plain = 0, 0
    for _ in range(400):
        z = np.abs(np.cumsum(rng.normal(size=len(n)))) / np.sqrt(n)
        missed += bool((z > wide).any())
        plain += bool((z > 1.96).any())
    # 5 % of 400 is 20 with a standard deviation of 4.4; Ville's bound is the limit of watching for ever
    assert missed <= 20
    assert plain > 200


def test_knows_nothing_without_information():
    """No information, no interval."""
    assert confidence_sequence.widening(0.0) == math.inf
    assert confidence_sequence.widening(math.nan) == math.inf
    assert confidence_sequence.widening(1e-12) > 1e5
