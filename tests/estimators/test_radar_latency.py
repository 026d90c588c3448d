"""A radar's stated latency is added to dead times, with its uncertainty, by every estimator, live and over a whole drive."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import canid
from canid.analysis.drive import drive_parameters
from canid.mathematics.estimators import ESTIMATORS
from canid.mathematics.estimators.windows import reported_estimates
from canid.signals.vehicle import read_vehicle
from canid.values.types import Latency, Status, Trace

REPO = Path(__file__).parents[2]
LATE = Latency(0.12, 0.03)


@pytest.fixture(scope="module")
def trace() -> Trace:
    """Two minutes in town."""
    whole = canid.read_trace(REPO / "replay_logs" / "following_urban.blf", "generic")
    return whole


def test_the_vehicle_file_states_it(tmp_path: Path) -> None:
    """In [lead], as a value and what is not known of it; it reaches the driver and both estimators' settings."""
    made = read_vehicle("generic")
    source = Path(made.path)
    text = source.read_text(encoding="utf-8")
    section = "latency = { value = 0.12, sd = 0.03 }\n"
    text = (
        text.replace("[lead]\n", "[lead]\n" + section) if "[lead]" in text else f"{text}\n[lead]\n{section}"
    )
    for dbc in source.parent.glob("*.dbc"):
        shutil.copy(dbc, tmp_path / dbc.name)
    text = text.replace('"../', f'"{source.parents[1].as_posix()}/')
    file = tmp_path / "late.toml"
    file.write_text(text, encoding="utf-8")
    vehicle = read_vehicle(str(file))
    assert vehicle.driver.latency == LATE
    assert {settings.latency for settings in vehicle.estimators.values()} == {LATE}
    assert made.driver.latency is None


@pytest.mark.slow("identifies a drive twice")
def test_a_whole_drive_adds_it(trace: Trace) -> None:
    """To dead times and sums of both methods, one to one; intervals grow by its uncertainty; gains stay."""
    plain, late = (
        canid.identify(drive, select_orders=False, sliding=False).whole
        for drive in (trace, trace._replace(latency=LATE))
    )
    for name, found in plain.items():
        other = late[name]
        assert found is not None
        assert other is not None
        for key, channel in found.channels.items():
            moved = other.channels[key]
            assert moved.K == channel.K
            assert moved.status is channel.status
            for one, two in (
                (channel.dead_time, moved.dead_time),
                (channel.tau_plus_dead_time, moved.tau_plus_dead_time),
            ):
                if one.value == one.value:
                    assert two.value - one.value == pytest.approx(0.12, abs=1e-6)
                    assert two.high - two.value > one.high - one.value
        assert any("latency" in line for line in other.lines)


@pytest.mark.slow("windows of a drive")
def test_windows_add_it(trace: Trace) -> None:
    """The same estimates as without, moved."""

    def made(latency: Latency | None) -> list[float]:
        running = [of.make(trace.input_names, trace.dt, of.settings(latency=latency)) for of in ESTIMATORS]
        every = reported_estimates(running, drive_parameters.samples(trace))
        return [e.channels["range_rate"].tau_plus_dead_time.value for e in every if e.status is Status.OK]

    plain, late = made(None), made(LATE)
    assert len(plain) > 3
    assert [b - a for a, b in zip(plain, late, strict=True) if a == a] == pytest.approx(
        [0.12] * sum(a == a for a in plain), abs=1e-6
    )
