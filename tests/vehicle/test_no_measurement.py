"""Raw numbers that J1939-71 reserves are no measurement, and whole numbers keep their last bits, in every decoding path."""

from __future__ import annotations

import random
from collections import Counter
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive.drive_reader import read_signals
from canid.analysis.drive.signal_columns import MessageFrames, decode
from canid.io.logs import write_log
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.bits import Bits, payloads, put, scaled
from canid.signals.vehicle.database import bits_of
from canid.signals.vehicle.decoding_plan import _is_plain, _plain
from canid.signals.vehicle.j1939 import PROTOCOL, first_no_value
from canid.signals.vehicle.mapping import RoleMap, SignalMap
from canid.signals.vehicle.signal_values import plain_values, read_values
from canid.values.types import Flag, Frame
from tests.vehicle.test_j1939 import truck

# J1939-71: of each length the last number that is a measurement; from the next one on it is none
_LAST = {8: 0xFA, 16: 0xFAFF, 32: 0xFAFF_FFFF, 12: 0xFAF, 24: 0xFA_FFFF}


def _signal(length: int, motorola: bool, scale: float, offset: float, *, signed: bool = False) -> Signal:
    start = 7 if motorola else 0
    return Signal(
        "S", start, length, motorola, signed, False, scale, offset, None, None, "", {}, False, None, ()
    )


def _data(bits: Bits, raws: list[int]) -> np.ndarray:
    return np.frombuffer(b"".join(put(bits, raw, 8).to_bytes(8, "little") for raw in raws), np.uint8).reshape(
        -1, 8
    )


def _by_every_path(signal: Signal, protocol: str, raws: list[int]) -> dict[str, np.ndarray]:
    """Values by a message's columns, by a role alone, and by the fast path frame by frame."""
    bits = bits_of(signal)
    data, n = _data(bits, raws), len(raws)
    length = np.full(n, 8, np.uint8)
    message = Message("M", 0x18FEF100, True, 8, 0.1, (signal,), protocol)
    column = decode(message, signal, MessageFrames(np.arange(n) * 0.1, length, data))
    assert column is not None
    how = SignalMap(
        "S",
        bits,
        signal.scale,
        signal.offset,
        -np.inf,
        np.inf,
        "number",
        reserved=first_no_value(message, signal),
    )
    alone = read_values(how, "S", payloads(data, length), Counter())[0]
    found = {"columns": column.value, "role": alone}
    plain = _plain((RoleMap("speed", "M", 1, True, None, "", 1.0, how),))
    if _is_plain(how) and plain is not None:
        each = [plain_values(plain, payloads(data[k : k + 1], length[k : k + 1])) for k in range(n)]
        found["together"] = np.array([one["speed"][0] if one else np.nan for one in each])
    return found


@pytest.mark.parametrize("length", _LAST)
@pytest.mark.parametrize("motorola", [False, True])
@pytest.mark.parametrize("scale", [0.125, -0.125])
def test_reserved_raw_numbers_are_no_measurement(length: int, motorola: bool, scale: float) -> None:
    """0xFB to 0xFF in the first byte of any length; the number before them is a measurement, and so are all of plain CAN."""
    last, top = _LAST[length], (1 << length) - 1
    step = max((top - last) // 40, 1)
    raws = [0, 1, last - 1, last, *range(last + 1, top, step), top]
    signal = _signal(length, motorola, scale, 3.0)
    for path, values in _by_every_path(signal, PROTOCOL, raws).items():
        expected = [raw * scale + 3.0 if raw <= last else np.nan for raw in raws]
        np.testing.assert_array_equal(values, expected, err_msg=path)
    for path, values in _by_every_path(signal, "", raws).items():
        np.testing.assert_array_equal(values, [raw * scale + 3.0 for raw in raws], err_msg=path)


def test_a_truck_without_a_measurement_has_none(tmp_path: Path) -> None:
    """A pedal of 0xFB to 0xFD and a speed of 0xFB00 to 0xFDFF of a log are not measured, and are counted as reserved."""
    log = tmp_path / "truck.blf"
    raws = [50, 0xFA, 0xFB, 0xFC, 0xFD, 0xFE, 0xFF, 60]
    frames = []
    for k, raw in enumerate(raws):
        eec2 = bytes([0xFF, raw, *[0xFF] * 6])
        ccvs = b"\xff" + (raw << 8).to_bytes(2, "little") + bytes(5)
        frames.append(Frame(0.1 * k, 0, 0x0CF00300, eec2, int(Flag.EXTENDED)))
        frames.append(Frame(0.1 * k, 0, 0x18FEF121, ccvs, int(Flag.EXTENDED)))
    write_log(log, frames)
    found = read_signals(log, truck(tmp_path))
    measured = [True, True, False, False, False, False, False, True]
    assert (~np.isnan(found["pedal"].value)).tolist() == measured
    assert (~np.isnan(found["speed"].value)).tolist() == measured


@pytest.mark.parametrize("motorola", [False, True])
@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize(
    ("scale", "offset"),
    [
        (1.0, 0.0),
        (1.0, -(2.0**60)),
        (2.0, -(2.0**60)),
        (1.0, -9.007199254740993e15),
        (0.1, 0.0),
        (1e-9, -1.7e9),
    ],
)
def test_whole_numbers_keep_their_last_bits(
    motorola: bool, signed: bool, scale: float, offset: float
) -> None:
    """Of 54 to 64 bits: the double next to raw · scale + offset as exact numbers, whatever the path."""
    rng = random.Random(7)
    for length in (54, 57, 63, 64):
        low, high = (-(1 << (length - 1)), (1 << (length - 1)) - 1) if signed else (0, (1 << length) - 1)
        near = [2**53, 2**53 + 1, 2**60 + 1, 2**60 + 3, -(2**53) - 1]
        raws = [
            low,
            high,
            *(raw for raw in near if low <= raw <= high),
            *(rng.randint(low, high) for _ in range(40)),
        ]
        signal = _signal(length, motorola, scale, offset, signed=signed)
        for path, values in _by_every_path(signal, "", raws).items():
            exact = [float(Fraction(raw) * Fraction(scale) + Fraction(offset)) for raw in raws]
            large = np.array([abs(raw) > 2**53 for raw in raws])
            np.testing.assert_array_equal(values[large], np.array(exact)[large], err_msg=path)
            np.testing.assert_allclose(values, exact, rtol=1e-12, err_msg=path)


def test_numbers_beyond_all_doubles_are_infinite() -> None:
    """A factor that no product holds: infinite with its sign, no exception."""
    raw = np.array([2**63, 1], np.uint64)
    assert scaled(Bits(0, 64), raw, 1e300, 0.0)[0] == np.inf
    assert scaled(Bits(0, 64), raw, -1e300, 0.0)[0] == -np.inf
