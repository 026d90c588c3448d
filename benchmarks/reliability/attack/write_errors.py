"""Writes, syncs and creations that fail once, now and then or for a time; a disk that is full and freed again."""

from __future__ import annotations

import errno
import json
import math
import random
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.attack import judging
from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.disks import tmpfs
from benchmarks.reliability.failing_writes import FailingWrites, compiler
from benchmarks.reliability.needs import root
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording, until

PROMISE = "a write error ends a file, not the recording: it goes on in another file, every frame is there or counted, exit 5"
FORMATS = (".blf", ".asc", ".log")
RATES = (200, 2000, 8000)  # frames/s
MAX_END_S = 2.0  # s from a signal to the end of the process
ERRORS = (errno.ENOSPC, errno.EIO, errno.ESTALE, errno.EAGAIN, errno.EDQUOT, errno.EROFS)


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """A fault that is drawn; one that does not end; a full disk."""
    if not compiler():
        yield _failing(folder, rng)
        yield _for_good(folder, rng)
    if not root():
        yield _full_and_freed(folder, rng)


def _failing(folder: Path, rng: random.Random) -> Outcome:
    disk = folder / "disk"
    disk.mkdir()
    number, suffix, rate = rng.choice(ERRORS), rng.choice(FORMATS), rng.choice(RATES)
    calls = rng.choice((("write",), ("write",), ("sync",), ("write", "create"), ("write", "sync", "create")))
    kind = rng.choice(("once", "now and then", "for a time"))
    words = rng.choice(((), ("--file-size", "20kB"), ("--file-size", "20kB", "--keep-share", "90%")))
    faults = FailingWrites(
        folder,
        number,
        path=disk,
        calls=calls,
        share=rng.uniform(0.05, 0.4) if kind == "now and then" else 1.0,
        once=kind == "once",
        seed=rng.randrange(1000),
    )
    sender = Sender(folder, rate)
    path = disk / f"x{suffix}"
    with (
        Recording(path, *words, talk=folder, bus=sender.words, environment=faults.environment) as recording,
        sender,
    ):
        sender.wait(rng.uniform(0.3, 1.0))
        faults.on()
        sender.wait(rng.uniform(0.5, 2.0), since_now=True)
        faults.off()
        sender.wait(rng.uniform(0.5, 1.0), since_now=True)
        sender.end()
        code = recording.end()
        wrong = _judged(recording, sender, code)
    about = f" ({kind}, {errno.errorcode[number]} of {'+'.join(calls)}, {suffix}, {rate}/s, {words})"
    return Outcome("LD_PRELOAD: errors once, now and then, for a time", math.nan, 0, _joined(wrong, about))


def _for_good(folder: Path, rng: random.Random) -> Outcome:
    """No folder takes a file any more: frames wait in memory, and at the end each one is counted."""
    suffix, number = rng.choice(FORMATS), rng.choice(ERRORS)
    talk = folder / "talk"
    talk.mkdir()
    faults = FailingWrites(talk, number, path="/z", but="/talk/", calls=("write", "create"))
    sender = Sender(folder, 2000)
    with (
        Recording(
            folder / f"z{suffix}", talk=talk, bus=sender.words, environment=faults.environment
        ) as recording,
        sender,
    ):
        sender.wait(rng.uniform(0.3, 1.0))
        faults.on()
        until(lambda: "no folder takes a file" in recording.said)
        sender.wait(rng.uniform(0.2, 1.0), since_now=True)
        sender.end()
        began = time.monotonic()
        code = recording.end()
        took = time.monotonic() - began
        faults.off()
        reported = recording.reported()
    found = judging.read([folder / f"z{suffix}"])
    wrong = list(found.wrong)
    if code != 5:
        wrong.append(f"exit code {code}")
    if found.numbers != list(range(reported["written"])):
        wrong.append(f"{len(found.numbers)} frames in the file, {reported['written']} stated")
    if not reported["drops_disk"] or reported["written"] + reported["drops_disk"] != len(sender.sent):
        wrong.append(
            f"{reported['drops_disk']} counted and {reported['written']} written of {len(sender.sent)}"
        )
    if took > MAX_END_S * judging.busy():
        wrong.append(f"ended after {took:.1f} s")
    about = f" ({errno.errorcode[number]}, {suffix})"
    return Outcome("LD_PRELOAD: no folder takes a file any more", math.nan, 0, _joined(wrong, about))


def _full_and_freed(folder: Path, rng: random.Random) -> Outcome:
    suffix, ring = rng.choice(FORMATS), rng.random() < 0.7
    words = ("--file-size", "20kB", *(("--keep-share", "90%") if ring else ()))
    sender = Sender(folder, 4000)
    with (
        tmpfs(folder / "small", "600k") as disk,
        Recording(disk / f"y{suffix}", *words, talk=folder, bus=sender.words) as recording,
        sender,
    ):
        sender.wait(rng.uniform(0.5, 1.0))
        other = disk / "ballast"
        with other.open("wb", buffering=0) as file:
            try:
                while True:
                    file.write(bytes(4096))
            except OSError:
                pass
        sender.wait(rng.uniform(0.5, 2.5), since_now=True)
        other.unlink()
        sender.wait(1.0, since_now=True)
        sender.end()
        code = recording.end()
        reported = recording.reported()
        wrong = []
        deleted = sum("is deleted" in line for line in recording.said.splitlines())
        if code not in ((5, 143) if ring else (5,)):
            wrong.append(f"exit code {code}")
        if reported["written"] + reported["drops_disk"] != reported["frames"]:
            wrong.append(
                f"{reported['written']} written and {reported['drops_disk']} counted of {reported['frames']}"
            )
        found = _found(disk, f"y*{suffix}")
        wrong += found.wrong
        if ring and deleted:
            # the oldest are gone, as the ring has it
            last = found.numbers[-1] if found.numbers else -1
            if found.numbers != list(range(last + 1 - len(found.numbers), last + 1)):
                wrong.append("frames are missing among those that are kept")
            if last + 1 < reported["frames"]:
                wrong.append(f"the last {reported['frames'] - last - 1} frames are missing")
        elif len(found.numbers) != reported["written"]:
            wrong.append(f"{len(found.numbers)} frames in the files, {reported['written']} stated")
    return Outcome(
        "a tmpfs that another file fills, and frees", math.nan, 0, _joined(wrong, f" ({suffix}, {words})")
    )


def _judged(recording: Recording, sender: Sender, code: int) -> list[str]:
    """Every frame is in the files, once and in order, whatever failed; the exit code and the journal say that it did."""
    reported = recording.reported()
    failed = reported["state"].startswith("failed")
    folder = recording.output.parent
    found = _found(folder, f"x*{recording.output.suffix}")
    events = _events(folder)
    if "the disk is full: " in "".join(events.values()):
        # a ring gave its oldest files, and their journals, as it may
        found = judging.Found([*range(reported["frames"] - len(found.numbers)), *found.numbers], found.wrong)
    elif failed and "write_error" not in events:
        found.wrong.append(f"no write error in the journal: {sorted(events)}")
    wrong = judging.missing(found, sender, math.inf, 0.0)
    if code != (5 if failed else 143):
        wrong.append(f"exit code {code}")
    if reported["drops_disk"]:
        wrong.append(f"{reported['drops_disk']} frames dropped, although memory had room")
    if not len(found.numbers) == reported["written"] == reported["frames"]:
        wrong.append(
            f"{len(found.numbers)} frames in the files, {reported['written']} stated, {reported['frames']} received"
        )
    return wrong


def _events(folder: Path) -> dict[str, str]:
    """What the journals report, by kind."""
    journals = [each for place in (folder, folder.parent) for each in place.glob("*.events*.jsonl")]
    events = [json.loads(line) for path in journals for line in path.read_text().splitlines()]
    return {event["what"]: event["says"] for event in events}


def _found(folder: Path, name: str) -> judging.Found:
    """The numbers in all files of the recording, also where it went on in the folder above, in the order of the frames."""
    paths = [path for place in (folder, folder.parent) for path in place.glob(name)]
    each = [judging.read([path]) for path in paths]
    each.sort(key=lambda found: found.numbers[:1])
    return judging.Found(
        [n for found in each for n in found.numbers], [w for found in each for w in found.wrong]
    )


def _joined(wrong: list[str], about: str) -> str:
    return "; ".join(wrong) + about if wrong else ""
