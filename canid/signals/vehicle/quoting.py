"""Quoting of texts and values of a vehicle file or a DBC in a sentence: printable, on one short line."""

from __future__ import annotations

import reprlib

# characters; the longest name that a DBC may have is 32, by its extension 128
MAX_QUOTED_LENGTH = 80

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = MAX_QUOTED_LENGTH
_SHORT.maxlong = 30
_SHORT.maxlevel = 2
_SHORT.maxdict = _SHORT.maxlist = _SHORT.maxtuple = 4


def brief(text: str) -> str:
    r"""Cut a text, and escape characters that are not printable.

    Example:
        >>> brief("ENGINE_DATA"), brief("a" + chr(10) + "b"), len(brief("x" * 10**6))
        ('ENGINE_DATA', 'a\\nb', 80)
    """
    if len(text) > MAX_QUOTED_LENGTH:
        keep = (MAX_QUOTED_LENGTH - 3) // 2
        text = f"{text[: MAX_QUOTED_LENGTH - 3 - keep]}...{text[-keep:]}"
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def shown(value: object) -> str:
    """Spell a value of a TOML file, cut.

    Example:
        >>> shown(-60), shown("a" * 200)[:4], shown([[1, [2, [3]]]] * 9)
        ('-60', "'aaa", '[[1, [...]], [1, [...]], [1, [...]], [1, [...]], ...]')
    """
    try:
        return brief(_SHORT.repr(value))
    except ValueError:  # an integer of more digits than Python prints
        return "a number of thousands of digits"


def several(names: list[str], most: int = 5) -> str:
    """List names, the first few of many.

    Example:
        >>> several(["a", "b"]), several(["a", "b", "c", "d"], 2)
        ('a, b', 'a, b and 2 more')
    """
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(brief, names[:most])) + rest
