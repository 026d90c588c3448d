"""Results as data frames of pandas or polars, whichever is installed."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from canid.analysis.drive.drive_parameters import Identified
from canid.values.errors import ConfigError
from canid.values.text.numbers import gain_unit, role_unit
from canid.values.types import QUOTED, Trace

LIBRARIES = ("pandas", "polars")
# fields of a channel that are rows of a table
FIELDS = ("K", "tau", "dead_time", "tau_plus_dead_time")


def trace_frame(trace: Trace, library: str = "") -> Any:
    """The columns of a trace; units in `attrs` (pandas) or in the columns' names (polars).

    Example:
        >>> import canid
        >>> frame = canid.read_trace("replay_logs/following_urban.blf", "generic").to_frame("pandas")
        >>> frame.attrs["units"]["speed"], list(frame.columns[:4])
        ('m/s', ['t', 'output', 'headway_error', 'range_rate'])
    """
    columns: dict[str, Any] = {"t": trace.t, "output": trace.output}
    columns |= {name: trace.inputs[:, k] for k, name in enumerate(trace.input_names)}
    columns |= {role: values for role, values in trace.signals.items() if role not in columns}
    units = {"t": "s"} | {name: role_unit(name) for name in columns if name not in ("t", "output")}
    columns |= {
        "learn": trace.learn,
        "segment": trace.segment,
        "gate": np.array([gate.name.lower() for gate in trace.gate], dtype=object),
    }
    return data_frame(columns, {name: unit for name, unit in units.items() if unit}, library)


def parameters_frame(drive: Identified, library: str = "") -> Any:
    """The headline's parameters, one row each."""
    output = drive.drive_summary.output
    rows = [
        {
            "input": name,
            "parameter": field,
            "value": interval.value,
            "low": interval.low,
            "high": interval.high,
            "unit": gain_unit(output, name) if field == "K" else "s",
            "quotable": field in QUOTED[channel.status],
        }
        for name, channel in drive.channels.items()
        for field in FIELDS
        for interval in [getattr(channel, field)]
    ]
    names = ("input", "parameter", "value", "low", "high", "unit", "quotable")
    return data_frame({name: np.array([row[name] for row in rows]) for name in names}, {}, library)


def data_frame(columns: dict[str, Any], units: dict[str, str], library: str = "") -> Any:
    """A data frame of a library.

    Raises:
        ConfigError: it, or both of them, is not installed.
        ValueError: another library.
    """
    if library not in ("", *LIBRARIES):
        raise ValueError(f"to_frame: {library!r} is neither {' nor '.join(LIBRARIES)}")
    wanted = [library] if library else list(LIBRARIES)
    there = [name for name in wanted if find_spec(name) is not None]
    if not there:
        raise ConfigError(f"to_frame needs {' or '.join(wanted)}: pip install {wanted[0]}")
    module = import_module(there[0])
    if there[0] == "polars":
        labelled = {
            f"{name} [{units[name]}]" if name in units else name: column for name, column in columns.items()
        }
        return module.DataFrame(
            {name: column.tolist() if column.dtype == object else column for name, column in labelled.items()}
        )
    frame = module.DataFrame(columns)
    if units:
        frame.attrs["units"] = units
    return frame
