"""Repairs of a DBC as a user reads them, and names that a file gives twice."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from canid.signals.dbc_text.content import REPAIRS
from canid.signals.dbc_text.parsing import Content, Message, Signal
from canid.signals.vehicle.quoting import brief

# line numbers that a summary gives, and lines on what was left out or renamed
_MAX_LINE_NUMBERS, _MAX_LINES = 4, 5


def repair_report(content: Content) -> list[str]:
    """Say what was repaired and left out, each line to follow the file's name.

    Repairs that change no value share one line; what is left out has a line each, with its text and the reason.

    Example:
        >>> from canid.signals.dbc_text.parsing import Repair
        >>> one = Repair(12, "flag", "BO_ 201326642 RADAR: 8 X", "29-bit id 0xC000032")
        >>> repair_report(Content((), (), (), (one,), (Repair(3, "", "BO_ x", "no message"),)))[0]
        ': ids above 0x7FF without the flag of 29-bit ids, read as such: line 12'
    """
    by_kind: dict[str, list[int]] = {}
    for repair in content.repairs:
        by_kind.setdefault(repair.kind, []).append(repair.line)
    notable: list[str] = []
    cosmetic: list[str] = []
    for kind, numbers in by_kind.items():
        text, own_line = REPAIRS[kind]
        (notable if own_line else cosmetic).append(f"{text}: {_line_numbers(numbers)}")
    lines = [f": {text}" for text in notable]
    if cosmetic:
        lines.append(f": repaired without a change of any value: {'; '.join(cosmetic)}")
    lines += [
        f", line {repair.line}, {brief(repair.was)}: {repair.now}" for repair in content.left_out[:_MAX_LINES]
    ]
    more = len(content.left_out) - _MAX_LINES
    return [*lines, f": {more:,} more lines are left out"] if more > 0 else lines


def _line_numbers(numbers: Sequence[int]) -> str:
    shown = ", ".join(str(number) for number in numbers[:_MAX_LINE_NUMBERS])
    more = len(numbers) - _MAX_LINE_NUMBERS
    return f"{'line' if len(numbers) == 1 else 'lines'} {shown}{f' and {more:,} more' if more > 0 else ''}"


def by_name(messages: Iterable[Message]) -> tuple[dict[str, Message], list[str]]:
    """Messages and their signals by name: of several with one name the last keeps it, the others get their id.

    Returns:
        The messages, and a line on each name that was given twice.

    Example:
        >>> one = Message("M", 1, False, 8, 0.1, ())
        >>> found, lines = by_name([one, one._replace(id=2)])
        >>> list(found), lines
        (['M_0x1', 'M'], [': M is the name of 2 messages; 0x2 keeps it, the others are M_0x1'])
    """
    same: dict[str, list[Message]] = {}
    lines: list[str] = []
    for message in messages:
        signals, doubled = _distinct(message.signals)
        if doubled:
            lines.append(
                f": {brief(message.name)} has several signals of one name; the last of each keeps it, the others are "
                f"{brief(', '.join(doubled))}"
            )
        same.setdefault(message.name, []).append(message._replace(signals=signals))
    named: dict[str, Message] = {}
    taken = set(same)
    for name, alike in same.items():
        others = []
        for message in alike[:-1]:
            # NaN is no equal period
            if message._replace(period=0.0) != alike[-1]._replace(period=0.0):
                others.append(_free(f"{name}_0x{message.id:X}", taken))
                named[others[-1]] = message._replace(name=others[-1])
        named[name] = alike[-1]
        if others:
            lines.append(
                f": {brief(name)} is the name of {len(others) + 1} messages; 0x{alike[-1].id:X} keeps it, the others are "
                f"{brief(', '.join(others))}"
            )
    shown, more = lines[:_MAX_LINES], len(lines) - _MAX_LINES
    return named, [*shown, f": {more:,} more names are given twice"] if more > 0 else shown


def _free(name: str, taken: set[str]) -> str:
    """A name that is not taken yet; it is then."""
    number, free = 2, name
    while free in taken:
        free, number = f"{name}_{number}", number + 1
    taken.add(free)
    return free


def _distinct(signals: tuple[Signal, ...]) -> tuple[tuple[Signal, ...], list[str]]:
    """Signals with names that differ, and the new names; the same signal twice, or on several pages, is one."""
    counts: dict[str, list[Signal]] = {}
    for signal in signals:
        counts.setdefault(signal.name, []).append(signal)
    if len(counts) == len(signals):
        return signals, []
    out: list[Signal] = []
    renamed: list[str] = []
    taken = set(counts)
    for name, alike in counts.items():
        # cantools gives the value table to the first of them
        texts = next((signal.choices for signal in alike if signal.choices), {})
        alike = [signal if signal.choices else signal._replace(choices=texts) for signal in alike]
        last = alike[-1]
        if _exclusive(alike):
            out.append(_on_all_pages(alike))
            continue
        for earlier in alike[:-1]:
            if earlier != last:
                new = _free(f"{name}_bit{earlier.start}", taken)
                renamed.append(new)
                out.append(earlier._replace(name=new))
        out.append(last)
    return tuple(out), renamed


def _exclusive(signals: Sequence[Signal]) -> bool:
    """Whether a frame carries one of these at most: they are on different pages of one selector."""
    pages = [page for signal in signals for page in signal.pages]
    selectors = {signal.multiplexer for signal in signals}
    return (
        len(signals) > 1
        and len(selectors) == 1
        and None not in selectors
        and all(signal.pages and not signal.is_multiplexer for signal in signals)
        and len(pages) == len(set(pages))
    )


def _on_all_pages(signals: Sequence[Signal]) -> Signal:
    """One signal of several pages."""
    places: list[Signal] = []
    for signal in signals:
        k = next((k for k, other in enumerate(places) if other._replace(pages=signal.pages) == signal), None)
        if k is None:
            places.append(signal)
        else:
            places[k] = places[k]._replace(pages=tuple(sorted((*places[k].pages, *signal.pages))))
    return places[0]._replace(elsewhere=tuple(places[1:]))
