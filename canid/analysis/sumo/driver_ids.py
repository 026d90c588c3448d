"""Ids that SUMO takes, of any names: letters, digits and _ - . alone, each once."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

# characters of a name that an id keeps: some file systems and command lines end a name at 255
LONGEST = 60


def driver_ids(names: Sequence[str]) -> list[str]:
    """Return one id for each name.

    Args:
        names: of drivers; any text, also the same twice.

    Example:
        >>> driver_ids(["Zoë", "a b", "a;b", "山田", ""])
        ['driver_Zoe', 'driver_a_b', 'driver_a_b_2', 'driver_unnamed', 'driver_unnamed_2']
    """
    taken: set[str] = set()
    out = []
    for name in names:
        plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
        kept = re.sub(r"[^A-Za-z0-9_.-]+", "_", plain)[:LONGEST].strip("_.-") or "unnamed"
        id_, k = f"driver_{kept}", 1
        # SUMO on Windows writes files named by ids, where case does not count
        while id_.lower() in taken:
            k += 1
            id_ = f"driver_{kept}_{k}"
        taken.add(id_.lower())
        out.append(id_)
    return out
