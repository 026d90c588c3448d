"""Playback of a recorded log through the pipeline: at a speed, paused, and from another time on.

Estimates rest on all that came before them. A seek forwards therefore runs the log as fast as it goes up to the target.
What came out is kept: a seek within what was run gives the same values again and computes nothing, so that numbers after
a seek are those of an uninterrupted replay.
"""

from __future__ import annotations

import math
import threading
import time
from bisect import bisect_right
from collections import Counter
from collections.abc import Generator
from contextlib import closing, suppress
from pathlib import Path
from typing import NamedTuple

from canid.analysis.drive import drive_reader
from canid.io.logs import Log, open_log
from canid.io.recording.controls import Controls, Playback
from canid.models.pipeline import pipeline
from canid.signals.vehicle import Vehicle
from canid.values.errors import CanidError
from canid.values.types import Event
from canid.values.window import WHOLE, Window

# s of real time that a chunk lasts, as live
CHUNK_S = 0.05
# s of the log that a chunk lasts at most while a person is at the controls: a fifth of a second of computing, so that
# a pause at full speed acts soon
MAX_SPAN_S = 2.0
# s between two checks of the controls
POLL_S = 0.02
# s between two positions
POSITION_INTERVAL_S = 0.2
# s of the log that is given again at once
PIECE_S = 0.1
# of each kind, up to the target of a seek: the last minute of samples at 10 Hz, which a page draws whole, and of older
# ones as many as a plot shows. All of an hour would take the page seconds
RECENT, MAX_OLDER = 600, 600
NO_WAY_BACK = "a replay with --state cannot go back: the state would learn from the same drive twice"


class Played(NamedTuple):
    """A piece of the log, when its time has come."""

    t: float  # s, its end
    out: list[pipeline.Output]
    fresh: list[pipeline.Output]  # outputs that were not given before
    frames: int  # of the log up to here
    state: pipeline.State  # after what was run so far


class _Kept(NamedTuple):
    """What came out of a piece of the log."""

    first: float  # s
    last: float  # s
    out: list[pipeline.Output]
    frames: int  # of the log up to its end


class Position(NamedTuple):
    """Where a replay is."""

    t: float  # s of the log
    playback: Playback
    ended: bool  # the end of the log, or of the part, was reached
    passes: int  # how often the log was begun, and given again from its begin
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
    within: Window = WHOLE,
    keep: str | Path | None = None,
    interactive: bool = False,
    stays: bool = False,
) -> Generator[Played | Position, None, None]:
    """Play a log.

    Args:
        log: from `open_log`.
        vehicle: from `read_vehicle`.
        controls: speed, pause, seek and stop; asked every `POLL_S`.
        within: the part of the log.
        keep: state file, see `drive_reader.run`. There is no way back then.
        interactive: the controls may change. Otherwise the log is cut as for the speed at the beginning.
        stays: after the end, wait for a seek backwards or a stop.

    Yields:
        `Played` for each piece, and a `Position` five times a second.

    Raises:
        ConfigError, OutputError: as `drive_reader.run`.
    """
    target: float | None = None
    t, says, reported, passes = within.begin, "", 0.0, 1
    kept: list[_Kept] = []
    at = given = frames = 0  # the piece that is next; how many were given; frames that were run
    state: pipeline.State | None = None

    def span(first: float) -> float:
        if target is not None and first < target:
            return min(target - first, MAX_SPAN_S)
        return min(CHUNK_S * controls.playback.speed, MAX_SPAN_S)

    def position(*, ended: bool = False) -> Position:
        nonlocal reported
        reported = time.monotonic()
        return Position(t, controls.playback, ended, passes, target, says)

    def asked() -> tuple[float | None, bool]:
        """The target of a seek, and whether it has just come."""
        nonlocal says
        to = controls.take_seek()
        if to is None:
            return target, False
        to = min(max(to, within.begin), within.stop)
        says = NO_WAY_BACK if to < t and keep is not None else ""
        return (target, False) if says else (to, True)

    steps = drive_reader.run(
        log,
        vehicle,
        within=within,
        keep=keep,
        span=span if interactive else CHUNK_S * controls.playback.speed,
    )
    pacing: Pacing | None = None
    sought = False
    with closing(steps):
        while not controls.stop_requested:
            if sought and target is not None:
                sought, pacing = False, None
                if target < t:
                    at, passes, t = 0, passes + 1, within.begin
                    yield position()
                until = bisect_right(kept, target, lo=at, hi=given, key=lambda played: played.last)
                if state is not None and until > at:
                    items = [item for played in kept[at:until] for item in played.out]
                    at, t = until, kept[until - 1].last
                    yield Played(t, _thinned(items), [], kept[until - 1].frames, state)
                if at < given:
                    target = None
            if at == len(kept):
                if not interactive:
                    kept, at, given = [], 0, 0
                step = next(steps, None)
                if step is None:
                    target = None
                    if not stays:
                        return
                    if time.monotonic() - reported >= POSITION_INTERVAL_S:
                        yield position(ended=True)
                    time.sleep(POLL_S)
                    target, sought = asked()
                    continue
                state = step.state
                kept += _pieces(step, frames) if interactive else [_whole(step, frames)]
                frames += len(step.chunk.t)
            assert state is not None  # a step was run
            piece = kept[at]
            while not controls.stop_requested:
                target, sought = asked()
                if sought:
                    break
                if target is not None and piece.last >= target:
                    target, pacing = None, None
                if pacing is None or pacing.playback != controls.playback:
                    pacing = Pacing(controls.playback, piece.first)
                ahead = pacing.ahead(piece.last)
                if ahead <= 0.0 or target is not None:
                    break
                if time.monotonic() - reported >= POSITION_INTERVAL_S:
                    yield position()
                time.sleep(min(ahead, POLL_S) if interactive else ahead)
            if sought or controls.stop_requested:
                continue
            fresh = piece.out if at >= given else []
            at += 1
            given, t = max(given, at), piece.last
            yield Played(t, piece.out, fresh, piece.frames, state)
            if time.monotonic() - reported >= POSITION_INTERVAL_S:
                yield position()


def _whole(step: drive_reader.Step, frames: int) -> _Kept:
    """A chunk as one piece; `frames`: before it."""
    t = step.chunk.t
    return _Kept(float(t[0]), float(t[-1]), step.out, frames + len(t))


def _pieces(step: drive_reader.Step, frames: int) -> list[_Kept]:
    """A chunk in pieces of at most `PIECE_S`, each with what came by its end; only at the last one the frames count."""
    whole = _whole(step, frames)
    n = max(math.ceil((whole.last - whole.first) / PIECE_S), 1)
    ends = [whole.first + (k + 1) * (whole.last - whole.first) / n for k in range(n - 1)] + [whole.last]
    out, begin = [], 0
    for k, end in enumerate(ends):
        stop = begin
        while stop < len(step.out) and (step.out[stop].t <= end or k == n - 1):
            stop += 1
        first = whole.first if k == 0 else ends[k - 1]
        out.append(_Kept(first, end, step.out[begin:stop], whole.frames if k == n - 1 else frames))
        begin = stop
    return out


def _thinned(items: list[pipeline.Output]) -> list[pipeline.Output]:
    """Outputs in their order: of each kind the last `RECENT`, and at most `MAX_OLDER` of those before."""
    left = Counter(type(item) for item in items)
    every = {kind: max(math.ceil((n - RECENT) / MAX_OLDER), 1) for kind, n in left.items()}
    out = []
    for item in items:
        kind = type(item)
        left[kind] -= 1
        if isinstance(item, Event) or left[kind] < RECENT or left[kind] % every[kind] == 0:
            out.append(item)
    return out


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
