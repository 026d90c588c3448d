"""Escaping of untrusted text for a terminal: names from files must not move the cursor, change colors or forge lines.

Names of vehicles, signals, buses and files are data. On a terminal they are shown visibly escaped; JSON, HTML and CSV
escape them by their own rules.
"""

from __future__ import annotations

import re
import unicodedata

# characters of nearly all text: checked at once
_PLAIN = re.compile(
    r"[\x20-\x7e\u00a1-\u00ac\u00ae-\u02ff\u0370-\u03ff\u2013-\u2027\u2030-\u205e\u2190-\u2bff]*"
)


def terminal_text(text: str) -> str:
    r"""Escape everything in a line of text that a terminal would act on instead of showing it, line feeds included.

    That is whatever Unicode calls not printable: controls (ESC, C1), format characters (directional overrides, zero
    width), lone surrogates (bytes of a file name that are no text), line and paragraph separators, private and
    unassigned characters. Spaces of all widths stay.

    Example:
        >>> terminal_text("τ 0.4 s · gap"), terminal_text("car\x1b[2J\n\u202egnp")
        ('τ 0.4 s · gap', 'car\\x1b[2J\\n\\u202egnp')
    """
    if _PLAIN.fullmatch(text):
        return text
    return "".join(map(_escaped, text))


def _escaped(character: str) -> str:
    if character.isprintable() or unicodedata.category(character) == "Zs":
        return character
    # as in a string of Python: \x1b, \n, \u202e
    return repr(character)[1:-1]
