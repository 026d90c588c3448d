"""The interval of several models that may hold has the truth in 95 %, whichever of them holds."""

from __future__ import annotations

import numpy as np
import pytest

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.fopdt.channel_mixture import mixed
from canid.values.types import Channel, Identifiable, Interval


def part(value: float, sd: float) -> tuple[Channel]:
    half = NORMAL_QUANTILE * sd
    return (Channel(Interval(value, value - half, value + half), status=Identifiable.GAIN_ONLY),)


@pytest.mark.parametrize("apart", [0.0, 1.0, 2.0, 4.0, 8.0])
@pytest.mark.parametrize("share", [0.5, 0.8, 0.95])
@pytest.mark.parametrize("wider", [1.0, 3.0])
def test_the_interval_holds_what_is_drawn_from_the_mixture(apart: float, share: float, wider: float) -> None:
    """0.95 of 20,000 draws, to 0.01, whatever the models differ by; with one standard deviation as few as 0.68."""
    rng = np.random.default_rng(1)
    K = mixed([part(5.0, 1.0), part(5.0 + apart, wider)], np.array([share, 1.0 - share]))[0].K
    second = rng.random(20_000) > share
    truth = 5.0 + np.where(second, apart, 0.0) + np.where(second, wider, 1.0) * rng.normal(size=20_000)
    assert abs(float(np.mean((truth >= K.low) & (truth <= K.high))) - 0.95) < 0.01


def test_what_one_does_not_know_the_mixture_does_not() -> None:
    """A parameter that was not estimated is NaN in the mixture."""
    one, other = part(5.0, 1.0), (Channel(),)
    assert np.isnan(mixed([one, other], np.array([0.9, 0.1]))[0].K.value)
