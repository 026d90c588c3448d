"""Object types of a .blf that hold no CAN frame: a closed table of the kind of each.

Numbers as in Vector_BLF's `ObjectType`, which follows Vector's `binlog_objects.h`.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import numpy.typing as npt

# kind -> its types, single ones and ranges
_TABLE: dict[str, tuple[int | range, ...]] = {
    "overload frames": (3,),
    "bus statistics": (4,),
    "CAN driver and settings": (31, 44, 74, 91, 129),
    "triggers": (5, 127, 128),
    "variables": (range(6, 10), 72, 124, 130, 131),
    "LIN": (range(11, 22), 42, 43, 54, range(57, 65), 75, range(87, 90), 105),
    "MOST": (range(22, 26), range(32, 40), range(67, 71), range(76, 86), 95),
    "FlexRay": (29, 40, 41, 45, range(47, 51), 66),
    "FlexRay synchronization": (30,),
    "GPS": (46,),
    "clock": (51,),
    "J1708": (55, 56),
    "texts and remarks": (65, 92),
    "Ethernet": (71, 102, 103, 114, range(120, 124)),
    "serial ports and K-Line": (90, 99),
    "WLAN": (93, 94),
    "markers": (96,),
    "AFDX and ARINC 429": (97, 98, 106, 107, range(109, 114)),
    "restore points": (115,),
    "diagnostics and tests": (118, 119),
    "data that the writer lost": (125, 126),
}
_KIND = {
    number: kind
    for kind, types in _TABLE.items()
    for entry in types
    for number in (entry if isinstance(entry, range) else (entry,))
}
UNKNOWN = "of unknown types"
# objects of frames' types, by their direction
REQUESTS = "transmit requests"


def kind_of(number: int) -> str:
    """The kind of an object type; `UNKNOWN` where it is not in the table.

    >>> kind_of(71), kind_of(900) == UNKNOWN
    ('Ethernet', True)
    """
    return _KIND.get(number, UNKNOWN)


def count(types: npt.NDArray[np.int64]) -> Counter[str]:
    """How many objects of each kind there are among these types.

    >>> sorted(count(np.array([11, 16, 71, 900])).items())
    [('Ethernet', 1), ('LIN', 2), ('of unknown types', 1)]
    """
    counts: Counter[str] = Counter()
    for number, n in zip(*np.unique(types, return_counts=True), strict=True):
        counts[kind_of(int(number))] += int(n)
    return counts
