"""A radar's objects as messages of one or two, with other names in some, as a list with ids, on pages: one lead."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.analysis.proposal import proposal
from canid.io.logs import open_log
from canid.values.errors import ConfigError
from tests.fixtures.measured_logs import files

HEAD = """VERSION ""
NS_ :
BS_:
BU_: X
BO_ 256 Engine: 8 X
 SG_ Pedal : 0|16@1+ (0.01,0) [0|100] "%" X
BO_ 257 Brake: 8 X
 SG_ Speed : 0|16@1+ (0.01,0) [0|655] "km/h" X
"""
# two signals of 16 bits and one of 8, of one object
PART = ' SG_ {d} {page}: {a}|16@1+ (0.01,0) [0|655] "m" X\n SG_ {r} {page}: {b}|16@1- (0.01,0) [-327|327] "m/s" X\n'
SIDE = ' SG_ {s} {page}: {c}|8@1- (0.1,0) [-12|12] "m" X\n'
OBJECTS = 4


def signals(number: str = "", page: str = "", at: int = 0, side: bool = True) -> str:
    names = {"d": f"DistLong{number}", "r": f"VRel{number}", "s": f"DistLat{number}"}
    return (PART + SIDE * side).format(**names, page=page, a=at, b=at + 16, c=at + 32)


LAYOUTS = {
    "numbered": (
        "".join(f"BO_ {1024 + k} Track_{k}: 8 X\n{signals()}" for k in range(OBJECTS)),
        'tracks = "Track_{0..3}"\ndistance = "DistLong"\nrate = "VRel"\nlateral = "DistLat"',
    ),
    "names": (
        "".join(
            f"BO_ {1024 + k} Track_{k}: 8 X\n{signals().replace('VRel', 'VRel' if k % 2 else 'SpeedRel')}"
            for k in range(OBJECTS)
        ),
        'tracks = "Track_{0..3}"\ndistance = "DistLong"\n'
        'rate = ["SpeedRel", "VRel", "SpeedRel", "VRel"]\nlateral = "DistLat"',
    ),
    "several": (
        "".join(
            f"BO_ {1024 + k} Track_{k}: 16 X\n{signals('1')}{signals('2', at=64)}"
            for k in range(OBJECTS // 2 + 1)
        ),
        'tracks = "Track_{0..2}"\ndistance = "DistLong{1..2}"\nrate = "VRel{1..2}"\nlateral = "DistLat{1..2}"',
    ),
    "list": (
        f'BO_ 1024 Obj_1_General: 8 X\n SG_ Obj_ID : 40|8@1+ (1,0) [0|255] "" X\n{signals()}',
        'tracks = "Obj_1_General"\ndistance = "DistLong"\nrate = "VRel"\nlateral = "DistLat"\nid = "Obj_ID"',
    ),
    "pages": (
        'BO_ 1024 Radar: 8 X\n SG_ Page M : 40|8@1+ (1,0) [0|255] "" X\n'
        + "".join(signals(str(k), f"m{k} ") for k in range(OBJECTS)),
        'tracks = "Radar"\ndistance = "DistLong{0..3}"\nrate = "VRel{0..3}"\nlateral = "DistLat{0..3}"',
    ),
}


# a report that is out of the range of its distance
NOTHING = b"\xff\xff" + bytes(6)


def frame(layout: str, message: int, t: float, reports: dict[int, tuple[float, float, float]]) -> str:
    """A message with the reports of some objects, by number."""
    each = {}
    for number, (distance, rate, side) in reports.items():
        data = round(distance * 100).to_bytes(2, "little") + round(rate * 100).to_bytes(
            2, "little", signed=True
        )
        each[number] = data + round(side * 10).to_bytes(1, "little", signed=True) + bytes([number, 0, 0])
    if layout == "several":
        both = b"".join(each.get(number, NOTHING) for number in (2 * message, 2 * message + 1))
        return f"({1.75e9 + t:.6f}) can0 {1024 + message:X}##0{both.hex().upper()}\n"
    (data,) = each.values()
    return f"({1.75e9 + t:.6f}) can0 {1024 + message:X}#{data.hex().upper()}\n"


def trace(folder: Path, layout: str, seed: int) -> canid.Trace:
    rng = np.random.default_rng(seed)
    numbers = rng.permutation(200)[:OBJECTS].tolist()
    folder.mkdir()
    (folder / "car.dbc").write_text(HEAD + LAYOUTS[layout][0])
    (folder / "car.toml").write_text(
        'name = "car"\ndbc = ["car.dbc"]\n[signals]\npedal = "Engine.Pedal"\nspeed = "Brake.Speed"\n'
        f"[lead]\n{LAYOUTS[layout][1]}\n"
    )
    lines = []
    for n in range(400):
        t = 0.05 * n
        pedal, speed = round(2000 + 500 * np.sin(t)), round(7200 + 300 * np.cos(t))
        for id_, raw in (("100", pedal), ("101", speed)):
            lines.append(f"({1.75e9 + t:.6f}) can0 {id_}#{raw.to_bytes(8, 'little').hex().upper()}\n")
        gap = 40.0 + 5.0 * np.sin(0.3 * t)
        reports = [
            (gap, 1.5 * np.cos(0.3 * t), 0.2),
            (0.6 * gap, 0.3, 3.6),
            (gap + 30.0, -1.0, -0.3),
            (90.0, -2.0, -5.0),
        ]
        # an object leaves the list and comes back
        there = {k: report for k, report in enumerate(reports) if k != 2 or not 100 < n < 200}
        for pair in (0, 1):
            at, both = t + 0.001 * (pair + 1), [k for k in (2 * pair, 2 * pair + 1) if k in there]
            if layout == "several":
                lines.append(frame(layout, pair, at, {k: there[k] for k in both}))
                continue
            for k in both:
                number = numbers[k] if layout == "list" else k
                lines.append(frame(layout, 0 if layout in ("list", "pages") else k, at, {number: there[k]}))
    (folder / "drive.log").write_text("".join(lines))
    return canid.read_trace(folder / "drive.log", folder / "car.toml")


@pytest.mark.parametrize("layout", ["names", "several", "list", "pages"])
def test_the_lead_does_not_depend_on_the_layout(tmp_path: Path, layout: str, seed: int) -> None:
    expected, found = (trace(tmp_path / name, name, seed) for name in ("numbered", layout))
    assert np.isfinite(expected.signals["gap"]).mean() > 0.8
    for role in ("gap", "range_rate", "lead_valid"):
        np.testing.assert_array_equal(found.signals[role], expected.signals[role])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_init_proposes_each_layout(tmp_path: Path, layout: str, seed: int) -> None:
    """With units in the database and a log: the section that a person writes, and neither gap nor rate of one object."""
    trace(tmp_path / layout, layout, seed)
    folder = tmp_path / layout
    made = proposal(folder / "car.dbc", folder, open_log(folder / "drive.log"))
    found, wanted = tomllib.loads(made.text), tomllib.loads(f"[lead]\n{LAYOUTS[layout][1]}")
    assert found["lead"] == wanted["lead"]
    assert not {"gap", "range_rate", "lead_speed"} & set(found["signals"])


@pytest.mark.parametrize(
    ("lead", "says"),
    [
        (
            'distance = "DistLong{0..3}"\nrate = "VRel{0..2}"',
            "distance numbers 4 and rate numbers 3: as many in each",
        ),
        ('distance = "DistLong{0..}"\nrate = "VRel0"', "lead.distance: write it as"),
        (
            'distance = "DistLong0"\nrate = "VRel0"\nid = "Pag"',
            'no signal "Pag" in message Radar .did you mean "Page"',
        ),
        ('distance = ["DistLong0", 5]\nrate = "VRel0"', r"lead.distance.signal.1: must be a valid string"),
        ('distance = "DistLong{0..199}"\nrate = ["A{0..199}", "B{0..199}"]', "400 tracks; at most 256"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, lead: str, says: str) -> None:
    (tmp_path / "car.dbc").write_text(HEAD + LAYOUTS["pages"][0])
    (tmp_path / "car.toml").write_text(
        'dbc = ["car.dbc"]\n[signals]\npedal = "Engine.Pedal"\nspeed = "Brake.Speed"\n'
        f'[lead]\ntracks = "Radar"\n{lead}\n'
    )
    with pytest.raises(ConfigError, match=says):
        canid.read_vehicle(tmp_path / "car.toml")


@pytest.mark.parametrize("layout", ["names", "several"])
def test_as_many_names_as_tracks(tmp_path: Path, layout: str) -> None:
    """A name too few is said; one that a message lacks too."""
    (tmp_path / "car.dbc").write_text(HEAD + LAYOUTS[layout][0])
    wrong = {
        "names": (
            ('"SpeedRel", "VRel"]', '"SpeedRel"]'),
            "tracks numbers 4 and rate numbers 3: as many in each",
        ),
        "several": (
            ("VRel{1..2}", "VRel{1..3}"),
            "tracks numbers 3 and distance numbers 2 and rate numbers 3",
        ),
    }
    (old, new), says = wrong[layout]
    (tmp_path / "car.toml").write_text(
        'dbc = ["car.dbc"]\n[signals]\npedal = "Engine.Pedal"\nspeed = "Brake.Speed"\n'
        f"[lead]\n{LAYOUTS[layout][1].replace(old, new)}\n"
    )
    with pytest.raises(ConfigError, match=says):
        canid.read_vehicle(tmp_path / "car.toml")


@pytest.mark.parametrize("file", files("reports/52-tracks/*.dbc"), ids=lambda file: file.stem)
def test_reported_radars(file: Path, tmp_path: Path) -> None:
    """Without a log, by names and units alone: the proposal can be read, and has every track."""
    made = proposal(file, tmp_path)
    (tmp_path / "car.toml").write_text(made.text)
    tracks = canid.read_vehicle(tmp_path / "car.toml").lead.tracks
    assert tracks is not None
    rates = [track.rate.signal for track in tracks]
    assert (
        rates
        == {
            "mazda": ["RVEL_OBJ", "RELV_OBJ", "RVEL_OBJ"],
            "hkg": ["1_REL_SPEED", "2_REL_SPEED"] * 3,
        }[file.stem]
    )


@pytest.mark.parametrize(("first", "count", "style"), [(0x210, 16, "x"), (0x3A5, 32, "X"), (0x1FC, 12, "x")])
def test_hexadecimal_numbers(tmp_path: Path, first: int, count: int, style: str) -> None:
    """All messages are proposed, not those alone whose number has no letter; and in their order."""
    names = [f"RADAR_TRACK_{first + k:{style}}" for k in range(count)]
    messages = [
        f"BO_ {1024 + k} {name}: 16 X\n{signals('1')}{signals('2', at=64)}" for k, name in enumerate(names)
    ]
    (tmp_path / "car.dbc").write_text(HEAD + "".join(messages))
    (tmp_path / "car.toml").write_text(proposal(tmp_path / "car.dbc", tmp_path).text)
    tracks = canid.read_vehicle(tmp_path / "car.toml").lead.tracks
    assert tracks is not None
    assert [track.message for track in tracks] == [name for name in names for _ in range(2)]
    ends = f"{{0{style}{first:{style}}..0{style}{first + count - 1:{style}}}}"
    assert f'tracks = "RADAR_TRACK_{ends}"' in (tmp_path / "car.toml").read_text()
