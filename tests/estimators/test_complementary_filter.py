"""A speed in steps, where its acceleration is recorded: its steps are gone, and what is fine or does not fit stays."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from canid.mathematics.estimators.complementary_filter import fine_speed, with_fine_speed
from canid.values.types import Array, LearnGate, Trace
from tests import seeds

DT = 0.1


def motion(seed: int, n: int = 6000) -> tuple[Array, Array, Array]:
    """Time, speed and its acceleration, in traffic: accelerations of 0.4 m/s² over some 3 s, speeds of 4 m/s over 20 s."""
    white = np.random.default_rng(seed).standard_normal(n)
    keep, back = np.exp(-DT / 3.0), np.exp(-DT / 20.0)
    accel = lfilter([1.0], [1.0, -keep], white)
    accel *= 0.4 / accel.std()
    speed = lfilter([DT], [1.0, -back], accel)
    return DT * np.arange(n), 20.0 + speed, np.gradient(speed, DT)


@pytest.mark.parametrize("step", [0.28, 0.5, 1.0])
@seeds.mostly(0.95)
def test_the_steps_are_gone(step: float, seed: int) -> None:
    """With noise of the acceleration and an offset of 0.1 m/s², half of the error of rounding at most is left."""
    t, speed, accel = motion(seed)
    seen = accel + 0.1 + 0.05 * np.random.default_rng([seed, 1]).standard_normal(len(t))
    coarse = np.round(speed / step) * step
    fine = fine_speed(coarse, seen, t, DT)
    assert fine is not None
    left = (fine - speed)[100:-100]
    assert np.std(left) < 0.5 * np.std(coarse - speed)


def test_what_is_fine_or_does_not_fit_stays(seed: int) -> None:
    """A speed in steps of 0.01 m/s or with noise of a step; an acceleration of the wrong unit or of nothing."""
    t, speed, accel = motion(seed)
    rng = np.random.default_rng([seed, 2])
    assert fine_speed(np.round(speed, 2), accel, t, DT) is None
    assert fine_speed(np.round(speed + 0.5 * rng.standard_normal(len(t))), accel, t, DT) is None
    assert fine_speed(np.round(speed), 9.81 * accel, t, DT) is None
    assert fine_speed(np.round(speed), np.full(len(t), np.nan), t, DT) is None


def test_the_headway_error_is_that_of_the_fine_speed(seed: int) -> None:
    """Nearer to the true one; nothing else of the drive changes, and one without an acceleration is the same object."""
    t, speed, accel = motion(seed)
    gap, n = 1.5 * speed + 2.0, len(t)
    signals = {"gap": gap, "speed": np.round(speed), "accel": accel}
    given = Trace(
        DT, t, accel, np.column_stack([gap / np.round(speed) - 1.5, accel]), ("headway_error", "range_rate"),
        (LearnGate.OPEN,) * n, np.ones(n, bool), np.zeros(n, np.int64), signals,
    )  # fmt: skip
    fine = with_fine_speed(given)
    true = gap / speed - 1.5
    assert np.std(fine.inputs[:, 0] - true) < 0.5 * np.std(given.inputs[:, 0] - true)
    assert np.array_equal(fine.inputs[:, 1], given.inputs[:, 1])
    assert all(a is b for name, a, b in zip(given._fields, fine, given, strict=True) if name != "inputs")
    bare = given._replace(signals={"gap": gap, "speed": np.round(speed)})
    assert with_fine_speed(bare) is bare


def test_nothing_is_averaged_over_a_pause(seed: int) -> None:
    """What comes before a pause does not change what comes behind it."""
    t, speed, accel = motion(seed)
    later = np.where(t > 300.0, t + 60.0, t)
    other = np.where(t > 300.0, speed, speed + 7.0)
    first, second = (fine_speed(np.round(x), accel, later, DT) for x in (speed, other))
    assert first is not None
    assert second is not None
    assert np.allclose(first[t > 300.0], second[t > 300.0])
