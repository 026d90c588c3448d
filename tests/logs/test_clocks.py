"""Clocks of logs that pause, wrap or are set: no frame is lost, and durations, rates and samples are those of the drive."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive import drive_reader, vehicle_check
from canid.analysis.drive.drive_reader import Drive, read_drive
from canid.analysis.drive.signal_columns import rounds
from canid.io.logs import open_log
from canid.signals.vehicle import read_vehicle
from canid.ui.cli import main
from tests.exact import exact

DBC = """VERSION ""
BU_: A
BO_ 256 M: 8 A
 SG_ Pedal : 0|16@1+ (0.01,0) [0|100] "%" A
 SG_ Speed : 16|16@1+ (0.01,0) [0|400] "km/h" A
 SG_ Gap : 32|16@1+ (0.01,0) [0|300] "m" A
 SG_ Rate : 48|16@1- (0.005,0) [-100|100] "m/s" A
"""
CAR = """name = "m"
dbc = ["m.dbc"]
[signals]
pedal = "M.Pedal"
speed = "M.Speed"
gap = "M.Gap"
range_rate = "M.Rate"
"""
_END_S = 100.0
_WRAPS = {
    "32 bits, us": 2**32 * 1e-6,
    "32 bits, ms": 2**32 * 1e-3,
    "16 bits, ms": 65.536,
    "60 s": 60.0,
    "end of summer time": 3600.0,
}


@pytest.fixture
def log(tmp_path: Path, seed: int) -> Callable[[Callable[[float], float]], Path]:
    """Writes the same drive with other time stamps."""
    (tmp_path / "m.dbc").write_text(DBC)
    (tmp_path / "m.toml").write_text(CAR)
    rng = np.random.default_rng(seed)
    t = np.round(np.cumsum(rng.uniform(0.02, 0.08, int(_END_S / 0.04))), 3)
    t = t[t <= _END_S]
    raw = np.column_stack(
        [
            level + size * np.sin(0.1 * t + rng.uniform(0, 6)) + rng.normal(0, 2, len(t))
            for level, size in ((2000, 500), (9000, 500), (4000, 300), (0, 200))
        ]
    ).astype("<i2")

    def written(clock: Callable[[float], float]) -> Path:
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.log"
        lines = [
            f"({clock(at):.6f}) can0 100#{row.tobytes().hex().upper()}\n"
            for at, row in zip((t - t[0]).tolist(), raw, strict=True)
        ]
        path.write_text("".join(lines))
        return path

    return written


def read(path: Path, **part: float) -> Drive:
    return read_drive(path, path.with_name("m.toml"), estimating=False, **part)


@pytest.mark.long("many or long logs")
def test_a_counter_that_wraps(log: Callable[[Callable[[float], float]], Path]) -> None:
    """The samples, the signals, each part and the duration of the log whose clock goes on; said once."""
    part = {"start": 20.0, "stop": 80.0}

    def answers(path: Path) -> list[str]:
        drive, vehicle = read(path), path.with_name("m.toml")
        assert drive.health.back_in_time == ""
        assert len(drive.health.remarks) == (path != plain)
        return [
            exact(each)
            for each in (
                drive.trace,
                drive.health.duration,
                read(path, **part).trace,
                drive_reader.read_signals(path, vehicle),
                of_rounds(path),
                of_contents(path),
            )
        ]

    plain = log(lambda t: 1.7e9 + t)
    expected = answers(plain)
    for (name, period), start in product(_WRAPS.items(), (30.0, 99.4)):
        path = log(lambda t: (round((t - start) * 1e6) % round(period * 1e6)) * 1e-6)  # noqa: B023
        assert answers(path) == expected, (name, start)


def of_rounds(path: Path) -> list[float]:
    return [t for chunks in rounds(open_log(path)) for chunk in chunks for t in chunk.t.tolist()]


def of_contents(path: Path) -> str:
    return exact(vehicle_check.contents(open_log(path).columns()))


@pytest.mark.long("many or long logs")
@pytest.mark.parametrize("hours", [1.0, 2.0, 26.0])
def test_a_pause_of_hours(
    log: Callable[[Callable[[float], float]], Path], hours: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """All frames are used and keep their times; rates are those of the time in which frames came."""
    plain, path = log(lambda t: 1.7e9 + t), log(lambda t: 1.7e9 + t + (t >= 60.0) * hours * 3600.0)
    whole, drive = read(plain), read(path)
    assert drive.health.duration == pytest.approx(whole.health.duration + hours * 3600.0)
    assert drive.health.back_in_time == ""
    assert drive.health.remarks[0].startswith(f"no frame for {hours:g} h at ")
    # but for the edges of the pause the samples are those of the drive; a grid of 0.1 s divides these hours
    back = drive.trace.t - np.where(drive.trace.t > 1800.0, hours * 3600.0, 0.0)
    inside = (np.abs(back - 60.0) > 3.0) & (back < 95.0)
    k = np.searchsorted(whole.trace.t, back[inside] - 0.05)
    assert np.abs(drive.trace.output[inside] - whole.trace.output[k]).max() < 1e-3
    counted = vehicle_check.contents(open_log(path).columns())
    assert counted.paused == pytest.approx(hours * 3600.0, abs=0.1)
    checked = vehicle_check.check(open_log(path).columns(), read_vehicle(path.with_name("m.toml")))
    assert checked.duration == drive.health.duration
    rate = drive.health.frames / whole.health.duration
    assert [row.rate for row in checked.rows] == pytest.approx([rate] * len(checked.rows), rel=0.01)
    main(["check", str(path), "--vehicle", str(path.with_name("m.toml"))])
    printed = capsys.readouterr()
    assert "back in time" not in printed.out + printed.err
    assert f"{checked.duration:.1f} s of which {checked.paused:.1f} s without any frame" in printed.out


@pytest.mark.long("many or long logs")
def test_a_clock_that_is_set_cuts_the_drive(log: Callable[[Callable[[float], float]], Path]) -> None:
    """No frame is lost, and no sample is made of both parts."""
    path = log(lambda t: 1.7e9 + t - (t >= 60.0) * 1234.0)
    plain = read(log(lambda t: 1.7e9 + t))
    drive = read(path)
    assert drive.health.back_in_time == ""
    assert "is cut in two" in drive.health.remarks[0]
    steps = np.diff(drive.trace.t)
    assert (steps > 5.0).sum() == 1
    assert np.isfinite(drive.trace.output).sum() > np.isfinite(plain.trace.output).sum() - 60


def test_a_part_from_hours_on(log: Callable[[Callable[[float], float]], Path]) -> None:
    """The first frame of a part may be hours from the log's first."""
    path = log(lambda t: 1.7e9 + t + (t >= 60.0) * 7200.0)
    drive = read(path, start=7200.0 + 60.0)
    assert drive.health.remarks == ()
    assert drive.trace.t[0] == pytest.approx(7260.0, abs=0.3)
