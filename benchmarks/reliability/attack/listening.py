"""Attacks on listen-only mode: configuration from anywhere asks for an active slcan adapter."""

from __future__ import annotations

import json
import math
import os
import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.reliability.attack.slcan_terminal import SlcanTerminal
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import ROOT

PROMISE = (
    "listen-only is read back, not asked for: no source of configuration makes canid send or open actively"
)
# what canid may write to an adapter, by first letter: close, bit rate, bit timing, data bit rate, listen
ALLOWED = (b"C", b"S", b"s", b"Y", b"L")
ACTIVE: tuple[dict[str, Any], ...] = (
    {"listen_only": False},
    {"listen_only": "no"},
    {"listen_only": "0"},
    {"listen_only": 0},
    {"listen_only": "off", "bitrate": 500000},
    {"listen_only": "False", "state": "ACTIVE"},
    {"state": "ACTIVE", "monitor": False, "receive_own_messages": True},
    {"btr": "031C\rO"},
    {"btr": "031C\rO\rt1230"},
    {"btr": "031C"},
    {"bitrate": 250000},
    {"sleep_after_open": 0.0, "listen_only": None},
    {"fd": True, "data_bitrate": 2000000, "listen_only": False},
    {"ttyBaudrate": 9600, "listen_only": "n"},
    {"poll_interval": 0.001, "listen_only": []},
    {},
)
FILES = ("can.conf", ".canrc", ".can", "can.conf in the home", "can.ini", "can.cfg")
ANSWERS: tuple[dict[bytes, bytes], ...] = (
    {b"": b"\r"},
    {b"": b"\r"},
    {},
    {b"L": b"\a", b"": b"\r"},
    {b"": b"\a"},
    {b"": b"z\r"},
    {b"L": b"\rO\r", b"": b"\r"},
)
NOISE = (b"", b"", b"t1\xff\xfe2\r", b"\a\r\x00", b"T1\r", b"O\r", b"t7FF8")


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One adapter, with one to three sources that ask for the contrary."""
    home, here = folder / "home", folder / "here"
    home.mkdir()
    here.mkdir()
    answers = rng.choice(ANSWERS)
    adapter = SlcanTerminal(answers, rng.choice(NOISE), rng.random() < 0.3)
    verb = rng.choice(("record", "record", "live", "check"))
    words = [verb, "--duration", "0.6"]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("CAN_")}
    environment |= {"HOME": str(home), "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    named: dict[str, Any] = {"interface": "slcan", "channel": adapter.channel}
    sources = rng.sample(("command line", "CAN_CONFIG", "file", "environment"), rng.randrange(1, 4))
    # check listens to a bus that the command line names
    if verb == "check" or "command line" in sources or rng.random() < 0.5:
        words += ["-i", "slcan", "-c", adapter.channel]
    else:
        environment |= {"CAN_INTERFACE": "slcan", "CAN_CHANNEL": adapter.channel}
    drawn: list[str] = []
    for source in sources:
        asked = rng.choice(ACTIVE)
        drawn.append(f"{source}: {asked}")
        if source == "command line":
            words += ["--bus-kwargs", *(f"{k}={v}" for k, v in asked.items())] if asked else []
        elif source == "CAN_CONFIG":
            environment["CAN_CONFIG"] = json.dumps(asked | (named if rng.random() < 0.3 else {}))
        elif source == "environment":
            environment["CAN_BITRATE"] = rng.choice(("500000", "250000", "0", "x", "1\rO"))
        else:
            name = rng.choice(FILES)
            text = "[default]\n" + "".join(f"{k} = {str(v)!s}\n" for k, v in asked.items()).replace("\r", " ")
            place = home / "can.conf" if "home" in name else (home if name.startswith(".") else here) / name
            place.write_text(text)
    if verb == "record":
        words += ["-o", "drive.blf"]
    elif verb == "live":
        words += ["--vehicle", "generic", "--record", "drive.blf"]
    try:
        done = subprocess.run(
            [sys.executable, "-m", "canid", *words],
            cwd=here,
            env=environment,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=120,
            check=False,
        )
        commands = adapter.commands
        state = adapter.open
    finally:
        adapter.close()
    wrong = _judged(commands, state, done, answers, here)
    about = f" ({verb}, {drawn}, answers {answers})" if wrong else ""
    yield Outcome(
        "slcan on a pseudo-terminal; --bus-kwargs, can.conf, ~/.canrc, CAN_CONFIG, CAN_* ask for the contrary",
        math.nan,
        0,
        "; ".join(wrong) + about,
    )


def _judged(
    commands: list[bytes],
    state: str,
    done: subprocess.CompletedProcess[str],
    answers: dict[bytes, bytes],
    here: Path,
) -> list[str]:
    wrong = [f"it was sent {each!r}" for each in commands if each[:1] not in ALLOWED]
    wrong += [f"it was sent {each!r}" for each in commands if each[:1] in (b"C", b"L") and len(each) > 1]
    said = done.stdout + done.stderr
    if "Traceback" in said or done.returncode not in (0, 1, 2, 3, 5):
        wrong.append(f"exit code {done.returncode}: {said[-300:]}")
    opened = b"L" in commands
    confirmed = "opened with L, never with O" in said
    if done.returncode in (2, 3) and not opened:
        return wrong
    if not opened:
        wrong.append(f"nothing opened it: {commands}, {said[-300:]}")
    refused = answers.get(b"L", answers.get(b"", b"")) == b"\a"
    if confirmed and refused:
        wrong.append("the adapter refused L, and canid says that it listens only")
    if "record" in done.args or "live" in done.args:
        journal = here / "drive.events.jsonl"
        reported = journal.read_text() if journal.exists() else ""
        if done.returncode in (0, 5) and ("listen_only" not in reported):
            wrong.append(f"the journal does not say it: {reported[-300:]}")
        if refused and done.returncode in (0, 5) and "could not be verified" not in said + reported:
            wrong.append(f"it is not said that it could not be verified: {said[-300:]}")
    if state == "O":
        wrong.append("it was left active")
    return wrong
