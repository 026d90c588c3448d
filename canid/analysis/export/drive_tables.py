"""Samples and estimates of a drive as tables, and both in one wide table for plots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from canid.analysis.export.table import Field, Table, Values, of_columns
from canid.signals.signal_checks.output_scale import output_scale
from canid.values.roles import DERIVED, ROLES
from canid.values.text.names import method
from canid.values.types import NAN, Array, Estimate, Trace

if TYPE_CHECKING:
    from canid.analysis.drive.drive_series import DriveSeries

# of the inputs of the models, and of derived roles
_UNITS = {"headway": "s", "headway_error": "s"}
PARAMETERS = ("K", "tau", "dead_time", "tau_plus_dead_time")


def unit_of(name: str) -> str:
    """Unit of a role or of an input, in ASCII.

    Example:
        >>> unit_of("accel"), unit_of("headway_error"), unit_of("brake"), unit_of("gap_reported")
        ('m/s2', 's', '', 'm')
    """
    role = name.removesuffix("_reported")
    return _UNITS.get(role) or (ROLES[role].unit if role in ROLES else "")


def _meaning(role: str) -> str:
    return ROLES[role].meaning if role in ROLES else DERIVED.get(role, "")


def samples_table(trace: Trace, output: str) -> Table:
    """Columns: every role in its unit, output and inputs of the model, gate, learn.

    Args:
        trace: of the drive.
        output: role of the driver's output.
    """
    columns: list[tuple[Field, Values]] = [
        (Field(role, unit_of(role), _meaning(role)), values) for role, values in trace.signals.items()
    ]
    columns.append((Field("output", unit_of(output), f"the driver's output: {output}"), trace.output))
    columns += [
        (Field(f"input_{name}", unit_of(name), "input of the model"), trace.inputs[:, k])
        for k, name in enumerate(trace.input_names)
    ]
    gate = np.array([gate.name.lower() for gate in trace.gate], dtype=object)
    columns.append(
        (Field("gate", "", "why nothing is learned from the sample; open: nothing is wrong", "text"), gate)
    )
    learn = trace.learn.astype(np.int64)
    columns.append((Field("learn", "", "1: the estimators learn from the sample", "integer"), learn))
    return of_columns("samples", "", np.round(trace.t, 9), columns, "samples of the uniform grid")


def _interval_fields(output: str, name: str) -> list[Field]:
    gain = f"({unit_of(output)})/({unit_of(name)})" if name else ""
    out = []
    for parameter in PARAMETERS:
        unit = gain if parameter == "K" else "s"
        out.append(Field(parameter, unit))
        out += [
            Field(f"{parameter}_{end}", unit, f"{end} end of the 95 % interval") for end in ("low", "high")
        ]
    return out


def _numbers(estimate: Estimate, name: str) -> list[float]:
    channel = estimate.channels[name]
    return [x for key in PARAMETERS for x in getattr(channel, key)]


_LEAD = (
    Field("status", kind="text"),
    Field("can_tell", "", "which parameters may be quoted", "text"),
    Field("scale", "", "of a pedal: whether K in % of its full travel is confirmed", "text"),
)
_TAIL = (Field("fit_percent", "%"), Field("used", "s", "data that the estimate rests on"))


def scale_text(trace: Trace) -> str:
    """Whether a drive's pedal is in % of its full travel: "confirmed", "not confirmed", or "" where it is no pedal."""
    scale = output_scale(trace.output, trace.dt, trace.full_scale, trace.findings)
    return "" if scale is None else "confirmed" if scale.confirmed else "not confirmed"


def estimates_table(estimates: Sequence[Estimate], scale: str = "") -> Table:
    """One row per estimate and channel: estimator, status, channel, can_tell, scale, K, K_low, K_high, tau, ..."""
    rows: list[tuple[Any, ...]] = [
        (
            e.estimator,
            e.status.value,
            name,
            e.channels[name].status.value,
            scale,
            *_numbers(e, name),
            e.fit_percent,
            e.used,
        )
        for e in estimates
        for name in e.channels
    ]
    of_text = (Field("estimator", kind="text"), _LEAD[0], Field("channel", kind="text"), *_LEAD[1:])
    # the unit of K differs between channels
    fields = (*of_text, *_interval_fields("", ""), *_TAIL)
    t = np.round(np.array([e.t for e in estimates for _ in e.channels]), 9)
    return _of_rows("estimates", "", t, fields, rows)


def _of_rows(
    group: str, name: str, t: Array, fields: Sequence[Field], rows: Sequence[tuple[Any, ...]]
) -> Table:
    kinds = {"text": object, "integer": np.int64, "number": np.float64}
    columns: list[tuple[Field, Values]] = [
        (field, np.array([row[k] for row in rows], dtype=kinds[field.kind])) for k, field in enumerate(fields)
    ]
    return of_columns(group, name, t, columns)


def channel_tables(estimates: Sequence[Estimate], output: str, scale: str = "") -> list[Table]:
    """Estimates, a table for each estimator and channel: for formats in which a name stands for one curve."""
    by_channel: dict[tuple[str, str], list[Estimate]] = {}
    for e in estimates:
        for name in e.channels:
            by_channel.setdefault((e.estimator, name), []).append(e)
    return [
        _of_rows(
            "estimates",
            f"{estimator}.{name}",
            np.round(np.array([e.t for e in those]), 9),
            (*_LEAD, *_interval_fields(output, name), *_TAIL),
            [
                (
                    e.status.value,
                    e.channels[name].status.value,
                    scale,
                    *_numbers(e, name),
                    e.fit_percent,
                    e.used,
                )
                for e in those
            ],
        )
        for (estimator, name), those in by_channel.items()
    ]


def plot_table(trace: Trace, estimates: Sequence[Estimate], series: DriveSeries | None, output: str) -> Table:
    """Samples, the model's prediction and the estimates as curves on one time axis.

    Estimates stand at their own instants, NaN between them. `prediction` is the output simulated from the inputs alone.
    """
    samples = samples_table(trace, output)
    every = slice(None)
    columns = list(zip(samples.fields, samples.values(every), strict=True))
    t = samples.t
    if series is not None and len(series.t):
        known = np.isfinite(series.simulated)
        at = np.searchsorted(series.t, t - 1e-6).clip(0, len(series.t) - 1)
        near = (np.abs(series.t[at] - t) < 0.5 * trace.dt + 1e-6) & known[at]
        predicted = np.where(near, series.simulated[at], NAN)
        if len(series.t) != len(t) and known.any():  # on a coarser grid: a line through its rows
            step = float(np.median(np.diff(series.t))) if len(series.t) > 1 else trace.dt
            line = np.interp(t, series.t[known], series.simulated[known])
            after = np.searchsorted(series.t[known], t).clip(0, known.sum() - 1)
            before = (after - 1).clip(0)
            close = series.t[known][after] - series.t[known][before] < 1.5 * step
            predicted = np.where(close, line, NAN)
        says = f"output simulated from the inputs alone by {method(series.estimator)}"
        columns.append((Field("prediction", unit_of(output), says), predicted))
    for table in channel_tables(estimates, output):
        estimator, _, name = table.name.partition(".")
        rows = np.searchsorted(t, table.t - 0.5 * trace.dt).clip(0, max(len(t) - 1, 0))
        for field, values in zip(table.fields, table.values(every), strict=True):
            if field.kind != "number":
                continue
            placed = np.full(len(t), NAN)
            placed[rows] = values
            columns.append((field._replace(name=f"{estimator}/{name}/{field.name}"), placed))
    return of_columns("plot", "", t, columns)
