"""One drive in drawn dialects of delimited text is one drive, to the last bit, or is refused; never another one."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from canid.analysis.tables.table import open_table
from tests.tables.test_times import drive, frames

NAMES = {
    "speed": ("Speed", "vehicle speed", "v_ego", "Geschwindigkeit", "vitesse", "VehicleSpeed", "velocidad"),
    "gap": ("Gap", "range", "lead_distance", "Abstand", "LeadDistance", "distance to lead"),
    "range_rate": ("RangeRate", "relative speed", "rel_velocity", "Relativgeschwindigkeit", "v_rel"),
    "pedal": ("Pedal", "Accelerator Pedal Position", "gas pedal", "Fahrpedal", "APP"),
}
UNITS = {
    "speed": ("m/s", "km/h", "mph"),
    "gap": ("m", "ft", "cm"),
    "range_rate": ("m/s", "km/h"),
    "pedal": ("%",),
}
# a pattern of strftime with %L for ms, or a number of a unit
TIMES = (
    "s",
    "ms",
    "%H:%M:%S.%L",
    "%Y-%m-%dT%H:%M:%S.%LZ",
    "%d.%m.%Y %H:%M:%S.%L",
    "%m/%d/%Y %I:%M:%S.%L %p",
)
NOTHING = ("", "NaN", "n/a", "-", "NULL", "#N/A")


class Dialect(NamedTuple):
    """How a table is written."""

    delimiter: str
    comma: bool  # decimal
    units_in: str  # "brackets", "parentheses", a "row" or the "cells"
    time: str
    start: datetime
    quoted: bool
    space: str  # behind a delimiter
    last: str  # behind the last cell
    nothing: str
    preamble: bool
    repeated: bool  # the header stands among the rows too
    encoding: str
    end: str


def drawn(rng: np.random.Generator) -> Dialect:
    delimiter = str(rng.choice([",", ";", "\t", "|"]))
    start = datetime(2026, 1, 13, tzinfo=UTC) + timedelta(seconds=int(rng.integers(300 * 86_400)))
    return Dialect(
        delimiter=delimiter,
        comma=delimiter != "," and bool(rng.random() < 0.4),
        units_in=str(rng.choice(["brackets", "parentheses", "row", "cells"])),
        time=str(rng.choice(TIMES)),
        start=start,
        quoted=bool(rng.random() < 0.25),
        space=" " if delimiter != "\t" and rng.random() < 0.25 else "",
        last=delimiter if rng.random() < 0.2 else "",
        nothing=str(rng.choice(NOTHING)),
        preamble=bool(rng.random() < 0.3),
        repeated=bool(rng.random() < 0.3),
        encoding=str(rng.choice(["utf-8", "utf-8-sig", "utf-16", "latin-1"])),
        end=str(rng.choice(["\n", "\r\n"])),
    )


def stamp(dialect: Dialect, t: float) -> str:
    if "%" not in dialect.time:
        return f"{t:.3f}" if dialect.time == "s" else f"{t * 1e3:.0f}"
    at = dialect.start + timedelta(seconds=t)
    return at.strftime(dialect.time.replace("%L", f"{at.microsecond // 1000:03d}"))


def written(
    dialect: Dialect, names: dict[str, str], units: dict[str, str], rows: list[tuple[float, list[str]]]
) -> bytes:
    """The table; `rows`: times, and the numbers of the columns in the order of `names`."""
    time_unit = dialect.time if "%" not in dialect.time else ""
    all_units = [time_unit, *units.values()]

    def cell(text: str, unit: str) -> str:
        text = text.replace(".", ",") if dialect.comma else text
        text = f"{text} {unit}" if dialect.units_in == "cells" and text and text[-1].isdigit() else text
        return text.rstrip()

    def line(cells: list[str]) -> str:
        cells = [f'"{each}"' for each in cells] if dialect.quoted else cells
        return (dialect.delimiter + dialect.space).join(cells) + dialect.last

    around = {"brackets": "{} [{}]", "parentheses": "{} ({})"}.get(dialect.units_in, "{}")
    heads = [
        around.format(name, unit) if unit else name
        for name, unit in zip(["time", *names.values()], all_units, strict=True)
    ]
    body = []
    for t, numbers in rows:
        time = stamp(dialect, t)
        others = [cell(x, unit) for x, unit in zip(numbers, units.values(), strict=True)]
        body.append(line([cell(time, time_unit) if time_unit else time, *others]))
    if dialect.repeated:
        body.insert(len(body) // 2, line(heads))
    before = [line(["Vehicle", "Golf"]), ""] if dialect.preamble else []
    lines = [*before, line(heads), *([line(all_units)] if dialect.units_in == "row" else []), *body]
    return (dialect.end.join(lines) + dialect.end).encode(dialect.encoding)


@pytest.mark.parametrize("case", range(24))
def test_a_dialect_is_the_same_drive(tmp_path: Path, case: int, seed: int) -> None:
    """The frames of a table with points, commas and units in brackets that holds the same digits."""
    rng = np.random.default_rng([seed, case])
    dialect = drawn(rng)
    roles = [str(role) for role in rng.permutation(list(NAMES))]
    units, names = ({role: str(rng.choice(which[role])) for role in roles} for which in (UNITS, NAMES))
    order = ("speed", "gap", "range_rate", "pedal")
    rows = []
    for k, (t, cells) in enumerate(drive(seed + case, 400)):
        numbers = dict(zip(order, cells.split(","), strict=True))
        if k > 20 and k % 37 == 0:
            numbers["gap"] = ""
        rows.append((t, [numbers[role] for role in roles]))
    plain = Dialect(
        ",", False, "brackets", "s", dialect.start, False, "", "", "", False, False, "utf-8", "\n"
    )
    # an empty cell is no reading; one that says so is a reading of nothing
    nothing = "NaN" if dialect.nothing else ""
    holes, rows = (
        [(t, [x or no for x in numbers]) for t, numbers in rows] for no in (dialect.nothing, nothing)
    )
    drawn_path, plain_path = tmp_path / "drawn.csv", tmp_path / "plain.csv"
    drawn_path.write_bytes(written(dialect, names, units, holes))
    plain_path.write_bytes(written(plain, {role: role for role in roles}, units, rows))
    assert frames(open_table(drawn_path)) == frames(open_table(plain_path)), dialect


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_row_names_of_r_move_no_column(tmp_path: Path, delimiter: str, seed: int) -> None:
    """`write.table` has a name less than cells, and the rows of a part of a table count from any number."""
    rows = [(t, cells.split(",")) for t, cells in drive(seed, 400)]
    head = [f'"{name}"' for name in ("time", "speed", "gap", "range_rate", "pedal")]
    lines = [delimiter.join(head)]
    lines += [delimiter.join((f'"{k + 37}"', f"{t:.3f}", *cells)) for k, (t, cells) in enumerate(rows)]
    path, plain = tmp_path / "r.txt", tmp_path / "plain.csv"
    path.write_text("\n".join(lines) + "\n")
    plain.write_text(
        "\n".join([",".join(head), *(",".join((f"{t:.3f}", *cells)) for t, cells in rows)]) + "\n"
    )
    assert frames(open_table(path)) == frames(open_table(plain))


@pytest.mark.parametrize("mark", ["# ", "#", "% ", "%"])
def test_a_header_in_a_comment(tmp_path: Path, mark: str, seed: int) -> None:
    """As numpy and MATLAB write it: the first name is not another one."""
    body = "\n".join(f"{t:.3f},{cells}" for t, cells in drive(seed, 100)) + "\n"
    read = []
    for name, begin in (("x.csv", mark), ("y.csv", "")):
        (tmp_path / name).write_text(f"{begin}time,speed,gap,range_rate,pedal\n{body}")
        read.append(frames(open_table(tmp_path / name)))
    assert read[0] == read[1]
