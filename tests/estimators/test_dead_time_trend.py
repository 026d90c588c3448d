"""A dead time that drifts is found, as with a clock that runs off; random walks of gains and offset are none."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from canid.analysis.drive import drive_parameters
from canid.mathematics.estimators import dead_time_trend
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.estimators.whole_drive_agreement import arbitrated, diagnosed
from canid.values.types import Channel, Identifiable, Interval
from tests.plants.outside_drives import drawn_drive
from tests.plants.quoted_intervals import identified, trace
from tests.plants.sensor_effects import OUTPUT, clock
from tests.seeds import mostly

Array = npt.NDArray[np.float64]
SECONDS, ROWS = 600, 5
INPUTS = 2


def parts(rng: np.random.Generator, ppm: float = 0.0, walk: float = 0.0) -> Array:
    """(600, 8, 8) products of ten minutes: slopes of two gains, offset, two taus, two dead times; and the output.

    Args:
        rng: source of random numbers.
        ppm: drift of both dead times.
        walk: sd of the random walks of gains and offset over the drive, in the noise of the output.
    """
    x = rng.standard_normal((SECONDS, ROWS, 7))
    # a lag is nearly a dead time
    x[:, :, 3:5] = 0.9 * x[:, :, 5:7] + 0.4 * x[:, :, 3:5]
    walks = walk * np.cumsum(rng.standard_normal((SECONDS, 3)), axis=0) / SECONDS**0.5
    output = np.einsum("bri,bi->br", x[:, :, :3], 3.0 + walks)
    output += 1e-6 * ppm * np.arange(SECONDS)[:, None] * x[:, :, 5:7].sum(axis=2)
    output += rng.standard_normal((SECONDS, ROWS))
    columns = np.concatenate([x, output[:, :, None]], axis=2)
    products: Array = columns.transpose(0, 2, 1) @ columns
    return products


def drift(products: Array) -> dead_time_trend.DeadTimeTrend:
    """Of both inputs, with a block per second."""
    found = dead_time_trend.fit(products, INPUTS, np.arange(len(products), dtype=np.float64))
    assert found is not None
    return found


@mostly(0.9)
def test_a_drift_is_within_its_interval(seed: int) -> None:
    """In either direction; of 95 %, times 1.3."""
    for ppm in (-1000.0, 500.0):
        found = drift(parts(np.random.default_rng(seed), ppm))
        assert found.found
        assert abs(found.rate - 1e-6 * ppm) < 2.6 * found.sd
        assert ("grow" if ppm > 0.0 else "fall") in dead_time_trend.says(found)


@pytest.mark.parametrize("walk", [0.0, 1.0])
def test_nothing_drifts_where_only_gains_and_levels_wander(walk: float, seed: int) -> None:
    """Of 100 drives none is beyond 3.9 standard deviations, and these are what they say."""
    rng = np.random.default_rng(seed)
    z = np.array([one.rate / one.sd for one in (drift(parts(rng, walk=walk)) for _ in range(100))])
    # chance of either: less than 1e-5, of normal numbers
    assert np.abs(z).max() < 5.0
    assert 0.6 < z.std() < 1.3


def test_a_short_drive_has_none() -> None:
    """Of few clusters of half a minute the variance is not known."""
    short = parts(np.random.default_rng(1))[:200]
    assert dead_time_trend.fit(short, INPUTS, np.arange(200.0)) is None
    assert dead_time_trend.says(None) == ""


def test_no_method_quotes_delays_that_drift() -> None:
    """Gains stay, and the reason is said with each method; the diagnosis next to it is one of them."""
    one = Interval(0.5, 0.4, 0.6)
    channel = Channel(one, one, one, one, Identifiable.OK)
    says = dead_time_trend.says(dead_time_trend.DeadTimeTrend(1e-3, 1e-4))
    drifting = WholeDrive({"range_rate": channel}, details={"dead_time_trend": says})
    out = arbitrated({"fopdt": drifting, "armax": WholeDrive({"range_rate": channel})})
    for result in out.values():
        assert result is not None
        assert result.channels["range_rate"].status is Identifiable.GAIN_ONLY
        assert result.lines == (says,)
    left, why, _ = diagnosed({"range_rate": channel}, {"fopdt": drifting}, None)
    assert left["range_rate"].status is Identifiable.GAIN_ONLY
    assert why == (says,)


@pytest.mark.slow("identifies drives of ten minutes")
@mostly(0.7)
def test_a_clock_of_the_output_that_runs_off_is_found(seed: int) -> None:
    """At 1500 ppm, over 10 min; not without."""
    drive = drawn_drive("Helly", seed)
    sound = identified(drive)
    assert sound is not None
    assert not any("dead times" in line for result in sound.whole.values() if result for line in result.lines)
    off = clock(drive, 1500.0, np.random.default_rng(seed), role=OUTPUT)
    found = drive_parameters.whole_drive(trace(off))
    assert any(
        "dead times fall" in line for result in found.whole.values() if result for line in result.lines
    )
    assert found.channels["range_rate"].status in (Identifiable.GAIN_ONLY, Identifiable.NOT)
