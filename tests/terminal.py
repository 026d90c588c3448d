"""The terminal view as text."""

from __future__ import annotations

from collections.abc import Sequence

from canid.ui.terminal.spans import Line


def plain(lines: Sequence[Line]) -> str:
    """The text alone, without blanks at the ends of lines."""
    return "\n".join("".join(span.text for span in line).rstrip() for line in lines)
