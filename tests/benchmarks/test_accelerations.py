"""Drives with accelerations: the plant is what it says, and no cut moves a number."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.identification import acceleration, canid_side
from benchmarks.identification.acceleration import DT
from benchmarks.identification.noise_models import REMNANT
from benchmarks.identification.tables import cuts, filters, poles
from canid.mathematics.estimators import armax_whole_drive
from canid.mathematics.identification.armax.armax_batch import Orders
from canid.values.types import Identifiable
from tests.seeds import mostly


@mostly(0.95)
def test_a_cut_moves_nothing(seed: int) -> None:
    """Some tenths of a second less at either end move hardly any number by more than a quarter of its half width.

    Where two lags far apart explain a drive equally well (one drive in a hundred, behind an unknown filter), a cut may
    still choose between them.
    """
    found = [cuts._simulated(seed + k, how) for how in ("stated", "unknown", "nothing") for k in range(3)]
    moves = [x for one in found for x in one.most.values()]
    assert moves
    # one such drive of nine has four numbers of some thirty; all drives: the table `cuts`
    assert np.mean([x <= 0.25 for x in moves]) >= 0.75
    assert sum(one.disjoint > 0 for one in found) <= 1


def test_the_plant_is_what_it_says(seed: int) -> None:
    """The speed is the integral of the acceleration, and what is published follows the acceleration."""
    drive = acceleration.drive(seed, 3.0, REMNANT)
    assert drive.acceleration.shape == drive.speed.shape == drive.inputs[:, 0].shape
    np.testing.assert_allclose(np.diff(drive.speed) / DT, drive.acceleration[:-1], atol=0.6)
    smooth = acceleration.published(drive, filters.CASES[1], seed)
    assert 0.7 < np.corrcoef(smooth[50:-50], drive.acceleration[50:-50])[0, 1] <= 1.0


@pytest.mark.parametrize("declared", ["stated", "nothing"])
def test_an_acceleration_shows_the_answer_to_range_rate(declared: str) -> None:
    """By ARMAX, smoothed over 1.1 s, with its filter stated or not: K of range rate may be quoted and is right to 30 %."""
    how = filters.CASES[1]
    drive = acceleration.drive(4, 3.0, REMNANT)
    trace = poles._trace(acceleration.published(drive, how, 4), drive.inputs, filters.given(how)[declared])
    found = armax_whole_drive.identify(trace, Orders())
    assert found is not None
    channel = found.channels["range_rate"]
    assert channel.status is not Identifiable.NOT
    assert abs(channel.K.value / drive.channels[1].K - 1.0) < 0.3


@pytest.mark.parametrize("declared", ["stated", "unknown", "nothing"])
def test_live_armax_shows_the_answer_to_range_rate(declared: str) -> None:
    """Of an acceleration smoothed over 1.1 s K of range rate may be quoted live and is right to 30 %; delays where known."""
    how = filters.CASES[1]
    drive = acceleration.drive(4, 3.0, REMNANT)
    y = acceleration.published(drive, how, 4)
    names, of = poles.NAMES, filters.given(how)[declared]
    (last,) = canid_side.live_at("armax", names, y, drive.inputs, DT, [179.0], of)
    assert last is not None
    channel = last.channels["range_rate"]
    assert channel.status is not Identifiable.NOT
    assert abs(channel.K.value / drive.channels[1].K - 1.0) < 0.3
    assert (channel.status is Identifiable.GAIN_ONLY) or declared != "unknown"
