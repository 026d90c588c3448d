"""Traces of arrays and of data frames, through the same path as a CAN log."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any, Literal

import numpy as np

from canid.analysis.tables.column_map import ColumnMap
from canid.analysis.tables.headings import EXTRA, TIME, heading, role_of
from canid.analysis.tables.remedies import ARRAYS, FRAME
from canid.analysis.tables.sources.array_source import ArraySource
from canid.analysis.tables.table import Selection, table_of, trace_of
from canid.models.pipeline import pipeline
from canid.signals.vehicle.schema import did_you_mean
from canid.values.errors import CanidError
from canid.values.roles import OUTPUTS, ROLES
from canid.values.types import Driver, OutputFilter, Trace

_TASKS = ("car_following", "lane_keeping")


def from_arrays(
    *,
    time: Any,
    task: Literal["car_following", "lane_keeping"] | None = None,
    output: str | None = None,
    units: Mapping[str, str] | None = None,
    headway_desired: float = 2.0,
    output_filter: OutputFilter | None = None,
    dt: float = pipeline.DT,
    **columns: Any,
) -> Trace:
    """Make a trace of arrays: sampled, the lead smoothed, gates judged, signals checked as those of a CAN log.

    Args:
        time: (n,) s, or whatever `units` says; or datetime64. NaN in another column: no value in this row.
        task: None: judged from the columns.
        output: the driver's: pedal, accel, accel_command or steering_angle; None: pedal, else accel (of the speed, where no
            acceleration is given), else steering_angle.
        units: column -> its unit, such as {"speed": "km/h"}; otherwise SI, pedal and grade in %, steering_angle in degrees.
        headway_desired: s, a convention: only K1 times it, plus the offset, is identified.
        output_filter: how the output was smoothed before it was recorded; None: not stated.
        dt: step of the grid, s.
        **columns: by role: pedal, speed, gap (or headway), range_rate (or lead_speed), lead_valid, cruise_active, brake, ...

    Returns:
        a `Trace`, for `canid.identify` and `canid.diagnose`. Rows that are not in the order of time are sorted (stable),
        with a UserWarning.

    Raises:
        ValueError: names the argument, and the remedy.

    Example:
        >>> import numpy as np
        >>> t = np.arange(0.0, 60.0, 0.1)
        >>> trace = from_arrays(time=t, pedal=20 + 0 * t, speed=72 + 0 * t, gap=30 + 0 * t, range_rate=0 * t,
        ...     units={"speed": "km/h"})
        >>> round(float(trace.signals["headway"][100]), 6), trace.dt
        (1.5, 0.1)
    """
    given = {TIME: time, **{name: x for name, x in columns.items() if x is not None}}
    return _trace(given, units or {}, task, output, headway_desired, output_filter, dt, "from_arrays")


def from_frame(
    frame: Any,
    columns: Mapping[str, str] | None = None,
    *,
    units: Mapping[str, str] | None = None,
    task: Literal["car_following", "lane_keeping"] | None = None,
    output: str | None = None,
    headway_desired: float = 2.0,
    output_filter: OutputFilter | None = None,
    dt: float = pipeline.DT,
) -> Trace:
    """Make a trace of a data frame, as `from_arrays` does of arrays.

    Args:
        frame: of pandas or polars, or anything with named columns: `frame.columns` and `frame[name]`; or a mapping.
        columns: role -> the frame's column, such as {"speed": "v_ego"}; None: by the usual names, as in a CSV file;
            times may be the index of a pandas frame.
        units: role -> unit, where the column's name (speed [km/h]) does not state it.
        task: as in `from_arrays`.
        output: as in `from_arrays`.
        headway_desired: s.
        output_filter: as in `from_arrays`.
        dt: step of the grid, s.

    Returns:
        a `Trace`. How a name with several meanings was read by its unit or values is a UserWarning.

    Raises:
        ValueError: names the column, and the remedy.

    Example:
        >>> import numpy as np
        >>> t = np.arange(0.0, 60.0, 0.1)
        >>> frame = {"t": t, "gas": 20 + 0 * t, "v [km/h]": 72 + 0 * t, "gap": 30 + 0 * t, "v_rel": 0 * t}
        >>> round(float(from_frame(frame).signals["headway"][100]), 6)
        1.5
    """
    if columns is not None and not isinstance(columns, Mapping):
        raise ValueError(
            f'from_frame: columns={columns!r:.60} is no mapping; give role -> column, as {{"speed": "v_ego"}}'
        )
    names = list(frame.keys() if isinstance(frame, Mapping) else getattr(frame, "columns", ()))
    if not names:
        raise ValueError(
            "from_frame: the frame has no columns; give a data frame of pandas or polars, or a mapping"
        )
    if columns is None:
        taken = {**_index(frame, names), **{str(name): frame[name] for name in names}}
        return _trace(
            taken, units or {}, task, output, headway_desired, output_filter, dt, "from_frame", named=False
        )
    wrong = [role for role in columns if role not in ROLES and role not in EXTRA]
    if wrong:
        raise ValueError(
            f"from_frame: columns: unknown role {wrong[0]!r}{did_you_mean(str(wrong[0]), (*ROLES, *EXTRA))}"
        )
    lacking = [name for name in columns.values() if name not in names]
    if lacking:
        hint = did_you_mean(str(lacking[0]), [str(name) for name in names])
        raise ValueError(f"from_frame: columns: the frame has no column {lacking[0]!r}{hint}")
    given = {role: frame[name] for role, name in columns.items()}
    stated = {role: unit for role, name in columns.items() if (unit := heading(str(name)).unit) is not None}
    return _trace(
        given, {**stated, **(units or {})}, task, output, headway_desired, output_filter, dt, "from_frame"
    )


def _trace(
    given: Mapping[str, Any],
    units: Mapping[str, str],
    task: str | None,
    output: str | None,
    headway_desired: float,
    output_filter: OutputFilter | None,
    dt: float,
    verb: str,
    named: bool = True,
) -> Trace:
    """Check the arguments and make the trace; `named`: the keys are roles, not any columns."""
    known = (*ROLES, *EXTRA)
    if not isinstance(units, Mapping):
        raise ValueError(
            f'{verb}: units={units!r:.60} is no mapping; give column -> unit, as {{"speed": "km/h"}}'
        )
    if output_filter is not None and not isinstance(output_filter, OutputFilter):
        raise ValueError(f"{verb}: output_filter={output_filter!r:.60} is no OutputFilter, nor None")
    if named:
        wrong = [name for name in given if name not in known]
        if wrong:
            raise ValueError(
                f"{verb}: unknown column {wrong[0]!r}{did_you_mean(wrong[0], known)}; known: {', '.join(known)}"
            )
        wrong = [name for name in units if name not in given]
        if wrong:
            raise ValueError(
                f"{verb}: units: there is no column {wrong[0]!r}{did_you_mean(wrong[0], list(given))}"
            )
    if task is not None and task not in _TASKS:
        raise ValueError(f"{verb}: task={task!r} is not one of {', '.join(_TASKS)}")
    if output is not None and output not in OUTPUTS:
        raise ValueError(f"{verb}: output={output!r} is not one of {', '.join(OUTPUTS)}")
    if not _within(headway_desired, 0.01, 60.0):
        raise ValueError(
            f"{verb}: headway_desired={headway_desired!r} is no headway in s; give one such as 2.0"
        )
    if not _within(dt, 0.01, 1.0):
        raise ValueError(f"{verb}: dt={dt!r} is no step of the grid in s; give one of 0.01 to 1, such as 0.1")
    headings = {_with_unit(name, units, named): x for name, x in given.items()}
    says = ARRAYS if verb == "from_arrays" else FRAME
    driver = _driver(given, task, output, headway_desired, output_filter, named)
    try:
        table = table_of(
            ArraySource(headings, verb), ColumnMap(driver=driver), Selection(named=named), says=says
        )
        if driver is None:
            table = table._replace(
                vehicle=table.vehicle._replace(
                    driver=table.vehicle.driver._replace(headway_desired=headway_desired)
                )
            )
        trace = trace_of(table, dt)
    except CanidError as error:
        raise ValueError(str(error)) from None
    if len(trace.t) < 2:
        first, last = table.log.span
        lasts = f"the times span {last - first:.3g} s, too short for two samples"
        same = "all rows have the same time: nothing can be identified"
        raise ValueError(
            f"{verb}: {lasts if last > first else same}; give each row its own, in s since any start, or as dates"
        )
    for note in (*table.judged, *([table.sorted] if table.sorted else [])):
        warnings.warn(note, stacklevel=3)
    if _of_1970(given, named):
        warnings.warn(f"{verb}: dates of 1970 are taken as the time of the drive in s", stacklevel=3)
    return trace


def _within(value: object, low: float, high: float) -> bool:
    return isinstance(value, Real) and low <= float(value) <= high


def _of_1970(given: Mapping[str, Any], named: bool) -> bool:
    """Whether the times are seconds that were made dates."""
    for name, column in given.items():
        if (name if named else role_of(heading(name))) == TIME:
            stamps = np.asarray(column)
            if stamps.dtype.kind == "M" and (stamps < np.datetime64("1971")).any():
                return True
    return False


def _index(frame: Any, names: Sequence[Any]) -> dict[str, Any]:
    """The index of a pandas frame as its times, if it holds dates or is called so and no column holds times."""
    index = getattr(frame, "index", None)
    if (
        index is None
        or not hasattr(index, "dtype")
        or any(role_of(heading(str(name))) == TIME for name in names)
    ):
        return {}
    named = str(getattr(index, "name", None) or "")
    if role_of(heading(named)) == TIME:
        return {named: index}
    return {TIME: index} if getattr(index.dtype, "kind", "") == "M" else {}


def _with_unit(name: str, units: Mapping[str, str], named: bool) -> str:
    role = name if named else role_of(heading(name))
    unit = units.get(name, units.get(role or "", None))
    if unit is None:
        return name
    return f"{name if named else heading(name).name} [{unit}]"


def _driver(
    given: Mapping[str, Any],
    task: str | None,
    output: str | None,
    headway_desired: float,
    output_filter: OutputFilter | None,
    named: bool,
) -> Driver | None:
    """The driver that the arguments state; None: judged from the columns."""
    if task is None and output is None and output_filter is None:
        return None
    if task is None:
        task = "lane_keeping" if output == "steering_angle" else "car_following"
    if output is None:
        output = (
            "steering_angle"
            if task == "lane_keeping"
            else ("pedal" if "pedal" in given or not named else "accel")
        )
    return Driver(task, output, headway_desired, output_filter)
