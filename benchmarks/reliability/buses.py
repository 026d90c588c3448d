"""Buses that fail: what is received is recorded as it came, and what happened stands in the log."""

from __future__ import annotations

import math
import re
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.reliability import faulty_bus
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording, until
from canid.io.logs import open_log
from canid.values.types import Flag
from tests.fixtures.markers import markers
from tests.fixtures.readers import by_canid, disagreement
from tests.fixtures.traffic import Traffic

MAX_RETURN_S = 2.0  # s within which a bus that is there again is read again
CLOCK_STEP_S = 3600.0  # s
MAX_STAMP_ERROR_S = 0.1  # s from the sending of a frame to its stamp
# a socket buffer that some hundred frames fill, instead of 32 MB
SMALL_BUFFER = "from canid.io.buses.receivers import socketcan; socketcan.RECEIVE_BUFFER_BYTES = 100_000"


def errors_and_bus_off(folder: Path) -> list[str]:
    """Error frames are logged; bus-off is reported at once and in the log, it is not restarted, its end is reported too."""
    steps: list[list[Any]] = [
        ["frames", 500, 1000],
        ["error", 50],
        ["state", "ERROR"],
        ["pause", 1.5],
        ["state", "ACTIVE"],
        ["frames", 1500, 1000],
        ["idle"],
    ]
    recording, reported, wrong = _played(folder, steps, 2000)
    frames = list(open_log(recording.output))
    if reported["errors"] != 50 or sum(bool(f.flags & Flag.ERROR) for f in frames) != 50:
        wrong.append(f"{reported['errors']} error frames of 50")
    if "controller bus off" not in recording.said:
        wrong.append("bus-off is not shown")
    return wrong + _events(recording, ["bus_off", "error_active"]) + _numbers(recording, list(range(2000)))


def gone_and_back(folder: Path) -> list[str]:
    """An interface that is unplugged: read again within 2 s of being there again, the gap reported in the log."""
    away = 1.5
    steps: list[list[Any]] = [["frames", 500, 1000], ["gone", away], ["frames", 500, 1000], ["idle"]]
    recording, _, wrong = _played(folder, steps, 1000)
    log = open_log(recording.output)
    times = [log.start_utc + f.t for f in log]
    there = dict(faulty_bus.Script(folder / "script.json").instants())["gone"] + away
    if not 0.0 <= times[500] - there <= MAX_RETURN_S:
        wrong.append(f"back {times[500] - there:.3f} s after the interface was")
    gap = next((e.says for e in markers(recording.output) if e.what == "bus_back"), "")
    if "nothing was received for" not in gap:
        wrong.append(f"the gap is not reported: {gap!r}")
    return wrong + _events(recording, ["bus_lost", "bus_back"]) + _numbers(recording, list(range(1000)))


def overrun(folder: Path) -> list[str]:
    """The process is stopped, the socket's buffer is full: what the kernel drops is counted and reported in the log."""
    with Recording(folder / "x.blf", talk=folder, before=SMALL_BUFFER) as recording:
        Traffic(1000.0, 200).start().join()
        time.sleep(0.5)
        recording.process.send_signal(signal.SIGSTOP)
        Traffic(math.inf, 5000).start().join()
        recording.process.send_signal(signal.SIGCONT)
        time.sleep(2.0)
        code, reported = recording.end(), recording.reported()
        kept = len(by_canid(folder / "x.blf").frames)
        wrong = [] if code == 143 else [f"exit code {code}: {recording.said}"]
        if not reported["drops"] or kept + reported["drops"] != 5200 or kept != reported["written"]:
            wrong.append(f"{kept} recorded and {reported['drops']} counted of 5200")
        in_log = [e.says for e in markers(folder / "x.blf") if e.what == "frames_dropped"]
        if not in_log or f"({reported['drops']:,} in all)" not in in_log[-1]:
            wrong.append(f"the log says {in_log}")
        if " dropped" not in recording.said:
            wrong.append("not shown")
    return wrong


def clock_steps(folder: Path) -> list[str]:
    """The clock is set on by an hour, then back by two: reported, and every frame keeps the time that it was stamped."""
    steps: list[list[Any]] = [["frames", 1500, 1000], ["clock", CLOCK_STEP_S], ["frames", 1500, 1000]]
    steps += [["clock", -2 * CLOCK_STEP_S], ["frames", 1500, 1000], ["idle"]]
    recording, reported, wrong = _played(folder, steps, 4500)
    first, second = folder / "x.blf", folder / "x-2.blf"
    if reported["path"] != str(second) or not second.exists():
        return [*wrong, f"no new file for times before the first one's start: {reported['path']}"]
    instants = [at for name, at in faulty_bus.Script(folder / "script.json").instants() if name == "frames"]
    ours = [by_canid(first), by_canid(second)]
    times = ours[0].times + ours[1].times
    stamped = [
        times[0] - instants[0],
        times[1500] - instants[1] - CLOCK_STEP_S,
        times[3000] - instants[2] + CLOCK_STEP_S,
    ]
    if max(map(abs, stamped)) > MAX_STAMP_ERROR_S:
        wrong.append(f"times are off by {stamped} s")
    if (len(ours[0].frames), len(ours[1].frames)) != (3000, 1500):
        wrong.append(f"{len(ours[0].frames)} and {len(ours[1].frames)} frames")
    steps_reported = [e["says"] for e in recording.journal() if e["what"] == "clock_step"]
    later = folder / "x-2.events.jsonl"
    steps_reported += (
        [text for text in later.read_text().splitlines() if "clock_step" in text] if later.exists() else []
    )
    sizes = [
        float(found[1]) for text in steps_reported if (found := re.search(r"stepped by ([-+.0-9]+) s", text))
    ]
    if len(sizes) != 2 or abs(sizes[0] - CLOCK_STEP_S) > 0.5 or abs(sizes[1] + 2 * CLOCK_STEP_S) > 0.5:
        wrong.append(f"reported were {steps_reported}")
    return wrong + [text for text in (disagreement(first), disagreement(second)) if text]


def twice_and_swapped(folder: Path) -> list[str]:
    """Frames that come twice or in the wrong order are recorded as they came."""
    steps = [["frames", 100, 1000], ["duplicate", 50], ["swap", 50], ["frames", 100, 1000], ["idle"]]
    recording, _, wrong = _played(folder, steps, 350)
    came = [*range(100), *(i for i in range(100, 150) for _ in (1, 2))]
    came += [i + d for i in range(150, 250, 2) for d in (1, 0)] + list(range(250, 350))
    return wrong + _numbers(recording, came)


def which_clock(folder: Path) -> list[str]:
    """The log itself says which clock stamped its frames, each file of a series too."""
    with Recording(folder / "x.blf", "--file-time", "1s", talk=folder) as recording:
        Traffic(1000.0, 2500).start().join()
        time.sleep(0.5)
        recording.end()
        reported = recording.reported()
    files = sorted(folder.glob("x_*.blf"))
    said = [[e.says for e in markers(path) if e.what == "stamp_clock"] for path in files]
    wrong = (
        [] if reported["buses"][0]["clock"] == "kernel" else [f"--json says {reported['buses'][0]['clock']}"]
    )
    if len(files) < 2 or any(len(each) != 1 or "the kernel's clock" not in each[0] for each in said):
        wrong.append(f"the logs say {said}")
    return wrong


CASES: tuple[tuple[str, Callable[[Path], list[str]]], ...] = (
    ("error frames, bus-off", errors_and_bus_off),
    ("interface gone and back", gone_and_back),
    ("receive buffer overrun", overrun),
    ("clock steps", clock_steps),
    ("frames twice, frames swapped", twice_and_swapped),
    ("which clock stamped", which_clock),
)
TRIALS = 3 * len(CASES)


def trial(k: int, seed: int = 0) -> Iterator[Outcome]:
    """The cases in turn."""
    name, case = CASES[k % len(CASES)]
    with TemporaryDirectory() as folder:
        yield Outcome(name, math.nan, 0, "; ".join(case(Path(folder))))


def _played(folder: Path, steps: list[list[Any]], frames: int) -> tuple[Recording, dict[str, Any], list[str]]:
    bus = faulty_bus.script(folder, steps)
    with Recording(folder / "x.blf", talk=folder, bus=bus.words, before=faulty_bus.BEFORE) as recording:
        until(lambda: bus.handed_over() >= frames or recording.process.poll() is not None)
        code, reported = recording.end(), recording.reported()
    return recording, reported, [] if code == 143 else [f"exit code {code}: {recording.said}"]


def _numbers(recording: Recording, wanted: list[int]) -> list[str]:
    frames = [f for f in open_log(recording.output) if not f.flags & Flag.ERROR]
    numbers = [int.from_bytes(f.data[:4], "big") for f in frames]
    return [] if numbers == wanted else [f"{len(numbers)} frames of {len(wanted)}, or in another order"]


def _events(recording: Recording, wanted: list[str]) -> list[str]:
    """The same events in the journal and in the log, and no others of a bus."""
    own = ("bus_lost", "bus_back", "bus_off", "error_active", "error_passive")
    in_journal = [e["what"] for e in recording.journal() if e["what"] in own]
    in_log = [e.what for e in markers(recording.output) if e.what in own]
    return [] if in_journal == in_log == wanted else [f"journal {in_journal}, log {in_log}"]
