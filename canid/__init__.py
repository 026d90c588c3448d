"""canid records a CAN bus without loss and tells how the driver is driving.

The verbs of the command line, as functions; each is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from canid.diagnosis.diagnosing import diagnose as diagnose
    from canid.drive import identify as identify
    from canid.errors import CanidError as CanidError
    from canid.frames.recovery import recover as recover
    from canid.logs import read_drive as read_drive
    from canid.logs import read_signals as read_signals
    from canid.logs import read_trace as read_trace
    from canid.logs import replay as replay
    from canid.session import live as live
    from canid.simulation import simulate as simulate
    from canid.vehicle import read_vehicle as read_vehicle

_HOME = {
    "CanidError": "errors",
    "diagnose": "diagnosis.diagnosing",
    "identify": "drive",
    "live": "session",
    "read_drive": "logs",
    "read_signals": "logs",
    "read_trace": "logs",
    "read_vehicle": "vehicle",
    "recover": "frames.recovery",
    "replay": "logs",
    "simulate": "simulation",
}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'canid' has no attribute {name!r}")
    value = getattr(import_module(f"canid.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*globals(), *__all__]
