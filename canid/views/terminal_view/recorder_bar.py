"""The first lines of the terminal view: is it recording, where, how far, and was anything dropped."""

from __future__ import annotations

import math
from pathlib import PurePath

from canid.views.numbers import clock
from canid.views.status_lines import MAX_LAG_S
from canid.views.terminal_view.spans import Line, Span, cells, fitted, packed, shortened, width, wrapped
from canid.views.terminal_view.state import Recording, Replayed, View

# columns from which on all of it stands in one line
ONE_LINE_FROM_COLUMNS = 76
# columns of the progress bar of a replay
MIN_BAR_COLUMNS, MAX_BAR_COLUMNS = 8, 24


def lines(view: View, columns: int) -> list[Line]:
    """One or two lines; they are there at every size."""
    if view.recording is not None:
        return _recording(view, view.recording, columns)
    if view.replayed is not None:
        return _replayed(view, view.replayed, columns)
    return [fitted((Span(f" {view.title}  {clock(view.t)}", "reverse bold"),), columns, fill=True)]


def _recording(view: View, r: Recording, columns: int) -> list[Line]:
    if r.state.startswith("failed"):
        out = wrapped(f"✗ RECORDING {r.state}", "reverse bold red", columns)
        out += packed([(_dropped(r, ""),), (Span(f"{r.written:,} of {r.frames:,} frames written"),)], columns)
        return out
    wrong = r.dropped > 0 or r.lag > MAX_LAG_S
    base = "reverse bold red" if wrong else "reverse green" if r.path else "reverse yellow"
    state = {"recording": "● REC", "waiting": "● REC waiting", "listening": "○ NOT RECORDING"}.get(
        r.state, f"● REC {r.state}" if r.path else f"○ {r.state}"
    )
    frames = f"{r.written if r.path else r.frames:,} frames"
    size = f"{r.bytes / 1e6:.1f} MB" if r.path else ""
    lag = f"lag {r.lag:.2f} s" if r.path and math.isfinite(r.lag) else ""
    first = [Span(f" {state} ", f"{base} bold"), _dropped(r, base)]
    first.insert(1, Span(f" {frames}  ", base))
    end = f" {clock(r.elapsed)} "
    name = PurePath(r.path).name
    if columns >= ONE_LINE_FROM_COLUMNS:
        left = columns - width(tuple(first)) - cells(end) - 2
        rest = [lag, size] if cells(lag + size + name) + 6 <= left else [lag]
        left -= sum(cells(text) + 2 for text in rest if text)
        shown = r.path if cells(r.path) <= left else shortened(name, left)
        middle = "".join(f"  {text}" for text in (*rest, shown) if text)
        line = fitted((*first, Span(middle, base)), columns - cells(end), fill=True)
        return [(*line, Span(end, base))]
    lag = lag.replace(".00 s", ".0 s")
    second = f" {shortened(name or 'no file', columns - cells(lag) - 3)}  {lag}"
    return [
        fitted(tuple(first), columns, fill=True),
        fitted((Span(second, base),), columns, fill=True),
    ]


def _dropped(r: Recording, base: str) -> Span:
    return Span(f"{r.dropped:,} dropped", "reverse bold red" if r.dropped else base)


def _replayed(view: View, r: Replayed, columns: int) -> list[Line]:
    """The drive's time, of its duration where that is known."""
    state = " ❚❚ REPLAY paused " if r.paused else " ▶ REPLAY "
    base = "reverse yellow" if r.paused else "reverse cyan"
    known = r.duration > 0.0 and math.isfinite(r.duration)
    done = min(max(r.t / r.duration, 0.0), 1.0) if known else 0.0
    time = f"{clock(r.t)} of {clock(r.duration)}  {100 * done:.0f} %" if known else clock(r.t)
    speed = f"×{r.speed:g}" if math.isfinite(r.speed) else "max"
    first: Line = (Span(state, f"{base} bold"), Span(f" {time}  {speed} ", base))
    log, _, vehicle = view.title.removeprefix("canid replay · ").partition(" · ")
    left = columns - width(first) - 2
    if columns < ONE_LINE_FROM_COLUMNS:
        second = (Span(f" {shortened(log, columns - 2)}", base),)
        return [fitted(line, columns, fill=True) for line in (first, second)]
    bar = max(min(left - cells(log) - 2, MAX_BAR_COLUMNS), MIN_BAR_COLUMNS) if known else 0
    full = round(done * bar)
    progress = f"{'█' * full}{'░' * (bar - full)}  " if known else ""
    name = shortened(log, max(left - cells(progress), 0))
    more = f"  {vehicle}" if vehicle and cells(progress + name + vehicle) + 2 <= left else ""
    return [fitted((*first, Span(f" {progress}{name}{more}", base)), columns, fill=True)]
