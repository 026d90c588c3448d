"""New files by size and by time, rings by age and by share of the disk: nothing is lost at the seams."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.reliability.disks import tmpfs
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording
from canid.io.logs import open_log
from tests.fixtures.readers import by_canid, disagreement
from tests.fixtures.traffic import Traffic, number

RATE_PER_S = 8000.0  # frames/s
DURATION_S = 5.0
FILE_BYTES = 100_000  # bytes
MAX_GAP_S = 0.25  # s


def by_size(suffix: str, folder: Path) -> list[str]:
    """Files of at most so many bytes."""
    wrong, files, _ = _recorded(folder, suffix, "--file-size", FILE_BYTES)
    sizes = [path.stat().st_size for path in files]
    if max(sizes) > FILE_BYTES:
        wrong.append(f"a file has {max(sizes)} bytes")
    if min(sizes[:-1], default=0) < 0.9 * FILE_BYTES:
        wrong.append(f"a file has {min(sizes[:-1])} bytes only")
    return wrong + _contiguous(files, 0)


def by_time(suffix: str, folder: Path) -> list[str]:
    """Files of 1 s."""
    wrong, files, _ = _recorded(folder, suffix, "--file-time", "1s")
    lasts = [frames[-1].t for frames in map(list, map(open_log, files))]
    # text logs have microseconds: a frame 0.9999997 s after the first one may be at 1.000000 s
    if max(lasts) >= 1.0 + 1e-6 or len(files) < DURATION_S - 1:
        wrong.append(f"files of {lasts} s")
    return wrong + _contiguous(files, 0)


def ring_by_age(suffix: str, folder: Path) -> list[str]:
    """Files that were finished more than 2 s ago are gone, and nothing else."""
    foreign = _foreign(folder, suffix)
    wrong, files, recording = _recorded(folder, suffix, "--file-time", "1s", "--keep-time", "2s")
    if not 2 <= len(files) <= 5 or recording.reported()["files"] <= len(files):
        wrong.append(f"{len(files)} files are left of {recording.reported()['files']}")
    return wrong + foreign() + _contiguous(files, None)


def ring_by_share(suffix: str, folder: Path) -> list[str]:
    """All files together take at most 15 % of the disk, but for what a second adds."""
    with tmpfs(folder / "disk", "2000k") as disk:
        foreign = _foreign(disk, suffix)
        words = ("--file-size", 50_000, "--keep-share", "15%")
        wrong, files, recording = _recorded(disk, suffix, *words, talk=folder)
        took, limit = sum(path.stat().st_size for path in files), 0.15 * 2_048_000
        if not limit - 100_000 < took < limit + 160_000 or recording.reported()["files"] <= len(files):
            wrong.append(f"{took} bytes are left in {len(files)} files of {recording.reported()['files']}")
        return wrong + foreign() + _contiguous(files, None)


def killed(suffix: str, folder: Path) -> list[str]:
    """SIGKILL while new files begin all the time: at most 0.25 s, in any file."""
    rng = random.Random(str(folder))
    with Recording(folder / f"drive{suffix}", "--file-size", 20_000, talk=folder) as recording:
        traffic = Traffic(RATE_PER_S).start()
        traffic.wait(rng.uniform(0.5, 2.0))
        instant = recording.kill()
        traffic.stop()
    files = sorted(folder.glob(f"drive_*{suffix}"))
    kept = sum(len(by_canid(path).frames) for path in files if path.stat().st_size)
    lost = instant - traffic.sent[kept] if kept < traffic.before(instant) else 0.0
    wrong = [f"{lost:.3f} s are lost"] if lost > MAX_GAP_S else []
    empty = [path for path in files if not path.stat().st_size]
    # a text log that was just begun may be empty, a .blf never
    wrong += [f"{path.name} is empty" for path in empty if suffix == ".blf" or path != files[-1]]
    return wrong + _contiguous([path for path in files if path not in empty], 0)


FORMATS = (".blf", ".asc", ".log")
CASES: tuple[tuple[str, Callable[[str, Path], list[str]]], ...] = (
    ("by size", by_size),
    ("by time", by_time),
    ("ring by age", ring_by_age),
    ("ring by share of the disk", ring_by_share),
    ("kill -9 between seams", killed),
)
TRIALS = len(CASES) * len(FORMATS)


def trial(k: int, seed: int = 0) -> Iterator[Outcome]:
    """The cases in turn, then the formats."""
    name, case = CASES[k % len(CASES)]
    suffix = FORMATS[k // len(CASES) % len(FORMATS)]
    with TemporaryDirectory() as folder:
        yield Outcome(f"{name}, {suffix}", math.nan, 0, "; ".join(case(suffix, Path(folder))))


def _recorded(
    folder: Path, suffix: str, *words: object, talk: Path | None = None
) -> tuple[list[str], list[Path], Recording]:
    """Record some seconds; what was wrong, and the files in the order of their names."""
    with Recording(folder / f"drive{suffix}", *words, talk=talk or folder) as recording:
        total = round(RATE_PER_S * DURATION_S)
        Traffic(RATE_PER_S, total).start().join()
        time.sleep(0.5)
        code, reported = recording.end(), recording.reported()
    wrong = [] if code == 143 else [f"exit code {code}: {recording.said}"]
    if not reported["frames"] == reported["written"] == total:
        wrong.append(f"{reported['frames']} received, {reported['written']} written of {total}")
    return wrong, sorted(folder.glob(f"drive_2*{suffix}")), recording


def _contiguous(files: list[Path], first: int | None) -> list[str]:
    """Each file opens alone and begins where the one before ended; `first`: the very first frame, if it is there."""
    wrong, numbers = [], []
    end = 0.0
    for path in files:
        read = by_canid(path)
        numbers += [int.from_bytes(data[:4], "big") for _, data in read.frames]
        wrong += [text for text in (disagreement(path),) if text]
        if read.times and not end <= read.times[0] + 2e-6 < end + 2.0 and end:
            wrong.append(f"{path.name} begins {read.times[0] - end:.6f} s after the one before")
        end = read.times[-1] if read.times else end
    start = first if first is not None else numbers[0] if numbers else 0
    if numbers != list(range(start, start + len(numbers))) or not numbers:
        wrong.append("frames are missing at a seam")
    if files and by_canid(files[0]).frames[0][1] != number(start):
        wrong.append("not the first frame")
    return wrong


def _foreign(folder: Path, suffix: str) -> Callable[[], list[str]]:
    """Files with names like the series' own, older than all of them; returns whether they are still there."""
    names = [f"drive_19990101T000000Z_00000{i}{suffix}" for i in (1, 2)] + [f"drive{suffix}", f"x{suffix}"]
    for name in names:
        (folder / name).write_bytes(b"another program's")

    def gone() -> list[str]:
        lost = [name for name in names if not (folder / name).exists()]
        for name in names:
            (folder / name).unlink(missing_ok=True)
        return [f"{lost} were deleted"] if lost else []

    return gone
