"""A car that sends no own speed and no range rate: `init` makes them of the wheels, of the lead's speed or of the gap."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from canid.analysis.proposal import proposal
from canid.io.logs import open_log
from canid.models.simulation import bus_frames, simulate
from canid.signals.vehicle import read_vehicle

HEAD = """VERSION ""
BU_: X
BO_ 256 ENGINE_DATA: 2 X
 SG_ AccelPedalPos : 0|16@1+ (0.01,0) [0|100] "%" X
BO_ 257 WHEEL_SPEEDS: 8 X
 SG_ WHL_SpdFLVal : 0|16@1+ (0.01,0) [0|655] "km/h" X
 SG_ WHL_SpdFRVal : 16|16@1+ (0.01,0) [0|655] "km/h" X
 SG_ WHL_SpdRLVal : 32|16@1+ (0.01,0) [0|655] "km/h" X
 SG_ WHL_SpdRRVal : 48|16@1+ (0.01,0) [0|655] "km/h" X
BO_ 259 RADAR_OBJECT: 8 X
 SG_ ObjDistance : 0|16@1+ (0.01,0) [0|300] "m" X
"""
LEAD_SPEED = ' SG_ LeadVehSpeed : 16|16@1+ (0.01,0) [0|655] "km/h" X\n'
WHEELS = '{ mean_of = ["WHEEL_SPEEDS.WHL_SpdFLVal", "WHEEL_SPEEDS.WHL_SpdFRVal", '
WHEELS += '"WHEEL_SPEEDS.WHL_SpdRLVal", "WHEEL_SPEEDS.WHL_SpdRRVal"] }'
RATES = {
    "the lead's speed": (HEAD + LEAD_SPEED, '{ lead_speed = "RADAR_OBJECT.LeadVehSpeed" }'),
    "the gap": (HEAD, '{ derivative_of = "gap" }'),
}


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("of", RATES)
def test_what_is_not_sent_is_made_of_what_is(tmp_path: Path, of: str, seed: int) -> None:
    """The proposed file has both forms, needs no edit, and `check` says what they are."""
    dbc, rate = RATES[of]
    (tmp_path / "car.dbc").write_text(dbc)
    (tmp_path / "true.toml").write_text(
        f'dbc = ["car.dbc"]\n[signals]\npedal = "ENGINE_DATA.AccelPedalPos"\nspeed = {WHEELS}\n'
        f'gap = "RADAR_OBJECT.ObjDistance"\nrange_rate = {rate}\n'
    )
    frames = bus_frames.frames(simulate(minutes=2.0, seed=seed), read_vehicle(tmp_path / "true.toml"))
    lines = (f"({frame.t:.6f}) can0 {frame.id:03X}#{frame.data.hex().upper()}" for frame in frames)
    (tmp_path / "drive.log").write_text("\n".join(lines) + "\n")

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "canid", *words]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    assert run("init", "car.dbc", "--log", "drive.log", "--yes", "-o", "car.toml").returncode == 0
    signals = tomllib.loads((tmp_path / "car.toml").read_text())["signals"]
    assert signals["speed"] == tomllib.loads(f"x = {WHEELS}")["x"]
    assert signals["range_rate"] == tomllib.loads(f"x = {rate}")["x"]
    checked = run("check", "--vehicle", "car.toml", "drive.log")
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert "mean of 4 signals" in checked.stderr
    assert ("derivative of the gap" in checked.stderr) == ("derivative_of" in rate)


@pytest.mark.slow("a drive, encoded and read")
def test_what_contradicts_the_log_is_no_role(tmp_path: Path, seed: int) -> None:
    """A flag of the lead that is never true while the gap moves, an acceleration that stands still: not written."""
    (tmp_path / "car.dbc").write_text(
        HEAD
        + ' SG_ ObjRelSpeed : 16|16@1- (0.01,0) [-100|100] "m/s" X\n SG_ ObjValid : 40|1@1+ (1,0) [0|1] "" X\n'
        + 'BO_ 260 ESP: 4 X\n SG_ LONG_ACCEL : 0|11@1- (0.01,2.5) [-10|10] "m/s^2" X\n'
        + ' SG_ VehicleSpeed : 16|16@1+ (0.01,0) [0|655] "km/h" X\n'
    )
    (tmp_path / "true.toml").write_text(
        'dbc = ["car.dbc"]\n[signals]\npedal = "ENGINE_DATA.AccelPedalPos"\nspeed = "ESP.VehicleSpeed"\n'
        'gap = "RADAR_OBJECT.ObjDistance"\nrange_rate = "RADAR_OBJECT.ObjRelSpeed"\n'
    )
    frames = bus_frames.frames(simulate(minutes=1.0, seed=seed), read_vehicle(tmp_path / "true.toml"))
    lines = (f"({frame.t:.6f}) can0 {frame.id:03X}#{frame.data.hex().upper()}" for frame in frames)
    (tmp_path / "drive.log").write_text("\n".join(lines) + "\n")
    made = proposal(tmp_path / "car.dbc", log=open_log(tmp_path / "drive.log"))
    signals = tomllib.loads(made.text)["signals"]
    assert {"gap", "range_rate", "speed", "pedal"} <= signals.keys()
    assert not {"lead_valid", "accel"} & signals.keys()


@pytest.mark.long("verbs on whole logs")
def test_init_says_what_it_found_a_line_a_role(tmp_path: Path) -> None:
    """On the terminal: how sure, the signal and its range; of what is open, what decides it."""
    (tmp_path / "car.dbc").write_text(HEAD)
    command = [sys.executable, "-m", "canid", "init", "car.dbc", "-o", "car.toml"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False).stderr
    lines = {line.split()[1]: line for line in said.splitlines() if line.startswith("canid: ")}
    assert "sure   ENGINE_DATA.AccelPedalPos" in lines["pedal"]
    assert "made   { mean_of = [" in lines["speed"]
    assert 'made   { derivative_of = "gap" }' in lines["range_rate"]
    (tmp_path / "car.dbc").write_text(HEAD.replace("ObjDistance", "Something"))
    command.append("--force")
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False).stderr
    assert "open   nothing of that kind was found: name its signal, or one more DBC file" in said
