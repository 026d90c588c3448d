"""The same log by three readers that share no code: canid, python-can and tshark."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

from canid.frames import open_log, python_can
from canid.types import Flag


class Read(NamedTuple):
    """What one reader found: (id, data) in the file's order, absolute times in s, and its complaint."""

    frames: list[tuple[int, bytes]]
    times: list[float]
    complaint: str = ""


def by_canid(path: Path) -> Read:
    """Our own reader."""
    log = open_log(path)
    frames = [f for f in log if not f.flags & Flag.ERROR]
    complaint = log.damage.says if log.damage else ""
    return Read([(f.id, f.data) for f in frames], [log.start_utc + f.t for f in frames], complaint)


def by_python_can(path: Path) -> Read:
    """python-can's, as far as it comes."""
    frames, times, complaint = [], [], ""
    try:
        # an .asc's own times count from its date, which has whole ms
        words = {"relative_timestamp": False} if path.suffix == ".asc" else {}
        with python_can.load().LogReader(str(path), **words) as reader:
            for message in reader:
                if not message.is_error_frame:
                    frames.append((message.arbitration_id, bytes(message.data)))
                    times.append(message.timestamp)
    except Exception as error:  # of any kind: it has no kind of its own
        complaint = f"{type(error).__name__}: {error}"
    return Read(frames, times, complaint)


def by_tshark(path: Path) -> Read | None:
    """Wireshark's; None where it is not installed."""
    if shutil.which("tshark") is None:
        return None
    fields = ("frame.time_epoch", "can.id", "data.data")
    asked = [word for field in fields for word in ("-e", field)]
    # heuristics off: a payload that looks like some protocol would be shown as that
    command = ["tshark", "-n", "-r", str(path), "-T", "fields", *asked, "-d", "can.subdissector,data"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode and not done.stdout:
        command = command[:-2]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    frames, times = [], []
    for line in done.stdout.splitlines():
        at, name, data = line.split("\t")
        frames.append((int(name), bytes.fromhex(data.replace(":", ""))))
        times.append(float(at))
    return Read(frames, times, "" if done.returncode == 0 else done.stderr.strip().splitlines()[-1])


def disagreement(path: Path) -> str:
    """Where the three do not read the same; "" where they do. Microseconds may differ, by their floats."""
    ours = by_canid(path)
    others = {"python-can": by_python_can(path), "tshark": by_tshark(path) if path.suffix == ".blf" else None}
    for name, other in others.items():
        if other is None:
            continue
        if other.complaint:
            return f"{name} complains: {other.complaint}"
        if other.frames != ours.frames:
            return f"{name} reads {len(other.frames)} frames, canid {len(ours.frames)}"
        if any(
            abs(a - b) > (1.1e-3 if path.suffix == ".asc" else 2e-6)
            for a, b in zip(ours.times, other.times, strict=True)
        ):
            return f"{name} reads other times"
    return f"canid complains: {ours.complaint}" if ours.complaint else ""
