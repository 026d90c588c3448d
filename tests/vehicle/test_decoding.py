import math
import random
from itertools import islice

import cantools
import pytest

from canid.signals.vehicle import decoder, encoder, missing, read_vehicle
from canid.signals.vehicle.units import factor_to
from canid.values.frame_columns import columns_of
from canid.values.shipped_files import shipped
from canid.values.types import Event, Flag, Frame, Reading, TrackReading

GENERIC = cantools.database.load_file(shipped() / "generic.dbc")


def readings(out):
    return {item.role: item.value for item in out if isinstance(item, Reading)}


def expected(vehicle, files, frame):
    """The readings of a frame by cantools' own decoder: (role, DBC value), None where it does not decode."""
    out = {}
    for role in vehicle.roles.values():
        if role.id != frame.id or (role.bus is not None and role.bus != frame.bus):
            continue
        message = next(
            db for db in files if role.message in {m.name for m in db.messages}
        ).get_message_by_name(role.message)
        try:
            values = message.decode(frame.data, decode_choices=False, allow_truncated=True)
        except cantools.database.DecodeError:
            continue
        if role.signal in values:
            out[role.role] = (values[role.signal], message.get_signal_by_name(role.signal))
    return out


@pytest.mark.slow("parses hostile files in children")
def test_random_frames_decode_as_cantools_does(decode_all):
    """On random bytes, every reading is cantools' value in the role's unit, or NaN for a reason."""
    vehicle = read_vehicle("generic")
    chance = random.Random(1)
    compared = 0
    for _ in range(3400):
        message = chance.choice(GENERIC.messages)
        data = bytearray(
            chance.randbytes(chance.choice([message.length, message.length, chance.randint(0, 8)]))
        )
        if message.name == "GNSS_DATA" and data:
            data[0] = chance.choice([0, 1, 2, 2, 9])
        frame = Frame(0.0, 0, message.frame_id, bytes(data))
        state, out = decode_all(vehicle, [frame])
        mine, theirs = readings(out), expected(vehicle, [GENERIC], frame)
        for role, (value, signal) in theirs.items():
            how = vehicle.roles[role]
            si = value * (factor_to(signal.unit or "", how.unit) if how.unit else 1.0)
            if math.isnan(mine[role]):
                outside = not signal.minimum - signal.scale <= value <= signal.maximum + signal.scale
                named = signal.choices is not None and round(value / signal.scale) in {
                    int(raw) for raw in signal.choices
                } | {255}
                assert outside or named, (role, value)
            elif how.kind == "bool":
                assert mine[role] == float(value != 0)
            else:
                assert mine[role] == pytest.approx(si, rel=1e-12, abs=1e-12), role
                compared += 1
        for role in set(mine) - set(theirs):
            assert math.isnan(mine[role]), role
            assert state.counters[f"{role}: frame too short"] == 1
    assert compared > 3000


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("name", "log", "dbcs"),
    [
        ("openacc", "openacc/human_h22_v5.blf", ["openacc/car_following.dbc"]),
        ("toyota_rav4_2017", "rav4/rav4_highway.blf", ["rav4/toyota_pt.dbc", "rav4/toyota_radar.dbc"]),
    ],
)
def test_real_logs_decode_as_cantools_does(measured, decode_chunks, name, log, dbcs):
    """On real frames too, roles and radar tracks are cantools' values."""
    from canid.io.logs import open_log

    vehicle = read_vehicle(name)
    files = [cantools.database.load_file(measured / dbc, strict=False) for dbc in dbcs]
    radar = files[-1]
    compared = tracks = 0
    frames = list(islice(open_log(measured / log), 20_000))
    _, decoded = decode_chunks(vehicle, frames, 1000)
    for frame, out in zip(frames, decoded, strict=True):
        theirs = expected(vehicle, files, frame)
        mine = readings(out)
        assert set(mine) == set(theirs)
        for role, (value, signal) in theirs.items():
            how = vehicle.roles[role]
            sign = -1.0 if (name, role) == ("toyota_rav4_2017", "accel") else 1.0  # see the TOML
            factor = factor_to(signal.unit or "", how.unit) if how.unit else 1.0
            assert mine[role] == pytest.approx(sign * value * factor, rel=1e-12, abs=1e-12)
            compared += 1
        for item in out:
            if isinstance(item, TrackReading):
                values = radar.decode_message(frame.id, frame.data, decode_choices=False)
                assert item.valid == bool(values["VALID"])
                if item.valid:
                    assert (item.distance, item.rate, item.lateral) == pytest.approx(
                        (values["LONG_DIST"], values["REL_SPEED"], values["LAT_DIST"])
                    )
                    assert item.new == bool(values["NEW_TRACK"])
                    tracks += 1
    assert compared > 2000
    assert tracks > 500 or name == "openacc"


def test_no_target_is_no_value(decode_all):
    """The value table's "no target" gives NaN and a count with that text, not 409.55 m."""
    vehicle = read_vehicle("generic")
    frame = encoder(vehicle)(
        0.0, {"gap": math.nan, "range_rate": math.nan, "lead_valid": 0.0}, {"RADAR_LEAD": 0}
    )[0]
    assert GENERIC.decode_message(frame.id, frame.data)["LeadDistance"] == "no target"
    state, out = decode_all(vehicle, [frame])
    assert math.isnan(readings(out)["gap"])
    assert math.isnan(readings(out)["range_rate"])
    assert readings(out)["lead_valid"] == 0.0
    assert state.counters['gap: "no target"'] == 1


def test_out_of_range_is_no_value(decode_all):
    """A pedal of 101.2 % is no pedal; 100.0 and 100.4 % (one bit of rounding) are."""
    vehicle = read_vehicle("generic")
    for raw, there in ((0, True), (250, True), (251, True), (253, False), (254, False), (255, False)):
        state, out = decode_all(vehicle, [Frame(0.0, 0, 0x110, bytes([raw, 0, 0, 0]))])
        assert math.isfinite(readings(out)["pedal"]) == there, raw
        assert bool(state.counters) != there


def test_short_remote_error_and_extended_frames(decode_all):
    """Signals beyond a short frame's end are NaN and counted; remote, error and 29-bit frames say nothing."""
    vehicle = read_vehicle("generic")
    state, out = decode_all(vehicle, [Frame(0.0, 0, 0x110, b"\x64")])
    values = readings(out)
    assert values["pedal"] == 40.0
    assert math.isnan(values["engine_speed"])
    assert math.isnan(values["gear"])
    assert state.counters["engine_speed: frame too short"] == 1
    _, out = decode_all(vehicle, [Frame(0.0, 0, 0x110, b"")])
    assert all(math.isnan(value) for value in readings(out).values())
    for flag in (Flag.REMOTE, Flag.ERROR, Flag.EXTENDED):
        assert decode_all(vehicle, [Frame(0.0, 0, 0x110, bytes(4), int(flag))])[1] == []


def test_a_counter_that_stands_still_makes_the_message_stale(decode_all):
    """Once the counter has moved, five repeats make the values NaN; moving again heals at once."""
    vehicle = read_vehicle("generic")
    encode = encoder(vehicle)

    def pedal(tick):
        return encode(0.0, {"pedal": 20.0}, {"ENGINE_DATA": tick})[0]

    ticks = [0, 1, *[2] * 8, 3]
    state, out = decode_all(vehicle, [pedal(tick) for tick in ticks])
    lived = [math.isfinite(item.value) for item in out if item.role == "pedal"]
    assert lived == [True] * 7 + [False] * 3 + [True]
    assert state.counters["pedal: stale, the counter of ENGINE_DATA stands still"] == 3
    # A counter that never moved is none: many cars fill such fields with zeros.
    _, out = decode_all(vehicle, [pedal(0)] * 40)
    assert all(math.isfinite(item.value) for item in out if item.role == "pedal")


def test_multiplexed_signals_come_with_their_page_only(decode_all):
    """Altitude is read on page 0 alone; a page that the DBC does not define says nothing and is counted."""
    vehicle = read_vehicle("generic")
    pages = [
        set(readings(decode_all(vehicle, [Frame(0.0, 0, 0x170, bytes([page, *[0] * 7]))])[1]))
        for page in range(3)
    ]
    assert pages == [{"altitude", "grade", "gnss_speed"}, {"lat", "lon"}, {"east", "north"}]
    state, out = decode_all(vehicle, [Frame(0.0, 0, 0x170, bytes([7, *[0] * 7]))])
    assert out == []
    assert state.counters["GNSS_DATA: Page = 7 is not defined in the DBC"] == 1


def test_an_id_on_two_buses_is_taken_from_where_its_neighbours_are(decode_all):
    """Bus 1 speaks first with an id that it uses for something else; the other mapped ids are all on bus 0."""
    vehicle = read_vehicle("generic")
    frames = []
    for k in range(20):
        t = 0.1 * k
        frames += [
            Frame(t, 1, 0x110, bytes([250, 0, 0, 0])),
            Frame(t + 0.01, 0, 0x120, bytes(6)),
            Frame(t + 0.02, 0, 0x130, bytes(8)),
            Frame(t + 0.03, 0, 0x110, bytes([50, 0, 0, 0])),
        ]
    state, out = decode_all(vehicle, frames)
    pedal = [item.value for item in out if isinstance(item, Reading) and item.role == "pedal"]
    assert pedal[0] == 100.0
    assert pedal[1:] == [20.0] * 20
    events = [item for item in out if isinstance(item, Event)]
    assert len(events) == 1
    assert "bus 0 is used" in events[0].says
    assert state.counters["ENGINE_DATA: frame on bus 1 ignored"] == 19


def test_one_id_on_two_buses_is_taken_from_the_first_and_told_once(decode_all):
    """The first bus wins, the other is counted, and one event says how to choose."""
    vehicle = read_vehicle("generic")
    frames = [Frame(0.1 * k, k % 2, 0x110, bytes([10 * (1 + k % 2), 0, 0, 0])) for k in range(10)]
    state, out = decode_all(vehicle, frames)
    assert [item.value for item in out if isinstance(item, Reading) and item.role == "pedal"] == [4.0] * 5
    events = [item for item in out if isinstance(item, Event)]
    assert len(events) == 1
    assert events[0].what == "ambiguous_bus"
    assert "bus = 1" in events[0].says
    assert state.counters["ENGINE_DATA: frame on bus 1 ignored"] == 5


def test_what_never_came_is_named(decode_all):
    """Roles whose message or page was never seen are named, with message and id."""
    vehicle = read_vehicle("generic")
    frames = [frame for frame in encoder(vehicle)(0.0, {}) if frame.id != 0x120]
    state, _ = decode_all(vehicle, frames)
    lines = missing(vehicle, state)
    assert "speed: message EGO_SPEED (0x120) never seen" in lines
    assert "lat: message GNSS_DATA (0x170) came, but never with Latitude (a multiplexed signal)" in lines
    assert not [line for line in lines if line.startswith(("pedal", "gap", "altitude"))]


def test_tracks_bound_to_a_bus_are_missed_there(measured, decode_all):
    """Radar frames on the wrong bus are not decoded, and the list of missing signals says where they are."""
    vehicle = read_vehicle("toyota_rav4_2017")
    state, out = decode_all(vehicle, [Frame(0.0, 0, 0x210, bytes(8))])
    assert out == []
    lead = next(line for line in missing(vehicle, state) if line.startswith("lead"))
    assert "never seen on bus 1, but on bus 0" in lead


def test_states_are_values(decode_all):
    """Stepping twice from one state gives the same answer twice: nothing is kept outside the state."""
    vehicle = read_vehicle("generic")
    init, step = decoder(vehicle)
    start = init()
    frames = encoder(vehicle)(0.0, {"pedal": 20.0, "gap": math.nan})
    once = repr(step(start, columns_of(frames[:1])))
    for frame in frames:
        step(start, columns_of([frame]))
    assert repr(step(start, columns_of(frames[:1]))) == once
    assert start == init()
