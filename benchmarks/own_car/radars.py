"""Radars on a bus of their own, in layouts that are public: their DBC text, and their tracks of a drive."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import cantools
import numpy as np

from benchmarks.own_car.drive import STEP_S, Array, Drive
from benchmarks.own_car.frames import Stream, pack

# s, of the reports
PERIOD_S = 0.05


class Seen(NamedTuple):
    """One object that the radar sees, at its reports; NaN: it does not."""

    along: Array  # m
    rate: Array  # m/s
    side: Array  # m, left positive
    new: Array  # 1 at its first reports


class Radar(NamedTuple):
    """A family."""

    dbc: str
    messages: tuple[str, ...]
    values: Callable[[Seen], dict[str, Array]]  # of an object, with 0 where it is not seen
    idle: dict[str, float]  # of a track without object


def objects(drive: Drive, t: Array, rng: np.random.Generator) -> list[Seen]:
    """The vehicle ahead (another object after each cut-in), one in the next lane, oncoming traffic, a sign."""
    at = np.clip(((t - drive.latency) / STEP_S).astype(int), 0, len(drive.t) - 1)
    gap, rate, speed, number = drive.gap[at], drive.range_rate[at], drive.speed[at], drive.lead[at]
    n, nothing = len(t), np.full(len(t), np.nan)
    out = []
    for lead in range(int(number.max()) + 1):
        mine = number == lead
        first = np.zeros(n)
        first[np.flatnonzero(mine)[:3]] = 1.0
        side = 0.3 * np.sin(t / 5.0 + lead)
        out.append(_noisy(Seen(np.where(mine, gap, nothing), rate, side, first), rng))
    out.append(_noisy(Seen(0.6 * gap + 3.0, rate + 0.3 * np.cos(t / 6.0), 3.5 + 0.0 * t, 0.0 * t), rng))
    closing = speed + 20.0
    where = 150.0 - (np.cumsum(closing) * PERIOD_S) % 400.0
    out.append(_noisy(Seen(np.where(where > 5.0, where, nothing), -closing, -3.6 + 0.0 * t, 0.0 * t), rng))
    sign = 120.0 - (np.cumsum(speed) * PERIOD_S) % 300.0
    out.append(_noisy(Seen(np.where(sign > 5.0, sign, nothing), -speed, -6.0 + 0.0 * t, 0.0 * t), rng))
    return out


def _noisy(seen: Seen, rng: np.random.Generator) -> Seen:
    n = len(seen.along)
    return seen._replace(
        along=seen.along + rng.normal(0, 0.15, n),
        rate=seen.rate + rng.normal(0, 0.08, n),
        side=seen.side + rng.normal(0, 0.1, n),
    )


def streams(radar: Radar, drive: Drive, bus: int, seed: int) -> list[Stream]:
    """The radar's frames: every track in each report, objects among them."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.02, drive.t[-1], PERIOD_S)
    database = cantools.database.load_string(radar.dbc, "dbc", strict=False)
    seen = objects(drive, t, rng)
    # a radar of few tracks leaves out what is no vehicle ahead
    order = rng.permutation(len(radar.messages)).tolist()
    by_track = dict(zip(order, seen, strict=False))
    out = []
    for track, name in enumerate(radar.messages):
        message = database.get_message_by_name(name)
        nothing = {key: np.full(len(t), value) for key, value in radar.idle.items()}
        columns = nothing
        if track in by_track:
            one = by_track[track]
            there = np.isfinite(one.along)
            columns = {
                key: np.where(there, value, nothing.get(key, 0.0))
                for key, value in radar.values(Seen(*(np.nan_to_num(x) for x in one))).items()
            }
        data = pack(message.signals, columns, message.length, len(t))
        out.append(Stream(bus, message.frame_id, False, t + 1e-4 * (track + 1), data))
    return out


def _dbc(names: tuple[str, ...], first: int, signals: str, tables: str = "") -> str:
    lines = ['VERSION ""', "NS_ :", "BS_:", "BU_: RADAR"]
    for k, name in enumerate(names):
        lines += [f"BO_ {first + k} {name}: 8 RADAR", *signals.strip().splitlines()]
    lines += [
        table.replace("ID", str(first + k))
        for k in range(len(names))
        for table in tables.strip().splitlines()
    ]
    return "\n".join(lines) + "\n"


def _esr() -> Radar:
    names = tuple(f"ESR_Track{k:02d}" for k in range(1, 65))
    signals = """
 SG_ CAN_TX_TRACK_ONCOMING : 0|1@0+ (1,0) [0|1] "" X
 SG_ CAN_TX_TRACK_STATUS : 15|3@0+ (1,0) [0|7] "" X
 SG_ CAN_TX_TRACK_ANGLE : 12|10@0- (0.1,0) [-51.2|51.1] "deg" X
 SG_ CAN_TX_TRACK_RANGE : 18|11@0+ (0.1,0) [0|204.7] "m" X
 SG_ CAN_TX_TRACK_WIDTH : 37|4@0+ (0.5,0) [0|7.5] "m" X
 SG_ CAN_TX_TRACK_ROLLING_COUNT : 38|1@0+ (1,0) [0|1] "" X
 SG_ CAN_TX_TRACK_RANGE_ACCEL : 33|10@0- (0.05,0) [-25.6|25.55] "m/s/s" X
 SG_ CAN_TX_TRACK_RANGE_RATE : 53|14@0- (0.01,0) [-81.92|81.91] "m/s" X
"""
    states = ("No", "New", "New_Updated", "Updated", "Coasted", "Invalid", "Merged", "Invalid_Coasted")
    texts = " ".join(f'{k} "{state}_Target"' for k, state in enumerate(states))
    table = f"VAL_ ID CAN_TX_TRACK_STATUS {texts} ;"

    def values(seen: Seen) -> dict[str, Array]:
        return {
            "CAN_TX_TRACK_RANGE": np.hypot(seen.along, seen.side),
            "CAN_TX_TRACK_ANGLE": -np.degrees(np.arctan2(seen.side, np.maximum(seen.along, 1.0))),
            "CAN_TX_TRACK_RANGE_RATE": seen.rate,
            "CAN_TX_TRACK_WIDTH": 2.0 + 0.0 * seen.along,
            "CAN_TX_TRACK_STATUS": np.where(seen.new > 0, 1.0, 3.0),
        }

    return Radar(_dbc(names, 0x500, signals, table), names, values, {})


def _mazda() -> Radar:
    names = tuple(f"RADAR_TRACK_{k}" for k in range(361, 367))
    signals = """
 SG_ DIST_OBJ : 7|12@0+ (1,0) [0|4095] "" X
 SG_ ANG_OBJ : 11|12@0- (1,0) [-2048|2047] "" X
 SG_ RELV_OBJ : 31|12@0- (1,0) [-2048|2047] "" X
 SG_ CTR : 59|4@0+ (1,0) [0|15] "" X
"""

    def values(seen: Seen) -> dict[str, Array]:
        return {
            "DIST_OBJ": 16 * np.hypot(seen.along, seen.side),
            "ANG_OBJ": 64 * np.degrees(np.arctan2(seen.side, np.maximum(seen.along, 1.0))),
            "RELV_OBJ": 16 * seen.rate,
        }

    return Radar(
        _dbc(names, 0x361, signals), names, values, {"DIST_OBJ": 4095.0, "ANG_OBJ": 2046.0, "RELV_OBJ": -16.0}
    )


def _cartesian(
    names: tuple[str, ...], first: int, signals: str, keys: dict[str, str], idle: dict[str, float]
) -> Radar:
    def values(seen: Seen) -> dict[str, Array]:
        made = {
            "along": seen.along,
            "rate": seen.rate,
            "side": seen.side,
            "valid": 1.0 + 0.0 * seen.along,
            "new": seen.new,
        }
        return {keys[name]: column for name, column in made.items() if name in keys}

    return Radar(_dbc(names, first, signals), names, values, idle)


def _toyota() -> Radar:
    signals = """
 SG_ COUNTER : 7|8@0+ (1,0) [0|255] "" X
 SG_ LONG_DIST : 15|13@0+ (0.04,0) [0|300] "m" X
 SG_ NEW_TRACK : 36|1@0+ (1,0) [0|1] "" X
 SG_ LAT_DIST : 31|11@0- (0.04,0) [-50|50] "m" X
 SG_ REL_SPEED : 47|12@0- (0.025,0) [-100|100] "m/s" X
 SG_ VALID : 48|1@0+ (1,0) [0|1] "" X
"""
    keys = {
        "along": "LONG_DIST",
        "rate": "REL_SPEED",
        "side": "LAT_DIST",
        "valid": "VALID",
        "new": "NEW_TRACK",
    }
    names = tuple(f"TRACK_A_{k}" for k in range(16))
    return _cartesian(names, 528, signals, keys, {"LONG_DIST": 320.0})


def _acura() -> Radar:
    signals = """
 SG_ LONG_DIST : 7|12@0+ (0.0625,0) [0|255.5] "m" X
 SG_ NEW_TRACK : 8|1@0+ (1,0) [0|1] "" X
 SG_ LAT_DIST : 21|10@0- (0.0625,0) [0|63.5] "m" X
 SG_ REL_SPEED : 43|12@0- (0.03125,0) [0|127.5] "m/s" X
"""
    keys = {"along": "LONG_DIST", "rate": "REL_SPEED", "side": "LAT_DIST", "new": "NEW_TRACK"}
    names = tuple(f"TRACK_{k}" for k in range(16))
    return _cartesian(names, 1072, signals, keys, {"LONG_DIST": 255.0})


def _bosch() -> Radar:
    signals = """
 SG_ Obj_dx : 0|12@1+ (0.0625,0) [0|255] "m" X
 SG_ Obj_dy : 12|12@1- (0.0625,0) [-128|127] "m" X
 SG_ Obj_vx : 24|12@1- (0.0625,0) [-128|127] "m/s" X
 SG_ Obj_measured : 36|1@1+ (1,0) [0|1] "" X
 SG_ Obj_type : 40|3@1+ (1,0) [0|7] "" X
 SG_ Obj_width : 43|5@1+ (0.2,0) [0|6] "m" X
"""
    keys = {"along": "Obj_dx", "rate": "Obj_vx", "side": "Obj_dy", "valid": "Obj_measured"}
    names = tuple(f"MRR_Object_{k:02d}" for k in range(1, 13))
    return _cartesian(names, 0x400, signals, keys, {})


FAMILIES: dict[str, Callable[[], Radar]] = {
    "Delphi ESR": _esr,
    "Mazda": _mazda,
    "Toyota": _toyota,
    "Acura": _acura,
    "Bosch": _bosch,
}
