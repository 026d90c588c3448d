"""A radar without a flag and the car behind it, as frames."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.types import Array, Frame

T = 0.05 * np.arange(6000)
# of a whole drive
ROWS = 2400
SPEED = np.round(22.0 + 2.0 * np.sin(T / 9.0), 2)
DBC = """VERSION ""
BU_: X
BO_ 256 CAR: 8 X
 SG_ Pedal : 0|16@1+ (0.01,0) [0|100] "%" X
 SG_ Speed : 16|16@1+ (0.01,0) [0|400] "km/h" X
BO_ 416 RADAR: 8 X
 SG_ Distance : 0|11@1+ (0.1,0) [0|204.7] "m" X
 SG_ Rate : 16|9@1+ (0.1,-16.4) [-16.4|34.7] "m/s" X
"""
TOML = """name = "radar"
dbc = ["radar.dbc"]
[signals]
pedal = "CAR.Pedal"
speed = "CAR.Speed"
gap = "RADAR.Distance"
range_rate = "RADAR.Rate"
"""


def vehicle(folder: Path) -> Vehicle:
    """The vehicle, of files in a folder."""
    (folder / "radar.dbc").write_text(DBC, encoding="utf-8")
    (folder / "radar.toml").write_text(TOML, encoding="utf-8")
    return read_vehicle(folder / "radar.toml")


def motion(seed: int, sd: float = 3.0) -> tuple[Array, Array]:
    """A gap in m that its range rate in m/s moves."""
    rng = np.random.default_rng(seed)
    rate = np.convolve(rng.normal(0.0, sd, len(T) + 199), np.hanning(200) / 100.0, "valid")
    gap = 40.0 + 0.05 * np.cumsum(rate)
    return np.maximum(gap - gap.mean() + 40.0, 5.0), rate


def frames(
    none: Array, raw: tuple[int, int] | None, seed: int, limit: float = math.inf, sd: float = 3.0
) -> list[Frame]:
    """A drive; without a target these raw numbers, or no message; the range rate within a limit in m/s."""
    gap, rate = motion(seed, sd)
    sent = np.clip(rate, -limit, limit)
    out = []
    for k, t in enumerate(T[:ROWS].tolist()):
        pedal = round(2500 + 300 * rate[k])
        car = pedal.to_bytes(2, "little") + round(360 * SPEED[k]).to_bytes(2, "little") + bytes(4)
        out.append(Frame(t, 0, 0x100, car))
        numbers = (round(10 * gap[k]), round(10 * sent[k]) + 164) if not none[k] else raw
        if numbers is not None:
            data = (numbers[0] | numbers[1] << 16).to_bytes(8, "little")
            out.append(Frame(t + 0.001, 0, 0x1A0, data))
    return out
