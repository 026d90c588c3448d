"""Every line of a table is a row, known to be none, or damaged, whatever was done to it; the others are read exactly."""

from __future__ import annotations

import gzip
import json
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import canid
from canid.analysis.tables.source import EMPTY
from canid.analysis.tables.sources.text_source import TextSource
from canid.analysis.tables.table import open_table
from canid.ui.cli import main
from canid.values.errors import LogError

_NAMES = ("time", "speed", "gap", "range_rate", "accel")
_TABLE = st.fixed_dictionaries(
    {
        "numbers": st.lists(
            st.lists(st.none() | st.floats(-1e6, 1e6).map(lambda x: round(x, 6)), min_size=4, max_size=4),
            min_size=30,
            max_size=60,
        ),
        "delimiter": st.sampled_from([",", ";", "\t", "|"]),
        "comma": st.booleans(),
        "quoted": st.booleans(),
        "preamble": st.integers(0, 2),
        "units": st.booleans(),
        "seed": st.integers(0, 2**32),
    }
)


def _line(row: list[float | None], k: int, of: dict[str, object]) -> tuple[str, list[float]]:
    """A row's line, and what is read of it."""
    values = [0.1 * k, *[EMPTY if x is None else x for x in row]]
    cells = [f"{0.1 * k:.1f}", *["" if x is None else repr(x) for x in row]]
    values[0] = float(cells[0])
    if of["comma"]:
        cells = [cell.replace(".", ",") for cell in cells]
    if of["quoted"] and k % 3 == 0:
        cells = [f'"{cell}"' for cell in cells]
    return str(of["delimiter"]).join(cells), values


def _corrupted(line: str, delimiter: str, rng: random.Random) -> str:
    """A line that is no row for certain."""
    cells = line.split(delimiter)
    kind = rng.randrange(8)
    if kind == 0:  # an open quote
        at = rng.randrange(len(cells))
        cells[at] = '"' + cells[at].strip('"')
        return delimiter.join(cells)
    if kind == 1:
        at = rng.randrange(len(line))
        return line[:at] + "\0" + line[at:]
    if kind == 2:
        return delimiter.join(cells[: rng.randrange(1, len(cells))])
    if kind == 3:
        return delimiter.join([*cells, "1", "2"][: len(cells) + rng.randrange(1, 3)])
    if kind == 4:
        return line.replace(delimiter, "#")
    if kind == 5:  # half a line, up to within a cell
        return line[: rng.randrange(1, line.index(delimiter) + 1)].replace(delimiter, "") or "x"
    if kind == 6:  # the line's feed is gone, and another line follows
        return line + line
    return '"' + line.replace('"', "")


@pytest.mark.slow("whole tables")
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(of=_TABLE)
def test_lines_are_rows_known_or_damaged_and_the_rows_are_exact(
    of: dict[str, object], tmp_path: Path
) -> None:
    """Quotes, NULs, missing and other cells, delimiters and half lines cost their own line, which is counted."""
    rng = random.Random(of["seed"])  # type: ignore[arg-type]
    d = str(of["delimiter"])
    if d == "," and of["comma"]:
        of = {**of, "comma": False}
    lines = [f"# made by {k}" for k in range(of["preamble"])]  # type: ignore[call-overload]
    lines.append(d.join(_NAMES))
    if of["units"]:
        lines.append(d.join(["s", "m/s", "m", "m/s", "m/s^2"]))
    known, damaged, expected = len(lines), 0, []
    for k, row in enumerate(of["numbers"]):  # type: ignore[arg-type, var-annotated]
        line, values = _line(row, k, of)
        what = rng.random() if k > 3 else 1.0
        if what < 0.25:
            lines.append(_corrupted(line, d, rng))
            damaged += 1
        elif what < 0.3:
            lines.append(rng.choice(["# a remark", d.join(_NAMES), "#"]))
            known += 1
        elif what < 0.35:
            lines.append(rng.choice(["", " ", "\r"]))
        else:
            lines.append(line + (d if rng.random() < 0.1 else ""))
            expected.append(values)
    ends = [rng.choice(["\n", "\n", "\r\n"]) for _ in lines]
    path = tmp_path / "x.csv"
    content = "".join(map("".join, zip(lines, ends, strict=True))).encode("latin-1")
    path.write_bytes(content)
    source = TextSource(path)
    assert tuple(heading.split(" [")[0] for heading in source.headings) == _NAMES
    got = [block.numbers for block in source.blocks(range(5), [])]
    np.testing.assert_array_equal(np.concatenate(got), np.array(expected), strict=True)
    count = source.count
    assert (count.read, count.others.total(), count.bad) == (len(expected), known, damaged)
    there = sum(bool(line.strip()) for line in content.split(b"\n"))
    assert count.read + count.others.total() + count.bad == there
    as_texts = [block.texts for block in source.blocks([0], range(5))]
    assert sum(len(part[0]) for part in as_texts) == len(expected)


def _drive(n: int) -> list[str]:
    """A car that follows another, n rows at 10 Hz."""
    rng = random.Random(1)
    lines, gap, rate, v = ["time,speed,gap,range_rate,accel"], 30.0, 0.0, 20.0
    for k in range(n):
        accel = 0.2 * (gap - 1.5 * v) + 0.5 * rate + rng.gauss(0, 0.1)
        rate += 0.1 * (rng.gauss(0, 1.0) - accel)
        v += 0.1 * accel
        gap += 0.1 * rate
        lines.append(f"{0.1 * k:.1f},{v:.4f},{gap:.4f},{rate:.4f},{accel:.4f}")
    return lines


@pytest.mark.slow("whole tables")
def test_an_open_quote_costs_its_own_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """801 rows with one quote that is never closed: 800 are used, the line is named, exit code 4, JSON says it."""
    lines = _drive(801)
    cells = lines[201].split(",")
    lines[201] = ",".join([cells[0], '"x', *cells[2:]])
    path = tmp_path / "q2.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert main(["identify", str(path), "--json", str(tmp_path / "x.json")]) == 4
    err = capsys.readouterr().err
    assert "read 800 of 801 rows" in err
    assert "line 202: a quote is open at its end" in err
    found = json.loads((tmp_path / "x.json").read_text())
    assert found["duration"] == pytest.approx(80.0, abs=2.0)
    assert "line 202: a quote is open at its end" in found["damage"]


def test_a_long_line_behind_a_quote_is_one_damaged_line(tmp_path: Path) -> None:
    """Forty megabytes on one line between rows: that line alone is damaged, and it is never kept."""
    import tracemalloc

    lines = _drive(400)
    path = tmp_path / "quote.csv"
    with path.open("w", encoding="utf-8") as file:
        file.write("\n".join(lines[:200]) + '\n20.0,"')
        for _ in range(40):
            file.write("x" * 1_000_000)
        file.write("\n" + "\n".join(lines[200:]) + "\n")
    tracemalloc.start()
    table = open_table(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert table.log.count.read == 400
    assert table.damaged == 1
    assert "line 201: it has more than 2,097,152 bytes" in table.log.count.damage("rows").says  # type: ignore[union-attr]
    assert peak < 30e6


def test_many_lines_behind_a_quote_are_rows(tmp_path: Path) -> None:
    """What comes behind an open quote is read line by line, however much it is."""
    lines = _drive(60_000)
    path = tmp_path / "x.csv"
    path.write_text("\n".join([*lines[:5], '0.4,"1,2', *lines[5:]]) + "\n", encoding="utf-8")
    source = TextSource(path)
    rows = sum(len(block.numbers) for block in source.blocks([0], []))
    assert (rows, source.count.bad) == (60_000, 1)


@pytest.mark.slow("whole tables")
@pytest.mark.parametrize("n", [1, 2, 3, 30, 600])
@pytest.mark.parametrize("what", ["as it is", "no output", "no gap", "one value", "all texts", "no step"])
@pytest.mark.parametrize("verb", ["identify", "diagnose", "check", "compare"])
def test_a_short_or_empty_table_is_weak_data(
    verb: str, what: str, n: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A status or one line, never an exception."""
    rows = [line.split(",") for line in _drive(n)]
    for k, row in enumerate(rows[1:]):
        if what == "no output" and k:
            row[4] = ""
        if what == "no gap" and k:
            row[2] = row[3] = "nan"
        if what == "one value":
            row[1:] = ["20", "30", "0", "0.1"]
        if what == "all texts":
            row[1:] = ["x"] * 4
        if what == "no step":
            row[0] = "0"
    path = tmp_path / "x.csv"
    path.write_text("\n".join(map(",".join, rows)) + "\n", encoding="utf-8")
    words = [verb, str(path), *([str(path)] if verb == "compare" else [])]
    assert main(words) in (0, 1, 2, 4)
    assert "Traceback" not in capsys.readouterr().err


def test_a_gzipped_table_that_is_cut_is_read_in_part(tmp_path: Path) -> None:
    """What comes before the damage is used, and the damage reported."""
    path = tmp_path / "x.csv.gz"
    data = gzip.compress("\n".join(_drive(20_000)).encode())
    path.write_bytes(data[: len(data) // 2])
    table = open_table(path)
    frames = sum(len(chunk.t) for chunk in table.log.columns())
    assert table.log.damage is not None
    assert "the gzip stream is damaged" in table.log.damage.says
    assert frames > 5_000
    assert table.log.count.read > 5_000


def test_a_vbo_is_accounted_by_lines(tmp_path: Path) -> None:
    """A line of the data that is no row is damaged, with its number; the others are read."""
    path = tmp_path / "x.vbo"
    head = ["File created on 02/08/2018 at 15:34:47", "[header]", "time", "velocity kmh", "gap", "range_rate", "accel",
            "[column names]", "time velocity gap range_rate accel", "[data]"]  # fmt: skip
    rows = [f"1534{k // 10:02d}.{k % 10}00 072.0 30.0 0.0 0.1" for k in range(300)]
    rows[5], rows[7] = "153447.500 072.0", "x 072.0 30.0 0.0 0.1"
    path.write_text("\r\n".join([*head, *rows]) + "\r\n", encoding="utf-8")
    table = open_table(path)
    assert (table.log.count.read, table.damaged) == (298, 2)
    assert "line 16: has 2 values, and there are 5 columns" in table.log.count.damage("rows").says  # type: ignore[union-attr]


def test_a_table_without_rows_that_can_be_read_says_so(tmp_path: Path) -> None:
    """Where each line is damaged there is nothing to use: one line with the first cause."""
    path = tmp_path / "x.csv"
    path.write_text("time,speed,gap,range_rate,accel\nx,1,2,3,4\nx,1,2,3,4\n", encoding="utf-8")
    with pytest.raises((LogError, canid.values.errors.ConfigError), match="time"):
        open_table(path)
