"""Glob patterns of paths as regular expressions: *, ?, [...] within a name, ** over folders."""

from __future__ import annotations

import re

WILD = frozenset("*?[")


def is_pattern(words: str) -> bool:
    """Whether a word has wildcards.

    Example:
        >>> is_pattern("a/*.blf"), is_pattern("a/b.blf")
        (True, False)
    """
    return bool(WILD & set(words))


def parted(pattern: str) -> tuple[str, list[str]]:
    """Split into the folders before the first wildcard, and the names after them.

    Example:
        >>> parted("/data/2019/*/a*.blf"), parted("*.blf")
        (('/data/2019', ['*', 'a*.blf']), ('', ['*.blf']))
    """
    names = pattern.split("/")
    first = next((i for i, name in enumerate(names) if is_pattern(name)), len(names))
    fixed = "/".join(names[:first])
    return ("/" if first == 1 and names[0] == "" else fixed), [name for name in names[first:] if name]


def of_names(names: list[str]) -> re.Pattern[str]:
    """A pattern, split into names, as an expression for whole relative paths.

    Example:
        >>> found = of_names(["**", "a*.blf"])
        >>> bool(found.fullmatch("x/y/ab.blf")), bool(found.fullmatch("a.blf")), bool(found.fullmatch("x/b.blf"))
        (True, True, False)
    """
    parts = []
    for i, name in enumerate(names):
        last = i == len(names) - 1
        if name == "**":
            parts.append(r".*" if last else r"(?:[^/]+/)*")
        else:
            parts.append(_name(name) + ("" if last else "/"))
    return re.compile("".join(parts), re.DOTALL)


def of_name(name: str) -> re.Pattern[str]:
    """A pattern of one name, without folders.

    Example:
        >>> bool(of_name("[!a]?.blf").fullmatch("b1.blf")), bool(of_name("[").fullmatch("["))
        (True, True)
    """
    return re.compile(_name(name), re.DOTALL)


def _name(name: str) -> str:
    """A stretch between two * is found at its first place and kept there: patterns of many * stay linear."""
    stretches = _stretches(name)
    if len(stretches) == 1:
        return stretches[0]
    first, *middle, last = stretches
    return first + "".join(f"(?>[^/]*?{stretch})" for stretch in middle if stretch) + f"[^/]*{last}"


def _stretches(name: str) -> list[str]:
    """What stands before, between and after the *, as expressions; a * within [...] is one of its characters."""
    out, at = [""], 0
    while at < len(name):
        char = name[at]
        end = name.find("]", at + 2 + (name[at + 1 : at + 2] == "!")) if char == "[" else -1
        if char == "*":
            out.append("")
        elif char == "?":
            out[-1] += "[^/]"
        elif end > 0:
            out[-1] += _set(name[at + 1 : end])
            at = end
        else:
            out[-1] += re.escape(char)
        at += 1
    return out


def _set(inside: str) -> str:
    negated = inside.startswith("!")
    items = inside.removeprefix("!")
    out, at = [], 0
    while at < len(items):
        if items[at + 1 : at + 2] == "-" and at + 2 < len(items):
            low, high = items[at], items[at + 2]
            # a range that runs backwards holds nothing
            out += [f"{re.escape(low)}-{re.escape(high)}"] if low <= high else []
            at += 3
        else:
            out.append(re.escape(items[at]))
            at += 1
    if not out:
        return "[^/]" if negated else "(?!)"
    return f"(?!/)[{'^' if negated else ''}{''.join(out)}]"
