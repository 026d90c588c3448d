"""Clocks that step, run backwards or disagree: every frame stands in a file at its own stamp, as python-can reads it."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmarks.reliability import faulty_bus
from benchmarks.reliability.attack import judging
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording, until
from tests.fixtures.readers import by_python_can, by_tshark

PROMISE = (
    "whatever the clocks do, python-can and tshark read every frame at its stamp, each bus in the order in which it came,"
    " and a step that changes the order is an event"
)
FORMATS = (".blf", ".asc", ".log")
WORDS = ((), (), ("--file-time", "1s"), ("--file-size", "20kB"), ("--file-time", "1s", "--keep-share", "90%"))
STEPS_S = (0.001, 0.05, 0.4, 0.9, 5.0, 400.0, 3600.0, 86_400.0)
MAX_ERROR_S = 1.2e-6  # s: text logs have microseconds, floats of today 0.24 of one
MAX_FILES = 40  # in some seconds, also of a clock that runs backwards
SECOND_BUS = 1_000_000  # the number of its first frame


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One or two buses whose clocks do something that is drawn."""
    suffix = rng.choice(FORMATS)
    words = rng.choice(WORDS)
    buses = [faulty_bus.script(folder, _steps(rng, k), f"bus{k}") for k in range(rng.choice((1, 1, 2)))]
    listen = ["-i", faulty_bus.NAME, *(word for bus in buses for word in ("-c", str(bus.path)))]
    with Recording(
        folder / f"x{suffix}", *words, talk=folder, bus=listen, before=faulty_bus.BEFORE
    ) as recording:
        until(
            lambda: (
                all("idle" in dict(bus.instants()) for bus in buses) or recording.process.poll() is not None
            )
        )
        code = recording.end()
        reported = recording.reported()
    stamps = [bus.stamps() for bus in buses]
    wrong = [] if code == 143 else [f"exit code {code}: {recording.said}"]
    paths = [path for path in folder.glob(f"x*{suffix}") if path.stat().st_size]
    events = [
        json.loads(line) for path in folder.glob("*.events*.jsonl") for line in path.read_text().splitlines()
    ]
    # a clock with a zero of its own is set against the computer's: the journal says by how much
    added = [_added(events, bus) for bus in buses]
    stamps = [
        [(number, at + offset) for number, at in each] for each, offset in zip(stamps, added, strict=True)
    ]
    wrong += _judged(paths, stamps)
    if len(paths) > MAX_FILES:
        wrong.append(f"{len(paths)} files")
    back = any(b < a for each in stamps for (_, a), (_, b) in pairwise(each))
    if back and not {"clock_step", "clock_order"} & {event["what"] for event in events}:
        wrong.append("stamps go back, and the journal does not say so")
    if reported["written"] != sum(map(len, stamps)):
        wrong.append(f"{reported['written']} of {sum(map(len, stamps))} frames written")
    about = f" ({suffix}, {words}, {[bus.path.read_text() for bus in buses]})" if wrong else ""
    attack = "a plug-in interface: steps of 1 ms to a day, backwards, two buses apart, swapped frames, a zero of its own"
    yield Outcome(attack, math.nan, 0, "; ".join(wrong) + about)


def _steps(rng: random.Random, bus: int) -> list[list[Any]]:
    """A script: some stretches of frames, with something that the clock does between them."""
    steps: list[list[Any]] = [["number", bus * SECOND_BUS]]
    if rng.random() < 0.2:
        steps.append(
            ["clock", -1_795_000_000 + rng.randrange(1000)]
        )  # as a computer without a battery, from 1970 on
    if bus:
        steps.append(["clock", rng.choice((-1, 1)) * rng.choice(STEPS_S)])
    for _ in range(rng.randrange(2, 6)):
        steps.append(["frames", rng.randrange(1, 400), 1000])
        what = rng.randrange(4)
        if what == 0:
            steps.append(["swap", rng.randrange(1, 5)])
        elif what == 1:
            steps.append(["run", rng.choice((-1.0, -20.0, 0.0, 1.0, 1.02))])
        else:
            steps.append(["clock", rng.choice((-1, -1, 1)) * rng.choice(STEPS_S)])
    return [*steps, ["frames", 200, 1000], ["pause", 0.3], ["idle"]]


def _added(events: list[dict[str, Any]], bus: faulty_bus.Script) -> float:
    says = [
        event["says"]
        for event in events
        if event["what"] == "stamp_offset" and str(bus.path) in event["says"]
    ]
    return int(says[0].split(" ns are")[0].split()[-1].replace(",", "")) * 1e-9 if says else 0.0


def _judged(paths: list[Path], stamps: list[list[tuple[int, float]]]) -> list[str]:
    wrong = []
    found: list[tuple[int, float]] = []
    for path in paths:
        theirs = by_python_can(path)
        if theirs.complaint:
            wrong.append(f"{path.name}: python-can: {theirs.complaint}")
        numbers = [int.from_bytes(data[:4], "big") for _, data in theirs.frames]
        found += zip(numbers, theirs.times, strict=True)
        shark = by_tshark(path) if path.suffix == ".blf" else None
        if shark is not None and any(
            abs(a - b) > MAX_ERROR_S for a, b in zip(shark.times, theirs.times, strict=True)
        ):
            wrong.append(f"{path.name}: tshark reads other times")
        ours = judging.read([path])
        if ours.wrong:
            wrong += ours.wrong
    sent = {number: at for each in stamps for number, at in each}
    if sorted(number for number, _ in found) != sorted(sent):
        wrong.append(f"{len(found)} frames in the files of {len(sent)}")
        return wrong
    worst = max((abs(at - sent[number]) for number, at in found), default=0.0)
    if worst > MAX_ERROR_S:
        wrong.append(f"python-can reads a stamp that is off by {worst:.6f} s")
    for path in paths:
        inside = [int.from_bytes(data[:4], "big") for _, data in by_python_can(path).frames]
        for each in stamps:
            order = {number: k for k, (number, _) in enumerate(each)}
            own = [order[number] for number in inside if number in order]
            if own != sorted(own):
                wrong.append(f"{path.name}: not in the order in which they came")
    return wrong
