"""Log files: readers and writers of each format, behind `open_log` and `write_log`."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from canid.io.logs.log import Log, open_log
    from canid.io.logs.log_writer import write_log

__all__ = ["Log", "open_log", "write_log"]

# imported when first used: help texts need `formats` alone, and a recorder no reader
_MODULES = {
    "Log": "canid.io.logs.log",
    "open_log": "canid.io.logs.log",
    "write_log": "canid.io.logs.log_writer",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'canid.io.logs' has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)
