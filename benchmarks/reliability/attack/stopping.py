"""Attacks on the end: a sender that goes on at 20,000 frames/s while the recording is asked to stop."""

from __future__ import annotations

import random
import signal
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.attack import judging
from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording

PROMISE = "stopping is quick: what came before the stop is on the disk, and the end follows within 2 s"
MAX_STOP_S = 2.0  # s
RATE = 20_000.0  # frames/s


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One stop by a signal or --duration."""
    suffix, verb = rng.choice((".blf", ".asc", ".log")), rng.choice(("record", "record", "live"))
    end = rng.choice(("SIGTERM", "SIGINT", "SIGHUP", "twice"))
    path = folder / f"x{suffix}"
    words = ("--vehicle", "generic") if verb == "live" else ()
    sender = Sender(folder, RATE)
    with Recording(path, *words, verb=verb, talk=folder, bus=sender.words) as recording, sender:
        since = time.time()
        sender.wait(rng.uniform(0.3, 1.2))
        till = time.time()
        number = signal.SIGTERM if end == "twice" else signal.Signals[end]
        recording.process.send_signal(number)
        if end == "twice":
            time.sleep(rng.uniform(0.0, 0.3))
        code = recording.end(number if end == "twice" and recording.process.poll() is None else None)
        took = time.time() - till
        sender.end()
        reported = recording.reported() if verb == "record" and end != "twice" else None
    wrong = []
    # a second signal ends the process at once; after its handlers are gone the system does
    if code != 128 + number and not (end == "twice" and code == -number):
        wrong.append(f"exit code {code}: {recording.said[-300:]}")
    if took > MAX_STOP_S * judging.busy():
        wrong.append(f"it ended after {took:.1f} s")
    found = judging.read([path])
    if reported is not None and reported["drops"]:  # counted, and stated
        if len(found.numbers) + reported["drops"] < sender.before(till):
            wrong.append(f"{len(found.numbers)} + {reported['drops']} dropped of {sender.before(till)}")
    elif end != "twice":
        wrong += judging.missing(found, sender, since, till)
    elif found.numbers != list(range(len(found.numbers))):
        wrong.append("it is not contiguous")
    about = f" ({verb} {suffix}, {end}, {sender.before(till)} frames)" if wrong else ""
    yield Outcome(
        "SIGTERM, SIGINT, SIGHUP, twice, while 20,000 frames/s go on coming",
        took,
        0,
        "; ".join(wrong) + about,
        measure="ended within",
    )
