"""Numbers and times as spreadsheets and loggers write them are the same drive, or said to be none."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.tables.source import NO_NUMBER, number
from canid.analysis.tables.table import open_table, trace_of
from tests.tables.test_times import _Drive, at, drive, frames, last, opened

_START = datetime(2026, 8, 5, 8, 58, 20, 500_000, tzinfo=UTC)
_DAYS_TO_1970 = 25_569.0


def _days(t: float) -> str:
    """As a spreadsheet writes dates as numbers."""
    return f"{(_START + timedelta(seconds=t)).timestamp() / 86_400.0 + _DAYS_TO_1970:.10f}"


WRITTEN: dict[str, tuple[Callable[[float], str], bool]] = {
    "hhmmss": (at("%H%M%S.%L", _START), False),
    "yyyymmdd_hhmmss": (at("%Y%m%d_%H%M%S.%L", _START), True),
    "yyyymmddhhmmss": (at("%Y%m%d%H%M%S.%L", _START), True),
    "days since 1899": (_days, True),
    "part of a day": (lambda t: f"{(8.5 * 3600.0 + t) / 86_400.0:.10f}", False),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_times(tmp_path: Path, name: str, seed: int) -> None:
    """Four minutes over a full hour, with or without a date."""
    rows = drive(seed)
    written, dated = WRITTEN[name]
    table = opened(tmp_path / "x.csv", "time", rows, written)
    assert last(table) == pytest.approx(rows[-1][0], abs=2e-5)
    chunks = np.concatenate([chunk.t for chunk in table.log.columns()])
    assert np.abs(chunks - [t for t, _ in rows]).max() < 2e-5
    assert (table.log.start_ns is not None) == dated
    if table.log.start_ns is not None:
        assert table.log.start_ns / 1e9 == pytest.approx(_START.timestamp(), abs=1e-4)


def test_rows_of_microseconds_apart_are_no_days(tmp_path: Path) -> None:
    """Messages in bursts, a row each: most steps are short, and the drive is not."""
    lines = [
        f"{0.1 * k + 1e-5 * i:.6f},{',' * i}{1.0 + k % 7}{',' * (3 - i)}"
        for k in range(600)
        for i in range(4)
    ]
    path = tmp_path / "x.csv"
    path.write_text("time,speed,gap,range_rate,pedal\n" + "\n".join(lines) + "\n", encoding="utf-8")
    assert last(open_table(path)) == pytest.approx(59.9, abs=1e-3)


def test_seconds_with_a_pause_are_no_hhmmss(tmp_path: Path, seed: int) -> None:
    """59.9 s, and the next row at 100 s: of a clock of seconds some are between 60 and 100."""
    rows = [(t, cells) for t, cells in drive(seed, 2400) if not 59.95 < t < 99.95]
    table = opened(tmp_path / "x.csv", "time", rows, lambda t: f"{t:.1f}")
    assert last(table) == pytest.approx(rows[-1][0])


# hyphens, dashes and minus signs of Unicode, and a blank behind the minus
_MINUS = ["\u2010", "\u2011", "\u2012", "\u2013", "\u2014", "\N{MINUS SIGN}", "\ufe63", "\uff0d", "- "]


@pytest.mark.parametrize("minus", _MINUS)
def test_a_minus_of_typography_is_a_minus(tmp_path: Path, seed: int, minus: str) -> None:
    """Half of the range rates would be left out, those of one sign."""
    rows: _Drive = [(t, cells.replace("-", minus)) for t, cells in drive(seed)]
    table = opened(tmp_path / "x.csv", "time", rows, lambda t: f"{t:.1f}")
    plain = opened(tmp_path / "y.csv", "time", drive(seed), lambda t: f"{t:.1f}")
    assert not [note for note in table.notes if "no unit is stated" not in note]
    a, b = (np.concatenate([c.data for c in made.log.columns()]) for made in (table, plain))
    assert (a == b).all()


@pytest.mark.parametrize("form", ["({})", "{}-"])
def test_negative_numbers_as_accounts_write_them(tmp_path: Path, seed: int, form: str) -> None:
    """Half of the range rates would be left out, those of one sign."""
    rows: _Drive = []
    for t, cells in drive(seed):
        parts = cells.split(",")
        rows.append((t, ",".join(form.format(part[1:]) if part[0] == "-" else part for part in parts)))
    table = opened(tmp_path / "x.csv", "time", rows, lambda t: f"{t:.1f}")
    plain = opened(tmp_path / "y.csv", "time", drive(seed), lambda t: f"{t:.1f}")
    a, b = (np.concatenate([c.data for c in made.log.columns()]) for made in (table, plain))
    assert (a == b).all()


def test_dots_of_thousands_next_to_decimal_commas(tmp_path: Path, seed: int) -> None:
    """A German export in ms: 1.000 is a thousand, also where the first 200 rows have none, and `Zeit` is the time."""
    rows = drive(seed)
    for first in (0, 700):
        path = tmp_path / f"{first}.csv"
        lines = [
            ";".join([
                f"{round(1e3 * t):,}".replace(",", ".") if k >= first else str(round(1e3 * t)),
                *(cell.replace(".", ",") for cell in cells.split(",")),
            ])
            for k, (t, cells) in enumerate(rows)
        ]  # fmt: skip
        names = "Zeit;Geschwindigkeit;Abstand;Relativgeschwindigkeit;Fahrpedal\nms;m/s;m;m/s;%\n"
        path.write_text(names + "\n".join(lines) + "\n", encoding="cp1252")
        table = open_table(path)
        assert last(table) == pytest.approx(rows[-1][0])
        assert sum(len(chunk.t) for chunk in table.log.columns()) == len(rows)
        assert not table.sorted


def test_times_of_whole_seconds_are_said(tmp_path: Path, seed: int) -> None:
    rows = drive(seed, 600)
    table = opened(tmp_path / "x.csv", "time", rows, at("%H:%M:%S", _START))
    assert any("539 of 600 rows have the time of the row before" in note for note in table.notes)
    several = opened(tmp_path / "y.csv", "time", rows, lambda t: f"{t:.1f}")
    assert not any("time of the row before" in note for note in several.notes)


def test_infinite_cells_are_not_measured(tmp_path: Path, seed: int) -> None:
    rows = [(t, cells if k % 50 > 3 else "25,inf,-inf,20") for k, (t, cells) in enumerate(drive(seed, 600))]
    table = opened(tmp_path / "x.csv", "time", rows, lambda t: f"{t:.1f}")
    assert last(table) == pytest.approx(rows[-1][0])
    assert not [note for note in table.notes if "no unit is stated" not in note]


def test_digits_with_an_underscore_are_no_number(tmp_path: Path) -> None:
    """Python reads 1_0 as 10."""
    assert number("1_0") == NO_NUMBER
    path = tmp_path / "x.csv"
    lines = [f"{0.1 * k:.1f},2_0,30,0.1,20" for k in range(50)]
    lines += [f"{0.1 * k:.1f},20,30,0.1,20" for k in range(50, 100)]
    path.write_text("time,speed,gap,range_rate,pedal\n" + "\n".join(lines) + "\n", encoding="utf-8")
    assert any("50 of 100 cells hold no number" in note for note in open_table(path).notes)


@pytest.mark.parametrize("units", [("s", "m/s", "m", "m/s", "%"), (" s", " km/h", " m", " km/h", " %")])
@pytest.mark.parametrize("decimal", [".", ","])
def test_cells_with_their_units(tmp_path: Path, units: tuple[str, ...], decimal: str, seed: int) -> None:
    """They are the columns' units, where a heading states none; a cell of another unit is no number."""
    rows = drive(seed, 600)
    factor = [3.6 if "km/h" in unit else 1.0 for unit in units]

    def lines(written: tuple[str, ...]) -> str:
        made = []
        for t, cells in rows:
            numbers = (t, *map(float, cells.split(",")))
            texts = [f"{x * f:.5f}{u}" for x, f, u in zip(numbers, factor, written, strict=True)]
            made.append(";".join(texts).replace(".", decimal))
        return "\n".join(made) + "\n"

    in_cells, in_header = tmp_path / "cells.csv", tmp_path / "header.csv"
    in_cells.write_text("time;speed;gap;range_rate;pedal\n" + lines(units), encoding="utf-8")
    stated = ";".join(
        f"{name} [{unit.strip()}]"
        for name, unit in zip(["time", "speed", "gap", "range_rate", "pedal"], units, strict=True)
    )
    in_header.write_text(stated + "\n" + lines(("",) * 5), encoding="utf-8")
    table = open_table(in_cells)
    assert frames(table) == frames(open_table(in_header))
    assert not any("no unit is stated" in note for note in table.notes)
    text = in_cells.read_text(encoding="utf-8")
    in_cells.write_text(text.replace(f"{units[2]};", " ft;", 3), encoding="utf-8")
    notes = [note for note in open_table(in_cells).notes if "hold no number" in note]
    assert [note.partition("gap: ")[2] for note in notes] == ["3 of 600 cells hold no number"]


@pytest.mark.parametrize(("scale", "said"), [(2.55, True), (1.0, True), (0.997, False)])
def test_whole_numbers_of_a_pedal_without_a_unit_are_said(tmp_path: Path, scale: float, said: bool) -> None:
    """They may be counts, which no value below 100 shows."""
    rows = drive(7, 600)
    path = tmp_path / "x.csv"
    text = [
        f"{t:.1f},{cells.rpartition(',')[0]},{round((20 + k % 9) * scale, 0 if said else 2):g}"
        for k, (t, cells) in enumerate(rows)
    ]
    path.write_text("time,speed,gap,range_rate,pedal\n" + "\n".join(text) + "\n", encoding="utf-8")
    assert any("where they are counts" in note for note in open_table(path).notes) == said
    stated = path.read_text(encoding="utf-8").replace("pedal", "pedal [%]", 1)
    path.write_text(stated, encoding="utf-8")
    assert not any("where they are counts" in note for note in open_table(path).notes)


@pytest.mark.long("many or long tables")
@pytest.mark.parametrize("heading", ["pedal [%]", "pedal"])
def test_a_pedal_that_never_exceeds_1_is_a_fraction(tmp_path: Path, seed: int, heading: str) -> None:
    """As spreadsheets hold what they show in %: 0.21 under a heading that states %."""
    rows = drive(seed)
    tables = []
    for name, head, factor in (("x", heading, 0.01), ("y", "pedal [%]", 1.0)):
        lines = [
            f"{t:.1f},{c.rpartition(',')[0]},{float(c.rpartition(',')[2]) * factor:.6f}" for t, c in rows
        ]
        path = tmp_path / f"{name}.csv"
        path.write_text("\n".join([f"time,speed,gap,range_rate,{head}", *lines]) + "\n", encoding="utf-8")
        tables.append(open_table(path))
    assert any("taken as a fraction" in note for note in tables[0].notes)
    np.testing.assert_allclose(*(trace_of(made, 0.1).output for made in tables), rtol=1e-6)
