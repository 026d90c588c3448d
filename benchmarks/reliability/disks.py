"""Disks that are full, read-only, slow or stuck: recording goes on elsewhere or lags in the open, live goes on."""

from __future__ import annotations

import errno
import math
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.reliability.faulty_disk import FaultyDisk
from benchmarks.reliability.fuse import Mounted
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording, until
from tests.fixtures.markers import markers
from tests.fixtures.readers import by_canid, disagreement
from tests.fixtures.traffic import Traffic, number

SYNC_S = 0.5  # s per sync
RATE_PER_S = 8000.0  # frames/s
DURATION_S = 4.0
# frames that may wait in these trials, instead of a minute's: 2.5 s of 8,000 frames/s
MAX_WAITING_FRAMES = 20_000


def full(folder: Path) -> list[str]:
    """A tmpfs of 200 kB fills up under `live`: exit 5, the file is whole up to there, the rest is in the folder above."""
    with tmpfs(folder / "small", "200k") as disk:
        return _failing(folder, disk, lambda: None, "No space left")


def becomes_read_only(folder: Path) -> list[str]:
    """A file system that becomes read-only under the recorder, as ext4 does after an error."""
    disk = FaultyDisk()
    (folder / "disk").mkdir()

    def turn() -> None:
        disk.failure = errno.EROFS

    with Mounted(disk, folder / "disk"):
        return _failing(folder, folder / "disk", turn, "Read-only file system")


def is_read_only(folder: Path) -> list[str]:
    """It is read-only from the start: one line, exit 5."""
    with tmpfs(folder / "ro", "200k,ro") as disk, Recording(disk / "x.blf", talk=folder) as recording:
        code = recording.end(None)
        wrong = [] if code == 5 else [f"exit code {code}"]
        if recording.said.count("cannot create") != 1 or "Traceback" in recording.said:
            wrong.append(recording.said)
    return wrong


def stalls(folder: Path) -> list[str]:
    """500 ms per sync, and no write during it: nothing is lost, and the lag is shown."""
    disk = FaultyDisk(stall=SYNC_S)
    (folder / "disk").mkdir()
    with Mounted(disk, folder / "disk"), Recording(folder / "disk/x.blf", talk=folder) as recording:
        total = round(RATE_PER_S * DURATION_S)
        traffic = Traffic(RATE_PER_S, total).start()
        traffic.join()
        time.sleep(0.5)
        code, reported = recording.end(), recording.reported()
        frames = by_canid(folder / "disk/x.blf").frames
        wrong = [] if code == 143 else [f"exit code {code}: {recording.said}"]
        if frames != [(i % 2048, number(i)) for i in range(total)]:
            wrong.append(f"{total - len(frames)} frames are missing")
        if reported["drops_disk"] or reported["drops"]:
            wrong.append(f"drops: {reported}")
        if "behind" not in recording.said:
            wrong.append("the lag is not shown")
        if disk.syncs < DURATION_S / SYNC_S / 2:
            wrong.append(f"only {disk.syncs} syncs: nothing was tried")
    return wrong


def stuck(folder: Path) -> list[str]:
    """Longer than memory lasts: every frame that is dropped is counted, shown, and reported in the log itself."""
    disk = FaultyDisk(stall=SYNC_S)
    (folder / "disk").mkdir()
    path = folder / "disk/x.blf"
    before = f"from canid.io.recording import log_writer_thread; log_writer_thread.MAX_WAITING_FRAMES = {MAX_WAITING_FRAMES}"
    with Mounted(disk, folder / "disk"), Recording(path, talk=folder, before=before) as recording:
        total = round(RATE_PER_S * 2 * DURATION_S)
        traffic = Traffic(RATE_PER_S, total).start()
        traffic.wait(1.0)
        disk.stuck.set()
        traffic.wait(DURATION_S + 1.0)
        disk.stuck.clear()
        traffic.join()
        time.sleep(0.5)
        code, reported = recording.end(), recording.reported()
        frames = [int.from_bytes(data[:4], "big") for _, data in by_canid(path).frames]
        missing = total - len(frames)
        events = [e for e in markers(path) if e.what == "frames_not_recorded"]
        in_log = sum(int(e.says.split()[0].replace(",", "")) for e in events)
        in_journal = sum(e["what"] == "frames_not_recorded" for e in recording.journal())
        gaps = sum(b != a + 1 for a, b in pairwise([-1, *frames, total]))
        wrong = [] if code == 5 else [f"exit code {code}: {recording.said}"]
        if reported["frames"] != total or reported["drops"]:
            wrong.append(f"live did not go on: {reported}")
        if not missing or not missing == reported["drops_disk"] == in_log:
            wrong.append(f"{missing} missing, {reported['drops_disk']} counted, {in_log} reported in the log")
        if not gaps == len(events) == in_journal:
            wrong.append(f"{gaps} gaps, {len(events)} reported in the log, {in_journal} in the journal")
        if "NOT RECORDED" not in recording.said:
            wrong.append("the drops are not shown")
        wrong.append(disagreement(path))
    return wrong


CASES: tuple[tuple[str, Callable[[Path], list[str]]], ...] = (
    ("disk full (tmpfs of 200 kB)", full),
    ("disk becomes read-only", becomes_read_only),
    ("disk is read-only", is_read_only),
    ("500 ms per sync, 8,000 frames/s", stalls),
    ("disk stuck for 4 s, queue of 2.5 s", stuck),
)
TRIALS = 2 * len(CASES)


def trial(k: int, seed: int = 0) -> Iterator[Outcome]:
    """The cases in turn."""
    name, case = CASES[k % len(CASES)]
    with TemporaryDirectory() as folder:
        yield Outcome(name, math.nan, 0, "; ".join(w for w in case(Path(folder)) if w))


def _failing(folder: Path, disk: Path, turn: Callable[[], None], why: str) -> list[str]:
    path = disk / "x.blf"
    with Recording(path, "--vehicle", "generic", verb="live", talk=folder) as recording:
        traffic = Traffic(RATE_PER_S, round(RATE_PER_S * 2 * DURATION_S)).start()
        traffic.wait(1.0)
        turn()
        until(lambda: "the recording goes on in" in recording.said or recording.process.poll() is not None)
        traffic.join()
        time.sleep(0.5)
        code = recording.end(signal.SIGTERM)
        log, rest = by_canid(path), by_canid(folder / "x.blf")
        wrong = [] if code == 5 else [f"exit code {code}"]
        if "Traceback" in recording.said or why not in recording.said:
            wrong.append(recording.said)
        n, sent = len(log.frames), len(traffic.sent)
        if log.frames + rest.frames != [(i % 2048, number(i)) for i in range(sent)] or not 0 < n < sent:
            wrong.append(f"the files hold {n} and {len(rest.frames)} frames of {sent}")
        if f"{sent:,} of {sent:,} frames" not in recording.printed:
            wrong.append(f"live did not go on, or counts wrongly: {recording.printed}")
        wrong += [disagreement(path), disagreement(folder / "x.blf")]
    return wrong


@contextmanager
def tmpfs(folder: Path, options: str) -> Iterator[Path]:
    """A small file system in memory."""
    folder.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={options}", "tmpfs", str(folder)], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)
