"""Clocks and dates of tables: whatever a program writes, the same drive has the same times, to the last bit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.tables.table import Table, open_table
from canid.signals.samples import sampling_grid
from canid.values.errors import ConfigError
from tests.exact import exact

_HEAD = "speed,gap,range_rate,pedal"
_Drive = list[tuple[float, str]]
_NIGHT = datetime(2026, 8, 5, 23, 58, 20, tzinfo=UTC)


def drive(seed: int, n: int = 1200, dt: float = 0.1) -> _Drive:
    """Rows of a drive: time, s, and the cells; the columns go on from row to row as those of a car do."""
    rng = np.random.default_rng(seed)
    t = np.round(np.arange(n) * dt, 6)
    phase = rng.uniform(0, 6.0, 4)
    columns = [
        level + size * np.sin(0.05 * t + p)
        for level, size, p in zip((25, 40, 0, 20), (3, 8, 1, 9), phase, strict=True)
    ]
    noise = rng.normal(0.0, 0.01, (4, n))
    return [
        (float(t[k]), ",".join(f"{c[k] + e[k]:.3f}" for c, e in zip(columns, noise, strict=True)))
        for k in range(n)
    ]


def opened(path: Path, heading: str, rows: _Drive, written: Callable[[float], str]) -> Table:
    lines = [f"{written(t)},{cells}" for t, cells in rows]
    path.write_text("\n".join([f"{heading},{_HEAD}", *lines]) + "\n", encoding="utf-8")
    return open_table(path)


def frames(table: Table) -> str:
    return exact(tuple(table.log.columns()))


def at(pattern: str, start: datetime = _NIGHT) -> Callable[[float], str]:
    """Times in a pattern of strftime; %L: ms."""

    def written(t: float) -> str:
        stamp = start + timedelta(seconds=t)
        return stamp.strftime(pattern.replace("%L", f"{stamp.microsecond // 1000:03d}"))

    return written


DATES = {
    "05-Aug-2026": ("time", "%d-%b-%Y %H:%M:%S.%L"),
    "05.08.2026": ("time", "%d.%m.%Y %H:%M:%S.%L"),
    "month first, 12 hours": ("time", "%m/%d/%Y %I:%M:%S.%L %p"),
    "day first": ("time", "%d/%m/%Y %H:%M:%S.%L"),
    "two digits of the year": ("time", "%d.%m.%y %H:%M:%S.%L"),
    "two digits of the year, first": ("time", "%y/%m/%d %H:%M:%S.%L"),
    "a month's name between two digits each": ("time", "%y-%b-%d %H:%M:%S.%L"),
    "weekday": ("time", "%a %d %b %Y %H:%M:%S.%L"),
    "month's name first": ("time", '"%b %d, %Y %H:%M:%S.%L"'),
    "ISO": ("time", "%Y-%m-%dT%H:%M:%S.%LZ"),
    "ISO, UTC": ("time", "%Y-%m-%d %H:%M:%S.%L UTC"),
    "year first, with points": ("time", "%Y.%m.%d %H:%M:%S.%L"),
    "a column of dates alone": ("date", "%d.%m.%Y %H:%M:%S.%L"),
    "two columns, ISO": ("Date,Time", "%Y-%m-%d,%H:%M:%S.%L"),
    "two columns, day first": ("Date,Time", "%d/%m/%Y,%H:%M:%S.%L"),
    "two columns, month first": ("Date,Time", "%m/%d/%Y,%I:%M:%S.%L %p"),
    "two columns, the time first": ("Time,Date", "%H:%M:%S.%L,%d-%b-%Y"),
    "SAS": ("time", "%d%b%Y:%H:%M:%S.%L"),
    "servers' logs": ("time", "%d/%b/%Y:%H:%M:%S.%L"),
    "ordinal, of telemetry": ("time", "%Y:%j:%H:%M:%S.%L"),
    "ordinal, without marks": ("time", "%Y%jT%H:%M:%S.%L"),
    "clock": ("time", "%H:%M:%S.%L"),
    "clock behind the day of the year": ("time", "%j:%H:%M:%S.%L"),
    "clock of 12 hours": ("time", "%I:%M:%S.%L %p"),
    "the date of the first row in all rows": ("Date,Time", "2026-08-05,%H:%M:%S.%L"),
}


@pytest.mark.long("many or long tables")
@pytest.mark.parametrize("name", DATES)
def test_dates_as_programs_write_them(tmp_path: Path, name: str, seed: int) -> None:
    """Over midnight, in one column or two: the frames and the start of times in s; the order of day and month is said."""
    rows = drive(seed)
    heading, pattern = DATES[name]
    table = opened(tmp_path / "x.csv", heading, rows, at(pattern))
    assert frames(table) == frames(opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.3f}"))
    if not name.startswith("clock"):
        assert table.log.start_utc == _NIGHT.timestamp()
    # 5 August, over midnight: 6 August; the other reading is a month later
    notes = [note for note in table.notes if "first, as otherwise the rows would be" in note]
    assert len(notes) == any(x in pattern for x in ("%d/%m", "%d.%m", "%m/%d", "%y-%b"))
    order = "year" if pattern.startswith("%y") else "month" if "%m/%d" in pattern else "day"
    assert all(f": {order} first" in note for note in notes)


@pytest.mark.parametrize(
    ("start", "pattern", "says", "day"),
    [
        ("2026-08-25", "%m/%d/%Y %H:%M:%S.%L", 'month first, as "08/25/2026 12:00:00.000" shows', 25),
        ("2026-08-25", "%d/%m/%Y %H:%M:%S.%L", 'day first, as "25/08/2026 12:00:00.000" shows', 25),
        ("2026-08-05", "%m/%d/%Y %I:%M:%S.%L %p", "month taken to be first, which no row shows", 5),
        ("2026-08-05", "%d/%m/%Y %H:%M:%S.%L", "day taken to be first, which no row shows", 5),
        ("2026-08-05", "%d.%m.%Y %H:%M:%S.%L", "day taken to be first, which no row shows", 5),
        (
            "2026-08-05",
            "%y/%m/%d %H:%M:%S.%L",
            "year taken to be first, which no row shows (day first: 2005-08-26)",
            5,
        ),
        (
            "2026-08-05",
            "%d.%m.%y %H:%M:%S.%L",
            "day taken to be first, which no row shows (month first: 2026-05-08",
            5,
        ),
        (
            "2026-08-31",
            "%d/%m/%y %H:%M:%S.%L",
            "day taken to be first, which no row shows (year first: 2031-08-26)",
            31,
        ),
        (
            "2026-08-31",
            "%y/%m/%d %H:%M:%S.%L",
            "year taken to be first, which no row shows (day first: 2031-08-26)",
            31,
        ),
    ],
)
def test_which_of_two_numbers_is_the_month(
    tmp_path: Path, start: str, pattern: str, says: str, day: int, seed: int
) -> None:
    """A number above 12 shows it, else the order of the rows; where nothing does, what was taken is said."""
    begin = datetime.fromisoformat(f"{start}T12:00:00Z")
    table = opened(tmp_path / "x.csv", "time", drive(seed, 100), at(pattern, begin))
    assert [note for note in table.notes if says in note]
    assert datetime.fromtimestamp(table.log.start_utc, UTC).day == day


COUNTERS = {
    "32 bits, us": ("time [us]", 2**32 * 1e-6, 1e6),
    "32 bits, ms": ("time [ms]", 2**32 * 1e-3, 1e3),
    "16 bits, ms": ("time [ms]", 65.536, 1e3),
    "16 bits, ms, no unit": ("time", 65.536, 1e3),
    "60 s": ("time [s]", 60.0, 1.0),
    "60 s, no unit": ("time", 60.0, 1.0),
    "an hour": ("time [s]", 3600.0, 1.0),
    "a day": ("time [s]", 86_400.0, 1.0),
    "GPS week": ("time [ms]", 604_800.0, 1e3),
}


@pytest.mark.parametrize("name", COUNTERS)
@pytest.mark.parametrize("dt", [0.1, 0.02])
def test_counters_that_wrap(tmp_path: Path, name: str, dt: float, seed: int) -> None:
    """The frames of times that go on, to the last bit, and one sentence."""
    heading, period, factor = COUNTERS[name]
    rows = drive(seed, 2400, dt)
    units = round(period * factor * 1000)

    def counted(t: float) -> str:
        value = (units + round((t - 30.0) * factor * 1000)) % units
        return f"{value / 1000:.3f}" if factor == 1.0 else str(value // 1000)

    table = opened(tmp_path / "x.csv", heading, rows, counted)
    plain = opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.3f}")
    assert frames(table) == frames(plain)
    assert len([note for note in table.notes if "wraps" in note or "anew" in note or "midnight" in note]) == 1
    assert not any("sorted" in note for note in table.notes)


def test_episodes_of_a_minute_are_no_counter(tmp_path: Path, seed: int) -> None:
    """Drives of 60 s each one after the other, whose times begin anew, are refused as they were."""
    rows = [row for k in range(4) for row in drive(seed + k, 600)]
    with pytest.raises(ConfigError, match="holds several drives"):
        opened(tmp_path / "x.csv", "time [s]", rows, lambda t: f"{t:.3f}")


@pytest.mark.parametrize("minute", [15, 58])
@pytest.mark.parametrize("mark", [".", ","])
def test_minutes_and_seconds_as_spreadsheets_show_them(
    tmp_path: Path, minute: int, mark: str, seed: int
) -> None:
    """15:00.0, which says no hour: the frames of times in s, over a full hour as well."""
    rows = drive(seed)
    start = datetime(2026, 8, 5, 8, minute, tzinfo=UTC)
    table = opened(
        tmp_path / "x.csv", "Time", rows, lambda t: f'"{at("%M:%S.%L", start)(t)[:-2]}"'.replace(".", mark)
    )
    assert frames(table) == frames(opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.3f}"))
    assert table.log.start_ns is None


@pytest.mark.parametrize("pattern", ["%H:%M:%S.%L", "%Y-%m-%d %H:%M:%S.%L", "%d.%m.%Y %H:%M:%S.%L"])
@pytest.mark.parametrize("begins", [True, False])
def test_summer_time(tmp_path: Path, pattern: str, begins: bool, seed: int) -> None:
    """Local times without a zone over the change are the drive, and it is said."""
    change = datetime(2026, 3, 29, 2, tzinfo=UTC) if begins else datetime(2026, 10, 25, 3, tzinfo=UTC)
    start = change - timedelta(seconds=100)

    def local(t: float) -> str:
        hour = (t >= 100.0) * (3600.0 if begins else -3600.0)
        return at(pattern, start)(t + hour)

    rows = drive(seed)
    table = opened(tmp_path / "x.csv", "time", rows, local)
    assert frames(table) == frames(opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.3f}"))
    assert [note for note in table.notes if "summer time" in note]


@pytest.mark.parametrize("pattern", ["%I:%M:%S.%L", "%d.%m.%Y %I:%M:%S.%L"])
@pytest.mark.parametrize("hour", [0, 12])
def test_clock_of_twelve_hours(tmp_path: Path, pattern: str, hour: int, seed: int) -> None:
    """Without AM and PM it goes on from 12:59:59 to 1:00, and that is said; up to 12:00 it is in order."""
    rows = drive(seed)
    plain = frames(opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.3f}"))
    start = datetime(2026, 8, 5, hour, 58, 20, tzinfo=UTC)
    table = opened(tmp_path / "x.csv", "time", rows, at(pattern, start))
    assert frames(table) == plain
    assert [note for note in table.notes if "the clock of twelve hours goes on" in note]
    assert not any("sorted" in note or "set back" in note for note in table.notes)
    if hour:
        before_noon = opened(tmp_path / "z.csv", "time", rows, at(pattern, start - timedelta(hours=1)))
        assert frames(before_noon) == plain


@pytest.mark.parametrize("zone", ["Z", "+01:00"])
def test_times_with_a_zone_have_no_summer_time(tmp_path: Path, zone: str, seed: int) -> None:
    """An hour without rows is a pause."""
    start = datetime(2026, 3, 29, 1, 58, 20, tzinfo=UTC)
    rows = drive(seed)
    written = at("%Y-%m-%dT%H:%M:%S.%L" + zone, start)
    table = opened(tmp_path / "x.csv", "time", rows, lambda t: written(t + (t >= 100.0) * 3600.0))
    assert last(table) == pytest.approx(rows[-1][0] + 3600.0)


@pytest.mark.parametrize(
    ("zone", "hours"),
    [
        (" CET", 1),
        (" EST", -5),
        (" GMT+1", 1),
        ("+01", 1),
        (" (UTC)", 0),
        ("+01:00[Europe/Berlin]", 1),
        (" CST", None),
    ],
)
def test_the_zone_behind_a_date_is_used(tmp_path: Path, zone: str, hours: int | None, seed: int) -> None:
    """The start in UTC; a name of several zones is said not to be known. No zone has a summer time of its own."""
    start = datetime(2026, 3, 29, 1, 58, 20, tzinfo=UTC)
    table = opened(tmp_path / "x.csv", "time", drive(seed), at("%Y-%m-%d %H:%M:%S.%L" + zone, start))
    assert table.log.start_utc == (start - timedelta(hours=hours or 0)).timestamp()
    assert any('offset the zone "CST" has is not known' in note for note in table.notes) == (hours is None)


def last(table: Table) -> float:
    return max(float(chunk.t.max()) for chunk in table.log.columns())


@pytest.mark.parametrize(
    ("heading", "pattern"),
    [("time", "%H:%M:%S.%L"), ("Date,Time", "%Y-%m-%d,%H:%M:%S.%L"), ("time", "%d.%m.%Y %H:%M:%S.%L")],
)
@pytest.mark.parametrize("hours", [1.0, 2.0, 9.0, 13.0, 20.0, 26.0])
@pytest.mark.parametrize("hour", [7, 15])
def test_pauses(tmp_path: Path, heading: str, pattern: str, hours: float, hour: int, seed: int) -> None:
    """A pause has the length that the clock shows; beyond a day the date alone shows it."""
    start = datetime(2026, 8, 5, hour, 13, tzinfo=UTC)
    rows = drive(seed, 600)
    table = opened(
        tmp_path / "x.csv", heading, rows, lambda t: at(pattern, start)(t + (t >= 30.0) * hours * 3600.0)
    )
    shown = hours - 24.0 if hours > 24.0 and pattern.startswith("%H") else hours
    assert last(table) == pytest.approx(rows[-1][0] + 3600.0 * shown)
    assert not any("sorted" in note for note in table.notes)


@pytest.mark.parametrize("heading", ["time [s]", "time"])
@pytest.mark.parametrize("back", [0.8, 1.0, 1.7, 5.0, 40.0])
def test_a_clock_that_is_set_back_cuts_the_drive(
    tmp_path: Path, heading: str, back: float, seed: int
) -> None:
    """Rows of both parts keep their order, with a pause between them that no sample crosses, and it is said."""
    rows = drive(seed, 2400)
    start = datetime(2026, 8, 5, 9, 10, tzinfo=UTC)
    text = at("%d.%m.%Y %H:%M:%S.%L", start) if heading == "time" else lambda t: f"{t:.3f}"
    table = opened(tmp_path / "x.csv", heading, rows, lambda t: text(t - (t >= 100.0) * back))
    assert [
        note for note in table.notes if f"is set back by {back - 0.1:.1f} s: the drive is cut in two" in note
    ]
    t = np.unique(np.concatenate([chunk.t for chunk in table.log.columns()]))
    true = np.array([row[0] for row in rows])
    assert np.abs(t - true - (true >= 100.0) * (t[1000] - 100.0)).max() < 1e-6
    assert t[1000] - t[999] > sampling_grid.MAX_PAUSE_S


@pytest.mark.parametrize("seconds", [0.3, 1.0, 1.9])
def test_rows_that_exchanged_their_places_are_sorted(tmp_path: Path, seconds: float, seed: int) -> None:
    """A block that stands behind the next one is no clock that is set back by as much."""
    rows, n = drive(seed), round(seconds / 0.1)
    order = rows[:1000] + rows[1000 + n : 1000 + 2 * n] + rows[1000 : 1000 + n] + rows[1000 + 2 * n :]
    table = opened(tmp_path / "x.csv", "time [s]", order, lambda t: f"{t:.3f}")
    assert frames(table) == frames(opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.3f}"))
    assert any("sorted" in note for note in table.notes)


LEAP = {
    "ISO": ("time", "%Y-%m-%dT%H:%M:%S.%LZ"),
    "day first": ("time", "%d.%m.%Y %H:%M:%S.%L"),
    "clock": ("time", "%H:%M:%S.%L"),
    "two columns": ("Date,Time", "%Y-%m-%d,%H:%M:%S.%L"),
}


@pytest.mark.parametrize("name", LEAP)
def test_a_leap_second_lasts_a_second(tmp_path: Path, name: str, seed: int) -> None:
    """Over 23:59:60 the times go on, and it is said; a clock that writes 60 for 59.9996 has none."""
    heading, pattern = LEAP[name]
    rows, text = drive(seed, 600), at(pattern, datetime(2016, 12, 31, 23, 59, 30, tzinfo=UTC))

    def sixty(t: float) -> str:
        return text(t - 1.0).replace(":59.", ":60.")

    plain = frames(opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.3f}"))
    leap = opened(
        tmp_path / "x.csv", heading, rows, lambda t: sixty(t) if 30.0 <= t < 31.0 else text(t - (t >= 31.0))
    )
    rounded = opened(tmp_path / "z.csv", heading, rows, lambda t: sixty(t) if t == 30.0 else text(t))
    for table, says in ((leap, True), (rounded, False)):
        assert frames(table) == plain
        said = [note for note in table.notes if "a leap second:" in note]
        assert bool(said) is says
        assert all(" time: " in f" {note.lower()}" for note in said)


def test_blocks_and_overlapping_buffers_are_sorted(tmp_path: Path, seed: int) -> None:
    """Rows that a logger writes in buffers, which overlap a little, are no clock that is set."""
    rows = drive(seed)
    order = [row for k in range(0, 2400, 100) for row in (rows[k + 1 : k + 100 : 2] + rows[k : k + 100 : 2])]
    table = opened(tmp_path / "x.csv", "time [s]", order, lambda t: f"{t:.3f}")
    assert frames(table) == frames(opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.3f}"))
    assert any("sorted" in note for note in table.notes)


def test_damaged_dates_are_damaged(tmp_path: Path, seed: int) -> None:
    """A cell that is no date costs its row, and decides nothing."""
    rows = drive(seed, 300)
    text = at("%d/%m/%Y %H:%M:%S.%L", datetime(2026, 8, 25, 12, tzinfo=UTC))
    table = opened(tmp_path / "x.csv", "time", rows, lambda t: "45/77/2026 99:99" if t == 10.0 else text(t))
    assert table.damaged == 1
    assert [note for note in table.notes if "day first" in note]


def test_reported_clocks(measured: Path) -> None:
    """The reported tables: the frames of noon.csv; of the counter of 60 s those of times that go on."""
    folder = measured / "reports" / "50-clock"
    noon = frames(open_table(folder / "noon.csv"))
    for name in ("midnight", "twocol_midnight", "summer_end"):
        table = open_table(folder / f"{name}.csv")
        assert frames(table) == noon, name
        # a date of its own shows it without a word
        assert any("over midnight" in note or "set back" in note for note in table.notes) == (
            name[:3] != "two"
        ), name
    table = open_table(folder / "slcan60.csv")
    t = np.concatenate([chunk.t for chunk in table.log.columns()])
    assert np.array_equal(np.unique(t), np.round(np.arange(12_000) * 0.05 * 1e9) * 1e-9)


def _orders(rows: Sequence[tuple[float, str]]) -> dict[str, _Drive]:
    rng = np.random.default_rng(len(rows))
    return {
        "any order": [rows[k] for k in rng.permutation(len(rows))],
        "newest first": list(rows[::-1]),
        "the second part first": [*rows[900:], *rows[:900]],
        "neighbours exchanged": [rows[k ^ 1] for k in range(len(rows))],
    }


@pytest.mark.long("many or long tables")
@pytest.mark.parametrize("pattern", ["%H:%M:%S.%L", "%d.%m.%Y %H:%M:%S.%L"])
def test_rows_in_another_order_are_sorted(tmp_path: Path, pattern: str, seed: int) -> None:
    """Rows of a drive of hours that are in no order are no nights, and no clock that wraps."""
    rows = drive(seed, 2400, 2.0)
    expected = frames(opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.3f}"))
    start = datetime(2026, 8, 5, 11, 13, tzinfo=UTC)
    for name, order in _orders(rows).items():
        table = opened(tmp_path / "x.csv", "time", order, at(pattern, start))
        assert frames(table) == expected, name
        assert any("sorted" in note for note in table.notes), name


@pytest.mark.parametrize("day", [45_000.25, 738_000.75])
def test_date_numbers_count_days(tmp_path: Path, day: float) -> None:
    """Numbers of spreadsheets and of MATLAB; the same rows with seconds since the start are the same drive."""
    rows = drive(3, n=400)
    table = opened(tmp_path / "x.csv", "time", rows, lambda t: f"{day + t / 86_400:.10f}")
    plain = opened(tmp_path / "y.csv", "time", rows, lambda t: f"{t:.3f}")
    times, wanted = (np.concatenate([part.t for part in x.log.columns()]) for x in (table, plain))
    np.testing.assert_allclose(times, wanted, atol=2e-5)
    assert any("taken as days" in note for note in table.notes)
    assert table.log.start_utc == pytest.approx((day - (25_569 if day < 1e5 else 719_529)) * 86_400, abs=1e-3)


def test_seconds_since_a_start_of_the_clock_are_no_date_numbers(tmp_path: Path) -> None:
    """The same size, in steps of a drive."""
    rows = drive(4, n=400)
    table = opened(tmp_path / "x.csv", "time", rows, lambda t: f"{45_000.0 + t:.3f}")
    assert not any("taken as days" in note for note in table.notes)


# the rest of a second in a column of its own: headings, and the cells of both
RESTS: dict[str, tuple[str, Callable[[float], str]]] = {
    "clock and ms": ("Time,ms", lambda t: f"{at('%H:%M:%S', _MORNING)(t)},{round(1000 * t) % 1000}"),
    "date, clock and ms": (
        "Date,Time,Milliseconds",
        lambda t: f"{at('%d.%m.%Y,%H:%M:%S', _MORNING)(t)},{round(1000 * t) % 1000}",
    ),
    "date and us": ("timestamp,usec", lambda t: f"{at('%Y-%m-%d %H:%M:%S', _MORNING)(t)},{round(1e6 * t) % 1_000_000}"),
    "seconds and ms": ("time [s],msec", lambda t: f"{int(t + 1e-6)},{round(1000 * t) % 1000}"),
    "of ROS": ("header.stamp.secs,header.stamp.nsecs", lambda t: f"{1785000000 + int(t + 1e-6)},{round(1e9 * t) % 10**9}"),
    "as decimals": ("time,nanosec", lambda t: f"{1785000000 + int(t + 1e-6)}.0,{round(1e9 * t) % 10**9}"),
}  # fmt: skip
_MORNING = datetime(2026, 8, 5, 8, 58, 20, tzinfo=UTC)


@pytest.mark.parametrize("name", RESTS)
def test_the_rest_of_a_second_in_a_column_of_its_own(tmp_path: Path, name: str, seed: int) -> None:
    """Nine of ten rows would have the time of the row before."""
    heading, written = RESTS[name]
    rows = drive(seed)
    table = opened(tmp_path / "x.csv", heading, rows, written)
    plain = opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.1f}")
    assert frames(table) == frames(plain)
    assert not any("the time of the row before" in note for note in table.notes)


def test_a_column_that_does_not_begin_anew_with_each_second_is_no_rest(tmp_path: Path, seed: int) -> None:
    """Milliseconds since the start next to whole seconds, and others of any order."""
    rng = np.random.default_rng(seed)
    for written in (
        lambda t: f"{int(t + 1e-6)},{round(1000 * t)}",
        lambda t: f"{int(t + 1e-6)},{rng.integers(1000)}",
    ):
        table = opened(tmp_path / "x.csv", "time [s],ms", drive(seed), written)
        assert any("the time of the row before" in note for note in table.notes)


@pytest.mark.parametrize("other", ["Elapsed Time [s]", "timestamp [ms]"])
def test_the_times_that_go_on_are_taken(tmp_path: Path, other: str, seed: int) -> None:
    """A clock of whole seconds that is called Time, next to a finer one."""
    rows = drive(seed)
    clock, factor = at("%H:%M:%S", _MORNING), 1000 if "ms" in other else 1
    table = opened(tmp_path / "x.csv", f"Time,{other}", rows, lambda t: f"{clock(t)},{factor * t:.1f}")
    assert frames(table) == frames(opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.1f}"))


@pytest.mark.parametrize(
    "form", ["{h}:{m}:{s}.{ms}", "{h}:{m}:{s}:{ms}", "2026-08-05 {h:02}:{m:02}:{s:02}.{ms}"]
)
@pytest.mark.parametrize("first", [0, 7])
def test_milliseconds_without_leading_zeros(tmp_path: Path, form: str, first: int, seed: int) -> None:
    """As C# and Arduino programs write them: 3.20 is 20 ms behind 3."""
    rows = drive(seed, 2400, 0.02)

    def written(t: float) -> str:
        ms = round(1000 * t) + first + 32_300_000
        return form.format(h=ms // 3_600_000, m=ms // 60_000 % 60, s=ms // 1000 % 60, ms=ms % 1000)

    table = opened(tmp_path / "x.csv", "time", rows, written)
    assert frames(table) == frames(opened(tmp_path / "y.csv", "time [s]", rows, lambda t: f"{t:.2f}"))
    # with all of them, and as decimals of any length, they are what they were
    for plain in ("0:00:{:.3f}", "0:00:{:.4g}"):
        table = opened(tmp_path / "x.csv", "time", rows, plain.format)
        assert last(table) == pytest.approx(47.98)


def test_seconds_of_labview_have_the_date_that_they_show(tmp_path: Path, seed: int) -> None:
    """Since 1904: 5 August 2026, and not 2092."""
    since = 2_082_844_800 + int(datetime(2026, 8, 5, 8, tzinfo=UTC).timestamp())
    table = opened(tmp_path / "x.csv", "time", drive(seed, 50), lambda t: f"{since + t:.1f}")
    assert str(np.datetime64(table.log.start_ns, "ns"))[:13] == "2026-08-05T08"
