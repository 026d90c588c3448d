"""Frames that the kernel drops since they are not read in time are counted exactly, to the last one."""

from __future__ import annotations

import json
import re
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.bus.network import events, numbers, queued, says, shown

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(900)]
TOTAL = 1_000_000
# the whole command, with a receive buffer that some hundred frames fill instead of 77,000
SMALL = (
    "import sys; from canid.io.buses.receivers import socketcan; socketcan.RECEIVE_BUFFER_BYTES = 100_000; "
    "from canid.ui.cli import main; sys.exit(main())"
)


# of a sender with real-time priority the kernel drops nearly all frames before they reach a socket: in the processor's
# queue, which a thread of lower priority empties (Linux 6.1)
REAL_TIME = ("chrt", "--fifo", "50")


@pytest.mark.parametrize(("verb", "priority"), [("record", ()), ("live", ()), ("record", REAL_TIME)])
def test_received_and_dropped_are_all_that_were_sent(
    verb: str,
    priority: tuple[str, ...],
    tmp_path: Path,
    start: Callable[..., Any],
    until: Callable[..., None],
) -> None:
    """1,000,000 frames at full speed: recorded + dropped = sent, also for drops that no socket counts or after the last."""
    recording, reported = tmp_path / "heard.blf", tmp_path / "reported.json"
    into = ("-o", recording) if verb == "record" else ("--vehicle", "generic", "--record", recording)
    words = (verb, "-i", "socketcan", "-c", "vcan0", *into, "--json", reported)
    program = start(sys.executable, "-c", SMALL, *words)
    program.wait_for("listen-only")
    time.sleep(1.0 if verb == "live" else 0.0)  # both estimators have begun
    before = shown("vcan0")["stats64"]["tx"]["packets"]
    began = time.monotonic()
    sender = start(*priority, sys.executable, "-m", "tests.bus.sendmmsg", "vcan0", TOTAL)
    assert sender.end() == 0, sender.says()
    took = time.monotonic() - began
    # what waits there when the recorder ends has neither come nor been dropped
    until(lambda: not queued())
    assert program.end(signal.SIGTERM) == 143, program.says()
    # the device counts for itself what went through it
    assert shown("vcan0")["stats64"]["tx"]["packets"] - before == TOTAL
    kept = numbers(recording)
    assert kept == sorted(set(kept))
    received, drops = (
        number(pattern, program.printed())
        for pattern in (r"vcan0: open +([\d,]+) frames", r"  ([\d,]+) dropped")
    )
    print(
        f"{TOTAL:,} in {took:.1f} s: {len(kept):,} recorded, {drops:,} dropped; the last one is {kept[-1]:,}"
    )
    assert 0 < len(kept) < TOTAL
    assert received == len(kept)
    assert len(kept) + drops == TOTAL
    if verb == "record":
        bus = json.loads(reported.read_text())["buses"][0]
        assert (bus["frames"], bus["drops"]) == (received, drops)
    assert events(recording, "frames_dropped")
    parts = [
        re.search(r": ([\d,]+) frames .*\(([\d,]+) in all\)", text)
        for text in says(recording, "frames_dropped")
    ]
    each = [int(found[1].replace(",", "")) for found in parts if found]
    assert len(each) == len(parts)
    assert sum(each) == drops


def number(pattern: str, text: str) -> int:
    """The last number in this place of a text."""
    return int(re.findall(pattern, text)[-1].replace(",", ""))
