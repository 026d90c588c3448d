"""Files of peers' test suites, by count and value: canid against python-can (logs) and cantools (databases).

    python -m benchmarks peer_files FOLDER

FOLDER holds clones such as python-can, cantools, vector_blf, SavvyCAN. A table of kinds, then every file that differs: with
who is right and why where that is known. Ends with 1 where one differs that is not.
"""

from __future__ import annotations

import argparse
import math
import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peer_files.known import known
from canid.analysis.drive.signal_columns import MessageFrames, decode
from canid.io.logs import open_log
from canid.signals.dbc_text.parsing import Parser
from canid.signals.vehicle.database import load
from canid.values.errors import CanidError
from canid.values.frame_columns import FD_BYTES, octets_of
from canid.values.types import Flag

LOGS = (".asc", ".blf", ".trc", ".log", ".csv", ".mf4")
DATABASES = (".dbc", ".kcd", ".sym", ".arxml")
# (µs, id, extended, kind, data): what both have of a frame; python-can's .trc counts channels from 1, canid from 0
FrameKey = tuple[int, int, bool, str, bytes]
# s; python-can rounds times to floats
_CLOSE_US = 2
_PAYLOADS = 20  # drawn for each message
# relative, of floats that were computed in another order
_CLOSE = 1e-9


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks peer_files", description=__doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    args = parser.parse_args()
    found: Counter[tuple[str, str]] = Counter()
    unknown = 0
    for path in sorted(args.folder.rglob("*")):
        compare = _compare_of(path)
        if compare is None:
            continue
        says = compare(path)
        why = known(path.name) if says.startswith("differs") else None
        found[path.suffix.lower(), says.partition(":")[0]] += 1
        if says.startswith("differs"):
            unknown += why is None
            judged = f"{why.right} right: {why.why}" if why is not None else "NOT KNOWN"
            print(f"{path.relative_to(args.folder)}: {says}; {judged}", flush=True)
    print()
    for (suffix, says), n in sorted(found.items()):
        print(f"{suffix:8} {says:24} {n:6,}")
    return int(unknown > 0)


def _compare_of(path: Path) -> Callable[[Path], str] | None:
    if not path.is_file():
        return None
    suffix = path.suffix.lower()
    return _log if suffix in LOGS else _database if suffix in DATABASES else None


def _log(path: Path) -> str:
    """`equal`, `differs: how`, or who alone reads it."""
    ours, theirs = _ours(path), _theirs(path)
    if ours is None or theirs is None:
        return (
            "both refuse"
            if ours is theirs
            else "canid alone"
            if theirs is None
            else "differs: python-can alone reads it"
        )
    # python-can's times are the epoch's, canid's begin with the log's first line, of whatever kind
    ours = [(frame[0] - ours[0][0], *frame[1:]) for frame in ours]
    if len(ours) != len(theirs):
        return f"differs: {len(ours)} frames, python-can {len(theirs)}"
    for k, (one, other) in enumerate(zip(ours, theirs, strict=True)):
        if one[1:] != other[1:] or abs(one[0] - other[0]) > _CLOSE_US:
            return f"differs: frame {k} is {one}, python-can {other}"
    return "equal"


def _ours(path: Path) -> list[FrameKey] | None:
    try:
        return [
            (
                round(frame.t * 1e6),
                frame.id,
                bool(frame.flags & Flag.EXTENDED),
                _kind(frame.flags),
                frame.data,
            )
            for frame in open_log(path)
            if not frame.flags & Flag.ERROR
        ]
    except CanidError:
        return None


def _kind(flags: int) -> str:
    return " ".join(flag.name or "" for flag in (Flag.REMOTE, Flag.FD, Flag.BRS, Flag.ESI) if flags & flag)


def _theirs(path: Path) -> list[FrameKey] | None:
    import can

    try:
        with can.LogReader(path) as reader:
            messages = [message for message in reader if not message.is_error_frame]
    except Exception:  # each reader has its own kinds
        return None
    if not messages:
        return []
    first = messages[0].timestamp
    return [
        (
            round((message.timestamp - first) * 1e6),
            message.arbitration_id,
            message.is_extended_id,
            " ".join(
                name
                for name, is_so in (
                    ("REMOTE", message.is_remote_frame),
                    ("FD", message.is_fd),
                    ("BRS", message.bitrate_switch),
                    ("ESI", message.error_state_indicator),
                )
                if is_so
            ),
            bytes(message.data) if not message.is_remote_frame else b"",
        )
        for message in messages
    ]


def _database(path: Path) -> str:
    """Messages by id, and the values of drawn payloads of those that both have."""
    import cantools

    try:
        theirs: Any = cantools.database.load_file(path, strict=False)
        messages: dict[tuple[int, bool], Any] | None = {
            (m.frame_id, m.is_extended_frame): m for m in theirs.messages
        }
    except Exception:  # as many kinds as parsers
        messages = None
    try:
        with Parser() as parser:
            ours, _, _ = load(path, None, parser)
    except CanidError:
        if messages is None:
            return "both refuse"
        return "no messages" if not messages else "differs: cantools alone reads it"
    if messages is None:
        return "canid alone"
    mine = {(m.id, m.extended): m for m in ours.messages.values()}
    if mine.keys() != messages.keys():
        return f"differs: {len(mine)} messages, cantools {len(messages)}"
    rng = random.Random(0)
    for key, message in messages.items():
        if message.is_container or not 0 < message.length <= FD_BYTES:
            continue
        payloads = [rng.randbytes(message.length) for _ in range(_PAYLOADS)]
        rows = np.arange(_PAYLOADS, dtype=np.float64)
        frames = MessageFrames(rows, np.full(_PAYLOADS, message.length, np.uint8), octets_of(payloads))
        got = {signal.name: decode(mine[key], signal, frames) for signal in mine[key].signals}
        for k, payload in enumerate(payloads):
            try:
                values = message.decode(payload, decode_choices=False)
            except Exception:  # a selector's number without a page
                continue
            for name, value in values.items():
                column = got.get(name)
                if column is None or not isinstance(value, int | float):
                    continue
                row = np.flatnonzero(column.t == k)
                one = float(column.value[row[0]]) if row.size else math.nan
                if not math.isclose(one, value, rel_tol=_CLOSE, abs_tol=1e-12):
                    return f"differs: {message.name}.{name} is {one}, cantools {value}"
    return "equal"


if __name__ == "__main__":
    raise SystemExit(main())
