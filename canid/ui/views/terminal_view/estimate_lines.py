"""An estimate as lines: its head, its channels and its sentence."""

from __future__ import annotations

from typing import NamedTuple

from canid.ui.terminal.spans import Line, Span, packed, wrapped
from canid.ui.views.terminal_view.state import View
from canid.values.text import estimate_text
from canid.values.text.names import HEADLINE_MARK, method, readable
from canid.values.text.numbers import clock, gain_unit, number
from canid.values.types import Channel, Estimate, Identifiable, Status

STYLES = {
    Status.OK: "bold green",
    Status.CONVERGING: "yellow",
    Status.NOT_EXCITED: "yellow",
    Status.INCONSISTENT: "bold red",
    Status.NO_LEAD: "cyan",
    Status.NO_DRIVER: "cyan",
    Status.STALE: "bold red",
}
# columns of "headway error" and of "K -16.45 [-22.28, -11.05] % per m/s", where the terminal is wide enough to have the
# numbers of two channels below one another
NAME_COLUMNS, GAIN_COLUMNS = 13, 32
ALIGNED_FROM_COLUMNS = 76
# columns below which the head of an estimate keeps to what matters most
SPACIOUS_FROM_COLUMNS = 50


class Numbers(NamedTuple):
    """An estimate as it is now, and the one whose numbers are shown."""

    now: Estimate
    shown: Estimate  # the last good one, where there is none now
    outdated: bool
    style: str


def numbers(view: View, now: Estimate) -> Numbers:
    """Which numbers are shown of an estimator: without an estimate now, the last good one, dimmed."""
    last_ok = next((e for e in view.last_ok if e.estimator == now.estimator), None)
    # the numbers of an inconsistent estimate are shown as they are, in the style of its status
    good = now.status in (Status.OK, Status.INCONSISTENT)
    if good or last_ok is None:
        style = "bold green" if now.headline else STYLES[now.status].removeprefix("bold ") if good else "dim"
        return Numbers(now, now, False, style)
    return Numbers(now, last_ok, True, "dim")


def head(n: Numbers, columns: int) -> list[Line]:
    """Estimator, status, and how much the numbers rest on."""
    mark = f"{HEADLINE_MARK} " if n.now.headline else ""
    status = n.now.status
    items: list[Line] = [
        (
            Span(mark, "bold green"),
            Span(method(n.now.estimator), "bold"),
            Span("  "),
            Span(status.value, STYLES[status]),
        )
    ]
    if n.outdated:
        items.append((Span(f"last estimate at {clock(n.shown.t)}", "yellow"),))
    elif n.now.headline:
        items.append((Span("headline estimate" if columns >= ALIGNED_FROM_COLUMNS else "headline", "green"),))
    if n.shown.fit_percent == n.shown.fit_percent:
        items.append((Span(f"fit {number(n.shown.fit_percent, '%', 2)}", "dim"),))
    if n.shown.used == n.shown.used and columns >= SPACIOUS_FROM_COLUMNS:
        items.append((Span(f"from {n.shown.used:.0f} s", "dim"),))
    return packed(items, columns)


def channel(name: str, ch: Channel, output: str, style: str, columns: int) -> list[Line]:
    """K, and what is known of τ and θ, each with its 95 % interval."""
    aligned = columns >= ALIGNED_FROM_COLUMNS
    label = Span(f"{readable(name):{NAME_COLUMNS}}" if aligned else readable(name))
    if ch.status is Identifiable.NOT:
        return packed([(label,), (Span("not identifiable", "dim"),)], columns)
    gain, unit = f"K {estimate_text.fixed(ch.K)}", gain_unit(output, name)
    fill = " " * max(GAIN_COLUMNS - len(gain) - len(unit) - 1, 0) if aligned else ""
    items: list[Line] = [(label,)]
    # where both fit side by side, else the unit follows the number on the next line
    together = len(gain) + len(unit) + 1 <= columns - 2
    items += (
        [(Span(gain, style), Span(f" {unit}{fill}", "dim"))]
        if together
        else [(Span(gain, style),), (Span(unit, "dim"),)]
    )
    if ch.status is Identifiable.OK:
        items.append((Span(f"τ {estimate_text.fixed(ch.tau)} s", style),))
        items.append((Span(f"θ {estimate_text.fixed(ch.dead_time)} s", style),))
    elif ch.status is Identifiable.SUM_ONLY:
        items.append((Span(f"τ+θ {estimate_text.fixed(ch.tau_plus_dead_time)} s", style),))
        items.append((Span(_rough(ch), "dim"),))
    else:
        items.append((Span(estimate_text.delays(ch) or "τ, θ not identifiable", "dim"),))
    return packed([item for item in items if any(span.text for span in item)], columns)


def _rough(ch: Channel) -> str:
    """What is known of τ where only the sum may be quoted, in brackets."""
    _, bracket, known = estimate_text.delays(ch).rpartition("(")
    return f"({known}" if bracket else ""


def sentence(e: Estimate, columns: int) -> list[Line]:
    """What the status says, and what to do; never shortened."""
    return wrapped(
        e.says, "dim" if e.status is Status.OK else STYLES[e.status], columns, first="", indent="  "
    )


def lines(n: Numbers, output: str, columns: int) -> list[Line]:
    """Head, channels and, where the estimate is not good, its sentence."""
    out = head(n, columns)
    for name, ch in n.shown.channels.items():
        out += channel(name, ch, output, n.style, columns)
    if n.now.status is not Status.OK:
        out += sentence(n.now, columns)
    return out
