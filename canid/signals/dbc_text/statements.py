"""Statements of a DBC text: where each begins and ends, also where quotes or semicolons are missing."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from typing import NamedTuple

from canid.signals.dbc_text.content import Repair
from canid.signals.dbc_text.strings import STRING

_KEYWORDS = (  # noqa: SIM905
    "BA_ BA_DEF_ BA_DEF_DEF_ BA_DEF_DEF_REL_ BA_DEF_REL_ BA_DEF_SGTYPE_ BA_REL_ BA_SGTYPE_ BO_ BO_TX_BU_ BS_ BU_ "
    "BU_BO_REL_ BU_EV_REL_ BU_SG_REL_ CAT_ CAT_DEF_ CM_ ENVVAR_DATA_ EV_ EV_DATA_ FILTER NS_ NS_DESC_ SG_ SG_MUL_VAL_ "
    "SGTYPE_ SGTYPE_VAL_ SIG_GROUP_ SIG_TYPE_REF_ SIG_VALTYPE_ SIGTYPE_VALTYPE_ VAL_ VAL_TABLE_ VERSION"
).split()
_KEYWORD = "(?:" + "|".join(_KEYWORDS) + ")(?![A-Za-z0-9_])"
# a keyword that begins a line: reading goes on there after a defect
_LINE_WITH_KEYWORD = re.compile(rf"\n[ \t]*(?={_KEYWORD})")
_BLANK = re.compile(r"\s*")
_REMARK_LINE = re.compile(r"//[^\n]*\s*")
_AT_KEYWORD = re.compile(_KEYWORD)
# a line of names alone, below NS_, and of lists that are continued on the next line
_WORDS = re.compile(r"\n[ \t]*[A-Za-z_][A-Za-z0-9_]*[ \t]*(?=\n|$)")
_LIST = re.compile(rf'\n(?![ \t]*{_KEYWORD})[ \t]*(?:[A-Za-z_][\w, \t]*(?=\n|$)|[\[("@|][^\n]*)')
# another statement on the same line
_INLINE = re.compile(r'(?:[^"\n]|"[^"\n]*")*?[\s"](?=(?:BO_|SG_|CM_|VAL_)\s)')
_OBJECT = r"(?:BO_\s*\d+|SG_\s*\d+\s+[A-Za-z_]\w*|(?:BU_|EV_)\s*[A-Za-z_]\w*)?"
_COMMENT = re.compile(rf"CM_\s*{_OBJECT}\s*{STRING}\s*;")
_ODD_COMMENT = re.compile(rf'CM_[^"\n;]*{STRING}\s*;')
_STOP = re.compile(rf'[";]|\n(?=[ \t]*{_KEYWORD})')
# a string may go on over lines, but not over the begin of the next statement: its quote is missing
_STRING_STOP = re.compile(rf'(?<!\\)"|\n(?=[ \t]*{_KEYWORD}[ \t])')
_COMMENT_END = re.compile(r'"[ \t]*;[ \t]*(?=\n|$)')
# lines that people write as comments
_REMARK = re.compile(r"[#*;]|/\*|--|==")
# characters of a message's or signal's line; a signal with 60 receivers has 2,000
MAX_LINE = 8_000
# characters of a text that a repair quotes
_QUOTED = 70


class Statement(NamedTuple):
    """One statement, with the line on which it begins."""

    keyword: str  # "" for a line that is none
    line: int
    text: str


class Statements(NamedTuple):
    """A text, divided."""

    statements: list[Statement]
    repairs: list[Repair]


def quoted(text: str) -> str:
    r"""Shorten a text of the file to what a message can quote.

    Example:
        >>> quoted("  BO_  1\tX:\n 8 Y")
        'BO_ 1 X: 8 Y'
    """
    short = " ".join(text[: 4 * _QUOTED].split())
    return short if len(short) <= _QUOTED else short[: _QUOTED - 3] + "..."


def divided(text: str) -> Statements:
    """Divide a DBC text into statements.

    Args:
        text: with line feeds alone.

    Returns:
        The statements, and what was repaired to find their ends: missing semicolons, quotes in comments.

    Example:
        >>> text = divided('CM_ "a "quoted" word";' + chr(10) + "BO_ 1 X: 8 Y")
        >>> [(statement.keyword, statement.line) for statement in text.statements], text.repairs[0].kind
        ([('CM_', 1), ('BO_', 2)], 'comment')
    """
    feeds = [match.start() for match in re.finditer("\n", text)]
    repairs: list[Repair] = []
    statements = [
        Statement(keyword, bisect_right(feeds, begin - 1) + 1, text[begin:end])
        for keyword, begin, end in _spans(text, feeds, repairs)
    ]
    return Statements(statements, repairs)


def _spans(text: str, feeds: list[int], repairs: list[Repair]) -> Iterator[tuple[str, int, int]]:
    position = 0
    while True:
        position = _repeated(_REMARK_LINE, text, _matched(_BLANK, text, position))
        if position >= len(text):
            return
        at = _AT_KEYWORD.match(text, position)
        begin, keyword = position, at[0] if at else ""
        position, problem = _end(text, begin, keyword)
        if problem:
            line = bisect_right(feeds, begin - 1) + 1
            repairs.append(Repair(line, *problem[:1], quoted(text[begin:position]), problem[1]))
        yield keyword, begin, position


def _end(text: str, begin: int, keyword: str) -> tuple[int, tuple[str, str] | None]:
    """Where a statement ends, and what is repaired by that: kind and fix."""
    line = _line_end(text, begin)
    if keyword in ("BO_", "SG_"):
        inline = _INLINE.match(text, begin + 3, min(line, begin + MAX_LINE))
        if inline is not None:
            return inline.end(), None
    if keyword in ("BO_", "SG_", "BU_"):
        return _repeated(_LIST, text, line), None
    if keyword == "NS_":
        return _repeated(_WORDS, text, line), None
    if keyword in ("BS_", "VERSION", ""):
        return line, None
    if keyword != "CM_":
        end = _behind_semicolon(text, begin)
        if end:
            return end, None
    elif whole := _COMMENT.match(text, begin):
        return whole.end(), None
    elif odd := _ODD_COMMENT.match(text, begin):
        return odd.end(), ("comment", "a comment on nothing that a DBC has")
    following = _LINE_WITH_KEYWORD.search(text, begin)
    last = following.start() if following else len(text)
    if keyword == "CM_":
        close = _COMMENT_END.search(text, begin, last)
        if close is not None:
            return close.end(), ("comment", "a comment that ends at the last quote before its semicolon")
        return last, ("comment", "a comment that ends before the next statement")
    return last, ("semicolon", "a statement that ends before the next one")


def _behind_semicolon(text: str, begin: int) -> int:
    """Where a statement ends with its semicolon, one in a string not counted; 0: it has none."""
    position = begin
    while stop := _STOP.search(text, position):
        if stop[0] == ";":
            return stop.end()
        close = _STRING_STOP.search(text, stop.end()) if stop[0] == '"' else None
        if close is None or close[0] != '"':
            return 0
        position = close.end()
    return 0


def _line_end(text: str, begin: int) -> int:
    end = text.find("\n", begin)
    return len(text) if end < 0 else end


def _matched(pattern: re.Pattern[str], text: str, at: int) -> int:
    match = pattern.match(text, at)
    return match.end() if match else at


def _repeated(pattern: re.Pattern[str], text: str, at: int) -> int:
    """As the pattern repeated: `(...)*` would remember every repetition, some hundred bytes each."""
    while (match := pattern.match(text, at)) and match.end() > at:
        at = match.end()
    return at


def is_remark(line: str) -> bool:
    """Whether a line that is no statement was written as a comment.

    Example:
        >>> is_remark("# radar"), is_remark("B0_ 12 RADAR: 8 XXX")
        (True, False)
    """
    return _REMARK.match(line) is not None
