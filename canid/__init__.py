"""canid records a CAN bus without loss and reports how the driver is driving.

The verbs of the command line, as functions; each is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

if TYPE_CHECKING:
    from canid.diagnosis.diagnose import diagnose as diagnose
    from canid.drive_parameters import identify as identify
    from canid.drive_reader import read_drive as read_drive
    from canid.drive_reader import read_signals as read_signals
    from canid.drive_reader import read_trace as read_trace
    from canid.drive_reader import replay as replay
    from canid.errors import CanidError as CanidError
    from canid.files.model_file import read_model as read_model
    from canid.logs.recovery import recover as recover
    from canid.session import live as live
    from canid.simulation import simulate as simulate
    from canid.simulation.model_drive import simulate_model as simulate_model
    from canid.vehicle import read_vehicle as read_vehicle

_HOME = {
    "CanidError": "errors",
    "diagnose": "diagnosis.diagnose",
    "identify": "drive_parameters",
    "live": "session",
    "read_drive": "drive_reader",
    "read_model": "files.model_file",
    "read_signals": "drive_reader",
    "read_trace": "drive_reader",
    "read_vehicle": "vehicle",
    "recover": "logs.recovery",
    "replay": "drive_reader",
    "simulate": "simulation",
    "simulate_model": "simulation.model_drive",
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
