"""An id that stands for several vehicles is refused with the list of them, and each of them can be chosen."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from canid.analysis.tables.table import Selection, open_table
from canid.values.errors import ConfigError
from tests.exact import exact

_NGSIM = (
    "Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,v_Length,v_Width,v_Class,v_Vel,v_Acc,Lane_ID,"
    "Preceding,Following,Space_Headway,Time_Headway,Location"
)


def _period(
    start_ms: int, ids: dict[int, tuple[float, int]], place: str, frame: int, rng: random.Random, n: int = 60
) -> list[str]:
    """Rows of some vehicles: id -> length in feet, and the id ahead."""
    lines = []
    for id_, (length, ahead) in ids.items():
        speed = 40 + rng.random()
        lines += [
            f"{id_},{frame + k},{n},{start_ms + 100 * k},20,{300 - 90 * id_ + 4 * k},{length},6,2,"
            f"{speed + rng.random():.2f},0.1,2,{ahead},0,{90 if ahead else 0},2,{place}"
            for k in range(n)
        ]
    return lines


def _written(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join([_NGSIM, *lines]) + "\n", encoding="utf-8")
    return path


def _frames(path: Path, *where: str, id_: str = "2") -> str:
    return exact(tuple(open_table(path, selection=Selection(where, id_)).log.columns()))


_CASES = {
    "another period": (15 * 60_000, 18.0, "us-101", 100),
    "another period of the same length": (15 * 60_000, 15.5, "us-101", 100),
    "a period at once, with a lower count of frames": (9_000, 15.5, "us-101", 10_000),
    "another place at the same time": (0, 15.5, "i-80", 100),
    "another length, without a pause": (6_000, 22.0, "us-101", 160),
}


@pytest.mark.parametrize("case", _CASES)
@pytest.mark.parametrize("shuffled", [False, True])
def test_an_id_of_several_vehicles_is_refused_and_can_be_chosen(
    case: str, shuffled: bool, tmp_path: Path, seed: int
) -> None:
    """Each vehicle alone gives the rows of its own period, whatever the order of the rows."""
    rng = random.Random(seed)
    shift, length, place, frame = _CASES[case]
    start = 1_118_846_980_200 + rng.randrange(10**9)
    one = _period(start, {1: (14.5, 0), 2: (15.5, 1)}, "us-101", 100, rng)
    other = _period(start + shift, {1: (16.5, 0), 2: (length, 1)}, place, frame, rng)
    lines = one + other
    if shuffled:
        rng.shuffle(lines)
    path = _written(tmp_path / "all.csv", lines)
    with pytest.raises(
        ConfigError, match=r"vehicle 2 is 2 vehicles that have the same id: 2#1: 20.* 2#2: "
    ) as error:
        open_table(path, selection=Selection((), "2"))
    assert "--vehicle-id 2#1 to 2#2" in str(error.value)
    parts = [_frames(path, id_=f"2#{k}") for k in (1, 2)]
    alone = [_frames(_written(tmp_path / "one.csv", lines)) for lines in (one, other)]
    assert sorted(parts) == sorted(alone)
    with pytest.raises(ConfigError, match="stands for 2"):
        open_table(path, selection=Selection((), "2#3"))


def test_conditions_choose_as_well(tmp_path: Path) -> None:
    """The conditions that the message proposes, and any other that leaves one vehicle."""
    rng = random.Random(3)
    one = _period(1_118_846_980_200, {1: (14.5, 0), 2: (15.5, 1)}, "us-101", 100, rng)
    other = _period(1_118_846_980_200, {1: (16.5, 0), 2: (22.0, 1)}, "i-80", 900, rng)
    path = _written(tmp_path / "all.csv", [line for pair in zip(one, other, strict=True) for line in pair])
    with pytest.raises(ConfigError, match='--where "Location=us-101"'):
        open_table(path, selection=Selection((), "2"))
    alone = _frames(_written(tmp_path / "one.csv", other))
    assert _frames(path, "Location=i-80") == alone
    assert _frames(path, "v_Length=22") == alone


def test_three_drivers_of_one_id_are_three(tmp_path: Path) -> None:
    """Three periods of fifteen minutes with other lengths: three vehicles, in the order of time."""
    rng = random.Random(4)
    lines = []
    for k, length in enumerate((15.5, 22.0, 18.0)):
        lines += _period(1_118_846_980_200 + k * 900_000, {1: (14.5, 0), 2: (length, 1)}, "us-101", 100, rng)
    rng.shuffle(lines)
    path = _written(tmp_path / "all.csv", lines)
    with pytest.raises(
        ConfigError, match=r"vehicle 2 is 3 vehicles .*v_Length 15.5.*v_Length 22.*v_Length 18"
    ):
        open_table(path, selection=Selection((), "2"))


_OWN = "time,vehicle_id,speed,gap,range_rate,accel"


def test_minutes_without_a_row_are_said_in_any_table(tmp_path: Path) -> None:
    """A car that stood still for minutes is one vehicle: the pause is said."""
    lines = [f"{k * 0.1 + (600 if k >= 100 else 0):.1f},car,20,30,0,0" for k in range(200)]
    path = tmp_path / "x.csv"
    path.write_text("\n".join([_OWN, *lines]) + "\n", encoding="utf-8")
    table = open_table(path)
    assert any("vehicle car has no row for 10 minutes" in note for note in table.notes)


def test_vehicles_at_once_that_no_column_tells_apart_are_refused(tmp_path: Path) -> None:
    """Two rows of each time with other values, and nothing that says of which vehicle: no number."""
    lines = [f"{k * 0.1:.1f},7,{v},30,0,0" for k in range(200) for v in (20 + k % 3, 30 + k % 4)]
    path = tmp_path / "x.csv"
    path.write_text("\n".join([_OWN, *lines]) + "\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="vehicle 7 has several rows of the same time with other values"):
        open_table(path)


def test_lengths_that_are_measured_in_every_row_are_no_other_vehicle(tmp_path: Path) -> None:
    """A length that a radar measures anew, and a break of the count of frames of a second, are one vehicle."""
    rng = random.Random(5)
    lines = [
        f"{k * 0.1 + (1.0 if k >= 100 else 0.0):.1f},7,{k + (10 if k >= 100 else 0)},{4 + rng.random():.2f},20,30,0,0"
        for k in range(200)
    ]
    path = tmp_path / "x.csv"
    head = "time,vehicle_id,frame_id,length,speed,gap,range_rate,accel"
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    assert open_table(path).log.count.read == 200


def test_ids_that_hold_the_mark_themselves(tmp_path: Path) -> None:
    """An id such as car#2 is that id."""
    lines = [f"{k * 0.1:.1f},car#{n},20,30,0,0" for k in range(100) for n in (1, 2)]
    path = tmp_path / "x.csv"
    path.write_text("\n".join([_OWN, *lines]) + "\n", encoding="utf-8")
    assert open_table(path, selection=Selection((), "car#2")).log.count.read == 200


@pytest.mark.parametrize("name", ["merged", "same_time"])
def test_reported_sets_are_refused(name: str, measured: Path) -> None:
    """The reported files: two drivers of one id are never one estimate."""
    with pytest.raises(ConfigError, match="vehicle 2 is 2 vehicles"):
        open_table(measured / "reports" / "22-ngsim" / f"{name}.csv", selection=Selection((), "2"))


@pytest.mark.parametrize("name", ["shuffled", "comma"])
def test_reported_forms_are_the_same_drive(name: str, measured: Path) -> None:
    """In any order, and with thousands separators: the rows of period1.csv."""
    folder = measured / "reports" / "22-ngsim"
    assert _frames(folder / f"{name}.csv") == _frames(folder / "period1.csv")
