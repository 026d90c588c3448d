"""Values of signals from the raw numbers of frames; what a frame cannot mean becomes NaN and is counted."""

from __future__ import annotations

from collections import Counter

import numpy as np
import numpy.typing as npt

from canid.signals.vehicle.bits import Bools, Payloads, raws_of, scaled
from canid.signals.vehicle.decoding_plan import PlainSignals
from canid.signals.vehicle.mapping import SignalMap
from canid.values.types import NAN, Array


def plain_values(plain: PlainSignals, frames: Payloads) -> dict[str, Array]:
    """Values of the plain signals, by role; a role is missing where a frame has none: `read_values` counts why."""
    if frames.shortest < plain.bytes:
        return {}
    raw = np.array((frames.little, frames.big))[plain.motorola] >> plain.shift & plain.mask
    number = ((raw ^ plain.sign) - plain.sign).view(np.int64)  # two's complement, modulo 2^64
    with np.errstate(all="ignore"):
        value = number * plain.factor + plain.offset
    good: Bools = np.all((value >= plain.low) & (value <= plain.high), axis=1)
    which, no_value = plain.no_value
    if len(which):
        good[which[(number[which] == no_value).any(axis=1)]] = False
    if len(plain.switches):
        value[plain.switches] = (value[plain.switches] != 0.0) != plain.inverted
    return {role: value[k] for k, role in enumerate(plain.roles) if good[k]}


def read_values(
    how: SignalMap, what: str, frames: Payloads, problems: Counter[str]
) -> tuple[Array, Bools | None]:
    """The values in the role's unit, NaN where there is none, and which frames carry it (None: all)."""
    value, present = _read_place(how, what, frames, problems)
    for other in how.elsewhere:
        there, carries = _read_place(other, what, frames, problems)
        if present is not None and carries is not None:  # pages exclude each other
            value, present = np.where(carries, there, value), present | carries
    return value, present


def _read_place(
    how: SignalMap, what: str, frames: Payloads, problems: Counter[str]
) -> tuple[Array, Bools | None]:
    """The same, of one of its places."""
    present: Bools | None = None
    for where, numbers in how.when:
        raw, there = raws_of(where, frames)
        fits = among(raw, numbers)
        fits = fits if there is None else fits & there
        present = fits if present is None else present & fits
    raw, there = raws_of(how.bits, frames)
    value = scaled(how.bits, raw, how.factor, how.offset)
    # frames that count: those that carry it and are long enough, whose text and range nobody has objected to
    good = present
    if there is not None:
        lacking = ~there if present is None else present & ~there
        _drop(value, lacking, _short_text(what), problems)
        good = there if present is None else present & there
    if how.reserved is not None:
        first, error, absent = how.reserved
        for hit, text in (
            ((raw >= first) & (raw < error), "reserved"),
            ((raw >= error) & (raw < absent), "error"),
            (raw >= absent, "not available"),
        ):
            hit = hit if good is None else hit & good
            _drop(value, hit, _no_value_text(what, text), problems)
            good = ~hit if good is None else good & ~hit
    for number, text in how.no_value.items():
        hit = raw == number
        if hit.any():
            hit = hit if good is None else hit & good
            _drop(value, hit, _no_value_text(what, text), problems)
            good = ~hit if good is None else good & ~hit
    if not _cannot_leave(how):
        with np.errstate(invalid="ignore"):
            hit = ~((value >= how.low) & (value <= how.high))
        if hit.any():
            hit = hit if good is None else hit & good
            _drop(value, hit, _out_of_range_text(what), problems)
    if how.kind == "bool":
        true = value != 0.0 if how.on is None else np.isin(value, tuple(how.on))
        value = np.where(value == value, (true != how.invert).astype(np.float64), NAN)
    return value, present


def _drop(value: Array, hit: Bools, problem: str, problems: Counter[str]) -> None:
    n = int(np.count_nonzero(hit))
    if n:
        value[hit] = NAN
        problems[problem] += n


def _cannot_leave(how: SignalMap) -> bool:
    """Whether every raw number is within the signal's range."""
    if how.bits.floating:
        return False
    ends = [raw * how.factor + how.offset for raw in how.bits.reach]
    return how.low <= min(ends) and max(ends) <= how.high


def among(raw: npt.NDArray[np.generic], numbers: frozenset[int]) -> Bools:
    """Which raw numbers are among these; a handful, so each is compared."""
    hits = np.zeros(len(raw), bool)
    for number in numbers:
        hits |= raw == number
    return hits


def _short_text(what: str) -> str:
    """A frame that ends before the signal does."""
    return f"{what}: frame too short"


def _no_value_text(what: str, text: str) -> str:
    """A value-table entry that says that there is none."""
    return f'{what}: "{text}"'


def _out_of_range_text(what: str) -> str:
    """A value outside what the vehicle file or the DBC allows."""
    return f"{what}: out of range"
