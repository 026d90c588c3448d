"""The gain of an input that the loop holds: too large by its variance over itself, and not any more."""

from __future__ import annotations

import numpy as np
import pytest

from canid.mathematics.identification import feedback_bias
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.fopdt.fopdt_fit import Settings, fit_process
from canid.values.types import Array, Channel, Identifiable, Interval, OutputFilter

STEP, SECONDS, K = 0.1, 240.0, 0.4


def drive(rng: np.random.Generator) -> tuple[Array, Array]:
    """Acceleration of a driver with noise of 1 s behind a lead, headway error and range rate: no part of canid.

    Returns:
        (n,) and (n, 2).
    """
    n, late, decay = round(SECONDS / STEP), 3, np.exp(-STEP / 0.4)
    error, rate, y = np.zeros(n), np.zeros(n), np.zeros(n)
    lead, speed, gap, noise, slow = 20.0, 20.0, 32.0, 0.0, np.zeros(2)
    aim = 20.0
    for k in range(n):
        if k % 150 == 0:
            aim = rng.uniform(15.0, 25.0)
        error[k], rate[k] = gap / speed - 1.6, lead - speed
        seen = np.array([error[max(k - late, 0)], rate[max(k - late, 0)]])
        slow = decay * slow + (1.0 - decay) * seen
        noise = np.exp(-STEP) * noise + 0.3 * np.sqrt(1.0 - np.exp(-2.0 * STEP)) * rng.standard_normal()
        y[k] = K * slow[0] + 0.6 * slow[1] + noise
        lead += STEP * float(np.clip(0.3 * (aim - lead), -1.0, 1.0))
        gap += STEP * (lead - speed)
        speed += STEP * y[k]
    return y, np.column_stack([error, rate])


@pytest.mark.slow("fits many drives")
def test_on_average_the_gain_is_the_drivers() -> None:
    """Over drives of four minutes the mean error of K is nearer to zero than to what theory says of the plain one."""
    rng = np.random.default_rng()
    plain, mended, expected = [], [], []
    for _ in range(24):
        y, u = drive(rng)
        every = np.full(len(y), True)
        first, second = (
            fit_process(y, u, every, STEP, Settings(output_filter=OutputFilter("none"), held=held))
            .channels[0]
            .K
            for held in (None, 0)
        )
        sd = (first.high - first.low) / (2.0 * NORMAL_QUANTILE)
        plain.append((first.value - K) / sd)
        mended.append((second.value - K) / sd)
        expected.append(sd / K)
    assert np.mean(mended) < np.mean(plain)
    # an average of 24 is known to 0.2
    assert abs(np.mean(mended)) < 0.8
    assert np.mean(expected) > 0.3


def test_what_is_known_well_stays() -> None:
    """A per cent of uncertainty moves K by a ten-thousandth; a K that is not known, and its status, stay."""
    exact = Channel(K=Interval(5.0, 4.9, 5.1), status=Identifiable.OK)
    moved = feedback_bias.without(exact)
    assert abs(moved.K.value / 5.0 - 1.0) < 2e-4
    assert moved.status is Identifiable.OK
    assert feedback_bias.without(Channel()) == Channel()
    # a gain of either sign is moved towards zero
    negative = feedback_bias.without(Channel(K=Interval(-1.0, -1.8, -0.2))).K
    assert -1.0 < negative.value < -0.8
