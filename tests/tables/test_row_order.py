"""Rows in any order are the table in the order of time; what no order makes one drive is refused."""

from __future__ import annotations

import random
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.tables.table import Table, open_table
from canid.values.errors import ConfigError
from tests.exact import exact

_HEAD = ("speed", "gap", "range_rate", "accel")
_START = datetime(2025, 3, 3, 23, 59, 50, tzinfo=UTC)
_UNITS = {
    "time [s]": lambda t: f"{t:.2f}",
    "time [ms]": lambda t: f"{1000 * t:.0f}",
    "timestamp": lambda t: f"{1.7e12 + 1000 * t:.0f}",
    "time": lambda t: f"{1000 * t:.0f}",  # ms by its steps
    "t": lambda t: f"{10**18 + round(1e9 * t)}",  # larger than doubles hold
    "datetime": lambda t: (_START + timedelta(seconds=t)).isoformat(),
    "clock time": lambda t: f"{_START + timedelta(seconds=t):%H:%M:%S.%f}",  # over midnight
}


def _drive(rng: random.Random, n: int) -> list[tuple[float, list[str]]]:
    step = rng.choice((0.1, 0.05, 0.02))
    if rng.random() < 0.3:
        step = 10.0
    return [(k * step, [f"{20 + rng.random():.3f}" for _ in _HEAD]) for k in range(n)]


def _written(path: Path, heading: str, rows: list[tuple[float, list[str]]]) -> Table:
    text = _UNITS[heading]
    heading = "time" if heading == "clock time" else heading
    lines = [",".join((text_of, *cells)) for text_of, cells in ((text(t), cells) for t, cells in rows)]
    path.write_text("\n".join([",".join((heading, *_HEAD)), *lines]) + "\n", encoding="utf-8")
    return open_table(path)


def _frames(table: Table) -> str:
    return exact(tuple(table.log.columns()))


def _orders(
    rows: list[tuple[float, list[str]]], rng: random.Random
) -> dict[str, list[tuple[float, list[str]]]]:
    shuffled = rows[:]
    rng.shuffle(shuffled)
    nearly = rows[:]
    for k in range(5, len(rows) - 1, 17):
        nearly[k], nearly[k + 1] = nearly[k + 1], nearly[k]
    cut = rng.randrange(1, len(rows))
    return {
        "any order": shuffled,
        "newest first": rows[::-1],
        "neighbours exchanged": nearly,
        "the second part first": rows[cut:] + rows[:cut],
        "every second row, then the others": rows[::2] + rows[1::2],
        "twice": [row for row in rows for _ in range(2)],
    }


@pytest.mark.slow("two hundred tables, each in six orders")
def test_rows_in_any_order_are_the_table_in_order(tmp_path: Path, seed: int) -> None:
    """Whatever the order, the clock and its unit: to the last bit the frames of the sorted table, and it is said."""
    rng = random.Random(seed)
    for k in range(200):
        heading = list(_UNITS)[k % len(_UNITS)]
        # fewer rows than a stretch that could be a second drive, every other time
        rows = _drive(rng, rng.choice((12, 40, 45)))
        if heading == "clock time" and rows[1][0] > 1:
            rows = [(t / 100, cells) for t, cells in rows]
        table = _written(tmp_path / "sorted.csv", heading, rows)
        for name, order in _orders(rows, rng).items():
            if name == "twice" or order == rows:
                continue
            other = _written(tmp_path / "other.csv", heading, order)
            print(k, heading, name, len(rows), other.notes)
            assert _frames(other) == _frames(table)
            assert other.log.start_ns == table.log.start_ns
            assert any("rows were not in the order of time; they were sorted" in note for note in other.notes)


def test_blocks_of_messages_one_after_the_other_are_interleaved(tmp_path: Path) -> None:
    """Two messages joined by pandas.concat are the table whose rows alternate."""
    rows = [(k * 0.1, [f"{20 + k % 7}", f"{30 + k % 5}", "0.5", "0.1"]) for k in range(300)]
    first = [(t, [v, "", "", a]) for t, (v, _, _, a) in rows]
    second = [(t + 0.03, ["", gap, rate, ""]) for t, (_, gap, rate, _) in rows]
    alternating = [row for pair in zip(first, second, strict=True) for row in pair]
    blocks = _written(tmp_path / "blocks.csv", "time [s]", first + second)
    assert _frames(blocks) == _frames(_written(tmp_path / "rows.csv", "time [s]", alternating))


def test_the_same_rows_a_second_time_change_nothing(tmp_path: Path) -> None:
    """A file that was appended to itself is the file."""
    rows = _drive(random.Random(1), 200)
    twice = _written(tmp_path / "twice.csv", "time [s]", rows + rows)
    once = _written(tmp_path / "once.csv", "time [s]", [row for row in rows for _ in range(2)])
    assert _frames(twice) == _frames(once)


@pytest.mark.parametrize("shift", [0.0, 0.003])
def test_two_drives_whose_times_begin_anew_are_not_mixed(tmp_path: Path, shift: float) -> None:
    """Sorting would mix two drives: they are refused, with the line at which the second begins."""
    rng = random.Random(2)
    rows, others = _drive(rng, 200), [(t + shift, cells) for t, cells in _drive(rng, 180)]
    step = rows[1][0]
    others = [(k * step + shift, cells) for k, (_, cells) in enumerate(others)]
    with pytest.raises(
        ConfigError, match=r"holds several drives: the times of line 2 begin anew at line 202"
    ):
        _written(tmp_path / "two.csv", "time [s]", rows + others)
    mixed = rows + others
    rng.shuffle(mixed)
    if not shift:
        with pytest.raises(ConfigError, match="rows have the time of another row and other values"):
            _written(tmp_path / "mixed.csv", "time [s]", mixed)


def test_a_coarse_clock_is_no_second_drive(tmp_path: Path) -> None:
    """Rows that share a second because the clock has no fraction stay as they are, which is said."""
    rows = [(float(k // 10), [f"{20 + k % 9}", "30", "0", "0"]) for k in range(300)]
    rows[100], rows[150] = rows[150], rows[100]
    notes = _written(tmp_path / "coarse.csv", "time [s]", rows).notes
    notes = [note for note in notes if "no unit is stated" not in note]
    assert len(notes) == 2
    assert "were not in the order of time" in notes[0]
    assert "269 of 300 rows have the time of the row before" in notes[1]


def test_reported_orders_are_the_sorted_table(measured: Path) -> None:
    """The reported tables: the frames of sorted.csv in every order of its rows."""
    folder = measured / "reports" / "23-table-order"
    table = open_table(folder / "sorted.csv")
    for name in ("shuffled", "reversed", "nearly"):
        assert _frames(open_table(folder / f"{name}.csv")) == _frames(table), name


def test_numbers_with_thousands_separators(tmp_path: Path) -> None:
    """Commas in quoted numbers group thousands where points are decimal, as a portal exports them."""
    path = tmp_path / "x.csv"
    lines = [f'"{1_118_846_980_200 + 100 * k:,}",20,"1,0{k % 10}0.5",0,0.25' for k in range(50)]
    path.write_text("\n".join(["time," + ",".join(_HEAD), *lines]) + "\n", encoding="utf-8")
    plain = tmp_path / "y.csv"
    rows = [f"{1_118_846_980_200 + 100 * k},20,10{k % 10}0.5,0,0.25" for k in range(50)]
    plain.write_text("\n".join(["time," + ",".join(_HEAD), *rows]) + "\n", encoding="utf-8")
    assert _frames(open_table(path)) == _frames(open_table(plain))
    assert np.isfinite(open_table(path).log.start_utc)


@pytest.mark.parametrize(
    ("delimiter", "mark", "group"),
    [
        (";", ",", "."),
        ("\t", ",", "."),
        (";", ".", "'"),
        (";", ",", "\u202f"),
        (";", ",", ""),
        (";", ".", ""),
    ],
)
def test_thousands_are_grouped_as_in_each_country(
    tmp_path: Path, delimiter: str, mark: str, group: str
) -> None:
    """Times in ms that pass a thousand, the first behind the rows by which the layout is judged."""

    def written(x: float, places: int) -> str:
        return f"{x:,.{places}f}".replace(",", "_").replace(".", mark).replace("_", group)

    rows = [(7.0 * k, 20.0 + 0.1 * k, 1800.0 + k, 0.125, 3.5) for k in range(600)]
    path, plain = tmp_path / "x.csv", tmp_path / "y.csv"
    heads = ("time [ms]", "speed [m/s]", "gap [cm]", "range_rate [m/s]", "pedal [%]")
    places = (0, 2, 1, 3, 1)
    path.write_text(
        "\n".join(
            delimiter.join(x)
            for x in [heads, *([written(x, n) for x, n in zip(row, places, strict=True)] for row in rows)]
        ),
        encoding="utf-8",
    )
    plain.write_text("\n".join(",".join(map(str, row)) for row in [heads, *rows]), encoding="utf-8")
    np.testing.assert_allclose(_cells(path), _cells(plain), atol=0.006)


def _cells(path: Path) -> np.ndarray:
    """Stamps and values of a table's frames."""
    parts = list(open_table(path).log.columns())
    return np.concatenate([np.column_stack([part.t, part.data.view("<i8")]) for part in parts])


@pytest.mark.parametrize("n", [2, 3])
def test_drives_whose_rows_alternate_are_refused(tmp_path: Path, n: int, seed: int) -> None:
    """The rows of several drivers, sorted by time: each row goes on in the one behind n, not in the next."""
    rng = np.random.default_rng(seed)
    t = np.arange(1200) * 0.1
    level = 30.0 + 6.0 * np.arange(n)[:, None] + 3.0 * np.sin(0.2 * t + rng.uniform(0, 6.0, (n, 1)))
    rows = [
        f"{t[k]:.1f},{who},{level[who, k]:.3f},{level[who, k] + 9.0:.3f},{rng.normal():.3f},20.{k % 7}"
        for k in range(len(t))
        for who in range(n)
    ]
    path = tmp_path / "x.csv"
    path.write_text("time,participant,speed [km/h],gap,range_rate,pedal\n" + "\n".join(rows) + "\n")
    with pytest.raises(ConfigError, match=f"several drives or vehicles: {n} rows have each time"):
        open_table(path)


def test_a_clock_of_whole_seconds_is_one_drive(tmp_path: Path, seed: int) -> None:
    """Ten rows a second go on from row to row."""
    rng = np.random.default_rng(seed)
    t = np.arange(1800) * 0.1
    speed = 80.0 + 9.0 * np.sin(0.4 * t + rng.uniform(0, 6.0))
    rows = [f"{int(t[k])},{speed[k]:.3f},{speed[k] / 2:.3f},{rng.normal():.3f},20" for k in range(len(t))]
    path = tmp_path / "x.csv"
    path.write_text("time,speed [km/h],gap,range_rate,pedal\n" + "\n".join(rows) + "\n")
    assert any("have the time of the row before" in note for note in open_table(path).notes)
