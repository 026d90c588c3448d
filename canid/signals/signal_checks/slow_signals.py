"""Signals whose values are updated too rarely for delays to be identified: slow, held, or joined by lines.

A line between two readings holds the later one, so an output answers before its driver does, and lags for longer. Measured
on drives of 10 min: where 20 % of the rows of 10 Hz were lost tau came out 0.02 to 0.08 s longer and theta as much shorter,
at 35 % 0.1 to 0.2 s, and with the output alone at 4 Hz, joined by lines, 0.03 s. With all signals at 2 Hz gains came out up
to nine times too large. With a radar at 5 Hz, held or joined by lines, 42 numbers of 8 drives no longer held, and 41 of them
were tau or theta (`python -m benchmarks sensor_effects`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Annotated, NamedTuple

from canid.signals.samples.reading_spans import SPAN_S
from canid.signals.signal_checks.blocks import Block
from canid.signals.signal_checks.check import Check, Found
from canid.values.state_constraints import TIME
from canid.values.text.names import readable

# s; between the periods of 4 Hz, at which gains hold, and of 3.3 Hz (OBD2 polled), at which they do not always
MAX_UPDATE_S = 0.28
# s, of an output, whose samples are then taken as far apart (mathematics/estimators/output_stamps.py): gains held at 2 Hz
MAX_OUTPUT_UPDATE_S = 0.55
# s; between the 0.122 s of 10 Hz of which 10 % of the readings are lost, at which delays hold as without a loss, and the
# 0.150 s of 20 %, at which they do not; a span of ten seconds knows them to 0.008 and 0.013 s
MAX_DELAYS_UPDATE_S = 0.135
# An offset is what the wheel makes it: held, it is late, and the wheel moves before it. Of 0.2 s K was 1.4 times the truth.
LATE_WHERE_HELD = "lateral_offset"
# spans that are kept, a minute, and of these that must be slow: one calm stretch decides nothing
KEPT_SPANS, NEEDED_SPANS = 6, 3
# roles that the inputs are made of; any other that comes is the output
INPUTS = frozenset(("gap", "range_rate", "speed", "lateral_offset"))
# of a role that a driver holds between movements, at no fixed rate. Of a wheel angle nothing was measured
BY_FOOT = "pedal"
# 10 s show how even intervals are, and not whose they are: of those that vary by 3 % about a clock, and of a person's, whose
# variations add up, 9 and 8 of 10 count as a clock's, by 6 % 3 and 4, by 10 % none
EVENLY = "at a rhythm even to some 5 %"
BETWEEN = {"points": "", "hold": ", held in between", "line": ", joined by lines"}


class Update(NamedTuple):
    """What a span of one role has shown."""

    seconds: float  # s between new values
    kind: str
    clock: bool = True


class Shown(NamedTuple):
    """What the spans of one role have shown."""

    since: Annotated[float, TIME]  # s, begin of the first: a rate is that of the whole drive
    updates: tuple[Update, ...]  # of the latest


class State(NamedTuple):
    """By role."""

    shown: Mapping[str, Shown] = {}


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(name: str, state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block.

    Args:
        name: of the finding that is looked for.
        state: from `init()` or the step before.
        block: of a second.

    Example:
        >>> import numpy as np
        >>> from canid.signals.samples.reading_spans import ReadingSpan
        >>> state, rows = init(), np.zeros((10, 10))
        >>> for k in range(3):
        ...     span = ReadingSpan("pedal", 10.0 * k + 10.0, 0.5, "points", 0.0, 2.0)
        ...     block = Block(span.t, 0.1, rows, (), (), True, True, spans=(span,))
        ...     state, found = step("output_slow", state, block)
        >>> found.says
        'pedal comes at 2 Hz: tau and theta cannot be identified below 0.5 s'
    """
    shown = dict(state.shown)
    for span in block.spans:
        if (span.role in INPUTS) == (name == "input_slow") and span.update == span.update:
            # the readings' own time, and the estimators' where they differ after a restart
            before = shown.get(span.role) or Shown(max(min(span.t, block.t) - SPAN_S, 0.0), ())
            updates = (*before.updates, Update(span.update, span.kind, span.clock))[-KEPT_SPANS:]
            shown[span.role] = before._replace(updates=updates)
    state = State(shown)
    slow = {role: update for role, seen in shown.items() if (update := _slow(seen.updates)) is not None}
    held = slow.pop(BY_FOOT) if BY_FOOT in slow and not slow[BY_FOOT].clock else None
    if name == "output_held":
        return state, None if held is None else _held(held, shown[BY_FOOT].since)
    if not slow:
        return state, None
    parts: dict[str, list[str]] = {}
    for role, update in slow.items():
        how = f"at {1.0 / update.seconds:.2g} Hz{BETWEEN[update.kind]}"
        parts.setdefault(how, []).append(readable(role))
    named = "; ".join(
        f"{', '.join(roles)} {'comes' if len(roles) == 1 else 'come'} {how}" for how, roles in parts.items()
    )
    longest = max(update.seconds for update in slow.values())
    delays_only = longest <= (MAX_UPDATE_S if name == "input_slow" else MAX_OUTPUT_UPDATE_S)
    late = slow.get(LATE_WHERE_HELD)
    delays_only = delays_only and (late is None or late.kind != "hold")
    what = "the response is not identifiable"
    if delays_only:
        what = f"tau and theta cannot be identified below {longest:.2g} s"
    says = f"{named}: {what}"
    since = min(shown[role].since for role in slow)
    remedy = f"record {', '.join(map(readable, slow))} at 8 Hz or more"
    if BY_FOOT in slow and slow[BY_FOOT].kind == "hold":
        remedy += f"; a driver who moves it {EVENLY} shows the same, and then nothing is wrong"
    return state, Found(name, tuple(slow), since, says, remedy, delays_only=delays_only)


def _held(update: Update, since: float) -> Found:
    """What is said of a pedal that stands between movements at no fixed rate: the hold is in tau + theta, and gains stay."""
    says = (
        f"{BY_FOOT} stands still between movements some {update.seconds:.2g} s apart, not {EVENLY}: a driver who acts and "
        "waits, or a program that held what came irregularly; tau and theta contain the hold"
    )
    remedy = f"nothing is wrong where the driver did so; else record {BY_FOOT} as it comes"
    return Found("output_held", (BY_FOOT,), since, says, remedy, delays_only=True)


def _slow(updates: tuple[Update, ...]) -> Update | None:
    """How the value is updated where enough spans show that delays are not identifiable.

    Not each of them shows the knots of lines. On a clock if half of them are.
    """
    slow = sorted(update for update in updates if update.seconds > MAX_DELAYS_UPDATE_S)
    if len(slow) < NEEDED_SPANS:
        return None
    clock = 2 * sum(update.clock for update in slow) >= len(slow)
    return slow[(len(slow) - 1) // 2]._replace(clock=clock)


CHECKS = (
    Check("input_rate", init, partial(step, "input_slow")),
    Check("output_rate", init, partial(step, "output_slow")),
    Check("output_holds", init, partial(step, "output_held")),
)
