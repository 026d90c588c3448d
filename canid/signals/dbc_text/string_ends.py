r"""Strings of a DBC whose last character is a backslash, such as the folder C:\logs\ or half of a character.

The grammar of a DBC has no escapes; writers use `\"` for a quote within a text, and parsers read it so. Where what follows
can only stand behind a string, the backslash is the text's own.
"""

from __future__ import annotations

import re

_KEYWORD = r"(?:[A-Z][A-Z_]{1,18}_|VERSION|FILTER)(?![A-Za-z0-9_])"
# stands for the backslash at the end of a string while the text is parsed: of the private use area
_MARK = "\ue05c"
# what follows a string, and nothing else: the end of the statement; the next entry of a value table or of a list; in the
# line of a signal its receivers
_FOLLOWS = re.compile(
    rf"""
      [ \t]*;[ \t]*(?:\n\s*)?(?:\Z|{_KEYWORD}|//)
    | \s+[-+]?(?:0[xX][0-9a-fA-F]{{1,16}}|\d[0-9.eE+-]{{0,40}})[ \t]*"
    | \s*,\s*"
    | [ \t]*\n\s*(?:\Z|{_KEYWORD})
    """,
    re.VERBOSE,
)
_RECEIVERS = re.compile(r"[ \t]+[A-Za-z_][\w, \t]*(?:\n|\Z)")
_ESCAPED = re.compile(r'\\"')
_SIGNAL = re.compile(r"[ \t]*SG_[ \t]")


def marked(text: str) -> str:
    r"""Put a mark in place of backslashes at the ends of strings; see `unmarked`.

    Example:
        >>> marked('VAL_ 1 S 0 "a\\" 1 "b" ;').count(_MARK), marked('CM_ "a \\"b\\" c";').count(_MARK)
        (1, 0)
    """
    if '\\"' not in text:
        return text
    parts: list[str] = []
    begin = 0
    for match in _ESCAPED.finditer(text):
        at = match.end()
        if _FOLLOWS.match(text, at) or (_of_signal(text, match.start()) and _RECEIVERS.match(text, at)):
            parts += [text[begin : match.start()], _MARK, '"']
            begin = at
    return "".join(parts) + text[begin:]


def _of_signal(text: str, at: int) -> bool:
    """Whether a place is in the one string of a signal's line."""
    line = text.rfind("\n", 0, at) + 1
    return _SIGNAL.match(text, line) is not None and text.count('"', line, at) == 1


def unmarked(text: str) -> str:
    r"""The text of a string as the file has it.

    Example:
        >>> unmarked("C:" + _MARK)
        'C:\\'
    """
    return text.replace(_MARK, "\\")
