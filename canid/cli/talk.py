"""What a command says: results on standard output, all else on standard error; the door to the terminal for both.

Whatever passes here may hold names from files; it comes out as plain text in one line (`terminal_text`).
"""

from __future__ import annotations

import sys
from collections.abc import Callable

from canid.views.terminal_text import terminal_text


def talk(text: str) -> None:
    """Say something to the user, in one line on standard error; what becomes of it ends nothing."""
    _line(sys.stderr, f"canid: {text}")


def tell(text: str) -> None:
    """Write one line of a result to standard output."""
    _line(sys.stdout, text)


def teller(json: str | None) -> Callable[[str], None]:
    """Choose where lines of a result go: where JSON takes standard output, to standard error."""
    return talk if json == "-" else tell


def _line(stream: object, text: str) -> None:
    if stream is not None:  # a program that uses canid as a library may have none
        stream.write(terminal_text(text) + "\n")  # type: ignore[attr-defined]
        stream.flush()  # type: ignore[attr-defined]
