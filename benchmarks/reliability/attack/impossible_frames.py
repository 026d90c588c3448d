"""Attacks by frames that no bus can carry: random msgpack and garbage between good frames."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.attack import judging
from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording, until
from tests.fixtures.readers import by_canid

PROMISE = "a frame that no bus can carry costs itself only: counted, reported, left out of every format"
RATES = (500, 2000, 4000)  # frames/s
SECONDS = 1.2


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One recording, in a format and by a verb that are drawn."""
    suffix, verb = rng.choice((".blf", ".asc", ".log")), rng.choice(("record", "record", "live"))
    rate = rng.choice(RATES)
    share = rng.choice((0.01, 0.1, 0.5, 0.9))
    path = folder / f"x{suffix}"
    sender = Sender(folder, rate, total=round(rate * SECONDS), seed=rng.random(), strange=share)
    words = ("--vehicle", "generic") if verb == "live" else ()
    with Recording(path, *words, verb=verb, talk=folder, bus=sender.words) as recording:
        until(lambda: path.exists() or recording.process.poll() is not None)
        with sender:
            sender.end(wait=True)
        time.sleep(0.3)
        code = recording.end()
        said = recording.said
        reported = recording.reported() if verb == "record" else None
    wrong = [] if code == 143 else [f"exit code {code}: {said[-300:]}"]
    if path.exists():
        found = judging.read([path])
        wrong += judging.missing(found, sender, 0.0, math.inf)
        kept = len(by_canid(path).frames)
    else:
        kept, wrong = 0, [*wrong, "there is no log"]
    total = len(sender.sent) + sender.foreign
    if reported is not None:
        bus = reported["buses"][0]
        if reported["frames"] + bus["impossible"] + reported["drops"] != total:
            wrong.append(
                f"{reported['frames']} recorded + {bus['impossible']} impossible + {reported['drops']} dropped, {total} sent"
            )
        errors = reported["errors"]
        if reported["written"] != kept + errors:
            wrong.append(f"{reported['written']} stated, {kept} + {errors} error frames in the file")
        if bus["impossible"] and "impossible" not in (folder / "x.events.jsonl").read_text():
            wrong.append("the journal does not report it")
    if "bus_lost" in said or "lost:" in said:
        wrong.append(f"the bus was lost: {said[-300:]}")
    about = f" ({verb} {suffix}, {rate}/s, {share})" if wrong else ""
    yield Outcome(
        "own sender: random msgpack and garbage between numbered frames",
        math.nan,
        0,
        "; ".join(wrong) + about,
        tried=total,
    )
