"""`canid look`: what a log contains, before there is any vehicle file."""

from __future__ import annotations

import gzip
import json
import re
import shlex
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.analysis.contents import course, survey
from canid.analysis.contents.log_survey import Wanted
from canid.analysis.contents.protection import crc_table, fields
from canid.analysis.drive.signal_columns import frames_by_message
from canid.io.logs import open_log, write_log
from canid.values.errors import DAMAGED, DONE, USAGE
from canid.values.types import Flag, Frame
from tests.seeds import mostly

Canid = Callable[..., Any]
ROOT = Path(__file__).parents[2]
URBAN, RADAR = ROOT / "replay_logs/following_urban.blf", ROOT / "replay_logs/toyota_rav4_2017_simulated.blf"
GENERIC, TOYOTA = ROOT / "dbc/generic.dbc", ROOT / "dbc/toyota_rav4_2017.dbc"
TOYOTA_RADAR = ROOT / "dbc/toyota_rav4_2017_radar.dbc"
UTC = 1.7e9


def values(canid: Canid, *words: object) -> dict[str, Any]:
    ran = canid("look", *words, "--json", "-")
    assert ran.code in (DONE, DAMAGED), ran.err
    found: dict[str, Any] = json.loads(ran.out)
    return found


def test_rows_are_what_a_count_by_hand_gives(canid: Canid) -> None:
    """Frames, rates, lengths, changes and changed bits of each id, next to a count frame by frame."""
    found = values(canid, URBAN)
    log = open_log(URBAN)
    frames = list(log)
    assert (found["frames"], found["start_utc"]) == (len(frames), log.start_utc)
    assert found["duration"] == pytest.approx(max(f.t for f in frames))
    assert {(m["bus"], m["id"]) for m in found["messages"]} == {(f.bus, f.id) for f in frames}
    for row in found["messages"]:
        of = [f for f in frames if f.id == row["id"]]
        assert row["frames"] == len(of)
        assert row["rate"] == pytest.approx((len(of) - 1) / (of[-1].t - of[0].t))
        assert row["jitter"] == pytest.approx(np.std(np.diff([f.t for f in of])), rel=1e-6)
        assert row["changes"] == sum(a.data != b.data for a, b in pairwise(of))
        data = np.array([list(f.data) for f in of], np.uint8)
        assert row["changed_bits"] == np.bitwise_or.reduce(data ^ data[0]).tobytes().hex()
        assert row["bytes"] == [data.shape[1]] * 2


def test_signals_are_the_log_s_own(canid: Canid) -> None:
    """Ends, last value, changes and course of a signal; "no target" is no value, a gear is a text."""
    found = values(canid, ROOT / "replay_logs/following_lost_lead.blf", "--dbc", GENERIC)
    signals = {f"{s['message']}.{s['signal']}": s for s in found["signals"]}
    frames = [f for f in open_log(ROOT / "replay_logs/following_lost_lead.blf") if f.id == 0x130]
    raw = np.array([int.from_bytes(f.data, "little") & 0x1FFF for f in frames])
    gap = signals["RADAR_LEAD.LeadDistance"]
    metres = 0.05 * raw[raw != 8191]
    assert (gap["low"], gap["high"]) == pytest.approx((metres.min(), metres.max()))
    assert gap["mean"] == pytest.approx(metres.mean())
    assert gap["entries"] == {"no target": int((raw == 8191).sum())}
    assert gap["no_values"] == gap["entries"]["no target"] > 200
    assert gap["changes"] == (np.diff(raw) != 0).sum()
    assert not gap["is_state"]
    # the longer loss of the lead, 130 to 142 s of 180 s, is a hole in the course
    at = (np.arange(len(gap["course"])) + 0.5) / len(gap["course"]) * 180.0
    assert all(x is None for x, t in zip(gap["course"], at, strict=True) if 133.0 < t < 139.0)
    assert sum(x is None for x in gap["course"]) < 0.12 * len(at)
    assert signals["ENGINE_DATA.Gear"]["is_state"]
    assert signals["ENGINE_DATA.Gear"]["last_text"] in {"1st", "2nd", "3rd", "4th", "5th"}
    assert signals["ENGINE_DATA.EngineCounter"]["protects"] == "counter"


def test_files_find_their_buses(canid: Canid) -> None:
    """Two DBC files on the two buses whose ids they have; @ binds one to another bus, where nothing is found."""
    found = values(canid, RADAR, "--dbc", TOYOTA_RADAR, TOYOTA)
    assert [(one["buses"], one["found"], one["bound"]) for one in found["dbc"]] == [
        ([1], 16, False),
        ([0], 7, False),
    ]
    ran = canid("look", RADAR, "--dbc", f"{TOYOTA}@1", "--json", "-")
    assert json.loads(ran.out)["dbc"][0] | {"file": ""} == {
        "file": "", "buses": [1], "bound": True, "messages": 7, "found": 0,
    }  # fmt: skip
    assert "none of its messages came" in ran.err


def test_how_a_log_was_read_stands_in_the_json_too(canid: Canid, tmp_path: Path) -> None:
    """What the text says of a file in which decimal and hexadecimal numbers stand."""
    fd = "   0.300000 CANFD   1 Rx  102  1 0 8  8 0a 0b 0c 0d 0e 0f 10 11   100000  132 3000 0 0 0 0 0\n"
    (tmp_path / "x.asc").write_text("base dec  timestamps absolute\n   0.1 1  256  Rx   d 2 10 11\n" + fd)
    ran = canid("look", tmp_path / "x.asc", "--json", "-")
    remarks = json.loads(ran.out)["remarks"]
    assert remarks
    assert all(remark in ran.err for remark in remarks)


@mostly(0.95)
def test_counters_and_checksums_show_themselves(seed: int) -> None:
    """Planted ones are found with any constant in them, at either end; random bytes and quantities are none."""
    rng = np.random.default_rng(seed)
    n = 200
    noise = rng.integers(0, 256, (n, 5)).astype(np.uint8)
    counter = ((np.arange(n) + rng.integers(16)) % 16 | 0x50).astype(np.uint8)
    body = np.column_stack([noise, counter])
    constant = np.uint8(rng.integers(256))
    crc = np.full(n, constant)
    for column in body.T:
        crc = crc_table(0x1D)[crc ^ column]
    checks = {
        "sum of the other bytes": body.sum(axis=1, dtype=np.uint8) + constant,
        "XOR of the other bytes": np.bitwise_xor.reduce(body, axis=1) ^ constant,
        "CRC-8, polynomial 0x1D": crc,
    }
    for says, check in checks.items():
        for front in (True, False):
            data = np.column_stack([check, body] if front else [body, check])
            at = 0 if front else 6
            found = [(one.kind, one.start, one.length) for one in fields(data)]
            assert found == [("counter", 8 * (5 + front), 4), ("checksum", 8 * at, 8)], says
            assert fields(data)[-1].says == says
    walk = np.cumsum(rng.integers(-2, 3, n))
    assert fields(np.column_stack([noise, walk.astype(np.uint8)])) == ()
    assert fields(body[:20]) == ()


def test_text_fits_its_width_and_is_bounded(
    canid: Canid, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """No line is wider than asked for, rows are limited, --all gives them; the next command ends it."""
    frames = [Frame(0.001 * k, k % 3, 0x100 + k % 300, bytes([k % 256] * 8)) for k in range(3000)]
    write_log(tmp_path / "many.log", frames, UTC)
    ran = canid("look", tmp_path / "many.log", "--sort", "changes")
    assert max(map(len, ran.out.splitlines()[3:-2])) <= 100
    assert "… 252 more (--all)" in ran.out
    assert ran.out.rstrip().endswith(f"next: canid look {tmp_path / 'many.log'} --dbc FILE.dbc")
    assert canid("look", tmp_path / "many.log", "--all").out.count("0x") == 300
    ran = canid("look", URBAN, "--dbc", GENERIC)
    assert ran.out.rstrip().endswith(
        f"next: canid init {shlex.quote(str(GENERIC))} --log {shlex.quote(str(URBAN))}"
    )
    for columns in (60, 80, 200):
        monkeypatch.setattr("canid.ui.cli.commands.look.width", lambda columns=columns: columns)
        rows = canid("look", URBAN, "--dbc", GENERIC).out.splitlines()[4:-2]
        assert max(len(row) for row in rows if not row.startswith(("bits of", "…"))) <= columns
        assert columns < 80 or sum(bool(re.search("[▁-█]", row)) for row in rows) > 20


def test_filters(canid: Canid) -> None:
    """--bus, --id, --signals, --start and --stop leave out what they say; the head counts the whole part."""
    found = values(canid, RADAR, "--bus", 1, "--id", "0x210", 529, "--start", 10, "--stop", 20)
    assert [(m["bus"], m["id"]) for m in found["messages"]] == [(1, 0x210), (1, 0x211)]
    assert all(10.0 <= m["first"] < m["last"] <= 20.0 for m in found["messages"])
    assert {bus["bus"] for bus in found["buses"]} == {0, 1}
    found = values(canid, URBAN, "--dbc", GENERIC, "--signals", "*.vehicle*")
    assert [s["signal"] for s in found["signals"]] == ["VehicleSpeed"]
    assert [m["name"] for m in found["messages"]] == ["EGO_SPEED"]
    assert ", 7 ids\n" in canid("look", URBAN, "--id", 0x120).out
    assert canid("look", URBAN, "--signals", "x").code == USAGE
    assert "no frames between 900" in canid("look", URBAN, "--start", 900).line
    assert "no frame has such" in canid("look", URBAN, "--id", 1).err


def test_hostile_names_and_logs_are_data(canid: Canid, tmp_path: Path) -> None:
    """Control characters of DBC texts reach no terminal; huge and odd numbers, FD, errors, one frame, damage: an answer."""
    text = GENERIC.read_text().replace('"%"', '"\x1b[2J%"').replace('"no target"', '"\x1b]0;x\x07"')
    text = text.replace("(0.4,0) [0|100]", "(1e308,-1e308) [0|0]").replace("(0.01,0) [0|300]", "(0,7) [0|0]")
    (tmp_path / "bad\x1b[31m.dbc").write_text(text)
    ran = canid("look", URBAN, "--dbc", tmp_path / "bad\x1b[31m.dbc", "--all")
    assert ran.code == DONE, ran.err
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f]", ran.out + ran.err)
    assert "\\x1b" in ran.out
    frames = [
        Frame(0.0, 65534, 0x1FFFFFFF, b"", int(Flag.EXTENDED)),
        Frame(0.5, 3, 5, bytes(range(64)), int(Flag.FD)),
        Frame(0.6, 3, 5, bytes(64), int(Flag.FD)),
        Frame(0.7, 3, 0, b"", int(Flag.ERROR)),
        Frame(0.8, 3, 6, b"", int(Flag.REMOTE), 8),
    ]
    write_log(tmp_path / "odd.blf", frames, UTC)
    found = values(canid, tmp_path / "odd.blf")
    assert [(b["bus"], b["errors"], b["remote"], b["fd"]) for b in found["buses"]] == [
        (3, 1, 1, 2),
        (65534, 0, 0, 0),
    ]
    assert len(canid("look", tmp_path / "odd.blf").out.splitlines()) < 12
    cut = tmp_path / "cut.log.gz"
    lines = "".join(f"({k}.0) can0 10{k % 9}#0{k % 9}\n" for k in range(500))
    cut.write_bytes(gzip.compress(lines.encode())[:-20])
    assert canid("look", cut).code == DAMAGED
    (tmp_path / "none.asc").write_text("date Mon Jan 1 00:00:00 2024\nbase hex timestamps absolute\n")
    assert "Traceback" not in canid("look", tmp_path / "none.asc").err


def test_a_log_in_many_rounds_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory is bounded by reading in rounds; however they are cut, the numbers are those of one, and so are the means."""
    from canid.analysis.contents import log_survey as module
    from canid.analysis.contents.binding import DbcFile
    from canid.analysis.drive import signal_columns
    from canid.signals.dbc_text.parsing import Parser
    from canid.signals.vehicle.database import load

    with Parser() as parser:
        files = [DbcFile("g", None, tuple(load(GENERIC, None, parser)[0].messages.values()))]
    log = ROOT / "replay_logs/following_lost_lead.blf"
    one = survey(open_log(log), files)
    monkeypatch.setattr(signal_columns, "FRAMES_PER_ROUND", 500)
    many = survey(open_log(log), files)
    assert many.buses == one.buses
    for a, b in zip(one.messages, many.messages, strict=True):
        assert a._replace(changed=b.changed, jitter=b.jitter, rate=b.rate) == b
        assert (a.rate, a.jitter) == pytest.approx((b.rate, b.jitter))
        np.testing.assert_array_equal(a.changed, b.changed)
    for a, b in zip(one.signals, many.signals, strict=True):
        assert a._replace(course=b.course, mean=b.mean) == b
        assert a.mean == pytest.approx(b.mean, nan_ok=True)
        np.testing.assert_allclose(a.course, b.course)
    # the course is the mean of what a bucket holds, at the step that the length asks for
    step = course.FIRST_SPAN_S / course.BUCKETS * 2 ** course.doublings(course.grid(0.0), 180.0)
    frames = next(of for key, of in frames_by_message(open_log(log)).items() if key.id == 0x120)
    speed = 0.01 * frames.data[:, :2].astype(float) @ [256, 1]
    index = (frames.t / step).astype(int)
    expected = np.bincount(index, speed) / np.bincount(index)
    found = next(s for s in one.signals if s.signal == "VehicleSpeed")
    np.testing.assert_allclose(found.course[: expected.size], expected)
    # more ids than are kept are counted
    monkeypatch.setattr(module, "MAX_IDS", 3)
    left = survey(open_log(log), (), Wanted())
    assert len(left.messages) == 3
    assert left.frames_left_out == one.frames - sum(m.frames for m in left.messages)


def test_j1939_matches_by_group(canid: Canid, tmp_path: Path) -> None:
    """Frames of another source and priority are the message; numbers for "error" and "not available" are no speeds."""
    (tmp_path / "truck.dbc").write_text(
        'VERSION ""\n\nBU_: A\n\nBO_ 2566844926 CCVS: 8 A\n SG_ Speed : 8|16@1+ (0.00390625,0) [0|250] "km/h" A\n\n'
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
        'BA_DEF_DEF_ "VFrameFormat" "J1939PG";\nBA_ "VFrameFormat" BO_ 2566844926 3;\n'
        'BA_DEF_ "ProtocolType" STRING ;\nBA_DEF_DEF_ "ProtocolType" "J1939";\nBA_ "ProtocolType" "J1939";\n'
    )
    raws = [20 * 256, 30 * 256, 0xFE00, 0xFFFF]
    frames = [
        Frame(0.1 * k, 0, 0x0CFEF117, b"\xff" + raw.to_bytes(2, "little") + bytes(5), int(Flag.EXTENDED))
        for k, raw in enumerate(raws)
    ]
    write_log(tmp_path / "truck.blf", frames, UTC)
    found = values(canid, tmp_path / "truck.blf", "--dbc", tmp_path / "truck.dbc")
    (speed,) = found["signals"]
    assert (speed["message"], speed["id"], speed["low"], speed["high"]) == ("CCVS", 0x0CFEF117, 20.0, 30.0)
    assert (speed["readings"], speed["no_values"], speed["last"]) == (4, 2, 30.0)


LONG = """VERSION ""
BO_ 256 M: 8 A
 SG_ S : 0|64@1+ (1,{}) [0|0] "" B
VAL_ 256 S 18446744073709551615 "SNA" ;
"""


@pytest.mark.parametrize("offset", [0, -(1 << 60)])
def test_raw_numbers_of_64_bits_are_counted_exactly(offset: int, canid: Canid, tmp_path: Path) -> None:
    """Numbers that are one double are changes; an entry of the table is that number and not its neighbour."""
    raws = [(1 << 60) + k for k in range(10)] + [(1 << 64) - 2, (1 << 64) - 1, (1 << 64) - 1]
    write_log(
        tmp_path / "x.blf",
        [Frame(k * 0.1, 0, 256, raw.to_bytes(8, "little")) for k, raw in enumerate(raws)],
        UTC,
    )
    (tmp_path / "x.dbc").write_text(LONG.format(offset))
    (row,) = values(canid, tmp_path / "x.blf", "--dbc", tmp_path / "x.dbc")["signals"]
    assert (row["readings"], row["changes"], row["no_values"]) == (13, 11, 2)
    assert (row["low"], row["last_text"]) == ((1 << 60) + offset, "SNA")
    assert row["high"] == float((1 << 64) - 2 + offset)
    lines = canid("decode", tmp_path / "x.blf", "--dbc", tmp_path / "x.dbc").out.splitlines()
    assert sum("SNA" in line for line in lines) == 2
