"""Regular expressions of the package mean the same on every Python that canid supports."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Behind a group Python before 3.11.5 matches them wrongly (gh-106052): on Debian 12, 3.11.2, signals of a repaired DBC
# were lost. `(?=(?P<x>...))(?P=x)` says the same; behind a character or a set they are right.
POSSESSIVE_GROUP = re.compile(r"\)(?:[*+?]|\{\d*,?\d*\})\+")


def possessive(source: str) -> list[str]:
    """The texts of a source, parts of f-strings too, that hold a possessive quantifier behind a group."""
    return [
        node.value
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and POSSESSIVE_GROUP.search(node.value)
    ]


def test_no_group_is_possessive() -> None:
    found = {
        str(path.relative_to(ROOT)): texts
        for package in ("canid", "canid_study")
        for path in sorted((ROOT / package).rglob("*.py"))
        if (texts := possessive(path.read_text(encoding="utf-8")))
    }
    assert found == {}


@pytest.mark.parametrize("source", ["r'(?:a|b)*+'", "rf'{x}(?:a)++;'", "'(a){2,3}+'", "'(a)?+'"])
def test_one_would_be_found(source: str) -> None:
    assert possessive(source)
    assert not possessive(source.replace(")", ")x"))
