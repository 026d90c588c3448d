"""Parser of trigger conditions, by recursive descent: comparisons with numbers, joined by and, or, not.

condition  = all { "or" all }
all        = one { "and" one }
one        = "not" one | "(" condition ")" | "misfit" | "mark" | "event" NAME | NAME [ operator number [ unit ] ]
"""

from __future__ import annotations

import math
import re
from difflib import get_close_matches
from typing import NamedTuple

from canid.values.errors import ConfigError

# characters of a condition, and brackets within brackets: more is no text that a person wrote
MAX_LENGTH, MAX_DEPTH = 500, 20
# characters of it in a sentence
_MAX_QUOTED = 80

_WORDS = ("and", "or", "not", "misfit", "mark", "event")
# `=` alone is a token too, for its own sentence
_TOKEN = re.compile(
    r"\s*(?:(?P<op><=|>=|==|!=|<|>|=)|(?P<bracket>[()])"
    r"|(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[^\W\d]\w*(?:\.\w+)?))"
)
_UNIT = re.compile(r"\s*(?P<unit>[%°‰]|(?:[^\W\d_]|[%°])[^\s()<>=!]*)")


class Compared(NamedTuple):
    """A signal against a number; `operator` "": a yes/no signal that must say yes."""

    name: str
    operator: str
    value: float
    unit: str
    column: int = 1  # of the name in the text, from 1
    unit_column: int = 1


class Misfit(NamedTuple):
    """The monitor says that the model does not fit."""


class Happened(NamedTuple):
    """An event of this name, at the frame that caused it; `mark`: of a person."""

    event: str


class Not(NamedTuple):
    """The contrary."""

    of: Condition


class And(NamedTuple):
    """All of them."""

    parts: tuple[Condition, ...]


class Or(NamedTuple):
    """One of them at least."""

    parts: tuple[Condition, ...]


Condition = Compared | Misfit | Happened | Not | And | Or


def brief(text: str) -> str:
    r"""A part of a condition for a sentence: printable, on one short line.

    >>> brief("a" + chr(27) + "b"), len(brief("x" * 500))
    ('a\\x1bb', 80)
    """
    short = text if len(text) <= _MAX_QUOTED else f"{text[: _MAX_QUOTED - 3]}..."
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in short)


def parse(text: str) -> Condition:
    """Parse a condition.

    Raises:
        ConfigError: it is none; the sentence names the column.

    Example:
        >>> parse("brake > 0")[:3]
        ('brake', '>', 0.0)
        >>> parse("speed >= 50 km/h and not mark").parts[1]
        Not(of=Happened(event='mark'))
        >>> parse("brake > ")
        Traceback (most recent call last):
        canid.values.errors.ConfigError: --trigger "brake > ", column 9: a number is missing
    """
    if len(text) > MAX_LENGTH:
        raise ConfigError(f"--trigger: a condition of {len(text):,} characters; {MAX_LENGTH} is the most")
    parser = _Parser(text)
    condition = parser.any_of(0)
    if parser.kind:
        close = get_close_matches(parser.word.lower(), ("and", "or"), n=1)
        hint = f' (did you mean "{close[0]}"?)' if close else ""
        if parser.kind == "op":
            hint = "; join comparisons by and: 1 < x < 3 is x > 1 and x < 3"
        raise parser.wrong(f'"{brief(parser.word)}" is not expected here{hint}')
    return condition


def mistake(text: str, column: int, says: str) -> ConfigError:
    """An error that names the place in the text."""
    return ConfigError(f'--trigger "{brief(text)}", column {column}: {says}')


class _Parser:
    """The rest of a text and its next token."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._next = 0
        self.kind = self.word = ""
        self.column = 1
        self.step()

    def wrong(self, says: str) -> ConfigError:
        return mistake(self._text, self.column, says)

    def step(self) -> None:
        """Take the next token; `kind` is "" at the end."""
        rest = self._text[self._next :]
        self.column = self._next + len(rest) - len(rest.lstrip()) + 1
        token = _TOKEN.match(self._text, self._next)
        if token is not None:
            self.kind = token.lastgroup or ""
            self.word = token[self.kind]
            self._next = token.end()
        elif rest.strip():
            raise self.wrong(f'"{brief(rest.strip()[0])}" is not part of a condition')
        else:
            self.kind = self.word = ""

    def any_of(self, depth: int) -> Condition:
        parts = [self.all_of(depth)]
        while self._is("or"):
            self.step()
            parts.append(self.all_of(depth))
        return parts[0] if len(parts) == 1 else Or(tuple(parts))

    def all_of(self, depth: int) -> Condition:
        parts = [self.one(depth)]
        while self._is("and"):
            self.step()
            parts.append(self.one(depth))
        return parts[0] if len(parts) == 1 else And(tuple(parts))

    def one(self, depth: int) -> Condition:
        if depth == MAX_DEPTH:
            raise self.wrong(f"more than {MAX_DEPTH} brackets and nots within each other")
        if self._is("not"):
            self.step()
            return Not(self.one(depth + 1))
        if self.word == "(":
            self.step()
            inner = self.any_of(depth + 1)
            if self.word != ")":
                raise self.wrong('")" is missing')
            self.step()
            return inner
        if self._is("misfit"):
            self.step()
            return Misfit()
        if self._is("mark"):
            self.step()
            return Happened("mark")
        if self._is("event"):
            self.step()
            if self.kind != "name":
                raise self.wrong("the name of an event is missing, such as target_change")
            name = self.word
            self.step()
            return Happened(name)
        return self._compared()

    def _is(self, word: str) -> bool:
        return self.kind == "name" and self.word == word

    def _compared(self) -> Condition:
        if self.kind == "number":
            raise self.wrong("the signal comes first, then the number: speed > 20")
        if self.kind != "name" or self.word in _WORDS:
            what = f'a signal is missing before "{brief(self.word)}"' if self.word else "a signal is missing"
            raise self.wrong(what)
        name, column = self.word, self.column
        self.step()
        if self.kind != "op":
            return Compared(name, "", 0.0, "", column)
        operator = self.word
        if operator == "=":
            raise self.wrong('"=" is no comparison; write ==')
        self.step()
        if self.kind != "number":
            raise self.wrong("a number is missing" + (f' before "{brief(self.word)}"' if self.word else ""))
        value = float(self.word)
        if not math.isfinite(value):
            raise self.wrong(f"{brief(self.word)} is too large")
        unit = self._unit()
        unit_column = self._next - len(unit) + 1
        self.step()
        return Compared(name, operator, value, unit, column, unit_column)

    def _unit(self) -> str:
        """The unit behind a number, if there is one: it may hold signs that are no tokens."""
        match = _UNIT.match(self._text, self._next)
        if match is None or match["unit"] in _WORDS:
            return ""
        self._next = match.end()
        return match["unit"]


def events(condition: Condition) -> set[str]:
    """Names of all events of a condition."""
    if isinstance(condition, Happened):
        return {condition.event}
    return {name for part in _parts(condition) for name in events(part)}


def has_misfit(condition: Condition) -> bool:
    """Whether a condition asks the monitor."""
    return isinstance(condition, Misfit) or any(has_misfit(part) for part in _parts(condition))


def _parts(condition: Condition) -> tuple[Condition, ...]:
    if isinstance(condition, Not):
        return (condition.of,)
    return condition.parts if isinstance(condition, And | Or) else ()
