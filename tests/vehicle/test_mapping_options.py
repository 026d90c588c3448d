"""Options of a mapping: unit, scale, offset, valid, stale, invert, on, bus, and [lead]'s own."""

import math
import shutil
from pathlib import Path

import pytest

from canid.signals.vehicle import read_vehicle
from canid.values.errors import ConfigError
from canid.values.types import Frame, Reading, TrackReading

ROOT = Path(__file__).parents[2]
REST = """
pedal = "ENGINE_DATA.PedalPosition"
gap = "RADAR_LEAD.LeadDistance"
range_rate = "RADAR_LEAD.LeadRelSpeed"
"""
TRACKS = """VERSION ""
BU_: R
BO_ 100 OBJ_01: 6 R
 SG_ Dist : 0|12@1+ (0.1,0) [0|400] "m" R
 SG_ Rel : 12|12@1- (0.1,0) [0|0] "km/h" R
 SG_ Lat : 24|8@1- (0.1,0) [0|0] "m" R
 SG_ Ok : 32|2@1+ (1,0) [0|3] "" R
 SG_ Fresh : 34|1@1+ (1,0) [0|1] "" R
BO_ 101 OBJ_02: 6 R
 SG_ Dist : 0|12@1+ (0.1,0) [0|400] "m" R
 SG_ Rel : 12|12@1- (0.1,0) [0|0] "km/h" R
 SG_ Lat : 24|8@1- (0.1,0) [0|0] "m" R
 SG_ Ok : 32|2@1+ (1,0) [0|3] "" R
 SG_ Fresh : 34|1@1+ (1,0) [0|1] "" R
VAL_ 100 Ok 3 "not available";
"""


@pytest.fixture
def car(tmp_path):
    """Read a vehicle with one entry for the speed (or more lines of [signals])."""

    def read(speed='"EGO_SPEED.VehicleSpeed"', more="", dbc='"generic.dbc"'):
        shutil.copy(ROOT / "dbc" / "generic.dbc", tmp_path / "generic.dbc")
        file = tmp_path / "car.toml"
        file.write_text(f"dbc = [{dbc}]\n[signals]\nspeed = {speed}\n{REST}{more}", encoding="utf-8")
        return read_vehicle(file)

    return read


def value(decode_all, vehicle, frame, role="speed"):
    _, out = decode_all(vehicle, [frame])
    return next(item.value for item in out if isinstance(item, Reading) and item.role == role)


SPEED_3600 = Frame(0.0, 0, 0x120, (3600).to_bytes(2, "big") + bytes(4))  # 36.00 in the DBC's km/h


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ("", 10.0),
        (', unit = "mph"', 36 * 0.44704),
        (", scale = 1.02", 10.2),
        (", scale = 0.5, offset = 3.6", 6.0),
        (', unit = "m/s", scale = 2', 72.0),
        (", valid = [0, 37]", 10.0),
        (", valid = [0, 35]", math.nan),  # in the signal's own unit, km/h
        (", valid = [37, 400]", math.nan),
    ],
)
def test_unit_scale_offset_and_range(car, decode_all, options, expected):
    """scale and offset act on the DBC's value, `valid` on the result, then the unit is converted to SI."""
    vehicle = car(f'{{ signal = "EGO_SPEED.VehicleSpeed"{options} }}')
    assert value(decode_all, vehicle, SPEED_3600) == pytest.approx(expected, rel=1e-12, nan_ok=True)


def test_a_unit_nobody_knows_needs_unit_or_scale(car, decode_all, tmp_path):
    """An unknown DBC unit is one mistake with the remedy; a scale alone then means the role's unit."""
    text = (ROOT / "dbc" / "generic.dbc").read_text()
    (tmp_path / "odd.dbc").write_text(text.replace('[0|300] "km/h"', '[0|300] "ticks"'))
    with pytest.raises(
        ConfigError, match=r'signals.speed: VehicleSpeed has the unit "ticks".*set unit = "..."'
    ):
        car(dbc='"odd.dbc"')
    vehicle = car('{ signal = "EGO_SPEED.VehicleSpeed", scale = 0.5 }', dbc='"odd.dbc"')
    assert value(decode_all, vehicle, SPEED_3600) == 18.0
    vehicle = car('{ signal = "EGO_SPEED.VehicleSpeed", unit = "km/h" }', dbc='"odd.dbc"')
    assert value(decode_all, vehicle, SPEED_3600) == pytest.approx(10.0)


@pytest.mark.slow("parses hostile files in children")
def test_switches_can_be_inverted_or_taken_from_a_state(car, decode_all):
    """`invert` turns a switch round; `on` says which of a state's numbers mean yes."""
    vehicle = car(more='brake = { signal = "DRIVER_STATE.BrakePressed", invert = true }')
    for bit in (0, 1):
        frame = Frame(0.0, 0, 0x140, bytes([bit, 0]))
        assert value(decode_all, vehicle, frame, "brake") == 1.0 - bit
    vehicle = car(more='cruise_active = { signal = "ENGINE_DATA.Gear", on = [3, 5] }')
    active = [
        value(decode_all, vehicle, Frame(0.0, 0, 0x110, bytes([0, 0, 0, raw])), "cruise_active")
        for raw in range(7)
    ]
    assert active == [0, 0, 0, 1, 0, 1, 0]
    # "not available" is no "no": it is not measured.
    assert math.isnan(value(decode_all, vehicle, Frame(0.0, 0, 0x110, bytes([0, 0, 0, 15])), "cruise_active"))
    for wrong in ("invert = true", "on = [1]"):
        with pytest.raises(ConfigError, match=r"signals.speed\.(invert|on): is for yes/no roles"):
            car(f'{{ signal = "EGO_SPEED.VehicleSpeed", {wrong} }}')


def test_how_long_a_value_lives(car):
    """`stale` is the file's, or the role's usual one; switches are held, numbers are not."""
    vehicle = car('{ signal = "EGO_SPEED.VehicleSpeed", stale = 2 }', 'gear = "ENGINE_DATA.Gear"')
    assert vehicle.roles["speed"].stale == 2.0
    assert 0 < vehicle.roles["pedal"].stale < 1.0
    assert [vehicle.roles[role].switch for role in ("speed", "gear")] == [False, True]


def test_the_bus_can_be_chosen(car, decode_all):
    """A mapping bound to a bus takes its frames from there alone, by the signal's `bus` or by the file's."""
    for vehicle in (
        car('{ signal = "EGO_SPEED.VehicleSpeed", bus = 1 }'),
        car(dbc='{ file = "generic.dbc", bus = 1 }'),
    ):
        state, out = decode_all(vehicle, [SPEED_3600, SPEED_3600._replace(bus=1, t=1.0)])
        assert [item.t for item in out] == [1.0]
        assert state.counters["EGO_SPEED: frame on bus 0 ignored"] == 1


def test_one_id_with_two_meanings_on_two_buses(car, decode_all, tmp_path):
    """Two DBC files that give one id two meanings are kept apart by their buses."""
    other = """VERSION ""
BU_: X
BO_ 288 OTHER: 2 X
 SG_ Height : 0|16@1+ (1,0) [0|0] "m" X
"""
    (tmp_path / "other.dbc").write_text(other)
    vehicle = car(
        more='altitude = "OTHER.Height"',
        dbc='{ file = "generic.dbc", bus = 0 }, { file = "other.dbc", bus = 1 }',
    )
    state, out = decode_all(vehicle, [SPEED_3600, Frame(1.0, 1, 288, b"\x05\x00")])
    assert [(item.role, item.value) for item in out] == [("speed", pytest.approx(10.0)), ("altitude", 5.0)]
    assert dict(state.counters) == {}


def tracks_file(folder, lead):
    (folder / "tracks.dbc").write_text(TRACKS)
    shutil.copy(ROOT / "dbc" / "generic.dbc", folder / "generic.dbc")
    file = folder / "car.toml"
    file.write_text(
        'dbc = ["generic.dbc", { file = "tracks.dbc", bus = 1 }]\n[signals]\n'
        'speed = "EGO_SPEED.VehicleSpeed"\n'
        f'pedal = "ENGINE_DATA.PedalPosition"\n[lead]\n{lead}'
    )
    return file


LEAD = (
    'tracks = "OBJ_{01..02}"\ndistance = "Dist"\nrate = "Rel"\nlateral = "Lat"\nvalid = "Ok"\nnew = "Fresh"\n'
)


def test_tracks_in_their_own_words(decode_all, tmp_path):
    """Track signals are converted to SI with the file's sign; 0 or "not available" is no valid track."""
    vehicle = read_vehicle(tracks_file(tmp_path, LEAD + "rate_sign = -1\nin_path = 1.5\n"))
    assert vehicle.lead.in_path == 1.5
    word = 500 | (180 << 12) | ((-12 & 0xFF) << 24) | (1 << 32) | (1 << 34)
    state, out = decode_all(vehicle, [Frame(2.0, 1, 101, word.to_bytes(6, "little"))])
    assert out == [TrackReading(2.0, 1, 50.0, pytest.approx(-5.0), pytest.approx(-1.2), True, True)]
    for ok in (0, 3):
        word = 500 | (ok << 32)
        state, out = decode_all(vehicle, [Frame(2.0, 1, 100, word.to_bytes(6, "little"))])
        assert not out[0].valid
        assert math.isnan(out[0].distance)
        assert dict(state.counters) == {}
    # A valid track beyond its range is none, and that is counted.
    state, out = decode_all(vehicle, [Frame(2.0, 1, 101, (4095 | (1 << 32)).to_bytes(6, "little"))])
    assert not out[0].valid
    assert dict(state.counters) == {"track distance: out of range": 1}


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("lead", "says"),
    [
        (LEAD.replace("02", "03"), r'lead.tracks: no message "OBJ_03" in .*did you mean "OBJ_0'),
        (LEAD.replace("{01..02}", "{0-2}"), r'lead.tracks: write it as "TRACK_\{0..15\}"'),
        (LEAD.replace("{01..02}", "{2..1}"), r"is not a range of 1 to 256 tracks"),
        (LEAD.replace("{01..02}", "{0..99999999}"), r"is not a range of 1 to 256 tracks"),
        (
            LEAD.replace('"Dist"', '"Dst"'),
            r'lead.distance: no signal "Dst" in message OBJ_01 \(did you mean "Dist"',
        ),
        (LEAD.replace('rate = "Rel"\n', ""), r"lead.rate: is missing; lead.tracks needs it"),
        (
            LEAD.replace('"Rel"', '"Dist"'),
            r'lead.rate: Dist has the unit "m", which cannot be converted to m/s',
        ),
    ],
)
def test_mistakes_in_lead_are_told(tmp_path, lead, says):
    """Each mistake of [lead] is one line with its key."""
    with pytest.raises(ConfigError, match=says) as caught:
        read_vehicle(tracks_file(tmp_path, lead))
    assert len(str(caught.value).splitlines()) == 1


def test_what_is_to_be_said_of_every_track_is_said_once(tmp_path) -> None:
    """A range that does not fit the bits of any of 16 tracks: one line, with their number."""
    signals = ' SG_ Dist : 0|12@1+ (0.1,0) [0|400] "m" R\n SG_ Rel : 12|12@1- (0.03125,0) [0|127.5] "m/s" R\n'
    messages = "".join(f"BO_ {100 + k} OBJ_{k}: 8 R\n{signals}" for k in range(16))
    own = 'BO_ 50 OWN: 8 R\n SG_ P : 0|8@1+ (1,0) [0|100] "%" R\n SG_ V : 8|8@1+ (1,0) [0|250] "km/h" R\n'
    (tmp_path / "car.dbc").write_text(f'VERSION ""\nBU_: R\n{own}{messages}')
    (tmp_path / "car.toml").write_text(
        'dbc = ["car.dbc"]\n[signals]\npedal = "OWN.P"\nspeed = "OWN.V"\n'
        '[lead]\ntracks = "OBJ_{0..15}"\ndistance = "Dist"\nrate = "Rel"\n'
    )
    of_rate = [line for line in read_vehicle(tmp_path / "car.toml").warnings if "lead.rate" in line]
    assert len(of_rate) == 1
    assert of_rate[0].startswith("lead.rate, 16 tracks: the DBC's range [0|127.5] of Rel does not fit")
