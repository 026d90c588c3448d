"""Decoded signals of an .mf4 (a measurement without bus logging) or .mcap as a source of columns, by their names."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from canid.analysis.tables.headings import TIME
from canid.analysis.tables.sources.array_source import ArraySource
from canid.analysis.tables.sources.signals_child import COMPLETE, NO_ASAMMDF, NO_MCAP, Group
from canid.io.logs.local_time import zone_of
from canid.io.logs.mf4.bus_groups import Start
from canid.values.errors import ConfigError, DamagedLogError
from canid.values.processes.child import EXIT_S, Child, NoAnswerError, ending
from canid.values.processes.child_process import command
from canid.values.timestamps import EPOCH_FLOOR_S

# sentences of what is left out that a message has
_NAMED = 3
_MISSING = {
    NO_ASAMMDF: "asammdf; run: pip install canid[mf4]",
    NO_MCAP: "mcap; run: pip install canid[export]",
}


def read_signals_file(path: Path) -> ArraySource:
    """Read all signals.

    A group, or topic, is rows of its own times. A name that several of them have gets the group's before it.

    Raises:
        ConfigError: the package that reads it is missing, or it has no signals.
        DamagedLogError: it cannot be read.
    """
    groups: list[Group] = []
    start_ns = 0
    words = command(
        "canid.analysis.tables.sources.signals_child", os.path.abspath(path), options=("-W", "ignore")
    )
    with Child(words, answers=(Start,)) as child:
        try:
            while not isinstance(answer := child.receive(), str):
                if isinstance(answer, Start):
                    start_ns = answer.epoch_ns(zone_of(None))
                else:
                    groups.append(answer)
            why = answer
        except NoAnswerError:
            why = f"its reader {ending(child.end(EXIT_S))}"
    if why in _MISSING:
        raise ConfigError(f"{path}: reading {path.suffix} needs {_MISSING[why]}")
    if why != COMPLETE:
        raise DamagedLogError(f"cannot read {path}: {why}")
    left_out = [sentence for *_, sentences in groups for sentence in sentences]
    groups = [group for group in groups if group[2]]
    if not groups:
        why = f" that canid reads ({_several(left_out)})" if left_out else ""
        raise ConfigError(f"{path}: holds no signals and no CAN frames{why}")
    source = ArraySource(_columns(groups, start_ns), str(path))
    if left_out:
        source.notes = (f"{path}: {_several(left_out)}",)
    return source


def _several(sentences: list[str]) -> str:
    more = f"; and {len(sentences) - _NAMED:,} more" if len(sentences) > _NAMED else ""
    return "; ".join(sentences[:_NAMED]) + more


def _columns(groups: list[Group], start_ns: int) -> dict[str, Any]:
    """Rows of all groups in the order of time; cells of other groups are empty."""
    t = np.concatenate([np.asarray(of_group, float) for _, of_group, *_ in groups])
    order = np.argsort(t, kind="stable")
    times: Any = t[order]
    if start_ns >= EPOCH_FLOOR_S * 10**9:
        times = (np.round(times * 1e9).astype(np.int64) + start_ns).astype("datetime64[ns]")
    columns = {TIME: times}
    counts = Counter(name for _, _, signals, _ in groups for name, _, _ in signals)
    begin = 0
    for group, of_group, signals, _ in groups:
        part = slice(begin, begin + len(of_group))
        begin += len(of_group)
        for name, unit, values in signals:
            title = name if counts[name] == 1 else f"{group}.{name}"
            heading = f"{title} [{unit}]" if unit else title
            cells: Any = np.full(len(t), np.nan)
            if isinstance(values, list):
                cells = np.full(len(t), None, object)
            cells[part] = values
            while heading in columns:
                heading += "_"
            columns[heading] = cells[order]
    return columns
