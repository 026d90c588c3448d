"""The live view: what a test engineer reads in one second, as a rich renderable."""

from __future__ import annotations

from typing import NamedTuple

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from canid.types import Channel, Estimate, Event, Gate, Identifiable, Sample, Status
from canid.views import words

COLOURS = {
    Status.OK: "bold green",
    Status.CONVERGING: "yellow",
    Status.NOT_EXCITED: "yellow",
    Status.INCONSISTENT: "bold red",
    Status.NO_LEAD: "cyan",
    Status.NO_DRIVER: "cyan",
    Status.STALE: "bold red",
}
SHOWN = {"speed": "m/s", "gap": "m", "headway": "s", "range_rate": "m/s", "lateral_offset": "m"}


class BusLine(NamedTuple):
    """State of the world outside, already in words; red where something is wrong."""

    says: str
    wrong: bool = False


class View(NamedTuple):
    """Everything that the screen shows."""

    title: str
    t: float = 0.0
    output: str = "pedal"
    sample: Sample | None = None
    estimates: tuple[Estimate, ...] = ()  # the latest of each estimator
    held: tuple[Estimate, ...] = ()  # the last "ok" of each estimator
    lines: tuple[BusLine, ...] = ()
    events: tuple[Event, ...] = ()
    truth: tuple[tuple[str, str], ...] = ()  # (channel, known values), in a demonstration


def update(view: View, item: Sample | Estimate | Event) -> View:
    """Take one output of the pipeline into the view."""
    if isinstance(item, Sample):
        return view._replace(t=item.t, sample=item)
    if isinstance(item, Event):
        return view._replace(events=(*view.events[-2:], item))
    others = tuple(e for e in view.estimates if e.estimator != item.estimator)
    view = view._replace(t=max(view.t, item.t), estimates=tuple(sorted((*others, item), key=_by_name)))
    if item.status is Status.OK:
        others = tuple(e for e in view.held if e.estimator != item.estimator)
        view = view._replace(held=(*others, item))
    return view


def _by_name(e: Estimate) -> str:
    return e.estimator


def render(view: View) -> RenderableType:
    """Draw the view."""
    parts: list[RenderableType] = [_now(view), _estimates(view)]
    if view.truth:
        known = Text("truth  ", style="bold magenta")
        known.append("   ".join(f"{name}: {values}" for name, values in view.truth), style="magenta")
        parts.append(known)
    parts += [Text(line.says, style="bold red" if line.wrong else "dim") for line in view.lines]
    parts += [Text(f"• {event.says}", style="yellow") for event in view.events]
    return Panel(Group(*parts), title=view.title, subtitle=words.clock(view.t), title_align="left")


def _now(view: View) -> Text:
    text = Text()
    if view.sample is None:
        return Text("waiting for the first frames …", style="dim")
    signals = view.sample.signals
    for role, unit in SHOWN.items():
        if role in signals:
            value = signals[role]
            shown = f"{value:.1f}" if value == value else "–"
            text.append(f"{role.replace('_', ' ')} ", style="dim")
            text.append(f"{shown} {unit}   ", style="bold")
    value = view.sample.output
    text.append(f"{view.output.replace('_', ' ')} ", style="dim")
    shown = f"{value:.1f}" if value == value else "–"
    text.append(f"{shown} {words.OUTPUT_UNITS.get(view.output, '')}", style="bold")
    if view.sample.gate is not Gate.OPEN:
        text.append(f"\n{view.sample.gate.value}", style="cyan")
    return text


def _estimates(view: View) -> Table:
    unit = words.OUTPUT_UNITS.get(view.output, "")
    table = Table(box=None, pad_edge=False, expand=True)
    for head in ("answer to", "by", "K", "τ  s", "θ  s", "can be told", "status"):
        table.add_column(head, no_wrap=head != "status")
    held = {e.estimator: e for e in view.held}
    for latest in view.estimates:
        ok = latest.status is Status.OK
        shown = latest if ok else held.get(latest.estimator, latest)
        for row, (name, ch) in enumerate(shown.channels.items()):
            style = "" if ok else "dim"
            status = Text(latest.status.value, style=COLOURS[latest.status]) if row == 0 else Text("")
            if row == 0 and ok and latest.fit_percent == latest.fit_percent:
                status.append(f"  fit {latest.fit_percent:.0f} %", style="dim")
            table.add_row(
                Text(f"{words.INPUT_WORDS.get(name, name)} [{unit}/{words.INPUT_UNITS.get(name, '')}]"),
                latest.estimator,
                Text(words.interval(ch.K), style="bold" if ok else "dim"),
                *(Text(cell, style=style) for cell in _delays(ch)),
                Text(words.CAN_TELL[ch.status], style=style),
                status,
            )
        age = f" (shown: {shown.t:.0f} s)" if not ok and shown is not latest else ""
        swing = ", ".join(
            f"{words.INPUT_WORDS.get(n, n)} ±{x:.2g} {words.INPUT_UNITS.get(n, '')}"
            for n, x in latest.excitation.items()
            if x == x
        )
        table.add_row(Text(f"  {latest.says}{age}" + (f"  excitation {swing}" if swing else ""), style="dim"))
    return table


def _delays(ch: Channel) -> tuple[str, str]:
    if ch.status is Identifiable.OK:
        return words.interval(ch.tau), words.interval(ch.dead_time)
    if ch.status is Identifiable.SUM_ONLY:
        return f"τ+θ {words.interval(ch.tau_plus_dead_time)}", ""
    return "–", "–"
