"""Reads ASAM .mf4 with bus logging through asammdf, in a child process (see `mf4_child`)."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

from canid.io.logs.mf4.bus_groups import NO_ASAMMDF, End, Part, Start
from canid.io.logs.reader_state import ReadState
from canid.values.errors import ConfigError, DamagedLogError, LogError
from canid.values.frame_columns import WantedIds, rows, select
from canid.values.processes.child import EXIT_S, Child, NoAnswerError
from canid.values.processes.child_process import command
from canid.values.types import Columns, Damage

SIGNATURE = b"MDF"
# frames of one chunk of columns, at most
_CHUNK_FRAMES = 65_536


def read_mf4(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of time; `wanted`: frames with other ids may be left out.

    Raises ConfigError without asammdf and where the file has signals and no frames, LogError where nothing can be read.
    """
    first: int | None = None
    end = End("")
    words = command("canid.io.logs.mf4.mf4_child", os.path.abspath(path), options=("-W", "ignore"))
    with Child(words, answers=(Start, Part, End)) as child:
        start = 0
        try:
            while not isinstance(answer := child.receive(), End):
                if isinstance(answer, Start):
                    start = answer.epoch_ns(state.zone)
                    if answer.buses:
                        named = ", ".join(f"{name} is bus {k}" for k, name in enumerate(answer.buses))
                        state.remark(f"it has no channel numbers: {named}")
                    continue
                ns, *columns = answer
                if first is None:
                    first = int(ns[0])
                    state.start_ns = start + first
                    # asammdf has opened the file; how much of it is read is not known
                    state.done = state.size // 2
                state.frames += len(ns)
                chunk = Columns((ns - first) * 1e-9, *columns)
                for row in range(0, len(ns), _CHUNK_FRAMES):
                    part = rows(chunk, row, row + _CHUNK_FRAMES)
                    wanted_rows = None if wanted is None else wanted.rows(part.id)
                    if wanted_rows is None:
                        yield part
                    elif len(wanted_rows):
                        yield select(part, wanted_rows)
            end = answer
        except NoAnswerError:
            code = child.end(EXIT_S)
            slow = code == -getattr(signal, "SIGPROF", 0)
            said = "found no frame in it for many seconds" if slow else f"ended with code {code}"
            end = End(f"asammdf failed ({said})")
    if end.why == NO_ASAMMDF:
        raise ConfigError(f"{path}: reading .mf4 needs asammdf; run: pip install canid[mf4]")
    _close(path, state, end)


def _close(path: Path, state: ReadState, end: End) -> None:
    """Count what is no frame. Raises LogError where nothing was read."""
    state.other_kinds.update(dict(end.others))
    why = end.why
    damaged = end.incomplete + end.impossible + end.failed
    total = -1 if why else state.frames + damaged
    says = "; ".join(
        text
        for n, text in (
            (end.incomplete, f"{end.incomplete:,} records are incomplete, as behind a power failure"),
            (end.impossible, f"{end.impossible:,} frames have a time, id, channel or length that cannot be"),
            (end.failed, f"{end.failed:,} records cannot be read ({end.failure})"),
            (bool(why), why),
        )
        if n
    )
    state.damaged = damaged + bool(why)
    state.done = state.size
    if says and not state.frames:
        with path.open("rb") as file:
            known = file.read(len(SIGNATURE)) == SIGNATURE
        if why and not damaged:
            raise (DamagedLogError if known else LogError)(f"cannot read {path}: {why}")
        raise DamagedLogError(f"{path} holds no frame that can be read ({says})")
    if says:
        share = f" of {total:,}" if total >= 0 else ""
        state.damage = Damage(f"read {state.frames:,}{share} frames: {says}", state.frames, total)
    if not state.frames and end.n_signals:
        more = f" and {end.n_signals - len(end.signals):,} more" if end.n_signals > len(end.signals) else ""
        raise ConfigError(
            f"{path}: is a measurement of decoded signals ({', '.join(end.signals)}{more}), without CAN frames; "
            f"identify and diagnose read it as a table of named columns; for other verbs record the bus"
        )
