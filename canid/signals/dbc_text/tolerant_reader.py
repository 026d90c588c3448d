"""A DBC, read line by line: what has one meaning is repaired, what has none is left out, both with their lines."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from canid.signals.dbc_text import tables
from canid.signals.dbc_text.attributes import Attributes
from canid.signals.dbc_text.content import Content, Message, Repair
from canid.signals.dbc_text.message_lines import MessageLine, SignalLine, message_line, name_in, signal_line
from canid.signals.dbc_text.messages import assembled
from canid.signals.dbc_text.overlap import overlaps
from canid.signals.dbc_text.statements import Statement, divided, is_remark, quoted
from canid.signals.dbc_text.tables import Key, Pages

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
        >>> content = read_tolerantly('BO_ 201326642 2017_5: 8 X' + chr(10) + ' SG_ 0_S : 7|8@0+ (.5,0) [0|1] "km/h" X')
        >>> content.messages[0][:3], content.messages[0].signals[0].scale, [repair.kind for repair in content.repairs]
        (('2017_5', 201326642, True), 0.5, ['flag', 'name', 'name', 'number'])
    """
    parts = divided(text)
    dbc = Found([], {}, {}, {}, {}, {}, Attributes({}, {}, {}), [*parts.repairs], [])
    current: Lines | None = None
    for statement in parts.statements:
        if statement.keyword == "BO_":
            current = _message(statement, dbc)
        elif statement.keyword == "SG_":
            _signal(statement, current, dbc)
        elif statement.keyword:
            _further(statement, dbc)
        elif is_remark(statement.text):
            dbc.repairs.append(Repair(statement.line, "comment", quoted(statement.text), "a comment"))
        else:
            # it may have been the line of a message: signals that follow are not those of the message before
            current = None
            _leave_out(statement, "no statement of a DBC", dbc)
    messages: list[Message] = []
    for lines in dbc.messages:
        messages += assembled(lines, dbc)
    _unused(dbc)
    dbc.repairs.sort()
    dbc.left_out.sort()
    bad = [message.name for message in messages if overlaps(message)]
    return Content(tuple(messages), (), tuple(bad), tuple(dbc.repairs), tuple(dbc.left_out))


def _leave_out(statement: Statement, why: str, dbc: Found) -> None:
    dbc.left_out.append(Repair(statement.line, "", quoted(statement.text), why))


def _message(statement: Statement, dbc: Found) -> Lines | None:
    parsed = message_line(statement.text)
    if isinstance(parsed, str):
        if _UNASSIGNED not in statement.text:
            _leave_out(statement, f"{parsed}; the message is left out", dbc)
        return None
    if parsed.name == _UNASSIGNED:
        return None
    dbc.repairs.extend(
        Repair(statement.line, kind, quoted(statement.text), now) for kind, now in parsed.fixes
    )
    lines = Lines(statement.line, parsed, [], set())
    dbc.messages.append(lines)
    return lines


def _signal(statement: Statement, message: Lines | None, dbc: Found) -> None:
    if message is None:
        return  # of a message that was left out
    parsed = signal_line(statement.text)
    if isinstance(parsed, str):
        message.lost.add(name_in(statement.text))
        _leave_out(statement, f"{parsed}; the signal is left out", dbc)
        return
    dbc.repairs.extend(
        Repair(statement.line, kind, quoted(statement.text), now) for kind, now in parsed.fixes
    )
    message.signals.append((statement.line, statement.text, parsed))


def _further(statement: Statement, dbc: Found) -> None:
    reader = _READERS.get(statement.keyword)
    if reader is not None and not reader(statement, dbc):
        about = tables.subject(statement.text)
        if statement.keyword in ("SIG_VALTYPE_", "SG_MUL_VAL_"):
            if about is not None:
                dbc.unclear[about] = statement
            _leave_out(statement, "it cannot be read; the signal that it describes is left out", dbc)
        elif statement.keyword in ("VAL_", "VAL_TABLE_"):
            _leave_out(statement, "it cannot be read; the signal has no value table", dbc)
        else:
            dbc.repairs.append(Repair(statement.line, "attribute", quoted(statement.text), "left out"))


def _values(statement: Statement, dbc: Found) -> bool:
    parsed = tables.values(statement.text)
    if parsed is None:
        return tables.is_of_variable(statement.text)
    if parsed.texts or parsed.table:
        dbc.texts[parsed.key, parsed.signal] = statement, parsed.texts, parsed.table
    return True


def _table(statement: Statement, dbc: Found) -> bool:
    parsed = tables.value_table(statement.text)
    if parsed is not None:
        dbc.tables[parsed[0]] = parsed[1]
    return parsed is not None


def _type(statement: Statement, dbc: Found) -> bool:
    parsed = tables.value_type(statement.text)
    if parsed is not None:
        dbc.floats[parsed[0], parsed[1]] = statement, parsed[2]
    return parsed is not None


def _pages(statement: Statement, dbc: Found) -> bool:
    parsed = tables.pages(statement.text)
    if parsed is not None:
        dbc.pages.setdefault(parsed.key, []).append((statement, parsed))
    return parsed is not None


def _attribute(statement: Statement, dbc: Found) -> bool:
    parsed = tables.attribute(statement.text)
    if parsed is not None:
        dbc.attributes.values[parsed.name, parsed.key, parsed.signal] = parsed.value
    # of nodes and variables: not needed
    return parsed is not None or " BU_" in statement.text or " EV_" in statement.text


def _default(statement: Statement, dbc: Found) -> bool:
    parsed = tables.default(statement.text)
    if parsed is not None:
        dbc.attributes.defaults[parsed[0]] = parsed[1]
    return parsed is not None


def _definition(statement: Statement, dbc: Found) -> bool:
    parsed = tables.choices(statement.text)
    if parsed is not None:
        dbc.attributes.choices[parsed[0]] = parsed[1]
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


def _unused(dbc: Found) -> None:
    known = {
        ((lines.message.id, lines.message.extended), signal.name)
        for lines in dbc.messages
        for _, _, signal in lines.signals
    }
    for statement, about in [
        *((entry[0], key) for key, entry in dbc.texts.items()),
        *((entry[0], key) for key, entry in dbc.floats.items()),
        *(
            (statement, (key, page.signal))
            for key, entries in dbc.pages.items()
            for statement, page in entries
        ),
    ]:
        if about not in known:
            dbc.repairs.append(Repair(statement.line, "unused", quoted(statement.text), "left out"))
