"""A car with a radar that reports along the beam: proposed, checked and identified without an edit."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import canid
from canid.analysis.proposal.track_groups import track_groups
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle import read_vehicle
from canid.signals.vehicle.database import Dbc
from tests.proposal import polar_radar
from tests.seeds import mostly


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "canid", *words], cwd=folder, capture_output=True, text=True, check=False
    )


def proposed(folder: Path) -> dict:
    done = run(folder, "init", "car.dbc", "--log", "drive.log", "--yes", "-o", "car.toml")
    assert done.returncode == 0, done.stderr
    return tomllib.loads((folder / "car.toml").read_text())


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("angle", [True, False])
@mostly(0.9)
def test_the_lead_is_found_among_tracks(tmp_path: Path, angle: bool, seed: int) -> None:
    """With range and angle, and with range alone: `check` passes, and the gain of range rate is the driver's."""
    truth = polar_radar.write(tmp_path, seed, angle=angle).truth["channels"]["range_rate"]["K"]
    lead = proposed(tmp_path)["lead"]
    assert lead["tracks"] == "ESR_Track{01..12}"
    assert lead.get("angle") == ("TX_TRACK_ANGLE" if angle else None)
    checked = run(tmp_path, "check", "--vehicle", "car.toml", "drive.log")
    assert checked.returncode == 0, checked.stdout
    found = canid.identify(
        canid.read_trace(tmp_path / "drive.log", tmp_path / "car.toml"), select_orders=False
    )
    gain = found.channels["range_rate"].K
    assert gain.low - 0.3 < truth < gain.high + 0.3, (gain, truth)


@pytest.mark.slow("whole commands, one after the other")
def test_a_pedal_beyond_full_travel_is_no_fit(tmp_path: Path, seed: int) -> None:
    """Raw counts that the DBC declares as %: an error of `check` with the scale, and no number of `identify`."""
    polar_radar.write(tmp_path, seed, full=6.1)
    proposed(tmp_path)
    checked = run(tmp_path, "check", "--vehicle", "car.toml", "drive.log")
    assert checked.returncode == 1
    assert "the pedal is pressed by up to" in checked.stdout
    assert "scale =" in checked.stdout
    identified = run(tmp_path, "identify", "--vehicle", "car.toml", "drive.log", "--check")
    assert identified.returncode != 0


@pytest.mark.slow("whole commands, one after the other")
def test_tracks_that_are_never_in_the_path_are_no_fit(tmp_path: Path, seed: int) -> None:
    """A distance that is mapped as the side: reports come, no lead is ever chosen, and `check` says so."""
    polar_radar.write(tmp_path, seed)
    proposed(tmp_path)
    text = (tmp_path / "car.toml").read_text()
    (tmp_path / "car.toml").write_text(text.replace('angle = "TX_TRACK_ANGLE"', 'lateral = "TX_TRACK_RANGE"'))
    checked = run(tmp_path, "check", "--vehicle", "car.toml", "drive.log")
    assert checked.returncode == 1
    assert "none became the vehicle ahead" in checked.stdout


@pytest.mark.slow("whole drives through the pipeline")
def test_a_stated_range_of_one_is_full_travel(tmp_path: Path, seed: int) -> None:
    """A pedal of 8 bits and 0.005 whose DBC states [0|1]: 1 is 100 %, not the largest raw number."""
    polar_radar.write(tmp_path, seed, pedal='(0.0001,0) [0|1] ""')
    pedal = proposed(tmp_path)["signals"]["pedal"]
    assert pedal["unit"] == "0..1"
    assert "scale" not in pedal


def test_a_status_is_read_by_its_value_table() -> None:
    """States with a target that is measured are valid; none, coasted and merged ones are not."""
    texts = [
        "No_Target",
        "New_Target",
        "New_Updated_Target",
        "Updated_Target",
        "Coasted_Target",
        "Invalid_Coasted_Target",
    ]
    signals = [
        Signal(name, start, 12, True, True, False, 0.1, 0.0, None, None, unit, choices, False, None, ())
        for start, (name, unit, choices) in enumerate(
            [
                ("TX_TRACK_RANGE", "m", {}),
                ("TX_TRACK_RANGE_RATE", "m/s", {}),
                ("TX_TRACK_ANGLE", "deg", {}),
            ]
        )
    ]
    status = signals[0]._replace(
        name="TX_TRACK_STATUS", length=3, scale=1.0, unit="", choices=dict(enumerate(texts))
    )
    messages = {
        f"ESR_Track{k:02d}": Message(f"ESR_Track{k:02d}", k, False, 8, 0.05, (*signals, status))
        for k in range(1, 9)
    }
    parts = track_groups([Dbc("radar.dbc", None, messages)])[0].parts
    assert parts["valid"].signal == "TX_TRACK_STATUS"
    assert parts["valid"].on == (1.0, 2.0, 3.0)


def numbered(name: str, k: int, signals: dict[str, str]) -> Message:
    """A track's message; `signals`: name, with a place for its number -> unit."""
    made = (
        Signal(one.format(k=k), 0, 12, True, True, False, 0.1, 0.0, None, None, unit, {}, False, None, ())
        for one, unit in signals.items()
    )
    return Message(name.format(k=k), 0x400 + k, False, 8, 0.05, tuple(made))


@pytest.mark.parametrize("form", ["FLRRTrk{k}%s", "FLRRTrk%s{k}", "FLRR{k:02d}%sTrk", "Trk%s"])
@pytest.mark.parametrize("name", ["LRR_Obj_Track_{k}", "LRRObject{k:02d}_FO"])
def test_tracks_whose_signals_are_numbered_too(tmp_path: Path, form: str, name: str) -> None:
    """As GM's, in message and signal: each signal is written with its numbers, and the vehicle file takes that."""
    parts = {form % "Range": "m", form % "RangeRate": "m/s", form % "Azimuth": "deg", form % "Width2": "m"}
    messages = {name.format(k=k): numbered(name, k, parts) for k in range(1, 13)}
    (group,) = track_groups([Dbc("radar.dbc", None, messages)])
    assert group.pattern == name.replace("{k:02d}", "{01..12}").replace("{k}", "{1..12}")
    shown = {part: of.signal for part, of in group.parts.items()}
    for part, word in (("distance", "Range"), ("rate", "RangeRate"), ("angle", "Azimuth")):
        expected = (form % word).replace("{k:02d}", "{01..12}").replace("{k}", "{1..12}")
        assert shown[part] == expected
        of_each = [names[part] for _, names in group.tracks]
        assert of_each == [(form % word).format(k=k) for k in range(1, 13)]
    # the vehicle file takes what is proposed
    rows = ['VERSION ""', "BS_:", "BU_: X", "BO_ 16 EGO: 8 X"]
    rows += [' SG_ Pedal : 0|8@1+ (0.4,0) [0|100] "%" X', ' SG_ Speed : 8|16@1+ (0.01,0) [0|100] "m/s" X']
    for message in messages.values():
        rows.append(f"BO_ {message.id} {message.name}: 8 X")
        for at, signal in enumerate(message.signals):
            rows.append(f' SG_ {signal.name} : {12 * at}|12@1- (0.1,0) [0|0] "{signal.unit}" X')
    (tmp_path / "car.dbc").write_text("\n".join([*rows, ""]))
    (tmp_path / "car.toml").write_text(
        'name = "car"\ndbc = ["car.dbc"]\n[signals]\npedal = "EGO.Pedal"\nspeed = "EGO.Speed"\n[lead]\n'
        f'tracks = "{group.pattern}"\n'
        + "".join(f'{part} = "{name}"\n' for part, name in shown.items())
        + '[driver]\ntask = "car_following"\noutput = "pedal"\n'
    )
    tracks = read_vehicle(str(tmp_path / "car.toml")).lead.tracks
    assert tracks is not None
    assert [track.distance.signal for track in tracks] == [names["distance"] for _, names in group.tracks]
