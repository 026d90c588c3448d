"""The result of `canid look` as JSON: all that the text shows, and more; no row is left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from canid.ui.views.look_text import Head
from canid.values.log_contents import LogContents, MessageContents


class LookedAt(NamedTuple):
    """The frames of one id on one bus."""

    message: MessageContents
    bytes: tuple[int, int]  # the shortest, the longest
    changed_bits: str  # hexadecimal


class Look(NamedTuple):
    """The object of `canid look --json`."""

    log: str
    format: str
    start_utc: float
    duration: float
    damage: str
    remarks: tuple[str, ...]  # how the log was read, where the reader had to decide
    interfaces: Mapping[str, int]  # name -> bus; empty where the format has no names
    contents: LogContents
    messages: tuple[LookedAt, ...]
    next: str  # command


def document(contents: LogContents, head: Head, remarks: tuple[str, ...], command: str) -> Look:
    """What `canid look` writes."""
    messages = tuple(
        LookedAt(row, (row.shortest, row.longest), row.changed[: row.longest].tobytes().hex())
        for row in contents.messages
    )
    return Look(
        head.path,
        head.format,
        head.start_utc,
        contents.duration,
        head.damage,
        remarks,
        head.interfaces,
        contents,
        messages,
        command,
    )
