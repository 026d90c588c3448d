"""What logs must hold of what a sender has sent."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.reliability.attack.traffic_process import Sender
from tests.fixtures.readers import Read, by_canid, by_python_can
from tests.fixtures.traffic import number

# by how much longer than promised a time may be; tests set more, for a machine that is busy at times
SLACK = 1.0


class Found(NamedTuple):
    """The numbered frames of one or more logs, and what is wrong with them."""

    numbers: list[int]
    wrong: list[str]


def busy() -> float:
    """Processes that want to run per core, at least 1: by as much a time that is promised is longer here."""
    return SLACK * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


def read(paths: Iterable[Path]) -> Found:
    """Read logs by canid and python-can, and compare; frames that carry no number are passed over."""
    numbers: list[int] = []
    wrong: list[str] = []
    for path in paths:
        if not path.exists():
            wrong.append(f"{path.name} is not there")
            continue
        ours, other = by_canid(path), by_python_can(path)
        if ours.complaint or other.complaint:
            wrong.append(f"{path.name}: {ours.complaint or other.complaint}")
        mine, others = list(_numbers(ours)), list(_numbers(other))
        # other frames are not compared: of error frames python-can's candump reader knows some only
        if mine != others:
            wrong.append(f"{path.name}: python-can reads {len(others)} frames, canid {len(mine)}")
        numbers += mine
    return Found(numbers, wrong)


def _numbers(log: Read) -> Iterator[int]:
    for id_, data in log.frames:
        i = int.from_bytes(data[:4], "big")
        if data == number(i) and id_ == i % 2048:
            yield i


def missing(found: Found, sender: Sender, since: float = math.inf, until: float = 0.0) -> list[str]:
    """Why these are not all frames, once and in order, that were sent between two instants (wall clock)."""
    numbers, wrong = found
    if not numbers:
        return (
            [*wrong, "no frame is in the log"] if sender.before(until) > sender.first_after(since) else wrong
        )
    if numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        gaps = numbers[-1] - numbers[0] + 1 - len(set(numbers))
        return [
            *wrong,
            f"{gaps} frames are missing inside, {len(numbers) - len(set(numbers))} are there twice",
        ]
    first, last = sender.first_after(since), sender.before(until)
    if numbers[0] > first:
        wrong = [*wrong, f"the first {numbers[0] - first} frames are missing"]
    if numbers[-1] + 1 < last:
        wrong = [*wrong, f"the last {last - numbers[-1] - 1} frames are missing"]
    return wrong
