"""The folder of a recording is mounted over, unmounted, renamed, removed or replaced while files begin in it."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.outcome import Outcome
from canid.io.logs import open_log
from tests.fixtures.mounted_recording import (
    ACTIONS,
    Settings,
    record_under,
    removed_and_made_anew,
    unavailable,
    unmounted_lazily,
)

PROMISE = (
    "a recording goes on in the folder in which it began, whatever is mounted over it or takes its name, and in the next"
    " one where that is gone: every frame is in a file that is named as it can be found, and it is said once"
)
FORMATS = (".blf", ".asc", ".log")
RATES = (500.0, 2000.0, 4000.0)  # frames/s
SAID = ("folder_covered", "folder_gone", "recording_moved")
# of a recording that lost, or could not write, something
BAD = {"write_error", "recording_waits", "recording_lost", "frames_not_recorded"}


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One recording for each that may happen to its folder; how fast it rotates and when it happens is drawn."""
    why = unavailable()
    if why:
        yield Outcome(f"not tried: {why}", math.nan, 0)
        return
    for action in ACTIONS:
        words = rng.choice((("--file-size", "10kB"), ("--file-size", "40kB"), ("--file-time", "1s"), ()))
        if action.__name__.endswith("begins") and not words:
            words = ("--file-size", "10kB")
        base = folder / action.__name__
        base.mkdir()
        settings = Settings(
            str(base),
            action.__name__,
            list(words),
            rng.choice(FORMATS),
            rng.choice(RATES),
            before_s=rng.uniform(0.0, 1.5),
            after_s=rng.uniform(0.2, 2.0),
        )
        done = record_under(settings)
        wrong: list[str] = []
        numbers: list[int] = []
        for path in base.rglob(f"*{settings.suffix}"):
            log = open_log(path)
            numbers += [int.from_bytes(frame.data[:4], "big") for frame in log]
            if log.damage is not None:
                wrong.append(f"{path.name}: {log.damage.says}")
        found = sorted(set(numbers) if action is unmounted_lazily else numbers)
        first = found[0] if found and action is removed_and_made_anew and words else 0
        if found != list(range(first, done.sent)):
            wrong.append(f"{len(found)} frames in files, {len(set(found))} of them different, of {done.sent}")
        if done.code != 143 or done.written != done.sent:
            wrong.append(f"exit code {done.code}, {done.written} of {done.sent} stated")
        if done.absent:
            wrong.append(f"{done.absent} named, which is not there")
        said = [event for event in done.events if event in SAID]
        if len(said) > 1 or BAD & set(done.events):
            wrong.append(f"events {done.events}")
        about = f" ({settings[2:]})" if wrong else ""
        yield Outcome(action.__name__.replace("_", " "), math.nan, 0, "; ".join(wrong) + about)
