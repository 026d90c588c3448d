"""The live view: what a test engineer reads in one second, as a rich renderable."""

from __future__ import annotations

from typing import NamedTuple

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.panel import Panel
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from canid.types import Channel, Estimate, Event, Gate, Identifiable, Sample, Screened, Status, Watch
from canid.views import words
from canid.views.terminal_text import terminal_text

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
    screened: Screened | None = None  # the latest
    truth: tuple[tuple[str, str], ...] = ()  # (channel, known values), in a demonstration


def update(view: View, item: Sample | Estimate | Screened | Event) -> View:
    """Take one output of the pipeline into the view."""
    if isinstance(item, Sample):
        return view._replace(t=item.t, sample=item)
    if isinstance(item, Event):
        return view._replace(events=(*view.events[-2:], item))
    if isinstance(item, Screened):
        return view._replace(t=max(view.t, item.t), screened=item)
    others = tuple(e for e in view.estimates if e.estimator != item.estimator)
    view = view._replace(t=max(view.t, item.t), estimates=tuple(sorted((*others, item), key=_by_name)))
    if item.status is Status.OK:
        others = tuple(e for e in view.held if e.estimator != item.estimator)
        view = view._replace(held=(*others, item))
    return view


def _by_name(e: Estimate) -> str:
    return e.estimator


def render(view: View) -> RenderableType:
    """Draw the view: some 96 columns and 20 lines, whose places do not move while numbers come and go."""
    parts: list[RenderableType] = [_now(view)]
    held = {e.estimator: e for e in view.held}
    for latest in view.estimates:
        parts += [Text(), *_estimator(latest, held.get(latest.estimator), view.output)]
    if view.screened is not None:
        parts += [Text(), _screened(view.screened)]
    if view.truth:
        known = Text("truth  ", style="bold magenta")
        known.append("   ".join(f"{name}: {values}" for name, values in view.truth), style="magenta")
        parts += [Text(), known]
    parts.append(Text())
    parts += [_line(line.says, "bold red" if line.wrong else "dim") for line in view.lines]
    parts += [_line(f"• {event.says}", "yellow") for event in view.events]
    title = _line(view.title, "")
    return TerminalSafe(Panel(Group(*parts), title=title, subtitle=words.clock(view.t), title_align="left"))


class TerminalSafe:
    """A renderable whose text holds nothing that a terminal acts on, wherever in it a foreign name stands."""

    def __init__(self, renderable: RenderableType):
        """Wrap it."""
        self._renderable = renderable

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Render it, with the text of every segment escaped; rich's own styles and movements stay."""
        for segment in console.render(self._renderable, options):
            safe = segment.control or segment.text == "\n"
            yield (
                segment
                if safe
                else Segment("\n".join(map(terminal_text, segment.text.split("\n"))), segment.style)
            )


def _line(says: str, style: str) -> Text:
    """Foreign text in one line; escaped before rich measures its width."""
    return Text(terminal_text(says), style=style)


def _now(view: View) -> Text:
    text = Text()
    if view.sample is None:
        return Text("waiting for the first frames …", style="dim")
    signals = view.sample.signals
    # right-aligned in the width of 199.9 and -19.9, so that nothing jumps
    for role, unit in SHOWN.items():
        if role in signals:
            text.append(f"{role.replace('_', ' ')} ", style="dim")
            text.append(f"{_short(signals[role]):>5} {unit}   ", style="bold")
    text.append(f"{view.output.replace('_', ' ')} ", style="dim")
    text.append(f"{_short(view.sample.output):>5} {words.OUTPUT_UNITS.get(view.output, '')}", style="bold")
    gate = view.sample.gate
    if gate is not Gate.OPEN:
        text.append(f"\n{gate.value}", style="cyan")
    elif view.sample.learn:
        text.append("\nlearning", style="green")
    else:
        text.append("\nsettling: the estimators wait until what was before has died away", style="cyan")
    return text


def _screened(s: Screened) -> Text:
    """Does the model still fit, and since when not."""
    known = any(block.state is Watch.FITS for block in s.blocks.values())
    style = "bold red" if not s.fits else "green" if known else "dim"
    return Text("  screen ", style="bold").append(words.misfit(s), style=style)


def _short(value: float) -> str:
    return f"{value:.1f}" if value == value else "–"


def _estimator(latest: Estimate, held: Estimate | None, output: str) -> list[RenderableType]:
    """Head, one row per input, sentence. Without an estimate now, the last good one stays, dimmed."""
    ok = latest.status is Status.OK
    # numbers that another estimator contradicts are shown as they are, in the colour of their status
    now = ok or latest.status is Status.INCONSISTENT
    shown = latest if now or held is None else held
    style = (
        "bold green" if latest.headline else COLOURS[latest.status].removeprefix("bold ") if now else "dim"
    )
    head = Text()
    head.append(f"{words.READ if latest.headline else ' '} ", style="bold green")
    head.append(f"{latest.estimator:7}", style="bold")
    head.append(f"{latest.status.value:13}", style=COLOURS[latest.status])
    if shown.fit_percent == shown.fit_percent:
        head.append(f"fit {shown.fit_percent:.0f} %   ")
    if shown.used == shown.used:
        head.append(f"from {shown.used:.0f} s of driving   ")
    if latest.headline:
        head.append("the number to read", style="bold green")
    if not now and held is not None:
        head.append(f"last told at {words.clock(held.t)}", style="yellow")
    table = Table(box=None, pad_edge=False, show_header=False, padding=(0, 1, 0, 0))
    # widths of "headway error", "-16.45 [-22.28, -11.05] m/s² per m/s", "τ 0.06 [0.03, 0.20] s  θ ..."
    for width in (14, 33, 45):
        table.add_column(width=width, no_wrap=True)
    for name, ch in shown.channels.items():
        table.add_row(
            Text(f" {words.INPUT_WORDS.get(name, name)}"),
            _gain(ch, f"{words.OUTPUT_UNITS.get(output, '')} per {words.INPUT_UNITS.get(name, '')}", style),
            Text(_delays(ch), style=style if latest.headline or not ok else ""),
        )
    swing = " · ".join(
        f"{words.INPUT_WORDS.get(name, name)} ±{x:.2g} {words.INPUT_UNITS.get(name, '')}"
        for name, x in latest.excitation.items()
        if x == x
    )
    says = Text(f" {latest.says}", style="dim" if ok else COLOURS[latest.status])
    return [head, table, Text(f" excitation: {swing or '–'}", style="dim"), says]


def _gain(ch: Channel, unit: str, style: str) -> Text:
    if ch.status is Identifiable.NOT:
        return Text("–  not identifiable", style="dim")
    text = Text(f"K {words.interval(ch.K)}", style=style)
    text.append(f" {unit}", style="not bold dim")
    return text


def _delays(ch: Channel) -> str:
    return "τ, θ cannot be told" if ch.status is Identifiable.GAIN_ONLY else words.lag(ch)
