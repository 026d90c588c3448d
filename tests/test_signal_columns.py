"""Signals of a DBC in whole columns: what cantools decodes frame by frame, and what `read_signals` gives by role."""

from __future__ import annotations

import math
from pathlib import Path

import cantools
import numpy as np
import pytest

from canid.analysis.drive.drive_reader import read_signals
from canid.analysis.drive.signal_columns import MessageKey, by_message, decode, frames_by_message
from canid.io.logs import open_log, write_log
from canid.signals.dbc_text.parsing import Parser
from canid.signals.vehicle import read_vehicle
from canid.signals.vehicle.database import Dbc, load
from canid.values.frame_columns import columns_of
from canid.values.types import Flag, Frame
from canid.values.window import Window

ROOT = Path(__file__).parents[1]
# all kinds of signals: both byte orders, signs, floats, over byte borders, behind byte 8 (FD), two levels of multiplexing
TEXT = """VERSION ""

BU_: A

BO_ 100 PLAIN: 8 A
 SG_ intel : 3|13@1+ (0.5,-10) [0|0] "m" A
 SG_ intel_signed : 16|11@1- (0.25,1) [0|0] "" A
 SG_ motorola : 39|9@0+ (2,0) [0|0] "" A
 SG_ motorola_signed : 46|15@0- (0.1,3) [0|0] "" A
 SG_ whole : 56|8@1- (1,0) [0|0] "" A

BO_ 101 FLOATS: 8 A
 SG_ single : 0|32@1- (1,0) [0|0] "" A
 SG_ other : 39|32@0- (2,1) [0|0] "" A

BO_ 102 PAGES: 8 A
 SG_ page M : 0|4@1+ (1,0) [0|0] "" A
 SG_ first m0 : 8|16@1- (0.1,0) [0|0] "" A
 SG_ second m1 : 15|12@0+ (1,0) [0|0] "" A
 SG_ always : 56|8@1+ (1,0) [0|0] "" A

BO_ 103 LONG: 64 A
 SG_ near : 0|16@1+ (1,0) [0|0] "" A
 SG_ far : 100|33@1- (0.01,0) [0|0] "" A
 SG_ across : 395|20@0+ (1,0) [0|0] "" A
 SG_ end : 448|64@1+ (1,0) [0|0] "" A

BO_ 2147483752 EXTENDED: 3 A
 SG_ short : 0|24@1- (1,0) [0|0] "" A

SIG_VALTYPE_ 101 single : 1;
SIG_VALTYPE_ 101 other : 1;
"""


@pytest.fixture(scope="module")
def dbc(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("dbc") / "kinds.dbc"
    path.write_text(TEXT)
    return path


def read(path: Path) -> Dbc:
    with Parser() as parser:
        return load(path, None, parser)[0]


def test_every_kind_of_signal_is_cantools_own(dbc: Path, seed: int, tmp_path: Path) -> None:
    """Random frames, some too short, from a log: every value, or NaN where the frame ends before the signal."""
    rng = np.random.default_rng(seed)
    theirs = cantools.database.load_file(dbc)
    frames = []
    for k in range(400):
        message = theirs.messages[k % len(theirs.messages)]
        size = message.length if k % 7 else int(rng.choice([1, 2, 4, 7, message.length]))
        size = min(size, message.length)
        data = rng.bytes(size)
        if message.name == "PAGES":
            data = bytes([data[0] & 0xF0 | k // 5 % 3]) + data[1:]
        flags = (Flag.EXTENDED if message.is_extended_frame else 0) | (Flag.FD if message.length > 8 else 0)
        frames.append(Frame(0.01 * k, k % 2, message.frame_id, data, int(flags)))
    # neither of them is data, and the same id with 29 bits is another message
    frames += [Frame(5.0, 0, 100, b"", int(Flag.REMOTE), 8), Frame(5.1, 0, 100, bytes(8), int(Flag.EXTENDED))]
    write_log(tmp_path / "random.asc", frames, 1.7e9)
    found = frames_by_message(open_log(tmp_path / "random.asc"))
    compared = 0
    for message in read(dbc).messages.values():
        of = theirs.get_message_by_name(message.name)
        for signal in message.signals:
            single = signal.multiplexer is None
            for bus in (0, 1):
                column = decode(message, signal, found[MessageKey(bus, message.id, message.extended)])
                assert column is not None
                mine = dict(zip(column.t.round(6).tolist(), column.value.tolist(), strict=True))
                sent = [f for f in frames[:400] if (f.bus, f.id) == (bus, message.id)]
                for frame in sent:
                    page = frame.data[0] & 15
                    if not single and page not in signal.pages:
                        assert round(frame.t, 6) not in mine
                        continue
                    value = mine.pop(round(frame.t, 6))
                    last = {s.name: s for s in of.signals}[signal.name]
                    padded = frame.data + bytes(message.length - len(frame.data))
                    needed = max(bit // 8 for bit in bits(last)) + 1
                    if len(frame.data) < needed:
                        assert math.isnan(value)
                    elif message.name == "PAGES" and page > 1:
                        continue  # cantools refuses a page that it does not know
                    else:
                        expected = float(of.decode(padded, decode_choices=False)[signal.name])
                        assert value == pytest.approx(expected, rel=1e-12, nan_ok=True)
                        compared += 1
                assert not mine
    assert compared > 1000


def bits(signal: cantools.database.can.Signal) -> list[int]:
    """Numbers of all bits of a signal, byte by byte."""
    if signal.byte_order == "little_endian":
        return list(range(signal.start, signal.start + signal.length))
    out, at = [], signal.start
    for _ in range(signal.length):
        out.append(at)
        at = at - 1 if at % 8 else at + 15
    return out


def test_a_role_is_the_same_by_both_ways() -> None:
    """Columns of a DBC, converted and without entries of value tables, are `read_signals` to the last bit."""
    vehicle, path = read_vehicle("generic"), ROOT / "replay_logs/following_lost_lead.blf"
    roles, messages = read_signals(path, vehicle), read(ROOT / "dbc/generic.dbc").messages
    found = frames_by_message(open_log(path))
    for role, of in roles.items():
        how = vehicle.roles[role]
        message = messages[how.message]
        signal = next(s for s in message.signals if s.name == how.signal)
        column = decode(
            message, signal._replace(scale=1.0, offset=0.0), found[MessageKey(0, message.id, False)]
        )
        assert column is not None
        np.testing.assert_array_equal(column.t, of.t)
        known = np.isfinite(of.value)
        assert known.any()
        factor, offset = how.how.factor, how.how.offset
        if how.kind == "number":
            np.testing.assert_array_equal((column.value * factor + offset)[known], of.value[known])


def test_rounds_of_any_size_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """However a log is cut, the frames of each message are those of the whole, in order; parts too."""
    from canid.analysis.drive import signal_columns

    path = ROOT / "replay_logs/following_mixed.blf"
    whole = frames_by_message(open_log(path))
    monkeypatch.setattr(signal_columns, "FRAMES_PER_ROUND", 100)
    parts = frames_by_message(open_log(path), within=Window(10.0, 20.0), ids=[0x110, 0x130])
    assert [key.id for key in parts] == [0x110, 0x130]
    for key, part in parts.items():
        rows = (whole[key].t >= 10.0) & (whole[key].t <= 20.0)
        for mine, theirs in zip(part, whole[key], strict=True):
            np.testing.assert_array_equal(mine, theirs[rows])


def test_frames_of_both_widths_of_one_message() -> None:
    """Classic and FD frames of one id in one log are one message, 64 bytes wide."""
    chunks = [
        columns_of([Frame(0.0, 0, 1, b"abc")]),
        columns_of([Frame(0.1, 0, 1, bytes(range(20)), int(Flag.FD))]),
    ]
    frames = by_message(chunks)[MessageKey(0, 1, False)]
    assert frames.data.shape == (2, 64)
    assert (bytes(frames.data[0, :3]), frames.length.tolist()) == (b"abc", [3, 20])
