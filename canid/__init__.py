"""canid records a CAN bus and estimates how the driver drives: gain K, lag τ, dead time θ, with 95 % intervals.

A log and a vehicle file in, numbers out (times in s since the log's first frame, SI units, NaN: not measured):

    >>> import canid
    >>> result = canid.identify("replay_logs/following_urban.blf", "generic", sliding=False)
    >>> print("K of range rate:", result.channels["range_rate"].K)
    K of range rate: 5.6 [4.9, 6.2]

    read_vehicle(path)              a vehicle file: which signal of which DBC is the pedal, the gap, ...
    read_signals(log, vehicle)      every mapped signal as it came
    read_trace(log, vehicle)        uniform samples, the lead chosen, gates judged: a Trace
    read_drive(log, vehicle)        the same with the estimates and what was wrong with the log
    from_arrays(time=..., ...)      a Trace from your own arrays; from_frame(frame): from pandas or polars
    identify(log, vehicle)          the driver of a drive: K, τ, θ per input; a Trace goes as well
    diagnose(log, vehicle)          what the simulation gets wrong, why, and a better model
    compare(a, b)                   two drivers, from what identify or diagnose found
    replay(log, vehicle)            estimates one by one, as they would have come live
    live(channel, interface, ...)   estimates from a bus; nothing is ever sent
    Listener(vehicle, callback)     the same behind python-can's Notifier, into a callback or an asyncio queue
    simulate(...)                   a drive with a known driver; read_model, simulate_model: with an identified one
    recover(log)                    a damaged log, as far as it can be read
    json_schema(name)               the JSON Schema of what `canid VERB --json` writes
    Trace, Drive, Identified, Report, Estimate, Channel, Interval    what these return
    CanidError                      what the user can correct: one line, `str(error)`

Results print short and show themselves in a notebook; result.summary() is the text of the command line,
result.plot() a plotly figure, trace.to_frame() a data frame. help(canid.identify) and the like say more;
docs/python.md has examples. All other modules of the package may change between releases.
"""

from __future__ import annotations

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

from canid.values import presentation as _presentation

__version__ = "0.3.0"

if TYPE_CHECKING:
    from typing import Any

    from canid.analysis.drive.drive_parameters import Identified as Identified
    from canid.analysis.drive.drive_reader import Drive as Drive
    from canid.analysis.drive.drive_reader import read_drive as read_drive
    from canid.analysis.drive.drive_reader import read_signals as read_signals
    from canid.analysis.drive.drive_reader import read_trace as read_trace
    from canid.analysis.drive.drive_reader import replay as replay
    from canid.analysis.drive_results import compare as compare
    from canid.analysis.drive_results import diagnose as diagnose
    from canid.analysis.drive_results import identify as identify
    from canid.analysis.session.listener import Listener as Listener
    from canid.analysis.session.session import live as live
    from canid.analysis.tables.arrays import from_arrays as from_arrays
    from canid.analysis.tables.arrays import from_frame as from_frame
    from canid.io.files.model_file import read_model as read_model
    from canid.io.logs.recovery import recover as recover
    from canid.models.simulation import simulate as simulate
    from canid.models.simulation.model_drive import simulate_model as simulate_model
    from canid.signals.vehicle import read_vehicle as read_vehicle
    from canid.ui.cli.commands.schema import json_schema as json_schema
    from canid.values.errors import CanidError as CanidError
    from canid.values.findings import Report as Report
    from canid.values.types import Channel as Channel
    from canid.values.types import Estimate as Estimate
    from canid.values.types import Interval as Interval
    from canid.values.types import Trace as Trace

# each name is imported when it is first used: mathematics takes seconds to import, recording must not wait for it
_HOME = {
    "CanidError": "values.errors",
    "Channel": "values.types",
    "Drive": "analysis.drive.drive_reader",
    "Estimate": "values.types",
    "Identified": "analysis.drive.drive_parameters",
    "Interval": "values.types",
    "Listener": "analysis.session.listener",
    "Report": "values.findings",
    "Trace": "values.types",
    "compare": "analysis.drive_results",
    "diagnose": "analysis.drive_results",
    "from_arrays": "analysis.tables.arrays",
    "from_frame": "analysis.tables.arrays",
    "identify": "analysis.drive_results",
    "json_schema": "ui.cli.commands.schema",
    "live": "analysis.session.session",
    "read_drive": "analysis.drive.drive_reader",
    "read_model": "io.files.model_file",
    "read_signals": "analysis.drive.drive_reader",
    "read_trace": "analysis.drive.drive_reader",
    "read_vehicle": "signals.vehicle",
    "recover": "io.logs.recovery",
    "replay": "analysis.drive.drive_reader",
    "simulate": "models.simulation",
    "simulate_model": "models.simulation.model_drive",
}


# no __all__: help(canid) would print the whole text of every name in it behind the screen above
def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'canid' has no attribute {name!r}")
    value = getattr(_import_module(f"canid.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return ["__doc__", "__file__", "__name__", "__path__", "__version__", *sorted(_HOME)]


def _presenters() -> _presentation.Find:
    from canid.ui.views import presenters

    return presenters.find


_presentation.provide(_presenters)
