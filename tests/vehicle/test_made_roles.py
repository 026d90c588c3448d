"""Roles that are made of others: speed of the wheels, gap of headway and speed, range rate of the lead or the gap."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.analysis.drive.vehicle_check import check
from canid.models.simulation import bus_frames, simulate
from canid.models.simulation.following import Simulation
from canid.signals.vehicle import Vehicle, missing, read_vehicle
from canid.values.errors import ConfigError
from canid.values.frame_columns import columns_of
from canid.values.types import Frame, Reading
from tests.seeds import mostly

DBC = """VERSION ""
BU_: X
BO_ 256 ENGINE: 2 X
 SG_ Pedal : 0|16@1+ (0.01,0) [0|100] "%" X
BO_ 257 WHEELS: 8 X
 SG_ FL : 0|16@1+ (0.01,0) [0|655] "km/h" X
 SG_ FR : 16|16@1+ (0.01,0) [0|655] "km/h" X
 SG_ RL : 32|16@1+ (0.01,0) [0|655] "km/h" X
 SG_ RR : 48|16@1+ (0.01,0) [0|655] "km/h" X
BO_ 258 REAR: 4 X
 SG_ L : 0|16@1+ (0.01,0) [0|655] "km/h" X
 SG_ R : 16|16@1+ (0.01,0) [0|655] "km/h" X
BO_ 259 RADAR: 8 X
 SG_ Dist : 0|16@1+ (0.01,0) [0|300] "m" X
 SG_ Headway : 16|16@1+ (0.01,0) [0|20] "s" X
 SG_ LeadSpeed : 32|16@1+ (0.01,0) [0|655] "km/h" X
 SG_ Rate : 48|16@1- (0.01,0) [-100|100] "m/s" X
"""
PLAIN = {
    "pedal": '"ENGINE.Pedal"',
    "speed": '"WHEELS.FL"',
    "gap": '"RADAR.Dist"',
    "range_rate": '"RADAR.Rate"',
}


def car(folder: Path, **changed: str) -> Vehicle:
    (folder / "car.dbc").write_text(DBC)
    lines = [f"{role} = {entry}" for role, entry in (PLAIN | changed).items()]
    (folder / "car.toml").write_text('dbc = ["car.dbc"]\n[signals]\n' + "\n".join(lines) + "\n")
    return read_vehicle(folder / "car.toml")


def wheels(t: float, *kmh: float, id_: int = 257) -> Frame:
    return Frame(t, 0, id_, struct.pack(f"<{len(kmh)}H", *(round(100 * x) for x in kmh)))


def values(out, role: str) -> list[float]:
    return [item.value for item in out if isinstance(item, Reading) and item.role == role]


FOUR = '{ mean_of = ["WHEELS.FL", "WHEELS.FR", "WHEELS.RL", "WHEELS.RR"] }'


def test_a_speed_is_the_mean_of_the_wheels_that_agree(tmp_path, decode_all) -> None:
    """A wheel that stands out is left out and counted; two that disagree are no speed."""
    vehicle = car(tmp_path, speed=FOUR)
    frames = [
        wheels(0.0, 72.0, 72.4, 71.6, 72.0),
        wheels(0.1, 72.0, 0.0, 72.36, 72.0),
        wheels(0.2, 0, 0, 72, 72),
    ]
    state, out = decode_all(vehicle, frames)
    assert values(out, "speed") == pytest.approx([20.0, 72.12 / 3.6, np.nan], nan_ok=True)
    assert state.counters["speed: WHEELS.FR left out, it differs from the others"] == 2
    assert not any("speed" in line for line in missing(vehicle, state))


def test_wheels_of_several_messages_are_joined_by_their_latest_values(tmp_path, decode_all) -> None:
    """Of the second message the latest counts, until it is too old; a message that never came is named."""
    vehicle = car(tmp_path, speed='{ mean_of = ["WHEELS.FL", "WHEELS.FR", "REAR.L"], stale = 0.3 }')
    frames = [
        wheels(0.0, 36.0, 36.0, 0, 0),
        wheels(0.01, 37.8, 0, id_=258),
        wheels(0.02, 36.0, 36.0, 0, 0),
        wheels(0.5, 36.0, 36.0, 0, 0),
    ]
    _, out = decode_all(vehicle, frames)
    assert values(out, "speed") == pytest.approx([10.0, 10.0 + 0.5 / 3, 10.0])
    state, _ = decode_all(vehicle, frames[:1])
    assert "speed.3: message REAR (0x102) never seen" in missing(vehicle, state)


def test_gap_from_headway_and_range_rate_from_the_lead_s_speed(tmp_path, decode_all) -> None:
    """With the latest own speed, which may itself be a mean; before there is one: not measured."""
    vehicle = car(
        tmp_path,
        speed=FOUR,
        gap='{ headway = "RADAR.Headway" }',
        range_rate='{ lead_speed = "RADAR.LeadSpeed" }',
    )
    radar = struct.pack("<HHHh", 0, 150, 7920, 0)
    frames = [Frame(0.0, 0, 259, radar), wheels(0.01, 72, 72, 72, 72), Frame(0.02, 0, 259, radar)]
    _, out = decode_all(vehicle, frames)
    assert values(out, "gap") == pytest.approx([np.nan, 30.0], nan_ok=True)
    assert values(out, "range_rate") == pytest.approx([np.nan, 2.0], nan_ok=True)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"gap": '{ mean_of = ["RADAR.Dist", "RADAR.Dist"] }'}, "signals.gap.mean_of: makes speed or wheel_speed, not gap"),
        ({"speed": '{ mean_of = ["WHEELS.FL"] }'}, "signals.speed.mean_of: "),
        ({"speed": '{ mean_of = ["WHEELS.FL", "WHEELS.FL"] }'}, "signals.speed.mean_of: names a signal twice"),
        ({"speed": '{ mean_of = ["WHEELS.FL", "WHEELS.FX"] }'}, 'no signal "FX" in message WHEELS (did you mean "F'),
        ({"speed": '{ mean_of = ["WHEELS.FL", "WHEELS.FR"], stal = 1 }'}, 'stal: unknown key (did you mean "stale"?)'),
        ({"range_rate": '{ derivative_of = "speed" }'}, "signals.range_rate.derivative_of: must be 'gap'"),
        ({"range_rate": '{ derivative_of = "gap", lead_speed = "RADAR.LeadSpeed" }'}, "exclude each other"),
        ({"gap": '{ headway = "RADAR.Dist" }'}, "cannot be converted to s"),
        ({"speed": '{ derivative_of = "gap" }'}, "signals.speed.derivative_of: makes range_rate, not speed"),
    ],
)  # fmt: skip
def test_mistakes_are_said_with_their_key(tmp_path, changed, says) -> None:
    """A form that a role does not have, a signal that is not there, a unit of another dimension."""
    with pytest.raises(ConfigError) as raised:
        car(tmp_path, **changed)
    assert says in str(raised.value)


MADE = {
    "wheels": {"speed": FOUR},
    "headway": {"gap": '{ headway = "RADAR.Headway" }'},
    "lead_speed": {"range_rate": '{ lead_speed = "RADAR.LeadSpeed" }', "speed": FOUR},
    "derivative": {"range_rate": '{ derivative_of = "gap" }'},
}


def read(folder: Path, vehicle: Vehicle, minutes: float, seed: int) -> tuple[canid.Trace, Simulation]:
    """A simulated drive in this vehicle's messages, checked and read."""
    drive = simulate(minutes=minutes, seed=seed)
    frames = bus_frames.frames(drive, vehicle)
    assert not check([columns_of(frames)], vehicle).problems
    lines = (f"({frame.t:.6f}) can0 {frame.id:03X}#{frame.data.hex().upper()}" for frame in frames)
    (folder / "drive.log").write_text("\n".join(lines) + "\n")
    return canid.read_trace(folder / "drive.log", vehicle), drive


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize("form", MADE)
def test_a_made_role_is_what_it_stands_for(tmp_path: Path, form: str, seed: int) -> None:
    """`check` accepts each form, and the samples are the drive's up to the radar's noise."""
    trace, drive = read(tmp_path, car(tmp_path, **MADE[form]), 2.0, seed)
    for role, most in (("speed", 0.1), ("gap", 1.0), ("range_rate", 0.3)):
        off = trace.signals[role] - np.interp(trace.t, drive.columns["t"], drive.columns[role])
        assert np.nanmean(np.isfinite(off)) > 0.6, role
        assert np.nanmedian(np.abs(off)) < most, role


@pytest.mark.slow("whole drives, identified")
@mostly(0.85)
def test_the_gain_holds_where_the_range_rate_is_the_gap_s_derivative(tmp_path: Path, seed: int) -> None:
    """The smoother's error does not depend on what it gives out: K is not attenuated, and its interval holds."""
    trace, drive = read(tmp_path, car(tmp_path, **MADE["derivative"]), 4.0, seed)
    found = canid.identify(trace, select_orders=False)
    truth, K = drive.truth["channels"]["range_rate"]["K"], found.channels["range_rate"].K
    assert K.low <= truth <= K.high, (K, truth)
