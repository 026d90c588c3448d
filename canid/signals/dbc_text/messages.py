"""Messages, put together from their lines and from what other statements say of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from canid.signals.dbc_text import attributes
from canid.signals.dbc_text.content import Message, Repair, Signal
from canid.signals.dbc_text.message_lines import SignalLine
from canid.signals.dbc_text.statements import quoted
from canid.signals.dbc_text.tables import Key

if TYPE_CHECKING:
    from canid.signals.dbc_text.tolerant_reader import Found, Lines


def assembled(lines: Lines, dbc: Found) -> list[Message]:
    """Put one message together; none where a statement on it cannot be read."""
    key = (lines.message.id, lines.message.extended)
    if (key, "") in dbc.unclear:
        why = f"line {dbc.unclear[key, ''].line} describes it and cannot be read; the message is left out"
        dbc.left_out.append(Repair(lines.line, "", lines.message.name[:60], why))
        return []
    name = dbc.attributes.values.get(("SystemMessageLongSymbol", key, "")) or lines.message.name
    signals = _signals(lines, key, dbc)
    return [
        Message(
            name,
            *key,
            lines.message.length,
            attributes.period(dbc.attributes, key),
            tuple(sorted(signals, key=_start)),
            attributes.protocol(dbc.attributes, key),
        )
    ]


def _start(signal: Signal) -> int:
    return 8 * (signal.start // 8) + 7 - signal.start % 8 if signal.motorola else signal.start


def _signals(lines: Lines, key: Key, dbc: Found) -> list[Signal]:
    given: dict[str, dict[str, list[int]]] = {}  # selector -> signal -> pages
    for _, page in dbc.pages.get(key, ()):
        given.setdefault(page.selector, {})[page.signal] = page.numbers
    selector_of = {name: selector for selector, by_signal in given.items() for name in by_signal}
    selectors = [signal.name for _, _, signal in lines.signals if signal.marker.endswith("M")]
    only = selectors[0] if len(selectors) == 1 else None
    names = {signal.name for _, _, signal in lines.signals}
    out = []
    for line, text, signal in lines.signals:
        selector = None
        if signal.marker:
            selector = selector_of.get(signal.name) if only is None else only if signal.name != only else None
        why = _trouble(signal, selector, key, names, given, dbc)
        if why:
            dbc.left_out.append(Repair(line, "", quoted(text), f"{why}; the signal is left out"))
            continue
        numbers: set[int] = set()
        if selector is not None:
            if only is not None and signal.marker[1:].isdigit():
                numbers.add(int(signal.marker[1:]))
            numbers.update(given.get(selector, {}).get(signal.name, ()))
        out.append(_made(signal, selector, numbers, key, dbc))
    return out


def _trouble(
    signal: SignalLine,
    selector: str | None,
    key: Key,
    names: set[str],
    given: Mapping[str, Mapping[str, list[int]]],
    dbc: Found,
) -> str:
    """Why a signal has no one meaning; empty where it has."""
    if (key, signal.name) in dbc.unclear:
        return f"line {dbc.unclear[key, signal.name].line} describes it and cannot be read"
    if selector is not None and selector not in names:
        return f"its multiplexer {selector[:60]} cannot be read or does not exist"
    paged = given.get(selector, {}) if selector is not None else {}
    if signal.marker == "m" and signal.name not in given and signal.name not in paged:
        return "its page is not said"
    if signal.marker.startswith("m") and selector is None and signal.name not in given:
        return "it is multiplexed, and which signal selects its page is not said"
    return ""


def _made(signal: SignalLine, selector: str | None, pages: set[int], key: Key, dbc: Found) -> Signal:
    def long_name(name: str) -> str:
        return dbc.attributes.values.get(("SystemSignalLongSymbol", key, name)) or name

    entry = dbc.texts.get((key, signal.name))
    texts = {} if entry is None else entry[1]
    if entry is not None and entry[2]:
        texts = dbc.tables.get(entry[2], {})
        now = f"value table {entry[2]}" if texts else "no value table"
        dbc.repairs.append(Repair(entry[0].line, "table", quoted(entry[0].text), now))
    floating = dbc.floats.get((key, signal.name))
    return Signal(
        name=long_name(signal.name),
        start=signal.start,
        length=signal.length,
        motorola=signal.motorola,
        signed=signal.signed,
        floating=floating is not None and floating[1],
        scale=signal.scale,
        offset=signal.offset,
        minimum=signal.minimum,
        maximum=signal.maximum,
        unit=signal.unit,
        choices=dict(texts),
        is_multiplexer=signal.marker.endswith("M"),
        multiplexer=None if selector is None else long_name(selector),
        pages=tuple(sorted(pages)),
        spn=attributes.spn(dbc.attributes, key, signal.name),
    )
