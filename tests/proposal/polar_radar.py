"""A simulated drive seen by a radar that reports along the beam, in the layout of Delphi's ESR (numbered track messages).

Track 3 is the vehicle ahead; track 5 drives in the next lane, nearer; track 8 comes towards; track 9 stands at the roadside.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import canid
from canid.models.simulation.following import Simulation

STEP = 5  # rows of the simulation (0.01 s) for each frame
TRACKS = 12
LANE_M = 3.6


def _dbc(angle: bool, pedal: str) -> str:
    lines = ['VERSION ""', "NS_ :", "BS_:", "BU_: X"]
    for k in range(1, TRACKS + 1):
        lines += [
            f"BO_ {0x500 + k} ESR_Track{k:02d}: 8 X",
            ' SG_ TX_TRACK_RANGE : 0|16@1+ (0.01,0) [0|655] "m" X',
            ' SG_ TX_TRACK_RANGE_RATE : 16|16@1- (0.01,0) [-327|327] "m/s" X',
        ]
        if angle:
            lines.append(' SG_ TX_TRACK_ANGLE : 32|16@1- (0.01,0) [-90|90] "deg" X')
        lines.append(' SG_ TX_TRACK_WIDTH : 48|8@1+ (0.5,0) [0|7.5] "m" X')
    return "\n".join(
        [
            *lines,
            "BO_ 256 EngineData: 8 X",
            f" SG_ AccelPedalPos : 0|16@1+ {pedal} X",
            "BO_ 257 BrakeData: 8 X",
            ' SG_ VehicleSpeed : 0|16@1+ (0.01,0) [0|655] "km/h" X',
            "",
        ]
    )


def write(
    folder: Path, seed: int, *, angle: bool = True, pedal: str = '(0.01,0) [0|100] "%"', full: float = 1.0
) -> Simulation:
    """Write car.dbc and drive.log; returns the drive.

    Args:
        folder: where to.
        seed: of the drive.
        angle: the radar reports a side.
        pedal: factor, range and unit of the pedal in the DBC.
        full: by what the raw value of the pedal exceeds 100 for each %.
    """
    drive = canid.simulate(5.0, seed=seed)
    columns = {name: values[::STEP] for name, values in drive.columns.items()}
    t, gap, rate, speed = (columns[name] for name in ("t", "gap", "range_rate", "speed"))
    scenes = {
        3: (gap, rate, 0.2 + 0.0 * t),
        5: (0.5 * gap, rate, LANE_M + 0.0 * t),
        8: (150.0 - (2.0 * speed.mean() * t) % 140.0, -speed - speed.mean(), -LANE_M + 0.0 * t),
        9: (80.0 - np.cumsum(speed * np.gradient(t)) % 75.0, -speed, 5.0 + 0.0 * t),
    }
    if not angle:  # without a side the lead cannot be separated from what drives in the next lane
        del scenes[5]
    rows: list[tuple[float, int, bytes]] = []
    for k, (along, closing, side) in scenes.items():
        lead = np.isfinite(along)
        beam = np.where(lead, np.hypot(along, side), 0.0)
        bearing = np.degrees(np.arctan2(side, np.where(lead, along, 1.0)))
        data = np.zeros((len(t), 4), "<i2")
        data[:, 0] = np.round(beam * 100)
        data[:, 1] = np.round(np.where(lead, closing, 0.0) * 100)
        if angle:
            data[:, 2] = np.round(bearing * 100)
        rows += [
            (at, 0x500 + k, row.tobytes()) for at, row, there in zip(t, data, lead, strict=True) if there
        ]
    for identifier, value in ((0x100, columns["pedal"] * 100 * full), (0x101, speed * 360)):
        raw = np.zeros((len(t), 4), "<u2")
        raw[:, 0] = np.round(value)
        rows += [(at, identifier, row.tobytes()) for at, row in zip(t, raw, strict=True)]
    rows.sort(key=lambda row: row[0])
    lines = [f"({1_700_000_000 + at:.6f}) can0 {id_:03X}#{data.hex().upper()}" for at, id_, data in rows]
    (folder / "drive.log").write_text("\n".join(lines) + "\n")
    (folder / "car.dbc").write_text(_dbc(angle, pedal))
    return drive
