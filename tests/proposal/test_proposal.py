"""`canid init`: the right signals by name and by log, no decoy, nothing confidently wrong."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.proposal import proposal
from canid.analysis.proposal.name_score import name_points
from canid.analysis.proposal.signal_words import words
from canid.io.logs import open_log
from canid.signals.vehicle import read_vehicle
from tests.proposal.renamed_car import DECOYS, MAKERS, write

ROOT = Path(__file__).parents[2]

# names of makers and standards that no rule was written for one by one
NAMES = {
    "pedal": ["AccelPedalPos1", "APedPos", "accelerator_pedal_position", "PdlAccrPosn", "AcclPdlPos",
         "Gaspedalstellung", "POSITION_PEDALE_ACC"],
    "speed": ["WheelBasedVehicleSpeed", "vehicle_speed", "EgoVelocity", "VehSpdLgt", "Fahrzeuggeschwindigkeit",
         "VITESSE_VEHICULE", "CAR_SPD"],
    "gap": ["DistanceToForwardVehicle", "LeadVehDist", "TargetDistance", "ObjLongDist", "Abstand_Objekt"],
    "range_rate": ["RelativeSpeed", "LeadRelVel", "TgtRangeRate", "ObjRelSpd", "Relativgeschwindigkeit"],
    "brake": ["BrakeSwitch", "BrakePedalPressed", "DriverBrakeApplied", "BrkPdlSts", "BRAKE_PEDAL_SW",
         "Bremslichtschalter"],
}  # fmt: skip
WRONG_NAMES = {
    "pedal": ["BrakePedalPos", "ClutchPedalPosition", "AccelPedalFault", "AccPedalPos_CRC", "KickDownSwitch",
         "PedalGradient", "VirtualAccelPedalPos"],
    "speed": ["SPEED_UP", "EngineSpeed", "WheelSpeedFL", "VehicleSpeedSetpoint", "VehicleSpeedDisplayed",
         "SpeedLimit", "VehSpdQf", "FanSpeed",
              "LeadVehicleSpeed", "YawSpeed", "WiperSpeed", "VehicleSpeedCounter", "GPS_Speed", "KBI_angez_Geschw"],
    "gap": ["RearObstacleDistance", "ParkDistance", "DistanceToEmpty", "LeadLateralDistance", "DistanceSetting",
         "TotalDistance", "LeadDistanceValid"],
    "range_rate": ["RelativeAcceleration", "LatRelVel", "SteeringRate", "RelSpdQuality", "RearObjRelSpd"],
    "brake": ["ParkingBrakeSwitch", "BrakePressure", "BrakeFluidLow", "AEB_BrakeRequest", "BrakeFault",
         "NOT_BRAKE_PRESSED", "AutoHoldBrakeActive"],
}  # fmt: skip


@pytest.mark.parametrize("role", NAMES)
def test_names_of_many_makers(role: str) -> None:
    """Names of each role score, and names of counters, buttons, displays, targets and other quantities do not."""
    assert [name for name in NAMES[role] if name_points(role, words(name))[0] < 3.0] == []
    assert [name for name in WRONG_NAMES[role] if name_points(role, words(name))[0] >= 3.0] == []


@pytest.mark.parametrize("maker", MAKERS)
def test_a_renamed_car_with_decoys(maker: str, tmp_path: Path, seed: int) -> None:
    """With a log every role of a renamed car is found, with unit and sign; no decoy is taken, with a log or without."""
    dbc, log = write(tmp_path, MAKERS[maker], seed)
    unseen = DECOYS - {"VehSpdAlt"}  # only a log shows that it reads 3 % more than the wheels
    for made, decoys in ((proposal(dbc, tmp_path), unseen), (proposal(dbc, tmp_path, open_log(log)), DECOYS)):
        taken = {
            role: of.chosen.candidate for role, of in made.decisions.roles.items() if of.chosen is not None
        }
        assert not {each.signal.name for each in taken.values()} & decoys
    assert {role: taken[role].where for role in MAKERS[maker].right} == MAKERS[maker].right
    if maker == "american":
        assert taken["speed"].unit == "km/h"
        assert taken["range_rate"].scale == -1.0
        file = tmp_path / "car.toml"
        file.write_text(made.text)
        vehicle = read_vehicle(file)
        assert vehicle.roles["pedal"].how.factor == pytest.approx(100 / 255, rel=1e-3)
        assert vehicle.roles["speed"].how.factor == pytest.approx(0.01 / 3.6)


def test_two_buses_with_the_same_ids(tmp_path: Path, seed: int) -> None:
    """Ids that are on two buses: the DBC is bound to the bus that carries it."""
    dbc, log = write(tmp_path, MAKERS["american"], seed)
    lines = log.read_text().splitlines()
    other = [line.replace("can0", "can1").split("#")[0] + "#0000" for line in lines if " 100#" in line]
    both = sorted(lines + other)
    log.write_text("\n".join(both) + "\n")
    (tmp_path / "swapped.log").write_text("\n".join(other[:1] + both) + "\n")
    for name in ("drive.log", "swapped.log"):
        reader = open_log(tmp_path / name)
        table = tomllib.loads(proposal(dbc, tmp_path, reader).text)
        (file,) = table["dbc"]
        right = next(f.bus for f in reader if f.id == 0x108)
        assert file == {"file": "car.dbc", "bus": right}


def test_a_constant_or_absent_signal_is_not_taken_for_a_moving_one(tmp_path: Path, seed: int) -> None:
    """Of two copies, the one that the log does not have, or that stands still, is not chosen."""
    dbc, log = write(tmp_path, MAKERS["american"], seed)
    text = dbc.read_text() + 'BO_ 80 HybridData: 8 X\n SG_ AccelPdlPos : 0|16@1+ (0.1,0) [0|100] "%" X\n'
    dbc.write_text(text)
    made = proposal(dbc, tmp_path, open_log(log)).decisions.roles["pedal"]
    assert made.chosen is not None
    assert made.chosen.candidate.where == "EngineData.AccelPdlPos"
    assert made.absent == ("HybridData.AccelPdlPos",)


def tracks_dbc(sign: int) -> tuple[str, list[str]]:
    """Six tracks that close in at 2 m/s, and a log of them."""
    lines = ['VERSION ""', "NS_ :", "BS_:", "BU_: X"]
    for number in range(6):
        lines += [
            f"BO_ {512 + number} TRACK_{number}: 8 X",
            ' SG_ LONG_DIST : 0|16@1+ (0.01,0) [0|300] "m" X',
            ' SG_ REL_SPEED : 16|16@1- (0.01,0) [-100|100] "m/s" X',
            ' SG_ LAT_DIST : 32|16@1- (0.01,0) [-50|50] "m" X',
        ]
    log = []
    for row in range(600):
        t = row * 0.05
        rate = 2.0 * np.sin(0.3 * t)
        for number in range(6):
            distance = 40 + 5 * number - 2.0 / 0.3 * (np.cos(0.3 * t) - 1)
            raw = [round(distance * 100), round(sign * rate * 100) & 0xFFFF, 0]
            data = b"".join(int(x).to_bytes(2, "little") for x in raw) + b"\0\0"
            log.append(f"({1e9 + t:.6f}) can0 {512 + number:03X}#{data.hex()}")
    return "\n".join(lines) + "\n", log


@pytest.mark.parametrize("sign", [1, -1])
def test_radar_tracks_and_their_sign(tmp_path: Path, sign: int) -> None:
    """Numbered messages become [lead], and a closing speed is recognised by the change of the distances."""
    dbc, log = tracks_dbc(sign)
    (tmp_path / "radar.dbc").write_text(dbc)
    (tmp_path / "drive.log").write_text("\n".join(log) + "\n")
    table = tomllib.loads(proposal(tmp_path / "radar.dbc", tmp_path, open_log(tmp_path / "drive.log")).text)
    assert table["lead"]["tracks"] == "TRACK_{0..5}"
    assert table["lead"]["rate"] == "REL_SPEED"
    assert table["lead"].get("rate_sign", 1) == sign


CLOSE = """VERSION ""
NS_ :
BS_:
BU_: X
BO_ 1 EngineData: 8 X
 SG_ AccelPos : 0|8@1+ (0.4,0) [0|100] "%" X
 SG_ PedalPos : 8|8@1+ (0.4,0) [0|100] "%" X
BO_ 2 BrakeData: 8 X
 SG_ VS : 0|16@1+ (0.01,0) [0|300] "km/h" X
 SG_ Vx : 16|16@1+ (0.01,0) [0|300] "km/h" X
"""


def answered(tmp_path: Path, answers: str, *words: str) -> tuple[str, str]:
    """`canid init` on a pseudo-terminal that types the answers; returns standard output and error."""
    (tmp_path / "close.dbc").write_text(CLOSE)
    parent, child = pty.openpty()
    error_parent, error_child = pty.openpty()
    environment = os.environ | {"PYTHONPATH": str(ROOT), "TERM": "dumb", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "canid", "init", "close.dbc", *words]
    running = subprocess.Popen(
        command, stdin=child, stdout=subprocess.PIPE, stderr=error_child, cwd=tmp_path, env=environment
    )
    os.close(child)
    os.close(error_child)
    os.write(parent, answers.encode())
    out = running.communicate(timeout=60)[0].decode()
    error = b""
    try:
        while part := os.read(error_parent, 65536):
            error += part
    except OSError:  # the other end is closed
        pass
    os.close(parent)
    os.close(error_parent)
    assert running.returncode == 0, error
    return out, error.decode()


@pytest.mark.slow("whole logs")
def test_a_close_role_is_asked_on_a_terminal(tmp_path: Path) -> None:
    """Enter takes the first of a list, a number that one, 0 none; anything else is asked again. --yes never asks."""
    out, error = answered(tmp_path, "\n\n")
    first = tomllib.loads(out)["signals"]
    assert "Which signal is it?" in error
    assert "PedalPos" in error
    assert {"pedal", "speed"} <= set(first)
    out, error = answered(tmp_path, "zebra\n2\n0\n")
    assert "is not a number" in error
    second = tomllib.loads(out)["signals"]
    assert second["speed"] != first["speed"]
    assert "pedal" not in second
    out, error = answered(tmp_path, "", "--yes")
    assert "Which signal" not in error


@pytest.mark.slow("whole logs")
def test_without_a_terminal_nothing_is_asked_and_json_says_why(tmp_path: Path) -> None:
    """Not on a terminal is as --yes; JSON lists state and candidates of each role; a file is never overwritten unasked."""
    (tmp_path / "close.dbc").write_text(CLOSE)
    command = [sys.executable, "-m", "canid", "init", "close.dbc", "-o", "car.toml", "--json", "-"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    runs = [
        subprocess.run(
            command,
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            check=False,
        )
        for _ in range(2)
    ]
    values = json.loads(runs[0].stdout)
    assert values["roles"]["gap"] == {"state": "open", "signal": None, "candidates": [], "not_in_log": []}
    assert {each["signal"] for each in values["roles"]["speed"]["candidates"]} == {
        "BrakeData.VS",
        "BrakeData.Vx",
    }
    assert any(line.startswith("gap is open") for line in values["missing"])
    assert runs[1].returncode == 5
    assert runs[1].stderr.count("\n") == 1


def test_hostile_names_stay_data(tmp_path: Path) -> None:
    """Names and units with quotes, markup and braces give a TOML that is read back."""
    text = CLOSE.replace('"%"', '"% [red]"').replace("close", "x")
    (tmp_path / 'a "{0..9}".dbc').write_text(text, encoding="utf-8")
    table = tomllib.loads(proposal(tmp_path / 'a "{0..9}".dbc', tmp_path).text)
    assert table["dbc"] == ['a "{0..9}".dbc']
