"""Which parts of a picture there is room for: all in their smallest form first, then larger ones by importance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from canid.ui.terminal.spans import Line


class Section(NamedTuple):
    """A part of the picture in several forms, from the smallest to the largest; the first may be empty."""

    name: str
    forms: tuple[list[Line], ...]


def allocated(
    sections: Sequence[Section], steps: Sequence[tuple[str, int]], height: int
) -> dict[str, list[Line]]:
    """The lines of each section in the largest forms that fit into `height` rows.

    Args:
        sections: in any order; each begins with its first form.
        steps: (name, form), most important first; a step that does not fit is left out, and so are later forms of
            the same section.
        height: rows.

    Example:
        >>> one = Section("K", ([()], [(), (), ()]))
        >>> other = Section("bus", ([], [()]))
        >>> steps = [("bus", 1), ("K", 1)]
        >>> [{name: len(lines) for name, lines in allocated((one, other), steps, rows).items()} for rows in (1, 2, 4)]
        [{'K': 1, 'bus': 0}, {'K': 1, 'bus': 1}, {'K': 3, 'bus': 1}]
    """
    by_name = {section.name: section for section in sections}
    chosen = {section.name: section.forms[0] for section in sections}
    used = sum(map(len, chosen.values()))
    refused = set()
    for name, form in steps:
        section = by_name.get(name)
        if section is None or name in refused or form >= len(section.forms):
            continue
        more = len(section.forms[form]) - len(chosen[name])
        if used + more > height:
            refused.add(name)
            continue
        chosen[name] = section.forms[form]
        used += more
    return chosen
