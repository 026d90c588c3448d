"""Attacks on a series and its ring: foreign files, reused names, links, and a list that lies."""

from __future__ import annotations

import math
import os
import random
import time
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path

from benchmarks.reliability.attack import judging
from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording
from canid.io.files.file_identity import FileIdentity
from canid.io.recording.ring_list import Entry

PROMISE = "a ring deletes and writes its own files only: what its list describes, never through a link"
RATE = 3000.0  # frames/s
FORMATS = (".blf", ".asc", ".log")


class Ring:
    """A folder with the series x of an earlier session, and foreign files in it."""

    def __init__(self, folder: Path, suffix: str, rng: random.Random):
        """Take the folder as it is."""
        self.folder = folder
        self.suffix = suffix
        self.rng = rng
        self.elsewhere = folder.parent / "elsewhere"
        self.elsewhere.mkdir()
        self.foreign: dict[Path, tuple[int, bytes]] = {}

    @property
    def list(self) -> Path:
        """The list's file."""
        return self.folder / "x.series"

    def own(self) -> list[Path]:
        """Logs of the series."""
        found = self.folder.glob(f"x_*{self.suffix}")
        return sorted(p for p in found if p not in self.foreign and p.is_file() and not p.is_symlink())

    def put(self, path: Path, content: bytes = b"") -> Path:
        """Put a foreign file there, whatever was there before."""
        path.unlink(missing_ok=True)
        path.write_bytes(content or self.rng.randbytes(3000))
        self.keep(path)
        return path

    def keep(self, path: Path) -> None:
        """From now on this file must stay as it is."""
        content = os.fsencode(os.readlink(path)) if path.is_symlink() else path.read_bytes()
        self.foreign[path] = (os.lstat(path).st_ino, sha256(content).digest())

    def harmed(self) -> list[str]:
        """Which foreign files and links are not as they were."""
        before, self.foreign = self.foreign, {}
        for path in before:
            if os.path.lexists(path):
                self.keep(path)
        return [
            f"{path.name} was {'changed' if path in self.foreign else 'deleted'}"
            for path, was in before.items()
            if self.foreign.get(path) != was
        ]


def names_in_the_list(ring: Ring) -> None:
    """Names of foreign files in the list: bare, with a wrong checksum, with another's identity, outside the folder."""
    victims = [ring.put(ring.folder / f"x_20200101T00000{k}Z_00000{k}{ring.suffix}") for k in range(4)]
    victims.append(ring.put(ring.folder / "notes.txt"))
    outside = ring.put(ring.elsewhere / f"y{ring.suffix}")
    lines = []
    for victim in victims:
        forged = Entry(victim.name, FileIdentity(1, 2, victim.stat().st_size)).line()
        lines += [b"+%s\n" % victim.name.encode(), b"00000000" + forged[8:], forged]
    found = ring.list.read_bytes().splitlines()
    own = next((entry for entry in map(Entry.decoded, found) if entry), None)
    if own is not None:
        lines += [own._replace(name=victim.name).line() for victim in victims]
        there = os.stat(outside)
        identity = own.identity._replace(device=there.st_dev, inode=there.st_ino, size=there.st_size)
        lines += [
            Entry(f"../elsewhere/{outside.name}", identity).line(),
            Entry(str(outside), identity).line(),
        ]
    ring.rng.shuffle(lines)
    with ring.list.open("ab") as file:
        file.write(b"".join(lines))


def own_names_reused(ring: Ring) -> None:
    """Own names that are other files now: of the same size, of the same beginning, longer, links."""
    for path in ring.own():
        content, kind = path.read_bytes(), ring.rng.randrange(5)
        if kind == 0:
            ring.put(path, bytes(len(content)) or b"x")
        elif kind == 1:
            ring.put(path, content[:-1] + b"!")
        elif kind == 2:
            ring.put(path, content + b"more")
        elif kind == 3:
            victim = ring.put(ring.elsewhere / f"to {path.name}", content)
            path.unlink()
            path.symlink_to(victim)
            ring.keep(path)
        else:
            # another name of the same file must outlive it
            os.link(path, ring.elsewhere / path.name)
            ring.keep(ring.elsewhere / path.name)


def list_is_a_link(ring: Ring) -> None:
    """The list is a symbolic link, has a second name, is a FIFO or a folder."""
    kind = ring.rng.randrange(4)
    target = ring.elsewhere / "list"
    if kind == 0:
        ring.list.rename(target)
        ring.list.symlink_to(target)
    elif kind == 1:
        os.link(ring.list, target)
    elif kind == 2:
        ring.list.rename(target)
        os.mkfifo(ring.list)
    else:
        ring.list.rename(target)
        ring.list.mkdir()
    ring.keep(target)
    for path in ring.own():  # a list that is not used names no files
        ring.keep(path)


def journals_are_links(ring: Ring) -> None:
    """Journals, temporary names and names to come are links to foreign files, or foreign files."""
    now = time.time()
    for k in range(8):
        stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(now + k))
        for number in range(1, 5):
            for end in (ring.suffix, ".events.jsonl"):
                path = ring.folder / f"x_{stamp}_{number:06d}{end}"
                if os.path.lexists(path):
                    continue
                if ring.rng.random() < 0.5:
                    victim = ring.put(ring.elsewhere / path.name)
                    path.symlink_to(victim if ring.rng.random() < 0.7 else "nowhere")
                    ring.keep(path)
                else:
                    ring.put(path)
    for name in (
        "x.events.jsonl",
        "x.series~",
        "x.series.tmp",
        ".x.series",
        f"x{ring.suffix}",
        f".x{ring.suffix}",
    ):
        path = ring.folder / name
        if not os.path.lexists(path):
            path.symlink_to(ring.put(ring.elsewhere / f"to {name}"))
            ring.keep(path)


def list_is_damaged(ring: Ring) -> None:
    """Bits flipped, lines doubled, cut."""
    ring.put(ring.folder / f"x_20200101T000000Z_000001{ring.suffix}")
    data = bytearray(ring.list.read_bytes())
    for _ in range(ring.rng.randrange(1, 20)):
        at = ring.rng.randrange(len(data))
        match ring.rng.randrange(3):
            case 0:
                data[at] ^= 1 << ring.rng.randrange(8)
            case 1:
                del data[at : at + ring.rng.randrange(60)]
            case _:
                data[at:at] = data[at : at + 200] or b"\n"
        data = data or bytearray(b"x")
    ring.list.write_bytes(data)


ATTACKS: tuple[Callable[[Ring], None], ...] = (
    names_in_the_list,
    own_names_reused,
    list_is_a_link,
    journals_are_links,
    list_is_damaged,
)


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """A session, an attack or two, and a session that keeps next to nothing."""
    suffix = rng.choice(FORMATS)
    (folder / "logs").mkdir()
    ring = Ring(folder / "logs", suffix, rng)
    wrong: list[str] = []
    # an earlier session, by canid's own recorder in this process: files as they are on a disk
    _earlier(ring)
    acts = rng.sample(ATTACKS, rng.choice((1, 1, 2)))
    # a list that is a link must not be written by the others
    acts.sort(key=lambda act: act is list_is_a_link)
    for act in acts:
        act(ring)
    sender = Sender(folder, RATE)
    words = ("--file-size", 20_000, "--keep-share", "0.0001%")
    with Recording(ring.folder / f"x{suffix}", *words, talk=folder, bus=sender.words) as recording, sender:
        time.sleep(rng.uniform(0.8, 1.4))
        if rng.random() < 0.5:  # a finished own file of this session is replaced while it is recorded
            own = ring.own()
            if len(own) > 1:
                ring.put(own[0])
        time.sleep(rng.uniform(0.3, 0.8))
        till = time.time()
        code = recording.end()
        sender.end()
        reported = recording.reported()
        said = recording.said
    if code != 143:
        wrong.append(f"exit code {code}: {said[-300:]}")
    if reported["files"] < 3:
        wrong.append(f"only {reported['files']} files: nothing was tried")
    harmed = ring.harmed()
    wrong += harmed
    new = [p for p in ring.folder.glob(f"x*{suffix}") if p not in ring.foreign and not p.is_symlink()]
    new = [p for p in new if p.is_file() and p.stat().st_mtime > sender.sent[0] and p.stat().st_size]
    found = judging.read(sorted(new, key=lambda p: (p.stat().st_mtime_ns, p.name)))
    found = found._replace(numbers=sorted(found.numbers))
    last = judging.missing(found, sender, math.inf, till)
    wrong += [text for text in last if "first" not in text and "inside" not in text]
    if found.numbers and found.numbers[-1] + 1 < sender.before(till):
        wrong.append(f"{sender.before(till) - found.numbers[-1] - 1} frames at the end are missing")
    about = f" ({[act.__name__ for act in acts]}, {suffix})" if wrong else ""
    yield Outcome(
        "list forged, damaged or a link; own names reused; links at names to come; files replaced in between",
        math.nan,
        0,
        "; ".join(wrong) + about,
        tried=max(len(ring.foreign), 1),
    )


def _earlier(ring: Ring) -> None:
    from canid.io.recording.file_series import Series
    from canid.io.recording.rotation import Rotation
    from canid.values.types import Frame

    series = Series(ring.folder / f"x{ring.suffix}", Rotation(time=1.0))
    for k in range(3):
        writer = series.open_next()
        writer.start_ns = 1_700_000_000_000_000_000 + k
        for i in range(10):
            writer.append(Frame(i * 0.1, 0, i, bytes([k, i])))
        writer.close()
    series.close()
    for path in ring.own():  # earlier than any frame of this round
        os.utime(path, (time.time() - 100, time.time() - 100))
