"""PlotJuggler layout (.xml): opens an exported file with tabs for output, gap, range rate, gains and delays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from canid.analysis.export.table import Table
from canid.values.types import Array

MARK = " canid export "
# PlotJuggler's plugins and the parameters of the two that ask for the column of the time
_PLUGINS = {"csv": "DataLoad CSV", "parquet": "DataLoad Parquet", "mcap": "DataLoad MCAP"}
# of matplotlib's and PlotJuggler's cycle
COLORS = ("#1f77b4", "#d62728", "#1ac938", "#ff7f0e", "#f14cc1", "#9467bd", "#17becf", "#bcbd22")
# the ends of a 95 % interval, in the order of COLORS
LIGHT = ("#9ecae1", "#f4a6a6", "#a6e3a1", "#fdd0a2", "#f9c6e8", "#d1c0e0", "#a8e4ec", "#e3e3a0")
# share of the range of values above and below the curves
MARGIN = 0.05


class Curve(NamedTuple):
    """A curve of a plot."""

    column: int  # of the table
    color: str


class Tab(NamedTuple):
    """A tab: plots one below the other."""

    name: str
    plots: list[list[Curve]]


def tabs(table: Table) -> list[Tab]:
    """Choose what is plotted, of a `plot_table`; PlotJuggler knows no curve without any number."""
    columns = zip(table.fields, table.values(slice(None)), strict=True)
    at = {
        field.name: k
        for k, (field, values) in enumerate(columns)
        if field.kind != "text" and np.isfinite(values.astype(float)).any()
    }

    def plot(*names: str) -> list[Curve]:
        return [Curve(at[name], COLORS[k]) for k, name in enumerate(n for n in names if n in at)]

    parts = [name.split("/") for name in at if name.count("/") == 2]
    estimators = list(dict.fromkeys(part[0] for part in parts))
    channels = list(dict.fromkeys(part[1] for part in parts))

    def bands(channel: str, parameter: str) -> list[Curve]:
        curves = []
        for k, estimator in enumerate(estimators):
            for ending, colors in (("", COLORS), ("_low", LIGHT), ("_high", LIGHT)):
                name = f"{estimator}/{channel}/{parameter}{ending}"
                if name in at:
                    curves.append(Curve(at[name], colors[k % len(colors)]))
        return curves

    inputs = [name for name in at if name.startswith("input_")]
    candidates = [
        Tab("output and prediction", [plot("output", "prediction"), plot("learn")]),
        Tab(
            "gap and range rate",
            [plot("gap"), plot("range_rate"), plot("speed", "lead_speed"), plot("headway")],
        ),
        Tab("inputs", [plot(name) for name in inputs]),
        Tab("K", [bands(channel, "K") for channel in channels]),
        Tab("tau + dead time", [bands(channel, "tau_plus_dead_time") for channel in channels]),
    ]
    filled = [Tab(tab.name, [plot for plot in tab.plots if plot]) for tab in candidates]
    return [tab for tab in filled if tab.plots]


def layout(table: Table, curve: Callable[[int], str], data: Path, kind: str, time: str) -> bytes:
    """The file.

    Args:
        table: from `plot_table`.
        curve: name of the curve of a column, as PlotJuggler has it for this kind of file.
        data: the exported file.
        kind: "csv", "parquet" or "mcap".
        time: name of the time column in it.
    """
    root = ElementTree.Element("root")
    root.append(ElementTree.Comment(MARK))
    widget = ElementTree.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    values = table.values(slice(None))
    for tab in tabs(table):
        page = ElementTree.SubElement(widget, "Tab", tab_name=tab.name, containers="1")
        container = ElementTree.SubElement(page, "Container")
        count = len(tab.plots)
        sizes = ";".join([f"{1.0 / count:.6f}"] * count)
        splitter = ElementTree.SubElement(
            container, "DockSplitter", orientation="-", count=str(count), sizes=sizes
        )
        for curves in tab.plots:
            area = ElementTree.SubElement(splitter, "DockArea", name="...")
            shown = {"mode": "TimeSeries", "style": "Lines", "flip_x": "false", "flip_y": "false"}
            plot = ElementTree.SubElement(area, "plot", shown)
            ElementTree.SubElement(plot, "range", _range(table.t, [values[line.column] for line in curves]))
            ElementTree.SubElement(plot, "limitY")
            for line in curves:
                ElementTree.SubElement(plot, "curve", name=curve(line.column), color=line.color)
    ElementTree.SubElement(widget, "currentTabIndex", index="0")
    ElementTree.SubElement(root, "use_relative_time_offset", enabled="1")
    plugins = ElementTree.SubElement(root, "Plugins")
    parameters = _parameters(kind, time)
    ElementTree.SubElement(plugins, "plugin", ID=_PLUGINS[kind]).extend(parameters)
    loaded = ElementTree.SubElement(root, "previouslyLoaded_Datafiles")
    # a name alone: PlotJuggler takes it relative to the layout
    file = ElementTree.SubElement(loaded, "fileInfo", filename=_visible(data.name), prefix="")
    ElementTree.SubElement(file, "selected_datasources", value="")
    ElementTree.SubElement(file, "plugin", ID=_PLUGINS[kind]).extend(_parameters(kind, time))
    ElementTree.SubElement(root, "customMathEquations")
    ElementTree.SubElement(root, "snippets")
    ElementTree.indent(root, " ")
    text = ElementTree.tostring(root, encoding="unicode")
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{text}\n".encode()


def _parameters(kind: str, time: str) -> list[ElementTree.Element]:
    if kind == "csv":
        return [ElementTree.Element("parameters", time_axis=time, delimiter="0")]
    if kind == "parquet":
        return [
            ElementTree.Element("prefer_stamp_seconds", enabled="0"),
            ElementTree.Element("time_column", name=time),
        ]
    return []


def _range(t: Array, curves: Sequence[Array]) -> dict[str, str]:
    known = np.concatenate([values[np.isfinite(values.astype(float))].astype(float) for values in curves])
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    room = MARGIN * (high - low) or 0.5
    left, right = (float(t[0]), float(t[-1])) if len(t) else (0.0, 1.0)
    limits = {"left": left, "right": right, "bottom": low - room, "top": high + room}
    return {name: f"{x:.6f}" for name, x in limits.items()}


def _visible(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode()
