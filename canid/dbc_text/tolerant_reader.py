"""A DBC, read line by line: what has one meaning is repaired, what has none is left out, both with their lines."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from canid.dbc_text import tables
from canid.dbc_text.attributes import Attributes
from canid.dbc_text.content import Content, Message, Repair
from canid.dbc_text.message_lines import MessageLine, SignalLine, message_line, name_in, signal_line
from canid.dbc_text.messages import assembled
from canid.dbc_text.overlap import overlaps
from canid.dbc_text.statements import Statement, divided, is_remark, quoted
from canid.dbc_text.tables import Key, Pages

# signals that belong to no message
_UNASSIGNED = "VECTOR__INDEPENDENT_SIG_MSG"


class Lines(NamedTuple):
    """A message's lines."""

    line: int
    message: MessageLine
    signals: list[tuple[int, str, SignalLine]]  # with line and text
    lost: set[str]  # names of signals that cannot be read


class Found(NamedTuple):
    """What the statements of a file say."""

    messages: list[Lines]
    texts: dict[tuple[Key, str], tuple[Statement, dict[int, str], str]]
    tables: dict[str, dict[int, str]]
    floats: dict[tuple[Key, str], tuple[Statement, bool]]
    pages: dict[Key, list[tuple[Statement, Pages]]]
    unclear: dict[tuple[Key, str], Statement]  # signals (or "": messages) of which a statement cannot be read
    attributes: Attributes
    repairs: list[Repair]
    left_out: list[Repair]


def read_tolerantly(text: str) -> Content:
    """Read a DBC text that the format's grammar refuses.

    Args:
        text: with line feeds alone.

    Returns:
        Its messages as cantools would give them for the repaired text; what was repaired; what was left out.

    Example:
        >>> found = read_tolerantly('BO_ 201326642 2017_5: 8 X' + chr(10) + ' SG_ 0_S : 7|8@0+ (.5,0) [0|1] "km/h" X')
        >>> found.messages[0][:3], found.messages[0].signals[0].scale, [one.kind for one in found.repairs]
        (('2017_5', 201326642, True), 0.5, ['flag', 'name', 'name', 'number'])
    """
    parts = divided(text)
    found = Found([], {}, {}, {}, {}, {}, Attributes({}, {}, {}), [*parts.repairs], [])
    current: Lines | None = None
    for one in parts.statements:
        if one.keyword == "BO_":
            current = _message(one, found)
        elif one.keyword == "SG_":
            _signal(one, current, found)
        elif one.keyword:
            _further(one, found)
        elif is_remark(one.text):
            found.repairs.append(Repair(one.line, "comment", quoted(one.text), "a comment"))
        else:
            # it may have been the line of a message: signals that follow are not those of the message before
            current = None
            _leave_out(one, "no statement of a DBC", found)
    messages: list[Message] = []
    for lines in found.messages:
        messages += assembled(lines, found)
    _unused(found)
    found.repairs.sort()
    found.left_out.sort()
    bad = [message.name for message in messages if overlaps(message)]
    return Content(tuple(messages), (), tuple(bad), tuple(found.repairs), tuple(found.left_out))


def _leave_out(one: Statement, why: str, found: Found) -> None:
    found.left_out.append(Repair(one.line, "", quoted(one.text), why))


def _message(one: Statement, found: Found) -> Lines | None:
    parsed = message_line(one.text)
    if isinstance(parsed, str):
        if _UNASSIGNED not in one.text:
            _leave_out(one, f"{parsed}; the message is left out", found)
        return None
    if parsed.name == _UNASSIGNED:
        return None
    found.repairs.extend(Repair(one.line, kind, quoted(one.text), now) for kind, now in parsed.fixes)
    lines = Lines(one.line, parsed, [], set())
    found.messages.append(lines)
    return lines


def _signal(one: Statement, message: Lines | None, found: Found) -> None:
    if message is None:
        return  # of a message that was left out
    parsed = signal_line(one.text)
    if isinstance(parsed, str):
        message.lost.add(name_in(one.text))
        _leave_out(one, f"{parsed}; the signal is left out", found)
        return
    found.repairs.extend(Repair(one.line, kind, quoted(one.text), now) for kind, now in parsed.fixes)
    message.signals.append((one.line, one.text, parsed))


def _further(one: Statement, found: Found) -> None:
    reader = _READERS.get(one.keyword)
    if reader is not None and not reader(one, found):
        about = tables.subject(one.text)
        if one.keyword in ("SIG_VALTYPE_", "SG_MUL_VAL_"):
            if about is not None:
                found.unclear[about] = one
            _leave_out(one, "it cannot be read; the signal that it describes is left out", found)
        elif one.keyword in ("VAL_", "VAL_TABLE_"):
            _leave_out(one, "it cannot be read; the signal has no value table", found)
        else:
            found.repairs.append(Repair(one.line, "attribute", quoted(one.text), "left out"))


def _values(one: Statement, found: Found) -> bool:
    parsed = tables.values(one.text)
    if parsed is None:
        return tables.is_of_variable(one.text)
    if parsed.texts or parsed.table:
        found.texts[parsed.key, parsed.signal] = one, parsed.texts, parsed.table
    return True


def _table(one: Statement, found: Found) -> bool:
    parsed = tables.value_table(one.text)
    if parsed is not None:
        found.tables[parsed[0]] = parsed[1]
    return parsed is not None


def _type(one: Statement, found: Found) -> bool:
    parsed = tables.value_type(one.text)
    if parsed is not None:
        found.floats[parsed[0], parsed[1]] = one, parsed[2]
    return parsed is not None


def _pages(one: Statement, found: Found) -> bool:
    parsed = tables.pages(one.text)
    if parsed is not None:
        found.pages.setdefault(parsed.key, []).append((one, parsed))
    return parsed is not None


def _attribute(one: Statement, found: Found) -> bool:
    parsed = tables.attribute(one.text)
    if parsed is not None:
        found.attributes.values[parsed.name, parsed.key, parsed.signal] = parsed.value
    # of nodes and variables: not needed
    return parsed is not None or " BU_" in one.text or " EV_" in one.text


def _default(one: Statement, found: Found) -> bool:
    parsed = tables.default(one.text)
    if parsed is not None:
        found.attributes.defaults[parsed[0]] = parsed[1]
    return parsed is not None


def _definition(one: Statement, found: Found) -> bool:
    parsed = tables.choices(one.text)
    if parsed is not None:
        found.attributes.choices[parsed[0]] = parsed[1]
    return True


_READERS: dict[str, Callable[[Statement, Found], bool]] = {
    "VAL_": _values,
    "VAL_TABLE_": _table,
    "SIG_VALTYPE_": _type,
    "SG_MUL_VAL_": _pages,
    "BA_": _attribute,
    "BA_DEF_DEF_": _default,
    "BA_DEF_": _definition,
}


def _unused(found: Found) -> None:
    known = {
        ((lines.message.id, lines.message.extended), signal.name)
        for lines in found.messages
        for _, _, signal in lines.signals
    }
    for one, about in [
        *((entry[0], key) for key, entry in found.texts.items()),
        *((entry[0], key) for key, entry in found.floats.items()),
        *((one, (key, page.signal)) for key, of in found.pages.items() for one, page in of),
    ]:
        if about not in known:
            found.repairs.append(Repair(one.line, "unused", quoted(one.text), "left out"))
