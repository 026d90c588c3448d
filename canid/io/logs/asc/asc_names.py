"""Symbolic names of messages in an .asc, as Vector's tools log with a database: the ids that a database gives them."""

from __future__ import annotations

import re
from collections.abc import Mapping

_ID = re.compile(r"[0-9a-f]{1,9}x?", re.IGNORECASE)
_WAYS = ("rx", "tx", "txrq")
# the kind of a line with the name of a message that no database has
UNKNOWN = "messages that no database names"


def resolved(
    words: list[str], names: Mapping[str, tuple[int, bool]], base: int, fd_base: int
) -> list[str] | None:
    """The words of a line with an id in place of a message's name; None: no database has the name.

    Args:
        words: of a line that begins with a time.
        names: of messages, each with its id and whether that has 29 bits.
        base: of numbers.
        fd_base: of those in CAN FD lines.

    >>> resolved("0.5 1 Gap Rx d 1 0A".split(), {"Gap": (0x18FEF100, True)}, 16, 16)
    ['0.5', '1', '18fef100x', 'Rx', 'd', '1', '0A']
    >>> resolved("0.5 1 Speed Rx d 1 0A".split(), {"Gap": (7, False)}, 16, 16) is None
    True
    """
    is_fd = len(words) > 4 and words[1].upper() == "CANFD"
    at = 2
    if is_fd:
        at, base = (4 if words[3].lower() in _WAYS else 3), fd_base
    way = 3 if is_fd and at == 4 else at + 1
    if len(words) <= max(at, way) or words[way].lower() not in _WAYS or words[at].lower() == "errorframe":
        return words
    if words[at] in names:
        id_, extended = names[words[at]]
        return [*words[:at], (f"{id_:x}" if base == 16 else str(id_)) + "x" * extended, *words[at + 1 :]]
    return words if _ID.fullmatch(words[at]) else None
