"""A question of `canid init` on a terminal: which of several signals is a role's."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence

from canid.analysis.proposal.choice import Choice
from canid.ui.terminal.messages import info
from canid.ui.views.look_text import sparkline
from canid.values.roles import ROLES

# candidates that a list shows; later ones have hardly more than a similar name
_MOST_SHOWN = 6
_SPARK_CHARS = 32


def asked(role: str, choices: Sequence[Choice], read: Callable[[], str] | None = None) -> int | None:
    """Ask on standard error; the answer is a line of standard input.

    Args:
        role: of the signals.
        choices: the best first.
        read: gives a line; None: of standard input. An empty text is the end of the input.

    Returns:
        The index of the chosen one (Enter takes the first); None for none of them, and at the end of the input.
    """
    shown = choices[:_MOST_SHOWN]
    info(f"{role}: {ROLES[role].meaning}. Which signal is it?")
    for number, choice in enumerate(shown, 1):
        info(f"  {number}  {line(choice)}")
    info("  0  none of these")
    while True:
        sys.stderr.write(f"canid: number (Enter: 1; 0 to {len(shown)}): ")
        sys.stderr.flush()
        answer = (read or sys.stdin.readline)()
        text = answer.strip().lower()
        if not answer or text in ("0", "none", "n"):
            return None
        if not text:
            return 0
        if text.isdecimal() and len(text) <= 2 and 1 <= int(text) <= len(shown):
            return int(text) - 1
        info(f"{text[:20]!r} is not a number from 0 to {len(shown)}")


def line(choice: Choice) -> str:
    """What is known of a candidate: message and signal, unit, what the log shows."""
    candidate = choice.candidate
    parts = [candidate.where, f'"{candidate.signal.unit}"']
    if choice.values is not None:
        parts.append(sparkline(choice.values, _SPARK_CHARS))
    if math.isfinite(choice.low):
        parts.append(f"{choice.low:.4g} to {choice.high:.4g} {ROLES[candidate.role].unit}".rstrip())
    return "  ".join([*parts, "; ".join(choice.remarks)]).rstrip()
