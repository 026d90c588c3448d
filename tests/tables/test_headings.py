"""A heading that stands for several things is what its unit and its values say, and the second reading is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import canid
from canid.analysis.tables.table import Table, open_table
from canid.values.errors import ConfigError
from tests.fixtures.measured_logs import MEASURED, needs_measured

N = 400
T = 0.1 * np.arange(N)
SPEED = 15.0 + np.sin(T)
ACCEL = np.cos(T)


def _table(folder: Path, **more: np.ndarray | list[str]) -> Table:
    """A drive of 400 rows with other columns; "__" stands for a space, as before a unit."""
    given = {"time": T, "speed": SPEED, "range_rate": 0.1 * ACCEL, **more}
    given.setdefault("gap", 30.0 + ACCEL) if not any("eadway" in name for name in given) else None
    path = folder / "x.csv"
    lines = [",".join(name.replace("__", " ") for name in given)]
    lines += [",".join(map(str, row)) for row in zip(*given.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return open_table(path)


STANDS_FIRST = np.where(T < 25.0, 0.0, np.round(ACCEL, 1))
CASES: dict[str, tuple[str, np.ndarray | list[str], str]] = {
    "an acceleration": ("acc", np.round(ACCEL, 1), "accel"),
    "0 while the car stands, for longer than the first rows": ("acc", STANDS_FIRST, "accel"),
    "in whole numbers": ("acc", np.round(6.0 * ACCEL), "accel"),
    "with a value for none": ("acc", np.where(np.arange(N) == 300, 327.67, ACCEL), "accel"),
    "a pedal": ("acc", 20.0 + 10.0 * ACCEL, "pedal"),
    "a pedal as a fraction": ("acc", 0.2 + 0.1 * ACCEL, "pedal"),
    "a switch": ("acc", (T > 20.0).astype(int), "cruise_active"),
    "a switch in floats": ("acc", (T > 20.0).astype(float), "cruise_active"),
    "a switch that was resampled": ("acc", np.clip((T - 20.0) / 0.8, 0.0, 1.0), "cruise_active"),
    "states": ("acc", np.arange(N) // 100, "cruise_active"),
    "a switch in words": ("acc", ["on" if t > 20.0 else "off" for t in T], "cruise_active"),
    "an acceleration by its unit": ("acc [m/s2]", (T > 20.0).astype(int), "accel"),
    "in g": ("acc (g)", ACCEL / 9.80665, "accel"),
    "a pedal by its unit": ("acc [%]", (T > 20.0).astype(int), "pedal"),
    "a gap by its unit": ("headway [m]", 30.0 + ACCEL, "gap"),
    "a gap in feet": ("Headway (ft)", (30.0 + ACCEL) / 0.3048, "gap"),
    "a headway by its unit": ("headway [s]", 2.0 + 0.1 * ACCEL, "headway"),
    "a gap by its values": ("headway", 30.0 + ACCEL, "gap"),
    "a headway by its values": ("headway", 2.0 + 0.01 * ACCEL, "headway"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_heading_is_what_its_unit_and_values_say(tmp_path: Path, case: str) -> None:
    """The role is listed in the first line; where it is not the name's usual one a note says why, and the other."""
    name, values, role = CASES[case]
    more = {} if role in ("accel", "pedal") else {"accel": ACCEL}
    table = _table(tmp_path, **{name: values}, **more)
    assert f"{role} = {name}" in table.columns
    usual = "headway" if "eadway" in name else "cruise_active"
    said = [note for note in table.notes if f"taken as {role}" in note]
    assert bool(said) == (role != usual)
    if said:
        assert f"where it is {usual}: --columns MAP.toml with [columns] {usual} =" in said[0]


def test_a_switch_that_is_measured_is_not_used(tmp_path: Path) -> None:
    """The set speed under the name of the switch would say that cruise control drives all the time."""
    table = _table(tmp_path, accel=ACCEL, cruise=25.0 + SPEED)
    assert "cruise_active" not in table.columns
    assert any("cruise: not used: its values, " in note for note in table.notes)
    table = _table(tmp_path, accel=ACCEL, **{"cruise [km/h]": SPEED})
    assert "cruise_active" not in table.columns


def test_a_distance_between_two_fronts_is_no_gap(tmp_path: Path) -> None:
    """It is longer by the length of the vehicle ahead, whatever headway it gives."""
    given = {"time": T, "speed": SPEED, "front to front distance": 35.0 + 9.0 * ACCEL, "accel": ACCEL}
    path = tmp_path / "x.csv"
    rows = [",".join(map(str, row)) for row in zip(*given.values(), 0.1 * ACCEL, strict=True)]
    path.write_text("\n".join([",".join([*given, "range_rate"]), *rows]) + "\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="gap is missing"):
        open_table(path)
    path.write_text(path.read_text(encoding="utf-8").replace("front to front ", "", 1), encoding="utf-8")
    assert "gap = distance" in open_table(path).columns


def test_a_gap_in_seconds_is_a_headway_only_if_no_gap_fits(tmp_path: Path) -> None:
    """A gap of 1.5 at 15 m/s is no distance; one of 6 is, although it could be a headway as well."""
    assert "headway = gap" in _table(tmp_path, accel=ACCEL, gap=1.5 + 0.1 * ACCEL).columns
    assert "gap = gap" in _table(tmp_path, accel=ACCEL, gap=6.0 + 0.1 * ACCEL).columns
    close = _table(tmp_path, accel=ACCEL, headway=6.0 + 0.1 * ACCEL)
    assert "headway = headway" in close.columns
    assert any("where it is gap" in note for note in close.notes)


def test_a_name_that_another_column_has_is_left_to_it(tmp_path: Path) -> None:
    """`acc` with the values of an acceleration next to `accel`: the latter is taken."""
    table = _table(tmp_path, accel=ACCEL, acc=2.0 * ACCEL)
    assert "accel = accel" in table.columns
    assert "cruise_active" not in table.columns
    assert any("acc: not used" in note and "another column" in note for note in table.notes)


def test_one_quantity_in_two_units_is_taken_once(tmp_path: Path) -> None:
    """The column in the base unit; two of one unit are still refused."""
    table = _table(tmp_path, accel=ACCEL, **{"v [km/h]": 3.6 * SPEED, "v [m/s]": SPEED})
    assert "speed = speed" in table.columns
    path = tmp_path / "y.csv"
    rows = "".join(f"{t:.1f},{3.6 * v:.3f},{v:.3f},30,0,0\n" for t, v in zip(T, SPEED, strict=True))
    path.write_text("time,v [km/h],v [m/s],gap,range_rate,accel\n" + rows, encoding="utf-8")
    assert "speed = v [m/s]" in open_table(path).columns
    path.write_text("time,v [m/s],v [mps],gap,range_rate,accel\n" + rows, encoding="utf-8")
    assert "speed = v [m/s]" in open_table(path).columns
    path.write_text("time,v,v,gap,range_rate,accel\n" + rows, encoding="utf-8")
    with pytest.raises(ConfigError, match="speed could be v #1, v #2"):
        open_table(path)


def test_the_speed_by_satellite_stands_in_and_never_stops_the_reading(tmp_path: Path) -> None:
    """Two of them, as Torque writes, next to the car's own, and alone."""
    two = {"GPS Speed (Meters/second)": SPEED, "Speed (GPS)(km/h)": 3.6 * SPEED}
    both = _table(tmp_path, accel=ACCEL, **two)
    assert "gnss_speed = GPS Speed (Meters/second)" in both.columns
    assert any("Speed (GPS)(km/h) as well" in note for note in both.notes)
    path = tmp_path / "y.csv"
    rows = "".join(f"{t:.1f},{v:.3f},{3.6 * v:.3f},30,0,0\n" for t, v in zip(T, SPEED, strict=True))
    path.write_text(",".join(["time", *two, "gap", "range_rate", "accel"]) + "\n" + rows, encoding="utf-8")
    alone = open_table(path)
    assert "speed = GPS Speed (Meters/second)" in alone.columns
    assert any("speed: the one by satellite" in note for note in alone.notes)


def test_times_are_those_of_the_column_that_advances(tmp_path: Path) -> None:
    """The elapsed time of a session in parts comes after its time stamps; a column that stands still is none."""
    path = tmp_path / "x.csv"
    for names, first, second in (
        ("elapsed_time,timestamp", T % 20.0, 1785849363.0 + T),
        ("t,interval", np.zeros(N), 1000.0 * T),
    ):
        numbers = zip(first, second, SPEED, strict=True)
        rows = "".join(f"{a:.3f},{b:.3f},{v:.3f},30,0,0\n" for a, b, v in numbers)
        path.write_text(f"{names},speed,gap,range_rate,accel\n{rows}", encoding="utf-8")
        table = open_table(path)
        assert f"time = {names.split(',')[1]}" in table.columns
        assert table.log.span[1] - table.log.span[0] == pytest.approx(39.9)


def test_what_was_judged_in_a_frame_is_a_warning() -> None:
    """A data frame has no first lines; names that are given as roles are not judged."""
    frame = {"time": T, "speed": SPEED, "gap": 30.0 + ACCEL, "range_rate": 0.1 * ACCEL, "acc": ACCEL}
    with pytest.warns(UserWarning, match="acc: taken as accel"):
        trace = canid.from_frame(frame)
    assert trace.learn.any()
    with pytest.raises(ValueError, match='gap: "s" is no unit of it'):
        canid.from_arrays(
            time=T, speed=SPEED, gap=2.0 + 0 * T, range_rate=0 * T, accel=ACCEL, units={"gap": "s"}
        )


@needs_measured
def test_measured_headings() -> None:
    """`acc` in steps of 0.1 m/s² gives the numbers of the same file with `accel`; `headway [m]` is a gap."""
    folder = MEASURED / "reports" / "45-headings"
    one, other = (open_table(folder / f"{name}_rounded.csv") for name in ("acc", "accel"))
    for a, b in zip(one.log.columns(), other.log.columns(), strict=True):
        np.testing.assert_array_equal(a.data, b.data)
    assert "accel = acc" in open_table(folder / "acc_pedal.csv").columns
    assert "gap = headway [m]" in open_table(folder / "headway_unit.csv").columns


@pytest.mark.parametrize(
    "name",
    [
        "CAN 1::ABS::Speed [m/s]",
        "ABS.Speed",
        "Speed@ABS",
        "/abs/speed",
        "ABS: Speed",
        "CAN2/ECM/VehicleSpeed",
    ],
)
def test_a_heading_with_its_sender_is_what_stands_behind_it(tmp_path: Path, name: str) -> None:
    """A bus and a control unit say nothing of a signal; of two that may be meant none is taken, nor another speed."""
    path = tmp_path / "x.csv"
    rows = "".join(f"{t:.1f},{v:.3f},30,0,0,1\n" for t, v in zip(T, SPEED, strict=True))
    path.write_text(f"time,{name},gap,range_rate,accel,ECM::Gap\n{rows}", encoding="utf-8")
    table = open_table(path)
    assert f"speed = {name}" in table.columns
    assert "gap = gap," in table.columns
    for others in ("ABS.Speed,gap,range_rate,accel,ECM.Speed", "Fan.Speed,gap,range_rate,accel,ABS.Limit"):
        path.write_text(f"time,{others}\n{rows}", encoding="utf-8")
        with pytest.raises(ConfigError, match="speed"):
            open_table(path)
