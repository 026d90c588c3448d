"""`canid decode --table`: the last values are those of the last frames, of a log, of a part, and live on a terminal."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canid.ui.cli.signals.live_table import table
from canid.values.errors import DONE, USAGE
from canid.values.signal_table import Row

Canid = Callable[..., Any]
ROOT = Path(__file__).parents[2]
LOG, DBC = ROOT / "replay_logs/following_lost_lead.blf", ROOT / "dbc/generic.dbc"


def rows(text: str) -> dict[str, tuple[str, str]]:
    found = (re.fullmatch(r"(\S+)\s+(.*?)\s{2,}(.*)", line) for line in text.splitlines())
    return {one[1]: (one[2], one[3]) for one in found if one}


def test_the_table_of_a_part_of_a_log_has_the_last_values_before_its_end(canid: Canid) -> None:
    words = ("decode", LOG, "--dbc", DBC, "--signals", "EGO_SPEED", "--start", 55, "--stop", 60)
    shown = rows(canid(*words, "--table").out)
    last: dict[str, str] = {}
    for line in canid(*words).out.splitlines():
        for part in line.split("EGO_SPEED", 1)[1].split(", "):
            name, value = part.split(maxsplit=1)
            last[f"EGO_SPEED.{name}"] = value
    assert {name: value for name, (value, _) in shown.items()} == last
    rates = {float(rate.removesuffix(" 1/s")) for _, rate in shown.values()}
    assert all(45.0 < rate < 55.0 for rate in rates)


def test_the_table_fits_the_terminal_and_says_what_it_leaves_out() -> None:
    many = [
        Row(k % 2, f"MESSAGE_{k}.SIGNAL_WITH_A_NAME_OF_SOME_LENGTH", f"{k} m", 10.0, 0.0) for k in range(300)
    ]
    for columns, height in ((60, 20), (80, 24), (200, 60), (40, 10)):
        lines = table(many, columns, height)
        assert len(lines) == height
        assert max(map(len, lines)) <= columns
        assert "more: --signals, --id, --bus" in lines[-1]
    assert len(table(many, 200)) == 100


def test_what_a_narrow_table_cuts_shows_that_it_is_cut() -> None:
    """Two signals of a message differ at the end of their names, and no number loses digits in silence."""
    names = ["ENGINE_DATA.PedalPosition", "ENGINE_DATA.EngineSpeed"]
    for columns in (30, 40, 50):
        lines = table([Row(0, name, "-1600.512345678 rpm", 50.0, 0.0) for name in names], columns)
        assert [line.split()[0][-5:] for line in lines] == ["ition", "Speed"]
        for line, name in zip(lines, names, strict=True):
            assert len(line) == columns
            assert name in line or line.startswith("…")
            assert "-1600.512345678 rpm" in line or line.split()[1][-1] == "…" or line.split()[2][-1] == "…"


def test_table_excludes_the_other_forms(canid: Canid) -> None:
    assert canid("decode", LOG, "--dbc", DBC, "--table", "--csv").code == USAGE


@pytest.mark.slow("a bus in real time")
def test_the_table_of_a_bus_is_redrawn_until_q_and_the_terminal_is_restored() -> None:
    """Frames are sent over python-can's multicast; the numbers on the screen change."""
    parent, child = pty.openpty()
    sender = (
        "import can, time\n"
        "bus = can.Bus('239.74.163.7', interface='udp_multicast', port=43217)\n"
        "for k in range(4000):\n"
        "    bus.send(can.Message(arbitration_id=0x110, is_extended_id=False, data=[k % 100, 0, 0, 0]))\n"
        "    time.sleep(0.01)\n"
    )
    env = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "TERM": "xterm"}
    talks = subprocess.Popen([sys.executable, "-c", sender], env=env, stderr=subprocess.DEVNULL)
    words = ["decode", "--dbc", str(DBC), "-i", "udp_multicast", "-c", "239.74.163.7", "--table"]
    words += ["--bus-kwargs", "port=43217"]
    shows = subprocess.Popen(
        [sys.executable, "-m", "canid", *words], stdin=child, stdout=child, stderr=child, env=env
    )
    os.close(child)
    seen, end = "", time.monotonic() + 60.0
    try:
        while time.monotonic() < end and len(set(re.findall(r"PedalPosition +(\S+) %", seen))) < 3:
            if select.select([parent], [], [], 0.5)[0]:
                seen += os.read(parent, 65536).decode("utf-8", "replace")
            assert shows.poll() is None, seen
        assert "\x1b[?1049h" in seen
        os.write(parent, b"q")
        while time.monotonic() < end:
            try:
                part = os.read(parent, 65536)
            except OSError:  # it has ended
                break
            if not part:
                break
            seen += part.decode("utf-8", "replace")
        assert shows.wait(30) == DONE
        assert "\x1b[?1049l" in seen
        assert "PedalPosition" in seen.split("\x1b[?1049l")[-1]
    finally:
        talks.kill()
        talks.wait()
        shows.kill()
        shows.wait()
        os.close(parent)
