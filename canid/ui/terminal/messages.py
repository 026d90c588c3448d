"""Lines for the user: results on standard output, messages on standard error.

All text that reaches the terminal passes here. It may contain names from files, and comes out as plain text in one line
(`terminal_text`).
"""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Callable

from canid.values.terminal_text import terminal_text


def info(text: str) -> None:
    """Write one line to standard error, on a terminal broken between words; one that cannot be written ends nothing."""
    for line in _fitted(f"canid: {text}"):
        _write_line(sys.stderr, line)


def print_line(text: str) -> None:
    """Write one line of a result to standard output."""
    _write_line(sys.stdout, text)


def print_text(text: str) -> None:
    """Write a text of several lines to standard output."""
    for line in text.splitlines():
        print_line(line)


def line_printer(json: str | None) -> Callable[[str], None]:
    """Where lines of a result go: to standard output, or to standard error where JSON takes standard output."""
    return info if json == "-" else print_line


def _fitted(text: str) -> list[str]:
    """The same in lines of the terminal's columns; a path stays whole. One line where standard error is no terminal."""
    if sys.stderr is None or not sys.stderr.isatty():
        return [text]
    columns = shutil.get_terminal_size().columns
    whole = textwrap.TextWrapper(
        columns, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    )
    return whole.wrap(terminal_text(text)) or [""]


def _write_line(stream: object, text: str) -> None:
    if stream is not None:  # a program that uses canid as a library may have none
        stream.write(terminal_text(text) + "\n")  # type: ignore[attr-defined]
        stream.flush()  # type: ignore[attr-defined]
