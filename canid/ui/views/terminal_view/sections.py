"""The parts of the terminal view below the headline, each as lines of a given width."""

from __future__ import annotations

import re

from canid.signals.signal_checks.signal_checks import sentence
from canid.ui.terminal.spans import Line, Span, packed, wrapped
from canid.ui.views.terminal_view.state import HealthLine, View
from canid.ui.views.terminal_view.units import SpeedUnit
from canid.values.text import estimate_text
from canid.values.text.names import readable
from canid.values.text.numbers import DASH, UNITS, clock, number
from canid.values.types import BlockStatus, Event, LearnGate, Sample

# the measured signals, most important first: role and unit; a role that the vehicle does not have is left out
COLUMNS = {"gap": "m", "headway": "s", "range_rate": "m/s", "speed": "m/s", "lateral_offset": "m"}
# columns of a measured value, right-aligned: 199.9 and -19.9 fit, so that nothing jumps
VALUE_WIDTH = 5
# the beginning of a sentence that says when
_TIMED = re.compile(r"[\d.]+ s: ")


def measured(view: View, unit: SpeedUnit, columns: int) -> list[Line]:
    """Lead, own speed, the driver's output, and whether the estimators learn."""
    if view.sample is None:
        waits = "waiting for the first frames" if view.estimating else ""
        return [(Span(waits, "dim"),)] if waits else []
    signals = view.sample.signals
    items: list[Line] = []
    for role, unit_text in COLUMNS.items():
        if role in signals:
            speed = unit_text == SpeedUnit.M_S.value
            value = signals[role] * (unit.factor if speed else 1.0)
            items.append(_value(role, value, unit.value if speed else unit_text))
    items.append(_value(view.output, view.sample.output, UNITS.get(view.output, "")))
    return packed(items, columns, indent=0)


def gate(sample: Sample | None, columns: int) -> list[Line]:
    """Whether the estimators learn from this sample, or why not."""
    if sample is None:
        return []
    if sample.gate is not LearnGate.OPEN:
        return wrapped(sample.gate.value, "cyan", columns)
    if sample.learn:
        return [(Span("learning", "green"),)]
    return wrapped("settling: the estimators wait until earlier transients have decayed", "cyan", columns)


def _value(role: str, x: float, unit: str) -> Line:
    text = f"{round(x, 1) + 0.0:{VALUE_WIDTH}.1f}" if x == x else f"{DASH:>{VALUE_WIDTH}}"
    return (Span(readable(role), "dim"), Span(f"{text} {unit}", "bold"))


def excitation(view: View, columns: int) -> list[Line]:
    """Standard deviation of each input over the data that the headline estimate rests on."""
    e = next((e for e in view.estimates if e.headline), view.estimates[-1] if view.estimates else None)
    if e is None:
        return []
    known = [
        (Span(f"{readable(name)} ±{number(x, UNITS.get(name, ''), 2)}", "dim"),)
        for name, x in e.excitation.items()
        if x == x
    ]
    return packed([(Span("excitation", "dim"),), *known], columns) if known else []


def residual_tests(view: View, columns: int) -> list[Line]:
    """The residual tests of the headline estimate."""
    tests = next((e.residual_tests for e in view.estimates if e.headline), None)
    if tests is None:
        return []
    return [line for text in estimate_text.residual_tests(tests) for line in wrapped(text, "dim", columns)]


def monitor(view: View, columns: int) -> list[Line]:
    """Whether the learnt models still fit, and since when not."""
    if view.monitor is None:
        return []
    known = any(block.state is BlockStatus.FITS for block in view.monitor.blocks.values())
    style = "bold red" if not view.monitor.fits else "green" if known else "dim"
    return wrapped(f"monitor: {estimate_text.misfit(view.monitor)}", style, columns)


def diagnosis(view: View, columns: int, most: int | None = None) -> list[Line]:
    """What the diagnosis of the drive so far says; `most`: in so many lines."""
    if view.diagnosis is None:
        return []
    return wrapped(view.diagnosis.says, "magenta", columns)[:most]


def findings(view: View, columns: int, first: int | None = None) -> list[Line]:
    """What is wrong with signals; `first`: only so many, and how many more there are."""
    shown = view.signals[:first]
    out = [line for finding in shown for line in wrapped(f"✗ {sentence(finding)}", "bold red", columns)]
    return out + _more(len(view.signals) - len(shown), "signal findings")


def troubles(view: View, columns: int, first: int | None = None) -> list[Line]:
    """What is wrong with recorder, buses and estimators."""
    wrong = [line for line in view.lines if line.wrong]
    shown = wrong[:first]
    out = [line for trouble in shown for line in health(trouble, columns)]
    return out + _more(len(wrong) - len(shown), "lines on what is wrong")


def _more(left: int, what: str) -> list[Line]:
    return [(Span(f"  and {left} more {what}: use a larger terminal", "red"),)] if left else []


def health(line: HealthLine, columns: int) -> list[Line]:
    """A line on a bus, the recorder or the estimators, broken between its items where it is too long."""
    style = "bold red" if line.wrong else "dim"
    out: list[Line] = []
    now = ""
    for item in line.text.split("   "):
        longer = f"{now}   {item}" if now else item
        if now and len(longer) > columns:
            out += wrapped(now, style, columns)
            longer = f"  {item}"
        now = longer
    return out + wrapped(now, style, columns)


def in_order(view: View, columns: int) -> list[Line]:
    """The lines on buses and estimators that report nothing wrong; the recorder's is the first line of the picture."""
    lines = view.lines[1:] if view.recording is not None else view.lines
    return [line for entry in lines if not entry.wrong for line in health(entry, columns)]


def loads(view: View, columns: int) -> list[Line]:
    """The load of each bus, in one line."""
    if view.recording is None:
        return []
    known = [
        (Span(f"{bus.name} {100 * bus.load:.0f} %", "dim"),)
        for bus in view.recording.buses
        if bus.load == bus.load
    ]
    return packed([(Span("bus load", "dim"),), *known], columns)[:1] if known else []


def events(view: View, columns: int, last: int) -> list[Line]:
    """The last events, the newest at the bottom."""
    kept = view.events[-last:] if last else ()
    return [line for event in kept for line in wrapped(f"• {event_text(event)}", "yellow", columns)]


def event_text(event: Event) -> str:
    """What an event says, with its time where the sentence does not begin with it.

    Example:
        >>> event_text(Event(62.0, "mark", "mark: overtaking")), event_text(Event(3.0, "x", "2.9 s: another vehicle"))
        ('1:02.0 mark: overtaking', '2.9 s: another vehicle')
    """
    return event.says if _TIMED.match(event.says) else f"{clock(event.t)} {event.says}"


def truth(view: View, columns: int) -> list[Line]:
    """The known parameters of a demonstration."""
    if not view.truth:
        return []
    known = [(Span(f"{name}: {values}", "magenta"),) for name, values in view.truth]
    return packed([(Span("truth", "bold magenta"),), *known], columns)
