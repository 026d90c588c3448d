"""Lateral offsets that stand for no lane are left out; those of a lane are not, however coarse, slow or steady."""

from __future__ import annotations

import numpy as np
import pytest

import canid
from canid.signals.samples import no_lane
from canid.signals.signal_checks.drive_time import fitted_trace
from canid.signals.vehicle.decoding_state import Decoded, RoleReadings
from canid.values.types import Array, Trace
from tests.plants import lane_two
from tests.plants.lane_measurement import ANGLE_STEP, OFFSET_STEP_M, rounded
from tests.seeds import mostly

MINUTES = 6.0


def drive(seed: int, rate: int = 20, minutes: float = MINUTES) -> dict[str, Array]:
    """Columns of a drive of the lane keeper that is not canid's, at `rate` Hz."""
    noise = lane_two.NOISES[seed % len(lane_two.NOISES)]
    made = lane_two.plant({}, seed=seed, minutes=minutes, noise=noise, curves=3e-4 * (seed % 2))
    every = round(1.0 / (rate * made.dt))
    columns = {name: x[::every] for name, x in made.columns.items()}
    columns["steering_angle"] = rounded(columns["steering_angle"], ANGLE_STEP)
    return columns


def holes(seed: int, t: Array) -> Array:
    """Where the camera sees no lane, in stretches of 1.5 to 8 s."""
    rng = np.random.default_rng(seed)
    none = np.zeros(len(t), bool)
    for begin in rng.uniform(0.0, t[-1] - 8.0, 12):
        none |= (begin < t) & (begin + rng.uniform(1.5, 8.0) > t)
    return none


def left_out(t: Array, offset: Array, speed: Array, cut: int = 10**6) -> Array:
    """Which offsets are left out, in chunks of `cut` frames."""
    state, out = no_lane.init(), []
    for begin in range(0, len(t), cut):
        part = slice(begin, begin + cut)
        rows = np.arange(len(t[part]))
        readings = (
            RoleReadings("lateral_offset", rows, offset[part]),
            RoleReadings("speed", rows, speed[part]),
        )
        state, decoded, counts = no_lane.step(state, Decoded(readings, (), ()), t[part])
        out.append(np.isnan(decoded.roles[0].value))
        assert sum(counts.values()) == out[-1].sum()
    return np.concatenate(out)


@pytest.mark.parametrize("rate", [10, 20, 50])
@pytest.mark.parametrize("number", [0.0, 3.2, -0.4])
def test_a_number_that_stands_for_no_lane(rate: int, number: float, seed: int) -> None:
    """Nearly all of its readings, and hardly another one; however the frames are divided."""
    columns = drive(seed, rate)
    t, speed = columns["t"], columns["speed"]
    none = holes(seed, t)
    offset = np.where(none, number, rounded(columns["lateral_offset"], OFFSET_STEP_M))
    found = left_out(t, offset, speed)
    # of another number than 0 the first two stretches are not known; of a stretch that no jump begins, the first second
    assert found[none].mean() > 0.6
    assert found[~none].mean() < 0.005
    assert (left_out(t, offset, speed, 997) == found).all()


@pytest.mark.parametrize("step", [0.002, 0.005, 0.02])
@pytest.mark.parametrize("rate", [10, 20, 50])
def test_offsets_of_a_lane_are_kept(step: float, rate: int, seed: int) -> None:
    """In fine and coarser steps, with noise, and where a camera repeats each offset for as much as 2 s."""
    columns = drive(seed, rate)
    t, speed = columns["t"], columns["speed"]
    noise = np.random.default_rng(seed).normal(0.0, 0.01, len(t))
    offset = rounded(columns["lateral_offset"], step)
    assert not left_out(t, offset, speed).any()
    assert not left_out(t, rounded(columns["lateral_offset"] + noise, step), speed).any()
    for period in (0.2, 0.5, 1.0, 2.0):
        held = offset[np.searchsorted(t, np.floor(t / period) * period - 1e-9)]
        assert not left_out(t, held, speed).any()


def test_a_lane_change_and_a_standstill_are_no_holes(seed: int) -> None:
    """The offset jumps by the width of a lane and moves on; a car that stands has one offset."""
    columns = drive(seed)
    t, speed = columns["t"], columns["speed"].copy()
    offset = rounded(columns["lateral_offset"] + np.where(t % 60.0 < 30.0, 0.0, 3.5), OFFSET_STEP_M)
    assert not left_out(t, offset, speed).any()
    stands = (t > 60.0) & (t < 90.0)
    offset[stands], speed[stands] = 0.0, 0.0
    assert not left_out(t, offset, speed).any()


@pytest.mark.long("takes whole drives")
def test_estimates_do_not_depend_on_what_a_camera_sends_without_a_lane(seed: int) -> None:
    """The gain is that of the offsets that were measured; a zero that counts as one makes it smaller by a third."""
    columns = drive(seed)
    none = holes(seed, columns["t"])
    measured = rounded(columns["lateral_offset"], OFFSET_STEP_M)

    def gain(offset: Array) -> tuple[float, float, float]:
        given = {name: x for name, x in columns.items() if name != "t"} | {"lateral_offset": offset}
        trace: Trace = canid.from_arrays(time=columns["t"], task="lane_keeping", **given)
        K = canid.identify(trace, select_orders=False, sliding=False).channels["lateral_offset"].K
        return K.value, K.low, K.high

    absent, zeros = (gain(np.where(none, number, measured)) for number in (np.nan, 0.0))
    # half of the half width of its interval
    assert abs(zeros[0] - absent[0]) < 0.25 * (absent[2] - absent[1])


@pytest.mark.long("takes whole drives")
@mostly(0.9)
def test_nothing_is_learned_from_a_zero_that_stands_for_no_lane(seed: int) -> None:
    """Of a drive whose offsets are used as where they are absent: 11 samples of the first second halved a gain."""
    columns = drive(seed)
    measured = rounded(columns["lateral_offset"], OFFSET_STEP_M)
    none = holes(seed, columns["t"])

    def learned(number: float) -> tuple[Array, Array]:
        given = {name: x for name, x in columns.items() if name != "t"}
        given["lateral_offset"] = np.where(none, number, measured)
        trace = fitted_trace(canid.from_arrays(time=columns["t"], task="lane_keeping", **given))
        return trace.inputs[:, 0], trace.learn & np.isfinite(trace.inputs[:, 0])

    (zeros, used), (absent, known) = learned(0.0), learned(np.nan)
    assert used.mean() > 0.5
    # a stretch that begins near the middle of the lane differs by what the car moves in a second
    assert not (used & ~known & (np.abs(zeros) < 1e-9)).sum() > 3
    assert np.abs(zeros - absent)[used & known].max() < 0.05
