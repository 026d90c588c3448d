"""SIGINT, SIGTERM, SIGHUP and the end of the bus in a burst of 60,000 frames; a restart under the same name."""

from __future__ import annotations

import math
import signal
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.reliability import faulty_bus
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording, until
from canid.io.buses import python_can
from tests.fixtures.readers import by_canid, disagreement
from tests.fixtures.traffic import number

BURST = 60_000
ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, None)
TRIALS = 8


def trial(k: int, seed: int = 0) -> Iterator[Outcome]:
    """The ends in turn; every second one under the name of a recording that was killed."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        yield one(folder, ENDS[k % len(ENDS)], again=k // len(ENDS) % 2 == 1)


def one(folder: Path, number_: signal.Signals | None, *, again: bool = False, burst: int = BURST) -> Outcome:
    """A burst, and the end as soon as the bus has handed it over; `again`: the name is taken, by a torn file."""
    before = b"LOGG, what a killed recorder left" if again else b""
    if again:
        (folder / "x.blf").write_bytes(before)
    end = [["gone", 1000.0]] if number_ is None else [["idle"]]
    bus = faulty_bus.script(folder, [["frames", burst, 0.0], *end])
    with Recording(folder / "x.blf", talk=folder, bus=bus.words, before=faulty_bus.BEFORE) as recording:
        until(lambda: bus.handed_over() >= burst or recording.process.poll() is not None)
        code = recording.end(number_)
        reported = recording.reported()
    wrong = []
    if code != (3 if number_ is None else 128 + number_):
        wrong.append(f"exit code {code}: {recording.said}")
    path = folder / ("x-2.blf" if again else "x.blf")
    if again and (folder / "x.blf").read_bytes() != before:
        wrong.append("the earlier file was touched")
    if reported["frames"] != burst or reported["written"] != burst or Path(reported["path"]) != path:
        wrong.append(f"it says {reported}")
    frames = by_canid(path).frames
    if frames != [(i % 2048, number(i)) for i in range(burst)]:
        wrong.append("not every frame, or not in order")
    with python_can.load().BLFReader(str(path)) as reader:
        if reader.object_count != burst or reader.file_size != path.stat().st_size:
            wrong.append(f"the header says {reader.object_count} frames, {reader.file_size} bytes")
    wrong.append(disagreement(path))
    name = "end of the bus" if number_ is None else number_.name
    group = f"{name}{', the name is taken' if again else ''}"
    return Outcome(group, math.nan, burst - len(frames), "; ".join(w for w in wrong if w))
