"""Attacks on a recording's own file and folder while it is written: deleted, moved, replaced, changed."""

from __future__ import annotations

import os
import random
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.reliability.attack import judging
from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording, until

PROMISE = "a recording that disappears is noticed within 1 s and goes on: nothing is lost, or exit code 5"
MAX_NOTICE_S = 1.0  # s
RATES = (200, 2000, 5000)  # frames/s
FOREIGN = b"another program's file, longer than a line\n" * 50


def deleted(path: Path) -> None:
    """As `rm` does."""
    path.unlink()


def moved(path: Path) -> None:
    """On the same file system."""
    (path.parent.parent / "archive").mkdir()
    path.rename(path.parent.parent / f"archive/y{path.suffix}")


def replaced(path: Path) -> None:
    """As an editor saves."""
    (path.parent / "other").write_bytes(FOREIGN)
    (path.parent / "other").replace(path)


def linked(path: Path) -> None:
    """A link to another program's file takes its name."""
    (path.parent / "other").write_bytes(FOREIGN)
    path.unlink()
    path.symlink_to("other")


def folder_instead(path: Path) -> None:
    """A folder takes its name."""
    path.unlink()
    path.mkdir()


def folder_removed(path: Path) -> None:
    """As `rm -r` does."""
    shutil.rmtree(path.parent, ignore_errors=True)


def folder_renamed(path: Path) -> None:
    """And another one takes its name."""
    path.parent.rename(path.parent.parent / "renamed")
    path.parent.mkdir()


def folder_and_parent_removed(path: Path) -> None:
    """The nearest folder that exists is two above."""
    shutil.rmtree(path.parent.parent, ignore_errors=True)


def truncated(path: Path) -> None:
    """By another program."""
    os.truncate(path, 0)


def overwritten(path: Path) -> None:
    """In place."""
    path.write_bytes(FOREIGN)


def appended(path: Path) -> None:
    """By another program."""
    with path.open("ab") as file:
        file.write(FOREIGN)


# with the words of the event, and whether the file's frames so far may be lost (exit code 5 then)
LOSSLESS: tuple[Callable[[Path], None], ...] = (
    deleted,
    moved,
    replaced,
    linked,
    folder_instead,
    folder_removed,
    folder_renamed,
    folder_and_parent_removed,
)
CHANGING: tuple[Callable[[Path], None], ...] = (truncated, overwritten, appended)


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One recording; the file is attacked once or, where nothing may be lost, several times."""
    act = rng.choice((*LOSSLESS, *CHANGING))
    suffix, verb = rng.choice((".blf", ".asc", ".log")), rng.choice(("record", "record", "live"))
    times = rng.choice((1, 1, 3)) if act is deleted else 1
    base = folder / "a" / "b"
    base.mkdir(parents=True)
    talk = folder / "talk"
    talk.mkdir()
    path = base / f"x{suffix}"
    words = ("--vehicle", "generic") if verb == "live" else ()
    wrong: list[str] = []
    noticed = 0.0
    sender = Sender(folder, rng.choice(RATES))
    with Recording(path, *words, verb=verb, talk=talk, bus=sender.words) as recording:
        until(lambda: "listen-only" in recording.said)
        with sender:
            # a text log has a name from the start, and its first line with its first checkpoint
            until(lambda: path.exists() and path.stat().st_size > 200)
            time.sleep(rng.uniform(0.0, 0.8))
            victim = path
            for k in range(times):
                time.sleep(rng.uniform(0.3, 0.8) if k else 0.0)
                said = len(recording.said)
                victim = path if k == 0 else _newest(base, suffix)
                instant = time.time()
                act(victim)
                until(
                    lambda said=said: _told(recording.said[said:]) or recording.process.poll() is not None,
                    30.0,
                )
                noticed = max(noticed, time.time() - instant)
            time.sleep(rng.uniform(0.1, 0.5))
            till = time.time()
            code = recording.end()
            sender.end()
        said_all = recording.said
    allowed = (143,) if act in LOSSLESS else (5,)
    if code not in allowed:
        wrong.append(f"exit code {code}: {said_all[-500:]}")
    if noticed > MAX_NOTICE_S * judging.busy():
        wrong.append(f"noticed after {noticed:.1f} s")
    logs = [each for each in folder.rglob(f"*{suffix}") if each.is_file() and not each.is_symlink()]
    logs = [each for each in logs if FOREIGN not in each.read_bytes() and each.stat().st_size]
    found = judging.read(sorted(logs, key=lambda each: each.stat().st_mtime_ns))
    found = found._replace(numbers=sorted(found.numbers))
    if act in LOSSLESS:
        wrong += judging.missing(found, sender, 0.0, till)
    else:
        # what was in the file may be lost; what came from a second later on must not be
        wrong += judging.missing(found, sender, instant + MAX_NOTICE_S * judging.busy(), till)
    left = {replaced: path, linked: path.parent / "other", overwritten: path}.get(act)
    if left is not None and left.read_bytes() != FOREIGN:
        wrong.append(f"{left.name}, which is another program's, was written into")
    about = f" ({act.__name__} × {times}, {verb} {suffix})" if wrong else ""
    kind = (
        "deleted, moved, replaced, its folder removed or renamed"
        if act in LOSSLESS
        else "truncated, overwritten, appended to by another program"
    )
    yield Outcome(kind, noticed, 0, "; ".join(wrong) + about, measure="noticed within")


def _newest(folder: Path, suffix: str) -> Path:
    """The file that is being written; one that is finished is its owner's to delete."""
    files = [path for path in folder.glob(f"x*{suffix}") if "restored" not in path.name]
    return max(files, key=lambda path: path.stat().st_mtime_ns)


def _told(said: str) -> bool:
    return any(words in said for words in ("was deleted", "was moved", "out of reach", "was changed"))
