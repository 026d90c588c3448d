"""Times whose parts have columns of their own, GPS weeks, names with line feeds, and gaps in yards."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.tables.table import Table, open_table
from canid.values.errors import ConfigError
from tests.tables.loggers import Columns, columns
from tests.tables.platoon import platoon

NAMES = "speed [km/h],gap [m],range_rate [m/s],pedal [%]"
# IERS Bulletin C 52: from 2017 on UTC is 18 s behind GPS, which has counted since 6 January 1980
GPS = datetime.datetime(1980, 1, 6, tzinfo=datetime.UTC) - datetime.timedelta(seconds=18)
Stamps = list[datetime.datetime]


def written(path: Path, of: Columns, head: str, first: list[list[str]]) -> Table:
    rows = [head]
    for cells, v, gap, rate, pedal in zip(
        zip(*first, strict=True), of.speed, of.gap, of.rate, of.pedal, strict=True
    ):
        rows.append(",".join([*cells, f"{3.6 * v:.5f}", f"{gap:.5f}", f"{rate:.5f}", f"{pedal:.4f}"]))
    path.write_text("\n".join(rows) + "\n")
    return open_table(path)


def times(table: Table) -> np.ndarray:
    """Of the readings of the speed."""
    return np.unique(np.concatenate([chunk.t for chunk in table.log.columns()]))


def drawn(seed: int) -> tuple[Columns, Stamps, np.ndarray]:
    """A drive with a pause of minutes, which begins some s before midnight."""
    rng = np.random.default_rng(seed)
    of = columns(platoon(seed % 1000, 1.0))
    t = of.t + np.where(np.arange(len(of.t)) < len(of.t) // 2, 0.0, 60.0 * rng.integers(2, 50))
    day = datetime.datetime(2018 + seed % 8, 2, 28, 23, 59, tzinfo=datetime.UTC)
    zero = day + datetime.timedelta(milliseconds=100 * int(rng.integers(100, 599)))
    return of, [zero + datetime.timedelta(milliseconds=round(1000 * x)) for x in t], t


FORMS: dict[str, Callable[[datetime.datetime], list[str]]] = {
    "Year,Month,Day,Hour,Minute,Second": lambda at: [
        str(at.year), str(at.month), str(at.day), str(at.hour), str(at.minute), f"{at.second + at.microsecond / 1e6:.1f}",
    ],
    "hours,minutes,seconds": lambda at: [str(at.hour), str(at.minute), f"{at.second}.{at.microsecond // 100_000}"],
    "hour,min,sec,ms": lambda at: [str(at.hour), str(at.minute), str(at.second), str(at.microsecond // 1000)],
    "Date,utc_hour,utc_minute,utc_second": lambda at: [
        f"{at:%Y-%m-%d}", str(at.hour), str(at.minute), f"{at.second}.{at.microsecond // 100_000}",
    ],
    "Time [h],Time [min],Time [s]": lambda at: [str(at.hour), str(at.minute), f"{at.second + at.microsecond / 1e6:.1f}"],
    "GPS Week,GPS TOW (s)": lambda at: [str((at - GPS).days // 7), f"{(at - GPS).total_seconds() % 604_800:.1f}"],
    "Week,Seconds": lambda at: [str((at - GPS).days // 7), f"{(at - GPS).total_seconds() % 604_800:.1f}"],
    "week,iTOW": lambda at: [str((at - GPS).days // 7), f"{round((at - GPS).total_seconds() * 1000) % 604_800_000}"],
}  # fmt: skip


@pytest.mark.parametrize("head", FORMS)
def test_parts_of_the_clock_are_one_time(head: str, tmp_path: Path, seed: int) -> None:
    """Over midnight, and over a pause that seconds alone do not show."""
    of, stamps, t = drawn(seed)
    table = written(
        tmp_path / "x.csv",
        of,
        f"{head},{NAMES}",
        list(map(list, zip(*map(FORMS[head], stamps), strict=True))),
    )
    got = times(table)
    np.testing.assert_allclose(got, t - t[0], atol=1e-6)
    dated = head.startswith(("Year", "Date", "GPS", "week", "Week"))
    assert table.log.start_ns == (round(stamps[0].timestamp() * 1000) * 10**6 if dated else None)
    assert any("UTC is taken as 18 s behind" in note for note in table.notes) == ("eek" in head)


def test_a_gps_week_goes_over_and_one_of_ten_bits_states_no_date(tmp_path: Path, seed: int) -> None:
    of, _, _ = drawn(seed)
    at = 604_800.0 - float(np.random.default_rng(seed).integers(5, 50)) + of.t
    for zero, dated in ((2304, True), (256, False)):
        cells = [[str(zero + int(x // 604_800)) for x in at], [f"{x % 604_800:.1f}" for x in at]]
        table = written(tmp_path / "x.csv", of, f"gps_week,tow [s],{NAMES}", cells)
        np.testing.assert_allclose(times(table), of.t, atol=1e-6)
        assert (table.log.start_ns is not None) == dated


def test_parts_may_have_decimal_commas(tmp_path: Path, seed: int) -> None:
    of, stamps, t = drawn(seed)
    rows = ["Year;Month;Day;Hour;Minute;Second;" + NAMES.replace(",", ";")]
    for at, *values in zip(stamps, 3.6 * of.speed, of.gap, of.rate, of.pedal, strict=True):
        first = FORMS["Year,Month,Day,Hour,Minute,Second"](at)
        rows.append(";".join([*first, *(f"{x:.5f}" for x in values)]).replace(".", ","))
    (tmp_path / "x.csv").write_text("\n".join(rows))
    table = open_table(tmp_path / "x.csv")
    np.testing.assert_allclose(times(table), t - t[0], atol=1e-6)
    assert table.log.start_ns == round(stamps[0].timestamp() * 1000) * 10**6


def test_seconds_that_count_on_have_no_minutes(tmp_path: Path, seed: int) -> None:
    """A column "min" next to them is a least value, whatever the first rows show; hours up to twelve state no date."""
    of, stamps, t = drawn(seed)
    of = of._replace(t=0.2 * of.t)
    slow = [[f"{5 * x:.1f}" for x in of.t], ["3"] * len(of.t)]
    np.testing.assert_allclose(
        times(written(tmp_path / "x.csv", of, f"seconds,min,{NAMES}", slow)), 5 * of.t, atol=1e-6
    )
    parts = [*map(list, zip(*(FORMS["Year,Month,Day,Hour,Minute,Second"](at) for at in stamps), strict=True))]
    table = written(
        tmp_path / "x.csv", of, f"Year,Month,Day,Hour,Minute,Second,AM/PM,{NAMES}", [*parts, ["PM"] * len(t)]
    )
    assert table.log.start_ns is None


def test_stamps_of_ros_below_a_path_have_their_ns(tmp_path: Path, seed: int) -> None:
    of, stamps, t = drawn(seed)
    cells = [[str(int(x.timestamp())) for x in stamps], [str(x.microsecond * 1000) for x in stamps]]
    names = ("header/stamp/sec", "header/stamp/nanosec", *NAMES.split(","))
    head = ",".join(f"/ego/{name}" for name in names)
    np.testing.assert_allclose(times(written(tmp_path / "x.csv", of, head, cells)), t - t[0], atol=1e-6)


def test_names_in_quotes_may_hold_line_feeds(tmp_path: Path, seed: int) -> None:
    of, _, _ = drawn(seed)
    head = '"Time\n[s]","Vehicle\nspeed\n[km/h]",gap [m],"Relative\nspeed [m/s]",pedal [%]'
    table = written(tmp_path / "x.csv", of, head, [[f"{x:.1f}" for x in of.t]])
    assert (len(times(table)), table.damaged) == (len(of.t), 0)
    assert "Vehicle speed [km/h]" in table.columns


@pytest.mark.parametrize(
    ("gap", "rate", "says"), [(0.9144, 1.0, "yd"), (0.3048, 1 / 3.6, "ft with km/h"), (1.0, 1.0, "")]
)
def test_a_gap_without_a_unit_is_refused_where_it_is_in_yards(
    gap: float, rate: float, says: str, tmp_path: Path, seed: int
) -> None:
    """And one in m is read, with the noise of a radar."""
    of, rng = columns(platoon(seed % 1000, 3.0)), np.random.default_rng(seed)
    noisy = of.gap + 0.1 * rng.normal(size=len(of.t))
    of = of._replace(gap=noisy / gap, rate=(of.rate + 0.05 * rng.normal(size=len(of.t))) / rate)
    head = "time [s],speed [km/h],gap,range_rate,pedal [%]"
    cells = [[f"{x:.1f}" for x in of.t]]
    if not says:
        written(tmp_path / "x.csv", of, head, cells)
        return
    with pytest.raises(ConfigError, match=says):
        written(tmp_path / "x.csv", of, head, cells)


@pytest.mark.parametrize("cell", ["nan", "inf", "1e400", "-", ""])
@pytest.mark.parametrize("head", ["Time,ms", "hour,min,sec,ms", "GPS Week,GPS TOW (s)"])
def test_a_part_that_is_no_number_is_no_exception(head: str, cell: str, tmp_path: Path, seed: int) -> None:
    """A status or one clear line, whichever of the first rows it is in."""
    of, stamps, _ = drawn(seed)
    form = FORMS.get(head, lambda at: [f"{at:%H:%M:%S}", str(at.microsecond // 1000)])
    cells = list(map(list, zip(*map(form, stamps), strict=True)))
    cells[-1][seed % 100] = cell
    try:
        table = written(tmp_path / "x.csv", of, f"{head},{NAMES}", cells)
    except ConfigError as error:
        assert "\n" not in str(error)  # noqa: PT017
        return
    assert np.isfinite(times(table)).all()
