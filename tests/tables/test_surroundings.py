"""What stands around and next to the measurements of a table is no measurement."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from canid.analysis.tables.sources.grouped_numbers import any_by_commas
from canid.analysis.tables.table import open_table
from canid.values.types import Array
from tests.samples.test_missing_codes import T, motion
from tests.tables.reading import read_table

N = 600


def written(path: Path, names: list[str], columns: list[Array | list[str]], after: str = "") -> Path:
    """A table of these columns, with some text below."""
    cells = [[x if isinstance(x, str) else f"{x:.4f}" for x in column] for column in columns]
    lines = [",".join(names), *(",".join(row) for row in zip(*cells, strict=True))]
    path.write_text("\n".join(lines) + "\n" + after, encoding="utf-8")
    return path


def test_means_and_sums_below_the_rows_are_no_rows(tmp_path: Path, seed: int) -> None:
    """Whose time lies within the drive; they are counted as what they are."""
    now = {role: x[:N] for role, x in motion(seed).items()}
    index = [str(k) for k in range(N)]
    after = "mean,30.0,1.0,1.0,1.0,1.0\nStd.,17.3,1.0,1.0,1.0,1.0\nmax:,59.9,1,1,1,1\n"
    path = written(tmp_path / "x.csv", ["", "time [s]", *now], [index, T[:N], *now.values()], after)
    table = open_table(path)
    assert list(table.log.columns())[-1].t[-1] == pytest.approx(T[N - 1])
    assert sum(len(chunk.t) for chunk in table.log.columns()) == N
    assert table.damaged == 0
    assert dict(table.log.other_kinds)["footer lines"] == 3


@pytest.mark.parametrize("name", ["gap_valid", "Range valid"])
def test_the_flag_of_a_gap_says_where_there_is_none(tmp_path: Path, name: str, seed: int) -> None:
    """A gap that is held while its flag is 0 is in no sample that is learned from."""
    now = {role: x[:N].copy() for role, x in motion(seed).items()}
    valid = np.ones(N)
    for begin in (100, 250, 400):
        valid[begin : begin + 30] = 0.0
        now["gap"][begin : begin + 30] += 3.0
    path = written(tmp_path / "x.csv", ["time [s]", *now, name], [T[:N], *now.values(), valid])
    trace = read_table(path)
    there = np.interp(trace.t, T[:N], valid) == 1.0
    assert not trace.learn[~there].any()
    assert trace.learn[there].mean() > 0.4


@pytest.mark.parametrize(
    ("rows", "group"),
    [
        ([["22,329", "35.60", "-0,004"]], False),
        ([["22,329", "35.60", "12,5"]], False),
        ([["22,329", "35.60"]], True),
        ([["1,118,846"]], True),
    ],
)
def test_commas_group_nothing_next_to_a_decimal_comma(rows: list[list[str]], group: bool) -> None:
    """-0,004 and 12,5 are no thousands, so 22,329 is none either."""
    assert any_by_commas(rows) is group


def test_a_clock_of_seconds_is_left_for_a_counter(tmp_path: Path, seed: int) -> None:
    """The time by satellite repeats itself; the time since the logger's start does not."""
    now = {role: x[:N] for role, x in motion(seed).items()}
    clock = [f"2026-08-05T10:00:{int(t):02d}Z" for t in T[:N]]
    up = [f"{1000 * t + 123456:.0f}" for t in T[:N]]
    path = written(tmp_path / "x.csv", ["gps_time", "uptime_ms", *now], [clock, up, *now.values()])
    assert read_table(path).learn.mean() > 0.9


@pytest.mark.parametrize(("unit", "per"), [("ft/min", 60 / 0.3048), ("m/min", 60.0), ("cm_s", 100.0)])
def test_speeds_per_minute_and_in_centimetres(tmp_path: Path, unit: str, per: float, seed: int) -> None:
    """As aviation, cranes and small microcontrollers have them."""
    now = {role: x[:N].copy() for role, x in motion(seed).items()}
    columns = [T[:N], now["speed"] * per, now["gap"], now["range_rate"] * per, now["pedal"]]
    names = (
        [f"speed_{unit}", f"range_rate_{unit}"]
        if "_" in unit
        else [f"speed [{unit}]", f"range_rate [{unit}]"]
    )
    path = written(tmp_path / "x.csv", ["time [s]", names[0], "gap [m]", names[1], "pedal [%]"], columns)
    trace = read_table(path)
    assert np.nanmax(np.abs(trace.signals["speed"] - np.interp(trace.t, T[:N], now["speed"]))) < 0.1
