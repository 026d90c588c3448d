"""Tables of the pages: every row has the cells of its head, and a head stands alone, so that all of it is rendered."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
RULE = re.compile(r"\s*\|[\s:|-]*-[\s:|-]*\|\s*$")


def cells(line: str) -> int:
    """Bars that part cells: not those in code, nor those that are escaped."""
    return len(re.findall(r"(?<!\\)\|", re.sub(r"`[^`]*`", "", line)))


def faults(text: str) -> list[str]:
    lines = re.sub(r"(?ms)^```.*?^```", lambda block: "\n" * block[0].count("\n"), text).splitlines()
    out = []
    for k, line in enumerate(lines):
        if not RULE.fullmatch(line):
            continue
        before = lines[k - 2].strip() if k > 1 else ""
        if not lines[k - 1].startswith("|") or (before and not before.startswith("<!--")):
            out.append(f"line {k}: the head of the table is not a line of its own")
        rows = [k - 1]
        while rows[-1] + 1 < len(lines) and lines[rows[-1] + 1].startswith("|"):
            rows.append(rows[-1] + 1)
        out += [f"line {row + 1}: {lines[row]}" for row in rows if cells(lines[row]) != cells(line)]
    return out


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_tables_are_rendered_whole(page: Path) -> None:
    """The pages of the repository."""
    assert not faults(page.read_text(encoding="utf-8"))


def test_what_is_not_rendered_is_found() -> None:
    """A head behind a sentence, a bar in a cell, a cell too few."""
    assert not faults("a\n\n| b | c |\n|---|---|\n| `|` | \\| |\n")
    assert len(faults("a. | b | c |\n|---|---|\n| 1 | 2 |\n")) == 1
    assert len(faults("| b | c |\n|---|---|\n| |Δ| | 2 |\n| 1 |\n")) == 2
