"""Playback of a recorded log through the pipeline: at a speed, paused, and from another time on.

Estimates rest on all that came before them. A seek forwards therefore runs the log as fast as it goes up to the target,
and a seek backwards begins the log anew and does the same: numbers after a seek are those of an uninterrupted replay.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Generator
from contextlib import closing, suppress
from pathlib import Path
from typing import NamedTuple

from canid import drive_reader, pipeline
from canid.controls import Controls, Playback
from canid.errors import CanidError
from canid.logs import Log, open_log
from canid.vehicle import Vehicle

# s of real time that a chunk lasts, as live
CHUNK_S = 0.05
# s of the log that a chunk lasts at most while a person is at the controls: a fifth of a second of computing, so that
# a pause at full speed acts soon
MAX_SPAN_S = 2.0
# s between two checks of the controls
POLL_S = 0.02
# s between two positions
POSITION_INTERVAL_S = 0.2
NO_WAY_BACK = "a replay with --state cannot go back: the state would learn from the same drive twice"


class Played(NamedTuple):
    """One chunk of the log, when its time has come."""

    step: drive_reader.Step
    fresh: list[pipeline.Output]  # outputs that no earlier pass has given
    frames: int  # of this pass so far


class Position(NamedTuple):
    """Where a replay is."""

    t: float  # s of the log
    playback: Playback
    ended: bool  # the end of the log, or of the part, was reached
    passes: int  # how often the log was begun
    seeking: float | None  # s, the target of a seek that is under way
    says: str  # why the last request was refused; "": it was not


class Pacing:
    """When the frames of a log are due: their time, stretched by the speed."""

    def __init__(self, playback: Playback, t: float) -> None:
        """The frame at `t` s is due now."""
        self.playback = playback
        self._t = t
        self._began = time.monotonic()

    def ahead(self, t: float) -> float:
        """S until the frame at `t` is due; infinite while paused."""
        if self.playback.paused:
            return float("inf")
        return self._began + (t - self._t) / self.playback.speed - time.monotonic()


def play(
    log: Log,
    vehicle: Vehicle,
    controls: Controls,
    *,
    start: float = 0.0,
    stop: float = float("inf"),
    keep: str | Path | None = None,
    interactive: bool = False,
    stays: bool = False,
) -> Generator[Played | Position, None, None]:
    """Play a log.

    Args:
        log: from `open_log`.
        vehicle: from `read_vehicle`.
        controls: speed, pause, seek and stop; asked every `POLL_S`.
        start: s, leave out what is earlier.
        stop: s, leave out what is later.
        keep: state file, see `drive_reader.run`. There is no way back then.
        interactive: the controls may change. Otherwise the log is cut as for the speed at the beginning.
        stays: after the end, wait for a seek backwards or a stop.

    Yields:
        `Played` for each chunk, and a `Position` five times a second.

    Raises:
        ConfigError, OutputError: as `drive_reader.run`.
    """
    seen = passes = 0
    target: float | None = None
    t, says, reported = start, "", 0.0

    def span(first: float) -> float:
        if target is not None and first < target:
            return min(target - first, MAX_SPAN_S)
        return min(CHUNK_S * controls.playback.speed, MAX_SPAN_S)

    def position(*, ended: bool = False) -> Position:
        nonlocal reported
        reported = time.monotonic()
        return Position(t, controls.playback, ended, passes, target, says)

    def asked() -> tuple[float | None, bool]:
        """The target of a seek, and whether the log must be begun anew for it."""
        nonlocal says
        to = controls.take_seek()
        if to is None:
            return target, False
        to = min(max(to, start), stop)
        says = NO_WAY_BACK if to < t and keep is not None else ""
        return (target, False) if says else (to, to < t)

    again = True
    while again:
        again, items, frames = False, 0, 0
        passes += 1
        t = start
        if passes > 1:
            yield position()
        pacing: Pacing | None = None
        steps = drive_reader.run(
            log,
            vehicle,
            start=start,
            stop=stop,
            keep=keep,
            span=span if interactive else CHUNK_S * controls.playback.speed,
        )
        with closing(steps):
            for step in steps:
                first, last = float(step.chunk.t[0]), float(step.chunk.t[-1])
                while True:
                    target, again = asked()
                    if again or controls.stop_requested:
                        break
                    if target is not None and last >= target:
                        target, pacing = None, None
                    if pacing is None or pacing.playback != controls.playback:
                        pacing = Pacing(controls.playback, first)
                    ahead = pacing.ahead(last)
                    if ahead <= 0.0 or target is not None:
                        break
                    if time.monotonic() - reported >= POSITION_INTERVAL_S:
                        yield position()
                    time.sleep(min(ahead, POLL_S) if interactive else ahead)
                if again or controls.stop_requested:
                    break
                frames += len(step.chunk.t)
                fresh = step.out[max(seen - items, 0) :]
                items += len(step.out)
                seen = max(seen, items)
                t = last
                yield Played(step, fresh, frames)
                if time.monotonic() - reported >= POSITION_INTERVAL_S:
                    yield position()
        while stays and not again and not controls.stop_requested:
            target = None
            if time.monotonic() - reported >= POSITION_INTERVAL_S:
                yield position(ended=True)
            time.sleep(POLL_S)
            target, again = asked()


class Duration:
    """The duration of a log, found by a thread that reads it once without decoding; `seconds` is None until then."""

    def __init__(self, path: Path, stop: float = float("inf")) -> None:
        """Begin to read; nothing later than `stop` s counts."""
        self.seconds: float | None = None
        self._closed = False
        threading.Thread(target=self._read, args=(path, stop), name="canid-duration", daemon=True).start()

    def _read(self, path: Path, stop: float) -> None:
        latest = 0.0
        with suppress(CanidError, OSError):
            for chunk in open_log(path).columns():
                if self._closed:
                    return
                latest = max(latest, float(chunk.t.max(initial=0.0)))
                if latest >= stop:
                    break
            self.seconds = min(latest, stop)

    def close(self) -> None:
        """Stop reading."""
        self._closed = True
