"""Tables of many shapes give the same drive, or one line that says what is missing."""

from __future__ import annotations

import gzip
import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.analysis.drive.drive_parameters import identify
from canid.analysis.tables.table import open_table
from canid.ui.cli import main
from canid.values.errors import ConfigError, LogError
from canid.values.types import Interval, Trace
from tests.tables import platoon
from tests.tables.platoon import K2, Platoon
from tests.tables.reading import read_table

COLUMNS = ("time", "speed", "gap", "range_rate", "accel")


@pytest.fixture(scope="module")
def drive() -> Platoon:
    return platoon.platoon(3)


def columns(of: Platoon) -> dict[str, np.ndarray]:
    rate = of.speed[:, 0] - of.speed[:, 1]
    numbers = of.t, of.speed[:, 1], of.gap(1), rate, of.accel[:, 1]
    return {name: np.round(x, 6) for name, x in zip(COLUMNS, numbers, strict=True)}


def text(of: dict[str, np.ndarray], delimiter: str = ",") -> str:
    rows = zip(*([f"{x:.6f}" for x in column] for column in of.values()), strict=True)
    return "\n".join([delimiter.join(of), *map(delimiter.join, rows)]) + "\n"


def equal(a: Trace, b: Trace, atol: float = 0.0) -> None:
    for name in ("t", "output", "inputs"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=0, atol=atol, err_msg=name)
    np.testing.assert_array_equal(a.learn, b.learn)


def gain(trace: Trace) -> Interval:
    return identify(trace, select_orders=False, sliding=False).channels["range_rate"].K


Change = Callable[[dict[str, np.ndarray]], str | bytes]
_START = datetime(2026, 3, 1, 9, 30, 0, 250_000, tzinfo=UTC)


def _renamed(of: dict[str, np.ndarray], **names: str) -> dict[str, np.ndarray]:
    return {names.get(name, name): x for name, x in of.items()}


def _scaled(of: dict[str, np.ndarray], name: str, heading: str, factor: float) -> str:
    return text(_renamed({**of, name: of[name] * factor}, **{name: heading}))


def _stamped(of: dict[str, np.ndarray], stamp: Callable[[float], str], heading: str = "time") -> str:
    lines = text(_renamed(of, time=heading)).splitlines()
    rows = [line.split(",", 1)[1] for line in lines[1:]]
    return "\n".join([lines[0], *(f"{stamp(t)},{row}" for t, row in zip(of["time"], rows, strict=True))])


VARIANTS: dict[str, Change] = {
    "shuffled columns": lambda of: text({name: of[name] for name in reversed(COLUMNS)}),
    "km/h in brackets": lambda of: _scaled(of, "speed", "Speed [km/h]", 3.6),
    "km/h as an ending": lambda of: _scaled(of, "speed", "ego_speed_kmh", 3.6),
    "feet": lambda of: _scaled(of, "gap", "d_rel (ft)", 1 / 0.3048),
    "closing speed": lambda of: _scaled(of, "range_rate", "closing_speed", -1.0),
    "lead speed": lambda of: text(
        {**{n: x for n, x in of.items() if n != "range_rate"}, "lead_speed": of["speed"] + of["range_rate"]}
    ),
    "headway": lambda of: text(
        {**{n: x for n, x in of.items() if n != "gap"}, "thw": of["gap"] / of["speed"]}
    ),
    "semicolons and decimal commas": lambda of: text(of, ";").replace(".", ","),
    "tabs, Windows lines, a mark": lambda of: b"\xef\xbb\xbf" + text(of, "\t").replace("\n", "\r\n").encode(),
    "quotes": lambda of: re.sub(r"([^,\n]+)", r'"\1"', text(of)),
    "a line of units": lambda of: text(of).replace("accel\n", "accel\ns,m/s,m,m/s,m/s2\n", 1),
    "a preamble": lambda of: "# of a driving simulator\nrun,7,,,\n" + text(of),
    "ms since 1970": lambda of: _stamped(of, lambda t: f"{1_772_357_400_250 + 1000 * t:.0f}"),
    "ns since 1970": lambda of: _stamped(of, lambda t: str(1_772_357_400_250_000_000 + round(1e9 * t))),
    "ISO 8601": lambda of: _stamped(of, lambda t: (_START + timedelta(seconds=float(t))).isoformat()),
    "clock": lambda of: _stamped(of, lambda t: f"{(_START + timedelta(seconds=float(t))):%H:%M:%S.%f}"),
    "ms from 0": lambda of: _stamped(of, lambda t: f"{1000 * t:.0f}", "t [ms]"),
    "ms without a unit": lambda of: _stamped(of, lambda t: f"{1000 * t:.0f}"),
    "utc and times from 0": lambda of: _stamped(
        of, lambda t: f"{(_START + timedelta(seconds=float(t))).isoformat()},{t}", "utc,t [s]"
    ),
    "the latest first": lambda of: text({name: x[::-1] for name, x in of.items()}),
    "thousands of other columns": lambda of: text(of | {f"x{k}": of["time"] for k in range(300)}),
    "gzipped": lambda of: gzip.compress(text(of).encode()),
    "UTF-16": lambda of: text(of).encode("utf-16"),
}


@pytest.mark.slow("whole tables")
@pytest.mark.parametrize("variant", VARIANTS)
def test_however_it_is_written_it_is_the_same_drive(tmp_path: Path, drive: Platoon, variant: str) -> None:
    """Order, units, delimiters, encodings and clocks change nothing beyond the digits that are written."""
    short = {name: x[:400] for name, x in columns(drive).items()}
    plain, other = (
        tmp_path / "plain.csv",
        tmp_path / ("other.csv.gz" if variant == "gzipped" else "other.csv"),
    )
    plain.write_text(text(short), encoding="utf-8")
    content = VARIANTS[variant](short)
    other.write_bytes(content.encode() if isinstance(content, str) else content)
    # 6 digits of the factors of feet and headways
    equal(read_table(plain), read_table(other), 1e-5)
    start = open_table(other).log.start_utc
    dated = "1970" in variant or "ISO" in variant
    assert start == pytest.approx(_START.timestamp(), abs=1e-3) if dated else start != start


@pytest.mark.slow("whole tables")
def test_the_rate_of_the_rows_does_not_move_the_gain(tmp_path: Path) -> None:
    """The same driver at 5 Hz, and at 50 Hz with half of the rows missing at random, is within the interval."""
    fine = columns(platoon.platoon(5, minutes=2.5, rate=50.0, vehicles=2))
    keep = np.random.default_rng(1).random(len(fine["time"])) < 0.5
    for rows in (slice(None, None, 10), keep):
        path = tmp_path / "x.csv"
        path.write_text(text({name: x[rows] for name, x in fine.items()}), encoding="utf-8")
        found = gain(read_table(path))
        assert found.low < K2 < found.high, rows


SETS: dict[str, tuple[Callable[[Path, Platoon], Path], float, str, int]] = {
    "ngsim": (platoon.ngsim, 10.0, "3", 1),
    "ngsim.txt": (lambda path, of: platoon.ngsim(path, of, header=False), 10.0, "3", 1),
    "highd": (platoon.highd, 25.0, "2", 1),
    "highd, rightwards": (lambda path, of: platoon.highd(path, of, leftwards=False), 25.0, "3", 2),
    "openacc": (platoon.openacc, 10.0, "3", 2),
    "positions": (platoon.positions, 10.0, "11", 1),
    "follownet": (platoon.follownet, 10.0, "7", 1),
    "openpilot": (platoon.openpilot, 25.0, "", 1),
}


@pytest.mark.parametrize("name", SETS)
def test_public_layouts_give_the_drivers_gap_and_speed(tmp_path: Path, name: str) -> None:
    """Feet, frames, signs, headways from front to front, leads in other rows: the follower's own gap, rate and speed."""
    write, rate, vehicle, follower = SETS[name]
    of = platoon.platoon(7, minutes=0.5, rate=rate)
    path = write(tmp_path / (f"{name}.csv" if "." not in name else name), of)
    title = name.split(".")[0].split(",")[0]
    table = open_table(path, None) if title in ("openpilot",) else None
    trace = read_table(
        path, None if title in ("positions", "openpilot") else title, vehicle_id=vehicle or None
    )
    # one row of a vehicle that has just become the lead, the edges of slopes, and the lag of the smoothing
    inside = slice(10, -25)
    # frames are counted from 1
    t = trace.t[inside] - (1 / 25 if title == "highd" else 0.0)
    truth = {
        "speed": of.speed[:, follower],
        "gap": of.gap(follower),
        "range_rate": of.speed[:, follower - 1] - of.speed[:, follower],
    }
    for role, x in truth.items():
        np.testing.assert_allclose(
            trace.signals[role][inside], np.interp(t, of.t, x), atol=0.05, err_msg=role
        )
    derived = title in ("openacc", "positions", "follownet")
    assert trace.output_filter is not None
    assert trace.output_filter.kind == ("savitzky_golay" if derived else "unknown")
    np.testing.assert_allclose(
        trace.output[inside], np.interp(t, of.t, of.accel[:, follower]), atol=0.25 if derived else 0.02
    )
    assert table is None or "read as openpilot" in table.notes[0]


def test_several_vehicles_are_listed_by_how_long_they_follow(tmp_path: Path) -> None:
    """Without --vehicle-id the message names those that follow, the longest first."""
    of = platoon.platoon(7, minutes=0.5)
    of.lead[100:, 2] = -1
    for write, listed in (
        (platoon.ngsim, "3 (30 s behind a lead), 4 (10 s), 2 (0 s)"),
        (platoon.openacc, "2, 3"),
    ):
        path = write(tmp_path / "x.csv", of)
        with pytest.raises(
            ConfigError, match=re.escape(f"--vehicle-id{' ID;' if write is platoon.ngsim else ':'} {listed}")
        ):
            read_table(path)
    with pytest.raises(ConfigError, match="none of its 900 rows has Vehicle_ID=99"):
        read_table(platoon.ngsim(tmp_path / "x.csv", of), "ngsim", vehicle_id=99)


def test_another_vehicle_ahead_begins_a_new_history(tmp_path: Path) -> None:
    """A lead that becomes another one, at nearly the same gap, is a new segment, not a jump of the range rate."""
    of = platoon.platoon(7, minutes=0.5, vehicles=4)
    shifted = of._replace(lead=of.lead.copy())
    shifted.lead[150:, 3] = 0
    whole = read_table(platoon.ngsim(tmp_path / "a.csv", of), "ngsim", vehicle_id=5)
    cut = read_table(platoon.ngsim(tmp_path / "b.csv", shifted), "ngsim", vehicle_id=5)
    assert len(set(whole.segment[whole.learn])) == 1
    assert len(set(cut.segment[cut.learn])) == 2


@pytest.mark.slow("whole tables")
def test_holes_texts_and_times_that_go_back_are_counted_never_measured(
    tmp_path: Path, drive: Platoon
) -> None:
    """Empty cells, words, infinities, repeated and late rows: not measured, sorted, counted, and the rest is as it was."""
    short = {name: x[:600] for name, x in columns(drive).items()}
    lines = text(short).splitlines()
    for k in range(200, 230):  # 3 s without a lead
        t, v, _, _, a = lines[k].split(",")
        lines[k] = f"{t},{v},,,{a}"
    cells = lines[300].split(",")
    lines[300] = ",".join([cells[0], "broken", *cells[2:]])
    lines[310] = ",".join([*lines[310].split(",")[:2], "inf", *cells[3:]])
    lines[320] = ",".join(["", *cells[1:]])  # no time
    lines.insert(400, lines[380])  # 2 s back
    lines.insert(450, lines[450])  # twice
    path = tmp_path / "x.csv"
    path.write_text("\n".join([*lines, "60.0,20.1"]) + "\n", encoding="utf-8")
    table = open_table(path)
    assert any("speed: 1 of 602 cells hold no number" in note for note in table.notes)
    assert any("1 of 602 rows have no time" in note for note in table.notes)
    drive_read = canid.read_drive(path, table.vehicle, log=table.log)
    health = drive_read.health
    assert health.counters['gap: "empty cell"'] == 30
    assert health.counters['speed: "no number"'] == 1
    assert health.damage is not None
    assert "read 601 of 602 rows" in health.damage.says
    assert "line 604: it has 2 cells, and a row has 5" in health.damage.says
    assert any(
        "1 of 602 rows were not in the order of time; they were sorted" in note for note in table.notes
    )
    assert not health.back_in_time
    trace = drive_read.trace
    assert not trace.learn[(trace.t > 20.6) & (trace.t < 23.0)].any()
    assert np.nanmax(np.abs(trace.signals["gap"])) < 200


WRONG = {
    "no rows": ("time,speed,gap,v_rel\n", LogError, "has a header, but no rows"),
    "one column": ("speed\n1.0\n2.0\n", LogError, "has one column alone, speed"),
    "no header": ("1,2,3\n2,3,4\n", LogError, "no header"),
    "binary": (b"\x00\x01" * 300, LogError, "binary"),
    "empty": ("", LogError, "empty"),
    "no time": ("speed,gap,range_rate,accel\n1,2,3,4\n", ConfigError, "no column of times"),
    "no gap": ("time,speed,accel\n0,1,2\n", ConfigError, "gap, range_rate are missing"),
    "two speeds": (
        "time,v_ego,own_speed,gap,v_rel\n0,1,1,2,3\n",
        ConfigError,
        "speed could be v_ego, own_speed",
    ),
    "a wrong unit": ("time,speed [kg],gap,v_rel\n0,1,2,3\n", ConfigError, '"kg" is no unit'),
    "km/h without saying so": (
        "time,speed,gap,v_rel,accel\n0,110,2,3,0\n1,111,2,3,0\n",
        ConfigError,
        "state the unit",
    ),
    "no dates": ("time,speed,gap,v_rel\nsoon,1,2,3\nlater,1,2,3\n", ConfigError, '"soon" is no time'),
    "texts": ("time,speed,gap,v_rel\n0,fast,2,3\n1,slow,2,3\n", ConfigError, "no row has a value of speed"),
    "frames of SavvyCAN": (
        "Time Stamp,ID,Extended,Dir,Bus,LEN,D1\n1,0x1,false,Rx,0,1,2\n",
        ConfigError,
        "CAN frames",
    ),
    "one long line": ("time," * 1_000_000, LogError, "a line has more"),
    "an open quote": ('time,speed,gap,v_rel\n0,"1,2,3\n1,1,2,3\n' + "x" * 200_000, LogError, "no header"),
    "a formula": ("=cmd|'/c calc'!A0,time,speed\n1,2,3\n", ConfigError, "missing"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_file_gives_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str) -> None:
    """What, where, what to do; exit code 2; no traceback."""
    content, _, says = WRONG[what]
    path = tmp_path / "x.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    assert main(["identify", str(path)]) == 2
    lines = [
        line for line in capsys.readouterr().err.splitlines() if not line.startswith("canid: x.csv: time")
    ]
    assert len(lines) == 1, lines
    assert says in lines[0]
    assert "x.csv" in lines[0]


@pytest.mark.slow("whole tables")
def test_bombs_are_refused(tmp_path: Path) -> None:
    """A gzipped file that unpacks without end is left before it fills the memory; what came before is read."""
    path = tmp_path / "x.csv.gz"
    path.write_bytes(
        gzip.compress(
            b"time,speed,gap,range_rate,accel\n" + (b"0,1,2,3,4," + b"x" * 5000 + b"\n") * 20_000, 6
        )
    )
    table = open_table(path)
    damage = canid.read_drive(path, table.vehicle, log=table.log).health.damage
    assert damage is not None
    assert "unpacks to more than 200 times its size; unpack it with gunzip" in damage.says


def test_csv_of_can_frames_is_still_a_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The header decides; options of tables are refused for a log, and a log still needs its vehicle."""
    path = tmp_path / "frames.csv"
    frames = "".join(f"{1.0 + 0.1 * k:.1f},0x110,0,0,0,4,MgAAAA==\n" for k in range(300))
    path.write_text("timestamp,arbitration_id,extended,remote,error,dlc,data\n" + frames, encoding="utf-8")
    assert main(["check", str(path), "--vehicle", "generic", "--json", str(tmp_path / "c.json")]) in (0, 1)
    assert main(["identify", str(path)]) == 2
    assert "--vehicle V.toml is missing" in capsys.readouterr().err
    assert main(["identify", str(path), "--vehicle", "generic", "--vehicle-id", "3"]) == 2
    assert "--vehicle-id is for tables" in capsys.readouterr().err


def test_a_column_map_reports_all_mistakes(tmp_path: Path) -> None:
    """Unknown roles, keys and outputs, with the nearest name."""
    path = tmp_path / "map.toml"
    path.write_text(
        '[columns]\nspeeed = "v"\ngap = { column = "d", unti = "m" }\n[driver]\noutput = "pedl"\n',
        encoding="utf-8",
    )
    table = tmp_path / "x.csv"
    table.write_text("time,v,d\n0,1,2\n", encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        read_table(table, path)
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    for hint in ('"speed"', '"unit"', '"pedal"'):
        assert any(f"did you mean {hint}" in line for line in lines), hint


@pytest.mark.slow("whole tables")
def test_verbs_read_tables(tmp_path: Path, drive: Platoon) -> None:
    """check, replay, compare and study take a table; --vehicle may be the column map."""
    named = dict(
        zip(("clock", "v", "dist", "dv", "acc"), [x[:900] for x in columns(drive).values()], strict=True)
    )
    path, by = tmp_path / "x.csv", tmp_path / "map.toml"
    path.write_text(text({**named, "v": named["v"] * 3.6}), encoding="utf-8")
    by.write_text(
        'name = "simulator"\n[columns]\ntime = "clock"\nspeed = { column = "v", unit = "km/h" }\ngap = "dist"\n'
        'range_rate = "dv"\naccel = "acc"\n[driver]\noutput = "accel"\nheadway_desired = 1.5\n'
        '[driver.output_filter]\nkind = "none"\n',
        encoding="utf-8",
    )
    assert main(["check", str(path), "--vehicle", str(by)]) == 0
    assert main(["replay", str(path), "--columns", str(by), "--stop", "20"]) == 0
    assert main(["compare", str(path), "--halves", "--columns", str(by)]) == 0
    trace = read_table(path, by)
    np.testing.assert_allclose(trace.inputs[:, 0], trace.signals["headway"] - 1.5, equal_nan=True)
    assert trace.output_filter is not None
    assert trace.output_filter.kind == "none"
