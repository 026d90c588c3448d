"""The one place that imports python-can, and it keeps asammdf out of the process.

`import can` pulls in `can.io.mf4`, which imports asammdf where that is installed: 1.5 s and 100 MB that no
bus and no log format but .mf4 needs, and .mf4 is read in a child process (`mf4_child`).
"""

from __future__ import annotations

import logging
import sys
from functools import cache
from types import ModuleType

# What python-can imports only because it happens to be installed, and only for .mf4.
_KEPT_OUT = "asammdf"


@cache
def load() -> ModuleType:
    """Python-can, imported at the first call; asammdf stays importable for everybody else.

    >>> load().Message(arbitration_id=0x123).arbitration_id
    291
    """
    # python-can logs what it also raises; without a handler Python would print it beside our one line
    logging.getLogger("can").addHandler(logging.NullHandler())
    if _KEPT_OUT in sys.modules:
        import can

        return can
    # None in sys.modules makes `import asammdf` raise ImportError, which python-can expects and survives.
    sys.modules[_KEPT_OUT] = None  # type: ignore[assignment]
    try:
        import can
    finally:
        del sys.modules[_KEPT_OUT]
    return can
