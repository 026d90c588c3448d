"""The live view of the display: state, estimates and health of a session, as a rich renderable."""

from __future__ import annotations

from typing import NamedTuple

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.panel import Panel
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from canid.signal_checks.signal_checks import sentence
from canid.types import (
    BlockStatus,
    Channel,
    Estimate,
    Event,
    Identifiable,
    LearnGate,
    MonitorReport,
    Sample,
    SignalFinding,
    SignalReport,
    Status,
)
from canid.views import estimate_text
from canid.views.names import HEADLINE_MARK, readable
from canid.views.numbers import DASH, UNITS, clock, gain_unit
from canid.views.terminal_text import terminal_text

# the columns of measured signals, left to right: role and unit; a role that the vehicle does not have is left out
COLUMNS = {"speed": "m/s", "gap": "m", "headway": "s", "range_rate": "m/s", "lateral_offset": "m"}
STYLES = {
    Status.OK: "bold green",
    Status.CONVERGING: "yellow",
    Status.NOT_EXCITED: "yellow",
    Status.INCONSISTENT: "bold red",
    Status.NO_LEAD: "cyan",
    Status.NO_DRIVER: "cyan",
    Status.STALE: "bold red",
}
# columns of "headway error", "-16.45 [-22.28, -11.05] m/s² per m/s", "τ 0.06 [0.03, 0.20] s  θ ..."
CHANNEL_WIDTHS = (14, 33, 45)
# columns of a measured value, right-aligned: 199.9 and -19.9 fit, so that nothing jumps
VALUE_WIDTH = 5
# events that stay on the display
EVENTS_SHOWN = 3


class HealthLine(NamedTuple):
    """One line on the state of a bus, the recorder or the estimators; red where something is wrong."""

    text: str
    wrong: bool = False


class View(NamedTuple):
    """Everything that the live view shows."""

    title: str
    t: float = 0.0
    output: str = "pedal"
    sample: Sample | None = None
    estimates: tuple[Estimate, ...] = ()  # the latest of each estimator
    last_ok: tuple[Estimate, ...] = ()  # the latest "ok" of each estimator
    lines: tuple[HealthLine, ...] = ()
    events: tuple[Event, ...] = ()
    monitor: MonitorReport | None = None  # the latest of the model monitor
    signals: tuple[SignalFinding, ...] = ()  # that stand
    truth: tuple[tuple[str, str], ...] = ()  # (channel, known values), in a demonstration


def update(view: View, item: Sample | Estimate | MonitorReport | SignalReport | Event) -> View:
    """Take one output of the pipeline into the view."""
    if isinstance(item, Sample):
        return view._replace(t=item.t, sample=item)
    if isinstance(item, Event):
        return view._replace(events=(*view.events, item)[-EVENTS_SHOWN:])
    if isinstance(item, MonitorReport):
        return view._replace(t=max(view.t, item.t), monitor=item)
    if isinstance(item, SignalReport):
        wrong = [one for one in item.findings if one.withholds]
        return view._replace(
            signals=tuple(one for one in item.findings if one.until != one.until),
            # what was good while a signal was wrong, and nobody knew it yet
            last_ok=tuple(
                e for e in view.last_ok if not any(one.since <= e.t <= one.raised for one in wrong)
            ),
        )
    others = tuple(e for e in view.estimates if e.estimator != item.estimator)
    view = view._replace(t=max(view.t, item.t), estimates=tuple(sorted((*others, item), key=_by_name)))
    if item.status is Status.OK:
        others = tuple(e for e in view.last_ok if e.estimator != item.estimator)
        view = view._replace(last_ok=(*others, item))
    return view


def _by_name(e: Estimate) -> str:
    return e.estimator


def render(view: View) -> RenderableType:
    """Draw the view: some 96 columns and 20 lines, whose places do not move while numbers come and go."""
    parts: list[RenderableType] = [_signals(view)]
    last_ok = {e.estimator: e for e in view.last_ok}
    for latest in view.estimates:
        parts += [Text(), *_estimator(latest, last_ok.get(latest.estimator), view.output)]
    if view.monitor is not None:
        parts += [Text(), _monitor_line(view.monitor)]
    if view.signals:
        parts += [Text(), *(_line(f"✗ {sentence(one)}", "bold red") for one in view.signals)]
    if view.truth:
        known = Text("truth  ", style="bold magenta")
        known.append("   ".join(f"{name}: {values}" for name, values in view.truth), style="magenta")
        parts += [Text(), known]
    parts.append(Text())
    parts += [_line(line.text, "bold red" if line.wrong else "dim") for line in view.lines]
    parts += [_line(f"• {event.says}", "yellow") for event in view.events]
    title = _line(view.title, "")
    return TerminalSafe(Panel(Group(*parts), title=title, subtitle=clock(view.t), title_align="left"))


class TerminalSafe:
    """A renderable without characters that a terminal acts on, wherever in it text from a file stands."""

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


def _line(text: str, style: str) -> Text:
    """Text from a file or a driver in one line; escaped before rich measures its width."""
    return Text(terminal_text(text), style=style)


def _signals(view: View) -> Text:
    """Measured signals, the driver's output, and whether the estimators learn."""
    text = Text()
    if view.sample is None:
        return Text("waiting for the first frames …", style="dim")
    signals = view.sample.signals
    for role, unit in COLUMNS.items():
        if role in signals:
            text.append(f"{readable(role)} ", style="dim")
            text.append(f"{_value(signals[role])} {unit}   ", style="bold")
    text.append(f"{readable(view.output)} ", style="dim")
    text.append(f"{_value(view.sample.output)} {UNITS.get(view.output, '')}", style="bold")
    gate = view.sample.gate
    if gate is not LearnGate.OPEN:
        text.append(f"\n{gate.value}", style="cyan")
    elif view.sample.learn:
        text.append("\nlearning", style="green")
    else:
        text.append("\nsettling: the estimators wait until earlier transients have decayed", style="cyan")
    return text


def _value(x: float) -> str:
    return f"{x:{VALUE_WIDTH}.1f}" if x == x else f"{DASH:>{VALUE_WIDTH}}"


def _monitor_line(s: MonitorReport) -> Text:
    """Whether the learnt models still fit, and since when not."""
    known = any(block.state is BlockStatus.FITS for block in s.blocks.values())
    style = "bold red" if not s.fits else "green" if known else "dim"
    return Text("  monitor ", style="bold").append(estimate_text.misfit(s), style=style)


def _estimator(latest: Estimate, last_ok: Estimate | None, output: str) -> list[RenderableType]:
    """Head, one row per channel, excitation, and what is missing or the sentence.

    Without an estimate now, the last good one stays, dimmed.
    """
    # the numbers of an inconsistent estimate are shown as they are, in the style of its status
    now = latest.status in (Status.OK, Status.INCONSISTENT)
    shown = latest if now or last_ok is None else last_ok
    style = "bold green" if latest.headline else STYLES[latest.status].removeprefix("bold ") if now else "dim"
    missing = estimate_text.all_missing(latest.channels) if latest.status is Status.OK else ""
    return [
        _head(latest, shown, None if now else last_ok),
        _channels(shown, output, style, plain=latest.status is Status.OK and not latest.headline),
        Text(f" excitation: {_excitation(latest)}", style="dim"),
        Text(
            f" {missing or latest.says}", style="dim" if latest.status is Status.OK else STYLES[latest.status]
        ),
    ]


def _head(latest: Estimate, shown: Estimate, outdated: Estimate | None) -> Text:
    head = Text()
    head.append(f"{HEADLINE_MARK if latest.headline else ' '} ", style="bold green")
    head.append(f"{latest.estimator:7}", style="bold")
    head.append(f"{latest.status.value:13}", style=STYLES[latest.status])
    if shown.fit_percent == shown.fit_percent:
        head.append(f"fit {shown.fit_percent:.0f} %   ")
    if shown.used == shown.used:
        head.append(f"from {shown.used:.0f} s of driving   ")
    if latest.headline:
        head.append("headline estimate", style="bold green")
    if outdated is not None:
        head.append(f"last estimate at {clock(outdated.t)}", style="yellow")
    return head


def _channels(shown: Estimate, output: str, style: str, *, plain: bool) -> Table:
    table = Table(box=None, pad_edge=False, show_header=False, padding=(0, 1, 0, 0))
    for width in CHANNEL_WIDTHS:
        table.add_column(width=width, no_wrap=True)
    for name, ch in shown.channels.items():
        delays = Text(_delays(ch), style="" if plain else style)
        table.add_row(Text(f" {readable(name)}"), _gain(ch, gain_unit(output, name), style), delays)
    return table


def _excitation(e: Estimate) -> str:
    """Standard deviation of each input over the data used."""
    known = [f"{readable(name)} ±{x:.2g} {UNITS.get(name, '')}" for name, x in e.excitation.items() if x == x]
    return " · ".join(known) or DASH


def _gain(ch: Channel, unit: str, style: str) -> Text:
    if ch.status is Identifiable.NOT:
        return Text(f"{DASH}  not identifiable", style="dim")
    text = Text(f"K {estimate_text.fixed(ch.K)}", style=style)
    text.append(f" {unit}", style="not bold dim")
    return text


def _delays(ch: Channel) -> str:
    delays = estimate_text.delays(ch)
    return delays or ("τ, θ not identifiable" if ch.status is Identifiable.GAIN_ONLY else "")
