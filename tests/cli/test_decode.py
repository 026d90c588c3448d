"""`canid decode`: every frame of every message, its values those of cantools, from a log and from a bus."""

from __future__ import annotations

import csv
import io
import json
import random
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import cantools
import pytest

from canid.values.errors import DAMAGED, DONE, NO_BUS, USAGE

Canid = Callable[..., Any]
ROOT = Path(__file__).parents[2]
DBC = ROOT / "dbc" / "generic.dbc"


def drawn(rng: random.Random, n: int) -> list[can.Message]:
    """Frames of the file's messages and of others, with random bytes, not in the order of time."""
    messages = cantools.database.load_file(DBC).messages
    made = []
    for k in range(n):
        of = rng.choice(messages)
        unknown = rng.random() < 0.1
        data = bytearray(rng.randbytes(of.length))
        if of.is_multiplexed():
            data[0] = rng.randrange(3)  # pages that the file has; cantools refuses others
        made.append(
            can.Message(
                timestamp=1.7e9 + 0.01 * k + rng.uniform(-0.02, 0.02),
                arbitration_id=0x7E0 if unknown else of.frame_id,
                is_extended_id=of.is_extended_frame and not unknown,
                data=data,
            )
        )
    return made


def expected(messages: list[can.Message]) -> list[tuple[str, dict[str, float]]]:
    database = cantools.database.load_file(DBC)
    known = {of.frame_id: of for of in database.messages}
    return [
        (known[m.arbitration_id].name, known[m.arbitration_id].decode(m.data, decode_choices=False))
        for m in messages
        if m.arbitration_id in known
    ]


def rows(text: str) -> list[tuple[str, dict[str, float]]]:
    """Rows of CSV, frame by frame: one begins where a signal comes again, or another message."""
    found: list[tuple[str, dict[str, float]]] = []
    before = None
    for row in csv.DictReader(io.StringIO(text)):
        frame = (row["t"], row["message"])
        if frame != before or row["signal"] in found[-1][1]:
            found.append((row["message"], {}))
        before = frame
        found[-1][1][row["signal"]] = float(row["value"])
    return found


@pytest.mark.parametrize("suffix", [".blf", ".log"])
def test_a_log_decodes_as_cantools_does(suffix: str, canid: Canid, tmp_path: Path, seed: int) -> None:
    messages = drawn(random.Random(seed), 300)
    with can.Logger(tmp_path / f"x{suffix}") as log:
        for message in messages:
            log(message)
    ran = canid("decode", tmp_path / f"x{suffix}", "--dbc", DBC, "--csv")
    assert ran.code == DONE
    found, wanted = rows(ran.out), expected(messages)
    assert [name for name, _ in found] == [name for name, _ in wanted]
    for (_, ours), (_, theirs) in zip(found, wanted, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-9)
    left = len(messages) - len(wanted)
    assert f"{len(wanted):,} frames decoded; {left:,} frames of 1 ids are in none" in ran.err
    written = tmp_path / "x.jsonl"
    assert canid("decode", tmp_path / f"x{suffix}", "--dbc", DBC, "--json", written).code == DONE
    frames = [json.loads(line) for line in written.read_text().splitlines()]
    assert [one["message"] for one in frames] == [name for name, _ in found]
    for one, (_, values) in zip(frames, found, strict=True):
        assert {signal["name"]: signal["value"] for signal in one["signals"]} == pytest.approx(
            values, rel=1e-9
        )
    # as lines: one for each frame
    assert len(canid("decode", tmp_path / f"x{suffix}", "--dbc", DBC).out.splitlines()) == len(wanted)


def test_a_bus_is_decoded_as_it_comes(canid: Canid, tmp_path: Path, seed: int) -> None:
    messages = drawn(random.Random(seed), 40)

    def talk() -> None:
        with can.Bus(str(tmp_path), "virtual") as bus:
            for message in messages:
                bus.send(message)

    timer = threading.Timer(0.5, talk)
    timer.start()
    ran = canid("decode", "--dbc", DBC, "--csv", "-i", "virtual", "-c", tmp_path, "--duration", 1.5)
    timer.join()
    assert ran.code == DONE
    assert [name for name, _ in rows(ran.out)] == [name for name, _ in expected(messages)]
    assert canid("decode", "--dbc", DBC, "-i", "virtual", "-c", tmp_path, "--duration", 0.2).code == NO_BUS


def test_what_is_missing_is_said(canid: Canid, tmp_path: Path) -> None:
    ran = canid("decode", "x.blf")
    assert (ran.code, "--dbc" in ran.err) == (USAGE, True)
    ran = canid("decode", "--dbc", DBC)
    assert (ran.code, "name a log, or a bus" in ran.err) == (USAGE, True)
    (tmp_path / "x.log").write_text("(1.0) can0 110#0011223344556677\n(1.1) can0 110#00zz\n")
    assert canid("decode", tmp_path / "x.log", "--dbc", DBC).code == DAMAGED


@pytest.mark.parametrize("shape", [(), ("--csv",), ("--table",)])
def test_files_of_another_bus_are_an_error_with_what_to_do(canid: Canid, shape: tuple[str, ...]) -> None:
    """Nothing could be decoded: not the success that an empty table looks like to a script."""
    log = ROOT / "replay_logs" / "following_urban.blf"
    ran = canid("decode", log, "--dbc", ROOT / "dbc" / "toyota_rav4_2017_radar.dbc", "--stop", 2, *shape)
    assert ran.code == USAGE
    assert "0 frames decoded" in ran.err
    assert "give --dbc those of this bus; `canid look` lists what came" in ran.err
    assert canid("decode", log, "--dbc", DBC, "--stop", 2, *shape).code == DONE
