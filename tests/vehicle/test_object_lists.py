"""A radar's objects as numbered messages, as a list with ids, on pages of one message, or side by side: one lead."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.analysis.proposal import proposal
from canid.io.logs import open_log
from canid.values.errors import ConfigError

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


def frames(layout: str, k: int, t: float, report: tuple[float, float, float], number: int) -> str:
    distance, rate, side = report
    data = round(distance * 100).to_bytes(2, "little") + round(rate * 100).to_bytes(2, "little", signed=True)
    data += round(side * 10).to_bytes(1, "little", signed=True)
    data += bytes([{"numbered": 0, "list": number, "pages": k}[layout], 0, 0])
    id_ = 1024 + (k if layout == "numbered" else 0)
    return f"({1.75e9 + t:.6f}) can0 {id_:X}#{data.hex().upper()}\n"


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
        for k, (report, number) in enumerate(zip(reports, numbers, strict=True)):
            # an object leaves the list and comes back
            if k != 2 or not 100 < n < 200:
                lines.append(frames(layout, k, t + 0.001 * (k + 1), report, number))
    (folder / "drive.log").write_text("".join(lines))
    return canid.read_trace(folder / "drive.log", folder / "car.toml")


@pytest.mark.parametrize("layout", ["list", "pages"])
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
