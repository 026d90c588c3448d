"""The one place that imports python-can, and it keeps asammdf out of the process.

`import can` pulls in `can.io.mf4`, which imports asammdf where that is installed; only .mf4 needs it, and .mf4 is
read in a child process (`mf4_child`).
"""

from __future__ import annotations

import logging
from functools import cache
from types import ModuleType

from canid.imports import without


@cache
def load() -> ModuleType:
    """Python-can, imported at the first call; asammdf stays importable for everybody else.

    >>> load().Message(arbitration_id=0x123).arbitration_id
    291
    """
    # python-can logs what it also raises; without a handler Python would print it beside our one line
    logging.getLogger("can").addHandler(logging.NullHandler())
    with without("asammdf"):
        import can
    return can
