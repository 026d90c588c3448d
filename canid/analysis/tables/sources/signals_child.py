"""Run with FILE as a child process: sends the decoded signals of an .mf4 or .mcap to its parent.

A process of its own because asammdf is slow to import, and because these files are untrusted. Messages: the start
(`bus_groups.Start`), then a tuple `(name, t, [(signal, unit, values), ...], left out)` for each group, t in s since that
start, values an array of floats or a list of texts, and a sentence for each signal whose conversion is not applied; the last
message is a text: `COMPLETE`, or why no more can be read.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from canid.io.logs.mf4 import raw_mdf
from canid.io.logs.mf4.bus_groups import Start
from canid.io.logs.mf4.conversions import ConversionError, physical
from canid.io.logs.mf4.mf4_child import failure, start, times
from canid.values.processes import limits
from canid.values.processes.confinement import confine
from canid.values.processes.serve import Connection, connect

COMPLETE, NO_ASAMMDF, NO_MCAP = "", "asammdf is missing", "mcap is missing"
# s of CPU time up to each message, and s per MiB of the file
_CPU_S, _CPU_S_PER_MIB = 20.0, 2.0
# bytes beyond the modules' own, and bytes per byte of the file for the unpacked columns
_EXTRA_BYTES, _BYTES_PER_FILE_BYTE = 512 << 20, 64
# objects within objects of a JSON message
_MAX_DEPTH = 6
# sentences of what is left out, of one group
_MAX_SENTENCES = 100
Group = tuple[str, Any, list[tuple[str, str, Any]], list[str]]


def main(path: str) -> int:
    """Send all signals of `path`."""
    parent = connect(plain=True)
    size = os.path.getsize(path)
    limits.limit_more_data(_EXTRA_BYTES + _BYTES_PER_FILE_BYTE * size)
    limits.limit_cpu(_CPU_S + _CPU_S_PER_MIB * size / (1 << 20))
    read = _mcap if Path(path).suffix.lower() == ".mcap" else _mf4
    parent.answer(_sent(read, path, parent))
    return 0


def _sent(read: Any, path: str, parent: Connection) -> str:
    try:
        for message in read(path):
            parent.answer(message)
    except ImportError:
        return NO_MCAP if read is _mcap else NO_ASAMMDF
    except BrokenPipeError:
        raise
    except Exception as error:  # both libraries raise errors of any kind on damaged files
        limits.limit_data(None)
        return _failure(error, read)
    return COMPLETE


def _failure(error: Exception, read: Any) -> str:
    if read is _mf4:
        return failure(error)
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def _mf4(path: str) -> Iterator[Start | Group]:
    mdf = raw_mdf.opened(raw_mdf.load(), path)
    file = mdf.file
    yield start(file.header)
    for index, group in enumerate(file.groups):
        master = file.masters_db.get(index)
        if master is None or not group.channel_group.cycles_nr or group.channel_group.flags & 2:
            continue  # without a time, or events of a bus
        signals: list[tuple[str, str, Any]] = []
        left_out: list[str] = []
        name = str(group.channel_group.acq_name or f"group {index}")
        try:
            t = times(mdf, index)
        except ConversionError as error:
            yield name, np.zeros(0), [], [f"{error}; all of {name} has its times from it"]
            continue
        for place, channel in enumerate(group.channels):
            if place != master:
                try:
                    values = _signal(mdf, index, place)
                except ConversionError as error:
                    left_out.append(str(error))
                    continue
                except MemoryError:
                    raise
                except Exception:  # one channel that cannot be read costs no other
                    continue
                if values is not None and len(values) == len(t):
                    conversion = mdf.conversions.get((index, place))
                    unit = str((conversion and conversion.unit) or channel.unit or "")
                    signals.append((str(channel.name), unit, values))
        if signals or left_out:
            yield name, t, signals, left_out[:_MAX_SENTENCES]


def _signal(mdf: raw_mdf.RawMdf, index: int, place: int) -> Any:
    """Physical values of a channel; None: a structure or bytes."""
    raw, invalid = mdf.samples(index, place)
    if raw.ndim != 1 or raw.dtype.names:
        return None
    name = str(mdf.file.groups[index].channels[place].name)
    return _values(physical(raw, mdf.conversions.get((index, place)), name), invalid)


def _values(samples: Any, invalid: Any) -> Any:
    """Numbers with NaN where they are invalid, or texts; None: bytes."""
    if samples.dtype.kind in "biuf":
        values = samples.astype(float)
        if invalid is not None:
            values[np.asarray(invalid, bool)] = np.nan
        return values
    if samples.dtype.kind in "SUO":
        return [
            cell.decode("utf-8", "replace") if isinstance(cell, bytes) else str(cell)
            for cell in samples.tolist()
        ]
    return None


def _mcap(path: str) -> Iterator[Start | Group]:
    from mcap.reader import make_reader

    confine()

    rows: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    units: dict[str, dict[str, str]] = {}
    other: set[str] = set()
    with open(path, "rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            if channel.message_encoding != "json":
                other.add(channel.message_encoding)
                continue
            value = json.loads(message.data)
            if isinstance(value, dict):
                rows.setdefault(channel.topic, []).append((message.log_time, _flat(value, "", _MAX_DEPTH)))
                if channel.topic not in units:
                    stated = json.loads(channel.metadata.get("units", "{}"))
                    units[channel.topic] = stated if isinstance(stated, dict) else {}
    if not rows and other:
        raise ValueError(f"its messages are {', '.join(sorted(other))[:60]}, and not json")
    # a log without a date counts from 0
    first = min((ns for stamped in rows.values() for ns, _ in stamped), default=0)
    zero = first if first > 10**18 // 2 else 0
    yield Start(zero, False)
    for topic, stamped in rows.items():
        t = np.array([(ns - zero) * 1e-9 for ns, _ in stamped])
        signals = []
        for name in dict.fromkeys(key for _, row in stamped for key in row):
            cells = [row.get(name) for _, row in stamped]
            if any(isinstance(cell, str) for cell in cells):
                values: Any = ["" if cell is None else str(cell) for cell in cells]
            else:
                values = np.array([np.nan if cell is None else float(cell) for cell in cells])
            # canid's own files have the time of a row twice
            if name != "t" or not units[topic]:
                signals.append((name, str(units[topic].get(name, "")), values))
        yield topic, t, signals, []


def _flat(value: dict[str, Any], before: str, depth: int) -> dict[str, Any]:
    """Numbers and texts of an object, those of objects within it as "outer.inner"."""
    flat: dict[str, Any] = {}
    for key, each in value.items():
        if isinstance(each, dict) and depth:
            flat |= _flat(each, f"{before}{key}.", depth - 1)
        elif isinstance(each, bool | int | float | str):
            flat[f"{before}{key}"] = each
    return flat


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1]))
