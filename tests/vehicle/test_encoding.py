import math

import numpy as np
import pytest

from canid.signals.vehicle import encoder, read_vehicle
from canid.signals.vehicle.bits import Bits, put, raw_of
from canid.values.types import NAN, Flag, Reading, TrackReading


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize("name", ["generic", "generic_lane", "openacc"])
def test_every_role_comes_back_within_half_a_bit(decode_all, name):
    """Values in SI that were encoded decode to themselves, within half of the signal's resolution."""
    vehicle = read_vehicle(name)
    encode, chance = encoder(vehicle), np.random.default_rng(2)
    back = dict.fromkeys(vehicle.roles, 0)
    for tick in range(60):
        values = {}
        for role, how in vehicle.roles.items():
            ends = sorted(raw * how.how.factor + how.how.offset for raw in how.how.bits.reach)
            # One bit of the DBC's range is tolerance, and the last raw number may mean "no value".
            lsb = abs(how.how.factor)
            low, high = max(how.valid[0], ends[0]) + 2 * lsb, min(how.valid[1], ends[1]) - 2 * lsb
            values[role] = float(chance.integers(0, 2)) if how.kind == "bool" else chance.uniform(low, high)
            if how.kind == "state":
                values[role] = float(chance.integers(0, 7))
        due = {message.name: tick for message in vehicle.messages}
        _, out = decode_all(vehicle, encode(0.1 * tick, values, due))
        for item in out:
            assert isinstance(item, Reading)
            lsb = abs(vehicle.roles[item.role].how.factor)
            assert item.value == pytest.approx(values[item.role], abs=0.5001 * lsb), item.role
            back[item.role] += 1
    assert all(count >= 20 for count in back.values()), back


def test_values_beyond_the_range_are_clipped(decode_all):
    """140 % pedal is written as 100 %, not as a number that wraps around or means "not available"."""
    vehicle = read_vehicle("generic")
    for value, written in ((140.0, 100.4), (-3.0, 0.0)):
        _, out = decode_all(vehicle, encoder(vehicle)(0.0, {"pedal": value}, {"ENGINE_DATA": 0}))
        assert out[0].value == pytest.approx(written)


def test_radar_tracks_carry_the_lead(decode_all):
    """Where a car has tracks, gap and range rate come back as the first track, straight ahead; no others."""
    vehicle = read_vehicle("toyota_rav4_2017")
    _, out = decode_all(vehicle, encoder(vehicle)(0.0, {"gap": 33.3, "range_rate": -2.5, "lead_valid": 1.0}))
    tracks = [item for item in out if isinstance(item, TrackReading)]
    assert len(tracks) == 16
    assert [track.track for track in tracks if track.valid] == [0]
    assert (tracks[0].distance, tracks[0].rate, tracks[0].lateral) == pytest.approx(
        (33.3, -2.5, 0.0), abs=0.013
    )
    _, out = decode_all(vehicle, encoder(vehicle)(0.0, {"gap": NAN, "range_rate": NAN, "lead_valid": 0.0}))
    assert not any(item.valid for item in out if isinstance(item, TrackReading))


def test_bits_go_in_and_out_in_any_place():
    """Any signed, unsigned or floating number at any place of a frame comes back, in both byte orders."""
    chance = np.random.default_rng(3)
    for _ in range(2000):
        motorola, signed = (bool(b) for b in chance.integers(0, 2, 2))
        size = int(chance.choice([1, 2, 8, 64]))
        length = int(chance.integers(1, min(8 * size, 40) + 1))
        first = int(chance.integers(0, 8 * size - length + 1))
        start = 8 * (first // 8) + 7 - first % 8 if motorola else first
        bits = Bits(start, length, motorola, signed)
        raw = int(chance.integers(int(bits.reach[0]), int(bits.reach[1]) + 1))
        data = put(bits, raw, size).to_bytes(size, "little")
        assert raw_of(bits, data) == raw
        assert raw_of(bits, data[: (bits.end - 1) // 8]) is None
    for length, value in ((32, 1.5), (64, math.pi)):
        bits = Bits(8, length, floating=True)
        assert raw_of(bits, put(bits, value, 9).to_bytes(9, "little")) == value


def test_long_and_29_bit_messages_are_marked():
    """A message with a 29-bit id or more than 8 bytes is a frame with the flag that says so."""
    vehicle = read_vehicle("generic")
    message = vehicle.messages[0]._replace(extended=True, length=16)
    frame = encoder(vehicle._replace(messages=(message,)))(0.0, {})[0]
    assert frame.flags == Flag.EXTENDED | Flag.FD
    assert len(frame.data) == 16
