"""Gaps that stand for no vehicle ahead are left out, and those of vehicles never are, however coarse or steady."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.models.pipeline import pipeline
from canid.signals.samples import no_target, trace_assembly
from canid.signals.vehicle import Vehicle
from canid.signals.vehicle.decoding_state import Decoded, RoleReadings
from canid.values.frame_columns import chunks
from canid.values.types import NAN, Array, Frame, Sample, Trace
from tests import seeds
from tests.samples.radar import ROWS, SPEED, T, frames, motion, vehicle

# raw distance and rate that a radar sends without a target
NONE = {"zeros": (0, 164), "all zeros": (0, 0), "all ones": (2047, 511)}


def holes(seed: int) -> Array:
    """Where there is no target, in stretches of 4 to 15 s."""
    rng = np.random.default_rng(seed)
    none = np.zeros(len(T), bool)
    for begin in rng.uniform(20.0, 280.0, 6):
        none |= (begin < T) & (begin + rng.uniform(4.0, 15.0) > T)
    return none


def left_out(gap: Array, rate: Array, speed: Array, largest: float = math.inf, cut: int = 6000) -> Array:
    """Which gaps are left out, in chunks of `cut` frames."""
    state, out = no_target.init(), []
    for begin in range(0, len(T), cut):
        part = slice(begin, begin + cut)
        rows = np.arange(len(T[part]))
        columns = (("range_rate", rate), ("gap", gap), ("speed", speed))
        readings = tuple(RoleReadings(role, rows, x[part]) for role, x in columns)
        state, decoded, _ = no_target.step(state, Decoded(readings, (), ()), T[part], largest)
        hidden = np.isnan(decoded.roles[1].value)
        assert (np.isnan(decoded.roles[0].value) == hidden).all(), "without a gap there is no range rate"
        out.append(hidden)
    return np.concatenate(out)


@pytest.mark.parametrize(("number", "rate_there"), [(0.0, 0.0), (0.0, -16.4), (204.7, 34.7), (-0.5, 0.0)])
def test_zero_and_the_largest_number_are_none_at_once(number: float, rate_there: float, seed: int) -> None:
    """From the first report on, and no other."""
    none, (gap, rate) = holes(seed), motion(seed)
    gap, rate = np.where(none, number, np.round(gap, 1)), np.where(none, rate_there, np.round(rate, 1))
    assert (left_out(gap, rate, SPEED, 204.7) == none).all()


# on 2 of 10,000 drives a lead whose readings stand still for more than 8 s after a hole (0.1 m, 0.0 m/s) is taken for none
# for up to 3 s: the readings are those of such a number
@pytest.mark.parametrize("number", [150.0, 255.0, 0.5])
@seeds.mostly(0.999)
def test_a_number_that_stands_still_is_none_once_it_is_known(number: float, seed: int) -> None:
    """Of the first stretch some seconds are missing; all later ones are found with their first report, and no vehicle is."""
    none, (gap, rate) = holes(seed), motion(seed)
    gap, rate = np.where(none, number, np.round(gap, 1)), np.where(none, 0.0, np.round(rate, 1))
    found = left_out(gap, rate, SPEED)
    assert not (found & ~none).any()
    assert (found == none)[np.flatnonzero(found)[0] :].all()
    assert found.sum() > 0.6 * none.sum()


@pytest.mark.parametrize("step", [0.01, 0.1, 0.5, 1.0])
def test_a_vehicle_at_a_nearly_constant_gap_is_none_never(step: float, seed: int) -> None:
    """A coarse gap stands still for seconds while both vehicles change their speed; another one comes, too."""
    rng = np.random.default_rng(seed)
    _, rate = motion(seed)
    gap = 30.0 + 0.05 * np.cumsum(0.1 * (rate - rate.mean()))
    gap[3000:] += 25.0
    rate = np.round(0.1 * rate + rng.normal(0.0, 0.03, len(rate)), 1)
    assert not left_out(np.round(gap / step) * step, rate, SPEED).any()


def test_a_standing_vehicle_and_a_radar_that_hangs_are_not_none(seed: int) -> None:
    """In a queue nothing moves; a last report that is repeated is a fault of its own."""
    gap, rate = motion(seed)
    stands = (T > 100.0) & (T < 160.0)
    queue = np.where(stands, 0.0, SPEED)
    assert not left_out(np.where(stands, 4.2, gap), np.where(stands, 0.0, rate), queue).any()
    assert not left_out(np.where(stands, 0.0, gap), np.where(stands, 0.0, rate), queue).any()
    hung = np.where(stands, gap[2000], gap), np.where(stands, rate[2000], rate)
    assert not left_out(*hung, SPEED).any()


def test_a_drive_that_begins_in_equilibrium_is_behind_a_lead() -> None:
    """Nothing moves at first, the own speed neither."""
    gap, rate = motion(1)
    begins = T < 30.0
    speed = np.where(begins, 22.0, SPEED)
    assert not left_out(np.where(begins, gap[600], gap), np.where(begins, 0.0, rate), speed).any()


def test_a_radar_that_never_has_a_target_is_found() -> None:
    """By its first number, once the own speed has changed."""
    found = left_out(np.full(len(T), 250.0), np.zeros(len(T)), SPEED)
    assert found[400:].all()


def test_chunks_do_not_matter(seed: int) -> None:
    """One frame at a time, or all."""
    none, (gap, rate) = holes(seed), motion(seed)
    gap, rate = np.where(none, 150.0, np.round(gap, 1)), np.where(none, 0.0, np.round(rate, 1))
    gap[none & (T < 100.0)] = 0.0
    whole = left_out(gap, rate, SPEED)
    assert (left_out(gap, rate, SPEED, cut=1) == whole).all()
    assert (left_out(gap, rate, SPEED, cut=37) == whole).all()


@pytest.fixture(scope="module")
def radar(tmp_path_factory: pytest.TempPathFactory) -> Vehicle:
    """A radar without a flag."""
    return vehicle(tmp_path_factory.mktemp("radar"))


def traced(car: Vehicle, several: list[Frame], size: int) -> tuple[Trace, dict[str, int]]:
    """The samples of a drive, and what was left out."""
    running = pipeline.build(car, estimating=False)
    state, samples = running.init(), []
    for chunk in chunks(several, size):
        state, out = running.step(state, chunk)
        samples += [item for _, item in out if isinstance(item, Sample)]
    return trace_assembly.trace(samples, car.driver, pipeline.DT), dict(state.sampler.decoding.counters)


@pytest.mark.long("takes whole drives")
@pytest.mark.parametrize("kind", NONE)
def test_samples_are_those_of_a_message_that_does_not_come(kind: str, radar: Vehicle, seed: int) -> None:
    """Who learns, and from what: the same; and the counters say why."""
    none = holes(seed)
    none[(T > 60.0) & (T < 70.0)] = True
    gone, nothing = traced(radar, frames(none, None, seed), 4096)
    read, counted = traced(radar, frames(none, NONE[kind], seed), 4096)
    assert not any("vehicle ahead" in what for what in nothing)
    assert [n for what, n in counted.items() if what.startswith("gap: ")] == [int(none[:ROWS].sum())]
    # at the end, what does not come is waited for
    n = min(len(gone.t), len(read.t))
    assert n > 1150
    assert (read.learn[:n] == gone.learn[:n]).mean() > 0.99
    both = np.flatnonzero(read.learn[:n] & gone.learn[:n])
    assert len(both) > 600
    np.testing.assert_allclose(read.inputs[both], gone.inputs[both], atol=0.02)


def test_samples_are_the_same_live(radar: Vehicle, seed: int) -> None:
    """In chunks of some frames, as on a bus, to the last bit."""
    none = (T > 20.0) & (T < 30.0)
    several = frames(none, NONE["zeros"], seed)[:1600]
    read, live = (traced(radar, several, size)[0] for size in (4096, 7))
    assert len(read.t) > 300
    np.testing.assert_array_equal(live.inputs, read.inputs)
    np.testing.assert_array_equal(live.learn, read.learn)


def test_a_flag_comes_first() -> None:
    """Where `lead_valid` says that there is none, nothing is added."""
    rows = np.arange(4)
    flag = RoleReadings("lead_valid", rows, np.array([1.0, 0.0, 1.0, 1.0]))
    gap = RoleReadings("gap", rows, np.array([30.0, 0.0, 0.0, 30.1]))
    _, decoded, counts = no_target.step(no_target.init(), Decoded((flag, gap), (), ()), T[:4], math.inf)
    assert np.isnan(decoded.roles[1].value).tolist() == [False, False, True, False]
    assert sum(counts.values()) == 1


def test_holes_are_not_runs() -> None:
    """Gaps that are not measured end a run: nothing is known of what was in between."""
    gap = motion(2)[0]
    gap[::2] = NAN
    state, decoded, counts = no_target.step(
        no_target.init(), Decoded((RoleReadings("gap", np.arange(len(T)), gap),), (), ()), T, math.inf
    )
    assert not counts
    assert not state.known
    assert np.isnan(decoded.roles[0].value).sum() == len(T) / 2
