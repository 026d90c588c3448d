"""Units that a DBC leaves out: a pedal of raw numbers beyond its stated range, and two speeds of one car."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.proposal import proposal
from canid.io.logs import open_log

DBC = """VERSION ""
NS_ :
BS_:
BU_: X
BO_ 256 EngineData: 8 X
 SG_ AccelPedal : 0|10@1+ (1,0) [0|{stated}] "" X
BO_ 257 Wheel: 8 X
 SG_ Speed : 0|16@1+ (0.01,0) [0|0] "" X
BO_ 258 Gateway: 8 X
 SG_ VehicleSpeed : 0|16@1+ (0.01,0) [0|655] "{unit}" X
"""


@pytest.mark.parametrize(("unit", "factor"), [("km/h", 3.6), ("mph", 2.23694), ("m/s", 1.0)])
@pytest.mark.parametrize("stated", [1, 15, 1023])
def test_a_log_gives_what_the_database_leaves_out(
    tmp_path: Path, unit: str, factor: float, stated: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    (tmp_path / "car.dbc").write_text(DBC.format(stated=stated, unit=unit))
    t = np.arange(0.0, 60.0, 0.05)
    pedal = 30.0 + 15.0 * np.sin(t / 3.0) + rng.normal(0, 0.3, len(t))
    speed = 20.0 + np.cumsum(0.03 * (pedal - 30.0)) * 0.05
    lines = []
    for k in range(len(t)):
        words = {
            "100": round(float(pedal[k]) * 10.0),
            "101": round(float(speed[k]) * 360.0),
            "102": round(float(speed[k]) * factor * 100.0),
        }
        lines += [
            f"({1.75e9 + t[k]:.6f}) can0 {id_}#{raw.to_bytes(8, 'little').hex().upper()}\n"
            for id_, raw in words.items()
        ]
    (tmp_path / "drive.log").write_text("".join(lines))
    made = proposal(tmp_path / "car.dbc", tmp_path, open_log(tmp_path / "drive.log"))
    text = tomllib.loads(made.text)["signals"]
    # 1,000 raw numbers are full travel: the bits hold 1,023, and no reading is left out
    assert text["pedal"]["scale"] == pytest.approx(100.0 / 1023.0, rel=1e-3)
    assert text["pedal"]["valid" if stated < 1023 else "unit"] == ([0, 100] if stated < 1023 else "%")
    speeds = text["speed"]
    if isinstance(speeds, dict):
        assert speeds == {"signal": "Wheel.Speed", "unit": "km/h"}
    else:
        assert speeds == "Gateway.VehicleSpeed"
