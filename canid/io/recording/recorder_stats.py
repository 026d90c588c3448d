"""The state of the recorder, for views and exit codes."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from canid.io.recording.trigger_gate import TriggerStats


class BusStats(NamedTuple):
    """One bus."""

    name: str
    state: str  # "open", or "lost: why"
    frames: int
    errors: int  # error frames
    drops: int  # dropped by the kernel before they were read; 0 where unknown
    load: float  # share of the bus's time in the last second; NaN: bit rate unknown
    controller: str  # "error_active", "error_warning", "error_passive", "bus_off"; "" unknown
    clock: str = "unknown"  # that stamps the frames: a name of `TimestampSource`, in lower case
    tec: int | None = None  # the controller's transmit error counter; None: unknown
    rec: int | None = None  # its receive error counter
    impossible: int = 0  # messages left out because no bus can carry them


class Stats(NamedTuple):
    """The recorder at one time."""

    # "waiting", "recording", "armed" or "recording (trigger: why)", "listening" (no file), "failed: why", "stopping",
    # "stopped"
    state: str
    path: Path | None  # the log, or the newest of them; the name may differ from the one asked for
    frames: int  # received
    written: int  # appended to the log
    bytes: int  # in the file, or the newest one
    rate: float  # frames/s over the last second
    errors: int  # error frames
    drops_bus: int
    drops_estimator: int  # frames that the consumer did not get because it raised
    lag: float  # s from a frame's arrival until it was appended, the latest batch's first
    waiting: int  # frames received and not yet appended
    start_ns: int | None  # epoch ns of the first frame
    buses: tuple[BusStats, ...]
    files: int = 0  # that were begun
    drops_disk: int = 0  # frames that are not in the log because the disk, or canid itself, was too slow
    events_unwritten: int = 0  # that are not in the journal
    trigger: TriggerStats | None = None  # None: all is recorded
    hidden: str = ""  # at the end: why the log is not seen under `path`, and what shows it
