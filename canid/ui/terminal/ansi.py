"""A picture as the characters that draw it on a terminal (ECMA-48), whole and from its first row on."""

from __future__ import annotations

from collections.abc import Sequence

from canid.ui.terminal.spans import Line, width

# the alternate screen, cleared; no cursor; a line that is too long is cut off instead of moving the others
ENTER = "\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[H\x1b[J"
LEAVE = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"
# a terminal that knows this shows the picture at once (synchronized output); others leave it out
BEGIN, END = "\x1b[?2026h", "\x1b[?2026l"
SGR = {"bold": 1, "dim": 2, "reverse": 7, "red": 31, "green": 32, "yellow": 33, "magenta": 35, "cyan": 36}
# from here on the codes are colors
FIRST_COLOR = 30


def drawn(lines: Sequence[Line], columns: int, *, color: bool) -> str:
    r"""The whole picture, drawn over the one before: nothing is cleared first, so nothing flickers.

    A picture that a stuck terminal never got is repaired by the next one.

    Example:
        >>> from canid.ui.terminal.spans import Span
        >>> drawn([(Span("K", "bold"),)], 80, color=True)
        '\x1b[?2026h\x1b[1;1H\x1b[1mK\x1b[0m\x1b[K\x1b[?2026l'
    """
    out = [BEGIN]
    for row, line in enumerate(lines, 1):
        out.append(f"\x1b[{row};1H")
        for text, style in line:
            codes = _codes(style, color)
            out.append(f"\x1b[{codes}m{text}\x1b[0m" if codes else text)
        if width(line) < columns:  # behind a full line the cursor stands on its last character
            out.append("\x1b[K")
    return "".join((*out, END))


def _codes(style: str, color: bool) -> str:
    known = (SGR[word] for word in style.split())
    return ";".join(str(code) for code in known if color or code < FIRST_COLOR)
