"""Proposal of a vehicle file for DBC files, by names and units, and by what a log shows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from canid.analysis.proposal import log_columns
from canid.analysis.proposal.choice import Ask, Decisions, decide
from canid.analysis.proposal.vehicle_text import vehicle_text
from canid.io.logs import Log
from canid.signals.dbc_text.parsing import Parser
from canid.signals.vehicle.database import MAX_DBC_BYTES, Dbc, load

__all__ = ["Proposal", "proposal", "propose"]


class Proposal(NamedTuple):
    """A proposed vehicle file, and how each role was decided."""

    text: str
    decisions: Decisions
    warnings: tuple[str, ...]


# of a DBC's messages: where a log has fewer, it may be another car's
_FEW_MESSAGES = 0.5
# s: in less hardly anything moves
_SHORT_S = 10.0


def proposal(
    paths: str | Path | Sequence[str | Path],
    folder: str | Path | None = None,
    log: Log | None = None,
    ask: Ask | None = None,
    progress: Callable[[float], None] | None = None,
) -> Proposal:
    """Propose a vehicle file, as `propose`, with all candidates of each role.

    Args:
        paths: as of `propose`.
        folder: as of `propose`.
        log: as of `propose`.
        ask: asked where two candidates are close: role, candidates -> index, or None for none of them.
        progress: called with the share of the log that was read.
    """
    paths = [paths] if isinstance(paths, str | Path) else list(paths)
    files, warnings = databases(paths)
    columns = log_columns.read(log, files, progress) if log is not None else None
    if columns is not None:
        warnings = [*warnings, *_limits(files, columns)]
    decisions = decide(files, columns, ask)
    home = Path(paths[0]).parent if folder is None else Path(folder)
    name = log.path.name if log is not None else None
    return Proposal(vehicle_text(paths, files, decisions, warnings, home, name), decisions, tuple(warnings))


def _limits(files: Sequence[Dbc], columns: log_columns.LogColumns) -> Iterator[str]:
    """Why a log may show less than it seems to."""
    for file in files:
        messages = list(file.messages.values())
        there = sum(bool(log_columns.keys_of(message, columns)) for message in messages)
        if there < _FEW_MESSAGES * len(messages):
            yield (
                f"the log has {there} of the {len(messages)} messages of {file.file}: "
                "is it a log of this car, and of this bus?"
            )
    if len(columns.t) and columns.t[-1] - columns.t[0] < _SHORT_S:
        yield (
            f"the log has {columns.t[-1] - columns.t[0]:.0f} s: names and units decide; take a drive of a minute or more"
        )


def databases(paths: Sequence[str | Path]) -> tuple[list[Dbc], list[str]]:
    """Read DBC files, and what is to be said about them."""
    files, warnings, bytes_left = [], [], MAX_DBC_BYTES
    with Parser() as parser:
        for path in paths:
            file, warned, size = load(Path(path), None, parser, bytes_left)
            bytes_left -= size
            files.append(file)
            warnings += warned
    return files, warnings
