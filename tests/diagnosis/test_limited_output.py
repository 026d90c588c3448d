"""A sample at a limit says that the demand was beyond the limit, not what was recorded there."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from canid.models.diagnosis.fitting.likelihood import Noise, Output, counted, score


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_score_of_a_limited_autoregression_has_the_mean_0_at_the_truth(seed: int, side: float) -> None:
    """Of a pedal that is recorded as 0 below 0.5 %, and of one that is recorded as 5 % above 4.5 (Tobin 1958)."""
    n, rng = 100_000, np.random.default_rng(seed)
    mean = 2.5 + side * (1.0 + 3.0 * np.sin(np.arange(n) / 40.0))
    wanted = mean + lfilter([1.0], [1.0, -0.9], rng.standard_normal(n))
    below, above = wanted <= 0.5, wanted >= 4.5
    low, high = (below, np.zeros(n, dtype=bool)) if side > 0 else (np.zeros(n, dtype=bool), above)
    y = np.where(low, 0.0, np.where(high, 5.0, wanted))
    output = Output(y, np.ones(n, dtype=bool), low, 0.5, high, 4.5, 0.1)
    rows = counted(output, 1)
    scored = score(output, rows, Noise(np.array([1.0, -0.9]), 1.0, np.ones(n), np.empty(0)), mean)
    slopes = (scored.e * scored.slope)[rows]
    # 4.5 standard errors: 7 in a million
    assert abs(slopes.mean()) < 4.5 * slopes.std() / np.sqrt(rows.sum())
