"""The first lines of the terminal view: is it recording, where, how far, and was anything dropped."""

from __future__ import annotations

import math
from pathlib import PurePath

from canid.ui.terminal.spans import Line, Span, cells, fitted, packed, shortened, width, wrapped
from canid.ui.views.terminal_view.state import Recording, Replayed, View
from canid.values.text.numbers import clock, file_size

# s between a frame's arrival and its writing above which the line is red: 0.25 is promised, a busy machine adds to it
MAX_LAG_S = 0.4
# columns from which on all of it stands in one line
ONE_LINE_FROM_COLUMNS = 76
# columns of the progress bar of a replay
MIN_BAR_COLUMNS, MAX_BAR_COLUMNS = 8, 24

NAMED = {"waiting": "● REC waiting", "armed": "◌ ARMED", "listening": "○ NOT RECORDING"}


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
    armed = r.state == "armed"
    base = "reverse bold red" if wrong else "reverse green" if r.path and not armed else "reverse yellow"
    if r.state.startswith(
        "recording"
    ):  # of a triggered recording with the trigger, which has a line of its own
        state = "● REC"
    else:
        state = NAMED.get(r.state) or (f"● REC {r.state}" if r.path else f"○ {r.state}")
    frames = f"{r.written if r.path else r.frames:,} frames"
    size = file_size(r.bytes) if r.path else ""
    lag = f"lag {r.lag:.2f} s" if r.path and math.isfinite(r.lag) else ""
    first = [Span(f" {state} ", f"{base} bold"), _dropped(r, base)]
    first.insert(1, Span(f" {frames}  ", base))
    end = f" {clock(r.elapsed)} "
    name = PurePath(r.path).name
    left = columns - width(tuple(first)) - cells(lag) - 4
    if columns >= ONE_LINE_FROM_COLUMNS and cells(name) <= left:
        # the name before the time and the size, the whole path last
        end = end if cells(name + end) <= left else ""
        left -= cells(end)
        size = f"  {size}" if size and cells(name + size) + 2 <= left else ""
        left -= cells(size)
        shown = r.path if cells(r.path) <= left else name
        middle = "".join(f"  {text}" for text in (lag + size, shown) if text)
        line = fitted((*first, Span(middle, base)), columns - cells(end), fill=True)
        return [(*line, Span(end, base))]
    items: list[Line] = [
        (Span(state, f"{base} bold"),),
        (Span(frames, base),),
        (_dropped(r, base),),
        (Span(shortened(name or "no file", columns - 2), base),),
        (Span(lag, base),) if lag else (),
    ]
    out = packed(items, columns - 2, indent=0)
    # blanks between items, too, in the style of the bar
    styled = [tuple(Span(text, style or base) for text, style in line) for line in out]
    return [fitted((Span(" ", base), *line, Span(" ", base)), columns, fill=True) for line in styled]


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
    if columns < ONE_LINE_FROM_COLUMNS or cells(log) > left:
        second = (Span(f" {shortened(log, columns - 2)}", base),)
        return [fitted(line, columns, fill=True) for line in (first, second)]
    bar = min(left - cells(log) - 2, MAX_BAR_COLUMNS) if known else 0
    bar = bar if bar >= MIN_BAR_COLUMNS else 0
    full = round(done * bar)
    progress = f"{'█' * full}{'░' * (bar - full)}  " if bar else ""
    more = f"  {vehicle}" if vehicle and cells(progress + log + vehicle) + 2 <= left else ""
    return [fitted((*first, Span(f" {progress}{log}{more}", base)), columns, fill=True)]
