"""Frames decode as cantools does, in chunks of any size: generated signals, pages within pages, buses, counters."""

from __future__ import annotations

import math
import random
from pathlib import Path

import cantools
import numpy as np
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.analysis.drive.drive_reader import read_signals
from canid.io.logs import open_log, write_log
from canid.signals.dbc_text import parsing
from canid.signals.vehicle import Vehicle, decoder, read_vehicle
from canid.signals.vehicle.bits import Bits, payloads, raws_of
from canid.signals.vehicle.database import bits_of
from canid.values.frame_columns import columns_of
from canid.values.types import Flag, Frame, Reading
from canid.values.window import Window

# roles that are plain numbers, with their units
NUMBERS = {
    "pedal": "%", "speed": "m/s", "gap": "m", "range_rate": "m/s", "accel": "m/s2", "lateral_offset": "m",
}  # fmt: skip


@st.composite
def signals(draw: st.DrawFn, length: int, smallest_float: int = 16) -> Signal:
    """Any signal that fits a message of so many bytes."""
    bits = 8 * length
    floats = [size for size in (16, 32, 64) if smallest_float <= size <= bits]
    is_float = bool(floats) and draw(st.booleans())
    size = draw(st.sampled_from(floats)) if is_float else draw(st.integers(1, min(bits, 64)))
    at = draw(st.integers(0, bits - size))
    motorola = draw(st.booleans())
    # a Motorola signal's start is its most significant bit, and bits within a byte are counted from the right
    start = 8 * (at // 8) + 7 - at % 8 if motorola else at
    return Signal(
        "S",
        start,
        size,
        "big_endian" if motorola else "little_endian",
        not is_float and draw(st.booleans()),
        conversion=BaseConversion.factory(1, 0, None, is_float),
    )


def bits(signal: Signal) -> Bits:
    """Where a signal of cantools lies."""
    return bits_of(parsing.Signal(*parsing.signal_fields(signal)))


@pytest.mark.slow("whole drives through the pipeline")
@settings(max_examples=250, deadline=None)
@given(data=st.data(), length=st.sampled_from((1, 2, 5, 8, 12, 16, 64)))
def test_raw_numbers_are_cantools(data: st.DataObject, length: int) -> None:
    """Any signal, in any place, Intel or Motorola, signed, unsigned or floating: the same number, bit for bit."""
    signal = data.draw(signals(length))
    message = Message(1, "M", length, [signal], strict=False)
    rows = data.draw(st.lists(st.binary(min_size=length, max_size=length), min_size=1, max_size=5))
    chunk = columns_of([Frame(0.0, 0, 1, row) for row in rows])
    found, there = raws_of(bits(signal), payloads(chunk.data, chunk.length))
    assert there is None
    expected = [message.decode(row, scaling=False, decode_choices=False)["S"] for row in rows]
    assert list(map(repr, found.tolist())) == list(map(repr, expected))


@settings(max_examples=60, deadline=None)
@given(data=st.data(), length=st.sampled_from((2, 8, 12)))
def test_short_frames_lack_what_they_do_not_reach(data: st.DataObject, length: int) -> None:
    """A frame that ends before the signal is distinguished from one that is long enough; a longer one changes nothing."""
    signal = data.draw(signals(length))
    lengths = data.draw(st.lists(st.integers(0, length), min_size=1, max_size=5))
    chunk = columns_of([Frame(0.0, 0, 1, b"\xa5" * n) for n in lengths])
    where = bits(signal)
    _, there = raws_of(where, payloads(chunk.data, chunk.length))
    got = [True] * len(lengths) if there is None else there.tolist()
    assert got == [8 * n >= where.end for n in lengths]


def car(tmp_path: Path, dbc: str, toml: str) -> Vehicle:
    (tmp_path / "x.dbc").write_text(
        'VERSION ""\n\nNS_ :\n\tSG_MUL_VAL_\n\nBS_:\n\nBU_: A\n\n' + dbc, encoding="utf-8"
    )
    (tmp_path / "x.toml").write_text(
        f'name = "X"\ndbc = ["x.dbc"]\n[signals]\n{toml}\n[driver]\noutput = "accel"\n', encoding="utf-8"
    )
    return read_vehicle(tmp_path / "x.toml")


@pytest.mark.slow("parses hostile files in children")
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32), chosen=st.data())
def test_generated_messages_decode_as_cantools(
    seed: int, chosen: st.DataObject, tmp_path_factory: pytest.TempPathFactory, same_in_chunks: object
) -> None:
    """A DBC of random signals, scaled and offset: every value is cantools'."""
    rng = random.Random(seed)
    lines, toml, floating = [], [], []
    for k, (role, unit) in enumerate(NUMBERS.items()):
        signal = chosen.draw(signals(8, 32))  # a DBC knows no half precision
        # integers that a float holds, or cantools' own would be rounded in another way
        size = signal.length if signal.conversion.is_float else min(signal.length, 52)
        scale, offset = rng.choice(("1", "0.1", "-0.5", "3", "1E-007")), rng.choice(("0", "-40", "12.5"))
        sign = "-" if signal.is_signed or signal.conversion.is_float else "+"
        order = 0 if signal.byte_order == "big_endian" else 1
        lines.append(
            f'BO_ {100 + k} M{k}: 8 A\n SG_ S : {signal.start}|{size}@{order}{sign} ({scale},{offset}) [0|0] "" A\n'
        )
        toml.append(f'{role} = {{ signal = "M{k}.S", unit = "{unit}" }}')
        if signal.conversion.is_float:
            floating.append(f"SIG_VALTYPE_ {100 + k} S : {1 if size == 32 else 2};\n")
    folder = tmp_path_factory.mktemp("car")
    vehicle = car(folder, "\n".join(lines) + "\n" + "".join(floating), "\n".join(toml))
    database = cantools.database.load_file(folder / "x.dbc", strict=False)
    frames = [
        Frame(0.01 * k, 0, rng.choice(database.messages).frame_id, rng.randbytes(rng.choice((8, 8, 8, 5))))
        for k in range(80)
    ]
    same_in_chunks(vehicle, frames, (33,))  # type: ignore[operator]
    init, step = decoder(vehicle)
    _, decoded = step(init(), columns_of(frames))
    for role, rows, values in decoded.roles:
        for row, value in zip(rows.tolist(), values.tolist(), strict=True):
            frame = frames[row]
            message = database.get_message_by_frame_id(frame.id)
            expected = float(message.decode(frame.data, allow_truncated=True).get("S", math.nan))
            # an infinite or undefined float is no measurement
            assert value == expected or (math.isnan(value) and not math.isfinite(expected)), role


MULTIPLEXED = """
BO_ 200 PAGES: 8 A
 SG_ Page M : 0|4@1+ (1,0) [0|0] "" A
 SG_ Sub m1M : 4|4@1+ (1,0) [0|0] "" A
 SG_ A m0 : 8|16@1- (0.01,0) [0|0] "" A
 SG_ B m1 : 15|12@0+ (0.5,-3) [0|0] "" A
 SG_ C m2 : 8|8@1+ (1,0) [0|0] "" A
 SG_ D m3 : 24|32@1- (1,0) [0|0] "" A

SIG_VALTYPE_ 200 D : 1;
SG_MUL_VAL_ 200 Sub Page 1-1;
SG_MUL_VAL_ 200 A Page 0-0, 5-6;
SG_MUL_VAL_ 200 B Page 1-1;
SG_MUL_VAL_ 200 C Sub 2-3;
SG_MUL_VAL_ 200 D Sub 3-3, 7-9;
"""


def test_pages_within_pages(tmp_path: Path, same_in_chunks) -> None:  # type: ignore[no-untyped-def]
    """Simple and extended multiplexing: a signal comes with its pages, with cantools' value, and with no other."""
    mapped = {"accel": "A", "gap": "B", "speed": "C", "range_rate": "D"}
    toml = "\n".join(f'{r} = {{ signal = "PAGES.{s}", unit = "{NUMBERS[r]}" }}' for r, s in mapped.items())
    vehicle = car(tmp_path, MULTIPLEXED, toml)
    database = cantools.database.load_file(tmp_path / "x.dbc", strict=False)
    rng = random.Random(3)
    frames = [
        Frame(0.01 * k, 0, 200, bytes([rng.randrange(8) | rng.randrange(10) << 4]) + rng.randbytes(7))
        for k in range(600)
    ]
    same_in_chunks(vehicle, frames)
    init, step = decoder(vehicle)
    state, decoded = step(init(), columns_of(frames))
    found = {(role, k): x for role, row, value in decoded.roles for k, x in zip(row, value, strict=True)}
    seen = set()
    for k, frame in enumerate(frames):
        page, sub = frame.data[0] & 15, frame.data[0] >> 4
        if page in (2, 3, 4, 7) or (page == 1 and sub not in (2, 3, 7, 8, 9)):
            continue  # cantools refuses selectors that the DBC does not define
        expected = database.decode_message(200, frame.data)
        for role, name in mapped.items():
            assert (name in expected) == ((role, k) in found)
            if name in expected:
                value = float(expected[name])
                assert found[role, k] == value or (math.isnan(found[role, k]) and not math.isfinite(value))
                seen.add(name)
    assert seen == set("ABCD")
    assert state.counters["PAGES: Page = 7 is not defined in the DBC"] > 10


def test_counters_and_buses_go_on_from_chunk_to_chunk(tmp_path: Path, same_in_chunks) -> None:  # type: ignore[no-untyped-def]
    """A counter that stands still across chunks, ids on several buses, remote and error frames: in any chunks."""
    vehicle = car(
        tmp_path,
        'BO_ 300 A: 8 A\n SG_ X : 0|16@1- (0.01,0) [-300|300] "m/s2" A\n SG_ AliveCounter : 16|4@1+ (1,0) [0|15] "" A\n'
        '\nBO_ 301 B: 8 A\n SG_ Y : 7|8@0+ (1,0) [0|250] "m" A\n'
        ' SG_ R : 15|8@0- (0.1,0) [0|0] "m/s" A\n\nBO_ 302 C: 8 A\n SG_ Z : 0|8@1+ (1,0) [0|0] "m/s" A\n'
        '\nVAL_ 301 Y 255 "no target" 254 "error" ;\n',
        'accel = "A.X"\ngap = "B.Y"\nspeed = "C.Z"\nrange_rate = "B.R"',
    )
    for seed in range(6):
        rng = random.Random(seed)
        counter, frames = 0, []
        for k in range(500):
            counter += rng.random() < (0.1 if k % 100 < 60 else 1.0)
            flags = rng.choice((0, 0, 0, 0, 0, int(Flag.REMOTE), int(Flag.ERROR), int(Flag.EXTENDED)))
            data = rng.randbytes(2) + bytes([counter % 16]) + bytes(rng.choice((5, 5, 5, 0)))
            bus = rng.choice((0, 0, 0, 1, 1 + seed % 3))
            data = b"" if flags & Flag.REMOTE else data[: rng.choice((8, 8, 8, 2, 1, 0))]
            length = 0 if flags & Flag.REMOTE else -1
            frames.append(Frame(0.01 * k, bus, 300 + rng.randrange(4), data, flags, length))
        same_in_chunks(vehicle, frames, (13, 300, 1000))


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("log", "vehicle"),
    [("rav4/rav4_highway.blf", "toyota_rav4_2017"), ("openacc/human_h22_v5.blf", "openacc")],
)
def test_measured_logs(measured: Path, same_in_chunks, log: str, vehicle: str) -> None:  # type: ignore[no-untyped-def]
    """Real logs, radar tracks among them, in chunks of any size."""
    mapped = read_vehicle(vehicle)
    ids = {message.id for message in mapped.messages}
    frames = [frame for frame in open_log(measured / log) if frame.id in ids][:12_000]
    same_in_chunks(mapped, frames, (1000,))


@pytest.mark.slow("parses hostile files in children")
def test_signals_are_the_same_however_they_are_read(decode_all, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    """`read_signals` gives every reading of the log's frames, times and values, in order."""
    whole = open_log(Path(__file__).parents[2] / "replay_logs" / "following_lost_lead.blf")
    path = tmp_path / "part.blf"
    write_log(path, Window(30.0, 60.0).frames(whole), whole.start_utc)
    vehicle = read_vehicle("generic")
    expected: dict[str, list[tuple[float, float]]] = {}
    for reading in decode_all(vehicle, open_log(path))[1]:
        if isinstance(reading, Reading):
            expected.setdefault(reading.role, []).append((reading.t, reading.value))
    found = read_signals(path, vehicle)
    assert set(found) == set(expected)
    for role, signal in found.items():
        assert np.array_equal(np.array(expected[role]), np.array([signal.t, signal.value]).T, equal_nan=True)
