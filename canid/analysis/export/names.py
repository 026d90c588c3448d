"""Names of messages and signals, made harmless for file names, for MATLAB, and for headers."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from canid.values.terminal_text import terminal_text

# of a part of a file name: whole names have 255 bytes on usual file systems
MAX_FILE_PART = 80
# MATLAB's namelengthmax
MAX_MATLAB_NAME = 63
# characters of a header cell
MAX_HEADER = 200
# MATLAB's iskeyword
_MATLAB_WORD = re.compile(
    "break|case|catch|classdef|continue|else|elseif|end|for|function|global|if|otherwise|parfor|persistent|return|"
    "spmd|switch|try|while"
)


def file_part(name: str) -> str:
    r"""Part of a file name: ASCII letters, digits, `_`, `-` and dots between them.

    Example:
        >>> file_part("../../etc/passwd"), file_part("GEAR\x1b[2J.bus1"), file_part("")
        ('etc_passwd', 'GEAR_2J.bus1', '_')
    """
    return re.sub(r"[^A-Za-z0-9_.-]+|\.{2,}", "_", name).strip("._-")[:MAX_FILE_PART] or "_"


def matlab_name(name: str) -> str:
    """Name of a variable or field that MATLAB takes.

    Example:
        >>> matlab_name("2nd.gear"), matlab_name("end"), matlab_name("τ")
        ('x2nd_gear', 'end_', 'x_')
    """
    plain = re.sub(r"[^A-Za-z0-9_]+", "_", name)[:MAX_MATLAB_NAME]
    if not plain[:1].isalpha():
        plain = f"x{plain}"[:MAX_MATLAB_NAME]
    return f"{plain}_" if _MATLAB_WORD.fullmatch(plain) else plain


def header(name: str, unit: str = "") -> str:
    r"""Name and unit as one visible line; what a spreadsheet would run as a formula is made plain text.

    Example:
        >>> header("gap", "m"), header("learn"), header("=1+1\n", "%")
        ('gap [m]', 'learn', "'=1+1\\n [%]")
    """
    text = terminal_text(f"{name} [{unit}]" if unit else name)[:MAX_HEADER]
    return disarmed(text)


def disarmed(text: str) -> str:
    """Put an apostrophe before text that a spreadsheet would run as a formula.

    Example:
        >>> disarmed("=HYPERLINK(1)"), disarmed("D")
        ("'=HYPERLINK(1)", 'D')
    """
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text


def unique(names: Iterable[str], made: Callable[[str], str], taken: Iterable[str] = ()) -> list[str]:
    """Make each name harmless, and no two the same; case does not make a difference.

    Example:
        >>> unique(["a.b", "A_B", "c"], matlab_name)
        ['a_b', 'A_B_2', 'c']
    """
    used = {name.lower() for name in taken}
    out = []
    for name in names:
        plain = candidate = made(name)
        k = 1
        while candidate.lower() in used:
            k += 1
            ending = f"_{k}"
            candidate = (
                plain[: MAX_MATLAB_NAME - len(ending)] + ending if made is matlab_name else plain + ending
            )
        used.add(candidate.lower())
        out.append(candidate)
    return out
